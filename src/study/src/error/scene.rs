//! Runs whole scenes with [`Simulation`], in the same way as an FMU steps them.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{ADAPTIVE_STEP, BodyMotion};
use tiprub_core::{CoSimulation, Scene, Simulation, system::Structure};
use tiprub_shell::native;

use super::{
    competitor::Competitor,
    run::{StepExtremes, TimedRun},
};

/// A run of a scene.
pub struct SceneRun {
    simulation: Simulation,
    start: f64,
    interval: f64,
    division: u32,
    samples: u32,
    /// Motion without contact of every structure that has contact nodes.
    unmoved: Vec<Unmoved>,
}

/// Motion of a structure without contact: at rest at its start position, or in straight flight.
struct Unmoved {
    /// Displacements at the start (m).
    start: Vec<f64>,
    /// Their rates (m/s); empty if the structure does not move freely.
    rates: Vec<f64>,
    /// True if contact forces have acted on it.
    touched: bool,
}

/// Returns the displacements of all contact nodes: node by node, axis by axis, sector by sector (m).
fn rows(structure: &Structure) -> Vec<f64> {
    let modes = structure.modes();
    (0..modes.rows()).flat_map(|row| (0..modes.sectors()).map(move |sector| modes.row(row, sector))).collect()
}

impl Unmoved {
    fn of(structure: &Structure, flies: bool) -> Self {
        let modes = structure.modes();
        let rate = |row: usize| (modes.row(row, 0) - modes.row_before(row, 0)) / modes.step();
        let rates = if flies { (0..modes.rows()).map(rate).collect() } else { Vec::new() };
        Self { start: rows(structure), rates, touched: false }
    }

    /// Returns the displacements caused by contact up to a time since the start (s): exactly zero for free bodies that were not touched.
    fn moved(&self, mut displacements: Vec<f64>, time: f64) -> Vec<f64> {
        displacements.iter_mut().zip(&self.start).for_each(|(value, start)| *value -= start);
        for (value, rate) in displacements.iter_mut().zip(&self.rates) {
            *value = if self.touched { *value - rate * time } else { 0.0 };
        }
        displacements
    }
}

impl SceneRun {
    /// Compiles and initialises the scene; `perturbation` is a relative change of clearances and velocities.
    ///
    /// # Errors
    /// The core rejects the scene.
    pub fn new(
        scene: &Scene,
        (scheme, solver): (Scheme, Solver),
        interval: f64,
        division: u32,
        perturbation: f64,
    ) -> Result<Self, String> {
        let scene = Self::changed(scene, (scheme, solver), interval / f64::from(division), perturbation);
        Self::with_start_values(&scene, interval, division, &[])
    }

    /// Returns the scene with another method: with `division` internal steps in `interval` (s), or with the tolerance 1/`division`; and with a
    /// relative change of clearances and velocities.
    pub fn by(
        scene: &Scene,
        (scheme, solver): (Scheme, Solver),
        interval: f64,
        division: u32,
        perturbation: f64,
    ) -> Scene {
        if !Competitor::Core(scheme, solver).is_by_tolerance() {
            return Self::changed(scene, (scheme, solver), interval / f64::from(division), perturbation);
        }
        let mut scene = Self::changed(scene, (scheme, solver), ADAPTIVE_STEP.min(interval), perturbation);
        scene.settings.time.tolerance = Some(1.0 / f64::from(division));
        scene
    }

    /// Returns the scene with another method and internal step (s), and with a relative change of clearances and velocities.
    pub fn changed(scene: &Scene, (scheme, solver): (Scheme, Solver), step: f64, perturbation: f64) -> Scene {
        let mut scene = scene.clone();
        scene.settings.time.scheme = scheme;
        scene.settings.time.step = step;
        for contact in &mut scene.settings.contacts {
            contact.solver = solver;
            contact.gap *= 1.0 + perturbation;
            contact.sector_gaps.iter_mut().for_each(|gap| *gap *= 1.0 + perturbation);
        }
        // The gaps of free bodies are part of their ROMs.
        let velocities = scene.settings.structures.iter_mut().flat_map(|structure| &mut structure.velocity);
        velocities.for_each(|velocity| *velocity *= 1.0 + perturbation);
        scene
    }

