//! Outputs from state and window: how the rows of the table are filled.

use std::fmt;
use std::sync::Arc;

use nalgebra::DMatrix;
use tiprub_cosim::variables::{Causality, NO_CLEARANCE, Quantity, Span, Variable};

use super::Simulation;
use super::compile::Compiled;
use super::units::LENGTH;
use super::watched::WatchedGaps;
use super::window::{StepWindow, speed_of};
use crate::Result;
use crate::contact::coating::Coating;
use crate::geometry::sector_angle;
use crate::modes::bank::ModalBank;
use crate::scene::rom::{STRESSES, von_mises};
use crate::system::System;
use crate::system::ledger::Ledger;

type Fill = dyn Fn(&OutputView, &mut [f64]) + Send + Sync;

/// Function that fills the elements of an output.
#[derive(Clone)]
pub(crate) struct OutputReader(Arc<Fill>);

impl fmt::Debug for OutputReader {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Reader")
    }
}

/// Makes the reader of a scalar.
pub fn scalar(read: impl Fn(&OutputView) -> f64 + Send + Sync + 'static) -> OutputReader {
    OutputReader(Arc::new(move |view, out| out[0] = read(view)))
}

/// Creates the reader of an output that is a count.
pub fn count(read: impl Fn(&OutputView) -> u64 + Send + Sync + 'static) -> OutputReader {
    #[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
    scalar(move |view| read(view) as f64)
}

/// Makes the reader of an array, element by element.
pub fn each(read: impl Fn(&OutputView, usize) -> f64 + Send + Sync + 'static) -> OutputReader {
    OutputReader(Arc::new(move |view, out| {
        out.iter_mut().enumerate().for_each(|(index, value)| *value = read(view, index));
    }))
}

/// Makes the reader of a whole array.
pub(crate) fn array_reader(read: impl Fn(&OutputView, &mut [f64]) + Send + Sync + 'static) -> OutputReader {
    OutputReader(Arc::new(read))
}

/// Readers of the outputs, and values from which they read.
#[derive(Debug, Clone)]
pub struct Outputs {
    /// Functions that fill the outputs, in the order of the table.
    readers: Vec<OutputReader>,
    /// Fraction of the friction heat that flows into the surface carrier, per pair.
    slave_shares: Vec<f64>,
    pub watched_gaps: WatchedGaps,
    /// Energies of each set of structures that influence each other, if the ledger is kept.
    pub energies: Vec<SetEnergy>,
}

/// Energies of structures that influence each other (J).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SetEnergy {
    /// Instantaneous kinetic plus strain energy.
    pub now: f64,
    /// Energy that the scheme conserves.
    pub conserved: f64,
}

impl Outputs {
    /// Allocates the values of a scene with a number of sets of structures.
    ///
    /// # Errors
    /// Errors of the gap functions of watched points.
    pub fn new(compiled: &Compiled, readers: Vec<OutputReader>, sets: usize) -> Result<Self> {
        Ok(Self {
            readers,
            slave_shares: vec![1.0; compiled.plan.pairs.len()],
            watched_gaps: WatchedGaps::new(compiled)?,
            energies: vec![SetEnergy::default(); sets],
        })
    }
}

/// Data that outputs are read from, for all outputs at one instant.
pub(crate) struct OutputView<'a> {
    pub(super) simulation: &'a Simulation,
    pub system: &'a System,
    pub window: &'a StepWindow,
    /// 1/elapsed time of the communication step, 0 at its start (1/s).
    pub mean: f64,
    /// Elapsed time of the communication step (s).
    pub elapsed: f64,
    /// Instantaneous kinetic and strain energy (J), if the ledger is kept.
    pub energies: (f64, f64),
    /// Energy that the scheme conserves (J), if the ledger is kept.
    pub conserved: f64,
    /// Work and losses of all structures.
    pub ledger: Ledger,
}

