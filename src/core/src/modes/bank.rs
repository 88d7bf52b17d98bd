//! State of all modes of all sectors, and the fused pass of one step.
//!
//! Layout: sectors are SIMD lanes in chunks of `LANES`; within a chunk the modes follow each other,
//! `state[(chunk · modes + mode) · width + lane]`. The pass predicts (eq. 9 of the paper without contact), recovers the
//! displacements of the contact rows and sums the damping loss while a chunk is in registers; there is no horizontal sum. Contact
//! forces are then applied to the few sectors in contact.

mod coefficients;
mod correction;
mod coupling;
mod excited;
mod heated;
mod predict;
mod span;

use nalgebra::DMatrix;
use tiprub_cosim::persist::{Persist, StateReader, StateWriter};
use tiprub_cosim::persist_fields;

use super::excitation::{Excitation, SectorLoads};
use super::modal::{ModalModel, ModalSpin};
use crate::math::simd::InstructionSet;
use crate::modes::schemes::{ModeCoefficients, Velocity};
use crate::scene::method::Scheme;
use coupling::Coupling;
use heated::HeatLoads;
use predict::Predict;

/// Lanes of one chunk: one 512-bit register of f64.
pub(crate) const LANES: usize = 8;

/// Amplitudes below this are periodically set to zero: damped modes without load would decay into denormals.
pub(super) const FLUSH_BELOW: f64 = 1e-150;

/// Number of lanes of a displacement row for this many sectors: rounded up to whole chunks, except for a single structure.
pub fn lanes(sectors: usize) -> usize {
    if sectors == 1 { 1 } else { sectors.div_ceil(LANES) * LANES }
}

/// Optional features of a bank; a feature that is off takes neither time nor memory.
#[derive(Debug, Clone, PartialEq)]
pub struct BankOptions {
    /// Factor on the frequencies of every sector (mistuning); empty if all sectors are tuned.
    pub frequency_factors: Vec<f64>,
    /// True if there are modal loads in addition to contact forces: centrifugal growth, heat, nodal-diameter loads.
    pub loads: bool,
    /// Free expansion per kelvin in modal coordinates; empty without heat.
    pub expansion: Vec<f64>,
    /// Spin in modal coordinates, and which effects couple the modes: (stiffening, coriolis).
    pub coupling: Option<(ModalSpin, bool, bool)>,
    /// Loads of an engine order.
    pub excitation: Option<Excitation>,
    /// True if G = Φ diag(c) Φᵀ is stored; a slave with many contact rows uses its modes instead.
    pub flexibility: bool,
}

impl Default for BankOptions {
    fn default() -> Self {
        Self {
            frequency_factors: Vec::new(),
            loads: false,
            expansion: Vec::new(),
            coupling: None,
            excitation: None,
            flexibility: true,
        }
    }
}

/// All state variables.
#[derive(Debug, Clone, PartialEq)]
struct BankState {
    /// q at the current step.
    position: Vec<f64>,
    /// d = q − q⁻.
    increment: Vec<f64>,
    /// Displacements of the contact rows at the current step, `[row][lane]`.
    displacement: Vec<f64>,
    /// Displacements of the contact rows one step earlier, `[row][lane]`.
    displacement_before: Vec<f64>,
    /// Damping loss per lane since the last collection (J).
    loss: Vec<f64>,
    /// Modal loads of the previous step; empty without loads.
    modal_load_before: Vec<f64>,
    /// Speed of the coupling (rad/s).
    speed: f64,
    /// Temperature of the structure (K).
    temperature: f64,
    /// Thermal loads of the previous step, for a sector without a factor; empty if all sectors are equal.
    heat_before: Vec<f64>,
    /// Change of the stiffness of quasi-static modes since the last step, relative to their stiffness; empty without softening.
    stiffened: Vec<f64>,
}

persist_fields!(BankState {
    position,
    increment,
    displacement,
    displacement_before,
    loss,
    modal_load_before,
    speed,
    temperature,
    heat_before,
    stiffened
});

