//! `palpate flash`: the emulated board in its boot loader, and refusals before a board is reached.

use std::fs;

use crate::serve::Server;
use crate::support::{emulated, image, json, palpate};

#[test]
fn the_board_runs_what_was_flashed_and_keeps_its_settings() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let set = ["settings", "set", "rate_hz=250", "--store"];
    assert!(emulated(&set, folder).status.success());
    let elf = image().to_str().unwrap();
    let flashed = json(&emulated(&["flash", elf, "--json"], folder));
    let bytes = flashed["written_bytes"].as_u64().unwrap();
    assert!((150_000..300_000).contains(&bytes), "{flashed}");
    assert_eq!(flashed["firmware"], env!("CARGO_PKG_VERSION"));
    let settings = json(&emulated(&["settings", "get", "--json"], folder));
    assert!(settings.to_string().contains("250"), "{settings}");
}

#[test]
fn the_drive_takes_the_firmware_and_the_board_is_asked_who_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let drive = folder.path();
    // Contents as in the boot ROM (RP2040 datasheet 2.8.4.3).
    let info = "UF2 Bootloader v3.0\r\nModel: Raspberry Pi RP2\r\nBoard-ID: RPI-RP2\r\n";
    fs::write(drive.join("INFO_UF2.TXT"), info).unwrap();
    let server = Server::start(&[]);
    let board = format!("tcp:{}", server.address);
    let elf = image().to_str().unwrap();
    let flash = ["flash", elf, "--drive", ".", "--board", &board, "--json"];
    let flashed = json(&palpate(&flash, drive));
    assert_eq!(flashed["firmware"], env!("CARGO_PKG_VERSION"));
    let written = fs::read(drive.join("palpate.uf2")).unwrap();
    assert!(written.starts_with(b"UF2\n"));
    assert_eq!(
        written.len() as u64 / 2,
        flashed["written_bytes"].as_u64().unwrap()
    );
}

#[test]
fn what_is_no_firmware_is_refused_before_a_board_is_reached() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("notes.uf2"), [0; 1024]).unwrap();
    let elf = image().to_str().unwrap();
    for (arguments, said) in [
        (&["flash", "notes.uf2"][..], "block 0"),
        (&["flash", "missing.uf2"], "missing.uf2"),
        (&["flash", elf, "--drive", "."], "INFO_UF2.TXT"),
    ] {
        let output = palpate(arguments, folder);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(said), "{message}");
    }
}
