//! What campaigns over drawn sensors have in common.

use clap::Args;
use palpate_cli::quantity;

/// Where random numbers begin.
#[derive(Args)]
pub(crate) struct Seed {
    /// Seed of what is random
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
}

/// Which sensors a campaign draws.
#[derive(Args)]
pub(crate) struct DrawnSensors {
    /// How many sensors are drawn
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) plants: u64,
    /// The first sensor; the following have the following seeds
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "ultrasoft")]
    pub(crate) stack: String,
    /// The loads, in units of c_S
    #[arg(long, value_delimiter = ',', default_value = "0.2,0.5,1,2,5", value_parser = quantity::load)]
    pub(crate) loads: Vec<f64>,
    /// One JSON object for each row
    #[arg(long)]
    pub(crate) json: bool,
}
