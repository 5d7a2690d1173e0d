//! All sectors wear equally.

use crate::support::specimens::{fullest, typical};
use crate::support::wear::{alternating, wear};

#[track_caller]
fn assert_even((least, greatest): (u32, u32), saves: u32, sectors: u32) {
    assert!(greatest - least <= 2, "{least} to {greatest}");
    // Each save erases the sectors of the save before the stored one.
    let expected = saves * sectors / 16;
    assert!(
        greatest.abs_diff(expected) <= 2,
        "{greatest}, not {expected}"
    );
}

#[test]
fn the_sectors_are_erased_equally_often() {
    assert_even(wear(500, alternating(typical)), 500, 1);
    assert_even(wear(100, alternating(fullest)), 100, 2);
}
