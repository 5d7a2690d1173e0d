//! Coupling of the bridge's switching to the sensing coil: with the measures of docs/decisions/0041
//! it stays below the converter's quantisation, and without them it would not.

use crate::common::{converting, middle, ms, world};
use palpate_sim::current::PWM_PERIOD_S;
use palpate_sim::electrical::{Circuit, CircuitParameters, Pins, edges};
use palpate_sim::parameters::{EDGE_S, INTERFERENCE_V_PER_V};
use palpate_sim::random::Stream;
use palpate_sim::sensing_coil::CoilDesign;
use palpate_sim::sensing_coil::interference::{Bridge, InterferenceParameters, Oscillation};
use palpate_sim::sensing_coil::mutual::{drive_turns, mutual_inductance_h};
use palpate_sim::sensing_coil::tank::{SensingTank, TankState};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, SharedWorld};

/// A conversion at 1 kHz, s, with the reference of a single channel.
const WINDOW_S: f64 = 1e-3;
const REFERENCE_HZ: f64 = 30e6;
/// Interval between conversions, s: a conversion and eleven reference periods.
const INTERVAL_S: f64 = WINDOW_S + 11.0 / REFERENCE_HZ;
/// The highest supply of the reference plants, V.
const SUPPLY_V: f64 = 12.0;
/// Voltage in the sensing coil per volt at the drive coils without a plane of copper: 0.77 µH
/// mutual, 20 µH own inductance (`the_copper_plane_is_what_decouples`).
const WITHOUT_PLANE: f64 = 0.77 / 20.0;

/// Relative standard deviation of a reading by quantisation (docs/ldc161x.md).
fn quantisation() -> f64 {
    1.0 / (12_f64.sqrt() * REFERENCE_HZ * WINDOW_S)
}

/// Range of the tank's frequency for presses of 0 to 0.4 mm in the reference plants, Hz.
fn band_hz() -> (f64, f64) {
    let tank = SensingTank::new(&middle("soft-closed").tank);
    let at = |pressed_m: f64| {
        let state = TankState {
            apparent_m: pressed_m,
            displacement_m: pressed_m,
            warmer_k: 0.0,
            ..TankState::default()
        };
        tank.resonance(&state).frequency_hz
    };
    (at(0.4e-3), at(0.0))
}

/// Error that the bridge adds to readings at one resonance, Hz rms: 40 starts at random phase, 40
/// conversions each.
fn added_hz(parameters: &InterferenceParameters, period_s: f64, free_hz: f64) -> f64 {
    let mut random = Stream::named(7, "pwm_coupling");
    // The duty at which the nearest harmonic is largest, near a half.
    let harmonic = (free_hz * period_s).round();
    let bridge = Bridge {
        supply_v: SUPPLY_V,
        duty: ((0.5 * harmonic).floor() + 0.5) / harmonic,
        period_s,
    };
    let interferer = parameters.nearest(&bridge, free_hz);
    let mut squares = 0.0;
    for _ in 0..40 {
        let mut oscillation = Oscillation::default();
        let mut start_s = random.uniform();
        for _ in 0..40 {
            let pulled = oscillation.follow(Some(&interferer), (start_s, WINDOW_S), free_hz);
            squares += (pulled / WINDOW_S).powi(2);
            start_s += INTERVAL_S;
        }
    }
    f64::sqrt(squares / 1600.0)
}

/// Worst error in the band, relative to the quantisation, with its frequency in Hz.
fn worst(parameters: &InterferenceParameters, period_s: f64) -> (f64, f64) {
    let (low_hz, high_hz) = band_hz();
    println!("{low_hz:.0} to {high_hz:.0} Hz");
    let spacing_hz = 1.0 / period_s;
    let first = (low_hz / spacing_hz).ceil() as u32;
    let last = (high_hz / spacing_hz).floor() as u32;
    assert!(last >= first, "no harmonic in the band");
    let mut worst = (0.0, 0.0);
    for harmonic in first..=last {
        let harmonic_hz = f64::from(harmonic) * spacing_hz;
        // Every hertz near the harmonic, where it locks, then in steps of a tenth of the
        // distance, to half-way to its neighbour.
        let near = (-60..=60).map(f64::from);
        let far = (0..60).map(|step| 61.0 * 1.11_f64.powi(step));
        let far = far.take_while(|&away_hz| away_hz < 0.5 * spacing_hz);
        for away_hz in near.chain(far.flat_map(|away_hz| [away_hz, -away_hz])) {
            let free_hz = harmonic_hz + away_hz;
            let part = added_hz(parameters, period_s, free_hz) / (free_hz * quantisation());
            if part > worst.0 {
                worst = (part, free_hz);
            }
        }
    }
    worst
}

