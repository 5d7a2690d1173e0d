//! The printed figures of a field, with keys, labels and units in one place.

use palpate_field::figures::Figures;
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::drive::Drive;

/// A printed figure.
pub(super) struct Quantity {
    /// Label.
    label: &'static str,
    /// Short label of the figure, for column heads.
    head: &'static str,
    /// Label and short label of the figure per ampere, where they differ from those at a current.
    called_per_ampere: Option<[&'static str; 2]>,
    /// Key of the figure per ampere, including the unit.
    key_per_ampere: &'static str,
    /// Key of the figure at a current or in a background, including the unit.
    key: &'static str,
    /// Display unit of the figure per ampere, and its factor from the SI unit.
    shown_per_ampere: (&'static str, f64),
    /// Display unit of the figure at a current or in a background, and its factor from the SI unit.
    shown: (&'static str, f64),
    /// Returns the figure in SI units.
    pub(super) value: fn(&Figures) -> f64,
}

impl Quantity {
    /// Label and short label.
    pub(super) const fn called(&self, drive: Drive) -> [&'static str; 2] {
        match (drive, self.called_per_ampere) {
            (Drive::PerAmpere, Some(called)) => called,
            _ => [self.label, self.head],
        }
    }

    /// Key for a drive.
    pub(super) const fn key(&self, drive: Drive) -> &'static str {
        match drive {
            Drive::PerAmpere => self.key_per_ampere,
            Drive::Current(_) | Drive::Background => self.key,
        }
    }

    /// Key of the derivative by the current.
    pub(super) fn derivative_key(&self) -> String {
        format!("{}_per_A", self.key)
    }

    /// Display unit, and the factor from the SI unit.
    pub(super) const fn shown(&self, drive: Drive) -> (&'static str, f64) {
        match drive {
            Drive::PerAmpere => self.shown_per_ampere,
            Drive::Current(_) | Drive::Background => self.shown,
        }
    }
}

/// Creates a dimensionless share, independent of the current.
const fn share(
    label: &'static str,
    head: &'static str,
    key: &'static str,
    value: fn(&Figures) -> f64,
) -> Quantity {
    Quantity {
        label,
        head,
        called_per_ampere: None,
        key_per_ampere: key,
        key,
        shown_per_ampere: ("%", 100.0),
        shown: ("%", 100.0),
        value,
    }
}

/// All printed figures, in order.
pub(super) const QUANTITIES: [Quantity; 10] = [
    Quantity {
        label: "field in the centre",
        head: "centre",
        called_per_ampere: None,
        key_per_ampere: "centre_T_per_A",
        key: "centre_T",
        shown_per_ampere: ("uT/A", 1e6),
        shown: ("mT", 1e3),
        value: |f| f.centre_t,
    },
    Quantity {
        label: "mean over the core",
        head: "core mean",
        called_per_ampere: None,
        key_per_ampere: "core_mean_T_per_A",
        key: "core_mean_T",
        shown_per_ampere: ("uT/A", 1e6),
        shown: ("mT", 1e3),
        value: |f| f.core_mean_t,
    },
    share("std/mean, r8", "cv r8", "cv_r8", |f| f.cv[0]),
    share("std/mean, r6", "cv r6", "cv_r6", |f| f.cv[1]),
    share("std/mean, r4", "cv r4", "cv_r4", |f| f.cv[2]),
    share("peak to peak, axial", "axial pp", "axial_pp", |f| {
        f.axial_pp
    }),
    share("peak to peak, radial", "radial pp", "radial_pp", |f| {
        f.radial_pp
    }),
    Quantity {
        label: "flux linkage",
        head: "linkage",
        called_per_ampere: Some(["inductance L", "L"]),
        key_per_ampere: "inductance_H",
        key: "linkage_Wb",
        shown_per_ampere: ("uH", 1e6),
        shown: ("uWb", 1e6),
        value: |f| f.linkage_wb,
    },
    Quantity {
        label: "attraction of the halves",
        head: "force",
        called_per_ampere: None,
        key_per_ampere: "force_N_per_A2",
        key: "force_N",
        shown_per_ampere: ("mN/A^2", 1e3),
        shown: ("mN", 1e3),
        value: |f| f.force_n,
    },
    Quantity {
        label: "greatest in the plates",
        head: "plates",
        called_per_ampere: None,
        key_per_ampere: "plate_max_T_per_A",
        key: "plate_max_T",
        shown_per_ampere: ("mT/A", 1e3),
        shown: ("mT", 1e3),
        value: |f| f.plate_max_t,
    },
];

/// Derivatives of the figures by the current, serialised under their keys.
#[derive(Clone, Copy, Debug)]
pub(super) struct KeyedDerivatives(pub(super) Figures);

impl Serialize for KeyedDerivatives {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(QUANTITIES.len()))?;
        for quantity in &QUANTITIES {
            map.serialize_entry(&quantity.derivative_key(), &(quantity.value)(&self.0))?;
        }
        map.end()
    }
}

/// Figures or their errors, serialised under their keys.
#[derive(Clone, Copy, Debug)]
pub(super) struct KeyedFigures {
    /// Drive of the field.
    pub(super) drive: Drive,
    /// Values in SI units.
    pub(super) figures: Figures,
}

impl Serialize for KeyedFigures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(QUANTITIES.len()))?;
        for quantity in &QUANTITIES {
            map.serialize_entry(quantity.key(self.drive), &(quantity.value)(&self.figures))?;
        }
        map.end()
    }
}
