//! Contacts that may stick, by a tolerance, on whole scenes: blades by themselves, in elastic casings, coupled.

use super::{Change, H, apart, disk_displacements, goes_on_with_the_same_bits, run, scene, still};
use crate::guide::{self, told};
use tiprub_core::settings::{Scheme, Solver};
use tiprub_core::{Rom, Scene};
use tiprub_test_models::disk::Disk;
use tiprub_test_models::{bumps, flexible};

/// The solver that knows sticking, on a rub where all slides: it tends to what massless-boundary tends to with it, and errors are those
/// asked for.
#[test]
fn errors_of_friction_that_may_stick_are_those_asked_for() {
    for (name, change) in [("rigid", (|_: &mut Scene| {}) as Change), ("flexible", flexible)] {
        let of = |scheme: Scheme, step: f64, tolerance: f64| {
            let mut scene = scene(scheme, step, tolerance);
            change(&mut scene);
            scene.settings.contacts[0].solver = Solver::Coulomb;
            run(&scene, still)
        };
        let exact = of(Scheme::Galerkin, 0.25 * H, 1e-6);
        if name == "rigid" {
            let far = |step: f64| apart(&of(Scheme::MasslessBoundary, step, 1e-3).displacements, &exact.displacements);
            let (coarse, fine) = (far(2e-7), far(5e-8));
            told!("coulomb, massless-boundary, h = 0.05 us: {fine:.1e}");
            assert!(fine < 1e-5 && coarse > 2.0 * fine, "{coarse:e} {fine:e}");
        }
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
            let found = of(Scheme::Galerkin, H, tolerance);
            let error = apart(&found.displacements, &exact.displacements);
            told!("coulomb, {name}, tolerance {tolerance:.0e}: {error:.1e}, steps per blade {}", found.steps);
            assert!(error < 1.5 * tolerance && found.residual < 1e-13, "{error:e} {:e}", found.residual);
        }
    }
    guide::hold("cargo test -p tiprub-core --test galerkin sticking");
}

/// Sectors that step together are what they are as one structure, where they slide and where they are slow enough to stick.
#[test]
fn coupled_sectors_stick_as_one_structure_does() {
    let disk = Disk::random(6, 1, 8, 0.25, 3);
    for speed in [1300.0, 300.0] {
        let of = |rom: Rom, tolerance: f64| {
            let mut scene = bumps(rom);
            scene.settings.structures[0].speed = speed;
            scene.settings.contacts[0].friction = 0.15;
            scene.settings.contacts[0].solver = Solver::Coulomb;
            disk_displacements(scene, tolerance)
        };
        let exact = of(disk.whole(), 1e-6);
        for tolerance in [1e-3, 1e-4, 1e-5] {
            let [together, alone] = [disk.cyclic(), disk.whole()].map(|rom| of(rom, tolerance));
            let (parted, error) = (apart(&together, &alone), apart(&together, &exact));
            println!("{speed} rad/s, tolerance {tolerance:e}: {error:.1e}, from one structure {parted:.1e}");
            assert!(parted < tolerance, "{speed} rad/s, {tolerance:e}: {parted:e}");
            assert!(speed < 1000.0 || error < 2.0 * tolerance, "{speed} rad/s, {tolerance:e}: {error:e}");
        }
    }
}

#[test]
fn what_sticks_is_saved_and_asks_for_no_memory() {
    let mut alone = scene(Scheme::Galerkin, H, 1e-4);
    alone.settings.contacts[0].solver = Solver::Coulomb;
    let (mut carried, mut coupled) = (alone.clone(), alone.clone());
    flexible(&mut carried);
    coupled.roms[0] = Disk::random(4, 1, 9, 0.25, 3).cyclic();
    [alone, carried, coupled].iter().for_each(goes_on_with_the_same_bits);
}
