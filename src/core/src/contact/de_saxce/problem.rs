//! The contact problem in units scaled for each contact, and its residual.
//!
//! Contact i is scaled by a unit σ_i, a power of two near the square root of its largest flexibility: r̂ = σ r, û = u/σ, Ŵ_ij = W_ij/(σ_i
//! σ_j). Normal and tangents share the unit, so that Coulomb's law keeps its form and µ; the diagonal becomes of order one, and scaling
//! causes no rounding.

use nalgebra::DMatrix;

use super::linear::AddColumns;
use super::one_contact::{self, length};
use crate::math::simd::InstructionSet;

/// Fraction of the unit diagonal by which one contact is softened about its current reaction: fixed points are unchanged, and blocks
/// without full rank have a unique next reaction.
const LOCAL_PROXIMAL: f64 = 1e-10;

/// Terms of a displacement beyond this multiple of the prediction do not permit a larger residual: forces that cancel each other, of a node
/// that is pinched and cannot yield, must not count as a solution because they are large.
const LARGEST_TERMS: f64 = 1e5;

/// A problem of `size` contacts in scaled variables; entries contact by contact (normal, tangent 1, tangent 2).
#[derive(Debug, Clone)]
pub(super) struct ScaledProblem {
    pub(super) size: usize,
    /// Ŵ by columns, 3·size rows.
    matrix: Vec<f64>,
    /// Predicted relative displacements û.
    pub(super) free: Vec<f64>,
    pub(super) friction: Vec<f64>,
    unit: Vec<f64>,
    /// r̂.
    pub(super) reaction: Vec<f64>,
    /// û = free + Ŵ r̂, kept up to date by the sweeps.
    pub(super) relative: Vec<f64>,
    /// Sum of the magnitudes of the terms of û at the last refresh, but at most `ceiling`.
    magnitude: Vec<f64>,
    ceiling: f64,
    /// Diagonal of Ŵ and predicted displacements while the problem is softened.
    hard: (Vec<f64>, Vec<f64>),
    pub(super) instructions: InstructionSet,
}

impl ScaledProblem {
    pub(super) fn new(capacity: usize) -> Self {
        let order = 3 * capacity;
        Self {
            size: 0,
            matrix: vec![0.0; order * order],
            free: vec![0.0; order],
            friction: vec![0.0; capacity],
            unit: vec![1.0; capacity],
            reaction: vec![0.0; order],
            relative: vec![0.0; order],
            magnitude: vec![0.0; order],
            ceiling: 0.0,
            hard: (vec![0.0; order], vec![0.0; order]),
            instructions: InstructionSet::detect(),
        }
    }

    /// Number of scalar unknowns.
    pub(super) fn order(&self) -> usize {
        3 * self.size
    }

    /// Loads a problem; the warm start is projected on the cones. Returns false if a value is not finite.
    pub(super) fn load(&mut self, delassus: &DMatrix<f64>, free: &[f64], friction: &[f64], warm: &[f64]) -> bool {
        let order = self.order();
        for contact in 0..self.size {
            let largest = (3 * contact..3 * contact + 3).fold(0.0, |most: f64, k| most.max(delassus[(k, k)]));
            self.unit[contact] = unit(largest);
            self.friction[contact] = if friction[contact] < 0.0 { 0.0 } else { friction[contact] };
        }
        for column in 0..order {
            let across = 1.0 / self.unit[column / 3];
            for contact in 0..self.size {
                let factor = across / self.unit[contact];
                for row in 3 * contact..3 * contact + 3 {
                    self.matrix[column * order + row] = delassus[(row, column)] * factor;
                }
            }
        }
        for k in 0..order {
            let warm = warm[k] * self.unit[k / 3];
            self.reaction[k] = if warm.is_finite() { warm } else { 0.0 };
            self.free[k] = free[k] / self.unit[k / 3];
        }
        for contact in 0..self.size {
            self.project(contact);
        }
        self.ceiling = LARGEST_TERMS * self.largest_prediction();
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        finite(&self.matrix[..order * order]) && finite(&self.free[..order]) && finite(&self.friction[..self.size])
    }

