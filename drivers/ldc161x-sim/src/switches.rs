//! Unsettled properties of the silicon, each as a switch.
//!
//! For each of these properties the sources contradict each other, or are silent. Each property is
//! an enum in this module, with all positions in its `VARIANTS`; a correct driver works in all of
//! them. [`Switches::default`] selects the position that is hardest for the driver, except where
//! the evidence against it is strong; those exceptions say so.

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
    /// STATUS shows an error or DRDY only if its 2INT bit is set (datasheet table 26; seen on an
    /// LDC1314).
    #[default]
    OnlyWhenEnabled,
    /// STATUS always shows them; the 2INT bits affect INTB alone (SNOA959 table 1).
    Always,
}

/// Time between two conversions on a single channel, beyond the first one's 16 RCOUNT clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Overhead {
    /// Number of reference clocks.
    pub clocks: f64,
    /// Constant time in addition to the clocks, nanoseconds.
    pub nanoseconds: f64,
}

impl Overhead {
    /// +11 clocks: measured, 18 intervals of 36.305 ms at 12 MHz and RCOUNT 1512 (eddy-ng issue 3).
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
    /// No overhead (datasheet tables 9 to 12).
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
    /// The registers keep their values (datasheet 7.4.2). This is the default although it is easier
    /// for the driver: with `LosesOnce` the chip cannot measure until the loss has occurred.
    #[default]
    Keeps,
    /// The first time, all registers return to their reset values and the chip falls asleep again:
    /// reported in E2E 462858 and 1037151, probably because the supply droops when the coil starts.
    LosesOnce,
}

/// Value read from the reserved bits 5:0 of CONFIG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ConfigReadback {
    /// As written, 0x2801 after reset (datasheet table 27). This is the default although it is
    /// easier for the driver: TI calls the other value impossible, and only one customer reports
    /// it.
    #[default]
    AsWritten,
    /// As zero, 0x2800 after reset (E2E 934126).
    ReservedAsZero,
}

/// The smallest RCOUNT with valid results. With a smaller one a conversion ends on time, but with a
/// zero count.
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
    /// The write is accepted, and the current conversion counts wrong. This is the default: eddy-ng
    /// changes the drive current of a running chip, so writes are not lost.
    #[default]
    CorruptsConversion,
}

/// What a master reads after the two bytes of a register.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BurstRead {
    /// 0xFF, since the chip releases the bus (E2E 796435: "just yields a NACK").
    #[default]
    Released,
    /// The register's two bytes again.
    Repeats,
    /// The bytes of the next register.
    AutoIncrement,
}

/// Code of the 33 MHz filter in MUX_CONFIG.DEGLITCH. An unassigned code filters at 1 MHz.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Deglitch33 {
    /// b111 (datasheet table 28 and the reset value of MUX_CONFIG).
    #[default]
    Code111,
    /// b011 (datasheet table 45).
    Code011,
}

/// How the counter counts; both methods give words 2²⁸ M/N. See "The counter" in the crate's
/// documentation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Counter {
    /// Two gates of 16 RCOUNT reference clocks, one for the rising and one for the falling edges of
    /// the sensor; M and N are sums over both gates. This explains the spread of N in recorded
    /// words.
    #[default]
    TwoGates,
    /// One gate, in which half periods of the sensor and half periods of the reference are counted.
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

/// Whether a read of DATAx_LSB returns the half that belongs to the DATAx_MSB read before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ShadowLatch {
    /// The read of DATAx_MSB latches both halves (datasheet 7.5.3). This is the default although it
    /// is easier for the driver: no source contradicts it.
    #[default]
    OnMsbRead,
    /// DATAx_LSB always belongs to the newest result, so a word may mix two results.
    None,
}

/// When the results of an autoscan cycle reach DATAx. The two positions differ only with several
/// channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Overwrite {
    /// Each result at the end of its own conversion: channel 0 is overwritten long before INTB
    /// falls for the cycle, and a frame that is read late mixes two cycles. This is the default: no
    /// source says otherwise.
    #[default]
    ByChannel,
    /// All results at the end of the last channel's conversion, when INTB falls.
    ByScan,
}

/// Effect of a STOP or START between the two bytes of a register.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum EarlyTermination {
    /// The access is lost, without further effect.
    Harmless,
    /// A half-done write stores the new high byte with the old low one, and in the next transaction
    /// every byte is shifted by one bit. Datasheet 7.5.2 says that it "may corrupt that transaction
    /// and/or the following"; in which way is a guess.
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
    /// The code of the 33 MHz deglitch filter.
    pub deglitch_33: Deglitch33,
    /// Method of counting.
    pub counter: Counter,
    /// Whether reading clears the flags of a result.
    pub flag_read: FlagRead,
    /// Whether a read of DATAx_LSB returns the half that belongs to the DATAx_MSB read before.
    pub shadow_latch: ShadowLatch,
    /// When the results of an autoscan cycle reach DATAx.
    pub overwrite: Overwrite,
    /// Effect of a STOP or START between the two bytes of a register.
    pub early_termination: EarlyTermination,
}

impl Switches {
    /// The default positions, followed by every set that differs from them in one switch. Test a
    /// driver with all of them.
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

/// Sets of switches that differ from the defaults in one switch, for each of its other positions.
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
