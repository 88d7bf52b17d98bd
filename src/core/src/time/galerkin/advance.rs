//! Advances the modes of a sector from the start of a step to its end.

use super::basis::{MOST, real};
use super::kernels::PADDED;
use super::level::{ModeSteps, StepTables};
use super::response::TERMS;
use super::rows::{ContactRows, Sums};
use super::state::SectorState;
use crate::math::simd::{InstructionSet, Kernel};
use crate::math::vector::Vector3;

/// Scratch memory, allocated once.
#[derive(Debug, Clone)]
pub struct Advance {
    /// Rows with a force, and the coefficients of θᵃ of these forces (N).
    rows: Vec<usize>,
    forces: [Vec<f64>; MOST],
    /// φᵀp_a of every mode.
    modal: [Vec<f64>; MOST],
    /// φᵀp_a of every mode, as coefficients of powers of the fraction of one part of the step.
    part_modal_forces: [Vec<f64>; MOST],
    /// Amplitude of every mode in the step.
    amplitudes: Vec<f64>,
    losses: Vec<f64>,
    instructions: InstructionSet,
}

/// Advances all modes to the end of a step (`TERMS` coefficients with forces, 2 without) and computes their damping losses (J).
struct End<'a, const COUNT: usize> {
    tables: &'a ModeSteps,
    state: [&'a mut [f64]; 2],
    modal: [&'a [f64]; MOST],
    /// `None` if no mode is damped.
    losses: Option<&'a mut [f64]>,
}

impl<const COUNT: usize> Kernel for End<'_, COUNT> {
    #[inline(always)]
    fn run(self) {
        let Self { tables, state: [position, velocity], modal, losses } = self;
        let count = position.len();
        let velocity = &mut velocity[..count];
        let modal = modal.map(|modal| &modal[..count]);
        let end: [[&[f64]; COUNT]; 2] = [0, 1].map(|row| std::array::from_fn(|term| &tables.end[row][term][..count]));
        let z = |mode: usize, q: f64, v: f64| -> [f64; COUNT] {
            std::array::from_fn(|term| match term {
                0 => q,
                1 => v,
                _ => modal[term - 2][mode],
            })
        };
        if let Some(losses) = losses {
            let losses = &mut losses[..count];
            let forms: [[&[f64]; COUNT]; COUNT] =
                std::array::from_fn(|row| std::array::from_fn(|term| &tables.loss[row][term][..count]));
            for mode in 0..count {
                let z = z(mode, position[mode], velocity[mode]);
                let mut loss = 0.0;
                for row in 0..COUNT {
                    let mut sum = 0.0;
                    for term in 0..COUNT {
                        sum += forms[row][term][mode] * z[term];
                    }
                    loss += z[row] * sum;
                }
                losses[mode] = loss;
            }
        }
        for mode in 0..count {
            let z = z(mode, position[mode], velocity[mode]);
            let mut sums = [0.0; 2];
            for (sum, rows) in sums.iter_mut().zip(&end) {
                for (row, z) in rows.iter().zip(&z) {
                    *sum += row[mode] * z;
                }
            }
            [position[mode], velocity[mode]] = sums;
        }
    }
}

impl Advance {
    /// Creates scratch memory for `modes` modes and `nodes` contact nodes.
    pub fn new(modes: usize, nodes: usize) -> Self {
        let padded = || vec![0.0; modes.next_multiple_of(PADDED)];
        Self {
            rows: Vec::with_capacity(3 * nodes),
            forces: std::array::from_fn(|_| vec![0.0; 3 * nodes]),
            modal: std::array::from_fn(|_| padded()),
            part_modal_forces: std::array::from_fn(|_| padded()),
            amplitudes: padded(),
            losses: padded(),
            instructions: InstructionSet::detect(),
        }
    }

    /// Advances q and q̇ over a step without forces and returns the damping loss (J).
    pub fn freely(&mut self, level: &StepTables, state: &mut SectorState) -> f64 {
        self.finish::<2>(level, state)
    }

    /// Advances q and q̇ under the forces of the last [`Self::set_forces`], and returns the damping loss (J).
    pub fn under_forces(&mut self, level: &StepTables, state: &mut SectorState) -> f64 {
        if self.rows.is_empty() { self.freely(level, state) } else { self.finish::<TERMS>(level, state) }
    }

