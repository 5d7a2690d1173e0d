//! Plant files: their content and their refusals.

use std::path::Path;

use palpate_sim::scenario::Scenario;
use palpate_sim::sensing_coil::CoilDesign;
use palpate_sim::stack::{Disturbances, Stack, document::FileError, quantity::Quantity};

const ULTRASOFT: &str = include_str!("../../stacks/ultrasoft.toml");
const DISTURBANCES: &str = include_str!("../../stacks/disturbances.toml");

#[test]
fn every_built_in_stack_is_read() {
    for name in Stack::BUILTIN {
        assert_eq!(Stack::builtin(name).expect("it is read").name, name);
    }
    let error = Stack::builtin("paperr").unwrap_err().to_string();
    assert!(error.contains("paper, soft-closed, ultrasoft"), "{error}");
}

#[test]
fn the_numbers_arrive_in_their_fields() {
    let paper = Stack::builtin("paper").unwrap();
    let spread = |nominal| Quantity::Spread {
        nominal,
        spread: 0.2,
    };
    assert_eq!(paper.sensing_spring_n_per_m, spread(55e3));
    assert_eq!(paper.actuated_spring_n_per_m, spread(1070e3));
    assert_eq!(paper.stiffening_at_peak, spread(0.014));
    assert_eq!(paper.field_at_peak_t, Quantity::Fixed(0.0204));
    assert_eq!(paper.field_half_t, Quantity::Fixed(0.30));
    assert_eq!(paper.attraction_n_per_a2, spread(0.29e-3));
    let range = |min, max| Quantity::Uniform { min, max };
    assert_eq!(paper.crosstalk_at_peak_m, range(5e-6, 11e-6));
    assert_eq!(paper.peak_current_a, Quantity::Fixed(10.0));
    assert_eq!(paper.coil_resistance_ohm, Quantity::Fixed(0.389));
    assert_eq!(paper.coil_inductance_h, Quantity::Fixed(40e-6));
    assert_eq!(paper.press_depth_of_sensing_layer_m, range(0.2e-3, 0.4e-3));
}

#[test]
fn the_disturbances_arrive_in_their_fields() {
    let d = Disturbances::builtin().unwrap();
    let range = |min, max| Quantity::Uniform { min, max };
    let log = |min, max| Quantity::LogUniform { min, max };
    assert_eq!(d.crosstalk_relative_slope_per_press_depth, range(-0.3, 0.3));
    assert_eq!(d.attraction_relative_gradient_per_m, range(100.0, 300.0));
    assert_eq!(d.creep.amplitude, range(0.02, 0.10));
    assert_eq!(d.creep.tau_fast_s, log(0.05, 5.0));
    assert_eq!(d.creep.tau_mid_s, log(5.0, 100.0));
    assert_eq!(d.creep.tau_slow_s, log(100.0, 1000.0));
    assert_eq!(d.magnetorheological.memory, range(0.05, 0.20));
    assert_eq!(d.magnetorheological.lag_s, range(0.001, 0.010));
    assert_eq!(
        d.magnetorheological.stiffening_per_kelvin,
        range(-0.005, 0.005)
    );
    assert_eq!(d.magnetorheological.spring_per_kelvin, range(-0.004, 0.001));
    assert_eq!(
        d.thermal.temperature_change_since_calibration_k,
        range(-5.0, 5.0)
    );
    assert_eq!(d.thermal.growth_m_per_k, range(0.3e-6, 1.5e-6));
    assert_eq!(d.thermal.copper_heat_capacity_j_per_k, Quantity::Fixed(0.8));
    assert_eq!(d.thermal.pad_heat_capacity_j_per_k, Quantity::Fixed(60.0));
    assert_eq!(d.thermal.copper_to_pad_k_per_w, Quantity::Fixed(0.5));
    assert_eq!(d.thermal.pad_to_ambient_k_per_w, Quantity::Fixed(8.0));
    assert_eq!(d.tank.coil, CoilDesign::REFERENCE);
    assert_eq!(d.tank.capacitance_f, Quantity::Fixed(330e-12));
    assert_eq!(d.tank.capacitance_tempco_per_k, range(-30e-6, 30e-6));
    assert_eq!(d.ldc.reference_clock_error, range(-50e-6, 50e-6));
    assert_eq!(d.ldc.white_noise_relative, Quantity::Fixed(1e-6));
    assert_eq!(d.current_chain.gain_error, range(-0.02, 0.02));
    assert_eq!(d.current_chain.inl_lsb, Quantity::Fixed(8.0));
    assert_eq!(d.current_chain.noise_lsb_rms, Quantity::Fixed(2.0));
    assert_eq!(d.current_chain.supply_v, range(6.0, 12.0));
    assert_eq!(d.current_chain.supply_resistance_ohm, range(0.05, 0.3));
    assert_eq!(d.press.vibration_amplitude_m, range(0.0, 0.5e-6));
    assert_eq!(d.press.vibration_hz, range(5.0, 120.0));
    assert_eq!(d.press.hand_tremor_amplitude_m, Quantity::Fixed(5e-6));
    assert_eq!(d.press.hand_tremor_hz, range(7.0, 10.0));
    assert_eq!(d.contact.stiffening_lost_per_m2, range(200.0, 12e3));
    assert_eq!(d.contact.radius_m, range(2e-3, 7e-3));
    assert_eq!(d.contact.tilted_share, range(0.4, 0.6));
    assert_eq!(d.calibration_rig.frame_spring_n_per_m, log(500e3, 5000e3));
    assert_eq!(d.calibration_rig.load_cell_noise_n, Quantity::Fixed(1e-3));
    assert_eq!(d.calibration_rig.load_cell_gain_error, range(-0.001, 0.001));
    assert_eq!(d.calibration_rig.stage_error_m, Quantity::Fixed(1e-6));
    assert_eq!(d.calibration_rig.spring_tolerance, Quantity::Fixed(0.01));
    assert_eq!(d.load_ratios_to_sensing_spring, [0.2, 0.5, 1.0, 2.0, 5.0]);
}

