//! Fuzz target: bytes decoded as records and as commands.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(defect) = (system_tests::fuzz::FRAMES.run)(bytes) {
        panic!("{defect}");
    }
});
