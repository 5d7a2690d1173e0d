//! Evidence: the results of campaigns that are too long for the test suite.
//!
//! # The contract with a campaign
//!
//! A campaign is a command of this workspace that is free to print what it likes, and prints its
//! result to standard output between a line that ends with [`document::BEGIN`] and a line that is
//! [`document::END`], as Markdown with headings of the second level or below. It exits with
//! success only when its claim holds. Its seed is the argument after `--seed`.
//!
//! `cargo xtask evidence NAME` runs it and writes `docs/evidence/NAME.md`: what was run, on which
//! commit, with which toolchain and when, and the result as the campaign printed it. A campaign
//! that fails, or prints no result, leaves the file as it was.

mod age;
mod document;
mod provenance;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::time::Instant;

use anyhow::{Context, Result, bail};

use crate::process::{Invocation, Workspace};
pub(crate) use age::check as check_age;
use document::Record;
pub(crate) use document::{BEGIN, END};
use provenance::Origin;

/// The folder of the results, in the workspace.
const FOLDER: &str = "docs/evidence";

/// A long run whose result is kept.
#[derive(Debug, Clone, Copy)]
struct Campaign {
    /// Its name, and the name of its file.
    name: &'static str,
    /// What its result shows.
    purpose: &'static str,
    /// What it runs.
    runs: Runs,
    /// The code that decides its result: when it changes, the page is out of date.
    rests_on: &'static [&'static str],
}

/// What a campaign runs.
#[derive(Debug, Clone, Copy)]
enum Runs {
    /// The tool, with these arguments.
    Tool(&'static [&'static str]),
    /// The program of all campaigns, with these.
    Campaign(&'static [&'static str]),
    /// Cargo, with these.
    Cargo(&'static [&'static str]),
}

/// How cargo runs the tool.
const TOOL: &[&str] = &["run", "--release", "-p", "palpate", "--"];
/// How it runs the campaigns.
const CAMPAIGN: &[&str] = &["run", "--release", "-p", "palpate-campaigns", "--"];

/// What the converter's driver does against the simulated chip.
const DRIVER: &[&str] = &[
    "drivers/ldc161x/src",
    "drivers/ldc161x-sim/src",
    "tests/src",
];
/// What drives the coil.
const COIL: &[&str] = &["drivers/hbridge/src", "tests/src"];
/// The instrument in a simulated world.
const INSTRUMENT: &[&str] = &[
    "drivers",
    "firmware/node",
    "firmware/procedure",
    "host",
    "model/src",
    "sim-host/src",
    "tests/campaigns",
];
/// The native board on its links.
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
/// The field solver.
const FIELD: &[&str] = &["model/field", "tests/campaigns/src/field_accuracy.rs"];
/// The search among fields, and a simulated sensor.
const FRONT: &[&str] = &[
    "drivers",
    "firmware/node",
    "firmware/procedure",
    "host",
    "model",
    "sim-host/src",
    "xtask/src/field_front.rs",
];
/// The firmware's image on the emulated board.
const IMAGE: &[&str] = &[
    "drivers",
    "firmware",
    "model/src",
    "sim-host",
    "tests/campaigns/src/image",
];
/// The tool at an emulated board.
const DESK: &[&str] = &["drivers", "firmware", "host", "model/src", "sim-host"];
/// All that reads files for the tool.
const TOOL_FILES: &[&str] = &[
    "firmware/wire",
    "host",
    "model/field/src",
    "sim-host/src",
    "sim-host/emulator/src",
];
/// The tests, and what they test.
const TESTS: &[&str] = &[
    "drivers",
    "firmware",
    "host",
    "model",
    "sim-host",
    "tests",
    "xtask/src/planted/mod.rs",
    "xtask/src/planted",
];

