//! Contact laws: the forces of one group of coupled contacts for given predicted gaps and Delassus matrix. Each law has a file here, a
//! variant of `Law`, and, if an importer may choose it, a row of the enumeration of solvers.
//!
//! Each law owns its matrix, its unknowns and its state. The group fills in the Delassus matrix W = C_Nᵀ A⁻¹ C_NT along the directions of
//! the law, poses the contacts one after the other, and calls the law's solver.

pub mod active_set;
mod coated;
pub mod coating;
mod coulomb;
mod cutting;
pub mod de_saxce;
mod film;
mod lcp;
mod proximal;

use nalgebra::DMatrix;
use tiprub_cosim::persist::{Persist, StateReader, StateWriter};

use crate::contact::active_set::SolverOutcome;
use crate::contact::coating::Coating;
use crate::math::vector::{Vector3, tangents};
use crate::scene::method::Solver;
pub(crate) use coated::Coated;
pub use coulomb::Coulomb;
pub(crate) use cutting::CuttingLaw;
pub use film::Film;
pub use lcp::Lcp;

/// Gaps and compliances of contacts before their forces are known.
pub(crate) trait ContactPrediction {
    /// Predicted gap (m).
    fn gap(&self) -> f64;
    /// Returns whether the contact was closed before, at this depth below the surface (m): the first guess.
    fn was_closed(&self, depth: f64) -> bool;
    /// Unit normal (own directions of the node).
    fn normal(&self) -> Vector3;
    /// Coulomb coefficient µ (-).
    fn friction(&self) -> f64;
    /// Predicted slip over the step, including rigid motion (m, own directions of the node).
    fn slip(&self) -> Vector3;
    /// Contact force of the last step (N, own directions).
    fn last_force(&self) -> Vector3;
    /// Unit direction of slip (own directions); 0 without slip.
    fn slip_direction(&self) -> Vector3;
    /// Sector of the node.
    fn sector(&self) -> usize;
    /// Angle of the node on the casing (rad, fixed frame).
    fn angle(&self) -> f64;
}

/// Interface of every contact law. Slices are along the columns of the Delassus matrix or have one entry per contact.
pub(crate) trait ContactLaw {
    /// Directions per contact in the Delassus matrix: 1 (normal, with sliding friction in the columns) or 3 (normal and tangents).
    const DIRECTIONS: usize;
    /// True if a contact that the solution would open or press in is checked again; the paper's rule detects once.
    const LOOKS_AGAIN: bool;
    /// True if the law starts from the contact forces of the last step.
    const STARTS_FROM_FORCES: bool = false;
    /// Fills the rows of the Delassus matrix along which the law needs the motion of a contact, and the columns along which its multipliers
    /// push.
    fn fill_directions(at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]);
    /// Begins a group of `size` contacts.
    fn begin(&mut self, size: usize);
    /// Delassus matrix (m/N), to be filled.
    fn matrix(&mut self) -> &mut DMatrix<f64>;
    /// Poses contact `contact` of the group, in order; `directions` are its rows of the matrix.
    fn pose(&mut self, contact: usize, directions: &[Vector3], at: &impl ContactPrediction);
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
}

/// A law with its unknowns.
#[derive(Debug, Clone)]
pub(crate) enum Law {
    /// Forward-increment Lagrange multipliers: penetration detected once, equality there.
    Film(Film),
    /// Complementarity on all contacts.
    Lcp(Lcp),
    /// Complementarity with stick and slip.
    Coulomb(Coulomb),
    /// Complementarity on an abradable coating that is pressed in.
    Coated(Coated),
    /// Complementarity on an abradable coating that is cut.
    Cutting(CuttingLaw),
}

/// Calls the same function of every law.
macro_rules! each_law {
    ($self:expr, $law:ident => $call:expr) => {
        match $self {
            Law::Film($law) => $call,
            Law::Lcp($law) => $call,
            Law::Coulomb($law) => $call,
            Law::Coated($law) => $call,
            Law::Cutting($law) => $call,
        }
    };
}

/// Poses all contacts of one law. Each law has its own instance: all of them inlined in their caller would exceed the instruction cache.
#[inline(never)]
fn pose_all<L: ContactLaw, P: ContactPrediction>(law: &mut L, rows: &[Vector3], contacts: impl Iterator<Item = P>) {
    for (contact, at) in contacts.enumerate() {
        law.pose(contact, &rows[L::DIRECTIONS * contact..][..L::DIRECTIONS], &at);
    }
}

/// Fills row n and column n − µt of a contact that slides along t.
#[inline(always)]
fn fill_sliding(at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
    let (normal, friction) = (at.normal(), at.friction());
    let slip = if friction > 0.0 { at.slip_direction() } else { Vector3::zeros() };
    rows[0] = normal;
    columns[0] = normal - friction * slip;
}

/// Fills rows and columns n, t₁, t₂ of a contact whose tangential force may have any direction.
fn fill_tangents(at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
    let normal = at.normal();
    let [first, second] = tangents(normal);
    rows.copy_from_slice(&[normal, first, second]);
    columns.copy_from_slice(rows);
}

fn fill_directions<L: ContactLaw>(_: &L, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
    L::fill_directions(at, rows, columns);
}

