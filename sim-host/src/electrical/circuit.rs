//! Bridge, coil and supply.
//!
//! L di/dt = E − R i, where the driving voltage E and the resistance R depend on which transistors
//! and diodes conduct: i(t) = E/R + (i₀ − E/R) exp(−R t/L). A span is divided into such pieces by
//! dead times, the hardware limit and a diode current that decays to zero.

use std::collections::VecDeque;

/// Parameters of the circuit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircuitParameters {
    /// Resistance of the coil, ohm, 10⁻³ to 10³.
    pub coil_ohm: f64,
    /// Inductance of the coil, H, 10⁻⁷ to 1.
    pub inductance_h: f64,
    /// Resistance of the bridge's two conducting transistors and of the wires, ohm.
    pub bridge_ohm: f64,
    /// Voltage of the supply without load, V.
    pub supply_v: f64,
    /// Resistance of the supply, ohm. The supply absorbs the energy that the coil returns.
    pub supply_ohm: f64,
    /// Forward voltage of a diode, V.
    pub diode_v: f64,
    /// Delay from an edge of an input until the conducting transistor opens, s: 0 to 8e-6.
    pub lag_s: f64,
    /// Dead time between the two transistors of a half bridge, s.
    pub dead_s: f64,
    /// Time from an edge of an input until the gate of the closing transistor is full, s: 0 to
    /// 8e-6. After a shorter pulse the gate is emptied sooner, by half of the time that was missing,
    /// since more current flows out of a gate than into it. So short pulses vanish.
    pub charged_s: f64,
    /// Hardware current limit, A; infinite for a bridge without one.
    pub limit_a: f64,
    /// Delay from reaching the limit to the end of the drive, s: comparator and blanking.
    pub limit_delay_s: f64,
    /// Time for which the bridge shorts the coil after a trip, s.
    pub limit_off_s: f64,
    /// Wake-up time, s: from nSLEEP high until the outputs follow the inputs.
    pub wake_s: f64,
}

impl CircuitParameters {
    /// A typical bridge: transistors and wires of 70 mΩ, 100 ns of dead time, limit 15 A after
    /// 1.5 µs with a fixed off-time of 20 µs. All values are within the data sheets of integrated 12 V
    /// bridges; the exact values are a guess. It wakes within 1 ms, the time of gate drivers for
    /// external transistors (DRV8704, SLVSD29, t_SLEEP; DRV8714-Q1, t_WAKE).
    #[must_use]
    pub const fn common(coil_ohm: f64, inductance_h: f64, supply_v: f64) -> Self {
        Self {
            coil_ohm,
            inductance_h,
            bridge_ohm: 0.07,
            supply_v,
            supply_ohm: 0.05,
            diode_v: 0.8,
            lag_s: 0.0,
            dead_s: 100e-9,
            charged_s: 0.0,
            limit_a: 15.0,
            limit_delay_s: 1.5e-6,
            limit_off_s: 20e-6,
            wake_s: 1e-3,
        }
    }

    /// These parameters with the switching of the carrier's bridge (`hardware/README.md`), as the
    /// current amplifier shows it: its lag of 0.55 us is counted as the bridge's.
    ///
    /// A long pulse of the deck `bridge` (`hardware/spice`) begins 1.76 us and ends 1.15 us after
    /// its edges, each at half of the supply: 0.5 us of the DRV8701 (SLVSCX5B, 6.5), its gate
    /// currents of 12.5 and 25 mA into the transistors' charge, and 150 ns of its own dead time.
    /// Mean currents are those of the deck within 4 % and 0.1 A.
    #[must_use]
    pub const fn carrier(self) -> Self {
        Self {
            lag_s: 1.15e-6 + 0.55e-6,
            dead_s: 0.61e-6,
            charged_s: 2.5e-6,
            ..self
        }
    }
}

/// Levels of the bridge's inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pins {
    /// nSLEEP.
    pub awake: bool,
    /// IN1 and IN2.
    pub inputs: [bool; 2],
}

/// Conducting part of one half bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Half {
    /// The upper transistor.
    Top,
    /// The lower transistor.
    Bottom,
    /// Neither transistor: the current takes a diode.
    #[default]
    Diodes,
}

