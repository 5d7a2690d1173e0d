//! Storage and activation of the configuration, links and their answers, restart.

use std::collections::VecDeque;

use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_procedure::storage::{StorageFailure, StorageOrder, StorageReport, Stored};
use palpate_procedure::{Action, Event, Instant, Link, Procedure};
use palpate_wire::code::{
    FaultCode, Location, Outcome, Part, RebootTarget, State, StorageAction, StorageState,
};
use palpate_wire::command::{
    CalibrationIdentity, ClearFault, GetCalibration, Locate, Reboot, Settings,
};
use palpate_wire::record::{Acknowledgement, Fault, Hello, Storage};
use palpate_wire::{Command, Record, configuration_crc};

use crate::support::calibration::{calibration, settings, tip};
use crate::support::sensor::Sensor;
use crate::support::{BOOT, Content, Rig, board, drive_coil, frame};

/// Procedure with a storage that carries out one order per millisecond.
struct Desk {
    procedure: Procedure,
    now_us: u64,
    sequence: u32,
    stored: Vec<Command>,
    generation: u32,
    /// Commands of the save in progress.
    put: Vec<Command>,
    /// Reports still to be delivered.
    reports: VecDeque<StorageReport>,
    orders: VecDeque<StorageOrder>,
    /// The storage answers no orders.
    is_dead: bool,
    /// Failure of every order, if any.
    fails: Option<StorageFailure>,
    records: Vec<(Option<Link>, Record)>,
    actions: Vec<Action>,
}

impl Desk {
    fn new(stored: &[Command]) -> Self {
        Self::with(stored, 0)
    }

    fn with(stored: &[Command], crashes: u8) -> Self {
        let mut info = board();
        (info.storage, info.crashes) = (true, crashes);
        Self {
            procedure: Procedure::new(info),
            now_us: 0,
            sequence: 0,
            stored: stored.to_vec(),
            generation: u32::from(!stored.is_empty()),
            put: Vec::new(),
            reports: VecDeque::new(),
            orders: VecDeque::new(),
            is_dead: false,
            fails: None,
            records: Vec::new(),
            actions: Vec::new(),
        }
    }

    fn begun(mut self) -> Self {
        self.settle();
        assert!(self.procedure.has_begun());
        self
    }

    fn step(&mut self, event: &Event<'_>) {
        self.now_us += 100;
        let actions = self.procedure.step(Instant::from_ticks(self.now_us), event);
        for action in &actions {
            match action {
                Action::Record { to, record, .. } => self.records.push((*to, record.clone())),
                Action::Storage(order) => self.orders.push_back(order.clone()),
                _ => {}
            }
        }
        self.actions.extend(actions);
        assert!(self.orders.len() <= 1, "one order at a time");
    }

    /// Runs until the storage has no work left; a longer run would fault for a silent converter.
    fn settle(&mut self) {
        self.run(1);
        while !(self.orders.is_empty() && self.reports.is_empty()) {
            self.run(1);
        }
    }

    /// Runs for `ms` milliseconds.
    fn run(&mut self, ms: u32) {
        for _ in 0..ms {
            self.now_us += 900;
            if !self.is_dead {
                self.work();
            }
            match self.reports.pop_front() {
                Some(report) => self.step(&Event::Storage(&report)),
                None => self.step(&Event::Tick),
            }
        }
    }

    fn work(&mut self) {
        let Some(order) = self.orders.pop_front() else {
            return;
        };
        if self.fails.is_some() {
            self.reports.push_back(self.done());
            return;
        }
        match order {
            StorageOrder::Inspect => self.reports.push_back(self.done()),
            StorageOrder::Load => {
                let items = self.stored.iter().cloned().map(StorageReport::Item);
                self.reports.extend(items);
                self.reports.push_back(self.done());
            }
            StorageOrder::Begin => {
                self.put.clear();
                self.reports.push_back(StorageReport::Ready);
            }
            StorageOrder::Put(command) => {
                self.put.push(command);
                self.reports.push_back(StorageReport::Ready);
            }
            StorageOrder::Commit => {
                self.generation += 1;
                self.stored = std::mem::take(&mut self.put);
                self.reports.push_back(self.done());
            }
            StorageOrder::Erase => {
                (self.generation, self.stored) = (0, Vec::new());
                self.reports.push_back(self.done());
            }
        }
    }

