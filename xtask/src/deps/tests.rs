//! A correct workspace passes; the rule that forbids a planted violation finds it.

use std::collections::BTreeSet;

use super::check::violations;
use super::check_workspace;
use super::graph::{Crate, Dependency, Graph, Kind};
use super::rules::RULES;
use crate::members::{Member, RunsOn};
use crate::process::Workspace;

/// The complete workspace by design: name, folder, platform, dependencies.
const SOUND: &[(&str, &str, RunsOn, &[&str])] = &[
    ("palpate-model", "model", RunsOn::Everywhere, &["libm"]),
    ("palpate-wire", "firmware/wire", RunsOn::Everywhere, &[]),
    (
        "palpate-field",
        "model/field",
        RunsOn::Host,
        &["palpate-model"],
    ),
    (
        "palpate-calibration",
        "host/calibration",
        RunsOn::Host,
        &["palpate-wire"],
    ),
    (
        "ldc161x",
        "drivers/ldc161x",
        RunsOn::Everywhere,
        &["embedded-hal"],
    ),
    (
        "ldc161x-sim",
        "drivers/ldc161x-sim",
        RunsOn::Everywhere,
        &["embedded-hal"],
    ),
    (
        "coil-hbridge",
        "drivers/hbridge",
        RunsOn::Everywhere,
        &["embedded-hal"],
    ),
    (
        "palpate-procedure",
        "firmware/procedure",
        RunsOn::Everywhere,
        &["palpate-model", "palpate-wire", "ldc161x", "coil-hbridge"],
    ),
    (
        "palpate-node",
        "firmware/node",
        RunsOn::Everywhere,
        &[
            "palpate-procedure",
            "palpate-storage",
            "palpate-wire",
            "ldc161x",
        ],
    ),
    ("palpate-float", "firmware/float", RunsOn::Everywhere, &[]),
    (
        "palpate-storage",
        "firmware/storage",
        RunsOn::Everywhere,
        &["palpate-wire"],
    ),
    (
        "palpate-firmware",
        "firmware",
        RunsOn::Mcu,
        &[
            "palpate-float",
            "palpate-node",
            "palpate-procedure",
            "palpate-storage",
            "palpate-wire",
            "ldc161x",
            "coil-hbridge",
            "rp2040-hal",
            "rtic",
            "cortex-m",
            "defmt",
            "rtt-target",
        ],
    ),
    (
        "palpate-sim",
        "sim-host",
        RunsOn::Host,
        &[
            "palpate-procedure",
            "palpate-model",
            "palpate-field",
            "ldc161x-sim",
        ],
    ),
    (
        "palpate-emulator",
        "sim-host/emulator",
        RunsOn::Host,
        &["palpate-sim", "palpate-procedure", "rp2040-emu"],
    ),
    (
        "palpate-cli",
        "host/cli",
        RunsOn::Host,
        &["palpate-calibration", "palpate-sim", "palpate-wire"],
    ),
    (
        "palpate-simulate",
        "host/simulate",
        RunsOn::Host,
        &["palpate-cli", "palpate-sim", "clap"],
    ),
    (
        "palpate-design",
        "host/design",
        RunsOn::Host,
        &["palpate-cli", "palpate-field", "palpate-simulate"],
    ),
    (
        "palpate",
        "host/tool",
        RunsOn::Host,
        &[
            "palpate-sim",
            "palpate-emulator",
            "palpate-wire",
            "palpate-design",
            "palpate-simulate",
            "ldc161x",
            "clap",
        ],
    ),
    (
        "palpate-campaigns",
        "tests/campaigns",
        RunsOn::Host,
        &["palpate", "palpate-emulator"],
    ),
    (
        "system-tests",
        "tests",
        RunsOn::Host,
        &["palpate-sim", "palpate-model", "rp2040-emu"],
    ),
    ("xtask", "xtask", RunsOn::Host, &["clap"]),
];

