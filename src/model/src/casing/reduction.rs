//! Reduction of a casing: Craig-Bampton on a grid of contact nodes, with static responses to the thermal loads.
//!
//! Craig-Bampton needs many fixed-interface modes to represent the casing between its contact nodes. The reduced
//! pencil is therefore transformed to its modes and [condensed](super::condense): modes above a cut-off are replaced
//! by their static response, so that contact and heat see the stiffness of the whole finite-element model.

use faer::Mat;
use nalgebra::{DMatrix, DVector};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{DisplacementFrame, RomChecks, RomExtras, Thermal};
use tiprub_cosim::ThermalPatch;

use super::condense::condense;
use super::grid::GridNodes;
use super::modal_form::{ModalForm, modal_form};
use super::support::HeldRows;
use crate::assembly::{assemble_with, free_dofs};
use crate::craig_bampton::{CraigBampton, InnerBasis, craig_bampton_with};
use crate::element::Formulation;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::patches::PatchCoordinates;
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::{ContactPoint, Reduction, check_nodes, compare, element_names, full_modes};
use crate::shapes::Surface;
use crate::sparse::{principal_pair, tall_product};
use crate::thermal::patch_loads;
use crate::{Error, Result};

/// Number of rigid-body motions of a free structure.
const RIGID: usize = 6;

