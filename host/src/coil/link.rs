//! The way to an instrument's firmware: on a board behind a debug probe, or on the emulated one.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::Args;
use palpate_emulator::{Instrument, Options};
use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_wire::code::Outcome;
use palpate_wire::{Command, Message, Record, RecordDecoder, Sequencer, encode};

use crate::failure::Failure;
use crate::image::{self, Program};
use crate::instrument::coil;

/// How a board is reached.
#[derive(Args)]
// Its group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Arguments {
    /// Where a probe's server hands on the board's records (channel 1 of its RTT), as HOST:PORT
    #[arg(
        long,
        value_name = "HOST:PORT",
        required_unless_present = "emulated",
        requires = "commands",
        conflicts_with = "emulated"
    )]
    records: Option<String>,
    /// Where it takes commands for the board (channel 0)
    #[arg(long, value_name = "HOST:PORT", requires = "records")]
    commands: Option<String>,
    /// The firmware's image on the emulated board instead
    #[arg(long)]
    pub(super) emulated: bool,
    #[command(flatten)]
    image: image::Arguments,
    /// The stack that the coil belongs to, by name or file, for its data: without it a board has
    /// to know them already. The emulated board has this coil, `ultrasoft` without a word
    #[arg(long, value_name = "STACK")]
    stack: Option<String>,
    /// Which sensor of the stack the emulated board has
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// The stack of the emulated board where none is named.
const USUAL: &str = "ultrasoft";
/// How long a board's answer may take. It waits for a test of the coil itself; a probe's server
/// polls every 10 ms.
const PATIENCE: Duration = Duration::from_secs(5);
/// From one poll of a probe's server to the next.
const LOOK: Duration = Duration::from_millis(2);
/// From one word to the board to the next while it drives a current: it waits for 100 ms.
pub(super) const WORD_S: f64 = 0.04;

/// A record with its time, s of the device.
pub(super) type Reported = (f64, Record);

/// A board, spoken to.
pub(super) struct Link {
    way: Way,
    received: Vec<Reported>,
}

enum Way {
    Probe(Box<Probe>),
    Emulated(Box<Instrument>),
}

struct Probe {
    records: TcpStream,
    commands: TcpStream,
    decoder: RecordDecoder,
    sequencer: Sequencer,
}

/// True current of the emulated board: charge, A s, and time, s, so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Truth {
    pub(super) charge_a_s: f64,
    pub(super) time_s: f64,
}

impl Arguments {
    /// Connects, and sends the coil's data if they are named.
    pub(super) fn open(&self) -> Result<Link, Failure> {
        let stack = match (&self.stack, self.emulated) {
            (Some(name), _) => Some(Stack::named(name, Path::new(""))?),
            (None, true) => Some(Stack::builtin(USUAL).map_err(LoadError::from)?),
            (None, false) => None,
        };
        let mut link = match (&self.records, &self.commands, &stack) {
            (Some(records), Some(commands), _) => {
                self.image.none_without("--emulated")?;
                Link::probe(records, commands)?
            }
            (_, _, Some(stack)) => self.emulated(stack)?,
            _ => {
                return Err(Failure::Argument(
                    "name --records and --commands, or --emulated".into(),
                ));
            }
        };
        link.must(&Command::Disarm)?;
        if let Some(stack) = &stack {
            let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
            let plant = draw(stack, &disturbances, self.seed);
            link.must(&Command::SetCoil(coil(&plant)))?;
        }
        Ok(link)
    }

    fn emulated(&self, stack: &Stack) -> Result<Link, Failure> {
        let (_, image) = self.image.load(Program::Firmware)?;
        let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
        let plant = draw(stack, &disturbances, self.seed);
        let world = World::new(&plant, Switches::all(), Setup::default())
            .map_err(|error| Failure::Refused(error.to_string()))?;
        let mut board = Instrument::new(&image, world, Options::default());
        board.start().map_err(stopped)?;
        Ok(Link {
            way: Way::Emulated(Box::new(board)),
            received: Vec::new(),
        })
    }
}

fn stopped(failure: palpate_emulator::ImageFailure) -> Failure {
    Failure::Refused(failure.to_string())
}

