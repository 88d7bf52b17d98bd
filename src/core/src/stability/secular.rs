//! Eigenvalues of many oscillators that a few closed contacts hold, as zeros of a small determinant.
//!
//! E(s) = R + (1 + γs) Σ c φ_n φ_fᵀ/(s² + a s + b) maps the forces of k contacts to their gaps, and s is an eigenvalue where E is
//! singular. With the poles p of the oscillators, P(s) = det E(s) Π (s − p) is a polynomial. Its zeros are found together by the
//! iteration of Ehrlich and Aberth (O. Aberth, Mathematics of Computation 27, 1973), each sweep over N modes at a cost of N²k²
//! where a dense eigenvalue problem costs N³ many times over.
//!
//! What was found is then proven: the discs about all zeros z_i with the radii N |P(z_i)|/|P_N Π (z_i − z_j)| hold all zeros of
//! P (B. T. Smith, Journal of the ACM 17, 1970). Rounding of E counts as part of |P|. Where a disc is too large, or a pole is
//! real, nothing is returned.

use super::held::Held;
use nalgebra::Complex;

type Number = Complex<f64>;

/// Largest radius of a disc that holds an eigenvalue, of an accepted result; far below what growth per step is told from rounding.
const RADIUS: f64 = 1e-9;
/// Sweeps until the zeros stand still.
const SWEEPS: usize = 60;
/// A zero that moves by less is found: the iteration is of third order.
const STILL: f64 = 1e-11;
/// Modes of which contact sees less than this share of the largest are apart from it.
const UNSEEN: f64 = 1e-18;
/// A leading coefficient that cancels to less than this share of its terms is not trusted.
const CANCELLED: f64 = 1e-6;

/// Eigenvalues with a positive imaginary part (of each pair one); `None` where they are not proven, or there are more than
/// three contacts.
pub fn eigenvalues(held: &Held) -> Option<Vec<Number>> {
    match held.contacts() {
        1 => Secular::<1>::new(held)?.eigenvalues(),
        2 => Secular::<2>::new(held)?.eigenvalues(),
        3 => Secular::<3>::new(held)?.eigenvalues(),
        _ => None,
    }
}

/// 1/x.
fn inverse(number: Number) -> Number {
    let scale = 1.0 / number.norm_sqr();
    Complex::new(number.re * scale, -number.im * scale)
}

fn size(number: Number) -> f64 {
    number.norm_sqr().sqrt()
}

/// 1/(s − z) + 1/(s − z̄), and 1/((s − z)(s − z̄)).
fn of_pair(s: Number, z: Number) -> (Number, Number) {
    let (down, up) = (s - z, s - z.conj());
    let both = inverse(down * up);
    ((down + up) * both, both)
}

/// Determinant by expansion along rows from `row` on, without the columns of the set `taken`; with `sign` 1 the permanent.
fn expand<const K: usize>(matrix: &[[Number; K]; K], sign: f64, row: usize, taken: usize) -> Number {
    let mut sum = Complex::new(if row == K { 1.0 } else { 0.0 }, 0.0);
    let mut next = 1.0;
    for column in (0..K).filter(|column| row < K && taken >> column & 1 == 0) {
        sum += matrix[row][column] * expand(matrix, sign, row + 1, taken | 1 << column) * next;
        next *= sign;
    }
    sum
}

fn determinant<const K: usize>(matrix: &[[Number; K]; K]) -> Number {
    expand(matrix, -1.0, 0, 0)
}

fn permanent<const K: usize>(matrix: &[[f64; K]; K]) -> f64 {
    expand(&matrix.map(|row| row.map(|value| Complex::new(value, 0.0))), 1.0, 0, 0).re
}

/// The contact problem of K contacts.
struct Secular<const K: usize> {
    /// Upper poles of the modes that contact sees, with c φ_n φ_fᵀ.
    modes: Vec<(Number, [[f64; K]; K])>,
    /// Upper poles of the others, which are eigenvalues.
    apart: Vec<Number>,
    residual: [[f64; K]; K],
    /// γ.
    late: f64,
    /// Leading coefficient of P.
    lead: f64,
    /// Pairs of zeros of P.
    pairs: usize,
}

impl<const K: usize> Secular<K> {
    fn new(held: &Held) -> Option<Self> {
        let mut modes = Vec::with_capacity(held.modes.len());
        let mut largest = 0.0_f64;
        for (mode, [damping, stiffness, weight]) in held.modes.iter().enumerate() {
            let square = stiffness - 0.25 * damping * damping;
            let pole = Complex::new(-0.5 * damping, libm::sqrt(square));
            if !(square > 0.0) {
                return None;
            }
            let entry = |i: usize, j: usize| weight * held.normals[(i, mode)] * held.forces[(j, mode)];
            let seen: [[f64; K]; K] = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
            largest = seen.iter().flatten().fold(largest, |most, value| most.max(value.abs()));
            modes.push((pole, seen));
        }
        let is_seen =
            |(_, seen): &(Number, [[f64; K]; K])| seen.iter().flatten().any(|value| value.abs() > UNSEEN * largest);
        let (mut modes, apart): (Vec<_>, Vec<_>) = modes.into_iter().partition(is_seen);
        modes.sort_by(|a, b| a.0.norm_sqr().total_cmp(&b.0.norm_sqr()));
        let residual =
            std::array::from_fn(|i| std::array::from_fn(|j| held.residual.as_ref().map_or(0.0, |r| r[(i, j)])));
        let pairs = if held.residual.is_some() { modes.len() } else { modes.len().checked_sub(K)? };
        let apart = apart.into_iter().map(|(pole, _)| pole).collect();
        let mut problem = Self { modes, apart, residual, late: held.late, lead: 0.0, pairs };
        let (leading, sizes) = if held.residual.is_some() { (residual, residual) } else { problem.summed() };
        let lead = determinant(&leading.map(|row| row.map(|value| Complex::new(value, 0.0)))).re;
        let size = permanent(&sizes.map(|row| row.map(f64::abs)));
        problem.lead = lead;
        (lead.abs() > CANCELLED * size).then_some(problem)
    }

