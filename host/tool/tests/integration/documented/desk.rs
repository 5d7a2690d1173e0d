//! Working folder of a reader: the files before a page's first command, and the tool.

use std::ffi::OsString;
use std::fs::{self, File, Permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tempfile::{TempDir, tempdir_in};

use super::page::root;

/// Replacement of the tool for a reader: a board is connected and pressed, questions are answered
/// with yes, and a verb that runs until Ctrl-C ends.
const STAND_IN: &str = r#"#!/bin/sh
takes() { "$TOOL" "$@" --help > /dev/null 2>&1; }
if takes "$@" --board emulated; then
    set -- "$@" --board emulated
    case " $* " in
        *" --untouched "*) ;;
        *) if takes "$@" --load 1.5; then set -- "$@" --load 1.5; fi ;;
    esac
fi
if takes "$@" --yes; then set -- "$@" --yes; fi
case $1 in
    live) exec timeout --signal INT --preserve-status 5 "$TOOL" "$@" ;;
    record) if takes "$@" --for 10; then set -- "$@" --for 10; fi ;;
    watch) if takes "$@" --for 3; then set -- "$@" --for 3; fi ;;
esac
exec "$TOOL" "$@"
"#;

/// Calibration that a page may start with; it takes minutes.
const CALIBRATE: &str = "palpate calibrate sensor --board emulated --save-session cold.json";

/// Part of a calibration for `palpate encode`.
const CALIBRATION: &str =
    "[[set_tank]]\nsensor = 0\nchannel = 0\ncapacitance_f = 330e-12\nrest_frequency_hz = 3e6\n";

/// Longest wait until a server listens, since it first builds the image.
const PATIENCE: Duration = Duration::from_secs(600);

/// Files before the first command of a page.
pub(super) struct Start {
    folder: TempDir,
    has_board: bool,
    /// Lock for a page whose commands listen at a port.
    ports: Mutex<()>,
}

impl Start {
    /// Creates the files of a checkout and a release, a sensor design, and files for `palpate
    /// decode` and `palpate encode`.
    pub(super) fn without_board() -> Self {
        // The folder lies in the checkout, where the tool finds the firmware's image.
        let root = root();
        let target = root.join("target");
        fs::create_dir_all(&target).unwrap();
        let folder = tempdir_in(target).unwrap();
        let bin = folder.path().join("bin");
        fs::create_dir(&bin).unwrap();
        for (name, text) in [("palpate", STAND_IN), ("xdg-open", "#!/bin/sh\n")] {
            fs::write(bin.join(name), text).unwrap();
            fs::set_permissions(bin.join(name), Permissions::from_mode(0o755)).unwrap();
        }
        let desk = folder.path().join("desk");
        fs::create_dir_all(desk.join(".local/share/bash-completion/completions")).unwrap();
        for (name, place) in [
            ("docs", "docs"),
            ("target", "target"),
            ("firmware", "target/image"),
            ("palpate-pico.elf", "target/image/palpate-pico.elf"),
            ("palpate-pico.uf2", "target/image/palpate-pico.uf2"),
            ("records.bin", "firmware/wire/fixture/v2-records.bin"),
        ] {
            symlink(root.join(place), desk.join(name)).unwrap();
        }
        for name in ["commands.jsonl", "current.jsonl"] {
            fs::write(desk.join(name), "\"identify\"\n").unwrap();
        }
        fs::write(desk.join("calibration.toml"), CALIBRATION).unwrap();
        fs::copy(
            root.join("sim-host/stacks/ultrasoft.toml"),
            desk.join("mine.toml"),
        )
        .unwrap();
        Self {
            folder,
            has_board: false,
            ports: Mutex::new(()),
        }
    }

    /// Creates the files of [`Self::without_board`], and adds the firmware's image, the settings of
    /// a calibrated board, and recordings of a press.
    pub(super) fn with_board() -> Self {
        let start = Self::without_board();
        let mut desk = start.desk(&[]);
        for command in [
            "cargo xtask firmware",
            CALIBRATE,
            "palpate record press.mcap --board emulated --load 1.5 --arm --for 10",
            "mkdir monday && cp press.mcap monday/",
            "palpate settings export board.jsonl --board emulated",
        ] {
            desk.run(command).unwrap();
        }
        copy(&desk.folder(), &start.folder.path().join("desk"));
        drop(desk);
        Self {
            has_board: true,
            ..start
        }
    }

