//! Entries of a design file, as deserialised.

use core::fmt;
use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor};
use toml::Spanned;

/// A number, or an expression that may contain names of parameters.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a number, or a text like \"1.64 + gap\"")]
pub(super) enum Number {
    Value(f64),
    Text(String),
}

pub(super) type SpannedNumber = Spanned<Number>;
pub(super) type Pair = Spanned<[SpannedNumber; 2]>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) name: String,
    #[serde(default)]
    pub(super) about: String,
    pub(super) length_unit: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) parameters: BTreeMap<String, Spanned<f64>>,
    pub(super) core: CoreFile,
    pub(super) conductor: Option<ConductorFile>,
    pub(super) background: Option<BackgroundFile>,
    #[serde(default)]
    pub(super) material: BTreeMap<String, Spanned<MaterialFile>>,
    #[serde(default)]
    pub(super) coil: Vec<Spanned<CoilFile>>,
    #[serde(default)]
    pub(super) board: Vec<Spanned<BoardFile>>,
    #[serde(default)]
    pub(super) body: Vec<Spanned<PartFile>>,
    #[serde(default)]
    pub(super) plate: Vec<Spanned<PartFile>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CoreFile {
    pub(super) r: SpannedNumber,
    pub(super) x: Pair,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConductorFile {
    #[serde(rename = "resistivity_ohm_m")]
    pub(super) resistivity: SpannedNumber,
    #[serde(rename = "current_A")]
    pub(super) current: SpannedNumber,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BackgroundFile {
    #[serde(rename = "field_T")]
    pub(super) field: SpannedNumber,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialFile {
    pub(super) mu_r: Option<SpannedNumber>,
    #[serde(rename = "remanence_T")]
    pub(super) remanence: Option<SpannedNumber>,
    #[serde(rename = "saturation_A_per_m")]
    pub(super) saturation: Option<SpannedNumber>,
    pub(super) initial_mu_r: Option<SpannedNumber>,
    #[serde(rename = "knee_T")]
    pub(super) knee: Option<SpannedNumber>,
    pub(super) exponent: Option<SpannedNumber>,
    pub(super) bh_table: Option<Spanned<String>>,
    #[serde(rename = "conductivity_S_per_m")]
    pub(super) conductivity: Option<SpannedNumber>,
    pub(super) loss_tangent: Option<SpannedNumber>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CoilFile {
    pub(super) name: String,
    pub(super) r: Pair,
    pub(super) x: Pair,
    pub(super) rings: Option<Spanned<u32>>,
    pub(super) pitch: Option<SpannedNumber>,
    pub(super) turns: Option<SpannedNumber>,
    pub(super) sense: Option<Spanned<String>>,
    pub(super) driven: Option<bool>,
    #[serde(rename = "current_A")]
    pub(super) current: Option<SpannedNumber>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BoardFile {
    pub(super) name: String,
    pub(super) r: Pair,
    pub(super) x: Pair,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartFile {
    pub(super) name: String,
    pub(super) material: Spanned<String>,
    pub(super) shape: Spanned<ShapeFile>,
    #[serde(default)]
    pub(super) minus: Vec<Spanned<ShapeFile>>,
    pub(super) pillars: Option<Spanned<PillarsFile>>,
    pub(super) slots: Option<Spanned<SlotsFile>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PillarsFile {
    pub(super) count: u32,
    pub(super) diameter: SpannedNumber,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SlotsFile {
    pub(super) count: u32,
    pub(super) width: SpannedNumber,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShapeFile {
    pub(super) r: Option<Pair>,
    pub(super) x: Option<Pair>,
    pub(super) outline: Option<Spanned<Vec<Spanned<OutlineEntry>>>>,
    pub(super) outline_dxf: Option<Spanned<String>>,
    pub(super) layer: Option<Spanned<String>>,
    pub(super) drawing_unit: Option<Spanned<String>>,
    pub(super) centre_x: Option<SpannedNumber>,
    pub(super) semi_r: Option<SpannedNumber>,
    pub(super) semi_x: Option<SpannedNumber>,
}

/// An entry of an outline: a corner [r, x], or { through = [r, x] }, a point on the arc from the
/// previous corner to the next.
pub(super) enum OutlineEntry {
    Corner([SpannedNumber; 2]),
    Through([SpannedNumber; 2]),
}

/// Implemented by hand, since derived untagged enums lose the location of their contents.
impl<'de> Deserialize<'de> for OutlineEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OutlineVisitor)
    }
}

struct OutlineVisitor;

impl<'de> Visitor<'de> for OutlineVisitor {
    type Value = OutlineEntry;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a corner [r, x], or { through = [r, x] }")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<OutlineEntry, A::Error> {
        let (r, x) = (entries.next_element()?, entries.next_element()?);
        let more: Option<SpannedNumber> = entries.next_element()?;
        match (r, x, more) {
            (Some(r), Some(x), None) => Ok(OutlineEntry::Corner([r, x])),
            _ => Err(A::Error::custom("a corner has two numbers, [r, x]")),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<OutlineEntry, A::Error> {
        let mut through = None;
        while let Some(key) = entries.next_key::<String>()? {
            if key != "through" {
                return Err(A::Error::unknown_field(&key, &["through"]));
            }
            through = Some(entries.next_value()?);
        }
        let through = through.ok_or_else(|| A::Error::missing_field("through"))?;
        Ok(OutlineEntry::Through(through))
    }
}
