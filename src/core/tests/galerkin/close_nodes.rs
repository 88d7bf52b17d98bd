//! Contact nodes that almost coincide, in an elastic casing: their contact problem is almost singular.

use super::{H, STEPS, scene};
use nalgebra::DMatrix;
use tiprub_core::Scene;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::rom::ContactNode;
use tiprub_test_models::{flexible, go, started};

/// Returns the scene in an elastic casing, with one more contact node at a distance `offset` (m) around the axis from the first one.
fn scene_with_close_nodes(offset: f64) -> Scene {
    let mut scene = scene(Scheme::Galerkin, H, 1e-3);
    let rom = &mut scene.roms[0];
    let rows = rom.contact_map.nrows();
    rom.contact_map = DMatrix::from_fn(rows + 3, rom.order(), |row, mode| rom.contact_map[(row % rows, mode)]);
    let node = rom.contact_nodes[0].clone();
    let [radius, angle, z] = node.position;
    let (name, position) = (format!("{}_again", node.name), [radius, angle + offset / radius, z]);
    rom.contact_nodes.push(ContactNode { name, position, ..node });
    flexible(&mut scene);
    scene
}

/// Almost coincident nodes have dependent contact forces. They need about as many steps as nodes that coincide.
#[test]
fn almost_coincident_nodes_need_no_shorter_steps() {
    let tried = |offset: f64| {
        let mut simulation = started(&scene_with_close_nodes(offset));
        (0..STEPS).for_each(|_| go(&mut simulation, H));
        assert!(simulation.system().ledger().friction_loss.value() > 1.0);
        simulation.system().steps_tried() as f64
    };
    let coincident = tried(0.0);
    for offset in [1e-8, 1e-7, 1e-6, 1e-5, 1e-4] {
        let ratio = tried(offset) / coincident;
        println!("offset {offset:e} m: {ratio:.3}");
        assert!((0.8..1.25).contains(&ratio), "{offset:e} m: {ratio}");
    }
}
