//! Readings that a bound counts, and its assumptions.

/// Steps from all information of the sensor down to the information that the chain uses: the
/// readings counted, and the assumed knowledge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InformationLevel {
    /// The sensor is known exactly; all readings of a press count.
    SensorKnown,
    /// All readings of bench and press count.
    Everything,
    /// Only conversions within falls count.
    Falls,
    /// The press may also drift, linearly and with the logarithm of time, so creep carries no
    /// information about the load.
    Drifting,
    /// In addition, the coil's own heat carries no information about the temperature coefficients.
    WithoutOwnHeat,
}

impl InformationLevel {
    pub(super) const ALL: [Self; 5] = [
        Self::SensorKnown,
        Self::Everything,
        Self::Falls,
        Self::Drifting,
        Self::WithoutOwnHeat,
    ];

    pub(super) const fn evaluation(self) -> Evaluation {
        match self {
            Self::SensorKnown | Self::Everything => Evaluation::Whole,
            Self::Falls => Evaluation::Falls,
            Self::Drifting | Self::WithoutOwnHeat => Evaluation::FallsWithDrift,
        }
    }
}

/// Use of the conversions of a train.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Evaluation {
    Whole,
    Falls,
    FallsWithDrift,
}

impl Evaluation {
    pub(super) const ALL: [Self; 3] = [Self::Whole, Self::Falls, Self::FallsWithDrift];
}
