//! Units and enumerations of the variables.

use crate::variables::{Enumeration, Unit};

/// rad/s.
pub static ANGULAR_SPEED: Unit =
    Unit { name: "rad/s", exponents: [0, 0, -1, 1, 0], display: &[("rpm", 9.549_296_585_513_72)] };
/// rad.
pub static ANGLE: Unit = Unit {
    name: "rad",
    exponents: [0, 0, 0, 1, 0],
    display: &[("deg", 57.295_779_513_082_32), ("rev", 0.159_154_943_091_895_35)],
};
/// m.
pub static LENGTH: Unit = Unit { name: "m", exponents: [0, 1, 0, 0, 0], display: &[("mm", 1e3), ("um", 1e6)] };
/// m/s.
pub static LINEAR_SPEED: Unit = Unit { name: "m/s", exponents: [0, 1, -1, 0, 0], display: &[] };
/// s.
pub static TIME: Unit = Unit { name: "s", exponents: [0, 0, 1, 0, 0], display: &[("ms", 1e3), ("us", 1e6)] };
/// Pa.
pub static PRESSURE: Unit = Unit { name: "Pa", exponents: [1, -1, -2, 0, 0], display: &[("MPa", 1e-6)] };
/// N.
pub static FORCE: Unit = Unit { name: "N", exponents: [1, 1, -2, 0, 0], display: &[("kN", 1e-3)] };
/// N.m.
pub static TORQUE: Unit = Unit { name: "N.m", exponents: [1, 2, -2, 0, 0], display: &[] };
/// N.s.
pub static IMPULSE: Unit = Unit { name: "N.s", exponents: [1, 1, -1, 0, 0], display: &[] };
/// W.
pub static POWER: Unit = Unit { name: "W", exponents: [1, 2, -3, 0, 0], display: &[("kW", 1e-3)] };
/// J.
pub static ENERGY: Unit = Unit { name: "J", exponents: [1, 2, -2, 0, 0], display: &[("mJ", 1e3)] };

pub static INPUT_INTERPOLATIONS: Enumeration = Enumeration {
    name: "InputInterpolation",
    description: "Inputs between communication points",
    items: &[
        ("ramp", "From the value reached to the one set, which is reached at the end of the step"),
        ("hold", "The value set acts at once: a jump within one internal step"),
    ],
};

/// K; temperatures are differences from the reference, so that there is no degC.
pub static TEMPERATURE: Unit = Unit { name: "K", exponents: [0, 0, 0, 0, 1], display: &[] };
/// N/m.
pub static LINE_LOAD: Unit = Unit { name: "N/m", exponents: [1, 0, -2, 0, 0], display: &[("kN/m", 1e-3)] };
/// m³.
pub static VOLUME: Unit = Unit { name: "m3", exponents: [0, 3, 0, 0, 0], display: &[("mm3", 1e9)] };
