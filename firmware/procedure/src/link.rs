//! The links to PCs.

/// Link to a PC: an answer goes to the link of its command. All other records go to all links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// A debug probe (RTT).
    Probe,
    /// USB.
    Usb,
}

impl Link {
    /// All links.
    pub const ALL: [Self; 2] = [Self::Probe, Self::Usb];
}