/// A forbidden edge for each rule: rule, crate, dependency, table.
const PLANTED: &[(&str, &str, &str, Kind)] = &[
    ("model-alone", "palpate-model", "palpate-wire", Kind::Normal),
    ("model-alone", "palpate-model", "palpate-field", Kind::Dev),
    ("wire-alone", "palpate-wire", "palpate-model", Kind::Normal),
    (
        "node-without-hardware",
        "palpate-node",
        "palpate-sim",
        Kind::Normal,
    ),
    ("board-below", "palpate-emulator", "ldc161x", Kind::Normal),
    (
        "field-on-model",
        "palpate-field",
        "palpate-sim",
        Kind::Normal,
    ),
    (
        "calibration-independent",
        "palpate-calibration",
        "palpate-model",
        Kind::Normal,
    ),
    ("drivers-apart", "ldc161x", "palpate-model", Kind::Normal),
    ("drivers-apart", "coil-hbridge", "palpate-model", Kind::Dev),
    (
        "drivers-apart",
        "ldc161x-sim",
        "palpate-procedure",
        Kind::Build,
    ),
    (
        "simulator-independent",
        "ldc161x-sim",
        "ldc161x",
        Kind::Normal,
    ),
    ("simulator-independent", "ldc161x-sim", "ldc161x", Kind::Dev),
    (
        "procedure-sans-io",
        "palpate-procedure",
        "ldc161x-sim",
        Kind::Normal,
    ),
    (
        "procedure-sans-io",
        "palpate-procedure",
        "palpate-sim",
        Kind::Dev,
    ),
    (
        "storage-on-wire",
        "palpate-storage",
        "palpate-procedure",
        Kind::Normal,
    ),
    (
        "float-alone",
        "palpate-float",
        "palpate-model",
        Kind::Normal,
    ),
    (
        "firmware-below",
        "palpate-firmware",
        "palpate-field",
        Kind::Normal,
    ),
    (
        "simulation-without-firmware",
        "palpate-sim",
        "palpate-firmware",
        Kind::Normal,
    ),
    ("cli-below", "palpate-cli", "palpate-emulator", Kind::Normal),
    (
        "simulate-small",
        "palpate-simulate",
        "palpate-emulator",
        Kind::Normal,
    ),
    (
        "design-without-boards",
        "palpate-design",
        "palpate-emulator",
        Kind::Normal,
    ),
    ("tool-above", "palpate", "palpate-firmware", Kind::Normal),
    ("tool-above", "palpate", "palpate-model", Kind::Normal),
    (
        "campaigns-above",
        "palpate-campaigns",
        "palpate-firmware",
        Kind::Normal,
    ),
    (
        "tests-without-firmware",
        "system-tests",
        "palpate-firmware",
        Kind::Normal,
    ),
    ("xtask-alone", "xtask", "palpate-model", Kind::Normal),
    (
        "no-std-below-std",
        "palpate-firmware",
        "palpate-sim",
        Kind::Normal,
    ),
    (
        "hardware-in-firmware",
        "palpate-procedure",
        "rtic",
        Kind::Normal,
    ),
    ("hardware-in-firmware", "ldc161x", "rp2040-hal", Kind::Dev),
    (
        "hardware-in-firmware",
        "ldc161x-sim",
        "stm32f4xx-hal",
        Kind::Normal,
    ),
    (
        "hardware-in-firmware",
        "palpate-model",
        "cortex-m-rt",
        Kind::Normal,
    ),
    ("hardware-in-firmware", "palpate", "defmt-rtt", Kind::Normal),
    (
        "hardware-in-firmware",
        "palpate-sim",
        "rtt-target",
        Kind::Normal,
    ),
    ("log-format-optional", "ldc161x", "defmt", Kind::Normal),
];

fn edge(name: &str, kind: Kind) -> Dependency {
    Dependency {
        name: name.to_owned(),
        kind,
        optional: false,
        target_gated: false,
    }
}

fn sound() -> (Graph, Vec<Member>) {
    let crates = SOUND
        .iter()
        .map(|(name, folder, _, dependencies)| Crate {
            name: (*name).to_owned(),
            folder: (*folder).to_owned(),
            dependencies: dependencies
                .iter()
                .map(|name| edge(name, Kind::Normal))
                .collect(),
            ..Crate::default()
        })
        .collect();
    let members = SOUND
        .iter()
        .map(|&(name, _, runs_on, _)| Member {
            name,
            runs_on,
            published: false,
            features: &[],
            tested_features: &[],
            mcu_examples: &[],
        })
        .collect();
    (Graph { crates }, members)
}

