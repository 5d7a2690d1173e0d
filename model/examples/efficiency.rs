//! Compares the estimator with the Cramer-Rao bound, over thousands of ramps: `cargo run --release
//! -p palpate-model --example efficiency -- [--seed N] [--ramps N] [--noise
//! stated|residual|larger]`, by default from seed 1, 2000 ramps and `residual`. It fails if a limit
//! is missed.

#[path = "../tests/integration/common/mod.rs"]
mod common;

use std::process::ExitCode;

use common::efficiency::{CASES, EfficiencyCase};
use common::statistics::EstimateErrors;
use palpate_model::ramp::Noise;

struct EfficiencyArguments {
    seed: u64,
    ramps: u64,
    noise: Noise,
}

fn arguments() -> Option<EfficiencyArguments> {
    let mut arguments = EfficiencyArguments {
        seed: 1,
        ramps: 2000,
        noise: Noise::Residual,
    };
    let mut words = std::env::args().skip(1);
    while let Some(name) = words.next() {
        let value = words.next()?;
        match (name.as_str(), value.as_str()) {
            ("--seed", text) => arguments.seed = text.parse().ok()?,
            ("--ramps", text) => arguments.ramps = text.parse().ok().filter(|&n| n > 0)?,
            ("--noise", "stated") => arguments.noise = Noise::Stated,
            ("--noise", "residual") => arguments.noise = Noise::Residual,
            ("--noise", "larger") => arguments.noise = Noise::Larger,
            _ => return None,
        }
    }
    Some(arguments)
}

/// Limits: RMSE within 5 % of the Cramer-Rao bound, bias within a tenth of a standard error,
/// coverage within 1.5 %.
fn meets_the_bars(case: &EfficiencyCase, errors: &EstimateErrors) -> bool {
    // A fit with a creep term on a single ramp is for comparison only: no limit applies to it.
    case.published > 0.03
        || (errors.rms() <= 1.05
            && errors.mean().abs() <= 0.1
            && (0.935..=0.965).contains(&errors.coverage())
            && errors.refused == 0)
}

fn main() -> ExitCode {
    let Some(EfficiencyArguments { seed, ramps, noise }) = arguments() else {
        eprintln!("usage: efficiency [--seed N] [--ramps N] [--noise stated|residual|larger]");
        return ExitCode::from(2);
    };
    println!("<!-- evidence:begin -->");
    println!(
        "400 samples, eps 3 %, noise 1e-4, three equal springs; {ramps} ramps from seed {seed}.\n"
    );
    println!("| case | bound | published | RMSE / bound | mean / s.e. | coverage | refused |");
    println!("|---|---|---|---|---|---|---|");
    let mut met = true;
    for case in &CASES {
        let errors = case.run(seed..=seed + (ramps - 1), noise);
        met &= meets_the_bars(case, &errors);
        println!(
            "| {} | {:.3} % | {:.2} % | {:.4} | {:+.4} | {:.2} % | {} |",
            case.name,
            case.bound() * 100.0,
            case.published * 100.0,
            errors.rms(),
            errors.mean(),
            errors.coverage() * 100.0,
            errors.refused,
        );
    }
    println!("<!-- evidence:end -->");
    if met {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
