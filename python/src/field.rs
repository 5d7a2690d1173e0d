//! Magnetic field of designs of the actuated layer.

use palpate_design::field::Solution;
use palpate_field::design::builtin_names;
use pyo3::prelude::*;

use crate::errors::raised;
use crate::json;

/// Names of the built-in designs.
#[pyfunction]
pub(crate) fn designs() -> Vec<String> {
    builtin_names().into_iter().map(Into::into).collect()
}

/// A solved design, made by `palpate.field.solve`.
#[pyclass(frozen, module = "palpate")]
pub(crate) struct Field {
    solution: Solution,
}

/// Positions, m, and the flux densities B_r and B_x there, T.
type Profile = (Vec<f64>, Vec<f64>, Vec<f64>);

#[pymethods]
impl Field {
    /// Solves a design, by the arguments of `palpate field solve`.
    #[new]
    fn solve(py: Python<'_>, arguments: Vec<String>) -> PyResult<Self> {
        let solution = py.detach(|| Solution::solve(&arguments));
        Ok(Self {
            solution: solution.map_err(raised)?,
        })
    }

    /// Figures of the field with their errors, in SI units.
    #[getter]
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let figures = py.detach(|| json::text(&self.solution.figures()?));
        json::object(py, &figures.map_err(raised)?)
    }

    /// Radius of the core, m.
    #[getter]
    fn core_r_m(&self) -> f64 {
        self.solution.design().core.r_m
    }

    /// Ends of the core on the axis, m.
    #[getter]
    fn core_x_m(&self) -> (f64, f64) {
        self.solution.design().core.x_m.into()
    }

    /// Field along a line.
    #[pyo3(signature = (along, from_mm = None, to_mm = None, points = 201))]
    fn profile(
        &self,
        py: Python<'_>,
        along: &str,
        from_mm: Option<f64>,
        to_mm: Option<f64>,
        points: u32,
    ) -> PyResult<Profile> {
        let samples = py.detach(|| self.solution.profile(along, [from_mm, to_mm], points));
        let samples = samples.map_err(raised)?.into_iter();
        let mut profile = Profile::default();
        for (at_m, field) in samples {
            let [radial_t, axial_t] = field.b;
            profile.0.push(at_m);
            profile.1.push(radial_t);
            profile.2.push(axial_t);
        }
        Ok(profile)
    }

    /// Flux densities (B_r, B_x), T, at points (r, x), m.
    fn at(&self, py: Python<'_>, points: Vec<[f64; 2]>) -> Vec<(f64, f64)> {
        let fields = py.detach(|| self.solution.at(&points)).into_iter();
        fields.map(|field| field.b.into()).collect()
    }
}
