//! Exact response of one mode over a step to a force that is a polynomial in time.

use super::basis::{MOST, POINTS, TimeBasis, real};
use nalgebra::SMatrix;

/// Modal state and force: q, q̇, and the coefficients p_a of θᵃ of the modal force.
pub const TERMS: usize = 2 + MOST;

/// Solution of q̈ + 2ξωq̇ + ω²q = Σ p_a θᵃ over one step, linear in (q, q̇, p₀, p₁, p₂) at its start.
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// Indices of the state vector of the matrix exponential.
const POSITION: usize = 0;
const SPEED: usize = 1;
const FORCE: usize = 2;
const INTEGRAL: usize = FORCE + MOST;
const DOUBLE: usize = INTEGRAL + 1;
const STATES: usize = DOUBLE + 1;
const BOTH: usize = 2 * TERMS;

impl ModalResponse {
    /// Response for angular frequency ω (rad/s; 0 for a rigid-body mode), damping ratio ξ and step h (s).
    ///
    /// The state is (q, q̇h/κ, p and its derivatives with respect to θ, ∫q, ∫∫q) with κ = max(ωh, 1). Its flow is a matrix
    /// exponential (Taylor series, scaling and squaring).
    pub fn new(frequency: f64, damping_ratio: f64, step: f64) -> Self {
        let angle = frequency * step;
        let kappa = angle.max(1.0);
        let mut flow = SMatrix::<f64, STATES, STATES>::zeros();
        flow[(POSITION, SPEED)] = kappa;
        flow[(SPEED, POSITION)] = -angle * angle / kappa;
        flow[(SPEED, SPEED)] = -2.0 * damping_ratio * angle;
        flow[(SPEED, FORCE)] = 1.0;
        for a in 1..MOST {
            flow[(FORCE + a - 1, FORCE + a)] = 1.0;
        }
        flow[(INTEGRAL, POSITION)] = 1.0;
        flow[(DOUBLE, INTEGRAL)] = 1.0;
        let end = exponential(&flow);
        // Columns of (q, q̇, p_a) from those of the state: p has the derivatives a! p_a.
        let forced = step * step / kappa;
        let scale = [1.0, step / kappa, forced, forced, 2.0 * forced];
        let row = |row: usize, factor: f64| -> [f64; TERMS] {
            std::array::from_fn(|term| factor * end[(row, term)] * scale[term])
        };
        let (integral, double) = (row(INTEGRAL, 1.0), row(DOUBLE, 1.0));
        Self {
            position: row(POSITION, 1.0),
            velocity: row(SPEED, kappa / step),
            // ∫∫q = ∫(1 − θ)q.
            moments: [integral, std::array::from_fn(|term| integral[term] - double[term])],
            loss: loss(&flow, 2.0 * damping_ratio * angle * kappa * kappa / (step * step), &scale),
        }
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

/// e^A by scaling to a norm below ½, twenty terms of the series, and squaring. (The version of nalgebra needs the mathematics of
/// the standard library, whose bits depend on the machine.)
fn exponential<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let (halvings, scale) = halvings(matrix);
    let scaled = matrix * scale;
    let identity = SMatrix::identity();
    let series = (1..=20).rev().fold(identity, |sum, n| identity + scaled * sum / real(n));
    (0..halvings).fold(series, |power, _| power * power)
}

/// Returns how often a matrix must be halved until the sums of the magnitudes of its rows are at most ½, and the resulting factor.
fn halvings<const N: usize>(matrix: &SMatrix<f64, N, N>) -> (usize, f64) {
    let mut largest = matrix.row_iter().map(|row| row.iter().map(|entry| entry.abs()).sum()).fold(0.0, f64::max);
    let (mut count, mut scale) = (0, 1.0);
    while largest > 0.5 {
        (count, scale, largest) = (count + 1, 0.5 * scale, 0.5 * largest);
    }
    (count, scale)
}

/// Converts coefficients of θᵃ to coefficients of the forces at the points.
pub(crate) fn by_points(terms: &[f64; TERMS], basis: &TimeBasis) -> [f64; POINTS] {
    std::array::from_fn(|k| (0..basis.degree).map(|a| terms[2 + a] * basis.projection[a][k]).sum())
}

/// `factor`·∫w² dθ of the state w = q̇h/κ. Over a short part of the step, from a matrix exponential (C. F. Van Loan, IEEE Trans. Automatic
/// Control 23, 1978). Over the whole step this exponential would contain e^(2ξωh), and the difference of such numbers would be wrong for
/// strongly damped modes. So the time is doubled: with the flow E over a time, the integral W becomes W + EᵀWE.
fn loss(flow: &SMatrix<f64, STATES, STATES>, factor: f64, scale: &[f64; TERMS]) -> [[f64; TERMS]; TERMS] {
    if factor == 0.0 {
        return [[0.0; TERMS]; TERMS];
    }
    let flow = flow.fixed_view::<TERMS, TERMS>(0, 0).into_owned();
    let (doublings, part) = halvings(&flow);
    let mut block = SMatrix::<f64, BOTH, BOTH>::zeros();
    block.fixed_view_mut::<TERMS, TERMS>(0, 0).copy_from(&(-part * flow.transpose()));
    block.fixed_view_mut::<TERMS, TERMS>(TERMS, TERMS).copy_from(&(part * flow));
    block[(SPEED, TERMS + SPEED)] = part;
    let end = exponential(&block);
    let mut flow = end.fixed_view::<TERMS, TERMS>(TERMS, TERMS).into_owned();
    let mut form = flow.transpose() * end.fixed_view::<TERMS, TERMS>(0, TERMS);
    for _ in 0..doublings {
        form += flow.transpose() * form * flow;
        flow *= flow;
    }
    std::array::from_fn(|i| std::array::from_fn(|k| 0.5 * factor * scale[i] * scale[k] * (form[(i, k)] + form[(k, i)])))
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
            let response = ModalResponse::new(frequency, ratio, step);
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
                let response = ModalResponse::new(frequency, ratio, step);
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
