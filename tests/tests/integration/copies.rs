//! Compares the project's own copies of reference data with the originals. If the originals are not
//! available beside the checkout, the test says so.

use std::{fs, path::Path};

/// Each copy of reference data in the project, with its original.
const COPIES: &[(&str, &str)] = &[
    ("docs/examples/words.csv", "ldc_words.csv"),
    (
        "sim-host/stacks/disturbances.toml",
        "stacks/disturbances.toml",
    ),
    ("sim-host/stacks/paper.toml", "stacks/paper.toml"),
    (
        "sim-host/stacks/soft-closed.toml",
        "stacks/soft-closed.toml",
    ),
    ("sim-host/stacks/ultrasoft.toml", "stacks/ultrasoft.toml"),
];

#[test]
fn copies_of_reference_data_equal_their_originals() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let originals = root.join("../shared/data");
    if !originals.is_dir() {
        // Written past the test harness's output capture, so that it appears in every run.
        use std::io::Write;
        let _ = writeln!(
            std::io::stderr(),
            "skipped: copies_of_reference_data_equal_their_originals (no originals beside this checkout)"
        );
        return;
    }
    for (copy, original) in COPIES {
        let read = |path: &Path| {
            fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        };
        let (copy, original) = (root.join(copy), originals.join(original));
        assert!(read(&copy) == read(&original), "{} differs", copy.display());
    }
}
