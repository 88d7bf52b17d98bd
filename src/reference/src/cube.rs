//! The cube between two rings of the paper's section 5: matrices, histories and files. Geometry and meshes are
//! those of [`tiprub_model::cube`].

pub mod calculix;
pub mod files;
pub mod history;
pub mod outside;
pub mod scene;

pub use tiprub_model::cube::{
    CENTRE, CUBE_ELEMENTS, FRICTION, HALF_ARC, INNER_RADIUS, OUTER_RADIUS, RING_ELEMENTS, RingSide, SIDE, START,
    THICKNESS, WIDTH, cube_material, cube_mesh, cube_of, ring_material, ring_mesh, ring_of,
};
