//! Misuse of flash, boot ROM and boot loader ends the run with its reason, on a board without
//! firmware. Also covers states that no test with an image reaches.

use ldc161x_sim::Settings;
use rp2040_emu::core::CoreBus;

use super::*;
use crate::board::flash::{FlashOperationKind, FlashTimes, SECTOR, SIZE};
use crate::board::plant::Still;
use crate::image::FLASH;

type Board = EmulatedBoard<Still>;

/// Return address of the called functions: a loop in RAM.
const RETURN: u32 = 0x2000_0000;
const DATA: u32 = 0x2000_1000;
/// The instruction `b .`, an endless loop, twice.
const LOOP: u32 = 0xE7FE_E7FE;
/// Byte that fills the flash after the image's code, unlike an erased byte.
const FILL: u8 = 0x5A;
const SSI: u32 = 0x1800_0000;
const SELECT: u32 = 0x4001_800C;
/// Arguments of an erase of 64 KiB.
const ERASE: [u32; 4] = [0x1_0000, 0x1_0000, 0x1_0000, 0xD8];

fn image() -> Image {
    Image::of_code(&[0xE7FE], FILL)
}

fn board_with(options: Options) -> Board {
    let plant = Still::new([3e6; 4]);
    let mut board = EmulatedBoard::new(&image(), plant, Settings::default(), options);
    board.poke(RETURN, LOOP);
    board
}

fn board() -> Board {
    board_with(Options::default())
}

/// Calls a function of the ROM by its code, without waiting for its end.
fn begin(board: &mut Board, code: [u8; 2], arguments: [u32; 4]) {
    let half_word = |address: u32| board.peek(address & !3) >> (8 * (address & 2)) & 0xFFFF;
    let code = u32::from(u16::from_le_bytes(code));
    let mut entries = (half_word(0x14)..).step_by(4);
    let function = half_word(entries.find(|&entry| half_word(entry) == code).unwrap() + 2);
    board.core.regs.r[..4].copy_from_slice(&arguments);
    board.core.regs.r[14] = RETURN | 1;
    board.set_pc(function);
}

/// Calls a function of the ROM by its code.
fn call(board: &mut Board, code: [u8; 2], arguments: [u32; 4]) -> Result<(), Stop> {
    begin(board, code, arguments);
    board.run_until(Time::from_ms(3_000), |board| board.pc() == RETURN)
}

fn leave_xip(board: &mut Board) {
    call(board, *b"IF", [0; 4]).unwrap();
    call(board, *b"EX", [0; 4]).unwrap();
}

/// Starts to erase 64 KiB without waiting for the end.
fn begin_erase(board: &mut Board) {
    leave_xip(board);
    begin(board, *b"RE", ERASE);
    board.run_for(Time::from_ms(5)).unwrap();
    assert!(board.flash().is_busy());
}

/// Reads a word as an instruction does; returns it with its wait cycles.
fn load(board: &mut Board, address: u32) -> (u32, u32) {
    board.bus.stall = 0;
    let word = board.bus.read32(address);
    (word, board.bus.stall)
}

/// Reason why the run has stopped, empty if it has not; clears the reason.
fn stopped(board: &mut Board) -> String {
    let stop = board.bus.stop.take();
    stop.map(|stop| stop.to_string()).unwrap_or_default()
}

fn misuse(result: Result<(), Stop>) -> &'static str {
    match result {
        Err(Stop::Misused { what, .. }) => what,
        other => panic!("{other:?}"),
    }
}

// ---- functions of the boot ROM ----

#[test]
fn each_misuse_of_the_functions_ends_the_run_with_its_reason() {
    let cases: [([u8; 2], [u32; 4], &str); 13] = [
        (*b"RE", [0x800, 0x1000, 0x1_0000, 0xD8], "parts of sectors"),
        (*b"RE", [0x1000, 0x100, 0x1_0000, 0xD8], "parts of sectors"),
        (*b"RE", [SIZE as u32, 0x1000, 0x1_0000, 0xD8], "beyond"),
        (*b"RE", [FLASH, 0x1000, 0x1_0000, 0xD8], "beyond"),
        (*b"RE", [0xFFFF_F000, 0x1000, 0x1_0000, 0xD8], "beyond"),
        (*b"RE", [0, 0x1000, 0x1_0000, 0x20], "block size"),
        (*b"RE", [0, 0x1000, 0x1000, 0x02], "block size"),
        (*b"RE", [0, 0x1000, 0x3000, 0xD8], "power of two"),
        (*b"RE", [0, 0x1000, 0, 0xD8], "power of two"),
        (*b"RP", [0x80, DATA, 256, 0], "parts of pages"),
        (*b"RP", [0x100, DATA, 100, 0], "parts of pages"),
        (*b"RP", [SIZE as u32 - 256, DATA, 512, 0], "beyond"),
        (*b"RP", [0x100, FLASH, 256, 0], "not in RAM"),
    ];
    for (code, arguments, expected) in cases {
        let mut board = board();
        leave_xip(&mut board);
        let what = misuse(call(&mut board, code, arguments));
        assert!(what.contains(expected), "{arguments:x?}: {what}");
        assert!(board.flash().operations().is_empty());
    }
}