    fn done(&self) -> StorageReport {
        let identity = self.stored.iter().find_map(|command| match command {
            Command::SetCalibrationIdentity(identity) => Some(identity.clone()),
            _ => None,
        });
        let state = match (self.fails, self.stored.is_empty()) {
            (Some(StorageFailure::Damaged), _) => StorageState::Damaged,
            (_, true) => StorageState::Empty,
            (_, false) => StorageState::Whole,
        };
        StorageReport::Done {
            failure: self.fails,
            stored: Stored {
                state,
                generation: self.generation,
                configuration_crc: configuration_crc(&self.stored),
                items: self.stored.len() as u16,
                unknown_items: 0,
                identity,
            },
        }
    }

    fn send_by(&mut self, link: Link, command: Command) -> Outcome {
        self.sequence += 1;
        let before = self.records.len();
        self.step(&Event::Command(link, &frame(command, BOOT, self.sequence)));
        let answers: Vec<_> = self.records[before..]
            .iter()
            .filter_map(|(to, record)| Some((*to, Acknowledgement::of(record)?)))
            .collect();
        assert_eq!(answers.len(), 1, "{answers:?}");
        let (to, answer) = &answers[0];
        assert_eq!(*to, Some(link), "answered where it came from");
        assert_eq!(answer.command, self.sequence);
        answer.outcome
    }

    fn send(&mut self, command: Command) -> Outcome {
        self.send_by(Link::Usb, command)
    }

    fn accepted(&mut self, command: Command) {
        let outcome = self.send(command.clone());
        assert_eq!(outcome, Outcome::Accepted, "{command:?}");
    }

    fn all_accepted(&mut self, commands: &[Command]) {
        for command in commands {
            self.accepted(command.clone());
        }
    }

    /// Returns the last record of the storage.
    fn storage(&self) -> Storage {
        let mut records = self.records.iter().rev();
        let found = records.find_map(|(_, record)| Storage::of(record).cloned());
        found.expect("a record of the storage")
    }

    fn faults(&self) -> Vec<(FaultCode, Location)> {
        let records = self.records.iter();
        let faults = records.filter_map(|(_, record)| Fault::of(record));
        let raised = faults.filter(|fault| fault.active);
        raised.map(|fault| (fault.code, fault.location)).collect()
    }

    fn crc(&self) -> u32 {
        self.procedure.configuration().crc()
    }
}

/// Returns the commands that set settings, calibration and its identity.
fn configured(rate_hz: f32, id: u32) -> Vec<Command> {
    let mut commands = vec![Command::SetSettings(settings(|it| it.rate_hz = rate_hz))];
    commands.extend(calibration(&Sensor::default()));
    commands.push(identity_of(&commands, id));
    commands
}

fn identity_of(commands: &[Command], id: u32) -> Command {
    let parts = in_order(commands);
    let parts = parts
        .iter()
        .filter(|command| !matches!(command, Command::SetSettings(_)));
    Command::SetCalibrationIdentity(CalibrationIdentity {
        id,
        calibrated_at_s: 1_795_000_000 + id,
        calibrated_at_c: 23.0,
        hash: configuration_crc(parts),
    })
}

/// Sorts commands in the protocol's order for the CRC.
fn in_order(commands: &[Command]) -> Vec<Command> {
    let mut sorted = commands.to_vec();
    sorted.sort_by_key(palpate_wire::Message::kind);
    sorted
}

fn reboot(target: RebootTarget) -> Command {
    Command::Reboot(Reboot { target })
}

#[test]
fn what_was_stored_is_in_force_before_the_first_word() {
    let stored = in_order(&configured(500.0, 4));
    let desk = Desk::new(&stored).begun();
    let Some((
        None,
        Record::Hello(Hello {
            configuration_crc: said,
            ..
        }),
    )) = desk.records.first()
    else {
        panic!("{:?} is not who it is, said to all", desk.records.first());
    };
    assert_eq!(*said, configuration_crc(&stored));
    let storage = desk.storage();
    assert_eq!(
        (storage.action, storage.succeeded, storage.state),
        (StorageAction::Load, true, StorageState::Whole)
    );
    assert_eq!(storage.stored_crc, storage.in_force_crc);
    assert_eq!(
        (storage.refused_items, storage.calibration_id),
        (0, Some(4))
    );
    assert_eq!(desk.procedure.configuration().settings().rate_hz, 500.0);
    let configures = |action: &&Action| matches!(action, Action::ConfigureSensors { .. });
    assert_eq!(desk.actions.iter().filter(configures).count(), 1);
    // Arming needs the coil's data, which the load has set.
    let mut desk = desk;
    assert_eq!(desk.send(Command::Arm), Outcome::Accepted);
}

