//! Fuzz target: bytes over the links of a board.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(defect) = (system_tests::fuzz::COMMANDS.run)(bytes) {
        panic!("{defect}");
    }
});