impl Pins {
    /// Conducting parts of both half bridges. Both inputs low disconnect the coil; both high short
    /// it at the bottom.
    const fn halves(self) -> [Half; 2] {
        match (self.awake, self.inputs) {
            (false, _) | (true, [false, false]) => [Half::Diodes; 2],
            (true, [true, true]) => [Half::Bottom; 2],
            (true, [true, false]) => [Half::Top, Half::Bottom],
            (true, [false, true]) => [Half::Bottom, Half::Top],
        }
    }
}

/// Sums since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// Time, s.
    pub time_s: f64,
    /// ∫ i dt, A s.
    pub charge_a_s: f64,
    /// ∫ i² dt, A² s.
    pub square_a2_s: f64,
    /// Energy drawn from the supply less the energy returned, J.
    pub supply_j: f64,
    /// ∫ V dt at the bridge's supply pins, V s.
    pub supply_v_s: f64,
}

/// The circuit and its state.
#[derive(Clone, Debug, PartialEq)]
pub struct Circuit {
    /// Parameters; may change at any time.
    pub parameters: CircuitParameters,
    current_a: f64,
    totals: Totals,
    peak_a: f64,
    /// States that the pins have requested within the lag, with the times at which they are asked
    /// for.
    coming: VecDeque<(f64, [Half; 2])>,
    /// State that is asked for; it takes effect when the dead time ends.
    asked: [Half; 2],
    /// Time of the last change of the requested state.
    requested_s: f64,
    dead_until_s: [f64; 2],
    /// Time at which the hardware limit trips; the short after it lasts to `shorted_until_s`.
    trips_s: f64,
    shorted_until_s: f64,
    trips: u32,
    /// Time from which on the bridge is awake; infinite while it is asleep.
    awake_from_s: f64,
    decays: Decays,
}

/// Fraction of a current that is left after a span, with the integrals of the fraction and of its
/// square over the span, s.
#[derive(Clone, Copy, Debug)]
struct Decay {
    rate: f64,
    span_s: f64,
    rest: f64,
    single_s: f64,
    double_s: f64,
}

/// The last decays, placed by their rate and span. A PWM that hardly changes repeats its spans, so
/// most of the exponentials are here.
#[derive(Clone, Debug)]
struct Decays([Decay; 1 << Decays::BITS]);

impl Decay {
    fn over(rate: f64, span_s: f64) -> Self {
        let gone = -libm::expm1(-rate * span_s);
        let rest = 1.0 - gone;
        // ∫ exp = gone/rate, ∫ exp² = (1 − rest²)/(2 rate)
        Self {
            rate,
            span_s,
            rest,
            single_s: gone / rate,
            double_s: 0.5 * (1.0 - rest * rest) / rate,
        }
    }
}

impl Decays {
    const BITS: u32 = 8;

    fn new() -> Self {
        // No rate equals NaN, so no place matches before it is filled.
        Self([Decay::over(f64::NAN, 0.0); 1 << Self::BITS])
    }

    fn over(&mut self, rate: f64, span_s: f64) -> Decay {
        // The golden ratio as a fraction of 2⁶⁴ spreads neighbouring numbers over the places.
        let mixed = (rate.to_bits() ^ span_s.to_bits()).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let place = (mixed >> (u64::BITS - Self::BITS)) as usize;
        let Some(place) = self.0.get_mut(place) else {
            return Decay::over(rate, span_s);
        };
        if place.rate != rate || place.span_s != span_s {
            *place = Decay::over(rate, span_s);
        }
        *place
    }
}

