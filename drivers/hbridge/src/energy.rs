//! Net energy that the circuit has taken: counted by a drive, and forecast for a current profile.
//! Both use the same formula.

use crate::hardware::Hardware;
use crate::limits::Limits;
use crate::watch::ATTENDED_WITHIN;

/// Safety factor of the energy count: covers the sum of the errors by which current and supply may
/// be measured too low, which is 2 % of gain and nonlinearity, 5 % of the divider, and the offset.
const COUNTED: f32 = 1.1;
/// Number of Newton steps for the current whose heat equals the continuous power. Far above the
/// root each step halves the value: 24 steps suffice from 10^4 times the root.
const STEPS: u8 = 24;

/// Net energy of the circuit: the energy taken, multiplied by a safety factor of 1.1, less the
/// continuous power that the circuit gives off; never below zero.
///
/// ```
/// use coil_hbridge::{Account, EnergyDemand, Load};
/// let mut account = Account::with(60.0, 3.5);
/// account.pass(50.0, 0.5); // Counts 1.1 * 50 J = 55 J: an empty account cannot give off energy.
/// // Half an ohm, from 0 to 10 A and back within 1.2 s: 22 J taken, 4 J of them given off again.
/// let mut demand = EnergyDemand::new(&account, Load { resistance_ohm: 0.5, lost_v: 0.0 });
/// demand.line(10.0, 0.6);
/// demand.line(0.0, 0.6);
/// assert!(!account.allows(&demand));
/// let wait_s = account.wait_s(&demand).expect("it fits an account that is empty");
/// assert!((3.0..6.0).contains(&wait_s));
/// account.pass(0.0, wait_s + 0.001);
/// assert!(account.allows(&demand));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Account {
    energy_j: f32,
    usable_j: f32,
    continuous_w: f32,
}

/// The circuit as found by its self-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Resistance of coil, bridge, wires and supply together, ohm.
    pub resistance_ohm: f32,
    /// Voltage lost to the bridge's dead time, V.
    pub lost_v: f32,
}

/// Energy that a current profile needs from an [`Account`]: straight lines in succession, starting
/// from rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyDemand {
    load: Load,
    continuous_w: f32,
    /// Current at which the counted heat equals the continuous power.
    even_a: f32,
    at_a: f32,
    /// Change of the account since the start of the profile, and (`most_j`, `least_j`) its highest
    /// and its lowest value.
    gain_j: f32,
    most_j: f32,
    least_j: f32,
    /// Greatest rise of the account from a minimum to a later maximum: the highest value of an
    /// account that starts empty.
    rise_j: f32,
}

impl Account {
    /// Creates the empty account of a drive. The usable energy is the limit less the energy that
    /// may flow before a supervisor acts.
    #[must_use]
    pub fn new(hardware: &Hardware, limits: &Limits) -> Self {
        let unseen_s = ATTENDED_WITHIN as f32 * hardware.period_s;
        let [_, supply_v] = limits.supply_v;
        let unseen_j = unseen_s * supply_v * limits.trip_a;
        Self::with(limits.energy_j - unseen_j, limits.continuous_w)
    }

    /// Creates an empty account from its limit, J, and the continuous power, W.
    #[must_use]
    pub const fn with(usable_j: f32, continuous_w: f32) -> Self {
        Self {
            energy_j: 0.0,
            usable_j,
            continuous_w,
        }
    }

    /// Net energy taken, J.
    #[must_use]
    pub const fn energy_j(&self) -> f32 {
        self.energy_j
    }

    /// Limit at which a drive switches off, J.
    #[must_use]
    pub const fn usable_j(&self) -> f32 {
        self.usable_j
    }

    /// Adds the energy measured over a time. Energy that returns from the coil's field to the
    /// supply stays counted, which errs on the safe side.
    pub fn pass(&mut self, measured_j: f32, elapsed_s: f32) {
        let left_j = self.energy_j - self.continuous_w * elapsed_s;
        self.energy_j = if left_j > 0.0 { left_j } else { 0.0 };
        self.charge((COUNTED * measured_j).max(0.0));
    }

    /// Adds energy that was not measured.
    pub fn charge(&mut self, energy_j: f32) {
        if energy_j.is_finite() {
            self.energy_j += energy_j;
        }
    }

