//! Evidence: the results of campaigns that are too long for the test suite.
//!
//! # The contract with a campaign
//!
//! A campaign is a command of this workspace. It may print any text, and prints its result to
//! standard output between a line that ends with [`document::BEGIN`] and a line that is
//! [`document::END`], as Markdown. Its first paragraph is the figure: the result in a sentence or
//! two. Details may follow, some 30 lines at most, if a reader would question the figure; long
//! tables are printed before the first marker. The command exits with success only when its claim
//! holds. Its seed is the argument after `--seed`.
//!
//! `cargo xtask evidence NAME` runs it and writes its row of `docs/evidence/README.md`: claim, figure,
//! command, commit, date, compiler and duration. Where details follow the figure, the page
//! `docs/evidence/NAME.md` has them. A campaign that fails, or prints no result, leaves both as they were.

mod age;
mod document;
mod provenance;

use std::fs;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, bail};

use crate::process::{Invocation, Workspace};
pub(crate) use age::check as check_age;
use document::Record;
pub(crate) use document::{BEGIN, END};
use provenance::Origin;

/// Folder of the results, in the workspace.
const FOLDER: &str = "docs/evidence";
/// Page in that folder with a row for each campaign.
const OVERVIEW: &str = "README.md";

/// A long run whose result is kept.
#[derive(Debug, Clone, Copy)]
struct Campaign {
    /// Name of the campaign and of its page.
    name: &'static str,
    /// Claim that the result shows, in a short sentence or two.
    claim: &'static str,
    /// Arguments of cargo.
    command: &'static str,
    /// Paths of the code that decides the result: when it changes, the result is out of date.
    rests_on: &'static [&'static str],
}

/// Code of the converter's driver on the simulated chip.
const DRIVER: &[&str] = &[
    "drivers/ldc161x/src",
    "drivers/ldc161x-sim/src",
    "tests/src",
];
/// Code that drives the coil.
const COIL: &[&str] = &["drivers/hbridge/src", "tests/src"];
/// Code of the instrument in a simulated world.
const INSTRUMENT: &[&str] = &[
    "drivers",
    "firmware/node",
    "firmware/procedure",
    "host",
    "model/src",
    "sim-host/src",
    "tests/campaigns",
];
/// Code of the native board with its links.
const BOARD: &[&str] = &[
    "drivers",
    "firmware/node",
    "firmware/procedure",
    "firmware/storage",
    "firmware/wire",
    "model/src",
    "sim-host/src",
    "tests/src",
];
/// Code of arrays of sensing coils, simulated and estimated.
const TOUCH: &[&str] = &[
    "host/calibration/src",
    "model/src",
    "sim-host/src",
    "tests/campaigns/src/touch",
];
/// Code of the field solver.
const FIELD: &[&str] = &["model/field", "tests/campaigns/src/field_accuracy.rs"];
/// Code of the search among field designs, and of a simulated sensor.
const FRONT: &[&str] = &[
    "drivers",
    "firmware/node",
    "firmware/procedure",
    "host",
    "model",
    "sim-host/src",
    "tests/campaigns/src/field_front.rs",
];
/// Code of the firmware's image on the emulated board.
const IMAGE: &[&str] = &[
    "drivers",
    "firmware",
    "model/src",
    "sim-host",
    "tests/campaigns/src/image",
];
/// Code of the tool with an emulated board.
const DESK: &[&str] = &["drivers", "firmware", "host", "model/src", "sim-host"];
/// Code that reads files for the tool.
const TOOL_FILES: &[&str] = &[
    "firmware/wire",
    "host",
    "model/field/src",
    "sim-host/src",
    "sim-host/emulator/src",
];
/// The tests, and the code that they test.
const TESTS: &[&str] = &[
    "drivers",
    "firmware",
    "host",
    "model",
    "sim-host",
    "tests",
    "xtask/src/planted",
];