/// Coefficients of the special pass per mode and lane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct BankCoefficients {
    beta: f64,
    kappa: f64,
    /// Displacement per unit modal load; 0 in padding lanes.
    load: f64,
    loss: f64,
}

/// Identical uncoupled sectors in modal coordinates, stepped together.
#[derive(Debug, Clone)]
pub struct ModalBank {
    instruction_set: InstructionSet,
    model: ModalModel,
    options: BankOptions,
    sectors: usize,
    width: usize,
    chunks: usize,
    rows: usize,
    /// `[mode][row]`.
    contact_modes: Vec<f64>,
    /// `[row][mode]`.
    contact_rows: Vec<f64>,
    /// `[set][mode]`: one set for all sectors, or one per sector with mistuning.
    coefficients: Vec<ModeCoefficients>,
    /// Velocity coefficients, `[set][mode]`; quasi-static modes have none.
    velocities: Vec<Velocity>,
    /// True if the damping loss is collected.
    with_loss: bool,
    lane_coefficients: Vec<BankCoefficients>,
    /// G per set: displacement of the contact rows per unit force held for one step (m/N), rows × rows.
    flexibility: Vec<DMatrix<f64>>,
    coupling: Option<Coupling>,
    excitation: Option<SectorLoads>,
    heat: Option<HeatLoads>,
    scheme: Scheme,
    step: f64,
    state: BankState,
    /// Modal loads of the current step.
    modal_load: Vec<f64>,
    /// Scratch: increments of the previous step.
    increment_before: Vec<f64>,
    /// Scratch: φᵀf of the current sector.
    modal_force: Vec<f64>,
    /// Scratch: change of the modal coordinates of the current sector.
    correction: Vec<f64>,
    /// Scratch: displacements of the rows of one sector.
    moved: Vec<f64>,
    /// Scratch: modal coordinates and increments of one sector.
    gathered: [Vec<f64>; 2],
}

impl ModalBank {
    /// Creates a bank with all sectors at rest and without options; call [`ModalBank::set_step`] before stepping.
    pub fn new(model: &ModalModel, sectors: usize) -> Self {
        Self::with_options(model, sectors, BankOptions::default())
    }

    /// Creates a bank with options, all sectors at rest.
    pub fn with_options(model: &ModalModel, sectors: usize, options: BankOptions) -> Self {
        let width = if sectors == 1 { 1 } else { LANES };
        let chunks = sectors.div_ceil(width);
        let (rows, modes) = (model.contact_modes.nrows(), model.len());
        let (state_len, lanes) = (chunks * modes * width, chunks * width);
        let sets = if options.frequency_factors.is_empty() { 1 } else { sectors };
        let special = options.loads || sets > 1;
        let coupling = options
            .coupling
            .clone()
            .map(|(spin, stiffening, coriolis)| Coupling::new(spin, stiffening, coriolis, &options.frequency_factors));
        let heat = HeatLoads::new(&options.expansion, &options.frequency_factors);
        let softening = coupling.as_ref().is_some_and(Coupling::softens);
        Self {
            instruction_set: InstructionSet::detect(),
            sectors,
            width,
            chunks,
            rows,
            contact_modes: model.contact_modes.as_slice().to_vec(),
            contact_rows: model.contact_modes.transpose().as_slice().to_vec(),
            coefficients: vec![ModeCoefficients::default(); sets * modes],
            velocities: vec![Velocity::default(); sets * modes],
            with_loss: true,
            lane_coefficients: vec![BankCoefficients::default(); if special { state_len } else { 0 }],
            flexibility: vec![DMatrix::zeros(rows, rows); if options.flexibility { sets } else { 0 }],
            scheme: Scheme::default(),
            step: 0.0,
            state: BankState {
                position: vec![0.0; state_len],
                increment: vec![0.0; state_len],
                displacement: vec![0.0; rows * lanes],
                displacement_before: vec![0.0; rows * lanes],
                loss: vec![0.0; lanes],
                modal_load_before: vec![0.0; if options.loads { modes } else { 0 }],
                speed: coupling.as_ref().map_or(0.0, Coupling::speed),
                temperature: coupling.as_ref().map_or(0.0, Coupling::temperature),
                heat_before: vec![0.0; heat.as_ref().map_or(0, HeatLoads::remembered)],
                stiffened: vec![0.0; if softening { model.quasi_static.min(modes) } else { 0 }],
            },
            modal_load: vec![0.0; if special { modes } else { 0 }],
            increment_before: vec![0.0; state_len],
            modal_force: vec![0.0; modes],
            correction: vec![0.0; modes],
            moved: vec![0.0; rows],
            gathered: [vec![0.0; modes], vec![0.0; modes]],
            coupling,
            excitation: options.excitation.map(|excitation| SectorLoads::new(excitation, model, sectors)),
            heat,
            options,
            model: model.clone(),
        }
    }

