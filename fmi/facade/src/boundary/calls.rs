//! Calls that exist in both versions of the standard and differ only in names and C types.

use std::ffi::{CString, c_char};

use super::instance::{InstanceHandle, enter, guard};
use super::{In, Out, TextArgument};
use crate::slave::order::{CallRule, unsupported};
use crate::slave::{AccessRequest, Dialect, FmiStatus, FmiValue, Refusal, Result, Slave};

/// Returns the argument names of get and set functions: references, values.
fn arguments(dialect: Dialect) -> (&'static str, &'static str) {
    match dialect {
        Dialect::Fmi2 => ("vr", "value"),
        Dialect::Fmi3 => ("valueReferences", "values"),
    }
}

/// Returns values of one type; `convert` creates the C value.
pub(crate) fn get<T: FmiValue, C: Copy>(
    (handle, rule, type_name): (InstanceHandle, &CallRule, &'static str),
    (references, count): (In<u32>, usize),
    (values, n_values): (Out<C>, usize),
    convert: impl Fn(T) -> C,
) -> FmiStatus {
    guard(handle, rule, |slave| {
        let (reference_argument, value_argument) = arguments(slave.dialect());
        let references = references.array(count, slave.reference_limit(), reference_argument)?;
        let window = values.window(n_values, value_argument)?;
        let read = slave.read::<T>(&AccessRequest { type_name, references, values: n_values })?;
        window.fill(&read.into_iter().map(convert).collect::<Vec<_>>());
        Ok(())
    })
}

/// Sets values of one type; `convert` creates the Rust value, or describes the problem with the C value.
pub(crate) fn set<T: FmiValue, C>(
    (handle, rule, type_name): (InstanceHandle, &CallRule, &'static str),
    (references, count): (In<u32>, usize),
    (values, n_values): (In<C>, usize),
    convert: impl Fn(&C) -> Result<T>,
) -> FmiStatus {
    guard(handle, rule, |slave| {
        let (reference_argument, value_argument) = arguments(slave.dialect());
        let references = references.array(count, slave.reference_limit(), reference_argument)?;
        let elements = slave.elements(&AccessRequest { type_name, references, values: n_values })?;
        let values = values.array(elements.len(), usize::MAX, value_argument)?;
        slave.write(&elements, &values.iter().map(convert).collect::<Result<Vec<T>>>()?)
    })
}

/// Returns strings, which the instance owns until the next call that returns strings.
pub(crate) fn strings(
    (handle, rule): (InstanceHandle, &CallRule),
    (references, count): (In<u32>, usize),
    (values, n_values): (Out<*const c_char>, usize),
) -> FmiStatus {
    guard(handle, rule, |slave| {
        let (reference_argument, value_argument) = arguments(slave.dialect());
        let references = references.array(count, slave.reference_limit(), reference_argument)?;
        let window = values.window(n_values, value_argument)?;
        let read = slave.read::<String>(&AccessRequest { type_name: "String", references, values: n_values })?;
        let texts = read.into_iter().map(|text| CString::new(text.replace('\0', " ")).unwrap_or_default()).collect();
        window.fill(&slave.keep(texts).iter().map(|text| text.as_ptr()).collect::<Vec<_>>());
        Ok(())
    })
}

/// Implements `fmi2SetDebugLogging` and `fmi3SetDebugLogging`.
pub(crate) fn set_debug_logging(
    handle: InstanceHandle,
    rule: &CallRule,
    on: bool,
    (categories, count): (In<TextArgument>, usize),
) -> FmiStatus {
    let outcome = enter(handle, rule, |_, instance| {
        let categories = categories.array(count, 64, "categories")?;
        let names = categories.iter().map(|name| name.required("categories")).collect::<Result<Vec<_>>>()?;
        instance.log.choose(on, &names).map_err(Refusal::error)?;
        Ok((FmiStatus::Ok, ()))
    });
    outcome.0
}

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

/// `fmi2FMUstate`, `fmi3FMUState`: an opaque handle of a saved state.
pub(crate) type StateHandle = *const Vec<u8>;

/// Saved states.
pub(crate) mod state {
    use super::*;

    fn required(state: StateHandle) -> Result<StateHandle> {
        if state.is_null() {
            return Err(Refusal::error("argument FMUstate is NULL. Pass a state that was saved by this instance"));
        }
        Ok(state)
    }

    /// Saves into a new state, or into the one that `*state` refers to.
    pub(crate) fn save(handle: InstanceHandle, rule: &CallRule, state: Out<StateHandle>) -> FmiStatus {
        guard(handle, rule, |slave| {
            let window = state.single("FMUstate")?;
            let existing = window.current().filter(|existing| !existing.is_null());
            slave.save(existing).map(|saved| window.fill(&[saved]))
        })
    }

    /// Restores a state.
    pub(crate) fn restore(handle: InstanceHandle, rule: &CallRule, state: StateHandle) -> FmiStatus {
        guard(handle, rule, |slave| slave.restore(required(state)?))
    }

    /// Frees a state; NULL, or a pointer to NULL, is legal.
    pub(crate) fn free(handle: InstanceHandle, rule: &CallRule, state: Out<StateHandle>) -> FmiStatus {
        guard(handle, rule, |slave| {
            if state.is_null() {
                return Ok(());
            }
            let window = state.single("FMUstate")?;
            if let Some(existing) = window.current().filter(|existing| !existing.is_null()) {
                slave.free_snapshot(existing)?;
                window.fill(&[std::ptr::null()]);
            }
            Ok(())
        })
    }

    /// Writes the size in bytes.
    pub(crate) fn size(handle: InstanceHandle, rule: &CallRule, state: StateHandle, size: Out<usize>) -> FmiStatus {
        guard(handle, rule, |slave| {
            let window = size.single("size")?;
            slave.serialised(required(state)?).map(|saved| window.fill(&[saved.len()]))
        })
    }

    fn check_size(given: usize, needed: usize) -> Result<()> {
        if given == needed {
            return Ok(());
        }
        Err(Refusal::error(format!(
            "size = {given}, but a serialised state of this FMU has {needed} bytes. Pass that size"
        )))
    }

    /// Serialises a state.
    pub(crate) fn serialise(
        handle: InstanceHandle,
        rule: &CallRule,
        state: StateHandle,
        bytes: Out<u8>,
        size: usize,
    ) -> FmiStatus {
        guard(handle, rule, |slave: &mut Slave| {
            let saved = slave.serialised(required(state)?)?;
            check_size(size, saved.len())?;
            bytes.window(size, "serializedState").map(|window| window.fill(saved))
        })
    }

    /// Deserialises into a new state, or into the one that `*state` refers to.
    pub(crate) fn deserialise(
        handle: InstanceHandle,
        rule: &CallRule,
        bytes: In<u8>,
        size: usize,
        state: Out<StateHandle>,
    ) -> FmiStatus {
        guard(handle, rule, |slave| {
            let window = state.single("FMUstate")?;
            check_size(size, slave.serialised_size())?;
            let bytes = bytes.array(size, size, "serializedState")?;
            let existing = window.current().filter(|existing| !existing.is_null());
            slave.deserialise(bytes, existing).map(|saved| window.fill(&[saved]))
        })
    }
}