    /// Compiles and initialises the scene with replaced start values (name, value as text).
    ///
    /// # Errors
    /// The errors of [`Self::new`], or a rejected value.
    pub fn with_start_values(
        scene: &Scene,
        interval: f64,
        division: u32,
        values: &[(String, String)],
    ) -> Result<Self, String> {
        let start = scene.settings.experiment.start;
        let mut simulation = Simulation::new(scene).map_err(|error| error.to_string())?;
        for (name, value) in values {
            native::set(&mut simulation, name, value).map_err(|failure| failure.to_string())?;
        }
        simulation.initialise(start).map_err(|error| error.to_string())?;
        let (structures, pairs) = (simulation.system().structures(), simulation.system().pairs());
        let flies = |index: usize| {
            let mut pairs = pairs.iter().zip(&scene.settings.contacts);
            let master = pairs.find(|(pair, _)| pair.structure() == index).map(|(_, contact)| &contact.master);
            let all = scene.settings.structures.iter();
            all.filter(|structure| Some(&structure.name) == master).any(|master| master.motion == BodyMotion::Free)
        };
        let touching = structures.iter().enumerate().filter(|(_, structure)| structure.nodes() > 0);
        let unmoved = touching.map(|(index, structure)| Unmoved::of(structure, flies(index))).collect();
        Ok(Self { simulation, start, interval, division, samples: 0, unmoved })
    }

    /// Returns the strain energy of all structures (J).
    pub fn strain_energy(&self) -> f64 {
        self.simulation.system().energies().1
    }

    /// Returns the work of friction since the start (J).
    pub fn friction_work(&self) -> f64 {
        self.simulation.system().ledger().friction_loss.value()
    }

    /// Returns the displacements of all contact nodes, free flight included (m).
    pub fn displacements_with_flight(&self) -> Vec<f64> {
        self.touching().flat_map(rows).collect()
    }

    /// Returns the structures with contact nodes.
    fn touching(&self) -> impl Iterator<Item = &Structure> {
        self.simulation.system().structures().iter().filter(|structure| structure.nodes() > 0)
    }

    /// Returns the displacements of watched points (m).
    pub fn watched_displacements(&self) -> Vec<f64> {
        self.simulation.watched_displacements()
    }

    /// Returns the current time (s).
    pub fn time(&self) -> f64 {
        self.start + f64::from(self.samples) * self.interval
    }
}

impl TimedRun for SceneRun {
    fn advance(&mut self) -> Result<(), String> {
        let time = self.time();
        self.samples += 1;
        self.simulation.do_step(time, self.interval).map_err(|error| error.to_string())
    }

    fn watch(&mut self, seen: &mut StepExtremes) -> Result<(), String> {
        let time = self.time();
        self.samples += 1;
        self.simulation.begin_step(time, self.interval).map_err(|error| error.to_string())?;
        loop {
            let progress = self.simulation.advance().map_err(|error| error.to_string())?;
            let system = self.simulation.system();
            // Adaptive steps are not divided.
            let step = match system.settings().scheme {
                Scheme::Galerkin => system.step_size(),
                _ => self.interval / f64::from(self.division),
            };
            let least = system.gaps().fold(f64::INFINITY, |least: f64, gap| least.min(*gap));
            seen.add(progress.time, step, system.events().iter().map(|event| event.normal), least);
            seen.shares.resize(self.unmoved.len(), 0.0);
            for event in system.events() {
                seen.shares[event.structure] += event.normal * step;
                self.unmoved[event.structure].touched = true;
            }
            if progress.finished {
                return Ok(());
            }
        }
    }

    /// Returns the displacements caused by contact: without the start values and without free flight, which would hide them.
    fn displacements(&self) -> Vec<f64> {
        let time = f64::from(self.samples) * self.interval;
        let each = self.touching().zip(&self.unmoved);
        each.flat_map(|(structure, unmoved)| unmoved.moved(rows(structure), time)).collect()
    }

    fn parts(&self) -> Vec<usize> {
        self.unmoved.iter().map(|unmoved| unmoved.start.len()).collect()
    }

    fn energy(&self) -> f64 {
        let (kinetic, strain) = self.simulation.system().energies();
        kinetic + strain
    }

    fn residual(&self) -> Option<f64> {
        let system = self.simulation.system();
        let scale = system.ledger().scale();
        (scale > 0.0).then(|| system.ledger().residual(self.energy()) / scale)
    }
}
