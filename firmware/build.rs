//! Sets the board's memory map, the linker scripts and the source version.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// Memory map of the Raspberry Pi Pico: 2 MiB of flash, whose first 256 bytes are the second-stage boot
/// loader, and 264 KiB of RAM. The stack lies below everything else, so an overflow leaves RAM and
/// faults instead of overwriting a variable.
///
/// All code except the start-up code runs from RAM, where the start-up code copies it. The flash cache
/// has 16 KiB in two ways, less than the code that a sample passes through, and every missing line costs
/// half a microsecond. Constants are in RAM as well: while flash is erased it cannot be read, and
/// everything except the storage continues to run.
///
/// The start-up code, which has ended before any flash is erased, and the storage, which waits for each
/// erase, stay in flash; so does what the procedure runs only while the storage is idle
/// (`Procedure::can_read_flash`) or while the coil is armed, which excludes the storage: the estimate of a
/// touch, the setting of parts of the configuration, and what a train needs a few times. The functions
/// that these call are in RAM unless the linker script below selects them by name.
///
/// Code that relies on the time between two instructions must also be in RAM, in a function of its
/// own that is never inlined into one in flash. `CODE_SHIFT` shifts all code by that many bytes;
/// the test of this rule uses it.
///
/// The last 64 KiB of flash hold settings and calibration and are not part of an image.
const PICO: &str = "MEMORY {
    BOOT2 : ORIGIN = 0x10000000, LENGTH = 0x100
    FLASH : ORIGIN = 0x10000100, LENGTH = 2048K - 64K - 0x100
    STACK : ORIGIN = 0x20000000, LENGTH = 24K
    RAM : ORIGIN = 0x20006000, LENGTH = 240K
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
        *(.text.*palpate_procedure..storage..StorageOrder*5clone*);
        *(.text.*palpate_procedure7machine7storage*16storage_reported*);
        *(.text.*palpate_model5touch* .text.*palpate_model..touch*);
        *(.text.*palpate_procedure5touch* .text.*palpate_procedure..touch*);
        *(.text.*palpate_procedure13configuration13Configuration3set*);
        *(.text.*palpate_procedure13configuration13Configuration5reset*);
        *(.text.*palpate_procedure13configuration6law_of*);
        *(.text.*palpate_model17calibration_curve22MonotoneCurve*3new*);
        *(.text.*palpate_model17calibration_curve*_slope*);
        *(.text.*palpate_node10instrument10Instrument4make*);
        *(.text.*usb_device3bus*UsbBusAllocator*5alloc* .text.*UsbBus*8alloc_ep*);
        *(.text.*palpate_procedure7machine6budget*14may_take_train*);
        *(.text.*palpate_procedure7machine6budget*7account17*);
        *(.text.*palpate_procedure7machine6budget*7load_at*);
        *(.text.*palpate_procedure7machine4coil*5begin17* .text.*palpate_procedure7machine4coil*11coil_tested*);
        *(.text.*palpate_procedure7machine6phases*17begin_measurement*);
        *(.text.*palpate_procedure7machine8commands*6change*);
        *(.text.*palpate_procedure7machine9Procedure11follow_heat* .text.*palpate_procedure7machine9Procedure14begin_baseline*);
        *(.text.*palpate_procedure13configuration13Configuration7deepest* .text.*palpate_procedure13configuration13Configuration8limit_to*);
        *(.text.*palpate_procedure11measurement11Measurement10begin_sums*);
        *(.text.*palpate_node4coil*CoilManager*6follow17* .text.*palpate_node4coil*CoilManager*4test17* .text.*palpate_node4coil*CoilManager*7correct17*);
        *(.text.*palpate_procedure4heat4Heat8forecast* .text.*palpate_procedure4heat4Heat6wait_s*);
        *(.text.*palpate_procedure11measurement10TrainDrive5start*);
        *(.text.*palpate_procedure7machine6phases*10progressed*);
        *(.text.*palpate_procedure11measurement8interval*);
        *(.text.*palpate_procedure11measurement5ramps5Ramps12close_single*);
        *(.text.*palpate_model4ramp4Ramp5solve* .text.*palpate_model4ramp4Ramp9fit_first*);
        *(.text.*palpate_model4ramp3fit* .text.*palpate_model4ramp5basis*);
        *(.text.*palpate_model4ramp8interval* .text.*palpate_model4ramp6misfit*);
        *(.text.*palpate_model4ramp7moments5Sweep* .text.*palpate_model..math..wide..Wide*3div*);
        *(.text.*palpate_model11uncertainty* .text.*palpate_model4math7student*);
        *(.text.*coil_hbridge6energy12EnergyDemand* .text.*coil_hbridge6energy7Account6wait_s*);
        *(.text.*coil_hbridge10supervisor10Supervisor4test*);
        *(.text.*coil_hbridge12current_line11CurrentLine5check*);
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
    // The variable DEFMT_LOG selects the log levels that defmt compiles in.
    println!("cargo:rerun-if-env-changed=DEFMT_LOG");
    let commit = git(&["rev-parse", "--short=8", "HEAD"]);
    let dirty =
        git(&["status", "--porcelain", "--untracked-files=no"]).is_none_or(|it| !it.is_empty());
    println!(
        "cargo:rustc-env=PALPATE_COMMIT={}",
        commit.unwrap_or_else(|| "0".into())
    );
    println!("cargo:rustc-env=PALPATE_DIRTY={}", u8::from(dirty));
    // Cargo runs this script, and rebuilds the firmware, every time if a file named here does not exist.
    // So git is asked where its files are: it knows them also in a worktree or in a copy inside the
    // checkout.
    for file in ["HEAD", "index"] {
        if let Some(path) = git(&["rev-parse", "--git-path", file]) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    Ok(())
}

/// Output of a git command, or `None` if the sources are not a checkout.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