    /// Largest predicted displacement of the contacts that penetrate, or of all if none does.
    fn largest_prediction(&self) -> f64 {
        let contacts = self.free[..self.order()].chunks_exact(3);
        let largest = |most: f64, contact: &[f64]| contact.iter().fold(most, |most, value| most.max(value.abs()));
        let closed = contacts.clone().filter(|contact| contact[0] < 0.0).fold(0.0, largest);
        if closed > 0.0 { closed } else { contacts.fold(0.0, largest) }
    }

    /// Writes reactions (N) and relative displacements (m).
    pub(super) fn store(&self, reactions: &mut [f64], relative: &mut [f64]) {
        for k in 0..self.order() {
            reactions[k] = self.reaction[k] / self.unit[k / 3];
            relative[k] = self.relative[k] * self.unit[k / 3];
        }
    }

    /// Replaces Ŵ by Ŵ + αI and the prediction such that the current reactions give the same û as before.
    pub(super) fn soften(&mut self, alpha: f64) {
        let order = self.order();
        for k in 0..order {
            (self.hard.0[k], self.hard.1[k]) = (self.matrix[k * order + k], self.free[k]);
            self.matrix[k * order + k] += alpha;
            self.free[k] -= alpha * self.reaction[k];
        }
    }

    /// Reverts `soften`, to the last bit.
    pub(super) fn harden(&mut self) {
        let order = self.order();
        for k in 0..order {
            (self.matrix[k * order + k], self.free[k]) = (self.hard.0[k], self.hard.1[k]);
        }
    }

    /// Ŵ(row, column).
    pub(super) fn entry(&self, row: usize, column: usize) -> f64 {
        self.matrix[column * self.order() + row]
    }

    /// Inverse stiffness of the normal and of the tangents in the residual: the diagonal of Ŵ.
    pub(super) fn flexibility(&self, contact: usize) -> (f64, f64) {
        let k = 3 * contact;
        let normal = self.entry(k, k).max(f64::EPSILON);
        (normal, self.entry(k + 1, k + 1).max(self.entry(k + 2, k + 2)).max(f64::EPSILON))
    }

    /// Replaces the reaction of a contact by the nearest one in its cone.
    pub(super) fn project(&mut self, contact: usize) {
        let k = 3 * contact;
        let (friction, normal) = (self.friction[contact], self.reaction[k]);
        let tangential = length([self.reaction[k + 1], self.reaction[k + 2]]);
        if tangential <= friction * normal {
            return;
        }
        let along = (normal + friction * tangential) / (1.0 + friction * friction);
        let factor = if along > 0.0 && tangential > 0.0 { friction * along / tangential } else { 0.0 };
        self.reaction[k] = along.max(0.0);
        self.reaction[k + 1] *= factor;
        self.reaction[k + 2] *= factor;
    }

    pub(super) fn carries(&self, contact: usize) -> bool {
        self.reaction[3 * contact..3 * contact + 3].iter().any(|value| *value != 0.0)
    }

    /// Returns the number of contacts with a reaction.
    pub(super) fn count_carrying(&self) -> usize {
        (0..self.size).filter(|contact| self.carries(*contact)).count()
    }

    /// Recomputes û and the magnitudes of its terms from the reactions.
    pub(super) fn refresh(&mut self) {
        let order = self.order();
        self.relative[..order].copy_from_slice(&self.free[..order]);
        for k in 0..order {
            self.magnitude[k] = self.free[k].abs();
        }
        for contact in 0..self.size {
            if !self.carries(contact) {
                continue;
            }
            let factors = std::array::from_fn(|k| self.reaction[3 * contact + k]);
            let columns = &self.matrix[3 * contact * order..(3 * contact + 3) * order];
            self.instructions.run(AddColumns::<false> { columns, factors, target: &mut self.relative[..order] });
            self.instructions.run(AddColumns::<true> { columns, factors, target: &mut self.magnitude[..order] });
        }
        for magnitude in &mut self.magnitude[..order] {
            *magnitude = magnitude.min(self.ceiling);
        }
    }

