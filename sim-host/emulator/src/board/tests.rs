//! Functions of the boot ROM, called as firmware calls them, on a board without firmware.

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
const CYCLES_6_5_MHZ: f64 = 6.5e6;

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

/// Calls code at an address, and returns its r0.
fn run(board: &mut Board, address: u32, arguments: [u32; 4]) -> Result<u32, Stop> {
    board.core.regs.r[..4].copy_from_slice(&arguments);
    board.core.regs.r[14] = RETURN | 1;
    board.set_pc(address);
    board.run_until(Time::from_ms(3_000), |board| board.pc() == RETURN)?;
    Ok(board.core.regs.r[0])
}

fn pointer(board: &Board, address: u32) -> u32 {
    board.peek(address & !3) >> (8 * (address & 2)) & 0xFFFF
}

/// Result of the ROM's lookup of `code` in the table whose pointer is at the address `table`.
fn look_up(board: &mut Board, table: u32, code: [u8; 2]) -> u32 {
    let code = u32::from(u16::from_le_bytes(code));
    let (lookup, table) = (pointer(board, 0x18), pointer(board, table));
    run(board, lookup, [table, code, 0, 0]).unwrap()
}

/// Calls a function of the ROM by its code.
fn call(board: &mut Board, code: &[u8; 2], arguments: [u32; 4]) -> Result<u32, Stop> {
    let function = look_up(board, 0x14, *code);
    assert_ne!(function, 0, "{code:?}");
    run(board, function, arguments)
}

fn leave_xip(board: &mut Board) {
    call(board, b"IF", [0; 4]).unwrap();
    call(board, b"EX", [0; 4]).unwrap();
}

fn enter_xip(board: &mut Board) {
    call(board, b"FC", [0; 4]).unwrap();
    call(board, b"CX", [0; 4]).unwrap();
}

fn erase(board: &mut Board, address: u32, count: u32) -> Result<u32, Stop> {
    call(board, b"RE", [address, count, 0x1_0000, 0xD8])
}

fn fill_data(board: &mut Board, word: u32, bytes: u32) {
    for offset in (0..bytes).step_by(4) {
        board.poke(DATA + offset, word);
    }
}

/// Reads a word as an instruction does; returns it with its wait cycles.
fn load(board: &mut Board, address: u32) -> (u32, u32) {
    board.bus.stall = 0;
    let word = board.bus.read32(address);
    (word, board.bus.stall)
}

fn misuse(result: Result<u32, Stop>) -> &'static str {
    match result {
        Err(Stop::Misused { what, .. }) => what,
        other => panic!("{other:?}"),
    }
}

// ---- tables and plain functions ----

#[test]
fn the_rom_begins_with_its_magic_and_finds_what_is_in_its_tables() {
    let mut board = board();
    assert_eq!(board.peek(0x10), u32::from_le_bytes([b'M', b'u', 1, 3]));
    let codes = [
        b"P3", b"R3", b"L3", b"T3", b"MS", b"S4", b"MC", b"C4", b"UB", b"IF", b"EX", b"RE", b"RP",
        b"FC", b"CX", b"WV",
    ];
    for code in codes {
        let function = look_up(&mut board, 0x14, *code);
        assert!(function & 1 == 1 && function < 0x4000, "{code:?}");
    }
    assert_eq!(look_up(&mut board, 0x14, *b"XX"), 0);
    let copyright = look_up(&mut board, 0x16, *b"CR");
    assert_eq!(board.bus.memory.byte(copyright), b'p');
    assert_eq!(look_up(&mut board, 0x16, *b"SF"), 0, "no soft floats");
}

#[test]
fn bits_are_counted_and_turned() {
    let mut board = board();
    for value in [0, 1, 2, 0x8000_0000, 0x0010_0600, 0xDEAD_BEEF, u32::MAX] {
        for (code, expected) in [
            (b"P3", value.count_ones()),
            (b"R3", value.reverse_bits()),
            (b"L3", value.leading_zeros()),
            (b"T3", value.trailing_zeros()),
        ] {
            let result = call(&mut board, code, [value, 0, 0, 0]).unwrap();
            assert_eq!(result, expected, "{code:?} of {value:#x}");
        }
    }
}

