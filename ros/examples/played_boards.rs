//! Boards that play a recording, each at a TCP port, for tests: `played_boards RECORDING FIRST_PORT COUNT [RATE_HZ]`.
//!
//! The samples of the recording are sent again and again, at whole periods of the system's clock, and with them
//! what was recorded between them. Their force is their number modulo 10,000, in N, where the system's clock has
//! number 0 at 1970. So a subscriber knows which sample it has, and how wrong the stamp is. After every hundredth follows a touch. Commands are answered as a board answers them, and named on
//! standard error. A line `unplug BOARD SECONDS` on standard input
//! closes the port of a board for a time; it comes back as after a start. `mute BOARD SECONDS` leaves its commands
//! unanswered for a time.

use std::io::{self, BufRead, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use palpate::recording::{Entry, Reader};
use palpate_wire::code::{Outcome, TouchVerdict};
use palpate_wire::record::{Acknowledgement, Hello, Sample, Touch};
use palpate_wire::{Command, CommandDecoder, Message, Record, Sequencer, encode};

/// Numbers of the samples: forces beyond 10,000 N are no records.
const NUMBERS: u64 = 10_000;

type Failed = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failed> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [recording, first_port, count, rest @ ..] = arguments.as_slice() else {
        return Err("played_boards RECORDING FIRST_PORT COUNT [RATE_HZ]".into());
    };
    let rate_hz: u64 = rest.first().map_or(Ok(1000), |text| text.parse())?;
    let played = Arc::new(Played::read(Path::new(recording), 1_000_000 / rate_hz)?);
    let first_port: u16 = first_port.parse()?;
    let mut boards = Vec::new();
    for index in 0..count.parse()? {
        let [unplugged_until_us, mute_until_us] = [(); 2].map(|()| Arc::new(AtomicU64::new(0)));
        let board = Board {
            played: Arc::clone(&played),
            port: first_port + index,
            unplugged_until_us: Arc::clone(&unplugged_until_us),
            mute_until_us: Arc::clone(&mute_until_us),
        };
        boards.push((unplugged_until_us, mute_until_us));
        thread::spawn(move || board.run());
    }
    for line in io::stdin().lock().lines() {
        let line = line?;
        if let [what, board, seconds] = line.split(' ').collect::<Vec<_>>().as_slice() {
            let until_us = now_us() + (seconds.parse::<f64>()? * 1e6) as u64;
            let board = boards.get(board.parse::<usize>()?).ok_or("no such board")?;
            match *what {
                "unplug" => board.0.store(until_us, Ordering::Relaxed),
                "mute" => board.1.store(until_us, Ordering::Relaxed),
                _ => return Err("unplug or mute".into()),
            }
        }
    }
    Ok(())
}

/// What is played: samples, and what was recorded between them.
struct Played {
    hello: Hello,
    records: Vec<Record>,
    period_us: u64,
}

impl Played {
    fn read(file: &Path, period_us: u64) -> Result<Self, Failed> {
        let mut hello = None;
        let mut records = Vec::new();
        for entry in Reader::open(file).map_err(|failure| failure.to_string())? {
            match entry {
                Entry::Frame(recorded) => match recorded.frame.message {
                    Record::Acknowledgement(_) | Record::Hello(_) => {}
                    record => records.push(record),
                },
                Entry::Note(note) => {
                    let text = note.fields.get("hello");
                    if let Some(Record::Hello(of)) =
                        text.and_then(|of| serde_json::from_str(of).ok())
                    {
                        hello = Some(of);
                    }
                }
                Entry::Log(_) => {}
            }
        }
        let hello = hello.ok_or("the recording names no board")?;
        if !records
            .iter()
            .any(|record| matches!(record, Record::Sample(_)))
        {
            return Err("the recording has no samples".into());
        }
        Ok(Self {
            hello,
            records,
            period_us,
        })
    }
}

struct Board {
    played: Arc<Played>,
    port: u16,
    unplugged_until_us: Arc<AtomicU64>,
    mute_until_us: Arc<AtomicU64>,
}

/// The board's side of a connection.
struct Output {
    stream: TcpStream,
    sequencer: Sequencer,
}

impl Output {
    fn send(&mut self, time_us: u64, record: &Record) -> io::Result<()> {
        let header = self.sequencer.stamp(time_us);
        let mut buffer = [0; Record::MAX_FRAME];
        let bytes = encode(&header, record, &mut buffer);
        let bytes = bytes.map_err(|error| io::Error::other(error.to_string()))?;
        self.stream.write_all(bytes)
    }
}

impl Board {
    fn run(&self) {
        let mut boots = 0;
        loop {
            while self.is_unplugged() {
                thread::sleep(Duration::from_millis(1));
            }
            boots += 1;
            if let Err(error) = self.boot(boots) {
                eprintln!("port {}: {error}", self.port);
                thread::sleep(Duration::from_millis(10));
            }
        }
    }

