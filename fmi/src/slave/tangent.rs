//! Derivatives of outputs over the last communication step: an extension, which a parameter of the FMU switches on.

use super::{Refusal, Result, Slave};

impl Slave {
    /// Refuse where the parameter is off, or not there.
    ///
    /// # Errors
    /// Says what it would need.
    pub(crate) fn check_derivatives(&self) -> Result<()> {
        if self.simulation.is_differentiated() {
            return Ok(());
        }
        Err(Refusal::error(if self.simulation.table().find("step_derivatives").is_some() {
            "this FMU has no derivatives at an instant: outputs do not depend on inputs of the same instant. For those of outputs at the \
             end of the last step by inputs over it, set the parameter step_derivatives to on (2) before initialisation"
        } else {
            "this FMU has no inputs that move or load something, and no derivatives. Ask for such inputs in the scene (whirl, moving, thermal), or do without"
        }))
    }

    /// Σ_j ∂y_i(t+H)/∂u_j s_j of the last communication step, for each output.
    ///
    /// # Errors
    /// As [`tiprub_core::Simulation::step_derivative`].
    pub(crate) fn directional(&mut self, outputs: &[u32], inputs: &[u32], seed: &[f64]) -> Result<Vec<f64>> {
        let mut sensitivity = vec![0.0; outputs.len()];
        self.simulation.step_derivative(outputs, inputs, seed, &mut sensitivity)?;
        Ok(sensitivity)
    }

    /// Σ_i s_i ∂y_i(t+H)/∂u_j of the last communication step, for each input.
    ///
    /// # Errors
    /// As [`Slave::directional`].
    pub(crate) fn adjoint(&mut self, outputs: &[u32], inputs: &[u32], seed: &[f64]) -> Result<Vec<f64>> {
        if let Some(wrong) = seed.iter().find(|value| !value.is_finite()) {
            return Err(Refusal::error(format!("seed {wrong} is not finite. Give finite seeds")));
        }
        let by = |input: &u32| {
            let sensitivity = self.directional(outputs, std::slice::from_ref(input), &[1.0])?;
            Ok(sensitivity.iter().zip(seed).map(|(value, seed)| value * seed).sum())
        };
        inputs.iter().map(by).collect()
    }
}
