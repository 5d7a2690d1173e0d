//! A board under any input, with checks of its promises.

use ldc161x_sim::Time;
use palpate_node::board::DRIVE_LIMITS;
use palpate_procedure::Link;
use palpate_sim::device::Device;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_wire::code::State;
use palpate_wire::{Command, Header, Message};

use super::Summary;
use super::frame::{Parts, payload};
use super::links::Peer;
use super::script::{Addressee, Move};
use super::sensor::Sensor;

/// Longest duration of a script; a fuzzer's scripts may be of any length.
const LONGEST: Time = Time::from_ms(30_000);
/// Ratio of the drive's trip level to the limit of the regulated current.
const TRIP: f64 = DRIVE_LIMITS.trip_a as f64 / DRIVE_LIMITS.setpoint_a as f64;
/// Largest current without a command, A: the offset of the measurement, and the residue of a test.
const NONE_A: f64 = 0.2;
/// Time in which the current decays after the bridge is turned off: ten time constants of 0.4 ms.
const DECAY: Time = Time::from_ms(4);
/// Deepest press of a script, relative to the calibrated range.
const DEEPEST: f64 = 0.8;
/// Speed of the press, m/s.
const SPEED_M_PER_S: f64 = 10e-3;

/// A board, the PCs at its links, and the results so far.
pub(super) struct HostileSession<'a> {
    board: NativeBoard<'a>,
    sensor: &'a Sensor,
    peers: [Peer; 2],
    sequence: u32,
    end: Time,
    /// Time from which on the coil must carry no current.
    disarmed: Option<Time>,
    /// Time from which on the coil has carried a current.
    driven: Option<Time>,
    pub(super) summary: Summary,
}

impl<'a> HostileSession<'a> {
    pub(super) fn new(wiring: &'a Wiring, sensor: &'a Sensor) -> Self {
        let mut board = NativeBoard::new(wiring);
        for link in Link::ALL {
            board.write(link, &[]);
        }
        Self {
            end: board.now() + LONGEST,
            board,
            sensor,
            peers: Default::default(),
            sequence: 0,
            disarmed: None,
            driven: None,
            summary: Summary::default(),
        }
    }

    pub(super) fn carry_out(&mut self, of: &Move) -> Result<(), String> {
        match of {
            Move::Raw(link, bytes) => self.write(*link, bytes),
            Move::Command(link, to, kind, payload) => {
                let parts = self.parts(*to, *kind, payload);
                self.write(*link, &parts.frame());
            }
            Move::Damaged(link, to, kind, payload, damage) => {
                let parts = self.parts(*to, *kind, payload);
                self.write(*link, &damage.done_to(&parts));
            }
            Move::Calibrate(link) => {
                for command in &self.sensor.calibration {
                    self.ask(*link, command);
                }
            }
            Move::Press(part) => self.press(f64::from(*part) / 255.0),
            Move::Run(ms) => {
                let end = self.board.now() + Time::from_ms((*ms).into());
                return self.run_until(end.min(self.end));
            }
        }
        Ok(())
    }

    /// Drains both links: the board reads the written bytes, finishes its work, and must accept a
    /// command as usual.
    pub(super) fn finish(&mut self) -> Result<(), String> {
        let waits = |board: &NativeBoard<'_>| Link::ALL.map(|link| board.unread(link));
        // Time limit: per link a frame or 200 bytes each millisecond, and the time of a restart.
        let bytes: usize = waits(&self.board).iter().sum();
        let end = self.board.now() + Time::from_ms(bytes as u64 + 500);
        while waits(&self.board) != [0, 0] {
            if self.board.now() >= end {
                return Err(format!("{:?} bytes are not read", waits(&self.board)));
            }
            self.advance(end)?;
        }
        // A zero ends any partial frame.
        for link in Link::ALL {
            self.write(link, &[0, 0]);
            self.ask_any(link, &Command::Disarm);
            self.ask_any(link, &Command::Identify);
        }
        self.run_until(self.board.now() + Time::from_ms(250))?;
        let is_armed = |procedure: &palpate_procedure::Procedure| procedure.is_armed();
        if self.board.procedure().is_none_or(is_armed) {
            return Err("not disarmed at the end".to_owned());
        }
        let [probe, _] = &self.peers;
        self.summary.reports = probe.reports.clone();
        for peer in &self.peers {
            self.summary.refused += peer.refused;
            for (outcome, count) in &peer.outcomes {
                *self.summary.outcomes.entry(outcome).or_default() += count;
            }
        }
        Ok(())
    }

    fn write(&mut self, link: Link, bytes: &[u8]) {
        self.summary.bytes += bytes.len() as u64;
        self.summary.frames += 1;
        self.board.write(link, bytes);
        self.peers[place(link)].wrote(bytes);
    }