#[test]
fn memory_is_set_and_copied_and_its_address_returned() {
    let mut board = board();
    fill_data(&mut board, 0x4433_2211, 16);
    for code in [b"MC", b"C4"] {
        fill_data(&mut board, 0x4433_2211, 16);
        let result = call(&mut board, code, [DATA + 32, DATA, 8, 0]);
        assert_eq!(result, Ok(DATA + 32));
        let copied = [32, 36, 40].map(|offset| board.peek(DATA + offset));
        assert_eq!(copied, [0x4433_2211, 0x4433_2211, 0xA5A5_A5A5]);
    }
    for code in [b"MS", b"S4"] {
        assert_eq!(call(&mut board, code, [DATA, 0x7E, 4, 0]), Ok(DATA));
        assert_eq!(
            [board.peek(DATA), board.peek(DATA + 4)],
            [0x7E7E_7E7E, 0x4433_2211]
        );
    }
    assert_eq!(call(&mut board, b"MS", [DATA, 0, 0, 0]), Ok(DATA));
    assert_eq!(board.peek(DATA), 0x7E7E_7E7E);
}

#[test]
fn the_second_cores_function_ends_the_run() {
    assert!(misuse(call(&mut board(), b"WV", [0; 4])).contains("second core"));
}

// ---- erase and program ----

#[test]
fn a_range_is_erased_by_blocks_where_they_fit_and_programmed_by_pages() {
    use FlashOperationKind::{EraseBlock64, EraseSector, ProgramPage};
    let mut board = board();
    board.flash_mut().import(&vec![0; SIZE]);
    leave_xip(&mut board);
    erase(&mut board, 0xF000, 0x1_2000).unwrap();
    fill_data(&mut board, 0x1234_5678, 512);
    call(&mut board, b"RP", [0x1_0100, DATA, 512, 0]).unwrap();
    enter_xip(&mut board);
    let operations: Vec<_> = board
        .flash()
        .operations()
        .iter()
        .map(|op| (op.kind, op.address))
        .collect();
    assert_eq!(
        operations,
        [
            (EraseSector, 0xF000),
            (EraseBlock64, 0x1_0000),
            (EraseSector, 0x2_0000),
            (ProgramPage, 0x1_0100),
            (ProgramPage, 0x1_0200),
        ]
    );
    for (offset, expected) in [
        (0xEFFC, 0),
        (0xF000, u32::MAX),
        (0x1_00FC, u32::MAX),
        (0x1_0100, 0x1234_5678),
        (0x1_02FC, 0x1234_5678),
        (0x1_0300, u32::MAX),
        (0x2_0FFC, u32::MAX),
        (0x2_1000, 0),
    ] {
        assert_eq!(load(&mut board, FLASH + offset).0, expected, "{offset:#x}");
    }
    assert_eq!(board.bus.stop, None);
}

#[test]
fn a_block_size_beyond_the_flash_erases_by_sectors() {
    let mut board = board();
    leave_xip(&mut board);
    call(&mut board, b"RE", [0x1_0000, 0x1_0000, 1 << 31, 0]).unwrap();
    assert_eq!(board.flash().operations().len(), 16);
}

#[test]
fn nothing_is_erased_or_programmed_where_nothing_is_asked_for() {
    let mut board = board();
    leave_xip(&mut board);
    erase(&mut board, SIZE as u32, 0).unwrap();
    call(&mut board, b"RP", [0, DATA, 0, 0]).unwrap();
    assert!(board.flash().operations().is_empty());
}

#[test]
fn the_functions_take_the_time_of_flash_and_bits() {
    for (flash_times, sector, page) in [
        (FlashTimes::Typical, Time::from_ms(45), Time::from_us(400)),
        (FlashTimes::Longest, Time::from_ms(400), Time::from_ms(3)),
    ] {
        let mut board = board_with(Options {
            flash_times,
            ..Options::default()
        });
        leave_xip(&mut board);
        let begun = board.now();
        erase(&mut board, 0x1000, 0x2000).unwrap();
        let erased = board.now() - begun;
        assert!((2 * sector.as_ps()..2 * sector.as_ps() + 300_000_000).contains(&erased.as_ps()));
        let begun = board.now();
        call(&mut board, b"RP", [0x1000, DATA, 256, 0]).unwrap();
        // 2088 bits, of two commands and the page, at a sixth of 6.5 MHz.
        let bits_ps = (2088.0 * 6.0 / CYCLES_6_5_MHZ * 1e12) as u64;
        let least = page.as_ps() + bits_ps;
        let passed = (board.now() - begun).as_ps();
        assert!(
            (least..least + 100_000_000).contains(&passed),
            "{passed} {least}"
        );
    }
}

