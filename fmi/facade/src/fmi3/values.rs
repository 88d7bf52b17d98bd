//! Getting and setting variables. Reals are `Float64`, integers and enumerations `Int64`; the functions of the other
//! types exist, and reject every reference because no variable has their type.

use std::ffi::c_char;

use super::Boolean;
use crate::boundary::{self, ADJOINT, DIRECTIONAL, In, InstanceHandle, Out, TextArgument, derivatives, guard};
use crate::slave::order::{CallRule, fmi3 as order};
use crate::slave::{AccessRequest, FmiStatus, Refusal};

/// Defines functions of a type that has variables: exported getter and setter, their rules, name of the type, C type,
/// Rust type, conversions.
macro_rules! with_variables {
    ($($get:ident $get_rule:ident $set:ident $set_rule:ident $name:literal $c:ty, $rust:ty, $out:expr, $in:expr;)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $get(
            instance: InstanceHandle,
            valueReferences: In<u32>,
            nValueReferences: usize,
            values: Out<$c>,
            nValues: usize,
        ) -> FmiStatus {
            let convert: fn($rust) -> $c = $out;
            let target = (instance, &order::$get_rule, $name);
            boundary::get(target, (valueReferences, nValueReferences), (values, nValues), convert)
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $set(
            instance: InstanceHandle,
            valueReferences: In<u32>,
            nValueReferences: usize,
            values: In<$c>,
            nValues: usize,
        ) -> FmiStatus {
            let convert: fn(&$c) -> $rust = $in;
            let target = (instance, &order::$set_rule, $name);
            boundary::set(target, (valueReferences, nValueReferences), (values, nValues), |value| Ok(convert(value)))
        }
    )*};
}

with_variables! {
    fmi3GetFloat64 GET_FLOAT64 fmi3SetFloat64 SET_FLOAT64 "Float64" f64, f64, |value| value, |value| *value;
    fmi3GetInt64 GET_INT64 fmi3SetInt64 SET_INT64 "Int64" i64, i64, |value| value, |value| *value;
    fmi3GetBoolean GET_BOOLEAN fmi3SetBoolean SET_BOOLEAN "Boolean" Boolean, bool, Boolean::from, |value| *value != 0;
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3GetString(
    instance: InstanceHandle,
    valueReferences: In<u32>,
    nValueReferences: usize,
    values: Out<*const c_char>,
    nValues: usize,
) -> FmiStatus {
    boundary::strings((instance, &order::GET_STRING), (valueReferences, nValueReferences), (values, nValues))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3SetString(
    instance: InstanceHandle,
    valueReferences: In<u32>,
    nValueReferences: usize,
    values: In<TextArgument>,
    nValues: usize,
) -> FmiStatus {
    let target = (instance, &order::SET_STRING, "String");
    boundary::set(target, (valueReferences, nValueReferences), (values, nValues), |value: &TextArgument| {
        value.required("values").map(str::to_owned)
    })
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
            Ok(FmiStatus::Ok)
        } else {
            Err(Refusal::error(format!("no variable has the type {type_name}")))
        }
    })
}

/// Defines functions of a type that no variable has.
macro_rules! without_variables {
    ($($get:ident $get_rule:ident $set:ident $set_rule:ident $name:literal $c:ty;)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $get(
            instance: InstanceHandle,
            valueReferences: In<u32>,
            nValueReferences: usize,
            _values: Out<$c>,
            _nValues: usize,
        ) -> FmiStatus {
            no_variable(instance, &order::$get_rule, $name, (valueReferences, nValueReferences))
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $set(
            instance: InstanceHandle,
            valueReferences: In<u32>,
            nValueReferences: usize,
            _values: In<$c>,
            _nValues: usize,
        ) -> FmiStatus {
            no_variable(instance, &order::$set_rule, $name, (valueReferences, nValueReferences))
        }
    )*};
}

without_variables! {
    fmi3GetFloat32 GET_FLOAT32 fmi3SetFloat32 SET_FLOAT32 "Float32" f32;
    fmi3GetInt8 GET_INT8 fmi3SetInt8 SET_INT8 "Int8" i8;
    fmi3GetUInt8 GET_UINT8 fmi3SetUInt8 SET_UINT8 "UInt8" u8;
    fmi3GetInt16 GET_INT16 fmi3SetInt16 SET_INT16 "Int16" i16;
    fmi3GetUInt16 GET_UINT16 fmi3SetUInt16 SET_UINT16 "UInt16" u16;
    fmi3GetInt32 GET_INT32 fmi3SetInt32 SET_INT32 "Int32" i32;
    fmi3GetUInt32 GET_UINT32 fmi3SetUInt32 SET_UINT32 "UInt32" u32;
    fmi3GetUInt64 GET_UINT64 fmi3SetUInt64 SET_UINT64 "UInt64" u64;
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3GetBinary(
    instance: InstanceHandle,
    valueReferences: In<u32>,
    nValueReferences: usize,
    _valueSizes: Out<usize>,
    _values: Out<*const u8>,
    _nValues: usize,
) -> FmiStatus {
    no_variable(instance, &order::GET_BINARY, "Binary", (valueReferences, nValueReferences))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3SetBinary(
    instance: InstanceHandle,
    valueReferences: In<u32>,
    nValueReferences: usize,
    _valueSizes: In<usize>,
    _values: In<*const u8>,
    _nValues: usize,
) -> FmiStatus {
    no_variable(instance, &order::SET_BINARY, "Binary", (valueReferences, nValueReferences))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3GetClock(
    instance: InstanceHandle,
    valueReferences: In<u32>,
    nValueReferences: usize,
    _values: Out<Boolean>,
) -> FmiStatus {
    no_variable(instance, &order::GET_CLOCK, "Clock", (valueReferences, nValueReferences))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3SetClock(
    instance: InstanceHandle,
    valueReferences: In<u32>,
    nValueReferences: usize,
    _values: In<Boolean>,
) -> FmiStatus {
    no_variable(instance, &order::SET_CLOCK, "Clock", (valueReferences, nValueReferences))
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
