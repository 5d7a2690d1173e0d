//! Corrupts frames in every way and counts those that the decoder accepts.
//!
//! ```text
//! cargo run --release -p palpate-wire --example corruption -- [COUNT] [SEED]
//! ```
//!
//! Fails if the decoder accepts a corrupted frame, or does not resynchronise within one frame after the
//! damage.

use std::process::ExitCode;
use std::time::Instant;

#[path = "../tests/integration/support/mod.rs"]
mod support;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let mut number = |name: &str, default: u64| match arguments.next() {
        None => Ok(default),
        Some(text) => text
            .parse()
            .map_err(|error| format!("{name} `{text}`: {error}")),
    };
    let (count, seed) = match (number("COUNT", 1_000_000), number("SEED", 1)) {
        (Ok(count), Ok(seed)) => (count, seed),
        (Err(message), _) | (_, Err(message)) => {
            eprintln!("{message}; expected: corruption [COUNT] [SEED]");
            return ExitCode::FAILURE;
        }
    };
    let start = Instant::now();
    let outcome = support::corruption::run(count, seed);
    println!("{outcome}");
    println!("seed {seed}, {:.1} s", start.elapsed().as_secs_f64());
    if outcome.undetected == 0 && outcome.out_of_step == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
