//! Mode shapes at the contact rows, arranged for sums over modes and over rows.

use super::basis::MOST;
use super::kernels::{Combine, PADDED};
use super::level::StepTables;
use super::state::SectorState;
use crate::math::octet::{Octet, OctetKernel};
use crate::math::simd::{InstructionSet, Kernel};
use crate::math::vector::{Vector3, strided_vector3};
use crate::modes::coordinates::ContactModes;
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
    lowest_frequency: f64,
    /// Coefficients of the bound on the displacement of each mode.
    motions: Vec<FreeMotion>,
    /// The indices 0, 1, 2, …
    all: Vec<usize>,
}

/// Largest phase angle of a mode over a step that resolves its motion (rad).
const RESOLVED: f64 = 2.0;

/// Frequency of the mode whose interpolation error replaces that of a rigid-body mode (rad/s).
const RIGID: f64 = 1.0;

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

/// Data of all modes for bounds on interpolation errors, padded with zeros.
#[derive(Debug, Clone)]
struct ModeBounds {
    /// ξω (1/s), and 1/ω_d (s) and 1/ω² (s²) or 0 for a rigid-body mode.
    rates: Vec<f64>,
    per_frequencies: Vec<f64>,
    per_squares: Vec<f64>,
    /// ω (rad/s); [`RIGID`] for a rigid-body mode.
    frequencies: Vec<f64>,
    /// Largest displacement of any node per unit modal amplitude.
    shapes: Vec<f64>,
    /// 0 for a rigid-body mode, otherwise 1.
    vibrates: Vec<f64>,
}

impl ModeBounds {
    fn new(modes: &ContactModes) -> Self {
        let count = modes.len().next_multiple_of(PADDED);
        let of = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..count).map(|mode| if mode < modes.len() { value(mode) } else { 0.0 }).collect()
        };
        let (w, ratio) = (|mode: usize| modes.frequencies[mode], |mode: usize| modes.damping_ratios[mode]);
        let unless_rigid = |mode: usize, value: f64| if w(mode) > 0.0 { value } else { 0.0 };
        let largest = |mode: usize| {
            let shape = modes.shapes.column(mode);
            (0..modes.rows() / 3).map(|node| shape.fixed_rows::<3>(3 * node).norm()).fold(0.0, f64::max)
        };
        Self {
            rates: of(&|mode| ratio(mode) * w(mode)),
            per_frequencies: of(&|mode| unless_rigid(mode, 1.0 / (w(mode) * (1.0 - ratio(mode) * ratio(mode)).sqrt()))),
            per_squares: of(&|mode| unless_rigid(mode, 1.0 / (w(mode) * w(mode)))),
            frequencies: of(&|mode| if w(mode) > 0.0 { w(mode) } else { RIGID }),
            shapes: of(&largest),
            vibrates: of(&|mode| unless_rigid(mode, 1.0)),
        }
    }
}

/// See [`ContactRows::find_amplitudes`].
struct FindAmplitudes<'a> {
    bounds: &'a ModeBounds,
    state: [&'a [f64]; 2],
    forces: Option<[&'a [f64]; MOST]>,
    step: f64,
    amplitudes: &'a mut [f64],
}

impl Kernel for FindAmplitudes<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { bounds, state, forces, step, amplitudes } = self;
        let count = state[0].len();
        let amplitudes = &mut amplitudes[..count];
        let [q, v] = state.map(|values| &values[..count]);
        let (rates, per_frequencies) = (&bounds.rates[..count], &bounds.per_frequencies[..count]);
        let (per_squares, vibrates) = (&bounds.per_squares[..count], &bounds.vibrates[..count]);
        let size = |q: f64, turned: f64| {
            let (q, turned) = (q.abs(), turned.abs());
            // At most 8 % above √(q² + turned²).
            q.max(turned) + (std::f64::consts::SQRT_2 - 1.0) * q.min(turned)
        };
        let Some(forces) = forces else {
            for mode in 0..count {
                amplitudes[mode] =
                    vibrates[mode] * size(q[mode], (v[mode] + rates[mode] * q[mode]) * per_frequencies[mode]);
            }
            return;
        };
        let [one, two, three] = forces.map(|values| &values[..count]);
        let (per_step, per_square_step) = (1.0 / step, 1.0 / (step * step));
        for mode in 0..count {
            // Subtract the steady motion under the forces: it is a polynomial of degree 2, which cubics represent exactly.
            let (rate, per_square, last) = (rates[mode], per_squares[mode], three[mode] * per_square_step);
            let quadratic = last * per_square;
            let linear = (two[mode] * per_step - 4.0 * rate * quadratic) * per_square;
            let position = q[mode] - (one[mode] - 2.0 * rate * linear - 2.0 * quadratic) * per_square;
            let turned = (v[mode] - linear + rate * position) * per_frequencies[mode];
            amplitudes[mode] = vibrates[mode] * size(position, turned) + (1.0 - vibrates[mode]) * (2.0 * last.abs());
        }
    }
}

