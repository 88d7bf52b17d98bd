//! The paper's application (figs 11 and 12): coupled blades against an elastic casing that a load with two nodal diameters
//! makes oval, for a range of angular velocities.

use serde_json::json;
use tiprub_core::{Scene, Simulation, dynamics::cyclic::CyclicModel, variables::Quantity};

use super::{Figure, Picture, Sheet, Statement, Study, sweep};
use crate::{
    Failure, Result,
    cli::{Speeds, StudyArguments},
    console::Console,
    report::{
        plots::{Plot, Series},
        waterfall::{Axis, Waterfall},
    },
    scene_source,
    schedule::Schedule,
};

/// By how much the oval casing would reach beyond the tips at rest, as a share of the clearance.
const OVERLAP: f64 = 0.15;
/// Run length and the part of it in which the load grows, in periods of the first mode of nodal diameter 2.
const PERIODS: f64 = 25.0;
const QUICK_PERIODS: f64 = 10.0;
const RAMP_PERIODS: f64 = 4.0;
/// Angular velocities, relative to the one at which the oval meets the first mode of nodal diameter 2.
const RANGE: [f64; 2] = [0.5, 1.5];
const COUNT: usize = 21;
const QUICK_COUNT: usize = 5;
/// The nodal diameters of the paper's figure.
const SHOWN: [usize; 2] = [2, 4];
/// Points of one curve that are kept.
const MOST_POINTS: usize = 1000;
/// Nodal diameters below this share of the largest amplitude are not drawn.
const SILENT: f64 = 1e-4;
/// Largest clearance, as a share of the clearance at rest, that counts as contact.
const PENETRATION: f64 = 1e-6;

/// What is asked of one stage.
struct Setup {
    scene: Scene,
    /// Amplitude that closes the clearance and [`OVERLAP`] more (N/m).
    amplitude: f64,
    /// First frequency of nodal diameter 2 (Hz).
    frequency: f64,
    /// Angular velocity at which four waves per revolution meet the first mode of nodal diameter 4 (rad/s).
    second_resonance: f64,
    schedule: Schedule,
    ramp: f64,
}

/// One run.
struct Run {
    speed: f64,
    times: Vec<f64>,
    /// Of the contact nodes of blade 1, node by node (m).
    clearances: Vec<Vec<f64>>,
    /// Amplitudes by nodal diameter from 0 (m).
    amplitudes: Vec<Vec<f64>>,
    /// Nodes in contact on the whole disk.
    contacts: Vec<f64>,
    /// Smallest clearance anywhere at any communication point (m).
    least_clearance: f64,
    energy_residual: f64,
    largest_force: f64,
    stepping: std::time::Duration,
    internal_steps: u64,
    /// What the simulation warned of, such as flutter of closed contact.
    warnings: Vec<String>,
}

impl Setup {
    fn new(mut scene: Scene, quick: bool) -> Result<Self> {
        let disk = &scene.roms[0];
        let in_scene = |error| Failure::from_core("scene `stage`", error);
        let wheel = CyclicModel::from_rom(disk, disk.damping_ratio).map_err(in_scene)?;
        let frequency = wheel.diameters[2].frequencies[0] / std::f64::consts::TAU;
        let second_resonance = wheel.diameters.get(SHOWN[1]).map_or(f64::NAN, |modes| modes.frequencies[0] / 4.0);
        let gap = scene.settings.contacts[0].gap;
        // The load alone makes the casing oval here; the scene that ships adds a shape, which importers need not drive.
        scene.settings.surfaces[0].shape = tiprub_core::settings::Shape::Circular {};
        let amplitude = (1.0 + OVERLAP) * gap / flexibility(&scene)?;
        if let Some(load) = &mut scene.settings.structures[1].load {
            load.amplitude = 0.0;
        }
        let mut experiment = scene.settings.experiment.clone();
        let periods = if quick { QUICK_PERIODS } else { PERIODS };
        let step = experiment.communication_step;
        experiment.stop = experiment.start + (periods / frequency / step).ceil() * step;
        let schedule = Schedule::new(&experiment, None, None)?;
        Ok(Self { scene, amplitude, frequency, second_resonance, schedule, ramp: RAMP_PERIODS / frequency })
    }

    /// Where the oval, which the turning blades see twice per revolution, meets the first mode of nodal diameter 2 (rad/s).
    fn critical_speed(&self) -> f64 {
        std::f64::consts::PI * self.frequency
    }

