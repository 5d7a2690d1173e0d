//! File of a session: the bench's recorded data, for a second session or a later check.

use std::path::Path;

use palpate_calibration::session::Session;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::text;
use palpate_wire::Command;
use serde::{Deserialize, Serialize};

/// Contents of a session file.
#[derive(Serialize, Deserialize)]
struct File<S, C> {
    /// Version of the format.
    palpate_session: u32,
    session: S,
    /// Commands of the resulting calibration; `None` if there was none.
    calibration: Option<C>,
}

/// Data read from a session file.
pub(crate) struct Written {
    pub(crate) session: Session,
    /// Calibration from this session alone.
    pub(crate) calibration: Option<Vec<Command>>,
}

/// Version that is written, and the only one that is read.
const VERSION: u32 = 1;

/// Writes a session to a file, as JSON, with its calibration.
///
/// # Errors
/// If it cannot be written.
pub(super) fn write(
    session: &Session,
    calibration: Option<&[Command]>,
    to: &OutputFile,
) -> Result<(), Failure> {
    let file = File {
        palpate_session: VERSION,
        session,
        calibration,
    };
    to.write(serde_json::to_vec(&file)?)
}

/// Reads a session from a file.
///
/// # Errors
/// If it cannot be read, or is not a session of this version.
pub(crate) fn read(path: &Path) -> Result<Written, Failure> {
    let bytes = text::bytes_of_file(path)?;
    let wrong = |line: usize, problem: String| Failure::Input {
        file: path.to_path_buf(),
        line: line as u64,
        problem,
        allowed: format!(
            "a session of version {VERSION}, as `palpate calibrate sensor --save-session FILE` writes it"
        ),
    };
    let file: File<Session, Vec<Command>> = serde_json::from_slice(&bytes)
        .map_err(|error| wrong(error.line(), format!("not a session: {error}")))?;
    if file.palpate_session != VERSION {
        return Err(wrong(1, format!("version {}", file.palpate_session)));
    }
    Ok(Written {
        session: file.session,
        calibration: file.calibration,
    })
}

#[cfg(test)]
mod tests {
    use palpate_calibration::session::{BenchSample, Pressed, Run};
    use palpate_wire::command::Attraction;

    use super::*;

    fn session() -> Session {
        let mut run = Run::new(Pressed::Spring { n_per_m: 6e3 }, 0.3e-3);
        run.lines.push(BenchSample {
            time_s: 0.1 + 0.2,
            frequency_hz: 1e7 / 3.0,
            current_a: 0.0,
            gauges_time_s: 1.0 / 3.0,
            force_n: Some(-1e-9 / 7.0),
            stage_m: None,
        });
        Session {
            runs: vec![Run::new(Pressed::Nothing, 0.0), run],
            contact: Vec::new(),
            deepest_press: Run::new(Pressed::Block, 0.4e-3),
            bare: vec![(1.0, 2e-6)],
            temperature_c: 43.1,
        }
    }

    #[test]
    fn a_session_comes_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cold.json");
        let calibration = vec![Command::SetAttraction(Attraction {
            attraction_n_per_a2: 1e-4 / 3.0,
            uncertainty: 0.1,
        })];
        for calibration in [None, Some(calibration)] {
            let file = OutputFile::new("--save-session", &path).unwrap();
            write(&session(), calibration.as_deref(), &file).unwrap();
            let read = read(&path).unwrap();
            assert_eq!(read.session, session());
            assert_eq!(read.calibration, calibration);
        }
    }

    #[test]
    fn what_is_no_session_is_refused_with_what_is_allowed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("other.json");
        let refused = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read(&path).map(|_| ()).unwrap_err().to_string()
        };
        assert!(refused("{\n\"runs\": 3}").contains("not a session"));
        let later = serde_json::to_string(&File {
            palpate_session: 2,
            session: session(),
            calibration: None::<()>,
        });
        let message = refused(&later.unwrap());
        assert!(
            message.contains("version 2") && message.contains("--save-session"),
            "{message}"
        );
        assert!(
            read(&folder.path().join("none.json"))
                .map(|_| ())
                .unwrap_err()
                .to_string()
                .contains("none.json")
        );
    }
}
