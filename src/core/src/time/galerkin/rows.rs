//! Mode shapes at the contact rows, arranged for sums over modes and over rows.

mod mode_bounds;

use super::kernels::{Combine, PADDED};
use super::level::StepTables;
use super::state::SectorState;
use crate::math::simd::{InstructionSet, Kernel};
use crate::math::vector::{Vector3, strided_vector3};
use crate::modes::coordinates::ContactModes;
use mode_bounds::ModeBounds;
use nalgebra::DMatrix;

/// Data that all step lengths share.
#[derive(Debug, Clone)]
pub struct ContactRows {
    /// Shapes mode by mode: all nodes of the first component, then of the second and the third, padded with zeros.
    by_mode: Vec<f64>,
    /// Magnitudes of `by_mode`.
    magnitudes: Vec<f64>,
    stride: usize,
    /// Shapes row by row (3·node + component), padded with zeros.
    by_row: Vec<f64>,
    instructions: InstructionSet,
    residual: DMatrix<f64>,
    error_form: DMatrix<f64>,
    /// ξω and 1/ω_d of each mode; 1/ω_d is infinite for rigid-body modes.
    rates: Vec<[f64; 2]>,
    mode_bounds: ModeBounds,
    /// See [`ContactRows::lowest_frequencies`].
    lowest_frequencies: Vec<[f64; 2]>,
    /// Coefficients of the bound on the displacement of each mode.
    motions: Vec<FreeMotion>,
    /// The indices 0, 1, 2, …
    all: Vec<usize>,
}

/// Largest phase angle of a mode over a step that resolves its motion (rad).
const RESOLVED: f64 = 2.0;

/// A mode moves a node noticeably if its shape at the node is at least this fraction of the largest shape of any mode there (per
/// unit modal amplitude).
const NOTICEABLE: f64 = 0.01;

/// Coefficients of all modes and the sums over modes; allocated once.
#[derive(Debug, Clone)]
pub struct Sums<const N: usize> {
    coefficients: [Vec<f64>; N],
    /// Rows of each set: all nodes of the first component, then of the second and the third.
    pub rows: [Vec<f64>; N],
}

impl<const N: usize> Sums<N> {
    /// Allocates sums for `modes` modes and `nodes` contact nodes.
    pub fn new(modes: usize, nodes: usize) -> Self {
        Self {
            coefficients: std::array::from_fn(|_| vec![0.0; modes]),
            rows: std::array::from_fn(|_| vec![0.0; (3 * nodes).next_multiple_of(PADDED)]),
        }
    }

    /// Returns the three components of a node in a set.
    pub(crate) fn vector3(&self, set: usize, node: usize, nodes: usize) -> Vector3 {
        strided_vector3(&self.rows[set], node, nodes)
    }
}

/// `to` = `a`·q + `b`·v for all modes.
struct Weigh<'a> {
    tables: [&'a [f64]; 2],
    state: [&'a [f64]; 2],
    to: &'a mut [f64],
}

impl Kernel for Weigh<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { tables: [a, b], state: [q, v], to } = self;
        for (to, ((a, b), (q, v))) in to.iter_mut().zip(a.iter().zip(b).zip(q.iter().zip(v))) {
            *to = a * q + b * v;
        }
    }
}

impl ContactRows {
    /// Arranges the rows of the modes of a sector.
    pub fn new(modes: &ContactModes) -> Self {
        let (nodes, count) = (modes.rows() / 3, modes.len());
        let stride = modes.rows().next_multiple_of(PADDED);
        let mut by_mode = vec![0.0; stride * count];
        for (entries, shape) in by_mode.chunks_exact_mut(stride.max(1)).zip(modes.shapes.column_iter()) {
            for (row, value) in shape.iter().enumerate() {
                entries[(row % 3) * nodes + row / 3] = *value;
            }
        }
        let padded = count.next_multiple_of(PADDED);
        let mut by_row = vec![0.0; padded * modes.rows()];
        for (entries, shapes) in by_row.chunks_exact_mut(padded.max(1)).zip(modes.shapes.row_iter()) {
            entries.iter_mut().zip(shapes.iter()).for_each(|(entry, shape)| *entry = *shape);
        }
        let rates = modes.frequencies.iter().zip(&modes.damping_ratios);
        let rates: Vec<[f64; 2]> =
            rates.map(|(w, ratio)| [ratio * w, 1.0 / (w * (1.0 - ratio * ratio).sqrt())]).collect();
        Self {
            mode_bounds: ModeBounds::new(modes),
            lowest_frequencies: (0..nodes).map(|node| find_lowest_frequencies(modes, node)).collect(),
            magnitudes: by_mode.iter().map(|shape| shape.abs()).collect(),
            by_mode,
            stride,
            by_row,
            instructions: InstructionSet::detect(),
            residual: modes.residual.clone(),
            error_form: modes.error_form(),
            motions: rates.iter().copied().map(FreeMotion::new).collect(),
            rates,
            all: (0..count).collect(),
        }
    }