    fn ask(&mut self, link: Link, command: &Command) {
        let parts = self.parts(Addressee::Present, command.kind(), &payload(command));
        self.write(link, &parts.frame());
    }

    fn ask_any(&mut self, link: Link, command: &Command) {
        let parts = self.parts(Addressee::Any, command.kind(), &payload(command));
        self.write(link, &parts.frame());
    }

    fn parts(&mut self, to: Addressee, kind: u8, payload: &[u8]) -> Parts {
        self.sequence += 1;
        let present = self.board.boot_id();
        Parts {
            boot_id: match to {
                Addressee::Present => present,
                Addressee::Any => Header::ANY_BOOT,
                Addressee::Next => present + 1,
                Addressee::None => u32::MAX,
            },
            sequence: self.sequence,
            kind,
            payload: payload.to_vec(),
        }
    }

    fn press(&mut self, part: f64) {
        let [lifted_m, deepest_m] = self.sensor.travel_m;
        let position_m = if part > 0.0 {
            DEEPEST * part * deepest_m
        } else {
            lifted_m
        };
        self.board
            .with_world(|world| world.move_press(position_m, SPEED_M_PER_S));
    }

    fn run_until(&mut self, end: Time) -> Result<(), String> {
        while self.board.now() < end {
            self.advance(end)?;
        }
        Ok(())
    }

    /// Advances a short time, and checks the promises.
    fn advance(&mut self, end: Time) -> Result<(), String> {
        let unread = Link::ALL.map(|link| self.board.unread(link));
        let boot_id = self.board.boot_id();
        let advanced = self.board.advance(end);
        advanced.map_err(|error| error.to_string())?;
        self.board.frames().clear();
        let now = self.board.now();
        let mut received = [Vec::new(), Vec::new()];
        for (link, before) in Link::ALL.into_iter().zip(unread) {
            let peer = &mut self.peers[place(link)];
            peer.taken(before - self.board.unread(link), now);
            received[place(link)] = peer.received(&self.board.read(link), boot_id)?;
            peer.is_answered(now)?;
        }
        self.went_where_they_belong(received)?;
        if self.board.boot_id() != boot_id {
            self.summary.restarts += 1;
            for peer in &mut self.peers {
                peer.restarted()?;
            }
        }
        self.coil_is_within_its_limits(now)
    }

    /// Checks that answers went to the requesting link, and all other records to both links.
    fn went_where_they_belong(&self, [probe, mut usb]: [Vec<Vec<u8>>; 2]) -> Result<(), String> {
        let mut alone = Vec::new();
        for record in probe {
            match usb.iter().position(|other| *other == record) {
                Some(index) => drop(usb.remove(index)),
                None => alone.push((Link::Probe, record)),
            }
        }
        alone.extend(usb.into_iter().map(|record| (Link::Usb, record)));
        for (link, record) in alone {
            if !self.peers[place(link)].may_have(&record) {
                return Err(format!("only {link:?} had a record: {record:02X?}"));
            }
        }
        Ok(())
    }

    fn coil_is_within_its_limits(&mut self, now: Time) -> Result<(), String> {
        let truth = self.board.with_world(|world| world.truth());
        let current_a = truth.current_a.abs();
        let state = self.board.procedure().map(|of| (of.state(), of.is_armed()));
        self.summary.see(state, current_a, &truth);
        if current_a > f64::from(DRIVE_LIMITS.setpoint_a) * TRIP {
            return Err(format!("{current_a} A"));
        }
        let is_driven = current_a > NONE_A;
        let may_be_driven = state.is_some_and(|(state, armed)| armed && state != State::Fault);
        let disarmed = since(&mut self.disarmed, !may_be_driven, now);
        if is_driven && disarmed.is_some_and(|disarmed| disarmed > DECAY) {
            return Err(format!("{current_a} A in {state:?}"));
        }
        let driven_s = since(&mut self.driven, is_driven, now).map_or(0.0, Time::as_secs_f64);
        if driven_s > DRIVE_LIMITS.on_time_s.into() {
            return Err(format!("a current for {driven_s} s"));
        }
        let allowed_j = f64::from(DRIVE_LIMITS.energy_j)
            + f64::from(DRIVE_LIMITS.continuous_w) * self.board.now().as_secs_f64();
        if truth.heat_in_j > allowed_j {
            return Err(format!("{} J of {allowed_j} J", truth.heat_in_j));
        }
        Ok(())
    }
}

/// Duration for which a condition has held; `None` if it does not hold.
fn since(mark: &mut Option<Time>, is_so: bool, now: Time) -> Option<Time> {
    if !is_so {
        *mark = None;
        return None;
    }
    Some(now - *mark.get_or_insert(now))
}

const fn place(link: Link) -> usize {
    match link {
        Link::Probe => 0,
        Link::Usb => 1,
    }
}
