//! `palpate field` as its users call it.

use std::f64::consts::PI;
use std::process::Output;

use assert_cmd::Command;
use palpate_sim::stack::Stack;
use serde_json::Value;

fn palpate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("field")
        .args(arguments)
        .output()
        .unwrap()
}

fn printed(arguments: &[&str]) -> String {
    let output = palpate(arguments);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {complaint}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&printed(arguments)).unwrap()
}

/// Exit code and message of a refused command.
fn refused(arguments: &[&str]) -> (Option<i32>, String) {
    let output = palpate(arguments);
    assert!(output.stdout.is_empty(), "{arguments:?}");
    let complaint = String::from_utf8(output.stderr).unwrap();
    (output.status.code(), complaint)
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no {key}"))
}

/// A copper plane mirrors the coil's field, which lowers the inductance; its eddy currents absorb
/// power, which adds to the coil's resistance.
#[test]
fn a_copper_plane_lowers_inductance_and_quality_of_the_sensing_coil() {
    let copper = "material.plane.conductivity_S_per_m=5.8e7";
    let at = |arguments: &[&str]| {
        let asked = ["ac", "sensing", "--frequency", "3e6", "--json"];
        let solved = json(&[&asked[..], arguments].concat());
        assert_eq!(solved[0]["reached"], true);
        solved[0]["coils"][0].clone()
    };
    let [without, with] = [&[][..], &["--set", copper]].map(at);
    for key in ["inductance_H", "quality"] {
        assert!(number(&with, key) < 0.999 * number(&without, key), "{key}");
    }
    let shares = &with["resistance_by_part_ohm"];
    let sum: f64 = shares
        .as_object()
        .unwrap()
        .values()
        .map(|share| share.as_f64().unwrap())
        .sum();
    assert!((sum / number(&with, "resistance_ohm") - 1.0).abs() < 1e-9);
    assert!(number(shares, "plane") > 0.0);
    let (code, complaint) = refused(&["ac", "sensing", "--frequency", "3e6", "--coil", "x"]);
    assert_eq!(code, Some(2));
    assert!(
        complaint.contains("no coil is named \"x\"; allowed: sensing"),
        "{complaint}"
    );
}

/// Of two designs on a front, the one with more power has the smaller error.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn no_design_on_a_front_beats_another() {
    let asked = [
        "front", "closed", "--power", "5..10", "--starts", "2", "--budget", "4",
    ];
    let varied = [
        "--vary",
        "parameters.rim=4..5",
        "--accuracy",
        "1e-2",
        "--json",
    ];
    let front = json(&[&asked[..], &varied].concat());
    let front: Vec<[f64; 2]> = (front["front"].as_array().unwrap().iter())
        .map(|design| ["power_W", "figure"].map(|key| number(design, key)))
        .collect();
    let better = |pair: &[[f64; 2]]| pair[0][0] < pair[1][0] && pair[0][1] > pair[1][1];
    assert!(front.len() > 1 && front.windows(2).all(better), "{front:?}");
    assert!(
        front.iter().all(|[power, _]| (4.99..10.01).contains(power)),
        "{front:?}"
    );
}

#[test]
fn figures_of_a_design_as_json() {
    let solved = json(&["solve", "backplates", "--current", "10", "--json"]);
    for key in [
        "centre_T_per_A",
        "core_mean_T_per_A",
        "cv_r8",
        "cv_r6",
        "cv_r4",
        "axial_pp",
        "radial_pp",
        "inductance_H",
        "force_N_per_A2",
        "resistance_ohm",
        "error_estimate",
        "unknowns",
    ] {
        assert!(number(&solved, key) > 0.0, "{key}");
    }
    let driven = &solved["at_current"];
    for key in ["core_mean_T", "plate_max_T", "linkage_Wb"] {
        assert!(number(driven, key) > 0.0, "{key}");
        assert!(number(&driven["errors"], key) > 0.0, "error of {key}");
    }
    assert!((number(driven, "centre_T") - 0.0644).abs() < 1e-4);
    assert!((number(&solved, "resistance_ohm") - 0.389).abs() < 1e-3);
    assert!(number(&solved, "error_estimate") <= 1e-4);
    assert!(number(driven, "newton_iterations") <= 6.0);
    let small = json(&["solve", "air", "--accuracy", "1e-5", "--json"]);
    assert!((number(&small, "centre_T_per_A") / 1012.9492e-6 - 1.0).abs() < 1e-5);
    assert!(small.get("at_current").is_none());
    // Coils in series: the total is the sum of their inductances and those of all pairs.
    let matrix = json(&["solve", "air", "--matrix", "--json"]);
    let rows = matrix["inductances"]["rows_H"].as_array().unwrap();
    let entries = rows.iter().flat_map(|row| row.as_array().unwrap());
    let sum: f64 = entries.map(|henry| henry.as_f64().unwrap()).sum();
    assert!(
        (sum / number(&matrix, "inductance_H") - 1.0).abs() < 1e-3,
        "{sum}"
    );
    assert_eq!(rows.len(), 4);
}

