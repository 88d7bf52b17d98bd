//! State of all modes of all sectors, and the fused pass of one step.
//!
//! Layout: sectors are SIMD lanes in chunks of [`LANES`]; within a chunk the modes follow each other,
//! `state[(chunk · modes + mode) · width + lane]`. The pass predicts (eq. 9 of the paper without contact), recovers
//! the displacements of the contact rows and adds up the damping loss while a chunk is in registers; no horizontal
//! sum occurs. Contact forces are then applied to the few sectors that touch.

use nalgebra::DMatrix;

use super::dispatch::{InstructionSet, Kernel};
use super::modal::ModalModel;
use super::scheme::{ModeCoefficients, free_increment, resample};
use crate::persist::{Persist, Reader, Writer, persist_fields};
use crate::settings::Scheme;

/// Lanes of one chunk: one 512-bit register of f64.
pub const LANES: usize = 8;

/// Amplitudes below this are flushed to zero now and then: idle damped modes would decay into denormals.
const FLUSH_BELOW: f64 = 1e-150;

/// Lanes of a displacement row for this many sectors: rounded up to whole chunks, except for a single structure.
pub fn lanes(sectors: usize) -> usize {
    if sectors == 1 { 1 } else { sectors.div_ceil(LANES) * LANES }
}

/// Everything that moves.
#[derive(Debug, Clone, PartialEq)]
struct BankState {
    /// q at the current step.
    position: Vec<f64>,
    /// d = q − q⁻.
    increment: Vec<f64>,
    /// Displacements of the contact rows at the current step, `[row][lane]`.
    displacement: Vec<f64>,
    /// The same one step earlier.
    displacement_before: Vec<f64>,
    /// Damping loss per lane since the last collection (J).
    loss: Vec<f64>,
}

persist_fields!(BankState { position, increment, displacement, displacement_before, loss });

/// Identical uncoupled sectors in modal coordinates, stepped together.
#[derive(Debug, Clone)]
pub struct ModalBank {
    instruction_set: InstructionSet,
    sectors: usize,
    width: usize,
    chunks: usize,
    rows: usize,
    frequencies: Vec<f64>,
    damping_ratios: Vec<f64>,
    /// `[mode][row]`.
    contact_modes: Vec<f64>,
    /// `[row][mode]`.
    contact_rows: Vec<f64>,
    coefficients: Vec<ModeCoefficients>,
    /// G = Φ diag(c) Φᵀ, rows × rows: displacement of the contact rows per unit force held for one step (m/N).
    flexibility: DMatrix<f64>,
    step: f64,
    state: BankState,
    /// Scratch: increments of the step before.
    increment_before: Vec<f64>,
    /// Scratch: φᵀf of the sector being corrected.
    modal_force: Vec<f64>,
}

impl ModalBank {
    /// All sectors at rest; [`ModalBank::set_step`] must be called before stepping.
    pub fn new(model: &ModalModel, sectors: usize) -> Self {
        let width = if sectors == 1 { 1 } else { LANES };
        let chunks = sectors.div_ceil(width);
        let (rows, modes) = (model.contact_modes.nrows(), model.len());
        let state_len = chunks * modes * width;
        let lanes = chunks * width;
        Self {
            instruction_set: InstructionSet::detect(),
            sectors,
            width,
            chunks,
            rows,
            frequencies: model.frequencies.clone(),
            damping_ratios: model.damping_ratios.clone(),
            contact_modes: model.contact_modes.as_slice().to_vec(),
            contact_rows: model.contact_modes.transpose().as_slice().to_vec(),
            coefficients: vec![ModeCoefficients::default(); modes],
            flexibility: DMatrix::zeros(rows, rows),
            step: 0.0,
            state: BankState {
                position: vec![0.0; state_len],
                increment: vec![0.0; state_len],
                displacement: vec![0.0; rows * lanes],
                displacement_before: vec![0.0; rows * lanes],
                loss: vec![0.0; lanes],
            },
            increment_before: vec![0.0; state_len],
            modal_force: vec![0.0; modes],
        }
    }

    /// Number of sectors.
    pub fn sectors(&self) -> usize {
        self.sectors
    }

    /// Lanes of a displacement row: sectors rounded up to whole chunks.
    pub fn lanes(&self) -> usize {
        self.chunks * self.width
    }

    /// Number of contact rows (3 per contact node).
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of modes of one sector.
    pub fn modes(&self) -> usize {
        self.frequencies.len()
    }

