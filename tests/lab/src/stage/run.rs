//! One run of the stage: clearances and amplitudes of the blades over time.

use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::Quantity;

use super::{CLOSED, StageCasing, StageSetup};

/// Maximum number of points of one curve.
const MOST_POINTS: usize = 1000;

/// One run.
pub(super) struct Run {
    pub speed: f64,
    pub times: Vec<f64>,
    /// Clearances of the contact nodes of blade 1, node by node, at these times (m).
    pub clearances: Vec<Vec<f64>>,
    /// Smallest clearances of the same nodes at any internal step (m).
    pub least: Vec<f64>,
    /// Number of times that each of them closes and opens again after the casing is oval.
    pub touches: Vec<usize>,
    /// Amplitudes by nodal diameter from 0 (m).
    pub amplitudes: Vec<Vec<f64>>,
    /// Number of nodes in contact on the whole disk.
    pub contacts: Vec<f64>,
    /// Smallest clearance of all blades at any communication point (m).
    pub least_clearance: f64,
    pub energy_residual: f64,
    /// Largest force of any node at any internal step (N).
    pub largest_force: f64,
    pub stepping: std::time::Duration,
    pub internal_steps: u64,
    /// Warnings of the simulation, such as flutter of closed contact.
    pub warnings: Vec<String>,
    /// Reason if the run ended early.
    pub ended: Option<String>,
}

impl Run {
    /// Creates an empty run for a number of contact nodes of a blade and of nodal diameters.
    pub(super) fn new(speed: f64, nodes: usize, diameters: usize) -> Self {
        Self {
            speed,
            times: Vec::new(),
            clearances: vec![Vec::new(); nodes],
            least: vec![f64::INFINITY; nodes],
            touches: vec![0; nodes],
            amplitudes: vec![Vec::new(); diameters],
            contacts: Vec::new(),
            least_clearance: f64::INFINITY,
            energy_residual: 0.0,
            largest_force: 0.0,
            stepping: std::time::Duration::ZERO,
            internal_steps: 0,
            warnings: Vec::new(),
            ended: None,
        }
    }

    /// Returns the root mean square of an amplitude after the oval is complete.
    pub(super) fn effective(&self, nodal_diameter: usize, from: f64) -> f64 {
        let values = self.times.iter().zip(&self.amplitudes[nodal_diameter]).filter(|(time, _)| **time >= from);
        let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), (_, value)| (sum + value * value, count + 1));
        (sum / f64::from(count.max(1))).sqrt()
    }

    /// Returns the fraction of the points at which any blade touches.
    pub(super) fn touching(&self) -> f64 {
        let count = self.contacts.iter().filter(|count| **count > 0.0).count();
        count as f64 / self.contacts.len().max(1) as f64
    }
}

/// Elements of the variables that a run reads and writes.
struct Elements {
    clearances: Vec<u32>,
    least: Vec<u32>,
    amplitudes: Vec<u32>,
    contacts: Vec<u32>,
    load: Vec<u32>,
    residual: Vec<u32>,
    peak: Vec<u32>,
}

impl Elements {
    fn of(simulation: &Simulation) -> Self {
        let all = |quantity| -> Vec<u32> {
            let variable = simulation.table().with_quantity(quantity);
            variable.map_or(Vec::new(), |variable| (variable.reference..).take(variable.len()).collect())
        };
        Self {
            clearances: all(Quantity::Clearance(0)),
            least: all(Quantity::WatchedClearanceMinimum(0)),
            amplitudes: all(Quantity::NodalDiameterAmplitude),
            contacts: all(Quantity::ContactCount),
            load: all(Quantity::LoadAmplitude),
            residual: all(Quantity::EnergyResidualRelative),
            peak: all(Quantity::NormalForcePeak),
        }
    }
}

/// Extremes after every communication step, and the number of contacts of blade 1.
struct StageWatch {
    closed: Vec<bool>,
    limit: f64,
}

impl StageWatch {
    fn look(
        &mut self,
        run: &mut Run,
        simulation: &Simulation,
        elements: &Elements,
        full: bool,
    ) -> tiprub_core::Result<()> {
        let most = |list: &[u32], before: f64| -> tiprub_core::Result<f64> {
            // NaN is preserved: an extreme that includes an unknown value is unknown.
            list.iter().try_fold(before, |most, one| {
                let value = simulation.real(*one)?.abs();
                Ok(if value.is_nan() || value > most { value } else { most })
            })
        };
        run.energy_residual = most(&elements.residual, run.energy_residual)?;
        run.largest_force = most(&elements.peak, run.largest_force)?;
        let gaps = simulation.system().gaps().copied();
        run.least_clearance = gaps.fold(run.least_clearance, f64::min);
        for (node, one) in elements.least.iter().enumerate() {
            let least = simulation.real(*one)?;
            run.least[node] = run.least[node].min(least);
            let closed = least <= self.limit;
            run.touches[node] += usize::from(full && closed && !self.closed[node]);
            self.closed[node] = closed;
        }
        Ok(())
    }
}

fn record(run: &mut Run, simulation: &Simulation, elements: &Elements, time: f64) -> tiprub_core::Result<()> {
    run.times.push(time);
    for (column, one) in run.clearances.iter_mut().zip(&elements.clearances) {
        column.push(simulation.real(*one)?);
    }
    for (column, one) in run.amplitudes.iter_mut().zip(&elements.amplitudes) {
        column.push(simulation.real(*one)?);
    }
    for one in &elements.contacts {
        run.contacts.push(f64::from(simulation.integer(*one)?));
    }
    Ok(())
}

/// Performs one communication step.
fn advance(run: &mut Run, simulation: &mut Simulation, time: f64, length: f64) -> tiprub_core::Result<()> {
    simulation.begin_step(time, length)?;
    loop {
        run.internal_steps += 1;
        if simulation.advance()?.finished {
            return Ok(());
        }
    }
}

/// Performs the run at one speed; if it fails, the results so far are kept.
pub(super) fn march(setup: &StageSetup, scene: &Scene, casing: StageCasing, speed: f64) -> tiprub_core::Result<Run> {
    let mut simulation = Simulation::new(scene)?;
    let schedule = &setup.schedule;
    simulation.initialise(schedule.start)?;
    let elements = Elements::of(&simulation);
    let mut run = Run::new(speed, elements.clearances.len(), elements.amplitudes.len());
    let mut watch = StageWatch { closed: vec![false; run.least.len()], limit: CLOSED * setup.gap() };
    let stride = schedule.count.div_ceil(MOST_POINTS).max(1);
    for index in 0..=schedule.count {
        let time = schedule.time(index);
        watch.look(&mut run, &simulation, &elements, time >= setup.full())?;
        if index % stride == 0 {
            record(&mut run, &simulation, &elements, time)?;
        }
        if index == schedule.count {
            break;
        }
        if casing == StageCasing::Flexible {
            // An input reaches its value at the end of the step.
            for one in &elements.load {
                simulation.set_real(*one, setup.load(schedule.time(index + 1)))?;
            }
        }
        let clock = std::time::Instant::now();
        if let Err(error) = advance(&mut run, &mut simulation, time, schedule.time(index + 1) - time) {
            run.ended = Some(error.to_string());
            break;
        }
        run.stepping += clock.elapsed();
    }
    run.warnings = tiprub_cosim::warning::texts(simulation.warnings());
    Ok(run)
}