/// Extreme values of the draw.
fn corner() -> InterferenceParameters {
    InterferenceParameters {
        volt_per_volt: INTERFERENCE_V_PER_V.range().1,
        edge_s: EDGE_S.range().0,
    }
}

#[test]
fn what_the_bridge_adds_is_below_quantisation_over_the_whole_band() {
    let (part, at_hz) = worst(&corner(), PWM_PERIOD_S);
    println!("worst of all plants: {part:.2} of the quantisation, at {at_hz:.0} Hz");
    assert!(part < 1.0, "{part} at {at_hz} Hz");
    let usual = InterferenceParameters {
        volt_per_volt: INTERFERENCE_V_PER_V.centre(),
        edge_s: EDGE_S.centre(),
    };
    let (part, at_hz) = worst(&usual, PWM_PERIOD_S);
    println!("a plant in the middle: {part:.2}, at {at_hz:.0} Hz");
    assert!(part < 0.25, "{part} at {at_hz} Hz");
    // Away from the harmonic, the window averages the beat.
    for (away_hz, most) in [
        (500.0, 0.5),
        (1_450.0, 0.2),
        (5_400.0, 0.04),
        (14_400.0, 0.02),
    ] {
        let free_hz = 46.0 / PWM_PERIOD_S + away_hz;
        let part = added_hz(&corner(), PWM_PERIOD_S, free_hz) / (free_hz * quantisation());
        println!("worst of all plants, {away_hz} Hz from a harmonic: {part:.3}");
        assert!(part < most, "{away_hz}: {part}");
    }
}

#[test]
fn each_measure_is_needed() {
    let without_plane = InterferenceParameters {
        volt_per_volt: WITHOUT_PLANE,
        ..corner()
    };
    let steep = InterferenceParameters {
        edge_s: 0.02e-6,
        ..corner()
    };
    for (what, parameters, period_s) in [
        ("without the plane", without_plane, PWM_PERIOD_S),
        ("steep edges", steep, PWM_PERIOD_S),
        ("twice the frequency", corner(), 0.5 * PWM_PERIOD_S),
    ] {
        let (part, at_hz) = worst(&parameters, period_s);
        println!("{what}: {part:.2} of the quantisation, at {at_hz:.0} Hz");
        assert!(part > 1.0, "{what} is no worse: {part}");
    }
    // Half-way between two harmonics, the plane is still needed.
    let free_hz = 46.4 / PWM_PERIOD_S;
    let part = added_hz(&without_plane, PWM_PERIOD_S, free_hz) / (free_hz * quantisation());
    println!("without the plane, 25 kHz from a harmonic: {part:.1} of the quantisation");
    assert!(part > 3.0, "{part}");
}

#[test]
fn the_copper_plane_is_what_decouples() {
    let sensing = CoilDesign::REFERENCE;
    let at = |above_m: f64, copper_m: f64, frequency_hz: f64| {
        let turns: Vec<_> = drive_turns(above_m).collect();
        mutual_inductance_h(&sensing, &turns, copper_m, frequency_hz)
    };
    // 20.0 µH: docs/field.md, design `air`.
    let own_h = 20.0e-6;
    let bare = at(10e-3, 0.0, 3e6) / own_h;
    assert!((bare / WITHOUT_PLANE - 1.0).abs() < 0.01, "{bare}");
    let range = INTERFERENCE_V_PER_V.range();
    for above_m in [4e-3, 6e-3, 10e-3] {
        let [thick, thin] = [70e-6, 35e-6].map(|copper_m| at(above_m, copper_m, 3e6) / own_h);
        println!("{above_m} m above: {thick:.2e} behind 70 um, {thin:.2e} behind 35 um");
        assert!(thick > 2.0 * range.0 && 2.0 * thick < range.1, "{thick}");
        assert!(2.0 * thin > range.1, "35 um leave no margin: {thin}");
    }
    // A field that changes within milliseconds passes the plane.
    let slow = at(10e-3, 70e-6, 1e3) / at(10e-3, 0.0, 1e3);
    assert!(slow > 0.9, "{slow}");
}

