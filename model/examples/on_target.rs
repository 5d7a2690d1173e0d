//! Runs the evaluation of `tests/integration/bits.rs` as an image for a Cortex-M0+: it stores the
//! bits of the results in `BITS`, where an emulator or a debugger can read them, and counts its
//! runs in `RUNS`. Linked with `-C link-arg=-Tlink.x` and this folder as `-L`, the image also shows
//! that no panic can be reached; with `--cfg planted_panic` it contains one, to show that the check
//! would find it.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[path = "../tests/integration/common/pipeline.rs"]
#[allow(unreachable_pub)]
mod pipeline;

#[cfg(not(target_os = "none"))]
fn main() {
    match pipeline::run(std::hint::black_box(1.0)) {
        Some(bits) => println!("{bits:#010X?}"),
        None => println!("refused, which it must not be"),
    }
}

#[cfg(target_os = "none")]
mod image {
    use core::hint::black_box;
    use core::sync::atomic::{AtomicU32, Ordering};

    use cortex_m_rt::entry;
    use panic_halt as _;

    use crate::pipeline;

    static BITS: [AtomicU32; 34] = [const { AtomicU32::new(0) }; 34];
    static RUNS: AtomicU32 = AtomicU32::new(0);

    #[entry]
    fn main() -> ! {
        loop {
            if let Some(bits) = pipeline::run(black_box(1.0)) {
                for (index, bits) in BITS.iter().zip(bits) {
                    index.store(bits, Ordering::Relaxed);
                }
            }
            let runs = RUNS.load(Ordering::Relaxed).wrapping_add(1);
            RUNS.store(runs, Ordering::Relaxed);
            #[cfg(planted_panic)]
            assert!(runs != 7, "planted");
        }
    }
}
