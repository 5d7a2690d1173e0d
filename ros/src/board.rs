//! A board: connected, read and connected again, in a thread of its own.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use palpate::library::Board;
use palpate_cli::failure::Failure;
use palpate_wire::code::Part;
use palpate_wire::command::GetCalibration;
use palpate_wire::{Command, Frame, Message as _, Record};
use ros2_client::Publisher;

use crate::clock::Clock;
use crate::end;
use crate::health::Health;
use crate::messages::{Header, Stiffness, Temperature, Time, Touch, WrenchStamped};
use crate::records::{Converter, Output};
use crate::ros::{Log, Ros};

/// Longest wait for a record.
const POLL: Duration = Duration::from_millis(10);
/// Wait before a board that is gone is looked for again.
const AGAIN: Duration = Duration::from_millis(200);
/// Interval of the exchanges that compare the clocks: the clocks drift by 0.12 ms at most in it.
const EXCHANGE: Duration = Duration::from_millis(200);
/// Exchanges at the connection: the shortest of them counts.
const FIRST_EXCHANGES: usize = 8;

/// A board as its user names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Name in topics and frames.
    pub name: String,
    /// Board as of `palpate --board`; `None` for the one that is plugged in.
    pub board: Option<String>,
}

/// How boards are used.
#[derive(Clone, Debug)]
pub struct Usage {
    /// Arm boards, so that they measure at every contact.
    pub arm: bool,
    /// Frame of a board: this and its name.
    pub frame_prefix: String,
    /// Further arguments of `palpate measure`.
    pub rest: Vec<String>,
}

/// Topics of a board.
struct Topics {
    force: Publisher<WrenchStamped>,
    temperature: Publisher<Temperature>,
    stiffness: Publisher<Stiffness>,
    touch: Publisher<Touch>,
}

impl Topics {
    fn new(ros: &mut Ros, name: &str) -> Result<Self, Failure> {
        let topic = |kind: &str| format!("~/{name}/{kind}");
        Ok(Self {
            force: ros.publisher(&topic("force"))?,
            temperature: ros.publisher(&topic("temperature"))?,
            stiffness: ros.publisher(&topic("stiffness"))?,
            touch: ros.publisher(&topic("touch"))?,
        })
    }

    /// Publishes; returns whether the message was sent.
    fn publish(&self, output: Output) -> bool {
        match output {
            Output::Force(message) => self.force.publish(message).is_ok(),
            Output::Temperature(message) => self.temperature.publish(message).is_ok(),
            Output::Stiffness(message) => self.stiffness.publish(*message).is_ok(),
            Output::Touch(message) => self.touch.publish(*message).is_ok(),
        }
    }
}

/// The thread's side of a board.
pub struct Reader {
    named: Named,
    usage: Usage,
    topics: Topics,
    log: Log,
    health: Arc<Mutex<Health>>,
    frame_id: String,
}

impl Reader {
    /// Makes the topics of a board. Also returns its health, for the reports.
    ///
    /// # Errors
    /// If a topic cannot be made.
    pub fn new(
        ros: &mut Ros,
        named: Named,
        usage: &Usage,
    ) -> Result<(Self, Arc<Mutex<Health>>), Failure> {
        let location = named
            .board
            .as_deref()
            .unwrap_or("the board that is plugged in");
        let health = Arc::new(Mutex::new(Health::new(location)));
        let reader = Self {
            topics: Topics::new(ros, &named.name)?,
            log: ros.log(),
            frame_id: format!("{}{}", usage.frame_prefix, named.name),
            health: Arc::clone(&health),
            usage: usage.clone(),
            named,
        };
        Ok((reader, health))
    }

    /// Connects and publishes until the end of the program is requested, or of a recording is reached.
    ///
    /// # Errors
    /// If no later attempt can succeed: an argument or a file is refused.
    pub fn run(&self) -> Result<(), Failure> {
        let mut said = None;
        while !end::is_asked() {
            let failure = match Board::open(&self.arguments()) {
                Ok(board) => {
                    said = None;
                    self.log.info(&format!(
                        "{}: connected to {}",
                        self.named.name,
                        board.name()
                    ));
                    self.health().connect(board.hello());
                    match self.read(board) {
                        Ok(()) => return Ok(()),
                        Err(failure) => failure,
                    }
                }
                Err(failure) => failure,
            };
            if end::is_asked() {
                break;
            }
            match failure {
                Failure::Unconnected(_) | Failure::Lost(_) | Failure::Refused(_) => {}
                other => return Err(other),
            }
            let text = failure.to_string();
            self.health().disconnect(text.clone());
            if said.as_ref() != Some(&text) {
                self.log.warn(&format!("{}: {text}", self.named.name));
                said = Some(text);
            }
            end::wait(AGAIN);
        }
        Ok(())
    }

    fn arguments(&self) -> Vec<String> {
        let mut arguments = Vec::new();
        if let Some(board) = &self.named.board {
            arguments.extend(["--board".to_owned(), board.clone()]);
            if board.ends_with(".mcap") {
                arguments.extend(["--speed", "1"].map(str::to_owned));
            }
        }
        arguments.extend(self.usage.rest.iter().cloned());
        arguments
    }

