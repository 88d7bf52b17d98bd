//! A disk of coupled sectors in modal coordinates, stepped together.
//!
//! Nodal diameters are SIMD lanes in blocks of `LANES`, complex amplitudes are pairs of real and imaginary parts:
//! `state[block · modes + mode][re, im][lane]`. If a nodal diameter has fewer modes than others, or is padding of the last block,
//! the coefficients of the additional modes are 0. The transforms of `fourier` convert contact displacements to sectors and
//! forces on sectors to nodal diameters. The effect of a force on any sector within a step is the block-circulant flexibility G(s
//! − s') = Σ_n Re(Ĝ_n e^(2πin(s − s')/N)), Ĝ_n = Ψ_n diag(c) Ψ_nᴴ.

mod coefficients;
mod contact;
mod energy;
mod excited;
mod fourier;
mod model;
mod pass;
mod span;
#[cfg(test)]
mod tests;

use tiprub_cosim::persist::{Persist, StateReader, StateWriter};
use tiprub_cosim::persist_fields;

use super::bank::{FLUSH_BELOW, LANES, lanes};
use super::excitation::DiskLoads;
use crate::math::simd::InstructionSet;
use crate::math::vector::Vector3;
use crate::modes::schemes::{ModeCoefficients, Velocity};
use crate::scene::method::Scheme;
use fourier::{Fourier, Synthesis};
pub use model::CyclicModel;
pub use model::DiameterModes;
use pass::{Complexes, CyclicCoefficients, Pass, Recover};

const NOTHING: Complexes = [[0.0; LANES]; 2];

/// All state variables.
#[derive(Debug, Clone, PartialEq)]
struct CyclicState {
    /// q at the current step, without contact forces that have not been applied yet.
    position: Vec<Complexes>,
    /// d = q − q⁻, without contact forces that have not been applied yet.
    increment: Vec<Complexes>,
    /// d of the previous step, for the damping loss.
    older: Vec<Complexes>,
    /// Displacements of the contact rows at the current step, `[row][lane of sector]`, including contact.
    displacement: Vec<f64>,
    /// Displacements of the contact rows one step earlier, `[row][lane of sector]`.
    displacement_before: Vec<f64>,
    /// Damping loss per nodal diameter since the last collection (J).
    loss: Vec<f64>,
    /// Modal loads of the previous step; empty without loads.
    modal_load_before: Vec<f64>,
    /// Spectrum of the contact forces of the last step (N).
    force: Vec<Complexes>,
    /// True for contact nodes with a force on any sector.
    touched: Vec<bool>,
    /// True if the contact forces have not been applied to the modes of their step.
    unapplied: bool,
    /// True if there are such forces.
    acting: bool,
    /// True if the damping loss of the last step has not been added.
    loss_due: bool,
}

persist_fields!(CyclicState {
    position,
    increment,
    older,
    displacement,
    displacement_before,
    loss,
    modal_load_before,
    force,
    touched,
    unapplied,
    acting,
    loss_due
});

/// Coupled sectors, stepped together.
#[derive(Debug, Clone)]
pub struct CyclicBank {
    instruction_set: InstructionSet,
    model: CyclicModel,
    fourier: Fourier,
    lanes: usize,
    rows: usize,
    /// Largest number of modes of a nodal diameter.
    modes: usize,
    /// Ψ, `[block][mode][row]`.
    shapes: Vec<Complexes>,
    /// `[block][mode]`.
    lane_coefficients: Vec<CyclicCoefficients>,
    /// `[n · modes + mode]`; the default if there is no such mode.
    coefficients: Vec<ModeCoefficients>,
    /// Velocity coefficients, `[n · modes + mode]`; quasi-static modes have none.
    velocities: Vec<Velocity>,
    /// Ĝ, `[block][column][row]`.
    spectral_flexibility: Vec<Complexes>,
    /// G(s − s'), `[difference][column node][row node][component of the force][component of the displacement]`, the last
    /// padded to four.
    flexibility: Vec<[[f64; 4]; 3]>,
    scheme: Scheme,
    step: f64,
    loads: bool,
    excitation: Option<DiskLoads>,
    state: CyclicState,
    /// Modal loads of nodal diameter 0 for the current step.
    modal_load: Vec<f64>,
    /// Displacements caused by `modal_load`, per mode.
    load_response: Vec<f64>,
    /// Scratch: spectrum of displacements.
    spectrum: Vec<Complexes>,
    /// Requested forces: (sector, node, force).
    asked: Vec<(usize, usize, Vector3)>,
    /// Spectrum and contact nodes of the requested forces.
    asked_force: Vec<Complexes>,
    asked_nodes: Vec<bool>,
    /// Displacements caused by the requested forces (m), `[row][lane of sector]`.
    moved: Vec<f64>,
    /// True if the damping loss is collected.
    with_loss: bool,
}

