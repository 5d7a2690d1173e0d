//! Health of a board, as `diagnostic_msgs`.

use palpate_cli::describe::first_sentence;
use palpate_wire::code::State;
use palpate_wire::loss::{Account, Arrival};
use palpate_wire::record::{Fault, Hello, Status};
use palpate_wire::{Frame, Record};

use crate::messages::{DiagnosticStatus, KeyValue};

/// State of a board and its connection.
#[derive(Debug, Default)]
pub struct Health {
    /// Why there is no connection, with what to do; `None` while connected.
    pub unconnected: Option<String>,
    /// Location of the board.
    pub location: String,
    /// How often it was connected.
    pub connections: u32,
    /// Messages that were not sent, because a subscriber acknowledged nothing for long.
    pub unsent: u64,
    /// Why the board was not armed, with what to do.
    pub not_armed: Option<String>,
    /// Largest error of the stamps, s.
    pub stamps_within_s: Option<f64>,
    hello: Option<Hello>,
    status: Option<Status>,
    state: Option<State>,
    is_armed: bool,
    faults: Vec<Fault>,
    account: Account,
    /// Records that are missing since the start of this program.
    missing: u64,
    has_force: bool,
    has_touch: bool,
    force_sigma_n: Option<f32>,
    /// What the last report said.
    reported: Reported,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Reported {
    missing: u64,
    conversions_lost: u32,
    unsent: u64,
}

impl Health {
    /// A board that is not connected yet.
    pub fn new(location: &str) -> Self {
        Self {
            unconnected: Some("not connected yet".to_owned()),
            location: location.to_owned(),
            ..Self::default()
        }
    }

    /// The board is connected.
    pub fn connect(&mut self, hello: Option<&Hello>) {
        self.unconnected = None;
        self.connections += 1;
        self.hello = hello.cloned();
    }

    /// The board is gone; its state is unknown.
    pub fn disconnect(&mut self, why: String) {
        *self = Self {
            unconnected: Some(why),
            location: std::mem::take(&mut self.location),
            connections: self.connections,
            unsent: self.unsent,
            missing: self.missing,
            hello: self.hello.take(),
            reported: self.reported,
            ..Self::default()
        };
    }

    /// Takes a received record.
    pub fn take(&mut self, frame: &Frame<Record>) {
        match self.account.take(&frame.header) {
            Arrival::FirstOfBoot => self.has_touch = false,
            Arrival::AfterGap { missing } => self.missing += u64::from(missing),
            Arrival::Late => self.missing = self.missing.saturating_sub(1),
            Arrival::Next | Arrival::Duplicate | Arrival::Stale => {}
        }
        match &frame.message {
            Record::Hello(hello) => {
                self.hello = Some(hello.clone());
                self.faults.clear();
            }
            Record::Status(status) => self.status = Some(status.clone()),
            Record::State(change) => {
                self.state = Some(change.state);
                self.is_armed = change.armed;
            }
            Record::Fault(fault) => {
                self.faults.retain(|of| of.code != fault.code);
                if fault.active {
                    self.faults.push(fault.clone());
                }
            }
            Record::Sample(sample) if sample.sensor == 0 => {
                self.has_force = sample.force_n.is_some();
                self.force_sigma_n = sample.force_sigma_n;
            }
            Record::Touch(_) => self.has_touch = true,
            _ => {}
        }
    }

    /// Level and description. Losses are those since the last report.
    fn verdict(&self, now: Reported) -> (u8, String) {
        if let Some(why) = &self.unconnected {
            return (DiagnosticStatus::ERROR, why.clone());
        }
        if let Some(fault) = self.faults.first() {
            let meaning = fault.code.meaning().trim();
            let text = format!("{}: {meaning} docs/faults.md says what to do", fault.code);
            return (DiagnosticStatus::ERROR, text);
        }
        let before = self.reported;
        let missing = now.missing.saturating_sub(before.missing);
        let lost = now.conversions_lost.wrapping_sub(before.conversions_lost);
        let unsent = now.unsent - before.unsent;
        let warning = if missing > 0 {
            format!(
                "{missing} records of the board are missing: use a shorter cable or fewer programs, or lower rate_hz"
            )
        } else if lost > 0 {
            format!("{lost} conversions were lost on the board: lower rate_hz")
        } else if unsent > 0 {
            format!(
                "{unsent} messages were not sent: a subscriber acknowledges nothing; end it, or use --best-effort"
            )
        } else if let Some(why) = &self.not_armed {
            why.clone()
        } else if !self.has_force && !self.has_touch {
            "no force: the board is not calibrated, or sends no samples; `palpate doctor` says which".to_owned()
        } else {
            return (DiagnosticStatus::OK, self.activity());
        };
        (DiagnosticStatus::WARN, warning)
    }

    fn activity(&self) -> String {
        let state = self.state.map_or("measuring force".to_owned(), |of| {
            first_sentence(of.meaning()).to_owned()
        });
        let armed = if self.is_armed { ", armed" } else { "" };
        format!("{state}{armed}")
    }