    /// Returns the two lowest frequencies of the modes that move a node noticeably (rad/s).
    pub(crate) fn lowest_frequencies(&self, node: usize) -> [f64; 2] {
        self.lowest_frequencies[node]
    }

    /// Residual flexibility G (m/N), rows 3·node + component.
    pub fn residual(&self) -> &DMatrix<f64> {
        &self.residual
    }

    /// See [`ContactModes::error_form`].
    pub(crate) fn error_form(&self) -> &DMatrix<f64> {
        &self.error_form
    }

    /// Sums Σ φ (A q + B q̇) for the range `points` of the points of a step.
    pub fn free(&self, level: &StepTables, state: &SectorState, points: std::ops::Range<usize>, sums: &mut Sums<3>) {
        for (point, to) in points.clone().zip(&mut sums.coefficients) {
            let [a, b] = &level.modes.points[point];
            self.instructions.run(Weigh { tables: [a, b], state: [&state.position, &state.velocity], to });
        }
        let [first, second, third] = &sums.coefficients;
        let [one, two, three] = &mut sums.rows;
        match points.len() {
            3 => self.add_up(&self.by_mode, [first, second, third], [one, two, three]),
            2 => self.add_up(&self.by_mode, [first, second], [one, two]),
            _ => self.add_up(&self.by_mode, [first], [one]),
        }
    }

    /// Returns the three components of the sum over modes at a node.
    pub fn at_node(&self, node: usize, modes: &[f64]) -> Vector3 {
        let padded = self.all.len().next_multiple_of(PADDED);
        let sum = |component: usize| {
            let shapes = &self.by_row[(3 * node + component) * padded..][..modes.len()];
            shapes.iter().zip(modes).map(|(shape, mode)| shape * mode).sum()
        };
        [0, 1, 2].map(sum).into()
    }

    /// Finds displacements and velocities by the modes with inertia.
    pub fn now(&self, state: &SectorState, sums: &mut Sums<2>) {
        let [one, two] = &mut sums.rows;
        self.add_up(&self.by_mode, [&state.position, &state.velocity], [one, two]);
    }

    /// Finds displacements by the modes with inertia.
    pub(crate) fn displacements(&self, state: &SectorState, sums: &mut Sums<2>) {
        let [one, _] = &mut sums.rows;
        self.add_up(&self.by_mode, [&state.position], [one]);
    }

    /// Sums the amplitudes of the modes whose phase advances by more than `RESOLVED` within a step of this length (s),
    /// as displacements of the rows (m). For an infinite length, these are the largest displacements from rest at any
    /// time without contact.
    pub(crate) fn unresolved_amplitudes(&self, step: f64, state: &SectorState, sums: &mut Sums<1>) {
        let [amplitudes] = &mut sums.coefficients;
        let modes = self.rates.iter().zip(state.position.iter().zip(&state.velocity));
        for (amplitude, ([rate, per_frequency], (q, v))) in amplitudes.iter_mut().zip(modes) {
            let turned = (v + rate * q) * per_frequency;
            *amplitude = if step < RESOLVED * per_frequency { 0.0 } else { (q * q + turned * turned).sqrt() };
        }
        let [one] = &mut sums.rows;
        self.add_up(&self.magnitudes, [&sums.coefficients[0]], [one]);
    }

    /// Bounds the displacements of the rows from their current positions over a time `span` (s) without forces. The bound is `span` times
    /// the magnitude of the first set of `velocities` (slow modes, m/s), plus `rest` (m).
    pub(crate) fn travel(&self, span: f64, state: &SectorState, velocities: &mut Sums<2>, rest: &mut Sums<1>) {
        let ([slow, _], [bounds]) = (&mut velocities.coefficients, &mut rest.coefficients);
        self.instructions.run(FindTravel {
            motions: &self.motions,
            state: [&state.position, &state.velocity],
            span,
            slow,
            bounds,
        });
        let ([one, _], [two]) = (&mut velocities.rows, &mut rest.rows);
        self.instructions.run(SumTravel {
            shapes: &self.by_mode,
            stride: self.stride,
            coefficients: [&velocities.coefficients[0], &rest.coefficients[0]],
            sums: [one, two],
        });
    }

