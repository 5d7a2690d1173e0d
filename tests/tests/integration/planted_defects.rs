//! The list of planted defects stays plantable; `cargo xtask evidence planted-defects` plants them.

use std::{fs, path::Path};

use system_tests::planted::{LIST, parse};

#[test]
fn every_defect_can_be_planted() {
    let defects = parse(LIST).unwrap();
    assert!(defects.len() >= 5);
    for defect in defects {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("..")
            .join(&defect.file);
        let source = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path:?}: {error}"));
        let planted = defect.plant(&source).unwrap();
        assert_ne!(planted, source, "{}", defect.name);
    }
}