#[test]
fn a_background_stands_in_figures_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field.toml");
    let text = "name = \"ball\"\nlength_unit = \"mm\"\n[background]\nfield_T = 1e-3\n\
        [core]\nr = 5.0\nx = [-5.0, 5.0]\n[material.m]\nmu_r = 3.7\n\
        [[body]]\nname = \"b\"\nmaterial = \"m\"\n\
        shape = { centre_x = 0.0, semi_r = 10.0, semi_x = 10.0 }\n";
    std::fs::write(&path, text).unwrap();
    let file = path.to_str().unwrap();
    // A sphere in a uniform field: B = 3 mu/(mu + 2) B0.
    let solved = json(&["solve", file, "--json"]);
    assert!((number(&solved, "centre_T") / (11.1e-3 / 5.7) - 1.0).abs() < 1e-4);
    assert!(solved.get("centre_T_per_A").is_none());
    let (code, complaint) = refused(&["solve", file, "--current", "1"]);
    assert_eq!(code, Some(2));
    assert!(complaint.contains("add a [[coil]]"), "{complaint}");
    std::fs::write(&path, text.replace("field_T = 1e-3", "field_T = 0")).unwrap();
    let (code, complaint) = refused(&["solve", file]);
    assert_eq!(code, Some(2));
    assert!(
        complaint.contains("there is no source of a field"),
        "{complaint}"
    );
    let within = printed(&["show", "closed"]) + "\n[background]\nfield_T = 0.01\n";
    std::fs::write(&path, within).unwrap();
    let (code, complaint) = refused(&["stack", file, "--mse", "soft"]);
    assert_eq!(code, Some(1));
    assert!(complaint.contains("remove [background]"), "{complaint}");
}

#[test]
fn magnets_need_no_coil() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("magnets.toml");
    let ball = |name: &str, centre_x: f64| {
        format!(
            "[[plate]]\nname = \"{name}\"\nmaterial = \"magnet\"\n\
             shape = {{ centre_x = {centre_x}, semi_r = 3.0, semi_x = 3.0 }}\n"
        )
    };
    let text = "name = \"balls\"\nlength_unit = \"mm\"\n[core]\nr = 1.0\nx = [4.0, 6.0]\n\
        [material.magnet]\nmu_r = 1.0\nremanence_T = 1.2\n"
        .to_owned();
    std::fs::write(&path, text + &ball("low", 0.0) + &ball("high", 10.0)).unwrap();
    let file = path.to_str().unwrap();
    let solved = json(&["solve", file, "--force", "low", "--json"]);
    // Dipoles: 8 pi/3 a^6 B_r^2/(mu0 d^4).
    let exact_n = 8.0 * PI / 3.0 * 3e-3_f64.powi(6) * 1.44 / (4e-7 * PI * 1e-8);
    let force_n = solved["forces"][0]["force_N"].as_f64().unwrap();
    assert!(
        (force_n / exact_n - 1.0).abs() < 1e-3,
        "{force_n} {exact_n}"
    );
    let least_t = solved["magnets"][1]["least_B_T"].as_f64().unwrap();
    assert!(
        (0.8..0.9).contains(&least_t),
        "two thirds of 1.2 T and more: {least_t}"
    );
    let shown = printed(&["solve", file]);
    assert!(shown.starts_with("balls, with the magnets\n"), "{shown}");
    assert!(shown.contains("  magnet high "), "{shown}");
    let (code, complaint) = refused(&["solve", file, "--current", "1"]);
    assert_eq!(code, Some(2));
    assert!(complaint.contains("add a [[coil]]"), "{complaint}");
}

