//! Contents of a picture, and the text in it.

use palpate_field::design::Design;
use palpate_field::solve::Solved;

/// A field to draw.
pub(super) struct Picture<'p> {
    pub(super) design: &'p Design,
    pub(super) solved: &'p Solved,
    /// Unit of |B|: `mT` or `mT/A`.
    pub(super) unit: String,
    /// Drive in words.
    pub(super) driven: String,
}

/// Font of the drawings: any sans-serif font. Drawings are made large, since the library rounds to
/// whole pixels.
pub(super) const FONT: &str = "sans-serif";
pub(super) const TITLE: u32 = 40;
pub(super) const LABEL: u32 = 30;
