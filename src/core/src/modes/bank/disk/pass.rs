//! The pass over all modes, block by block: forces of the previous step, damping loss and prediction in one loop, then recovery.
//!
//! Contact forces of a step are applied to the modes in the next pass, which loads the contact modes anyway; until then they are
//! stored as a spectrum (see `ModalBank::finish`). Sums run mode by mode for every lane, so that wider registers do not change the result.

use super::complexes_mut;
use super::fourier::Fourier;
use crate::math::octet::{Octet, OctetKernel, Portable};
use crate::math::simd::Kernel;
use crate::math::vector::Vector3;
use crate::modes::bank::LANES;
use crate::modes::bank::predict::used_len;
use crate::modes::schemes::ModeCoefficients;

/// One complex value per lane: real and imaginary parts.
pub(in crate::modes::bank) type Complexes = [[f64; LANES]; 2];

/// Number of columns that are added, one after the other, to a sum while it stays in registers.
const COLUMNS_PER_GROUP: usize = 4;

/// Complex numbers of all lanes in registers.
type Registers<L> = [L; 2];

#[inline(always)]
fn read<L: Octet>(from: &Complexes) -> Registers<L> {
    [L::read(&from[0]), L::read(&from[1])]
}

#[inline(always)]
fn write<L: Octet>(values: Registers<L>, to: &mut Complexes) {
    values[0].write(&mut to[0]);
    values[1].write(&mut to[1]);
}

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

impl<const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool> OctetKernel
    for Pass<'_, APPLY, DELAYED, LOSS, ADVANCE>
{
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(mut self) {
        for block in 0..self.spectrum.len() / self.rows {
            self.block::<L>(block);
        }
    }
}

