//! Adaptive steps of a whole scene: each island separately, with its own steps.

use super::scene_island::SceneIsland;
use crate::geometry::PrescribedMotion;
use crate::system::{SearchStart, StepFailure, Structure, System};
use crate::time::workers::Workers;
use crate::time::{SteadyInterval, Stepper};
use std::io;

/// Tables and scratch memory for adaptive steps of all islands of a system.
#[derive(Debug, Clone)]
pub struct Galerkin {
    /// Single sectors first, in the order of their structures.
    islands: Vec<SceneIsland>,
    /// Largest number of attempted steps since the start of the run.
    most_tried: u64,
    /// Threads that share the sectors of an island.
    workers: Workers,
}

impl Galerkin {
    /// Creates tables for spans up to `longest` (s) with errors within the fraction `tolerance` of the smallest clearance of each set.
    pub fn new(system: &mut System, longest: f64, tolerance: f64) -> Self {
        let touches = |set: &usize| !system.sets.pairs(*set).is_empty();
        let sets = (0..system.sets.count()).filter(touches);
        let islands = sets.map(|set| SceneIsland::new(set, system, longest, tolerance));
        let (mut islands, others): (Vec<_>, Vec<_>) = islands.partition(SceneIsland::is_single);
        islands.extend(others);
        for structure in system.structures.iter_mut().filter(|structure| structure.nodes() > 0) {
            structure.lowest_in_span = vec![f64::INFINITY; structure.gaps().len()];
        }
        Self { islands, most_tried: u64::MAX, workers: Workers::default() }
    }
}

impl Stepper for Galerkin {
    fn set_step(&mut self, step: f64) {
        self.islands.iter_mut().for_each(|island| island.set_span(step));
    }

    fn allow(&mut self, most_tried: u64) {
        self.most_tried = most_tried;
    }

    fn use_threads(&mut self, threads: usize) -> io::Result<()> {
        let most = self.islands.iter().map(SceneIsland::max_threads).max().unwrap_or(1);
        let more = threads.min(most).saturating_sub(1);
        if more != self.workers.count() {
            self.workers = Workers::default();
            self.workers = Workers::new(more)?;
            self.islands.iter_mut().for_each(|island| island.use_threads(more + 1));
        }
        Ok(())
    }

    fn step(&mut self, system: &mut System, drives: &[PrescribedMotion]) -> Result<(), StepFailure> {
        let span = system.step_size();
        for (pair, drive) in system.pairs.iter_mut().zip(drives) {
            pair.move_to(drive, span);
        }
        system.events.shift();
        system.events.now.clear();
        let factorisations = system.counted.effort.factorisations;
        let Self { islands, most_tried, workers } = self;
        islands.iter_mut().try_for_each(|island| island.integrate(system, span, *most_tried, workers))?;
        system.counted.factorisations += system.counted.effort.factorisations - factorisations;
        system.check_travel()?;
        system.find_gaps(SearchStart::StartOfSpan);
        system.structures.iter_mut().for_each(Structure::include_gaps_now);
        system.check_edges()?;
        system.counted.steps += 1;
        Ok(())
    }

    fn fly(&mut self, system: &mut System, drives: &[PrescribedMotion], turns: &[f64], length: f64) -> bool {
        let all_single =
            self.islands.len() == system.structures.len() && self.islands.iter().all(SceneIsland::is_single);
        if !all_single || !self.islands.iter_mut().all(|island| island.is_free(system, drives, turns)) {
            return false;
        }
        for (pair, drive) in system.pairs.iter_mut().zip(drives) {
            pair.move_to(drive, length);
        }
        self.islands.iter_mut().for_each(|island| island.fly(system, length));
        system.events.now.clear();
        system.events.before.clear();
        system.find_gaps(SearchStart::Angles);
        system.counted.steps += 1;
        true
    }

    fn supports_steady_phase(&self) -> bool {
        self.islands.iter().all(SceneIsland::supports_steady_phase)
    }

    fn step_in_steady_phase(
        &mut self,
        system: &mut System,
        drives: &[PrescribedMotion],
        interval: SteadyInterval,
    ) -> Result<(), StepFailure> {
        for (pair, drive) in system.pairs.iter_mut().zip(drives) {
            pair.move_to(drive, interval.to - interval.from);
        }
        system.events.shift();
        system.events.now.clear();
        let factorisations = system.counted.effort.factorisations;
        let Self { islands, workers, .. } = self;
        islands.iter_mut().try_for_each(|island| island.integrate_steady_interval(system, interval, workers))?;
        system.counted.factorisations += system.counted.effort.factorisations - factorisations;
        system.check_travel()?;
        system.structures.iter_mut().for_each(|structure| {
            structure.find_lowest();
            structure.include_gaps_now();
        });
        system.check_edges()?;
        system.counted.steps += 1;
        Ok(())
    }

    fn close_steps(&mut self, system: &mut System, time: f64) -> Result<(), StepFailure> {
        let (span, factorisations) = (system.steady_phase.span, system.counted.effort.factorisations);
        self.islands
            .iter_mut()
            .try_for_each(|island| island.close_steps(system, SteadyInterval { from: time, to: time, span }))?;
        system.counted.factorisations += system.counted.effort.factorisations - factorisations;
        system.steady_phase.active = false;
        system.find_gaps(SearchStart::Angles);
        Ok(())
    }

    fn begin_loads(&mut self, system: &mut System) {
        for structure in &mut system.structures {
            if structure.bank().is_some() {
                structure.modes_mut().begin_loads();
            }
        }
    }
}
