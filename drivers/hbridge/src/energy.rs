//! The energy that the circuit has taken and not given off yet: what a drive counts, and what a profile
//! of the current will make of that. One law for both.

use crate::hardware::Hardware;
use crate::limits::Limits;
use crate::watch::ATTENDED_WITHIN;

/// Energy is counted too high by what current and supply may be measured too low together: 2 % of
/// gain and bow, 5 % of the divider, and the offset.
const COUNTED: f32 = 1.1;
/// Newton's steps to the current whose heat is given off for ever. Its square root is found from
/// above, halving at first: 24 suffice from 10^4 times the root.
const STEPS: u8 = 24;

/// What the circuit has taken, a tenth too high, less what it gives off for ever; never below zero.
///
/// ```
/// use coil_hbridge::{Account, Demand, Load};
/// let mut account = Account::with(60.0, 3.5);
/// account.pass(50.0, 0.5); // 55 J less nothing: there was nothing to give off before
/// // Half an ohm, from 0 to 10 A and back within 1.2 s: 22 J, of which 4 are given off meanwhile.
/// let mut demand = Demand::new(&account, Load { resistance_ohm: 0.5, lost_v: 0.0 });
/// demand.line(10.0, 0.6);
/// demand.line(0.0, 0.6);
/// assert!(!account.bears(&demand));
/// let wait_s = account.wait_s(&demand).expect("it fits an account that is empty");
/// assert!((3.0..6.0).contains(&wait_s));
/// account.pass(0.0, wait_s + 0.001);
/// assert!(account.bears(&demand));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Account {
    energy_j: f32,
    usable_j: f32,
    continuous_w: f32,
}

/// The circuit, as its self-test finds it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Load {
    /// Resistance of coil, bridge, wires and supply together, ohm.
    pub resistance_ohm: f32,
    /// What the bridge's dead time takes of the voltage, V.
    pub lost_v: f32,
}

/// What a profile of the current asks of an [`Account`]: straight lines, one after the other, from
/// rest.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Demand {
    load: Load,
    continuous_w: f32,
    /// The current that heats as much as is given off.
    even_a: f32,
    at_a: f32,
    /// What the account has gained so far, at its highest and at its lowest.
    gain_j: f32,
    most_j: f32,
    least_j: f32,
    /// The greatest rise from a low to a later high: what an account that is empty comes to.
    rise_j: f32,
}

impl Account {
    /// An empty account of a drive. The limit is less by what may flow before a supervisor looks.
    #[must_use]
    pub fn new(hardware: &Hardware, limits: &Limits) -> Self {
        let unseen_s = ATTENDED_WITHIN as f32 * hardware.period_s;
        let [_, supply_v] = limits.supply_v;
        let unseen_j = unseen_s * supply_v * limits.trip_a;
        Self::with(limits.energy_j - unseen_j, limits.continuous_w)
    }

    /// An empty account with these limits, J and W.
    #[must_use]
    pub const fn with(usable_j: f32, continuous_w: f32) -> Self {
        Self {
            energy_j: 0.0,
            usable_j,
            continuous_w,
        }
    }

    /// Energy that was taken and not given off yet, J.
    #[must_use]
    pub const fn energy_j(&self) -> f32 {
        self.energy_j
    }

    /// Where a drive ends, J.
    #[must_use]
    pub const fn usable_j(&self) -> f32 {
        self.usable_j
    }

    /// Takes what was measured over a time. What comes back from the coil's field was counted when it
    /// went there.
    pub fn pass(&mut self, measured_j: f32, elapsed_s: f32) {
        let left_j = self.energy_j - self.continuous_w * elapsed_s;
        self.energy_j = if left_j > 0.0 { left_j } else { 0.0 };
        self.charge((COUNTED * measured_j).max(0.0));
    }

    /// Takes what was not measured.
    pub fn charge(&mut self, energy_j: f32) {
        if energy_j.is_finite() {
            self.energy_j += energy_j;
        }
    }