/// Names of the rules that the correct workspace breaks after `change` is applied to one of its
/// crates.
fn broken_by(who: &str, change: impl FnOnce(&mut Crate)) -> BTreeSet<&'static str> {
    let (mut graph, members) = sound();
    let krate = graph
        .crates
        .iter_mut()
        .find(|krate| krate.name == who)
        .unwrap();
    change(krate);
    violations(&graph, &members)
        .into_iter()
        .map(|violation| {
            assert_eq!(violation.who, who, "{violation}");
            violation.rule
        })
        .collect()
}

#[test]
fn the_workspace_of_the_design_is_sound() {
    let (graph, members) = sound();
    let found = violations(&graph, &members);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn each_planted_dependency_is_found_by_its_rule() {
    for &(rule, who, on, kind) in PLANTED {
        let broken = broken_by(who, |krate| krate.dependencies.push(edge(on, kind)));
        assert!(broken.contains(rule), "{who} on {on}: {rule} is silent");
    }
}

#[test]
fn each_rule_has_a_planted_violation() {
    let planted: BTreeSet<_> = PLANTED.iter().map(|&(rule, ..)| rule).collect();
    for rule in RULES {
        assert!(
            planted.contains(rule.name),
            "{} was never seen red",
            rule.name
        );
    }
}

#[test]
fn tests_of_a_no_std_crate_may_use_the_standard_library() {
    // Of the no_std crates, only the firmware's rules allow the difference to show.
    let broken = broken_by("palpate-firmware", |krate| {
        krate.dependencies.push(edge("palpate-sim", Kind::Dev));
    });
    assert!(!broken.contains("no-std-below-std"));
}

#[test]
fn an_example_of_a_driver_or_the_model_may_name_its_microcontroller() {
    for who in ["ldc161x", "palpate-model"] {
        let broken = broken_by(who, |krate| {
            for name in ["stm32f4xx-hal", "cortex-m-rt", "defmt-rtt", "defmt"] {
                krate.dependencies.push(Dependency {
                    target_gated: true,
                    ..edge(name, Kind::Dev)
                });
            }
        });
        assert!(broken.is_empty(), "{who}: {broken:?}");
    }
}

#[test]
fn the_same_entry_in_another_table_or_crate_is_found() {
    let gated = |kind| Dependency {
        target_gated: true,
        ..edge("stm32f4xx-hal", kind)
    };
    for (who, kind) in [("ldc161x", Kind::Normal), ("palpate-wire", Kind::Dev)] {
        let broken = broken_by(who, |krate| krate.dependencies.push(gated(kind)));
        assert!(broken.contains("hardware-in-firmware"), "{who} {kind:?}");
    }
}

#[test]
fn a_library_may_offer_the_log_format_behind_a_feature() {
    let broken = broken_by("palpate-model", |krate| {
        krate.dependencies.push(Dependency {
            optional: true,
            ..edge("defmt", Kind::Normal)
        });
    });
    assert!(broken.is_empty(), "{broken:?}");
}

#[test]
fn a_crate_without_a_row_or_a_rule_is_found() {
    let (mut graph, mut members) = sound();
    graph.crates.push(Crate {
        name: "newcomer".to_owned(),
        folder: "newcomer".to_owned(),
        ..Crate::default()
    });
    members.push(Member {
        name: "departed",
        ..members[0]
    });
    let found: BTreeSet<_> = violations(&graph, &members)
        .into_iter()
        .map(|violation| violation.rule)
        .collect();
    assert_eq!(
        found,
        BTreeSet::from(["crate-bound", "crate-entered", "table-current"])
    );
}

#[test]
fn a_feature_without_an_entry_is_found() {
    let broken = broken_by("ldc161x", |krate| {
        krate.features.insert("turbo".to_owned());
    });
    assert_eq!(broken, BTreeSet::from(["features-entered"]));
}

#[test]
fn this_workspace_is_sound() {
    let workspace = Workspace::find(None).unwrap();
    if let Err(error) = check_workspace(&workspace) {
        panic!("{error:#}");
    }
}
