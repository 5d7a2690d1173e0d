//! Converts settings to a plan for the converter.

use ldc161x::{
    Acquisition, Channel, Configuration, DriveCode, ErrorConfig, LimitError, Model, Plan, Rate,
    ReferenceClock, Request, Sequence,
};

use super::parts::Parts;
use super::setpoint::{Scheme, Setpoint};
use crate::board::{BUS_HZ, Clkin, SENSOR};

/// Events that INTB reports: the end of every frame, and a conversion that the watchdog has aborted. The
/// second one is for a sensor that does not oscillate: no conversion of more than 5.2 ms then ends, and
/// INTB would be as silent as with a disconnected converter.
const ERRORS: ErrorConfig = ErrorConfig {
    watchdog_to_interrupt: true,
    ..ErrorConfig::DATA_READY
};
/// Time between two channels of a scan (datasheet equation 8).
const SWITCH_S: f32 = 692e-9 + 5.0 / Clkin::SCAN.hz() as f32;

impl Setpoint {
    /// Returns the converter clock that the setpoint needs.
    #[must_use]
    pub fn clkin(&self) -> Clkin {
        match acquisition(self.channels) {
            Acquisition::Single(_) => Clkin::SINGLE,
            Acquisition::Autoscan(_) => Clkin::SCAN,
        }
    }
}

impl Scheme {
    /// Creates the plan for a setpoint. `with_status`: STATUS is read first in each frame.
    ///
    /// # Errors
    ///
    /// The driver's error if the converter cannot follow the setpoint.
    pub fn new(setpoint: Setpoint, with_status: bool) -> Result<Self, LimitError> {
        let acquisition = acquisition(setpoint.channels);
        let rate = Rate::PerSecond(ceil(setpoint.rate_hz));
        let clock = ReferenceClock::External {
            hz: setpoint.clkin().hz(),
        };
        let request = Request {
            status_reads: with_status,
            bus_hz: BUS_HZ,
            ..Request::new(Model::Ldc1614, clock, acquisition, SENSOR).rate(rate)
        };
        let mut plan: Plan = request.plan()?;
        plan.configuration.errors = ERRORS;
        let Times {
            before_edge_us,
            offsets_us,
            ages_us,
        } = times(&plan.configuration);
        let first = plan.configuration.acquisition.channels().next();
        let scale = plan.configuration.scale(first.unwrap_or_default());
        let scheme = Self {
            setpoint,
            window_us: (scale.conversion_s() as f32 * 1e6 + 0.5) as u16,
            configuration: plan.configuration,
            period_us: plan.frame_period_ns as f32 / 1e3,
            before_edge_us,
            offsets_us,
            ages_us,
            channels: plan.configuration.acquisition.channel_count(),
        };
        // Assumes STATUS, since the other converter on the bus may need it in each frame.
        let parts = Parts::new(&scheme, true);
        if setpoint.shares_bus && !parts.fit() {
            return Err(LimitError::BusTooSlow {
                frame_period_ns: plan.frame_period_ns,
                frame_read_ns: 2 * plan.frame_read_ns,
                most_per_second: (500_000_000 / plan.frame_read_ns.max(1)) as u32,
            });
        }
        Ok(scheme)
    }
}

/// Returns the lowest and the highest whole scan rate that can be requested, in hertz.
pub fn rates_hz(setpoint: Setpoint, with_status: bool) -> [u32; 2] {
    let scheme = |rate_hz: u32| {
        let rate_hz = rate_hz as f32;
        Scheme::new(
            Setpoint {
                rate_hz,
                ..setpoint
            },
            with_status,
        )
    };
    let is_too_fast = |rate_hz| scheme(rate_hz).is_err();
    let highest = first(1, MOST_HZ, is_too_fast).saturating_sub(1);
    let is_kept = |rate_hz| scheme(rate_hz).is_ok_and(|scheme| scheme.is_kept());
    [first(1, highest, is_kept), highest]
}

/// The protocol's highest rate plus one (firmware/wire/src/command/settings.rs).
const MOST_HZ: u32 = 5_001;

