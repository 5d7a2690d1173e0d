//! What the driver knows about the chip, apart from any bus: shared by the blocking and the
//! asynchronous driver.

use heapless::Vec;

use crate::{
    Acquisition, BusAccess, Channel, Configuration, Frame, Freshness, Marks, Reading, Register,
    Scale, Status, Word,
};

/// STATUS, and MSB and LSB of four channels, each read twice.
pub(crate) const FRAME_REGISTERS: usize = 1 + 2 * 2 * 4;

/// The registers of a frame.
pub(crate) type RegisterList = Vec<Register, FRAME_REGISTERS>;

/// The registers of a frame, in the order in which they are read: STATUS where it is, then MSB and
/// LSB of every active channel. For bus masters that read frames by themselves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameRequest(RegisterList);

impl FrameRequest {
    /// What is written before each register's two bytes are read, behind the target's address.
    pub fn pointers(&self) -> impl Iterator<Item = u8> + '_ {
        self.0.iter().map(|register| register.address())
    }

    /// Number of registers, 2 to 17; each has two bytes.
    pub fn register_count(&self) -> usize {
        self.0.len()
    }
}

/// What releases INTB on the chip in hand. The datasheet says both (8.1.8), and so do those who
/// measured: ask the chip with `probe_interrupt_release`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum InterruptRelease {
    /// Reading the data does: STATUS is not read, 95 bit times a frame.
    ByData,
    /// Only reading STATUS does: it is read first in each frame, 142 bit times. Assumed until
    /// the chip was asked.
    #[default]
    ByStatusOnly,
}

/// One register of the running chip compared with what it should hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Canary {
    /// The register that was compared, and agreed.
    pub register: Register,
    /// When this comparison completed the round over all registers: the number of the last
    /// frame before the round began. Frames up to it were converted with every register intact.
    pub confirmed: Option<u32>,
}

/// What the driver remembers.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct DriverState {
    pub(crate) access: BusAccess,
    pub(crate) release: InterruptRelease,
    pub(crate) read_twice: bool,
    /// What the chip should be.
    pub(crate) requested: Option<Configuration>,
    /// One unit of each channel's code in hertz, while it runs: computed once, and not with a
    /// division for every reading.
    units_hz: [f64; 4],
    /// The chip converts as requested, as far as is known.
    pub(crate) running: bool,
    /// A transfer failed: ask for the identity before the next frame is trusted.
    pub(crate) suspect: bool,
    marks: Marks,
    frame_number: u32,
    canary_index: u8,
    /// The last frame before the present round of canaries.
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

    /// Stops, to begin with this.
    // Its references say that the two do not overlap, which the future that awaits does not know.
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

    /// Frames were read and thrown away.
    pub(crate) fn frames_discarded(&mut self) {
        self.marks.gap = true;
    }

    pub(crate) fn drive_stepped(&mut self) {
        self.marks.drive_step = true;
    }

    /// The registers of the next frame: STATUS first where it is read, then MSB before LSB.
    pub(crate) fn frame_registers(&self, acquisition: Acquisition, status: bool) -> RegisterList {
        let mut list = RegisterList::new();
        // The list holds the longest frame there is, so that no push can fail.
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

    /// What is read for a frame.
    pub(crate) fn frame_request(&self, configuration: &Configuration) -> FrameRequest {
        let status = self.reads_status();
        FrameRequest(self.frame_registers(configuration.acquisition, status))
    }

    /// Whether a frame begins with STATUS.
    pub(crate) fn reads_status(&self) -> bool {
        self.release == InterruptRelease::ByStatusOnly
    }

    fn reads(&self) -> usize {
        if self.read_twice { 2 } else { 1 }
    }

    /// Makes a frame of register words in the order of [`frame_registers`](Self::frame_registers).
    /// `asked` is a STATUS that was read before, in a transfer of its own.
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

    /// The register that the next canary compares, and its value.
    pub(crate) fn canary(&self, configuration: &Configuration) -> (Register, u16) {
        configuration
            .register(self.canary_index)
            .unwrap_or((Register::Config, configuration.config(false).to_bits()))
    }

    /// The canary's register agreed.
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

    /// The next canary is the first of a new round.
    pub(crate) fn begin_round(&mut self) {
        self.canary_index = 0;
        self.round_began_at = self.frame_number;
    }
}

/// One reading from the words of its channel: MSB, LSB and, read twice, MSB and LSB again.
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
    // The first read cleared the flags: only the codes can be compared.
    let agrees = match words {
        [_, _, msb, lsb] => Some(Word::from_registers(*msb, *lsb).code() == word.code()),
        _ => None,
    };
    let freshness = match status {
        None => Freshness::NotAsked,
        Some(status) if status.unread(channel) => Freshness::New,
        Some(_) => Freshness::Repeated,
    };
    // as Scale::frequency_hz has it
    let frequency_hz = f64::from(scale.whole(word.code())) * unit_hz;
    Reading {
        channel,
        word,
        frequency_hz,
        // as Scale::sigma_hz has it, without the frequency a second time
        sigma_hz: scale.relative_sigma(word.code()) * frequency_hz as f32,
        above_quarter_reference: scale.above_quarter_reference(word.code()),
        freshness,
        agrees,
        after_gap: marks.gap,
    }
}
