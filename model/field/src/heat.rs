//! Heat capacities, from which the heating of the windings follows.
//!
//! Volumetric heat capacities are handbook values at room temperature: copper 3.45, glass-fibre
//! board 2.0, nickel iron 4.0 MJ/(m³ K). Elastomer: 30 vol% iron of 3.5 and 70 vol% silicone of 1.6
//! MJ/(m³ K).

use core::f64::consts::{PI, TAU};

use crate::design::{Design, Rectangle};
use crate::solve::Solved;

const COPPER_J_PER_M3_K: f64 = 3.45e6;
const BOARD_J_PER_M3_K: f64 = 2.0e6;
const METAL_J_PER_M3_K: f64 = 4.0e6;
const ELASTOMER_J_PER_M3_K: f64 = 2.2e6;

/// Heat capacities, J/K.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatCapacity {
    /// Heat capacity of the driven windings alone, which warm up in the first second, J/K.
    pub copper_j_per_k: f64,
    /// Heat capacity of windings, boards, bodies and plates together, J/K.
    pub stack_j_per_k: f64,
}

impl HeatCapacity {
    /// Computes the heat capacities of a solved design.
    #[must_use]
    pub fn of(design: &Design, solved: &Solved) -> Self {
        let volume = |section: &Rectangle| PI * ring(section.r_m) * width(section.x_m);
        let rings = || design.driven_coils().flat_map(|coil| &coil.rings);
        let copper_m3: f64 = rings().map(volume).sum();
        let boards = design.boards.iter();
        let boards_m3: f64 = boards.map(|board| volume(&board.section)).sum();
        let embedded = |section: &&Rectangle| {
            let middle = [middle(section.r_m), middle(section.x_m)];
            let mut boards = design.boards.iter();
            boards.any(|board| {
                let [r, x] = [board.section.r_m, board.section.x_m];
                (r[0]..r[1]).contains(&middle[0]) && (x[0]..x[1]).contains(&middle[1])
            })
        };
        let embedded_m3: f64 = rings().filter(embedded).map(volume).sum();
        let copper = COPPER_J_PER_M3_K * copper_m3;
        let mut stack = copper + BOARD_J_PER_M3_K * (boards_m3 - embedded_m3);
        solved.visit(|at| {
            let part = at.region.part;
            if let Some(part) = part.and_then(|part| design.parts.get(part as usize)) {
                let capacity = if part.cast {
                    ELASTOMER_J_PER_M3_K
                } else {
                    METAL_J_PER_M3_K
                };
                stack += capacity * TAU * at.weight * at.point[0];
            }
        });
        Self {
            copper_j_per_k: copper,
            stack_j_per_k: stack,
        }
    }
}

fn ring([from, to]: [f64; 2]) -> f64 {
    to * to - from * from
}

fn width([from, to]: [f64; 2]) -> f64 {
    to - from
}

fn middle([from, to]: [f64; 2]) -> f64 {
    0.5 * (from + to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::builtin;
    use crate::solve::{Accuracy, Excitation, solve};

    /// 38.9 W warm the paper's copper by 25 K/s, and the whole pad by about half a kelvin per
    /// second.
    #[test]
    fn the_paper_s_stack() {
        let design = builtin("A").expect("built in");
        let solved = solve(
            &design,
            &Excitation::small(&design, 1.0),
            &Accuracy::default(),
        );
        let heat = HeatCapacity::of(&design, &solved.expect("a field"));
        let rate = |capacity: f64| 100.0 * design.resistance_ohm() / capacity;
        assert!(
            (rate(heat.copper_j_per_k) / 25.0 - 1.0).abs() < 0.03,
            "{heat:?}"
        );
        assert!((0.35..0.6).contains(&rate(heat.stack_j_per_k)), "{heat:?}");
    }
}
