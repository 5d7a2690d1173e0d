//! Settings and calibration in the image's flash: set, saved, disturbed, and loaded at the next
//! start.

use std::collections::BTreeSet;

use ldc161x_sim::Settings as ChipSettings;
use palpate_emulator::{EmulatedBoard, FlashOperation, FlashOperationKind, Options, Plant, Still};
use palpate_emulator::{FlashTimes, Time};
use palpate_wire::code::{
    Drift, FaultCode, Outcome, RebootTarget, StorageAction, StorageState, Stream, TipShape,
};
use palpate_wire::command::{
    Attraction, CalibrationIdentity, ContactTolerance, Creep, Crosstalk, DeformationCurve,
    DeformationKnot, KNOTS_PER_CHUNK, Reboot, Settings, Springs, Stiffening, Tank,
    TemperatureCoefficients, TemperatureEffect, Tip,
};
use palpate_wire::{Command, Record, configuration_crc, record};

use super::{FREQUENCIES_HZ, RecordedBoard, coil, image, recording};

/// Range of the area for settings and calibration, from the start of the flash: its last 64 KiB.
pub(crate) const AREA: std::ops::Range<u32> = 0x1F_0000..0x20_0000;

/// Longer than any save takes at the longest times of the flash.
pub(crate) const LONGEST_SAVE: Time = Time::from_ms(8_000);
/// Time from a start to samples, including the load of stored data.
const START: Time = Time::from_ms(600);

/// Cycles to fetch a line of flash at a quarter of the processor's clock, as the image reads it:
/// eight flash clocks for address and mode, four to wait, sixteen for the data, and ten additional
/// cycles of the emulated board. An interrupt may have to wait this long.
const MISS_CYCLES: u32 = 10 + 4 * (8 + 4 + 16);

/// Size of the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Amount {
    /// One channel, a curve of six knots: fits one sector.
    Usual,
    /// Four channels, curves of 32 knots: needs two sectors.
    Full,
}

impl Amount {
    const fn channels(self) -> u8 {
        match self {
            Self::Usual => 1,
            Self::Full => 4,
        }
    }

    const fn knots(self) -> u8 {
        match self {
            Self::Usual => 6,
            Self::Full => 32,
        }
    }
}

/// Settings and calibration, in the order in which a PC sends them. Configurations of different
/// numbers differ in every part.
pub(crate) fn configuration(number: u32, amount: Amount) -> Vec<Command> {
    let scale = 1.0 + 0.01 * number as f32;
    let mut commands = vec![Command::SetSettings(settings(number))];
    for channel in 0..amount.channels() {
        commands.push(Command::SetTank(Tank {
            sensor: 0,
            channel,
            capacitance_f: 1e-10 * scale,
            rest_frequency_hz: 3e6 * f64::from(scale),
        }));
    }
    for channel in 0..amount.channels() {
        commands.extend(curve(channel, amount.knots(), scale));
    }
    for channel in 0..amount.channels() {
        commands.push(Command::SetCrosstalk(Crosstalk {
            sensor: 0,
            channel,
            apparent_m_per_a2: 1e-8 * scale,
            growth_per_m: 10.0 * scale,
            uncertainty: 0.01 * scale,
        }));
    }
    commands.extend([
        Command::SetSprings(Springs {
            sensing_n_per_m: 2_000.0 * scale,
            sensing_uncertainty: 0.01,
            actuated_n_per_m: 3_000.0 * scale,
            actuated_uncertainty: 0.01,
            force_scale_uncertainty: 0.01,
            zero_uncertainty_m: 1e-6,
            bend: 0.01,
        }),
        Command::SetStiffening(Stiffening {
            peak_current_a: 10.0,
            rise_at_peak: 0.1 * scale,
            rise_uncertainty: 0.01,
            field_at_peak_t: 0.1,
            field_half_t: 0.5,
        }),
        Command::SetCoil(palpate_wire::command::Coil {
            pad_capacity_j_per_k: 50.0 * scale,
            ..coil()
        }),
        Command::SetAttraction(Attraction {
            attraction_n_per_a2: 1e-3 * scale,
            uncertainty: 0.1,
        }),
        Command::SetTemperatureEffect(TemperatureEffect {
            calibrated_at_c: 23.0 * scale,
            springs_uncertainty_per_k: 1e-3,
            rise_uncertainty_per_k: 1e-3,
        }),
        Command::SetTemperatureCoefficients(TemperatureCoefficients {
            springs_per_k: -1e-3 * scale,
            rise_per_k: 2e-3 * scale,
        }),
        Command::SetContact(ContactTolerance {
            within_m: 1e-3,
            tilt_rad: 2e-3,
            rise_uncertainty: 4e-3,
            zero_uncertainty_m: 2e-6 * scale,
        }),
        Command::SetCreep(Creep {
            sensing: 0.01 * scale,
            actuated: 0.02,
            uncertainty: 0.002,
        }),
    ]);
    let hash = configuration_crc(&commands[1..]);
    let tip = Command::SetTip(Tip {
        shape: TipShape::FlatPin,
        radius_m: 3e-3 * scale,
        radius_uncertainty: 0.01,
        thickness_m: 0.0,
        thickness_uncertainty: 0.0,
        poisson_ratio: 0.5,
        poisson_uncertainty: 0.01,
        support_m_per_n: 0.0,
        support_uncertainty: 0.0,
    });
    // The order is that of the kinds; contact and creep, the last parts so far, come after the tip.
    commands.insert(commands.len() - 2, tip);
    commands.push(Command::SetCalibrationIdentity(CalibrationIdentity {
        id: number,
        calibrated_at_s: 1_795_000_000 + number,
        calibrated_at_c: 23.0,
        hash,
    }));
    commands
}

