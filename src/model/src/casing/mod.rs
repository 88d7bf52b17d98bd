//! Flexible casings: a parametric ring, its mesh, and its reduction with contact grid and thermal loads.
//!
//! [`reduce_ring`] builds and reduces a ring that follows a blade's tip contour; its default is `casing37`, around rotor
//! 37. [`reduce_casing`] does the same for a mesh from elsewhere whose contact nodes form a grid.
//!
//! **casing37** is ours: NASA TP-1659 describes the flow path, not the wall of the rig. Its inner contour is the tip
//! section of the blade [`TIP_GAP`] further out, continued straight to both sides.

mod condense;
mod contour;
mod grid;
mod modal_form;
mod reduction;
mod ring_mesh;

pub use condense::condense;
pub use contour::Contour;
pub use grid::GridNodes;
pub use modal_form::{ModalForm, modal_form};
pub use reduction::{CasingReductionOptions, reduce_casing};
pub use ring_mesh::{ContactRings, Flange, RingCounts, RingGeometry, RingMesh, ring_mesh};

use crate::Result;
use crate::element::ElementKind;
use crate::material::Material;
use crate::progress::{Listener, Stage, report};
use crate::reduce::Reduction;
use crate::rotor37::{TIP_GAP, sections};
use crate::thermal::equal_patches;

/// Name of the default casing.
pub const CASING37: &str = "casing37";

/// Where a ring is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Support {
    /// The end face at low z, flange included.
    Low,
    /// The end face at high z, flange included.
    High,
    /// Both end faces.
    Both,
    /// Nowhere: six rigid-body modes.
    Free,
}

/// What to build.
#[derive(Debug, Clone, PartialEq)]
pub struct CasingOptions {
    /// Name of the structure.
    pub name: String,
    /// Contour, thickness, flanges.
    pub geometry: RingGeometry,
    /// Numbers of elements.
    pub counts: RingCounts,
    /// Hex20, or hex8: cheaper, but far too stiff in bending with one element through the shell.
    pub kind: ElementKind,
    /// Material.
    pub material: Material,
    /// Where it is held.
    pub support: Support,
    /// The contact nodes.
    pub rings: ContactRings,
    /// Thermal patches around and along; none where either is zero.
    pub patches: [usize; 2],
    /// Number of fixed-interface modes, see [`CasingReductionOptions`].
    pub fixed_interface_modes: usize,
    /// Number of modes delivered as they are, see [`CasingReductionOptions`].
    pub modes: usize,
    /// Number of modes compared with the full model.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// Axial extent of casing37 (m); the tip of the blade is at 6.2 to 34.3 mm.
const AXIAL: [f64; 2] = [-0.038, 0.042];
/// First and last contact ring of casing37 (m): 3.7 mm before and behind the tip of the blade.
const RING_AXIAL: [f64; 2] = [2.6e-3, 38.0e-3];

impl Default for CasingOptions {
    /// casing37: steel, 4 mm thick, held at the end face of a flange of 5 mm x 10 mm at low z; a flange of 4 mm x 6 mm
    /// at high z.
    fn default() -> Self {
        let flanges = [Flange { thickness: 5e-3, height: 10e-3 }, Flange { thickness: 4e-3, height: 6e-3 }].map(Some);
        let geometry = RingGeometry { contour: casing37_contour(), thickness: 4e-3, flanges };
        Self {
            name: CASING37.into(),
            geometry,
            counts: RingCounts { around: 72, through: 1, along: 12, flange: 1 },
            kind: ElementKind::Hex20,
            material: Material::steel(),
            support: Support::Low,
            rings: ContactRings { around: 24, along: 3, axial: RING_AXIAL },
            patches: [12, 1],
            fixed_interface_modes: 156,
            modes: 60,
            checked_modes: 20,
            damping_ratio: 0.005,
        }
    }
}

/// Inner contour of casing37: points 1 mm apart along the tip of rotor 37, straight from its ends on.
pub fn casing37_contour() -> Contour {
    let tip = &sections()[sections().len() - 1];
    let point = |z: f64| {
        let x = tip.abscissa(z);
        let on = tip.on_surface([x, 0.0]);
        ([on.z, on.r + TIP_GAP], tip.meridional_slope(x))
    };
    let inner: Vec<_> = (7..=34).map(|millimetre: i32| point(1e-3 * f64::from(millimetre))).collect();
    let beyond = |([z, r], slope): ([f64; 2], f64), to: f64| [to, r + slope * (to - z)];
    let mut points = vec![beyond(inner[0], AXIAL[0])];
    points.extend(inner.iter().map(|(point, _)| *point));
    points.push(beyond(inner[inner.len() - 1], AXIAL[1]));
    Contour::new(&points).expect("the tip of the blade that ships is a contour")
}

/// Build, reduce and check a ring.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for lengths, counts and contact rings that do not fit each other, and those of [`reduce_casing`].
pub fn reduce_ring(options: &CasingOptions, listener: Listener<'_>) -> Result<Reduction> {
    let start = std::time::Instant::now();
    report(listener, Stage::Mesh, 0, 1);
    let ring = supported_ring(options)?;
    let clamped = if options.support == Support::Free { Vec::new() } else { ring.mesh.set(CLAMPED)?.to_vec() };
    let [around, along] = options.patches;
    let patches = equal_patches(around, along, options.geometry.contour.axial());
    report(listener, Stage::Mesh, 1, 1);
    let meshing = start.elapsed().as_secs_f64();
    let reduction_options = CasingReductionOptions {
        name: options.name.clone(),
        fixed_interface_modes: options.fixed_interface_modes,
        modes: options.modes,
        checked_modes: options.checked_modes,
        damping_ratio: options.damping_ratio,
    };
    let mut reduction =
        reduce_casing(ring.mesh, &options.material, &clamped, &ring.grid, &patches, &reduction_options, listener)?;
    reduction.timings.assembly += meshing;
    reduction.rom.origin = format!("{}: {}", describe(options), reduction.rom.origin);
    Ok(reduction)
}

/// Name of the node set that holds the clamped nodes, unless the ring is free.
pub const CLAMPED: &str = "clamped";

/// Mesh of the ring, with the clamped nodes as a set of their own.
///
/// # Errors
/// Those of [`ring_mesh`]; a contact ring on a clamped face cannot be, since contact rings lie inside the casing.
pub fn supported_ring(options: &CasingOptions) -> Result<RingMesh> {
    let mut ring = ring_mesh(&options.geometry, options.counts, options.rings, options.kind)?;
    let faces: &[&str] = match options.support {
        Support::Low => &["low_face"],
        Support::High => &["high_face"],
        Support::Both => &["low_face", "high_face"],
        Support::Free => &[],
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
        Support::Low => "held at its low end face",
        Support::High => "held at its high end face",
        Support::Both => "held at both end faces",
        Support::Free => "free",
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
