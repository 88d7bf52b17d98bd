//! Coulomb's law for one contact, solved exactly.
//!
//! With A the 3 × 3 Delassus block (normal, tangent 1, tangent 2) and b the relative displacement without the reaction of this contact: u =
//! A r + b, 0 ≤ u_N ⟂ r_N ≥ 0, ‖r_T‖ ≤ µ r_N, and r_T = −µ r_N u_T/‖u_T‖ if u_T ≠ 0. The cases are tried in the order take-off, stick,
//! slide. In sliding u_T = −α r_T with α > 0; eliminating r_N by u_N = 0 yields (S + αI) r_T = −c with the Schur complement S of A_NN, so
//! that with y = adj(S + αI) c and D = det(S + αI) the condition ‖r_T‖ = µ r_N becomes
//!
//! g(α) = µ (A_NT·y − b_N D)/A_NN − ‖y‖ = 0,
//!
//! whose square is the quartic of O. Bonnefon, G. Daviet (INRIA report, 2011, HAL inria-00553859). Outside the stick cone
//! g(0) < 0, and g grows like α² because b_N < 0: a root is always bracketed, and Newton's method polishes it.

/// Largest number of Newton and bisection steps for the sliding root; bisection alone would need about 60.
const ROOT_STEPS: usize = 100;

/// Reaction of one contact: block `a` by rows, displacement `b` without reaction, friction coefficient. A block without normal flexibility
/// (A_NN ≤ 0) has no reaction.
pub(super) fn solve(a: &[[f64; 3]; 3], b: [f64; 3], friction: f64) -> [f64; 3] {
    if b[0] >= 0.0 || a[0][0] <= 0.0 {
        return [0.0; 3];
    }
    if friction <= 0.0 {
        return [-b[0] / a[0][0], 0.0, 0.0];
    }
    let contact = TangentialProblem::new(a, b, friction);
    if let Some(reaction) = contact.stick() {
        return reaction;
    }
    contact.reaction(contact.root())
}

/// One contact after elimination of the normal reaction.
struct TangentialProblem {
    schur: [[f64; 2]; 2],
    right: [f64; 2],
    /// A_NT/A_NN.
    coupling: [f64; 2],
    /// −b_N/A_NN: the normal reaction without tangential reaction.
    alone: f64,
    friction: f64,
}

impl TangentialProblem {
    fn new(a: &[[f64; 3]; 3], b: [f64; 3], friction: f64) -> Self {
        let coupling = [a[0][1] / a[0][0], a[0][2] / a[0][0]];
        let alone = -b[0] / a[0][0];
        let schur = [
            [a[1][1] - a[1][0] * coupling[0], a[1][2] - a[1][0] * coupling[1]],
            [a[2][1] - a[2][0] * coupling[0], a[2][2] - a[2][0] * coupling[1]],
        ];
        let right = [b[1] + a[1][0] * alone, b[2] + a[2][0] * alone];
        Self { schur, right, coupling, alone, friction }
    }

    /// y = adj(S + αI) c and D = det(S + αI).
    fn adjugate(&self, alpha: f64) -> ([f64; 2], f64) {
        let ([[a, b], [c, d]], [x, y]) = (self.schur, self.right);
        let (a, d) = (a + alpha, d + alpha);
        ([d * x - b * y, a * y - c * x], a * d - b * c)
    }

    fn stick(&self) -> Option<[f64; 3]> {
        let (y, determinant) = self.adjugate(0.0);
        if determinant <= 0.0 {
            return None;
        }
        let tangential = [-y[0] / determinant, -y[1] / determinant];
        let normal = self.normal(tangential);
        let inside = normal >= 0.0 && length(tangential) <= self.friction * normal;
        inside.then_some([normal, tangential[0], tangential[1]])
    }

    fn normal(&self, tangential: [f64; 2]) -> f64 {
        self.alone - self.coupling[0] * tangential[0] - self.coupling[1] * tangential[1]
    }

    /// g(α) and its derivative.
    fn excess(&self, alpha: f64) -> (f64, f64) {
        let (y, determinant) = self.adjugate(alpha);
        let size = length(y);
        let coupled = self.coupling[0] * y[0] + self.coupling[1] * y[1];
        let slope = self.coupling[0] * self.right[0] + self.coupling[1] * self.right[1];
        let trace = self.schur[0][0] + self.schur[1][1] + 2.0 * alpha;
        let along = if size > 0.0 { (y[0] * self.right[0] + y[1] * self.right[1]) / size } else { 0.0 };
        (
            self.friction * (self.alone * determinant + coupled) - size,
            self.friction * (self.alone * trace + slope) - along,
        )
    }

