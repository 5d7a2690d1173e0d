//! `palpate plan-touch` as its users call it.

use assert_cmd::Command;
use serde_json::Value;

fn palpate(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("plan-touch")
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_layout_is_a_table_with_what_is_known_least() {
    let output = palpate(&["three-around-one"]);
    assert!(output.status.success());
    insta::assert_snapshot!(String::from_utf8(output.stdout).unwrap());
}

#[test]
fn a_layout_is_json_with_a_map_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("touch.svg");
    let map = map.to_str().unwrap();
    let output = palpate(&["seven", "--json", "--plot", map]);
    let touch: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(touch["coils"], 7);
    assert_eq!(touch["converters"], 2);
    let contacts = touch["contacts"].as_array().unwrap();
    assert_eq!(contacts.len(), 2);
    for contact in contacts {
        let all = contact["within_all"].as_f64().unwrap();
        assert!((0.9..=1.0).contains(&all), "{all}");
        assert!(all <= contact["radius_ln"]["within"].as_f64().unwrap());
    }
    assert!(std::fs::read_to_string(map).unwrap().starts_with("<svg"));
}

#[test]
fn the_shown_file_is_the_layout_and_a_square_of_it_does_not_separate() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let text = String::from_utf8(palpate(&["three-around-one", "--show"]).stdout).unwrap();
    std::fs::write(&file, &text).unwrap();
    let path = file.to_str().unwrap();
    let own = palpate(&[path, "--json"]).stdout;
    assert_eq!(own, palpate(&["three-around-one", "--json"]).stdout);
    // Four coils at the corners of a square of 10 mm.
    let mut square = text
        .replace("\"disc\"", "\"hull\"")
        .replace("margin_m = -2.8e-3", "margin_m = 0.0");
    for (from, to) in [
        ("x_m = 0.0\ny_m = 0.0", "x_m = 5e-3\ny_m = 5e-3"),
        ("x_m = 0.0\ny_m = 5.6e-3", "x_m = -5e-3\ny_m = 5e-3"),
        ("x_m = 4.850e-3\ny_m = -2.8e-3", "x_m = 5e-3\ny_m = -5e-3"),
        ("x_m = -4.850e-3\ny_m = -2.8e-3", "x_m = -5e-3\ny_m = -5e-3"),
    ] {
        assert!(square.contains(from), "{from}");
        square = square.replace(from, to);
    }
    std::fs::write(&file, square).unwrap();
    let said = String::from_utf8(palpate(&[path]).stdout).unwrap();
    assert!(said.contains("leave a combination undetermined"), "{said}");
    assert!(said.contains("changes no reading"), "{said}");
    let touch: Value = serde_json::from_slice(&palpate(&[path, "--json"]).stdout).unwrap();
    assert!(touch["contacts"][0]["undetermined"].as_u64() > Some(50));
    assert!(touch["contacts"][0]["force_ln"]["worst"].is_null());
}

#[test]
fn what_cannot_be_is_refused_with_what_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let text = String::from_utf8(palpate(&["seven", "--show"]).stdout).unwrap();
    std::fs::write(&file, text.replace("poisson = 0.5", "poisson = 0.6")).unwrap();
    let small = folder.path().join("small.toml");
    std::fs::write(&small, text.replace("margin_m = 0.0", "margin_m = -7e-3")).unwrap();
    let [file, small] = [&file, &small].map(|path| path.to_str().unwrap());
    for (arguments, code, part) in [
        (&["nosuch"][..], 2, "three-around-one, seven"),
        (&["no/such.toml"], 2, "no/such.toml"),
        (
            &[file],
            2,
            "layer.poisson: 0.6 is out of range; allowed: 0 to 0.5",
        ),
        (&[small], 1, "raise margin_m"),
        (&["seven", "--place", "0"], 2, "1e-4 to 100 mm"),
        (&["seven", "--show", "--json"], 2, "cannot be used with"),
    ] {
        let output = palpate(arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(message.contains(part), "{message}");
    }
}
