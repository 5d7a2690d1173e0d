//! Fuzz target: bytes as operations on a storage's flash.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(defect) = (system_tests::fuzz::STORAGE.run)(bytes) {
        panic!("{defect}");
    }
});
