//! Shapes of the modes at the contact rows, laid out for sums over modes.

use super::level::{ModeStep, Modes};
use super::state::SectorState;
use crate::dynamics::bank::LANES;
use crate::dynamics::dispatch::{InstructionSet, Kernel};
use nalgebra::DMatrix;

/// What all lengths of the step share.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Mode by mode, filled up with zeros to whole registers.
    by_mode: Vec<f64>,
    /// The same without signs.
    magnitudes: Vec<f64>,
    stride: usize,
    instructions: InstructionSet,
    /// Row by row.
    by_row: Vec<f64>,
    residual: DMatrix<f64>,
    error_form: DMatrix<f64>,
    /// ξω and 1/ω_d of each mode; the latter infinite of rigid ones.
    rates: Vec<[f64; 2]>,
}

/// Sums over modes for `N` sets of coefficients.
struct AddUp<'a, 'b, F, const N: usize> {
    shapes: &'a [f64],
    stride: usize,
    count: usize,
    coefficients: F,
    sums: &'a mut [&'b mut [f64]; N],
}

impl<F: FnMut(usize) -> [f64; N], const N: usize> Kernel for AddUp<'_, '_, F, N> {
    #[inline(always)]
    fn run(mut self) {
        for mode in 0..self.count {
            let coefficients = (self.coefficients)(mode);
            let shape = &self.shapes[mode * self.stride..][..self.stride];
            for (sums, coefficient) in self.sums.iter_mut().zip(coefficients) {
                for (sum, shape) in sums[..shape.len()].iter_mut().zip(shape) {
                    *sum += shape * coefficient;
                }
            }
        }
    }
}

impl Rows {
    /// Of the modes of a sector.
    pub fn new(modes: &Modes) -> Self {
        let stride = modes.rows().next_multiple_of(LANES);
        let mut by_mode = vec![0.0; stride * modes.len()];
        for (row, shape) in by_mode.chunks_exact_mut(stride).zip(modes.shapes.column_iter()) {
            row[..shape.len()].copy_from_slice(shape.as_slice());
        }
        let rates = modes.frequencies.iter().zip(&modes.damping_ratios);
        Self {
            magnitudes: by_mode.iter().map(|shape| shape.abs()).collect(),
            by_mode,
            stride,
            instructions: InstructionSet::detect(),
            by_row: modes.shapes.transpose().as_slice().to_vec(),
            residual: modes.residual.clone(),
            error_form: modes.error_form(),
            rates: rates.map(|(w, ratio)| [ratio * w, 1.0 / (w * (1.0 - ratio * ratio).sqrt())]).collect(),
        }
    }

    /// Shapes of a row in all modes.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.by_row[row * self.rates.len()..][..self.rates.len()]
    }

    /// G (m/N).
    pub fn residual(&self) -> &DMatrix<f64> {
        &self.residual
    }

    /// See [`Modes::error_form`].
    pub fn error_form(&self) -> &DMatrix<f64> {
        &self.error_form
    }

    /// Write the displacements of the modes alone and their velocities, and for `N` points the sums Σ φ (A q + B q̇) with the tables
    /// told. All slices are filled up to whole registers.
    pub fn free<const N: usize>(
        &self,
        modes: &[ModeStep],
        state: &SectorState,
        points: [usize; N],
        sums: &mut [&mut [f64]; N],
    ) {
        sums.iter_mut().for_each(|sums| sums.fill(0.0));
        let coefficients = |mode: usize| {
            let (table, q, v) = (&modes[mode].points, state.position[mode], state.velocity[mode]);
            points.map(|point| table[point][0] * q + table[point][1] * v)
        };
        self.add_up(&self.by_mode, coefficients, sums);
    }

    /// Displacements and velocities of the modes with inertia, filled up to whole registers.
    pub fn now(&self, state: &SectorState, sums: &mut [&mut [f64]; 2]) {
        sums.iter_mut().for_each(|sums| sums.fill(0.0));
        self.add_up(&self.by_mode, |mode| [state.position[mode], state.velocity[mode]], sums);
    }

    /// How far each row can be from where it rests, whenever, as long as nothing pushes (m): the amplitudes of all modes together.
    pub fn reach(&self, state: &SectorState, sums: &mut [&mut [f64]; 1]) {
        sums[0].fill(0.0);
        let amplitude = |mode: usize| {
            let ([rate, per_frequency], q) = (self.rates[mode], state.position[mode]);
            let turned = (state.velocity[mode] + rate * q) * per_frequency;
            [(q * q + turned * turned).sqrt()]
        };
        self.add_up(&self.magnitudes, amplitude, sums);
    }

    fn add_up<const N: usize>(
        &self,
        shapes: &[f64],
        coefficients: impl FnMut(usize) -> [f64; N],
        sums: &mut [&mut [f64]; N],
    ) {
        let (stride, count) = (self.stride, self.rates.len());
        self.instructions.run(AddUp { shapes, stride, count, coefficients, sums });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::galerkin::level::Level;
    use tiprub_test_models::Random;

    /// Decaying vibration stays within reach, and without damping goes there.
    #[test]
    fn free_motion_goes_as_far_as_its_reach_and_no_farther() {
        let mut random = Random(6);
        for case in 0..200 {
            let ratio = random.of(&[0.0, 0.02, 0.3, 0.7]);
            let count = 1 + random.below(3);
            let frequencies: Vec<f64> = (0..count).map(|_| random.scale(1e3, 1e4)).collect();
            let (damping_ratios, shapes) = (vec![ratio; count], random.matrix(3, count));
            let modes = Modes { frequencies, damping_ratios, shapes, residual: DMatrix::zeros(3, 3) };
            let (rows, mut level) = (Rows::new(&modes), Level::new(&modes, 1));
            level.set_step(&modes, 5e-6);
            let mut state = SectorState::new(count, 1);
            state.position.iter_mut().for_each(|q| *q = random.signed());
            state.velocity.iter_mut().for_each(|v| *v = 3e3 * random.signed());
            let (mut reach, mut now, mut rate) = (vec![0.0; LANES], vec![0.0; LANES], vec![0.0; LANES]);
            rows.reach(&state, &mut [&mut reach]);
            let mut most = [0.0_f64; 3];
            for _ in 0..1500 {
                rows.now(&state, &mut [&mut now, &mut rate]);
                (0..3).for_each(|row| most[row] = most[row].max(now[row].abs()));
                for (mode, table) in level.modes.iter().enumerate() {
                    let (q, v) = (state.position[mode], state.velocity[mode]);
                    let of = |row: [f64; 5]| row[0] * q + row[1] * v;
                    (state.position[mode], state.velocity[mode]) = (of(table.end[0]), of(table.end[1]));
                }
            }
            for (most, reach) in most.into_iter().zip(&reach) {
                assert!(most <= reach * (1.0 + 1e-12), "case {case}: {most} beyond {reach}");
                assert!(count > 1 || ratio > 0.0 || most > 0.999 * reach, "case {case}: {most} of {reach}");
            }
        }
    }
}
