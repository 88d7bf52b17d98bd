//! Reduction of finite-element meshes to reduced-order models of contact nodes.
//!
//! Floor 1. A [`Mesh`] of the six solid [elements](element) is [assembled](assembly) into sparse stiffness and mass,
//! its lowest modes are found by [shift-invert Lanczos](eigen), and [Craig-Bampton](craig_bampton) reduces it to a
//! small dense pencil in the displacements of the contact nodes: a [`tiprub_core::Rom`] with its checks (eqs 12 and
//! 13 of the paper). [`rotor37`] is the built-in blade, [`casing`] the ring around it, and [`cube`] a benchmark of
//! free bodies and [open surfaces](panel); [`read`] imports user models. Nothing is printed: a caller passes a
//! [listener](progress) and decides what to show. All quantities are in SI units.
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

pub mod assembly;
pub mod casing;
pub mod conduction;
mod contact_point;
pub mod craig_bampton;
pub mod cube;
pub mod cyclic;
pub mod eigen;
pub mod element;
mod error;
pub mod fe_model;
pub(crate) mod free_body;
pub mod free_interface;
pub mod inner_surface;
pub mod inp;
pub mod material;
pub mod mesh;
pub mod ordering;
pub mod panel;
pub mod patches;
mod pattern;
mod places;
pub mod progress;
pub mod quality;
pub mod read;
pub mod reduce;
pub mod rotor37;
pub mod shapes;
pub mod sparse;
pub mod spin;
pub mod stage;
pub mod stress;
pub mod thermal;
pub mod vtk;

pub use casing::{CasingOptions, reduce_casing, reduce_ring};
pub use error::{Error, Result};
pub use fe_model::FeModel;
pub use material::Material;
pub use mesh::{Mesh, surface_quads};
pub use progress::{ReductionProgress, ReductionStage};
pub use reduce::{Reduction, reduce, reduce_model};
pub use rotor37::{Rotor37Options, reduce_rotor37};
pub use shapes::SurfaceShapes;
