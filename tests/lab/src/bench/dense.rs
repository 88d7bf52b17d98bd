//! The paper's method with the dense matrices of the reduced coordinates, without modes: central differences with
//! forward-increment Lagrange multipliers (section 4.3, eqs 9-11).
//!
//! Products of matrices that do not change are computed before the first step, as any implementation would do.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use tiprub_reference::reduced::{
    ReducedScene,
    rub::{BladeScene, Blades, BumpedCasing, RubTip, Touch},
};

/// Identical blades in a casing, and their displacements.
pub(super) struct DensePaper<'a> {
    blades: &'a Blades,
    step: f64,
    steps: u32,
    /// (M/h² + D/2h)⁻¹ (2M/h² − K) and (M/h² + D/2h)⁻¹ (D/2h − M/h²) of eq. 9.
    prediction: [DMatrix<f64>; 2],
    /// (M/h² + D/2h)⁻¹ Cᵀ: coordinates per force on a contact row.
    response: DMatrix<f64>,
    /// C (M/h² + D/2h)⁻¹ Cᵀ.
    compliance: DMatrix<f64>,
    /// uₙ, uₙ₋₁ and uₙ₊₁: coordinates × blades (m).
    now: DMatrix<f64>,
    before: DMatrix<f64>,
    next: DMatrix<f64>,
}

/// Returns the damping matrix M Φ 2ξω Φᵀ M of one blade, in which every mode has the damping ratio of the scene.
pub(super) fn damping(scene: &BladeScene) -> DMatrix<f64> {
    let (modes, mass) = (scene.modes(), &scene.blades().mass);
    let rates = DVector::from_fn(mass.nrows(), |mode, _| 2.0 * modes.damping[mode] * modes.frequencies[mode]);
    let weighted = mass * &modes.shapes;
    &weighted * DMatrix::from_diagonal(&rates) * weighted.transpose()
}

impl<'a> DensePaper<'a> {
    /// Creates a run from rest with steps of `step` (s); `None` if M/h² + D/2h is singular.
    pub(super) fn new(scene: &'a BladeScene, step: f64) -> Option<Self> {
        let blades = scene.blades();
        let (inertia, damping) = (&blades.mass / (step * step), damping(scene) / (2.0 * step));
        let solve = (&inertia + &damping).lu();
        let prediction = [solve.solve(&(&inertia * 2.0 - &blades.stiffness))?, solve.solve(&(damping - inertia))?];
        let response = solve.solve(&blades.contact_map.transpose())?;
        let compliance = &blades.contact_map * &response;
        let rest = DMatrix::zeros(blades.mass.nrows(), blades.sectors);
        let [now, before, next] = [rest.clone(), rest.clone(), rest];
        Some(Self { blades, step, steps: 0, prediction, response, compliance, now, before, next })
    }

    /// Returns the displacements of all contact rows: rows × blades (m).
    pub(super) fn contact_rows(&self) -> DMatrix<f64> {
        &self.blades.contact_map * &self.now
    }

    /// Performs one step.
    ///
    /// # Errors
    /// A singular contact problem, or a motion that is not finite.
    pub(super) fn step(&mut self) -> Result<(), String> {
        self.steps += 1;
        self.next.gemm(1.0, &self.prediction[0], &self.now, 0.0);
        self.next.gemm(1.0, &self.prediction[1], &self.before, 1.0);
        let rows = &self.blades.contact_map * &self.next;
        for sector in 0..self.blades.sectors {
            let touching = self.touching(sector, &rows);
            if !touching.is_empty() {
                self.correct(sector, &touching).ok_or_else(|| format!("step {}: singular problem", self.steps))?;
            }
        }
        std::mem::swap(&mut self.before, &mut self.now);
        std::mem::swap(&mut self.now, &mut self.next);
        if self.now.amax() < 1.0 { Ok(()) } else { Err(format!("the motion diverged in step {}", self.steps)) }
    }

    /// Returns the nodes of a blade that penetrate at the predicted displacements, with their gaps and normals.
    fn touching(&self, sector: usize, rows: &DMatrix<f64>) -> Vec<(usize, Touch)> {
        let (blades, time) = (self.blades, f64::from(self.steps) * self.step);
        let pitch = TAU * sector as f64 / blades.sectors as f64;
        let clearance = blades.clearances.get(sector).copied().unwrap_or(blades.obstacle.clearance);
        let casing = BumpedCasing { clearance, ..blades.obstacle };
        let meets = |(node, tip): (usize, &RubTip)| {
            let moved = [0, 1, 2].map(|axis| rows[(3 * node + axis, sector)]);
            (node, casing.meets(&RubTip { angle: tip.angle + pitch, ..*tip }, time, moved))
        };
        blades.tips.iter().enumerate().map(meets).filter(|(_, touch)| touch.gap < 0.0).collect()
    }

    /// Closes the gaps of these nodes (eqs 10 and 11).
    fn correct(&mut self, sector: usize, touching: &[(usize, Touch)]) -> Option<()> {
        let entry = |i: usize, j: usize| {
            let ((row, normal), (column, force)) =
                ((touching[i].0, touching[i].1.normal), (touching[j].0, touching[j].1.force));
            let block = self.compliance.fixed_view::<3, 3>(3 * row, 3 * column);
            (0..9).map(|index| normal[index / 3] * block[(index / 3, index % 3)] * force[index % 3]).sum()
        };
        let matrix = DMatrix::from_fn(touching.len(), touching.len(), entry);
        let right = DVector::from_iterator(touching.len(), touching.iter().map(|(_, touch)| -touch.gap));
        let multipliers = matrix.lu().solve(&right)?;
        let mut displacements = self.next.column_mut(sector);
        for ((node, touch), multiplier) in touching.iter().zip(multipliers.iter()) {
            for axis in 0..3 {
                let force = multiplier * touch.force[axis];
                displacements.axpy(force, &self.response.column(3 * node + axis), 1.0);
            }
        }
        Some(())
    }
}
