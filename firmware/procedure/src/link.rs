//! The links to PCs.

/// Link to a PC. An answer goes to the link from which its command came; all other records go to all
/// links.
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