impl<const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool>
    Pass<'_, APPLY, DELAYED, LOSS, ADVANCE>
{
    #[inline(always)]
    fn block<L: Octet>(&mut self, block: usize) {
        let (modes, rows) = (self.modes, self.rows);
        let force = &self.force[block * rows..][..rows];
        // Loads rotate with the disk, so they act on nodal diameter 0 only.
        let loaded = block == 0 && !self.modal_load.is_empty();
        let moving = self.moving[block].max(if loaded { used_len(self.modal_load) } else { 0 });
        let mut lost = L::zero();
        let states = self.position[block * modes..][..modes]
            .iter_mut()
            .zip(&mut self.increment[block * modes..][..modes])
            .zip(&mut self.older[block * modes..][..modes]);
        let shapes = self.shapes[block * modes * rows..][..modes * rows].chunks_exact(rows);
        let coefficients = &self.coefficients[block * modes..][..modes];
        for (mode, ((((position, increment), older), shapes), k)) in states.zip(shapes).zip(coefficients).enumerate() {
            let [beta, kappa, loss] = [L::read(&k.beta), L::read(&k.kappa), L::read(&k.loss)];
            let [compliance, delayed] = [L::read(&k.compliance), L::read(&k.delayed)];
            let modal_force =
                if APPLY || DELAYED { modal_force::<L>(self.touched, shapes, force) } else { [L::zero(); 2] };
            for part in [0, 1] {
                let (mut q, mut d) = (L::read(&position[part]), L::read(&increment[part]));
                if APPLY {
                    let moved = compliance * modal_force[part];
                    (q, d) = (q + moved, d + moved);
                }
                if LOSS {
                    let twice = d + L::read(&older[part]);
                    lost = lost + loss * (twice * twice);
                }
                if ADVANCE {
                    let mut new = beta * d - kappa * q;
                    if DELAYED {
                        new = new + delayed * modal_force[part];
                    }
                    if loaded && part == 0 {
                        let load = self.modal_load.get(mode).copied().unwrap_or(0.0);
                        new = L::select(1, new + L::splat(load), new);
                    }
                    q = q + new;
                    new.write(&mut older[part]);
                }
                if APPLY {
                    d.write(&mut increment[part]);
                }
                if APPLY || ADVANCE {
                    q.write(&mut position[part]);
                }
            }
        }
        if LOSS {
            let (sums, _) = self.loss[block * LANES..].as_chunks_mut::<LANES>();
            (L::read(&sums[0]) + lost).write(&mut sums[0]);
        }
        if ADVANCE {
            let (shapes, position) = (&self.shapes[block * modes * rows..], &self.position[block * modes..][..moving]);
            combine::<L, 1>(shapes, [position], None, [&mut self.spectrum[block * rows..][..rows]]);
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

impl OctetKernel for Combination<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { columns, rows, matrix, values, touched, spectrum } = self;
        let blocks = matrix.chunks_exact(columns * rows).zip(values.chunks_exact(columns));
        for ((matrix, values), spectrum) in blocks.zip(spectrum.chunks_exact_mut(rows)) {
            combine::<L, 1>(matrix, [values], touched, [spectrum]);
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

impl OctetKernel for TwoCombinations<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { columns, rows, matrix, values: [one, two], spectra: [first, second] } = self;
        let values = one.chunks_exact(columns).zip(two.chunks_exact(columns));
        let spectra = first.chunks_exact_mut(rows).zip(second.chunks_exact_mut(rows));
        for ((matrix, (one, two)), (first, second)) in matrix.chunks_exact(columns * rows).zip(values).zip(spectra) {
            combine::<L, 2>(matrix, [one, two], None, [first, second]);
        }
    }
}

/// Computes the spectra of one block for `SETS` sets of amplitudes, from the columns of the contact nodes in `touched`, or from all columns.
#[inline(always)]
fn combine<L: Octet, const SETS: usize>(
    matrix: &[Complexes],
    values: [&[Complexes]; SETS],
    touched: Option<&[bool]>,
    mut spectra: [&mut [Complexes]; SETS],
) {
    spectra.iter_mut().for_each(|spectrum| spectrum.fill([[0.0; LANES]; 2]));
    let count = values.iter().map(|values| values.len()).min().unwrap_or(0);
    let mut columns = (0..count).filter(|column| touched.is_none_or(|touched| touched[column / 3]));
    loop {
        let (mut group, mut found) = ([0; COLUMNS_PER_GROUP], 0);
        for column in columns.by_ref().take(COLUMNS_PER_GROUP) {
            group[found] = column;
            found += 1;
        }
        if found == COLUMNS_PER_GROUP {
            add_columns::<L, SETS, COLUMNS_PER_GROUP>(matrix, values, group, &mut spectra);
            continue;
        }
        for column in &group[..found] {
            add_columns::<L, SETS, 1>(matrix, values, [*column], &mut spectra);
        }
        return;
    }
}

/// Adds `COUNT` columns, one after the other, to the sums of all rows.
#[inline(always)]
fn add_columns<L: Octet, const SETS: usize, const COUNT: usize>(
    matrix: &[Complexes],
    values: [&[Complexes]; SETS],
    columns: [usize; COUNT],
    spectra: &mut [&mut [Complexes]; SETS],
) {
    let rows = spectra[0].len();
    let entries: [&[Complexes]; COUNT] = std::array::from_fn(|place| &matrix[columns[place] * rows..][..rows]);
    let mut amplitudes = [[[L::zero(); 2]; COUNT]; SETS];
    for set in 0..SETS {
        for place in 0..COUNT {
            amplitudes[set][place] = read(&values[set][columns[place]]);
        }
    }
    for row in 0..rows {
        let mut sums = [[L::zero(); 2]; SETS];
        for set in 0..SETS {
            sums[set] = read(&spectra[set][row]);
        }
        for place in 0..COUNT {
            let [real, imaginary] = read::<L>(&entries[place][row]);
            for set in 0..SETS {
                let [a, b] = amplitudes[set][place];
                sums[set][0] = sums[set][0] + (real * a - imaginary * b);
                sums[set][1] = sums[set][1] + (real * b + imaginary * a);
            }
        }
        for set in 0..SETS {
            write(sums[set], &mut spectra[set][row]);
        }
    }
}

/// Returns p = Ψᴴ F over the contact nodes with forces, for callers outside SIMD kernels.
pub(super) fn find_modal_force(touched: &[bool], shapes: &[Complexes], force: &[Complexes]) -> Complexes {
    let mut found = [[0.0; LANES]; 2];
    write(modal_force::<Portable>(touched, shapes, force), &mut found);
    found
}

/// Returns p = Ψᴴ F over the contact nodes with forces.
#[inline(always)]
fn modal_force<L: Octet>(touched: &[bool], shapes: &[Complexes], force: &[Complexes]) -> Registers<L> {
    let mut sums = [L::zero(); 2];
    let (shapes, force) = (shapes.as_chunks::<3>().0, force.as_chunks::<3>().0);
    for ((touched, shapes), force) in touched.iter().zip(shapes).zip(force) {
        if *touched {
            // Separate sums for each node, so that the additions do not depend on each other.
            let mut node = [L::zero(); 2];
            for component in 0..3 {
                let ([real, imaginary], [across, along]) =
                    (read::<L>(&shapes[component]), read::<L>(&force[component]));
                node[0] = node[0] + (real * across + imaginary * along);
                node[1] = node[1] + (real * along - imaginary * across);
            }
            (sums[0], sums[1]) = (sums[0] + node[0], sums[1] + node[1]);
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

impl OctetKernel for ModalForces<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(self) {
        for (place, to) in complexes_mut(self.to).iter_mut().enumerate() {
            let force = &self.force[place / self.modes * self.rows..][..self.rows];
            let shapes = &self.shapes[place * self.rows..][..self.rows];
            write(modal_force::<L>(self.touched, shapes, force), to);
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

impl OctetKernel for TwoModalForces<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { modes, rows, shapes, forces, touched, to: [one, two] } = self;
        for (place, (one, two)) in complexes_mut(one).iter_mut().zip(complexes_mut(two)).enumerate() {
            let [first, second] = forces.map(|force| &force[place / modes * rows..][..rows]);
            let shapes = &shapes[place * rows..][..rows];
            write(modal_force::<L>(touched, shapes, first), one);
            write(modal_force::<L>(touched, shapes, second), two);
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