    /// Step size of the coefficients in use (s).
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Flexibility of the contact rows over one step (m/N), rows × rows.
    pub fn flexibility(&self) -> &DMatrix<f64> {
        &self.flexibility
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

    /// The same one step earlier (m).
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

    /// Set a sector's modal position q and velocity q̇; the increment is that of free motion under no force.
    pub fn set_modal_state(&mut self, mode: usize, sector: usize, position: f64, velocity: f64) {
        let (frequency, ratio, step) = (self.frequencies[mode], self.damping_ratios[mode], self.step);
        let index = self.index(mode, sector);
        self.state.position[index] = position;
        self.state.increment[index] = free_increment(frequency, ratio, position, velocity, step);
    }

    /// Recompute the contact displacements from the modal state (after setting it).
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

    /// Everything at rest and undeformed.
    pub fn rest(&mut self) {
        for values in [
            &mut self.state.position,
            &mut self.state.increment,
            &mut self.state.displacement,
            &mut self.state.displacement_before,
            &mut self.state.loss,
        ] {
            values.fill(0.0);
        }
    }

    /// New step size: coefficients and flexibility. The state is not touched (see [`ModalBank::resample`]).
    pub fn set_step(&mut self, scheme: Scheme, step: f64) {
        self.step = step;
        for (mode, coefficients) in self.coefficients.iter_mut().enumerate() {
            *coefficients = ModeCoefficients::new(scheme, self.frequencies[mode], self.damping_ratios[mode], step);
        }
        for row in 0..self.rows {
            for column in 0..self.rows {
                let terms = self.coefficients.iter().enumerate().map(|(mode, coefficients)| {
                    let shapes = &self.contact_modes[mode * self.rows..][..self.rows];
                    shapes[row] * coefficients.compliance * shapes[column]
                });
                self.flexibility[(row, column)] = terms.sum();
            }
        }
    }

    /// Modal damping ratio of all modes (takes effect with the next [`ModalBank::set_step`]).
    pub fn set_damping_ratio(&mut self, damping_ratio: f64) {
        self.damping_ratios.fill(damping_ratio);
    }

    /// Carry the state from the step size in use to `new_step`, each sector under its last contact force
    /// (`forces[row · lanes + sector]`, N), then use the new coefficients.
    pub fn resample(&mut self, scheme: Scheme, new_step: f64, forces: &[f64]) {
        let lanes = self.lanes();
        for sector in 0..self.sectors {
            for mode in 0..self.modes() {
                let shapes = &self.contact_modes[mode * self.rows..][..self.rows];
                let force = shapes.iter().enumerate().map(|(row, shape)| shape * forces[row * lanes + sector]).sum();
                let index = self.index(mode, sector);
                self.state.increment[index] = resample(
                    self.frequencies[mode],
                    self.damping_ratios[mode],
                    self.state.position[index],
                    self.state.increment[index],
                    force,
                    self.step,
                    new_step,
                );
            }
        }
        self.set_step(scheme, new_step);
        self.recover();
    }

    /// Predict one step without contact (eq. 9 of the paper) and recover the contact displacements.
    pub fn predict(&mut self, with_loss: bool) {
        std::mem::swap(&mut self.state.increment, &mut self.increment_before);
        std::mem::swap(&mut self.state.displacement, &mut self.state.displacement_before);
        let instruction_set = self.instruction_set;
        match (self.width, with_loss) {
            (1, true) => instruction_set.run(Predict::<1, true>(self)),
            (1, false) => instruction_set.run(Predict::<1, false>(self)),
            (_, true) => instruction_set.run(Predict::<LANES, true>(self)),
            (_, false) => instruction_set.run(Predict::<LANES, false>(self)),
        }
    }

    /// Correct one sector for the contact `force` on its rows (N), eq. 11 of the paper.
    pub fn correct(&mut self, sector: usize, force: &[f64], with_loss: bool) {
        let modal_force = &mut self.modal_force;
        let contact_rows = &self.contact_rows;
        self.instruction_set.run(ModalForce { modal_force, contact_rows, force });
        let (rows, width) = (self.rows, self.width);
        let start = sector / width * self.modes() * width + sector % width;
        let position = self.state.position[start..].iter_mut().step_by(width);
        let increment = self.state.increment[start..].iter_mut().step_by(width);
        let before = self.increment_before[start..].iter().step_by(width);
        let mut loss = 0.0;
        for ((((position, increment), before), modal_force), coefficients) in
            position.zip(increment).zip(before).zip(&self.modal_force).zip(&self.coefficients)
        {
            let correction = coefficients.compliance * modal_force;
            if with_loss {
                let predicted = *increment + before;
                loss += coefficients.loss * correction * (2.0 * predicted + correction);
            }
            *position += correction;
            *increment += correction;
        }
        self.state.loss[sector] += loss;
        let lanes = self.lanes();
        // G is symmetric: its columns are its rows.
        for (row, column) in self.flexibility.as_slice().chunks_exact(rows).enumerate() {
            let moved: f64 = column.iter().zip(force).map(|(entry, value)| entry * value).sum();
            self.state.displacement[row * lanes + sector] += moved;
        }
    }

    /// Kinetic and strain energy of all sectors (J), in the quantity the scheme conserves (see [`super::scheme`]).
    pub fn energies(&self) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        let block = self.modes() * self.width;
        let chunks = self.state.position.chunks_exact(block).zip(self.state.increment.chunks_exact(block));
        for (position, increment) in chunks {
            let rows = position.chunks_exact(self.width).zip(increment.chunks_exact(self.width));
            for ((position, increment), coefficients) in rows.zip(&self.coefficients) {
                // Padding lanes are zero and add nothing.
                for (position, increment) in position.iter().zip(increment) {
                    kinetic += coefficients.inertia * (increment * increment);
                    strain += coefficients.spring * (position * (position - increment));
                }
            }
        }
        (kinetic, strain)
    }