#[test]
fn what_is_in_force_is_stored_and_both_are_reported() {
    let mut desk = Desk::new(&[]).begun();
    assert_eq!(desk.storage().state, StorageState::Empty);
    assert_eq!(desk.send(Command::Load), Outcome::NothingStored);
    let commands = configured(500.0, 9);
    desk.all_accepted(&commands);
    let before = desk.storage();
    desk.accepted(Command::GetStorage);
    let asked = desk.storage();
    assert_eq!((asked.state, asked.stored_crc), (before.state, 0));
    assert_eq!(asked.in_force_crc, configuration_crc(in_order(&commands)));
    desk.accepted(Command::Store);
    desk.settle();
    let storage = desk.storage();
    assert_eq!(
        (storage.action, storage.succeeded, storage.generation),
        (StorageAction::Store, true, 1)
    );
    assert_eq!(storage.stored_crc, storage.in_force_crc);
    assert_eq!(storage.calibration_id, Some(9));
    assert_eq!(desk.stored, in_order(&commands));
    let changed = Settings {
        rate_hz: 250.0,
        ..DEFAULT_SETTINGS
    };
    desk.accepted(Command::SetSettings(changed));
    desk.accepted(Command::GetStorage);
    assert_ne!(desk.storage().stored_crc, desk.storage().in_force_crc);
    desk.accepted(Command::Load);
    desk.settle();
    assert_eq!(desk.storage().stored_crc, desk.storage().in_force_crc);
    assert_eq!(desk.procedure.configuration().settings().rate_hz, 500.0);
    desk.accepted(Command::Erase);
    desk.settle();
    assert_eq!(desk.storage().state, StorageState::Empty);
    assert_eq!(
        desk.crc(),
        configuration_crc(in_order(&commands)),
        "in force as before"
    );
}

#[test]
fn a_calibration_that_is_abandoned_at_any_step_leaves_the_earlier_one() {
    let earlier = in_order(&configured(500.0, 1));
    let later = configured(250.0, 2);
    let crc = configuration_crc(&earlier);
    for step in 0..=later.len() {
        let mut desk = Desk::new(&earlier).begun();
        for command in &later[..step] {
            desk.accepted(command.clone());
        }
        desk.accepted(Command::Load);
        desk.settle();
        let storage = desk.storage();
        assert_eq!(
            (storage.stored_crc, storage.in_force_crc, desk.crc()),
            (crc, crc, crc),
            "step {step}"
        );
        assert_eq!(storage.calibration_id, Some(1), "step {step}");
        assert!(desk.faults().is_empty());
    }
}

#[test]
fn nothing_is_set_or_driven_while_the_storage_is_at_work() {
    let mut desk = Desk::new(&[]).begun();
    desk.all_accepted(&configured(500.0, 1));
    desk.accepted(Command::Store);
    let refused = [
        Command::SetSettings(DEFAULT_SETTINGS),
        Command::Arm,
        Command::Store,
        Command::Load,
        Command::Erase,
        reboot(RebootTarget::Firmware),
    ];
    for command in refused {
        assert_eq!(desk.send(command.clone()), Outcome::Busy, "{command:?}");
    }
    for command in [Command::Identify, Command::GetStorage, Command::GetSettings] {
        desk.accepted(command);
    }
    desk.settle();
    desk.accepted(Command::Arm);
    for command in [Command::Store, Command::Load, Command::Erase] {
        assert_eq!(desk.send(command.clone()), Outcome::Armed, "{command:?}");
    }
}

#[test]
fn what_is_stored_already_is_looked_at_and_not_written_again() {
    let mut desk = Desk::new(&[]).begun();
    let mut store = |rate_hz, order| {
        desk.accepted(Command::SetSettings(settings(|it| it.rate_hz = rate_hz)));
        desk.accepted(Command::Store);
        assert_eq!(desk.orders, [order]);
        desk.settle();
        assert!(desk.storage().succeeded);
        desk.storage().generation
    };
    assert_eq!(store(250.0, StorageOrder::Begin), 1);
    assert_eq!(store(250.0, StorageOrder::Inspect), 1);
    assert_eq!(store(500.0, StorageOrder::Begin), 2);
}

