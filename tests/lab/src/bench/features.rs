//! Run time of the rubs with one additional feature, relative to the run time without it.

use serde_json::{Value, json};
use tiprub_core::scene::method::Solver;
use tiprub_core::scene::settings::SplineSettings;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_figure::table::Table;
use tiprub_shell::{Failure, Result};
use tiprub_study::error::{clock, summary::rate};

use super::{BenchSize, Rub, displacements_of};
use crate::beside::apart;

/// Communication step (s).
const INTERVAL: f64 = 1e-4;
/// Tolerance of the timed runs, and of the reference runs that determine their errors.
const TOLERANCES: [f64; 2] = [1e-2, 1e-3];
/// Eccentricity of the shaft relative to the clearance.
const ECCENTRICITY: f64 = 0.05;

/// Value of an input relative to its unit, as a function of the number of the communication step.
type InputCourse = fn(f64) -> f64;

/// A feature of a scene, and the motion of its inputs.
struct Feature {
    name: &'static str,
    change: fn(&mut Scene),
    /// Inputs that are set before each communication step.
    inputs: &'static [(&'static str, InputCourse)],
}

/// Number of features.
pub(super) const COUNT: usize = 7;

/// The first row adds no feature; the other rows are compared with it.
const FEATURES: [Feature; COUNT] = [
    Feature { name: "none", change: |_| {}, inputs: &[] },
    Feature { name: "mistuned blades", change: mistune, inputs: &[] },
    Feature { name: "speed that changes in every step", change: |_| {}, inputs: &[("speed", |n| 1.0 + 1e-6 * n)] },
    Feature { name: "eccentric shaft at rest", change: whirl, inputs: &[("whirl_x", |_| 1.0)] },
    Feature {
        name: "whirling shaft",
        change: whirl,
        inputs: &[("whirl_x", |n| (0.05 * n).cos()), ("whirl_y", |n| (0.05 * n).sin())],
    },
    Feature { name: "casing as a spline", change: spline, inputs: &[] },
    Feature { name: "sticking contacts", change: stick, inputs: &[] },
];

fn mistune(scene: &mut Scene) {
    let sectors = scene.roms[0].sectors;
    let factor = |sector: usize| if sector.is_multiple_of(2) { 1.01 } else { 0.99 };
    scene.settings.structures[0].frequency_factors = (0..sectors).map(factor).collect();
}

fn whirl(scene: &mut Scene) {
    scene.settings.structures[0].whirl = true;
}

fn spline(scene: &mut Scene) {
    scene.settings.surfaces[0].spline = Some(SplineSettings { around: 144, ..SplineSettings::default() });
}

fn stick(scene: &mut Scene) {
    scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = Solver::STICKING);
}

/// Time and error of the rub with a feature.
struct FeatureRow {
    name: &'static str,
    /// Processor time per simulated second (s/s).
    seconds: f64,
    error: f64,
    /// Number of attempted steps of all blades.
    trials: u64,
}

impl Feature {
    /// Runs a scene. Returns the time of the steps (s), the displacements at every millisecond (m) and the number of attempted
    /// steps. If `whole` is false, only the states that outputs need are evaluated, and no displacements are returned.
    fn run(
        &self,
        scene: &Scene,
        tolerance: f64,
        size: BenchSize,
        whole: bool,
    ) -> tiprub_core::Result<(f64, Vec<f64>, u64)> {
        let mut scene = scene.clone();
        (self.change)(&mut scene);
        scene.settings.time.tolerance = Some(tolerance);
        scene.settings.experiment.communication_step = INTERVAL;
        let mut simulation = Simulation::new(&scene)?;
        if !whole {
            simulation.skip_unneeded_states();
        }
        simulation.initialise(0.0)?;
        let unit = |name: &str| match name {
            "speed" => scene.settings.structures[0].speed,
            _ => ECCENTRICITY * scene.settings.contacts[0].gap,
        };
        let (mut seconds, mut displacements) = (0.0, Vec::new());
        let steps_per_millisecond = 10;
        for step in 0..size.milliseconds * steps_per_millisecond {
            for (name, of) in self.inputs {
                if let Some(variable) = simulation.table().find(name) {
                    let reference = variable.reference;
                    simulation.set_real(reference, unit(name) * of(f64::from(step)))?;
                }
            }
            let before = clock::now();
            simulation.do_step(f64::from(step) * INTERVAL, INTERVAL)?;
            seconds += (clock::now() - before).as_secs_f64();
            if whole && (step + 1).is_multiple_of(steps_per_millisecond) {
                displacements.extend(displacements_of(&simulation, &scene));
            }
        }
        Ok((seconds, displacements, simulation.system().steps_tried()))
    }

    fn row(&self, rub: &Rub) -> tiprub_core::Result<FeatureRow> {
        let scene = rub.with_tolerance(TOLERANCES[0]);
        let (mut seconds, _, trials) = self.run(&scene, TOLERANCES[0], rub.size, false)?;
        if seconds < 1.0 {
            for _ in 1..rub.size.repetitions {
                seconds = seconds.min(self.run(&scene, TOLERANCES[0], rub.size, false)?.0);
            }
        }
        let [own, finer] = TOLERANCES.map(|tolerance| self.run(&scene, tolerance, rub.size, true));
        let error = apart(&own?.1, &finer?.1);
        Ok(FeatureRow { name: self.name, seconds: rub.size.rate(seconds), error, trials })
    }
}

/// Runs each rub with each feature. Returns a table and its data. Calls `finished` with the number of finished rows.
///
/// # Errors
/// If a run fails.
pub(super) fn compare(rubs: &[Rub], finished: &dyn Fn(usize)) -> Result<(Table, Vec<Value>)> {
    let columns = ["rub", "added feature", "time (s/s)", "relative to none", "attempted steps", "error"];
    let mut table = Table::new("Processor time by feature", columns);
    let mut data = Vec::new();
    for rub in rubs {
        let mut plain = f64::NAN;
        for feature in &FEATURES {
            let row = feature
                .row(rub)
                .map_err(|error| Failure::from_core(format!("lab bench, {} rub, {}", rub.name, feature.name), error))?;
            let FeatureRow { name, seconds, error, trials } = row;
            if plain.is_nan() {
                plain = seconds;
            }
            let (ratio, rub) = (seconds / plain, rub.name);
            let (time, relative) = (rate(seconds), rate(ratio));
            table.rows.push(vec![rub.into(), name.into(), time, relative, trials.to_string(), format!("{error:.1e}")]);
            data.push(json!({
                "rub": rub, "feature": name, "seconds_per_second": seconds, "ratio": ratio, "trials": trials, "error": error
            }));
            finished(table.rows.len());
        }
    }
    Ok((table, data))
}