impl Link {
    fn probe(records: &str, commands: &str) -> Result<Self, Failure> {
        let probe = Probe {
            records: connect(records, 1)?,
            commands: connect(commands, 0)?,
            decoder: RecordDecoder::new(),
            sequencer: Sequencer::new(0),
        };
        let mut link = Self {
            way: Way::Probe(Box::new(probe)),
            received: Vec::new(),
        };
        // Its answer tells which run it is that commands have to name.
        link.must(&Command::Identify)?;
        Ok(link)
    }

    /// Sends a command that has to be accepted; returns the device's time of the answer, s.
    pub(super) fn must(&mut self, command: &Command) -> Result<f64, Failure> {
        let (at_s, outcome) = self.ask(command)?;
        if outcome == Outcome::Accepted {
            return Ok(at_s);
        }
        Err(Failure::Refused(match outcome {
            Outcome::NotCalibrated => "the board does not know its coil, and so not how hot it \
                becomes: name its stack with --stack, or send set_coil"
                .to_owned(),
            Outcome::Faulted => format!(
                "the board stands in a fault{}; docs/faults.md says what to do and how it is cleared",
                self.fault()
                    .map_or_else(String::new, |of| format!(" ({of})"))
            ),
            other => format!(
                "the board answers {} to {}: {}",
                other,
                command.name(),
                other.meaning().trim()
            ),
        }))
    }

    fn fault(&self) -> Option<String> {
        self.received
            .iter()
            .rev()
            .find_map(|(_, record)| match record {
                Record::Fault(fault) if fault.active => Some(fault.code.to_string()),
                _ => None,
            })
    }

    fn ask(&mut self, command: &Command) -> Result<(f64, Outcome), Failure> {
        let kind = command.kind();
        let sequence = match &mut self.way {
            Way::Emulated(board) => {
                board.send(command.clone()).map_err(stopped)?;
                None
            }
            Way::Probe(probe) => Some(probe.send(command)?),
        };
        let begin = Instant::now();
        loop {
            let before = self.received.len();
            self.listen()?;
            let answer = self.received.get(before..).into_iter().flatten().rev();
            let mut answer = answer.filter_map(|(at_s, record)| match record {
                Record::Acknowledgement(of)
                    if of.kind == kind && sequence.is_none_or(|number| number == of.command) =>
                {
                    Some((*at_s, of.outcome))
                }
                _ => None,
            });
            if let Some(found) = answer.next() {
                return Ok(found);
            }
            if sequence.is_none() || begin.elapsed() > PATIENCE {
                return Err(Failure::Refused(format!(
                    "the board does not answer {}. Does the firmware run, and are the probe's \
                     servers at channel 1 (records) and channel 0 (commands)?",
                    command.name()
                )));
            }
            sleep(LOOK);
        }
    }

    /// Takes what has come.
    fn listen(&mut self) -> Result<(), Failure> {
        match &mut self.way {
            Way::Emulated(board) => {
                let records = board.take_records().into_iter();
                self.received
                    .extend(records.map(|(at, record)| (at.as_ticks() as f64 * 1e-6, record)));
            }
            Way::Probe(probe) => probe.listen(&mut self.received)?,
        }
        Ok(())
    }

    /// Lets time pass: the board's, or that of the emulation. A fault ends it.
    pub(super) fn pass(&mut self, time_s: f64) -> Result<(), Failure> {
        let before = self.received.len();
        match &mut self.way {
            Way::Emulated(board) => {
                let end = board.now() + Time::from_secs_f64(time_s);
                board.run_until(end).map_err(stopped)?;
                self.listen()?;
            }
            Way::Probe(_) => {
                let begin = Instant::now();
                while begin.elapsed().as_secs_f64() < time_s {
                    sleep(LOOK);
                    self.listen()?;
                }
            }
        }
        self.no_fault(before)
    }

    /// The same while a current is driven: says something now and then.
    pub(super) fn drive_on(&mut self, time_s: f64) -> Result<(), Failure> {
        let mut left_s = time_s;
        while left_s > 0.0 {
            self.pass(left_s.min(WORD_S))?;
            self.must(&Command::GetSettings)?;
            left_s -= WORD_S;
        }
        Ok(())
    }