    fn health(&self) -> MutexGuard<'_, Health> {
        self.health.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn read(&self, board: Board) -> Result<(), Failure> {
        let mut connection = Connection {
            converter: Converter::new(board.is_emulated()),
            pace: board.is_emulated().then(Pace::default),
            board,
            clock: Clock::default(),
            boot_id: None,
            pending: Vec::new(),
            exchanged: Instant::now(),
            not_armed: None,
        };
        loop {
            if end::is_asked() {
                return Ok(());
            }
            let received = connection.receive(self.usage.arm);
            // What came before a failure is published too.
            self.publish(&mut connection);
            match received {
                Err(Failure::Lost(text)) if connection.board.is_recording() => {
                    self.log.info(&format!("{}: {text}", self.named.name));
                    return Ok(());
                }
                other => other?,
            }
            if let Some(why) = connection.not_armed.take() {
                self.log.warn(&format!("{}: {why}", self.named.name));
                self.health().not_armed = Some(why);
            }
        }
    }

    fn publish(&self, connection: &mut Connection) {
        let frames = std::mem::take(&mut connection.pending);
        let Some(last) = frames.last().map(|frame| frame.header.time_us) else {
            return;
        };
        let mut unsent = 0;
        for frame in &frames {
            for output in connection.convert(frame, &self.frame_id) {
                unsent += u64::from(!self.topics.publish(output));
            }
        }
        let mut health = self.health();
        health.unsent += unsent;
        health.stamps_within_s = connection.clock.within_s(last);
        frames.iter().for_each(|frame| health.take(frame));
    }
}

/// A connected board.
struct Connection {
    board: Board,
    clock: Clock,
    converter: Converter,
    /// Boot of the last record.
    boot_id: Option<u32>,
    pending: Vec<Frame<Record>>,
    /// Time of the last exchange.
    exchanged: Instant,
    pace: Option<Pace>,
    /// Why the board did not let itself be armed, until it is reported.
    not_armed: Option<String>,
}

impl Connection {
    /// Receives records, and compares the clocks if it is time.
    fn receive(&mut self, arm: bool) -> Result<(), Failure> {
        let received = self.board.receive(POLL)?;
        self.pending.extend(received);
        let boot_id = self.pending.last().map(|frame| frame.header.boot_id);
        if boot_id.is_some() && boot_id != self.boot_id {
            self.boot_id = boot_id;
            self.begin(arm)?;
        } else if self.exchanged.elapsed() >= EXCHANGE {
            let before = self.pending.len();
            match self.exchange() {
                // Without an answer in time, a board that still sends stays connected: what is on its way
                // would be lost.
                Err(Failure::Refused(_)) if self.pending.len() > before => {}
                other => other?,
            }
        }
        if let (Some(pace), Some(last)) = (&mut self.pace, self.pending.last()) {
            pace.wait(last.header.time_us);
        }
        Ok(())
    }

    /// A boot of the board begins: its clock and its configuration are unknown.
    fn begin(&mut self, arm: bool) -> Result<(), Failure> {
        let simulated =
            self.board.is_emulated() || self.board.hello().is_some_and(|of| of.simulated);
        self.converter = Converter::new(simulated);
        if self.board.is_recording() {
            return Ok(());
        }
        for _ in 0..FIRST_EXCHANGES {
            self.exchange()?;
        }
        for part in [Part::Tip, Part::Springs] {
            let question = GetCalibration {
                part,
                sensor: 0,
                channel: 0,
            };
            match self.ask(&Command::GetCalibration(question)) {
                // The board does not have this part.
                Err(Failure::Refused(_)) => {}
                other => other?,
            }
        }
        if arm {
            match self.ask(&Command::Arm) {
                // The board still measures forces.
                Err(Failure::Refused(why)) => self.not_armed = Some(why),
                other => other?,
            }
        }
        Ok(())
    }

    /// Asks a question whose answer is stamped, and compares the clocks. A recording does not answer.
    fn exchange(&mut self) -> Result<(), Failure> {
        self.exchanged = Instant::now();
        if self.board.is_recording() {
            return Ok(());
        }
        let asked_ns = now_ns();
        self.ask(&Command::GetSettings)?;
        let answered_ns = now_ns();
        let answer = self
            .pending
            .iter()
            .rev()
            .find(|frame| match &frame.message {
                Record::Acknowledgement(answer) => answer.kind == Command::GetSettings.kind(),
                _ => false,
            });
        if let Some(answer) = answer {
            let header = &answer.header;
            self.clock
                .exchange(header.boot_id, asked_ns, header.time_us, answered_ns);
        }
        Ok(())
    }

    /// Sends a command that has to be accepted. What came meanwhile is pending.
    fn ask(&mut self, command: &Command) -> Result<(), Failure> {
        let line = serde_json::to_string(command)?;
        let sent = self.board.send(&line);
        // The answer is already here.
        self.pending.extend(self.board.receive(Duration::ZERO)?);
        sent
    }

    /// Messages of a record; none before the clocks are compared.
    fn convert(&mut self, frame: &Frame<Record>, frame_id: &str) -> Vec<Output> {
        let header = &frame.header;
        if self.board.is_recording() {
            self.clock.play(header.boot_id, header.time_us, now_ns());
        }
        let Some(stamp_ns) = self.clock.stamp_ns(header.boot_id, header.time_us) else {
            return Vec::new();
        };
        let header = Header {
            stamp: Time::from_ns(stamp_ns),
            frame_id: frame_id.to_owned(),
        };
        self.converter.convert(&frame.message, &header)
    }
}

/// Keeps the emulated board of this program at the pace of real time, where the computer is fast enough.
#[derive(Default)]
struct Pace(Option<(Instant, u64)>);

impl Pace {
    fn wait(&mut self, time_us: u64) {
        let &mut (began, at_us) = self.0.get_or_insert((Instant::now(), time_us));
        let passed = Duration::from_micros(time_us.saturating_sub(at_us));
        thread::sleep(passed.saturating_sub(began.elapsed()));
    }
}

/// Time of the system's clock, ns since 1970.
fn now_ns() -> i64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