fn directions<L: ContactLaw>(_: &L) -> usize {
    L::DIRECTIONS
}

fn is_iterative<L: ContactLaw>(_: &L) -> bool {
    L::LOOKS_AGAIN
}

fn starts_from_forces<L: ContactLaw>(_: &L) -> bool {
    L::STARTS_FROM_FORCES
}

impl Law {
    /// Allocates for groups of up to `contacts` contacts; on a coating for whole blades.
    pub fn new(solver: Solver, coating: Option<Coating>, contacts: usize) -> Self {
        match (coating, solver) {
            (Some(coating), _) if coating.is_cut() => Self::Cutting(CuttingLaw::new(coating, contacts)),
            (Some(coating), _) => Self::Coated(Coated::new(coating, contacts)),
            (None, Solver::Film) => Self::Film(Film::new(contacts)),
            (None, Solver::Lcp) => Self::Lcp(Lcp::new(contacts)),
            (None, Solver::Coulomb) => Self::Coulomb(Coulomb::new(contacts)),
        }
    }

    /// Returns whether [`Law::new`] would create this law for the solver; a coating has one law.
    pub(crate) fn matches_solver(&self, solver: Solver) -> bool {
        match self {
            Self::Film(_) => solver == Solver::Film,
            Self::Lcp(_) => solver == Solver::Lcp,
            Self::Coulomb(_) => solver == Solver::Coulomb,
            Self::Coated(_) | Self::Cutting(_) => true,
        }
    }

    /// Returns [`ContactLaw::DIRECTIONS`].
    #[inline(always)]
    pub fn directions(&self) -> usize {
        each_law!(self, law => directions(law))
    }

    /// Returns [`ContactLaw::LOOKS_AGAIN`].
    #[inline(always)]
    pub(crate) fn is_iterative(&self) -> bool {
        each_law!(self, law => is_iterative(law))
    }

    /// Returns [`ContactLaw::STARTS_FROM_FORCES`].
    pub(crate) fn starts_from_forces(&self) -> bool {
        each_law!(self, law => starts_from_forces(law))
    }

    /// Calls [`ContactLaw::fill_directions`].
    #[inline(always)]
    pub(crate) fn fill_directions(&self, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        each_law!(self, law => fill_directions(law, at, rows, columns));
    }

    /// Calls [`ContactLaw::begin`].
    #[inline(always)]
    pub fn begin(&mut self, size: usize) {
        each_law!(self, law => law.begin(size));
    }

    /// Calls [`ContactLaw::matrix`].
    #[inline(always)]
    pub fn matrix(&mut self) -> &mut DMatrix<f64> {
        each_law!(self, law => law.matrix())
    }

    /// Calls [`ContactLaw::pose`] for all contacts; `rows` are all rows of the matrix.
    #[inline(always)]
    pub(crate) fn pose_all<P: ContactPrediction>(&mut self, rows: &[Vector3], contacts: impl Iterator<Item = P>) {
        each_law!(self, law => pose_all(law, rows, contacts));
    }

    /// Calls [`ContactLaw::solve`].
    #[inline(always)]
    pub fn solve(&mut self) -> SolverOutcome {
        each_law!(self, law => law.solve())
    }

    /// Calls [`ContactLaw::multipliers`].
    #[inline(always)]
    pub fn multipliers(&self) -> &[f64] {
        each_law!(self, law => law.multipliers())
    }

    /// Calls [`ContactLaw::gaps`].
    #[inline(always)]
    pub fn gaps(&self) -> &[f64] {
        each_law!(self, law => law.gaps())
    }

    /// Calls [`ContactLaw::coating_shares`].
    #[inline(always)]
    pub(crate) fn coating_shares(&self) -> &[f64] {
        each_law!(self, law => law.coating_shares())
    }

    /// Returns the coating of the law.
    pub fn coating(&self) -> Option<&Coating> {
        match self {
            Self::Coated(law) => Some(law.coating()),
            Self::Cutting(law) => Some(law.coating()),
            _ => None,
        }
    }

    /// Returns the coating of the law for changes of its wear.
    pub(crate) fn coating_mut(&mut self) -> Option<&mut Coating> {
        match self {
            Self::Coated(law) => Some(law.coating_mut()),
            Self::Cutting(law) => Some(law.coating_mut()),
            _ => None,
        }
    }

    /// Applies the wear of the last solution; returns the energy it consumes (J); for a coating that is cut this follows later.
    pub fn commit(&mut self) -> f64 {
        match self {
            Self::Coated(law) => law.commit(),
            Self::Cutting(law) => {
                law.commit();
                0.0
            }
            _ => 0.0,
        }
    }
}

/// The state of a law is the wear of its coating.
impl Persist for Law {
    fn save(&self, writer: &mut StateWriter) {
        self.coating().into_iter().for_each(|coating| coating.save(writer));
    }
    fn restore(&mut self, reader: &mut StateReader) {
        self.coating_mut().into_iter().for_each(|coating| coating.restore(reader));
    }
    fn check(&self, reader: &mut StateReader) {
        self.coating().into_iter().for_each(|coating| coating.check(reader));
    }
}
