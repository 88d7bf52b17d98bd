//! Bounds on the errors of cubics and straight lines that interpolate motion between two times, from the amplitudes of the modes.

use super::{ContactRows, Sums};
use crate::math::octet::{Octet, OctetKernel};
use crate::math::simd::Kernel;
use crate::modes::coordinates::ContactModes;
use crate::time::galerkin::basis::MOST;
use crate::time::galerkin::kernels::PADDED;
use crate::time::galerkin::state::SectorState;

/// Frequency of the mode whose interpolation error replaces that of a rigid-body mode (rad/s).
const RIGID: f64 = 1.0;

/// Data of all modes for bounds on interpolation errors, padded with zeros.
#[derive(Debug, Clone)]
pub(super) struct ModeBounds {
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
    pub fn new(modes: &ContactModes) -> Self {
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::Vector3;
    use crate::time::galerkin::advance::Advance;
    use crate::time::galerkin::basis::real;
    use crate::time::galerkin::level::StepTables;
    use nalgebra::DMatrix;
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
}