/// Error of a text in which one piece of a line was replaced.
fn refused(file: &str, good: &str, from: &str, to: &str) -> FileError {
    assert_eq!(good.matches(from).count(), 1, "{from:?} is there once");
    let bad = good.replacen(from, to, 1);
    let parse = |text: &str| match file {
        "disturbances.toml" => Disturbances::parse(file, text).map(drop),
        _ => Stack::parse(file, text).map(drop),
    };
    parse(good).expect("the text was good before");
    let error = parse(&bad).expect_err(to);
    println!("{error}");
    let line = good.lines().position(|line| line.contains(from.trim()));
    if let Some(line) = line {
        assert_eq!(error.line, line + 1, "{error}");
    }
    assert_eq!(error.file, file);
    error
}

fn stack(from: &str, to: &str) -> FileError {
    refused("ultrasoft.toml", ULTRASOFT, from, to)
}

fn disturbances(from: &str, to: &str) -> FileError {
    refused("disturbances.toml", DISTURBANCES, from, to)
}

#[test]
fn a_value_out_of_range_or_of_another_kind_is_refused_with_place_and_range() {
    for to in [
        "-6000",
        "nan",
        "inf",
        "{ nominal = nan, spread = 0.2 }",
        "{ nominal = -6e3, spread = 0.2 }",
        "{ nominal = 6e3, spread = 1.0 }",
        "{ nominal = 6e3, spread = -0.1 }",
        "{ nominal = 6e3, spread = nan }",
        "{ min = 7e3, max = 6e3 }",
        "{ min = -1.0, max = 6e3 }",
        "{ log_min = 0.0, log_max = 6e3 }",
        "\"6 kN/m\"",
        "true",
        "[6e3]",
        "1979-05-27",
        "{ nominal = 6e3 }",
        "{ nominal = 6e3, spread = 0.2, more = 1 }",
        "{ nominal = 6e3, spraed = 0.2 }",
        "{ nominal = \"6 N/mm\", spread = 0.2 }",
        "{ min = 1e3, log_max = 2e3 }",
        "{}",
    ] {
        let error = stack("{ nominal = 6e3, spread = 0.2 }", to);
        assert_eq!(error.key, "sensing_spring_N_per_m");
        assert!(error.allowed.starts_with("10 to 1e8 N/m"), "{error}");
    }
}