    /// Damping loss since the last call (J).
    pub fn collect_loss(&mut self) -> f64 {
        let loss = self.state.loss[..self.sectors].iter().sum();
        self.state.loss.fill(0.0);
        loss
    }

    /// Set amplitudes that have decayed to nothing to exactly zero, so that no denormals arise.
    pub fn flush(&mut self) {
        for values in [&mut self.state.position, &mut self.state.increment] {
            for value in values.iter_mut().filter(|value| value.abs() < FLUSH_BELOW) {
                *value = 0.0;
            }
        }
    }

    /// True when every modal coordinate is finite.
    pub fn is_finite(&self) -> bool {
        self.state.position.iter().chain(&self.state.increment).all(|value| value.is_finite())
    }

    /// Save the state (not the step size).
    pub fn save(&self, writer: &mut Writer) {
        self.state.save(writer);
    }

    /// Restore a saved state.
    pub fn restore(&mut self, reader: &mut Reader) {
        self.state.restore(reader);
    }
}

/// φᵀf of all modes for the forces on the contact rows of one sector.
struct ModalForce<'a> {
    modal_force: &'a mut [f64],
    contact_rows: &'a [f64],
    force: &'a [f64],
}

impl Kernel for ModalForce<'_> {
    #[inline(always)]
    fn run(self) {
        self.modal_force.fill(0.0);
        for (shapes, force) in self.contact_rows.chunks_exact(self.modal_force.len()).zip(self.force) {
            for (sum, shape) in self.modal_force.iter_mut().zip(shapes) {
                *sum += shape * force;
            }
        }
    }
}

/// The fused pass over all chunks. `increment_before` holds d, `state.increment` receives d⁺.
struct Predict<'a, const WIDTH: usize, const LOSS: bool>(&'a mut ModalBank);

impl<const WIDTH: usize, const LOSS: bool> Kernel for Predict<'_, WIDTH, LOSS> {
    #[inline(always)]
    fn run(self) {
        let bank = self.0;
        let (modes, rows) = (bank.frequencies.len(), bank.rows);
        let lanes = bank.chunks * WIDTH;
        let block = modes * WIDTH;
        for chunk in 0..bank.chunks {
            let position = &mut bank.state.position[chunk * block..][..block];
            let before = &bank.increment_before[chunk * block..][..block];
            let increment = &mut bank.state.increment[chunk * block..][..block];
            let loss = &mut bank.state.loss[chunk * WIDTH..][..WIDTH];
            let displacement = &mut bank.state.displacement[chunk * WIDTH..];
            let shapes = &bank.contact_modes;
            let modes = Modes { coefficients: &bank.coefficients, shapes, rows, lanes };
            // Nine rows (three contact nodes) fit the registers of the widest set; more go in further passes.
            let mut row = match rows {
                9.. => modes.advance::<WIDTH, 9, LOSS>(position, before, increment, loss, displacement),
                6.. => modes.advance::<WIDTH, 6, LOSS>(position, before, increment, loss, displacement),
                _ => modes.advance::<WIDTH, 3, LOSS>(position, before, increment, loss, displacement),
            };
            while row < rows {
                let displacement = &mut displacement[row * lanes..];
                row += match rows - row {
                    9.. => modes.recover::<WIDTH, 9>(row, position, displacement),
                    6.. => modes.recover::<WIDTH, 6>(row, position, displacement),
                    _ => modes.recover::<WIDTH, 3>(row, position, displacement),
                };
            }
        }
    }
}

