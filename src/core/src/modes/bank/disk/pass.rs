//! The fused pass over all modes: forces of the previous step, damping loss, prediction and recovery.
//!
//! Contact forces of a step are applied to the modes in the next pass, which loads the contact modes anyway; until then they are
//! stored as a spectrum (see `ModalBank::finish`). Accumulators stay in registers and sums run mode by mode for every lane, so that
//! wider registers do not change the result.

use super::fourier::Fourier;
use crate::math::simd::Kernel;
use crate::math::vector::Vector3;
use crate::modes::bank::LANES;
use crate::modes::bank::predict::used_len;
use crate::modes::schemes::ModeCoefficients;

/// One complex value per lane: real and imaginary parts.
pub(in crate::modes::bank) type Complexes = [[f64; LANES]; 2];

/// Rows recovered in the fused pass: three contact nodes.
const FUSED: usize = 9;

/// Coefficients of one mode for the lanes of a block (see [`crate::modes::schemes`]); 0 where there is no such mode.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct LaneCoefficients {
    pub beta: [f64; LANES],
    pub kappa: [f64; LANES],
    pub loss: [f64; LANES],
    pub compliance: [f64; LANES],
    pub delayed: [f64; LANES],
}

impl LaneCoefficients {
    /// Sets the coefficients of one lane.
    pub fn set(&mut self, lane: usize, k: &ModeCoefficients) {
        (self.beta[lane], self.kappa[lane], self.loss[lane]) = (k.beta, k.kappa, k.loss);
        (self.compliance[lane], self.delayed[lane]) = (k.compliance, k.delayed);
    }
}

/// Data of one pass. Arrays of modes are `[block][mode]`, spectra `[block][row]`.
///
/// `APPLY`: the contact forces of the previous step act with their compliance first. `DELAYED`: they also act on the predicted
/// step (massless-boundary). `LOSS`: add the damping loss of the previous step. `ADVANCE`: predict and recover.
pub(super) struct Pass<'a, const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool> {
    pub modes: usize,
    /// Number of modes of each block, counted from the first, that can differ from 0 after the prediction.
    pub moving: &'a [usize],
    pub rows: usize,
    /// Contact nodes on which the forces act.
    pub touched: &'a [bool],
    pub coefficients: &'a [LaneCoefficients],
    /// Ψ, `[block][mode][row]`.
    pub shapes: &'a [Complexes],
    /// Contact forces of the previous step.
    pub force: &'a [Complexes],
    /// Modal loads of nodal diameter 0 on the predicted step; may be empty.
    pub modal_load: &'a [f64],
    pub position: &'a mut [Complexes],
    /// d of the previous step; with `ADVANCE` it is updated only for the loss and not stored.
    pub increment: &'a mut [Complexes],
    /// d of the step before the previous one; receives the new d with `ADVANCE`.
    pub older: &'a mut [Complexes],
    pub loss: &'a mut [f64],
    pub spectrum: &'a mut [Complexes],
}

impl<const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool> Kernel
    for Pass<'_, APPLY, DELAYED, LOSS, ADVANCE>
{
    #[inline(always)]
    fn run(mut self) {
        for block in 0..self.spectrum.len() / self.rows {
            match self.rows {
                9.. => self.block::<FUSED>(block),
                6.. => self.block::<6>(block),
                _ => self.block::<3>(block),
            }
        }
    }
}

impl<const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool>
    Pass<'_, APPLY, DELAYED, LOSS, ADVANCE>
{
    #[inline(always)]
    fn block<const ROWS: usize>(&mut self, block: usize) {
        let (modes, rows) = (self.modes, self.rows);
        let force = &self.force[block * rows..][..rows];
        // Loads rotate with the disk, so they act on nodal diameter 0 only.
        let loaded = block == 0 && !self.modal_load.is_empty();
        let moving = self.moving[block].max(if loaded { used_len(self.modal_load) } else { 0 });
        let mut lost = [0.0; LANES];
        let mut sums = [[[0.0; LANES]; 2]; ROWS];
        let states = self.position[block * modes..][..modes]
            .iter_mut()
            .zip(&mut self.increment[block * modes..][..modes])
            .zip(&mut self.older[block * modes..][..modes]);
        let shapes = self.shapes[block * modes * rows..][..modes * rows].chunks_exact(rows);
        let coefficients = &self.coefficients[block * modes..][..modes];
        for (mode, ((((position, increment), older), shapes), k)) in states.zip(shapes).zip(coefficients).enumerate() {
            let (mut q, mut d) = (*position, *increment);
            let modal_force =
                if APPLY || DELAYED { modal_force(self.touched, shapes, force) } else { [[0.0; LANES]; 2] };
            for part in 0..2 {
                if APPLY {
                    for lane in 0..LANES {
                        let moved = k.compliance[lane] * modal_force[part][lane];
                        q[part][lane] += moved;
                        d[part][lane] += moved;
                    }
                }
                if LOSS {
                    for lane in 0..LANES {
                        let twice = d[part][lane] + older[part][lane];
                        lost[lane] += k.loss[lane] * (twice * twice);
                    }
                }
                if ADVANCE {
                    let mut new = [0.0; LANES];
                    for lane in 0..LANES {
                        new[lane] = k.beta[lane] * d[part][lane] - k.kappa[lane] * q[part][lane];
                    }
                    if DELAYED {
                        for lane in 0..LANES {
                            new[lane] += k.delayed[lane] * modal_force[part][lane];
                        }
                    }
                    if loaded && part == 0 {
                        new[0] += self.modal_load.get(mode).copied().unwrap_or(0.0);
                    }
                    for lane in 0..LANES {
                        q[part][lane] += new[lane];
                    }
                    older[part] = new;
                }
            }
            if APPLY {
                *increment = d;
            }
            if APPLY || ADVANCE {
                *position = q;
            }
            if ADVANCE && mode < moving {
                add_rows(&mut sums, shapes, &q);
            }
        }
        if LOSS {
            for (loss, lost) in self.loss[block * LANES..][..LANES].iter_mut().zip(lost) {
                *loss += lost;
            }
        }
        if ADVANCE {
            self.spectrum[block * rows..][..ROWS].copy_from_slice(&sums);
            let (shapes, position) = (&self.shapes[block * modes * rows..], &self.position[block * modes..][..moving]);
            combine(shapes, position, None, ROWS, &mut self.spectrum[block * rows..][..rows]);
        }
    }
}

