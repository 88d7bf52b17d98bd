//! The paper's application (figs 11 and 12): coupled blades against an oval casing, for a range of angular velocities.
//! The casing is rigid, as in the paper's French summary, and elastic, as in its section 6. On a rigid casing, which
//! absorbs no energy, sliding contact of these blades flutters; it is shown without friction as well.

mod figures;
mod run;
mod statements;
#[cfg(test)]
mod tests;

use serde_json::{Value, json};
use tiprub_core::modes::cyclic::CyclicModel;
use tiprub_core::scene::settings::{Shape, SplineSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::Quantity;
use tiprub_gallery::scene_source;
use tiprub_shell::{Failure, Result, console::Console, schedule::Schedule, sweep};
use tiprub_study::{Study, arguments::Speeds};

use self::run::Run;

/// Interference of the oval casing with the tips at rest, as a fraction of the clearance.
const OVERLAP: f64 = 0.15;
/// Run length and the part of it in which the oval grows, in periods of the first mode of nodal diameter 2.
const PERIODS: f64 = 25.0;
const QUICK_PERIODS: f64 = 10.0;
const RAMP_PERIODS: f64 = 4.0;
/// Angular velocities, relative to the one at which the oval excites the first mode of nodal diameter 2.
const RANGE: [f64; 2] = [0.5, 1.5];
const COUNT: usize = 21;
const QUICK_COUNT: usize = 5;
/// The nodal diameters of the paper's figure.
const SHOWN: [usize; 2] = [2, 4];
/// Largest clearance that counts as contact, as a fraction of the clearance at rest.
const CLOSED: f64 = 1e-6;

/// Casing of the blades.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StageCasing {
    /// Oval by its shape and rigid, without friction.
    Smooth,
    /// Oval and rigid, with the friction of the scene.
    Rigid,
    /// Round, and deformed by a load with two nodal diameters and by the blades.
    Flexible,
}

/// All casings, in the order of the results.
const CASINGS: [StageCasing; 3] = [StageCasing::Smooth, StageCasing::Rigid, StageCasing::Flexible];

impl StageCasing {
    fn name(self) -> &'static str {
        match self {
            Self::Smooth => "rigid casing without friction",
            Self::Rigid => "rigid casing",
            Self::Flexible => "flexible casing",
        }
    }
}

/// Request for one stage.
struct StageSetup {
    /// Scenes of all casings, without speed.
    scenes: [Scene; 3],
    /// Amplitude of the load that closes the clearance of the flexible casing and [`OVERLAP`] more (N/m).
    amplitude: f64,
    /// First frequency of nodal diameter 2 (Hz).
    frequency: f64,
    /// Angular velocity at which four waves per revolution excite the first mode of nodal diameter 4 (rad/s).
    second_resonance: f64,
    schedule: Schedule,
    ramp: f64,
    quick: bool,
}

impl StageSetup {
    fn new(mut scene: Scene, quick: bool) -> Result<Self> {
        let disk = &scene.roms[0];
        let in_scene = |error| Failure::from_core("scene `stage`", error);
        let disk = CyclicModel::from_rom(disk, disk.damping_ratio).map_err(in_scene)?;
        let frequency = disk.diameters[2].frequencies[0] / std::f64::consts::TAU;
        let second_resonance = disk.diameters.get(SHOWN[1]).map_or(f64::NAN, |modes| modes.frequencies[0] / 4.0);
        // Here the load alone makes the casing oval; the built-in scene adds a shape, which importers need not drive.
        scene.settings.surfaces[0].shape = Shape::Circular {};
        let amplitude = (1.0 + OVERLAP) * scene.settings.contacts[0].gap / flexibility(&scene)?;
        if let Some(load) = &mut scene.settings.structures[1].load {
            load.amplitude = 0.0;
        }
        let mut experiment = scene.settings.experiment.clone();
        let periods = if quick { QUICK_PERIODS } else { PERIODS };
        let step = experiment.communication_step;
        experiment.stop = experiment.start + (periods / frequency / step).ceil() * step;
        let schedule = Schedule::new(&experiment, None, None)?;
        let ramp = RAMP_PERIODS / frequency;
        let rigid = rigid(&scene, ramp);
        let mut smooth = rigid.clone();
        smooth.settings.contacts[0].friction = 0.0;
        let scenes = [smooth, rigid, scene];
        Ok(Self { scenes, amplitude, frequency, second_resonance, schedule, ramp, quick })
    }

    fn scene(&self, casing: StageCasing) -> &Scene {
        &self.scenes[casing as usize]
    }

    /// Returns the clearance at rest (m).
    fn gap(&self) -> f64 {
        self.scenes[0].settings.contacts[0].gap
    }

    /// Returns the speed at which the oval, which the rotating blades pass twice per revolution, excites the first mode
    /// of nodal diameter 2 (rad/s).
    fn critical_speed(&self) -> f64 {
        std::f64::consts::PI * self.frequency
    }

