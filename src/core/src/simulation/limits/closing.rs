//! Duration of closed contact, as far as it can be estimated at the start.

use std::f64::consts::{PI, TAU};

use crate::scene::settings::SpinSettings;
use crate::scene::shape::CompiledShape;
use crate::simulation::compile::Compiled;

/// Angles at which a shape is sampled.
const ANGLES: u32 = 3600;
/// Contact that may stay closed for long is assumed to do so for the run of the scene, and at least for this time (s), since importers may
/// run longer.
const A_WHILE: f64 = 1.0;

/// Bounds on the time that a contact of one structure stays closed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Closing {
    /// Widest angle over which the undeformed structure is inside a shape at rest (rad); infinite if inputs, loads or a flexible surface
    /// may hold contact for long.
    arc: f64,
    /// Half a period of the slowest mode (s): a vibrating blade may stay in contact for this time after it has passed the shape.
    after: f64,
    /// Duration of the run of the scene, or longer (s).
    run: f64,
}

impl Closing {
    /// Returns the duration for free bodies.
    pub(crate) fn of_run(compiled: &Compiled) -> Self {
        let experiment = &compiled.scene.settings.experiment;
        Self { arc: f64::INFINITY, after: 0.0, run: (experiment.stop - experiment.start).max(A_WHILE) }
    }

    /// Returns the duration for a rotor.
    pub fn new(compiled: &Compiled, body: usize) -> Self {
        let (structure, _) = compiled.body(body);
        let pairs = compiled.plan.pairs_of(body);
        let is_held = structure.whirl || structure.axial_shift || structure.spin != SpinSettings::default();
        let arc = |(pair, plan): (usize, &crate::simulation::plan::PairPlan)| {
            let surface = compiled.plan.surface(&compiled.scene.settings, pair);
            let contact = compiled.contact(pair);
            if is_held || surface.moving || plan.carrier.is_some() {
                return f64::INFINITY;
            }
            let closest = contact.sector_gaps.iter().copied().fold(contact.nominal_gap(), f64::min);
            CompiledShape::new(&surface.shape, contact.nominal_gap())
                .map_or(f64::INFINITY, |shape| widest(&shape, closest))
        };
        let arc = pairs.map(arc).fold(0.0, f64::max);
        Self { arc, after: PI / compiled.bodies[body].lowest_frequency(), ..Self::of_run(compiled) }
    }

    /// Longest time of closed contact (s) at a speed (rad/s).
    pub fn time(&self, speed: f64) -> f64 {
        // 0/0 if no node is inside and the rotor is at rest.
        let passing = if speed == 0.0 { f64::INFINITY } else { self.arc / speed.abs() };
        (passing + self.after).min(self.run)
    }
}

/// Widest angle (rad) over which a shape extends further inwards than `gap` (m); infinite if it does all around.
fn widest(shape: &CompiledShape, gap: f64) -> f64 {
    let spacing = TAU / f64::from(ANGLES);
    let is_inside = |place: u32| gap + shape.evaluate(spacing * f64::from(place)).0 <= 0.0;
    let (mut widest, mut now) = (0_u32, 0_u32);
    // Twice around, since arcs may extend across the start.
    for place in 0..2 * ANGLES {
        now = if is_inside(place) { now + 1 } else { 0 };
        widest = widest.max(now);
    }
    if widest >= ANGLES { f64::INFINITY } else { spacing * f64::from(widest + 1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::settings::Shape;

    #[test]
    fn contact_arc_widths_match_the_shape() {
        let lobes = |amplitude| CompiledShape::new(&Shape::Lobes { amplitude, order: 2, phase: 0.3 }, 1e-3).unwrap();
        // −A cos 2θ exceeds A/√2 over half a right angle, plus at most one spacing.
        let found = widest(&lobes(1e-3), 1e-3 / 2.0_f64.sqrt());
        assert!((PI / 4.0..PI / 4.0 + 0.005).contains(&found), "{found}");
        assert!(widest(&lobes(1e-3), 2e-3) < 0.002);
        assert!(widest(&CompiledShape::Circular, 0.0).is_infinite());
        // An arc across the start of the angle.
        let across = CompiledShape::new(&Shape::Lobes { amplitude: 1e-3, order: 1, phase: 0.0 }, 1e-3).unwrap();
        assert!((widest(&across, 0.0) - PI).abs() < 0.005);
        let closing = Closing { arc: 0.1, after: 1e-4, run: 1e-2 };
        for (speed, expected) in [(-1000.0, 2e-4), (0.0, 1e-2), (1e-3, 1e-2)] {
            assert!((closing.time(speed) - expected).abs() < 1e-18, "{speed}");
        }
    }
}
