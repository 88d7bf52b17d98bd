//! Four methods for the cube between two rings with separate time stepping and contact: [`film`], `bipotential`,
//! [`augmented`] and [`penalty`]. They share only the finite-element matrices, the surfaces and the contact search
//! ([`contact`]).

pub mod augmented;
pub(crate) mod bipotential;
mod blocks;
pub mod contact;
pub mod film;
mod operator;
pub mod penalty;
mod recorder;

use crate::cube::history::CubeHistory;
use crate::cube::scene::CubeScene;

/// Duration and resolution of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodRun {
    /// Step h (s).
    pub step: f64,
    /// End (s).
    pub end: f64,
    /// Number of steps between records.
    pub stride: usize,
    /// Times at which the displacements of all masters are recorded, at the first recorded step at or after each of
    /// them (s), ascending.
    pub snapshots: Vec<f64>,
}

impl MethodRun {
    /// Returns the number of steps to the end.
    pub(crate) fn steps(&self) -> usize {
        let mut steps = 0;
        while (steps as f64 + 0.5) * self.step < self.end {
            steps += 1;
        }
        steps
    }
}

/// Method, with a name for reports.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CubeMethod {
    /// [`film`].
    Film(film::FilmOptions),
    /// `bipotential`.
    Bipotential,
    /// [`augmented`].
    Augmented(augmented::AugmentedOptions),
    /// [`penalty`].
    Penalty(penalty::PenaltyOptions),
}

impl CubeMethod {
    /// Runs the scene.
    ///
    /// # Errors
    /// A mass or iteration matrix that is not positive definite; a solver that does not converge; an unstable
    /// explicit step.
    pub fn run(self, scene: &CubeScene, run: &MethodRun) -> tiprub_model::Result<CubeHistory> {
        match self {
            Self::Film(options) => film::run(scene, run, options),
            Self::Bipotential => bipotential::run(scene, run),
            Self::Augmented(options) => augmented::run(scene, run, options),
            Self::Penalty(options) => penalty::run(scene, run, options),
        }
    }
}