impl CyclicBank {
    /// Creates a disk with all sectors at rest; call [`CyclicBank::set_step`] before stepping. If `loads`, there are modal loads
    /// of nodal diameter 0 in addition to contact forces.
    pub fn new(model: &CyclicModel, loads: bool) -> Self {
        let (sectors, rows, modes) = (model.sectors, model.rows(), model.most_modes());
        let (fourier, lanes) = (Fourier::new(sectors), lanes(sectors));
        let blocks = fourier.blocks();
        let mut shapes = vec![NOTHING; blocks * modes * rows];
        for (n, diameter) in model.diameters.iter().enumerate() {
            for mode in 0..diameter.len() {
                for row in 0..rows {
                    let value = diameter.contact_modes[(row, mode)];
                    let entry = &mut shapes[(n / LANES * modes + mode) * rows + row];
                    (entry[0][n % LANES], entry[1][n % LANES]) = (value.re, value.im);
                }
            }
        }
        let load_count = if loads { model.diameters[0].len() } else { 0 };
        Self {
            instruction_set: InstructionSet::detect(),
            lane_coefficients: vec![CyclicCoefficients::NONE; blocks * modes],
            coefficients: vec![ModeCoefficients::default(); model.diameters.len() * modes],
            velocities: vec![Velocity::default(); model.diameters.len() * modes],
            spectral_flexibility: vec![NOTHING; blocks * rows * rows],
            flexibility: vec![[[0.0; 4]; 3]; sectors * rows / 3 * rows / 3],
            scheme: Scheme::default(),
            step: 0.0,
            state: CyclicState {
                position: vec![NOTHING; blocks * modes],
                increment: vec![NOTHING; blocks * modes],
                older: vec![NOTHING; blocks * modes],
                displacement: vec![0.0; rows * lanes],
                displacement_before: vec![0.0; rows * lanes],
                loss: vec![0.0; blocks * LANES],
                modal_load_before: vec![0.0; load_count],
                force: vec![NOTHING; blocks * rows],
                touched: vec![false; rows / 3],
                unapplied: false,
                acting: false,
                loss_due: false,
            },
            modal_load: vec![0.0; load_count],
            load_response: vec![0.0; load_count],
            spectrum: vec![NOTHING; blocks * rows],
            asked: Vec::with_capacity(sectors * rows / 3),
            asked_force: vec![NOTHING; blocks * rows],
            asked_nodes: vec![false; rows / 3],
            moved: vec![0.0; rows * lanes],
            model: model.clone(),
            fourier,
            lanes,
            rows,
            modes,
            shapes,
            loads,
            excitation: None,
            with_loss: true,
        }
    }

    /// Stops collecting the damping loss, which takes time.
    pub fn skip_losses(&mut self) {
        self.with_loss = false;
    }

    /// Number of sectors.
    pub fn sectors(&self) -> usize {
        self.model.sectors
    }

    /// Number of lanes of a displacement row: sectors rounded up to whole registers.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Number of contact rows of a sector (3 per contact node).
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Instruction set of the hot loops.
    pub fn instruction_set(&self) -> InstructionSet {
        self.instruction_set
    }

    /// Modes of the disk.
    pub fn model(&self) -> &CyclicModel {
        &self.model
    }

