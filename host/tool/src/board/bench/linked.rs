//! The simulated bench with a board on a link: the emulated board, which is powered on again for
//! each specimen.

use std::collections::VecDeque;
use std::time::Duration;

use palpate_calibration::bench::{Bench, Instrument, Work};
use palpate_calibration::session::{BenchSample, Pressed, Run};
use palpate_cli::failure::Failure;
use palpate_sim::parameters::Parameters;
use palpate_sim::rig::{BareRig, Gauges, RigReading};
use palpate_sim::switches::Switches;
use palpate_sim::thermal::CALIBRATION_C;
use palpate_sim::world::World;
use palpate_simulate::bench::{GaugeReading, bench_sample, mean_bare, on_rig, press};
use palpate_wire::code::Outcome;
use palpate_wire::{Command, Record};

use crate::board::link::Link;
use crate::interrupt::Interrupt;

/// The bench of an emulated board's plant.
pub(crate) struct LinkedBench<'l> {
    link: &'l mut Link,
    plant: &'l Parameters,
    /// Temperature of the bench above that of the calibration, K.
    warmer_k: f64,
    bare: BareRig,
    interrupt: Interrupt,
}

/// Disturbances of the simulated bench: all.
const SWITCHES: Switches = Switches::all();

impl<'l> LinkedBench<'l> {
    pub(crate) fn new(
        link: &'l mut Link,
        plant: &'l Parameters,
        warmer_k: f64,
        interrupt: Interrupt,
    ) -> Self {
        Self {
            link,
            plant,
            warmer_k,
            bare: BareRig::new(plant, SWITCHES),
            interrupt,
        }
    }
}

impl Bench for LinkedBench<'_> {
    type Error = Failure;

    fn with_specimen(
        &mut self,
        pressed: Pressed,
        work: &mut Work<'_, Failure>,
    ) -> Result<Run, Failure> {
        let rig = on_rig(self.plant, SWITCHES, pressed, self.warmer_k)?;
        let (world, gauges) = rig.into_parts();
        let board = self.link.emulated().ok_or_else(no_bench)?;
        board.power_on_in(world)?;
        self.link.reconnect(&self.interrupt)?;
        // The answer sets the link's copy of the device's clock.
        self.link.send_accepted(&Command::GetSettings)?;
        work(&mut LinkedInstrument {
            link: self.link,
            gauges,
            readings: Readings::default(),
            interrupt: &self.interrupt,
        })
    }

    fn press_bare(&mut self, force_n: f64) -> Result<Option<(f64, f64)>, Failure> {
        Ok(Some(mean_bare(&mut self.bare, force_n)))
    }

    fn temperature_c(&self) -> f64 {
        CALIBRATION_C + self.warmer_k
    }
}

fn no_bench() -> Failure {
    Failure::Argument("only the emulated board has a simulated bench: add --board emulated".into())
}

/// The board during a run.
struct LinkedInstrument<'l> {
    link: &'l mut Link,
    gauges: Gauges,
    readings: Readings,
    interrupt: &'l Interrupt,
}

impl LinkedInstrument<'_> {
    /// Converts a time of the link's clock to the device's time, s.
    fn device_s(&self, at: Duration) -> f64 {
        self.link.clock().device_s(at).unwrap_or_default()
    }

    fn world(&mut self) -> Result<&mut World, Failure> {
        let board = self.link.emulated().ok_or_else(no_bench)?;
        Ok(board.world_mut())
    }
}

impl Instrument for LinkedInstrument<'_> {
    type Error = Failure;

    fn now(&self) -> Duration {
        Duration::from_secs_f64(self.device_s(self.link.now()))
    }

    fn ask(&mut self, command: Command) -> Result<Outcome, Failure> {
        let (_, outcome) = self.link.ask(&command)?;
        self.link.take();
        Ok(outcome)
    }

    fn post(&mut self, command: Command) -> Result<(), Failure> {
        self.link.send(&command).map(drop)
    }

    fn advance(
        &mut self,
        end: Duration,
        lines: &mut Vec<BenchSample>,
    ) -> Result<Vec<Record>, Failure> {
        self.interrupt.go_on()?;
        let left_s = end.as_secs_f64() - self.now().as_secs_f64();
        // The lower limit also ends a wait if rounding leaves a small remainder of the time.
        let wait = Duration::from_secs_f64(left_s.clamp(LEAST_S, LONGEST_S));
        self.link.listen(wait)?;
        let arrivals = self.link.take();
        let now_s = self.device_s(self.link.now());
        let board = self.link.emulated().ok_or_else(no_bench)?;
        let reading = self.gauges.read(board.world_mut());
        self.readings.push((now_s, reading));
        let mut others = Vec::new();
        for arrival in arrivals {
            let frame = arrival.frame;
            match frame.message {
                Record::Sample(sample) => {
                    let time_s = frame.header.time_us as f64 * 1e-6;
                    let gauges: GaugeReading = self.readings.at(time_s).into();
                    lines.extend(bench_sample(time_s, &sample, time_s, gauges));
                }
                other => others.push(other),
            }
        }
        Ok(others)
    }

    fn press(&mut self, depth_m: f64, speed_m_per_s: f64) -> Result<Duration, Failure> {
        Ok(press(self.world()?, depth_m, speed_m_per_s))
    }
}

/// The last readings of the gauges, each with the device's time, s. A sample arrives after the
/// board took it, so the gauges' values at its time are interpolated between two readings.
#[derive(Default)]
struct Readings(VecDeque<(f64, RigReading)>);

impl Readings {
    /// Number of kept readings: those of a tenth of a second, much longer than the delay of a
    /// record.
    const KEPT: usize = 100;

    fn push(&mut self, reading: (f64, RigReading)) {
        self.0.push_back(reading);
        if self.0.len() > Self::KEPT {
            self.0.pop_front();
        }
    }

    /// Values of the gauges at a time, s. Outside the kept times it returns the nearest reading.
    fn at(&self, time_s: f64) -> RigReading {
        let later = self.0.partition_point(|(at_s, _)| *at_s < time_s);
        let before = later.checked_sub(1).and_then(|index| self.0.get(index));
        match (before, self.0.get(later)) {
            (Some((from_s, from)), Some((to_s, to))) => {
                let part = (time_s - from_s) / (to_s - from_s);
                let between = |from: f64, to: f64| from + part * (to - from);
                RigReading {
                    force_n: between(from.force_n, to.force_n),
                    stage_m: between(from.stage_m, to.stage_m),
                }
            }
            (Some((_, reading)), None) | (None, Some((_, reading))) => *reading,
            (None, None) => RigReading {
                force_n: 0.0,
                stage_m: 0.0,
            },
        }
    }
}

/// Shortest and longest wait for a record, s.
const LEAST_S: f64 = 50e-6;
const LONGEST_S: f64 = 10e-3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_readings_the_gauges_are_on_a_straight_line() {
        let reading = |force_n| RigReading {
            force_n,
            stage_m: 2.0 * force_n,
        };
        let mut readings = Readings::default();
        assert_eq!(readings.at(1.0), reading(0.0));
        readings.push((1.0, reading(1.0)));
        readings.push((1.0, reading(1.0)));
        readings.push((2.0, reading(3.0)));
        assert_eq!(readings.at(1.5), reading(2.0));
        assert_eq!(readings.at(0.5), reading(1.0));
        assert_eq!(readings.at(9.0), reading(3.0));
    }
}
