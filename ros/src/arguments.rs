//! Arguments of the program.

use clap::Parser;
use palpate_cli::failure::Failure;

use crate::board::{Named, Usage};
use crate::ros::{HIGHEST_DOMAIN, Place};
use crate::ros_arguments::RosArguments;

/// Publish force, temperature, stiffness, touch and health of palpate boards to ROS 2
#[derive(Parser)]
#[command(
    name = "palpate-ros",
    version,
    max_term_width = 96,
    after_help = "\
Topics, for a board NAME: /palpate/NAME/force (geometry_msgs/WrenchStamped), /palpate/NAME/temperature \
(sensor_msgs/Temperature), /palpate/NAME/stiffness (palpate_msgs/Stiffness), /palpate/NAME/touch \
(palpate_msgs/Touch); and /diagnostics.

Options after -- go to the link of every board, as those of `palpate measure`. --ros-args with -r __ns:=, \
-r __node:= and -r FROM:=TO is understood.

Examples:
  palpate-ros
  palpate-ros --board left=E660C0D1C7 --board right=/dev/ttyACM1 --arm
  palpate-ros --board finger=emulated --arm -- --load 1.5"
)]
struct Cli {
    /// A board, with its name in topics and frames: a serial number, a serial port, emulated,
    /// tcp:HOST:PORT, FILE.mcap or probe, as `palpate --board` has them. Several times for several
    /// boards; without it, the one that is plugged in, as `sensor`
    #[arg(long = "board", value_name = "[NAME=]BOARD", value_parser = named)]
    boards: Vec<Named>,
    /// Arm the boards, and measure stiffness at every contact: the coils are driven
    #[arg(long)]
    arm: bool,
    /// Domain
    #[arg(long, value_name = "ID", env = "ROS_DOMAIN_ID", default_value_t = 0,
        value_parser = clap::value_parser!(u16).range(..=i64::from(HIGHEST_DOMAIN)))]
    domain: u16,
    /// Reach subscribers on this computer alone; also by ROS_LOCALHOST_ONLY=1 or
    /// ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
    #[arg(long)]
    localhost: bool,
    /// Namespace of the node
    #[arg(long, value_name = "NAMESPACE", default_value = "/")]
    namespace: String,
    /// Name of the node
    #[arg(long, value_name = "NAME", default_value = "palpate")]
    node: String,
    /// Frame of a board: this and the board's name
    #[arg(long, value_name = "PREFIX", default_value = "palpate_")]
    frame_prefix: String,
    /// Send each message once, without acknowledgement: then only subscribers that ask for best effort,
    /// as for sensor data, receive
    #[arg(long)]
    best_effort: bool,
    /// Further options of `palpate measure`
    #[arg(last = true, value_name = "OPTIONS")]
    rest: Vec<String>,
}

/// What the program is to do.
#[derive(Clone, Debug)]
pub struct Request {
    /// Boards.
    pub boards: Vec<Named>,
    /// How they are used.
    pub usage: Usage,
    /// Domain, node and quality of service.
    pub place: Place,
    /// Names of the node and its topics.
    pub ros: RosArguments,
}

impl Request {
    /// Reads the arguments of the program, whose name is the first. A wrong one ends the program.
    ///
    /// # Errors
    /// If arguments of ROS are not understood, or two boards have one name.
    pub fn read(mut arguments: Vec<String>) -> Result<Self, Failure> {
        let ros = RosArguments::take(&mut arguments)?;
        let cli = Cli::parse_from(arguments);
        let mut boards = cli.boards;
        if boards.is_empty() {
            boards.push(Named {
                name: "sensor".to_owned(),
                board: None,
            });
        }
        for (index, board) in boards.iter().enumerate() {
            if boards
                .iter()
                .take(index)
                .any(|other| other.name == board.name)
            {
                return Err(Failure::Argument(format!(
                    "two boards are named {}: name each, as --board left=BOARD",
                    board.name
                )));
            }
        }
        Ok(Self {
            boards,
            usage: Usage {
                arm: cli.arm,
                frame_prefix: cli.frame_prefix,
                rest: cli.rest,
            },
            place: Place {
                domain_id: cli.domain,
                localhost: cli.localhost || is_local(),
                best_effort: cli.best_effort,
                namespace: cli.namespace,
                node: cli.node,
            },
            ros,
        })
    }
}

/// Whether the environment asks for this computer alone.
fn is_local() -> bool {
    let is = |name: &str, value: &str| std::env::var(name).is_ok_and(|of| of == value);
    is("ROS_LOCALHOST_ONLY", "1") || is("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
}

/// A board with its name, which is made from its location if it has none.
fn named(text: &str) -> Result<Named, String> {
    let (name, board) = match text.split_once('=') {
        Some((name, board)) => (name.to_owned(), board),
        None => (name_of(text), text),
    };
    let mut characters = name.chars();
    let is_name = characters
        .next()
        .is_some_and(|first| first.is_ascii_alphabetic())
        && characters.all(|of| of.is_ascii_alphanumeric() || of == '_')
        && !name.contains("__");
    if !is_name || board.is_empty() {
        return Err(
            "write NAME=BOARD; a name has letters, digits and single _, and begins with a letter"
                .to_owned(),
        );
    }
    Ok(Named {
        name,
        board: Some(board.to_owned()),
    })
}

/// Name from a location: /dev/ttyACM0 is ttyACM0, a serial number follows `board_`.
fn name_of(location: &str) -> String {
    let last = location.rsplit(['/', '\\']).next().unwrap_or(location);
    let last = last.strip_suffix(".mcap").unwrap_or(last);
    let words = last.split(|of: char| !of.is_ascii_alphanumeric());
    let words: Vec<_> = words.filter(|word| !word.is_empty()).collect();
    let name = words.join("_");
    if name.starts_with(|first: char| first.is_ascii_alphabetic()) {
        name
    } else {
        format!("board_{name}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(line: &str) -> Result<Request, Failure> {
        Request::read(line.split_whitespace().map(str::to_owned).collect())
    }

    #[test]
    fn boards_have_names() {
        let request = request(
            "palpate-ros --board left=E660C0D1 --board /dev/ttyACM1 --board 12ab --board tcp:127.0.0.1:7161 --domain 7 \
             --ros-args -r __ns:=/robot1 -- -- --load 1.5",
        );
        let request = request.unwrap();
        let names: Vec<_> = request.boards.iter().map(|of| of.name.as_str()).collect();
        assert_eq!(
            names,
            ["left", "ttyACM1", "board_12ab", "tcp_127_0_0_1_7161"]
        );
        assert_eq!(request.boards[0].board.as_deref(), Some("E660C0D1"));
        assert_eq!(request.place.domain_id, 7);
        assert_eq!(request.usage.rest, ["--load", "1.5"]);
        assert_eq!(request.ros.namespace.as_deref(), Some("/robot1"));
    }

    #[test]
    fn two_boards_of_one_name_are_refused() {
        let text = request("palpate-ros --board a=emulated --board a=x.mcap");
        let text = text.unwrap_err().to_string();
        assert!(text.contains("two boards are named a"), "{text}");
    }

    #[test]
    fn a_name_that_no_topic_can_have_is_refused() {
        for wrong in ["1a=x", "a-b=x", "a__b=x", "=x", "a="] {
            assert!(named(wrong).is_err(), "{wrong}");
        }
    }
}
