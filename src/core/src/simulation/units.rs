//! Units and enumerations of the variables.

use tiprub_cosim::variables::{Enumeration, VariableUnit};

/// rad/s.
pub(crate) static ANGULAR_SPEED: VariableUnit = VariableUnit {
    name: "rad/s",
    quantity: "AngularVelocity",
    exponents: [0, 0, -1, 1, 0],
    display: &[("rpm", 9.549_296_585_513_72)],
};
/// rad.
pub(crate) static ANGLE: VariableUnit = VariableUnit {
    name: "rad",
    quantity: "Angle",
    exponents: [0, 0, 0, 1, 0],
    display: &[("deg", 57.295_779_513_082_32), ("rev", 0.159_154_943_091_895_35)],
};
/// m.
pub static LENGTH: VariableUnit =
    VariableUnit { name: "m", quantity: "Length", exponents: [0, 1, 0, 0, 0], display: &[("mm", 1e3), ("um", 1e6)] };
/// m/s.
pub(crate) static LINEAR_SPEED: VariableUnit =
    VariableUnit { name: "m/s", quantity: "Velocity", exponents: [0, 1, -1, 0, 0], display: &[] };
/// s.
pub static TIME: VariableUnit =
    VariableUnit { name: "s", quantity: "Time", exponents: [0, 0, 1, 0, 0], display: &[("ms", 1e3), ("us", 1e6)] };
/// Pa.
pub static PRESSURE: VariableUnit =
    VariableUnit { name: "Pa", quantity: "Pressure", exponents: [1, -1, -2, 0, 0], display: &[("MPa", 1e-6)] };
/// Pa, for stresses.
pub static STRESS: VariableUnit =
    VariableUnit { name: "Pa", quantity: "Stress", exponents: [1, -1, -2, 0, 0], display: &[("MPa", 1e-6)] };
/// N.
pub static FORCE: VariableUnit =
    VariableUnit { name: "N", quantity: "Force", exponents: [1, 1, -2, 0, 0], display: &[("kN", 1e-3)] };
/// N.m.
pub(crate) static TORQUE: VariableUnit =
    VariableUnit { name: "N.m", quantity: "Torque", exponents: [1, 2, -2, 0, 0], display: &[("kN.m", 1e-3)] };
/// N.s.
pub(crate) static IMPULSE: VariableUnit =
    VariableUnit { name: "N.s", quantity: "Impulse", exponents: [1, 1, -1, 0, 0], display: &[("mN.s", 1e3)] };
/// W.
pub(crate) static POWER: VariableUnit =
    VariableUnit { name: "W", quantity: "Power", exponents: [1, 2, -3, 0, 0], display: &[("kW", 1e-3)] };
/// J.
pub static ENERGY: VariableUnit =
    VariableUnit { name: "J", quantity: "Energy", exponents: [1, 2, -2, 0, 0], display: &[("mJ", 1e3)] };

pub(crate) static INPUT_INTERPOLATIONS: Enumeration = Enumeration {
    name: "InputInterpolation",
    description: "Interpolation of inputs between communication points",
    items: &[
        ("ramp", "Linear from the current value to the new value, reached at the end of the communication step"),
        ("hold", "The new value acts immediately, as a jump within one internal step"),
    ],
};

/// Items of `step_derivatives`.
pub(crate) static STEP_DERIVATIVES: Enumeration = Enumeration {
    name: "StepDerivatives",
    description: "Result of the functions for directional derivatives",
    items: &[
        ("off", "None: calls are rejected"),
        (
            "on",
            "Derivatives of outputs at the end of the last communication step with respect to inputs during that step",
        ),
    ],
};

/// K; without degC, since temperatures are differences from the reference.
pub static TEMPERATURE: VariableUnit =
    VariableUnit { name: "K", quantity: "TemperatureDifference", exponents: [0, 0, 0, 0, 1], display: &[] };
/// N/m.
pub(crate) static LINE_LOAD: VariableUnit = VariableUnit {
    name: "N/m",
    quantity: "LinearForceDensity",
    exponents: [1, 0, -2, 0, 0],
    display: &[("kN/m", 1e-3)],
};
/// m³.
pub(crate) static VOLUME: VariableUnit =
    VariableUnit { name: "m3", quantity: "Volume", exponents: [0, 3, 0, 0, 0], display: &[("mm3", 1e9)] };
