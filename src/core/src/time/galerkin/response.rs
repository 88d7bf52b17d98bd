//! Exact responses of modes over a step to forces that are polynomials in time.

use super::basis::{MOST, POINTS, TimeBasis, real};
use crate::math::octet::{Octet, OctetKernel};
use crate::math::simd::InstructionSet;

/// Modal state and force: q, q̇, and the coefficients p_a of θᵃ of the modal force.
pub const TERMS: usize = 2 + MOST;
/// Number of modes whose responses are computed together.
pub(crate) const GROUP: usize = 8;

/// Solution of q̈ + 2ξωq̇ + ω²q = Σ p_a θᵃ over one step, linear in (q, q̇, p₀, p₁, p₂) at its start.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ModalResponse {
    /// q at the end.
    pub position: [f64; TERMS],
    /// q̇ at the end.
    pub velocity: [f64; TERMS],
    /// ∫θʲ q dθ, j = 0, 1.
    pub moments: [[f64; TERMS]; 2],
    /// Damping loss 2ξω∫q̇² dt, a symmetric form (J).
    pub loss: [[f64; TERMS]; TERMS],
}

/// Indices of the state vector (q, w, p, p′, p″, ∫q, ∫∫q); see [`ComputeResponses`].
const POSITION: usize = 0;
const SPEED: usize = 1;
const FORCE: usize = 2;
const INTEGRAL: usize = FORCE + MOST;
const DOUBLE: usize = INTEGRAL + 1;
const STATES: usize = DOUBLE + 1;

/// Number of terms of the Taylor series. The first omitted term is below 1e-22 of the flow, because the rates have norms of at most ½.
const SERIES: u8 = 18;

/// First nonzero column of each row of the flow, and the column after the last one.
const NONZERO: [[usize; 2]; STATES] = [[0, 5], [0, 5], [2, 5], [3, 5], [4, 5], [0, 6], [0, 7]];

impl ModalResponse {
    /// Computes the responses of modes with angular frequencies ω (rad/s; 0 for a rigid-body mode) and damping ratios ξ over a step h (s).
    /// The response of a mode does not depend on the other modes.
    pub fn compute(frequencies: [f64; GROUP], damping_ratios: [f64; GROUP], step: f64) -> [Self; GROUP] {
        InstructionSet::detect().run_octets(ComputeResponses { frequencies, damping_ratios, step })
    }

    /// Coefficients of (q, q̇, p_a) in q at point i = 1 … s, for the polynomial of degree s that preserves both end values and
    /// the moments up to s − 2.
    pub(crate) fn at_points(&self, basis: &TimeBasis) -> [[f64; TERMS]; MOST] {
        let s = basis.degree;
        let moment = |j: usize, i: usize| -> f64 {
            basis.monomials[i].iter().enumerate().map(|(a, c)| c / real(a + j + 1)).sum()
        };
        let mut at = [[0.0; TERMS]; MOST];
        at[s - 1] = self.position;
        for (term, end) in self.position.iter().enumerate() {
            let start = f64::from(u8::from(term == 0));
            let left = |j: usize| self.moments[j][term] - moment(j, 0) * start - moment(j, s) * end;
            match s {
                2 => at[0][term] = left(0) / moment(0, 1),
                3 => {
                    let [[a, b], [c, d]] = [0, 1].map(|j| [moment(j, 1), moment(j, 2)]);
                    let (first, second, determinant) = (left(0), left(1), a * d - b * c);
                    at[0][term] = (d * first - b * second) / determinant;
                    at[1][term] = (a * second - c * first) / determinant;
                }
                _ => {}
            }
        }
        at
    }
}

/// Converts coefficients of θᵃ to coefficients of the forces at the points.
pub(crate) fn by_points(terms: &[f64; TERMS], basis: &TimeBasis) -> [f64; POINTS] {
    std::array::from_fn(|k| (0..basis.degree).map(|a| terms[2 + a] * basis.projection[a][k]).sum())
}

/// Computes responses from the flow (state-transition matrix) E of the state (q, w, p and its derivatives with respect to θ, ∫q, ∫∫q),
/// where w = q̇h/κ and κ = max(ωh, 1).
///
/// Over a short part of the step, Taylor series give E and the quadratic form W of ∫w² dθ (C. F. Van Loan, IEEE Trans. Automatic
/// Control 23, 1978). The part is then doubled until it is the whole step: E becomes E², and W becomes W + EᵀWE. The series of W contains
/// e^(2ξωt). Over the whole step, this factor would amplify rounding errors of strongly damped modes.
struct ComputeResponses {
    frequencies: [f64; GROUP],
    damping_ratios: [f64; GROUP],
    step: f64,
}