    /// Returns the time at which the oval is complete (s).
    fn full(&self) -> f64 {
        self.schedule.start + self.ramp
    }

    /// Returns the load, which grows smoothly from zero, as the shape of the rigid casing does.
    fn load(&self, time: f64) -> f64 {
        let share = ((time - self.schedule.start) / self.ramp).clamp(0.0, 1.0);
        0.5 * self.amplitude * (1.0 - (std::f64::consts::PI * share).cos())
    }

    fn run(&self, casing: StageCasing, speed: f64) -> Result<Run> {
        let mut scene = self.scene(casing).clone();
        scene.settings.structures[0].speed = speed;
        let what = || format!("run at {speed} rad/s, {}", casing.name());
        run::march(self, &scene, casing, speed).map_err(|error| Failure::from_core(what(), error))
    }
}

/// Returns the scene with a rigid casing: a spline through as many points, oval all along the axis, and as far beyond
/// the tips.
fn rigid(scene: &Scene, ramp: f64) -> Scene {
    let mut scene = scene.clone();
    scene.roms.truncate(1);
    let ring = scene.settings.structures.pop();
    let amplitude = (1.0 + OVERLAP) * scene.settings.contacts[0].gap;
    // With the orientation of the load, whose phase is half a turn: narrow at θ = 0.
    let phase = ring.and_then(|ring| ring.load).map_or(0.0, |load| load.phase + std::f64::consts::PI);
    let surface = &mut scene.settings.surfaces[0];
    surface.structure = None;
    surface.patches = None;
    surface.spline = Some(SplineSettings { around: 28, along: 3, ..SplineSettings::default() });
    surface.shape = Shape::Lobes { amplitude, order: 2, phase };
    surface.ramp_time = ramp;
    scene
}

/// Returns the largest static radial displacement of the casing per unit amplitude of its load (m per N/m).
fn flexibility(scene: &Scene) -> Result<f64> {
    let in_scene = |error| Failure::from_core("static deformation of the casing", error);
    let mut scene = scene.clone();
    scene.settings.outputs.slave_displacement = true;
    let load = scene.settings.structures[1].load.as_mut();
    let load = load.ok_or_else(|| Failure::new("scene `stage`", "the casing has no load", ""))?;
    // Small enough to avoid contact.
    load.amplitude = 1e-3;
    let amplitude = load.amplitude;
    let mut simulation = Simulation::new(&scene).map_err(in_scene)?;
    simulation.initialise(scene.settings.experiment.start).map_err(in_scene)?;
    let variable = simulation.table().with_quantity(Quantity::SlaveDisplacement);
    let (first, count) = variable.map_or((0, 0), |variable| (variable.reference, variable.len()));
    let mut largest = 0.0_f64;
    for reference in (first..).take(count) {
        largest = largest.max(simulation.real(reference).map_err(in_scene)?.abs());
    }
    if largest > 0.0 {
        Ok(largest / amplitude)
    } else {
        Err(Failure::new("casing", "the load does not deform the casing", ""))
    }
}

/// Runs the study: loads the models, runs all speeds in all casings, draws.
///
/// # Errors
/// A model or a run that fails.
pub(crate) fn study(arguments: &crate::cli::LabStageArguments, console: &Console) -> Result<Study> {
    let quick = arguments.common.quick;
    let scene = scene_source::stage_scene(quick, &arguments.common.cache.cache(), console)?;
    let setup = StageSetup::new(scene, quick)?;
    let critical = setup.critical_speed();
    let count = if quick { QUICK_COUNT } else { COUNT };
    let speeds = arguments.speeds.unwrap_or(Speeds { from: RANGE[0] * critical, to: RANGE[1] * critical, count });
    // The elastic casing takes longer and comes first, so that no processor is idle at the end.
    let speeds = speeds.values();
    let asked: Vec<(StageCasing, f64)> =
        CASINGS.iter().rev().flat_map(|casing| speeds.iter().map(|speed| (*casing, *speed))).collect();
    let threads = arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get);
    let mut runs = {
        let task = console.task("Running the stage", Some(asked.len() as u64));
        sweep::sweep(
            &asked,
            threads,
            |(casing, speed)| setup.run(*casing, *speed),
            |done| {
                task.at(done as u64);
                task.line(&format!("{done} of {} runs", asked.len()));
            },
        )?
    };
    let smooth = runs.split_off(2 * speeds.len());
    let rigid = runs.split_off(speeds.len());
    let runs = [smooth, rigid, runs];
    let study = report(&setup, &runs)?;
    console.warn_texts(&warnings(runs.iter().flatten()));
    Ok(study)
}