#[test]
fn each_misuse_of_the_functions_ends_the_run_with_its_reason() {
    let cases: [(&[u8; 2], [u32; 4], &str); 13] = [
        (b"RE", [0x800, 0x1000, 0x1_0000, 0xD8], "parts of sectors"),
        (b"RE", [0x1000, 0x100, 0x1_0000, 0xD8], "parts of sectors"),
        (b"RE", [SIZE as u32, 0x1000, 0x1_0000, 0xD8], "beyond"),
        (b"RE", [FLASH, 0x1000, 0x1_0000, 0xD8], "beyond"),
        (b"RE", [0xFFFF_F000, 0x1000, 0x1_0000, 0xD8], "beyond"),
        (b"RE", [0, 0x1000, 0x1_0000, 0x20], "block size"),
        (b"RE", [0, 0x1000, 0x1000, 0x02], "block size"),
        (b"RE", [0, 0x1000, 0x3000, 0xD8], "power of two"),
        (b"RE", [0, 0x1000, 0, 0xD8], "power of two"),
        (b"RP", [0x80, DATA, 256, 0], "parts of pages"),
        (b"RP", [0x100, DATA, 100, 0], "parts of pages"),
        (b"RP", [SIZE as u32 - 256, DATA, 512, 0], "beyond"),
        (b"RP", [0x100, FLASH, 256, 0], "not in RAM"),
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
    let arguments = [0x1000, 0x1000, 0x1_0000, 0xD8];
    assert!(misuse(call(&mut board(), b"RE", arguments)).contains("before flash_exit_xip"));
    assert!(misuse(call(&mut board(), b"RP", [0, DATA, 256, 0])).contains("before flash_exit_xip"));
    assert!(misuse(call(&mut board(), b"EX", [0; 4])).contains("connect_internal_flash"));
    let mut board = board();
    leave_xip(&mut board);
    enter_xip(&mut board);
    assert!(misuse(call(&mut board, b"RE", arguments)).contains("before flash_exit_xip"));
}

// ---- reads in place ----

#[test]
fn flash_that_cannot_be_read_ends_the_run_with_the_reason() {
    let reason = |board: &mut Board| {
        load(board, FLASH + 0x1000);
        let stop = board.bus.stop.take();
        stop.map(|stop| stop.to_string()).unwrap_or_default()
    };
    let mut board = board();
    assert_eq!(reason(&mut board), "");
    call(&mut board, b"IF", [0; 4]).unwrap();
    assert_eq!(reason(&mut board), "");
    call(&mut board, b"EX", [0; 4]).unwrap();
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
        assert!(board.bus.stop.take().is_some(), "{window:#x}");
    }
    load(&mut board, 0x10);
    load(&mut board, DATA);
    assert_eq!(board.bus.stop, None);
    erase(&mut board, 0x1000, 0x1000).unwrap();
    assert!(reason(&mut board).contains("chip select"));
    call(&mut board, b"CX", [0; 4]).unwrap();
    assert!(reason(&mut board).contains("chip select"));
    call(&mut board, b"FC", [0; 4]).unwrap();
    assert_eq!(reason(&mut board), "");
}

#[test]
fn flash_that_erases_cannot_be_read() {
    let mut board = board();
    leave_xip(&mut board);
    let function = look_up(&mut board, 0x14, *b"RE");
    board.core.regs.r[..4].copy_from_slice(&[0x1000, 0x1000, 0x1_0000, 0xD8]);
    board.core.regs.r[14] = RETURN | 1;
    board.set_pc(function);
    board.run_for(Time::from_ms(10)).unwrap();
    assert!(board.flash().is_busy());
    load(&mut board, FLASH);
    let stop = board.run_for(Time::from_ms(1)).unwrap_err();
    assert!(stop.to_string().contains("erases or programs"), "{stop}");
}

#[test]
fn reads_by_command_cost_96_clocks_a_line_and_the_flushed_cache_is_empty() {
    let mut board = board();
    board.flash_mut().flip_bit(0x1003, 0);
    assert_eq!(load(&mut board, FLASH + 0x1000), (0xFEFF_FFFF, 66));
    assert_eq!(load(&mut board, FLASH + 0x1004).1, 0);
    // Past the cache: cached content is used, without filling another line; a word alone.
    assert_eq!(load(&mut board, 0x1100_1000).1, 0);
    assert_eq!(load(&mut board, 0x1100_2000).1, 50);
    assert_eq!(load(&mut board, 0x1100_2000).1, 50);
    assert_eq!(load(&mut board, 0x1300_1000), (0xFEFF_FFFF, 50));
    assert_eq!(load(&mut board, 0x1200_1000).1, 66);
    leave_xip(&mut board);
    enter_xip(&mut board);
    assert_eq!(load(&mut board, FLASH + 0x1000).1, 10 + 96 * 6);
    assert_eq!(load(&mut board, FLASH + 0x1004).1, 0);
    assert_eq!(load(&mut board, 0x1300_1000).1, 10 + 64 * 6);
    call(&mut board, b"FC", [0; 4]).unwrap();
    assert_eq!(load(&mut board, FLASH + 0x1004).1, 10 + 96 * 6);
    assert_eq!(board.bus.stop, None);
}