fn settings(number: u32) -> Settings {
    Settings {
        channels: 1,
        rate_hz: 1_000.0,
        stream: Stream::Samples,
        decimation: 1,
        status_period_s: 0.2 + 0.01 * number as f32,
        contact_noise_m: 2e-7,
        release_m: 5e-6,
        least_press_m: 50e-6,
        steady_m_per_s: 50e-6,
        settling_s: 1.0 + number as f32,
        automatic: false,
        peak_current_a: 10.0,
        end_current_a: 0.0,
        rise_s: 0.01,
        hold_s: 0.03,
        ramps: 12,
        ramp_s: 0.06,
        drift: Drift::Logarithmic,
        drift_time_s: 0.5,
        greatest_error: 0.5,
        load_points: 8,
        greatest_temperature_c: 80.0,
        greatest_energy_j: 40.0,
    }
}

/// Commands with the chunks of a curve.
fn curve(channel: u8, total: u8, scale: f32) -> Vec<Command> {
    let knots: Vec<DeformationKnot> = (0..total)
        .map(|knot| DeformationKnot {
            inductance_change: -2e-3 + 1e-3 * f32::from(knot),
            deformation_m: scale * (-2e-4 + 1e-4 * f32::from(knot)),
        })
        .collect();
    let chunks = knots.chunks(KNOTS_PER_CHUNK).enumerate();
    chunks
        .map(|(index, knots)| {
            Command::SetDeformationCurve(DeformationCurve {
                sensor: 0,
                channel,
                total,
                first: (index * KNOTS_PER_CHUNK) as u8,
                knots: knots.iter().cloned().collect(),
            })
        })
        .collect()
}

pub(crate) fn storage(record: &Record) -> Option<record::Storage> {
    match record {
        Record::Storage(storage) => Some(storage.clone()),
        _ => None,
    }
}

pub(crate) fn hello(record: &Record) -> Option<record::Hello> {
    match record {
        Record::Hello(hello) => Some(hello.clone()),
        _ => None,
    }
}

/// A streaming board with these flash times.
pub(crate) fn streaming_with(flash_times: FlashTimes, seed: u64) -> RecordedBoard {
    let options = Options {
        flash_times,
        seed,
        miss_cycles: MISS_CYCLES,
        ..recording()
    };
    let plant = Still::new(FREQUENCIES_HZ);
    let board = EmulatedBoard::new(image(), plant, ChipSettings::default(), options);
    let mut bench = RecordedBoard::of(board);
    bench.stream();
    bench
}

impl<P: Plant> RecordedBoard<P> {
    pub(crate) fn accepted(&mut self, command: &Command) {
        let answer = self.command(command);
        assert_eq!(answer.outcome, Outcome::Accepted, "{command:?}: {answer:?}");
    }

    pub(crate) fn set(&mut self, commands: &[Command]) {
        for command in commands {
            self.accepted(command);
        }
    }

    /// Sends a command to the storage, and waits for its end.
    pub(crate) fn with_storage(&mut self, command: &Command) -> record::Storage {
        self.accepted(command);
        self.wait_for(LONGEST_SAVE, storage)
            .unwrap_or_else(|| panic!("{command:?} does not end"))
    }

