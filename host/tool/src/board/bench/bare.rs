//! A board on a link without a bench: no press, no gauges.

use std::time::Duration;

use palpate_calibration::bench::Instrument;
use palpate_calibration::session::BenchSample;
use palpate_cli::failure::Failure;
use palpate_simulate::bench::{GaugeReading, bench_sample};
use palpate_wire::code::Outcome;
use palpate_wire::{Command, Record};

use crate::board::link::{Arrival, Link};
use crate::interrupt::Interrupt;

/// A board without a bench.
pub(crate) struct BareInstrument<'l> {
    link: &'l mut Link,
    interrupt: Interrupt,
}

impl<'l> BareInstrument<'l> {
    pub(crate) const fn new(link: &'l mut Link, interrupt: Interrupt) -> Self {
        Self { link, interrupt }
    }
}

/// Appends samples without gauge readings to the lines. Returns the other records.
pub(super) fn noted(arrivals: Vec<Arrival>, lines: &mut Vec<BenchSample>) -> Vec<Record> {
    let mut others = Vec::new();
    for arrival in arrivals {
        match arrival.frame.message {
            Record::Sample(sample) => {
                let time_s = arrival.frame.header.time_us as f64 * 1e-6;
                let gauges = GaugeReading::default();
                lines.extend(bench_sample(time_s, &sample, time_s, gauges));
            }
            other => others.push(other),
        }
    }
    others
}

/// Longest time of one receive call.
const POLL: Duration = Duration::from_millis(2);

impl Instrument for BareInstrument<'_> {
    type Error = Failure;

    fn now(&self) -> Duration {
        let device_s = self.link.clock().device_s(self.link.now());
        Duration::from_secs_f64(device_s.unwrap_or_default())
    }

    fn ask(&mut self, command: Command) -> Result<Outcome, Failure> {
        self.link.ask(&command).map(|(_, outcome)| outcome)
    }

    fn post(&mut self, command: Command) -> Result<(), Failure> {
        self.link.send(&command).map(drop)
    }

    fn advance(
        &mut self,
        _: Duration,
        lines: &mut Vec<BenchSample>,
    ) -> Result<Vec<Record>, Failure> {
        self.interrupt.go_on()?;
        self.link.listen(POLL)?;
        Ok(noted(self.link.take(), lines))
    }

    fn press(&mut self, _: f64, _: f64) -> Result<Duration, Failure> {
        Err(Failure::Argument("there is no stage that presses".into()))
    }
}