    /// The load grows smoothly from nothing.
    fn load(&self, time: f64) -> f64 {
        let share = ((time - self.schedule.start) / self.ramp).clamp(0.0, 1.0);
        0.5 * self.amplitude * (1.0 - (std::f64::consts::PI * share).cos())
    }

    fn run(&self, speed: f64) -> Result<Run> {
        let mut scene = self.scene.clone();
        scene.settings.structures[0].speed = speed;
        self.march(&scene, speed).map_err(|error| Failure::from_core(format!("run at {speed} rad/s"), error))
    }

    fn march(&self, scene: &Scene, speed: f64) -> tiprub_core::Result<Run> {
        let mut simulation = Simulation::new(scene)?;
        simulation.initialise(self.schedule.start)?;
        let reference = |quantity| simulation.table().with_quantity(quantity).map(|v| (v.reference, v.len()));
        let elements = |quantity| -> Vec<u32> {
            reference(quantity).map_or(Vec::new(), |(first, count)| (first..).take(count).collect())
        };
        let (clearances, amplitudes) = (elements(Quantity::Clearance(0)), elements(Quantity::NodalDiameterAmplitude));
        let (contacts, load) = (elements(Quantity::ContactCount), elements(Quantity::LoadAmplitude));
        let (residual, peak) = (elements(Quantity::EnergyResidualRelative), elements(Quantity::NormalForcePeak));
        let mut run = Run {
            speed,
            times: Vec::new(),
            clearances: vec![Vec::new(); clearances.len()],
            amplitudes: vec![Vec::new(); amplitudes.len()],
            contacts: Vec::new(),
            least_clearance: f64::INFINITY,
            energy_residual: 0.0,
            largest_force: 0.0,
            stepping: std::time::Duration::ZERO,
            internal_steps: 0,
            warnings: Vec::new(),
        };
        let stride = self.schedule.count.div_ceil(MOST_POINTS).max(1);
        for index in 0..=self.schedule.count {
            let time = self.schedule.time(index);
            let gaps = simulation.system().gaps().iter().copied();
            run.least_clearance = gaps.fold(run.least_clearance, f64::min);
            let most = |list: &[u32], before: f64| -> tiprub_core::Result<f64> {
                list.iter().try_fold(before, |most: f64, one| Ok(most.max(simulation.real(*one)?.abs())))
            };
            run.energy_residual = most(&residual, run.energy_residual)?;
            run.largest_force = most(&peak, run.largest_force)?;
            if index % stride == 0 {
                run.times.push(time);
                for (column, one) in run.clearances.iter_mut().zip(&clearances) {
                    column.push(simulation.real(*one)?);
                }
                for (column, one) in run.amplitudes.iter_mut().zip(&amplitudes) {
                    column.push(simulation.real(*one)?);
                }
                for one in &contacts {
                    run.contacts.push(f64::from(simulation.integer(*one)?));
                }
            }
            if index == self.schedule.count {
                break;
            }
            // What is set is reached at the end of the step.
            for one in &load {
                simulation.set_real(*one, self.load(self.schedule.time(index + 1)))?;
            }
            let clock = std::time::Instant::now();
            simulation.begin_step(time, self.schedule.time(index + 1) - time)?;
            loop {
                run.internal_steps += 1;
                if simulation.advance()?.finished {
                    break;
                }
            }
            run.stepping += clock.elapsed();
        }
        run.warnings = simulation.warnings().to_vec();
        Ok(run)
    }
}

/// Largest static radial displacement of the casing per unit amplitude of its load (m per N/m).
fn flexibility(scene: &Scene) -> Result<f64> {
    let in_scene = |error| Failure::from_core("static deformation of the casing", error);
    let mut scene = scene.clone();
    scene.settings.outputs.slave_displacement = true;
    let load = scene.settings.structures[1].load.as_mut();
    let load = load.ok_or_else(|| Failure::new("scene `stage`", "there is no load on the casing", ""))?;
    // Small enough not to touch.
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
    if largest > 0.0 { Ok(largest / amplitude) } else { Err(Failure::new("casing", "the load does not deform it", "")) }
}

impl Run {
    /// Root mean square of an amplitude once the load is there.
    fn effective(&self, nodal_diameter: usize, from: f64) -> f64 {
        let values = self.times.iter().zip(&self.amplitudes[nodal_diameter]).filter(|(time, _)| **time >= from);
        let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), (_, value)| (sum + value * value, count + 1));
        (sum / f64::from(count.max(1))).sqrt()
    }

    /// Share of the points at which any blade touches.
    fn touching(&self) -> f64 {
        let count = self.contacts.iter().filter(|count| **count > 0.0).count();
        count as f64 / self.contacts.len().max(1) as f64
    }
}

