//! Force and moment of the support of a structure on its held nodes.

use nalgebra::DMatrix;
use tiprub_cosim::bounds;

use super::{Rom, array};
use crate::scene::ranges;
use crate::{Error, Result};

/// Forces along x, y, z (N) and moments about x, y, z through the origin (N·m).
pub const SUPPORT_ROWS: usize = 6;

/// Rows of the finite-element equations at the held nodes, which a reduction omits: R = S_K q + S_M q̈ − S_T T is force and moment of the
/// support on the structure, in fixed directions and about the origin.
///
/// With the six rigid motions r of the held nodes s and the displacements u = Vq of the others f, S_K = rᵀK_sf V, S_M = rᵀM_sf V, and S_T =
/// rᵀf_s with the loads f per kelvin of each patch.
#[derive(Debug, Clone, PartialEq)]
pub struct SupportRows {
    /// S_K, 6 × n (N or N·m per unit coordinate).
    pub stiffness: DMatrix<f64>,
    /// S_M, 6 × n (kg or kg·m for coordinates that are displacements).
    pub mass: DMatrix<f64>,
    /// S_T, 6 × patches (N/K or N·m/K); no columns without thermal loads.
    pub thermal: DMatrix<f64>,
}

impl Rom {
    pub(super) fn validate_support(&self) -> Result<()> {
        let Some(support) = &self.extras.support else { return Ok(()) };
        let patches = self.extras.thermal.as_ref().map_or(0, |thermal| thermal.patches.len());
        let order = self.order();
        array("support_stiffness", &support.stiffness, (SUPPORT_ROWS, order), bounds::MATRIX)?;
        array("support_mass", &support.mass, (SUPPORT_ROWS, order), bounds::MATRIX)?;
        array("support_thermal", &support.thermal, (SUPPORT_ROWS, patches), ranges::THERMAL_LOAD)?;
        if self.sectors != 1 {
            let problem = format!("not supported for a ROM with {} sectors", self.sectors);
            let remedy = "Remove it, or use a ROM with one sector";
            return Err(Error::invalid("ROM array `support_stiffness`", problem, remedy));
        }
        Ok(())
    }
}
