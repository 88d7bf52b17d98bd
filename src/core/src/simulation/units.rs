//! Units and enumerations of the variables.

use tiprub_cosim::units;
use tiprub_cosim::variables::Enumeration;

units! {
    ANGULAR_SPEED "rad/s" "AngularVelocity" [0, 0, -1, 1, 0] [("rpm", 9.549_296_585_513_72)];
    ANGLE "rad" "Angle" [0, 0, 0, 1, 0] [("deg", 57.295_779_513_082_32), ("rev", 0.159_154_943_091_895_35)];
    LENGTH "m" "Length" [0, 1, 0, 0, 0] [("mm", 1e3), ("um", 1e6)];
    LINEAR_SPEED "m/s" "Velocity" [0, 1, -1, 0, 0] [];
    TIME "s" "Time" [0, 0, 1, 0, 0] [("ms", 1e3), ("us", 1e6)];
    PRESSURE "Pa" "Pressure" [1, -1, -2, 0, 0] [("MPa", 1e-6)];
    STRESS "Pa" "Stress" [1, -1, -2, 0, 0] [("MPa", 1e-6)];
    FORCE "N" "Force" [1, 1, -2, 0, 0] [("kN", 1e-3)];
    TORQUE "N.m" "Torque" [1, 2, -2, 0, 0] [("kN.m", 1e-3)];
    IMPULSE "N.s" "Impulse" [1, 1, -1, 0, 0] [("mN.s", 1e3)];
    POWER "W" "Power" [1, 2, -3, 0, 0] [("kW", 1e-3)];
    ENERGY "J" "Energy" [1, 2, -2, 0, 0] [("mJ", 1e3)];
    // Without degC, since temperatures are differences from the reference.
    TEMPERATURE "K" "TemperatureDifference" [0, 0, 0, 0, 1] [];
    LINE_LOAD "N/m" "LinearForceDensity" [1, 0, -2, 0, 0] [("kN/m", 1e-3)];
    VOLUME "m3" "Volume" [0, 3, 0, 0, 0] [("mm3", 1e9)];
}

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