    /// Whether there is no more.
    #[must_use]
    pub fn is_used_up(&self) -> bool {
        // So is one that is not a number.
        let compared = self.energy_j.partial_cmp(&self.usable_j);
        compared.is_none_or(core::cmp::Ordering::is_gt)
    }

    /// Whether a profile may begin now.
    #[must_use]
    pub fn bears(&self, demand: &Demand) -> bool {
        self.energy_j + demand.most_j <= self.usable_j && demand.rise_j <= self.usable_j
    }

    /// How long until a profile may begin, s; nothing if it never may.
    #[must_use]
    pub fn wait_s(&self, demand: &Demand) -> Option<f32> {
        let fits = demand.most_j <= self.usable_j && demand.rise_j <= self.usable_j;
        let wait_s = self.time_until_s(demand.most_j);
        (fits && wait_s.is_finite()).then_some(wait_s)
    }

    /// How long until it may gain so much, s.
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

impl Demand {
    /// Nothing yet.
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

    /// It begins at this current and not at rest.
    pub const fn starts_at(&mut self, at_a: f32) {
        self.at_a = at_a;
    }

    /// Goes on in a straight line.
    pub fn line(&mut self, to_a: f32, over_s: f32) {
        let from_a = core::mem::replace(&mut self.at_a, to_a);
        // Through zero in two lines, each of one sign.
        if from_a * to_a < 0.0 {
            let part = from_a / (from_a - to_a);
            self.one_sided(from_a.abs(), 0.0, part * over_s);
            self.one_sided(0.0, to_a.abs(), (1.0 - part) * over_s);
        } else {
            self.one_sided(from_a.abs(), to_a.abs(), over_s);
        }
    }

    /// What the account gains at its highest, J.
    #[must_use]
    pub const fn most_j(&self) -> f32 {
        self.most_j
    }

    /// The account turns where as much is taken as is given off: what lies between two turns is
    /// highest and lowest at its ends.
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
        // What is no number stays none, and nothing bears it.
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

    fn demand(account: &Account, lines: &[(f32, f32)]) -> Demand {
        let mut demand = Demand::new(account, LOAD);
        for &(to_a, over_s) in lines {
            demand.line(to_a, over_s);
        }
        demand
    }

    /// The highest count along the lines, in f64 and steps of 0.2 ms: the sum of so many in f32 is off by
    /// up to 0.1 J.
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
            assert!(!account.bears(&demand), "{lines:?}");
            assert_eq!(account.wait_s(&demand), None);
        }
        let load = Load {
            resistance_ohm: f32::NAN,
            ..LOAD
        };
        let mut demand = Demand::new(&account, load);
        demand.line(1.0, 1.0);
        assert!(!account.bears(&demand));
        let mut spoilt = account;
        spoilt.charge(f32::NAN);
        assert_eq!(spoilt, account);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// The forecast is what becomes of it.
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
            // Steps of the check, and the forecast's own f32.
            prop_assert!((forecast_j - most_j).abs() < 0.02 + 1e-3 * most_j, "{forecast_j} {most_j}");
        }

        /// A profile may begin after the time that is returned, and not before.
        #[test]
        fn the_wait_is_as_long_as_it_has_to_be(
            lines in prop::collection::vec((-12.0_f32..12.0, 0.0_f32..0.5), 1..12),
            energy_j in 0.0_f32..60.0,
        ) {
            let mut account = Account::with(56.0, 3.5);
            account.charge(energy_j);
            let demand = demand(&account, &lines);
            match account.wait_s(&demand) {
                Some(0.0) => prop_assert!(account.bears(&demand)),
                Some(wait_s) => {
                    let after = |s: f32| {
                        let mut later = account;
                        later.pass(0.0, s);
                        later.bears(&demand)
                    };
                    prop_assert!(!account.bears(&demand));
                    prop_assert!(after(wait_s + 1e-3) && !after(wait_s - 1e-3));
                }
                None => {
                    account.pass(0.0, 1e3);
                    prop_assert!(!account.bears(&demand));
                }
            }
        }
    }
}
