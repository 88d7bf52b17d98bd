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

pub use boundary::PairingReport;
pub use disk::{WholeDisk, whole_disk};
pub use families::SMALLEST_GAP;
pub use quality::WHEEL_MODES;
pub use reduction::reduce_cyclic;

/// The two faces where a sector meets its neighbours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CyclicBoundary {
    /// Pairs of node indices (low, high): the high node is the low one turned by +2π/sectors about z.
    pub pairs: Vec<[usize; 2]>,
    /// Number of sectors.
    pub sectors: usize,
}

/// Which modes are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ModeSelection {
    /// About this many per nodal diameter: those below a gap of frequency that all nodal diameters leave, so that a
    /// family of the blades, whose frequency hardly changes with the nodal diameter, is there for all of them or for none.
    /// A family of the disk, whose frequency rises steeply, is there as far as it lies below. The same number at every
    /// nodal diameter, and a note in [`CyclicReduction::notes`], where there is no such gap.
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
    /// Which modes are kept.
    pub kind: ReductionKind,
    /// Selection of modes.
    pub modes: ModeSelection,
    /// Modes of the full model per nodal diameter that are computed and compared with the reduced ones.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// One nodal diameter, full and reduced.
#[derive(Debug, Clone)]
pub struct NodalDiameter {
    /// Nodal diameter n.
    pub number: usize,
    /// Frequencies of the full model (Hz), ascending. With 0 < 2n < sectors each stands for two modes of the disk.
    pub full_frequencies: Vec<f64>,
    /// Frequencies of the reduced model (Hz), as many.
    pub reduced_frequencies: Vec<f64>,
    /// Frequency deviation (%), eq. 13.
    pub frequency_deviation: Vec<f64>,
    /// Residual convergence criterion (%), eq. 12.
    pub residual_criterion: Vec<f64>,
    /// Frequencies with the contact held (Hz), those kept; with free-interface modes of what is left of them with the contact held.
    pub fixed_interface_frequencies: Vec<f64>,
    /// Full modes as displacements (x, y, z) of every node of the first sector, mass-normalised for one sector (1/√kg).
    pub shapes: Vec<Vec<[Complex<f64>; 3]>>,
}

/// Quality of one number of modes per nodal diameter, over the lowest modes of the whole disk.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergenceRow {
    /// Modes per nodal diameter η.
    pub modes: usize,
    /// Number of modes of the whole disk.
    pub total_modes: usize,
    /// Frequency deviation (%) of each of the lowest modes of the disk, double ones twice, ascending in frequency.
    pub frequency_deviation: Vec<f64>,
    /// Residual convergence criterion (%) of the same modes.
    pub residual_criterion: Vec<f64>,
}

/// A reduced cyclic structure with what it came from.
#[derive(Debug, Clone)]
pub struct CyclicReduction {
    /// The reduced-order model, checks included.
    pub rom: Rom,
    /// One per nodal diameter 0 ..= sectors/2.
    pub nodal_diameters: Vec<NodalDiameter>,
    /// Eqs 12 and 13 against the number of modes, from none to all that were computed.
    pub convergence: Vec<ConvergenceRow>,
    /// Degrees of freedom of one sector that are neither clamped nor follow from the other face.
    pub free_dofs: usize,
    /// Largest natural angular frequency of the reduced model (rad/s).
    pub largest_angular_frequency: f64,
    /// Notes about the choice of modes.
    pub notes: Vec<String>,
}