/// Spectra of rows as combinations of columns: displacements from amplitudes, U = Σ Ψ q, or over one step from forces, U = Ĝ F.
pub(super) struct Combination<'a> {
    pub columns: usize,
    pub rows: usize,
    /// `[block][column][row]`.
    pub matrix: &'a [Complexes],
    /// `[block][column]`.
    pub values: &'a [Complexes],
    /// Contact nodes whose columns count; `None` if all columns count.
    pub touched: Option<&'a [bool]>,
    pub spectrum: &'a mut [Complexes],
}

impl Kernel for Combination<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { columns, rows, matrix, values, touched, spectrum } = self;
        let blocks = matrix.chunks_exact(columns * rows).zip(values.chunks_exact(columns));
        for ((matrix, values), spectrum) in blocks.zip(spectrum.chunks_exact_mut(rows)) {
            combine(matrix, values, touched, 0, spectrum);
        }
    }
}

/// Spectra of rows for two sets of amplitudes, U = Σ Ψ q. The shapes are loaded only once.
pub(super) struct TwoCombinations<'a> {
    pub columns: usize,
    pub rows: usize,
    /// `[block][column][row]`.
    pub matrix: &'a [Complexes],
    /// `[block][column]` of each set.
    pub values: [&'a [Complexes]; 2],
    pub spectra: [&'a mut [Complexes]; 2],
}

impl Kernel for TwoCombinations<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { columns, rows, matrix, values: [one, two], spectra: [first, second] } = self;
        let values = one.chunks_exact(columns).zip(two.chunks_exact(columns));
        let spectra = first.chunks_exact_mut(rows).zip(second.chunks_exact_mut(rows));
        for ((matrix, values), (first, second)) in matrix.chunks_exact(columns * rows).zip(values).zip(spectra) {
            let mut row = 0;
            while row < rows {
                let spectra = [&mut *first, &mut *second];
                row += match rows - row {
                    6.. => combine_two::<6>(matrix, values, row, spectra),
                    _ => combine_two::<3>(matrix, values, row, spectra),
                };
            }
        }
    }
}

/// Combines the columns of `ROWS` rows from row `first` on, for two sets of amplitudes. Returns `ROWS`.
#[inline(always)]
fn combine_two<const ROWS: usize>(
    matrix: &[Complexes],
    values: (&[Complexes], &[Complexes]),
    first: usize,
    spectra: [&mut [Complexes]; 2],
) -> usize {
    let mut sums = [[[[0.0; LANES]; 2]; ROWS]; 2];
    let [one, two] = &mut sums;
    let columns = matrix.chunks_exact(spectra[0].len()).zip(values.0.iter().zip(values.1));
    for (entries, (a, b)) in columns {
        add_rows(one, &entries[first..], a);
        add_rows(two, &entries[first..], b);
    }
    for (spectrum, sums) in spectra.into_iter().zip(&sums) {
        spectrum[first..][..ROWS].copy_from_slice(sums);
    }
    ROWS
}

/// Combines the columns of the rows from `row` on, for one block, in groups of rows that fit the registers.
#[inline(always)]
fn combine(
    matrix: &[Complexes],
    values: &[Complexes],
    touched: Option<&[bool]>,
    mut row: usize,
    spectrum: &mut [Complexes],
) {
    while row < spectrum.len() {
        row += match spectrum.len() - row {
            9.. => combine_rows::<9>(matrix, values, touched, row, spectrum),
            6.. => combine_rows::<6>(matrix, values, touched, row, spectrum),
            _ => combine_rows::<3>(matrix, values, touched, row, spectrum),
        };
    }
}