    /// Stops collecting the damping loss, which takes time.
    pub(crate) fn skip_losses(&mut self) {
        self.with_loss = false;
    }

    /// Number of sectors.
    pub fn sectors(&self) -> usize {
        self.sectors
    }

    /// Number of lanes of a displacement row: sectors rounded up to whole chunks.
    pub fn lanes(&self) -> usize {
        self.chunks * self.width
    }

    /// Number of contact rows (3 per contact node).
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of modes of one sector.
    pub fn modes(&self) -> usize {
        self.model.len()
    }

    /// Modes of one sector.
    pub fn model(&self) -> &ModalModel {
        &self.model
    }

    /// Step size of the current coefficients (s).
    pub fn step(&self) -> f64 {
        self.step
    }

    fn set_of(&self, sector: usize) -> usize {
        if self.options.frequency_factors.is_empty() { 0 } else { sector }
    }

    /// Coefficients of the modes of one sector.
    pub fn coefficients(&self, sector: usize) -> &[ModeCoefficients] {
        &self.coefficients[self.set_of(sector) * self.modes()..][..self.modes()]
    }

    /// Flexibility of the contact rows of one sector over one step (m/N), rows × rows; not symmetric with Coriolis forces.
    pub fn flexibility(&self, sector: usize) -> &DMatrix<f64> {
        &self.flexibility[self.set_of(sector)]
    }

    /// Displacement of one contact row per unit of each modal coordinate.
    pub fn contact_row(&self, row: usize) -> &[f64] {
        &self.contact_rows[row * self.modes()..][..self.modes()]
    }

    /// Displacements of the contact rows at the current step (m), `[row][lane]`.
    pub fn displacement(&self) -> &[f64] {
        &self.state.displacement
    }

    /// Displacements of the contact rows one step earlier (m), `[row][lane]`.
    pub fn displacement_before(&self) -> &[f64] {
        &self.state.displacement_before
    }

    /// Displacement of one contact row of one sector (m).
    pub fn row(&self, row: usize, sector: usize) -> f64 {
        self.state.displacement[row * self.lanes() + sector]
    }

    /// Displacement of one contact row of one sector one step earlier (m).
    pub fn row_before(&self, row: usize, sector: usize) -> f64 {
        self.state.displacement_before[row * self.lanes() + sector]
    }

    fn index(&self, mode: usize, sector: usize) -> usize {
        (sector / self.width * self.modes() + mode) * self.width + sector % self.width
    }

    /// Modal position and increment of one mode of one sector.
    pub fn modal_state(&self, mode: usize, sector: usize) -> (f64, f64) {
        let index = self.index(mode, sector);
        (self.state.position[index], self.state.increment[index])
    }

    fn frequency(&self, mode: usize, sector: usize) -> f64 {
        self.model.frequencies[mode] * self.options.frequency_factors.get(sector).copied().unwrap_or(1.0)
    }

    /// Sets modal position q and velocity q̇ of a sector; the increment is that of free motion without force. A quasi-static mode
    /// has neither and stays 0.
    pub fn set_modal_state(&mut self, mode: usize, sector: usize, position: f64, velocity: f64) {
        if mode >= self.model.dynamic_modes(self.scheme) {
            return;
        }
        let (frequency, ratio, step) = (self.frequency(mode, sector), self.model.damping_ratios[mode], self.step);
        let index = self.index(mode, sector);
        self.state.position[index] = position;
        self.state.increment[index] = self.scheme.increment(frequency, ratio, position, velocity, step);
    }