/// Returns every warning once, regardless of its run.
fn warnings<'a>(runs: impl Iterator<Item = &'a Run>) -> Vec<String> {
    let mut all: Vec<String> = runs.flat_map(|run| run.warnings.iter().cloned()).collect();
    all.sort();
    all.dedup();
    all
}

/// Returns the run nearest to resonance, among the complete ones if there are any.
fn nearest<'a>(setup: &StageSetup, runs: &'a [Run]) -> Result<&'a Run> {
    let place = |run: &Run| (run.ended.is_some(), (run.speed / setup.critical_speed() - 1.0).abs());
    let shown = runs.iter().min_by(|a, b| {
        let [a, b] = [place(a), place(b)];
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    shown.ok_or_else(|| Failure::new("lab stage", "there are no runs", ""))
}

fn report(setup: &StageSetup, runs: &[Vec<Run>; 3]) -> Result<Study> {
    let names: Vec<String> = setup.scenes[0].roms[0].contact_nodes.iter().map(|node| node.name.clone()).collect();
    let (mut figures, mut statements, mut results) = (Vec::new(), Vec::new(), Vec::new());
    for (casing, runs) in CASINGS.into_iter().zip(runs) {
        figures.extend(figures::of(setup, casing, runs, &names)?);
        statements.extend(statements::of(setup, casing, runs, &names)?);
        results.push(to_json(setup, casing, runs));
    }
    figures.push(figures::shares(setup, runs)?);
    let steps: u64 = runs.iter().flatten().map(|run| run.internal_steps).sum();
    let stepping: f64 = runs.iter().flatten().map(|run| run.stepping.as_secs_f64()).sum();
    Ok(Study {
        name: "stage",
        title: "Blades against an oval casing".into(),
        summary: format!(
            "{} coupled blades rotate in a casing that becomes oval: rigid without friction, rigid with friction, and \
             elastic, at {} angular velocities each.{}",
            setup.scenes[0].roms[0].sectors,
            runs[0].len(),
            if setup.quick { " Quick mode: coarse meshes and few short runs, for a first look only." } else { "" }
        ),
        facts: facts(setup, steps, stepping),
        statements,
        results: json!({
            "critical_speed": setup.critical_speed(),
            "first_frequency_of_nodal_diameter_2": setup.frequency,
            "load_amplitude": setup.amplitude,
            "casings": results,
            "internal_steps": steps,
            "stepping_seconds": stepping,
        }),
        figures,
        files: Vec::new(),
    })
}

fn to_json(setup: &StageSetup, casing: StageCasing, runs: &[Run]) -> Value {
    json!({
        "casing": casing.name(),
        "warnings": warnings(runs.iter()),
        "speeds": runs.iter().map(|run| run.speed).collect::<Vec<_>>(),
        "ended_early": runs.iter().map(|run| run.ended.clone()).collect::<Vec<_>>(),
        "least_clearances_of_blade_1": runs.iter().map(|run| run.least.clone()).collect::<Vec<_>>(),
        "touches_of_blade_1": runs.iter().map(|run| run.touches.clone()).collect::<Vec<_>>(),
        "effective_amplitudes": SHOWN.map(|number| json!({
            "nodal_diameter": number,
            "values": runs.iter().map(|run| run.effective(number, setup.full())).collect::<Vec<_>>(),
        })),
    })
}

fn facts(setup: &StageSetup, steps: u64, stepping: f64) -> Vec<(String, String)> {
    let scene = setup.scene(StageCasing::Flexible);
    let [disk, ring] = [0, 1].map(|index| &scene.roms[index]);
    let damping =
        |index: usize| scene.settings.structures[index].damping_ratio.unwrap_or(scene.roms[index].damping_ratio);
    let facts = [
        ("disk", disk.origin.clone()),
        ("elastic casing", ring.origin.clone()),
        ("rigid casing", "spline through 28 × 3 points, with the same oval at every axial position".into()),
        ("degrees of freedom of the reduced disk", disk.total_order().to_string()),
        ("modes of the elastic casing", ring.order().to_string()),
        ("clearance at rest", format!("{} m", setup.gap())),
        ("friction coefficient", scene.settings.contacts[0].friction.to_string()),
        ("damping ratios of disk and casing", format!("{}, {}", damping(0), damping(1))),
        ("oval", format!("without deformation, the interference is {OVERLAP} of the clearance")),
        ("load amplitude for this oval", format!("{:.1} N/m", setup.amplitude)),
        ("first frequency of nodal diameter 2", format!("{:.2} Hz", setup.frequency)),
        ("critical speed of an oval casing", format!("{:.2} rad/s", setup.critical_speed())),
        ("simulated time per run", format!("{:.4} s", setup.schedule.stop - setup.schedule.start)),
        ("stepping", format!("{:.2} µs per internal step", 1e6 * stepping / steps.max(1) as f64)),
    ];
    facts.map(|(name, value)| (name.to_owned(), value)).to_vec()
}
