//! Nodes that stay open penetrate by less than the tolerance between the points of a step.

use super::{SECTORS, scene};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_test_models::{GAP, go, ringing_blade, set, started};

/// Interval at which gaps are sampled (s).
const SAMPLE: f64 = 5e-7;
/// Largest penetration as a fraction of the tolerance. The error of a recorded minimum adds 0.3.
const ALLOWED: f64 = 1.3;

#[test]
fn detects_every_contact_between_points() {
    for (seed, tolerance) in
        [(1, 1e-3), (3, 1e-4), (7, 1e-4), (15, 1e-4), (22, 1e-3), (34, 1e-4), (46, 1e-3), (47, 1e-4)]
    {
        let mut scene = scene(Scheme::Galerkin, 8e-5, tolerance);
        scene.roms[0] = ringing_blade(SECTORS, seed);
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.2, width: 0.15, phase: 0.0 };
        scene.settings.contacts[0].friction = 0.0;
        // Blades with an even seed belong to an eccentric rotor.
        let eccentricity = if seed % 2 == 0 { 1.5e-4 } else { 0.0 };
        scene.settings.structures[0].whirl = eccentricity != 0.0;
        let mut simulation = started(&scene);
        let mut lowest = f64::INFINITY;
        for n in 0..16_000 {
            if n == 1 && eccentricity != 0.0 {
                set(&mut simulation, "whirl_x", eccentricity);
            }
            go(&mut simulation, SAMPLE);
            lowest = simulation.system().gaps().copied().fold(lowest, f64::min);
        }
        let ratio = -lowest / (tolerance * GAP);
        assert!(ratio < ALLOWED, "blade {seed}, tolerance {tolerance:e}: penetration / tolerance = {ratio}");
        assert!(simulation.system().effort().trials > 1000, "blade {seed} has too few contacts");
    }
}
