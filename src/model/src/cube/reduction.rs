//! Reduced-order models of the three bodies.

use super::{CUBE_ELEMENTS, RING_ELEMENTS, RingSide, cube_material, cube_of, ring_material, ring_of};
use crate::fe_model::FeModel;
use crate::free_body::{FreeBodyOptions, reduce_free_body};
use crate::mesh::Mesh;
use crate::panel::{PanelGrid, PanelOptions, reduce_panel};
use crate::patches::face_patches;
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::{ContactPoint, Reduction, ReductionKind};
use crate::{Material, Result};

/// Mass matrix of the finite elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MassMatrix {
    /// Lumped on the nodes: diagonal.
    #[default]
    Lumped,
    /// ∫ ρ NᵀN dV.
    Consistent,
}

/// Options of the reduction of the cube.
#[derive(Debug, Clone, PartialEq)]
pub struct CubeOptions {
    /// Name of the structure.
    pub name: String,
    /// Elements along a side.
    pub elements: usize,
    /// Mass matrix.
    pub mass: MassMatrix,
    /// Patches along y and along z on either face; the nodes of the faces if absent.
    pub patches: Option<[usize; 2]>,
    /// Kind of the modes.
    pub kind: ReductionKind,
    /// Number of modes: with the contact held, or in addition to the rigid-body motions. All if absent, which makes
    /// the reduction exact.
    pub modes: Option<usize>,
    /// Number of modes compared with the full model.
    pub checked_modes: usize,
}

impl Default for CubeOptions {
    fn default() -> Self {
        let name = "cube".to_owned();
        Self {
            name,
            elements: CUBE_ELEMENTS,
            mass: MassMatrix::default(),
            patches: None,
            kind: ReductionKind::FixedInterface,
            modes: None,
            checked_modes: 16,
        }
    }
}

/// Options of the reduction of a ring.
#[derive(Debug, Clone, PartialEq)]
pub struct RingOptions {
    /// Name of the structure.
    pub name: String,
    /// Side of the ring.
    pub side: RingSide,
    /// Elements along radius, width and arc.
    pub elements: [usize; 3],
    /// Mass matrix.
    pub mass: MassMatrix,
    /// Number of modes.
    pub modes: usize,
    /// Number of static responses to contact forces.
    pub static_responses: usize,
    /// Number of modes compared with the full model.
    pub checked_modes: usize,
}

impl RingOptions {
    /// Returns the options of the built-in ring of one side.
    pub fn new(side: RingSide) -> Self {
        Self {
            name: match side {
                RingSide::Left => "ring_left".into(),
                RingSide::Right => "ring_right".into(),
            },
            side,
            elements: RING_ELEMENTS,
            mass: MassMatrix::default(),
            modes: 100,
            static_responses: 0,
            checked_modes: 10,
        }
    }
}

/// Meshes, reduces and checks the cube. Without patches it has 72 contact nodes `left_1` ... and `right_1` ..., line
/// by line along z from the leading face.
///
/// # Errors
/// The errors of `reduce_free_body`.
pub fn reduce_cube(options: &CubeOptions, listener: Listener<'_>) -> Result<Reduction> {
    let mesh = cube_of(options.elements);
    let contact = match options.patches {
        None => master_points(&mesh)?,
        Some(counts) => master_patches(&mesh, counts)?,
    };
    let model = model(mesh, &cube_material(), options.mass, "Benchmark cube between two rings", listener)?;
    let reduction_options = FreeBodyOptions {
        name: options.name.clone(),
        kind: options.kind,
        modes: options.modes,
        checked_modes: options.checked_modes,
        damping_ratio: 0.0,
    };
    reduce_free_body(model, &contact, &reduction_options, listener)
}

/// Meshes, reduces and checks a ring, both ends clamped.
///
/// # Errors
/// The errors of `reduce_panel`.
pub fn reduce_cube_ring(options: &RingOptions, listener: Listener<'_>) -> Result<Reduction> {
    let mesh = ring_of(options.side, options.elements);
    let (clamped, grid) = (mesh.set("CLAMPED")?.to_vec(), ring_grid(options.side, options.elements));
    let origin = "Ring of the benchmark cube between two rings";
    let model = model(mesh, &ring_material(), options.mass, origin, listener)?;
    let reduction_options = PanelOptions {
        name: options.name.clone(),
        modes: options.modes,
        static_responses: options.static_responses,
        checked_modes: options.checked_modes,
        damping_ratio: 0.0,
    };
    reduce_panel(model, &clamped, &grid, &reduction_options, listener)
}

fn model(mesh: Mesh, material: &Material, mass: MassMatrix, origin: &str, listener: Listener<'_>) -> Result<FeModel> {
    report(listener, ReductionStage::Mesh, 1, 1);
    let kind = if mass == MassMatrix::Lumped { "lumped" } else { "consistent" };
    let model = FeModel::assembled(mesh, material, format!("{origin}, {kind} mass"), listener)?;
    if mass == MassMatrix::Lumped { model.lumped() } else { Ok(model) }
}

/// Returns the master nodes of the mesh of a cube: left face, then right.
///
/// # Errors
/// A mesh without the sets of [`cube_of`].
pub(crate) fn master_points(mesh: &Mesh) -> Result<Vec<ContactPoint>> {
    let mut points = Vec::new();
    for (set, name) in [("MASTER_LEFT", "left"), ("MASTER_RIGHT", "right")] {
        points.extend(
            mesh.set(set)?
                .iter()
                .zip(1..)
                .map(|(&node, number)| ContactPoint::at(format!("{name}_{number}"), node, 0.0)),
        );
    }
    Ok(points)
}

/// Returns patches on both faces, `along` by `across`: left face, then right, named like nodes, rows along z from the
/// leading face.
fn master_patches(mesh: &Mesh, [along, across]: [usize; 2]) -> Result<Vec<ContactPoint>> {
    let directions = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
    let mut points = Vec::new();
    for (set, side) in [("MASTER_LEFT", "left"), ("MASTER_RIGHT", "right")] {
        let name = |patch: usize| format!("{side}_{}", patch + 1);
        points.extend(face_patches(mesh, mesh.set(set)?, [across, along], directions, name)?);
    }
    Ok(points)
}

/// Returns the outer nodes of the mesh of a ring as a grid, rows along the arc, by ascending z; the direction of the
/// arc makes the normal point to the cube.
pub fn ring_grid(side: RingSide, [radial, wide, arc]: [usize; 3]) -> PanelGrid {
    let place = |i: usize| if side == RingSide::Left { arc - i } else { i };
    let node = |i: usize, j: usize| (place(i) * (wide + 1) + j) * (radial + 1) + radial;
    PanelGrid { around: arc + 1, nodes: (0..=wide).flat_map(|j| (0..=arc).map(move |i| node(i, j))).collect() }
}
