//! Runs of the methods of `tiprub-reference` on the full finite-element model of the cube and its rings.

use tiprub_reference::{
    cube::{history::CubeHistory, scene::CubeScene},
    methods::{self, CubeMethod},
};

use super::{
    competitor::Full,
    run::{StepExtremes, TimedRun},
};

/// Replay of a finished run: the methods run to the end without interruption and keep a history.
pub(crate) struct FullRun {
    history: CubeHistory,
    step: f64,
    speed: f64,
    interval: f64,
    samples: usize,
    /// Index of the record that belongs to the current sample.
    record: usize,
}

impl FullRun {
    /// Runs to the end of `samples` samples with `division` steps each.
    ///
    /// # Errors
    /// A run that the method rejects.
    pub(crate) fn new(
        scene: &CubeScene,
        method: Full,
        (interval, samples): (f64, usize),
        division: u32,
    ) -> Result<Self, String> {
        let method = match method {
            Full::Film => CubeMethod::Film(Default::default()),
            Full::Bipotential => CubeMethod::Bipotential,
            Full::Augmented => CubeMethod::Augmented(Default::default()),
            Full::Penalty => CubeMethod::Penalty(Default::default()),
        };
        let step = interval / f64::from(division);
        let end = |sample: usize| (sample + 1) as f64 * interval;
        let snapshots = (0..samples).map(end).collect();
        let run = methods::MethodRun { step, end: end(samples - 1), stride: 1, snapshots };
        let history = method.run(scene, &run).map_err(|error| error.to_string())?;
        if history.snapshots.len() < samples {
            return Err("the run ended early".into());
        }
        let record = history.times.iter().take_while(|time| **time < 0.5 * step).count();
        Ok(Self { history, step, speed: scene.setting.speed, interval, samples: 0, record })
    }
}

/// Returns the displacements of the nodes of a body that flies along −y, without the rigid motion (m).
pub(crate) fn without_flight(displacements: impl IntoIterator<Item = f64>, flown: f64) -> Vec<f64> {
    let all = displacements.into_iter().enumerate();
    all.map(|(index, value)| if index % 3 == 1 { value + flown } else { value }).collect()
}

impl TimedRun for FullRun {
    fn advance(&mut self) -> Result<(), String> {
        self.watch(&mut StepExtremes::nothing())
    }

    fn watch(&mut self, seen: &mut StepExtremes) -> Result<(), String> {
        self.samples += 1;
        let end = self.samples as f64 * self.interval + 0.5 * self.step;
        let history = &self.history;
        while self.record < history.times.len() && history.times[self.record] < end {
            let forces = history.forces[self.record].into_iter();
            seen.add(history.times[self.record], self.step, forces, -history.penetration[self.record]);
            // Sums over a face hide a tensile force at a single node.
            seen.adhesion = history.corner_forces[self.record].into_iter().fold(seen.adhesion, f64::min);
            self.record += 1;
        }
        Ok(())
    }

    fn displacements(&self) -> Vec<f64> {
        let Some(index) = self.samples.checked_sub(1) else { return Vec::new() };
        let snapshot = &self.history.snapshots[index];
        without_flight(snapshot.masters.iter().flatten().copied(), self.speed * snapshot.time)
    }

    fn energy(&self) -> f64 {
        let record = self.record.saturating_sub(1);
        self.history.kinetic[record] + self.history.strain[record]
    }

    fn residual(&self) -> Option<f64> {
        None
    }

    fn own_seconds(&self) -> Option<f64> {
        Some(self.history.processor_time)
    }
}
