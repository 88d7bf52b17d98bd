//! Warnings of a run, and the limits for its parameters.

use tiprub_cosim::warning::Warning;

use super::limits::{KnownChecks, Limits, Parameters, WarningState};
use crate::scene::settings::SceneSettings;

/// Warnings of a run, and the limits for its parameters. They follow from the saved state.
#[derive(Debug, Clone, Default)]
pub(crate) struct Diagnostics {
    /// Warnings since the start.
    pub warnings: Vec<Warning>,
    /// Warnings since [`tiprub_cosim::CoSimulation::take_notes`].
    pub notes: Vec<Warning>,
    /// Warnings reported since the start.
    pub reported: WarningState,
    /// Parameters for which the system was prepared.
    pub prepared: Option<Parameters>,
    /// Limits for the parameters that were checked last.
    pub limits: Option<Limits>,
    /// Stored results of slow checks.
    pub known: KnownChecks,
}

impl Diagnostics {
    /// Creates diagnostics without warnings, for a number of masters.
    pub fn new(bodies: usize) -> Self {
        Self { reported: WarningState::new(bodies), ..Self::default() }
    }

    /// Discards the warnings.
    pub fn clear(&mut self) {
        self.warnings.clear();
        self.notes.clear();
    }

    /// Adds a warning during a run, unless it is silenced.
    pub fn note(&mut self, warning: Warning, settings: &SceneSettings) {
        if !settings.is_silenced(warning.topic()) {
            self.warnings.push(warning.clone());
            self.notes.push(warning);
        }
    }

    /// Returns whether the system was prepared for the parameters that its tables depend on.
    pub(crate) fn is_prepared(&self, parameters: &Parameters) -> bool {
        let deciding = |from: &Parameters| {
            let numbers = [from.step, from.tolerance].map(f64::to_bits);
            (numbers, from.scheme, from.solver, from.damping_ratios.clone(), from.mode_damping.clone())
        };
        self.prepared.as_ref().is_some_and(|prepared| deciding(prepared) == deciding(parameters))
    }
}