/// The ripple's own frequency: windows cut periods, and the crosstalk follows the square of the
/// current.
#[test]
fn parts_of_a_period_at_the_ends_of_a_window_matter_less_than_quantisation() {
    // 20 µH, 12 V, a duty of one half: 2.4 A of ripple about 12 A, more than the reference coils
    // have.
    let mut circuit = Circuit::new(CircuitParameters {
        limit_a: f64::INFINITY,
        wake_s: 0.0,
        ..CircuitParameters::common(0.4, 20e-6, SUPPLY_V)
    });
    const STEPS: usize = 400;
    let step_s = PWM_PERIOD_S / STEPS as f64;
    let mut squares = Vec::with_capacity(STEPS);
    for period in 0..200 {
        for step in 0..STEPS {
            let at = (step as f64 + 0.5) / STEPS as f64;
            let inputs = edges([960, 480], 960)
                .take_while(|&(from, _)| from <= at)
                .last()
                .map_or([false; 2], |(_, inputs)| inputs);
            let before = circuit.totals().square_a2_s;
            circuit.advance(
                Pins {
                    awake: true,
                    inputs,
                },
                step_s,
            );
            if period == 199 {
                squares.push((circuit.totals().square_a2_s - before) / step_s);
            }
        }
    }
    let mean_a2 = squares.iter().sum::<f64>() / STEPS as f64;
    // Integral over the fraction of a period at the end of a window, for any start.
    let mut most_a2_s: f64 = 0.0;
    for begin in 0..STEPS {
        let mut sum = 0.0;
        for step in 0..STEPS {
            sum += (squares[(begin + step) % STEPS] - mean_a2) * step_s;
            most_a2_s = most_a2_s.max(f64::abs(sum));
        }
    }
    // The largest crosstalk of the reference plants, and the greatest sensitivity of their coil.
    let plant = middle("paper");
    let tank = SensingTank::new(&plant.tank);
    let pressed = tank.resonance(&TankState {
        apparent_m: 0.4e-3,
        displacement_m: 0.4e-3,
        warmer_k: 0.0,
        ..TankState::default()
    });
    let per_m = (pressed.per_apparent / pressed.frequency_hz).abs();
    let m_per_a2 = 11e-6 * 1.3 / (10.0 * 10.0);
    let part = per_m * m_per_a2 * most_a2_s / WINDOW_S / quantisation();
    println!("parts of a period: at most {part:.2} of the quantisation");
    assert!(part < 0.5, "{part}");
}

#[test]
fn a_converter_in_a_world_is_pulled_while_the_bridge_switches() {
    // A current, A, at whose duty the 48th harmonic has no zero.
    const CURRENT_A: f64 = 4.2;
    let mut plant = middle("soft-closed");
    // Strong enough to lock wherever the resonance lies.
    plant.interference.volt_per_volt = 1.0;
    let readings = |switches: Switches, current_a: f64| {
        let shared = SharedWorld::new(world(&plant, switches, Setup::default()));
        let settings = shared.borrow().chip_settings(REFERENCE_HZ);
        let chip = converting(&shared, settings);
        shared.borrow_mut().set_current(current_a);
        shared.borrow_mut().advance_to(ms(50));
        let mut chip = chip.borrow_mut();
        chip.advance_to(ms(50));
        *chip.last_conversion(0).expect("it converts")
    };
    let on = Switches {
        pwm_coupling: true,
        ..Switches::none()
    };
    let free = readings(Switches::none(), CURRENT_A);
    assert_eq!(free.oscillation_hz, free.sensor_hz);
    let still = readings(on, 0.0);
    assert_eq!(still.oscillation_hz, still.sensor_hz, "the bridge rests");
    let locked = readings(on, CURRENT_A);
    // Between two conversions, for 0.4 µs, the oscillation is free; then it locks again.
    let harmonics = locked.oscillation_hz * PWM_PERIOD_S;
    assert!((harmonics - harmonics.round()).abs() < 1e-4, "{harmonics}");
    assert!((locked.sensor_hz - locked.oscillation_hz).abs() > 1.0);
}
