//! The estimator against the Cramer-Rao bound, over thousands of ramps:
//! `cargo run --release -p palpate-model --example efficiency [first seed] [ramps]`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::efficiency::CASES;
use palpate_model::ramp::Noise;

fn main() {
    let argument = |n: usize| std::env::args().nth(n).map(|text| text.parse::<u64>());
    let (Ok(first), Ok(ramps)) = (
        argument(1).unwrap_or(Ok(1)),
        argument(2).unwrap_or(Ok(2000)),
    ) else {
        eprintln!("usage: efficiency [first seed] [ramps]");
        std::process::exit(2);
    };
    let seeds = first..=first + ramps.max(1) - 1;
    println!("400 samples, eps 3 %, noise 1e-4, three equal springs; seeds {seeds:?}");
    println!(
        "{:26} {:9} {:>8} {:>8} {:>10} {:>10} {:>8} {:>8}",
        "case", "noise", "bound", "publ.", "RMSE/bound", "mean/s.e.", "cover", "refused"
    );
    for case in CASES {
        for noise in [Noise::Stated, Noise::Residual, Noise::Larger] {
            let errors = case.run(seeds.clone(), noise);
            println!(
                "{:26} {:9} {:7.3}% {:7.2}% {:10.4} {:+10.4} {:7.2}% {:8}",
                case.name,
                format!("{noise:?}"),
                case.bound() * 100.0,
                case.published * 100.0,
                errors.rms(),
                errors.mean(),
                errors.coverage() * 100.0,
                errors.refused,
            );
        }
    }
}