/// Two circuits are equal whatever they have computed before.
impl PartialEq for Decays {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Driving voltage and resistance of the conducting path.
#[derive(Clone, Copy)]
struct Mesh {
    voltage_v: f64,
    resistance_ohm: f64,
    /// Whether the current takes a diode: it can then only decay, and stops at zero.
    through_diodes: bool,
    /// 1 where the current flows out of the supply, -1 where it flows back into the supply, 0 where
    /// it does not pass the supply.
    from_supply: f64,
}

impl Circuit {
    /// A circuit without current, its bridge asleep.
    #[must_use]
    pub fn new(parameters: CircuitParameters) -> Self {
        Self {
            parameters,
            current_a: 0.0,
            totals: Totals::default(),
            peak_a: 0.0,
            coming: VecDeque::new(),
            asked: [Half::Diodes; 2],
            requested_s: f64::NEG_INFINITY,
            dead_until_s: [0.0; 2],
            trips_s: f64::INFINITY,
            shorted_until_s: 0.0,
            trips: 0,
            awake_from_s: f64::INFINITY,
            decays: Decays::new(),
        }
    }

    /// Coil current, A.
    #[must_use]
    pub const fn current_a(&self) -> f64 {
        self.current_a
    }

    /// Sums since the start.
    #[must_use]
    pub const fn totals(&self) -> Totals {
        self.totals
    }

    /// Largest current so far, A, and the number of trips of the hardware limit.
    #[must_use]
    pub const fn peak(&self) -> (f64, u32) {
        (self.peak_a, self.trips)
    }

    /// Resets the peak current and the number of trips.
    pub const fn forget_peak(&mut self) {
        self.peak_a = self.current_a.abs();
        self.trips = 0;
    }

    /// Whether the hardware limit blocks the drive now.
    #[must_use]
    pub fn is_limiting(&self) -> bool {
        self.totals.time_s < self.shorted_until_s
    }

    /// Whether the bridge is waking up.
    #[must_use]
    pub fn is_waking(&self) -> bool {
        self.awake_from_s.is_finite() && self.totals.time_s < self.awake_from_s
    }

    /// Voltage at the bridge's supply pins, V.
    #[must_use]
    pub fn supply_v(&self) -> f64 {
        let p = &self.parameters;
        p.supply_v - p.supply_ohm * self.mesh(self.conducts()).from_supply * self.current_a
    }

    /// Advances time with constant pins.
    pub fn advance(&mut self, pins: Pins, duration_s: f64) {
        let now_s = self.totals.time_s;
        if !pins.awake {
            self.awake_from_s = f64::INFINITY;
        } else if self.awake_from_s == f64::INFINITY {
            self.awake_from_s = now_s + self.parameters.wake_s;
        }
        let wakes_s = if pins.awake {
            (self.awake_from_s - now_s).clamp(0.0, duration_s)
        } else {
            0.0
        };
        self.request([Half::Diodes; 2], wakes_s);
        self.request(pins.halves(), duration_s - wakes_s);
    }

    /// Advances time while the pins request a state.
    fn request(&mut self, halves: [Half; 2], duration_s: f64) {
        if duration_s <= 0.0 {
            return;
        }
        let now_s = self.totals.time_s;
        let last = self.coming.back();
        if last.map_or(self.asked, |(_, requested)| *requested) != halves {
            let p = &self.parameters;
            let missing_s = (p.charged_s - (now_s - self.requested_s)).max(0.0);
            let earliest_s = last.map_or(now_s, |(at_s, _)| *at_s);
            let at_s = (now_s + p.lag_s - 0.5 * missing_s).max(earliest_s);
            self.coming.push_back((at_s, halves));
            self.requested_s = now_s;
        }
        let end_s = now_s + duration_s;
        while let Some((at_s, halves)) = self.coming.pop_front_if(|(at_s, _)| *at_s < end_s) {
            self.conduct_until(at_s);
            self.ask(halves);
        }
        self.conduct_until(end_s);
    }

    fn conduct_until(&mut self, end_s: f64) {
        // A span has at most two dead times and a few trips. The bound of 64 only ends a loop that
        // rounding could prolong.
        for _ in 0..64 {
            let left_s = end_s - self.totals.time_s;
            if left_s <= 0.0 {
                return;
            }
            self.piece(left_s);
        }
        self.totals.time_s = end_s;
    }

    fn ask(&mut self, halves: [Half; 2]) {
        let now_s = self.totals.time_s;
        for ((asked, dead_until_s), half) in self
            .asked
            .iter_mut()
            .zip(&mut self.dead_until_s)
            .zip(halves)
        {
            if *asked != half {
                let changes_over = *asked != Half::Diodes && half != Half::Diodes;
                *dead_until_s = if changes_over {
                    now_s + self.parameters.dead_s
                } else {
                    now_s
                };
                *asked = half;
            }
        }
    }