    /// Whether the limit is exceeded.
    #[must_use]
    pub fn is_used_up(&self) -> bool {
        // NaN counts as exceeded.
        let compared = self.energy_j.partial_cmp(&self.usable_j);
        compared.is_none_or(core::cmp::Ordering::is_gt)
    }

    /// Whether a profile may start now.
    #[must_use]
    pub fn allows(&self, demand: &EnergyDemand) -> bool {
        self.energy_j + demand.most_j <= self.usable_j && demand.rise_j <= self.usable_j
    }

    /// Time until a profile may start, s; `None` if its energy exceeds the account's limit.
    #[must_use]
    pub fn wait_s(&self, demand: &EnergyDemand) -> Option<f32> {
        let fits = demand.most_j <= self.usable_j && demand.rise_j <= self.usable_j;
        let wait_s = self.time_until_s(demand.most_j);
        (fits && wait_s.is_finite()).then_some(wait_s)
    }

    /// Time until the circuit may take `gain_j` more energy, s.
    #[must_use]
    pub fn time_until_s(&self, gain_j: f32) -> f32 {
        let over_j = self.energy_j + gain_j - self.usable_j;
        if over_j <= 0.0 {
            0.0
        } else {
            over_j / self.continuous_w
        }
    }
}

impl EnergyDemand {
    /// Creates an empty profile.
    #[must_use]
    pub fn new(account: &Account, load: Load) -> Self {
        let Load {
            resistance_ohm,
            lost_v,
        } = load;
        let even_w = account.continuous_w / COUNTED;
        let mut even_a = 1.0 + even_w / resistance_ohm;
        for _ in 0..STEPS {
            let over_w = (resistance_ohm * even_a + lost_v) * even_a - even_w;
            even_a -= over_w / (2.0 * resistance_ohm * even_a + lost_v);
        }
        Self {
            load,
            continuous_w: account.continuous_w,
            even_a,
            at_a: 0.0,
            gain_j: 0.0,
            most_j: 0.0,
            least_j: 0.0,
            rise_j: 0.0,
        }
    }

    /// Sets the current at the start of the profile, A; zero by default.
    pub const fn starts_at(&mut self, at_a: f32) {
        self.at_a = at_a;
    }

    /// Appends a straight line to `to_a`, A, within `over_s`, s.
    pub fn line(&mut self, to_a: f32, over_s: f32) {
        let from_a = core::mem::replace(&mut self.at_a, to_a);
        // A line through zero is split in two, each of one sign.
        if from_a * to_a < 0.0 {
            let part = from_a / (from_a - to_a);
            self.one_sided(from_a.abs(), 0.0, part * over_s);
            self.one_sided(0.0, to_a.abs(), (1.0 - part) * over_s);
        } else {
            self.one_sided(from_a.abs(), to_a.abs(), over_s);
        }
    }

    /// Greatest rise of the account above its value at the start of the profile, J.
    #[must_use]
    pub const fn most_j(&self) -> f32 {
        self.most_j
    }

    /// Adds a line whose current does not change its sign. The account has its extremes where the
    /// heat equals the continuous power: the line is split at that current, so that the extremes
    /// are at the ends of the pieces.
    fn one_sided(&mut self, from_a: f32, to_a: f32, over_s: f32) {
        let even_a = self.even_a;
        if (from_a - even_a) * (to_a - even_a) < 0.0 {
            let part = (from_a - even_a) / (from_a - to_a);
            self.add(from_a, even_a, part * over_s);
            self.add(even_a, to_a, (1.0 - part) * over_s);
        } else {
            self.add(from_a, to_a, over_s);
        }
    }