#[test]
fn new_code_in_flash_is_what_runs() {
    // movs r0, #1; bx lr, and likewise with 2.
    let code = |value: u32| 0x4770_2000 | value;
    let mut board = board();
    for value in [1, 2] {
        leave_xip(&mut board);
        erase(&mut board, 0x4000, 0x1000).unwrap();
        fill_data(&mut board, code(value), 256);
        call(&mut board, b"RP", [0x4000, DATA, 256, 0]).unwrap();
        enter_xip(&mut board);
        assert_eq!(run(&mut board, FLASH + 0x4000, [0; 4]), Ok(value));
    }
}

#[test]
fn an_instruction_that_has_to_be_fetched_first_writes_when_it_is_there() {
    // str r1, [r0]
    let mut board = EmulatedBoard::new(
        &Image::of_code(&[0x6001], FILL),
        Still::new([3e6; 4]),
        Settings::default(),
        Options::default(),
    );
    board.bus.write32(0x4000_C000, 0);
    // r0 and r1: PWM.EN, and the bit that starts the count of its first slice.
    board.core.regs.r[..2].copy_from_slice(&[0x4005_00A0, 1]);
    board.set_pc(FLASH + 0x200);
    board.bus.memory.cache.flush();
    let begin = board.now();
    board.step(u64::MAX).unwrap();
    let took_cycles = (board.now() - begin).as_secs_f64() * CYCLES_6_5_MHZ;
    assert!(took_cycles > 66.0, "{took_cycles}");
    let count = board.bus.read32(0x4005_0008);
    assert!(count < 10, "the slice runs for {count} cycles");
}

// ---- interrupts ----

/// Counts interrupt 0 in RAM: its handler adds one to the word at `DATA`.
fn count_interrupts(board: &mut Board) {
    const TABLE: u32 = 0x2000_2000;
    const HANDLER: u32 = 0x2000_2100;
    // ldr r1, [pc, #4]; ldr r0, [r1]; adds r0, #1; str r0, [r1]; bx lr; nop; DATA
    for (offset, word) in [
        (0, 0x6808_4902),
        (4, 0x6008_3001),
        (8, 0xBF00_4770),
        (12, DATA),
    ] {
        board.poke(HANDLER + offset, word);
    }
    board.poke(TABLE + 4 * 16, HANDLER | 1);
    board.poke(DATA, 0);
    board.bus.private.ppb.vtor = TABLE;
    board.bus.write32(0xE000_E100, 1);
}

#[test]
fn interrupts_come_while_a_sector_is_erased() {
    let mut board = board();
    leave_xip(&mut board);
    count_interrupts(&mut board);
    let function = look_up(&mut board, 0x14, *b"RE");
    board.core.regs.r[..4].copy_from_slice(&[0x1000, 0x1000, 0x1_0000, 0xD8]);
    board.core.regs.r[14] = RETURN | 1;
    board.set_pc(function);
    for millisecond in 1..=40 {
        board.bus.write32(0xE000_E200, 1);
        board.run_for(Time::from_ms(1)).unwrap();
        assert_eq!(board.peek(DATA), millisecond);
        assert!(board.flash().is_busy());
    }
    board.run_for(Time::from_ms(6)).unwrap();
    assert_eq!(board.pc(), RETURN);
}

#[test]
fn an_interrupt_that_calls_the_rom_meanwhile_ends_the_run() {
    let mut board = board();
    leave_xip(&mut board);
    let function = look_up(&mut board, 0x14, *b"RE");
    board.core.regs.r[..4].copy_from_slice(&[0x1000, 0x1000, 0x1_0000, 0xD8]);
    board.set_pc(function);
    board.run_for(Time::from_ms(10)).unwrap();
    assert!(misuse(call_again(&mut board, function)).contains("while one of its functions"));
    board.bus.stop = None;
    board.bus.read32(0x1800_0028);
    assert!(matches!(board.bus.stop, Some(Stop::Misused { .. })));
}

fn call_again(board: &mut Board, function: u32) -> Result<u32, Stop> {
    run(board, function, [0; 4])
}