/// Nonzero entries of a = `part`·A, where A contains the rates of change of the state with respect to θ.
struct Rates<L> {
    /// Length of the part as a fraction of the step; also the entries in the rows of p and of the integrals of q, and in the row of w and
    /// the column of p.
    part: L,
    /// Entry in the row of q and the column of w.
    swing: L,
    /// Entries in the row of w, in the columns of q and w.
    restoring: L,
    damping: L,
}

impl<L: Octet> Rates<L> {
    /// Returns a·S.
    #[inline(always)]
    fn times(&self, s: &[[L; STATES]; STATES]) -> [[L; STATES]; STATES] {
        let mut product = [[L::zero(); STATES]; STATES];
        for i in 0..STATES {
            product[POSITION][i] = self.swing * s[SPEED][i];
            product[SPEED][i] = self.restoring * s[POSITION][i] + self.damping * s[SPEED][i] + self.part * s[FORCE][i];
            for a in 1..MOST {
                product[FORCE + a - 1][i] = self.part * s[FORCE + a][i];
            }
            product[INTEGRAL][i] = self.part * s[POSITION][i];
            product[DOUBLE][i] = self.part * s[INTEGRAL][i];
        }
        product
    }

    /// Returns −aᵀS for the states without the integrals of q.
    #[inline(always)]
    fn transposed_times(&self, s: &[[L; TERMS]; TERMS]) -> [[L; TERMS]; TERMS] {
        let mut product = [[L::zero(); TERMS]; TERMS];
        for i in 0..TERMS {
            product[POSITION][i] = L::zero() - self.restoring * s[SPEED][i];
            product[SPEED][i] = L::zero() - (self.swing * s[POSITION][i] + self.damping * s[SPEED][i]);
            product[FORCE][i] = L::zero() - self.part * s[SPEED][i];
            for a in 1..MOST {
                product[FORCE + a][i] = L::zero() - self.part * s[FORCE + a - 1][i];
            }
        }
        product
    }
}

/// Returns E².
#[inline(always)]
fn square<L: Octet>(flow: &[[L; STATES]; STATES]) -> [[L; STATES]; STATES] {
    let mut square = [[L::zero(); STATES]; STATES];
    for row in 0..STATES {
        for k in NONZERO[row][0]..NONZERO[row][1] {
            for column in NONZERO[k][0]..NONZERO[k][1] {
                square[row][column] = square[row][column] + flow[row][k] * flow[k][column];
            }
        }
    }
    square
}

/// Returns the form W + EᵀWE of twice the time, for a symmetric form W.
#[inline(always)]
fn double_duration<L: Octet>(form: &[[L; TERMS]; TERMS], flow: &[[L; STATES]; STATES]) -> [[L; TERMS]; TERMS] {
    let mut product = [[L::zero(); TERMS]; TERMS];
    for row in 0..TERMS {
        for k in 0..TERMS {
            for column in NONZERO[k][0]..NONZERO[k][1] {
                product[row][column] = product[row][column] + form[row][k] * flow[k][column];
            }
        }
    }
    let mut sum = *form;
    for row in 0..TERMS {
        for column in row..TERMS {
            // The flow is zero below the diagonal, except in the block of q and w.
            for k in 0..=row.max(SPEED) {
                sum[row][column] = sum[row][column] + flow[k][row] * product[k][column];
            }
            sum[column][row] = sum[row][column];
        }
    }
    sum
}

