//! Scenes of several structures and pairs.

use tiprub_core::Scene;
use tiprub_core::scene::method::Solver;
use tiprub_core::scene::settings::{BodyMotion, Shape, StructureSettings};

/// Assigns each of the blades' three nodes to a separate pair, all against the same casing.
pub fn split(scene: &Scene) -> Scene {
    let mut split = scene.clone();
    let names: Vec<String> = scene.roms[0].contact_nodes.iter().map(|node| node.name.clone()).collect();
    (split.settings.surfaces, split.settings.contacts) = (Vec::new(), Vec::new());
    for name in names {
        let mut surface = scene.settings.surfaces[0].clone();
        surface.name = format!("over_{name}");
        let mut contact = scene.settings.contacts[0].clone();
        (contact.slave, contact.nodes) = (surface.name.clone(), Some(name));
        split.settings.surfaces.push(surface);
        split.settings.contacts.push(contact);
    }
    split
}

/// Duplicates the rotor of the scene as `rear`, further along the axis, with a separate casing; the names of the first
/// one begin with `front`.
pub fn two_rotors(mut scene: Scene, shift: f64, change: impl Fn(&mut StructureSettings)) -> Scene {
    let settings = &mut scene.settings;
    settings.structures[0].name = "front".into();
    settings.surfaces[0].name = "front_casing".into();
    (settings.contacts[0].master, settings.contacts[0].slave) = ("front".into(), "front_casing".into());
    let mut rear = settings.structures[0].clone();
    rear.name = "rear".into();
    change(&mut rear);
    settings.structures.insert(1, rear);
    let mut surface = settings.surfaces[0].clone();
    surface.name = "rear_casing".into();
    settings.surfaces.push(surface);
    let mut contact = settings.contacts[0].clone();
    (contact.master, contact.slave) = ("rear".into(), "rear_casing".into());
    settings.contacts.push(contact);
    let mut rom = scene.roms[0].clone();
    rom.contact_nodes.iter_mut().for_each(|node| node.position[2] += shift);
    scene.roms.insert(1, rom);
    scene
}

/// Returns `count` copies of the scene in one scene, with numbered names of structures and surfaces.
pub fn copies(scene: &Scene, count: usize) -> Scene {
    let (mut many, settings) = (scene.clone(), &scene.settings);
    (many.settings.structures, many.settings.surfaces, many.settings.contacts) = (Vec::new(), Vec::new(), Vec::new());
    let numbered = |name: &str, index: usize| format!("{name}_{index}");
    for index in 0..count {
        for structure in &settings.structures {
            let name = numbered(&structure.name, index);
            many.settings.structures.push(StructureSettings { name, ..structure.clone() });
        }
        for surface in &settings.surfaces {
            let mut surface = surface.clone();
            surface.name = numbered(&surface.name, index);
            surface.structure = surface.structure.map(|name| numbered(&name, index));
            many.settings.surfaces.push(surface);
        }
        for contact in &settings.contacts {
            let mut contact = contact.clone();
            (contact.master, contact.slave) = (numbered(&contact.master, index), numbered(&contact.slave, index));
            many.settings.contacts.push(contact);
        }
    }
    many.roms = std::iter::repeat_n(&scene.roms, count).flatten().cloned().collect();
    many
}

/// Returns two rotors in one elastic ring.
pub fn in_one_casing(mut scene: Scene, solver: Solver, friction: f64) -> Scene {
    scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.position[2] *= 0.4);
    let mut scene = two_rotors(scene, 0.03, |rear| rear.speed = -1100.0);
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring".into(),
        motion: BodyMotion::Still,
        damping_ratio: Some(0.01),
        ..StructureSettings::default()
    });
    scene.roms.push(crate::ring(36, 8));
    for pair in 0..2 {
        scene.settings.surfaces[pair].structure = Some("ring".into());
        scene.settings.contacts[pair].solver = solver;
        scene.settings.contacts[pair].friction = friction * (1.0 + pair as f64);
    }
    scene
}

/// Lets two nodes of each blade touch the casing and the third a seal of smaller radius with another friction
/// coefficient.
pub fn tip_and_seal(mut scene: Scene, solver: Solver) -> Scene {
    scene.roms[0].contact_nodes[2].position[0] = 0.2;
    scene.roms[0].contact_nodes[0].name = "tip_1".into();
    scene.roms[0].contact_nodes[1].name = "tip_2".into();
    scene.roms[0].contact_nodes[2].name = "seal_1".into();
    let mut seal = scene.settings.surfaces[0].clone();
    (seal.name, seal.shape) = ("seal".into(), Shape::Lobes { amplitude: 3e-4, order: 2, phase: 1.0 });
    scene.settings.surfaces.push(seal);
    let mut contact = scene.settings.contacts[0].clone();
    (contact.slave, contact.nodes) = ("seal".into(), Some("seal_".into()));
    (contact.gap, contact.friction) = (3e-4, 0.05);
    scene.settings.contacts[0].friction = 0.1;
    scene.settings.contacts.push(contact);
    scene.settings.contacts[0].nodes = Some("tip_".into());
    scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = solver);
    scene
}
