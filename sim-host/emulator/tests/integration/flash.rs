//! The image's flash, rewritten and read again through its own second stage.

use ldc161x_sim::Settings;
use palpate_emulator::{EmulatedBoard, FlashOperationKind, Options, Still, Time};

use super::common::{FREQUENCIES_HZ, image};

type Board = EmulatedBoard<Still>;

/// RAM addresses of code, of a copy of the second stage, and of data. They overwrite the image's
/// memory, so the image does not continue.
const CODE: u32 = 0x2004_0000;
const SECOND_STAGE: u32 = 0x2004_0400;
const DATA: u32 = 0x2004_0600;
/// A sector outside of the image.
const SECTOR: u32 = 0x1F_0000;
const FLASH: u32 = 0x1000_0000;

fn board() -> Board {
    let plant = Still::new(FREQUENCIES_HZ);
    let mut board = EmulatedBoard::new(image(), plant, Settings::default(), Options::default());
    board.run_for(Time::from_ms(300)).unwrap();
    board
}

/// A call of a function with its arguments.
type Call = (u32, [u32; 4]);

/// Address of a boot ROM function, from its table.
fn rom(board: &Board, code: &[u8; 2]) -> u32 {
    let half_word = |address: u32| board.peek(address & !3) >> (8 * (address & 2)) & 0xFFFF;
    let code = u32::from(u16::from_le_bytes(*code));
    let mut entries = (half_word(0x14)..).step_by(4);
    half_word(entries.find(|&entry| half_word(entry) == code).unwrap() + 2)
}

/// Makes the processor call functions one after the other, without interrupts and watchdog, and
/// then loop; returns the address of the loop.
fn begin_calls(board: &mut Board, calls: &[Call]) -> u32 {
    // cpsid i; ldr r7, =calls; ldr r0, =WATCHDOG; movs r1, #0; str r1, [r0]
    let mut words: Vec<u16> = vec![0xB672, 0x4F1F, 0x481F, 0x2100, 0x6001];
    for _ in calls {
        // ldmia r7!, {r0-r4}; blx r4
        words.extend([0xCF1F, 0x47A0]);
    }
    // b .
    words.push(0xE7FE);
    let end = CODE + 2 * (words.len() as u32 - 1);
    let code = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    write(board, CODE, code);
    board.poke(CODE + 0x80, CODE + 0x88);
    board.poke(CODE + 0x84, 0x4005_8000);
    let table = calls
        .iter()
        .flat_map(|&(function, [a, b, c, d])| [a, b, c, d, function | 1]);
    for (offset, word) in (0x88..).step_by(4).zip(table) {
        board.poke(CODE + offset, word);
    }
    board.set_pc(CODE);
    end
}

fn write(board: &mut Board, address: u32, mut bytes: Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    for (offset, word) in (0..).step_by(4).zip(bytes.chunks(4)) {
        board.poke(
            address + offset,
            u32::from_le_bytes(word.try_into().unwrap()),
        );
    }
}

/// Calls that erase a sector and program its first page from `DATA`, up to the cache flush.
fn rewriting(board: &Board) -> Vec<Call> {
    vec![
        (rom(board, b"IF"), [0; 4]),
        (rom(board, b"EX"), [0; 4]),
        (rom(board, b"RE"), [SECTOR, 0x1000, 0x1_0000, 0xD8]),
        (rom(board, b"RP"), [SECTOR, DATA, 0x100, 0]),
        (rom(board, b"FC"), [0; 4]),
    ]
}

#[test]
fn code_that_was_just_programmed_runs_after_the_images_own_second_stage() {
    let mut board = board();
    // movs r0, #7; bx lr
    write(&mut board, DATA, vec![0x07, 0x20, 0x70, 0x47]);
    let stage = board.flash().bytes(0, 256);
    write(&mut board, SECOND_STAGE, stage);
    let mut calls = rewriting(&board);
    let result = (FLASH + SECTOR, [0; 4]);
    calls.extend([(SECOND_STAGE, [0; 4]), result]);
    let end = begin_calls(&mut board, &calls);
    board
        .run_until(Time::from_ms(60), |board| board.pc() == end)
        .unwrap();
    let kinds: Vec<_> = board
        .flash()
        .operations()
        .iter()
        .map(|op| op.kind)
        .collect();
    assert_eq!(
        kinds,
        [
            FlashOperationKind::EraseSector,
            FlashOperationKind::ProgramPage
        ]
    );
    // Without the second stage the flash cannot be read.
    let mut calls = rewriting(&board);
    calls.push(result);
    let end = begin_calls(&mut board, &calls);
    let stop = board
        .run_until(Time::from_ms(60), |board| board.pc() == end)
        .unwrap_err();
    assert!(stop.to_string().contains("not in XIP mode"), "{stop}");
}
