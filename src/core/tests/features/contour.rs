//! Slopes of the tip contour in a ROM, against its positions.

use tiprub_core::scene::settings::Meridian;
use tiprub_core::{Scene, Simulation};
use tiprub_test_models as models;

/// Returns twelve blades whose radii fall by 0.2 m per m along the axis, with these slopes.
fn tapered(slopes: [f64; 3]) -> Scene {
    let mut scene = models::rub(12);
    for (node, slope) in scene.roms[0].contact_nodes.iter_mut().zip(slopes) {
        node.position[0] = models::RADIUS - 0.2 * node.position[2];
        node.meridional_slope = slope;
    }
    scene
}

fn on_ring(slopes: [f64; 3]) -> Scene {
    let mut scene = tapered(slopes);
    models::flexible(&mut scene);
    scene
}

#[track_caller]
fn refused(scene: &Scene, parts: &[&str]) {
    let message = Simulation::new(scene).unwrap_err().to_string();
    assert!(parts.iter().all(|part| message.contains(part)), "{parts:?} are not all in {message:?}");
}

#[test]
fn rejects_slopes_that_contradict_the_positions() {
    let named = [
        "ROM `blade`, array `contact_meridional_slopes`",
        "`leading_edge` and `mid_chord`",
        "increase by -0.2 m per m",
    ];
    for scene in [tapered, on_ring] {
        Simulation::new(scene([-0.2; 3])).unwrap();
        // A wrong sign, and an angle in degrees.
        for wrong in [0.2, -11.3] {
            refused(&scene([wrong; 3]), &named);
        }
        // One slope alone, in addition to the curvature of the contour.
        refused(&scene([-0.2, -0.2, 1.2]), &["`mid_chord` and `trailing_edge`", "slopes -0.2 and 1.2"]);
    }
}

/// Zero slopes are a cylinder if the surface takes its normals from slopes, and have no effect if it follows the
/// positions.
#[test]
fn missing_slopes_default_to_a_cylinder() {
    let mut scene = tapered([0.0; 3]);
    refused(&scene, &["slopes 0 and 0", "increase by -0.2 m per m", "meridian = \"cylinder\""]);
    scene.settings.contacts[0].meridian = Meridian::Cylinder;
    Simulation::new(&scene).unwrap();
    Simulation::new(on_ring([0.0; 3])).unwrap();
}
