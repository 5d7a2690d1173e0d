//! Names of boards, and the search for a board without a name.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use palpate_cli::quantity::within;
use palpate_sim::parameters::Parameters;
use palpate_sim::stack::Stack;

use super::emulated::Emulated;
use super::playback::Playback;
use super::probe;
use super::serial::{self, Serial};
use super::tcp::{Probe, Tcp};
use super::transport::Transport;
use crate::board::emulated;
use crate::board::link::Link;
use crate::board::log;

/// How a board is reached.
#[derive(Args)]
// Skipped: the group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Arguments {
    /// The board: a serial port or the board's serial number; `emulated`; `tcp:HOST:PORT`, as of
    /// `palpate serve-emulated`; FILE.mcap, a recording; `probe`, behind the debug probe that is plugged
    /// in, or `probe:VID:PID:SERIAL`; `probe:HOST:PORT,HOST:PORT`, a debug probe's server for records
    /// (channel 1) and commands (channel 0). Without it, the one that is plugged in
    #[arg(long, value_name = "BOARD")]
    board: Option<String>,
    /// How fast a recording is played: 1 is as recorded, max as fast as possible
    #[arg(long, value_name = "FACTOR", value_parser = speed, allow_negative_numbers = true)]
    speed: Option<Speed>,
    #[command(flatten)]
    pub(crate) emulated: emulated::Arguments,
    #[command(flatten)]
    log: log::Arguments,
}

/// Speed of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Speed {
    /// Multiple of the recorded speed.
    Times(f64),
    AsFastAsPossible,
}

fn speed(text: &str) -> Result<Speed, String> {
    if text == "max" {
        return Ok(Speed::AsFastAsPossible);
    }
    within(SLOWEST, FASTEST, "")(text)
        .map(Speed::Times)
        .map_err(|allowed| format!("{allowed}, or max"))
}

/// Slowest speed: plays one sample of a 1 kHz recording per second.
const SLOWEST: f64 = 0.001;
/// Fastest speed: more than any computer reaches.
const FASTEST: f64 = 1e6;
/// Endings of the names of recordings: of complete ones, and of those that are being written.
const RECORDINGS: [&str; 2] = [".mcap", ".mcap.partial"];

/// A parsed board name.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Address {
    Found,
    Recording(PathBuf),
    Emulated,
    Tcp(String),
    /// A debug probe at this computer, by its name; `None` for the only one.
    DebugProbe(Option<String>),
    /// Servers of a debug probe, for records and for commands.
    Probe(String, String),
    Serial(String),
}

impl Address {
    fn parse(name: Option<&str>) -> Result<Self, Failure> {
        let Some(name) = name else {
            return Ok(Self::Found);
        };
        if name == "emulated" {
            return Ok(Self::Emulated);
        }
        if RECORDINGS.iter().any(|ending| name.ends_with(ending)) {
            return Ok(Self::Recording(PathBuf::from(name)));
        }
        if let Some(address) = name.strip_prefix("tcp:") {
            return Ok(Self::Tcp(address.to_owned()));
        }
        if name == "probe" {
            return Ok(Self::DebugProbe(None));
        }
        let Some(probe) = name.strip_prefix("probe:") else {
            return Ok(Self::Serial(name.to_owned()));
        };
        if let Some((records, commands)) = probe.split_once(',') {
            return Ok(Self::Probe(records.to_owned(), commands.to_owned()));
        }
        let is_number = |part: &str| u16::from_str_radix(part, 16).is_ok();
        match probe.split(':').collect::<Vec<_>>().as_slice() {
            [vendor, product, ..] if is_number(vendor) && is_number(product) => {
                Ok(Self::DebugProbe(Some(probe.to_owned())))
            }
            _ => Err(Failure::Argument(format!(
                "--board {name}: name a debug probe by its USB numbers, as probe:2e8a:000c or \
                 probe:2e8a:000c:E6614103E7, or two servers for records and for commands, as \
                 probe:localhost:9091,localhost:9090"
            ))),
        }
    }
}

impl Arguments {
    /// Whether the user named a board.
    pub(crate) const fn is_named(&self) -> bool {
        self.board.is_some()
    }