#[test]
fn a_profile_as_csv() {
    let axis = printed(&[
        "profile", "air", "--along", "axis", "--csv", "--points", "3",
    ]);
    let lines: Vec<&str> = axis.lines().collect();
    assert_eq!(lines[0], "mm,B_T_per_A,Bx_T_per_A,Br_T_per_A");
    assert_eq!(lines.len(), 4);
    let middle: Vec<f64> = lines[2].split(',').map(|n| n.parse().unwrap()).collect();
    assert!((middle[0] - 4.14).abs() < 1e-6);
    assert!((middle[1] / 1012.9492e-6 - 1.0).abs() < 1e-4);
    let line = ["--from", "0", "--to", "8", "--points", "9", "--csv"];
    for along in ["radius@x=4.14", "parallel@r=4"] {
        let mut arguments = vec!["profile", "A", "--along", along];
        arguments.extend(line);
        assert_eq!(printed(&arguments).lines().count(), 10, "{along}");
    }
    let (code, complaint) = refused(&["profile", "A", "--along", "radius"]);
    assert_eq!(code, Some(2));
    assert!(complaint.contains("radius@x=MM"), "{complaint}");
}

#[test]
fn pictures_with_axes_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    printed(&["figures", "C1in", "--out", out]);
    for (kind, words) in [
        ("map", ["r / mm", "|B| / mT/A"]),
        ("axial", ["x / mm", "|B| / mT/A"]),
        ("radial", ["r / mm", "|B| / mT/A"]),
    ] {
        let text = std::fs::read_to_string(folder.path().join(format!("C1in-{kind}.svg"))).unwrap();
        assert!(text.ends_with("</svg>\n"), "{kind}");
        for words in words {
            assert!(text.contains(words), "{kind}: {words}");
        }
    }
}

#[test]
fn a_sweep_keeps_every_point() {
    // A gap of zero gives no design; the row states this in its last column.
    let csv = printed(&[
        "sweep",
        "B1",
        "--accuracy",
        "1e-3",
        "--vary",
        "parameters.gap=0..6:3",
    ]);
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let heads = reader.headers().unwrap().clone();
    let column = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3);
    assert!(rows[0][column("refused")].contains("gap"), "{:?}", rows[0]);
    let mean = |row: usize| {
        rows[row][column("core_mean_T_per_A")]
            .parse::<f64>()
            .unwrap()
    };
    assert!(mean(1) > mean(2));
    let (code, complaint) = refused(&["sweep", "B1", "--vary", "parameters.width=1..2:3"]);
    assert_eq!(code, Some(2), "{complaint}");
    assert!(complaint.contains("there: gap"), "{complaint}");
    let none = palpate(&["sweep", "B1", "--vary", "parameters.gap=-2..-1:2"]);
    assert_eq!(none.status.code(), Some(1));
    assert_eq!(String::from_utf8(none.stdout).unwrap().lines().count(), 3);
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_optimum_within_bounds() {
    let text = printed(&[
        "optimise",
        "B1",
        "--goal",
        "homogeneity",
        "--accuracy",
        "1e-2",
        "--vary",
        "parameters.gap=4..6",
        "--budget",
        "7",
    ]);
    let gap = text
        .lines()
        .find_map(|line| line.strip_prefix("parameters.gap = "));
    // The number may be followed by a comma and the remark that it is at a bound.
    let gap: f64 = gap.unwrap().split(',').next().unwrap().parse().unwrap();
    assert!((4.0..=6.0).contains(&gap));
    assert!(text.contains("std/mean of |B| in the core"), "{text}");
    // The search starts with the user's own design, and keeps limits and comments.
    let search = |budget: &str, more: &[&str]| {
        let mut arguments = vec![
            "optimise",
            "closed",
            "--goal",
            "merit",
            "--accuracy",
            "1e-2",
        ];
        arguments.extend(["--vary", "parameters.disc=7..7.9", "--budget", budget]);
        arguments.extend(more);
        palpate(&arguments)
    };
    let found = search("1", &[]);
    let text = String::from_utf8(found.stdout).unwrap();
    let first = text.lines().next().unwrap();
    assert!(first.contains("merit eps w_D w_L 2.1"), "{text}");
    assert!(first.contains("parameters.disc=7.5"), "{text}");
    let text = String::from_utf8(search("3", &["--print"]).stdout).unwrap();
    assert!(text.contains("# radius of the elastomer"), "{text}");
    let beyond = search("1", &["--most-power", "9"]);
    assert_eq!(beyond.status.code(), Some(1));
    let text = String::from_utf8(beyond.stdout).unwrap();
    assert!(text.contains("9.7264 W, above the limit of 9"), "{text}");
    let (code, complaint) = refused(&[
        "optimise",
        "closed",
        "--goal",
        "merit",
        "--vary",
        "parameters.disc=4..5",
    ]);
    assert_eq!(code, Some(2));
    assert!(complaint.contains("the design has 7.5"), "{complaint}");
}