impl Simulation {
    /// Computes the outputs of the internal point reached.
    pub(super) fn compute_outputs(&mut self) {
        let [elapsed, time] = self.state.clock.step.reached();
        let mean = if elapsed > 0.0 && self.state.clock.step.length > 0.0 { 1.0 / elapsed } else { 0.0 };
        self.system.close_ledger();
        let (mut energies, mut conserved) = ((0.0, 0.0), 0.0);
        if self.system.settings().ledger {
            let (kinetic, strain) = self.system.energies();
            let of_sets = &mut self.outputs.energies;
            let now = self.system.energies_now(|set, (kinetic, strain)| of_sets[set].now = kinetic + strain);
            (energies, conserved) = (now, kinetic + strain);
            match &mut self.outputs.energies[..] {
                [only] => only.conserved = conserved,
                sets => sets.iter_mut().enumerate().for_each(|(set, energy)| {
                    energy.conserved = self.system.mechanical_energy(set);
                }),
            }
        }
        for pair in 0..self.outputs.slave_shares.len() {
            let share = self.state.values.elements(Quantity::HeatToSlave, pair);
            self.outputs.slave_shares[pair] = share.map_or(1.0, |share| share[0]);
        }
        self.find_watched();
        let mut values = self.state.values.replace(Vec::new());
        let (system, window) = (&self.system, &self.state.window);
        let ledger = system.ledger();
        let view = OutputView { simulation: self, system, window, mean, elapsed, energies, conserved, ledger };
        let outputs =
            self.state.values.table().variables().iter().filter(|variable| variable.causality == Causality::Output);
        for (variable, read) in outputs.zip(&self.outputs.readers) {
            let start = variable.reference as usize;
            (read.0)(&view, &mut values[start..start + variable.len()]);
        }
        for variable in
            self.state.values.table().variables().iter().filter(|row| row.causality == Causality::Independent)
        {
            values[variable.reference as usize] = time;
        }
        self.state.values.replace(values);
    }
}

/// Returns the smallest clearance as a finite number.
fn smallest<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    values.fold(f64::INFINITY, |low: f64, value| low.min(*value)).min(NO_CLEARANCE)
}

