//! Energy over very many impacts without loss: the content of the energy bank is bounded.

use super::{H, SECTORS, scene, scene_time};
use crate::guide::{self, print_row};
use tiprub_core::Simulation;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{Shape, TimeSettings};
use tiprub_test_models::disk::TestDisk;
use tiprub_test_models::{bumps, go, real, set, started};

/// Undamped, frictionless blades are squeezed by a round casing, and then vibrate against it.
#[test]
fn blades_conserve_energy_over_thousands_of_impacts() {
    let (longest, turns) = (8e-5, 40.0);
    for tolerance in [1e-1, 1e-2, 1e-3] {
        let mut scene = scene(Scheme::Galerkin, longest, tolerance);
        scene.settings.surfaces[0].shape = Shape::Circular {};
        scene.settings.surfaces[0].ramp_time = 0.0;
        scene.settings.contacts[0].friction = 0.0;
        scene.settings.structures[0].damping_ratio = Some(0.0);
        let mut simulation = started(&scene);
        // The impact loss belongs to the starts of open steps, like these energies.
        let energy = |simulation: &Simulation| {
            let (kinetic, strain) = simulation.system().energies();
            kinetic + strain
        };
        let mut largest = 0.0_f64;
        for radius in [-1.4e-4, -2.8e-4, -4.2e-4, -5.6e-4, -7e-4, -3.2e-4] {
            set(&mut simulation, "casing_radius_change", radius);
            go(&mut simulation, longest);
            largest = largest.max(energy(&simulation));
        }
        let given = energy(&simulation) + real(&simulation, "impact_loss");
        let mut most = 0.0_f64;
        for _ in 0..400 {
            go(&mut simulation, turns * std::f64::consts::TAU / 1300.0 / 400.0);
            let lost = real(&simulation, "impact_loss");
            most = most.max(lost / given);
            assert!(lost >= -1e-12 * given && lost <= 0.01 * largest, "{tolerance:e}: {lost:e} of {largest:e} J");
            assert!((energy(&simulation) + lost - given).abs() < 1e-10 * given, "{tolerance:e}");
        }
        let (left, effort) = (energy(&simulation) / given, *simulation.system().effort());
        print_row!(
            "tolerance {tolerance:.0e}: energy left {left:.4}, most lost {most:.4}, {} steps, {} trials per blade",
            effort.steps / SECTORS as u64,
            effort.trials / SECTORS as u64
        );
    }
    guide::hold("cargo test -p tiprub-core --test galerkin bank");
}

/// A round casing closes on all blades of a disk. The work on small gaps of closed contacts does not overdraw the bank. Otherwise the blades
/// would gain energy, or need shortest steps.
#[test]
fn closed_contacts_of_a_disk_do_not_overdraw_the_energy_bank() {
    let mut scene = bumps(TestDisk::random(8, 3, 10, 0.25, 3).cyclic());
    scene.settings.time = TimeSettings { tolerance: Some(0.1), ..scene_time() };
    scene.settings.outputs.energies = true;
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.contacts[0].friction = 0.05;
    let (mut simulation, mut lowest, spans) = (started(&scene), 0.0_f64, 150_u32);
    for span in 1..=spans {
        set(&mut simulation, "casing_radius_change", -1e-5 * f64::from(span.min(60)));
        go(&mut simulation, H);
        let (kinetic, strain) = simulation.system().energies();
        lowest = lowest.min(real(&simulation, "impact_loss") / (kinetic + strain).max(1e-9));
    }
    let steps = simulation.system().effort().steps / 8;
    println!("{steps} steps per blade in {spans} spans, lowest impact loss {lowest:e} of the energy");
    assert!(steps < 40 * u64::from(spans) && lowest > -1e-9, "{steps} {lowest:e}");
}
