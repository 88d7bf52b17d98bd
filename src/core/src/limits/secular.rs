//! Eigenvalues of many oscillators that a few closed contacts constrain, as zeros of a small determinant.
//!
//! E(s) = R + (1 + γs) Σ c φ_n φ_fᵀ/(s² + a s + b) maps the forces of k contacts to their gaps, and s is an eigenvalue if E is singular.
//! With the poles p of the oscillators, P(s) = det E(s) Π (s − p) is a polynomial. Its zeros are found together by the iteration of Ehrlich
//! and Aberth (O. Aberth, Mathematics of Computation 27, 1973). Each sweep over N modes costs N²k², whereas a dense eigenvalue problem
//! costs many times N³.
//!
//! The result is then proven: the discs about all zeros z_i with the radii N |P(z_i)|/|P_N Π (z_i − z_j)| contain all zeros of P (B. T.
//! Smith, Journal of the ACM 17, 1970). Rounding of E counts as part of |P|. If a disc is too large nothing is returned.

use super::held::HeldContacts;
use crate::math::argsort;
use nalgebra::{Complex, SMatrix};

type Number = Complex<f64>;
/// A number for each pair of contacts.
type Square<T, const K: usize> = SMatrix<T, K, K>;

/// Largest radius of a disc that contains an eigenvalue, of an accepted result; far below the growth per step that counts as rounding.
const RADIUS: f64 = 1e-9;
/// Largest number of sweeps until the zeros converge; a pair that does not converge is then assumed to be real.
const SWEEPS: usize = 60;
const REAL_AFTER: usize = 15;
/// A zero that moves by less has converged: the iteration is of third order.
const STILL: f64 = 1e-11;
/// Modes whose contact participation is below this fraction of the largest are treated as decoupled.
const UNSEEN: f64 = 1e-18;
/// A leading coefficient that cancels to less than this fraction of its terms is not trusted.
const CANCELLED: f64 = 1e-6;