/// See [`ContactRows::interpolation_error`].
struct SumErrors<'a> {
    bounds: &'a ModeBounds,
    length: f64,
    amplitudes: &'a [f64],
}

impl OctetKernel for SumErrors<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Octet>(self) -> f64 {
        let Self { bounds: ModeBounds { shapes, frequencies, .. }, length, amplitudes } = self;
        let mut sums = [0.0; PADDED];
        let modes = amplitudes.chunks_exact(PADDED).zip(shapes.chunks_exact(PADDED));
        for ((amplitudes, shapes), frequencies) in modes.zip(frequencies.chunks_exact(PADDED)) {
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum += shapes[i] * amplitudes[i] * relative_error(frequencies[i] * length);
            }
        }
        sums.iter().sum()
    }
}

/// Returns a bound on the error of the cubic between two times, relative to the amplitude of a mode whose phase advances by `phase` (rad).
#[inline(always)]
fn relative_error(phase: f64) -> f64 {
    let square = phase * phase;
    // The motion is bounded by the amplitude, and a cubic with its rates at both ends exceeds the amplitude only a little.
    (square * square * (1.0 / 384.0)).min(2.0 + 0.3 * phase)
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
            lowest_frequency: modes.frequencies.iter().copied().fold(f64::INFINITY, f64::min),
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

    /// Returns the lowest frequency of the modes (rad/s).
    pub(crate) fn lowest_frequency(&self) -> f64 {
        self.lowest_frequency
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

    /// Finds upper bounds on the amplitudes of all modes about their steady motion in a step of length `step` (s), for
    /// [`Self::interpolation_error`]. `forces` are the modal forces as coefficients of θᵃ; `None` if no force acts. A rigid-body mode counts as
    /// a mode of [`RIGID`] with the same fourth derivative. Returns a bound on the distance between the displacement of any node and the straight
    /// line between both ends (m), if `is_straight` is true, and otherwise [`Self::interpolation_error`] of the step.
    pub(crate) fn find_amplitudes(
        &self,
        step: f64,
        state: &SectorState,
        forces: Option<[&[f64]; MOST]>,
        is_straight: bool,
        amplitudes: &mut [f64],
    ) -> f64 {
        let state = [&state.position[..], &state.velocity];
        self.instructions.run(FindAmplitudes { bounds: &self.mode_bounds, state, forces, step, amplitudes });
        if is_straight {
            self.distance_from_line(step, forces, amplitudes)
        } else {
            self.interpolation_error(step, amplitudes)
        }
    }

    /// Returns a bound on the distance (m) between the displacement of any node and the straight line between both ends of a step.
    fn distance_from_line(&self, step: f64, forces: Option<[&[f64]; MOST]>, amplitudes: &[f64]) -> f64 {
        let (bounds, square) = (&self.mode_bounds, step * step);
        let mut distance = 0.0;
        for (mode, amplitude) in amplitudes.iter().enumerate() {
            let force = |term: usize| forces.map_or(0.0, |forces| forces[term][mode].abs());
            let (frequency, shape) = (bounds.frequencies[mode], bounds.shapes[mode]);
            distance += shape
                * if bounds.vibrates[mode] == 0.0 {
                    (force(0) + force(1) + force(2)) * (0.125 * square)
                } else {
                    let phase = frequency * step;
                    amplitude * (0.125 * phase * phase).min(2.0) + 0.25 * force(2) * bounds.per_squares[mode]
                };
        }
        distance
    }

    /// Returns an upper bound on the error (m) of the cubics that interpolate displacements and velocities of the nodes between two times at a
    /// distance of `length` (s). `amplitudes` are those of [`Self::find_amplitudes`].
    pub(crate) fn interpolation_error(&self, length: f64, amplitudes: &[f64]) -> f64 {
        self.instructions.run_octets(SumErrors { bounds: &self.mode_bounds, length, amplitudes })
    }

    /// Finds the same bounds for each row (m).
    pub(crate) fn interpolation_errors(&self, length: f64, amplitudes: &[f64], sums: &mut Sums<1>) {
        let ([errors], [rows]) = (&mut sums.coefficients, &mut sums.rows);
        for (error, (amplitude, frequency)) in
            errors.iter_mut().zip(amplitudes.iter().zip(&self.mode_bounds.frequencies))
        {
            *error = amplitude * relative_error(*frequency * length);
        }
        self.add_up(&self.magnitudes, [errors], [rows]);
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
    use crate::math::vector::Vector3;
    use crate::time::galerkin::advance::Advance;
    use crate::time::galerkin::basis::real;
    use tiprub_test_models::SeededRandom;

    /// Cubics through displacements and velocities at both ends of a part of a step stay within their bound, also under forces and for
    /// rigid-body modes. Straight lines between the ends of the step stay within theirs.
    #[test]
    fn interpolation_errors_are_bounded() {
        let mut random = SeededRandom(21);
        let mut largest = [0.0_f64; 2];
        for case in 0..400 {
            let count = 1 + random.below(4);
            let frequency = |random: &mut SeededRandom| if random.below(6) == 0 { 0.0 } else { random.scale(1e3, 1e6) };
            let frequencies: Vec<f64> = (0..count).map(|_| frequency(&mut random)).collect();
            let vibrates = frequencies.iter().all(|frequency| *frequency > 0.0);
            let damping_ratios = vec![if vibrates { random.of(&[0.0, 0.02, 0.3]) } else { 0.0 }; count];
            let modes = ContactModes {
                frequencies,
                damping_ratios,
                shapes: random.matrix(3, count),
                residual: DMatrix::zeros(3, 3),
            };
            let (step, parts) = (random.scale(1e-7, 1e-4), random.of(&[1, 2, 8]));
            let of_length = |length: f64| {
                let mut level = StepTables::new(&modes, 2);
                level.set_step(&modes, length);
                level
            };
            let (rows, whole, fine) = (ContactRows::new(&modes), of_length(step), of_length(step / 64.0));
            let mut state = SectorState::new(count, 1);
            state.position.iter_mut().for_each(|q| *q = random.signed());
            state.velocity.iter_mut().for_each(|v| *v = 1e5 * random.signed());
            let mut advance = Advance::new(count, 1);
            let force = [0, 1, 2].map(|_| 1e10 * Vector3::from_fn(|_, _| random.signed()));
            let acts = random.below(2) == 0;
            advance.set_forces(&rows, |_| acts.then_some(force));
            let line_bound = advance.find_amplitudes(&rows, &state, whole.step, 1);
            let length = step / f64::from(parts);
            let cubic_bound = advance.interpolation_error(&rows, length);
            let mut path = Vec::new();
            for part in 0..=64 {
                let of = |modes: &[f64]| rows.at_node(0, modes);
                path.push([of(&state.position), of(&state.velocity)]);
                if part < 64 {
                    advance.advance_part(&fine, &mut state, part, 64);
                }
            }
            let apart = 64 / usize::try_from(parts).unwrap();
            for (index, [moved, _]) in path.iter().enumerate() {
                let first = (index / apart * apart).min(64 - apart);
                let t = real(index - first) / real(apart);
                let ([from, start], [to, end]) = (path[first], path[first + apart]);
                let (start, end, rise) = (length * start, length * end, to - from);
                let bend = 3.0 * rise - 2.0 * start - end;
                let cubic = from + t * (start + t * (bend + t * (start + end - 2.0 * rise)));
                let line = path[0][0] + real(index) / 64.0 * (path[64][0] - path[0][0]);
                for (kind, (found, bound)) in [(cubic, cubic_bound), (line, line_bound)].into_iter().enumerate() {
                    let error = (found - moved).norm();
                    let rounding = 1e-12 * (1.0 + moved.norm() + rise.norm() + start.norm());
                    assert!(error <= bound * (1.0 + 1e-9) + rounding, "case {case}, {kind}: {error:e} of {bound:e}");
                    largest[kind] = largest[kind].max(error / (bound + rounding));
                }
            }
        }
        assert!(largest.iter().all(|share| *share > 0.5), "{largest:?}");
    }

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
