//! Contacts between the points of steps: nodes that stay open penetrate by less than the tolerance.

use super::{SECTORS, scene};
use std::cell::RefCell;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::rom::Rom;
use tiprub_core::scene::settings::Shape;
use tiprub_test_models::{GAP, RADIUS, SeededRandom, go, modal, node, started};

/// Interval at which gaps are sampled (s).
const SAMPLE: f64 = 5e-7;
/// Allowed penetration as a fraction of the tolerance: the error of a recorded minimum adds 0.3.
const ALLOWED: f64 = 1.3;

/// Returns a blade with many modes at high frequencies, which impacts excite and little damping lets ring.
fn ringing_blade(seed: u64) -> Rom {
    let random = RefCell::new(SeededRandom(seed));
    let ringing = (0..30).map(|mode| 5e4 * 1.12_f64.powi(mode));
    let frequencies: Vec<f64> =
        [1.5e3, 6e3, 1.5e4].into_iter().chain(ringing).chain((0..9).map(|mode| 2e6 + 1e5 * f64::from(mode))).collect();
    let shape = |row: usize, mode: usize| match mode.checked_sub(33) {
        None if row.is_multiple_of(3) => 2.0 * random.borrow_mut().signed(),
        None => random.borrow_mut().signed(),
        Some(local) if local == row => 60.0,
        Some(_) => random.borrow_mut().signed(),
    };
    let place = |index: usize| [RADIUS, 0.02 * index as f64, 0.015 * index as f64];
    let nodes = (0..3).map(|index| node(format!("node_{index}"), place(index), -0.2)).collect();
    Rom { sectors: SECTORS, damping_ratio: 1e-4, ..modal("blade", &frequencies, shape, nodes) }
}

#[test]
fn no_contact_is_missed_between_the_points() {
    for (seed, tolerance) in [(1, 1e-3), (3, 1e-4), (7, 1e-4), (15, 1e-4), (22, 1e-3), (34, 1e-4), (46, 1e-3)] {
        let mut scene = scene(Scheme::Galerkin, 8e-5, tolerance);
        scene.roms[0] = ringing_blade(seed);
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.2, width: 0.15, phase: 0.0 };
        scene.settings.contacts[0].friction = 0.0;
        let mut simulation = started(&scene);
        let mut lowest = f64::INFINITY;
        for _ in 0..16_000 {
            go(&mut simulation, SAMPLE);
            lowest = simulation.system().gaps().copied().fold(lowest, f64::min);
        }
        let share = -lowest / (tolerance * GAP);
        assert!(share < ALLOWED, "blade {seed}, tolerance {tolerance:e}: penetration {share} of it");
        assert!(simulation.system().effort().trials > 1000, "blade {seed} hardly touches");
    }
}