    /// Finds the root of g by Newton steps inside a shrinking bracket.
    fn root(&self) -> f64 {
        let far = length(self.right) / (self.friction * self.alone);
        let (mut low, mut high) = (0.0, far.max(self.schur[0][0].abs() + self.schur[1][1].abs()));
        for _ in 0..ROOT_STEPS {
            if self.excess(high).0 > 0.0 {
                break;
            }
            (low, high) = (high, 4.0 * high);
        }
        let mut alpha: f64 = high;
        for _ in 0..ROOT_STEPS {
            let (value, slope) = self.excess(alpha);
            if value < 0.0 {
                low = alpha;
            } else {
                high = alpha;
            }
            let newton = alpha - value / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - alpha).abs() <= 2.0 * f64::EPSILON * next {
                return next;
            }
            alpha = next;
        }
        alpha
    }

    /// Reaction of sliding with u_T = −α r_T, on the cone up to rounding of the last bit.
    fn reaction(&self, alpha: f64) -> [f64; 3] {
        let (y, determinant) = self.adjugate(alpha);
        let size = length(y);
        if size == 0.0 || determinant <= 0.0 {
            return [self.alone, 0.0, 0.0];
        }
        let normal = self.normal([-y[0] / determinant, -y[1] / determinant]);
        let normal = if normal > 0.0 { normal } else { size / (determinant * self.friction) };
        let limit = self.friction * normal / size;
        [normal, -limit * y[0], -limit * y[1]]
    }
}

