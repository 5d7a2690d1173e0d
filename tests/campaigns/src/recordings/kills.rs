//! Recordings whose process is killed at random times.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use palpate::recording::date::{self, NS_PER_S};
use palpate_cli::failure::Failure;
use palpate_sim::random::Stream;

use super::found;
use super::part::Part;
use crate::tool::{self, Tool};

/// Longest time from the file's creation to the kill, s.
const LATEST_S: f64 = 4.0;
/// Longest missing time at the end, s, as promised by docs/desk.md.
const PROMISED_S: f64 = 1.0;
/// Longest start-up time of a program.
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(5);

/// A child process that is killed when this value is dropped.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // The process may already have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Result of a kill.
struct Left {
    /// Time from the creation of the file to the kill, s.
    ran_s: f64,
    /// Time from the last readable record to the kill, s; from the creation if there is no record.
    lacks_s: f64,
    records: u64,
    missing: u64,
}

pub(super) fn run(tool: &Tool, kills: u32, seed: u64) -> Result<Part, Failure> {
    let (_server, address) = serve(tool)?;
    let mut random = Stream::named(seed, "kills");
    let mut left = Vec::new();
    for number in 0..kills {
        let after = Duration::from_secs_f64(random.between(0.0, LATEST_S));
        left.push(kill(tool, &address, number, after)?);
    }
    let greatest = |of: fn(&Left) -> f64| left.iter().map(of).fold(0.0, f64::max);
    let lacks_s = greatest(|left| left.lacks_s);
    let missing: u64 = left.iter().map(|left| left.missing).sum();
    let records: u64 = left.iter().map(|left| left.records).sum();
    let is_bad = |left: &&Left| left.lacks_s > PROMISED_S || left.missing > 0;
    let bad = left.iter().filter(is_bad).count();
    let shortest_s = left.iter().map(|left| left.ran_s).fold(LATEST_S, f64::min);
    let text = format!(
        "{kills} recordings that were killed {shortest_s:.2} to {:.2} s after their start lack their last {lacks_s:.2} s at most \
         ({PROMISED_S:.0} s is promised); {records} records are readable, and {missing} are missing among them.",
        greatest(|left| left.ran_s),
    );
    Ok(Part {
        text,
        failed: (bad > 0).then(|| format!("{bad} recordings that were killed lack too much")),
    })
}

/// Serves an emulated board; returns its address.
fn serve(tool: &Tool) -> Result<(Running, String), Failure> {
    let (flash, image) = (tool.name("served.flash"), tool.image());
    let serve = ["serve-emulated", "--listen", "127.0.0.1:0"];
    let mut command = tool::command(&serve)?;
    let command = command.args(["--state", &flash, "--image", &image]);
    let mut child = command.stderr(Stdio::piped()).spawn()?;
    let said = child.stderr.take();
    let server = Running(child);
    for line in said
        .into_iter()
        .flat_map(|said| BufReader::new(said).lines())
    {
        if let Some(address) = line?.strip_prefix("the emulated board is at ") {
            return Ok((server, format!("tcp:{address}")));
        }
    }
    Err(Failure::Refused(
        "the emulated board is not served".to_owned(),
    ))
}

fn kill(tool: &Tool, address: &str, number: u32, after: Duration) -> Result<Left, Failure> {
    let name = tool.name(&format!("killed-{number}.mcap"));
    let mut command = tool::command(&["record", &name, "--board", address])?;
    let program = command
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()?;
    let mut program = Running(program);
    let file = PathBuf::from(format!("{name}.partial"));
    let begin_ns = date::now_ns();
    while !file.exists() {
        if date::now_ns() > begin_ns + u64::try_from(PATIENCE.as_nanos()).unwrap_or(u64::MAX) {
            return Err(Failure::Refused("a recording does not begin".to_owned()));
        }
        sleep(LOOK);
    }
    let there_ns = date::now_ns();
    sleep(after);
    let killed_ns = date::now_ns();
    program.0.kill()?;
    program.0.wait()?;
    let found = found::read(&file)?;
    let seconds = |from_ns: u64| killed_ns.saturating_sub(from_ns) as f64 / NS_PER_S as f64;
    Ok(Left {
        ran_s: seconds(there_ns),
        lacks_s: seconds(found.last_ns.unwrap_or(there_ns)),
        records: found.contents.frames(),
        missing: found.missing(),
    })
}
