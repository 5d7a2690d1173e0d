//! ROS 2 node of the palpate tactile sensor; README.md says how it is used.

#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod arguments;
pub mod board;
pub mod clock;
pub mod end;
pub mod health;
pub mod messages;
pub mod records;
pub mod ros;
pub mod ros_arguments;

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use palpate_cli::failure::Failure;
use ros2_client::Publisher;

use crate::arguments::Request;
use crate::board::Reader;
use crate::health::Health;
use crate::messages::{DiagnosticArray, Header, Time};
use crate::ros::Ros;

/// Interval of the reports, as tools of ROS expect it.
const REPORT: Duration = Duration::from_secs(1);

/// Publishes until Ctrl-C, or until all recordings have ended.
///
/// # Errors
/// If an argument is refused, or the network cannot be used.
pub fn run(request: Request) -> Result<(), Failure> {
    end::catch()?;
    let mut ros = Ros::join(&request.place, request.ros)?;
    let diagnostics: Publisher<DiagnosticArray> = ros.publisher("/diagnostics")?;
    let mut readers = Vec::new();
    let mut healths = Vec::new();
    for named in request.boards {
        let name = named.name.clone();
        let (reader, health) = Reader::new(&mut ros, named, &request.usage)?;
        readers.push(reader);
        healths.push((name, health));
    }
    ros.log().info(&format!(
        "{} in domain {}: {} boards",
        ros.path(),
        request.place.domain_id,
        readers.len()
    ));
    let threads: Vec<_> = readers.into_iter().map(spawn).collect();
    while !threads.iter().all(JoinHandle::is_finished) && !end::is_asked() {
        end::wait(REPORT);
        // A subscriber that misses a report gets the next one.
        let _ = diagnostics.publish(report(&healths));
    }
    let results = threads.into_iter().map(|thread| match thread.join() {
        Ok(result) => result,
        Err(_) => Err(Failure::Refused(
            "the thread of a board has failed".to_owned(),
        )),
    });
    // Every thread ends first: it disarms its board.
    results.collect::<Vec<_>>().into_iter().collect()
}

/// Starts a board's thread. A board that cannot be used ends the program.
fn spawn(reader: Reader) -> JoinHandle<Result<(), Failure>> {
    thread::spawn(move || {
        let result = reader.run();
        if result.is_err() {
            end::ask();
        }
        result
    })
}

fn report(healths: &[(String, Arc<Mutex<Health>>)]) -> DiagnosticArray {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let reports = healths.iter().map(|(name, health)| {
        let mut health = health.lock().unwrap_or_else(PoisonError::into_inner);
        health.report(name)
    });
    DiagnosticArray {
        header: Header {
            stamp: Time::from_ns(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)),
            frame_id: String::new(),
        },
        status: reports.collect(),
    }
}
