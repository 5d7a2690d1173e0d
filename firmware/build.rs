//! The memory map of the board, the linker's scripts, and where the sources come from.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// Raspberry Pi Pico: 2 MiB of flash, whose first 256 bytes are the second stage of the boot
/// loader; 264 KiB of memory. The stack lies below everything else, so that one that grows too
/// far leaves the memory and ends in a fault instead of in a variable.
///
/// All code but the start lies in memory, copied there from flash at the start: the flash's cache
/// holds 16 KiB in two ways, less than what a sample passes through, and every line that it lacks
/// costs half a microsecond. Constants lie there as well: while flash is erased nothing can be read
/// from it, and everything but the storage goes on.
///
/// In flash stay the start, which is over by then, and the storage itself, which waits for each erase:
/// whatever they call that does not bear their names lies in memory.
///
/// Whatever counts on the time between two instructions has to lie in memory as well: a function of its
/// own that is never part of one in flash. `CODE_SHIFT` moves all code by so many bytes, for the test of
/// that.
///
/// The last 64 KiB of flash keep settings and calibration: they are no part of an image.
const PICO: &str = "MEMORY {
    BOOT2 : ORIGIN = 0x10000000, LENGTH = 0x100
    FLASH : ORIGIN = 0x10000100, LENGTH = 2048K - 64K - 0x100
    STACK : ORIGIN = 0x20000000, LENGTH = 32K
    RAM : ORIGIN = 0x20008000, LENGTH = 232K
}
_stack_end = ORIGIN(STACK);
_stack_start = ORIGIN(STACK) + LENGTH(STACK);
SECTIONS {
    .boot2 ORIGIN(BOOT2) : { KEEP(*(.boot2)); } > BOOT2
} INSERT BEFORE .text;
SECTIONS {
    .cold : ALIGN(4) {
        . += DEFINED(CODE_SHIFT) ? CODE_SHIFT : 0;
        *(.text.*__rtic_init_resources*);
        *(.text.*sequential_storage*);
        *(.text.*palpate_storage*);
        *(.text.*palpate_node7storage* .text.*palpate_node..storage*);
        *(.text.*palpate_firmware5tasks7storage*);
    } > FLASH
} INSERT BEFORE .text;
SECTIONS {
    .hot : ALIGN(16) {
        __hot_begin = .;
        . += DEFINED(CODE_SHIFT) ? CODE_SHIFT : 0;
        *(.text .text.*);
        *(.HardFaultTrampoline .HardFault.*);
        *(.rodata .rodata.*);
        . = ALIGN(16);
        __hot_end = .;
    } > RAM AT > FLASH
    __hot_load = LOADADDR(.hot);
    _stext = ALIGN(LOADADDR(.hot) + SIZEOF(.hot), 8);
} INSERT BEFORE .text;
";

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR")?);
    fs::write(out.join("board-memory.x"), PICO)?;
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
        println!("cargo:rustc-link-arg-examples={argument}");
    }
    println!("cargo:rerun-if-changed=build.rs");
    // What defmt compiles in.
    println!("cargo:rerun-if-env-changed=DEFMT_LOG");
    let commit = git(&["rev-parse", "--short=8", "HEAD"]);
    let dirty =
        git(&["status", "--porcelain", "--untracked-files=no"]).is_none_or(|it| !it.is_empty());
    println!(
        "cargo:rustc-env=PALPATE_COMMIT={}",
        commit.unwrap_or_else(|| "0".into())
    );
    println!("cargo:rustc-env=PALPATE_DIRTY={}", u8::from(dirty));
    // A file that is named and not there would have this run, and the firmware built, every time:
    // git knows where its files are, also from a worktree or a copy below the checkout.
    for file in ["HEAD", "index"] {
        if let Some(path) = git(&["rev-parse", "--git-path", file]) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    Ok(())
}

/// What git says, or nothing where the sources are no checkout.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
