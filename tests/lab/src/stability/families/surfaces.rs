//! Blade tips beyond the edge of their casing, steps that do not resolve loaded modes, and large displacements.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::SplineSettings;
use tiprub_core::{CoSimulation, Result, Scene, Simulation};

use super::super::{
    Cases, Check, Expected, StabilityCase,
    models::{GAP, RADIUS, StabilityMethod, Tower, blade, round},
    observe::{StabilityWatch, begin, real, set, steps},
};

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [edges(), resolution(), curved()].into_iter().flatten().collect()
}

fn rubbing(method: StabilityMethod) -> Scene {
    let mut scene = method.stepping(round(blade(4)), 1e-6);
    scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.meridional_slope = 0.0);
    scene.settings.structures[0].axial_shift = true;
    scene
}

/// Compares a cylinder: the spline continues beyond the edge like a surface of revolution, which has no edge.
fn edges() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all_with(Solver::Lcp).filter(|method| !method.is_massless()) {
        let name = method.integration();
        // Rings reach 7.5 mm beyond the contact nodes, and the surface continues for 11.25 mm.
        for (shift, expected) in [
            (0.005, Expected::right("agreement with a surface of revolution, signs of the energy terms")),
            (0.017, Expected::right("agreement with a surface of revolution, signs of the energy terms")),
            (0.024, Expected::refused(["has left the casing surface", "of sector", "axial extent"])),
        ] {
            let quick = method.scheme != Scheme::CentralDifference;
            cases.add(quick, format!("edge/{name}/shift={shift}"), expected, move || over_the_edge(method, shift));
        }
    }
    cases
}

fn over_the_edge(method: StabilityMethod, shift: f64) -> Result<Vec<Check>> {
    let run = |spline: Option<SplineSettings>| {
        let mut scene = rubbing(method);
        scene.settings.surfaces[0].spline = spline;
        let (mut simulation, mut watch) = begin(&scene)?;
        let length = scene.settings.experiment.communication_step;
        for index in 0..steps(2e-3, length) {
            let x = f64::from(index) * length / 1e-6;
            set(&mut simulation, "casing_radius_change", -1.02 * GAP * (x / 1000.0).min(1.0))?;
            set(&mut simulation, "axial_shift", shift * (x / 300.0).sin())?;
            watch.step(&mut simulation, length)?;
        }
        Ok::<_, tiprub_core::Error>((watch.impulse, real(&simulation, "impact_loss"), watch))
    };
    let (impulse, loss, watch) = run(Some(SplineSettings::default()))?;
    let (expected, expected_loss, _) = run(None)?;
    let mut checks = vec![Check::so("there is contact", impulse > 0.0), watch.ledger()];
    checks.push(Check::relative("impulse", impulse, expected, 0.05));
    if method.is_galerkin() {
        // The loss of its impacts is an error of the step.
        checks.push(watch.impact(0.0));
    } else {
        checks.push(Check::at_most("deviation of the impact loss", (loss - expected_loss).abs() / expected_loss, 0.1));
    }
    Ok(checks)
}

/// Returns cases of the step resolution: a step is rejected if it does not resolve modes that carry the contact, but
/// not because of a stiff node alone.
fn resolution() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all_with(Solver::Lcp) {
        let galerkin = method.is_galerkin();
        if method.is_adaptive() || !(galerkin || method.scheme == Scheme::ModalExact) {
            continue;
        }
        for product in [1.0, 3.0, 9.0, 11.0, 30.0, 116.0, 1e4] {
            for friction in [0.0, 0.15] {
                let against = "signs of energies and energy terms";
                let expected = if galerkin {
                    // A step in which the rotor turns several times is rejected.
                    Expected::either(against, ["features of the casing shape", "internal_step_max (time.step) below"])
                } else if product < 10.0 {
                    Expected::either_as(against, &[&["grows"], &["gained spurious energy"]])
                } else {
                    Expected::refused(["modal-exact", "ω_max·h", "flexibility"])
                };
                let name = format!("resolution/{}/µ={friction}/ω_max·h={product}", method.integration());
                cases.add(product < 100.0, name, expected, move || at_product(method, product, friction));
            }
        }
    }
    cases
}

/// Compares blades of one mass and spring in a casing that closes: their only mode carries everything.
fn at_product(method: StabilityMethod, product: f64, friction: f64) -> Result<Vec<Check>> {
    let mut scene = method.on(round(blade(4)));
    let fastest = scene.roms[0].stiffness.diagonal().max();
    // All modes have the same frequency.
    scene.roms[0].stiffness.fill_diagonal(fastest);
    scene.settings.contacts[0].friction = friction;
    let step = product / fastest.sqrt();
    let mut simulation = Simulation::new(method.stepping(scene.clone(), step))?;
    simulation.initialise(0.0)?;
    let mut watch = StabilityWatch::new(&scene);
    let mut negative = 0.0_f64;
    for index in 0..400 {
        set(&mut simulation, "casing_radius_change", -1.05 * GAP * (f64::from(index) / 200.0).min(1.0))?;
        watch.step(&mut simulation, step)?;
        negative = negative.min(real(&simulation, "strain_energy")).min(real(&simulation, "kinetic_energy"));
    }
    Ok(vec![watch.ledger(), Check::so("energies are not negative", negative >= 0.0)])
}

/// Returns cases of blades dragged around by friction: warned from 5 % of the clearance on, rejected at 100 %.
fn curved() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::common().filter(|method| method.solver == Solver::Lcp) {
        for (what, share) in [("small", 0.02), ("told", 0.2), ("refused", 1.5)] {
            let expected = if share < 1.0 {
                Expected::right("u²/2r relative to the clearance")
            } else {
                Expected::refused(["around the axis", "u²/2r", "clearance"])
            };
            let name = format!("curved/{what}/{}", method.integration());
            cases.add(true, name, expected, move || dragged(method, share));
        }
    }
    cases
}

/// Presses a blade whose root is soft around the axis until friction has moved it by `share` of the clearance.
fn dragged(method: StabilityMethod, share: f64) -> Result<Vec<Check>> {
    let mut scene = method.on(round(Tower::default().rom()));
    scene.settings.contacts[0].friction = 0.3;
    let mut simulation = Simulation::new(method.stepping(scene.clone(), 2e-6))?;
    simulation.initialise(0.0)?;
    let wanted = (2.0 * RADIUS * share * GAP).sqrt();
    let moved = |simulation: &Simulation| {
        let bank = simulation.system().bank();
        (0..bank.rows() / 3).map(|node| bank.row(3 * node + 1, 0).abs()).fold(0.0, f64::max)
    };
    let mut depth = 1.0;
    while moved(&simulation) < wanted && depth < 60.0 {
        depth += 2e-3;
        set(&mut simulation, "casing_radius_change", (-depth * GAP).max(-0.099 * RADIUS))?;
        simulation.do_step(simulation.time(), 2e-6)?;
    }
    let (reported, far) = (!simulation.take_notes().is_empty(), moved(&simulation));
    let error = far * far / (2.0 * RADIUS * GAP);
    Ok(vec![
        Check::so("a warning is given at 5 % and above", reported == (error >= 0.05)),
        Check::so("the displacement was reached", far >= wanted),
    ])
}