#[test]
fn a_key_in_another_unit_is_unknown() {
    let error = stack("peak_current_A = 10.0", "peak_current_mA = 10e3");
    assert_eq!(error.key, "peak_current_mA");
    assert!(error.problem == "unknown key" && error.allowed.contains("peak_current_A"));
}

fn appended(text: &str) -> FileError {
    let line = DISTURBANCES.lines().count() + 1;
    let error = Disturbances::parse("disturbances.toml", &format!("{DISTURBANCES}{text}\n"))
        .expect_err(text);
    assert_eq!(error.line, line, "{error}");
    error
}

#[test]
fn unknown_sections_and_keys_in_sections_are_refused() {
    assert_eq!(appended("[magic]").key, "magic");
    assert_eq!(appended("moon = 1").key, "load.moon");
    let error = disturbances("tau_mid_s", "tau_middle_s");
    assert_eq!(error.key, "creep.tau_middle_s");
    assert_eq!(error.problem, "unknown key");
    assert!(error.allowed.contains("tau_mid_s"), "{error}");
}

#[test]
fn a_missing_key_is_reported_with_its_range() {
    let bad = ULTRASOFT.replace("field_half_T = 0.25\n", "");
    let error = Stack::parse("ultrasoft.toml", &bad).unwrap_err();
    assert_eq!(
        (error.key.as_str(), error.problem.as_str()),
        ("field_half_T", "missing")
    );
    assert!(error.allowed.starts_with("0.001 to 10 T"), "{error}");
    let error = Disturbances::parse("d.toml", "").unwrap_err();
    assert_eq!(error.key, "crosstalk");
}

/// Files written by Windows editors, device files that never end, and names with control
/// characters.
#[test]
fn files_that_are_no_text_are_refused_with_their_cause() {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mine.toml");
    let load = |bytes: &[u8]| {
        std::fs::write(&file, bytes).unwrap();
        Stack::load(&file).map_err(|error| error.to_string())
    };
    let ultrasoft = Stack::builtin("ultrasoft").unwrap();
    let marked = format!("\u{feff}{ULTRASOFT}");
    assert_eq!(load(marked.as_bytes()).unwrap(), ultrasoft);
    let units = marked.encode_utf16().flat_map(u16::to_le_bytes);
    let latin = ULTRASOFT.replace("ultrasoft", "\u{1}").into_bytes();
    let latin = latin
        .into_iter()
        .map(|byte| if byte == 1 { 0xE4 } else { byte });
    let cases = [
        (units.collect(), "mine.toml:1: it is UTF-16"),
        (latin.collect(), "it is not UTF-8"),
        (vec![b'#'; 3_000_000], "is too large"),
        (
            ULTRASOFT
                .replace("\"ultrasoft\"", r#""a\u001b[2Jb""#)
                .into_bytes(),
            "name: has a control character",
        ),
    ];
    for (bytes, words) in cases {
        let error = load(&bytes).expect_err(words);
        assert!(error.contains(words), "{error}");
    }
    let endless = Stack::load(Path::new("/dev/zero")).unwrap_err().to_string();
    assert!(endless.contains("is too large"), "{endless}");
}

#[test]
fn a_stack_that_a_scenario_does_not_have_is_refused_at_its_line() {
    let text = "disturbances = \"all\"\nstack = \"ultrasof\"\n[[press]]\nload = \"rigid\"\n";
    let error = Scenario::parse("mine.toml", text).unwrap_err().to_string();
    let start = "mine.toml:2: stack: there is no built-in stack \"ultrasof\"; allowed: paper, ";
    assert!(error.starts_with(start), "{error}");
}

#[test]
fn all_keys_that_are_missing_are_reported_at_once() {
    let error = Stack::parse("mine.toml", "field_half_T = 0.25\n").unwrap_err();
    let missing = Stack::KEYS.map(|key| key.name);
    let missing = missing.into_iter().filter(|name| *name != "field_half_T");
    let missing: Vec<_> = core::iter::once("name").chain(missing).collect();
    assert_eq!(error.key, missing.join(", "));
    assert!(error.allowed.contains("palpate stack show"), "{error}");
}

#[test]
fn a_stack_is_read_again_as_it_is_written() {
    let mut stack = Stack::builtin("ultrasoft").unwrap();
    stack.name = "a \"b\" \\ c".to_owned();
    stack.attraction_n_per_a2 = Quantity::Fixed(0.0);
    stack.coil_inductance_h = Quantity::LogUniform {
        min: 1.0 / 3.0 * 1e-5,
        max: 1e-3,
    };
    let stacks = Stack::BUILTIN.map(|name| Stack::builtin(name).unwrap());
    for stack in stacks.into_iter().chain([stack]) {
        let text = stack.file();
        assert_eq!(Stack::parse("x.toml", &text).unwrap(), stack, "{text}");
        for key in Stack::KEYS {
            let comment = format!(
                "# {}: {}\n{} = ",
                key.meaning,
                key.allowed.bounds(),
                key.name
            );
            assert!(text.contains(&comment), "{text}");
        }
    }
}

#[test]
fn the_page_of_the_stack_file_has_every_key() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/stack.md");
    let page = std::fs::read_to_string(page).unwrap();
    let rows = Stack::KEYS.map(|key| {
        let range = key.allowed.bounds();
        format!("| `{}` | {range} | {} |", key.name, key.meaning)
    });
    for row in rows {
        assert!(page.contains(&row), "{row}");
    }
}

