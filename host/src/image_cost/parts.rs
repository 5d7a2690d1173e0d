//! Which part of the firmware an instruction belongs to, by the file that it was written in.

use std::collections::BTreeMap;
use std::ops::Range;

use palpate_board::{Profile, Sources};

/// A part of the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Part {
    Engine,
    Driver,
    Procedure,
    Estimator,
    Model,
    Wire,
    Coil,
    Tasks,
    Rtic,
    /// Works for every caller: floating point, mathematics, copying, the core library.
    Shared,
}

impl Part {
    pub(super) const ALL: [Self; 10] = [
        Self::Engine,
        Self::Driver,
        Self::Procedure,
        Self::Estimator,
        Self::Model,
        Self::Wire,
        Self::Coil,
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
            Self::Tasks => "tasks, start and idle",
            Self::Rtic => "RTIC and its like",
            Self::Shared => "without a known caller",
        }
    }

    /// The part that a source file belongs to.
    fn of(file: &str) -> Self {
        let file = file.replace('\\', "/");
        let found = FILES.iter().find(|(part, _)| file.contains(part));
        found.map_or(Self::Shared, |(_, part)| *part)
    }
}

/// Files by a part of their path; the first that fits counts.
const FILES: [(&str, Part); 21] = [
    ("/firmware/src/bus/", Part::Engine),
    ("/firmware/src/board/float.rs", Part::Shared),
    ("/firmware/src/board/memory.rs", Part::Shared),
    ("/drivers/ldc161x/", Part::Driver),
    ("/drivers/hbridge/", Part::Coil),
    ("/firmware/procedure/", Part::Procedure),
    ("/model/src/ramp/", Part::Estimator),
    ("/model/src/math/", Part::Shared),
    ("/model/src/units.rs", Part::Shared),
    ("/model/src/", Part::Model),
    ("/firmware/wire/", Part::Wire),
    ("/firmware/src/coil.rs", Part::Coil),
    ("/firmware/src/coil/", Part::Coil),
    ("/firmware/src/history.rs", Part::Coil),
    ("/firmware/src/tasks/coil.rs", Part::Coil),
    ("/firmware/src/", Part::Tasks),
    ("/rtic", Part::Rtic),
    ("/rtt-target", Part::Rtic),
    ("/cortex-m", Part::Rtic),
    ("/critical-section", Part::Rtic),
    ("/rp2040-pac", Part::Rtic),
];

/// The addresses of functions that work for every caller.
pub(super) fn shared(sources: &Sources) -> Vec<Range<u32>> {
    let functions = sources.functions().iter();
    functions
        .filter(|(range, _)| part_at(sources, range.start).0 == Part::Shared)
        .map(|(range, _)| range.clone())
        .collect()
}

/// The part at an address, and the function: of those inlined there, the innermost that belongs to
/// a part of its own.
fn part_at(sources: &Sources, address: u32) -> (Part, String) {
    let functions = sources.at(address);
    let owned = functions
        .iter()
        .map(|function| (Part::of(&function.file), function))
        .find(|(part, _)| *part != Part::Shared);
    if let Some((part, function)) = owned {
        return (part, function.name.clone());
    }
    let linked = sources.functions().iter();
    let linked = linked.rev().find(|(range, _)| range.contains(&address));
    let name = linked.map_or_else(|| format!("{address:#010x}"), |(_, name)| name.clone());
    (Part::Shared, name)
}

/// Cycles of a function or a part.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cycles {
    /// In its own instructions.
    pub(super) own: u64,
    /// With those of shared functions that it calls.
    pub(super) charged: u64,
}

impl Cycles {
    fn add(&mut self, own: u64, charged: u64) {
        self.own += own;
        self.charged += charged;
    }
}

/// A profile by parts and by functions.
#[derive(Clone, Debug, Default)]
pub(super) struct Split {
    pub(super) parts: BTreeMap<Part, Cycles>,
    pub(super) functions: BTreeMap<(Part, String), Cycles>,
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

    pub(super) fn charged(&self, part: Part) -> u64 {
        self.parts.get(&part).map_or(0, |cycles| cycles.charged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_belongs_to_the_part_whose_folder_it_lies_in() {
        for (file, part) in [
            ("/p/palpate/firmware/src/bus/engine.rs", Part::Engine),
            ("/p/firmware/src/tasks/coil.rs", Part::Coil),
            ("/p/firmware/src/tasks/sensing.rs", Part::Tasks),
            ("/p/firmware/procedure/src/stream.rs", Part::Procedure),
            ("/p/model/src/ramp/fit.rs", Part::Estimator),
            ("/p/model/src/contact/mod.rs", Part::Model),
            ("/p/model/src/math/mod.rs", Part::Shared),
            ("C:\\p\\drivers\\ldc161x\\src\\scale.rs", Part::Driver),
            ("/r/rtic-sync-1.6.0/src/signal.rs", Part::Rtic),
            ("/r/libm-0.2.16/src/math/sqrtf.rs", Part::Shared),
            ("/rustc/library/core/src/slice/mod.rs", Part::Shared),
        ] {
            assert_eq!(Part::of(file), part, "{file}");
        }
    }
}
