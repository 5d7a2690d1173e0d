//! State of the driver, independent of the bus: shared by the blocking and the asynchronous driver.

use heapless::Vec;

use crate::{
    Acquisition, BusAccess, Channel, Configuration, Frame, Freshness, Marks, Reading, Register,
    Scale, Status, Word,
};

/// Largest number of registers in a frame: STATUS, and DATAx_MSB and DATAx_LSB of four channels,
/// each read twice.
pub(crate) const FRAME_REGISTERS: usize = 1 + 2 * 2 * 4;

/// The registers of a frame.
pub(crate) type RegisterList = Vec<Register, FRAME_REGISTERS>;

/// The registers of a frame in the order of reading: STATUS if it is read, then DATAx_MSB and
/// DATAx_LSB of every active channel. For bus masters that read frames by themselves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameRequest(RegisterList);

impl FrameRequest {
    /// The pointer bytes, one per register: each is written after the target's address, before the
    /// register's two bytes are read.
    pub fn pointers(&self) -> impl Iterator<Item = u8> + '_ {
        self.0.iter().map(|register| register.address())
    }

    /// Number of registers, 2 to 17; each has two bytes.
    pub fn register_count(&self) -> usize {
        self.0.len()
    }
}

/// Which reads release INTB on the chip in use. The datasheet describes both behaviours (8.1.8),
/// and both were measured: `probe_interrupt_release` determines which one the chip has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum InterruptRelease {
    /// Reading the data releases INTB: STATUS is not read, so a frame takes 95 bit times.
    ByData,
    /// Only reading STATUS releases INTB: STATUS is read first in each frame, which takes 142 bit
    /// times. This is assumed until the chip has been probed.
    #[default]
    ByStatusOnly,
}

/// Comparison of one register of the running chip with its expected value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Canary {
    /// The register that was compared and agreed.
    pub register: Register,
    /// Number of the last frame before this round started, if this comparison completed the round
    /// over all registers. Frames up to that number were converted with every register intact.
    pub confirmed: Option<u32>,
}

/// State of the driver.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct DriverState {
    pub(crate) access: BusAccess,
    pub(crate) release: InterruptRelease,
    pub(crate) read_twice: bool,
    /// Configuration that the chip should have.
    pub(crate) requested: Option<Configuration>,
    /// Hertz per unit of each channel's code while the chip runs: computed once, to avoid a
    /// division for every reading.
    units_hz: [f64; 4],
    /// Whether the chip converts as requested, as far as the driver knows.
    pub(crate) running: bool,
    /// Whether a transfer has failed, so that the identity must be checked before the next frame.
    pub(crate) suspect: bool,
    marks: Marks,
    frame_number: u32,
    canary_index: u8,
    /// Number of the last frame before the current round of register comparisons.
    round_began_at: u32,
}

impl DriverState {
    pub(crate) const fn new() -> Self {
        Self {
            access: BusAccess::FramePerTransaction,
            release: InterruptRelease::ByStatusOnly,
            read_twice: false,
            requested: None,
            units_hz: [0.0; 4],
            running: false,
            suspect: false,
            marks: Marks {
                gap: true,
                drive_step: false,
            },
            frame_number: 0,
            canary_index: 0,
            round_began_at: 0,
        }
    }

    /// Stores the requested configuration, and marks the chip as stopped.
    // Not inlined: two arguments are known not to overlap. Of source and destination within the
    // calling future the compiler does not know that.
    #[inline(never)]
    pub(crate) fn request(&mut self, configuration: &Configuration) {
        self.stopped();
        self.requested = Some(*configuration);
    }

    pub(crate) fn stopped(&mut self) {
        self.running = false;
        self.marks.gap = true;
    }

    #[inline(never)]
    pub(crate) fn started(&mut self, configuration: &Configuration) {
        self.requested = Some(*configuration);
        self.units_hz = Channel::ALL.map(|channel| configuration.scale(channel).hz_per_lsb());
        self.running = true;
        self.suspect = false;
        self.marks.gap = true;
        self.canary_index = 0;
        self.round_began_at = self.frame_number;
    }

    pub(crate) fn transfer_failed(&mut self) {
        self.suspect = true;
        self.marks.gap = true;
    }

    /// Marks a gap after frames that were read and discarded.
    pub(crate) fn frames_discarded(&mut self) {
        self.marks.gap = true;
    }

    pub(crate) fn drive_stepped(&mut self) {
        self.marks.drive_step = true;
    }