    /// Computes `target += Ŵ · direction`.
    pub(super) fn add_product(&self, direction: &[f64], target: &mut [f64]) {
        let order = self.order();
        for contact in 0..self.size {
            let factors: [f64; 3] = std::array::from_fn(|k| direction[3 * contact + k]);
            if factors.iter().any(|factor| *factor != 0.0) {
                let columns = &self.matrix[3 * contact * order..(3 * contact + 3) * order];
                self.instructions.run(AddColumns::<false> { columns, factors, target });
            }
        }
    }

    /// Solves every contact exactly once while the others are held; `relaxation` is the fraction of the change that is applied.
    pub(super) fn sweep(&mut self, backward: bool, relaxation: f64) {
        for step in 0..self.size {
            self.visit(if backward { self.size - 1 - step } else { step }, relaxation);
        }
    }

    fn visit(&mut self, contact: usize, relaxation: f64) {
        let (k, order) = (3 * contact, self.order());
        if self.relative[k] >= 0.0 && !self.carries(contact) {
            return;
        }
        let columns = &self.matrix[k * order..(k + 3) * order];
        let mut block: [[f64; 3]; 3] =
            std::array::from_fn(|row| std::array::from_fn(|column| columns[column * order + k + row]));
        for (diagonal, row) in block.iter_mut().enumerate() {
            row[diagonal] += LOCAL_PROXIMAL;
        }
        let old: [f64; 3] = std::array::from_fn(|i| self.reaction[k + i]);
        let without = std::array::from_fn(|i| {
            self.relative[k + i] - (block[i][0] * old[0] + block[i][1] * old[1] + block[i][2] * old[2])
        });
        let new = one_contact::solve(&block, without, self.friction[contact]);
        let factors: [f64; 3] = std::array::from_fn(|i| relaxation * (new[i] - old[i]));
        if factors.iter().all(|factor| *factor == 0.0) {
            return;
        }
        for i in 0..3 {
            self.reaction[k + i] = if relaxation < 1.0 { old[i] + factors[i] } else { new[i] };
        }
        self.instructions.run(AddColumns::<false> { columns, factors, target: &mut self.relative[..order] });
    }

    /// Largest residual of all contacts; infinite if a value is NaN.
    pub(super) fn residual(&self) -> f64 {
        let all = (0..self.size).map(|contact| self.contact_residual(contact));
        all.fold(0.0, |worst: f64, value| if value.is_nan() { f64::INFINITY } else { worst.max(value) })
    }

    /// Residual of Signorini's and Coulomb's law at one contact, as fractions of the terms of u and r.
    fn contact_residual(&self, contact: usize) -> f64 {
        let k = 3 * contact;
        let (normal, tangent) = self.flexibility(contact);
        let (r, u) = (&self.reaction[k..k + 3], &self.relative[k..k + 3]);
        let scale = [self.magnitude[k], self.magnitude[k + 1].max(self.magnitude[k + 2])];
        let opening = share((normal * r[0]).min(u[0]).abs(), scale[0]);
        let limit = tangent * self.friction[contact] * r[0];
        let trial = [tangent * r[1] - u[1], tangent * r[2] - u[2]];
        let size = length(trial);
        if size <= limit {
            return opening.max(share(length([u[1], u[2]]), scale[1]));
        }
        let shrink = limit / size;
        let off = length([tangent * r[1] - shrink * trial[0], tangent * r[2] - shrink * trial[1]]);
        opening.max(share(off, shrink * scale[1]))
    }
}

fn share(value: f64, whole: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value / whole }
}

/// Returns a power of two near the square root of the flexibility; 1 for a contact without flexibility.
fn unit(flexibility: f64) -> f64 {
    if flexibility.is_finite() && flexibility >= f64::MIN_POSITIVE {
        libm::scalbn(1.0, libm::ilogb(flexibility).div_euclid(2))
    } else {
        1.0
    }
}