    /// Sets the static equilibrium under the modal loads `modal_load` for every sector: q = L/ω², rigid-body modes at 0.
    pub fn settle(&mut self, modal_load: &[f64]) {
        self.rest();
        self.state.modal_load_before.copy_from_slice(modal_load);
        for sector in 0..self.sectors {
            for (mode, load) in modal_load.iter().enumerate() {
                let (frequency, index) = (self.frequency(mode, sector), self.index(mode, sector));
                self.state.position[index] = if frequency > 0.0 { load / (frequency * frequency) } else { 0.0 };
            }
        }
        self.recover();
    }

    /// Recomputes the contact displacements from the modal state (after setting it).
    pub fn recover(&mut self) {
        let lanes = self.lanes();
        self.state.displacement.fill(0.0);
        self.state.displacement_before.fill(0.0);
        for sector in 0..self.sectors {
            for mode in 0..self.modes() {
                let (position, increment) = self.modal_state(mode, sector);
                for row in 0..self.rows {
                    let shape = self.contact_modes[mode * self.rows + row];
                    self.state.displacement[row * lanes + sector] += shape * position;
                    self.state.displacement_before[row * lanes + sector] += shape * (position - increment);
                }
            }
        }
    }

    /// Sets the state to rest, undeformed.
    pub fn rest(&mut self) {
        for values in [
            &mut self.state.position,
            &mut self.state.increment,
            &mut self.state.displacement,
            &mut self.state.displacement_before,
            &mut self.state.loss,
            &mut self.state.modal_load_before,
            &mut self.state.heat_before,
            &mut self.state.stiffened,
            &mut self.modal_load,
        ] {
            values.fill(0.0);
        }
        if let Some((spin, ..)) = &self.options.coupling {
            self.state.speed = spin.reference_speed;
            self.state.temperature = spin.reference_temperature;
        }
        if let Some(loads) = &mut self.excitation {
            loads.rest();
        }
        if let Some(heat) = &mut self.heat {
            heat.rest();
        }
    }

    /// Modal loads of the next step (for every sector), to be set before [`ModalBank::predict`].
    pub fn loads_mut(&mut self) -> &mut [f64] {
        &mut self.modal_load
    }

    /// Predicts one step without contact (eq. 9 of the paper) and recovers the contact displacements.
    pub fn predict(&mut self) {
        std::mem::swap(&mut self.state.increment, &mut self.increment_before);
        std::mem::swap(&mut self.state.displacement, &mut self.state.displacement_before);
        let instruction_set = self.instruction_set;
        match (self.width, self.with_loss, self.lane_coefficients.is_empty()) {
            (1, true, true) => instruction_set.run(Predict::<1, true, false>(self)),
            (1, false, true) => instruction_set.run(Predict::<1, false, false>(self)),
            (_, true, true) => instruction_set.run(Predict::<LANES, true, false>(self)),
            (_, false, true) => instruction_set.run(Predict::<LANES, false, false>(self)),
            (1, true, false) => instruction_set.run(Predict::<1, true, true>(self)),
            (1, false, false) => instruction_set.run(Predict::<1, false, true>(self)),
            (_, true, false) => instruction_set.run(Predict::<LANES, true, true>(self)),
            (_, false, false) => instruction_set.run(Predict::<LANES, false, true>(self)),
        }
        if self.coupling.as_ref().is_some_and(Coupling::is_active) {
            self.couple();
        }
        if self.excitation.is_some() {
            self.act_excited();
        }
        if self.heat.is_some() {
            self.act_expanded();
        }
    }

