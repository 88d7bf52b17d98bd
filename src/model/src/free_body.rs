//! Reduction of a free body: Craig-Bampton on its contact nodes or patches, or its modes with exact residual
//! flexibility, in modal form.
//!
//! The rigid-body motions are known beforehand and have exactly zero stiffness: translations of the contact nodes are
//! combinations of them, as a scene with a free structure requires.

use nalgebra::{DMatrix, DVector};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomExtras};

use crate::Result;
use crate::assembly::free_dofs;
use crate::casing::{modal_form, rigid_motions, without_rigid_motions};
use crate::fe_model::FeModel;
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::{
    ContactPoint, HeldContact, Reduction, ReductionKind, check_nodes, compare, description, full_modes, interface,
    responses,
};
use crate::shapes::Surface;

/// Number of rigid-body motions.
const RIGID: usize = 6;

/// Options of the reduction of a free body.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FreeBodyOptions {
    /// Name of the structure.
    pub name: String,
    /// Kind of the modes.
    pub kind: ReductionKind,
    /// Number of modes: with the contact held, or in addition to the rigid-body motions. All if absent, which makes
    /// the reduction exact.
    pub modes: Option<usize>,
    /// Number of modes compared with the full model, including the six rigid-body motions.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// Reduces an unsupported body to its contact nodes or patches; frame Cartesian, M = I, K = Λ with six zeros first.
///
/// # Errors
/// [`crate::Error::Invalid`] for contact nodes that are repeated or do not exist;
/// [`crate::Error::NotPositiveDefinite`] for collinear contact nodes and for a body that is not one connected part.
pub(crate) fn reduce_free_body(
    model: FeModel,
    contact: &[ContactPoint],
    options: &FreeBodyOptions,
    listener: Listener<'_>,
) -> Result<Reduction> {
    faer::set_global_parallelism(faer::Par::Seq);
    check_nodes(&model.nodes, &[], contact, DisplacementFrame::Cartesian)?;
    let free = free_dofs(model.nodes.len(), &[]);
    let held = HeldContact::new(&free, &model.nodes, contact, DisplacementFrame::Cartesian)?;
    let inner = free.len().saturating_sub(held.interface.len());
    // All modes means all modes with the contact held.
    let kind = if options.modes.is_none() { ReductionKind::FixedInterface } else { options.kind };
    let count = options.modes.unwrap_or(inner);
    let own = if kind == ReductionKind::FreeInterface { count + RIGID } else { 0 };
    let full = full_modes(&model.stiffness, &model.mass, true, options.checked_modes.max(own), listener)?;
    let points: Vec<[f64; 3]> = contact.iter().map(|point| point.cartesian(&model.nodes)).collect();
    let reduced = match kind {
        ReductionKind::FixedInterface => held.craig_bampton(&model.stiffness, &model.mass, count, listener)?,
        ReductionKind::FreeInterface => {
            held.free_interface(&model.stiffness, &model.mass, &full.modes.lowest(own), listener)?
        }
    };
    let full = full.truncated(options.checked_modes);
    let rigid = rigid_motions(&points, reduced.mass.nrows());
    let modes = modal_form(&reduced.stiffness, &reduced.mass, &rigid)?;
    report(listener, ReductionStage::Checks, 0, 1);
    let checks = without_rigid_motions(compare(&full, &model.mass, &reduced, &modes.squares, &modes.shapes));
    report(listener, ReductionStage::Checks, 1, 1);
    let order = modes.squares.len();
    let exact = if count == inner { " (all)" } else { "" };
    let kept = match kind {
        ReductionKind::FixedInterface => {
            format!("Craig-Bampton with {} and {count} fixed-interface modes{exact}", interface(contact))
        }
        ReductionKind::FreeInterface => {
            format!("{} with inertia relief and {count} free-interface modes", responses(contact))
        }
    };
    let rom = Rom {
        name: options.name.clone(),
        origin: format!("{}, free body; {kept}", description(&model, 0)),
        sectors: 1,
        frame: DisplacementFrame::Cartesian,
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_diagonal(&DVector::from_column_slice(&modes.squares)),
        damping_ratio: options.damping_ratio,
        contact_map: modes.shapes.rows(0, held.interface.len()).into_owned(),
        contact_nodes: contact.iter().zip(&points).map(|(point, place)| contact_node(point, *place)).collect(),
        checks,
        extras: RomExtras::default(),
    };
    let fixed_interface_frequencies = reduced.fixed_interface_frequencies;
    let surface = model.mesh.as_ref().map(|(mesh, _)| Surface::new(mesh, &[]));
    let shapes = surface.map(|surface| surface.real(&free, &reduced.transformation, Some(&modes.shapes)));
    let model = (model.nodes.len(), model.mesh);
    let reduction = Reduction::new(rom, &full.modes, &free, &modes.squares, model)?;
    Ok(Reduction { fixed_interface_frequencies, shapes, ..reduction })
}

fn contact_node(point: &ContactPoint, position: [f64; 3]) -> ContactNode {
    ContactNode { name: point.name.clone(), position, area: point.area, ..ContactNode::default() }
}
