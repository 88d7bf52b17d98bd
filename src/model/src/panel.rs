//! Reduction of a supported structure that carries an open contact surface: a grid of nodes with four free edges.
//!
//! Coordinates are the lowest modes of the supported structure and static responses to forces on the grid that these
//! modes do not represent (residual attachment modes: MacNeal, Computers & Structures 1, 1971; Rubin, AIAA Journal
//! 13(8), 1975). A grid has hundreds of nodes, and a response for each of them would make the model large again. So
//! the forces are the principal directions of the flexibility that the modes lack, C (K⁻¹ − ΦΛ⁻¹Φᵀ) Cᵀ v = κ v, in
//! order of descending κ, which minimises the neglected flexibility for their number.

use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactGrid, ContactNode, DisplacementFrame, RomExtras};

use crate::assembly::free_dofs;
use crate::craig_bampton::{CraigBampton, with_static_responses};
use crate::eigen::EigenModes;
use crate::fe_model::FeModel;
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::{FullModes, Reduction, compare, description, full_modes};
use crate::shapes::Surface;
use crate::sparse::{SparseMatrix, principal_pair};
use crate::{Error, Result};

/// Number of right-hand sides that are solved together.
const COLUMNS: usize = 64;

/// Contact nodes of an open surface: node `along · around + i` is the i-th of row `along`. With S_s along a row and
/// S_t from row to row, S_t × S_s points to the other body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PanelGrid {
    /// Number of nodes per row.
    pub around: usize,
    /// Node indices of the mesh (from 0), row by row; they may include clamped nodes.
    pub nodes: Vec<usize>,
}

impl PanelGrid {
    /// Returns the number of rows.
    pub(crate) fn along(&self) -> usize {
        self.nodes.len() / self.around.max(1)
    }

    fn check(&self, model: &FeModel) -> Result<()> {
        let refuse = |problem: String| {
            let remedy = "List every node once, row by row, with at least four rows of four nodes";
            Err(Error::invalid("contact grid", problem, remedy))
        };
        if self.around < 2 || self.along() < 2 || self.around * self.along() != self.nodes.len() {
            return refuse(format!("{} nodes cannot be divided into rows of {}", self.nodes.len(), self.around));
        }
        if let Some(node) = self.nodes.iter().find(|node| **node >= model.nodes.len()) {
            return refuse(format!("node {} does not exist; the model has {} nodes", node + 1, model.nodes.len()));
        }
        let mut sorted = self.nodes.clone();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => refuse(format!("node {} appears twice", pair[0] + 1)),
            None => Ok(()),
        }
    }
}

/// Options of the reduction of a panel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PanelOptions {
    /// Name of the structure.
    pub name: String,
    /// Number of modes.
    pub modes: usize,
    /// Number of static responses to forces on the grid, at most three per movable node; with the maximum, the static
    /// response to any contact force is that of the full model.
    pub static_responses: usize,
    /// Number of modes compared with the full model.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// Reduces a supported structure to its modes and static responses; frame Cartesian, M = I, K = Λ.
///
/// # Errors
/// [`Error::Invalid`] for a grid of nodes that do not exist or are repeated, more modes than degrees of freedom or
/// more static responses than forces; [`Error::NotPositiveDefinite`] for an unsupported structure.
pub(crate) fn reduce_panel(
    model: FeModel,
    clamped: &[usize],
    grid: &PanelGrid,
    options: &PanelOptions,
    listener: Listener<'_>,
) -> Result<Reduction> {
    faer::set_global_parallelism(faer::Par::Seq);
    grid.check(&model)?;
    let free = free_dofs(model.nodes.len(), clamped);
    let (stiffness, mass) = principal_pair(&model.stiffness, &model.mass, &free);
    let full = full_modes(&stiffness, &mass, false, options.modes.max(options.checked_modes), listener)?;
    let kept = full.modes.lowest(options.modes);
    let dofs = grid_dofs(&free, grid);
    let basis = with_grid_responses(kept, &full, (&stiffness, &mass), &dofs, options, listener)?;
    let order = basis.eigenvalues.len();
    let reduced = CraigBampton {
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_diagonal(&DVector::from_column_slice(&basis.eigenvalues)),
        transformation: basis.shapes,
        fixed_interface_frequencies: Vec::new(),
    };
    report(listener, ReductionStage::Checks, 0, 1);
    let judged = full.clone().truncated(options.checked_modes);
    let checks = compare(&judged, &mass, &reduced, &basis.eigenvalues, &DMatrix::identity(order, order));
    report(listener, ReductionStage::Checks, 1, 1);
    let rom = Rom {
        name: options.name.clone(),
        origin: format!(
            "{}; {} modes up to {:.0} Hz and {} static responses to forces on {} x {} contact nodes",
            description(&model, clamped.len()),
            options.modes,
            full.modes.frequencies()[..options.modes].last().copied().unwrap_or(0.0),
            order - options.modes,
            grid.around,
            grid.along(),
        ),
        sectors: 1,
        frame: DisplacementFrame::Cartesian,
        contact_map: contact_map(&free, grid, &reduced.transformation),
        mass: reduced.mass,
        stiffness: reduced.stiffness,
        damping_ratio: options.damping_ratio,
        contact_nodes: contact_nodes(&model, grid),
        checks,
        extras: RomExtras {
            grid: Some(ContactGrid { around: grid.around, along: grid.along(), closed: false }),
            ..RomExtras::default()
        },
    };
    let surface = model.mesh.as_ref().map(|(mesh, _)| Surface::new(mesh, &[]));
    let shapes = surface.map(|surface| surface.real(&free, &reduced.transformation, None));
    let model = (model.nodes.len(), model.mesh);
    let mut reduction = Reduction::new(rom, &full.modes, &free, &basis.eigenvalues, model)?;
    reduction.modes.truncate(options.checked_modes);
    reduction.shapes = shapes;
    Ok(reduction)
}