#[test]
fn an_optimisation_leads_to_the_error_that_is_planned() {
    let search = |design: &str, more: &[&str]| {
        let vary = match design {
            "A" => "parameters.gap=5..6",
            _ => "parameters.disc=7..7.9",
        };
        let arguments = [
            "optimise",
            design,
            "--accuracy",
            "1e-2",
            "--budget",
            "1",
            "--vary",
            vary,
        ];
        palpate(&[&arguments[..], more].concat())
    };
    // `palpate field stack closed --mse soft --out closed.toml` and `palpate plan closed.toml` give
    // 7.67 % at c_S.
    for goal in [&[][..], &["--goal", "merit"]] {
        let text = String::from_utf8(search("closed", goal).stdout).unwrap();
        let planned = "error of stiffness  0.0767";
        assert!(
            text.contains(planned) && text.contains("merit eps w_D w_L   0.021"),
            "{text}"
        );
        let last = text.lines().last().unwrap();
        assert_eq!(
            last.starts_with("expected error"),
            goal.is_empty(),
            "{last}"
        );
    }
    let refused = search("A", &[]);
    assert_eq!(refused.status.code(), Some(1));
    let reason = String::from_utf8(refused.stderr).unwrap();
    assert!(
        reason.contains("stiffens too little") && reason.contains("--goal merit"),
        "{reason}"
    );
    let text = String::from_utf8(search("A", &["--goal", "merit"]).stdout).unwrap();
    assert!(text.contains("error of stiffness  no plan"), "{text}");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_inductance_has_one_name() {
    let solved = printed(&["solve", "air", "--matrix", "--accuracy", "1e-3"]);
    assert!(solved.contains("  inductance L  "), "{solved}");
    assert!(solved.contains("inductance L of each coil"), "{solved}");
    let compared = printed(&["compare", "air", "--accuracy", "1e-3"]);
    let heads: Vec<_> = compared
        .lines()
        .next()
        .unwrap()
        .split_whitespace()
        .collect();
    assert!(
        heads.contains(&"L") && !heads.contains(&"linkage"),
        "{compared}"
    );
    // At a current the figure is a flux linkage, not an inductance.
    let driven = printed(&["compare", "air", "--current", "1", "--accuracy", "1e-3"]);
    assert!(
        driven.contains("linkage") && driven.contains("uWb"),
        "{driven}"
    );
    let sensing = printed(&["sensing", "--gap", "1"]);
    assert!(
        sensing.starts_with("L ") && sensing.contains("L uH"),
        "{sensing}"
    );
    for asked in [
        &["solve", "air", "--json"][..],
        &["sensing", "--gap", "1", "--json"],
        &[
            "ac",
            "sensing",
            "--frequency",
            "1e6",
            "--json",
            "--accuracy",
            "1e-3",
        ],
        &[
            "stack",
            "closed",
            "--mse",
            "soft",
            "--json",
            "--accuracy",
            "1e-2",
        ],
    ] {
        let text = json(asked).to_string();
        assert!(text.contains("inductance_H\":"), "{text}");
    }
}

#[test]
fn designs_side_by_side() {
    let both = json(&["compare", "A", "C1in", "--json", "--accuracy", "1e-3"]);
    // The paper's third claim: plates make the field in the inner part of the core homogeneous.
    assert!(number(&both[1], "cv_r4") < 0.05 * number(&both[0], "cv_r4"));
    let table = printed(&["compare", "A", "B1", "--accuracy", "1e-3"]);
    assert!(table.contains("uT/A") && table.contains("B1"), "{table}");
}

#[test]
fn stacks_that_the_plant_takes() {
    let folder = tempfile::tempdir().unwrap();
    let stack = |design: &str, mse: &str| {
        let path = folder.path().join(format!("{design}.toml"));
        printed(&[
            "stack",
            design,
            "--mse",
            mse,
            "--accuracy",
            "1e-3",
            "--out",
            path.to_str().unwrap(),
        ]);
        Stack::load(&path).unwrap()
    };
    let own = folder.path().join("mse.toml");
    std::fs::write(&own, "modulus_Pa = 1e5\nrise = 3.0\nhalf_T = 0.30\n").unwrap();
    // The file contains the numbers of soft elastomer, so both give the same springs.
    let paper = stack("A", own.to_str().unwrap());
    assert!((paper.actuated_spring_n_per_m.centre() / 1.07e6 - 1.0).abs() < 0.01);
    assert!((paper.sensing_spring_n_per_m.centre() / 55e3 - 1.0).abs() < 0.01);
    assert!((paper.attraction_n_per_a2.centre() / 0.29e-3 - 1.0).abs() < 0.02);
    let closed = stack("closed", "soft");
    let power =
        |stack: &Stack| stack.peak_current_a.centre().powi(2) * stack.coil_resistance_ohm.centre();
    assert!(power(&closed) <= power(&paper));
    let rise = closed.stiffening_at_peak.centre() / paper.stiffening_at_peak.centre();
    assert!(rise > 50.0, "{rise}");
    let file = std::fs::read_to_string(folder.path().join("A.toml")).unwrap();
    let printed = json(&[
        "stack",
        "A",
        "--mse",
        "soft",
        "--accuracy",
        "1e-3",
        "--json",
    ]);
    let law = printed["with_current"].as_array().unwrap();
    let last = law.last().unwrap();
    assert!(file.contains("# With current:"), "{file}");
    assert!((number(last, "stiffening") - paper.stiffening_at_peak.centre()).abs() < 1e-6);
}

/// Every command prints which files it reads (a table and a drawing), and where the field exceeds
/// the table. A table in other units is refused.
#[test]
fn files_of_a_design_and_fields_beyond_a_table_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let steel = "0;0\n100;0,4\n200;1,0\n500;1,3\n1000;1,45\n5000;1,62\n";
    std::fs::write(path("steel.csv"), steel).unwrap();
    let groups = "0 SECTION 2 ENTITIES 0 ARC 8 0 10 0 20 0 40 5 50 270 51 90 0 ENDSEC 0 EOF";
    std::fs::write(path("ball.dxf"), groups.replace(' ', "\n")).unwrap();
    let text = "name = \"ball\"\nlength_unit = \"mm\"\n[background]\nfield_T = 0.7\n\
        [core]\nr = 1.0\nx = [-1.0, 1.0]\n[material.steel]\nbh_table = \"steel.csv\"\n\
        [[plate]]\nname = \"ball\"\nmaterial = \"steel\"\nshape = { outline_dxf = \"ball.dxf\", layer = \"0\" }\n";
    std::fs::write(path("ball.toml"), text).unwrap();
    let file = path("ball.toml").display().to_string();
    let read = [
        "steel.csv: 6 points to 1.62 T at 5000 A/m",
        "ball.dxf: layer \"0\": r 0.000 to 5.000 mm, x -5.000 to 5.000 mm, 2 sides; unit by length_unit",
        "ball reaches 1.776 T, 0.156 T beyond the table of steel, which ends at 1.62 T: there B rises as in vacuum",
    ];
    let shown = printed(&["solve", &file]);
    let profile = palpate(&["profile", &file, "--along", "axis", "--csv"]);
    let said = String::from_utf8(profile.stderr).unwrap();
    for words in read {
        assert!(shown.contains(words), "{words}: {shown}");
        assert!(said.contains(words), "{words}: {said}");
    }
    let solved = json(&["solve", &file, "--json"]);
    assert_eq!(solved["files"].as_array().unwrap().len(), 2);
    let beyond = &solved["beyond_tables"][0];
    assert_eq!(beyond["part"], "ball");
    // A ball of polarisation J has the background plus two thirds of J. Beyond the table J stays at
    // the value of the table's end.
    let ball_t = 0.7 + 2.0 / 3.0 * (1.62 - 4e-7 * PI * 5e3);
    let greatest_t = number(beyond, "greatest_B_T");
    assert!((greatest_t / ball_t - 1.0).abs() < 1e-3, "{beyond}");
    let within = ["solve", &file, "--set", "background.field_T=0.3", "--json"];
    assert!(json(&within).get("beyond_tables").is_none());
    for (table, words) in [
        (
            "0 0\n0.4 100\n1.0 200\n1.3 500\n",
            "B in T before H in A/m: swap the columns",
        ),
        (
            "0 0\n1.2566 4000\n12.566 14500\n62.83 16200\n",
            "H in Oe and B in G",
        ),
    ] {
        std::fs::write(path("steel.csv"), table).unwrap();
        let (code, complaint) = refused(&["solve", &file]);
        assert_eq!(code, Some(2));
        assert!(
            complaint.contains("steel.csv, line 2: B of "),
            "{complaint}"
        );
        assert!(complaint.contains(words), "{complaint}");
    }
}