    /// Computes and stores the modal forces of a step, for the calls below. `forces(node)` returns the coefficients of θᵃ of the force on a node
    /// (N), or `None`.
    pub fn set_forces(&mut self, rows: &ContactRows, forces: impl Fn(usize) -> Option<[Vector3; MOST]>) {
        self.rows.clear();
        for node in 0..self.forces[0].len() / 3 {
            let Some(coefficients) = forces(node) else { continue };
            for component in 0..3 {
                for (forces, values) in self.forces.iter_mut().zip(&coefficients) {
                    forces[self.rows.len()] = values[component];
                }
                self.rows.push(3 * node + component);
            }
        }
        if !self.rows.is_empty() {
            let [a, b, c] = &self.forces;
            let [one, two, three] = &mut self.modal;
            rows.modal_forces(&self.rows, [a, b, c], [one, two, three]);
        }
    }

    /// Finds the amplitudes of all modes in a step of length `step` (s) under the forces of the last [`Self::set_forces`], for
    /// [`Self::interpolation_error`]. Returns a bound on the distance between the displacement of any node and its polynomial of degree
    /// `degree` (m).
    pub fn find_amplitudes(&mut self, rows: &ContactRows, state: &SectorState, step: f64, degree: usize) -> f64 {
        let forces = (!self.rows.is_empty()).then(|| std::array::from_fn(|term| &self.modal[term][..]));
        rows.find_amplitudes(step, state, forces, degree == 1, &mut self.amplitudes)
    }

    /// Returns an upper bound on the error (m) of the cubics that interpolate displacements and velocities of the nodes between two times at a
    /// distance of `length` (s), within the step of the last [`Self::find_amplitudes`].
    pub fn interpolation_error(&self, rows: &ContactRows, length: f64) -> f64 {
        rows.interpolation_error(length, &self.amplitudes)
    }

    /// Finds the same bounds for each row (m).
    pub(crate) fn interpolation_errors(&self, rows: &ContactRows, length: f64, sums: &mut Sums<1>) {
        rows.interpolation_errors(length, &self.amplitudes, sums);
    }

    /// Advances q and q̇ over part `part` (from 0) of `parts` equal parts of the step of the last [`Self::set_forces`]. `level` has the length
    /// of a part. Computes no damping loss.
    pub fn advance_part(&mut self, level: &StepTables, state: &mut SectorState, part: usize, parts: usize) {
        let state = [&mut state.position[..], &mut state.velocity];
        if self.rows.is_empty() {
            let modal = [0, 1, 2].map(|term| &self.modal[term][..]);
            self.instructions.run(End::<2> { tables: &level.modes, state, modal, losses: None });
            return;
        }
        let (part_start, part_fraction) = (real(part) / real(parts), 1.0 / real(parts));
        let ([a, b, c], [one, two, three]) = (&self.modal, &mut self.part_modal_forces);
        for mode in 0..a.len() {
            one[mode] = a[mode] + part_start * (b[mode] + part_start * c[mode]);
            two[mode] = part_fraction * (b[mode] + 2.0 * part_start * c[mode]);
            three[mode] = part_fraction * part_fraction * c[mode];
        }
        let modal = [0, 1, 2].map(|term| &self.part_modal_forces[term][..]);
        self.instructions.run(End::<TERMS> { tables: &level.modes, state, modal, losses: None });
    }

    /// Advances q and q̇ under known modal forces, given as coefficients of θᵃ, and returns the damping loss (J).
    pub fn driven(&mut self, level: &StepTables, state: &mut SectorState, modal: &[Vec<f64>; MOST]) -> f64 {
        self.modal.iter_mut().zip(modal).for_each(|(own, modal)| own[..modal.len()].copy_from_slice(modal));
        self.finish::<TERMS>(level, state)
    }

    fn finish<const COUNT: usize>(&mut self, level: &StepTables, state: &mut SectorState) -> f64 {
        let [a, b, c] = &self.modal;
        let losses = level.damped.then_some(&mut self.losses[..]);
        let end = End::<COUNT> {
            tables: &level.modes,
            state: [&mut state.position, &mut state.velocity],
            modal: [a, b, c],
            losses,
        };
        self.instructions.run(end);
        if level.damped { sum(&self.losses[..state.position.len()]) } else { 0.0 }
    }
}

/// Sums in eight parts, so that the result does not depend on the register width.
fn sum(values: &[f64]) -> f64 {
    let mut parts = [0.0; PADDED];
    for chunk in values.chunks(PADDED) {
        parts.iter_mut().zip(chunk).for_each(|(part, value)| *part += value);
    }
    parts.iter().sum()
}
