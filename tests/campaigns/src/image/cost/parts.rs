//! Maps an instruction to a part of the firmware, by its source file.

use std::collections::BTreeMap;
use std::ops::Range;

use palpate_emulator::{Profile, Sources};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum FirmwarePart {
    Engine,
    Driver,
    Procedure,
    Estimator,
    Model,
    Wire,
    Coil,
    Usb,
    Storage,
    Tasks,
    Rtic,
    /// Shared by all callers: floating point, mathematics, copying, the core library.
    Shared,
}

impl FirmwarePart {
    pub(super) const ALL: [Self; 12] = [
        Self::Engine,
        Self::Driver,
        Self::Procedure,
        Self::Estimator,
        Self::Model,
        Self::Wire,
        Self::Coil,
        Self::Usb,
        Self::Storage,
        Self::Tasks,
        Self::Rtic,
        Self::Shared,
    ];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Engine => "bus engine",
            Self::Driver => "driver (`ldc161x`)",
            Self::Procedure => "procedure",
            Self::Estimator => "estimator (`palpate-model`, ramps)",
            Self::Model => "rest of the model",
            Self::Wire => "encoding (`palpate-wire`)",
            Self::Coil => "coil",
            Self::Usb => "USB",
            Self::Storage => "storage",
            Self::Tasks => "tasks, start and idle",
            Self::Rtic => "RTIC and its like",
            Self::Shared => "without a known caller",
        }
    }

    /// Part of a source file.
    fn of(file: &str) -> Self {
        let file = file.replace('\\', "/");
        let found = FILES.iter().find(|(part, _)| file.contains(part));
        found.map_or(Self::Shared, |(_, part)| *part)
    }
}

/// Files by a part of their path; the first match counts.
const FILES: [(&str, FirmwarePart); 32] = [
    ("/firmware/src/board/rp2040/i2c/", FirmwarePart::Engine),
    ("/firmware/src/board/rp2040/control/", FirmwarePart::Coil),
    ("/firmware/src/board/rp2040/coil.rs", FirmwarePart::Coil),
    ("/firmware/src/board/rp2040/float.rs", FirmwarePart::Shared),
    (
        "/firmware/src/board/rp2040/routines.rs",
        FirmwarePart::Shared,
    ),
    ("/firmware/src/board/rp2040/usb.rs", FirmwarePart::Usb),
    ("/firmware/src/link/usb.rs", FirmwarePart::Usb),
    ("/usb-device", FirmwarePart::Usb),
    ("/usbd-serial", FirmwarePart::Usb),
    ("/rp2040-hal", FirmwarePart::Usb),
    ("/firmware/src/board/rp2040/flash.rs", FirmwarePart::Storage),
    ("/firmware/src/tasks/storage.rs", FirmwarePart::Storage),
    ("/firmware/node/src/storage.rs", FirmwarePart::Storage),
    ("/firmware/storage/", FirmwarePart::Storage),
    ("/sequential-storage", FirmwarePart::Storage),
    ("/drivers/ldc161x/", FirmwarePart::Driver),
    ("/drivers/hbridge/", FirmwarePart::Coil),
    ("/firmware/procedure/", FirmwarePart::Procedure),
    ("/model/src/ramp/", FirmwarePart::Estimator),
    ("/model/src/math/", FirmwarePart::Shared),
    ("/model/src/units.rs", FirmwarePart::Shared),
    ("/model/src/", FirmwarePart::Model),
    ("/firmware/wire/", FirmwarePart::Wire),
    ("/firmware/node/src/coil/", FirmwarePart::Coil),
    ("/firmware/src/tasks/coil.rs", FirmwarePart::Coil),
    ("/firmware/node/src/", FirmwarePart::Tasks),
    ("/firmware/src/", FirmwarePart::Tasks),
    ("/rtic", FirmwarePart::Rtic),
    ("/rtt-target", FirmwarePart::Rtic),
    ("/cortex-m", FirmwarePart::Rtic),
    ("/critical-section", FirmwarePart::Rtic),
    ("/rp2040-pac", FirmwarePart::Rtic),
];

/// Addresses of functions that are shared by all callers.
pub(super) fn shared(sources: &Sources) -> Vec<Range<u32>> {
    let functions = sources.functions().iter();
    functions
        .filter(|(range, _)| part_at(sources, range.start).0 == FirmwarePart::Shared)
        .map(|(range, _)| range.clone())
        .collect()
}

/// Part and function at an address: the innermost inlined function that belongs to an own part.
fn part_at(sources: &Sources, address: u32) -> (FirmwarePart, String) {
    let functions = sources.at(address);
    let owned = functions
        .iter()
        .map(|function| (FirmwarePart::of(&function.file), function))
        .find(|(part, _)| *part != FirmwarePart::Shared);
    if let Some((part, function)) = owned {
        return (part, function.name.clone());
    }
    let linked = sources.functions().iter();
    let linked = linked.rev().find(|(range, _)| range.contains(&address));
    let name = linked.map_or_else(|| format!("{address:#010x}"), |(_, name)| name.clone());
    (FirmwarePart::Shared, name)
}

/// Cycles of a function or a part.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cycles {
    /// Cycles in its own instructions.
    pub(super) own: u64,
    /// Cycles including the shared functions that it calls.
    pub(super) charged: u64,
}

impl Cycles {
    fn add(&mut self, own: u64, charged: u64) {
        self.own += own;
        self.charged += charged;
    }
}

/// A profile, split by parts and by functions.
#[derive(Clone, Debug, Default)]
pub(super) struct Split {
    pub(super) parts: BTreeMap<FirmwarePart, Cycles>,
    pub(super) functions: BTreeMap<(FirmwarePart, String), Cycles>,
}

impl Split {
    pub(super) fn new(profile: &Profile, sources: &Sources) -> Self {
        let mut split = Self::default();
        for (address, cost) in profile.instructions() {
            let (part, name) = part_at(sources, address);
            let (own, charged) = (cost.own_cycles, cost.charged_cycles);
            split.parts.entry(part).or_default().add(own, charged);
            let function = split.functions.entry((part, name)).or_default();
            function.add(own, charged);
        }
        split
    }

    pub(super) fn charged(&self, part: FirmwarePart) -> u64 {
        self.parts.get(&part).map_or(0, |cycles| cycles.charged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_belongs_to_the_part_whose_folder_it_lies_in() {
        for (file, part) in [
            (
                "/p/palpate/firmware/src/board/rp2040/i2c/engine.rs",
                FirmwarePart::Engine,
            ),
            ("/p/firmware/src/tasks/coil.rs", FirmwarePart::Coil),
            ("/p/firmware/src/tasks/sensing.rs", FirmwarePart::Tasks),
            (
                "/p/firmware/procedure/src/stream.rs",
                FirmwarePart::Procedure,
            ),
            ("/p/model/src/ramp/fit.rs", FirmwarePart::Estimator),
            ("/p/model/src/contact/mod.rs", FirmwarePart::Model),
            ("/p/model/src/math/mod.rs", FirmwarePart::Shared),
            (
                "C:\\p\\drivers\\ldc161x\\src\\scale.rs",
                FirmwarePart::Driver,
            ),
            ("/r/rtic-sync-1.6.0/src/signal.rs", FirmwarePart::Rtic),
            ("/r/libm-0.2.16/src/math/sqrtf.rs", FirmwarePart::Shared),
            ("/rustc/library/core/src/slice/mod.rs", FirmwarePart::Shared),
        ] {
            assert_eq!(FirmwarePart::of(file), part, "{file}");
        }
    }
}
