//! Contact laws: the forces of one group of coupled contacts for given predicted gaps and Delassus matrix. Each law has
//! a variant of `Law` and, if an importer may choose it, an item in the enumeration of solvers.
//!
//! Each law owns its matrix, its unknowns and its state. The group fills in the Delassus matrix W = C_Nᵀ A⁻¹ C_NT along the directions of
//! the law, poses the contacts one after the other, and calls the law's solver.

pub mod active_set;
mod coated;
pub mod coating;
mod coulomb;
pub mod de_saxce;
mod proximal;
mod sliding;

use std::ops::{Deref, DerefMut};

use nalgebra::DMatrix;

use crate::contact::active_set::SolverOutcome;
use crate::contact::coating::Coating;
use crate::geometry::Sliding;
use crate::math::vector::{Vector3, tangents};
use crate::scene::method::Solver;
use crate::scene::settings::ContactSettings;
use coated::Coated;
use coulomb::Coulomb;
use sliding::{Film, Lcp, SlidingLaw};

/// Parameters of the law of a contact pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactParameters {
    /// Friction coefficient µ (-).
    pub friction: f64,
    /// Ratio of the tangential to the normal force when a coating is cut (-); 0 without a coating.
    pub cutting: f64,
}

impl ContactParameters {
    /// Contact without friction and coating.
    pub const FRICTIONLESS: Self = Self { friction: 0.0, cutting: 0.0 };

    /// Returns the parameters of a contact of a scene.
    pub(crate) fn new(settings: &ContactSettings) -> Self {
        let cutting = settings.coating.and_then(|coating| coating.cutting);
        Self { friction: settings.friction, cutting: cutting.map_or(0.0, |cut| 1.0 / cut.normal_ratio) }
    }
}

/// Gaps and compliances of contacts before their forces are known.
pub(crate) trait ContactPrediction {
    /// Parameters of the law.
    fn parameters(&self) -> &ContactParameters;
    /// Predicted gap (m).
    fn gap(&self) -> f64;
    /// Returns whether the contact was closed before, at this depth below the surface (m): the first guess.
    fn was_closed(&self, depth: f64) -> bool;
    /// Unit normal (own directions of the node).
    fn normal(&self) -> Vector3;
    /// Predicted slip over the step, including rigid motion (m, own directions of the node).
    fn slip(&self) -> Vector3;
    /// Contact force of the last step (N, own directions).
    fn last_force(&self) -> Vector3;
    /// Predicted sliding (own directions).
    fn sliding(&self) -> Sliding;
    /// Sector of the node.
    fn sector(&self) -> usize;
    /// Angle of the node on the casing (rad, fixed frame).
    fn angle(&self) -> f64;
}

/// Interface of every contact law. Slices are along the columns of the Delassus matrix or have one entry per contact.
pub(crate) trait ContactLaw {
    /// Directions per contact in the Delassus matrix: 1 (normal, with sliding friction in the columns) or 3 (normal and tangents).
    fn directions(&self) -> usize {
        1
    }
    /// Returns whether contacts are detected again after a solution that opens them or lets them penetrate. The rule of
    /// the paper detects contacts only once per step.
    fn is_iterative(&self) -> bool {
        true
    }
    /// Returns whether the law starts from the contact forces of the last step.
    fn starts_from_forces(&self) -> bool {
        false
    }
    /// Fills the directions of a contact in the Delassus matrix: the rows, along which the law needs its motion, and
    /// the columns, along which its multipliers act.
    fn fill_directions(&self, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3])
    where
        Self: Sized;
    /// Begins a group of `size` contacts.
    fn begin(&mut self, size: usize);
    /// Begins a problem that differs from the last one in its predictions only. Returns false if the matrix must be filled in again: then
    /// call [`ContactLaw::begin`].
    fn begin_with_same_matrix(&mut self) -> bool {
        false
    }
    /// Delassus matrix (m/N), to be filled.
    fn matrix(&mut self) -> &mut DMatrix<f64>;
    /// Adds contact `contact` of the group to the problem, in order; `directions` are its rows of the matrix.
    fn pose(&mut self, contact: usize, directions: &[Vector3], at: &impl ContactPrediction)
    where
        Self: Sized;
    /// Solves for the forces of all posed contacts.
    fn solve(&mut self) -> SolverOutcome;
    /// Multipliers along the columns (N).
    fn multipliers(&self) -> &[f64];
    /// Corrected gaps (m).
    fn gaps(&self) -> &[f64];
    /// Parts of the normal forces that a coating carries (N); empty without a coating.
    fn coating_shares(&self) -> &[f64] {
        &[]
    }
    /// The coating of the law.
    fn coating(&self) -> Option<&Coating> {
        None
    }
    /// The coating of the law, for changes of its wear.
    fn coating_mut(&mut self) -> Option<&mut Coating> {
        None
    }
    /// Applies the wear of the last solution and returns the energy that the wear consumes (J). For a coating that is
    /// cut, the energy is known only later.
    fn commit(&mut self) -> f64 {
        0.0
    }
}