    /// Σ c φ_n φ_fᵀ, and of the absolute values.
    fn summed(&self) -> ([[f64; K]; K], [[f64; K]; K]) {
        let sum = |of: &dyn Fn(f64) -> f64| {
            std::array::from_fn(|i| std::array::from_fn(|j| self.modes.iter().map(|(_, seen)| of(seen[i][j])).sum()))
        };
        (sum(&|value| value), sum(&f64::abs))
    }

    fn eigenvalues(mut self) -> Option<Vec<Number>> {
        let mut zeros = self.guesses();
        self.refine(&mut zeros);
        let proven = (0..zeros.len()).all(|index| self.radius(&zeros, index) <= RADIUS);
        self.apart.append(&mut zeros);
        proven.then_some(self.apart)
    }

    /// Between the poles, that of zero i so many apart as contacts take modes away; none alike.
    fn guesses(&self) -> Vec<Number> {
        let last = self.modes.len().saturating_sub(1);
        let beyond = self.modes.len().saturating_sub(self.pairs).max(1);
        let guess = |index: usize| {
            let (low, high) = (self.modes[index].0, self.modes[(index + beyond).min(last)].0);
            let middle = if index == last { low * 1.2 } else { (low + high) * 0.5 };
            let (sine, cosine) = libm::sincos(f64::from(u32::try_from(index).unwrap_or(u32::MAX)));
            middle + Complex::new(sine, cosine) * (1e-3 * size(high - low).max(1e-3 * size(middle)))
        };
        (0..self.pairs).map(guess).collect()
    }

    /// P'/P.
    fn slope(&self, s: Number) -> Number {
        let zero = Complex::new(0.0, 0.0);
        let (mut value, mut rate) = ([[zero; K]; K], [[zero; K]; K]);
        let mut poles = zero;
        for (pole, seen) in &self.modes {
            let (pair, both) = of_pair(s, *pole);
            let bent = pair * both;
            poles += pair;
            for i in 0..K {
                for j in 0..K {
                    value[i][j] += both * seen[i][j];
                    rate[i][j] -= bent * seen[i][j];
                }
            }
        }
        let gain = s * self.late + 1.0;
        let mut turned = zero;
        for i in 0..K {
            for j in 0..K {
                rate[i][j] = rate[i][j] * gain + value[i][j] * self.late;
                value[i][j] = value[i][j] * gain + self.residual[i][j];
            }
        }
        for row in 0..K {
            let mut replaced = value;
            replaced[row] = rate[row];
            turned += determinant(&replaced);
        }
        turned * inverse(determinant(&value)) + poles
    }

    /// Ehrlich's and Aberth's iteration.
    fn refine(&self, zeros: &mut [Number]) {
        let mut moving = vec![true; zeros.len()];
        for _ in 0..SWEEPS {
            for index in 0..zeros.len() {
                if !moving[index] {
                    continue;
                }
                let zero = zeros[index];
                let mut slope = self.slope(zero) - inverse(zero - zero.conj());
                for (_, other) in zeros.iter().enumerate().filter(|(other, _)| *other != index) {
                    slope -= of_pair(zero, *other).0;
                }
                let step = inverse(slope);
                let moved = zero - step;
                zeros[index] = Complex::new(moved.re, moved.im.abs());
                moving[index] = step.norm_sqr() > STILL * STILL;
            }
            if !moving.contains(&true) {
                break;
            }
        }
    }

    /// Radius of the disc about a zero; not a number where there is none.
    fn radius(&self, zeros: &[Number], index: usize) -> f64 {
        let s = zeros[index];
        let (mut value, mut sizes) = ([[Complex::new(0.0, 0.0); K]; K], [[0.0; K]; K]);
        let mut ratio = 1.0;
        for (mode, (pole, seen)) in self.modes.iter().enumerate() {
            let (_, both) = of_pair(s, *pole);
            let gain = (s * self.late + 1.0) * both;
            for i in 0..K {
                for j in 0..K {
                    value[i][j] += gain * seen[i][j];
                    sizes[i][j] += size(gain) * seen[i][j].abs();
                }
            }
            ratio /= both.norm_sqr();
            match zeros.get(mode) {
                Some(_) if mode == index => ratio /= (s - s.conj()).norm_sqr(),
                Some(other) => ratio *= of_pair(s, *other).1.norm_sqr(),
                None => {}
            }
        }
        for i in 0..K {
            for j in 0..K {
                value[i][j] += self.residual[i][j];
                sizes[i][j] += self.residual[i][j].abs();
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "mode counts are far below 2^52")]
        let (count, terms) = (2.0 * zeros.len() as f64, (K * (self.modes.len() + 20)) as f64);
        let rounding = terms * f64::EPSILON * permanent(&sizes);
        count * (size(determinant(&value)) + rounding) * ratio.sqrt() / self.lead.abs()
    }
}
