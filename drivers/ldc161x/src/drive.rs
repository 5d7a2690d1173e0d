//! Sensor drive current: the table of codes, and the code for a sensor's parallel resistance.

use core::fmt;

/// Drive current of each code in microampere (datasheet Table 42; application note SNOA950 lists
/// the same currents).
const DRIVE_CURRENT_UA: [u16; 32] = [
    16, 18, 20, 23, 28, 32, 40, 46, 52, 59, 72, 82, 95, 110, 127, 146, 169, 195, 212, 244, 297,
    342, 424, 489, 551, 635, 763, 880, 1017, 1173, 1355, 1563,
];

/// Peak amplitude in volt above which the ESD clamp conducts and shifts the frequency (datasheet
/// 8.1.5).
pub const HIGHEST_AMPLITUDE_V: f32 = 1.8;
/// Peak amplitude in volt below which the chip raises its low-amplitude flag (datasheet 8.1.5).
pub const LOWEST_CLEAN_AMPLITUDE_V: f32 = 1.2;
/// Peak amplitude in volt below which the oscillation may stop (datasheet 8.1.5).
pub const LOWEST_AMPLITUDE_V: f32 = 0.6;

/// A code of DRIVE_CURRENTx.IDRIVE, 0 to 31.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriveCode(u8);

impl DriveCode {
    /// The strongest drive, 1563 uA.
    pub const STRONGEST: Self = Self(31);

    /// Creates a code from a number, 0 to 31.
    ///
    /// ```
    /// use ldc161x::DriveCode;
    /// assert_eq!(DriveCode::new(17).map(DriveCode::current_ua), Some(195));
    /// assert_eq!(DriveCode::new(32), None);
    /// ```
    pub const fn new(code: u8) -> Option<Self> {
        if code < 32 { Some(Self(code)) } else { None }
    }

    /// Creates a code from the low five bits of a register field.
    pub(crate) const fn from_field(bits: u16) -> Self {
        Self((bits & 0x1F) as u8)
    }

    /// The code as an integer.
    ///
    /// ```
    /// assert_eq!(ldc161x::DriveCode::STRONGEST.code(), 31);
    /// ```
    pub const fn code(self) -> u8 {
        self.0
    }

    /// Nominal drive current in microampere (datasheet Table 42).
    ///
    /// ```
    /// assert_eq!(ldc161x::DriveCode::default().current_ua(), 16);
    /// ```
    pub const fn current_ua(self) -> u16 {
        // The constructors guarantee a code below 32; the mask lets the compiler omit the bounds
        // check.
        DRIVE_CURRENT_UA[(self.0 & 0x1F) as usize]
    }

    /// Peak amplitude in volt across a sensor of parallel resistance `rp_ohm`:
    /// V = 4 I RP / pi (datasheet Equation 12).
    ///
    /// ```
    /// let code = ldc161x::DriveCode::new(17).unwrap();
    /// assert!((code.amplitude_v(6_000) - 1.49).abs() < 0.01);
    /// ```
    pub const fn amplitude_v(self, rp_ohm: u32) -> f32 {
        4.0 / core::f32::consts::PI * self.current_ua() as f32 * 1e-6 * rp_ohm as f32
    }

    /// The strongest code that keeps the amplitude at or below 1.8 V at the highest parallel
    /// resistance that the sensor will have (application note SNOA950). `None` above about 88
    /// kiloohm, where even the weakest drive is too strong: connect 100 kiloohm in parallel
    /// (datasheet 8.1.5).
    ///
    /// ```
    /// use ldc161x::DriveCode;
    /// assert_eq!(DriveCode::strongest_below_clamp(5_000).map(DriveCode::code), Some(19));
    /// assert_eq!(DriveCode::strongest_below_clamp(95_000), None);
    /// ```
    pub const fn strongest_below_clamp(highest_rp_ohm: u32) -> Option<Self> {
        let mut code = Self::STRONGEST;
        loop {
            if code.amplitude_v(highest_rp_ohm) <= HIGHEST_AMPLITUDE_V {
                return Some(code);
            }
            if code.0 == 0 {
                return None;
            }
            code = Self(code.0 - 1);
        }
    }
}

impl fmt::Display for DriveCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "code {} ({} uA)", self.0, self.current_ua())
    }
}
