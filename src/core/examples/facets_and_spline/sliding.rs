//! One blade node on a spring, pressed against a round casing and turned at constant speed.
//!
//! Central differences with the gap closed at every step: u⁺ = u_p + λ (n·e) h²/(m d), λ = max(0, −g_p/W),
//! W = (n·e)² h²/(m d), d = 1 + ξωh, with e the radial direction and g_p, n from the closest point to the predicted place.

use std::f64::consts::TAU;

use tiprub_core::geometry::Vector3;
use tiprub_core::geometry::surface_spline::{Projection, SurfaceSpline};
use tiprub_core::scene::settings::{Closure, Interpolation};

/// Radius of the data points of the casing (m).
pub const RADIUS: f64 = 0.25;
/// Data points around.
pub const AROUND: usize = 36;
/// Mass of the node (kg).
pub const MASS: f64 = 5e-3;
/// Radial stiffness of the blade (N/m).
pub const STIFFNESS: f64 = 1e6;
/// Damping ratio.
pub const DAMPING: f64 = 0.03;
/// Interference of the node at rest with the data points (m).
pub const INTERFERENCE: f64 = 5e-4;
/// Speed of the rotor (rad/s): low enough for the node to stay on the facets.
pub const SPEED: f64 = 300.0;
/// Step (s).
pub const STEP: f64 = 1e-6;

/// Contact forces of the steps of one turn.
#[derive(Debug, Clone)]
pub struct SlidingHistory {
    /// Angle of the node (degrees).
    pub angle: Vec<f64>,
    /// Normal force λ (N).
    pub force: Vec<f64>,
}

impl SlidingHistory {
    /// Change of the force from step to step (N); the first entry is zero.
    pub fn changes(&self) -> Vec<f64> {
        let changes = self.force.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        std::iter::once(0.0).chain(changes).collect()
    }

    /// Smallest and largest force (N).
    pub fn range(&self) -> [f64; 2] {
        let fold = |pick: fn(f64, f64) -> f64, start| self.force.iter().copied().fold(start, pick);
        [fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY)]
    }
}

/// The casing: three rings of [`AROUND`] points, the first at 180°.
pub fn casing(closure: Closure, interpolation: Interpolation) -> SurfaceSpline {
    let point = |index: usize| {
        let (sine, cosine) = libm::sincos(TAU * (0.5 + (index % AROUND) as f64 / AROUND as f64));
        [RADIUS * cosine, RADIUS * sine, 0.01 * (index / AROUND) as f64]
    };
    let data: Vec<[f64; 3]> = (0..3 * AROUND).map(point).collect();
    SurfaceSpline::new(&data, AROUND, 3, closure, interpolation).expect("a round casing")
}

/// Slide once around, after a first turn in which the start dies out.
pub fn slide(surface: &SurfaceSpline) -> SlidingHistory {
    let frequency = (STIFFNESS / MASS).sqrt();
    let damping = DAMPING * frequency * STEP;
    let (divisor, stiffness) = (1.0 + damping, frequency * frequency * STEP * STEP);
    let compliance = STEP * STEP / (MASS * divisor);
    let turn = (TAU / (SPEED * STEP)).floor() as usize;
    let mut history = SlidingHistory { angle: Vec::with_capacity(turn), force: Vec::with_capacity(turn) };
    let (mut displacement, mut before) = (-INTERFERENCE, -INTERFERENCE);
    let mut guess = surface.locate(Vector3::new(RADIUS, 0.0, 0.01));
    for step in 0..2 * turn {
        let angle = SPEED * STEP * step as f64;
        let (sine, cosine) = libm::sincos(angle);
        let predicted = ((2.0 - stiffness) * displacement - (1.0 - damping) * before) / divisor;
        let radius = RADIUS + INTERFERENCE + predicted;
        let projection = surface.project(Vector3::new(radius * cosine, radius * sine, 0.01), guess);
        let Projection::Found { gap, .. } = projection else { panic!("the node has left the casing: {projection:?}") };
        let radial = gap.normal[0] * cosine + gap.normal[1] * sine;
        let force = (-gap.distance / (radial * radial * compliance)).max(0.0);
        (before, displacement) = (displacement, predicted + compliance * force * radial);
        guess = surface.advance(gap.foot, SPEED * STEP / TAU);
        if step >= turn {
            history.angle.push((angle - SPEED * STEP * turn as f64).to_degrees());
            history.force.push(force);
        }
    }
    history
}