// ---- commands through registers ----

const SSI: u32 = 0x1800_0000;
const SELECT: u32 = 0x4001_800C;

/// Sends bytes with chip select low, as firmware does through the controller's registers.
fn command(board: &mut Board, bytes: &[u8]) -> Vec<u8> {
    board.bus.write32(SELECT, 0x200);
    let mut answer = Vec::new();
    for &byte in bytes {
        while board.bus.read32(SSI + 0x28) & 0b10 == 0 {
            board.bus.boot_delay(Time::from_us(1));
        }
        board.bus.write32(SSI + 0x60, u32::from(byte));
        while board.bus.read32(SSI + 0x28) & 0b1000 == 0 {
            board.bus.boot_delay(Time::from_us(1));
        }
        answer.push(board.bus.read32(SSI + 0x60) as u8);
    }
    board.bus.write32(SELECT, 0x300);
    assert_eq!(board.bus.stop, None);
    answer
}

#[test]
fn the_identifiers_are_read_through_the_controllers_registers() {
    let mut board = board();
    leave_xip(&mut board);
    assert_eq!(
        command(&mut board, &[0x9F, 0, 0, 0])[1..],
        [0xEF, 0x40, 0x15]
    );
    let answer = command(&mut board, &[&[0x4B][..], &[0; 12]].concat());
    assert_eq!(answer[5..], board.flash().unique_id());
    enter_xip(&mut board);
    assert_eq!(load(&mut board, FLASH + 0x1000).0, u32::MAX);
    assert_eq!(board.bus.stop, None);
}

#[test]
fn a_program_by_hand_shows_in_the_status_until_it_is_done() {
    let mut board = board();
    leave_xip(&mut board);
    command(&mut board, &[0x06]);
    command(&mut board, &[0x02, 0, 0x10, 0xFF, 0x12, 0x34]);
    assert_eq!(command(&mut board, &[0x05, 0])[1], 0b11);
    board.bus.boot_delay(Time::from_us(400));
    assert_eq!(command(&mut board, &[0x05, 0])[1], 0);
    // The bytes wrap within the page: after its last byte comes its first.
    assert_eq!(board.flash().bytes(0x10FE, 3), [0xFF, 0x12, 0xFF]);
    assert_eq!(board.flash().byte(0x1000), 0x34);
}

#[test]
fn bytes_take_eight_clocks_each_and_wait_in_queues_of_sixteen() {
    let mut board = board();
    leave_xip(&mut board);
    board.bus.write32(SELECT, 0x200);
    for _ in 0..4 {
        board.bus.write32(SSI + 0x60, 0x05);
    }
    // The first byte is in transmission; three wait.
    assert_eq!(board.bus.read32(SSI + 0x20), 3);
    assert_eq!(board.bus.read32(SSI + 0x28), 0b00011);
    // A byte takes 48 cycles of 6.5 MHz.
    board.bus.boot_delay(Time::from_ns(2 * 7_385));
    assert_eq!(board.bus.read32(SSI + 0x24), 2);
    board.bus.boot_delay(Time::from_ns(2 * 7_385));
    assert_eq!(board.bus.read32(SSI + 0x28), 0b01110);
    for _ in 0..16 {
        board.bus.write32(SSI + 0x60, 0);
    }
    board.bus.boot_delay(Time::from_ms(1));
    board.bus.read32(SSI + 0x28);
    assert!(board.bus.stop.unwrap().to_string().contains("overflow"));
}

#[test]
fn misuse_of_the_controller_ends_the_run_with_its_reason() {
    let cases: [(&[(u32, u32)], &str); 5] = [
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
    ];
    for (writes, expected) in cases {
        let mut board = board();
        leave_xip(&mut board);
        for &(address, value) in writes {
            board.bus.write32(address, value);
        }
        let stop = board.bus.stop.unwrap().to_string();
        assert!(stop.contains(expected), "{stop}");
    }
    let mut board = board();
    leave_xip(&mut board);
    board.bus.read32(SSI + 0x60);
    assert!(board.bus.stop.take().unwrap().to_string().contains("empty"));
    board.bus.write32(SELECT, 0x100);
    assert!(matches!(board.bus.stop, Some(Stop::Unmodelled { .. })));
}

#[test]
fn a_command_to_flash_in_continuous_read_ends_the_run() {
    let mut board = board();
    // The registers set the format of byte transfers, but nothing has ended XIP mode.
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
    assert!(
        board
            .bus
            .stop
            .unwrap()
            .to_string()
            .contains("flash_exit_xip")
    );
}

