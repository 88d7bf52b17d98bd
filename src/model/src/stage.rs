//! Parametric compressor stage in the size of the paper (section 6.1): 56 blades on a disk, and a casing ring with
//! flanges.

pub mod casing;
mod geometry;
mod lattice;
mod position;
mod reduction;
mod sector;

pub use geometry::{BladeGeometry, DiskGeometry, SectorGeometry};
pub use lattice::{blade_mesh, sector_mesh};
pub use reduction::{StageModel, StageOptions, reduce_stage, stage_model};
pub use sector::{SectorCounts, SectorMesh, SectorOptions};

/// Number of blades and of disk sectors.
pub const SECTORS: usize = 56;
/// Radius of the blade tips (m); the tip contour is a cylinder.
pub const TIP_RADIUS: f64 = 0.35;
/// Clearance between tip and casing (m).
pub const GAP: f64 = 5.0e-4;
/// Axial extent of the blade tip (m).
pub const TIP_AXIAL: [f64; 2] = [-0.016, 0.016];
