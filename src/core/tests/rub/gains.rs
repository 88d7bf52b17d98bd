//! Spurious energy gains end a run with a specific error: friction that feeds a vibration, impacts that gain energy,
//! nodes that stay inside, and curvature work that changes the sign of a result.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Result, Scene, Simulation};
use tiprub_test_models::{self as models, GAP, move_on, real, started};

/// Communication step (s).
const LENGTH: f64 = 5e-5;

/// Returns slowly turning blades in a casing that closes on them and opens in time with their lowest mode.
fn slow(scheme: Scheme, solver: Solver) -> Scene {
    let mut scene = models::round(models::rich_blade(2));
    scene.settings.time.scheme = scheme;
    scene.settings.time.step = if scheme == Scheme::Galerkin { LENGTH } else { 5e-7 };
    scene.settings.experiment.communication_step = LENGTH;
    scene.settings.structures[0].speed = 3.0;
    scene.settings.contacts[0].solver = solver;
    scene.settings.contacts[0].friction = 0.3;
    scene.settings.outputs.energies = true;
    scene
}

/// Closes the casing by `depth` more than the clearance (m) and opens it again, at 850 Hz; calls `look` after every
/// communication step.
fn squeeze(simulation: &mut Simulation, depth: f64, steps: u32, mut look: impl FnMut(&Simulation)) -> Result<()> {
    let rate = std::f64::consts::TAU * 850.0;
    let place = |index: u32| -0.5 * (GAP + depth) * (1.0 - (rate * LENGTH * f64::from(index)).cos());
    for index in 0..steps {
        move_on(simulation, "casing_radius_change", place(index), (place(index + 1) - place(index)) / LENGTH);
        simulation.do_step(simulation.time(), LENGTH)?;
        look(simulation);
    }
    Ok(())
}

#[test]
fn run_fails_when_friction_adds_energy_to_vibration() {
    for (scheme, solver) in [
        (Scheme::ModalExact, Solver::Lcp),
        (Scheme::ModalExact, Solver::Film),
        (Scheme::CentralDifference, Solver::Lcp),
        (Scheme::MasslessBoundary, Solver::Lcp),
        (Scheme::Galerkin, Solver::Lcp),
    ] {
        let mut simulation = started(&slow(scheme, solver));
        assert!(simulation.warnings().iter().any(|text| text.contains("sticking")), "{scheme:?}");
        let mut before = 0.0;
        let outcome = squeeze(&mut simulation, 2e-4, 200, |simulation| {
            let heat = real(simulation, "friction_loss");
            assert!(heat >= before - 1e-9 * simulation.system().ledger().scale(), "{scheme:?}: {heat} after {before}");
            before = before.max(heat);
        });
        let reported = outcome.unwrap_err().to_string();
        assert!(
            reported.contains("friction has added") && reported.contains("solver coulomb"),
            "{scheme:?}, {solver:?}: {reported}"
        );
    }
}

#[test]
fn sticking_friction_dissipates_when_sliding_reverses() {
    for scheme in [Scheme::ModalExact, Scheme::CentralDifference, Scheme::MasslessBoundary, Scheme::Galerkin] {
        let mut simulation = started(&slow(scheme, Solver::Coulomb));
        let mut before = [0.0; 2];
        squeeze(&mut simulation, 2e-4, 200, |simulation| {
            let [heat, impact] = ["friction_loss", "impact_loss"].map(|name| real(simulation, name));
            let all = simulation.system().ledger().scale();
            assert!(heat >= before[0] - 1e-12 * all, "{scheme:?}: {heat} after {}", before[0]);
            if !scheme.is_massless() {
                assert!(impact >= before[1] - 1e-12 * all, "{scheme:?}: {impact} after {}", before[1]);
            }
            assert!(simulation.system().acted().iter().all(|event| event.friction_heat >= 0.0), "{scheme:?}");
            before = [heat, impact];
        })
        .unwrap_or_else(|error| panic!("{scheme:?}: {error}"));
        assert!(
            before[0] > 0.0 && real(&simulation, "energy_residual_relative").abs() < 1e-9,
            "{scheme:?}: {before:?}"
        );
    }
}