/// Every campaign.
const CAMPAIGNS: &[Campaign] = &[
    Campaign {
        name: "fault-schedules",
        claim: "Under random faults of chip and bus the driver calls no wrong reading good, and recovers.",
        command: "campaign fault-schedules --schedules 200000 --seed 1",
        rests_on: DRIVER,
    },
    Campaign {
        name: "coil-guards",
        claim: "Under random commands, settings, faults and clocks the coil's driver keeps its limits.",
        command: "campaign coil-guards --sequences 100000 --seed 1",
        rests_on: COIL,
    },
    Campaign {
        name: "hostile-bytes",
        claim: "Under random and hostile bytes the instrument answers each command once and keeps the limits of the coil.",
        command: "campaign hostile-bytes --frames 1000000 --seed 1",
        rests_on: BOARD,
    },
    Campaign {
        name: "fuzz",
        claim: "A fuzzer on links, decoders and the storage finds no input that breaks a promise.",
        command: "xtask fuzz --seconds 600 --seed 1",
        rests_on: BOARD,
    },
    Campaign {
        name: "hostile-files",
        claim: "Mutants of every kind of file that the tool reads: how it ends, in what time, and what it changes.",
        command: "--config env.HOSTILE_MUTANTS='500' --config env.HOSTILE_SEED='40001' test --locked -p palpate --test integration -- hostile_files --nocapture",
        rests_on: TOOL_FILES,
    },
    Campaign {
        name: "hostile-connections",
        claim: "Programs that misuse the tool's ports, and fake boards, do not keep it from serving well-behaved ones.",
        command: "--config env.HOSTILE_ATTACKS='500' --config env.HOSTILE_SEED='40001' test --locked -p palpate --test integration -- hostile_connections --nocapture",
        rests_on: DESK,
    },
    Campaign {
        name: "storage",
        claim: "Turned bits, garbage and cuts of power change no stored value unnoticed, and saves wear the flash evenly.",
        command: "campaign storage --seed 1",
        rests_on: &[
            "firmware/storage",
            "firmware/wire/src",
            "tests/campaigns/src/storage.rs",
        ],
    },
    Campaign {
        name: "sigma",
        claim: "The stated standard deviation of a reading is that of the observed spread.",
        command: "campaign sigma --seed 1",
        rests_on: DRIVER,
    },
    Campaign {
        name: "series",
        claim: "In a long series of presses on one sensor every press is detected, and the 95 % intervals hold.",
        command: "campaign series --plants 200 --seed 600001",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "claims",
        claim: "The 95 % intervals of the stiffness hold on sensors that were each calibrated on their own bench.",
        command: "run --release -p palpate-simulate -- campaign --plants 200 --seed 2210001 --loads 0.1,0.2,0.5,1,2,5,10,block",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "temperatures",
        claim: "The 95 % intervals of the stiffness hold on sensors that were calibrated at two temperatures, 20 K apart.",
        command: "run --release -p palpate-simulate -- campaign --plants 200 --seed 2200001 --temperatures 2",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "worlds",
        claim: "What an estimate is worth if sensor, load or surroundings differ from what the calibration saw.",
        command: "run --release -p palpate-simulate -- campaign --plants 12 --seed 710001 --all-worlds",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "checked-worlds",
        claim: "What an estimate is worth if sensor, load or surroundings differ from what the calibration saw, after a check by a spring that is known to 1 %.",
        command: "run --release -p palpate-simulate -- campaign --plants 12 --seed 710001 --all-worlds --check-spring",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "untouched-worlds",
        claim: "What an estimate is worth if sensor, load or surroundings differ from what the calibration saw, after checks by a train on the untouched sensor and by a known spring.",
        command: "run --release -p palpate-simulate -- campaign --plants 12 --seed 710001 --all-worlds --check-untouched --check-spring",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "budget",
        claim: "Each part of the claimed uncertainty against the scatter of the error that it stands for, after a bench at two temperatures.",
        command: "campaign budget --plants 60 --seed 1250001 --temperatures 2",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "ablation",
        claim: "What each part of the chain is worth: the same presses with a part added or left out.",
        command: "campaign ablation --plants 16 --seed 870001",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "modulus",
        claim: "The 95 % intervals of Young's modulus hold, under pins and balls, on thick objects and on layers.",
        command: "campaign modulus --plants 40 --seed 1441001",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "efficiency",
        claim: "Errors of the whole chain, from bench to press, against the Cramer-Rao bound.",
        command: "campaign efficiency --plants 40 --seed 810001",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "misfit",
        claim: "The line fitted to a train of ramps is straight if the calibrated stiffening is right. A press with a disturbance that bends it, and that the calibration lacked, is refused, or its interval still contains the truth.",
        command: "campaign misfit --plants 17 --seed 660001",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "relaxation",
        claim: "Objects that relax: the 95 % intervals contain their stiffness at the train's rate, or the press is refused; the relaxation is off by no more than its standard error says.",
        command: "campaign relaxation --plants 12 --seed 2600201",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "springs",
        claim: "A calibration by springs alone beside one with a load cell; how close good sessions come to the limits of the bench's checks.",
        command: "campaign springs --plants 50 --seed 30001",
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "touch",
        claim: "Place, force and radius of presses on simulated arrays of sensing coils, each calibrated on its own bench.",
        command: "campaign touch --sensors 300 --seed 1700001",
        rests_on: TOUCH,
    },
    Campaign {
        name: "field-accuracy",
        claim: "The field solver's estimated errors cover the true ones on every built-in design.",
        command: "campaign field-accuracy",
        rests_on: FIELD,
    },
    Campaign {
        name: "field-front",
        claim: "The best field design found for each coil power, and the errors of the stiffness with one of them.",
        command: "campaign field-front --plants 30 --seed 1",
        rests_on: FRONT,
    },
    Campaign {
        name: "field-peers",
        claim: "The field solver beside NGSolve and GetDP: agreement and time.",
        command: "campaign field-peers",
        rests_on: &["model/field/src", "tests/campaigns/src/field_peers"],
    },
    Campaign {
        name: "touch-peers",
        claim: "Contacts of the simulated touch sensors beside ContactMechanics and published solutions: forces and areas of balls and pins within 1 %.",
        command: "campaign touch-peers",
        rests_on: &["sim-host/src/touch", "tests/campaigns/src/touch_peers"],
    },
    Campaign {
        name: "planted-defects",
        claim: "Tests of the tests: each planted defect turns a test red.",
        command: "xtask planted-defects",
        rests_on: TESTS,
    },
    Campaign {
        name: "image-faults",
        claim: "The firmware recovers from faults of bus and converter, and turns the bridge off after a crash during a ramp, both within their limits.",
        command: "campaign image-faults",
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-storage",
        claim: "Settings and calibration in the flash of the image withstand cuts of power and flipped bits; a save delays nothing.",
        command: "campaign image-storage",
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-rates",
        claim: "Rates, latencies and losses of the image.",
        command: "campaign image-rates",
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-starts",
        claim: "After starts of the converter and changes of settings every time stamp is right or its sample marked.",
        command: "campaign image-starts",
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-usb",
        claim: "At a USB host the image streams, answers and starts again, while the coil is driven.",
        command: "campaign image-usb --seed 1",
        rests_on: IMAGE,
    },
    Campaign {
        name: "coil-current",
        claim: "The firmware keeps the coil's current within its limits: over resistance, inductance and supply, before calibration, weeks apart, and under full telemetry.",
        command: "campaign coil-current",
        rests_on: IMAGE,
    },
    Campaign {
        name: "acceptance",
        claim: "From nothing to a calibrated reading, by the commands that a user types, on emulated boards.",
        command: "campaign acceptance --boards 5 --seed 1",
        rests_on: DESK,
    },
    Campaign {
        name: "recordings",
        claim: "Recordings of emulated boards are whole after ten minutes, after a kill and on a full disk, and replay to the bit.",
        command: "campaign recordings --seed 4001",
        rests_on: DESK,
    },
    Campaign {
        name: "image-cost",
        claim: "What the image costs of processor, flash and memory.",
        command: "campaign image-cost --seed 1",
        rests_on: IMAGE,
    },
];

