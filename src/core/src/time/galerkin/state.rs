//! State of one sector between steps.

use nalgebra::DMatrix;

/// State of a sector between steps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SectorState {
    /// Modal amplitudes q.
    pub position: Vec<f64>,
    /// Modal velocities q̇.
    pub velocity: Vec<f64>,
    /// Contact forces on the rows (N).
    pub forces: Vec<f64>,
    /// Multipliers λ of the nodes (N).
    pub multipliers: Vec<f64>,
    /// Gaps of the nodes (m).
    pub gaps: Vec<f64>,
    /// Normals of the nodes in contact for which their forces were found.
    pub normals: Vec<f64>,
    /// Slopes of the forces over the last step (N/s) if contacts may stick, otherwise 0.
    pub slopes: Vec<f64>,
    /// True if gaps and normals are current; they are not evaluated at the end of a free flight.
    pub gaps_known: bool,
}

impl SectorState {
    /// State at rest without contact.
    pub fn new(modes: usize, nodes: usize) -> Self {
        Self {
            position: vec![0.0; modes],
            velocity: vec![0.0; modes],
            forces: vec![0.0; 3 * nodes],
            multipliers: vec![0.0; nodes],
            gaps: vec![f64::INFINITY; nodes],
            normals: vec![0.0; 3 * nodes],
            slopes: vec![0.0; 3 * nodes],
            gaps_known: true,
        }
    }

    /// Returns whether a contact pushes.
    pub(crate) fn is_loaded(&self) -> bool {
        self.multipliers.iter().any(|multiplier| *multiplier != 0.0)
    }

    /// Copies everything about the contacts, but not the modes.
    pub(crate) fn copy_contacts(&mut self, from: &Self) {
        self.forces.copy_from_slice(&from.forces);
        self.multipliers.copy_from_slice(&from.multipliers);
        self.gaps.copy_from_slice(&from.gaps);
        self.normals.copy_from_slice(&from.normals);
        self.slopes.copy_from_slice(&from.slopes);
    }

    /// Kinetic energy and strain energy (J), the latter including the residual flexibility.
    pub fn energies(&self, frequencies: &[f64], residual: &DMatrix<f64>) -> (f64, f64) {
        let kinetic = 0.5 * self.velocity.iter().map(|v| v * v).sum::<f64>();
        let strain = self.position.iter().zip(frequencies).map(|(q, w)| (w * q) * (w * q)).sum::<f64>();
        let held = residual.column_iter().zip(&self.forces).filter(|(_, force)| **force != 0.0);
        let held: f64 =
            held.map(|(column, force)| force * column.iter().zip(&self.forces).map(|(g, f)| g * f).sum::<f64>()).sum();
        (kinetic, 0.5 * (strain + held))
    }
}
