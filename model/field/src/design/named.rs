//! Access to parts of a design by name.

use super::Design;
use crate::mesh::Region;

/// Reference to a coil, or to a body or plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Named {
    /// Index in [`Design::coils`].
    Coil(usize),
    /// Index in [`Design::parts`].
    Part(usize),
}

impl Named {
    /// Whether a region of a mesh belongs to this coil or part.
    pub(crate) fn takes(self, region: &Region) -> bool {
        match self {
            Self::Coil(coil) => region.ring.is_some_and(|[of, _]| of as usize == coil),
            Self::Part(part) => region.part.is_some_and(|of| of as usize == part),
        }
    }
}

impl Design {
    /// The first coil, body or plate with this name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<Named> {
        let coil = self.coils.iter().position(|coil| coil.name == name);
        let part = || self.parts.iter().position(|part| part.name == name);
        coil.map(Named::Coil).or_else(|| part().map(Named::Part))
    }

    /// The names of all coils, bodies and plates.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let coils = self.coils.iter().map(|coil| coil.name.as_str());
        coils.chain(self.parts.iter().map(|part| part.name.as_str()))
    }

    /// Whether any coil carries a current of its own.
    #[must_use]
    pub fn has_own_currents(&self) -> bool {
        self.coils.iter().any(|coil| coil.own_current_a.is_some())
    }
}