    fn couple(&mut self) {
        let Some(mut coupling) = self.coupling.take() else { return };
        for sector in 0..self.sectors {
            for mode in 0..self.modes() {
                let index = self.index(mode, sector);
                let predicted = self.state.increment[index];
                self.gathered[0][mode] = self.state.position[index] - predicted;
                self.gathered[1][mode] = self.increment_before[index];
                self.correction[mode] = predicted;
            }
            let mut correction = std::mem::take(&mut self.correction);
            let [position, increment] = &self.gathered;
            coupling.couple(self.set_of(sector), self.coefficients(sector), position, increment, &mut correction);
            self.correction = correction;
            self.move_modes(sector);
            self.move_rows(sector);
        }
        self.coupling = Some(coupling);
    }

    /// Kinetic and strain energy of all sectors (J), in the form that the scheme conserves (see [`crate::modes::schemes`]).
    pub fn energies(&self) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        // The strain energy belongs to one time, or to two.
        let lag = self.scheme.strain_lag();
        for sector in 0..self.sectors {
            for (mode, k) in self.coefficients(sector).iter().enumerate() {
                let (position, increment) = self.modal_state(mode, sector);
                kinetic += k.inertia * (increment * increment);
                strain += k.spring * (position * (position - lag * increment));
            }
            if let Some(coupling) = &self.coupling {
                let position = |mode| self.modal_state(mode, sector).0;
                strain += coupling
                    .strain(self.set_of(sector), position, |mode| position(mode) - self.modal_state(mode, sector).1);
            }
        }
        (kinetic, strain)
    }

    /// Instantaneous kinetic and strain energy of all sectors (J), ½q̇² and ½ω²q² of every mode, each sector under the persistent
    /// contact forces (`forces[row · lanes + sector]`, N) and the modal loads.
    pub(crate) fn energies_now(&mut self, forces: &[f64]) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        for sector in 0..self.sectors {
            self.gather_forces(sector, forces);
            let velocities = &self.velocities[self.set_of(sector) * self.modes()..];
            let modes = self.coefficients(sector).iter().zip(velocities).zip(&self.modal_force);
            for (mode, ((k, velocity), force)) in modes.enumerate() {
                let (position, increment) = self.modal_state(mode, sector);
                let velocity = velocity.of(position, increment, *force);
                kinetic += 0.5 * velocity * velocity;
                strain += k.spring * (position * position);
            }
            if let Some(coupling) = &self.coupling {
                let position = |mode| self.modal_state(mode, sector).0;
                strain += coupling.strain(self.set_of(sector), position, position);
            }
        }
        (kinetic, strain)
    }

    /// Damping loss since the last call (J).
    pub(crate) fn collect_loss(&mut self) -> f64 {
        let loss = self.state.loss[..self.sectors].iter().sum();
        self.state.loss.fill(0.0);
        loss
    }

    /// Sets amplitudes that have decayed almost to zero to exactly zero, so that no denormals arise.
    pub fn flush(&mut self) {
        for values in [&mut self.state.position, &mut self.state.increment] {
            for value in values.iter_mut().filter(|value| value.abs() < FLUSH_BELOW) {
                *value = 0.0;
            }
        }
    }

    /// Returns whether every modal coordinate is finite.
    pub fn is_finite(&self) -> bool {
        self.state.position.iter().chain(&self.state.increment).all(|value| value.is_finite())
    }

    /// Saves the state (not the step size).
    pub fn save(&self, writer: &mut StateWriter) {
        self.state.save(writer);
        if let Some(loads) = &self.excitation {
            loads.before.save(writer);
        }
    }

    /// Reads over a saved state and rejects invalid values.
    pub fn check(&self, reader: &mut StateReader) {
        self.state.check(reader);
        if let Some(loads) = &self.excitation {
            loads.before.check(reader);
        }
    }

    /// Restores a saved state, after [`ModalBank::set_step`].
    pub fn restore(&mut self, reader: &mut StateReader) {
        self.state.restore(reader);
        if let Some(loads) = &mut self.excitation {
            loads.before.restore(reader);
        }
        if self.coupling.is_some() && self.step > 0.0 {
            self.refresh_coupling();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Free motion conserves ½q̇² + ½ω²q² exactly, even where the energy of the scheme is half of it. A state at rest under load
    /// has no kinetic energy, for a load as well as for a persistent contact force.
    #[test]
    fn instantaneous_energy_matches_the_motion() {
        let frequencies = vec![0.0, 1e3, 4e4, 1.2e5];
        let model = ModalModel {
            damping_ratios: vec![0.0; 4],
            contact_modes: DMatrix::from_fn(3, 4, |row, mode| 1.0 + row as f64 - 0.3 * mode as f64),
            shapes: DMatrix::identity(4, 4),
            quasi_static: 0,
            frequencies,
        };
        let mut bank = ModalBank::new(&model, 3);
        bank.set_step(Scheme::ModalExact, 2e-5);
        let mut expected = 0.0;
        for sector in 0..3 {
            for (mode, frequency) in model.frequencies.iter().enumerate() {
                let (q, v) = (1e-4 * (1.0 + sector as f64), 0.3 - 0.1 * mode as f64);
                bank.set_modal_state(mode, sector, q, v);
                expected += 0.5 * v * v + 0.5 * frequency * frequency * q * q;
            }
        }
        for _ in 0..500 {
            bank.predict();
            let (kinetic, strain) = bank.energies_now(&[]);
            assert!((kinetic + strain - expected).abs() < 1e-10 * expected && kinetic >= 0.0 && strain >= 0.0);
        }
        let (kinetic, strain) = bank.energies();
        assert!(kinetic + strain < 0.6 * expected, "the energy that is conserved leaves out modes beyond the step");

        let mut bank = ModalBank::with_options(&model, 1, BankOptions { loads: true, ..BankOptions::default() });
        bank.set_step(Scheme::ModalExact, 2e-5);
        let modal_load = [0.0, 30.0, 4e3, 1e4];
        bank.settle(&modal_load);
        bank.loads_mut().copy_from_slice(&modal_load);
        let terms =
            modal_load.iter().zip(&model.frequencies).skip(1).map(|(load, frequency)| 0.5 * (load / frequency).powi(2));
        let at_rest: f64 = terms.sum();
        bank.predict();
        let (kinetic, strain) = bank.energies_now(&[]);
        assert!(kinetic < 1e-20 * at_rest && (strain - at_rest).abs() < 1e-12 * at_rest, "{kinetic:e}, {strain:e}");

        // A contact force on the rows that holds the vibration modes in place.
        let held = ModalModel {
            frequencies: vec![1.2e5; 3],
            damping_ratios: vec![0.01; 3],
            contact_modes: model.contact_modes.columns(0, 3).into_owned(),
            shapes: DMatrix::identity(3, 3),
            quasi_static: 0,
        };
        let mut bank = ModalBank::new(&held, 1);
        bank.set_step(Scheme::ModalExact, 2e-5);
        let force = [3.0, -2.0, 5.0];
        for mode in 0..3 {
            let load: f64 = (0..3).map(|row| held.contact_modes[(row, mode)] * force[row]).sum();
            let index = bank.index(mode, 0);
            bank.state.position[index] = load / 1.44e10;
        }
        let (kinetic, strain) = bank.energies_now(&force);
        assert!(kinetic < 1e-20 * strain && strain > 0.0, "{kinetic:e}, {strain:e}");
    }

    /// Three modes with inertia and one mode that is quasi-static under massless-boundary.
    fn small(damping: f64) -> ModalModel {
        ModalModel {
            frequencies: vec![0.0, 1e3, 4e3, 2e4],
            damping_ratios: vec![damping; 4],
            contact_modes: DMatrix::from_fn(3, 4, |row, mode| 1.0 + row as f64 - 0.3 * mode as f64),
            shapes: DMatrix::identity(4, 4),
            quasi_static: 1,
        }
    }

    #[test]
    fn reset_to_rest_clears_previous_loads() {
        let model = small(0.01);
        let spin = ModalSpin {
            reference_speed: 0.0,
            reference_temperature: 0.0,
            softening: None,
            stiffness_speed2: DMatrix::identity(4, 4) * 3.0,
            stiffness_speed4: DMatrix::zeros(4, 4),
            coriolis: DMatrix::zeros(4, 4),
        };
        let coupling = Some((spin, true, false));
        for (scheme, sectors) in [
            (Scheme::ModalExact, 1),
            (Scheme::ModalExact, 3),
            (Scheme::CentralDifference, 3),
            (Scheme::MasslessBoundary, 1),
        ] {
            let options = BankOptions { loads: true, coupling: coupling.clone(), ..BankOptions::default() };
            let mut bank = ModalBank::with_options(&model, sectors, options);
            bank.set_step(scheme, 2e-5);
            bank.set_speed(500.0, 0.0);
            for _ in 0..5 {
                bank.loads_mut().copy_from_slice(&[1.0, -2.0, 30.0, 4e3]);
                bank.predict();
                bank.correct(sectors - 1, &[3.0, -2.0, 5.0]);
                assert!(bank.finish_loads() != 0.0);
            }
            bank.rest();
            bank.set_step(scheme, 2e-5);
            assert_eq!((bank.energies_now(&[]), bank.energies(), bank.collect_loss()), ((0.0, 0.0), (0.0, 0.0), 0.0));
            assert!(bank.displacement().iter().chain(bank.displacement_before()).all(|value| *value == 0.0));
            // Neither another step length nor a load moves an unloaded structure.
            bank.resample(scheme, 7e-6, &[]);
            bank.predict();
            assert_eq!((bank.finish_loads(), bank.energies_now(&[])), (0.0, (0.0, 0.0)), "{scheme:?}");
            // The stiffness is again that of the reference speed: a mode of 1000 rad/s.
            bank.set_modal_state(1, 0, 1.0, 0.0);
            assert_eq!(bank.energies_now(&[]).1.to_bits(), 5e5_f64.to_bits());
        }
    }

    #[test]
    fn quasi_static_modes_start_without_motion() {
        let model = small(0.0);
        let mut bank = ModalBank::new(&model, 3);
        bank.set_step(Scheme::MasslessBoundary, 2e-5);
        let mut expected = 0.0;
        for (mode, frequency) in model.frequencies.iter().enumerate() {
            bank.set_modal_state(mode, 2, 1e-4, 0.3);
            expected += if mode < 3 { 0.5 * (0.09 + (1e-4 * frequency).powi(2)) } else { 0.0 };
        }
        let sum = |(kinetic, strain): (f64, f64)| kinetic + strain;
        assert!((sum(bank.energies_now(&[])) / expected - 1.0).abs() < 1e-12, "{expected} J");
        // The energy that the undamped scheme conserves is constant from the start.
        let at_first = sum(bank.energies());
        bank.predict();
        assert!((sum(bank.energies()) / at_first - 1.0).abs() < 1e-12);
    }

    /// Compares the widest instruction set with the baseline; without wider registers the baseline is compared with itself.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let modes = 11;
        let model = ModalModel {
            frequencies: (1..=modes).map(|mode| 700.0 * f64::from(mode).powi(2)).collect(),
            damping_ratios: vec![0.005; 11],
            contact_modes: DMatrix::from_fn(15, 11, |row, mode| (1.7 * row as f64 + 0.9 * mode as f64).sin()),
            shapes: DMatrix::identity(11, 11),
            quasi_static: 0,
        };
        let run = |instruction_set| {
            let mut bank = ModalBank::new(&model, 13);
            bank.instruction_set = instruction_set;
            bank.set_step(Scheme::ModalExact, 1e-6);
            let force: Vec<f64> = (0..15).map(|row| f64::from(row).cos()).collect();
            for step in 0..500 {
                bank.predict();
                bank.correct(step % 13, &force);
            }
            let state = &bank.state;
            let all = [&state.position, &state.increment, &state.displacement, &state.loss];
            all.iter().flat_map(|values| values.iter().map(|value| value.to_bits())).collect::<Vec<_>>()
        };
        assert_eq!(run(InstructionSet::Baseline), run(InstructionSet::detect()));
    }
}