    /// Step size of the current coefficients (s).
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Displacements of the contact rows at the current step (m), `[row][lane of sector]`.
    pub fn displacement(&self) -> &[f64] {
        &self.state.displacement
    }

    /// Displacements of the contact rows one step earlier (m), `[row][lane of sector]`.
    pub fn displacement_before(&self) -> &[f64] {
        &self.state.displacement_before
    }

    fn index(&self, nodal_diameter: usize, mode: usize) -> (usize, usize) {
        (nodal_diameter / LANES * self.modes + mode, nodal_diameter % LANES)
    }

    /// Modal amplitude q (re, im) and increment d (re, im) of a mode of a nodal diameter.
    pub fn modal_state(&self, nodal_diameter: usize, mode: usize) -> ([f64; 2], [f64; 2]) {
        let (index, lane) = self.index(nodal_diameter, mode);
        let part = |values: &Complexes| values.map(|part| part[lane]);
        let (mut position, mut increment) = (part(&self.state.position[index]), part(&self.state.increment[index]));
        if self.state.unapplied {
            let compliance = self.lane_coefficients[index].compliance[lane];
            for (part, force) in self.modal_force(nodal_diameter, mode).into_iter().enumerate() {
                position[part] += compliance * force;
                increment[part] += compliance * force;
            }
        }
        (position, increment)
    }

    /// Sets amplitude and velocity (re, im) of a mode of a nodal diameter; the increment is that of free motion without force. A
    /// quasi-static mode has neither and stays 0, and so does the imaginary part of a real mode.
    pub fn set_modal_state(&mut self, nodal_diameter: usize, mode: usize, position: [f64; 2], velocity: [f64; 2]) {
        let diameter = &self.model.diameters[nodal_diameter];
        if mode >= diameter.dynamic_modes(self.scheme) {
            return;
        }
        let (frequency, ratio) = (diameter.frequencies[mode], diameter.damping_ratios[mode]);
        let (index, lane) = self.index(nodal_diameter, mode);
        self.state.unapplied = false;
        for part in 0..if self.model.is_real(nodal_diameter) { 1 } else { 2 } {
            let increment = self.scheme.increment(frequency, ratio, position[part], velocity[part], self.step);
            self.state.position[index][part][lane] = position[part];
            self.state.increment[index][part][lane] = increment;
        }
    }

    /// Sets the static equilibrium under the modal loads `modal_load` of nodal diameter 0: q = L/ω², rigid-body modes at 0.
    pub fn settle(&mut self, modal_load: &[f64]) {
        self.rest();
        self.state.modal_load_before.copy_from_slice(modal_load);
        for (mode, load) in modal_load.iter().enumerate() {
            let frequency = self.model.diameters[0].frequencies[mode];
            let rest = if frequency > 0.0 { load / (frequency * frequency) } else { 0.0 };
            self.state.position[mode][0][0] = rest;
        }
        self.recover();
    }

    /// Sets the state to rest, undeformed.
    pub fn rest(&mut self) {
        let state = &mut self.state;
        for values in [&mut state.position, &mut state.increment, &mut state.older, &mut state.force] {
            values.fill(NOTHING);
        }
        for values in [
            &mut state.displacement,
            &mut state.displacement_before,
            &mut state.loss,
            &mut state.modal_load_before,
            &mut self.modal_load,
        ] {
            values.fill(0.0);
        }
        state.touched.fill(false);
        (state.unapplied, state.acting, state.loss_due) = (false, false, false);
        if let Some(loads) = &mut self.excitation {
            loads.rest();
        }
    }

    /// Modal loads of nodal diameter 0 for the next step, to be set before [`CyclicBank::predict`].
    pub fn loads_mut(&mut self) -> &mut [f64] {
        &mut self.modal_load
    }

