//! Runs the fuzzer's corpus, input by input: the targets of `cargo xtask fuzz` without a fuzzer.

use std::fs;
use std::path::Path;

use system_tests::fuzz::{TARGETS, Target};

fn corpus(target: &Target) -> Vec<(String, Vec<u8>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus");
    let files = fs::read_dir(root.join(target.name)).unwrap();
    let files = files.map(|file| {
        let file = file.unwrap();
        let name = file.file_name().to_string_lossy().into_owned();
        (name, fs::read(file.path()).unwrap())
    });
    files.collect()
}

#[test]
fn every_input_of_the_corpus_keeps_every_promise() {
    for target in TARGETS {
        let inputs = corpus(&target);
        assert!(inputs.len() >= 8, "{}", target.name);
        for (name, bytes) in inputs {
            assert_eq!((target.run)(&bytes), Ok(()), "{}/{name}", target.name);
        }
    }
}

#[test]
fn the_same_byte_a_few_times_is_a_script_as_well() {
    for target in TARGETS {
        for byte in 0..=u8::MAX {
            let bytes = vec![byte; usize::from(byte % 6)];
            assert_eq!((target.run)(&bytes), Ok(()), "{}: {bytes:?}", target.name);
        }
    }
}
