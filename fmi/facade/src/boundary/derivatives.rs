//! Directional and adjoint derivatives, for which both versions of the standard have functions.

use super::{In, InstanceHandle, Out, guard};
use crate::slave::order::unsupported;
use crate::slave::{AccessRequest, Dialect, FmiStatus, Result, Slave};

/// Value references, their number, the number of their values, and the name of the argument.
pub(crate) type ReferenceArguments = (In<u32>, usize, usize, &'static str);

/// Function of the slave that computes derivatives.
type DerivativeFunction = fn(&mut Slave, &[u32], &[u32], &[f64]) -> Result<Vec<f64>>;

/// Forward derivatives: changes of outputs caused by changes of inputs.
pub(crate) const DIRECTIONAL: DerivativeFunction = Slave::directional;
/// Backward derivatives: weights of inputs from weights of outputs.
pub(crate) const ADJOINT: DerivativeFunction = Slave::adjoint;

/// Computes derivatives of `unknowns` with respect to `knowns`; `seed` and `sensitivity` contain the names of their
/// arguments.
pub(crate) fn derivatives(
    (handle, name, answer): (InstanceHandle, &'static str, DerivativeFunction),
    unknowns: ReferenceArguments,
    knowns: ReferenceArguments,
    (seed, seeds, seed_name): (In<f64>, usize, &'static str),
    (sensitivity, sensitivities, sensitivity_name): (Out<f64>, usize, &'static str),
) -> FmiStatus {
    guard(handle, &unsupported(name), |slave| {
        slave.check_derivatives()?;
        let type_name = if slave.dialect() == Dialect::Fmi2 { "Real" } else { "Float64" };
        let elements = |slave: &Slave, (references, count, values, name): ReferenceArguments| {
            let references = references.array(count, slave.reference_limit(), name)?;
            slave.elements(&AccessRequest { type_name, references, values })
        };
        let (outputs, inputs) = (elements(slave, unknowns)?, elements(slave, knowns)?);
        let seed = seed.array(seeds, usize::MAX, seed_name)?;
        let window = sensitivity.window(sensitivities, sensitivity_name)?;
        answer(slave, &outputs, &inputs, seed).map(|values| window.fill(&values))
    })
}