    /// Predicts one step without contact (eq. 9 of the paper) and recovers the contact displacements of all sectors. Contact
    /// forces of the previous step that have not been applied yet are applied first.
    pub fn predict(&mut self) {
        for (mode, (load_response, modal_load)) in self.load_response.iter_mut().zip(&self.modal_load).enumerate() {
            *load_response = self.coefficients[mode].load_compliance() * modal_load;
        }
        let delayed = self.state.acting && self.scheme.properties().delays_contact;
        match (self.state.unapplied, delayed, self.state.loss_due) {
            (false, false, false) => self.pass::<false, false, false, true>(),
            (false, false, true) => self.pass::<false, false, true, true>(),
            (true, false, false) => self.pass::<true, false, false, true>(),
            (true, false, true) => self.pass::<true, false, true, true>(),
            (false, true, false) => self.pass::<false, true, false, true>(),
            (false, true, true) => self.pass::<false, true, true, true>(),
            (true, true, false) => self.pass::<true, true, false, true>(),
            (true, true, true) => self.pass::<true, true, true, true>(),
        }
        self.act_excited();
        std::mem::swap(&mut self.state.increment, &mut self.state.older);
        std::mem::swap(&mut self.state.displacement, &mut self.state.displacement_before);
        (self.state.unapplied, self.state.acting, self.state.loss_due) = (false, false, self.with_loss);
        let values = &mut self.state.displacement;
        let (fourier, spectrum, rows, lanes) = (&self.fourier, &self.spectrum, self.rows, self.lanes);
        self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values });
    }

    /// Applies the contact forces of the last step to its modes and adds its damping loss. The result is the same as that of the
    /// next [`CyclicBank::predict`].
    pub fn finish(&mut self) {
        match (self.state.unapplied, self.state.loss_due) {
            (false, false) => {}
            (false, true) => self.pass::<false, false, true, false>(),
            (true, false) => self.pass::<true, false, false, false>(),
            (true, true) => self.pass::<true, false, true, false>(),
        }
        (self.state.unapplied, self.state.loss_due) = (false, false);
    }

    fn pass<const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool>(&mut self) {
        let state = &mut self.state;
        self.instruction_set.run(Pass::<APPLY, DELAYED, LOSS, ADVANCE> {
            modes: self.modes,
            rows: self.rows,
            touched: &state.touched,
            coefficients: &self.lane_coefficients,
            shapes: &self.shapes,
            force: &state.force,
            modal_load: &self.load_response,
            position: &mut state.position,
            increment: &mut state.increment,
            older: &mut state.older,
            loss: &mut state.loss,
            spectrum: &mut self.spectrum,
        });
    }

    /// Recomputes the contact displacements from the modal state (after setting it). Losses that have not been added yet are dropped.
    pub fn recover(&mut self) {
        self.finish();
        let state = &mut self.state;
        for ((before, position), increment) in state.older.iter_mut().zip(&state.position).zip(&state.increment) {
            for part in 0..2 {
                for lane in 0..LANES {
                    before[part][lane] = position[part][lane] - increment[part][lane];
                }
            }
        }
        for (position, displacement) in
            [(&state.position, &mut state.displacement), (&state.older, &mut state.displacement_before)]
        {
            let (modes, rows, shapes) = (self.modes, self.rows, &self.shapes[..]);
            self.instruction_set.run(Recover { modes, rows, shapes, position, spectrum: &mut self.spectrum });
            let (fourier, spectrum, lanes) = (&self.fourier, &self.spectrum, self.lanes);
            self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values: displacement });
        }
    }

    /// Sets amplitudes that have decayed almost to zero to exactly zero, so that no denormals arise.
    pub fn flush(&mut self) {
        for values in [&mut self.state.position, &mut self.state.increment, &mut self.state.older] {
            for value in values.iter_mut().flatten().flatten().filter(|value| value.abs() < FLUSH_BELOW) {
                *value = 0.0;
            }
        }
    }

    /// Returns whether every modal coordinate is finite.
    pub fn is_finite(&self) -> bool {
        let state = &self.state;
        let all = state.position.iter().chain(&state.increment).chain(&state.force);
        all.flatten().flatten().all(|value| value.is_finite())
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

    /// Restores a saved state, after [`CyclicBank::set_step`].
    pub fn restore(&mut self, reader: &mut StateReader) {
        self.state.restore(reader);
        if let Some(loads) = &mut self.excitation {
            loads.before.restore(reader);
        }
    }
}
