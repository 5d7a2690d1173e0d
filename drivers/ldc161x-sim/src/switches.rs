//! Unsettled properties of the silicon, each as a switch.
//!
//! Sources contradict each other, or are silent. Every such property is an enum in this module,
//! with all positions in its `VARIANTS`; a correct driver works in all of them.
//! [`Switches::default`] selects the position that is hardest for the driver, except where the
//! evidence against it is strong; those exceptions say so.

/// Which reads release INTB.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum InterruptRelease {
    /// Only a read of STATUS (list in datasheet 8.1.8; TI in E2E 1032185).
    #[default]
    StatusOnly,
    /// A read of STATUS or of any DATAx_MSB (text of datasheet 8.1.8 and figure 58; Duet's boards).
    StatusOrData,
}

/// Which reads clear UNREADCONVx.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum UnreadCleared {
    /// Only the read of that channel's DATAx_MSB (datasheet 8.1.9).
    DataOnly,
    /// A read of DATAx_MSB or of STATUS, which clears all four (SNOA959 2.1; TI in E2E 884830).
    #[default]
    DataOrStatus,
}

/// Whether STATUS shows events that are not enabled in ERROR_CONFIG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum StatusReporting {
    /// An error or DRDY shows only if its 2INT bit is set (datasheet table 26; seen on an LDC1314).
    #[default]
    OnlyWhenEnabled,
    /// Always; the 2INT bits govern the pin alone (SNOA959 table 1).
    Always,
}

/// Time between two conversions on a single channel, beyond 16 RCOUNT reference clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Overhead {
    /// The part that scales with the reference clock, in its periods.
    pub clocks: f64,
    /// The constant part, nanoseconds.
    pub nanoseconds: f64,
}

impl Overhead {
    /// +11 clocks: 18 intervals of 36.305 ms at 12 MHz and RCOUNT 1512 (measured, eddy-ng issue 3).
    pub const MEASURED: Self = Self {
        clocks: 11.0,
        nanoseconds: 0.0,
    };
    /// +4 clocks (datasheet equation 7).
    pub const EQUATION_7: Self = Self {
        clocks: 4.0,
        nanoseconds: 0.0,
    };
    /// +692 ns + 5 clocks, as if the channel were switched (datasheet equation 8).
    pub const EQUATION_8: Self = Self {
        clocks: 5.0,
        nanoseconds: 692.0,
    };
    /// None (datasheet tables 9 to 12).
    pub const NONE: Self = Self {
        clocks: 0.0,
        nanoseconds: 0.0,
    };
    /// All published overheads, the default first.
    pub const VARIANTS: &'static [Self] = &[
        Self::MEASURED,
        Self::EQUATION_7,
        Self::EQUATION_8,
        Self::NONE,
    ];

    /// The overhead in seconds at a reference frequency in hertz.
    #[must_use]
    pub fn seconds(&self, reference_hz: f64) -> f64 {
        self.clocks / reference_hz + self.nanoseconds * 1e-9
    }
}

impl Default for Overhead {
    fn default() -> Self {
        Self::MEASURED
    }
}

/// Effect on the registers when the chip leaves sleep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SleepExit {
    /// The registers keep their values (datasheet 7.4.2). Default, though the milder one: in the
    /// other position nothing can be measured until it has taken effect.
    #[default]
    Keeps,
    /// The first time, all registers return to their reset values and the chip falls asleep again:
    /// field reports E2E 462858 and 1037151, likely a droop of the supply when the coil starts.
    LosesOnce,
}

/// Value read from the reserved bits 5:0 of CONFIG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ConfigReadback {
    /// As written, 0x2801 after reset (datasheet table 27). Default, though the milder one: TI
    /// calls the other impossible, and only one customer reports it.
    #[default]
    AsWritten,
    /// As zero, 0x2800 after reset (E2E 934126).
    ReservedAsZero,
}

/// The smallest RCOUNT that converts. Below it a conversion ends on time, but with a zero count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum RcountMinimum {
    /// 5 (datasheet table 9).
    Five,
    /// 9 (datasheet table 43: above 8).
    #[default]
    Nine,
}

impl RcountMinimum {
    pub(crate) const fn value(self) -> u16 {
        match self {
            Self::Five => 5,
            Self::Nine => 9,
        }
    }
}