    /// Returns sensor design and parameters: of the emulated board, or as named for a real one.
    pub(crate) fn sensor(&self) -> Result<Option<(Stack, Parameters)>, Failure> {
        if self.is_emulated() {
            return self.emulated.stack_and_plant().map(Some);
        }
        self.emulated.expected()
    }

    /// Whether the name is that of the emulated board.
    pub(crate) fn is_emulated(&self) -> bool {
        self.board.as_deref() == Some("emulated")
    }

    /// Writes firmware to the start of the flash through the named debug probe, and starts it.
    /// Returns `false` if no debug probe is named.
    ///
    /// # Errors
    /// If the probe does not reach a board, or the flash refuses the firmware.
    pub(crate) fn flash_through_probe(&self, firmware: &[u8]) -> Result<bool, Failure> {
        match Address::parse(self.board.as_deref())? {
            Address::DebugProbe(name) => probe::flash(name.as_deref(), firmware).map(|()| true),
            _ => Ok(false),
        }
    }

    /// Whether the board's data are simulated.
    pub(crate) fn is_simulated(&self, link: &Link) -> bool {
        self.is_emulated() || link.hello().is_some_and(|hello| hello.simulated)
    }

    /// Connects, and asks the board for its identity.
    pub(crate) fn open(&self) -> Result<Link, Failure> {
        self.open_pressed(Run::AsFastAsItCan, None)
    }

    /// Connects; an emulated board repeatedly presses a spring of this multiple of the sensing
    /// layer's stiffness.
    pub(crate) fn open_pressed(&self, run: Run, press: Option<f64>) -> Result<Link, Failure> {
        let address = Address::parse(self.board.as_deref())?;
        if self.speed.is_some() && !matches!(address, Address::Recording(_)) {
            return Err(Failure::Argument(
                "--speed is for a recording: name one with --board FILE.mcap".to_owned(),
            ));
        }
        match address {
            Address::Emulated => self.open_emulated(run, press),
            _ if press.is_some() => Err(Failure::Argument(
                "only the emulated board can press a load: leave --load out, or add \
                 --board emulated"
                    .to_owned(),
            )),
            Address::Recording(file) => self.open_recording(&file, run),
            address => self.open_real(address),
        }
    }

    fn open_recording(&self, file: &Path, run: Run) -> Result<Link, Failure> {
        self.emulated.none_for_a_real_board()?;
        let usual = match run {
            Run::AsFastAsItCan => Speed::AsFastAsPossible,
            Run::AtRealPace => Speed::Times(1.0),
        };
        let speed = match self.speed.unwrap_or(usual) {
            Speed::Times(times) => Some(times),
            Speed::AsFastAsPossible => None,
        };
        let (playback, hello) = Playback::open(file, speed)?;
        let name = file.display().to_string();
        Ok(Link::play(name, Box::new(playback), hello))
    }

    fn open_real(&self, address: Address) -> Result<Link, Failure> {
        self.emulated.none_for_a_real_board()?;
        if !matches!(address, Address::Probe(..) | Address::DebugProbe(_)) {
            self.log.none_without(
                "it is available through a debug probe (--board probe) and from the emulated board",
            )?;
        }
        let log = self.log.load(None)?;
        let (name, transport) = reach(address)?;
        Link::open(name, transport, log)
    }

    fn open_emulated(&self, run: Run, press: Option<f64>) -> Result<Link, Failure> {
        let model = self.emulated.load()?;
        let log = self.log.load(Some(&model.image_file))?;
        let board = model.plug(press)?;
        let transport = Emulated::new(board, run == Run::AtRealPace);
        Link::open("the emulated board".to_owned(), Box::new(transport), log)
    }
}

/// Speed of an emulated board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Run {
    /// As fast as this computer can.
    AsFastAsItCan,
    /// At the pace of real time.
    AtRealPace,
}

fn reach(address: Address) -> Result<(String, Box<dyn Transport>), Failure> {
    match address {
        Address::Tcp(to) => {
            let tcp = Tcp::open(&to).map_err(|error| unreachable_server(&to, &error))?;
            Ok((to, Box::new(tcp)))
        }
        Address::Probe(records, commands) => {
            let probe = Probe::open(&records, &commands);
            let probe = probe.map_err(|error| unreachable_probe(&records, &commands, &error))?;
            Ok((records, Box::new(probe)))
        }
        Address::DebugProbe(name) => probe::reach(name.as_deref()),
        Address::Serial(name) => reach_serial(Some(&name)),
        Address::Found | Address::Emulated | Address::Recording(_) => reach_serial(None),
    }
}