#[test]
fn what_a_second_stage_writes_brings_quad_reads_back() {
    let mut board = board();
    leave_xip(&mut board);
    call(&mut board, b"FC", [0; 4]).unwrap();
    let wait = |board: &mut Board| {
        while board.bus.read32(SSI + 0x28) & 0b101 != 0b100 {
            board.bus.boot_delay(Time::from_us(1));
        }
    };
    let write = |board: &mut Board, writes: &[(u32, u32)]| {
        for &(offset, value) in writes {
            board.bus.write32(SSI + offset, value);
        }
    };
    // Status register 2 by byte transfers: quad is enabled.
    write(
        &mut board,
        &[(0x08, 0), (0x14, 2), (0xF0, 1), (0x00, 7 << 16), (0x08, 1)],
    );
    write(&mut board, &[(0x60, 0x35), (0x60, 0)]);
    wait(&mut board);
    assert_eq!([0; 2].map(|_| board.bus.read32(SSI + 0x60))[1], 0x02);
    // One read with mode bits, then reads without a command.
    write(
        &mut board,
        &[
            (0x08, 0),
            (0x00, 0x005F_0300),
            (0x04, 0),
            (0xF4, 0x0000_2221),
        ],
    );
    write(&mut board, &[(0x08, 1), (0x60, 0xEB), (0x60, 0xA0)]);
    wait(&mut board);
    write(&mut board, &[(0x08, 0), (0xF4, 0xA000_2022), (0x08, 1)]);
    assert_eq!(load(&mut board, FLASH + 0x1000), (u32::MAX, 66));
    assert_eq!(board.bus.stop, None);
}

// ---- resets and power ----

/// Starts to erase 64 KiB from an address on without waiting for the end.
fn begin_erase(board: &mut Board, address: u32) {
    leave_xip(board);
    let function = look_up(board, 0x14, *b"RE");
    board.core.regs.r[..4].copy_from_slice(&[address, 0x1_0000, 0x1_0000, 0xD8]);
    board.set_pc(function);
    board.run_for(Time::from_ms(5)).unwrap();
    assert!(board.flash().is_busy());
}

/// Makes the watchdog reset the chip at once.
fn reset(board: &mut Board) {
    board.bus.write32(0x4001_0008, 0x1_FFFC);
    board.bus.write32(0x4005_8000, 1 << 31);
    board.run_for(Time::from_us(1)).unwrap();
    assert_eq!(board.resets().watchdog, 1);
}

#[test]
fn a_reset_while_the_flash_erases_delays_the_start_until_it_is_done() {
    let mut board = board();
    begin_erase(&mut board, 0x1_0000);
    let ends = board.flash().operations()[0].begun + Time::from_ms(150);
    reset(&mut board);
    assert!(!board.flash().is_busy() && !board.is_in_boot_loader());
    assert_eq!(board.pc(), FLASH + 0x200);
    let late = board.now() - ends;
    assert!(late < Time::from_ms(5), "{late}");
    assert_eq!(board.flash().byte(0x1_0000), 0xFF);
    assert_eq!(board.peek(RETURN), LOOP, "RAM outlives the watchdog");
}

#[test]
fn a_reset_in_an_erase_beyond_half_a_second_ends_in_the_boot_loader() {
    let mut board = board_with(Options {
        flash_times: FlashTimes::Longest,
        ..Options::default()
    });
    begin_erase(&mut board, 0x1_0000);
    reset(&mut board);
    assert!(board.is_in_boot_loader() && board.flash().is_busy());
    assert!((Time::from_ms(500)..Time::from_ms(530)).contains(&board.now()));
}

/// Sets the ring oscillator to 52 MHz, and resets all stages in `stages` by the watchdog.
fn reset_at_52_megahertz(board: &mut Board, stages: u32) {
    board.bus.write32(0x4006_0010, 0xAA2);
    board.bus.write32(0x4001_0008, stages);
    board.bus.write32(0x4005_8000, 1 << 31);
    board.run_for(Time::from_us(1)).unwrap();
}

#[test]
fn the_boot_rom_goes_by_the_ring_oscillator_which_the_watchdog_may_spare() {
    let longest = Options {
        flash_times: FlashTimes::Longest,
        ..Options::default()
    };
    let mut board = board_with(longest);
    begin_erase(&mut board, 0x1_0000);
    let begun = board.now();
    reset_at_52_megahertz(&mut board, 0x1_FFFC);
    assert!(board.is_in_boot_loader());
    let took = board.now() - begun;
    assert!(
        (Time::from_ms(60)..Time::from_ms(66)).contains(&took),
        "{took}"
    );

    let mut board = self::board();
    reset_at_52_megahertz(&mut board, 0x1_FFFC);
    assert_eq!(board.frequencies_hz().0, 52e6);
    reset_at_52_megahertz(&mut board, 0x1_FFFD);
    assert_eq!(board.frequencies_hz().0, 6.5e6, "reset as well");
    reset_at_52_megahertz(&mut board, 0x1_FFFC);
    board.cycle_power();
    assert_eq!(board.frequencies_hz().0, 6.5e6);
}

