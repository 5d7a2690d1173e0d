//! Forces on parts that the user selects.

use palpate_cli::failure::Failure;
use palpate_field::design::{Design, Named};
use palpate_field::solve::Solved;
use serde::Serialize;

use super::drive::Drive;

/// Axial force on a part. In a field per ampere it is the force per square of the current.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
pub(super) struct PartForce {
    part: String,
    /// `None` where the part touches magnetic material.
    force_N: Option<f64>,
    /// Lorentz force; `Some` for coils only.
    #[serde(skip_serializing_if = "Option::is_none")]
    by_lorentz_N: Option<f64>,
}

/// Looks up the selected parts.
pub(super) fn named(design: &Design, names: &[String]) -> Result<Vec<(String, Named)>, Failure> {
    let find = |name: &String| match design.named(name) {
        Some(named) => Ok((name.clone(), named)),
        None => {
            let known: Vec<&str> = design.names().collect();
            Err(Failure::Argument(format!(
                "--force {name:?}: {} has no such part; there: {}",
                design.name,
                known.join(", ")
            )))
        }
    };
    names.iter().map(find).collect()
}

impl PartForce {
    /// Computes the forces on these parts.
    pub(super) fn all(parts: &[(String, Named)], solved: &Solved) -> Vec<Self> {
        let of = |(name, part): &(String, Named)| Self {
            part: name.clone(),
            force_N: solved.force_on_n(*part),
            by_lorentz_N: match part {
                Named::Coil(coil) => Some(solved.lorentz_force_n(*coil)),
                Named::Part(_) => None,
            },
        };
        parts.iter().map(of).collect()
    }
}

/// Prints one line for each force.
pub(super) fn explain(forces: &[PartForce], drive: Drive) -> String {
    let unit = match drive {
        Drive::PerAmpere => "mN/A^2",
        Drive::Current(_) | Drive::Background => "mN",
    };
    let line = |force: &PartForce| {
        let lorentz = force.by_lorentz_N.map(|force_n| 1e3 * force_n);
        let lorentz = lorentz.map_or(String::new(), |force| {
            format!("; by Lorentz {force:.4} {unit}")
        });
        let by_work = match force.force_N {
            Some(force_n) => format!("{:>12.4} {unit} along the axis", 1e3 * force_n),
            None => "touches magnetic material: no separate force".to_owned(),
        };
        format!("  force on {:<18} {by_work}{lorentz}\n", force.part)
    };
    forces.iter().map(line).collect()
}
