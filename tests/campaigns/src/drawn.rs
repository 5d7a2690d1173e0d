//! Common arguments of the campaigns over drawn sensors.

use clap::Args;
use palpate_cli::quantity;

/// Start of the random numbers.
#[derive(Args)]
pub(crate) struct Seed {
    /// Seed of the random numbers
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
}

/// Sensors that a campaign draws.
#[derive(Args)]
pub(crate) struct DrawnSensors {
    /// Number of sensors
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) plants: u64,
    /// Seed of the first sensor; the next sensors have the next seeds
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "ultrasoft")]
    pub(crate) stack: String,
    /// Loads, in units of c_S
    #[arg(long, value_delimiter = ',', default_value = "0.2,0.5,1,2,5", value_parser = quantity::load)]
    pub(crate) loads: Vec<f64>,
    /// Print one JSON object per row
    #[arg(long)]
    pub(crate) json: bool,
}