#[test]
fn a_cut_of_power_keeps_the_flash_and_loses_the_rest() {
    let mut board = board();
    board.flash_mut().flip_bit(0x1000, 3);
    board.bus.write32(0x4005_800C, 7);
    // 1.15 V, which a watchdog reset would keep.
    board.bus.write32(0x4006_4000, 0xC1);
    let begun = board.now();
    board.cycle_power();
    assert_eq!(
        board.resets(),
        ResetCount {
            watchdog: 0,
            power: 1
        }
    );
    assert_eq!(board.peek(RETURN), 0xA5A5_A5A5);
    assert_eq!(board.bus.read32(0x4005_800C), 0);
    assert_eq!(
        board.bus.read32(0x4006_4000),
        0x10B1,
        "the core voltage at the start"
    );
    assert_eq!(
        board.bus.read32(0x4006_4008),
        1 << 8,
        "power-on is the cause"
    );
    assert_eq!(board.flash().byte(0x1000), 0xF7);
    assert_eq!((board.pc(), board.now() > begun), (FLASH + 0x200, true));
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
    board.bus.write32(0x4001_0008, 0x1_FFFC);
    board.bus.write32(0x4005_8000, 1 << 31);
    let stop = board.run_for(Time::from_us(1)).unwrap_err();
    assert!(stop.to_string().contains("scratch registers"), "{stop}");
}

#[test]
fn power_cut_in_any_operation_leaves_those_before_it_whole_and_those_after_it_undone() {
    let mut start = board();
    start
        .flash_mut()
        .import(&[&image().flash[..0x4000], &[0; 0x4000][..]].concat());
    fill_data(&mut start, 0x0F0F_0F0F, 1024);
    for number in 0..8 {
        let mut board = start.clone();
        board.flash_mut().cut_power_at_operation(number);
        leave_xip(&mut board);
        let erased = call(&mut board, b"RE", [0x4000, 0x4000, 1 << 31, 0]);
        let programmed = erased.and_then(|_| call(&mut board, b"RP", [0x4000, DATA, 1024, 0]));
        assert_eq!(programmed, Err(Stop::TimedOut), "the caller is gone");
        assert_eq!(board.resets().power, 1);
        let number = number as usize;
        assert_eq!(board.flash().operations().len(), number + 1);
        for sector in 0..4 {
            let bytes = board
                .flash()
                .bytes(0x4000 + 0x1000 * sector as u32 + 0x400, 0xC00);
            let is = |value: u8| bytes.iter().all(|&byte| byte == value);
            assert_eq!(is(0xFF), sector < number, "{number}: {sector}");
            assert!(sector <= number || is(0), "{number}: {sector}");
        }
        for page in 0..4 {
            let bytes = board.flash().bytes(0x4000 + 0x100 * page as u32, 0x100);
            let is_whole = bytes.iter().all(|&byte| byte == 0x0F);
            assert_eq!(is_whole, page + 4 < number, "{number}: page {page}");
        }
    }
}

// ---- the boot loader ----

fn in_boot_loader() -> Board {
    let mut board = board();
    board.bus.write32(0x4005_802C, 1 << 9 | 12);
    let function = look_up(&mut board, 0x14, *b"UB");
    board.core.regs.r[..2].copy_from_slice(&[1 << 25, 0b10]);
    board.set_pc(function);
    board.run_for(Time::from_ms(30)).unwrap();
    board
}

