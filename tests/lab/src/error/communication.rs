//! Cost of the communication step length H with adaptive steps, by tolerance: time and error of one rub.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::ADAPTIVE_STEP;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_figure::table::Table;
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::error::{case::ErrorCase, clock, measure::parts_apart, summary::rate};

use super::built_in::BuiltIn;

/// Communication steps as multiples of the shortest (1 µs), ascending.
const MULTIPLES: [usize; 4] = [1, 10, 100, 1000];
const SHORTEST: f64 = 1e-6;
const TOLERANCES: [f64; 3] = [1e-1, 1e-2, 1e-3];
/// Tolerance of the run that errors are relative to.
const FINEST: f64 = 1e-6;
/// Number of runs for the median time.
const REPETITIONS: usize = 3;

/// Displacements at the end of every 0.1 ms, or of every communication step if that is longer (m), and processor time
/// of the steps (s).
struct DisplacementSamples {
    displacements: Vec<Vec<f64>>,
    seconds: f64,
}

/// Runs `milliseconds` of the scene with communication steps of `multiple` times the shortest.
fn record(
    scene: &Scene,
    tolerance: f64,
    multiple: usize,
    milliseconds: usize,
) -> tiprub_core::Result<DisplacementSamples> {
    let mut scene = scene.clone();
    let interval = SHORTEST * multiple as f64;
    scene.settings.experiment.communication_step = interval;
    let time = &mut scene.settings.time;
    (time.scheme, time.step, time.tolerance) = (Scheme::Galerkin, ADAPTIVE_STEP, Some(tolerance));
    scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = Solver::Lcp);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let (steps, sampled) = (milliseconds * 1000 / multiple, (100 / multiple).max(1));
    let mut recording = DisplacementSamples { displacements: Vec::new(), seconds: 0.0 };
    for step in 0..steps {
        let before = clock::now();
        simulation.do_step(step as f64 * interval, interval)?;
        recording.seconds += (clock::now() - before).as_secs_f64();
        if (step + 1).is_multiple_of(sampled) {
            recording.displacements.push(simulation.system().bank().displacement().to_vec());
        }
    }
    Ok(recording)
}

/// Returns the relative error at the times that a coarser recording shares with the finest one.
fn error(found: &DisplacementSamples, finest: &DisplacementSamples) -> f64 {
    let every = finest.displacements.len() / found.displacements.len();
    let shared: Vec<Vec<f64>> = finest.displacements.iter().skip(every - 1).step_by(every).cloned().collect();
    let length = shared.first().map_or(0, Vec::len);
    parts_apart(&found.displacements, &shared, &[length])
}

/// Returns time and error by H and tolerance. The shortest H is omitted in the quick form and for coupled structures,
/// where it takes hours.
///
/// # Errors
/// A run that fails; never with the built-in scenes.
pub(crate) fn table(case: &BuiltIn, quick: bool, console: &Console) -> Result<Table> {
    let scene = case.scene();
    let simulated = case.interval() * case.samples() as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few milliseconds")]
    let milliseconds = (1e3 * simulated).floor().max(1.0) as usize;
    let failed =
        |error: tiprub_core::Error| Failure::new(case.name(), error.to_string(), "Report this to the developers");
    let finest = record(scene, FINEST, 100, milliseconds).map_err(failed)?;
    let columns = ["scene", "tolerance", "H (µs)", "time (s/s)", "error"];
    let mut table = Table::new("Adaptive steps for several communication steps H", columns);
    let multiples = if quick || scene.roms.len() > 1 { &MULTIPLES[1..] } else { &MULTIPLES[..] };
    let task = console
        .task(&format!("{}: communication steps", case.title()), Some((TOLERANCES.len() * multiples.len()) as u64));
    let mut done = 0;
    for tolerance in TOLERANCES {
        for &multiple in multiples {
            let repetitions = if quick || multiple == 1 || scene.roms.len() > 1 { 1 } else { REPETITIONS };
            let mut times = Vec::with_capacity(repetitions);
            let mut apart = f64::NAN;
            for _ in 0..repetitions {
                let found = record(scene, tolerance, multiple, milliseconds).map_err(failed)?;
                apart = error(&found, &finest);
                times.push(found.seconds);
            }
            times.sort_by(f64::total_cmp);
            table.rows.push(vec![
                case.title().to_owned(),
                format!("{tolerance:.0e}"),
                multiple.to_string(),
                rate(times[repetitions / 2] / (1e-3 * milliseconds as f64)),
                format!("{apart:.1e}"),
            ]);
            done += 1;
            task.at(done);
        }
    }
    Ok(table)
}