    /// Velocities of the rows at the end of a step without forces (m/s).
    pub(crate) fn end_velocities(&self, level: &StepTables, state: &SectorState, sums: &mut Sums<1>) {
        let [a, b, ..] = &level.modes.end[1];
        let ([to], [one]) = (&mut sums.coefficients, &mut sums.rows);
        self.instructions.run(Weigh { tables: [a, b], state: [&state.position, &state.velocity], to });
        self.add_up(&self.by_mode, [to], [one]);
    }

    /// Computes the forces on all modes, padded to whole registers, for sets of forces on the rows `rows` (N).
    pub(crate) fn modal_forces<const N: usize>(&self, rows: &[usize], forces: [&[f64]; N], sums: [&mut [f64]; N]) {
        let stride = self.all.len().next_multiple_of(PADDED);
        self.instructions.run(Combine { table: &self.by_row, stride, columns: rows, coefficients: forces, sums });
    }

    fn add_up<const N: usize>(&self, shapes: &[f64], coefficients: [&[f64]; N], sums: [&mut [f64]; N]) {
        self.instructions.run(Combine { table: shapes, stride: self.stride, columns: &self.all, coefficients, sums });
    }
}

/// Finds the two lowest frequencies of the modes that move a node noticeably (rad/s). Both are equal if there is only one such mode.
/// All modes count if none moves the node.
fn find_lowest_frequencies(modes: &ContactModes, node: usize) -> [f64; 2] {
    let size = |mode: usize| modes.shapes.fixed_view::<3, 1>(3 * node, mode).norm();
    let largest = (0..modes.len()).map(size).fold(0.0, f64::max);
    let noticeable = (0..modes.len()).filter(|mode| size(*mode) >= NOTICEABLE * largest);
    let [first, second] =
        noticeable.map(|mode| modes.frequencies[mode]).fold([f64::INFINITY; 2], |[first, second], new| {
            if new < first { [new, first] } else { [first, second.min(new)] }
        });
    [first, if second.is_finite() { second } else { first }]
}

/// Coefficients of the bound on the displacement of a mode without forces.
#[derive(Debug, Clone, Copy)]
struct FreeMotion {
    /// Decay rate ξω (1/s).
    rate: f64,
    /// 1/ω_d (s); 0 for a rigid-body mode.
    per_frequency: f64,
    /// Half the largest acceleration, divided by the amplitude (1/s²); 0 for a rigid-body mode.
    half_acceleration: f64,
}

impl FreeMotion {
    fn new([rate, per_frequency]: [f64; 2]) -> Self {
        if !per_frequency.is_finite() {
            return Self { rate, per_frequency: 0.0, half_acceleration: 0.0 };
        }
        // |q| ≤ A and |q̇| ≤ A ω, so |q̈| ≤ A ω (ω + 2ξω).
        let frequency = 1.0 / per_frequency + rate;
        Self { rate, per_frequency, half_acceleration: 0.5 * frequency * (frequency + 2.0 * rate) }
    }
}

/// Bounds the displacements of the modes over a time `span` (s), from their displacements q and velocities v. The bound of a mode is `span`
/// times the magnitude of its velocity in `slow`, plus its rest in `bounds`. For a slow mode, the rest bounds the acceleration
/// term ½ q̈ t². A fast mode of amplitude A moves by at most 2 A.
struct FindTravel<'a> {
    motions: &'a [FreeMotion],
    state: [&'a [f64]; 2],
    span: f64,
    slow: &'a mut [f64],
    bounds: &'a mut [f64],
}

impl Kernel for FindTravel<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { motions, state: [position, velocity], span, slow, bounds } = self;
        let state = position.iter().zip(velocity);
        for ((slow, bound), (motion, (q, v))) in slow.iter_mut().zip(bounds).zip(motions.iter().zip(state)) {
            let turned = (v + motion.rate * q) * motion.per_frequency;
            let amplitude = (q * q + turned * turned).sqrt();
            let parabola = motion.half_acceleration * span * span;
            let is_slow = parabola < 2.0;
            *slow = if is_slow { *v } else { 0.0 };
            *bound = amplitude * if is_slow { parabola } else { 2.0 };
        }
    }
}

/// Sums over the modes at the rows, in one loop: with the signed mode shapes and the first coefficients, and with the magnitudes of the
/// mode shapes and the second coefficients.
struct SumTravel<'a> {
    /// `[mode][row]`, with `stride` rows.
    shapes: &'a [f64],
    stride: usize,
    coefficients: [&'a [f64]; 2],
    sums: [&'a mut [f64]; 2],
}

impl SumTravel<'_> {
    /// Computes `K` registers of both sums from row `from` on.
    #[inline(always)]
    fn registers<const K: usize>(&mut self, from: usize) {
        let mut sums = [[[0.0; PADDED]; K]; 2];
        let modes = self.coefficients[0].iter().zip(self.coefficients[1]);
        for (shapes, (signed, unsigned)) in self.shapes.chunks_exact(self.stride).zip(modes) {
            let shapes: &[[f64; PADDED]; K] =
                shapes[from..].as_chunks().0.first_chunk().expect("columns hold K registers");
            for k in 0..K {
                for i in 0..PADDED {
                    sums[0][k][i] += shapes[k][i] * signed;
                    sums[1][k][i] += shapes[k][i].abs() * unsigned;
                }
            }
        }
        for (target, sums) in self.sums.iter_mut().zip(&sums) {
            target[from..from + K * PADDED].copy_from_slice(sums.as_flattened());
        }
    }
}

