//! Why a verb ended without its result.

use std::{fmt, io, path::PathBuf, process::ExitCode};

use palpate_calibration::bench::BrokenOff;
use palpate_sim::native::BoardError;
use palpate_sim::parameters::ParameterError;
use palpate_sim::stack::LoadError;
use palpate_sim::stack::document::FileError;

use crate::finding::Finding;
use crate::notice;

/// A failure with its location, its cause and what to do.
#[derive(Debug)]
pub enum Failure {
    /// Something in a file is not as it may be.
    Input {
        /// The file.
        file: PathBuf,
        /// Counted from 1.
        line: u64,
        /// What was found.
        problem: String,
        /// What is allowed there.
        allowed: String,
    },
    /// Something in a stack or a scenario is not as it may be.
    Document(FileError),
    /// A file cannot be read.
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        reason: io::Error,
    },
    /// A file that is to be written cannot be.
    Unwritable {
        /// The file.
        file: PathBuf,
        /// The argument that names it or its folder.
        argument: &'static str,
        /// The system's reason.
        reason: io::Error,
    },
    /// Arguments that do not go together, or do not fit what they are for.
    Argument(String),
    /// What was asked for was refused, or failed while running.
    Refused(String),
    /// No board was reached, or it is not one that this tool can use.
    Unconnected(Finding),
    /// The board is gone: unplugged, reset or switched off.
    Lost(String),
    /// The result could not be written.
    Output(io::Error),
}

impl Failure {
    /// What was run refused it, or failed, with this error.
    pub fn refused(error: impl fmt::Display) -> Self {
        Self::Refused(error.to_string())
    }

    /// 2 for input, 1 for everything else.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Input { .. }
            | Self::Document(_)
            | Self::Unreadable { .. }
            | Self::Unwritable { .. }
            | Self::Argument(_) => ExitCode::from(2),
            Self::Refused(_) | Self::Unconnected(_) | Self::Lost(_) | Self::Output(_) => {
                ExitCode::FAILURE
            }
        }
    }
}

/// Says why a program failed, and with which code it ends.
pub fn exit(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // A reader that went away (`palpate ... | head`) is no failure.
        Err(Failure::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => {
            ExitCode::SUCCESS
        }
        Err(failure) => {
            notice::say(format_args!("palpate: {failure}"));
            failure.exit_code()
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input {
                file,
                line,
                problem,
                allowed,
            } => {
                write!(
                    f,
                    "{}, line {line}: {problem}. Allowed: {allowed}.",
                    file.display()
                )
            }
            Self::Document(error) => error.fmt(f),
            Self::Unreadable { file, reason } => write!(
                f,
                "{}: {reason}. Name a file that exists and may be read.",
                file.display()
            ),
            Self::Unwritable {
                file,
                argument,
                reason,
            } => write!(
                f,
                "{argument} {}: {reason}. Name a file in a folder that exists and may be written.",
                file.display()
            ),
            Self::Argument(reason) | Self::Refused(reason) | Self::Lost(reason) => {
                f.write_str(reason)
            }
            Self::Unconnected(finding) => finding.fmt(f),
            Self::Output(error) => write!(f, "cannot write the result: {error}"),
        }
    }
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Read { path, source } => Self::Unreadable {
                file: path,
                reason: source,
            },
            LoadError::Refused(error) => Self::Document(error),
        }
    }
}

impl From<BrokenOff> for Failure {
    fn from(error: BrokenOff) -> Self {
        Self::refused(error)
    }
}

impl From<ParameterError> for Failure {
    fn from(error: ParameterError) -> Self {
        Self::Refused(error.to_string())
    }
}

impl From<BoardError> for Failure {
    fn from(error: BoardError) -> Self {
        Self::Refused(error.to_string())
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Self::Output(error.into())
    }
}
