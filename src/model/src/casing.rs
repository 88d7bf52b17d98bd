//! Flexible casings: a parametric ring, its mesh, and its reduction with contact grid and thermal loads.
//!
//! [`reduce_ring`] builds and reduces a ring that follows the tip contour of a blade; its default is `casing37`,
//! around rotor 37. [`reduce_casing`] reduces any mesh whose contact nodes form a grid.
//!
mod casing37;
mod condense;
mod contour;
mod grid;
mod modal_form;
mod reduction;
mod ring_mesh;
mod support;

pub use casing37::{CASING37, casing37_contour};
pub use condense::condense;
pub use contour::InnerContour;
pub use grid::GridNodes;
pub use modal_form::{ModalForm, modal_form};
pub use reduction::{CasingReductionOptions, reduce_casing};
pub(crate) use reduction::{rigid_motions, without_rigid_motions};
pub use ring_mesh::{ContactRings, Flange, RingCounts, RingGeometry, RingMesh, ring_mesh};

use crate::Result;
use crate::element::{ElementKind, Formulation};
use crate::material::Material;
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::Reduction;
use crate::thermal::equal_patches;

/// Support of a ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RingSupport {
    /// Clamped at the end face at low z, flange included.
    Low,
    /// Clamped at the end face at high z, flange included.
    High,
    /// Clamped at both end faces.
    Both,
    /// Unsupported: six rigid-body modes.
    Free,
}

/// Options of a casing.
#[derive(Debug, Clone, PartialEq)]
pub struct CasingOptions {
    /// Name of the structure.
    pub name: String,
    /// Contour, thickness, flanges.
    pub geometry: RingGeometry,
    /// Numbers of elements.
    pub counts: RingCounts,
    /// Element kind: hex20, or hex8, which is cheaper but far too stiff in bending with one element through the
    /// shell.
    pub kind: ElementKind,
    /// Material.
    pub material: Material,
    /// Support.
    pub support: RingSupport,
    /// Contact rings.
    pub rings: ContactRings,
    /// Thermal patches around and along; no patches if either is zero.
    pub patches: [usize; 2],
    /// Number of fixed-interface modes, see [`CasingReductionOptions`].
    pub fixed_interface_modes: usize,
    /// Number of modes that are kept unchanged, see [`CasingReductionOptions`].
    pub modes: usize,
    /// Number of modes compared with the full model.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// Builds, reduces and checks a ring.
///
/// # Examples
/// ```
/// # use tiprub_model::{casing::{CasingOptions, ContactRings, RingCounts}, progress::silent};
/// # let whole = CasingOptions::default();
/// let options = CasingOptions {
///     counts: RingCounts { around: 24, ..whole.counts },
///     rings: ContactRings { around: 12, ..whole.rings },
///     fixed_interface_modes: 20,
///     modes: 10,
///     checked_modes: 4,
///     ..whole
/// };
/// let reduction = tiprub_model::reduce_ring(&options, &silent)?;
/// assert!(reduction.rom.extras.grid.is_some());
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for inconsistent lengths, counts and contact rings; the errors of
/// [`reduce_casing`].
pub fn reduce_ring(options: &CasingOptions, listener: Listener<'_>) -> Result<Reduction> {
    report(listener, ReductionStage::Mesh, 0, 1);
    let ring = supported_ring(options)?;
    let clamped = if options.support == RingSupport::Free { Vec::new() } else { ring.mesh.set(CLAMPED)?.to_vec() };
    let [around, along] = options.patches;
    let patches = equal_patches(around, along, options.geometry.contour.axial());
    report(listener, ReductionStage::Mesh, 1, 1);
    let reduction_options = CasingReductionOptions {
        name: options.name.clone(),
        formulation: Formulation::Displacement,
        fixed_interface_modes: options.fixed_interface_modes,
        modes: options.modes,
        checked_modes: options.checked_modes,
        damping_ratio: options.damping_ratio,
    };
    let mut reduction =
        reduce_casing(ring.mesh, &options.material, &clamped, &ring.grid, &patches, &reduction_options, listener)?;
    reduction.rom.origin = format!("{}: {}", describe(options), reduction.rom.origin);
    Ok(reduction)
}

/// Name of the node set that holds the clamped nodes, unless the ring is free.
pub const CLAMPED: &str = "clamped";

/// Builds the mesh of the ring, with the clamped nodes as an additional node set.
///
/// # Examples
/// ```
/// # use tiprub_model::casing::{CLAMPED, CasingOptions, supported_ring};
/// let ring = supported_ring(&CasingOptions::default())?;
/// assert!(!ring.mesh.set(CLAMPED)?.is_empty());
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// The errors of [`ring_mesh`]. A contact ring never lies on a clamped face, since contact rings lie inside the
/// casing.
pub fn supported_ring(options: &CasingOptions) -> Result<RingMesh> {
    let mut ring = ring_mesh(&options.geometry, options.counts, options.rings, options.kind)?;
    let faces: &[&str] = match options.support {
        RingSupport::Low => &["low_face"],
        RingSupport::High => &["high_face"],
        RingSupport::Both => &["low_face", "high_face"],
        RingSupport::Free => &[],
    };
    let mut clamped = Vec::new();
    for face in faces {
        clamped.extend_from_slice(ring.mesh.set(face)?);
    }
    clamped.sort_unstable();
    if !clamped.is_empty() {
        ring.mesh.sets.insert(CLAMPED.to_owned(), clamped);
    }
    Ok(ring)
}

fn describe(options: &CasingOptions) -> String {
    let [low, high] = options.geometry.contour.axial();
    let around = if options.name == CASING37 { " around NASA rotor 37" } else { "" };
    let support = match options.support {
        RingSupport::Low => "held at its low-z end face",
        RingSupport::High => "held at its high-z end face",
        RingSupport::Both => "held at both end faces",
        RingSupport::Free => "free",
    };
    let millimetres = |metres: f64| 1e3 * metres;
    format!(
        "Casing ring{around}, inner radius {:.3} to {:.3} mm from z = {:.3} to {:.3} mm, {:.3} mm thick, {support}",
        millimetres(options.geometry.contour.radius(low)),
        millimetres(options.geometry.contour.radius(high)),
        millimetres(low),
        millimetres(high),
        millimetres(options.geometry.thickness),
    )
}
