//! Watched points of a structure, at which no contact force acts: their displacements or stresses.

use nalgebra::DMatrix;

use super::{ContactNode, Rom, array, refuse};
use crate::scene::ranges;
use crate::{Error, Result};

/// Points whose displacements or stresses are reported, but at which no contact force acts.
#[derive(Debug, Clone, PartialEq)]
pub struct WatchedPoints {
    /// Values per unit of each coordinate, rows (point, component) × n, directions as for contact nodes: three displacements, or six stresses σ₁₁,
    /// σ₂₂, σ₃₃, σ₁₂, σ₂₃, σ₃₁ (Pa).
    pub map: DMatrix<f64>,
    /// Names and positions; the other fields have no effect.
    pub points: Vec<ContactNode>,
}

/// Number of components of stress at a point.
pub const STRESSES: usize = 6;

/// Equivalent stress of von Mises (Pa) of σ₁₁, σ₂₂, σ₃₃, σ₁₂, σ₂₃, σ₃₁.
pub fn von_mises([xx, yy, zz, xy, yz, zx]: [f64; STRESSES]) -> f64 {
    let normal = [xx - yy, yy - zz, zz - xx].iter().map(|one| 0.5 * one * one).sum::<f64>();
    libm::sqrt(normal + 3.0 * (xy * xy + yz * yz + zx * zx))
}

impl Rom {
    pub(super) fn validate_watched(&self) -> Result<()> {
        self.validate_points("watched", self.extras.watched.as_ref(), (3, ranges::MAP))?;
        self.validate_points("stress", self.extras.stress.as_ref(), (STRESSES, ranges::STRESS_MAP))?;
        self.validate_static_stress()
    }

    fn validate_static_stress(&self) -> Result<()> {
        let extras = &self.extras;
        let patches = extras.thermal.as_ref().map(|thermal| thermal.patches.len());
        for (name, values, load, columns) in [
            ("stress_thermal", &extras.stress_thermal, "thermal_loads", patches),
            ("stress_centrifugal", &extras.stress_centrifugal, "centrifugal_load", extras.spin.as_ref().map(|_| 1)),
        ] {
            let Some(values) = values else { continue };
            let (Some(stress), Some(columns)) = (&extras.stress, columns) else {
                let problem = format!("requires `stress_map` and `{load}`");
                let remedy = "Add these arrays, or remove this one";
                return Err(Error::invalid(format!("ROM array `{name}`"), problem, remedy));
            };
            array(name, values, (STRESSES * stress.points.len(), columns), ranges::STRESS_MAP)?;
        }
        Ok(())
    }

    /// Checks points whose arrays are named `of`, with a number of components each up to the largest.
    fn validate_points(
        &self,
        of: &str,
        watched: Option<&WatchedPoints>,
        (components, largest): (usize, f64),
    ) -> Result<()> {
        let Some(watched) = watched else { return Ok(()) };
        let name = format!("{of}_map");
        if watched.points.is_empty() {
            return refuse(format!("ROM array `{name}`"), "no points");
        }
        array(&name, &watched.map, (components * watched.points.len(), self.order()), largest)?;
        if self.is_cyclic() {
            let problem = "not supported for coupled sectors, because it has no data for nodal diameters above 0";
            return Err(Error::invalid(format!("ROM array `{name}`"), problem, "Remove these points"));
        }
        let what = |index: usize| format!("ROM array `{of}_positions`, point {}", index + 1);
        let mut places = watched.points.iter().enumerate();
        places.try_for_each(|(index, point)| self.validate_place(&what(index), point))
    }
}
