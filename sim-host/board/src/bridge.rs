//! The H-bridge with its coil, as the firmware sees it: an ideal source of current.

/// What the pins tell the bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BridgeInputs {
    /// nSLEEP is high.
    pub awake: bool,
    /// The part of the time in which IN1 is high.
    pub forward: f64,
    /// The same of IN2.
    pub backward: f64,
}

/// The bridge: the coil's current is the difference of the two pulse widths times a full scale.
///
/// The lag of the coil, ripple and the supply's limits are left out; a bridge without power, or
/// with both inputs low, carries nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// The current at full pulse width, A.
    pub full_scale_a: f64,
}

impl Default for Bridge {
    fn default() -> Self {
        Self { full_scale_a: 20.0 }
    }
}

impl Bridge {
    /// The coil's current, A.
    #[must_use]
    pub fn current_a(&self, inputs: BridgeInputs) -> f64 {
        if inputs.awake {
            self.full_scale_a * (inputs.forward - inputs.backward)
        } else {
            0.0
        }
    }
}