    /// Report about the board of this name.
    pub fn report(&mut self, name: &str) -> DiagnosticStatus {
        let status = self.status.as_ref();
        let now = Reported {
            missing: self.missing,
            conversions_lost: status.map_or(0, |of| {
                of.conversions_lost.wrapping_add(of.second_conversions_lost)
            }),
            unsent: self.unsent,
        };
        if status.is_some() && self.reported.conversions_lost > now.conversions_lost {
            // The board counts from its start.
            self.reported.conversions_lost = 0;
        }
        let (level, message) = self.verdict(now);
        let values = self.values(now);
        self.reported = now;
        DiagnosticStatus {
            level,
            name: format!("palpate: {name}"),
            message,
            hardware_id: self.hardware_id(),
            values,
        }
    }

    fn hardware_id(&self) -> String {
        match &self.hello {
            Some(hello) if hello.unit != 0 => format!("{:016X}", hello.unit),
            _ => self.location.clone(),
        }
    }

    fn values(&self, now: Reported) -> Vec<KeyValue> {
        let mut values = Vec::new();
        let mut add = |key: &str, value: Option<String>| {
            if let Some(value) = value {
                let key = key.to_owned();
                values.push(KeyValue { key, value });
            }
        };
        let status = self.status.as_ref();
        add("location", Some(self.location.clone()));
        add("firmware", self.hello.as_ref().map(firmware));
        add("connections", Some(self.connections.to_string()));
        add("records missing", Some(now.missing.to_string()));
        add("messages not sent", Some(now.unsent.to_string()));
        add(
            "stamps within (ms)",
            self.stamps_within_s.map(|of| format!("{:.3}", 1e3 * of)),
        );
        add(
            "force standard uncertainty (N)",
            self.force_sigma_n.map(|of| of.to_string()),
        );
        add("state", self.state.map(|of| of.to_string()));
        add("armed", self.state.map(|_| self.is_armed.to_string()));
        for fault in &self.faults {
            add("fault", Some(fault.code.to_string()));
        }
        add(
            "conversions lost",
            status.map(|_| now.conversions_lost.to_string()),
        );
        add(
            "coil temperature (degC)",
            status
                .and_then(|of| of.temperature_c)
                .map(|of| of.to_string()),
        );
        add(
            "coil supply (V)",
            status.and_then(|of| of.supply_v).map(|of| of.to_string()),
        );
        add(
            "processor load (%)",
            status
                .and_then(|of| of.processor_load)
                .map(|of| format!("{:.0}", 100.0 * of)),
        );
        values
    }
}

fn firmware(hello: &Hello) -> String {
    let simulated = if hello.simulated { ", simulated" } else { "" };
    format!(
        "{}.{}.{} ({:08x}){simulated}",
        hello.firmware_major, hello.firmware_minor, hello.firmware_patch, hello.commit
    )
}

#[cfg(test)]
mod tests {
    use palpate_wire::Header;
    use palpate_wire::code::{FaultCode, Location, TouchVerdict};
    use palpate_wire::record::Touch;

    use super::*;

    fn frame(sequence: u32, message: Record) -> Frame<Record> {
        let header = Header {
            boot_id: 7,
            sequence,
            time_us: 0,
            dropped: 0,
        };
        Frame { header, message }
    }

    /// What a calibrated board sends.
    fn touch(sequence: u32) -> Frame<Record> {
        let message = Record::Touch(Touch::without_claim(TouchVerdict::Clear));
        frame(sequence, message)
    }

    fn connected() -> Health {
        let mut health = Health::new("/dev/ttyACM0");
        health.connect(None);
        health
    }

    #[test]
    fn missing_records_are_a_warning_once_and_are_counted_over_connections() {
        let mut health = connected();
        health.take(&touch(1));
        assert_eq!(health.report("left").level, DiagnosticStatus::OK);
        health.take(&touch(5));
        let report = health.report("left");
        assert_eq!(report.level, DiagnosticStatus::WARN);
        assert!(
            report.message.starts_with("3 records"),
            "{}",
            report.message
        );
        assert_eq!(health.report("left").level, DiagnosticStatus::OK);
        health.disconnect("unplugged: plug it in again".to_owned());
        let report = health.report("left");
        assert_eq!(report.level, DiagnosticStatus::ERROR);
        assert_eq!(report.message, "unplugged: plug it in again");
        let missing = report.values.iter().find(|of| of.key == "records missing");
        assert_eq!(missing.map(|of| of.value.as_str()), Some("3"));
        health.connect(None);
        health.take(&touch(900));
        assert_eq!(health.report("left").level, DiagnosticStatus::OK);
    }

    #[test]
    fn a_fault_is_an_error_until_it_is_cleared() {
        let fault = |sequence, active| {
            let message = Record::Fault(Fault {
                code: FaultCode::CoilTooHot,
                location: Location::Coil,
                active,
                value: None,
                limit: None,
            });
            frame(sequence, message)
        };
        let mut health = connected();
        health.take(&touch(1));
        health.take(&fault(2, true));
        let report = health.report("left");
        assert_eq!(report.level, DiagnosticStatus::ERROR);
        assert!(report.message.contains("Let it cool"), "{}", report.message);
        health.take(&fault(3, false));
        assert_eq!(health.report("left").level, DiagnosticStatus::OK);
    }

    #[test]
    fn a_board_without_a_force_says_so() {
        let report = connected().report("left");
        assert_eq!(report.level, DiagnosticStatus::WARN);
        assert!(
            report.message.contains("not calibrated"),
            "{}",
            report.message
        );
        assert_eq!(report.hardware_id, "/dev/ttyACM0");
    }
}