/// A law with its unknowns. It dereferences to [`ContactLaw`], the interface of all laws.
#[derive(Debug, Clone)]
pub(crate) enum Law {
    /// Forward-increment Lagrange multipliers: penetration detected once, equality there.
    Film(SlidingLaw<Film>),
    /// Complementarity on all contacts.
    Lcp(SlidingLaw<Lcp>),
    /// Complementarity with stick and slip.
    Coulomb(Coulomb),
    /// Contact with an abradable coating.
    Coated(Coated),
}

/// Evaluates the same expression for every law.
macro_rules! each_law {
    ($self:expr, $law:ident => $call:expr) => {
        match $self {
            Law::Film($law) => $call,
            Law::Lcp($law) => $call,
            Law::Coulomb($law) => $call,
            Law::Coated($law) => $call,
        }
    };
}

impl Deref for Law {
    type Target = dyn ContactLaw;

    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        each_law!(self, law => law)
    }
}

impl DerefMut for Law {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Self::Target {
        each_law!(self, law => law)
    }
}

impl Law {
    /// Allocates for groups of up to `contacts` contacts; on a coating for whole blades.
    pub fn new(solver: Solver, coating: Option<Coating>, contacts: usize) -> Self {
        match (coating, solver) {
            (Some(coating), _) => Self::Coated(Coated::new(coating, contacts)),
            (None, Solver::Film) => Self::Film(SlidingLaw::new(contacts)),
            (None, Solver::Lcp) => Self::Lcp(SlidingLaw::new(contacts)),
            (None, Solver::Coulomb) => Self::Coulomb(Coulomb::new(contacts)),
        }
    }

    /// Calls [`ContactLaw::fill_directions`] for all contacts; `rows` and `columns` are those of the matrix.
    #[inline(always)]
    pub(crate) fn fill_all<P: ContactPrediction>(
        &self,
        rows: &mut [Vector3],
        columns: &mut [Vector3],
        contacts: impl Iterator<Item = P>,
    ) {
        each_law!(self, law => fill_all(law, rows, columns, contacts));
    }

    /// Calls [`ContactLaw::pose`] for all contacts; `rows` are all rows of the matrix.
    #[inline(always)]
    pub(crate) fn pose_all<P: ContactPrediction>(&mut self, rows: &[Vector3], contacts: impl Iterator<Item = P>) {
        each_law!(self, law => pose_all(law, rows, contacts));
    }
}

/// Adds all contacts of one law to its contact problem. This function is not inlined, because the code of all laws in
/// one caller would exceed the instruction cache.
#[inline(never)]
fn pose_all<L: ContactLaw, P: ContactPrediction>(law: &mut L, rows: &[Vector3], contacts: impl Iterator<Item = P>) {
    let directions = law.directions();
    for (contact, at) in contacts.enumerate() {
        law.pose(contact, &rows[directions * contact..][..directions], &at);
    }
}

/// Fills the directions of all contacts of one law.
#[inline(always)]
fn fill_all<L: ContactLaw, P: ContactPrediction>(
    law: &L,
    rows: &mut [Vector3],
    columns: &mut [Vector3],
    contacts: impl Iterator<Item = P>,
) {
    let directions = law.directions();
    for (contact, at) in contacts.enumerate() {
        let span = directions * contact..directions * (contact + 1);
        law.fill_directions(&at, &mut rows[span.clone()], &mut columns[span]);
    }
}

/// Fills row n and column n − µt of a contact that slides along t, with a friction coefficient µ that may depend on the speed (m/s).
#[inline(always)]
fn fill_sliding(
    at: &impl ContactPrediction,
    coefficient: impl Fn(&ContactParameters, f64) -> f64,
    rows: &mut [Vector3],
    columns: &mut [Vector3],
) {
    (rows[0], columns[0]) = (at.normal(), at.normal());
    if at.parameters().friction > 0.0 {
        let Sliding { direction, speed } = at.sliding();
        columns[0] -= coefficient(at.parameters(), speed) * direction;
    }
}

/// Fills rows and columns n, t₁, t₂ of a contact whose tangential force may have any direction.
fn fill_tangents(at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
    let normal = at.normal();
    let [first, second] = tangents(normal);
    rows.copy_from_slice(&[normal, first, second]);
    columns.copy_from_slice(rows);
}
