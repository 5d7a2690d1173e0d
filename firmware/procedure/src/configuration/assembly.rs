//! Reception of a curve, or of an array, in chunks.

use palpate_model::touch::MOST_COILS;
use palpate_wire::command::{ARRAY_NUMBERS, COIL_NUMBERS, MAX_KNOTS};

/// Pairs of numbers of the largest array, which are more than the knots of the largest curve.
const MOST_POINTS: usize = (ARRAY_NUMBERS + COIL_NUMBERS * MOST_COILS) / 2;
const _: () = assert!(MOST_POINTS >= MAX_KNOTS as usize);

/// Calibration part that the received curve is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    Deformation {
        sensor: u8,
        channel: u8,
    },
    Stiffening {
        uncertainty: f32,
    },
    /// An array, whose numbers are received in pairs.
    Array,
}

/// Curve that is being received: its knots so far.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    target: Target,
    total: u8,
    points: heapless::Vec<(f32, f32), MOST_POINTS>,
}

impl Assembly {
    pub(super) const fn new(target: Target, total: u8) -> Self {
        Self {
            target,
            total,
            points: heapless::Vec::new(),
        }
    }

    /// Returns whether a chunk belongs to this curve and is the next one.
    pub(super) fn continues(&self, target: Target, total: u8, first: u8) -> bool {
        self.target == target && self.total == total && usize::from(first) == self.points.len()
    }

    /// Adds the knots of a chunk; `None` if there are more than announced.
    pub(super) fn with(mut self, knots: impl Iterator<Item = (f32, f32)>) -> Option<Self> {
        for knot in knots {
            self.points.push(knot).ok()?;
        }
        (self.points.len() <= usize::from(self.total)).then_some(self)
    }

    pub(super) fn is_complete(&self) -> bool {
        self.points.len() == usize::from(self.total)
    }

    pub(super) fn points(&self) -> &[(f32, f32)] {
        &self.points
    }
}
