//! Checks that no path of the build computer is in a release: a build in another folder would
//! differ.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// Refuses files that contain the path of one of `folders`.
///
/// # Errors
/// If a file contains such a path, or cannot be read.
pub(super) fn refuse(files: &[&Path], folders: &[PathBuf]) -> Result<()> {
    for file in files {
        let contents =
            fs::read(file).with_context(|| format!("{} cannot be read", file.display()))?;
        for folder in folders {
            if let Some(at) = position(&contents, folder.as_os_str().as_encoded_bytes()) {
                bail!(
                    "{} names the folder {} at byte {at}, so that it would be another one from another \
                     folder: see what was built without --remap-path-prefix",
                    file.display(),
                    folder.display()
                );
            }
        }
    }
    Ok(())
}

fn position(contents: &[u8], name: &[u8]) -> Option<usize> {
    contents
        .windows(name.len().max(1))
        .position(|of| of == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_names_the_folder_where_it_was_built_is_refused() {
        let file = std::env::temp_dir().join(format!("palpate-paths-{}", std::process::id()));
        let folders = [PathBuf::from("/srv/.cargo"), PathBuf::from("/src/palpate")];
        let of = |contents: &[u8]| {
            fs::write(&file, contents).unwrap();
            refuse(&[&file], &folders)
        };
        assert!(of(b"\0cargo/registry/src/a.rs\0palpate/host/src/main.rs").is_ok());
        let message = of(b"\0\xFF/src/palpate/host/src/main.rs")
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("names the folder /src/palpate at byte 2"),
            "{message}"
        );
        fs::remove_file(&file).unwrap();
    }
}
