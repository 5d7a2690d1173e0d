//! Causes of an error, and the quantities determined on the bench.

/// Cause of an error. The variances of all causes add up to that of the error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cause {
    /// Noise of the conversions, in the press and on the bench.
    Conversions,
    /// Vibration of the stand, in the press and on the bench.
    Vibration,
    /// Creep and memory beyond the fitted drifts, in the press and on the bench.
    Creep,
    /// Tolerance of the bench's springs.
    Springs,
    /// Gain of the load cell.
    LoadCell,
    /// Temperature difference from the bench.
    Temperature,
    /// Possible change of the cross-talk, by its prior.
    Prior,
    /// Differences between bench and use that no train of the bench contains.
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
        Self::Prior,
        Self::Model,
    ];
    /// The causes within a single train.
    pub(super) const OF_TRAIN: [Self; 3] = [Self::Conversions, Self::Vibration, Self::Creep];

    /// Column heading and JSON key.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Conversions => "conversions",
            Self::Vibration => "vibration",
            Self::Creep => "creep",
            Self::Springs => "springs",
            Self::LoadCell => "load_cell",
            Self::Temperature => "temperature",
            Self::Prior => "prior",
            Self::Model => "model",
        }
    }
}

/// A quantity determined on the bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// c_D0: stiffness of the actuated layer without current.
    ActuatedSpring,
    /// The size of the stiffening.
    Stiffening,
    /// The attraction of the actuated layer's halves.
    Attraction,
    /// The cross-talk without contact.
    Crosstalk,
    /// Growth of the cross-talk with the press.
    CrosstalkGrowth,
}

/// Number of quantities.
pub(super) const QUANTITIES: usize = 5;

impl Quantity {
    pub(crate) const ALL: [Self; QUANTITIES] = [
        Self::ActuatedSpring,
        Self::Stiffening,
        Self::Attraction,
        Self::Crosstalk,
        Self::CrosstalkGrowth,
    ];

    /// Column heading and JSON key.
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
