//! Arguments of `cargo campaign efficiency`.

use clap::Args;

/// Press springs on many sensors, each calibrated on its own bench, and compare the errors with the
/// Cramer-Rao bound of the readings of bench and press
#[derive(Args)]
#[command(after_help = "\
Prints Markdown: errors beside their bounds, and efficiencies, variance of a bound over the variance that was \
measured, of all that is read and of what the chain uses of it.

Exit code 1 when a bound is above what was measured by more than three standard errors, so that it is none, or \
when an efficiency of all that is read is below --least.

Example: 40 sensors

  cargo campaign efficiency --plants 40 --seed 810001")]
pub(crate) struct Arguments {
    /// Number of sensors
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(super) plants: u64,
    /// Seed of the first sensor; the next sensors have the next seeds
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "ultrasoft")]
    pub(super) stack: String,
    /// Press at the temperature of the bench
    #[arg(long)]
    pub(super) bench_temperature: bool,
    /// Least efficiency of the whole chain required at every load
    #[arg(long, default_value_t = 0.0)]
    pub(super) least: f64,
    /// Print one JSON object per load
    #[arg(long)]
    pub(super) json: bool,
}
