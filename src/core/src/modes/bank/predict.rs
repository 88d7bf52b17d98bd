//! Prediction of one step, and loops over all modes of uncoupled sectors.

use super::coupling::Coupling;
use super::{BankCoefficients, LANES, ModalBank, ModeCoefficients};
use crate::math::simd::Kernel;

impl ModalBank {
    /// Predicts one step without contact (eq. 9 of the paper) and recovers the contact displacements of all sectors.
    pub fn predict(&mut self) {
        std::mem::swap(&mut self.state.increment, &mut self.increment_before);
        std::mem::swap(&mut self.state.displacement, &mut self.state.displacement_before);
        if self.disk.is_some() {
            return self.predict_disk();
        }
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
            for mode in 0..self.modes {
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
}

/// The fused pass over all chunks. `increment_before` holds d, `state.increment` receives d⁺. `LOSS`: sum the damping loss.
/// `SPECIAL`: coefficients per lane (mistuning) and modal loads.
pub(super) struct Predict<'a, const WIDTH: usize, const LOSS: bool, const SPECIAL: bool>(pub &'a mut ModalBank);

impl<const WIDTH: usize, const LOSS: bool, const SPECIAL: bool> Kernel for Predict<'_, WIDTH, LOSS, SPECIAL> {
    #[inline(always)]
    fn run(self) {
        let bank = self.0;
        let (modes, rows) = (bank.model.len(), bank.rows);
        // The prediction of a quasi-static mode without a load is exactly 0, so its rows need no sums.
        let loaded = used_len(&bank.modal_load);
        let moving = bank.model.dynamic_modes(bank.scheme).max(loaded).min(modes);
        let lanes = bank.chunks * WIDTH;
        let block = modes * WIDTH;
        for chunk in 0..bank.chunks {
            let position = &mut bank.state.position[chunk * block..][..block];
            let before = &bank.increment_before[chunk * block..][..block];
            let increment = &mut bank.state.increment[chunk * block..][..block];
            let loss = &mut bank.state.loss[chunk * WIDTH..][..WIDTH];
            let displacement = &mut bank.state.displacement[chunk * WIDTH..];
            let shapes = &bank.contact_modes;
            let modes = ChunkModes {
                coefficients: &bank.coefficients,
                lane_coefficients: if SPECIAL { &bank.lane_coefficients[chunk * block..][..block] } else { &[] },
                modal_load: &bank.modal_load,
                shapes,
                moving,
                rows,
                lanes,
            };
            if WIDTH == 1 && rows > WIDE {
                modes.advance::<WIDTH, 0, LOSS, SPECIAL>(position, before, increment, loss, displacement);
                let sums = &mut displacement[..rows];
                sums.fill(0.0);
                // Sums over whole groups of four modes have the same bits as sums over all modes.
                let summed = moving.next_multiple_of(4).min(position.len());
                Accumulate { sums, matrix: &shapes[..summed * rows], values: &position[..summed] }.run();
                continue;
            }
            // Nine rows (three contact nodes) fit the registers of the widest set; further rows need further passes.
            let mut row = match rows {
                9.. => modes.advance::<WIDTH, 9, LOSS, SPECIAL>(position, before, increment, loss, displacement),
                6.. => modes.advance::<WIDTH, 6, LOSS, SPECIAL>(position, before, increment, loss, displacement),
                _ => modes.advance::<WIDTH, 3, LOSS, SPECIAL>(position, before, increment, loss, displacement),
            };
            let position = &position[..moving * WIDTH];
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

/// Returns the number of values up to the last one that is not 0.
pub(super) fn used_len(values: &[f64]) -> usize {
    values.iter().rposition(|value| *value != 0.0).map_or(0, |last| last + 1)
}

/// A single structure with more contact rows than this recovers them mode by mode.
const WIDE: usize = 18;

/// Data that the passes over one chunk share.
struct ChunkModes<'a> {
    coefficients: &'a [ModeCoefficients],
    /// `[mode · WIDTH + lane]` if the pass is special.
    lane_coefficients: &'a [BankCoefficients],
    /// Modal loads if the pass is special.
    modal_load: &'a [f64],
    shapes: &'a [f64],
    /// Number of modes, counted from the first, that can differ from 0 after the prediction.
    moving: usize,
    rows: usize,
    lanes: usize,
}

impl ChunkModes<'_> {
    /// Computes d⁺ = β d − κ q, q⁺ = q + d⁺ for all modes of one chunk, with the displacements of the first `ROWS` contact rows
    /// (`displacement[row · lanes + lane]`). Whole arrays stay in registers. Returns `ROWS`.
    #[inline(always)]
    fn advance<const WIDTH: usize, const ROWS: usize, const LOSS: bool, const SPECIAL: bool>(
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
        for (mode, ((((k, shapes), q), d), next)) in modes.zip(position).zip(before).zip(increment).enumerate() {
            let (beta, kappa) = (k.beta, k.kappa);
            let mut factor = [k.loss; WIDTH];
            let (old, d) = (*q, *d);
            let (mut new, mut moved) = ([0.0; WIDTH], [0.0; WIDTH]);
            if SPECIAL {
                let own = &self.lane_coefficients[mode * WIDTH..][..WIDTH];
                let modal_load = self.modal_load[mode];
                for lane in 0..WIDTH {
                    new[lane] = own[lane].beta * d[lane] - own[lane].kappa * old[lane] + own[lane].load * modal_load;
                    factor[lane] = own[lane].loss;
                }
            } else {
                for lane in 0..WIDTH {
                    new[lane] = beta * d[lane] - kappa * old[lane];
                }
            }
            for lane in 0..WIDTH {
                moved[lane] = old[lane] + new[lane];
            }
            *q = moved;
            *next = new;
            if LOSS {
                for lane in 0..WIDTH {
                    let twice = new[lane] + d[lane];
                    lost[lane] += factor[lane] * (twice * twice);
                }
            }
            if mode < self.moving {
                add_rows(&mut sums, shapes, &moved);
            }
        }
        if LOSS {
            for lane in 0..WIDTH {
                loss[lane] += lost[lane];
            }
        }
        self.store(&sums, displacement)
    }

    /// Recovers the displacements of `ROWS` further contact rows from `first` on. Returns `ROWS`.
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

/// `sums` + Σ matrix[i] · values[i], with `sums.len()` entries per value, added value by value.
pub(super) struct AddColumns<'a> {
    pub sums: &'a mut [f64],
    pub matrix: &'a [f64],
    pub values: &'a [f64],
}

impl Kernel for AddColumns<'_> {
    #[inline(always)]
    fn run(self) {
        for (value, column) in self.values.iter().zip(self.matrix.chunks_exact(self.sums.len().max(1))) {
            self.sums.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * value);
        }
    }
}

/// `sums` + Σ matrix[mode] · values[mode], with `sums.len()` entries per mode, added four modes at a time.
pub(crate) struct Accumulate<'a> {
    pub sums: &'a mut [f64],
    pub matrix: &'a [f64],
    pub values: &'a [f64],
}

impl Kernel for Accumulate<'_> {
    #[inline(always)]
    fn run(self) {
        let rows = self.sums.len().max(1);
        // Four modes per iteration, so that the sums are read and written once for all four.
        let (fours, rest) = self.values.as_chunks::<4>();
        let (head, tail) = self.matrix.split_at(4 * fours.len() * rows);
        for (values, shapes) in fours.iter().zip(head.chunks_exact(4 * rows)) {
            let (first, other) = shapes.split_at(2 * rows);
            let ((a, b), (c, d)) = (first.split_at(rows), other.split_at(rows));
            for ((((sum, a), b), c), d) in self.sums.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *sum += (a * values[0] + b * values[1]) + (c * values[2] + d * values[3]);
            }
        }
        for (value, shapes) in rest.iter().zip(tail.chunks_exact(rows)) {
            for (sum, shape) in self.sums.iter_mut().zip(shapes) {
                *sum += shape * value;
            }
        }
    }
}
