//! Modes of a symmetric pencil.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Mass-normalised modes with modal damping.
#[derive(Debug, Clone, PartialEq)]
pub struct DampedModes {
    /// Angular frequencies ω (rad/s).
    pub frequencies: Vec<f64>,
    /// Damping ratio ξ of all modes.
    pub damping: Vec<f64>,
    /// Shapes, coordinates × modes.
    pub shapes: DMatrix<f64>,
}

/// Fraction of the largest squared frequency below which a mode is a rigid-body mode.
const RIGID: f64 = 1e-12;

impl DampedModes {
    /// Solves K φ = ω² M φ by Cholesky's factor of the mass; `None` if the mass is not positive definite.
    pub(crate) fn new(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>, damping: f64) -> Option<Self> {
        let lower = mass.clone().cholesky()?.l();
        let half = lower.solve_lower_triangular(stiffness)?;
        let whole = lower.solve_lower_triangular(&half.transpose())?;
        let eigen = SymmetricEigen::new((&whole + whole.transpose()) * 0.5);
        let largest = eigen.eigenvalues.amax();
        let root = |square: f64| if square < RIGID * largest { 0.0 } else { square.sqrt() };
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let shapes = lower.transpose().solve_upper_triangular(&eigen.eigenvectors)?;
        Some(Self {
            frequencies: order.iter().map(|mode| root(eigen.eigenvalues[*mode])).collect(),
            damping: vec![damping; order.len()],
            shapes: shapes.select_columns(&order),
        })
    }

    /// Returns `count` uncoupled copies; the shapes are those of one copy.
    #[must_use]
    pub(crate) fn repeated(self, count: usize) -> Self {
        Self { frequencies: self.frequencies.repeat(count), damping: self.damping.repeat(count), shapes: self.shapes }
    }

    /// Returns the number of modes.
    pub(crate) fn len(&self) -> usize {
        self.frequencies.len()
    }

    /// Returns the largest angular frequency (rad/s).
    pub(crate) fn largest_frequency(&self) -> f64 {
        self.frequencies.iter().fold(0.0, |largest, value| f64::max(largest, *value))
    }

    /// Returns φᵀ f for forces on the coordinates.
    pub(crate) fn force(&self, force: &DVector<f64>) -> Vec<f64> {
        (self.shapes.transpose() * force).iter().copied().collect()
    }

    /// Returns the modal amplitudes φᵀ M u of displacements or velocities of the coordinates.
    pub(crate) fn amplitudes(&self, mass: &DMatrix<f64>, values: &DVector<f64>) -> Vec<f64> {
        self.force(&(mass * values))
    }
}