/// Effect of a write to a configuration register while the chip converts. CONFIG.SLEEP_MODE_EN = 1
/// and RESET_DEV always work. The datasheet only says to sleep first (7.4.1, 8.2.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ActiveWrite {
    /// The write is accepted and takes effect from the next conversion on.
    Accepted,
    /// The write is lost.
    Ignored,
    /// The write is accepted, and the current conversion counts wrong. Default: eddy-ng changes the
    /// drive current of a running chip, so writes do arrive.
    #[default]
    CorruptsConversion,
}

/// Bytes read after the two bytes of a register.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BurstRead {
    /// The chip leaves the bus alone, and 0xFF is read (E2E 796435: "just yields a NACK").
    #[default]
    Released,
    /// The same two bytes again.
    Repeats,
    /// The next register.
    AutoIncrement,
}

/// Code of DEGLITCH for 33 MHz. An unassigned code filters at 1 MHz.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Deglitch33 {
    /// b111 (datasheet table 28 and the reset value of MUX_CONFIG).
    #[default]
    Code111,
    /// b011 (datasheet table 45).
    Code011,
}

/// Method of counting; both give words M/N. See "The counter" in the crate's documentation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Counter {
    /// Two gates of 16 RCOUNT reference clocks, one on the rising and one on the falling edges of
    /// the sensor; M and N are the sums. This explains the spread of N in recorded words.
    #[default]
    TwoGates,
    /// One gate; half periods of the sensor in half periods of the reference.
    HalfPeriods,
}

/// Whether reading DATAx_MSB clears its error flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FlagRead {
    /// The flags are cleared (datasheet tables 1 to 7).
    #[default]
    Clears,
    /// The flags stay until the next result of that channel.
    Keeps,
}

/// Whether DATAx_LSB belongs to the DATAx_MSB read before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ShadowLatch {
    /// The read of DATAx_MSB latches both halves (datasheet 7.5.3). Default, though the milder one:
    /// nothing contradicts it.
    #[default]
    OnMsbRead,
    /// DATAx_LSB always belongs to the newest result, so a word can be torn.
    None,
}

/// When the results of an autoscan cycle reach DATAx. With one channel both are equal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Overwrite {
    /// Each result at the end of its own conversion: channel 0 is overwritten long before INTB
    /// falls for the cycle, and a frame that is read late mixes two cycles. Default: no source says
    /// otherwise.
    #[default]
    ByChannel,
    /// All results at the end of the last conversion, with INTB.
    ByScan,
}

/// Effect of a STOP or START within the two bytes of a register.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum EarlyTermination {
    /// None beyond the loss of that access.
    Harmless,
    /// A half-done write is stored as the new high byte with the old low one, and in the next
    /// transaction every byte is shifted by one bit (datasheet 7.5.2: "may corrupt that transaction
    /// and/or the following"; the form of it is a guess).
    #[default]
    CorruptsFollowing,
}

macro_rules! variants {
    ($($kind:ident: [$($variant:ident),+];)+) => {$(
        impl $kind {
            /// All positions of this switch, the default first.
            pub const VARIANTS: &'static [Self] = &[$(Self::$variant),+];
        }
    )+};
}

variants! {
    InterruptRelease: [StatusOnly, StatusOrData];
    UnreadCleared: [DataOrStatus, DataOnly];
    StatusReporting: [OnlyWhenEnabled, Always];
    SleepExit: [Keeps, LosesOnce];
    ConfigReadback: [AsWritten, ReservedAsZero];
    RcountMinimum: [Nine, Five];
    ActiveWrite: [CorruptsConversion, Accepted, Ignored];
    BurstRead: [Released, Repeats, AutoIncrement];
    Deglitch33: [Code111, Code011];
    Counter: [TwoGates, HalfPeriods];
    FlagRead: [Clears, Keeps];
    ShadowLatch: [OnMsbRead, None];
    Overwrite: [ByChannel, ByScan];
    EarlyTermination: [CorruptsFollowing, Harmless];
}

