//! `cargo campaign field-front`: the best design for each power, and the benefit of one of them.
//!
//! The tool searches the front. The front's design with the power nearest to that of the existing
//! design is driven at exactly that power, written to a stack file, and pressed on the same springs
//! in the same simulated worlds as the existing design. Prints its result for `cargo xtask evidence
//! field-front`.

use std::fs;

use clap::Args;
use palpate_cli::failure::Failure;
use serde_json::Value;

use crate::{evidence, tool};

/// Search the best field designs for each power, and press with one of them; writes
/// docs/images/field-front.svg
#[derive(Args)]
pub(crate) struct Arguments {
    /// Number of sensors of each design
    #[arg(long, default_value_t = 30)]
    plants: u32,
    /// Seed of the first sensor
    #[arg(long, default_value_t = 1)]
    seed: u32,
}

/// Folder of the stack files of both designs.
const FOLDER: &str = "target/field-front";
/// The picture: its path from the workspace's folder, and its path relative to the page.
const PICTURE: [&str; 2] = ["docs/images/field-front.svg", "../images/field-front.svg"];
/// Named design to be improved.
const DESIGN: &str = "closed";
const ELASTOMER: &str = "soft";
/// Power of the design [`DESIGN`] at its own current, W.
const POWER_W: f64 = 9.7;
/// Varied parameters of the design, with their bounds. A disc of 8 mm would touch the boards.
const VARIED: [&str; 2] = ["parameters.disc=4..7.9", "parameters.rim=1..8"];
/// Height limit: that of [`DESIGN`], 10.28 mm, with its rounding.
const HEIGHT: [&str; 2] = ["--most-height", "10.29"];
/// Stiffness of the pressed loads, in units of the sensing spring.
const LOADS: &str = "0.5,1,2";

/// A design, given by its differences from [`DESIGN`].
struct Changed {
    name: &'static str,
    settings: Vec<String>,
}

/// Runs everything and prints the result.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    fs::create_dir_all(FOLDER)?;
    let front = front()?;
    let better = nearest(&front, POWER_W)?;
    let designs = [
        Changed {
            name: DESIGN,
            settings: Vec::new(),
        },
        Changed {
            name: "the best found",
            settings: settings(better)?,
        },
    ];
    println!("{}", table_of_front(&front)?);
    println!("Both at equal power and height:");
    for design in &designs {
        println!("{}:\n{}", design.title(), figures(design)?);
    }
    let mut text = format!(
        "Of {} designs from {} starts the best at {:.1} W has a disc of {:.1} mm, a rim of {:.1} mm and a merit of {:.5}, `{DESIGN}` one of {:.5}.\n\n\
         ![Merit against power: the best found, and the design as it is]({})\n\n\
         {} sensors each from seed {}, all disturbances, each calibrated \
         on its own simulated bench; loads in units of the sensing spring c_S. Errors are ln(estimate/truth).\n\n\
         | design | load | estimated | refused | hold | RMS error | median half width |\n|---|---|---|---|---|---|---|\n",
        front["designs"],
        front["starts"],
        float(&better["power_W"])?,
        number_of(better, "parameters.disc")?,
        number_of(better, "parameters.rim")?,
        float(&better["figure"])?,
        float(&better["figure_as_it_is"])?,
        PICTURE[1],
        arguments.plants,
        arguments.seed,
    );
    for design in &designs {
        text.push_str(&presses(design, arguments)?);
    }
    evidence::print(&text);
    Ok(())
}

impl Changed {
    /// Title of the design: its name and parameters.
    fn title(&self) -> String {
        let numbers = self.settings.join(", ");
        let with = if numbers.is_empty() { "" } else { ": " };
        format!("{}{with}{numbers}", self.name)
    }

    /// Arguments of the tool for this design.
    fn arguments(&self) -> Vec<&str> {
        let set = self.settings.iter();
        let set = set.flat_map(|setting| ["--set", setting.as_str()]);
        [DESIGN].into_iter().chain(set).collect()
    }
}

/// Runs the tool and returns its output.
fn output(arguments: &[&str]) -> Result<String, Failure> {
    println!("    $ palpate {}", arguments.join(" "));
    tool::printed(&mut tool::command(arguments)?)
}

fn front() -> Result<Value, Failure> {
    let vary = VARIED.iter().flat_map(|varied| ["--vary", varied]);
    let search = [
        "field", "front", DESIGN, "--goal", "merit", "--power", "2..20", "--starts", "20",
    ];
    let result = ["--mse", ELASTOMER, "--picture", PICTURE[0], "--json"];
    let arguments: Vec<&str> = search
        .into_iter()
        .chain(HEIGHT)
        .chain(vary)
        .chain(result)
        .collect();
    Ok(serde_json::from_str(&output(&arguments)?)?)
}

