//! `palpate-ros`: ROS 2 node of the palpate tactile sensor.

use std::process::ExitCode;

use palpate_cli::failure;
use palpate_ros::arguments::Request;
use palpate_ros::run;

fn main() -> ExitCode {
    failure::exit(Request::read(std::env::args().collect()).and_then(run))
}
