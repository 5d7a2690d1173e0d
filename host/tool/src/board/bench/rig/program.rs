//! A gauge's or a stage's program: a child process that speaks lines of text.
//!
//! docs/calibration.md describes the lines, for authors of such a program.

use std::io::{BufRead, BufReader, Read, Write};
use std::iter;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use palpate_cli::failure::Failure;

/// Longest wait for a program to end after it has closed its output.
const END: Duration = Duration::from_secs(1);
const POLL: Duration = Duration::from_millis(10);

/// One line of a program.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum GaugeLine {
    /// A reading, with the program's own time in s if given.
    Reading { time_s: Option<f64>, value: f64 },
    /// A command was completed.
    Done,
    /// The command must be done by hand.
    ByHand,
    /// The command cannot be done, with the reason.
    Refused(String),
}

impl GaugeLine {
    /// Parses a line: `None` for an empty line or a comment, an error for an unknown line.
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

/// A source of lines: a program, or an amplifier that this tool supports itself.
pub(super) trait Source {
    /// Returns the lines received since the last call.
    ///
    /// # Errors
    /// If the source has ended, or sends an unknown line.
    fn lines(&mut self) -> Result<Vec<GaugeLine>, Failure>;

    /// Sends a command.
    ///
    /// # Errors
    /// If the source has ended.
    fn send(&mut self, command: &str) -> Result<(), Failure>;
}

/// A running program.
pub(super) struct Program {
    /// Argument that names the program.
    argument: &'static str,
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl Program {
    /// Starts a program from its path and arguments, separated by spaces; quotes protect spaces.
    ///
    /// # Errors
    /// If it cannot be started.
    pub(super) fn start(argument: &'static str, command: &str) -> Result<Self, Failure> {
        let unstarted = |reason: &dyn std::fmt::Display| {
            Failure::Argument(format!(
                "{argument} {command:?}: {reason}. Name a program that runs by itself, with its arguments; put a \
                 path with spaces in quotes of its own, as {argument} \"'my bench/read-cell' /dev/ttyUSB0\""
            ))
        };
        let mut words = words(command)
            .map_err(|reason| unstarted(&reason))?
            .into_iter();
        let path = words.next().ok_or_else(|| unstarted(&"it is empty"))?;
        let mut child = Command::new(path)
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| unstarted(&error))?;
        let output = child.stdout.take();
        let output = output.ok_or_else(|| unstarted(&"it has no standard output"))?;
        let (sender, lines) = sync_channel(WAITING);
        // The thread ends with the program's output.
        thread::spawn(move || {
            for line in texts(output) {
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
        let end = Instant::now() + END;
        let outcome = loop {
            match self.child.try_wait() {
                Ok(Some(status)) => break format!("has ended ({status})"),
                Ok(None) if Instant::now() < end => thread::sleep(POLL),
                Ok(None) => break "has closed its output and is still running".to_owned(),
                Err(error) => break format!("has closed its output ({error})"),
            }
        };
        Failure::Refused(format!(
            "the program of {} {outcome}: read its message, check its cable and its port",
            self.argument
        ))
    }
}

/// Maximum number of lines that wait to be read, those of a fast gauge in ten seconds. A program
/// that prints without a pause has to wait.
const WAITING: usize = 10_000;

/// Maximum length of a gauge's line with its end, bytes: twenty times the usual one. A longer line
/// is cut.
pub(super) const LONGEST_LINE: u64 = 1_000;

/// Splits a command into words at spaces, except within single or double quotes.
fn words(command: &str) -> Result<Vec<String>, &'static str> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut quote = None;
    for letter in command.chars() {
        if quote == Some(letter) {
            quote = None;
        } else if quote.is_none() && matches!(letter, '\'' | '"') {
            quote = Some(letter);
            word.get_or_insert_default();
        } else if quote.is_none() && letter.is_whitespace() {
            words.extend(word.take());
        } else {
            word.get_or_insert_default().push(letter);
        }
    }
    words.extend(word);
    match quote {
        None => Ok(words),
        Some(_) => Err("a quote is not closed"),
    }
}

/// Lines of an output until its end. Bytes that are not UTF-8 become a replacement character.
fn texts(output: impl Read) -> impl Iterator<Item = String> {
    let mut output = BufReader::new(output);
    iter::from_fn(move || {
        let mut line = Vec::new();
        let mut part = output.by_ref().take(LONGEST_LINE);
        let count = part.read_until(b'\n', &mut line).unwrap_or(0);
        (count > 0).then(|| String::from_utf8_lossy(&line).trim_end().to_owned())
    })
}

impl Source for Program {
    fn lines(&mut self) -> Result<Vec<GaugeLine>, Failure> {
        let mut lines = Vec::new();
        for _ in 0..WAITING {
            match self.lines.try_recv() {
                Ok(text) => match GaugeLine::parse(&text) {
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
        Ok(lines)
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
    /// Ends the program with the calibration: closes its input, then kills it if necessary.
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
        let reading = |time_s, value| Ok(Some(GaugeLine::Reading { time_s, value }));
        assert_eq!(GaugeLine::parse("1.5\r"), reading(None, 1.5));
        assert_eq!(
            GaugeLine::parse(" 12.25  -3e-3"),
            reading(Some(12.25), -3e-3)
        );
        assert_eq!(GaugeLine::parse("ok"), Ok(Some(GaugeLine::Done)));
        assert_eq!(GaugeLine::parse("by hand"), Ok(Some(GaugeLine::ByHand)));
        let refused = GaugeLine::Refused("end of travel".to_owned());
        assert_eq!(GaugeLine::parse("error end of travel"), Ok(Some(refused)));
        assert_eq!(GaugeLine::parse("# zeroed"), Ok(None));
        assert_eq!(GaugeLine::parse(""), Ok(None));
        for text in ["1,5", "nan", "1 2 3", "1.5 N", "inf", "ok then"] {
            assert_eq!(GaugeLine::parse(text), Err(()), "{text}");
        }
    }

    #[test]
    fn words_stand_between_spaces_or_in_quotes() {
        for (command, expected) in [
            ("read-cell", &["read-cell"][..]),
            (" a  b\tc ", &["a", "b", "c"]),
            ("'my bench/read' \"x y\" ''", &["my bench/read", "x y", ""]),
            (r"C:\cell.exe --at='1 2'", &[r"C:\cell.exe", "--at=1 2"]),
            ("\"it's\"", &["it's"]),
            ("", &[]),
        ] {
            assert_eq!(words(command).unwrap(), expected, "{command}");
        }
        assert!(words("'a").is_err() && words("a\"").is_err());
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

    /// Returns the failure at the end of a program's lines.
    #[cfg(unix)]
    fn failure(command: &str) -> String {
        let mut program = Program::start("--force", command).unwrap();
        let end = Instant::now() + Duration::from_secs(20);
        while Instant::now() < end {
            if let Err(failure) = program.lines() {
                return failure.to_string();
            }
            thread::sleep(Duration::from_millis(5));
        }
        panic!("{command}: neither a reading nor a failure");
    }

    /// Writes a program to a folder with a space in its name. Returns the command that starts it.
    #[cfg(unix)]
    fn script(folder: &std::path::Path, text: &str) -> String {
        let file = folder.join("read cell.sh");
        std::fs::write(&file, text).unwrap();
        format!("sh '{}'", file.display())
    }

    #[cfg(unix)]
    #[test]
    fn a_line_that_is_not_utf_8_is_shown_and_a_comment_may_be_anything() {
        let folder = tempfile::tempdir().unwrap();
        let text = "printf '# 25 \\260C\\n1.5\\n1.5 \\265N\\n'; sleep 60\n";
        let said = failure(&script(folder.path(), text));
        assert!(said.contains("prints \"1.5 \u{FFFD}N\""), "{said}");
    }

    #[cfg(unix)]
    #[test]
    fn a_program_that_prints_without_a_pause_is_read_in_pieces() {
        let mut program = Program::start("--force", "yes 1.5").unwrap();
        thread::sleep(Duration::from_millis(200));
        let lines = program.lines().unwrap();
        assert!((1..=WAITING).contains(&lines.len()), "{}", lines.len());
    }

    #[cfg(unix)]
    #[test]
    fn a_line_without_an_end_is_cut() {
        let said = failure("cat /dev/zero");
        assert!(said.contains("a line is a number"), "{said}");
        assert!(said.len() < 4 * LONGEST_LINE as usize, "{}", said.len());
    }

    #[cfg(unix)]
    #[test]
    fn a_program_that_closes_its_output_and_runs_on_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let said = failure(&script(folder.path(), "exec >&-; exec sleep 60\n"));
        assert!(said.contains("--force has closed its output"), "{said}");
    }

    #[cfg(unix)]
    #[test]
    fn a_path_with_a_blank_stands_in_quotes() {
        let folder = tempfile::tempdir().unwrap();
        let mut program = Program::start("--force", &script(folder.path(), "echo 1.5\n")).unwrap();
        let line = iter::repeat_with(|| program.lines()).find_map(|lines| lines.unwrap().pop());
        assert!(
            matches!(line, Some(GaugeLine::Reading { value: 1.5, .. })),
            "{line:?}"
        );
        let unclosed = Program::start("--force", "sh 'read cell").err().unwrap();
        assert!(
            unclosed.to_string().contains("a quote is not closed"),
            "{unclosed}"
        );
        let missing = Program::start("--force", "/no/such cell").err().unwrap();
        assert!(missing.to_string().contains("in quotes"), "{missing}");
    }
}