impl OctetKernel for ComputeResponses {
    type Output = [ModalResponse; GROUP];

    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "iterators over these arrays do not stay in registers")]
    fn run<L: Octet>(self) -> [ModalResponse; GROUP] {
        let Self { frequencies, damping_ratios, step } = self;
        let (mut angle, mut kappa, mut doublings) = ([0.0; GROUP], [1.0; GROUP], [0_u32; GROUP]);
        let (mut part, mut damping, mut loss) = ([1.0; GROUP], [0.0; GROUP], [0.0; GROUP]);
        for i in 0..GROUP {
            angle[i] = frequencies[i] * step;
            kappa[i] = angle[i].max(1.0);
            damping[i] = 2.0 * damping_ratios[i] * angle[i];
            loss[i] = damping[i] * kappa[i] * kappa[i] / (step * step);
            // Halve the step until the magnitudes in each row and column of the rates add up to at most ½.
            let mut largest = kappa[i] + damping[i] + 1.0;
            while largest > 0.5 && largest.is_finite() {
                (doublings[i], part[i], largest) = (doublings[i] + 1, 0.5 * part[i], 0.5 * largest);
            }
        }
        let (part, angle, kappa) = (L::read(&part), L::read(&angle), L::read(&kappa));
        let rates = Rates {
            part,
            swing: part * kappa,
            restoring: L::zero() - part * (angle * angle / kappa),
            damping: L::zero() - part * L::read(&damping),
        };
        let is_damped = loss.iter().any(|loss| *loss != 0.0);
        let mut flow = [[L::zero(); STATES]; STATES];
        let mut form = [[L::zero(); TERMS]; TERMS];
        for state in 0..STATES {
            flow[state][state] = L::splat(1.0);
        }
        // Horner's scheme for the series of E and of ∫e^(−aᵀ(1 − t)) Q e^(at) dt over 0 ≤ t ≤ 1. Q has one entry: `part` at (w, w).
        for n in (1..=SERIES).rev() {
            let inverse = L::splat(1.0 / f64::from(n));
            if is_damped {
                let mut next = rates.transposed_times(&form);
                for column in 0..TERMS {
                    next[SPEED][column] = next[SPEED][column] + part * flow[SPEED][column];
                }
                for row in 0..TERMS {
                    for column in 0..TERMS {
                        form[row][column] = next[row][column] * inverse;
                    }
                }
            }
            let next = rates.times(&flow);
            for row in 0..STATES {
                for column in NONZERO[row][0]..NONZERO[row][1] {
                    flow[row][column] = next[row][column] * inverse;
                }
                flow[row][row] = flow[row][row] + L::splat(1.0);
            }
        }
        // W is Eᵀ times this integral. Averaging with the transpose makes it exactly symmetric.
        let mut integral = [[L::zero(); TERMS]; TERMS];
        for row in 0..TERMS {
            for column in 0..TERMS {
                for k in 0..=row.max(SPEED) {
                    integral[row][column] = integral[row][column] + flow[k][row] * form[k][column];
                }
            }
        }
        for row in 0..TERMS {
            for column in 0..TERMS {
                form[row][column] = (integral[row][column] + integral[column][row]) * L::splat(0.5);
            }
        }
        for done in 0..doublings.into_iter().max().unwrap_or(0) {
            let mask = (0..GROUP).fold(0, |mask, i| mask | u8::from(done < doublings[i]) << i);
            if is_damped {
                let next = double_duration(&form, &flow);
                for row in 0..TERMS {
                    for column in 0..TERMS {
                        form[row][column] = L::select(mask, next[row][column], form[row][column]);
                    }
                }
            }
            let next = square(&flow);
            for row in 0..STATES {
                for column in NONZERO[row][0]..NONZERO[row][1] {
                    flow[row][column] = L::select(mask, next[row][column], flow[row][column]);
                }
            }
        }
        let mut responses = [ModalResponse::default(); GROUP];
        // Columns of (q, q̇, p_a) from those of the state: p has the derivatives a! p_a.
        let [rate_scale, force_scale] = [step, step * step].map(|time| L::splat(time) / kappa);
        let scale = [L::splat(1.0), rate_scale, force_scale, force_scale, L::splat(2.0) * force_scale];
        let (velocity, loss) = (kappa / L::splat(step), L::read(&loss));
        for term in 0..TERMS {
            let entry = |row: usize| flow[row][term] * scale[term];
            let position = entry(POSITION).array();
            let speed = (velocity * entry(SPEED)).array();
            // ∫∫q = ∫(1 − θ)q.
            let moments = [entry(INTEGRAL).array(), (entry(INTEGRAL) - entry(DOUBLE)).array()];
            for (i, response) in responses.iter_mut().enumerate() {
                response.position[term] = position[i];
                response.velocity[term] = speed[i];
                (response.moments[0][term], response.moments[1][term]) = (moments[0][i], moments[1][i]);
            }
            for row in 0..TERMS {
                let lost = (loss * scale[row] * scale[term] * form[row][term]).array();
                responses.iter_mut().zip(lost).for_each(|(response, lost)| response.loss[row][term] = lost);
            }
        }
        responses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fourth-order steps so short that only rounding errors remain.
    fn marched(frequency: f64, ratio: f64, step: f64, start: [f64; TERMS]) -> ([f64; 4], f64) {
        let count = 20_000;
        let h = 1.0 / f64::from(count);
        let [q, v, p @ ..] = start;
        let mut y = [q, v * step, 0.0, 0.0, 0.0];
        let rate = |theta: f64, y: &[f64; 5]| {
            let p = p[0] + theta * (p[1] + theta * p[2]);
            let angle = frequency * step;
            [
                y[1],
                -angle * angle * y[0] - 2.0 * ratio * angle * y[1] + step * step * p,
                y[0],
                theta * y[0],
                2.0 * ratio * frequency * y[1] * y[1] / step,
            ]
        };
        let add = |y: &[f64; 5], k: &[f64; 5], h: f64| -> [f64; 5] { std::array::from_fn(|i| y[i] + h * k[i]) };
        for n in 0..count {
            let theta = f64::from(n) * h;
            let a = rate(theta, &y);
            let b = rate(theta + 0.5 * h, &add(&y, &a, 0.5 * h));
            let c = rate(theta + 0.5 * h, &add(&y, &b, 0.5 * h));
            let d = rate(theta + h, &add(&y, &c, h));
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
        ([y[0], y[1] / step, y[2], y[3]], y[4])
    }

    #[test]
    fn modal_response_satisfies_the_equation_of_motion() {
        for (frequency, ratio) in [(0.0, 0.0), (1.0, 0.02), (3e4, 0.0), (4e4, 0.01), (9e5, 0.005), (9e5, 0.9)] {
            let step = 4e-5;
            let response = ModalResponse::compute([frequency; GROUP], [ratio; GROUP], step)[0];
            let start = [1e-4, -0.3, 2e3, -3e3, 1.5e3];
            let (expected, lost) = marched(frequency, ratio, step, start);
            let of = |row: &[f64; TERMS]| row.iter().zip(start).map(|(a, b)| a * b).sum::<f64>();
            let found =
                [of(&response.position), of(&response.velocity), of(&response.moments[0]), of(&response.moments[1])];
            let scale = [1e-4, 0.3 + frequency * 1e-4, 1e-4, 1e-4];
            for i in 0..4 {
                let error = (found[i] - expected[i]).abs() / scale[i];
                assert!(error < 3e-10, "ω {frequency}: {i}: {} {} {error:e}", found[i], expected[i]);
            }
            let form: f64 = (0..TERMS).map(|i| start[i] * of(&response.loss[i])).sum();
            assert!((form - lost).abs() <= 1e-9 * lost, "ω {frequency}: {form} {lost}");
        }
    }

    #[test]
    fn response_is_independent_of_other_modes() {
        let frequencies = [0.0, 3.0, 2e3, 3e4, 4e5, 9e5, 2e6, 5e4];
        let ratios = [0.0, 0.02, 1e-3, 0.9, 0.0, 5e-3, 0.1, 2.0];
        let together = ModalResponse::compute(frequencies, ratios, 4e-5);
        let kernel = ComputeResponses { frequencies, damping_ratios: ratios, step: 4e-5 };
        assert_eq!(together, InstructionSet::Baseline.run_octets(kernel));
        for (i, response) in together.iter().enumerate() {
            assert_eq!(*response, ModalResponse::compute([frequencies[i]; GROUP], [ratios[i]; GROUP], 4e-5)[i]);
        }
    }

    /// ΔE = ∫p q̇ − loss, with the work computed from the values at the points.
    #[test]
    fn energy_change_equals_work_minus_loss() {
        let mut worst: f64 = 0.0;
        for degree in 1..=MOST {
            let basis = TimeBasis::new(degree);
            for (frequency, ratio) in
                [(0.0, 0.0), (2.0, 0.1), (8e3, 0.01), (6e4, 0.0), (8e5, 0.004), (8e5, 0.3), (8e5, 0.99)]
            {
                let step = 8e-5;
                let response = ModalResponse::compute([frequency; GROUP], [ratio; GROUP], step)[0];
                let forces = [500.0, -200.0, 900.0, 100.0];
                let p: [f64; MOST] =
                    std::array::from_fn(|a| (0..=degree).map(|i| basis.projection[a][i] * forces[i]).sum());
                let start = [2e-5, 0.7, p[0], p[1], p[2]];
                let of = |row: &[f64; TERMS]| row.iter().zip(start).map(|(a, b)| a * b).sum::<f64>();
                let at = response.at_points(&basis);
                let displacement: Vec<f64> = std::iter::once(start[0]).chain(at[..degree].iter().map(of)).collect();
                let work: f64 = (0..=degree)
                    .flat_map(|i| (0..=degree).map(move |k| (i, k)))
                    .map(|(i, k)| forces[i] * basis.work[i][k] * displacement[k])
                    .sum();
                let energy = |q: f64, v: f64| 0.5 * v * v + 0.5 * (frequency * q).powi(2);
                let (before, after) =
                    (energy(start[0], start[1]), energy(of(&response.position), of(&response.velocity)));
                let loss: f64 = (0..TERMS).map(|i| start[i] * of(&response.loss[i])).sum();
                let residual = (after - before - work + loss).abs() / (before + after);
                worst = worst.max(residual);
                assert!(residual < 1e-11, "s {degree}, ω {frequency}: {residual:e}");
            }
        }
        println!("largest residual {worst:e}");
    }
}