#[test]
fn the_functions_are_called_in_their_order() {
    for (code, arguments, expected) in [
        (*b"RE", ERASE, "before flash_exit_xip"),
        (*b"RP", [0, DATA, 256, 0], "before flash_exit_xip"),
        (*b"EX", [0; 4], "connect_internal_flash"),
    ] {
        let what = misuse(call(&mut board(), code, arguments));
        assert!(what.contains(expected), "{what}");
    }
}

#[test]
fn an_interrupt_that_calls_the_rom_meanwhile_ends_the_run() {
    let mut board = board();
    begin_erase(&mut board);
    let again = misuse(call(&mut board, *b"RE", [0; 4]));
    assert!(again.contains("while one of its functions"), "{again}");
    board.bus.stop = None;
    board.bus.read32(SSI + 0x28);
    assert!(matches!(board.bus.stop, Some(Stop::Misused { .. })));
}

// ---- reads in place ----

#[test]
fn flash_that_cannot_be_read_ends_the_run_with_the_reason() {
    let reason = |board: &mut Board| {
        load(board, FLASH + 0x1000);
        stopped(board)
    };
    let mut board = board();
    assert_eq!(reason(&mut board), "");
    call(&mut board, *b"IF", [0; 4]).unwrap();
    assert_eq!(reason(&mut board), "");
    call(&mut board, *b"EX", [0; 4]).unwrap();
    assert!(reason(&mut board).contains("not in XIP mode"));
    // A read stops the run in each of the flash windows, but neither in ROM nor in RAM.
    for window in [
        0x1000_0000,
        0x1100_0000,
        0x1200_0000,
        0x1300_0000,
        0x13FF_FFFC,
    ] {
        load(&mut board, window);
        assert_ne!(stopped(&mut board), "", "{window:#x}");
    }
    load(&mut board, 0x10);
    load(&mut board, DATA);
    assert_eq!(stopped(&mut board), "");
    call(&mut board, *b"RE", ERASE).unwrap();
    assert!(reason(&mut board).contains("chip select"));
    call(&mut board, *b"FC", [0; 4]).unwrap();
    assert!(reason(&mut board).contains("not in XIP mode"));
    begin_erase(&mut board);
    assert!(reason(&mut board).contains("erases or programs"));
}

#[test]
fn each_window_of_the_flash_goes_its_way_past_the_cache() {
    let mut board = board();
    board.flash_mut().flip_bit(0x1003, 0);
    assert_eq!(load(&mut board, FLASH + 0x1000), (0xFEFF_FFFF, 66));
    assert_eq!(load(&mut board, FLASH + 0x1004).1, 0);
    // Window without allocation: a hit costs 0 cycles; a miss reads one word and fills no line.
    assert_eq!(load(&mut board, 0x1100_1000).1, 0);
    assert_eq!(load(&mut board, 0x1100_2000).1, 50);
    assert_eq!(load(&mut board, 0x1100_2000).1, 50);
    assert_eq!(load(&mut board, 0x1300_1000), (0xFEFF_FFFF, 50));
    assert_eq!(load(&mut board, 0x1200_1000).1, 66);
}

// ---- the flash's controller ----

#[test]
fn misuse_of_the_controller_ends_the_run_with_its_reason() {
    let overflow = [(SSI + 0x60, 0x05); 18];
    let cases: [(&[(u32, u32)], &str); 7] = [
        (&[(SSI + 0x14, 4)], "SSIENR"),
        (&[(SSI + 0x08, 0), (SSI + 0x60, 0)], "disabled"),
        (&[(SSI + 0x10, 0), (SSI + 0x60, 0)], "disabled"),
        (
            &[(SELECT, 0x200), (SSI + 0x60, 0x9F), (SELECT, 0x300)],
            "within a byte",
        ),
        (
            &[
                (SSI + 0x08, 0),
                (SSI, 1 << 16),
                (SSI + 0x08, 1),
                (SSI + 0x60, 0),
            ],
            "format",
        ),
        (&overflow, "transmit queue overflow"),
        (&[(SELECT, 0x100)], "not modelled"),
    ];
    for (writes, expected) in cases {
        let mut board = board();
        leave_xip(&mut board);
        for &(address, value) in writes {
            board.bus.write32(address, value);
        }
        let stop = stopped(&mut board);
        assert!(stop.contains(expected), "{stop}");
    }
    let mut board = board();
    leave_xip(&mut board);
    board.bus.read32(SSI + 0x60);
    assert!(stopped(&mut board).contains("empty"));
    for _ in 0..17 {
        board.bus.write32(SSI + 0x60, 0x05);
    }
    board.bus.boot_delay(Time::from_ms(1));
    board.bus.read32(SSI + 0x28);
    assert!(stopped(&mut board).contains("receive queue overflow"));
}

