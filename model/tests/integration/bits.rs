//! The evaluation gives the same bits with and without optimisation, on a PC and on a target.

use crate::common::pipeline::{Bits, run};

/// Bits of the results of `crate::common::pipeline`. A change of any formula changes them; a change
/// of compiler, optimisation or machine must not.
#[rustfmt::skip]
const EXPECTED: Bits = [
    0x3FC7_985F, 0x3A92_8662, 0x3FC7_5065, 0x3FC7_E06D, 0x40BE_0ACC, 0x3F49_CEA5,
    0x4094_2C32, 0x40FA_DAE3, 0x3DA1_4E85, 0x3FB3_D5E2, 0x3FDB_5ADC, 0x4211_3849,
    0x3517_57CD, 0x38E4_1AF9, 0x39B3_EB28, 0x3409_23F1, 0x3FA8_0146, 0x39A3_FDC1,
    0x4212_3C56, 0x41C9_982C, 0xB275_B942, 0x3963_068C, 0xBB16_4AFA, 0x40A2_EFA0,
    0x45BD_96A6, 0x4585_748F, 0x3B03_E6E1, 0x399F_D25F, 0x3F4B_8BDE, 0x3B07_51C1,
    0x3E64_C4D0, 0x38AD_AFE2, 0x3ED0_C6BC, 0x3F4B_D647,
];

#[test]
fn an_evaluation_has_the_frozen_bits() {
    let bits = run(std::hint::black_box(1.0)).expect("nothing in it is refused");
    let values = bits.map(f32::from_bits);
    println!("{bits:#010x?}\n{values:?}");
    assert!(values.iter().all(|value| value.is_finite()));
    assert_eq!(bits, EXPECTED);
}