    fn is_unplugged(&self) -> bool {
        now_us() < self.unplugged_until_us.load(Ordering::Relaxed)
    }

    /// Offers the port until the board is unplugged or its reader leaves.
    fn boot(&self, boots: u32) -> io::Result<()> {
        let listener = TcpListener::bind(("127.0.0.1", self.port))?;
        listener.set_nonblocking(true)?;
        let stream = loop {
            match listener.accept() {
                Ok((stream, _)) => break stream,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
            if self.is_unplugged() {
                return Ok(());
            }
            thread::sleep(Duration::from_millis(1));
        };
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        let period_us = self.played.period_us;
        // The device's clock begins at a whole period of the system's.
        let zero_us = now_us() / period_us * period_us;
        let boot_id = u32::from(self.port) << 16 | boots;
        let commands = stream.try_clone()?;
        let output = Arc::new(Mutex::new(Output {
            stream,
            sequencer: Sequencer::new(boot_id),
        }));
        let answers = Arc::clone(&output);
        let hello = self.played.hello.clone();
        let mute_until_us = Arc::clone(&self.mute_until_us);
        let answering =
            thread::spawn(move || answer(commands, &answers, &hello, zero_us, &mute_until_us));
        // An end of the connection is no error here: the reader has left.
        let _ = self.play(&output, zero_us);
        let output = output.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = output.stream.shutdown(Shutdown::Both);
        drop(output);
        let _ = answering.join();
        Ok(())
    }

    fn play(&self, output: &Mutex<Output>, zero_us: u64) -> io::Result<()> {
        let period_us = self.played.period_us;
        let mut time_us = 0;
        for record in self.played.records.iter().cycle() {
            if matches!(record, Record::Sample(_)) {
                time_us += period_us;
                let ahead_us = (zero_us + time_us).saturating_sub(now_us());
                thread::sleep(Duration::from_micros(ahead_us));
            }
            if self.is_unplugged() {
                break;
            }
            let mut output = output.lock().unwrap_or_else(PoisonError::into_inner);
            let number = (zero_us + time_us) / period_us % NUMBERS;
            output.send(time_us, &numbered(record, number))?;
            let index = time_us / period_us;
            if matches!(record, Record::Sample(_)) && index.is_multiple_of(100) {
                output.send(time_us, &Record::Touch(touch(index.is_multiple_of(200))))?;
            }
        }
        Ok(())
    }
}

/// The record, with this force if it is a sample.
fn numbered(record: &Record, number: u64) -> Record {
    match record {
        Record::Sample(sample) => Record::Sample(Sample {
            force_n: Some(number as f32),
            ..sample.clone()
        }),
        other => other.clone(),
    }
}

/// A press beside the centre, or none; tests/test_node.py knows the numbers.
fn touch(is_inside: bool) -> Touch {
    let value = |value| Some(value).filter(|_| is_inside);
    Touch {
        verdict: if is_inside {
            TouchVerdict::Inside
        } else {
            TouchVerdict::Clear
        },
        x_m: value(1.5e-3),
        y_m: value(-2.5e-3),
        x_sigma_m: value(2e-5),
        y_sigma_m: value(3e-5),
        correlation: value(0.25),
        force_n: value(4.0),
        force_uncertainty: value(0.02),
        radius_m: value(2e-3),
        radius_uncertainty: value(0.15),
        chi_square: value(12.5),
    }
}

/// Accepts every command at once, and identifies the board; drops commands while the board is mute.
fn answer(
    mut commands: TcpStream,
    output: &Mutex<Output>,
    hello: &Hello,
    zero_us: u64,
    mute_until_us: &AtomicU64,
) {
    let mut decoder = CommandDecoder::new();
    let mut buffer = [0; 4096];
    while let Ok(count @ 1..) = commands.read(&mut buffer) {
        for frame in decoder
            .frames(buffer.get(..count).unwrap_or_default())
            .flatten()
        {
            if now_us() < mute_until_us.load(Ordering::Relaxed) {
                continue;
            }
            let answer =
                Acknowledgement::new(&frame.header, frame.message.kind(), Outcome::Accepted);
            let mut output = output.lock().unwrap_or_else(PoisonError::into_inner);
            eprintln!("{}", frame.message.name());
            let time_us = now_us() - zero_us;
            if frame.message == Command::Identify {
                let _ = output.send(time_us, &Record::Hello(hello.clone()));
            }
            let _ = output.send(time_us, &Record::Acknowledgement(answer));
        }
    }
}

/// Time of the system's clock, us since 1970.
fn now_us() -> u64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    u64::try_from(since.as_micros()).unwrap_or(u64::MAX)
}
