//! Surface of revolution of a contact around a rotor.

use std::f64::consts::TAU;

use tiprub_core::geometry::PrescribedMotion;
use tiprub_core::scene::settings::{BodyMotion, ContactSettings, SurfaceSettings};
use tiprub_core::scene::shape::CompiledShape;
use tiprub_core::{Rom, Scene};
use tiprub_shell::{Failure, Result};

/// Points around and along the rigid surface of a contact without a coating.
const RING: [usize; 2] = [360, 8];
/// Axial extent of contact nodes, as a fraction of their radius, up to which they count as lying in one plane.
const FLAT: f64 = 1e-6;
/// Axial extent of the surface to both sides of contact nodes in one plane, as a fraction of the radius.
const HALF_STRIP: f64 = 0.05;

/// Surface of revolution of a contact.
#[derive(Debug)]
pub(crate) struct Ring {
    /// Index of the contact.
    pub(crate) contact: usize,
    /// Unique name.
    pub(crate) name: String,
    /// Prescribed shape.
    shape: CompiledShape,
    /// Radius and axial position of each ring of points (m).
    pub(crate) rows: Vec<[f64; 2]>,
    /// Number of points around the axis.
    pub(crate) around: usize,
    /// Nominal gap (m), which the radii include.
    pub(crate) gap: f64,
    /// Index of the structure with which the surface deforms; `None` for a rigid surface.
    pub(crate) carrier: Option<usize>,
    /// Name of the output with the wear of each cell; `None` without a coating.
    pub(crate) wear: Option<String>,
}

impl Ring {
    /// Returns the surface of a contact; `None` if its master is a free body or has no contact nodes.
    ///
    /// # Errors
    /// The shape of the surface cannot be evaluated.
    pub(crate) fn for_contact(contact: usize, scene: &Scene) -> Result<Option<Self>> {
        let settings = &scene.settings;
        let own = &settings.contacts[contact];
        let Some(surface) = settings.surfaces.iter().find(|surface| surface.name == own.slave) else { return Ok(None) };
        let master = settings.structures.iter().zip(&scene.roms).find(|(structure, _)| structure.name == own.master);
        let Some((_, rom)) = master.filter(|(structure, _)| structure.motion != BodyMotion::Free) else {
            return Ok(None);
        };
        let [around, along] = own.coating.map_or(RING, |coating| [coating.cells_around, coating.cells_along]);
        let Some(rows) = contour(rom, own, along) else { return Ok(None) };
        let shape = CompiledShape::new(&surface.shape, own.nominal_gap())
            .map_err(|error| Failure::from_core(&surface.name, error))?;
        let carrier = surface.structure.as_ref().filter(|_| !surface.rigid);
        Ok(Some(Self {
            contact,
            name: surface_name(settings.contacts.len(), surface, contact),
            shape,
            rows,
            around,
            gap: own.nominal_gap(),
            carrier: carrier.and_then(|name| settings.structures.iter().position(|own| own.name == *name)),
            wear: own.coating.map(|_| wear_name(settings.contacts.len(), surface)),
        }))
    }

    /// Returns the prescribed change of the radius (m) at `around` equal angles, from 0.
    pub(crate) fn radius_changes(&self, drive: &PrescribedMotion, around: usize) -> impl Iterator<Item = f64> {
        (0..around).map(move |i| {
            let angle = TAU * i as f64 / around as f64;
            let shape = drive.shape_factor * self.shape.evaluate(angle - drive.shape_rotation).0;
            shape + drive.radius_change + drive.gap_offset
        })
    }
}

/// Returns the unique name of the surface of a contact.
fn surface_name(contacts: usize, surface: &SurfaceSettings, contact: usize) -> String {
    if contacts > 1 { format!("{}_surface_{}", surface.name, contact + 1) } else { format!("{}_surface", surface.name) }
}

/// Returns the name of the output with the wear of each cell.
fn wear_name(contacts: usize, surface: &SurfaceSettings) -> String {
    if contacts > 1 { format!("{}.wear_depth", surface.name) } else { "wear_depth".to_owned() }
}

/// Returns radius and axial position (m) of `along` + 1 rings of points on the round surface of a contact: between its
/// first and its last contact node, at the distance of the nominal gap. `None` without contact nodes.
fn contour(rom: &Rom, contact: &ContactSettings, along: usize) -> Option<Vec<[f64; 2]>> {
    let start = contact.nodes.as_deref().unwrap_or_default();
    let nodes = rom.contact_nodes.iter().filter(|node| node.name.starts_with(start));
    let mut places: Vec<[f64; 2]> = nodes.map(|node| [node.position[2], node.position[0]]).collect();
    places.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (first, last) = (places.first()?, places.last()?);
    let half = if last[0] - first[0] > FLAT * first[1] { 0.0 } else { HALF_STRIP * first[1] };
    let [low, high] = [first[0] - half, last[0] + half];
    let radius = |z: f64| {
        let above = places.partition_point(|place| place[0] <= z);
        if above == 0 || above == places.len() {
            return places[above.saturating_sub(1)][1];
        }
        let ([from, a], [to, b]) = (places[above - 1], places[above]);
        a + (b - a) * (z - from) / (to - from)
    };
    let ring = |k: usize| {
        let z = low + (high - low) * k as f64 / along as f64;
        [radius(z) + contact.nominal_gap(), z]
    };
    Some((0..=along).map(ring).collect())
}