#[test]
fn what_is_damaged_is_not_in_force_and_is_said() {
    let mut desk = Desk::new(&configured(500.0, 1));
    desk.fails = Some(StorageFailure::Damaged);
    let mut desk = desk.begun();
    assert_eq!(
        desk.faults(),
        [(FaultCode::StorageDamaged, Location::Storage)]
    );
    assert_eq!(desk.procedure.state(), State::Fault);
    assert_eq!(desk.crc(), Desk::new(&[]).crc(), "nothing of it");
    assert_eq!(desk.storage().state, StorageState::Damaged);
    assert_eq!(desk.send(Command::Load), Outcome::NothingStored);
    desk.fails = None;
    desk.accepted(Command::Erase);
    desk.settle();
    assert_eq!(desk.storage().state, StorageState::Empty);
}

#[test]
fn a_load_that_breaks_off_leaves_nothing_of_it_in_force() {
    let stored = in_order(&configured(500.0, 1));
    let mut desk = Desk::new(&[]).begun();
    desk.accepted(Command::SetSettings(settings(|it| it.rate_hz = 250.0)));
    desk.stored = stored.clone();
    desk.accepted(Command::Store);
    desk.settle();
    desk.accepted(Command::Load);
    desk.orders.clear();
    desk.step(&Event::Storage(&StorageReport::Item(stored[0].clone())));
    desk.fails = Some(StorageFailure::Damaged);
    let done = desk.done();
    desk.step(&Event::Storage(&done));
    assert_eq!(desk.crc(), Desk::new(&[]).crc());
    assert_eq!(
        desk.faults(),
        [(FaultCode::StorageDamaged, Location::Storage)]
    );
}

#[test]
fn flash_that_takes_nothing_is_a_fault_and_what_was_stored_stays() {
    let stored = in_order(&configured(500.0, 1));
    let mut desk = Desk::new(&stored).begun();
    desk.fails = Some(StorageFailure::Flash);
    desk.accepted(Command::SetSettings(settings(|it| it.rate_hz = 250.0)));
    desk.accepted(Command::Store);
    desk.settle();
    assert_eq!(
        desk.faults(),
        [(FaultCode::StorageFailed, Location::Storage)]
    );
    let storage = desk.storage();
    assert_eq!(
        (storage.succeeded, storage.stored_crc),
        (false, configuration_crc(&stored))
    );
}

#[test]
fn a_start_does_not_wait_for_a_storage_that_is_silent() {
    let mut desk = Desk::new(&[]);
    desk.is_dead = true;
    desk.run(990);
    assert!(!desk.procedure.has_begun() && desk.records.is_empty());
    desk.run(50);
    assert!(desk.procedure.has_begun());
    assert!(matches!(
        desk.records.first(),
        Some((None, Record::Hello(_)))
    ));
    assert_eq!(desk.faults(), [(FaultCode::Overrun, Location::Storage)]);
    assert_eq!(desk.send(Command::Store), Outcome::NoStorage);
}

#[test]
fn a_save_that_does_not_end_is_a_fault_after_which_only_a_restart_helps() {
    let mut desk = Desk::new(&[]).begun();
    desk.all_accepted(&configured(500.0, 1));
    desk.is_dead = true;
    desk.accepted(Command::Store);
    desk.run(14_900);
    assert_eq!(
        desk.faults()
            .iter()
            .filter(|it| it.1 == Location::Storage)
            .count(),
        0
    );
    desk.run(200);
    assert!(
        desk.faults()
            .contains(&(FaultCode::Overrun, Location::Storage))
    );
    let code = FaultCode::Overrun;
    desk.accepted(Command::ClearFault(ClearFault { code }));
    // The flash may still be written to, and what sets or drives runs from it.
    for command in [Command::SetSettings(DEFAULT_SETTINGS), Command::Arm] {
        assert_eq!(desk.send(command), Outcome::Busy);
    }
    desk.accepted(reboot(RebootTarget::Firmware));
}

/// The stored configuration may be the cause of the crashes, so it is not loaded.
#[test]
fn after_a_streak_of_crashes_nothing_that_was_stored_is_in_force() {
    let stored = in_order(&configured(500.0, 1));
    let mut desk = Desk::with(&stored, 5).begun();
    assert_eq!(desk.crc(), Desk::new(&[]).crc());
    let storage = desk.storage();
    assert_eq!(
        (storage.action, storage.state),
        (StorageAction::Inspect, StorageState::Whole)
    );
    assert_eq!(
        desk.faults(),
        [(FaultCode::CrashStreak, Location::Processor)]
    );
    assert_eq!(desk.send(Command::Arm), Outcome::Faulted);
    desk.accepted(Command::Erase);
    desk.settle();
    assert_eq!(desk.storage().state, StorageState::Empty);
    desk.accepted(reboot(RebootTarget::BootLoader));
}

