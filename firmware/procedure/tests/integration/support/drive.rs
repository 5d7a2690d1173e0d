//! Coil drive that counts energy as the real one does, on a circuit with warming copper. The heat is
//! computed in `f64`, step by step, and shares no code with the procedure.

use coil_hbridge::{Account, EnergyDemand, Load};

use super::CurrentPath;

/// Heat capacity of the copper. This and the heat capacities and resistances below are those of
/// `calibration::COIL`.
const COPPER_J_PER_K: f64 = 0.8;
const PAD_J_PER_K: f64 = 60.0;
const COPPER_TO_PAD_K_PER_W: f64 = 0.5;
const PAD_TO_AMBIENT_K_PER_W: f64 = 8.0;
const AMBIENT_C: f64 = 25.0;
/// Period in microseconds at which the drive is polled.
const POLL_US: u64 = 1_000;

/// Simulated drive.
#[derive(Clone)]
pub(crate) struct SimulatedDrive {
    pub(crate) account: Account,
    /// Resistance of the copper at 20 degrees; `wires_ohm` is that of bridge, wires and supply.
    pub(crate) copper_ohm: f64,
    pub(crate) wires_ohm: f64,
    /// Voltage loss from dead time, V.
    pub(crate) lost_v: f64,
    /// Square of the ripple relative to the square of the current.
    pub(crate) ripple: f64,
    /// The drive neither reports its account nor enforces its limit.
    pub(crate) is_silent: bool,
    /// Highest value of the account so far, J.
    pub(crate) most_j: f32,
    copper_c: f64,
    pub(crate) pad_c: f64,
    now_us: u64,
}

impl SimulatedDrive {
    pub(crate) fn new(copper_ohm: f64, wires_ohm: f64, now_us: u64) -> Self {
        Self {
            // The limit is 60 J less the energy of 20 ms that could go undetected; 3.5 W is the
            // continuous power.
            account: Account::with(56.4, 3.5),
            copper_ohm,
            wires_ohm,
            lost_v: 0.07,
            ripple: 0.015,
            is_silent: false,
            most_j: 0.0,
            copper_c: AMBIENT_C,
            pad_c: AMBIENT_C,
            now_us,
        }
    }

    pub(crate) fn resistance_ohm(&self) -> f64 {
        self.wires_ohm + self.copper_ohm * (1.0 + 3.93e-3 * (self.copper_c - 20.0))
    }

    /// Returns whether the drive refuses a line that is requested at this time.
    pub(crate) fn refuses(&self, line: &CurrentPath) -> bool {
        let load = Load {
            resistance_ohm: self.resistance_ohm() as f32,
            lost_v: self.lost_v as f32,
        };
        let mut demand = EnergyDemand::new(&self.account, load);
        demand.starts_at(line.at(self.now_us) as f32);
        let ahead_us = line.since_us.saturating_sub(self.now_us);
        demand.line(line.from_a as f32, ahead_us as f32 * 1e-6);
        demand.line(line.to_a as f32, line.over_us as f32 * 1e-6);
        !self.is_silent && !self.account.allows(&demand)
    }

    /// Follows the current to a time; returns whether the drive's guard has ended the current.
    pub(crate) fn advance(&mut self, to_us: u64, line: &CurrentPath) -> bool {
        let mut is_over = false;
        while self.now_us < to_us {
            let step_us = POLL_US.min(to_us - self.now_us);
            let current_a = line.at(self.now_us + step_us / 2).abs();
            let step_s = step_us as f64 * 1e-6;
            let power_w = self.resistance_ohm() * current_a * current_a * (1.0 + self.ripple)
                + self.lost_v * current_a;
            self.account.pass((power_w * step_s) as f32, step_s as f32);
            self.most_j = self.most_j.max(self.account.energy_j());
            is_over |= current_a > 0.0 && self.account.is_used_up() && !self.is_silent;
            self.warm(power_w, step_s);
            self.now_us += step_us;
        }
        is_over
    }

    fn warm(&mut self, power_w: f64, step_s: f64) {
        let in_copper = 1.0 - self.wires_ohm / self.resistance_ohm();
        let to_pad_w = (self.copper_c - self.pad_c) / COPPER_TO_PAD_K_PER_W;
        let out_w = (self.pad_c - AMBIENT_C) / PAD_TO_AMBIENT_K_PER_W;
        self.copper_c += step_s * (in_copper * power_w - to_pad_w) / COPPER_J_PER_K;
        self.pad_c += step_s * (to_pad_w - out_w) / PAD_J_PER_K;
    }
}
