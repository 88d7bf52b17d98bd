//! The fused pass over all modes: forces of the previous step, damping loss, prediction and recovery.
//!
//! Contact forces of a step are applied to the modes in the next pass, which loads the contact modes anyway; until then they are
//! stored as a spectrum (see [`CyclicBank::finish`](super::CyclicBank::finish)). Accumulators stay in registers and sums run mode
//! by mode for every lane, so that wider registers do not change the result.

use super::fourier::Fourier;
use crate::math::simd::Kernel;
use crate::math::vector::Vector3;
use crate::modes::bank::LANES;

/// One complex value per lane: real and imaginary parts.
pub(crate) type Complexes = [[f64; LANES]; 2];

/// Rows recovered in the fused pass: three contact nodes.
const FUSED: usize = 9;

/// Coefficients of one mode for the lanes of a block (see [`crate::modes::schemes`]); 0 where there is no such mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CyclicCoefficients {
    pub beta: [f64; LANES],
    pub kappa: [f64; LANES],
    pub loss: [f64; LANES],
    pub compliance: [f64; LANES],
    pub delayed: [f64; LANES],
}

impl CyclicCoefficients {
    pub const NONE: Self = Self {
        beta: [0.0; LANES],
        kappa: [0.0; LANES],
        loss: [0.0; LANES],
        compliance: [0.0; LANES],
        delayed: [0.0; LANES],
    };
}

/// Data of one pass. Arrays of modes are `[block][mode]`, spectra `[block][row]`.
///
/// `APPLY`: the contact forces of the previous step act with their compliance first. `DELAYED`: they also act on the predicted
/// step (massless-boundary). `LOSS`: add the damping loss of the previous step. `ADVANCE`: predict and recover.
pub struct Pass<'a, const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool> {
    pub modes: usize,
    pub rows: usize,
    /// Contact nodes on which the forces act.
    pub touched: &'a [bool],
    pub coefficients: &'a [CyclicCoefficients],
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
            if ADVANCE {
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
            self.recover(block, ROWS);
        }
    }

    /// Recovers the rows from `row` on, for which the fused pass has no registers.
    #[inline(always)]
    fn recover(&mut self, block: usize, mut row: usize) {
        let (modes, rows) = (self.modes, self.rows);
        let shapes = &self.shapes[block * modes * rows..][..modes * rows];
        let position = &self.position[block * modes..][..modes];
        while row < rows {
            let spectrum = &mut self.spectrum[block * rows + row..];
            row += match rows - row {
                9.. => recover::<9>(shapes, row, rows, position, spectrum),
                6.. => recover::<6>(shapes, row, rows, position, spectrum),
                _ => recover::<3>(shapes, row, rows, position, spectrum),
            };
        }
    }
}

/// Recovers U = Σ Ψ q of `ROWS` rows from `first` on, for one block. Returns `ROWS`.
#[inline(always)]
fn recover<const ROWS: usize>(
    shapes: &[Complexes],
    first: usize,
    rows: usize,
    position: &[Complexes],
    spectrum: &mut [Complexes],
) -> usize {
    let mut sums = [[[0.0; LANES]; 2]; ROWS];
    for (q, shapes) in position.iter().zip(shapes.chunks_exact(rows)) {
        add_rows(&mut sums, &shapes[first..], q);
    }
    spectrum[..ROWS].copy_from_slice(&sums);
    ROWS
}

/// Recovers Σ Ψ q for all rows, without prediction.
pub struct Recover<'a> {
    pub modes: usize,
    pub rows: usize,
    pub shapes: &'a [Complexes],
    pub position: &'a [Complexes],
    pub spectrum: &'a mut [Complexes],
}

impl Kernel for Recover<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { modes, rows, shapes, position, spectrum } = self;
        for (block, spectrum) in spectrum.chunks_exact_mut(rows).enumerate() {
            let shapes = &shapes[block * modes * rows..][..modes * rows];
            for row in (0..rows).step_by(3) {
                recover::<3>(shapes, row, rows, &position[block * modes..][..modes], &mut spectrum[row..]);
            }
        }
    }
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
pub(crate) fn modal_force(touched: &[bool], shapes: &[Complexes], force: &[Complexes]) -> Complexes {
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

/// Spectrum of the displacements that the forces of a spectrum cause over one step: U = Ĝ F, with Ĝ
/// `[block][column][row]`.
pub(crate) struct SpectralResponse<'a> {
    pub rows: usize,
    pub touched: &'a [bool],
    pub flexibility: &'a [Complexes],
    pub force: &'a [Complexes],
    pub spectrum: &'a mut [Complexes],
}

impl Kernel for SpectralResponse<'_> {
    #[inline(always)]
    fn run(self) {
        let rows = self.rows;
        for (block, spectrum) in self.spectrum.chunks_exact_mut(rows).enumerate() {
            let force = &self.force[block * rows..][..rows];
            let flexibility = &self.flexibility[block * rows * rows..][..rows * rows];
            let mut row = 0;
            while row < rows {
                let target = &mut spectrum[row..];
                row += match rows - row {
                    9.. => answer::<9>(self.touched, flexibility, row, rows, force, target),
                    6.. => answer::<6>(self.touched, flexibility, row, rows, force, target),
                    _ => answer::<3>(self.touched, flexibility, row, rows, force, target),
                };
            }
        }
    }
}

#[inline(always)]
fn answer<const ROWS: usize>(
    touched: &[bool],
    flexibility: &[Complexes],
    first: usize,
    rows: usize,
    force: &[Complexes],
    spectrum: &mut [Complexes],
) -> usize {
    let mut sums = [[[0.0; LANES]; 2]; ROWS];
    for (column, (entries, force)) in flexibility.chunks_exact(rows).zip(force).enumerate() {
        if touched[column / 3] {
            add_rows(&mut sums, &entries[first..], force);
        }
    }
    spectrum[..ROWS].copy_from_slice(&sums);
    ROWS
}

/// Spectrum of the forces on some nodes.
pub(crate) struct Gather<'a> {
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