#[test]
fn disturbances_out_of_range_are_refused() {
    let ratios = "[0.2, 0.5, 1.0, 2.0, 5.0]";
    for (from, to, key) in [
        ("max = 0.10 }", "max = 1.10 }", "creep.amplitude"),
        ("log_min = 0.05,", "log_min = 0.0,", "creep.tau_fast_s"),
        ("= 330e-12", "= 330", "tank.capacitance_F"),
        (
            "ambient_K_per_W = 8.0",
            "ambient_K_per_W = -8.0",
            "thermal.pad_to_ambient_K_per_W",
        ),
        (
            "{ min = 0.05, max = 0.20 }",
            "nan",
            "magnetorheological.memory",
        ),
        (ratios, "[0.2, -0.5]", "load.ratio_to_sensing_spring"),
        (ratios, "[0.2, nan]", "load.ratio_to_sensing_spring"),
        (ratios, "[]", "load.ratio_to_sensing_spring"),
        (ratios, "0.2", "load.ratio_to_sensing_spring"),
    ] {
        let error = disturbances(from, to);
        assert_eq!(error.key, key);
        assert!(!error.allowed.is_empty());
    }
}

#[test]
fn a_coil_that_is_none_is_refused() {
    for (from, to) in [
        ("25 turns", "25 windings"),
        ("di 4 mm", "di 15 mm"),
        ("do 14 mm", "do -14 mm"),
        ("do 14 mm", "do NaN mm"),
        ("25 turns", "0 turns"),
        ("on both sides", "all around"),
        ("slabs 2 mm", "slabs 2 cm"),
        ("gap 1 mm at rest", "gap 0.01 mm at rest"),
        ("slabs 2 mm, ", ""),
    ] {
        let error = disturbances(from, to);
        assert_eq!(error.key, "tank.coil");
        assert!(error.allowed.contains("do 14 mm"), "{error}");
    }
}

#[test]
fn what_is_no_toml_is_refused_with_its_line() {
    let error = Stack::parse("x.toml", "name = \"x\"\nwhat is this\n").unwrap_err();
    assert_eq!((error.file.as_str(), error.line), ("x.toml", 2));
    let twice = format!("{ULTRASOFT}name = \"again\"\n");
    let error = Stack::parse("x.toml", &twice).unwrap_err();
    assert_eq!(error.line, ULTRASOFT.lines().count() + 1);
}

#[test]
fn a_file_that_is_not_there_says_so() {
    let path = Path::new("nowhere/nothing.toml");
    let error = Stack::load(path).unwrap_err().to_string();
    assert!(error.contains("nothing.toml"), "{error}");
}
