//! Errors that adaptive steps cause in nine rubs, by tolerance: the source of the error that `tiprub run` prints for
//! its steps.

use std::f64::consts::TAU;

use serde_json::{Value, json};
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_figure::table::Table;
use tiprub_shell::{Failure, Result, sweep};
use tiprub_study::{Statement, estimate};
use tiprub_test_models::SeededRandom;

use super::{FINEST, Rub, TOLERANCES, displacements_of};
use crate::beside::apart;

/// Communication step (s); the displacements at its ends are compared.
const INTERVAL: f64 = 8e-5;
/// Number of revolutions: full study, quick study.
const REVOLUTIONS: [f64; 2] = [3.0, 1.0];
/// Time over which the bumps of the slow approach grow, and duration of this rub (s).
const SLOW: f64 = 0.03;
/// Largest relative deviation of the frequencies of mistuned blades.
const MISTUNING: f64 = 0.02;

/// A change to the light rub.
struct RubVariant {
    name: &'static str,
    change: fn(&mut Scene),
    /// Duration (s); if `None`, a number of revolutions.
    duration: Option<f64>,
}

impl RubVariant {
    const fn new(name: &'static str, change: fn(&mut Scene)) -> Self {
        Self { name, change, duration: None }
    }
}

/// The first and the last variant belong to the quick study.
const VARIANTS: [RubVariant; 9] = [
    RubVariant::new("light, `depth` 0.6, as built in", |_| {}),
    RubVariant::new("light, without friction", |scene| rub_with(scene, 0.0)),
    RubVariant::new("light, µ = 0.3", |scene| rub_with(scene, 0.3)),
    RubVariant::new("light, 1200 rad/s", |scene| scene.settings.structures[0].speed = 1200.0),
    RubVariant::new("light, frequencies mistuned by up to 2 %", mistune),
    RubVariant {
        name: "slow approach: bumps grow over 30 ms, 30 ms",
        change: |scene| scene.settings.surfaces[0].ramp_time = SLOW,
        duration: Some(SLOW),
    },
    RubVariant::new("three lobes of 0.45 mm", |scene| {
        scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4.5e-4, order: 3, phase: 0.0 };
    }),
    RubVariant::new("medium, `depth` 0.8", |scene| deepen(scene, 0.8)),
    RubVariant::new("heavy, `depth` 1.2", |scene| deepen(scene, 1.2)),
];

fn rub_with(scene: &mut Scene, friction: f64) {
    scene.settings.contacts.iter_mut().for_each(|contact| contact.friction = friction);
}

fn mistune(scene: &mut Scene) {
    let mut random = SeededRandom(1);
    let factors = (0..scene.roms[0].sectors).map(|_| 1.0 + MISTUNING * random.signed());
    scene.settings.structures[0].frequency_factors = factors.collect();
}

/// Sets the depth of two bumps.
pub(super) fn deepen(scene: &mut Scene, bumps: f64) {
    if let Shape::TwoLobe { depth, .. } = &mut scene.settings.surfaces[0].shape {
        *depth = bumps;
    }
}

/// Errors of a rub for each tolerance, and the errors that `tiprub run` prints for them.
struct VariantErrors {
    name: &'static str,
    errors: [f64; TOLERANCES.len()],
    printed: [f64; TOLERANCES.len()],
}

/// Returns the displacements of all contact nodes at the ends of all communication steps (m).
fn displacements(scene: &Scene, steps: u32) -> tiprub_core::Result<Vec<f64>> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    let mut found = Vec::new();
    for step in 0..steps {
        simulation.do_step(f64::from(step) * INTERVAL, INTERVAL)?;
        found.extend(displacements_of(&simulation, scene));
    }
    Ok(found)
}

impl RubVariant {
    fn errors(&self, rub: &Rub, quick: bool) -> tiprub_core::Result<VariantErrors> {
        let with = |tolerance: f64| {
            let mut scene = rub.with_tolerance(tolerance);
            scene.settings.experiment.communication_step = INTERVAL;
            (self.change)(&mut scene);
            scene
        };
        let speed = with(FINEST).settings.structures[0].speed.abs();
        let duration = self.duration.unwrap_or(REVOLUTIONS[usize::from(quick)] * TAU / speed);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some hundreds of steps")]
        let steps = (duration / INTERVAL * (1.0 + 1e-9)).floor() as u32;
        let finest = displacements(&with(FINEST), steps)?;
        let mut found = VariantErrors { name: self.name, errors: [f64::NAN; 4], printed: [f64::NAN; 4] };
        for (index, tolerance) in TOLERANCES.into_iter().enumerate() {
            let scene = with(tolerance);
            found.errors[index] = apart(&displacements(&scene, steps)?, &finest);
            let estimates = estimate::without_runs(&scene, &[]);
            let of_steps = estimates.iter().find(|estimate| estimate.direction == "steps");
            found.printed[index] = of_steps.and_then(|steps| steps.left.clone().ok()).unwrap_or(f64::NAN);
        }
        Ok(found)
    }
}

/// Runs all rubs. Returns a table, its data, and a statement about the error that `tiprub run` prints.
///
/// # Errors
/// A run that fails.
pub(super) fn compare(rub: &Rub, quick: bool) -> Result<(Table, Vec<Value>, Statement)> {
    let chosen: Vec<&RubVariant> = if quick { vec![&VARIANTS[0], &VARIANTS[8]] } else { VARIANTS.iter().collect() };
    let run = |variant: &&RubVariant| {
        variant.errors(rub, quick).map_err(|error| Failure::from_core(format!("lab bench, {}", variant.name), error))
    };
    let found = sweep::sweep(&chosen, sweep::processors(), run, |_| ())?;
    let columns = ["rub", "1e-1", "1e-2", "1e-3", "1e-4"];
    let mut table = Table::new("Error of adaptive steps by tolerance", columns);
    let row = |one: &VariantErrors| {
        std::iter::once(one.name.to_owned()).chain(one.errors.map(|error| format!("{error:.1e}"))).collect()
    };
    table.rows = found.iter().map(row).collect();
    let ratios = found.iter().flat_map(|one| one.errors.iter().zip(&one.printed).map(|(error, most)| error / most));
    // A missing value counts as too large.
    let worst = ratios.fold(0.0, |worst: f64, ratio| if ratio <= worst { worst } else { ratio });
    let statement = Statement::tested(
        "No rub has a larger error of its steps than `tiprub run` prints",
        worst <= 1.0,
        format!("at most {worst:.2} of the printed error"),
    );
    let data = found.iter().map(
        |one| json!({ "variant": one.name, "tolerances": TOLERANCES, "errors": one.errors, "printed": one.printed }),
    );
    Ok((table, data.collect(), statement))
}
