//! Effect of a group of contacts on the structure that carries their surfaces, computed with its modes contact by contact.

mod kernels;

use super::Structure;
use super::pair::SurfaceCarrier;
use crate::geometry::Vector3;
use crate::geometry::frame::PolarFrame;
use crate::geometry::spline::SplineGap;
use crate::geometry::surface_spline::motion::PatchMotions;
use crate::geometry::surface_spline::{ClosestPoint, SurfaceSpline, Weights};
use crate::math::vector::vector3_at;
use crate::modes::bank::ModalBank;
use crate::modes::bank::predict::Accumulate;
use crate::modes::bank::surface::padded;
use kernels::{AddDelassus, MoveSurface};
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
}

/// A contact on the surface of a structure.
#[derive(Debug, Clone)]
struct Touch {
    /// Index of the contact in the group.
    member: usize,
    /// Control points around it.
    weights: Weights,
    /// First row of each control point.
    firsts: [usize; 16],
    /// Position of each control point among those that the contacts touch.
    slots: [usize; 16],
}

/// Scratch memory of a group for one structure that carries surfaces.
#[derive(Debug, Clone)]
pub struct Reaction {
    /// The structure.
    pub structure: usize,
    /// Contacts of the group that act on the structure.
    touches: Vec<Touch>,
    /// Fixed directions of the rows and columns of the Delassus matrix, in the order of the contacts.
    rows: Vec<Vector3>,
    columns: Vec<Vector3>,
    /// First rows of the control points that the contacts touch, and the position of each row in that list.
    firsts: Vec<usize>,
    slot_of: Vec<usize>,
    /// Displacements of all rows of the structure per unit force along each column (m/N), `[column][row]`.
    moved: Vec<f64>,
    /// The same at the touched control points, `[position][component][column]`.
    seen: Vec<f64>,
    /// Negative multiplier of each column (N).
    factors: Vec<f64>,
    /// Load on the rows of the structure (N).
    load: Vec<f64>,
    /// Modal forces.
    force: Vec<f64>,
    /// Displacement of the rows of the structure by the forces of a solution (m).
    response: Vec<f64>,
    /// Scratch: bounds of the motion of a surface.
    motions: PatchMotions,
}

/// A structure that carries surfaces has a single sector.
fn bank(structure: &Structure) -> &ModalBank {
    structure.bank().unwrap_or_else(|| unreachable!("a structure that carries surfaces has one sector"))
}

impl Reaction {
    /// Allocates memory for up to `contacts` simultaneous contacts with `directions` directions each.
    pub fn new(structure: usize, of: &Structure, contacts: usize, directions: usize) -> Self {
        let (modes, rows) = (bank(of).modes(), bank(of).rows());
        let columns = contacts * directions;
        Self {
            structure,
            touches: Vec::with_capacity(contacts),
            rows: Vec::with_capacity(columns),
            columns: Vec::with_capacity(columns),
            firsts: Vec::with_capacity(rows / 3),
            slot_of: vec![usize::MAX; rows],
            moved: vec![0.0; columns * padded(rows)],
            seen: vec![0.0; padded(columns) * rows],
            factors: Vec::with_capacity(columns),
            load: vec![0.0; rows],
            force: vec![0.0; modes],
            response: vec![0.0; padded(rows)],
            motions: PatchMotions::new(rows / 3),
        }
    }

    /// Removes all contacts.
    pub fn clear(&mut self) {
        for first in self.firsts.drain(..) {
            self.slot_of[first] = usize::MAX;
        }
        self.touches.clear();
        self.rows.clear();
        self.columns.clear();
    }

    /// Adds contact `member` of the group with its gap and force directions. The contact acts on this structure.
    pub fn see(&mut self, member: usize, spot: Spot, normals: &[Vector3], forces: &[Vector3]) {
        let (weights, firsts) = spot.rows();
        let mut slots = [0; 16];
        for (slot, first) in slots.iter_mut().zip(&firsts[..weights.len]) {
            if self.slot_of[*first] == usize::MAX {
                self.slot_of[*first] = self.firsts.len();
                self.firsts.push(*first);
            }
            *slot = self.slot_of[*first];
        }
        self.touches.push(Touch { member, weights, firsts, slots });
        self.rows.extend(normals.iter().map(|normal| spot.frame.fixed(*normal)));
        self.columns.extend(forces.iter().map(|force| spot.frame.fixed(*force)));
    }