/// Names plates without a conductivity; refuses a stack file of a design with a sensing coil.
#[test]
fn what_a_design_leaves_out_is_said() {
    let ac = [
        "ac",
        "closed-sensing",
        "--frequency",
        "1e5",
        "--accuracy",
        "1e-2",
    ];
    let insulating = ["--set", "material.permalloy.conductivity_S_per_m=0"];
    let said = "no currents are induced in them: ";
    assert!(!printed(&ac).contains(said));
    let printed = printed(&[&ac[..], &insulating].concat());
    assert!(printed.contains(said), "{printed}");
    let (code, refused) = refused(&["stack", "closed-sensing", "--mse", "soft"]);
    assert_eq!(code, Some(1));
    assert!(
        refused.contains("carries no current, and a stack's sensing coil"),
        "{refused}"
    );
}

#[test]
fn refusals_name_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    let shown = printed(&["show", "A"]);
    let line = |needle: &str| 1 + shown.lines().position(|l| l.contains(needle)).unwrap();
    for (from, to, words, line) in [
        ("length_unit = \"mm\"", "", "length_unit: missing", 1),
        (
            "material = \"mse\"",
            "material = \"steel\"",
            "unknown material \"steel\". Allowed: mse",
            line("material = \"mse\""),
        ),
        (
            "r = [8.0, 28.0]\nx = [0.0, 1.64]",
            "r = [8.0, 8.0]\nx = [0.0, 1.64]",
            "has zero thickness",
            line("r = [8.0, 28.0]"),
        ),
        (
            "x = [0.0, 0.07]",
            "x = [-0.01, 0.06]",
            "overlaps board \"lower\"",
            line("[[coil]]"),
        ),
        (
            "x = [0.0, 0.07]",
            "x = [-0.0705, -0.0005]",
            "leaves a gap",
            line("[[coil]]"),
        ),
    ] {
        std::fs::write(&path, shown.replacen(from, to, 1)).unwrap();
        let (code, complaint) = refused(&["solve", path.to_str().unwrap()]);
        assert_eq!(code, Some(2), "{complaint}");
        let index = format!("mine.toml, line {line}: ");
        assert!(complaint.contains(&index), "{complaint}");
        assert!(complaint.contains(words), "{complaint}");
    }
    let (code, complaint) = refused(&["solve", "D7"]);
    assert_eq!(code, Some(2));
    assert!(complaint.contains("air, A, A0"), "{complaint}");
    // The message about a changed number names the user's own line.
    std::fs::write(&path, format!("# mine\n{shown}")).unwrap();
    let file = path.to_str().unwrap();
    let (code, complaint) = refused(&["solve", file, "--set", "parameters.gap=0"]);
    assert_eq!(code, Some(2), "{complaint}");
    let index = format!("mine.toml, line {}: core.x: ", 1 + line("x = [1.64,"));
    assert!(complaint.contains(&index), "{complaint}");
    assert!(complaint.contains("with parameters.gap=0"), "{complaint}");
    let (code, complaint) = refused(&["solve", "/dev/zero"]);
    assert_eq!(code, Some(2), "{complaint}");
    assert!(complaint.contains("not a regular file"), "{complaint}");
    std::fs::write(&path, "modulus_Pa = 1e5\nrise = -3.0\nhalf_T = 0.30\n").unwrap();
    let (code, complaint) = refused(&["stack", "A", "--mse", path.to_str().unwrap()]);
    assert_eq!(code, Some(2));
    assert!(complaint.contains("line 2: rise is -3"), "{complaint}");
}