/// Figures of a design, as the search prints them for its starting point.
fn figures(design: &Changed) -> Result<String, Failure> {
    let vary = VARIED.iter().flat_map(|varied| ["--vary", varied]);
    let search = ["--mse", ELASTOMER, "--budget", "1"];
    let arguments: Vec<&str> = ["field", "optimise"]
        .into_iter()
        .chain(design.arguments())
        .chain(vary)
        .chain(search)
        .collect();
    let printed = output(&arguments)?;
    let (_, figures) = printed
        .split_once("the best found\n")
        .ok_or_else(|| missing("figures of a design"))?;
    // The last line belongs to the search.
    let lines = figures.lines().filter(|line| line.starts_with("  "));
    Ok(lines.map(|line| format!("{line}\n")).collect())
}

/// Presses the design; returns a table row for each load.
fn presses(design: &Changed, arguments: &Arguments) -> Result<String, Failure> {
    let file = format!("{FOLDER}/{}.toml", design.name.replace(' ', "-"));
    let mut stack = vec!["field", "stack"];
    stack.extend(design.arguments());
    stack.extend(["--mse", ELASTOMER, "--out", &file]);
    output(&stack)?;
    let (plants, seed) = (arguments.plants.to_string(), arguments.seed.to_string());
    let campaign = ["campaign", "--stack", &file, "--loads", LOADS];
    let sensors = ["--plants", &plants, "--seed", &seed, "--json"];
    let world: Value = serde_json::from_str(&output(&[campaign, sensors].concat())?)?;
    let bins = world["bins"]
        .as_array()
        .ok_or_else(|| missing("bins of the campaign"))?;
    let rows = bins.iter().map(|bin| {
        let share = |key: &str| percent(bin, key);
        format!(
            "| {} | {} c_S | {} | {} | {} | {} | {} |\n",
            design.name,
            bin["ratio"],
            bin["accepted"],
            bin["refused"],
            share("coverage95"),
            share("rms_ln"),
            share("half_width_ln"),
        )
    });
    Ok(rows.collect())
}

/// Failure to find something in the tool's output.
fn missing(what: &str) -> Failure {
    Failure::Refused(format!("the tool printed no {what}"))
}

/// A share in per cent; empty without a value.
fn percent(bin: &Value, key: &str) -> String {
    let share = bin[key].as_f64();
    share.map_or(String::new(), |share| format!("{:.2} %", 100.0 * share))
}

/// Table of the front, to 1e-4, beside the unchanged design at the same power.
fn table_of_front(front: &Value) -> Result<String, Failure> {
    let mut text = String::from(
        "| power, W | current, A | disc, mm | rim, mm | merit eps w_D w_L | of the design as it is |\n|---|---|---|---|---|---|\n",
    );
    for design in designs_of(front)? {
        let number = |name: &str| number_of(design, name);
        let [current, disc, rim] =
            ["conductor.current_A", "parameters.disc", "parameters.rim"].map(number);
        text.push_str(&format!(
            "| {:.2} | {:.2} | {:.2} | {:.2} | {:.5} | {:.5} |\n",
            float(&design["power_W"])?,
            current?,
            disc?,
            rim?,
            float(&design["figure"])?,
            float(&design["figure_as_it_is"])?,
        ));
    }
    Ok(text)
}

fn designs_of(front: &Value) -> Result<&Vec<Value>, Failure> {
    front["front"].as_array().ok_or_else(|| missing("front"))
}

fn float(value: &Value) -> Result<f64, Failure> {
    value
        .as_f64()
        .ok_or_else(|| missing("number where the front has one"))
}

/// Value of a design parameter, by its path.
fn number_of(design: &Value, path: &str) -> Result<f64, Failure> {
    let numbers = design["numbers"].as_array();
    let found = numbers.and_then(|all| all.iter().find(|number| number[0] == path));
    float(&found.ok_or_else(|| missing(path))?[1])
}

/// Design of the front with the nearest power, on a logarithmic scale.
fn nearest(front: &Value, power_w: f64) -> Result<&Value, Failure> {
    let distance = |design: &&Value| {
        let power = design["power_W"].as_f64().unwrap_or(f64::INFINITY);
        (power / power_w).ln().abs()
    };
    designs_of(front)?
        .iter()
        .min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .ok_or_else(|| missing("design of a front"))
}

/// Varied parameters of a design, as arguments of the tool. The current is left as it is.
fn settings(design: &Value) -> Result<Vec<String>, Failure> {
    ["parameters.disc", "parameters.rim"]
        .into_iter()
        .map(|path| Ok(format!("{path}={}", number_of(design, path)?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_design_of_nearest_power_gives_its_numbers_but_not_its_current() {
        let design = |power_w: f64, disc: f64| json!({ "power_W": power_w, "numbers": [["parameters.disc", disc], ["parameters.rim", 2.5], ["conductor.current_A", 4.0]] });
        let front = json!({ "front": [design(4.0, 5.0), design(9.0, 6.0), design(20.0, 7.0)] });
        let found = nearest(&front, 9.7).unwrap();
        let expected = ["parameters.disc=6", "parameters.rim=2.5"].map(str::to_owned);
        assert_eq!(settings(found).unwrap(), expected);
    }
}
