//! Recorder that fills a [`CubeHistory`] during a run.

use super::MethodRun;
use super::contact::{RingContact, Vectors};
use crate::cube::history::{CubeHistory, CubeSnapshot, processor_time};
use crate::cube::scene::CubeScene;

/// Data of one step of a method.
pub(super) struct StepEntry<'a> {
    pub(super) time: f64,
    pub(super) displacements: &'a Vectors,
    /// Velocity of the cube at all dofs, in any definition that is consistent with the scheme.
    pub(super) cube_velocity: &'a [f64],
    pub(super) kinetic: f64,
    pub(super) strain: f64,
}

pub(super) struct Recorder<'a> {
    scene: &'a CubeScene,
    run: &'a MethodRun,
    /// Nodes 1, 6, 85, 90 and 31, 36, 91, 96 (from 1), and their masters.
    corners: Vec<(usize, usize)>,
    masses: Vec<f64>,
    history: CubeHistory,
    started: f64,
    prepared: f64,
    penetration: f64,
    /// Sums since the last record: normal forces of all masters, and the number of steps.
    forces: Vec<f64>,
    summed: usize,
}

impl<'a> Recorder<'a> {
    /// Starts the clock for the preparation.
    pub(super) fn new(scene: &'a CubeScene, run: &'a MethodRun, method: &str) -> Self {
        let cube = &scene.bodies[0];
        let nodes = ["CORNERS_LEFT", "CORNERS_RIGHT"].map(|set| cube.mesh.sets[set].clone()).concat();
        let master = |node: usize| cube.contact.iter().position(|other| *other == node).expect("corners are masters");
        let mut masses = vec![0.0; cube.dofs()];
        super::blocks::BlockMatrix::new(&cube.mass).times(&vec![1.0; cube.dofs()], &mut masses);
        Self {
            scene,
            run,
            corners: nodes.into_iter().map(|node| (node, master(node))).collect(),
            masses,
            history: CubeHistory { method: method.into(), step: run.step, ..CubeHistory::default() },
            started: processor_time(),
            prepared: f64::NAN,
            penetration: 0.0,
            forces: vec![0.0; 2 * scene.masters],
            summed: 0,
        }
    }

    /// Ends the preparation and starts the clock of the steps.
    pub(super) fn prepared(&mut self) {
        self.prepared = processor_time();
    }

    pub(super) fn iterations(&mut self, count: usize) {
        self.history.iterations += count;
    }

    /// Returns whether the step is to be recorded.
    pub(super) fn wants(&self, step: usize) -> bool {
        step.is_multiple_of(self.run.stride)
    }

    /// Keeps the largest penetration of steps between records.
    pub(super) fn note_penetration(&mut self, penetration: f64) {
        self.penetration = self.penetration.max(penetration);
    }

    /// Adds contact forces of a step (in the frames, N); records contain their means.
    pub(super) fn note_forces(&mut self, contacts: &[RingContact], forces: &[[f64; 3]]) {
        for (contact, force) in contacts.iter().zip(forces) {
            self.forces[contact.side * self.scene.masters + contact.master] += force[0];
        }
        self.summed += 1;
    }

    pub(super) fn record(&mut self, entry: &StepEntry<'_>) {
        let steps = self.summed.max(1) as f64;
        let normal: Vec<f64> = self.forces.iter().map(|sum| sum / steps).collect();
        let (left, right) = normal.split_at(self.scene.masters);
        let sums = [left.iter().sum(), right.iter().sum()];
        let cube = &entry.displacements[0];
        let at = |node: usize| -> [f64; 3] { core::array::from_fn(|i| cube[3 * node + i]) };
        let history = &mut self.history;
        history.times.push(entry.time);
        history.corners.push(core::array::from_fn(|i| at(self.corners[i].0)));
        history.corner_forces.push(core::array::from_fn(|i| normal[self.corners[i].1]));
        history.forces.push(sums);
        history.kinetic.push(entry.kinetic);
        history.strain.push(entry.strain);
        history.penetration.push(std::mem::take(&mut self.penetration));
        self.forces.fill(0.0);
        self.summed = 0;
        let mass: f64 = self.masses.iter().step_by(3).sum();
        history.velocity.push(core::array::from_fn(|i| {
            let dofs = (i..cube.len()).step_by(3);
            dofs.map(|dof| self.masses[dof] * entry.cube_velocity[dof]).sum::<f64>() / mass
        }));
        let wanted = self.run.snapshots.get(history.snapshots.len());
        if wanted.is_some_and(|time| entry.time > time - 1e-3 * self.run.step) {
            let masters = self.scene.bodies[0].contact.iter().map(|&node| at(node)).collect();
            history.snapshots.push(CubeSnapshot { time: entry.time, masters });
        }
    }

    pub(super) fn finish(mut self) -> CubeHistory {
        self.history.preparation_time = self.prepared - self.started;
        self.history.processor_time = processor_time() - self.prepared;
        self.history
    }
}
