//! Rods through the core: one structure against a fixed obstacle, stepped by [`System`] without a scene.

use nalgebra::{DMatrix, DVector};
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::limits::{self, massless};
use tiprub_core::modes::{bank::BankOptions, modal::ModalModel};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::{System, SystemSettings};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_reference::reduced::bars::RodModel;
use tiprub_test_models::{node, single_sector_with, structure};

use super::run::{StepExtremes, TimedRun};

/// Normal of the only contact: the structure's first direction closes the gap.
pub(super) const NORMAL: Vector3 = Vector3::new(-1.0, 0.0, 0.0);

/// A rod prepared for the core.
#[derive(Debug, Clone)]
pub(crate) struct CoreRod {
    pub(super) model: ModalModel,
    pub(super) load: Vec<f64>,
    pub(super) start: [Vec<f64>; 2],
    pub(super) gap: f64,
    pub(super) whole: bool,
    /// Reference length of tolerances (m): the gap, or the largest displacement at the start.
    pub(super) length: f64,
    /// Largest step that closed contact allows massless-boundary (s).
    massless_limit: massless::MasslessLimit,
}

impl CoreRod {
    /// Prepares a rod; `ends` is the number of contact nodes without mass under massless-boundary. If `whole`, all
    /// nodes are compared, not the contact alone.
    ///
    /// # Errors
    /// None for rods.
    pub(crate) fn new(rod: &RodModel, ends: usize, whole: bool) -> Result<Self, String> {
        let count = rod.closing.len();
        let mut contact_map = DMatrix::zeros(3, count);
        contact_map.row_mut(0).copy_from(&rod.closing.transpose());
        let nodes = vec![node("end", [0.0; 3], 0.0)];
        let rom = structure("rod", rod.mass.clone(), rod.stiffness.clone(), contact_map, nodes);
        let model = ModalModel::from_rom(&rom, 0.0).map_err(|error| error.to_string())?;
        let model = ModalModel { quasi_static: ends, ..model };
        let amplitudes = |values: &DVector<f64>| model.modal_load((&rod.mass * values).as_slice());
        let check = massless::MasslessCheck { model: &model, normals: vec![NORMAL], carriers: Vec::new() };
        Ok(Self {
            load: model.modal_load(rod.load.as_slice()),
            start: [amplitudes(&rod.displacement), amplitudes(&rod.velocity)],
            gap: rod.gap,
            length: if whole { rod.displacement.amax() } else { rod.gap },
            massless_limit: check.limit(1.0).unwrap_or(massless::MasslessLimit::NONE),
            model,
            whole,
        })
    }

    /// Starts a run, with the checks of a scene.
    ///
    /// # Errors
    /// Steps beyond the limit of the scheme; the message contains numbers.
    pub(crate) fn run(
        &self,
        (scheme, solver): (Scheme, Solver),
        interval: f64,
        division: u32,
        perturbation: f64,
    ) -> Result<RodRun<'_>, String> {
        let step = interval / f64::from(division);
        limits::check_step(self.model.largest_frequency(), scheme, step).map_err(|error| error.to_string())?;
        if scheme == Scheme::MasslessBoundary {
            massless::check(step, self.massless_limit).map_err(|error| error.to_string())?;
        }
        let gap = self.gap * (1.0 + perturbation);
        let law = GapLaw::Fixed(FixedGap { normals: vec![NORMAL], gaps: vec![gap], sliding: vec![Vector3::zeros()] });
        let settings = SystemSettings { scheme, solver, ledger: true };
        let bank = BankOptions { loads: true, ..BankOptions::default() };
        let mut system = single_sector_with(&self.model, bank, law, 0.0, settings);
        system.set_step(step);
        for mode in 0..self.model.len() {
            let dynamic = mode < self.model.dynamic_modes(scheme);
            let velocity = self.start[1][mode] - if dynamic { self.half_kick(mode, step) } else { 0.0 };
            system.bank_mut().set_modal_state(mode, 0, self.start[0][mode], velocity);
        }
        system.start(&[PrescribedMotion::default()]);
        Ok(RodRun { rod: self, system, division, step })
    }

    /// Returns displacement and velocity of a mode by its load alone at a time (s): at rest, or rigid motion from rest.
    pub(super) fn loaded(&self, mode: usize, time: f64) -> [f64; 2] {
        match (self.model.frequencies[mode], self.load[mode]) {
            (0.0, load) => [0.5 * load * time * time, load * time],
            (frequency, load) => [load / (frequency * frequency), 0.0],
        }
    }

    /// Returns the velocity that gives the first increment the contribution of the load, because the core starts
    /// without loads.
    fn half_kick(&self, mode: usize, step: f64) -> f64 {
        let (frequency, load) = (self.model.frequencies[mode], self.load[mode]);
        if load == 0.0 {
            0.0
        } else if frequency == 0.0 {
            0.5 * load * step
        } else {
            load / frequency * (0.5 * frequency * step).tan()
        }
    }
}

/// A run of a rod.
pub(crate) struct RodRun<'a> {
    rod: &'a CoreRod,
    system: System,
    division: u32,
    step: f64,
}

impl RodRun<'_> {
    fn one(&mut self) -> Result<(), String> {
        self.system.bank_mut().loads_mut().copy_from_slice(&self.rod.load);
        let stepped = Recurrence.step(&mut self.system, &[PrescribedMotion::default()]);
        stepped.map_err(|failure| format!("step {} failed: {failure:?}", self.system.steps()))
    }

    fn position(&self) -> DVector<f64> {
        DVector::from_fn(self.rod.model.len(), |mode, _| self.system.bank().modal_state(mode, 0).0)
    }
}

impl TimedRun for RodRun<'_> {
    fn advance(&mut self) -> Result<(), String> {
        (0..self.division).try_for_each(|_| self.one())
    }

    #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
    fn watch(&mut self, seen: &mut StepExtremes) -> Result<(), String> {
        for _ in 0..self.division {
            self.one()?;
            let forces = self.system.events().iter().map(|event| event.normal);
            seen.add(self.system.steps() as f64 * self.step, self.step, forces, self.system.gap(0, 0));
        }
        self.system.close_ledger();
        Ok(())
    }

    fn displacements(&self) -> Vec<f64> {
        if self.rod.whole {
            return (&self.rod.model.shapes * self.position()).iter().copied().collect();
        }
        vec![self.system.bank().row(0, 0)]
    }

    fn energy(&self) -> f64 {
        let (kinetic, strain) = self.system.energies();
        let potential: f64 = self.rod.load.iter().zip(self.position().iter()).map(|(f, q)| f * q).sum();
        kinetic + strain - potential
    }

    fn residual(&self) -> Option<f64> {
        let (kinetic, strain) = self.system.energies();
        let scale = self.system.ledger().scale();
        (scale > 0.0).then(|| self.system.ledger().residual(kinetic + strain) / scale)
    }
}
