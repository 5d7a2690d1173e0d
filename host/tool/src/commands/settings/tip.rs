//! `palpate settings tip`: declares the tip on the sensor and the object under it.

use std::io::{self, Write};

use clap::Args;
use palpate_cli::describe::stiffness;
use palpate_cli::failure::Failure;
use palpate_cli::quantity::{length, part, spring};
use palpate_wire::code::{Part, TipShape};
use palpate_wire::command::{GetCalibration, Tip};
use palpate_wire::record::Storage;
use palpate_wire::{Command, Record};
use serde::Serialize;

use crate::board::configuration;
use crate::board::link::{self, Link};
use crate::board::storage;

/// Declare the tip on the sensor and the object under it, from which a modulus follows
#[derive(Args)]
#[command(after_help = "\
Without --pin, --ball or --none it prints what is declared. Every declaration replaces the one before as \
a whole. Uncertainties are standard uncertainties.

Examples:
  palpate settings tip --pin 3mm --store
  palpate settings tip --ball 8mm --thickness 12mm --poisson 0.45 --store
  palpate settings tip --board emulated")]
pub(super) struct TipArguments {
    #[command(flatten)]
    link: link::Arguments,
    /// A cylinder with a flat face of this radius
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with_all = ["ball", "none"])]
    pin: Option<f64>,
    /// A ball of this radius
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with = "none")]
    ball: Option<f64>,
    /// No tip: no modulus is computed
    #[arg(long)]
    none: bool,
    /// Uncertainty of the radius
    #[arg(long, value_name = "PART", default_value = "1%", value_parser = part)]
    radius_uncertainty: f64,
    /// Thickness of an object that is bonded to a rigid base; without it the object is thick
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    thickness: Option<f64>,
    /// Uncertainty of the thickness
    #[arg(long, value_name = "PART", default_value = "2%", value_parser = part)]
    thickness_uncertainty: f64,
    /// Poisson's ratio of the object: 0.5 for rubber and gel
    #[arg(long, value_name = "RATIO", default_value = "0.5", value_parser = palpate_cli::quantity::within(0.0, 0.5, ""))]
    poisson: f64,
    /// Uncertainty of Poisson's ratio
    #[arg(long, value_name = "DIFFERENCE", default_value = "0.01", value_parser = palpate_cli::quantity::within(0.0, 0.5, ""))]
    poisson_uncertainty: f64,
    /// Stiffness of what the object stands on; without it the stand is rigid
    #[arg(long, value_name = "STIFFNESS", value_parser = spring)]
    support: Option<f64>,
    /// Uncertainty of that stiffness
    #[arg(long, value_name = "PART", default_value = "5%", value_parser = part)]
    support_uncertainty: f64,
    /// Store the active configuration afterwards
    #[arg(long)]
    store: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// JSON output.
#[derive(Serialize)]
struct TipLine {
    simulated: bool,
    /// Absent if it was never declared.
    tip: Option<Tip>,
    storage: Storage,
}

pub(super) fn run(arguments: &TipArguments) -> Result<(), Failure> {
    let mut link = arguments.link.open()?;
    if let Some(tip) = arguments.tip() {
        link.send_accepted(&Command::Disarm)?;
        link.send_accepted(&Command::SetTip(tip))?;
    }
    let tip = in_force(&mut link)?;
    let storage = storage::store_if(arguments.store, &mut link)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        let line = TipLine {
            simulated: arguments.link.is_simulated(&link),
            tip,
            storage,
        };
        return Ok(writeln!(out, "{}", serde_json::to_string(&line)?)?);
    }
    writeln!(out, "{}", describe(tip.as_ref()))?;
    Ok(writeln!(out, "{}", storage::describe(&storage))?)
}

/// Reads the tip in force.
fn in_force(link: &mut Link) -> Result<Option<Tip>, Failure> {
    let question = GetCalibration {
        part: Part::Tip,
        sensor: 0,
        channel: 0,
    };
    let records = configuration::read_part(link, &question)?;
    Ok(records.into_iter().find_map(|record| match record {
        Record::Tip(tip) => Some(tip),
        _ => None,
    }))
}

impl TipArguments {
    /// The declaration; `None` to print the one in force.
    fn tip(&self) -> Option<Tip> {
        // The protocol has a radius without a tip as well.
        const ANY_M: f64 = 1e-3;
        let none = self.none.then_some((TipShape::None, ANY_M));
        let pin = self.pin.map(|radius_m| (TipShape::FlatPin, radius_m));
        let ball = self.ball.map(|radius_m| (TipShape::Ball, radius_m));
        let (shape, radius_m) = none.or(pin).or(ball)?;
        Some(Tip {
            shape,
            radius_m: radius_m as f32,
            radius_uncertainty: self.radius_uncertainty as f32,
            thickness_m: self.thickness.unwrap_or_default() as f32,
            thickness_uncertainty: self.thickness_uncertainty as f32,
            poisson_ratio: self.poisson as f32,
            poisson_uncertainty: self.poisson_uncertainty as f32,
            support_m_per_n: self.support.map_or(0.0, |n_per_m| 1.0 / n_per_m) as f32,
            support_uncertainty: self.support_uncertainty as f32,
        })
    }
}

fn describe(tip: Option<&Tip>) -> String {
    let Some(tip) = tip.filter(|tip| tip.shape != TipShape::None) else {
        return "No tip is declared: no modulus is computed. `palpate settings tip --pin 3mm` declares one."
            .to_owned();
    };
    let shape = match tip.shape {
        TipShape::Ball => "ball",
        _ => "flat pin",
    };
    let millimetres = |of_m: f32| format!("{} mm", 1e3 * of_m);
    let percent = |of: f32| format!("± {} %", 100.0 * of);
    let object = if tip.thickness_m > 0.0 {
        let thickness = millimetres(tip.thickness_m);
        format!("{thickness} {} thick", percent(tip.thickness_uncertainty))
    } else {
        "thick".to_owned()
    };
    let stand = if tip.support_m_per_n > 0.0 {
        let support = stiffness(1.0 / f64::from(tip.support_m_per_n));
        format!("on {support} {}", percent(tip.support_uncertainty))
    } else {
        "on a rigid stand".to_owned()
    };
    format!(
        "Tip: {shape} of radius {} {}. Object: {object}, Poisson's ratio {} ± {}, {stand}.",
        millimetres(tip.radius_m),
        percent(tip.radius_uncertainty),
        tip.poisson_ratio,
        tip.poisson_uncertainty,
    )
}