impl Campaign {
    fn invocation(&self) -> Invocation {
        Invocation::cargo(&self.command.split(' ').collect::<Vec<_>>())
    }
}

/// Prints every campaign with its claim and command.
pub(crate) fn list() {
    for campaign in CAMPAIGNS {
        println!("{}: {}", campaign.name, campaign.claim);
        println!("    $ {}", campaign.invocation());
    }
}

/// Whether a campaign of this name exists.
pub(crate) fn exists(name: &str) -> bool {
    CAMPAIGNS.iter().any(|campaign| campaign.name == name)
}

/// Runs a campaign and keeps its result.
pub(crate) fn collect(workspace: &Workspace, name: &str) -> Result<()> {
    let Some(campaign) = CAMPAIGNS.iter().find(|campaign| campaign.name == name) else {
        let known: Vec<_> = CAMPAIGNS.iter().map(|campaign| campaign.name).collect();
        bail!(
            "there is no campaign `{name}`; the campaigns are {}",
            known.join(", ")
        );
    };
    // Read before the run, which builds this state of the sources.
    let origin = Origin::read(workspace, FOLDER)?;
    let invocation = campaign.invocation();
    write(
        workspace,
        &perform(workspace, campaign, &invocation, origin)?,
    )
}

/// Writes the row and the page of a campaign.
fn write(workspace: &Workspace, record: &Record) -> Result<()> {
    let folder = workspace.root().join(FOLDER);
    let overview = folder.join(OVERVIEW);
    let text = fs::read_to_string(&overview)
        .with_context(|| format!("{FOLDER}/{OVERVIEW} could not be read"))?;
    let page = folder.join(format!("{}.md", record.name));
    if !record.details.is_empty() {
        fs::write(&page, record.page())?;
    } else if page.exists() {
        fs::remove_file(&page)?;
    }
    fs::write(
        &overview,
        document::with_row(&text, record.name, &record.row()),
    )?;
    println!("written: the row of {} in {FOLDER}/{OVERVIEW}", record.name);
    Ok(())
}

