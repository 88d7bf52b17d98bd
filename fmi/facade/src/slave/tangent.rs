//! Derivatives of outputs over the last communication step, an extension of units that support it.

use super::{Refusal, Result, Slave};

impl Slave {
    /// Rejects the call if the unit has no derivatives.
    ///
    /// # Errors
    /// A unit without derivatives; the message states what they require.
    pub(crate) fn check_derivatives(&self) -> Result<()> {
        self.unit.no_derivatives().map_or(Ok(()), |reason| Err(Refusal::error(reason)))
    }

    /// Computes Σ_j ∂y_i(t+H)/∂u_j s_j of the last communication step, for each output.
    ///
    /// # Errors
    /// Same as [`tiprub_cosim::CoSimulation::step_derivative`].
    pub(crate) fn directional(&mut self, outputs: &[u32], inputs: &[u32], seed: &[f64]) -> Result<Vec<f64>> {
        let mut sensitivity = vec![0.0; outputs.len()];
        self.unit.step_derivative(outputs, inputs, seed, &mut sensitivity)?;
        Ok(sensitivity)
    }

    /// Computes Σ_i s_i ∂y_i(t+H)/∂u_j of the last communication step, for each input.
    ///
    /// # Errors
    /// Same as [`Slave::directional`].
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