    fn conducts(&self) -> [Half; 2] {
        let now_s = self.totals.time_s;
        let [first, second] = self.dead_until_s.map(|until_s| now_s < until_s);
        let is_off = self.asked == [Half::Diodes; 2];
        if now_s < self.shorted_until_s && !is_off {
            return [Half::Bottom; 2];
        }
        let [left, right] = self.asked;
        [
            if first { Half::Diodes } else { left },
            if second { Half::Diodes } else { right },
        ]
    }

    fn mesh(&self, halves: [Half; 2]) -> Mesh {
        let p = &self.parameters;
        let flows = if self.current_a > 0.0 {
            1.0
        } else if self.current_a < 0.0 {
            -1.0
        } else {
            0.0
        };
        // For each end of the coil: 1 at the supply's voltage, else 0, and a diode's voltage
        // against the current. Current leaves the first half bridge and enters the second.
        let end = |half: Half, leaves: f64| match half {
            Half::Top => (1.0, 0.0),
            Half::Bottom => (0.0, 0.0),
            Half::Diodes if leaves > 0.0 => (0.0, -p.diode_v),
            Half::Diodes => (1.0, p.diode_v),
        };
        let [first, second] = halves;
        let ((first_top, first_v), (second_top, second_v)) =
            (end(first, flows), end(second, -flows));
        let transistor = |half: Half| if half == Half::Diodes { 0.0 } else { 1.0 };
        let transistors = transistor(first) + transistor(second);
        let from_supply = first_top - second_top;
        Mesh {
            voltage_v: from_supply * p.supply_v + first_v - second_v,
            resistance_ohm: p.coil_ohm
                + 0.5 * transistors * p.bridge_ohm
                + from_supply * from_supply * p.supply_ohm,
            through_diodes: transistors < 2.0,
            from_supply,
        }
    }

    /// Advances to the next change of the conducting path, or by `left_s`.
    fn piece(&mut self, left_s: f64) {
        let now_s = self.totals.time_s;
        let halves = self.conducts();
        let mesh = self.mesh(halves);
        let mut span_s = left_s;
        let [first_s, second_s] = self.dead_until_s;
        for change_s in [first_s, second_s, self.shorted_until_s] {
            if change_s > now_s {
                span_s = span_s.min(change_s - now_s);
            }
        }
        if mesh.through_diodes && self.current_a == 0.0 {
            return self.pass(&mesh, 0.0, span_s);
        }
        let rate = mesh.resistance_ohm / self.parameters.inductance_h;
        let end_a = mesh.voltage_v / mesh.resistance_ohm;
        if mesh.through_diodes
            && let Some(dies_s) = self.crosses(0.0, end_a, rate, span_s)
        {
            self.exponential(&mesh, end_a, rate, dies_s);
            self.current_a = 0.0;
            return;
        }
        if let Some(trip_s) = self.trip(&mesh, end_a, rate, span_s) {
            span_s = span_s.min(trip_s);
        }
        self.exponential(&mesh, end_a, rate, span_s);
        if self.totals.time_s >= self.trips_s {
            self.trips_s = f64::INFINITY;
            self.shorted_until_s = self.totals.time_s + self.parameters.limit_off_s;
            self.trips += 1;
        }
    }

    /// Time until the hardware limit trips in this piece, s.
    fn trip(&mut self, mesh: &Mesh, end_a: f64, rate: f64, span_s: f64) -> Option<f64> {
        let now_s = self.totals.time_s;
        let limit_a = self.parameters.limit_a;
        let drives =
            !mesh.through_diodes && mesh.from_supply != 0.0 && self.current_a * end_a >= 0.0;
        if !drives {
            self.trips_s = f64::INFINITY;
            return None;
        }
        if self.trips_s.is_finite() {
            return Some((self.trips_s - now_s).max(0.0));
        }
        let crosses_s = if self.current_a.abs() >= limit_a {
            0.0
        } else if end_a.abs() > limit_a {
            self.crosses(limit_a * end_a.signum(), end_a, rate, span_s)?
        } else {
            return None;
        };
        let trip_s = crosses_s + self.parameters.limit_delay_s;
        self.trips_s = now_s + trip_s;
        Some(trip_s)
    }

