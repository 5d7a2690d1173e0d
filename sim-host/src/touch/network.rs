//! Currents that a converted coil induces in the other coils.
//!
//! A converter ties both ends of a channel that it does not convert to ground (LDC1614, SNOSCY9A,
//! "Inactive channel sensor connections"), so an idle coil is closed, with its capacitor beside it. Two
//! converters convert at the same time: the other one's coil is a tank that oscillates by itself. All of
//! them are linear circuits at the frequency of the converted coil.

use core::f64::consts::TAU;

/// Resistance of each of the two switches that ground an idle channel, ohm (SNOSCY9A).
const SWITCH_OHM: f64 = 10.0;
/// Resistance of a coil at its frequency, ohm: 0.3 m of copper, 0.25 mm by 35 um, is 0.6 ohm, and the
/// skin adds to that (guess).
const COIL_OHM: f64 = 1.0;
/// Steps of the iteration to a tank's frequency; the currents depend little on it.
const STEPS: u32 = 20;
/// Factor between two frequencies whose difference gives a slope.
const BESIDE: f64 = 1.0001;

/// A coil with its tank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tank {
    pub(super) inductance_h: f64,
    pub(super) capacitance_f: f64,
}

/// Coils with their tanks and all mutual inductances.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub(super) tanks: Vec<Tank>,
    /// Mutual inductances, H.
    pub(super) mutual_h: Vec<Vec<f64>>,
}

/// Real and imaginary part.
pub(super) type Complex = [f64; 2];

/// A coil while it is converted.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Converted {
    /// Inductance that its tank oscillates with, H.
    pub(super) inductance_h: f64,
    /// Current in each coil per current in this one, which has 1.
    pub(super) currents: Vec<Complex>,
    /// Change of the inductance per change at one frequency: the frequency changes too.
    pub(super) by_frequency: f64,
}

/// Channels of a converter.
const CHANNELS: usize = 4;

/// The coil that the other converter converts at the same time.
pub(super) fn beside(index: usize) -> usize {
    if index < CHANNELS {
        index + CHANNELS
    } else {
        index - CHANNELS
    }
}

impl Network {
    /// Coupling factor of two coils.
    pub(super) fn coupling(&self, one: usize, other: usize) -> f64 {
        let root = |index: usize| {
            self.tanks
                .get(index)
                .map_or(0.0, |tank| tank.inductance_h.sqrt())
        };
        self.mutual(one, other) / (root(one) * root(other))
    }

    /// The coil whose oscillation this one's locks to: both are converted at the same time, and their
    /// frequencies are closer than half their coupling (Adler 1946).
    pub(super) fn locked_to(&self, index: usize) -> Option<usize> {
        let other = beside(index);
        let rate = |index: usize| {
            let tank = self.tanks.get(index)?;
            Some(1.0 / libm::sqrt(tank.inductance_h * tank.capacitance_f))
        };
        let (own, others) = (rate(index)?, rate(other)?);
        let apart = 2.0 * (own - others).abs() / (own + others);
        (self.coupling(index, other).abs() > 2.0 * apart).then_some(other)
    }

    /// A coil while it is converted.
    pub(super) fn converted(&self, index: usize) -> Option<Converted> {
        let tank = self.tanks.get(index)?;
        let rate = |inductance_h: f64| 1.0 / libm::sqrt(inductance_h * tank.capacitance_f);
        let mut inductance_h = tank.inductance_h;
        for _ in 0..STEPS {
            (inductance_h, _) = self.at(index, tank, rate(inductance_h));
        }
        let omega = rate(inductance_h);
        let (_, currents) = self.at(index, tank, omega);
        let (higher_h, _) = self.at(index, tank, BESIDE * omega);
        // d(ln omega) is -dL/2L.
        let slope_h = (higher_h - inductance_h) / (BESIDE - 1.0);
        Some(Converted {
            inductance_h,
            currents,
            by_frequency: 1.0 / (1.0 + 0.5 * slope_h / inductance_h),
        })
    }

    fn mutual(&self, one: usize, other: usize) -> f64 {
        let row = self.mutual_h.get(one);
        row.and_then(|row| row.get(other)).copied().unwrap_or(0.0)
    }

    /// Inductance of a coil with this tank at an angular frequency, H, and the currents of all coils.
    fn at(&self, index: usize, own: &Tank, omega: f64) -> (f64, Vec<Complex>) {
        let others = || {
            let tanks = self.tanks.iter().enumerate();
            tanks.filter(move |(other, _)| *other != index)
        };
        // Z u = -j omega M, with u = p + j q: R p - X q = 0 and X p + R q = -omega M.
        let equations = |(one, tank): (usize, &Tank)| {
            let impedance = |(other, _)| {
                if other == one {
                    loop_ohm(tank, one == beside(index), omega)
                } else {
                    [0.0, omega * self.mutual(one, other)]
                }
            };
            let (r, x): (Vec<f64>, Vec<f64>) = others().map(impedance).map(Into::into).unzip();
            let opposite = x.iter().map(|x| -x);
            let real: Vec<f64> = r.iter().copied().chain(opposite).chain([0.0]).collect();
            let source = -omega * self.mutual(index, one);
            let imaginary = x.iter().chain(&r).copied().chain([source]).collect();
            [real, imaginary]
        };
        let solution = solved(others().flat_map(equations).collect());
        let (real, imaginary) = solution.split_at(solution.len() / 2);
        let mut induced = real.iter().zip(imaginary).map(|(p, q)| [*p, *q]);
        let mut inductance_h = own.inductance_h;
        let current = |coil: usize| {
            if coil == index {
                return [1.0, 0.0];
            }
            let current = induced.next().unwrap_or_default();
            inductance_h += self.mutual(index, coil) * current[0];
            current
        };
        let currents = (0..self.tanks.len()).map(current).collect();
        (inductance_h, currents)
    }
}