impl Kernel for SumTravel<'_> {
    #[inline(always)]
    fn run(mut self) {
        let mut from = 0;
        while from + 4 * PADDED <= self.stride {
            self.registers::<4>(from);
            from += 4 * PADDED;
        }
        while from < self.stride {
            self.registers::<1>(from);
            from += PADDED;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::galerkin::advance::Advance;
    use tiprub_test_models::SeededRandom;

    /// Free vibration stays within the bound of its travel over any time up to the span.
    #[test]
    fn travel_is_bounded_over_the_span() {
        let mut random = SeededRandom(8);
        for case in 0..200 {
            let ratio = random.of(&[0.0, 0.02, 0.3, 0.7]);
            let count = 1 + random.below(4);
            let frequencies: Vec<f64> = (0..count).map(|_| random.scale(1e3, 1e6)).collect();
            let (damping_ratios, shapes) = (vec![ratio; count], random.matrix(3, count));
            let modes = ContactModes { frequencies, damping_ratios, shapes, residual: DMatrix::zeros(3, 3) };
            let (rows, mut level) = (ContactRows::new(&modes), StepTables::new(&modes, 1));
            level.set_step(&modes, 1e-7);
            let mut state = SectorState::new(count, 1);
            state.position.iter_mut().for_each(|q| *q = random.signed());
            state.velocity.iter_mut().for_each(|v| *v = 3e4 * random.signed());
            let (mut start, mut now, mut rest) = (Sums::new(count, 1), Sums::new(count, 1), Sums::new(count, 1));
            rows.now(&state, &mut start);
            let (from, mut advance) = (start.vector3(0, 0, 1), Advance::new(count, 1));
            rows.travel(2e-5, &state, &mut now, &mut rest);
            let bound = 2e-5 * now.vector3(0, 0, 1).abs() + rest.vector3(0, 0, 1);
            for _ in 0..200 {
                advance.freely(&level, &mut state);
                rows.now(&state, &mut now);
                let moved = (now.vector3(0, 0, 1) - from).abs();
                assert!(
                    (0..3).all(|row| moved[row] <= bound[row] * (1.0 + 1e-9)),
                    "case {case}: {moved} beyond {bound}"
                );
            }
        }
    }

    /// Decaying vibration stays within the largest displacement; undamped vibration attains it.
    #[test]
    fn free_motion_bound_is_valid_and_tight() {
        let mut random = SeededRandom(6);
        for case in 0..200 {
            let ratio = random.of(&[0.0, 0.02, 0.3, 0.7]);
            let count = 1 + random.below(3);
            let frequencies: Vec<f64> = (0..count).map(|_| random.scale(1e3, 1e4)).collect();
            let (damping_ratios, shapes) = (vec![ratio; count], random.matrix(3, count));
            let modes = ContactModes { frequencies, damping_ratios, shapes, residual: DMatrix::zeros(3, 3) };
            let (rows, mut level) = (ContactRows::new(&modes), StepTables::new(&modes, 1));
            level.set_step(&modes, 5e-6);
            let mut state = SectorState::new(count, 1);
            state.position.iter_mut().for_each(|q| *q = random.signed());
            state.velocity.iter_mut().for_each(|v| *v = 3e3 * random.signed());
            let (mut reach, mut now) = (Sums::new(count, 1), Sums::new(count, 1));
            rows.unresolved_amplitudes(f64::INFINITY, &state, &mut reach);
            let (reach, mut advance) = (reach.vector3(0, 0, 1), Advance::new(count, 1));
            let mut most = [0.0_f64; 3];
            for _ in 0..1500 {
                rows.now(&state, &mut now);
                let moved = now.vector3(0, 0, 1);
                (0..3).for_each(|row| most[row] = most[row].max(moved[row].abs()));
                advance.freely(&level, &mut state);
            }
            for (most, reach) in most.into_iter().zip(&reach) {
                assert!(most <= reach * (1.0 + 1e-12), "case {case}: {most} beyond {reach}");
                assert!(count > 1 || ratio > 0.0 || most > 0.999 * reach, "case {case}: {most} of {reach}");
            }
        }
    }
}
