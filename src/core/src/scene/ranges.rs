//! Allowed range of every number in a scene or a ROM, in one table. Beyond it no real machine is described, and sums and squares of such
//! numbers lose the digits of the others. Implausible values within the range are checked by [`crate::limits::plausibility`].

/// Largest coordinate of a contact node, and largest radius (m): eight times a wind turbine.
pub const POSITION: f64 = 1e3;
/// Smallest radius of a contact node (m): that of a hair.
pub(crate) const SMALLEST_RADIUS: f64 = 1e-5;
/// The model does not describe gaps, casing shapes and displacements beyond this fraction of the radius, or of the extent of open surfaces.
pub const SMALL: f64 = 0.1;
/// Largest slope of a tip contour (-): 0.06° off a plane face.
pub const SLOPE: f64 = 1e3;
/// Largest entry of a contact map, in any unit of the coordinates: 1/√m of a mass of 1e-30 kg.
pub(crate) const MAP: f64 = 1e15;
/// Largest stress of a unit coordinate (Pa): the stress of the largest strain of a contact map in diamond.
pub(crate) const STRESS_MAP: f64 = 1e27;
/// Largest thermal load of a patch (N/K), in any unit of the coordinates.
pub(crate) const THERMAL_LOAD: f64 = 1e15;
/// Largest angular velocity (rad/s): eight times that of the fastest turbines, in dental drills.
pub const SPEED: f64 = 1e6;
/// Largest velocity of a free body (m/s): ten times the escape velocity from the solar system.
pub const VELOCITY: f64 = 1e5;
/// Largest angle (rad) of a phase: a larger angle loses too many digits of its remainder.
pub const ANGLE: f64 = 1e6;
/// Largest angle (rad) of an input that may turn for hours: an angle of that size is rounded to 1e-4 rad.
pub const TURNED: f64 = 1e12;
/// Largest line load (N/m): a thousand times the strength of any casing.
pub const LINE_LOAD: f64 = 1e12;
/// Smallest and largest depth factor of bumps (-), whose heights are checked against the radius.
pub const DEPTH: f64 = 1e12;
/// Smallest and largest width parameter of bumps (-).
pub const LOBE_WIDTH: [f64; 2] = [1e-3, 0.25];
/// Largest number of lobes around the circumference.
pub const LOBES: f64 = 1e6;
/// Longest internal step (s): far above the period of any mode of a blade.
pub const LONGEST_STEP: f64 = 1.0;
/// Largest number of internal steps of one communication step.
pub const STEPS: f64 = 1e9;
/// Largest number of threads of a unit.
pub const THREADS: f64 = 64.0;
/// Smallest and largest error of a step, as a fraction of the clearance: below, it is mostly rounding.
pub const TOLERANCE: [f64; 2] = [1e-9, 0.1];
/// Largest friction coefficient.
pub const FRICTION: f64 = 2.0;
/// Largest damping ratio of a scene.
pub const DAMPING: f64 = 0.99;
/// Largest amplitude of the excitation of a blade (N): a thousand times the force that tears it off.
pub const EXCITATION: f64 = 1e9;
/// Largest engine order.
pub const ENGINE_ORDER: f64 = 1e6;
/// Largest angle of an excitation per internal step (rad): a step of the recurrences assumes it to be constant.
pub(crate) const EXCITED_ANGLE: f64 = 1.0;
/// Largest fraction of stiffness lost per kelvin (1/K): twenty times that of a metal.
pub const SOFTENING: f64 = 1e-2;
/// Smallest and largest remaining fraction of the stiffness at a temperature (-).
pub(crate) const SOFTENED: [f64; 2] = [0.1, 2.0];
/// Smallest and largest mistuning factor: beyond them it is a different blade.
pub const FREQUENCY_FACTORS: [f64; 2] = [0.5, 2.0];
/// Smallest number of data points for a closed cubic spline, and an upper bound above that of any mesh.
pub(crate) const SPLINE_AROUND: [usize; 2] = [4, 2000];
/// Smallest and largest number of rings of data points.
pub(crate) const SPLINE_ALONG: [usize; 2] = [2, 200];
/// Coating thickness (m): from a few atoms, whose effect on blades that move by micrometres is lost in rounding, to a tenth of a metre;
/// real coatings have millimetres.
pub const THICKNESS: [f64; 2] = [1e-9, 0.1];
/// Modulus of a coating (Pa): from any positive value, however soft, to above that of any solid.
pub const MODULUS: [f64; 2] = [5e-324, 1e13];
/// Largest yield stress and hardening of a coating (Pa), above that of any solid.
pub const STRESS: f64 = 1e13;
/// Specific cutting energy of a coating (J/m³): from softer than any foam to harder to cut than any alloy.
pub const CUTTING_ENERGY: [f64; 2] = [1e3, 1e12];
/// Normal force per tangential force of a cut: from tools that are drawn in to tips that hardly cut.
pub const NORMAL_RATIO: [f64; 2] = [0.05, 20.0];
/// Width around the circumference over which a tip presses a coating (m): from a foil to a metre.
pub const CONTACT_WIDTH: [f64; 2] = [1e-6, 1.0];
/// Largest number of cells of a coating: 80 megabytes of state.
pub(crate) const CELLS: usize = 10_000_000;
