//! Effect of a group of contacts on the structure that carries their surfaces, computed with its modes contact by contact.

use super::Structure;
use super::pair::{ContactPair, SurfaceCarrier};
use crate::geometry::Vector3;
use crate::geometry::frame::PolarFrame;
use crate::geometry::surface_spline::motion::largest_length;
use crate::geometry::surface_spline::{ClosestPoint, SurfaceSpline, Weights};
use crate::modes::bank::ModalBank;
use nalgebra::DMatrix;

/// Location at which a contact acts on a structure.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot<'a> {
    /// The surface.
    pub surface: &'a SurfaceSpline,
    /// The structure that carries the surface.
    pub carrier: SurfaceCarrier,
    /// Place on the surface.
    pub place: ClosestPoint,
    /// Directions of the contact node.
    pub frame: PolarFrame,
}

impl Spot<'_> {
    /// Returns the weights of the control points around the place, and the first row of each.
    pub fn rows(&self) -> (Weights, [usize; 16]) {
        let weights = self.surface.weights(self.place);
        (weights, weights.indices.map(|point| self.carrier.first_row + 3 * point as usize))
    }

    /// Interpolates values per row of the carrier, in the directions of the contact node.
    pub fn interpolate(&self, value: impl Fn(usize) -> f64) -> Vector3 {
        let mut sum = Vector3::zeros();
        for (index, weight) in self.surface.weights(self.place).iter() {
            let row = self.carrier.first_row + 3 * index;
            sum += weight * Vector3::new(value(row), value(row + 1), value(row + 2));
        }
        self.frame.local(sum)
    }

    /// Writes the modal components along a direction of the contact node, from those along x, y, z.
    pub fn components(&self, direction: Vector3, seen: [&[f64]; 3], to: &mut [f64]) {
        let ([x, y, z], [a, b, c]) = (seen, self.frame.fixed(direction).into());
        for (((to, x), y), z) in to.iter_mut().zip(x).zip(y).zip(z) {
            *to = a * x + b * y + c * z;
        }
    }
}

/// Scratch memory of a group for one structure that carries surfaces.
#[derive(Debug, Clone)]
pub struct Reaction {
    /// The structure.
    pub structure: usize,
    /// Contacts of the group that act on the structure.
    members: Vec<usize>,
    /// Modal components at the contacts along the rows and columns of the Delassus matrix.
    rows: Vec<f64>,
    columns: Vec<f64>,
    /// Modal components at one place along x, y, z.
    seen: [Vec<f64>; 3],
    /// Modal forces, or modal displacements per unit force.
    force: Vec<f64>,
    /// Displacement of the rows of the structure by the forces of a solution (m).
    response: Vec<f64>,
}

/// A structure that carries surfaces has a single sector.
fn bank(structure: &Structure) -> &ModalBank {
    structure.bank().unwrap_or_else(|| unreachable!("a structure that carries surfaces has one sector"))
}

impl Reaction {
    /// Allocates memory for up to `contacts` simultaneous contacts with `directions` directions each.
    pub fn new(structure: usize, of: &Structure, contacts: usize, directions: usize) -> Self {
        let (modes, rows) = (bank(of).modes(), bank(of).rows());
        Self {
            structure,
            members: Vec::with_capacity(contacts),
            rows: vec![0.0; contacts * directions * modes],
            columns: vec![0.0; contacts * directions * modes],
            seen: std::array::from_fn(|_| vec![0.0; modes]),
            force: vec![0.0; modes],
            response: vec![0.0; rows],
        }
    }

    /// Removes all contacts.
    pub fn clear(&mut self) {
        self.members.clear();
    }

    /// Projects the modes on the gap and force directions of contact `member` of the group. The contact acts on this
    /// structure.
    pub fn see(&mut self, of: &Structure, member: usize, spot: Spot, normals: &[Vector3], forces: &[Vector3]) {
        self.members.push(member);
        let bank = bank(of);
        let (modes, (weights, rows)) = (bank.modes(), spot.rows());
        for (component, seen) in self.seen.iter_mut().enumerate() {
            seen.fill(0.0);
            for (first, weight) in rows[..weights.len].iter().zip(weights.values) {
                let shapes = bank.contact_row(first + component);
                seen.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum += weight * shape);
            }
        }
        let seen = self.seen.each_ref().map(|seen| &seen[..]);
        for (directions, target) in [(normals, &mut self.rows), (forces, &mut self.columns)] {
            for (index, direction) in directions.iter().enumerate() {
                let target = &mut target[(member * directions.len() + index) * modes..][..modes];
                spot.components(*direction, seen, target);
            }
        }
    }

    /// Adds the part of this structure to the Delassus matrix (m/N) of a group with `per` directions per contact.
    pub(crate) fn add_delassus(&mut self, of: &Structure, matrix: &mut DMatrix<f64>, per: usize) {
        let modes = self.force.len();
        for at in 0..self.members.len() {
            for column in per * self.members[at]..per * (self.members[at] + 1) {
                let shapes = &self.columns[column * modes..][..modes];
                for ((moved, shape), k) in self.force.iter_mut().zip(shapes).zip(bank(of).coefficients(0)) {
                    *moved = k.compliance * shape;
                }
                for row in self.members.iter().flat_map(|member| per * member..per * (member + 1)) {
                    let shapes = self.rows[row * modes..][..modes].iter();
                    matrix[(row, column)] += shapes.zip(&self.force).map(|(shape, moved)| shape * moved).sum::<f64>();
                }
            }
        }
    }

    /// Computes the modal force −Σ F_j λ_j of a solution with `per` directions per contact.
    fn gather(&mut self, multipliers: &[f64], per: usize) {
        let modes = self.force.len();
        self.force.fill(0.0);
        let columns = self.members.iter().flat_map(|member| per * member..per * (member + 1));
        for (column, value) in columns.map(|column| (column, multipliers[column])) {
            if value != 0.0 {
                let shapes = &self.columns[column * modes..][..modes];
                self.force.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum -= value * shape);
            }
        }
    }

    /// Adds the displacements of the structure's rows under the forces of a solution.
    pub fn respond(&mut self, of: &mut Structure, multipliers: &[f64], per: usize) {
        self.gather(multipliers, per);
        if self.members.is_empty() {
            self.response.fill(0.0);
        } else {
            of.modes_mut().response_to_modal(&self.force, &mut self.response);
        }
    }

    /// Displacement of a place caused by the last [`Reaction::respond`], in the directions of the node (m).
    pub(crate) fn responded(&self, spot: Spot) -> Vector3 {
        spot.interpolate(|row| self.response[row])
    }

    /// Upper bound of the displacement of the surface of a pair by the last [`Reaction::respond`] (m).
    pub(crate) fn surface_motion(&self, pair: &ContactPair) -> f64 {
        let (Some(carrier), Some(surface)) = (pair.carrier(), pair.gap().spline()) else { return 0.0 };
        let rows = &self.response[carrier.first_row..][..3 * surface.control_points().len()];
        surface.amplification() * largest_length(rows)
    }

    /// Applies the forces of the solution passed to the last [`Reaction::respond`].
    pub fn apply(&self, of: &mut Structure) {
        of.delayed.copy_from_slice(&self.force);
        if !self.members.is_empty() {
            of.modes_mut().correct_modal(&self.force, &self.response);
        }
    }
}