impl OutputView<'_> {
    /// Fraction of the friction heat of a pair that flows into the surface carrier; 1 if the scene does not specify it.
    pub(crate) fn slave_share(&self, pair: usize) -> f64 {
        self.simulation.outputs.slave_shares[pair]
    }

    /// Returns the largest relative residual of any set of structures that influence each other.
    pub(crate) fn relative_residual(&self) -> f64 {
        let ledgers = self.system.ledgers().iter().zip(&self.simulation.outputs.energies);
        let relative = ledgers.map(|(ledger, energy)| match ledger.scale() {
            scale if scale > 0.0 => ledger.residual(energy.conserved) / scale,
            _ => 0.0,
        });
        let larger = |largest: f64, one: f64| if one.abs() > largest.abs() { one } else { largest };
        relative.reduce(larger).unwrap_or_default()
    }

    /// Reads a value of the coating of a pair; empty without a coating.
    pub fn coating(&self, pair: usize, read: impl Fn(&Coating) -> f64) -> f64 {
        self.system.coating(pair).map_or(0.0, read)
    }

    /// Fills in the mean wear depth of the coating of a pair around the circumference, or along the axis (m).
    pub fn wear_profile(&self, pair: usize, around: bool, out: &mut [f64]) {
        if let Some(coating) = self.system.coating(pair) {
            coating.wear_profile(around, out);
        }
    }

    pub fn modes(&self, body: usize) -> &ModalBank {
        self.system.structures()[body].modes()
    }

    pub fn index(&self, body: usize, node: usize, sector: usize) -> usize {
        self.system.structures()[body].index(node, sector)
    }

    /// Smallest clearance of all nodes of all structures within the communication step (m).
    pub fn lowest(&self) -> f64 {
        smallest(self.window.bodies.iter().flat_map(|body| &body.lowest))
    }

    /// Smallest clearance of a node over all sectors within the communication step (m).
    pub(crate) fn lowest_of_node(&self, body: usize, node: usize) -> f64 {
        let modes = self.modes(body);
        smallest(self.window.bodies[body].lowest[node * modes.lanes()..][..modes.sectors()].iter())
    }

    /// Smallest clearance of a sector over all nodes within the communication step (m).
    pub(crate) fn lowest_of_sector(&self, body: usize, sector: usize) -> f64 {
        smallest(self.of_sector(body, &self.window.bodies[body].lowest, sector))
    }

    /// Smallest clearance of one node of one sector within the communication step (m).
    pub(crate) fn lowest_at(&self, body: usize, node: usize, sector: usize) -> f64 {
        self.window.bodies[body].lowest[self.index(body, node, sector)].min(NO_CLEARANCE)
    }

    /// Values of a sector, node by node.
    pub fn of_sector<'a>(
        &self,
        body: usize,
        values: &'a [f64],
        sector: usize,
    ) -> impl Iterator<Item = &'a f64> + use<'a> {
        values.iter().skip(sector).step_by(self.modes(body).lanes())
    }

    pub fn normal_impulse(&self, body: usize, node: usize, sector: usize) -> f64 {
        self.window.bodies[body].normal_impulse[self.index(body, node, sector)]
    }

    /// Friction force of the last internal step (N).
    pub(crate) fn tangential_now(&self, body: usize, node: usize, sector: usize) -> f64 {
        let sought = (body, sector, node);
        let event = self.system.events().iter().find(|event| (event.structure, event.sector, event.node) == sought);
        event.map_or(0.0, |event| event.tangential)
    }

    /// Returns a value of the centre of mass of a free body along an axis, from the modal (position, increment) of its translations.
    pub fn centre(&self, body: usize, axis: usize, value: impl Fn((f64, f64)) -> f64) -> f64 {
        let translations = self.simulation.compiled.bodies[body].translations.as_ref();
        let modal = || [0, 1, 2].map(|mode| value(self.modes(body).modal_state(mode, 0)));
        translations.map_or(0.0, |translations| translations.centre(axis, modal()))
    }

    /// Radial displacement of the contact grid of a carrier.
    pub fn slave_displacement(&self, carrier: usize, out: &mut [f64]) {
        let compiled = &self.simulation.compiled;
        let (model, modes) = (&compiled.carriers[carrier].model, self.modes(compiled.bodies.len() + carrier));
        out.fill(0.0);
        for mode in 0..model.len() {
            let position = modes.modal_state(mode, 0).0;
            for (node, value) in out.iter_mut().enumerate() {
                *value += model.contact_modes[(3 * node, mode)] * position;
            }
        }
    }

    /// Amplitude of a mode of a sector.
    pub fn modal_amplitude(&self, body: usize, sector: usize, mode: usize) -> f64 {
        self.simulation.compiled.bodies[body].senses[mode] * self.modes(body).modal_state(mode, sector).0
    }

    /// Force (N) or moment (N·m) of the support on a structure that carries surfaces, mean over the communication step.
    pub fn support(&self, carrier: usize, row: usize) -> f64 {
        let Compiled { carriers, bodies, .. } = &self.simulation.compiled;
        let (Some(rows), own) = (&carriers[carrier].support, &self.window.supports[carrier]) else { return 0.0 };
        let structure = &self.system.structures()[bodies.len() + carrier];
        let mut sum = 0.0;
        for (mode, (moved, speed)) in own.moved.iter().zip(&own.speeds).enumerate() {
            let gained = speed_of(structure, mode) - speed;
            sum += rows.stiffness[(row, mode)] * moved + rows.mass[(row, mode)] * gained;
        }
        let temperatures = self.simulation.state.inputs.carriers[carrier].temperatures.iter().enumerate();
        let heated = temperatures.map(|(patch, input)| rows.thermal[(row, patch)] * input.at(0.5 * self.elapsed));
        let heat: f64 = heated.sum();
        let lining = row.checked_sub(3).map_or(0.0, |axis| own.lining[axis]);
        self.mean * (sum - self.elapsed * heat + lining)
    }

    /// Component of the stress at a place of a sector (Pa): stress by displacements, and the static stress by heat and growth of the full
    /// model. Stress by strain is proportional to the stiffness of the sector; stress by growth is determined by forces.
    pub fn stress(&self, body: usize, sector: usize, place: usize, component: usize) -> f64 {
        let (compiled, row) = (&self.simulation.compiled, STRESSES * place + component);
        let parts = &compiled.bodies[body];
        let rotor = &self.simulation.state.inputs.rotors[body];
        let (temperature, speed) = (rotor.temperature_at(self.elapsed), rotor.spin.at(self.elapsed));
        let heat = parts.stress_heat.get(row).map_or(0.0, |heat| heat * temperature);
        let growth = parts.stress_growth.get(row).map_or(0.0, |growth| growth * speed * speed);
        let moved = self.simulation.observed(body, &parts.stress, row, sector);
        compiled.stiffness_factor(body, sector, temperature) * (moved + heat) + growth
    }

    /// Equivalent stress of von Mises at a place of a sector (Pa).
    pub fn von_mises(&self, body: usize, sector: usize, place: usize) -> f64 {
        von_mises([0, 1, 2, 3, 4, 5].map(|component| self.stress(body, sector, place, component)))
    }

    /// Computes |(2/N) Σ_b u_b e^(−i n θ_b)| (1/N for n = 0 and n = N/2) of the radial displacement of the middle node, or of the mean over
    /// rows of patches.
    pub fn nodal_diameters(&self, body: usize, rows: usize, out: &mut [f64]) {
        let modes = self.modes(body);
        let (sectors, along) = (modes.sectors(), modes.rows() / (3 * rows));
        #[expect(clippy::cast_precision_loss, reason = "row and sector counts are far below 2^52")]
        for (diameter, value) in out.iter_mut().enumerate() {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for sector in 0..sectors {
                let (sine, cosine) = libm::sincos(diameter as f64 * sector_angle(sector, sectors));
                let middle = |row: usize| modes.row(3 * (row * along + along / 2), sector);
                let moved = (0..rows).map(middle).sum::<f64>() / rows as f64;
                real += moved * cosine;
                imaginary += moved * sine;
            }
            let weight = if diameter == 0 || 2 * diameter == sectors { 1.0 } else { 2.0 };
            *value = weight / sectors as f64 * libm::hypot(real, imaginary);
        }
    }
}

