//! Reads text from files and other inputs.

use std::fs;
use std::io::Read;
use std::path::Path;

use palpate_sim::stack::document::text_of;

use crate::failure::Failure;

/// Size limit of an input, bytes, since a device may send data without end. A day of conversion
/// words at 1 kHz is smaller.
const MOST_BYTES: u64 = 1_000_000_000;

/// Reads the text of a file, without a byte order mark.
///
/// # Errors
/// If it cannot be read, is too large, or is not UTF-8.
pub fn of_file(file: &Path) -> Result<String, Failure> {
    of_bytes(bytes_of_file(file)?, file)
}

/// Reads the text of an input; errors refer to the input as `name`.
pub fn of(from: impl Read, name: &Path) -> Result<String, Failure> {
    of_bytes(bytes(MOST_BYTES, from, name)?, name)
}

/// Reads the bytes of a file.
///
/// # Errors
/// If it cannot be read, or is too large.
pub fn bytes_of_file(file: &Path) -> Result<Vec<u8>, Failure> {
    let opened = fs::File::open(file).map_err(|reason| Failure::Unreadable {
        file: file.to_path_buf(),
        reason,
    })?;
    bytes(MOST_BYTES, opened, file)
}

fn bytes(most_bytes: u64, from: impl Read, name: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    from.take(most_bytes + 1)
        .read_to_end(&mut bytes)
        .map_err(|reason| Failure::Unreadable {
            file: name.to_path_buf(),
            reason,
        })?;
    if bytes.len() as u64 > most_bytes {
        return Err(Failure::Input {
            file: name.to_path_buf(),
            line: 1,
            problem: "it is too large".to_owned(),
            allowed: format!("at most {most_bytes} bytes"),
        });
    }
    Ok(bytes)
}

fn of_bytes(bytes: Vec<u8>, name: &Path) -> Result<String, Failure> {
    text_of("", bytes).map_err(|error| Failure::Input {
        file: name.to_path_buf(),
        line: error.line as u64,
        problem: error.problem,
        allowed: error.allowed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_that_never_ends_is_refused() {
        let read = bytes(1_000, std::io::repeat(b'#'), Path::new("endless"));
        let refused = read.unwrap_err().to_string();
        assert!(
            refused.contains("endless, line 1: it is too large"),
            "{refused}"
        );
        assert!(bytes(1_000, &[b'#'; 1_000][..], Path::new("full")).is_ok());
    }
}
