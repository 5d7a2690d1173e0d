//! Numbers of docs/faults.md that follow from the board's clocks.

use std::fs;
use std::path::Path;

use palpate_node::board::Clkin;

#[test]
fn the_page_of_the_faults_has_the_fastest_sensor() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/faults.md");
    let page = fs::read_to_string(page).unwrap();
    // The converter's input stays below a quarter of its clock (LDC1614 datasheet, table 43).
    let [single_mhz, scan_mhz] =
        [Clkin::SINGLE, Clkin::SCAN].map(|clock| f64::from(clock.hz()) / 4e6);
    let limits = format!("{single_mhz:.2} MHz with one channel, {scan_mhz} MHz with several");
    assert!(page.contains(&limits), "{limits}");
}