    /// Stores the configuration in force.
    pub(crate) fn store(&mut self) -> record::Storage {
        let stored = self.with_storage(&Command::Store);
        let is_done = stored.succeeded && stored.stored_crc == stored.in_force_crc;
        assert!(is_done && stored.state == StorageState::Whole, "{stored:?}");
        stored
    }

    /// Storage report on request: stored data and data in force.
    pub(crate) fn stored(&mut self) -> record::Storage {
        self.ask(&Command::GetStorage, storage).1
    }

    /// Sets a configuration and stores it.
    pub(crate) fn save(&mut self, commands: &[Command]) -> record::Storage {
        self.set(commands);
        self.store()
    }

    /// Reboots the board by command, and waits until it streams.
    pub(crate) fn reboot(&mut self) -> FoundAtStart {
        self.accepted(&reboot(RebootTarget::Firmware));
        let before = self.board.resets();
        self.board
            .run_until(Time::from_ms(300), |board| board.resets() != before)
            .expect("it starts anew");
        self.started()
    }

    /// Cuts and restores the board's power, and waits until it streams.
    pub(crate) fn cycle_power(&mut self) -> FoundAtStart {
        self.board.cycle_power();
        self.started()
    }

    /// First records of the board after the start of a run.
    pub(crate) fn started(&mut self) -> FoundAtStart {
        // Drops what is left of the previous run's bytes.
        self.board.read_channel(super::DATA);
        self.restart_listening();
        let storage = self
            .wait_for(START, storage)
            .expect("a start says what is stored");
        self.stream();
        let records = self.frames.iter().map(|frame| &frame.message);
        let hello = records.clone().find_map(hello).expect("a start says hello");
        FoundAtStart {
            hello,
            storage,
            settings: self.settings(),
            faults: self.faults(),
        }
    }

    /// Makes the power fail in a flash operation of a command, and starts again. `None` if the
    /// command has fewer operations.
    pub(crate) fn cut_at(&mut self, operation: u64, command: &Command) -> Option<FoundAtStart> {
        self.board.flash_mut().cut_power_at_operation(operation);
        let before = self.board.resets();
        let received = self.frames.len();
        self.send(command);
        let end = self.board.now() + LONGEST_SAVE;
        while self.board.resets() == before {
            self.board.run_for(Time::from_ms(1)).unwrap();
            if self.board.resets() == before {
                self.listen();
                let is_over = |frame: &palpate_wire::Frame<Record>| storage(&frame.message);
                if self.frames[received..].iter().find_map(is_over).is_some() {
                    assert!(self.board.flash_mut().cancel_power_cut());
                    return None;
                }
            }
            assert!(self.board.now() < end, "{command:?} does not end");
        }
        Some(self.started())
    }

    /// Flash operations of a command.
    pub(crate) fn operations_of(&self, command: &Command) -> Vec<FlashOperation> {
        let mut bench = self.clone();
        let before = bench.board.flash().operations().len();
        bench.with_storage(command);
        bench.board.flash().operations()[before..].to_vec()
    }

    /// Written addresses of the area.
    pub(crate) fn written(&self) -> Vec<u32> {
        let flash = self.board.flash();
        AREA.filter(|address| flash.byte(*address) != 0xFF)
            .collect()
    }
}

pub(crate) const fn reboot(target: RebootTarget) -> Command {
    Command::Reboot(Reboot { target })
}

pub(crate) fn erases(operations: &[FlashOperation]) -> usize {
    let is_erase = |of: &&FlashOperation| of.kind != FlashOperationKind::ProgramPage;
    operations.iter().filter(is_erase).count()
}

/// Records of a start.
#[derive(Clone, Debug)]
pub(crate) struct FoundAtStart {
    pub(crate) hello: record::Hello,
    pub(crate) storage: record::Storage,
    /// Settings in force.
    pub(crate) settings: Settings,
    pub(crate) faults: Vec<record::Fault>,
}

impl FoundAtStart {
    /// Whether a configuration is completely in force, stored, and reported so.
    pub(crate) fn is(&self, commands: &[Command]) -> bool {
        let Self {
            hello,
            storage,
            settings,
            faults,
        } = self;
        let crc = configuration_crc(commands);
        let has_settings = |command: &Command| *command == Command::SetSettings(settings.clone());
        let identity = commands.iter().find_map(|command| match command {
            Command::SetCalibrationIdentity(identity) => Some(identity),
            _ => None,
        });
        storage.action == StorageAction::Load
            && storage.succeeded
            && storage.state == StorageState::Whole
            && [
                storage.stored_crc,
                storage.in_force_crc,
                hello.configuration_crc,
            ] == [crc; 3]
            && storage.calibration_id == identity.map(|of| of.id)
            && storage.calibration_hash == identity.map(|of| of.hash)
            && commands.iter().any(has_settings)
            && faults.is_empty()
    }

