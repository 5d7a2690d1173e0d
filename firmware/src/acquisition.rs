//! From settings to a plan for the converter, and from frames to samples in time.

use ldc161x::{
    Acquisition, Channel, Configuration, DriveCode, Frame, Model, Plan, Rate, ReferenceClock,
    Refusal, Request, Sensor, Sequence,
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
/// To read one register: 48 bit times of 2.5 us, and the master's way to it.
pub const REGISTER_US: f32 = 130.0;
/// Between two channels of a scan (datasheet equation 8).
const SWITCH_S: f32 = 692e-9 + 5.0 / SCAN_HZ as f32;
/// Bits of a microsecond's fraction in the learnt period.
const FRACTION: u32 = 16;
/// An interval is one period if it differs by less than a period halved so often.
const TOLERANCE: u32 = 2;
/// A new interval's share in the period, as halvings: the converter shares the crystal with the
/// timer, so that the period is constant and only its value is not known.
const GAIN: u32 = 6;

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
    /// What a frame leaves of that on the bus, in microseconds; less by [`REGISTER_US`] if STATUS is
    /// read with it.
    pub spare_us: f32,
    /// Only one channel is active.
    pub is_single: bool,
    /// From the middle of the first conversion to the frame's edge, in microseconds.
    pub before_edge_us: u32,
    /// From the middle of the first conversion to that of each.
    pub offsets_us: [u16; 4],
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
        let (before_edge_us, offsets_us) = times(&plan.configuration);
        let first = plan.configuration.acquisition.channels().next();
        let scale = plan.configuration.scale(first.unwrap_or_default());
        Ok(Self {
            window_us: (scale.conversion_s() as f32 * 1e6 + 0.5) as u16,
            configuration: plan.configuration,
            period_us: plan.frame_period_ns as f32 / 1e3,
            spare_us: plan.frame_period_ns.saturating_sub(plan.frame_read_ns) as f32 / 1e3,
            is_single,
            before_edge_us,
            offsets_us,
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

/// A frame with its time.
#[derive(Clone, Copy)]
pub struct Sampled {
    /// The words.
    pub frame: Frame,
    /// Middle of its first conversion.
    pub time_us: u64,
    /// From there to the middle of each conversion.
    pub offsets_us: [u16; 4],
    /// How long a conversion takes.
    pub window_us: u16,
    /// Frames that were lost between the last one and this.
    pub missed: u32,
    /// What went before is unknown.
    pub gap: bool,
}

/// The grid of the frames: their period as it is learnt, and what is missing from it.
pub struct Grid {
    /// In parts of a microsecond.
    period: i64,
    last: Option<(u64, u16)>,
    /// Frames of which the edge was counted, but not seen.
    pub unseen: u32,
}

impl Grid {
    /// A grid of which only the planned period is known.
    pub const fn new(period_us: f32) -> Self {
        Self {
            period: (period_us * (1 << FRACTION) as f32) as i64,
            last: None,
            unseen: 0,
        }
    }

    /// The learnt period.
    pub const fn period_us(&self) -> f32 {
        self.period as f32 / (1 << FRACTION) as f32
    }

    /// How many frames have ended since an edge, when its frame was fetched so late: each of them
    /// has overwritten the one before, without an edge of its own.
    pub fn overwritten(&self, late_us: u32) -> u32 {
        if i64::from(late_us) << FRACTION < self.period {
            return 0;
        }
        (late_us as f32 / self.period_us()) as u32
    }

    /// The next edge is the first one of a new grid.
    pub const fn interrupt(&mut self) {
        self.last = None;
    }

    /// Takes the next edge, and returns how many frames are missing before it. The edge counter
    /// is the cross-check: a conversion that overwrites another makes no edge, so that each edge
    /// has to have been seen.
    pub fn missed(&mut self, edge_us: u64, edges: u16) -> u32 {
        let Some((last_us, last_edges)) = self.last.replace((edge_us, edges)) else {
            return 0;
        };
        let passed = u32::from(edges.wrapping_sub(last_edges));
        if edges != 0 && last_edges != 0 {
            self.unseen = self.unseen.wrapping_add(passed.saturating_sub(1));
        }
        let interval_us = edge_us.saturating_sub(last_us);
        // Less than the age of the universe: no bit is lost.
        let more = ((interval_us << FRACTION) as i64).saturating_sub(self.period);
        if more.abs() < self.period >> TOLERANCE {
            self.period += more >> GAIN;
            return 0;
        }
        ((interval_us as f32 / self.period_us() + 0.5) as u32).saturating_sub(1)
    }
}

/// From the middle of a frame's first conversion to its edge, and to the middles of the others:
/// the edge comes at the end of the last one.
fn times(configuration: &Configuration) -> (u32, [u16; 4]) {
    let mut middles = [0.0_f32; 4];
    let mut end_s = 0.0;
    let count = usize::from(configuration.acquisition.channel_count());
    for (place, middle) in middles.iter_mut().enumerate().take(count).rev() {
        let position = u8::try_from(place).unwrap_or_default();
        let Some(channel) = configuration.acquisition.channel_at(position) else {
            continue;
        };
        let conversion_s = configuration.scale(channel).conversion_s() as f32;
        *middle = end_s - conversion_s / 2.0;
        let settings = configuration.channel(channel);
        let periods = settings.settle_count.reference_periods() as f32;
        let settle_s = periods / reference_hz(configuration);
        end_s -= conversion_s + settle_s + SWITCH_S;
    }
    let [first_s, ..] = middles;
    let offsets = middles.map(|middle_s| ((middle_s - first_s) * 1e6 + 0.5) as u16);
    ((-first_s * 1e6 + 0.5) as u32, offsets)
}

fn reference_hz(configuration: &Configuration) -> f32 {
    let (_, nominal_hz, _) = configuration.reference.range_hz();
    nominal_hz as f32
}
