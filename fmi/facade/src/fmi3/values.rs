//! Getting and setting variables. Reals are `Float64`, integers and enumerations `Int64`; the functions of the other
//! types exist, and reject every reference because no variable has their type.

use std::ffi::c_char;

use super::Boolean;
use crate::boundary::{self, ADJOINT, DIRECTIONAL, In, InstanceHandle, Out, TextArgument, derivatives, guard};
use crate::shared::accessors;
use crate::slave::order::{CallRule, fmi3 as order};
use crate::slave::{AccessRequest, FmiStatus, Refusal};

accessors! {
    [nValues] fmi3GetString fmi3SetString "values";
    fmi3GetFloat64 fmi3SetFloat64 "Float64" f64, f64, |value| value, |value| *value;
    fmi3GetInt64 fmi3SetInt64 "Int64" i64, i64, |value| value, |value| *value;
    fmi3GetBoolean fmi3SetBoolean "Boolean" Boolean, bool, Boolean::from, |value| *value != 0;
}

/// Handles a type that no variable has: every reference is rejected with a message that states its actual type; a call
/// without references succeeds.
fn no_variable(
    instance: InstanceHandle,
    rule: &CallRule,
    type_name: &'static str,
    (references, count): (In<u32>, usize),
) -> FmiStatus {
    guard(instance, rule, |slave| {
        let references = references.array(count, slave.reference_limit(), "valueReferences")?;
        slave.elements(&AccessRequest { type_name, references, values: 0 })?;
        if references.is_empty() {
            Ok(())
        } else {
            Err(Refusal::error(format!("no variable has the type {type_name}")))
        }
    })
}

/// Defines functions of types that no variable has, with the arguments after the value references.
macro_rules! without_variables {
    ($($function:ident $rule:ident $name:literal $($argument:ident: $type:ty),*;)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $function(
            instance: InstanceHandle,
            valueReferences: In<u32>,
            nValueReferences: usize,
            $($argument: $type,)*
        ) -> FmiStatus {
            no_variable(instance, &order::$rule(stringify!($function)), $name, (valueReferences, nValueReferences))
        }
    )*};
}

without_variables! {
    fmi3GetFloat32 getter "Float32" _values: Out<f32>, _nValues: usize;
    fmi3SetFloat32 setter "Float32" _values: In<f32>, _nValues: usize;
    fmi3GetInt8 getter "Int8" _values: Out<i8>, _nValues: usize;
    fmi3SetInt8 setter "Int8" _values: In<i8>, _nValues: usize;
    fmi3GetUInt8 getter "UInt8" _values: Out<u8>, _nValues: usize;
    fmi3SetUInt8 setter "UInt8" _values: In<u8>, _nValues: usize;
    fmi3GetInt16 getter "Int16" _values: Out<i16>, _nValues: usize;
    fmi3SetInt16 setter "Int16" _values: In<i16>, _nValues: usize;
    fmi3GetUInt16 getter "UInt16" _values: Out<u16>, _nValues: usize;
    fmi3SetUInt16 setter "UInt16" _values: In<u16>, _nValues: usize;
    fmi3GetInt32 getter "Int32" _values: Out<i32>, _nValues: usize;
    fmi3SetInt32 setter "Int32" _values: In<i32>, _nValues: usize;
    fmi3GetUInt32 getter "UInt32" _values: Out<u32>, _nValues: usize;
    fmi3SetUInt32 setter "UInt32" _values: In<u32>, _nValues: usize;
    fmi3GetUInt64 getter "UInt64" _values: Out<u64>, _nValues: usize;
    fmi3SetUInt64 setter "UInt64" _values: In<u64>, _nValues: usize;
    fmi3GetBinary getter "Binary" _sizes: Out<usize>, _values: Out<*const u8>, _nValues: usize;
    fmi3SetBinary setter "Binary" _sizes: In<usize>, _values: In<*const u8>, _nValues: usize;
    fmi3GetClock getter "Clock" _values: Out<Boolean>;
    fmi3SetClock setter "Clock" _values: In<Boolean>;
}

/// Defines derivatives with respect to inputs over the last communication step, which require the parameter
/// `step_derivatives`; the last arguments are the numbers of values of unknowns and of knowns.
macro_rules! derivative {
    ($($name:ident $answer:ident $nSeed:ident $nSensitivity:ident $unknowns:ident $knowns:ident;)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $name(
            instance: InstanceHandle,
            unknowns: In<u32>,
            nUnknowns: usize,
            knowns: In<u32>,
            nKnowns: usize,
            seed: In<f64>,
            $nSeed: usize,
            sensitivity: Out<f64>,
            $nSensitivity: usize,
        ) -> FmiStatus {
            derivatives(
                (instance, stringify!($name), $answer),
                (unknowns, nUnknowns, $unknowns, "unknowns"),
                (knowns, nKnowns, $knowns, "knowns"),
                (seed, $nSeed, "seed"),
                (sensitivity, $nSensitivity, "sensitivity"),
            )
        }
    )*};
}

derivative! {
    fmi3GetDirectionalDerivative DIRECTIONAL nSeed nSensitivity nSensitivity nSeed;
    fmi3GetAdjointDerivative ADJOINT nSeed nSensitivity nSeed nSensitivity;
}