#[test]
fn the_identity_of_a_calibration_is_that_of_its_parts() {
    let mut desk = Desk::new(&[]).begun();
    let commands = configured(500.0, 1);
    let get = Command::GetCalibration(GetCalibration {
        part: Part::CalibrationIdentity,
        sensor: 0,
        channel: 0,
    });
    let (identity, parts) = commands.split_last().expect("commands");
    assert_eq!(desk.send(identity.clone()), Outcome::OtherCalibration);
    desk.all_accepted(parts);
    assert_eq!(desk.send(get.clone()), Outcome::NotSet);
    desk.accepted(identity.clone());
    desk.accepted(get.clone());
    // Settings and tip are not part of a calibration's hash.
    desk.accepted(Command::SetSettings(DEFAULT_SETTINGS));
    desk.accepted(get.clone());
    desk.accepted(tip());
    desk.accepted(get.clone());
    desk.accepted(identity.clone());
    desk.accepted(get.clone());
    for part in &parts[1..] {
        desk.accepted(identity.clone());
        desk.accepted(part.clone());
        // A started curve becomes active with its last chunk.
        if desk.send(get.clone()) == Outcome::Accepted {
            continue;
        }
        assert_eq!(desk.send(get.clone()), Outcome::NotSet, "{part:?}");
    }
    assert_eq!(desk.send(get), Outcome::NotSet);
    assert!(desk.faults().is_empty());
}

#[test]
fn answers_go_where_their_command_came_from_and_all_else_to_every_link() {
    let mut desk = Desk::new(&configured(500.0, 1)).begun();
    for link in Link::ALL {
        desk.records.clear();
        for command in [
            Command::Identify,
            Command::GetSettings,
            Command::GetStorage,
            Command::GetCalibration(GetCalibration {
                part: Part::Springs,
                sensor: 0,
                channel: 0,
            }),
        ] {
            assert_eq!(desk.send_by(link, command), Outcome::Accepted);
        }
        desk.run(5);
        assert!(desk.records.len() >= 9);
        assert!(desk.records.iter().all(|(to, _)| *to == Some(link)));
        desk.records.clear();
        assert_eq!(desk.send_by(link, Command::Arm), Outcome::Accepted);
        assert_eq!(desk.send_by(link, Command::Disarm), Outcome::Accepted);
        let changes = desk.records.iter();
        let changes: Vec<_> = changes
            .filter(|(_, record)| matches!(record, Record::State(_)))
            .collect();
        assert_eq!(changes.len(), 2);
        assert!(changes.iter().all(|(to, _)| to.is_none()));
    }
}

#[test]
fn only_the_pc_that_commands_a_current_keeps_it_up() {
    for (talking, ends) in [(Link::Probe, false), (Link::Usb, true)] {
        let mut rig = Rig::standing_in(State::Contact, |_| {});
        rig.accepted(drive_coil(1.0, 0.0));
        for number in 0..20 {
            rig.run(10);
            rig.step(&Event::Command(
                talking,
                &frame(Command::GetSettings, BOOT, 900 + number),
            ));
        }
        let silent = rig
            .faults()
            .iter()
            .any(|it| it.code == FaultCode::HostSilent);
        assert_eq!(silent, ends, "{talking:?} talks, the probe commands");
    }
}

#[test]
fn a_device_that_is_to_start_anew_is_off_and_takes_nothing_more() {
    let mut desk = Desk::new(&configured(500.0, 1)).begun();
    desk.accepted(Command::Arm);
    desk.actions.clear();
    desk.accepted(reboot(RebootTarget::Firmware));
    assert!(!desk.procedure.is_armed());
    let at = |of: fn(&Action) -> bool| desk.actions.iter().position(of);
    let safe = at(|action| *action == Action::SafeState);
    let restart = at(|action| *action == Action::Restart(RebootTarget::Firmware));
    assert!(safe.is_some() && safe < restart, "{safe:?} {restart:?}");
    assert_eq!(desk.send(Command::Arm), Outcome::Busy);
    assert_eq!(
        desk.send(Command::SetSettings(DEFAULT_SETTINGS)),
        Outcome::Busy
    );
}

#[test]
fn a_board_shows_which_it_is() {
    let mut desk = Desk::new(&[]).begun();
    desk.accepted(Command::Locate(Locate { duration_s: 2.5 }));
    let shows =
        |action: &&Action| matches!(action, Action::Locate(time) if time.as_ticks() == 2_500_000);
    assert_eq!(desk.actions.iter().filter(shows).count(), 1);
}
