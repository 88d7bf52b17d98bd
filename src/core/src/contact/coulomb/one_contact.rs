//! Coulomb's law for one contact, solved exactly.
//!
//! With A the 3 × 3 Delassus block (normal, tangent 1, tangent 2) and b the relative displacement without this
//! contact's reaction: u = A r + b, 0 ≤ u_N ⟂ r_N ≥ 0, ‖r_T‖ ≤ µ r_N, and r_T = −µ r_N u_T/‖u_T‖ where u_T ≠ 0.
//! The cases are tried in the order take-off, stick, slide. In sliding u_T = −α r_T with α > 0; eliminating r_N by
//! u_N = 0 leaves (S + αI) r_T = −c with the Schur complement S of A_NN, so that with y = adj(S + αI) c and
//! D = det(S + αI) the condition ‖r_T‖ = µ r_N becomes
//!
//! g(α) = µ (A_NT·y − b_N D)/A_NN − ‖y‖ = 0,
//!
//! whose square is the quartic of O. Bonnefon, G. Daviet (INRIA report 00553859, 2011). Outside the stick cone
//! g(0) < 0, and g grows like α² because b_N < 0: a root is always bracketed, and Newton's method polishes it.

/// Newton and bisection steps of the sliding root; bisection alone would need about 60.
const ROOT_STEPS: usize = 100;

/// Reaction of one contact: block `a` by rows, displacement `b` without reaction, friction coefficient.
/// A block without normal flexibility (A_NN ≤ 0) carries nothing.
pub(super) fn solve(a: &[[f64; 3]; 3], b: [f64; 3], friction: f64) -> [f64; 3] {
    if b[0] >= 0.0 || a[0][0] <= 0.0 {
        return [0.0; 3];
    }
    if friction <= 0.0 {
        return [-b[0] / a[0][0], 0.0, 0.0];
    }
    let contact = Sliding::new(a, b, friction);
    if let Some(reaction) = contact.stick() {
        return reaction;
    }
    contact.reaction(contact.root())
}

/// One contact after elimination of the normal reaction.
struct Sliding {
    schur: [[f64; 2]; 2],
    right: [f64; 2],
    /// A_NT/A_NN.
    coupling: [f64; 2],
    /// −b_N/A_NN: the normal reaction without tangential reaction.
    alone: f64,
    friction: f64,
}

impl Sliding {
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

    /// The root of g: Newton steps kept inside a shrinking bracket.
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

    /// The reaction of a slide with u_T = −α r_T, on the cone to the last bit but rounding.
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