    /// Adds the part of this structure to the Delassus matrix (m/N) of a group with `per` directions per contact.
    pub(crate) fn add_delassus(&mut self, of: &mut Structure, matrix: &mut DMatrix<f64>, per: usize) {
        self.firsts.iter().for_each(|first| of.modes_mut().find_columns(*first));
        let (bank, count, width) = (bank(of), self.columns.len(), padded(self.columns.len()));
        let (mut start, stride) = (0, padded(bank.rows()));
        while start < self.touches.len() {
            let first = &self.touches[start];
            let same = |touch: &&Touch| touch.firsts == first.firsts && touch.weights.len == first.weights.len;
            let end = start + self.touches[start..].iter().take_while(same).count();
            let columns = per * start..per * end;
            let moved = &mut self.moved[stride * columns.start..stride * columns.end];
            let (touches, columns) = (&self.touches[start..end], &self.columns[columns]);
            let flexibility = bank.columns();
            bank.instruction_set.run_octets(MoveSurface { touches, columns, per, flexibility, stride, moved });
            start = end;
        }
        for (slot, first) in self.firsts.iter().enumerate() {
            for component in 0..3 {
                let target = &mut self.seen[(3 * slot + component) * width..][..width];
                for (column, value) in target[..count].iter_mut().enumerate() {
                    *value = self.moved[column * stride + first + component];
                }
            }
        }
        let Self { touches, rows, seen, .. } = self;
        bank.instruction_set.run(AddDelassus { touches, rows, per, seen, width, matrix });
    }

    /// Computes the displacements of the rows of the structure by the forces of a solution with `per` directions per contact.
    pub fn respond(&mut self, of: &Structure, multipliers: &[f64], per: usize) {
        self.factors.clear();
        let columns = self.touches.iter().flat_map(|touch| per * touch.member..per * (touch.member + 1));
        self.factors.extend(columns.map(|column| -multipliers[column]));
        self.response.fill(0.0);
        let matrix = &self.moved[..self.factors.len() * self.response.len()];
        let sums = &mut self.response[..];
        bank(of).instruction_set.run(Accumulate { sums, matrix, values: &self.factors });
    }

    /// Displacement of a place of a surface, whose rows begin at `first`, caused by the last [`Reaction::respond`], in fixed directions (m).
    pub(crate) fn moved_at(&self, surface: &SurfaceSpline, place: ClosestPoint, first: usize) -> Vector3 {
        let mut sum = Vector3::zeros();
        for (point, weight) in surface.weights(place).iter() {
            sum += weight * vector3_at(&self.response[first..], point);
        }
        sum
    }

    /// Displacement of a place caused by the last [`Reaction::respond`], in the directions of the node (m).
    pub(crate) fn responded(&self, spot: Spot) -> Vector3 {
        spot.interpolate(|row| self.response[row])
    }

    /// Bounds the displacements that the last [`Reaction::respond`] causes in every patch of a surface (m); `first` is the first row of the
    /// surface.
    pub(crate) fn surface_motions(&mut self, gap: &SplineGap, first: usize) -> &PatchMotions {
        let rows = &self.response[first..][..3 * gap.surface.control_points().len()];
        gap.surface.patch_displacements(|point| vector3_at(rows, point).norm_squared(), &mut self.motions);
        &self.motions
    }

    /// Applies the forces of the solution passed to the last [`Reaction::respond`].
    pub fn apply(&mut self, of: &mut Structure) {
        for first in &self.firsts {
            self.load[*first..first + 3].fill(0.0);
        }
        let per = self.columns.len() / self.touches.len().max(1);
        for (column, (direction, factor)) in self.columns.iter().zip(&self.factors).enumerate() {
            let touch = &self.touches[column / per];
            let points = touch.firsts.iter().zip(&touch.weights.values).take(touch.weights.len);
            for (first, weight) in points.filter(|_| *factor != 0.0) {
                for (load, component) in self.load[*first..first + 3].iter_mut().zip(direction) {
                    *load += factor * weight * component;
                }
            }
        }
        bank(of).modal_force_of(&self.load, &self.firsts, &mut self.force);
        of.delayed.copy_from_slice(&self.force);
        if !self.touches.is_empty() {
            of.modes_mut().correct_modal(&self.force, &self.response);
        }
    }
}