/// Runs a campaign and returns its result.
fn perform(
    workspace: &Workspace,
    campaign: &Campaign,
    invocation: &Invocation,
    origin: Origin,
) -> Result<Record> {
    let start = Instant::now();
    let printed = workspace
        .observe(invocation, Command::stdout)
        .context("a campaign ends with success only when its claim holds, so nothing is written")?;
    let (figure, details) = document::result(&printed)
        .with_context(|| format!("`{invocation}` printed no usable result"))?;
    Ok(Record {
        name: campaign.name,
        claim: campaign.claim,
        command: invocation.to_string(),
        origin,
        seconds: start.elapsed().as_secs(),
        figure,
        details,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn perform_script(script: &str) -> Result<Record> {
        let workspace = Workspace::find(None).unwrap();
        let origin = Origin {
            commit: "0123abcd".to_owned(),
            date: "2026-02-03".to_owned(),
            toolchain: "rustc 1.95.0".to_owned(),
        };
        let campaign = Campaign {
            name: "trial",
            claim: "A trial.",
            command: "",
            rests_on: &["xtask/src"],
        };
        let invocation = Invocation::new("sh", &["-c", script]);
        perform(&workspace, &campaign, &invocation, origin)
    }

    /// Script that prints a result among other lines.
    fn result() -> String {
        format!("printf 'progress\\n{BEGIN}\\n3 of 3.\\n\\n## Schedules\\n{END}\\nmore\\n'")
    }

    #[test]
    fn a_campaign_is_kept_with_its_command_and_result() {
        let record = perform_script(&result()).unwrap();
        assert!(record.command.starts_with("sh -c"), "{record:?}");
        assert_eq!(record.figure, "3 of 3.");
        assert_eq!(record.details, "## Schedules");
    }

    /// Pages are short enough for one engineer to read all of them.
    #[test]
    fn pages_are_short_and_every_campaign_has_one_row() {
        let folder = Workspace::find(None).unwrap().root().join(FOLDER);
        let overview = fs::read_to_string(folder.join(OVERVIEW)).unwrap();
        for Campaign { name, claim, .. } in CAMPAIGNS {
            let rows = overview
                .lines()
                .filter(|line| line.contains(&format!(": {claim} | ")));
            assert!(rows.count() <= 1, "{name}");
            if let Ok(page) = fs::read_to_string(folder.join(format!("{name}.md"))) {
                assert!(page.lines().count() <= 45, "{name}");
                assert!(
                    overview.contains(&format!("| [{name}]({name}.md): {claim} | ")),
                    "{name}"
                );
            }
        }
    }

    #[test]
    fn a_campaign_that_fails_or_prints_no_result_gives_no_text() {
        for (script, cause) in [
            (result() + "; exit 1", "nothing is written"),
            ("true".to_owned(), "no usable result"),
        ] {
            let message = format!("{:#}", perform_script(&script).unwrap_err());
            assert!(message.contains(cause), "{message}");
        }
    }

    #[test]
    fn an_unknown_campaign_is_an_error_that_names_the_known_ones() {
        let workspace = Workspace::find(None).unwrap();
        let error = collect(&workspace, "no-such").unwrap_err().to_string();
        assert!(error.contains("fault-schedules"), "{error}");
    }

    #[test]
    fn every_campaign_states_its_seed_and_has_a_name_of_its_own() {
        /// Campaigns without random numbers, or with fixed seeds of their own.
        const WITHOUT_CHANCE: &[&str] = &[
            "planted-defects",
            "field-accuracy",
            "field-peers",
            "touch-peers",
            "image-faults",
            "image-rates",
            "image-starts",
            "image-storage",
            "coil-current",
            "hostile-files",
            "hostile-connections",
        ];
        for (index, campaign) in CAMPAIGNS.iter().enumerate() {
            let seeded = campaign.command.contains("--seed ");
            let chance = !WITHOUT_CHANCE.contains(&campaign.name);
            assert_eq!(seeded, chance, "{}", campaign.name);
            assert!(
                CAMPAIGNS[..index].iter().all(|c| c.name != campaign.name),
                "{}",
                campaign.name
            );
        }
    }
}
