//! Results of a reduction: coordinates in the frame of the contact nodes, the ROM with its origin, shapes for
//! figures.

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomChecks, RomExtras};

use super::{ContactPoint, Mode, Reduction, ReductionKind, ReductionOptions};
use crate::Result;
use crate::craig_bampton::CraigBampton;
use crate::eigen::EigenModes;
use crate::fe_model::FeModel;
use crate::material::Material;
use crate::mesh::Mesh;

/// Returns (cos θ, sin θ) of a point about the z axis.
pub(crate) fn direction([x, y, _]: [f64; 3]) -> (f64, f64) {
    let radius = x.hypot(y);
    (x / radius, y / radius)
}

/// Returns the reduced model with interface displacements in the given frame.
pub(super) fn rotated(
    mut model: CraigBampton,
    nodes: &[[f64; 3]],
    contact: &[ContactPoint],
    frame: DisplacementFrame,
) -> CraigBampton {
    if frame == DisplacementFrame::Cartesian {
        return model;
    }
    let order = model.mass.nrows();
    let mut rotation = DMatrix::<f64>::identity(order, order);
    for (index, point) in contact.iter().enumerate() {
        let (cos, sin) = direction(nodes[point.node]);
        let first = 3 * index;
        // Columns: the Cartesian components of the radial and the tangential unit vector.
        rotation[(first, first)] = cos;
        rotation[(first + 1, first)] = sin;
        rotation[(first, first + 1)] = -sin;
        rotation[(first + 1, first + 1)] = cos;
    }
    let symmetric = |matrix: DMatrix<f64>| 0.5 * (&matrix + matrix.transpose());
    model.mass = symmetric(rotation.transpose() * &model.mass * &rotation);
    model.stiffness = symmetric(rotation.transpose() * &model.stiffness * &rotation);
    model.transformation = &model.transformation * Mat::from_fn(order, order, |i, j| rotation[(i, j)]);
    model
}

pub(crate) fn contact_node(nodes: &[[f64; 3]], point: &ContactPoint, frame: DisplacementFrame) -> ContactNode {
    let position = match frame {
        DisplacementFrame::Cartesian => point.cartesian(nodes),
        DisplacementFrame::Cylindrical => point.cylindrical(nodes),
    };
    let ContactPoint { meridional_slope, area, length, .. } = *point;
    ContactNode { name: point.name.clone(), position, meridional_slope, area, length }
}

/// Names the interface that is held for fixed-interface modes, for the ROM's origin.
pub(crate) fn interface(contact: &[ContactPoint]) -> String {
    let patches = contact.iter().filter(|point| !point.patch.is_empty()).count();
    let of = if patches > 0 { format!(" of {patches} patches{}", in_rows(contact)) } else { String::new() };
    format!("{} interface degrees of freedom{of}", 3 * contact.len())
}

/// Names the static responses besides free-interface modes, for the ROM's origin.
pub(crate) fn responses(contact: &[ContactPoint]) -> String {
    match contact.iter().filter(|point| !point.patch.is_empty()).count() {
        0 => format!("static responses to forces on {} contact nodes", contact.len()),
        patches => format!("static responses to forces on {patches} patches{}", in_rows(contact)),
    }
}

fn in_rows(contact: &[ContactPoint]) -> String {
    ContactPoint::rows(contact).map_or(String::new(), |rows| format!(" in {rows} rows"))
}

/// Describes the full model and the number of its clamped nodes.
pub(crate) fn description(model: &FeModel, clamped: usize) -> String {
    let before = if model.origin.is_empty() { String::new() } else { format!("{}: ", model.origin) };
    let nodes = model.nodes.len();
    let elements = model
        .mesh
        .as_ref()
        .map_or(String::new(), |(mesh, _)| format!(", {} elements ({})", mesh.elements.len(), element_names(mesh)));
    let material = model.mesh.as_ref().map_or(String::new(), |(_, material)| {
        let Material { young_modulus, poisson_ratio, density, .. } = material;
        format!("; E = {young_modulus:e} Pa, nu = {poisson_ratio}, rho = {density} kg/m3")
    });
    format!("{before}{nodes} nodes{elements}, {clamped} nodes clamped{material}")
}

impl Reduction {
    /// Creates the result of a valid reduced model; `full` are the modes of the full model over its `free` dofs,
    /// `squares` all ω² of the reduced one.
    ///
    /// # Errors
    /// The errors of the ROM validation.
    pub(crate) fn new(
        rom: Rom,
        full: &EigenModes,
        free: &[usize],
        squares: &[f64],
        (nodes, mesh): (usize, Option<(Mesh, Material)>),
    ) -> Result<Self> {
        rom.validate()?;
        let (mesh, material) = mesh.unzip();
        Ok(Self {
            rom,
            mesh,
            material,
            nodes,
            modes: node_modes(full, free, nodes),
            largest_residual: full.residuals.iter().copied().fold(0.0, f64::max),
            free_dofs: free.len(),
            reduced_angular_frequencies: squares.iter().map(|square| square.max(0.0).sqrt()).collect(),
            fixed_interface_frequencies: Vec::new(),
            spin_checks: Vec::new(),
            shapes: None,
        })
    }
}

pub(super) fn build_rom(
    full: &FeModel,
    clamped: usize,
    contact: &[ContactPoint],
    options: &ReductionOptions,
    model: &CraigBampton,
    checks: RomChecks,
) -> Rom {
    let (boundary, order) = (3 * contact.len(), model.mass.nrows());
    let (before, modes) = (description(full, clamped), order - boundary);
    let origin = match options.kind {
        ReductionKind::FixedInterface => {
            let interface = interface(contact);
            format!("{before}; Craig-Bampton with {interface} and {modes} fixed-interface modes")
        }
        ReductionKind::FreeInterface => {
            format!("{before}; {} and {modes} free-interface modes", responses(contact))
        }
    };
    Rom {
        name: options.name.clone(),
        origin,
        sectors: options.sectors,
        frame: options.frame,
        mass: model.mass.clone(),
        stiffness: model.stiffness.clone(),
        damping_ratio: options.damping_ratio,
        contact_map: DMatrix::identity(boundary, order),
        contact_nodes: contact.iter().map(|point| contact_node(&full.nodes, point, options.frame)).collect(),
        checks,
        extras: RomExtras { basis: options.kind.basis(), rows: ContactPoint::rows(contact), ..RomExtras::default() },
    }
}

pub(crate) fn element_names(mesh: &Mesh) -> String {
    let mut names: Vec<_> = mesh.elements.iter().map(|element| element.kind.calculix_name()).collect();
    names.sort_unstable();
    names.dedup();
    names.join(", ")
}

fn node_modes(modes: &EigenModes, free: &[usize], nodes: usize) -> Vec<Mode> {
    let mode = |(k, frequency)| {
        let mut shape = vec![[0.0; 3]; nodes];
        for (row, dof) in free.iter().enumerate() {
            shape[dof / 3][dof % 3] = modes.shapes[(row, k)];
        }
        Mode { frequency, shape }
    };
    modes.frequencies().into_iter().enumerate().map(mode).collect()
}