/// Clearances of blade 1 over time at one speed: fig. 11.
fn clearance_figure(setup: &Setup, run: &Run, names: &[String]) -> Result<Figure> {
    let gap = setup.scene.settings.contacts[0].gap;
    let time = |time: &f64| time * setup.frequency;
    let series = names.iter().zip(&run.clearances).map(|(name, column)| {
        let points = run.times.iter().zip(column).map(|(at, value)| (time(at), value / gap)).collect();
        Series::line(name.replace('_', " "), points)
    });
    let mut plot = Plot::new(
        "time (periods of the first mode of nodal diameter 2)",
        "clearance / clearance at rest",
        series.collect(),
    );
    plot.height = 340;
    plot.levels.push((0.0, "contact".into()));
    let mut sheet = Sheet::new(["time (s)", "time (periods)"]);
    sheet.columns.extend(names.iter().map(|name| format!("{name} (m)")));
    sheet.columns.push("nodes in contact".into());
    for (index, at) in run.times.iter().enumerate() {
        let mut row = vec![*at, time(at)];
        row.extend(run.clearances.iter().map(|column| column[index]));
        row.push(run.contacts.get(index).copied().unwrap_or(0.0));
        sheet.rows.push(row);
    }
    Ok(Figure {
        name: "clearances",
        caption: format!(
            "Clearance between blade 1 and the casing at its three contact nodes, at {:.1} rad/s. The load grows over the \
             first {RAMP_PERIODS} periods; where the curves are zero the blade is in contact.",
            run.speed
        ),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// Amplitude of one nodal diameter over time and speed: fig. 12.
fn waterfall_figure(setup: &Setup, runs: &[Run], nodal_diameter: usize) -> Figure {
    let critical = setup.critical_speed();
    let points = |run: &Run| {
        let column = run.times.iter().zip(&run.amplitudes[nodal_diameter]);
        column.map(|(time, value)| (time * setup.frequency, 1e6 * value)).collect::<Vec<_>>()
    };
    let all = runs.iter().flat_map(|run| run.amplitudes[nodal_diameter].iter().map(|value| 1e6 * value));
    let times = runs.iter().flat_map(|run| run.times.iter().map(|time| time * setup.frequency));
    let waterfall = Waterfall {
        x: Axis::over("time (periods of the first mode of nodal diameter 2)", times),
        depth: Axis::over("speed / critical speed", runs.iter().map(|run| run.speed / critical)),
        value: Axis::over("amplitude (µm)", all.chain([0.0])),
        curves: runs.iter().map(|run| (run.speed / critical, points(run))).collect(),
    };
    let mut sheet = Sheet::new(["speed (rad/s)", "time (s)", "amplitude (m)"]);
    for run in runs {
        let column = run.times.iter().zip(&run.amplitudes[nodal_diameter]);
        sheet.rows.extend(column.map(|(time, value)| vec![run.speed, *time, *value]));
    }
    Figure {
        name: if nodal_diameter == SHOWN[0] { "nodal-diameter-2" } else { "nodal-diameter-4" },
        caption: format!(
            "Share of nodal diameter {nodal_diameter} in the radial displacement of the blades (middle contact node) over time and \
             angular velocity; the critical speed is {critical:.1} rad/s."
        ),
        picture: Picture::waterfall(&waterfall),
        sheet,
    }
}

/// Effective amplitudes against speed.
fn amplitude_figure(setup: &Setup, runs: &[Run]) -> Result<Figure> {
    let diameters = runs.first().map_or(0, |run| run.amplitudes.len());
    let value = |run: &Run, number: usize| run.effective(number, setup.schedule.start + setup.ramp);
    let most = |number: usize| runs.iter().map(|run| value(run, number)).fold(0.0, f64::max);
    let largest = (0..diameters).map(most).fold(0.0, f64::max);
    let (shown, silent): (Vec<usize>, Vec<usize>) =
        (0..diameters.min(5)).partition(|number| most(*number) > SILENT * largest);
    let series = shown.into_iter().map(|number| {
        let points = runs.iter().map(|run| (run.speed, 1e6 * value(run, number))).collect();
        Series::line(format!("nodal diameter {number}"), points)
    });
    let plot = Plot {
        logarithmic: true,
        marked: true,
        height: 320,
        ..Plot::new("angular velocity (rad/s)", "effective amplitude (µm)", series.collect())
    };
    let mut sheet = Sheet::new(["speed (rad/s)", "speed / critical speed"]);
    sheet.columns.extend((0..diameters).map(|number| format!("nodal diameter {number} (m)")));
    sheet.columns.extend(["points with contact", "largest force (N)", "least clearance (m)"].map(String::from));
    for run in runs {
        let mut row = vec![run.speed, run.speed / setup.critical_speed()];
        row.extend((0..diameters).map(|number| value(run, number)));
        row.extend([run.touching(), run.largest_force, run.least_clearance]);
        sheet.rows.push(row);
    }
    let mut caption =
        "Effective amplitude (root mean square once the load is there) of the nodal diameters against angular velocity.".to_owned();
    if !silent.is_empty() {
        let silent = silent.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        caption.push_str(&format!(
            " Not drawn, below {SILENT:e} of the largest: nodal diameters {silent}; the numbers are whole."
        ));
    }
    Ok(Figure { name: "amplitudes", caption, picture: Picture::plot(&plot)?, sheet })
}

fn statements(setup: &Setup, runs: &[Run], shown: &Run) -> Vec<Statement> {
    let gap = setup.scene.settings.contacts[0].gap;
    let from = setup.schedule.start + setup.ramp;
    let touched = runs.iter().filter(|run| run.touching() > 0.0).count();
    let least = shown.clearances.iter().map(|column| column.iter().copied().fold(f64::INFINITY, f64::min));
    let least: Vec<f64> = least.collect();
    let deepest = runs.iter().map(|run| -run.least_clearance).fold(0.0, f64::max);
    let ratio = |run: &Run| run.effective(SHOWN[1], from) / run.effective(SHOWN[0], from);
    let ratios: Vec<f64> = runs.iter().map(ratio).collect();
    let third = ratios.len().div_ceil(3);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (low, high) = (mean(&ratios[..third]), mean(&ratios[ratios.len() - third..]));
    let over = |threshold: f64| {
        let fast = runs.iter().zip(&ratios).filter(|(run, _)| run.speed >= threshold);
        fast.map(|(_, ratio)| *ratio).fold(0.0, f64::max)
    };
    let (largest, fast) = (over(0.0), over(setup.critical_speed()));
    let energy = runs.iter().map(|run| run.energy_residual).fold(0.0, f64::max);
    let warned = warnings(runs);
    vec![
        Statement::tested(
            "The oval casing closes the clearance: blade 1 comes into contact (fig. 11)",
            least.iter().any(|value| *value <= PENETRATION * gap),
            format!(
                "smallest clearances of its nodes at {:.1} rad/s: {} of the clearance at rest",
                shown.speed,
                least.iter().map(|value| format!("{:.3}", value / gap)).collect::<Vec<_>>().join(", ")
            ),
        ),
        Statement::tested(
            "There is contact at every angular velocity",
            touched == runs.len(),
            format!("at {touched} of {} angular velocities", runs.len()),
        ),
        Statement::remark(
            "Residual penetrations (fig. 11)",
            format!(
                "deepest reported at any communication point of any run: {deepest} m. The solver lcp closes every gap of a step \
                 exactly, so this is no measurement; what the turning of a flexible casing's normal within a step leaves is in \
                 the chapter Validation"
            ),
        ),
        Statement::tested(
            "Nodal diameter 2, that of the load, prevails over nodal diameter 4 from the critical speed on (fig. 12)",
            fast < 1.0,
            format!(
                "effective amplitude of 4 relative to that of 2: at most {fast:.3} there, {largest:.3} at any angular velocity. \
                 Contact twice per revolution also shakes at four times the speed, which meets the first mode of nodal \
                 diameter 4 at {:.1} rad/s ({:.2} of the critical speed)",
                setup.second_resonance,
                setup.second_resonance / setup.critical_speed()
            ),
        ),
        Statement::tested(
            "The share of nodal diameter 4 falls behind that of 2 as the angular velocity grows (fig. 12)",
            high < low,
            format!("{low:.3} on the average of the slowest third, {high:.3} of the fastest"),
        ),
        Statement::tested(
            "The energy ledger closes in every run",
            energy < 1e-9,
            format!("largest residual {energy:.1e} of the energy exchanged"),
        ),
        Statement::remark("Warnings of the runs", if warned.is_empty() { "none".into() } else { warned.join("; ") }),
    ]
}

/// The study: load the models, run all speeds, draw.
///
/// # Errors
/// A model or a run fails.
pub fn study(arguments: &StudyArguments, console: &Console) -> Result<Study> {
    let quick = arguments.quick;
    let scene = scene_source::stage_scene(quick, &arguments.cache.cache(), console)?;
    let setup = Setup::new(scene, quick)?;
    let critical = setup.critical_speed();
    let count = if quick { QUICK_COUNT } else { COUNT };
    let speeds = arguments.speeds.unwrap_or(Speeds { from: RANGE[0] * critical, to: RANGE[1] * critical, count });
    let speeds = speeds.values();
    let threads = arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get);
    let runs = {
        let task = console.task("Running the stage", Some(speeds.len() as u64));
        sweep::sweep(
            &speeds,
            threads,
            |speed| setup.run(*speed),
            |done| {
                task.at(done as u64);
                task.line(&format!("{done} of {} angular velocities", speeds.len()));
            },
        )?
    };
    let study = report(&setup, &runs, quick)?;
    console.warn(&warnings(&runs));
    Ok(study)
}

/// Every warning once, whichever run it came from.
fn warnings(runs: &[Run]) -> Vec<String> {
    let mut all: Vec<String> = runs.iter().flat_map(|run| run.warnings.iter().cloned()).collect();
    all.sort();
    all.dedup();
    all
}

fn report(setup: &Setup, runs: &[Run], quick: bool) -> Result<Study> {
    let critical = setup.critical_speed();
    let distance = |run: &&Run| (run.speed / critical - 1.0).abs();
    let shown = runs.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let shown = shown.ok_or_else(|| Failure::new("study stage", "no run", ""))?;
    let names: Vec<String> = setup.scene.roms[0].contact_nodes.iter().map(|node| node.name.clone()).collect();
    let mut figures = vec![clearance_figure(setup, shown, &names)?];
    figures.extend(SHOWN.map(|number| waterfall_figure(setup, runs, number)));
    figures.push(amplitude_figure(setup, runs)?);
    let [disk, ring] = [0, 1].map(|index| &setup.scene.roms[index]);
    let steps: u64 = runs.iter().map(|run| run.internal_steps).sum();
    let stepping: f64 = runs.iter().map(|run| run.stepping.as_secs_f64()).sum();
    let simulated = (setup.schedule.stop - setup.schedule.start) * runs.len() as f64;
    let damping = |index: usize| {
        setup.scene.settings.structures[index].damping_ratio.unwrap_or(setup.scene.roms[index].damping_ratio)
    };
    Ok(Study {
        name: "stage",
        title: "Blades against an oval casing".into(),
        summary: format!(
            "{} coupled blades turn in an elastic casing that a load with two nodal diameters makes oval, at {} angular velocities.{}",
            disk.sectors,
            runs.len(),
            if quick { " Quick form: coarse meshes and few short runs, for a first look only." } else { "" }
        ),
        facts: vec![
            ("disk".into(), disk.origin.clone()),
            ("casing".into(), ring.origin.clone()),
            ("degrees of freedom of the reduced disk".into(), disk.total_order().to_string()),
            ("modes of the casing".into(), ring.order().to_string()),
            ("clearance at rest".into(), format!("{} m", setup.scene.settings.contacts[0].gap)),
            ("friction coefficient".into(), setup.scene.settings.contacts[0].friction.to_string()),
            ("damping ratios of disk and casing".into(), format!("{}, {}", damping(0), damping(1))),
            (
                "load amplitude".into(),
                format!(
                    "{:.1} N/m: at rest the oval would reach {OVERLAP} of the clearance beyond the tips",
                    setup.amplitude
                ),
            ),
            ("first frequency of nodal diameter 2".into(), format!("{:.2} Hz", setup.frequency)),
            ("critical speed of an oval casing".into(), format!("{critical:.2} rad/s")),
            ("simulated time per run".into(), format!("{:.4} s", setup.schedule.stop - setup.schedule.start)),
            (
                "stepping".into(),
                format!(
                    "{:.2} µs per internal step, {:.1} s of computing per simulated second",
                    1e6 * stepping / steps.max(1) as f64,
                    stepping / simulated
                ),
            ),
        ],
        statements: statements(setup, runs, shown),
        results: json!({
            "critical_speed": critical,
            "first_frequency_of_nodal_diameter_2": setup.frequency,
            "load_amplitude": setup.amplitude,
            "warnings": warnings(runs),
            "speeds": runs.iter().map(|run| run.speed).collect::<Vec<_>>(),
            "internal_steps": steps,
            "stepping_seconds": stepping,
            "microseconds_per_internal_step": 1e6 * stepping / steps.max(1) as f64,
            "real_time_factor": stepping / simulated,
        }),
        figures,
        files: Vec::new(),
    })
}
