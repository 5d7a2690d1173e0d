//! Causes of an error, and the quantities that a bench determines.

/// What an error comes from. The variances of all causes add up to that of the error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cause {
    /// Noise of the conversions, in the press and on the bench.
    Conversions,
    /// Vibration of the stand, in the press and on the bench.
    Vibration,
    /// Creep and memory that no drift follows, in the press and on the bench.
    Creep,
    /// Tolerance of the bench's springs.
    Springs,
    /// Gain of the load cell.
    LoadCell,
    /// Temperature away from the bench's.
    Temperature,
    /// What the cross-talk may have changed by beside its own train.
    Beforehand,
    /// What differs between bench and use and is in no train of the bench.
    Model,
}

impl Cause {
    pub(crate) const ALL: [Self; 8] = [
        Self::Conversions,
        Self::Vibration,
        Self::Creep,
        Self::Springs,
        Self::LoadCell,
        Self::Temperature,
        Self::Beforehand,
        Self::Model,
    ];
    /// Those of a train by itself.
    pub(super) const OF_TRAIN: [Self; 3] = [Self::Conversions, Self::Vibration, Self::Creep];

    /// The heading of its column, and its key in JSON.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Conversions => "conversions",
            Self::Vibration => "vibration",
            Self::Creep => "creep",
            Self::Springs => "springs",
            Self::LoadCell => "load_cell",
            Self::Temperature => "temperature",
            Self::Beforehand => "beforehand",
            Self::Model => "model",
        }
    }
}

/// A quantity that the bench determines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// c_D0.
    ActuatedSpring,
    /// The size of the stiffening.
    Stiffening,
    /// The attraction of the actuated layer's halves.
    Attraction,
    /// The cross-talk without contact.
    Crosstalk,
    /// Its growth with the press.
    CrosstalkGrowth,
}

/// How many there are.
pub(super) const QUANTITIES: usize = 5;

impl Quantity {
    pub(crate) const ALL: [Self; QUANTITIES] = [
        Self::ActuatedSpring,
        Self::Stiffening,
        Self::Attraction,
        Self::Crosstalk,
        Self::CrosstalkGrowth,
    ];

    /// The heading of its column, and its key in JSON.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::ActuatedSpring => "c_D0",
            Self::Stiffening => "stiffening",
            Self::Attraction => "attraction",
            Self::Crosstalk => "crosstalk",
            Self::CrosstalkGrowth => "crosstalk_growth",
        }
    }
}