impl Simulation {
    /// Returns the displacements of the watched points of the ROMs (m): structure by structure, point by point, axis by axis, sector by
    /// sector. They belong to the internal point reached.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// // This blade has no watched points beside its contact nodes.
    /// assert!(simulation.watched_displacements().is_empty());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn watched_displacements(&self) -> Vec<f64> {
        let bodies = self.compiled.bodies.iter().enumerate();
        let rows = bodies.flat_map(|(body, parts)| (0..parts.watched.nrows()).map(move |row| (body, row)));
        let sectors = |body: usize| self.system.structures()[body].modes().sectors();
        rows.flat_map(|(body, row)| (0..sectors(body)).map(move |sector| self.watched_row(body, row, sector))).collect()
    }

    pub(super) fn watched_row(&self, body: usize, row: usize, sector: usize) -> f64 {
        self.observed(body, &self.compiled.bodies[body].watched, row, sector)
    }

    /// Value of one row of an observation matrix (per unit of each mode) at the displacements of a sector.
    fn observed(&self, body: usize, shapes: &DMatrix<f64>, row: usize, sector: usize) -> f64 {
        let modes = self.system.structures()[body].modes();
        modes.weigh_positions(sector, |mode| shapes[(row, mode)])
    }

    pub(super) fn derivative_of(&self, variable: &Variable, element: usize, reference: u32) -> f64 {
        let (now, before) = (self.state.values[reference as usize], self.state.previous[reference as usize]);
        let length = self.state.clock.step.length;
        match (variable.quantity, variable.span) {
            _ if self.state.clock.is_created() || length == 0.0 => 0.0,
            // A clearance that appears or disappears has no rate.
            _ if variable.unit == Some(&LENGTH) && now.max(before) >= NO_CLEARANCE => 0.0,
            (Quantity::Clearance(sector), _) => self.system.structures()[variable.of].gap_rate(element, sector),
            (Quantity::RotorAngle, _) => self.state.inputs.rotors[variable.of].speed.at(0.0),
            (_, Span::Mean) if self.state.clock.previous_length == 0.0 => 0.0,
            (_, Span::Mean) => (now - before) / (0.5 * (length + self.state.clock.previous_length)),
            _ => (now - before) / length,
        }
    }
}