/// What the passes over one chunk share.
struct Modes<'a> {
    coefficients: &'a [ModeCoefficients],
    shapes: &'a [f64],
    rows: usize,
    lanes: usize,
}

impl Modes<'_> {
    /// d⁺ = β d − κ q, q⁺ = q + d⁺ for all modes of one chunk, with the displacements of the first `ROWS` contact rows
    /// (`displacement[row · lanes + lane]`). Whole arrays at a time stay in registers. Returns `ROWS`.
    #[inline(always)]
    fn advance<const WIDTH: usize, const ROWS: usize, const LOSS: bool>(
        &self,
        position: &mut [f64],
        before: &[f64],
        increment: &mut [f64],
        loss: &mut [f64],
        displacement: &mut [f64],
    ) -> usize {
        let mut lost = [0.0; WIDTH];
        let mut sums = [[0.0; WIDTH]; ROWS];
        let (position, _) = position.as_chunks_mut::<WIDTH>();
        let (before, _) = before.as_chunks::<WIDTH>();
        let (increment, _) = increment.as_chunks_mut::<WIDTH>();
        let modes = self.coefficients.iter().zip(self.shapes.chunks_exact(self.rows));
        for ((((k, shapes), q), d), next) in modes.zip(position).zip(before).zip(increment) {
            let (beta, kappa, factor) = (k.beta, k.kappa, k.loss);
            let (old, d) = (*q, *d);
            let (mut new, mut moved) = ([0.0; WIDTH], [0.0; WIDTH]);
            for lane in 0..WIDTH {
                new[lane] = beta * d[lane] - kappa * old[lane];
                moved[lane] = old[lane] + new[lane];
            }
            *q = moved;
            *next = new;
            if LOSS {
                for lane in 0..WIDTH {
                    let twice = new[lane] + d[lane];
                    lost[lane] += factor * (twice * twice);
                }
            }
            add_rows(&mut sums, shapes, &moved);
        }
        if LOSS {
            for lane in 0..WIDTH {
                loss[lane] += lost[lane];
            }
        }
        self.store(&sums, displacement)
    }

    /// Displacements of `ROWS` further contact rows from `first` on. Returns `ROWS`.
    #[inline(always)]
    fn recover<const WIDTH: usize, const ROWS: usize>(
        &self,
        first: usize,
        position: &[f64],
        displacement: &mut [f64],
    ) -> usize {
        let mut sums = [[0.0; WIDTH]; ROWS];
        let (position, _) = position.as_chunks::<WIDTH>();
        for (q, shapes) in position.iter().zip(self.shapes.chunks_exact(self.rows)) {
            add_rows(&mut sums, &shapes[first..], q);
        }
        self.store(&sums, displacement)
    }

    #[inline(always)]
    fn store<const WIDTH: usize, const ROWS: usize>(
        &self,
        sums: &[[f64; WIDTH]; ROWS],
        displacement: &mut [f64],
    ) -> usize {
        for (row, sum) in sums.iter().enumerate() {
            displacement[row * self.lanes..][..WIDTH].copy_from_slice(sum);
        }
        ROWS
    }
}

#[inline(always)]
fn add_rows<const WIDTH: usize, const ROWS: usize>(sums: &mut [[f64; WIDTH]; ROWS], shapes: &[f64], q: &[f64; WIDTH]) {
    let shapes = &shapes[..ROWS];
    for row in 0..ROWS {
        for lane in 0..WIDTH {
            sums[row][lane] += shapes[row] * q[lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The widest set against the baseline; a processor without wider registers compares the baseline with itself.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let modes = 11;
        let model = ModalModel {
            frequencies: (1..=modes).map(|mode| 700.0 * f64::from(mode).powi(2)).collect(),
            damping_ratios: vec![0.005; 11],
            contact_modes: DMatrix::from_fn(15, 11, |row, mode| (1.7 * row as f64 + 0.9 * mode as f64).sin()),
            shapes: DMatrix::identity(11, 11),
        };
        let run = |instruction_set| {
            let mut bank = ModalBank::new(&model, 13);
            bank.instruction_set = instruction_set;
            bank.set_step(Scheme::ModalExact, 1e-6);
            let force: Vec<f64> = (0..15).map(|row| f64::from(row).cos()).collect();
            for step in 0..500 {
                bank.predict(true);
                bank.correct(step % 13, &force, true);
            }
            let state = &bank.state;
            let all = [&state.position, &state.increment, &state.displacement, &state.loss];
            all.iter().flat_map(|values| values.iter().map(|value| value.to_bits())).collect::<Vec<_>>()
        };
        assert_eq!(run(InstructionSet::Baseline), run(InstructionSet::detect()));
    }
}