/// Returns the rows of the components of grid nodes among the free dofs; `None` for clamped ones.
fn grid_dofs(free: &[usize], grid: &PanelGrid) -> Vec<Option<usize>> {
    let dofs = grid.nodes.iter().flat_map(|node| (0..3).map(move |component| 3 * node + component));
    dofs.map(|dof| free.binary_search(&dof).ok()).collect()
}

fn with_grid_responses(
    kept: EigenModes,
    full: &FullModes,
    (stiffness, mass): (&SparseMatrix, &SparseMatrix),
    dofs: &[Option<usize>],
    options: &PanelOptions,
    listener: Listener<'_>,
) -> Result<EigenModes> {
    let dofs: Vec<usize> = dofs.iter().copied().flatten().collect();
    let count = options.static_responses;
    if count > dofs.len() {
        let problem = format!("{count} requested, but only {} displacements of grid nodes are free", dofs.len());
        return Err(Error::invalid("number of static responses", problem, "Request fewer"));
    }
    if count == 0 {
        return Ok(kept);
    }
    let patterns = principal_forces(&kept, full, &dofs, count, listener)?;
    let mut loads = Mat::zeros(stiffness.order(), count);
    for k in 0..count {
        dofs.iter().enumerate().for_each(|(i, &dof)| loads[(dof, k)] = patterns[(i, k)]);
    }
    let responses = full.responses(loads);
    let squares = kept.eigenvalues.clone();
    let mut basis = with_static_responses(kept, stiffness, mass, &responses)?;
    // The projected problem returns the modes again; the iterated ones are more accurate.
    basis.eigenvalues[..squares.len()].copy_from_slice(&squares);
    basis.eigenvalues.iter().is_sorted().then_some(basis).ok_or_else(|| {
        let remedy = "Request a few more or fewer modes";
        Error::invalid("static responses", "their frequencies overlap with those of the modes", remedy)
    })
}

/// Computes the force patterns on the grid, dofs × `count`, for which the modes lack most flexibility.
fn principal_forces(
    kept: &EigenModes,
    full: &FullModes,
    dofs: &[usize],
    count: usize,
    listener: Listener<'_>,
) -> Result<Mat<f64>> {
    let mut lacking = Mat::zeros(dofs.len(), dofs.len());
    for (chunk, part) in dofs.chunks(COLUMNS).enumerate() {
        report(listener, ReductionStage::ConstraintModes, chunk * COLUMNS, dofs.len());
        let mut unit = Mat::zeros(kept.shapes.nrows(), part.len());
        part.iter().enumerate().for_each(|(j, &dof)| unit[(dof, j)] = 1.0);
        let response = full.responses(unit);
        for j in 0..part.len() {
            dofs.iter().enumerate().for_each(|(i, &dof)| lacking[(i, chunk * COLUMNS + j)] = response[(dof, j)]);
        }
    }
    let scaled =
        Mat::from_fn(dofs.len(), kept.eigenvalues.len(), |i, k| kept.shapes[(dofs[i], k)] / kept.eigenvalues[k].sqrt());
    lacking -= &scaled * scaled.transpose();
    let symmetric = Mat::from_fn(dofs.len(), dofs.len(), |i, j| 0.5 * (lacking[(i, j)] + lacking[(j, i)]));
    let scale = symmetric.norm_max();
    let eigen = (symmetric * faer::Scale(1.0 / scale)).self_adjoint_eigen(Side::Lower).map_err(|_| {
        Error::invalid("flexibility of the contact grid", "the eigenvalue problem did not converge", "Check the mesh")
    })?;
    Ok(Mat::from_fn(dofs.len(), count, |i, k| eigen.U()[(i, dofs.len() - 1 - k)]))
}

/// Returns the displacements of the grid nodes, zero for clamped ones.
fn contact_map(free: &[usize], grid: &PanelGrid, shapes: &Mat<f64>) -> DMatrix<f64> {
    let dofs = grid_dofs(free, grid);
    DMatrix::from_fn(dofs.len(), shapes.ncols(), |row, mode| dofs[row].map_or(0.0, |dof| shapes[(dof, mode)]))
}

fn contact_nodes(model: &FeModel, grid: &PanelGrid) -> Vec<ContactNode> {
    let named = |(index, &node): (usize, &usize)| ContactNode {
        name: format!("row_{}_{}", index / grid.around + 1, index % grid.around + 1),
        position: model.nodes[node],
        meridional_slope: 0.0,
        ..ContactNode::default()
    };
    grid.nodes.iter().enumerate().map(named).collect()
}
