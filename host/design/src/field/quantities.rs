//! The printed figures of a field, with keys, labels and units in one place.

use clap::Args;
use palpate_field::figures::Figures;
use palpate_field::solve::{Figure, Wanted};
use serde::ser::{Serialize, Serializer};

use super::drive::Drive;

/// A printed figure.
pub(super) struct Quantity {
    figure: Figure,
    /// Name in `--figures`.
    pub(super) name: &'static str,
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
    figure: Figure,
    label: &'static str,
    head: &'static str,
    key: &'static str,
    value: fn(&Figures) -> f64,
) -> Quantity {
    Quantity {
        figure,
        name: key,
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
        figure: Figure::Centre,
        name: "centre",
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
        figure: Figure::CoreMean,
        name: "core_mean",
        label: "mean over the core",
        head: "core mean",
        called_per_ampere: None,
        key_per_ampere: "core_mean_T_per_A",
        key: "core_mean_T",
        shown_per_ampere: ("uT/A", 1e6),
        shown: ("mT", 1e3),
        value: |f| f.core_mean_t,
    },
    share(Figure::CvWhole, "std/mean, r8", "cv r8", "cv_r8", |f| {
        f.cv[0]
    }),
    share(
        Figure::CvThreeQuarters,
        "std/mean, r6",
        "cv r6",
        "cv_r6",
        |f| f.cv[1],
    ),
    share(Figure::CvHalf, "std/mean, r4", "cv r4", "cv_r4", |f| {
        f.cv[2]
    }),
    share(
        Figure::AxialPp,
        "peak to peak, axial",
        "axial pp",
        "axial_pp",
        |f| f.axial_pp,
    ),
    share(
        Figure::RadialPp,
        "peak to peak, radial",
        "radial pp",
        "radial_pp",
        |f| f.radial_pp,
    ),
    Quantity {
        figure: Figure::Linkage,
        name: "linkage",
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
        figure: Figure::Force,
        name: "force",
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
        figure: Figure::PlateMax,
        name: "plate_max",
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

/// Figures to compute.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct Asked {
    /// Only these figures, which takes less time: centre, core_mean, cv_r8, cv_r6, cv_r4, axial_pp,
    /// radial_pp, linkage, force, plate_max
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = figure)]
    figures: Vec<Figure>,
}

fn figure(text: &str) -> Result<Figure, String> {
    let named = QUANTITIES.iter().find(|quantity| quantity.name == text);
    named.map(|quantity| quantity.figure).ok_or_else(|| {
        let names = QUANTITIES.map(|quantity| quantity.name);
        format!("allowed: {}", names.join(", "))
    })
}

impl Asked {
    /// What a solution has to be accurate for.
    pub(super) fn wanted(&self) -> Wanted<'_> {
        if self.figures.is_empty() {
            Wanted::Figures
        } else {
            Wanted::Only(&self.figures)
        }
    }

    /// The figures asked for, in the order of printing.
    pub(super) fn quantities(&self) -> impl Iterator<Item = &'static Quantity> + Clone {
        let asked = QUANTITIES
            .iter()
            .filter(|quantity| self.has(quantity.figure));
        asked.collect::<Vec<_>>().into_iter()
    }

    /// Whether a figure is asked for.
    pub(super) fn has(&self, figure: Figure) -> bool {
        self.figures.is_empty() || self.figures.contains(&figure)
    }
}

/// Derivatives of the figures by the current, serialised under their keys.
#[derive(Clone, Debug)]
pub(super) struct KeyedDerivatives {
    pub(super) asked: Asked,
    pub(super) figures: Figures,
}

impl Serialize for KeyedDerivatives {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(
            self.asked
                .quantities()
                .map(|quantity| (quantity.derivative_key(), (quantity.value)(&self.figures))),
        )
    }
}

/// Figures or their errors, serialised under their keys.
#[derive(Clone, Debug)]
pub(super) struct KeyedFigures {
    pub(super) asked: Asked,
    /// Drive of the field.
    pub(super) drive: Drive,
    /// Values in SI units.
    pub(super) figures: Figures,
}

impl Serialize for KeyedFigures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(
            self.asked
                .quantities()
                .map(|quantity| (quantity.key(self.drive), (quantity.value)(&self.figures))),
        )
    }
}
