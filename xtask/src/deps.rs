//! The direction of dependencies: cargo-deny compares the list `deny` in `deny.toml` with the
//! workspace. This module checks what that list cannot express: that the list has every library,
//! and in which table of a manifest a dependency stands.

use std::fs;

use anyhow::{Context, Result, bail};

use crate::members::FIRMWARE;
use crate::metadata::{self, Dependency, Package};
use crate::process::{Invocation, Workspace};

const RULES: &str = "deny.toml";

/// Crates that only the firmware names, by the beginning or the end of their names: HALs, register
/// crates, RTIC, start-up code, panic handlers, and transports of defmt logs.
const BEGINNINGS: &[&str] = &[
    "cortex-m",
    "defmt-itm",
    "defmt-rtt",
    "embassy-",
    "panic-",
    "rp-pico",
    "rp2040-",
    "rp235x-",
    "rtic",
    "rtt-target",
    "semihosting",
    "stm32",
];
const ENDS: &[&str] = &["-hal", "-pac"];
/// Crates with such names that are traits, or emulators for a PC.
const FOR_A_PC: &[&str] = &["embedded-hal", "rp2040-emu", "rp2350-emu"];

/// Checks this workspace and returns a line with the number of crates.
pub(crate) fn check_workspace(workspace: &Workspace) -> Result<String> {
    let packages = metadata::packages(workspace)?;
    let rules = fs::read_to_string(workspace.root().join(RULES))
        .with_context(|| format!("{RULES} could not be read"))?;
    let faults: Vec<_> = packages
        .iter()
        .flat_map(|package| {
            unlisted(package, &rules)
                .into_iter()
                .chain(hardware(package))
        })
        .collect();
    if !faults.is_empty() {
        bail!(
            "{} violations:\n    {}",
            faults.len(),
            faults.join("\n    ")
        );
    }
    // With `unused-wrapper`, a dependency that is listed but no longer exists is an error.
    let deny = ["deny", "--locked", "check", "-D", "unused-wrapper", "bans"];
    workspace.run(&Invocation::cargo(&deny))?;
    Ok(format!(
        "{} crates, every dependency points the right way",
        packages.len()
    ))
}

/// Describes a library that the list lacks: any crate could depend on that library.
fn unlisted(package: &Package, rules: &str) -> Option<String> {
    package.library()?;
    let entry = format!("crate = \"{}\", wrappers = [", package.name);
    (!rules.contains(&entry)).then(|| format!("{RULES} has no `{entry}`"))
}

/// Dependencies that only the firmware may have. An example of a library for a microcontroller may
/// also have them, as dev-dependencies for that target; a library may offer `defmt` by a feature.
fn hardware(package: &Package) -> Vec<String> {
    let is_wrong = |dependency: &&Dependency| {
        let for_an_example =
            dependency.kind.as_deref() == Some("dev") && dependency.target.is_some();
        let must_be_asked_for = dependency.name == "defmt" && !dependency.optional;
        !for_an_example && (must_be_asked_for || is_for_a_microcontroller(&dependency.name))
    };
    if package.name == FIRMWARE {
        return Vec::new();
    }
    let wrong = package.dependencies.iter().filter(is_wrong);
    let fault = |of: &Dependency| format!("{} must not depend on {} here", package.name, of.name);
    wrong.map(fault).collect()
}

fn is_for_a_microcontroller(name: &str) -> bool {
    !FOR_A_PC.contains(&name)
        && (BEGINNINGS.iter().any(|begin| name.starts_with(begin))
            || ENDS.iter().any(|end| name.ends_with(end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_dependency(name: &str, change: impl FnOnce(&mut Dependency)) -> Package {
        let workspace = Workspace::find(None).unwrap();
        let mut packages = metadata::packages(&workspace).unwrap();
        packages.retain(|package| package.name == "ldc161x");
        let mut package = packages.remove(0);
        let mut dependency = Dependency {
            name: name.to_owned(),
            kind: None,
            optional: false,
            target: None,
        };
        change(&mut dependency);
        package.dependencies.push(dependency);
        package
    }

    #[test]
    fn a_microcontroller_is_for_the_firmware_and_for_examples() {
        for name in ["rtic", "rp2040-hal", "stm32f4xx-pac", "defmt-rtt", "defmt"] {
            let as_it_is = with_dependency(name, |_| {});
            assert_eq!(hardware(&as_it_is).len(), 1, "{name}");
            let for_an_example = with_dependency(name, |it| {
                it.kind = Some("dev".to_owned());
                it.target = Some("cfg(target_os = \"none\")".to_owned());
            });
            assert!(hardware(&for_an_example).is_empty(), "{name}");
        }
        assert!(hardware(&with_dependency("defmt", |it| it.optional = true)).is_empty());
        assert!(hardware(&with_dependency("embedded-hal", |_| {})).is_empty());
        let firmware = Package {
            name: FIRMWARE.to_owned(),
            ..with_dependency("rtic", |_| {})
        };
        assert!(hardware(&firmware).is_empty());
    }

    #[test]
    fn a_library_without_an_entry_is_found() {
        let package = with_dependency("libm", |_| {});
        assert!(unlisted(&package, "").is_some());
        let rules = "{ crate = \"ldc161x\", wrappers = [\"palpate\"] }";
        assert_eq!(unlisted(&package, rules), None);
    }
}