/// Options of the reduction of a casing.
#[derive(Debug, Clone, PartialEq)]
pub struct CasingReductionOptions {
    /// Name of the structure.
    pub name: String,
    /// Formulation of hex8 elements.
    pub formulation: Formulation,
    /// Number of fixed-interface modes of the Craig-Bampton reduction; one fewer if a double mode would be split.
    pub fixed_interface_modes: usize,
    /// Number of modes of the reduced pencil that are kept unchanged; one fewer if a double mode would be split. The
    /// modes above only keep their static response to forces on the contact nodes and to heat.
    pub modes: usize,
    /// Number of modes of the full model that are computed and compared with the reduced ones.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// Reduces any mesh to a grid of contact nodes.
///
/// `clamped` lists nodes that are clamped in all directions; if it is empty, the casing is free and keeps six
/// rigid-body modes. Elements outside all `patches` stay at the reference temperature; without patches the ROM has no
/// thermal loads. The coordinates of the ROM are modes: M = I, K = Λ, frame cylindrical.
///
/// # Examples
/// ```
/// # use tiprub_model::{casing::{CLAMPED, CasingOptions, CasingReductionOptions, ContactRings, RingCounts, supported_ring}, progress::silent};
/// # let whole = CasingOptions::default();
/// let options = CasingOptions {
///     counts: RingCounts { around: 24, ..whole.counts },
///     rings: ContactRings { around: 12, ..whole.rings },
///     fixed_interface_modes: 20,
///     modes: 10,
///     checked_modes: 4,
///     ..whole
/// };
/// let ring = supported_ring(&options)?;
/// let clamped = ring.mesh.set(CLAMPED)?.to_vec();
/// let reduction = CasingReductionOptions {
///     name: "casing".into(),
///     formulation: Default::default(),
///     fixed_interface_modes: 20,
///     modes: 10,
///     checked_modes: 4,
///     damping_ratio: 0.005,
/// };
/// let casing = tiprub_model::reduce_casing(ring.mesh, &options.material, &clamped, &ring.grid, &[], &reduction, &silent)?;
/// assert!(casing.rom.extras.grid.is_some());
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for contact nodes that are clamped, repeated, on the axis or do not form
/// a grid, and for patches that overlap or have no elements; the errors of assembly, eigenvalue iteration and ROM
/// validation.
pub fn reduce_casing(
    mesh: Mesh,
    material: &Material,
    clamped: &[usize],
    grid: &GridNodes,
    patches: &[ThermalPatch],
    options: &CasingReductionOptions,
    listener: Listener<'_>,
) -> Result<Reduction> {
    // As for blades: threads of faer would split sums by the number of threads, on which the bits of the ROM would
    // depend.
    faer::set_global_parallelism(faer::Par::Seq);
    grid.validate()?;
    let contact = grid.contact_points();
    check_nodes(&mesh.nodes, clamped, &contact, DisplacementFrame::Cylindrical)?;
    let free = free_dofs(mesh.nodes.len(), clamped);
    // Points between nodes become additional degrees of freedom, in the directions of the mesh.
    let coordinates = PatchCoordinates::new(&free, &mesh.nodes, &contact, DisplacementFrame::Cartesian)
        .map_err(|_| too_fine(grid))?;
    let all_loads = patch_loads(&mesh, material, patches)?;
    let loads = Mat::from_fn(free.len(), patches.len(), |i, k| all_loads[(free[i], k)]);
    let assembled = assemble_with(&mesh, material, options.formulation, listener)?;
    let held = || HeldRows::new(&assembled, &mesh.nodes, clamped, &free, &all_loads);
    let held = (!clamped.is_empty()).then(held);
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    drop(assembled);
    let full = full_modes(&stiffness, &mass, clamped.is_empty(), options.checked_modes, listener)?;
    let basis = |loads| InnerBasis { modes: options.fixed_interface_modes, whole_pairs: true, loads: Some(loads) };
    let reduced = match &coordinates {
        None => {
            craig_bampton_with(&stiffness, &mass, &interface_dofs(&free, &contact), &basis(loads.as_ref()), listener)?
        }
        Some(coordinates) => {
            let (stiffness, mass) = coordinates.transformed_sparsely(&stiffness, &mass);
            let mut loads = loads.clone();
            coordinates.project(&mut loads);
            let interface = interface_dofs(&free, coordinates.points());
            let mut reduced = craig_bampton_with(&stiffness, &mass, &interface, &basis(loads.as_ref()), listener)?;
            coordinates.restore(&mut reduced.transformation);
            reduced
        }
    };
    let order = reduced.mass.nrows();
    let points = grid.positions(&mesh);
    let rigid = if clamped.is_empty() { rigid_motions(&points, order) } else { DMatrix::zeros(order, 0) };
    let modes = modal_form(&reduced.stiffness, &reduced.mass, &rigid)?;
    let reduced_loads = reduced_loads(grid, &reduced, &loads);
    let modes = condense(&modes, options.modes, &reduced_loads);
    report(listener, ReductionStage::Checks, 0, 1);
    let checks = compare(&full, &mass, &reduced, &modes.squares, &modes.shapes);
    report(listener, ReductionStage::Checks, 1, 1);
    let checks = if clamped.is_empty() { without_rigid_motions(checks) } else { checks };
    let rom = Rom {
        name: options.name.clone(),
        origin: origin(&mesh, (material, options.formulation), clamped.len(), grid, &reduced, &modes),
        sectors: 1,
        frame: DisplacementFrame::Cylindrical,
        mass: DMatrix::identity(modes.squares.len(), modes.squares.len()),
        stiffness: DMatrix::from_diagonal(&DVector::from_column_slice(&modes.squares)),
        damping_ratio: options.damping_ratio,
        contact_map: contact_map(&points, &modes),
        contact_nodes: grid.contact_nodes(&mesh),
        checks,
        extras: RomExtras {
            thermal: thermal(&reduced_loads, patches, &modes),
            grid: Some(grid.shape()),
            support: held.map(|rows| rows.reduced(&reduced, &modes)),
            ..RomExtras::default()
        },
    };
    let shapes = Some(Surface::new(&mesh, &[]).real(&free, &reduced.transformation, Some(&modes.shapes)));
    let model = (mesh.nodes.len(), Some((mesh, material.clone())));
    let fixed_interface_frequencies = reduced.fixed_interface_frequencies;
    let reduction = Reduction::new(rom, &full.modes, &free, &modes.squares, model)?;
    Ok(Reduction { fixed_interface_frequencies, shapes, ..reduction })
}

/// Returns the error for a grid whose points depend on each other.
fn too_fine(grid: &GridNodes) -> Error {
    let problem = format!("the mesh is too coarse to move {} x {} points independently", grid.around, grid.along());
    Error::invalid("contact grid of the casing", problem, "Use fewer points around or fewer rings, or refine the mesh")
}

/// Returns the rows of the contact dofs among the free ones; none is clamped.
fn interface_dofs(free: &[usize], contact: &[ContactPoint]) -> Vec<usize> {
    let dofs = contact.iter().flat_map(|point| (0..3).map(move |component| 3 * point.node + component));
    dofs.map(|dof| free.partition_point(|other| *other < dof)).collect()
}

/// Returns the rigid-body motions in Craig-Bampton coordinates: those of the contact nodes alone, since the
/// constraint modes determine the interior. Rotations are about the centre of the contact nodes, in units of their
/// distance from it.
pub(crate) fn rigid_motions(points: &[[f64; 3]], order: usize) -> DMatrix<f64> {
    let count = points.len() as f64;
    let centre: [f64; 3] = core::array::from_fn(|i| points.iter().map(|point| point[i]).sum::<f64>() / count);
    let mut motions = DMatrix::zeros(order, RIGID);
    for (index, point) in points.iter().enumerate() {
        let arm: [f64; 3] = core::array::from_fn(|i| point[i] - centre[i]);
        for axis in 0..3 {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            motions[(3 * index + axis, axis)] = 1.0;
            // e_axis x arm.
            motions[(3 * index + next, 3 + axis)] = -arm[last];
            motions[(3 * index + last, 3 + axis)] = arm[next];
        }
    }
    for mut rotation in motions.columns_mut(3, 3).column_iter_mut() {
        let size = rotation.amax();
        // A single contact node has no lever arm; the reduction has failed before in that case.
        if size > 0.0 {
            rotation /= size;
        }
    }
    motions
}

/// Returns the radial, tangential and axial displacement of the contact nodes, 3·nodes × modes.
fn contact_map(points: &[[f64; 3]], modes: &ModalForm) -> DMatrix<f64> {
    let mut map = modes.shapes.rows(0, 3 * points.len()).into_owned();
    for (index, &[x, y, _]) in points.iter().enumerate() {
        let radius = x.hypot(y);
        let (cos, sin) = (x / radius, y / radius);
        for mode in 0..map.ncols() {
            let (along_x, along_y) = (map[(3 * index, mode)], map[(3 * index + 1, mode)]);
            map[(3 * index, mode)] = cos * along_x + sin * along_y;
            map[(3 * index + 1, mode)] = cos * along_y - sin * along_x;
        }
    }
    map
}

/// Returns unit forces on the contact nodes, then the thermal loads, in Craig-Bampton coordinates.
fn reduced_loads(grid: &GridNodes, reduced: &CraigBampton, thermal: &Mat<f64>) -> DMatrix<f64> {
    let boundary = 3 * grid.nodes.len();
    let thermal = tall_product(reduced.transformation.as_ref(), thermal.as_ref());
    DMatrix::from_fn(thermal.nrows(), boundary + thermal.ncols(), |i, k| match k.checked_sub(boundary) {
        Some(patch) => thermal[(i, patch)],
        None if i == k => 1.0,
        None => 0.0,
    })
}

/// Returns the thermal loads on the modes; zero on rigid-body motions, which cause no strain.
fn thermal(loads: &DMatrix<f64>, patches: &[ThermalPatch], modes: &ModalForm) -> Option<Thermal> {
    if patches.is_empty() {
        return None;
    }
    let mut loads = modes.shapes.transpose() * loads.columns(loads.ncols() - patches.len(), patches.len());
    for (mode, _) in modes.squares.iter().enumerate().filter(|(_, square)| **square <= 0.0) {
        loads.row_mut(mode).fill(0.0);
    }
    Some(Thermal { loads, patches: patches.to_vec() })
}

/// Sets rigid-body modes to 0 Hz in the checks, without the deviation of round-off.
pub(crate) fn without_rigid_motions(mut checks: RomChecks) -> RomChecks {
    let rigid = RIGID.min(checks.full_frequencies.len());
    checks.full_frequencies[..rigid].fill(0.0);
    checks.frequency_deviation[..rigid].fill(0.0);
    checks
}

fn origin(
    mesh: &Mesh,
    (material, formulation): (&Material, Formulation),
    clamped: usize,
    grid: &GridNodes,
    reduced: &CraigBampton,
    modes: &ModalForm,
) -> String {
    let cut_off = match modes.condensed_from {
        Some(kept) => format!(
            "; {kept} dynamic modes up to {:.0} Hz and {} static modes above",
            modes.squares[..kept].last().map_or(0.0, |square| square.sqrt() / core::f64::consts::TAU),
            modes.squares.len() - kept
        ),
        None => format!("; all {} modes", modes.squares.len()),
    };
    let incompatible = match formulation {
        Formulation::IncompatibleModes => ", hex8 with incompatible modes",
        Formulation::Displacement => "",
    };
    format!(
        "{} nodes, {} elements ({}{incompatible}), {clamped} nodes clamped; {}: E = {:e} Pa, nu = {}, rho = {} kg/m3, alpha = {:e} 1/K; \
         Craig-Bampton with {} x {} contact nodes, {} fixed-interface modes and static responses to the thermal loads{cut_off}",
        mesh.nodes.len(),
        mesh.elements.len(),
        element_names(mesh),
        material.name,
        material.young_modulus,
        material.poisson_ratio,
        material.density,
        material.expansion,
        grid.around,
        grid.along(),
        reduced.fixed_interface_frequencies.len(),
    )
}
