//! Which of the readings a bound counts, and what it takes for known.

/// Which of the readings count, and what is known: from what the sensor could tell at most to what the chain makes use of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rung {
    /// Everything of the sensor is known; a press is read as a whole.
    SensorKnown,
    /// Bench and press are read as a whole.
    Everything,
    /// Only the conversions within falls count.
    Falls,
    /// The press may drift, straight and as the logarithm of time, so that creep tells nothing of the load.
    Drifting,
    /// And what the coil's own heat shows of the temperature's coefficients is not used.
    WithoutOwnHeat,
}

impl Rung {
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

/// How the conversions of a train are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Evaluation {
    Whole,
    Falls,
    FallsWithDrift,
}

impl Evaluation {
    pub(super) const ALL: [Self; 3] = [Self::Whole, Self::Falls, Self::FallsWithDrift];
}
