//! From settings to a plan for the converter.

use ldc161x::{
    Acquisition, Channel, Configuration, DriveCode, Model, Plan, Rate, ReferenceClock, Refusal,
    Request, Sensor, Sequence,
};

/// The resonators that the board is made for: 2 to 5 MHz with a quality factor of 50 at most. The
/// parallel resistance only gives the drive to begin with: the converter seeks its own at the start.
const SENSOR: Sensor = Sensor {
    highest_quality_factor: 50,
    lowest_rp_ohm: 3_000,
    highest_rp_ohm: 3_000,
    ..Sensor::new(2_000_000, 5_000_000)
};
/// Clocks of the converter with one channel and with several.
const SINGLE_HZ: u32 = 30_000_000;
const SCAN_HZ: u32 = 40_000_000;
/// Between two channels of a scan (datasheet equation 8).
const SWITCH_S: f32 = 692e-9 + 5.0 / SCAN_HZ as f32;

/// What the procedure wants of the converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Active channels: bit n for channel n.
    pub channels: u8,
    /// Scans per second.
    pub rate_hz: f32,
}

/// How the converter is to be run.
#[derive(Clone, Copy)]
pub struct Scheme {
    /// What is written to it.
    pub configuration: Configuration,
    /// From one frame to the next as planned, in microseconds.
    pub period_us: f32,
    /// Only one channel is active.
    pub is_single: bool,
    /// From the middle of the first conversion to the frame's edge, in microseconds.
    pub before_edge_us: u32,
    /// From the middle of the first conversion to that of each.
    pub offsets_us: [u16; 4],
    /// From the end of each conversion to the frame's edge, in microseconds: 0 for the last one.
    pub ages_us: [f32; 4],
    /// How many channels are converted.
    pub channels: u8,
    /// How long a conversion takes, in microseconds.
    pub window_us: u16,
}

impl Scheme {
    /// The scheme for channels and a rate.
    pub fn new(wanted: Wanted) -> Result<Self, Refusal> {
        let acquisition = acquisition(wanted.channels);
        let is_single = matches!(acquisition, Acquisition::Single(_));
        let hz = if is_single { SINGLE_HZ } else { SCAN_HZ };
        let rate = Rate::PerSecond(ceil(wanted.rate_hz));
        let clock = ReferenceClock::External { hz };
        let plan: Plan = Request::new(Model::Ldc1614, clock, acquisition, SENSOR)
            .rate(rate)
            .plan()?;
        let Times {
            before_edge_us,
            offsets_us,
            ages_us,
        } = times(&plan.configuration);
        let first = plan.configuration.acquisition.channels().next();
        let scale = plan.configuration.scale(first.unwrap_or_default());
        Ok(Self {
            window_us: (scale.conversion_s() as f32 * 1e6 + 0.5) as u16,
            configuration: plan.configuration,
            period_us: plan.frame_period_ns as f32 / 1e3,
            is_single,
            before_edge_us,
            offsets_us,
            ages_us,
            channels: plan.configuration.acquisition.channel_count(),
        })
    }

    /// Drives the active channels with what was found for them.
    pub fn drive(&mut self, found: &[Option<DriveCode>; 4]) {
        for (channel, drive) in Channel::ALL.into_iter().zip(found) {
            if let Some(drive) = drive {
                self.configuration.channel_mut(channel).drive = *drive;
            }
        }
    }
}

/// A drive with room for the growth of the parallel resistance when the sensor is pressed. What the
/// converter finds is the strongest below 1.8 V (datasheet 8.1.5.2); one code less is 1.1 to 1.25
/// times less, and a press makes the resistance up to 1.2 times as high.
pub fn with_room(found: DriveCode) -> DriveCode {
    DriveCode::new(found.code().saturating_sub(1)).unwrap_or(found)
}

/// The next whole number of scans per second.
fn ceil(rate_hz: f32) -> u32 {
    let whole = rate_hz as u32;
    let more = whole as f32 - rate_hz < 0.0;
    (whole + u32::from(more)).max(1)
}

/// One channel alone, or a scan up to the highest one: the converter knows no other sequences.
fn acquisition(channels: u8) -> Acquisition {
    let single = match channels {
        0b0010 => Some(Channel::One),
        0b0100 => Some(Channel::Two),
        0b1000 => Some(Channel::Three),
        0b0001 => Some(Channel::Zero),
        _ => None,
    };
    match single {
        Some(channel) => Acquisition::Single(channel),
        None if channels & 0b1000 != 0 => Acquisition::Autoscan(Sequence::ZeroToThree),
        None if channels & 0b0100 != 0 => Acquisition::Autoscan(Sequence::ZeroToTwo),
        None => Acquisition::Autoscan(Sequence::ZeroToOne),
    }
}

/// Where the conversions of a scan lie before its edge; see [`Scheme`].
struct Times {
    before_edge_us: u32,
    offsets_us: [u16; 4],
    ages_us: [f32; 4],
}

/// The edge comes at the end of the last conversion.
fn times(configuration: &Configuration) -> Times {
    let mut middles = [0.0_f32; 4];
    let mut ages_us = [0.0_f32; 4];
    let mut end_s = 0.0;
    let count = usize::from(configuration.acquisition.channel_count());
    let places = middles.iter_mut().zip(&mut ages_us).enumerate();
    for (place, (middle, age_us)) in places.take(count).rev() {
        let position = u8::try_from(place).unwrap_or_default();
        let Some(channel) = configuration.acquisition.channel_at(position) else {
            continue;
        };
        let conversion_s = configuration.scale(channel).conversion_s() as f32;
        *middle = end_s - conversion_s / 2.0;
        *age_us = -end_s * 1e6;
        let settings = configuration.channel(channel);
        let periods = settings.settle_count.reference_periods() as f32;
        let settle_s = periods / reference_hz(configuration);
        end_s -= conversion_s + settle_s + SWITCH_S;
    }
    // Each is rounded by itself against the edge, so that no time is rounded twice; up, since an
    // edge's stamp is late: 0.1 to 1.7 us of its interrupt, less what is cut to whole microseconds. A
    // time is then between 1.9 us early and 1.7 us late (docs/evidence/image-starts.md).
    let before_us = middles.map(|middle_s| (-middle_s * 1e6 + 1.0) as u32);
    let [before_edge_us, ..] = before_us;
    let offset_us = |before_us| u16::try_from(before_edge_us.saturating_sub(before_us));
    Times {
        before_edge_us,
        offsets_us: before_us.map(|before_us| offset_us(before_us).unwrap_or(u16::MAX)),
        ages_us,
    }
}

fn reference_hz(configuration: &Configuration) -> f32 {
    let (_, nominal_hz, _) = configuration.reference.range_hz();
    nominal_hz as f32
}