/// Returns the smallest number from `low` to `high` for which a monotonic condition holds; `high` if it
/// holds for no smaller one.
fn first(mut low: u32, mut high: u32, holds: impl Fn(u32) -> bool) -> u32 {
    while low < high {
        let middle = low + (high - low) / 2;
        if holds(middle) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

/// Ratio of the parallel resistance, and so of the amplitude, of the fully pressed sensor to that
/// at rest: 6 to 5, since a deformation of 0.4 mm between slabs raises the inductance by a fifth,
/// and the resistance is L/(R C).
const PRESSED: [u32; 2] = [6, 5];

/// Returns the strongest drive that leaves room for a press: the pressed sensor's amplitude, a fifth
/// above that at rest (`PRESSED`), is at most the amplitude at rest with `found`. The converter finds
/// the strongest drive below 1.8 V (datasheet 8.1.5.2); each code is 1.1 to 1.25 times the one below it.
/// At rest the oscillation may be too weak with the returned drive: see [`stronger`].
pub fn with_room(found: DriveCode) -> DriveCode {
    let [pressed, at_rest] = PRESSED;
    let has_room = |code: &DriveCode| {
        u32::from(code.current_ua()) * pressed <= u32::from(found.current_ua()) * at_rest
    };
    let weaker = (0..found.code()).rev().filter_map(DriveCode::new);
    weaker.into_iter().find(has_room).unwrap_or_default()
}

/// Returns the next stronger drive, for an oscillation below 1.2 V.
pub fn stronger(drive: DriveCode) -> DriveCode {
    DriveCode::new(drive.code().saturating_add(1)).unwrap_or(drive)
}

/// Rounds up to a whole number of scans per second.
fn ceil(rate_hz: f32) -> u32 {
    let whole = rate_hz as u32;
    let more = whole as f32 - rate_hz < 0.0;
    (whole + u32::from(more)).max(1)
}

/// Returns one channel alone, or a scan up to the highest channel: the converter has no other sequences.
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

/// Times of the conversions of a scan before its edge; see [`Scheme`].
struct Times {
    before_edge_us: u32,
    offsets_us: [u16; 4],
    ages_us: [f32; 4],
}

/// Returns the times of the conversions; the edge comes at the end of the last one.
fn times(configuration: &Configuration) -> Times {
    let mut middles = [0.0_f32; 4];
    let mut ages_us = [0.0_f32; 4];
    let mut end_s = 0.0;
    let count = usize::from(configuration.acquisition.channel_count());
    let places = middles.iter_mut().zip(&mut ages_us).enumerate();
    for (index, (middle, age_us)) in places.take(count).rev() {
        let position = u8::try_from(index).unwrap_or_default();
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
    // Each time is rounded relative to the edge, so rounding errors do not add up. It is rounded up,
    // since the stamp of an edge is late: by 0.1 to 1.7 us from the edge to its interrupt, less the
    // truncation to whole microseconds. The result is between 1.9 us early and 1.7 us late
    // (docs/evidence/image-starts.md).
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A conversion has at most 65,535 times 16 clocks: 31.46 ms of one channel at 33.3 MHz, 26.2 ms at
    /// 40 MHz. The fourth channel of a scan follows three conversions, and a record represents offsets
    /// up to 65.5 ms. A frame takes 47 bit times per register, a stop, and 10 us of the master.
    #[test]
    fn the_rates_are_those_of_conversion_record_and_bus() {
        for (channels, with_status, [lowest, highest]) in [
            (0b0001, true, [32, 2_693]),
            (0b0100, false, [32, 3_972]),
            (0b0011, false, [20, 2_037]),
            (0b0111, true, [13, 1_176]),
            (0b1111, true, [12, 918]),
            (0b1111, false, [12, 1_031]),
        ] {
            let setpoint = Setpoint {
                channels,
                rate_hz: 0.0,
                shares_bus: false,
            };
            let [low, high] = rates_hz(setpoint, with_status);
            assert_eq!(low, lowest, "{channels:#b}");
            // The converter's RCOUNT is a whole number, so a frame is up to 2 us longer than requested.
            assert!(
                (highest - 9..=highest).contains(&high),
                "{channels:#b}: {high}"
            );
            for (rate, works) in [
                (low - 1, false),
                (low, true),
                (high, true),
                (high + 1, false),
            ] {
                let rate_hz = rate as f32;
                let scheme = Scheme::new(
                    Setpoint {
                        channels,
                        rate_hz,
                        shares_bus: false,
                    },
                    with_status,
                );
                assert_eq!(
                    scheme.is_ok_and(|of| of.is_kept()),
                    works,
                    "{channels:#b} {rate}"
                );
            }
        }
    }

    /// For every found code and any amplitude at which it is found: pressed, the amplitude is at most
    /// 1.8 V with the returned drive; at rest, it is at least 1.2 V with the next stronger drive.
    #[test]
    fn a_pressed_sensor_has_room_and_one_at_rest_is_not_faint() {
        // The found code is the strongest one below the clamp of 1.8 V; the next code is above it.
        for code in 3..31 {
            let found = DriveCode::new(code).unwrap();
            let drive = with_room(found);
            let [found_ua, next_ua, drive_ua, stronger_ua] =
                [found, stronger(found), drive, stronger(drive)]
                    .map(|of| f64::from(of.current_ua()));
            // Range of the sensor's amplitude at the found code.
            let [low_v, high_v] = [1.8 * found_ua / next_ua, 1.8];
            let pressed_v = 1.2 * high_v * drive_ua / found_ua;
            assert!(pressed_v <= 1.8, "{found}: {pressed_v}");
            let at_rest_v = low_v * stronger_ua / found_ua;
            assert!(at_rest_v >= 1.2, "{found}: {at_rest_v}");
        }
    }
}