/// Returns the eigenvalues, one of each complex pair; `None` if they are not proven, or there are more than three contacts.
pub fn eigenvalues(held: &HeldContacts) -> Option<Vec<Number>> {
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

/// Two zeros, complex conjugates or both real.
type ZeroPair = [Number; 2];

/// Zeros of s² + a s + b.
fn roots(a: f64, b: f64) -> ZeroPair {
    let square = b - 0.25 * a * a;
    if square > 0.0 {
        let root = Complex::new(-0.5 * a, square.sqrt());
        return [root, root.conj()];
    }
    let far = -(0.5 * a + (-square).sqrt());
    [far, if far == 0.0 { 0.0 } else { b / far }].map(|real| Complex::new(real, 0.0))
}

/// Returns 1/(s − y) + 1/(s − z), and 1/((s − y)(s − z)).
fn of_pair(s: Number, [y, z]: ZeroPair) -> (Number, Number) {
    let (down, up) = (s - y, s - z);
    let both = inverse(down * up);
    ((down + up) * both, both)
}

/// Determinant by expansion along rows from `row` on, without the columns of the set `taken`; the permanent if `sign` is 1.
fn expand<const K: usize>(matrix: &Square<Number, K>, sign: f64, row: usize, taken: usize) -> Number {
    let mut sum = Complex::new(if row == K { 1.0 } else { 0.0 }, 0.0);
    let mut next = 1.0;
    for column in (0..K).filter(|column| row < K && taken >> column & 1 == 0) {
        sum += matrix[(row, column)] * expand(matrix, sign, row + 1, taken | 1 << column) * next;
        next *= sign;
    }
    sum
}

fn determinant<const K: usize>(matrix: &Square<Number, K>) -> Number {
    expand(matrix, -1.0, 0, 0)
}

fn permanent<const K: usize>(matrix: &Square<f64, K>) -> f64 {
    expand(&matrix.map(|value| Complex::new(value, 0.0)), 1.0, 0, 0).re
}

/// The contact problem of K contacts.
struct Secular<const K: usize> {
    /// Poles of the modes with contact participation, with c φ_n φ_fᵀ.
    modes: Vec<(ZeroPair, Square<f64, K>)>,
    /// Poles of the decoupled modes, which are eigenvalues.
    apart: Vec<Number>,
    residual: Square<f64, K>,
    /// γ.
    late: f64,
    /// Leading coefficient of P.
    lead: f64,
    /// Number of pairs of zeros of P.
    pairs: usize,
}

impl<const K: usize> Secular<K> {
    fn new(held: &HeldContacts) -> Option<Self> {
        let mut modes = Vec::with_capacity(held.modes.len());
        let mut largest = 0.0_f64;
        for (mode, [damping, stiffness, weight]) in held.modes.iter().enumerate() {
            let entry = |i: usize, j: usize| weight * held.normals[(i, mode)] * held.forces[(j, mode)];
            let seen = Square::<f64, K>::from_fn(entry);
            largest = seen.iter().fold(largest, |most, value| most.max(value.abs()));
            modes.push((roots(*damping, *stiffness), seen));
        }
        let is_seen = |(_, seen): &(ZeroPair, Square<f64, K>)| seen.iter().any(|value| value.abs() > UNSEEN * largest);
        let (seen, apart): (Vec<_>, Vec<_>) = modes.into_iter().partition(is_seen);
        let squared_moduli: Vec<f64> = seen.iter().map(|(poles, _)| poles[0].norm_sqr()).collect();
        let modes: Vec<_> = argsort(&squared_moduli).into_iter().map(|mode| seen[mode]).collect();
        let residual = Square::from_fn(|i, j| held.residual.as_ref().map_or(0.0, |residual| residual[(i, j)]));
        let pairs = if held.residual.is_some() { modes.len() } else { modes.len().checked_sub(K)? };
        let apart = apart.into_iter().flat_map(|(poles, _)| poles).collect();
        let mut problem = Self { modes, apart, residual, late: held.late, lead: 0.0, pairs };
        let (leading, sizes) = if held.residual.is_some() { (residual, residual) } else { problem.summed() };
        let lead = determinant(&leading.map(|value| Complex::new(value, 0.0))).re;
        let size = permanent(&sizes.map(f64::abs));
        problem.lead = lead;
        (lead.abs() > CANCELLED * size).then_some(problem)
    }

    /// Σ c φ_n φ_fᵀ, and the sum of its absolute values.
    fn summed(&self) -> (Square<f64, K>, Square<f64, K>) {
        let sum =
            |of: &dyn Fn(f64) -> f64| Square::from_fn(|i, j| self.modes.iter().map(|(_, seen)| of(seen[(i, j)])).sum());
        (sum(&|value| value), sum(&f64::abs))
    }

    fn eigenvalues(mut self) -> Option<Vec<Number>> {
        let mut zeros = self.guesses();
        self.refine(&mut zeros);
        let members = (0..zeros.len()).flat_map(|index| [(index, 0), (index, 1)]);
        for (index, member) in members.filter(|(index, member)| *member == 0 || zeros[*index][1].im == 0.0) {
            let proven = self.radius(&zeros, index, member) <= RADIUS;
            self.apart.push(proven.then_some(zeros[index][member])?);
        }
        Some(self.apart)
    }

    /// Start values between the poles, that of zero i offset by the number of modes that contacts remove; all distinct.
    fn guesses(&self) -> Vec<ZeroPair> {
        let last = self.modes.len().saturating_sub(1);
        let beyond = self.modes.len().saturating_sub(self.pairs).max(1);
        let guess = |index: usize| {
            let (low, high) = (self.modes[index].0[0], self.modes[(index + beyond).min(last)].0[0]);
            let middle = if index == last { low * 1.2 } else { (low + high) * 0.5 };
            let (sine, cosine) = libm::sincos(f64::from(u32::try_from(index).unwrap_or(u32::MAX)));
            let zero = middle + Complex::new(sine, cosine) * (1e-3 * size(high - low).max(1e-3 * size(middle)));
            [zero, zero.conj()]
        };
        (0..self.pairs).map(guess).collect()
    }

    /// 1/(P'/P − `others`), the step of Newton's iteration that avoids the other zeros.
    fn step(&self, s: Number, others: Number) -> Number {
        let zero = Complex::new(0.0, 0.0);
        let (mut value, mut rate) = (Square::<_, K>::repeat(zero), Square::<_, K>::repeat(zero));
        let mut poles = zero;
        for (pole, seen) in &self.modes {
            let (pair, both) = of_pair(s, *pole);
            let bent = pair * both;
            poles += pair;
            value += seen.map(|entry| both * entry);
            rate -= seen.map(|entry| bent * entry);
        }
        let gain = s * self.late + 1.0;
        let mut turned = zero;
        rate = rate.zip_map(&value, |rate, value| rate * gain + value * self.late);
        value = value.zip_map(&self.residual, |value, residual| value * gain + residual);
        for row in 0..K {
            let mut replaced = value;
            replaced.set_row(row, &rate.row(row));
            turned += determinant(&replaced);
        }
        let found = determinant(&value);
        found * inverse(turned + found * (poles - others))
    }

    /// Iterates by the method of Ehrlich and Aberth.
    fn refine(&self, zeros: &mut [ZeroPair]) {
        let mut moving = vec![true; zeros.len()];
        for sweep in 0..SWEEPS {
            for index in (0..zeros.len()).filter(|index| moving[*index]).collect::<Vec<_>>() {
                let first = self.correction(zeros, index, 0);
                let moved = zeros[index][0] - first;
                if zeros[index][0].im == 0.0 {
                    zeros[index][0] = moved;
                    let second = self.correction(zeros, index, 1);
                    zeros[index][1] -= second;
                    moving[index] = size(first) > STILL || size(second) > STILL;
                    continue;
                }
                moving[index] = size(first) > STILL;
                let up = Complex::new(moved.re, moved.im.abs());
                zeros[index] = [up, up.conj()];
                if moving[index] && sweep > REAL_AFTER && up.im < 2.0 * up.re.abs() {
                    zeros[index] = [up.re + up.im, up.re - up.im].map(|real| Complex::new(real, 0.0));
                }
            }
            if !moving.contains(&true) {
                break;
            }
        }
    }

    /// Returns the correction of a member of a pair; a small number if it lies on a pole or on another zero.
    fn correction(&self, zeros: &[ZeroPair], index: usize, member: usize) -> Number {
        let [zero, partner] = [zeros[index][member], zeros[index][1 - member]];
        let mut others = inverse(zero - partner);
        for (_, other) in zeros.iter().enumerate().filter(|(other, _)| *other != index) {
            others += of_pair(zero, *other).0;
        }
        let step = self.step(zero, others);
        if step.re.is_finite() && step.im.is_finite() { step } else { zero * 1e-6 }
    }

    /// Radius of the disc about a zero; NaN if there is none.
    fn radius(&self, zeros: &[ZeroPair], index: usize, member: usize) -> f64 {
        let s = zeros[index][member];
        let (mut value, mut sizes) = (Square::repeat(Complex::new(0.0, 0.0)), Square::<f64, K>::zeros());
        let mut ratio = 1.0;
        for (mode, (pole, seen)) in self.modes.iter().enumerate() {
            let (_, both) = of_pair(s, *pole);
            let gain = (s * self.late + 1.0) * both;
            value += seen.map(|entry| gain * entry);
            sizes += seen.map(|entry| size(gain) * entry.abs());
            ratio /= both.norm_sqr();
            match zeros.get(mode) {
                Some(_) if mode == index => ratio /= (s - zeros[index][1 - member]).norm_sqr(),
                Some(other) => ratio *= of_pair(s, *other).1.norm_sqr(),
                None => {}
            }
        }
        value = value.zip_map(&self.residual, |value, residual| value + residual);
        sizes += self.residual.abs();
        #[expect(clippy::cast_precision_loss, reason = "mode counts are far below 2^52")]
        let (count, terms) = (2.0 * zeros.len() as f64, (K * (self.modes.len() + 20)) as f64);
        let rounding = terms * f64::EPSILON * permanent(&sizes);
        let scale = if ratio.is_normal() { ratio.sqrt() / self.lead.abs() } else { f64::NAN };
        count * (size(determinant(&value)) + rounding) * scale
    }
}
