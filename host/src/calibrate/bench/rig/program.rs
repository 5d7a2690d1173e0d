//! A gauge's or a stage's program: a child process that speaks lines of text.
//!
//! docs/calibration.md describes the lines for people who write such a program.

use std::io::{self, BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use crate::failure::Failure;

/// One line of a program.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Line {
    /// A reading, with the program's own time in s if it names one.
    Reading { time_s: Option<f64>, value: f64 },
    /// A command is done.
    Done,
    /// What was asked for takes a person.
    ByHand,
    /// What was asked for cannot be done.
    Refused(String),
}

impl Line {
    /// What a line means; nothing for an empty one and a comment, an error for what is none of these.
    fn parse(text: &str) -> Result<Option<Self>, ()> {
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            return Ok(None);
        }
        if let Some(reason) = text.strip_prefix("error") {
            return Ok(Some(Self::Refused(reason.trim().to_owned())));
        }
        match text {
            "ok" => return Ok(Some(Self::Done)),
            "by hand" => return Ok(Some(Self::ByHand)),
            _ => {}
        }
        let numbers = text.split_whitespace().map(str::parse::<f64>);
        let numbers: Vec<f64> = numbers.collect::<Result<_, _>>().map_err(drop)?;
        match *numbers.as_slice() {
            [value] if value.is_finite() => Ok(Some(Self::Reading {
                time_s: None,
                value,
            })),
            [time_s, value] if time_s.is_finite() && value.is_finite() => Ok(Some(Self::Reading {
                time_s: Some(time_s),
                value,
            })),
            _ => Err(()),
        }
    }
}

/// A source of lines: a program, or what takes its place.
pub(super) trait Source {
    /// The lines that have come since.
    ///
    /// # Errors
    /// If the source has ended, or says what it may not.
    fn lines(&mut self) -> Result<Vec<Line>, Failure>;

    /// Sends a command.
    ///
    /// # Errors
    /// If the source has ended.
    fn send(&mut self, command: &str) -> Result<(), Failure>;
}

/// A program that runs.
pub(super) struct Program {
    /// The argument that names it.
    argument: &'static str,
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl Program {
    /// Starts a program: its path, and its arguments after spaces.
    ///
    /// # Errors
    /// If it cannot be started.
    pub(super) fn start(argument: &'static str, command: &str) -> Result<Self, Failure> {
        let unstarted = |reason: &dyn std::fmt::Display| {
            Failure::Argument(format!(
                "{argument} {command:?}: {reason}. Name a program that runs by itself, with its arguments"
            ))
        };
        let mut words = command.split_whitespace();
        let path = words.next().ok_or_else(|| unstarted(&"it is empty"))?;
        let mut child = Command::new(path)
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| unstarted(&error))?;
        let output = child.stdout.take();
        let output = output.ok_or_else(|| unstarted(&"it has no standard output"))?;
        let (sender, lines) = channel();
        // Ends with the program's output.
        thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(io::Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Ok(Self {
            argument,
            input: child.stdin.take(),
            child,
            lines,
        })
    }

    fn ended(&mut self) -> Failure {
        let status = self.child.wait();
        let status = status.map_or_else(|error| error.to_string(), |status| status.to_string());
        Failure::Refused(format!(
            "the program of {} has ended ({status}): see its message, its cable and its port",
            self.argument
        ))
    }
}

impl Source for Program {
    fn lines(&mut self) -> Result<Vec<Line>, Failure> {
        let mut lines = Vec::new();
        loop {
            match self.lines.try_recv() {
                Ok(text) => match Line::parse(&text) {
                    Ok(line) => lines.extend(line),
                    Err(()) => {
                        return Err(Failure::Refused(format!(
                            "the program of {} prints {text:?}: a line is a number, or a time in s and a \
                             number (docs/calibration.md)",
                            self.argument
                        )));
                    }
                },
                Err(TryRecvError::Empty) => return Ok(lines),
                Err(TryRecvError::Disconnected) if lines.is_empty() => return Err(self.ended()),
                Err(TryRecvError::Disconnected) => return Ok(lines),
            }
        }
    }

    fn send(&mut self, command: &str) -> Result<(), Failure> {
        let input = self.input.as_mut();
        let sent = input.map(|input| writeln!(input, "{command}").and_then(|()| input.flush()));
        match sent {
            Some(Ok(())) => Ok(()),
            _ => Err(self.ended()),
        }
    }
}

impl Drop for Program {
    /// A program ends with the calibration: its input closes, and if that is not enough it is killed.
    fn drop(&mut self) {
        drop(self.input.take());
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_number_a_time_and_a_number_or_an_answer() {
        let reading = |time_s, value| Ok(Some(Line::Reading { time_s, value }));
        assert_eq!(Line::parse("1.5\r"), reading(None, 1.5));
        assert_eq!(Line::parse(" 12.25  -3e-3"), reading(Some(12.25), -3e-3));
        assert_eq!(Line::parse("ok"), Ok(Some(Line::Done)));
        assert_eq!(Line::parse("by hand"), Ok(Some(Line::ByHand)));
        let refused = Line::Refused("end of travel".to_owned());
        assert_eq!(Line::parse("error end of travel"), Ok(Some(refused)));
        assert_eq!(Line::parse("# zeroed"), Ok(None));
        assert_eq!(Line::parse(""), Ok(None));
        for text in ["1,5", "nan", "1 2 3", "1.5 N", "inf", "ok then"] {
            assert_eq!(Line::parse(text), Err(()), "{text}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_program_that_ends_is_a_failure_with_its_status_after_its_last_line() {
        let mut program = Program::start("--force", "echo 1.5").unwrap();
        let mut lines = Vec::new();
        let failure = loop {
            match program.lines() {
                Ok(more) => lines.extend(more),
                Err(failure) => break failure.to_string(),
            }
        };
        assert_eq!(lines.len(), 1);
        assert!(
            failure.contains("--force has ended (exit status: 0)"),
            "{failure}"
        );
        let missing = Program::start("--force", "/no/such/program").err().unwrap();
        assert!(
            missing.to_string().contains("/no/such/program"),
            "{missing}"
        );
    }
}
