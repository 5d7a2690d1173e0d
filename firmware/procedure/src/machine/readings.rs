//! Error flags of readings: a single flag is data, a persistent one is a fault.

use palpate_wire::code::{FaultCode, Location};

use super::state::{Phase, is_of_readings};
use super::{Out, Procedure};
use crate::action::Action;
use crate::event::{Failure, Scan};
use crate::time::seconds;

impl Procedure {
    /// Raises a fault if a channel's readings stay flagged for the time that a converter may be silent,
    /// since a sensor without usable readings is as bad as a silent one. Ends the fault when every
    /// channel of that converter reads well.
    pub(super) fn watch_readings(&mut self, scan: &Scan, out: &mut Out<'_>) {
        let all_good = scan.conversions.iter().all(|of| of.reading.is_good());
        if all_good && !self.flagged_since.any && !matches!(self.phase, Phase::Fault(_)) {
            return;
        }
        let location = if scan.sensor & 1 == 0 {
            Location::Sensor
        } else {
            Location::SecondSensor
        };
        let mut failure = None;
        self.flagged_since.forget_ended();
        for conversion in &scan.conversions {
            let reading = &conversion.reading;
            let wrong = self.flagged_since.push(scan.sensor, reading, out.now);
            if let Some((code, since)) = wrong
                && seconds(since, out.now).0 > self.allowed_silence_s()
            {
                failure.get_or_insert(Failure {
                    value: Some(reading.channel.number().into()),
                    ..Failure::new(code, location)
                });
            }
        }
        if let Phase::Fault(standing) = &self.phase {
            let ends = |of: &Failure| is_of_readings(of.code) && of.location == location;
            let behind = self.behind.iter().find(|of| ends(of));
            let ended = if ends(standing) {
                Some(standing)
            } else {
                behind
            };
            if let (true, Some(code)) = (all_good, ended.map(|of| of.code)) {
                self.recovered(code, out);
            }
        } else if let Some(failure) = failure {
            self.fail(failure, out);
            // The converter's drive current may have been found while the sensor was pressed, so the
            // converter searches for it again. If that helps, good readings end the fault.
            if failure.code == FaultCode::SensorAmplitude {
                out.push(Action::SeekDrive {
                    sensor: scan.sensor & 1,
                });
            }
        }
    }
}