#[test]
fn the_boot_loader_has_its_masks_and_the_pins_are_as_after_a_reset() {
    let mut board = board();
    board.bus.write32(
        0x4000_C000,
        0x01FF_FFFF & !(1 << 5 | 1 << 8 | 1 << 6 | 1 << 9),
    );
    board.bus.write32(0x4001_4000 + 8 * 18 + 4, 5);
    board.bus.write32(0xD000_0014, 1 << 18);
    board.bus.write32(0xD000_0024, 1 << 18);
    assert!(board.bridge().awake);
    let function = look_up(&mut board, 0x14, *b"UB");
    board.core.regs.r[..2].copy_from_slice(&[1 << 25, 0b10]);
    board.set_pc(function);
    board.run_for(Time::from_ms(1)).unwrap();
    assert!(
        !board.is_in_boot_loader() && board.bridge().awake,
        "the watchdog has not come yet"
    );
    board.run_for(Time::from_ms(30)).unwrap();
    let loader = board.boot_loader().unwrap();
    assert_eq!(
        (loader.activity_pins, loader.disabled_interfaces),
        (1 << 25, 0b10)
    );
    assert!(!board.bridge().awake);
    let scratch = [0x4005_800C, 0x4005_8010].map(|address| board.bus.read32(address));
    assert_eq!(scratch, [1 << 25, 0b10]);
    let instructions = board.instructions();
    board.run_for(Time::from_ms(10)).unwrap();
    assert_eq!(
        board.instructions(),
        instructions,
        "nothing of the firmware runs"
    );
}

#[test]
fn a_uf2_replaces_its_sectors_and_no_other_and_starts() {
    let mut board = in_boot_loader();
    board.flash_mut().import(&vec![0x33; SIZE]);
    let new = Image::of_code(&[0xE7FE, 0xE7FD], 0x77);
    board.write_uf2(&new.to_uf2()).unwrap();
    assert!(!board.is_in_boot_loader());
    assert_eq!(board.resets().watchdog, 2);
    assert_eq!(board.pc(), FLASH + 0x200);
    assert_eq!(board.flash().bytes(0, SECTOR as u32), new.flash[..SECTOR]);
    assert_eq!(board.flash().bytes(SECTOR as u32, 16), [0x33; 16]);
    assert_eq!(board.flash().erase_counts()[..2], [1, 0]);
    board.run_for(Time::from_ms(1)).unwrap();
}

#[test]
fn a_part_of_a_uf2_leaves_the_board_in_the_boot_loader_and_the_rest_completes_it() {
    let mut board = in_boot_loader();
    let file = image().to_uf2();
    board.write_uf2(&file[..5 * 512]).unwrap();
    assert!(board.is_in_boot_loader());
    board.write_uf2(&file[3 * 512..]).unwrap();
    assert!(!board.is_in_boot_loader());
    assert_eq!(board.flash().erase_counts()[0], 1);
}

#[test]
fn a_uf2_needs_the_boot_loader_with_its_drive_and_blocks_within_the_flash() {
    let file = image().to_uf2();
    assert_eq!(board().write_uf2(&file), Err(Uf2Error::NotInBootLoader));
    let mut board = in_boot_loader();
    board.boot_loader.as_mut().unwrap().disabled_interfaces = 1;
    assert_eq!(board.write_uf2(&file), Err(Uf2Error::NoDrive));
    let mut board = in_boot_loader();
    let mut elsewhere = file.clone();
    elsewhere[12..16].copy_from_slice(&0x1020_0000_u32.to_le_bytes());
    let address = 0x1020_0000;
    assert_eq!(
        board.write_uf2(&elsewhere),
        Err(Uf2Error::Misplaced { address })
    );
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
            // The second stage is present, and its page was the first.
            assert!(number > 1, "{number}");
            board.core.halt();
            board.start_boot_loader([0; 2]);
        }
        board.write_uf2(&file).unwrap();
        assert_eq!(board.flash().bytes(0, SECTOR as u32), new.flash[..SECTOR]);
    }
    let mut board = start.clone();
    board.flash_mut().cut_power_at_operation(17);
    board.write_uf2(&file).unwrap();
    assert!(board.flash_mut().cancel_power_cut());
}

// ---- snapshots ----

#[test]
fn a_snapshot_within_an_erase_goes_on_as_its_origin_does() {
    let mut board = board();
    board
        .flash_mut()
        .import(&[&image().flash[..0x1000], &[0; 0x2_0000][..]].concat());
    board.flash_mut().cut_power_at_operation(1);
    begin_erase(&mut board, 0x1_0000);
    let mut snapshot = board.clone();
    let finish = |board: &mut Board| {
        board.run_for(Time::from_ms(200)).unwrap();
        leave_xip(board);
        let erased = erase(board, 0x1_0000, 0x1000);
        assert_eq!(erased, Err(Stop::TimedOut), "cut");
        (board.now(), board.instructions(), board.pc())
    };
    assert!(snapshot.flash().is_busy());
    assert_eq!(finish(&mut board), finish(&mut snapshot));
    assert!(board.flash() == snapshot.flash());
    assert_eq!(board.resets(), snapshot.resets());
}