    /// Creates a working folder for commands, without the files that they record.
    pub(super) fn desk(&self, commands: &[&str]) -> Desk<'_> {
        let folder = tempdir_in(&self.folder).unwrap();
        copy(&self.folder.path().join("desk"), folder.path());
        if commands
            .iter()
            .any(|text| text.starts_with("palpate record press.mcap"))
        {
            let _ = fs::remove_file(folder.path().join("press.mcap"));
        }
        let listens = |text: &&str| {
            ["palpate live", "palpate serve"]
                .iter()
                .any(|verb| text.starts_with(verb))
        };
        let ports = commands
            .iter()
            .any(listens)
            .then(|| self.ports.lock().unwrap());
        Desk {
            start: self,
            _ports: ports,
            folder,
            servers: Vec::new(),
        }
    }
}

/// Copies the contents of a folder into another.
fn copy(from: &Path, to: &Path) {
    let copied = Command::new("cp")
        .arg("-a")
        .arg(from.join("."))
        .arg(to)
        .status();
    assert!(copied.unwrap().success());
}

/// A folder in which commands run one after the other.
pub(super) struct Desk<'s> {
    start: &'s Start,
    _ports: Option<MutexGuard<'s, ()>>,
    folder: TempDir,
    /// Process groups of the commands that run in the background.
    servers: Vec<u32>,
}

impl Desk<'_> {
    fn folder(&self) -> PathBuf {
        self.folder.path().to_owned()
    }

    /// Runs a command. The error is its exit status and last output.
    pub(super) fn run(&mut self, text: &str) -> Result<(), String> {
        if self.start.has_board && is_made(text) {
            return Ok(());
        }
        let begin = Instant::now();
        let said = self.folder().join("said");
        let mut shell = self.shell(text, &said);
        let is_server = text.ends_with('&');
        if is_server {
            shell.process_group(0);
        }
        let mut shell = shell.spawn().unwrap();
        let status = shell.wait().unwrap();
        let said = || String::from_utf8_lossy(&fs::read(&said).unwrap()).into_owned();
        if is_server {
            self.servers.push(shell.id());
            while !said().contains(" is at ") && begin.elapsed() < PATIENCE {
                sleep(Duration::from_millis(100));
            }
        }
        println!("{:6.1} s, {status}: {text}", begin.elapsed().as_secs_f64());
        let said = said();
        let last: Vec<_> = said.lines().rev().take(5).collect();
        let last: Vec<_> = last.into_iter().rev().collect();
        status
            .success()
            .then_some(())
            .ok_or_else(|| format!("{status}: {}", last.join("\n")))
    }

    /// Builds the shell that runs a command. Its `HOME` is the desk's folder.
    fn shell(&self, text: &str, said: &Path) -> Command {
        let variable = |name| std::env::var_os(name);
        let home = PathBuf::from(variable("HOME").unwrap_or_default());
        let kept = |name, usual| variable(name).unwrap_or_else(|| home.join(usual).into());
        let mut path = OsString::from(self.start.folder.path().join("bin"));
        path.push(":");
        path.push(variable("PATH").unwrap_or_default());
        let said = File::create(said).unwrap();
        let mut shell = Command::new("sh");
        shell
            .args(["-c", text])
            .current_dir(&self.folder)
            .env("TOOL", env!("CARGO_BIN_EXE_palpate"))
            .env("PATH", path)
            .env("CARGO_HOME", kept("CARGO_HOME", ".cargo"))
            .env("RUSTUP_HOME", kept("RUSTUP_HOME", ".rustup"))
            .env("HOME", self.folder.path())
            .env("XDG_STATE_HOME", self.folder.path().join("state"))
            .stdin(Stdio::null())
            .stdout(said.try_clone().unwrap())
            .stderr(said);
        shell
    }
}

impl Drop for Desk<'_> {
    fn drop(&mut self) {
        for server in &self.servers {
            let group = format!("-{server}");
            let _ = Command::new("kill").args(["--", &group]).status();
        }
    }
}

/// Whether a command makes the calibration that already exists.
fn is_made(text: &str) -> bool {
    let (text, image) = text.split_once(" --image ").unwrap_or((text, ""));
    let image = image.split(' ').skip(1);
    let words = text.split(' ').chain(image).filter(|word| *word != "--yes");
    let words: Vec<_> = words.collect();
    words.starts_with(&["palpate", "calibrate"]) && CALIBRATE.starts_with(&words.join(" "))
}