#[test]
fn a_command_to_flash_in_continuous_read_ends_the_run() {
    let mut board = board();
    // The registers set the format of byte transfers, but XIP mode has not been ended.
    for (address, value) in [
        (SSI + 8, 0),
        (SSI, 7 << 16),
        (SSI + 8, 1),
        (SSI + 0x60, 0x9F),
    ] {
        board.bus.write32(address, value);
    }
    board.bus.boot_delay(Time::from_us(10));
    board.bus.read32(SSI + 0x28);
    assert!(stopped(&mut board).contains("flash_exit_xip"));
}

// ---- resets ----

/// The ring oscillator times the boot ROM's wait for the flash; a reset may leave it as set.
#[test]
fn a_reset_in_an_erase_that_lasts_too_long_ends_in_the_boot_loader() {
    for (divider, waits) in [
        (0xAB0, Time::from_ms(500)..Time::from_ms(530)),
        (0xAA2, Time::from_ms(60)..Time::from_ms(66)),
    ] {
        let mut board = board_with(Options {
            flash_times: FlashTimes::Longest,
            ..Options::default()
        });
        begin_erase(&mut board);
        board.bus.write32(0x4006_0010, divider);
        let begun = board.now();
        reset(&mut board, 0x1_FFFC).unwrap();
        assert!(board.is_in_boot_loader() && board.flash().is_busy());
        let took = board.now() - begun;
        assert!(waits.contains(&took), "{took}");
    }
}

/// Resets the stages in `stages` by the watchdog.
fn reset(board: &mut Board, stages: u32) -> Result<(), Stop> {
    board.bus.write32(0x4001_0008, stages);
    board.bus.write32(0x4005_8000, 1 << 31);
    board.run_for(Time::from_us(1))
}

#[test]
fn a_flash_without_its_second_stage_starts_the_boot_loader() {
    let mut board = board();
    for address in [0, 0x80, 0xFF] {
        board.flash_mut().flip_bit(address, 5);
        board.cycle_power();
        assert!(board.is_in_boot_loader(), "{address:#x}");
        board.flash_mut().flip_bit(address, 5);
        board.cycle_power();
        assert!(!board.is_in_boot_loader());
    }
}

#[test]
fn a_start_through_scratch_registers_is_not_followed() {
    let mut board = board();
    board.bus.write32(0x4005_801C, 0xB007_C0D3);
    let stop = reset(&mut board, 0x1_FFFC).unwrap_err();
    assert!(stop.to_string().contains("scratch registers"), "{stop}");
}

// ---- the boot loader ----

fn in_boot_loader() -> Board {
    let mut board = board();
    board.bus.write32(0x4005_802C, 1 << 9 | 12);
    begin(&mut board, *b"UB", [1 << 25, 0b10, 0, 0]);
    board.run_for(Time::from_ms(30)).unwrap();
    board
}

#[test]
fn a_uf2_needs_the_boot_loader_with_its_drive_and_all_of_its_blocks_within_the_flash() {
    let file = image().to_uf2();
    assert_eq!(board().write_uf2(&file), Err(Uf2Error::NotInBootLoader));
    let mut board = in_boot_loader();
    let mut elsewhere = file.clone();
    let address = 0x1020_0000_u32;
    elsewhere[12..16].copy_from_slice(&address.to_le_bytes());
    assert_eq!(
        board.write_uf2(&elsewhere),
        Err(Uf2Error::Misplaced { address })
    );
    let mut board = in_boot_loader();
    board.write_uf2(&file[..5 * 512]).unwrap();
    assert!(board.is_in_boot_loader());
    board.write_uf2(&file[3 * 512..]).unwrap();
    assert!(!board.is_in_boot_loader());
    let operations = board.flash().operations().iter();
    let erases = operations.filter(|of| of.kind == FlashOperationKind::EraseSector);
    assert_eq!(erases.count(), 1);
    let mut board = in_boot_loader();
    board.boot_loader.as_mut().unwrap().disabled_interfaces = 1;
    assert_eq!(board.write_uf2(&file), Err(Uf2Error::NoDrive));
}

#[test]
fn power_cut_at_any_operation_of_an_update_ends_in_the_boot_loader_or_in_a_whole_image() {
    let start = in_boot_loader();
    let new = Image::of_code(&[0xE7FE, 0xE7FD], 0x77);
    let file = new.to_uf2();
    for number in 0..17 {
        let mut board = start.clone();
        board.flash_mut().cut_power_at_operation(number);
        assert_eq!(
            board.write_uf2(&file),
            Err(Uf2Error::PowerFailed),
            "{number}"
        );
        assert_eq!(board.resets().power, 1);
        if !board.is_in_boot_loader() {
            // Operation 0 erases the sector, operation 1 programs the page of the second stage.
            assert!(number > 1, "{number}");
            board.core.halt();
            board.start_boot_loader(0);
        }
        board.write_uf2(&file).unwrap();
        assert_eq!(board.flash().bytes(0, SECTOR as u32), new.flash[..SECTOR]);
    }
    let mut board = start.clone();
    board.flash_mut().cut_power_at_operation(17);
    board.write_uf2(&file).unwrap();
    assert!(board.flash_mut().cancel_power_cut());
}
