//! Scans of a simulated sensor, estimated by the firmware's own procedure.

use palpate_cli::failure::Failure;
use palpate_sim::native::{FIRST_BOOT_ID, default_settings};
use palpate_sim::replay::{ActiveConfiguration, Compared, Replay};
use palpate_sim::touch::{CoilReading, Scan, Sequence, TouchTruth};
use palpate_wire::code::{Board, Chip, Contact, Outcome, ResetCause, TouchVerdict};
use palpate_wire::command::Settings;
use palpate_wire::record::{Acknowledgement, Conversion, Hello, Sample, Touch};
use palpate_wire::{Command, Frame, Header, Message, Record, Sequencer};

/// Channels of a converter.
const CHANNELS: usize = 4;

/// A scan with what the instrument says of it.
#[derive(Clone, Debug)]
pub struct Judged {
    /// What was pressed.
    pub truth: TouchTruth,
    /// The instrument's result.
    pub touch: Touch,
}

/// Estimates the touches of scans, which begin with an untouched sensor, by an array that these
/// commands set.
///
/// # Errors
/// If the procedure refuses the array, or does not estimate each scan.
pub fn judged(
    commands: &[Command],
    scans: &[Scan],
    (sequence, scans_per_s): (&Sequence, f64),
) -> Result<Vec<Judged>, Failure> {
    let mut replay = Replay::default();
    let configuration = ActiveConfiguration {
        hello: hello(),
        settings: Settings {
            channels: 0b1111,
            rate_hz: scans_per_s as f32,
            ..default_settings()
        },
        calibration: commands.to_vec(),
    };
    replay.configure(FIRST_BOOT_ID, configuration);
    let mut sequencer = Sequencer::new(FIRST_BOOT_ID);
    let mut compared = Vec::new();
    let mut take = |time_us, message| {
        let header = sequencer.stamp(time_us);
        compared.extend(replay.take(&Frame { header, message }));
    };
    // The procedure learns the untouched sensor from here on.
    if let Some(command) = commands.last() {
        take(0, accepted(command));
    }
    for scan in scans {
        for (sensor, coils) in scan.coils.chunks(CHANNELS).enumerate() {
            let first_s = coils.first().map_or(0.0, |of| of.time_s);
            let time_us = (1e6 * first_s) as u64;
            take(time_us, sample(sensor as u8, coils, sequence));
        }
        // The replay replaces this touch by the instrument's result.
        let last_s = scan.coils.last().map_or(0.0, |of| of.time_s);
        let unknown = Touch::without_claim(TouchVerdict::Settling);
        take((1e6 * last_s) as u64, Record::Touch(unknown));
    }
    compared.extend(replay.finish());
    let touches = compared.into_iter().filter_map(touch);
    let touches = touches.collect::<Result<Vec<_>, _>>()?;
    if touches.len() != scans.len() {
        let problem = format!("{} of {} scans have a result", touches.len(), scans.len());
        return Err(Failure::Refused(problem));
    }
    let pairs = scans.iter().zip(touches);
    let judged = pairs.map(|(scan, touch)| Judged {
        truth: scan.truth,
        touch,
    });
    Ok(judged.collect())
}

/// The touch among the recomputed records.
fn touch(of: Compared) -> Option<Result<Touch, Failure>> {
    if !matches!(of.frame.message, Record::Touch(_)) {
        return None;
    }
    match of.replayed {
        Ok(Record::Touch(touch)) => Some(Ok(touch)),
        Ok(_) => None,
        Err(pause) => Some(Err(Failure::Refused(format!(
            "no touch is estimated {}",
            pause.meaning()
        )))),
    }
}

fn accepted(command: &Command) -> Record {
    let header = Header {
        boot_id: FIRST_BOOT_ID,
        sequence: 0,
        time_us: 0,
        dropped: 0,
    };
    Record::Acknowledgement(Acknowledgement::new(
        &header,
        command.kind(),
        Outcome::Accepted,
    ))
}

fn sample(sensor: u8, coils: &[CoilReading], sequence: &Sequence) -> Record {
    let first_s = coils.first().map_or(0.0, |of| of.time_s);
    let channels = coils.iter().zip(0_u8..).map(|(coil, channel)| Conversion {
        channel,
        offset_us: (1e6 * (coil.time_s - first_s)) as u16,
        // The result of a conversion: frequency over reference, of 28 bits (datasheet of the LDC1614, eq. 6).
        word: (coil.frequency_hz / sequence.reference_hz * f64::from(1_u32 << 28)) as u32,
        frequency_hz: coil.frequency_hz,
        sigma_hz: 0.0,
        deformation_m: None,
        deformation_sigma_m: None,
        extrapolated: false,
    });
    Record::Sample(Sample {
        sensor,
        missed: 0,
        gap: false,
        channels: channels.collect(),
        contact: Contact::Settling,
        force_n: None,
        force_sigma_n: None,
        current_a: None,
        ripple_a: None,
    })
}

/// A board with two converters.
fn hello() -> Hello {
    Hello {
        minor_version: 0,
        schema_hash: 0,
        firmware_major: 0,
        firmware_minor: 0,
        firmware_patch: 0,
        commit: 0,
        dirty: false,
        simulated: true,
        board: Board::Native,
        unit: 0,
        reset_cause: ResetCause::PowerOn,
        chip: Chip::Ldc161x,
        second_chip: Chip::Ldc161x,
        configuration_crc: 0,
    }
}