fn unreachable_server(to: &str, error: &io::Error) -> Failure {
    Failure::Unconnected(Finding::new(
        "unreachable",
        format!("{to}: {error}"),
        "Start `palpate serve-emulated` there, or name another address with --board",
    ))
}

fn unreachable_probe(records: &str, commands: &str, error: &io::Error) -> Failure {
    Failure::Unconnected(Finding::new(
        "unreachable",
        format!("{records} and {commands}: {error}"),
        "Start a server for channels 1 (records) and 0 (commands) of the board's RTT there, as \
         docs/bring-up.md says",
    ))
}

fn reach_serial(name: Option<&str>) -> Result<(String, Box<dyn Transport>), Failure> {
    let ports = ports()?;
    let path = choose(name, &ports)?;
    let is_listed = ports.iter().any(|port| port.path == path);
    let port = Serial::open(&path).map_err(|error| unopened(&path, is_listed, &error))?;
    Ok((path, Box::new(port)))
}

/// Lists the serial ports of all connected boards.
///
/// # Errors
/// If the system does not list its ports.
pub(crate) fn ports() -> Result<Vec<serial::Port>, Failure> {
    serial::ports()
        .map_err(|error| Failure::Refused(format!("the serial ports cannot be listed: {error}")))
}

/// Opens the board at a listed serial port.
///
/// # Errors
/// If the port cannot be opened, or no palpate firmware answers there.
pub(crate) fn open_port(path: &str) -> Result<Link, Failure> {
    let port = Serial::open(path).map_err(|error| unopened(path, true, &error))?;
    Link::open(path.to_owned(), Box::new(port), None)
}

/// Returns the port with this name; without a name, the only port.
fn choose(name: Option<&str>, ports: &[serial::Port]) -> Result<String, Failure> {
    if let Some(name) = name {
        let is_meant = |port: &&serial::Port| {
            let number = port.serial_number.as_deref();
            number.is_some_and(|number| number.eq_ignore_ascii_case(name))
        };
        let path = ports.iter().find(is_meant).map(|port| port.path.clone());
        return Ok(path.unwrap_or_else(|| name.to_owned()));
    }
    match ports {
        [port] => Ok(port.path.clone()),
        [] => Err(Failure::Unconnected(no_board())),
        several => Err(Failure::Argument(format!(
            "{} boards are plugged in: name one with --board: {}",
            several.len(),
            listed(several)
        ))),
    }
}

/// The finding that no board is connected.
pub(crate) fn no_board() -> Finding {
    Finding::new(
        "no_board",
        "no board is plugged in",
        "Connect one by USB, with a cable that carries data: its LED lights up. Or name one with --board; \
         --board emulated needs none",
    )
}

fn listed(ports: &[serial::Port]) -> String {
    let names = ports.iter().map(|port| match &port.serial_number {
        Some(number) => format!("{number} ({})", port.path),
        None => port.path.clone(),
    });
    names.collect::<Vec<_>>().join(", ")
}

/// Udev rule that lets every user of a Linux computer open a board's port.
pub(crate) const UDEV_RULE: &str = "SUBSYSTEMS==\"usb\", ATTRS{idVendor}==\"1209\", \
     ATTRS{idProduct}==\"0001\", MODE=\"0660\", TAG+=\"uaccess\"";

/// Failure for a port that cannot be opened, with cause and remedy. `is_listed` says that the port
/// exists, since Windows reports a port in use like a missing one.
fn unopened(path: &str, is_listed: bool, error: &io::Error) -> Failure {
    let (finding, action) = match error.kind() {
        // The library reports a locked port as a missing one.
        _ if is_busy(error) => (
            "busy",
            "Another program has it open: close that first".into(),
        ),
        ErrorKind::NotFound if is_listed => (
            "busy",
            "Another program has it open: close that first, or plug the board in again".into(),
        ),
        ErrorKind::PermissionDenied => (
            "forbidden",
            format!(
                "This user has no permission to open it. On Linux, write this line to \
                 /etc/udev/rules.d/70-palpate.rules and plug the board in again:\n  {UDEV_RULE}"
            ),
        ),
        ErrorKind::NotFound => (
            "no_such_port",
            "There is no such port, and no board with this serial number: `palpate devices` lists all"
                .into(),
        ),
        _ => ("unopened", "Unplug the board and plug it in again".into()),
    };
    Failure::Unconnected(Finding::new(finding, format!("{path}: {error}"), action))
}

