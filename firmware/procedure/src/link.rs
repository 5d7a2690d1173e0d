//! The links to PCs.

/// A link to a PC: commands come by it, and their answers go back by it. Everything else that is
/// reported goes to all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// A debug probe (RTT).
    Probe,
    /// USB.
    Usb,
}

impl Link {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Probe, Self::Usb];
}
