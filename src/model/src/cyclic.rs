//! Reduction of a structure of identical coupled sectors, one nodal diameter at a time (cyclic symmetry).

mod boundary;
mod component;
mod condense;
mod disk;
mod families;
mod free_interface;
mod lanczos;
mod operator;
mod parallel;
mod quality;
mod reduction;
mod sector;

use nalgebra::Complex;
use tiprub_core::Rom;

use crate::reduce::ReductionKind;
use crate::shapes::SurfaceShapes;

pub use boundary::PairingReport;
pub use disk::{WholeDisk, whole_disk};
pub use families::SMALLEST_GAP;
pub use quality::WHEEL_MODES;
pub use reduction::reduce_cyclic;

/// Pairing of the two faces where a sector meets its neighbours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CyclicBoundary {
    /// Pairs of node indices (low, high): the high node is the low one rotated by +2π/sectors about z.
    pub pairs: Vec<[usize; 2]>,
    /// Number of sectors.
    pub sectors: usize,
}

/// Selection of the modes to keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ModeSelection {
    /// About this many per nodal diameter: all modes below a frequency gap that is common to all nodal diameters. A
    /// family of the blades, whose frequency hardly changes with the nodal diameter, is thus kept at all of them or
    /// at none. A family of the disk, whose frequency rises steeply, is kept where it lies below. Without such a gap
    /// the number is the same at every nodal diameter, and [`CyclicReduction::notes`] contains a note.
    Families(usize),
    /// Exactly this many at every nodal diameter.
    Count(usize),
    /// Modes up to a frequency (Hz).
    UpTo(f64),
}

/// Options of the reduction of coupled sectors.
#[derive(Debug, Clone, PartialEq)]
pub struct CyclicOptions {
    /// Name of the structure.
    pub name: String,
    /// Kind of the modes.
    pub kind: ReductionKind,
    /// Selection of modes.
    pub modes: ModeSelection,
    /// Modes of the full model per nodal diameter that are computed and compared with the reduced ones.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// Full and reduced modes of one nodal diameter.
#[derive(Debug, Clone)]
pub struct NodalDiameter {
    /// Nodal diameter n.
    pub number: usize,
    /// Frequencies of the full model (Hz), ascending. With 0 < 2n < sectors each represents two modes of the disk.
    pub full_frequencies: Vec<f64>,
    /// Frequencies of the reduced model (Hz), in the same number.
    pub reduced_frequencies: Vec<f64>,
    /// Frequency deviation (%), eq. 13.
    pub frequency_deviation: Vec<f64>,
    /// Residual convergence criterion (%), eq. 12.
    pub residual_criterion: Vec<f64>,
    /// Frequencies of the kept modes with the contact held (Hz); for free-interface modes, those of their parts that
    /// move no contact.
    pub fixed_interface_frequencies: Vec<f64>,
    /// Modes of the full model as displacements (x, y, z) of every node of the first sector, mass-normalised for one
    /// sector (1/√kg).
    pub shapes: Vec<Vec<[Complex<f64>; 3]>>,
}

/// Accuracy for one number of modes per nodal diameter, over the lowest modes of the whole disk.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergenceRow {
    /// Modes per nodal diameter η.
    pub modes: usize,
    /// Number of modes of the whole disk.
    pub total_modes: usize,
    /// Frequency deviation (%) of each of the lowest modes of the disk, double modes twice, by ascending frequency.
    pub frequency_deviation: Vec<f64>,
    /// Residual convergence criterion (%) of the same modes.
    pub residual_criterion: Vec<f64>,
}

/// Reduced cyclic structure with the data of its reduction.
#[derive(Debug, Clone)]
pub struct CyclicReduction {
    /// The reduced-order model, checks included.
    pub rom: Rom,
    /// Results of each nodal diameter 0 ..= sectors/2.
    pub nodal_diameters: Vec<NodalDiameter>,
    /// Eqs 12 and 13 against the number of modes, from none to all computed modes.
    pub convergence: Vec<ConvergenceRow>,
    /// Degrees of freedom of one sector that are neither clamped nor dependent on the other face.
    pub free_dofs: usize,
    /// Largest natural angular frequency of the reduced model (rad/s).
    pub largest_angular_frequency: f64,
    /// Notes about the choice of modes.
    pub notes: Vec<String>,
    /// Surface of the mesh of a sector, without its faces to other sectors, with its displacements per reduced
    /// coordinate; `None` without a mesh.
    pub shapes: Option<SurfaceShapes>,
}
