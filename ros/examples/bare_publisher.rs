//! Messages of the size of a board's forces without a board, for the comparison of latencies:
//! `bare_publisher COUNT RATE_HZ SECONDS`. Topics and quality of service are those of `palpate-ros`.

use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use palpate_cli::failure::Failure;
use palpate_ros::messages::{Header, Time, Vector3, WrenchStamped};
use palpate_ros::ros::{Place, Ros};
use palpate_ros::ros_arguments::RosArguments;
use ros2_client::Publisher;

fn main() -> Result<(), Failure> {
    let numbers = std::env::args()
        .skip(1)
        .map(|text| text.parse::<u64>().unwrap_or(1));
    let numbers: Vec<_> = numbers.collect();
    let &[count, rate_hz, seconds] = numbers.as_slice() else {
        return Err(Failure::Argument(
            "bare_publisher COUNT RATE_HZ SECONDS".to_owned(),
        ));
    };
    let place = Place {
        domain_id: 0,
        localhost: false,
        best_effort: false,
        namespace: "/".to_owned(),
        node: "palpate".to_owned(),
    };
    let mut ros = Ros::join(&place, RosArguments::default())?;
    let mut threads = Vec::new();
    for board in 0..count {
        let publisher = ros.publisher(&format!("~/b{board}/force"))?;
        threads.push(thread::spawn(move || publish(&publisher, rate_hz, seconds)));
    }
    threads.into_iter().for_each(|thread| drop(thread.join()));
    Ok(())
}

fn publish(publisher: &Publisher<WrenchStamped>, rate_hz: u64, seconds: u64) {
    let period_ns = 1_000_000_000 / rate_hz;
    let first = now_ns() / period_ns + 1;
    for index in first..first + rate_hz * seconds {
        let due_ns = index * period_ns;
        thread::sleep(Duration::from_nanos(due_ns.saturating_sub(now_ns())));
        // The stamp is the time of the sample, as from a board: a whole number of periods.
        let message = WrenchStamped {
            header: Header {
                stamp: Time::from_ns(due_ns as i64),
                frame_id: "palpate_b0".to_owned(),
            },
            force: Vector3 {
                x: 0.0,
                y: 0.0,
                // Numbered as by `played_boards`.
                z: -((index % 10_000) as f64),
            },
            torque: Vector3::default(),
        };
        let _ = publisher.publish(message);
    }
}

fn now_ns() -> u64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
