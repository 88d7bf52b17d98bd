//! The default casing, around rotor 37.
//!
//! The geometry is our own design: NASA TP-1659 describes the flow path, not the wall of the rig. The inner contour
//! is the natural cubic spline along the axis through three rings of contact nodes, so that the mesh and the contact
//! surface coincide. The radii of the rings are chosen so that the radial gap to the leading edge, mid-chord and
//! trailing edge of the blade is [`TIP_GAP`]; between them it follows the tip of the blade to a few hundredths of a
//! millimetre. Beyond the rings the contour continues straight, as the spline does.

use nalgebra::{Matrix3, Vector3};

use super::{CasingOptions, ContactRings, Flange, InnerContour, RingCounts, RingGeometry, RingSupport};
use crate::element::ElementKind;
use crate::material::Material;
use crate::rotor37::{MeshCounts, TIP_GAP, blade_mesh};

/// Name of the default casing.
pub const CASING37: &str = "casing37";

/// Axial extent (m); the tip of the blade is at 6.4 to 34.2 mm.
const AXIAL: [f64; 2] = [-0.038, 0.042];
/// Axial positions of the first and the last contact ring (m): 3.8 mm before and behind the blade tip; the third ring
/// is in the middle.
const RINGS: [f64; 2] = [2.6e-3, 38.0e-3];
/// Points of the contour between two rings.
const POINTS: u32 = 36;

impl Default for CasingOptions {
    /// Returns casing37: steel, 4 mm thick, clamped at the end face of a flange of 5 mm x 10 mm at low z, with a
    /// flange of 4 mm x 6 mm at high z.
    fn default() -> Self {
        let flanges = [Flange { thickness: 5e-3, height: 10e-3 }, Flange { thickness: 4e-3, height: 6e-3 }].map(Some);
        let geometry = RingGeometry { contour: casing37_contour(), thickness: 4e-3, flanges };
        Self {
            name: CASING37.into(),
            geometry,
            counts: RingCounts { around: 72, through: 1, along: 12, flange: 1 },
            kind: ElementKind::Hex20,
            material: Material::steel(),
            support: RingSupport::Low,
            rings: ContactRings { around: 24, along: 3, axial: RINGS },
            patches: [12, 1],
            fixed_interface_modes: 156,
            modes: 60,
            checked_modes: 20,
            damping_ratio: 0.005,
        }
    }
}

/// Returns the inner contour of casing37.
pub fn casing37_contour() -> InnerContour {
    let blade = blade_mesh(MeshCounts::default()).expect("the built-in blade can be meshed");
    let contact = blade.contact_points(3).expect("the tip has three nodes");
    let tip: Vec<[f64; 3]> = contact.iter().map(|point| blade.mesh.nodes[point.node]).collect();
    // Weights of the three rings at the three nodes, from the splines of unit vectors.
    let weights = Matrix3::from_fn(|node, ring| {
        let unit = core::array::from_fn(|other| if other == ring { 1.0 } else { 0.0 });
        natural_spline(unit, tip[node][2])
    });
    let wanted = Vector3::from_fn(|node, _| tip[node][0].hypot(tip[node][1]) + TIP_GAP);
    let radii = weights.lu().solve(&wanted).expect("the three tip nodes lie between different rings");
    let radius = |z| natural_spline(radii.into(), z);
    let last = 2 * POINTS;
    let inner = (0..=last).map(|i| RINGS[0] + (RINGS[1] - RINGS[0]) * f64::from(i) / f64::from(last));
    let mut points: Vec<[f64; 2]> = inner.map(|z| [z, radius(z)]).collect();
    points.insert(0, [AXIAL[0], radius(AXIAL[0])]);
    points.push([AXIAL[1], radius(AXIAL[1])]);
    InnerContour::new(&points).expect("the tip of the built-in blade gives a valid contour")
}

/// Evaluates the natural cubic spline through `values` at the three rings, straight beyond them.
fn natural_spline(values: [f64; 3], z: f64) -> f64 {
    let [first, last] = RINGS;
    let step = 0.5 * (last - first);
    let [before, after] = [values[1] - values[0], values[2] - values[1]];
    // Second derivative at the middle ring, times step²; those at the ends are zero.
    let bend = 1.5 * (after - before);
    let place = (z - first) / step;
    if place < 0.0 {
        return values[0] + place * (before - bend / 6.0);
    }
    if place > 2.0 {
        return values[2] + (place - 2.0) * (after + bend / 6.0);
    }
    let (from, to, t, near) = if place < 1.0 {
        (values[0], values[1], place, place)
    } else {
        (values[1], values[2], place - 1.0, 2.0 - place)
    };
    from + t * (to - from) + bend * (near * near * near - near) / 6.0
}
