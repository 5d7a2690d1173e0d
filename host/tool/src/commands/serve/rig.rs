//! The simulated bench of the served board: load cell and stage, with the lines of text of a real
//! gauge's program (docs/calibration.md).
//!
//! A program connects and sends `force` or `stage` as its first line. `mount` puts a specimen on
//! the stage: it powers the board off and on, with a sensor that was never pressed.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::ops::RangeInclusive;

use palpate_calibration::session::Pressed;
use palpate_cli::failure::Failure;
use palpate_sim::Time;
use palpate_sim::parameters::Parameters;
use palpate_sim::rig::{BareRig, Gauges, RigReading};
use palpate_sim::switches::Switches;
use palpate_simulate::bench::on_rig;

use super::{address_of, listen};
use crate::board::emulated::PluggedBoard;

/// Interval between two readings of a gauge.
const INTERVAL: Time = Time::from_ms(5);
/// Position of the stage, block on block, at the start, m.
const BARE_START_M: f64 = -10e-6;
/// Maximum number of bytes that wait for a program; a program that does not read is gone.
const WAITING: usize = 64 * 1024;
/// Longest line of a program, bytes.
const LONGEST_LINE: usize = 1024;
/// Greatest position, m, and range of speeds of the stage, m/s.
const FARTHEST_M: f64 = 1.0;
const SPEEDS_M_PER_S: RangeInclusive<f64> = 1e-6..=1.0;

/// The bench with the connected gauge programs.
pub(super) struct RigPort {
    listener: TcpListener,
    programs: Vec<GaugeClient>,
    plant: Parameters,
    bench: MountedBench,
    /// Time of the next reading, and of the end of the stage's movement.
    next: Time,
    arrives: Option<Time>,
}

/// The mounted bench.
enum MountedBench {
    /// A specimen above the sensor.
    Sensor(Box<Gauges>),
    /// Block on block, with the stage at a position, m.
    Bare(Box<BareRig>, f64),
}

/// Connection to the program of a gauge.
struct GaugeClient {
    stream: TcpStream,
    kind: Option<Kind>,
    received: Vec<u8>,
    waiting: Vec<u8>,
    /// Whether the program is not a gauge's: its first line names no gauge, or a line is too long.
    is_stranger: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Force,
    Stage,
}

impl RigPort {
    /// Listens for the gauge programs of a plant's bench, without contact.
    pub(super) fn listen(address: SocketAddr, plant: Parameters) -> Result<Self, Failure> {
        let (_, gauges) = on_rig(&plant, Switches::all(), Pressed::Block, 0.0)?.into_parts();
        Ok(Self {
            listener: listen(address, "--rig")?,
            programs: Vec::new(),
            plant,
            bench: MountedBench::Sensor(Box::new(gauges)),
            next: Time::ZERO,
            arrives: None,
        })
    }

    /// Address of the port.
    pub(super) fn address(&self) -> String {
        address_of(&self.listener)
    }

    /// Handles the programs' commands, and sends the due lines.
    pub(super) fn serve(&mut self, board: &mut PluggedBoard) -> Result<(), Failure> {
        if let Ok((stream, _)) = self.listener.accept()
            && stream.set_nonblocking(true).is_ok()
        {
            let _ = stream.set_nodelay(true);
            self.programs.push(GaugeClient::new(stream));
        }
        let lines: Vec<String> = self
            .programs
            .iter_mut()
            .flat_map(GaugeClient::lines)
            .collect();
        for line in lines {
            if let Some(answer) = self.answer(&line, board)? {
                self.say(Kind::Stage, &answer);
            }
        }
        if self.arrives.is_some_and(|time| board.now() >= time) {
            self.arrives = None;
            self.say(Kind::Stage, "ok");
        }
        if board.now() >= self.next {
            self.next = board.now() + INTERVAL;
            let time_s = board.now().as_secs_f64();
            let reading = self.read(board);
            self.say(Kind::Force, &format!("{time_s:.6} {:.6}", reading.force_n));
            self.say(Kind::Stage, &format!("{time_s:.6} {:.9}", reading.stage_m));
        }
        self.programs.retain_mut(GaugeClient::flush);
        Ok(())
    }

    fn say(&mut self, kind: Kind, line: &str) {
        let meant = self.programs.iter_mut();
        for program in meant.filter(|program| program.kind == Some(kind)) {
            program.waiting.extend(line.as_bytes());
            program.waiting.push(b'\n');
        }
    }

    fn read(&mut self, board: &mut PluggedBoard) -> RigReading {
        match &mut self.bench {
            MountedBench::Sensor(gauges) => gauges.read(board.world_mut()),
            MountedBench::Bare(bare, place_m) => {
                let force_n = place_m.max(0.0) / self.plant.rig.frame_m_per_n;
                let reading = bare.press(force_n);
                RigReading {
                    stage_m: reading.stage_m + place_m.min(0.0),
                    ..reading
                }
            }
        }
    }