    fn add(&mut self, from_a: f32, to_a: f32, over_s: f32) {
        let square_a2_s = over_s * (from_a * from_a + from_a * to_a + to_a * to_a) / 3.0;
        let charge_a_s = over_s * 0.5 * (from_a + to_a);
        let taken_j = self.load.resistance_ohm * square_a2_s + self.load.lost_v * charge_a_s;
        self.gain_j += COUNTED * taken_j - self.continuous_w * over_s;
        // A NaN stays NaN: no account has enough energy for it.
        let highest = |one: f32, other: f32| if one >= other { one } else { other };
        self.most_j = highest(self.most_j, self.gain_j);
        self.least_j = self.least_j.min(self.gain_j);
        self.rise_j = highest(self.rise_j, self.gain_j - self.least_j);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LOAD: Load = Load {
        resistance_ohm: 0.5,
        lost_v: 0.07,
    };

    fn demand(account: &Account, lines: &[(f32, f32)]) -> EnergyDemand {
        let mut demand = EnergyDemand::new(account, LOAD);
        for &(to_a, over_s) in lines {
            demand.line(to_a, over_s);
        }
        demand
    }

    /// The highest count along the lines, in f64 and steps of 0.2 ms: a sum of that many steps in
    /// f32 is off by up to 0.1 J.
    fn followed(account: &Account, lines: &[(f32, f32)]) -> f64 {
        let [resistance_ohm, lost_v, continuous_w] =
            [LOAD.resistance_ohm, LOAD.lost_v, account.continuous_w].map(f64::from);
        let mut energy_j = f64::from(account.energy_j);
        let (mut from_a, mut most_j) = (0.0, energy_j);
        for (to_a, over_s) in lines.iter().map(|&(a, s)| (f64::from(a), f64::from(s))) {
            let steps = (over_s / 2e-4).ceil().max(1.0);
            let step_s = over_s / steps;
            for step in 0..steps as u32 {
                let at_a = from_a + (to_a - from_a) * (f64::from(step) + 0.5) / steps;
                let power_w = resistance_ohm * at_a * at_a + lost_v * at_a.abs();
                energy_j = (energy_j - continuous_w * step_s).max(0.0);
                energy_j += f64::from(COUNTED) * power_w * step_s;
                most_j = most_j.max(energy_j);
            }
            from_a = to_a;
        }
        most_j
    }

    #[test]
    fn what_is_no_number_is_never_borne() {
        let account = Account::with(60.0, 3.5);
        for lines in [
            [(f32::NAN, 1.0), (0.0, 1.0)],
            [(1.0, f32::NAN), (0.0, 1.0)],
            [(f32::INFINITY, 1.0), (0.0, 1.0)],
        ] {
            let demand = demand(&account, &lines);
            assert!(!account.allows(&demand), "{lines:?}");
            assert_eq!(account.wait_s(&demand), None);
        }
        let load = Load {
            resistance_ohm: f32::NAN,
            ..LOAD
        };
        let mut demand = EnergyDemand::new(&account, load);
        demand.line(1.0, 1.0);
        assert!(!account.allows(&demand));
        let mut spoilt = account;
        spoilt.charge(f32::NAN);
        assert_eq!(spoilt, account);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// The forecast equals the count of the same profile.
        #[test]
        fn the_forecast_is_the_count(
            lines in prop::collection::vec((-12.0_f32..12.0, 0.0_f32..1.5), 1..12),
            energy_j in 0.0_f32..60.0,
        ) {
            let mut account = Account::with(56.0, 3.5);
            account.charge(energy_j);
            let demand = demand(&account, &lines);
            let most_j = followed(&account, &lines);
            let forecast_j = f64::from((account.energy_j() + demand.most_j()).max(demand.rise_j));
            // Tolerance for the steps of the check and the forecast's own f32.
            prop_assert!((forecast_j - most_j).abs() < 0.02 + 1e-3 * most_j, "{forecast_j} {most_j}");
        }

        /// A profile may start after the returned time, and not before.
        #[test]
        fn the_wait_is_as_long_as_it_has_to_be(
            lines in prop::collection::vec((-12.0_f32..12.0, 0.0_f32..0.5), 1..12),
            energy_j in 0.0_f32..60.0,
        ) {
            let mut account = Account::with(56.0, 3.5);
            account.charge(energy_j);
            let demand = demand(&account, &lines);
            match account.wait_s(&demand) {
                Some(0.0) => prop_assert!(account.allows(&demand)),
                Some(wait_s) => {
                    let after = |s: f32| {
                        let mut later = account;
                        later.pass(0.0, s);
                        later.allows(&demand)
                    };
                    prop_assert!(!account.allows(&demand));
                    prop_assert!(after(wait_s + 1e-3) && !after(wait_s - 1e-3));
                }
                None => {
                    account.pass(0.0, 1e3);
                    prop_assert!(!account.allows(&demand));
                }
            }
        }
    }
}