    /// Time at which the current, on its way to `end_a`, is `at_a`, s; `None` if not in this piece.
    fn crosses(&self, at_a: f64, end_a: f64, rate: f64, span_s: f64) -> Option<f64> {
        let way_a = end_a - self.current_a;
        // The current changes fastest at the start. Twice that leaves room for rounding.
        if (at_a - self.current_a).abs() > 2.0 * way_a.abs() * rate * span_s {
            return None;
        }
        // exp(-rate t) = (end - at)/(end - i)
        let time_s = libm::log(way_a / (end_a - at_a)) / rate;
        (0.0..=span_s).contains(&time_s).then_some(time_s)
    }

    fn exponential(&mut self, mesh: &Mesh, end_a: f64, rate: f64, span_s: f64) {
        let start_a = self.current_a - end_a;
        let Decay {
            rest,
            single_s,
            double_s,
            ..
        } = self.decays.over(rate, span_s);
        let charge = end_a * span_s + start_a * single_s;
        self.current_a = end_a + start_a * rest;
        self.totals.charge_a_s += charge;
        self.totals.square_a2_s += end_a * end_a * span_s
            + 2.0 * end_a * start_a * single_s
            + start_a * start_a * double_s;
        self.pass(mesh, charge, span_s);
    }

    /// Adds time and supply energy of a piece whose current has already been updated.
    fn pass(&mut self, mesh: &Mesh, charge_a_s: f64, span_s: f64) {
        let p = &self.parameters;
        let taken = mesh.from_supply * charge_a_s;
        self.totals.supply_j += p.supply_v * taken;
        self.totals.supply_v_s += p.supply_v * span_s - p.supply_ohm * taken;
        self.totals.time_s += span_s;
        self.peak_a = self.peak_a.max(self.current_a.abs());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn awake(first: bool, second: bool) -> Pins {
        Pins {
            awake: true,
            inputs: [first, second],
        }
    }

    const COAST: Pins = awake(false, false);
    const FORWARD: Pins = awake(true, false);
    const BACKWARD: Pins = awake(false, true);
    const BRAKE: Pins = awake(true, true);

    /// A circuit whose bridge wakes at once.
    fn circuit() -> Circuit {
        Circuit::new(CircuitParameters {
            wake_s: 0.0,
            ..CircuitParameters::common(0.4, 40e-6, 12.0)
        })
    }

    #[test]
    fn the_current_rises_as_the_closed_form_has_it() {
        let mut circuit = circuit();
        circuit.advance(FORWARD, 20e-6);
        let ohm = 0.4 + 0.07 + 0.05;
        let expected = 12.0 / ohm * (1.0 - (-ohm / 40e-6 * 20e-6_f64).exp());
        assert!((circuit.current_a() - expected).abs() < 1e-12);
    }

    #[test]
    fn one_long_span_is_many_short_ones() {
        let (mut whole, mut parts) = (circuit(), circuit());
        for pins in [FORWARD, BRAKE, FORWARD, COAST, BACKWARD, BRAKE, COAST] {
            whole.advance(pins, 9e-6);
            for _ in 0..900 {
                parts.advance(pins, 1e-8);
            }
        }
        assert!((whole.current_a() - parts.current_a()).abs() < 1e-9);
        let (a, b) = (whole.totals(), parts.totals());
        assert!((a.charge_a_s - b.charge_a_s).abs() < 1e-15);
        assert!((a.square_a2_s - b.square_a2_s).abs() < 1e-14);
        assert!((a.supply_j - b.supply_j).abs() < 1e-13);
    }

    #[test]
    fn energy_is_conserved() {
        // Without dead time no diode conducts: supply energy becomes heat and magnetic energy.
        let mut circuit = circuit();
        circuit.parameters.dead_s = 0.0;
        circuit.parameters.supply_ohm = 0.0;
        for _ in 0..200 {
            circuit.advance(FORWARD, 6e-6);
            circuit.advance(BRAKE, 10e-6);
        }
        let heat = 0.47 * circuit.totals().square_a2_s;
        let field = 0.5 * 40e-6 * circuit.current_a().powi(2);
        let supply = circuit.totals().supply_j;
        assert!((supply - heat - field).abs() < 1e-12 * supply, "{supply}");
    }

    #[test]
    fn a_coasting_current_dies_and_stays_dead() {
        let mut circuit = circuit();
        circuit.advance(FORWARD, 20e-6);
        let start_a = circuit.current_a();
        circuit.advance(COAST, 1e-6);
        let slope = (circuit.current_a() - start_a) / 1e-6;
        let expected = -(12.0 + 1.6 + 0.45 * start_a) / 40e-6;
        assert!((slope / expected - 1.0).abs() < 0.01, "{slope} {expected}");
        circuit.advance(COAST, 100e-6);
        assert_eq!(circuit.current_a(), 0.0);
    }

    #[test]
    fn dead_time_takes_its_part_of_a_pulse() {
        let run = |dead_s: f64, pulse_s: f64| {
            let mut circuit = circuit();
            circuit.parameters.dead_s = dead_s;
            for _ in 0..2_000 {
                circuit.advance(FORWARD, pulse_s);
                circuit.advance(BRAKE, 16e-6 - pulse_s);
            }
            circuit.current_a()
        };
        // A dead time costs more than its length: a diode's voltage opposes the current during it.
        let lost = run(0.0, 4e-6) - run(100e-9, 4e-6);
        let by_length = run(0.0, 4e-6) - run(0.0, 3.9e-6);
        assert!(
            lost > by_length && lost < 1.3 * by_length,
            "{lost} {by_length}"
        );
    }

    #[test]
    fn the_carriers_bridge_is_that_of_its_deck() {
        // Duty and mean current of `hardware/spice/bridge.cir`: 0.39 ohm and 40 uH at 12 V.
        for (duty, deck_a) in [
            (0.07, 0.03),
            (0.1, 0.956),
            (0.12, 1.805),
            (0.15, 3.084),
            (0.25, 6.094),
            (0.42, 10.794),
        ] {
            let mut circuit = Circuit::new(CircuitParameters {
                wake_s: 0.0,
                bridge_ohm: 0.023,
                ..CircuitParameters::common(0.39, 40e-6, 12.0).carrier()
            });
            for _ in 0..100 {
                circuit.advance(BRAKE, 8e-6 * (1.0 - duty));
                circuit.advance(FORWARD, 16e-6 * duty);
                circuit.advance(BRAKE, 8e-6 * (1.0 - duty));
            }
            let before = circuit.totals();
            circuit.advance(BRAKE, 8e-6 * (1.0 - duty));
            circuit.advance(FORWARD, 16e-6 * duty);
            circuit.advance(BRAKE, 8e-6 * (1.0 - duty));
            let mean_a = (circuit.totals().charge_a_s - before.charge_a_s) / 16e-6;
            let off_a = (mean_a - deck_a).abs();
            assert!(off_a < 0.1 + 0.04 * deck_a, "{duty}: {mean_a} {deck_a}");
        }
    }

    #[test]
    fn the_limit_holds_a_short_within_its_delay() {
        let mut circuit = Circuit::new(CircuitParameters {
            wake_s: 0.0,
            ..CircuitParameters::common(5e-3, 2e-6, 12.0)
        });
        circuit.advance(FORWARD, 1e-3);
        let (peak_a, trips) = circuit.peak();
        // Limit of 15 A; during its delay of 1.5 us, 12 V / 2 uH add 9 A.
        assert!(peak_a > 20.0 && peak_a < 15.0 + 9.0, "{peak_a}");
        assert!(trips > 30, "{trips}");
    }

    #[test]
    fn without_reaching_it_the_limit_does_nothing() {
        let mut circuit = circuit();
        circuit.advance(FORWARD, 50e-6);
        circuit.advance(BRAKE, 50e-6);
        assert_eq!(circuit.peak().1, 0);
    }
}