    /// Handles a line. Returns the answer if it is immediate.
    fn answer(&mut self, line: &str, board: &mut PluggedBoard) -> Result<Option<String>, Failure> {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["move", place, speed] => {
                let (Some(place_m), Some(speed_m_per_s)) = (
                    within(place, -FARTHEST_M..=FARTHEST_M),
                    within(speed, SPEEDS_M_PER_S),
                ) else {
                    return Ok(Some(format!(
                        "error move takes a position within {FARTHEST_M} m and a speed of {:e} to {} \
                         m/s",
                        SPEEDS_M_PER_S.start(),
                        SPEEDS_M_PER_S.end()
                    )));
                };
                self.send_to(place_m, speed_m_per_s, board);
                Ok(None)
            }
            ["mount", rest @ ..] => match specimen(rest) {
                Some(specimen) => self.mount(specimen, board).map(Some),
                None => Ok(Some("error no such specimen".to_owned())),
            },
            _ => Ok(Some(format!("error {line:?} is not a command"))),
        }
    }

    fn send_to(&mut self, place_m: f64, speed_m_per_s: f64, board: &mut PluggedBoard) {
        let now = board.now();
        match &mut self.bench {
            MountedBench::Sensor(_) => {
                let world = board.world_mut();
                let way_m = (place_m - world.planned_press_m()).abs();
                world.move_press(place_m, speed_m_per_s);
                self.arrives = Some(now + Time::from_secs_f64(way_m / speed_m_per_s));
            }
            MountedBench::Bare(_, at_m) => {
                *at_m = place_m;
                self.arrives = Some(now);
            }
        }
    }

    /// Puts a specimen on the stage. Returns the answer.
    fn mount(
        &mut self,
        specimen: Option<Pressed>,
        board: &mut PluggedBoard,
    ) -> Result<String, Failure> {
        let on_stage = specimen.unwrap_or(Pressed::Block);
        let (world, gauges) = match on_rig(&self.plant, Switches::all(), on_stage, 0.0) {
            Ok(rig) => rig.into_parts(),
            Err(error) => return Ok(format!("error {error}")),
        };
        board.power_on_in(world)?;
        self.bench = match specimen {
            Some(_) => MountedBench::Sensor(Box::new(gauges)),
            None => {
                let bare = BareRig::new(&self.plant, Switches::all());
                MountedBench::Bare(Box::new(bare), BARE_START_M)
            }
        };
        Ok("ok".to_owned())
    }
}

/// Parses a number within a range.
fn within(text: &str, range: RangeInclusive<f64>) -> Option<f64> {
    let number = text.parse().ok()?;
    range.contains(&number).then_some(number)
}

/// Parses the argument of `mount`: `Some(Some(_))` is a specimen above the sensor, `Some(None)`
/// block on block. For `nothing` a block stays above the sensor.
fn specimen(words: &[&str]) -> Option<Option<Pressed>> {
    match words {
        ["nothing" | "block"] => Some(Some(Pressed::Block)),
        ["bare"] => Some(None),
        ["spring", n_per_m] => {
            let n_per_m = n_per_m.parse().ok()?;
            Some(Some(Pressed::Spring { n_per_m }))
        }
        ["block-beside", distance_m, direction_rad] => Some(Some(Pressed::BlockBeside {
            distance_m: distance_m.parse().ok()?,
            direction_rad: direction_rad.parse().ok()?,
        })),
        ["block-tilted", angle_rad, direction_rad] => Some(Some(Pressed::BlockTilted {
            angle_rad: angle_rad.parse().ok()?,
            direction_rad: direction_rad.parse().ok()?,
        })),
        _ => None,
    }
}

impl GaugeClient {
    const fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            kind: None,
            received: Vec::new(),
            waiting: Vec::new(),
            is_stranger: false,
        }
    }

    /// Complete received lines, except the first, which names the gauge. Any other first line, as
    /// of a browser, leads to rejection.
    fn lines(&mut self) -> Vec<String> {
        let mut bytes = [0; 1024];
        if let Ok(count) = self.stream.read(&mut bytes) {
            self.received.extend(bytes.iter().take(count));
        }
        let mut lines = Vec::new();
        while !self.is_stranger
            && let Some(end) = self.received.iter().position(|byte| *byte == b'\n')
        {
            let line: Vec<u8> = self.received.drain(..=end).collect();
            let line = String::from_utf8_lossy(&line).trim().to_owned();
            match (self.kind, line.as_str()) {
                (None, "force") => self.kind = Some(Kind::Force),
                (None, "stage") => self.kind = Some(Kind::Stage),
                (None, _) => self.is_stranger = true,
                (Some(_), _) => lines.push(line),
            }
        }
        self.is_stranger |= self.received.len() > LONGEST_LINE;
        lines
    }

    /// Sends waiting bytes as far as the program reads them. Returns whether it is still connected.
    fn flush(&mut self) -> bool {
        let is_there = match self.stream.peek(&mut [0]) {
            Ok(count) => count > 0,
            Err(error) => error.kind() == ErrorKind::WouldBlock,
        };
        match self.stream.write(&self.waiting) {
            Ok(count) => drop(self.waiting.drain(..count)),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => return false,
        }
        is_there && !self.is_stranger && self.waiting.len() < WAITING
    }
}
