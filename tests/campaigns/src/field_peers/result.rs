//! Results of the compared programs.

use super::cases::Case;

/// Relative error of the mean field in the core that counts as "equal error".
pub(super) const EQUAL: f64 = 1e-4;

/// Result of a program on one mesh.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PeerResult {
    pub(super) wall_s: f64,
    pub(super) peak_mb: f64,
    pub(super) core_mean_t: f64,
    pub(super) centre_t: f64,
    pub(super) inductance_h: f64,
}

/// One case by all programs; the peers from coarse to fine.
pub(super) struct Compared {
    pub(super) case: Case,
    pub(super) ours: PeerResult,
    /// Result of palpate at 3e-6 with fourth-order elements.
    pub(super) truth: PeerResult,
    pub(super) ngsolve: Vec<PeerResult>,
    pub(super) getdp: Vec<PeerResult>,
}