    /// The registers of the next frame: STATUS first if it is read, then DATAx_MSB before
    /// DATAx_LSB.
    pub(crate) fn frame_registers(&self, acquisition: Acquisition, status: bool) -> RegisterList {
        let mut list = RegisterList::new();
        // `RegisterList` has room for the longest frame, so no push can fail.
        if status {
            let _ = list.push(Register::Status);
        }
        for channel in acquisition.channels() {
            for _ in 0..self.reads() {
                let _ = list.push(Register::DataMsb(channel));
                let _ = list.push(Register::DataLsb(channel));
            }
        }
        list
    }

    /// The registers to read for a frame.
    pub(crate) fn frame_request(&self, configuration: &Configuration) -> FrameRequest {
        let status = self.reads_status();
        FrameRequest(self.frame_registers(configuration.acquisition, status))
    }

    /// Whether a frame starts with STATUS.
    pub(crate) fn reads_status(&self) -> bool {
        self.release == InterruptRelease::ByStatusOnly
    }

    fn reads(&self) -> usize {
        if self.read_twice { 2 } else { 1 }
    }

    /// Assembles a frame from register words in the order of
    /// [`frame_registers`](Self::frame_registers). `asked` is STATUS if it was read earlier, in a
    /// transfer of its own.
    pub(crate) fn assemble(
        &mut self,
        configuration: &Configuration,
        asked: Option<Status>,
        words: &[u16],
        status_included: bool,
    ) -> Frame {
        let (status, data) = match (status_included, words.split_first()) {
            (true, Some((first, rest))) => (Some(Status::from_bits(*first)), rest),
            _ => (asked, words),
        };
        self.frame_number = self.frame_number.wrapping_add(1);
        let marks = core::mem::take(&mut self.marks);
        let mut frame = Frame::new(self.frame_number, marks, status);
        let width = 2 * self.reads();
        let mut rest = data;
        for channel in configuration.acquisition.channels() {
            let Some((pair, later)) = rest.split_at_checked(width) else {
                break;
            };
            rest = later;
            let unit_hz = self.units_hz.get(usize::from(channel.number()));
            let scale = (
                configuration.scale(channel),
                unit_hz.copied().unwrap_or(0.0),
            );
            frame.push(reading(scale, channel, pair, status, marks));
        }
        frame
    }

    /// The register that is compared next, and its expected value.
    pub(crate) fn canary(&self, configuration: &Configuration) -> (Register, u16) {
        configuration
            .register(self.canary_index)
            .unwrap_or((Register::Config, configuration.config(false).to_bits()))
    }

    /// Records that the compared register had its expected value.
    pub(crate) fn canary_lives(
        &mut self,
        configuration: &Configuration,
        register: Register,
    ) -> Canary {
        if self.canary_index < configuration.register_count() {
            self.canary_index += 1;
            return Canary {
                register,
                confirmed: None,
            };
        }
        let confirmed = Some(self.round_began_at);
        self.begin_round();
        Canary {
            register,
            confirmed,
        }
    }

    /// Starts a new round of register comparisons.
    pub(crate) fn begin_round(&mut self) {
        self.canary_index = 0;
        self.round_began_at = self.frame_number;
    }
}

/// Creates one reading from the words of its channel: DATAx_MSB, DATAx_LSB and, if read twice, both
/// again.
fn reading(
    (scale, unit_hz): (Scale, f64),
    channel: Channel,
    words: &[u16],
    status: Option<Status>,
    marks: Marks,
) -> Reading {
    let word = match words {
        [msb, lsb, ..] => Word::from_registers(*msb, *lsb),
        _ => Word::default(),
    };
    // The first read cleared the flags in the chip, so only the codes of the two reads can be
    // compared.
    let agrees = match words {
        [_, _, msb, lsb] => Some(Word::from_registers(*msb, *lsb).code() == word.code()),
        _ => None,
    };
    let freshness = match status {
        None => Freshness::NotAsked,
        Some(status) if status.unread(channel) => Freshness::New,
        Some(_) => Freshness::Repeated,
    };
    // Same formula as `Scale::frequency_hz`.
    let frequency_hz = f64::from(scale.with_offset(word.code())) * unit_hz;
    Reading {
        channel,
        word,
        frequency_hz,
        // Same formula as `Scale::sigma_hz`, with the frequency already computed.
        sigma_hz: scale.relative_sigma(word.code()) * frequency_hz as f32,
        above_quarter_reference: scale.above_quarter_reference(word.code()),
        freshness,
        agrees,
        after_gap: marks.gap,
    }
}