    /// Whether only the defaults are in force.
    pub(crate) fn is_default(&self) -> bool {
        self.storage.in_force_crc == defaults_crc()
    }
}

/// `configuration_crc` of a board with empty storage.
fn defaults_crc() -> u32 {
    static CRC: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    *CRC.get_or_init(|| streaming_with(FlashTimes::Typical, 1).stored().in_force_crc)
}

/// The one of two configurations that is completely in force and reported so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Which {
    Old,
    New,
    Neither,
}

impl Which {
    pub(crate) fn of(found: &FoundAtStart, old: &[Command], new: &[Command]) -> Self {
        if found.is(old) {
            Self::Old
        } else if found.is(new) {
            Self::New
        } else {
            Self::Neither
        }
    }
}

/// A board whose next save must erase: two configurations have been stored one after the other, and
/// a third is set.
#[derive(Clone)]
pub(crate) struct ThirdSave {
    pub(crate) bench: RecordedBoard,
    pub(crate) old: Vec<Command>,
    pub(crate) new: Vec<Command>,
    /// Number of flash operations before the save.
    pub(crate) before: usize,
    /// Flash operations of the save.
    pub(crate) operations: Vec<FlashOperation>,
}

impl ThirdSave {
    pub(crate) fn prepared(amount: Amount, flash_times: FlashTimes, seed: u64) -> Self {
        let mut bench = streaming_with(flash_times, seed);
        let [first, old, new] = [1, 2, 3].map(|number| configuration(number, amount));
        bench.save(&first);
        bench.save(&old);
        bench.set(&new);
        let operations = bench.operations_of(&Command::Store);
        assert!(erases(&operations) > 0, "a third save erases");
        Self {
            before: bench.board.flash().operations().len(),
            bench,
            old,
            new,
            operations,
        }
    }

    /// Result of a power cut in an operation of the save, with the board.
    pub(crate) fn cut(&self, operation: u64) -> (Which, RecordedBoard, FoundAtStart) {
        let mut bench = self.bench.clone();
        let found = bench
            .cut_at(operation, &Command::Store)
            .expect("the save has that operation");
        let which = Which::of(&found, &self.old, &self.new);
        (which, bench, found)
    }

    /// Result of a second power cut, in an operation of the next save, of the configuration that is
    /// not in force. `None` if that save has fewer operations.
    pub(crate) fn cut_again(
        &self,
        recovered: &RecordedBoard,
        active_configuration: Which,
        operation: u64,
    ) -> Option<(Which, FoundAtStart)> {
        let mut bench = recovered.clone();
        bench.set(match active_configuration {
            Which::New => &self.old,
            Which::Old | Which::Neither => &self.new,
        });
        let found = bench.cut_at(operation, &Command::Store)?;
        Some((Which::of(&found, &self.old, &self.new), found))
    }
}

/// Effect of a flipped bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum BitFlip {
    /// Everything is in force as stored.
    Corrected,
    /// The board reports a fault and uses the defaults.
    Found,
    /// Neither: other data are in force, or the fault is missing.
    Silent,
}

/// Inverts a bit of the stored data, and starts the board with it.
pub(crate) fn flip(bench: &RecordedBoard, stored: &[Command], address: u32, bit: u8) -> BitFlip {
    let mut bench = bench.clone();
    bench.board.flash_mut().flip_bit(address, bit);
    let found = bench.cycle_power();
    let is_damage = |fault: &record::Fault| fault.active && fault.code == FaultCode::StorageDamaged;
    if found.is(stored) {
        BitFlip::Corrected
    } else if found.is_default() && found.faults.iter().any(is_damage) {
        BitFlip::Found
    } else {
        BitFlip::Silent
    }
}

/// Some numbers of a range, including its ends.
pub(crate) fn spread(count: u64, of: u64) -> BTreeSet<u64> {
    let last = of.saturating_sub(1);
    let steps = count.saturating_sub(1).max(1);
    (0..count).map(|index| index * last / steps).collect()
}