/// Combines the columns of `ROWS` rows from `first` on. Returns `ROWS`.
#[inline(always)]
fn combine_rows<const ROWS: usize>(
    matrix: &[Complexes],
    values: &[Complexes],
    touched: Option<&[bool]>,
    first: usize,
    spectrum: &mut [Complexes],
) -> usize {
    let mut sums = [[[0.0; LANES]; 2]; ROWS];
    for (column, (entries, value)) in matrix.chunks_exact(spectrum.len()).zip(values).enumerate() {
        if touched.is_none_or(|touched| touched[column / 3]) {
            add_rows(&mut sums, &entries[first..], value);
        }
    }
    spectrum[first..][..ROWS].copy_from_slice(&sums);
    ROWS
}

#[inline(always)]
fn add_rows<const ROWS: usize>(sums: &mut [Complexes; ROWS], shapes: &[Complexes], q: &Complexes) {
    let shapes = &shapes[..ROWS];
    for row in 0..ROWS {
        let [real, imaginary] = &shapes[row];
        for lane in 0..LANES {
            sums[row][0][lane] += real[lane] * q[0][lane] - imaginary[lane] * q[1][lane];
            sums[row][1][lane] += real[lane] * q[1][lane] + imaginary[lane] * q[0][lane];
        }
    }
}

/// Returns p = Ψᴴ F over the contact nodes with forces.
#[inline(always)]
pub(super) fn modal_force(touched: &[bool], shapes: &[Complexes], force: &[Complexes]) -> Complexes {
    let mut sums = [[0.0; LANES]; 2];
    let (shapes, force) = (shapes.as_chunks::<3>().0, force.as_chunks::<3>().0);
    for ((touched, shapes), force) in touched.iter().zip(shapes).zip(force) {
        if *touched {
            // Separate sums for each node, so that the additions do not depend on each other.
            let mut node = [[0.0; LANES]; 2];
            for ([real, imaginary], [across, along]) in shapes.iter().zip(force) {
                for lane in 0..LANES {
                    node[0][lane] += real[lane] * across[lane] + imaginary[lane] * along[lane];
                    node[1][lane] += real[lane] * along[lane] - imaginary[lane] * across[lane];
                }
            }
            for lane in 0..LANES {
                sums[0][lane] += node[0][lane];
                sums[1][lane] += node[1][lane];
            }
        }
    }
    sums
}

/// Modal forces of a spectrum of contact forces on all modes.
pub(super) struct ModalForces<'a> {
    pub modes: usize,
    pub rows: usize,
    /// `[block][mode][row]`.
    pub shapes: &'a [Complexes],
    /// `[block][row]`.
    pub force: &'a [Complexes],
    /// Contact nodes with forces.
    pub touched: &'a [bool],
    /// `[block][mode][part][lane]`.
    pub to: &'a mut [f64],
}

impl Kernel for ModalForces<'_> {
    #[inline(always)]
    fn run(self) {
        for (place, to) in self.to.chunks_exact_mut(2 * LANES).enumerate() {
            let force = &self.force[place / self.modes * self.rows..][..self.rows];
            let shapes = &self.shapes[place * self.rows..][..self.rows];
            to.copy_from_slice(modal_force(self.touched, shapes, force).as_flattened());
        }
    }
}

/// Modal forces of two spectra of contact forces on all modes. The shapes are loaded only once.
pub(super) struct TwoModalForces<'a> {
    pub modes: usize,
    pub rows: usize,
    /// `[block][mode][row]`.
    pub shapes: &'a [Complexes],
    /// `[block][row]` of each set.
    pub forces: [&'a [Complexes]; 2],
    /// True for contact nodes with a force of either set.
    pub touched: &'a [bool],
    /// `[block][mode][part][lane]` of each set.
    pub to: [&'a mut [f64]; 2],
}

impl Kernel for TwoModalForces<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { modes, rows, shapes, forces, touched, to: [one, two] } = self;
        let targets = one.chunks_exact_mut(2 * LANES).zip(two.chunks_exact_mut(2 * LANES));
        for (place, (one, two)) in targets.enumerate() {
            let [first, second] = forces.map(|force| &force[place / modes * rows..][..rows]);
            let shapes = &shapes[place * rows..][..rows];
            one.copy_from_slice(modal_force(touched, shapes, first).as_flattened());
            two.copy_from_slice(modal_force(touched, shapes, second).as_flattened());
        }
    }
}

/// Spectrum of the forces on some nodes.
pub(super) struct Gather<'a> {
    pub fourier: &'a Fourier,
    pub rows: usize,
    /// (sector, node, force).
    pub forces: &'a [(usize, usize, Vector3)],
    pub spectrum: &'a mut [Complexes],
}

impl Kernel for Gather<'_> {
    #[inline(always)]
    fn run(self) {
        self.spectrum.fill([[0.0; LANES]; 2]);
        for (sector, node, force) in self.forces {
            self.fourier.add(*sector, 3 * node, self.rows, *force, self.spectrum);
        }
    }
}