    fn no_fault(&self, since: usize) -> Result<(), Failure> {
        let mut new = self.received.get(since..).into_iter().flatten();
        let fault = new.find_map(|(_, record)| match record {
            Record::Fault(fault) if fault.active => Some(fault.code),
            _ => None,
        });
        fault.map_or(Ok(()), |code| {
            Err(Failure::Refused(format!(
                "the board: {code}. {} docs/faults.md says what to do.",
                code.meaning().trim()
            )))
        })
    }

    /// Waits until a record says something.
    pub(super) fn wait_for<T>(
        &mut self,
        patience_s: f64,
        what: &str,
        of: impl Fn(&Reported) -> Option<T>,
    ) -> Result<T, Failure> {
        let mut seen = 0;
        let mut left_s = patience_s;
        loop {
            let new = self.received.get(seen..).into_iter().flatten();
            if let Some(found) = new.rev().find_map(&of) {
                return Ok(found);
            }
            if left_s <= 0.0 {
                return Err(Failure::Refused(format!("the board sent no {what}")));
            }
            seen = self.received.len();
            self.pass(0.01)?;
            left_s -= 0.01;
        }
    }

    /// The records that have been received and not been taken.
    pub(super) fn take(&mut self) -> Vec<Reported> {
        std::mem::take(&mut self.received)
    }

    /// True current so far; nothing on a board.
    pub(super) fn truth(&mut self) -> Option<Truth> {
        match &mut self.way {
            Way::Probe(_) => None,
            Way::Emulated(board) => {
                let totals = board.board_mut().circuit().totals();
                Some(Truth {
                    charge_a_s: totals.charge_a_s,
                    time_s: totals.time_s,
                })
            }
        }
    }
}

impl Drop for Link {
    /// Whatever ended this, no current goes on: the board would end it by itself after 100 ms.
    fn drop(&mut self) {
        if let Way::Probe(probe) = &mut self.way {
            let _ = probe.send(&Command::Disarm);
        }
    }
}

fn connect(address: &str, channel: u8) -> Result<TcpStream, Failure> {
    let unreachable = |error: std::io::Error| {
        Failure::Refused(format!(
            "{address}: {error}. Start a server for channel {channel} of the board's RTT there, as \
             docs/bring-up.md says."
        ))
    };
    let stream = TcpStream::connect(address).map_err(unreachable)?;
    stream.set_nonblocking(true).map_err(unreachable)?;
    Ok(stream)
}

impl Probe {
    fn send(&mut self, command: &Command) -> Result<u32, Failure> {
        let header = self.sequencer.stamp(0);
        let mut buffer = [0; Command::MAX_FRAME];
        let bytes = encode(&header, command, &mut buffer)
            .map_err(|error| Failure::Refused(format!("{}: {error}", command.name())))?;
        self.commands.write_all(bytes).map_err(gone)?;
        Ok(header.sequence)
    }

    fn listen(&mut self, received: &mut Vec<Reported>) -> Result<(), Failure> {
        let mut bytes = [0; 4096];
        // The other direction of the command channel has the board's log.
        read(&mut self.commands, &mut bytes)?;
        let length = read(&mut self.records, &mut bytes)?;
        let new = bytes.get(..length).unwrap_or_default();
        // A frame that began before we came, or was damaged, is one that is not there.
        for frame in self.decoder.frames(new).flatten() {
            self.sequencer.address(frame.header.boot_id);
            received.push((frame.header.time_us as f64 * 1e-6, frame.message));
        }
        Ok(())
    }
}

/// What has come; none if nothing has.
fn read(stream: &mut TcpStream, to: &mut [u8]) -> Result<usize, Failure> {
    match stream.read(to) {
        Ok(0) => Err(Failure::Refused(
            "the probe's server has closed the connection".to_owned(),
        )),
        Ok(length) => Ok(length),
        Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(0),
        Err(error) => Err(gone(error)),
    }
}

fn gone(error: std::io::Error) -> Failure {
    Failure::Refused(format!("the probe's server: {error}"))
}
