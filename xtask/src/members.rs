//! Properties of each crate of the workspace, for the gate.
//!
//! A new crate is registered only here. `cargo xtask deps` fails while a crate has no row here,
//! while a row has no crate, and while a row leaves out a feature of its crate, so no crate and no
//! feature escapes the gate.

/// Microcontroller targets: the least capable supported core, and one with an FPU.
pub(crate) const ARM_TARGETS: &[&str] = &["thumbv6m-none-eabi", "thumbv7em-none-eabihf"];

/// Target of the firmware image.
pub(crate) const FIRMWARE_TARGET: &str = "thumbv6m-none-eabi";

/// One crate of the workspace.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Member {
    /// Package name.
    pub(crate) name: &'static str,
    /// Where the crate's code runs.
    pub(crate) runs_on: RunsOn,
    /// Whether the crate is intended for the registry; the gate then packages it.
    pub(crate) published: bool,
    /// Features of the crate. The lints run with none of them, each alone, and all.
    pub(crate) features: &'static [&'static str],
    /// Features with their own tests, which no other crate enables.
    pub(crate) tested_features: &'static [&'static str],
    /// Examples of the crate for a microcontroller.
    pub(crate) mcu_examples: &'static [McuExample],
}

/// Where a crate's code runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunsOn {
    /// A PC only.
    Host,
    /// A PC and a microcontroller: `no_std`, built for each of [`ARM_TARGETS`].
    Everywhere,
    /// A microcontroller only: not built for the host.
    Mcu,
}

/// An example program for a microcontroller.
#[derive(Debug, Clone, Copy)]
pub(crate) struct McuExample {
    pub(crate) name: &'static str,
    pub(crate) target: &'static str,
}

/// A program for a PC without features, never published: the most frequent row.
const HOST_PROGRAM: Member = Member {
    name: "",
    runs_on: RunsOn::Host,
    published: false,
    features: &[],
    tested_features: &[],
    mcu_examples: &[],
};

pub(crate) const MEMBERS: &[Member] = &[
    Member {
        name: "coil-hbridge",
        runs_on: RunsOn::Everywhere,
        published: true,
        features: &[],
        tested_features: &[],
        mcu_examples: &[McuExample {
            name: "rp2040",
            target: FIRMWARE_TARGET,
        }],
    },
    Member {
        name: "ldc161x",
        runs_on: RunsOn::Everywhere,
        published: true,
        features: &["async", "defmt", "serde"],
        tested_features: &["async"],
        mcu_examples: &[McuExample {
            name: "stm32f411",
            target: "thumbv7em-none-eabihf",
        }],
    },
    Member {
        name: "ldc161x-sim",
        runs_on: RunsOn::Everywhere,
        published: true,
        features: &["async", "serde"],
        tested_features: &["async"],
        mcu_examples: &[],
    },
    Member {
        name: "palpate-node",
        runs_on: RunsOn::Everywhere,
        published: false,
        features: &["defmt"],
        tested_features: &[],
        mcu_examples: &[],
    },
    Member {
        name: "palpate-procedure",
        runs_on: RunsOn::Everywhere,
        published: false,
        features: &[],
        tested_features: &[],
        mcu_examples: &[],
    },
    Member {
        name: "palpate-storage",
        runs_on: RunsOn::Everywhere,
        published: false,
        features: &[],
        tested_features: &[],
        mcu_examples: &[],
    },
    Member {
        name: "palpate-model",
        runs_on: RunsOn::Everywhere,
        published: false,
        features: &[],
        tested_features: &[],
        mcu_examples: &[McuExample {
            name: "on_target",
            target: "thumbv6m-none-eabi",
        }],
    },
    Member {
        name: "palpate-wire",
        runs_on: RunsOn::Everywhere,
        published: false,
        features: &[],
        tested_features: &[],
        mcu_examples: &[],
    },
    Member {
        name: "palpate-float",
        runs_on: RunsOn::Everywhere,
        published: false,
        features: &[],
        tested_features: &[],
        mcu_examples: &[],
    },
    Member {
        name: "palpate-firmware",
        runs_on: RunsOn::Mcu,
        mcu_examples: &[
            McuExample {
                name: "on_target",
                target: FIRMWARE_TARGET,
            },
            McuExample {
                name: "bring_up",
                target: FIRMWARE_TARGET,
            },
        ],
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-calibration",
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-cli",
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-design",
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-simulate",
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-field",
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-sim",
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-emulator",
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate",
        features: &["probe"],
        ..HOST_PROGRAM
    },
    Member {
        name: "palpate-campaigns",
        ..HOST_PROGRAM
    },
    Member {
        name: "system-tests",
        ..HOST_PROGRAM
    },
    Member {
        name: "xtask",
        ..HOST_PROGRAM
    },
];

/// Crates that must build without the standard library, for either platform.
pub(crate) fn no_std() -> impl Iterator<Item = &'static Member> {
    MEMBERS
        .iter()
        .filter(|member| member.runs_on == RunsOn::Everywhere)
}

/// Arguments that select every crate that a PC can build.
pub(crate) fn host_packages() -> Vec<&'static str> {
    let mut arguments = vec!["--workspace"];
    for member in MEMBERS
        .iter()
        .filter(|member| member.runs_on == RunsOn::Mcu)
    {
        arguments.extend(["--exclude", member.name]);
    }
    arguments
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use serde_json::Value;

    use crate::process::{Invocation, Workspace};

    /// Source files in a folder and below.
    fn sources(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|it| it.unwrap().path());
        let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
        let below = folders.iter().flat_map(|folder| sources(folder));
        files.into_iter().chain(below).collect()
    }

    /// A library or program whose manifest disables its tests must have none: cargo would skip them
    /// silently.
    #[test]
    fn what_is_not_tested_holds_no_test() {
        let workspace = Workspace::find(None).unwrap();
        let query = ["metadata", "--format-version", "1", "--no-deps"];
        let printed = workspace.output(&Invocation::cargo(&query)).unwrap();
        let metadata: Value = serde_json::from_str(&printed).unwrap();
        let packages = metadata["packages"].as_array().unwrap();
        let of_package = |package: &Value| package["targets"].as_array().unwrap().clone();
        let mut seen = 0;
        for target in packages.iter().flat_map(of_package) {
            let file = PathBuf::from(target["src_path"].as_str().unwrap());
            let kind = target["kind"][0].as_str().unwrap();
            let files = match kind {
                "lib" => sources(file.parent().unwrap()),
                "bin" => vec![file],
                _ => continue,
            };
            let marks: &[(&str, &[&str])] = &[
                ("test", &["#[test]", "cfg(test)", "proptest!"]),
                ("doctest", &["```"]),
            ];
            for (switch, marks) in marks {
                if target[switch] != false || (kind == "bin" && *switch == "doctest") {
                    continue;
                }
                seen += 1;
                for file in &files {
                    let text = fs::read_to_string(file).unwrap();
                    let found = marks.iter().find(|mark| text.contains(**mark));
                    assert_eq!(found, None, "{}: {switch} = false", file.display());
                }
            }
        }
        assert!(seen > 0);
    }
}