/// Whether another program uses the port; operating systems report it differently.
fn is_busy(error: &io::Error) -> bool {
    let words = error.to_string().to_lowercase();
    error.kind() == ErrorKind::ResourceBusy
        || words.contains("busy")
        || words.contains("in use")
        || words.contains("exclusive lock")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_which_way_it_is() {
        let of = |name| Address::parse(Some(name)).unwrap();
        assert_eq!(Address::parse(None).unwrap(), Address::Found);
        assert_eq!(of("emulated"), Address::Emulated);
        assert_eq!(of("a/b.mcap"), Address::Recording("a/b.mcap".into()));
        assert_eq!(
            of("tcp:localhost:1"),
            Address::Tcp("localhost:1".to_owned())
        );
        assert_eq!(
            of("probe:a:1,b:2"),
            Address::Probe("a:1".to_owned(), "b:2".to_owned())
        );
        assert_eq!(of("COM5"), Address::Serial("COM5".to_owned()));
        assert_eq!(of("probe"), Address::DebugProbe(None));
        assert_eq!(
            of("probe:2e8a:000c:E661"),
            Address::DebugProbe(Some("2e8a:000c:E661".to_owned()))
        );
        assert!(Address::parse(Some("probe:localhost:1")).is_err());
    }

    #[test]
    fn a_speed_is_a_factor_or_max() {
        assert_eq!(speed("2.5"), Ok(Speed::Times(2.5)));
        assert_eq!(speed("max"), Ok(Speed::AsFastAsPossible));
        for wrong in ["-1", "0", "NaN", "fast", "1e9"] {
            assert!(speed(wrong).unwrap_err().contains("max"), "{wrong}");
        }
    }

    #[test]
    fn the_only_board_needs_no_name_and_a_serial_number_is_one() {
        let port = |path: &str, number: &str| serial::Port {
            path: path.to_owned(),
            serial_number: Some(number.to_owned()),
        };
        let one = [port("/dev/ttyACM0", "E660C0D1")];
        let two = [one[0].clone(), port("/dev/ttyACM1", "E660C0D2")];
        assert_eq!(choose(None, &one).unwrap(), "/dev/ttyACM0");
        assert_eq!(choose(Some("e660c0d2"), &two).unwrap(), "/dev/ttyACM1");
        assert_eq!(choose(Some("/dev/ttyACM7"), &two).unwrap(), "/dev/ttyACM7");
        let said = choose(None, &two).unwrap_err().to_string();
        assert!(said.contains("E660C0D2 (/dev/ttyACM1)"), "{said}");
        let said = choose(None, &[]).unwrap_err().to_string();
        assert!(said.contains("--board emulated"), "{said}");
    }

    #[test]
    fn a_port_that_cannot_be_opened_says_what_to_do() {
        for (kind, finding, action) in [
            (ErrorKind::PermissionDenied, "forbidden", "udev/rules.d"),
            (ErrorKind::NotFound, "no_such_port", "palpate devices"),
            (ErrorKind::ResourceBusy, "busy", "Another program"),
            (ErrorKind::Other, "unopened", "plug it in again"),
        ] {
            let Failure::Unconnected(found) = unopened("/dev/ttyACM0", false, &kind.into()) else {
                panic!("{kind}");
            };
            assert_eq!(found.finding, finding);
            assert!(found.action.contains(action), "{found}");
        }
        let listed = unopened("COM5", true, &ErrorKind::NotFound.into()).to_string();
        assert!(listed.contains("Another program"), "{listed}");
    }

    #[cfg(unix)]
    #[test]
    fn a_port_that_another_program_has_open_is_busy() {
        use serialport::{SerialPort, TTYPort};
        let (_far_end, port) = TTYPort::pair().unwrap();
        let path = port.name().unwrap();
        drop(port);
        let _first = serialport::new(&path, 115_200).open().unwrap();
        match open_port(&path).err().unwrap() {
            Failure::Unconnected(finding) => assert_eq!(finding.finding, "busy", "{finding}"),
            other => panic!("{other}"),
        }
    }
}