/// Length of a tangential vector.
pub(super) fn length(vector: [f64; 2]) -> f64 {
    (vector[0] * vector[0] + vector[1] * vector[1]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    /// Relative displacement for a reaction.
    fn relative(a: &[[f64; 3]; 3], b: [f64; 3], r: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| b[i] + a[i][0] * r[0] + a[i][1] * r[1] + a[i][2] * r[2])
    }

    /// Reaction of sliding with force direction θ at u_N = 0, and the moment of u_T about that direction.
    fn slide(a: &[[f64; 3]; 3], b: [f64; 3], friction: f64, theta: f64) -> ([f64; 3], f64, f64) {
        let (sin, cos) = (libm::sin(theta), libm::cos(theta));
        let normal = -b[0] / (a[0][0] + friction * (a[0][1] * cos + a[0][2] * sin));
        let r = [normal, friction * normal * cos, friction * normal * sin];
        let u = relative(a, b, r);
        (r, u[1] * sin - u[2] * cos, u[1] * cos + u[2] * sin)
    }

    /// Finds every solution by trying all three cases and all directions of sliding.
    fn brute_force(a: &[[f64; 3]; 3], b: [f64; 3], friction: f64) -> Vec<[f64; 3]> {
        let mut found = Vec::new();
        if b[0] >= 0.0 {
            found.push([0.0; 3]);
        }
        let matrix = Matrix3::from_fn(|i, j| a[i][j]);
        let stick = matrix.lu().solve(&-Vector3::from(b)).unwrap();
        if stick[0] >= 0.0 && length([stick[1], stick[2]]) <= friction * stick[0] {
            found.push(stick.into());
        }
        let step = std::f64::consts::TAU / 3600.0;
        for index in 0..3600 {
            let (mut low, mut high) = (step * f64::from(index), step * f64::from(index + 1));
            // The moment also changes its sign at a pole of the normal reaction; their product does not.
            let side = |theta: f64| {
                let (r, moment, _) = slide(a, b, friction, theta);
                r[0] * moment > 0.0
            };
            if side(low) == side(high) {
                continue;
            }
            let start = side(low);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                (low, high) = if side(middle) == start { (middle, high) } else { (low, middle) };
            }
            let (r, _, along) = slide(a, b, friction, low);
            if r[0] > 0.0 && r[0].is_finite() && along <= 0.0 {
                found.push(r);
            }
        }
        found
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn solution_matches_one_from_brute_force(
            entries in prop::array::uniform32(-1.0..1.0_f64),
            b in prop::array::uniform3(-1.0..1.0_f64),
            friction in 0.01..2.0_f64,
            stiff in prop::array::uniform3(0.05..1.0_f64),
            slip in 0.01..30.0_f64,
        ) {
            let skew = [0.0, entries[24], entries[25], -entries[24], 0.0, entries[26], -entries[25], -entries[26], 0.0];
            let a: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| {
                let product: f64 = (0..8).map(|k| entries[8 * i + k] * entries[8 * j + k]).sum();
                stiff[i] * stiff[j] * (product + 0.05 * skew[3 * i + j])
            }));
            let b = [b[0], slip * b[1], slip * b[2]];
            let r = solve(&a, b, friction);
            let all = brute_force(&a, b, friction);
            let size = r.iter().fold(1e-300_f64, |most, value| most.max(value.abs()));
            let off = |other: &[f64; 3]| (0..3).map(|i| (r[i] - other[i]).abs()).fold(0.0, f64::max) / size;
            prop_assert!(all.iter().any(|other| off(other) < 1e-6), "{r:?} is none of {all:?}");
            // The law is fulfilled to the last digits.
            let u = relative(&a, b, r);
            let terms: [f64; 3] = std::array::from_fn(|i| b[i].abs() + (0..3).map(|j| (a[i][j] * r[j]).abs()).sum::<f64>());
            prop_assert!(u[0] >= -1e-13 * terms[0] && (r[0] == 0.0 || u[0] <= 1e-13 * terms[0]), "u {u:?}");
            let (r_t, u_t) = (length([r[1], r[2]]), length([u[1], u[2]]));
            prop_assert!(r_t <= friction * r[0] * (1.0 + 1e-15));
            let sideways = length([r[1] * u_t + friction * r[0] * u[1], r[2] * u_t + friction * r[0] * u[2]]);
            prop_assert!(r[0] == 0.0 || sideways <= 1e-11 * friction * r[0] * terms[1].max(terms[2]), "r {r:?}, u {u:?}");
        }
    }

    /// No tangential flexibility: the force is µ times the normal force against the slip, for any ratio of slip to penetration.
    #[test]
    fn solves_sliding_at_vanishing_contact_pressure() {
        let (a, friction) = ([[1.0, 0.5, 0.0], [0.5, 0.25, 0.0], [0.0, 0.0, 0.0]], 0.6);
        for exponent in [0, -9, -30, -50, -70, -90] {
            let pressed = 10.0_f64.powi(exponent);
            let r = solve(&a, [-pressed, 1.0, 0.0], friction);
            // u_N = −p + r_N − 0.5 µ r_N = 0.
            let normal = pressed / (1.0 - 0.5 * friction);
            for (found, expected) in r.into_iter().zip([normal, -friction * normal, 0.0]) {
                assert!((found - expected).abs() <= 1e-14 * normal, "{pressed:e}: {r:?}");
            }
        }
    }

    #[test]
    fn solves_limits_between_open_stick_and_slip() {
        let a = [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(solve(&a, [0.0, 1.0, 1.0], 0.5).map(f64::to_bits), [0.0_f64.to_bits(); 3]);
        // On the edge of the stick cone.
        let r = solve(&a, [-2.0, -0.5, 0.0], 0.5);
        assert!((r[0] - 1.0).abs() < 1e-15 && (r[1] - 0.5).abs() < 1e-15);
        // A slip a million million times the elastic displacement: pure sliding.
        let r = solve(&a, [-2.0, 3e12, 4e12], 0.5);
        assert!((r[0] - 1.0).abs() < 1e-15 && (r[1] + 0.3).abs() < 1e-12 && (r[2] + 0.4).abs() < 1e-12);
        // One mode only: the block has rank one (and beyond µ = 1.79, where sliding locks up, there is no solution).
        let shape = [1.0, 0.5, -0.25];
        let flat: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| shape[i] * shape[j]));
        for friction in [0.0, 0.1, 1.0, 1.5] {
            let r = solve(&flat, [-1.0, 0.3, 0.1], friction);
            let u = relative(&flat, [-1.0, 0.3, 0.1], r);
            assert!(u[0].abs() < 1e-12 && r.iter().all(|value| value.is_finite()), "{r:?} {u:?}");
        }
    }
}
