//! Facts about the workspace's crates that the gate needs and cargo does not know.

/// Microcontroller targets: the least capable supported core, and one with an FPU.
pub(crate) const ARM_TARGETS: &[&str] = &["thumbv6m-none-eabi", "thumbv7em-none-eabihf"];

/// The firmware, the only crate that is not built for a PC, and the target of its image.
pub(crate) const FIRMWARE: &str = "palpate-firmware";
pub(crate) const FIRMWARE_TARGET: &str = "thumbv6m-none-eabi";

/// Libraries without the standard library, which are built for each of [`ARM_TARGETS`].
pub(crate) const NO_STD: &[&str] = &[
    "coil-hbridge",
    "ldc161x",
    "ldc161x-sim",
    "palpate-float",
    "palpate-model",
    "palpate-node",
    "palpate-procedure",
    "palpate-storage",
    "palpate-wire",
];

/// Crates intended for the registry.
pub(crate) const PUBLISHED: &[&str] = &["coil-hbridge", "ldc161x", "ldc161x-sim"];

/// Features with their own tests, which no other crate enables.
pub(crate) const TESTED_FEATURES: &str = "ldc161x/async,ldc161x-sim/async";

/// Examples for a microcontroller: crate, example and target.
pub(crate) const MCU_EXAMPLES: &[(&str, &str, &str)] = &[
    ("coil-hbridge", "rp2040", FIRMWARE_TARGET),
    ("ldc161x", "stm32f411", "thumbv7em-none-eabihf"),
    ("palpate-model", "on_target", FIRMWARE_TARGET),
    (FIRMWARE, "on_target", FIRMWARE_TARGET),
    (FIRMWARE, "bring_up", FIRMWARE_TARGET),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::metadata::{Package, Target, packages};
    use crate::process::Workspace;

    fn members() -> Vec<Package> {
        packages(&Workspace::find(None).unwrap()).unwrap()
    }

    /// Source files in a folder and below.
    fn sources(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|it| it.unwrap().path());
        let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
        let below = folders.iter().flat_map(|folder| sources(folder));
        files.into_iter().chain(below).collect()
    }

    #[test]
    fn every_library_without_the_standard_library_is_listed() {
        let is_no_std = |library: &Target| {
            let source = fs::read_to_string(&library.src_path).unwrap();
            source
                .lines()
                .any(|line| line.starts_with("#![") && line.contains("no_std"))
        };
        let members = members();
        let found = members
            .iter()
            .filter(|member| member.library().is_some_and(is_no_std));
        let found: BTreeSet<_> = found.map(|member| member.name.as_str()).collect();
        assert_eq!(found, BTreeSet::from_iter(NO_STD.iter().copied()));
    }

    /// A library or program whose manifest disables its tests must have none: cargo would skip them
    /// silently.
    #[test]
    fn what_is_not_tested_holds_no_test() {
        let marks: [&[&str]; 2] = [&["#[test]", "cfg(test)", "proptest!"], &["```"]];
        let members = members();
        let mut seen = 0;
        for target in members.iter().flat_map(|member| &member.targets) {
            let (files, tested) = match target.kind[0].as_str() {
                "lib" => {
                    let folder = target.src_path.parent().unwrap();
                    (sources(folder), [target.test, target.doctest])
                }
                "bin" => (vec![target.src_path.clone()], [target.test, true]),
                _ => continue,
            };
            for (marks, _) in marks.iter().zip(tested).filter(|(_, tested)| !tested) {
                seen += 1;
                for file in &files {
                    let text = fs::read_to_string(file).unwrap();
                    let found = marks.iter().find(|mark| text.contains(**mark));
                    assert_eq!(found, None, "{}: its tests do not run", file.display());
                }
            }
        }
        assert!(seen > 0);
    }
}
