//! Settings and calibration in the image's flash.
//!
//! Small form; every operation and more bits are the campaign `image-storage`.

use palpate_emulator::{FlashTimes, Time};
use palpate_wire::Command;

use crate::common::stored::{Amount, ThirdSave, Which, configuration, spread, streaming_with};

#[test]
fn settings_and_calibration_outlive_a_reboot_and_a_loss_of_power() {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    let commands = configuration(1, Amount::Usual);
    bench.save(&commands);
    println!("{:?}", bench.status().stack_bytes);
    let found = bench.reboot();
    assert!(found.is(&commands), "{found:?}");
    let found = bench.cycle_power();
    assert!(found.is(&commands), "{found:?}");
}

#[test]
fn a_power_cut_in_a_save_leaves_all_of_the_old_or_all_of_the_new() {
    let begin = std::time::Instant::now();
    let save = ThirdSave::prepared(Amount::Usual, FlashTimes::Typical, 1);
    println!("{:?}", begin.elapsed());
    let count = save.operations.len() as u64;
    println!("{count}");
    let mut found = Vec::new();
    for operation in spread(10, count) {
        let (which, _, at_start) = save.cut(operation);
        assert_ne!(which, Which::Neither, "{operation}: {at_start:?}");
        found.push(which);
    }
    println!("{found:?} {:?}", begin.elapsed());
    assert!(found.is_sorted() && found.contains(&Which::New));
    let _ = (Time::ZERO, Command::Store);
}