/// Impedance around the loop of a coil, idle or a tank that oscillates by itself, ohm.
fn loop_ohm(tank: &Tank, oscillates: bool, omega: f64) -> Complex {
    let susceptance = omega * tank.capacitance_f;
    let [r, x] = if oscillates {
        [0.0, -1.0 / susceptance]
    } else {
        let conductance = 0.5 / SWITCH_OHM;
        let square = conductance * conductance + susceptance * susceptance;
        [conductance / square, -susceptance / square]
    };
    [COIL_OHM + r, omega * tank.inductance_h + x]
}

/// Frequency of a tank, Hz.
pub(super) fn frequency_hz(inductance_h: f64, capacitance_f: f64) -> f64 {
    1.0 / (TAU * libm::sqrt(inductance_h * capacitance_f))
}

/// Solves linear equations, each a row with its right side at the end, by elimination: of the rows the
/// one with the greatest first entry is solved for the first unknown.
fn solved(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let first = |row: &Vec<f64>| row.first().copied().unwrap_or(0.0);
    let greatest = (rows.iter().enumerate())
        .max_by(|(_, a), (_, b)| first(a).abs().total_cmp(&first(b).abs()))
        .map(|(index, _)| index);
    let Some(greatest) = greatest else {
        return Vec::new();
    };
    let pivot = rows.swap_remove(greatest);
    let without_first = |row: &Vec<f64>| {
        let factor = first(row) / first(&pivot);
        let entries = row.iter().zip(&pivot).skip(1);
        entries.map(|(entry, of)| entry - factor * of).collect()
    };
    let mut solution = solved(rows.iter().map(without_first).collect());
    let known: f64 = (pivot.iter().skip(1).zip(&solution))
        .map(|(factor, x)| factor * x)
        .sum();
    let right = pivot.last().copied().unwrap_or(0.0);
    solution.insert(0, (right - known) / first(&pivot));
    solution
}

#[cfg(test)]
mod tests {
    use super::*;

    const TANK: Tank = Tank {
        inductance_h: 1e-6,
        capacitance_f: 330e-12,
    };

    /// Coils that all couple by `factor`, with the second converter's capacitors larger by `ratio`.
    fn coils(count: usize, factor: f64, ratio: f64) -> Network {
        let tank = |index: usize| Tank {
            capacitance_f: TANK.capacitance_f * if index < 4 { 1.0 } else { ratio },
            ..TANK
        };
        Network {
            tanks: (0..count).map(tank).collect(),
            mutual_h: vec![vec![factor * TANK.inductance_h; count]; count],
        }
    }

    /// Of two equal tanks, the real part of the current is -M/L whatever resistance closes the loop.
    #[test]
    fn a_current_in_an_idle_coil_opposes_the_field() {
        let found = coils(2, 0.05, 1.0).converted(0).unwrap();
        let [[own, _], [real, imaginary]] = [found.currents[0], found.currents[1]];
        assert_eq!(own, 1.0);
        assert!((real + 0.05).abs() < 2e-3, "{real}");
        // wL over the switches' 20 ohm.
        let ratio = (TANK.inductance_h / TANK.capacitance_f).sqrt() / 20.0;
        assert!((imaginary * ratio + 0.05).abs() < 4e-3, "{imaginary}");
        let reflected_h = 0.05 * 0.05 * TANK.inductance_h;
        let change_h = found.inductance_h - TANK.inductance_h;
        assert!((change_h / reflected_h + 1.0).abs() < 0.05, "{change_h}");
    }

    /// A tank at another frequency: L - M^2/(L' - 1/(w^2 C')), which is a normal mode of both.
    #[test]
    fn the_other_converters_coil_is_a_tank() {
        let mut network = coils(5, 0.0, 2.0);
        network.mutual_h[0][4] = 0.1e-6;
        network.mutual_h[4][0] = 0.1e-6;
        let found = network.converted(0).unwrap();
        let omega_squared = 1.0 / (found.inductance_h * TANK.capacitance_f);
        let rest_h = 1e-6 - 1.0 / (omega_squared * 2.0 * TANK.capacitance_f);
        let expected_h = 1e-6 - 0.01e-12 / rest_h;
        assert!((found.inductance_h / expected_h - 1.0).abs() < 1e-4);
        // Modes: (1 - x)(1 - 2 x) = k^2 with x = L C w^2 of coils alone, in units of 2 x^2.
        let x = 1e-6 * TANK.capacitance_f * omega_squared;
        let mode = (1.0 - x) * (1.0 - 2.0 * x) - 2.0 * 0.01 * x * x;
        assert!(mode.abs() < 1e-4, "{mode}");
    }

    #[test]
    fn coils_of_one_frequency_lock() {
        assert_eq!(coils(5, 0.01, 1.0).locked_to(0), Some(4));
        assert_eq!(coils(5, 0.01, 1.0).locked_to(1), None);
        assert_eq!(coils(5, 0.01, 1.02).locked_to(0), None);
        assert_eq!(coils(5, 0.03, 1.02).locked_to(4), Some(0));
    }
}