/// Every campaign.
const CAMPAIGNS: &[Campaign] = &[
    Campaign {
        name: "fault-schedules",
        purpose: "The driver under random schedules of chip and bus faults.",
        runs: Runs::Campaign(&["fault-schedules", "--schedules", "200000", "--seed", "1"]),
        rests_on: DRIVER,
    },
    Campaign {
        name: "coil-guards",
        purpose: "The coil's driver under random commands, settings, faults and clocks: what its limits let through.",
        runs: Runs::Campaign(&["coil-guards", "--sequences", "100000", "--seed", "1"]),
        rests_on: COIL,
    },
    Campaign {
        name: "hostile-bytes",
        purpose: "The instrument under whatever bytes come over its links: what is answered, and what the coil \
                  carries meanwhile.",
        runs: Runs::Campaign(&["hostile-bytes", "--frames", "1000000", "--seed", "1"]),
        rests_on: BOARD,
    },
    Campaign {
        name: "fuzz",
        purpose: "A fuzzer on what takes bytes: the instrument's links, the decoders, and the storage over any \
                  contents of its flash.",
        runs: Runs::Cargo(&["xtask", "fuzz", "--seconds", "600", "--seed", "1"]),
        rests_on: BOARD,
    },
    Campaign {
        name: "hostile-files",
        purpose: "Mutants of every kind of file that the tool reads: how it ends, in what time, and what it changes.",
        runs: Runs::Cargo(&[
            "--config",
            "env.HOSTILE_MUTANTS='500'",
            "--config",
            "env.HOSTILE_SEED='40001'",
            "test",
            "--locked",
            "-p",
            "palpate",
            "--test",
            "integration",
            "--",
            "hostile_files",
            "--nocapture",
        ]),
        rests_on: TOOL_FILES,
    },
    Campaign {
        name: "hostile-connections",
        purpose: "Programs that misuse the tool's ports, and false boards: whether those that behave are served after.",
        runs: Runs::Cargo(&[
            "--config",
            "env.HOSTILE_ATTACKS='500'",
            "--config",
            "env.HOSTILE_SEED='40001'",
            "test",
            "--locked",
            "-p",
            "palpate",
            "--test",
            "integration",
            "--",
            "hostile_connections",
            "--nocapture",
        ]),
        rests_on: DESK,
    },
    Campaign {
        name: "storage",
        purpose: "Settings and calibration in the flash: every bit turned, garbage, pairs of power cuts, and the \
                  wear of many saves.",
        runs: Runs::Campaign(&["storage", "--seed", "1"]),
        rests_on: &[
            "firmware/storage",
            "firmware/wire/src",
            "tests/campaigns/src/storage.rs",
        ],
    },
    Campaign {
        name: "sigma",
        purpose: "The stated standard deviation against the spread that is observed.",
        runs: Runs::Campaign(&["sigma", "--seed", "1"]),
        rests_on: DRIVER,
    },
    Campaign {
        name: "series",
        purpose: "Presses in a row, in a world that goes on: contacts, refusals and intervals.",
        runs: Runs::Campaign(&["series", "--plants", "200", "--seed", "600001"]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "claims",
        purpose: "How often the 95 % intervals of the stiffness hold, on simulated sensors that were \
                  each calibrated on their own bench.",
        runs: Runs::Tool(&[
            "campaign",
            "--plants",
            "500",
            "--seed",
            "920001",
            "--loads",
            "0.1,0.2,0.5,1,2,5,10,block",
        ]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "temperatures",
        purpose: "The same, of sensors that were calibrated at two temperatures, 20 K apart.",
        runs: Runs::Tool(&[
            "campaign",
            "--plants",
            "300",
            "--seed",
            "930001",
            "--temperatures",
            "2",
        ]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "worlds",
        purpose: "What a press is worth where something is another than on the bench: each sensor presses in all \
                  worlds that the campaign knows.",
        runs: Runs::Tool(&[
            "campaign",
            "--plants",
            "12",
            "--seed",
            "710001",
            "--all-worlds",
        ]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "checked-worlds",
        purpose: "The same after a check of each calibration, in its world, by a spring that is known to 1 %.",
        runs: Runs::Tool(&[
            "campaign",
            "--plants",
            "12",
            "--seed",
            "710001",
            "--all-worlds",
            "--check-spring",
        ]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "untouched-worlds",
        purpose: "The same after both checks: by a train on the untouched sensor, and by a known spring.",
        runs: Runs::Tool(&[
            "campaign",
            "--plants",
            "12",
            "--seed",
            "710001",
            "--all-worlds",
            "--check-untouched",
            "--check-spring",
        ]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "ablation",
        purpose: "What each part of the chain is worth: errors and intervals of the same sensors with a bench at one \
                  and at two temperatures, with and without a check, and with parts left out.",
        runs: Runs::Campaign(&["ablation", "--plants", "16", "--seed", "870001"]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "efficiency",
        purpose: "Errors of the whole chain, from bench to press, against the Cramer-Rao bound of what bench and press \
                  read, and where the rest is lost.",
        runs: Runs::Campaign(&["efficiency", "--plants", "40", "--seed", "810001"]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "misfit",
        purpose: "What a press is worth whose disturbance the calibration left out: how many are refused as misfits, \
                  and how often the others' intervals hold.",
        runs: Runs::Campaign(&["misfit", "--plants", "17", "--seed", "660001"]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "springs",
        purpose: "A calibration by springs alone beside one with a load cell, on the same sensors: errors and \
                  coverage; and what good sessions come to in the checks that refuse bad ones.",
        runs: Runs::Campaign(&["springs", "--plants", "50", "--seed", "30001"]),
        rests_on: INSTRUMENT,
    },
    Campaign {
        name: "field-accuracy",
        purpose: "The field solver on every built-in design: estimated against true errors, profiles, forces, energy.",
        runs: Runs::Campaign(&["field-accuracy"]),
        rests_on: FIELD,
    },
    Campaign {
        name: "field-front",
        purpose: "The best design of the field for each power, from 20 starts; what one of them is worth where \
                  stiffness is measured.",
        runs: Runs::Cargo(&["xtask", "field-front", "--plants", "30", "--seed", "1"]),
        rests_on: FRONT,
    },
    Campaign {
        name: "planted-defects",
        purpose: "Tests of the tests: each planted defect has to turn a test red.",
        runs: Runs::Cargo(&["xtask", "planted-defects"]),
        rests_on: TESTS,
    },
    Campaign {
        name: "image-faults",
        purpose: "Faults of bus and converter and crashes in mid-ramp, on the firmware's image.",
        runs: Runs::Campaign(&["image-faults"]),
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-storage",
        purpose: "Settings and calibration in the flash of the firmware's image: cuts of power at every \
                  operation, bits that flip, and all that goes on beside a save.",
        runs: Runs::Campaign(&["image-storage"]),
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-rates",
        purpose: "Rates, latencies and losses of the firmware's image.",
        runs: Runs::Campaign(&["image-rates"]),
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-starts",
        purpose: "Time stamps of the firmware's image after starts of the converter and changes of settings.",
        runs: Runs::Campaign(&["image-starts"]),
        rests_on: IMAGE,
    },
    Campaign {
        name: "image-usb",
        purpose: "The firmware's image at a USB host: streams, interruptions, control transfers of any kind, \
                  rubbish, new starts, while the coil is driven.",
        runs: Runs::Campaign(&["image-usb", "--seed", "1"]),
        rests_on: IMAGE,
    },
    Campaign {
        name: "coil-current",
        purpose: "The coil's current as the firmware's image drives it: steps and ramps over resistance, \
                  inductance and supply, errors before calibration and over weeks, two minutes of full \
                  telemetry.",
        runs: Runs::Campaign(&["coil-current"]),
        rests_on: IMAGE,
    },
    Campaign {
        name: "acceptance",
        purpose: "From nothing to a calibrated reading, by the commands that a user types: `calibrate sensor`, then \
                  `measure` in another process, on emulated boards.",
        runs: Runs::Campaign(&["acceptance", "--boards", "5", "--seed", "1"]),
        rests_on: DESK,
    },
    Campaign {
        name: "recordings",
        purpose: "Recordings of emulated boards: for ten minutes, killed at random times, on a full disk, and \
                  replayed.",
        runs: Runs::Campaign(&["recordings", "--seed", "4001"]),
        rests_on: DESK,
    },
    Campaign {
        name: IMAGE_COST,
        purpose: "What the firmware's image costs of processor, flash and memory, by its parts.",
        runs: Runs::Campaign(&["image-cost", "--seed", "1"]),
        rests_on: IMAGE,
    },
];

/// The campaign that `cargo xtask bench-image` runs.
pub(crate) const IMAGE_COST: &str = "image-cost";

impl Campaign {
    fn invocation(&self) -> Invocation {
        match self.runs {
            Runs::Tool(arguments) => Invocation::cargo(&[TOOL, arguments].concat()),
            Runs::Campaign(arguments) => Invocation::cargo(&[CAMPAIGN, arguments].concat()),
            Runs::Cargo(arguments) => Invocation::cargo(arguments),
        }
    }
}

/// Prints every campaign with its purpose and command.
pub(crate) fn list() {
    for campaign in CAMPAIGNS {
        println!("{}: {}", campaign.name, campaign.purpose);
        println!("    $ {}", campaign.invocation());
    }
}

/// Whether there is such a campaign.
pub(crate) fn exists(name: &str) -> bool {
    CAMPAIGNS.iter().any(|campaign| campaign.name == name)
}

/// Runs a campaign and writes its file.
pub(crate) fn collect(workspace: &Workspace, name: &str) -> Result<()> {
    let Some(campaign) = CAMPAIGNS.iter().find(|campaign| campaign.name == name) else {
        let known: Vec<_> = CAMPAIGNS.iter().map(|campaign| campaign.name).collect();
        bail!(
            "there is no campaign `{name}`; the campaigns are {}",
            known.join(", ")
        );
    };
    // Read before the run: it is this state of the sources that the run builds.
    let origin = Origin::read(workspace, FOLDER)?;
    let invocation = campaign.invocation();
    let text = perform(workspace, campaign, &invocation, origin)?;
    write(workspace, name, &text)
}

/// Keeps the result of a campaign that is a verb of its own, since it needs programs from elsewhere.
pub(crate) fn keep(
    workspace: &Workspace,
    name: &str,
    purpose: &str,
    command: &str,
    rests_on: &[&str],
    campaign: impl FnOnce() -> Result<String>,
) -> Result<()> {
    let origin = Origin::read(workspace, FOLDER)?;
    let start = Instant::now();
    let result = campaign()?;
    let record = Record {
        name,
        verb: name.to_owned(),
        purpose,
        command: command.to_owned(),
        seed: None,
        origin,
        rests_on,
        seconds: start.elapsed().as_secs(),
    };
    write(workspace, name, &record.render(&result))
}

/// Writes the file of a campaign.
fn write(workspace: &Workspace, name: &str, text: &str) -> Result<()> {
    let folder = workspace.root().join(FOLDER);
    fs::create_dir_all(&folder).with_context(|| format!("{FOLDER} could not be created"))?;
    fs::write(folder.join(format!("{name}.md")), text)
        .with_context(|| format!("{FOLDER}/{name}.md could not be written"))?;
    println!("written: {FOLDER}/{name}.md");
    Ok(())
}

/// Runs a campaign and returns the text of its file.
fn perform(
    workspace: &Workspace,
    campaign: &Campaign,
    invocation: &Invocation,
    origin: Origin,
) -> Result<String> {
    let start = Instant::now();
    let printed = observe(workspace, invocation)?;
    let record = Record {
        name: campaign.name,
        verb: format!("evidence {}", campaign.name),
        purpose: campaign.purpose,
        command: invocation.to_string(),
        seed: seed(invocation),
        origin,
        rests_on: campaign.rests_on,
        seconds: start.elapsed().as_secs(),
    };
    let result = document::result(&printed)
        .with_context(|| format!("`{invocation}` printed no usable result"))?;
    Ok(record.render(result))
}

/// Runs a command, shows its output as it comes, and returns what went to standard output.
fn observe(workspace: &Workspace, invocation: &Invocation) -> Result<String> {
    println!("$ {invocation}");
    let mut child = invocation
        .command(workspace)
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| invocation.cannot_start())?;
    let stdout = child
        .stdout
        .take()
        .context("the campaign's standard output was not captured")?;
    let mut printed = String::new();
    for line in BufReader::new(stdout).lines() {
        let line =
            line.with_context(|| format!("the output of `{invocation}` could not be read"))?;
        println!("{line}");
        printed.push_str(&line);
        printed.push('\n');
    }
    let status = child
        .wait()
        .with_context(|| format!("the end of `{invocation}` was not seen"))?;
    if !status.success() {
        bail!(
            "`{invocation}` failed ({status}); a campaign ends with success only when its claim \
             holds, so nothing is written"
        );
    }
    Ok(printed)
}

/// The argument after `--seed`.
fn seed(invocation: &Invocation) -> Option<String> {
    let arguments = invocation.arguments();
    let at = arguments.iter().position(|argument| argument == "--seed")?;
    arguments.get(at + 1).cloned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::env;

    /// Tells the test below to be a campaign, and of which kind.
    const KIND: &str = "XTASK_FAKE_CAMPAIGN";

    /// Does nothing, unless it is run as a campaign by the tests that follow.
    #[test]
    fn fake_campaign() {
        let kind = env::var(KIND).unwrap_or_default();
        if kind == "sound" || kind == "failing" {
            println!("progress, which is not kept");
            println!("{BEGIN}");
            println!("## Result\n\n3 of 3 schedules recovered.");
            println!("{END}");
            println!("more that is not kept");
        }
        if kind == "failing" {
            std::process::exit(1);
        }
    }

    /// Runs this test program as a campaign.
    fn perform_fake(kind: &'static str) -> Result<String> {
        let program = env::current_exe().unwrap();
        let test = "evidence::tests::fake_campaign";
        let invocation =
            Invocation::new(program.to_str().unwrap(), &["--nocapture", "--exact", test]);
        let workspace = Workspace::find(None).unwrap();
        let origin = Origin {
            commit: "0123abcd".to_owned(),
            date: "2026-02-03".to_owned(),
            toolchain: "rustc 1.95.0".to_owned(),
        };
        let invocation = invocation.with_env(KIND, kind);
        let campaign = Campaign {
            name: "trial",
            purpose: "A trial.",
            runs: Runs::Cargo(&[]),
            rests_on: &["xtask/src"],
        };
        perform(&workspace, &campaign, &invocation, origin)
    }

    #[test]
    fn a_campaign_is_wrapped_with_its_origin() {
        let text = perform_fake("sound").unwrap();
        assert!(
            text.starts_with("# Evidence: trial\n\nA trial.\n"),
            "{text}"
        );
        assert!(text.contains("fake_campaign"), "{text}");
        assert!(text.contains("| Commit | 0123abcd |"), "{text}");
        assert!(text.contains("| Rests on | `xtask/src` |"), "{text}");
        assert!(
            text.ends_with("\n## Result\n\n3 of 3 schedules recovered.\n"),
            "{text}"
        );
        assert!(!text.contains("not kept"), "{text}");
    }

    #[test]
    fn a_campaign_that_fails_or_prints_no_result_gives_no_text() {
        for (kind, cause) in [
            ("failing", "nothing is written"),
            ("silent", "no usable result"),
        ] {
            let message = format!("{:#}", perform_fake(kind).unwrap_err());
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
        /// Campaigns that draw no random numbers, or those of seeds of their own.
        const WITHOUT_CHANCE: &[&str] = &[
            "planted-defects",
            "field-accuracy",
            "image-faults",
            "image-rates",
            "image-starts",
            "image-storage",
            "coil-current",
            "hostile-files",
            "hostile-connections",
        ];
        for (index, campaign) in CAMPAIGNS.iter().enumerate() {
            let seeded = seed(&campaign.invocation()).is_some();
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
