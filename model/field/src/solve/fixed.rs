//! Contributions that do not depend on the field, computed once for all Newton steps on a mesh.

use super::assembly::{Level, Local};
use crate::element::shape::Placed;

/// Contributions at w = 0 of the triangles whose tangent does not depend on the field: those of
/// linear material and of the exterior.
pub(super) struct Fixed(Vec<Option<Local>>);

impl Fixed {
    /// No contributions computed in advance: for a single assembly.
    pub(super) const NONE: Self = Self(Vec::new());

    /// Computes the contributions of a mesh with its materials.
    pub(super) fn of(level: &Level) -> Self {
        let at_rest = vec![0.0; level.space.count];
        let mut placed = Placed::new(&level.space.basis);
        let triangles = level.space.mesh.triangles.iter().enumerate();
        let fixed = triangles.map(|(index, triangle)| {
            let material = level.materials.get(triangle.region as usize)?;
            if !material.is_linear() {
                return None;
            }
            let mut local = Local::new(level.space.basis.len(), true);
            level.local(index, &at_rest, &mut placed, &mut local);
            Some(local)
        });
        Self(fixed.collect())
    }

    /// Contribution of a triangle, if its tangent does not depend on the field.
    pub(super) fn of_triangle(&self, index: usize) -> Option<&Local> {
        self.0.get(index)?.as_ref()
    }
}