/// Positions of all switches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default))]
pub struct Switches {
    /// Which reads release INTB.
    pub interrupt_release: InterruptRelease,
    /// Which reads clear UNREADCONVx.
    pub unread_cleared: UnreadCleared,
    /// Whether STATUS shows events that are not enabled.
    pub status_reporting: StatusReporting,
    /// Time between two conversions on a single channel.
    pub overhead: Overhead,
    /// Effect on the registers when the chip leaves sleep.
    pub sleep_exit: SleepExit,
    /// Value read from the reserved bits of CONFIG.
    pub config_readback: ConfigReadback,
    /// The smallest RCOUNT that converts.
    pub rcount_minimum: RcountMinimum,
    /// Effect of a write while converting.
    pub active_write: ActiveWrite,
    /// Bytes read after the two bytes of a register.
    pub burst_read: BurstRead,
    /// The code of the widest deglitch filter.
    pub deglitch_33: Deglitch33,
    /// Method of counting.
    pub counter: Counter,
    /// Whether reading clears the flags of a result.
    pub flag_read: FlagRead,
    /// Whether the two halves of a word belong together.
    pub shadow_latch: ShadowLatch,
    /// When the results of an autoscan cycle reach DATAx.
    pub overwrite: Overwrite,
    /// Effect of a broken-off access.
    pub early_termination: EarlyTermination,
}

impl Switches {
    /// The default, followed by every set that differs from it in one switch. Run a driver through
    /// all of them.
    ///
    /// ```
    /// use ldc161x_sim::Switches;
    ///
    /// assert_eq!(Switches::one_at_a_time().next(), Some(Switches::default()));
    /// assert_eq!(Switches::one_at_a_time().count(), 20);
    /// ```
    pub fn one_at_a_time() -> impl Iterator<Item = Self> + Clone {
        core::iter::once(Self::default())
            .chain(moved(InterruptRelease::VARIANTS, |all, to| {
                all.interrupt_release = to
            }))
            .chain(moved(UnreadCleared::VARIANTS, |all, to| {
                all.unread_cleared = to
            }))
            .chain(moved(StatusReporting::VARIANTS, |all, to| {
                all.status_reporting = to
            }))
            .chain(moved(Overhead::VARIANTS, |all, to| all.overhead = to))
            .chain(moved(SleepExit::VARIANTS, |all, to| all.sleep_exit = to))
            .chain(moved(ConfigReadback::VARIANTS, |all, to| {
                all.config_readback = to
            }))
            .chain(moved(RcountMinimum::VARIANTS, |all, to| {
                all.rcount_minimum = to
            }))
            .chain(moved(ActiveWrite::VARIANTS, |all, to| {
                all.active_write = to
            }))
            .chain(moved(BurstRead::VARIANTS, |all, to| all.burst_read = to))
            .chain(moved(Deglitch33::VARIANTS, |all, to| all.deglitch_33 = to))
            .chain(moved(Counter::VARIANTS, |all, to| all.counter = to))
            .chain(moved(FlagRead::VARIANTS, |all, to| all.flag_read = to))
            .chain(moved(ShadowLatch::VARIANTS, |all, to| {
                all.shadow_latch = to
            }))
            .chain(moved(Overwrite::VARIANTS, |all, to| all.overwrite = to))
            .chain(moved(EarlyTermination::VARIANTS, |all, to| {
                all.early_termination = to
            }))
    }
}

/// The defaults with one switch in each of its other positions.
fn moved<T: Copy>(
    variants: &'static [T],
    set: fn(&mut Switches, T),
) -> impl Iterator<Item = Switches> + Clone {
    variants.iter().skip(1).map(move |&position| {
        let mut switches = Switches::default();
        set(&mut switches, position);
        switches
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_position_of_every_switch_is_visited_once() {
        let mut seen = [Switches::default(); 32];
        let mut count = 0;
        for switches in Switches::one_at_a_time() {
            assert!(
                !seen[1..count.max(1)].contains(&switches),
                "twice: {switches:?}"
            );
            seen[count] = switches;
            count += 1;
        }
        let alternatives = 12 + 2 * 2 + 3; // twelve of two, two of three, one of four positions
        assert_eq!(count, 1 + alternatives);
    }

    #[test]
    fn the_default_is_the_first_variant() {
        macro_rules! first_is_default {
            ($($kind:ident),+) => {$( assert_eq!($kind::VARIANTS[0], $kind::default()); )+};
        }
        first_is_default!(
            InterruptRelease,
            UnreadCleared,
            StatusReporting,
            Overhead,
            SleepExit,
            ConfigReadback,
            RcountMinimum,
            ActiveWrite,
            BurstRead,
            Deglitch33,
            Counter,
            FlagRead,
            ShadowLatch,
            Overwrite,
            EarlyTermination
        );
    }
}
