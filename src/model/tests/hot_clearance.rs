//! Hot running clearance against closed forms: a bar that rotates in a ring, both warm.
//!
//! A bar from radius a to b of constant section, clamped at a, without lateral contraction, extends at its tip by
//! ρΩ²/E (b²(b − a)/2 − (b³ − a³)/6) due to the rotation and by αΔT(b − a) due to the temperature; a free ring of
//! inner radius R expands by αΔT R.

use std::f64::consts::TAU;

use guide::print_row;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_core::scene::settings::StructureSettings;
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_model::casing::{ContactRings, InnerContour, RingCounts, RingGeometry, RingSupport};
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Mesh;
use tiprub_model::progress::silent;
use tiprub_model::reduce::{ContactPoint, ReductionKind, ReductionOptions};
use tiprub_model::stress::StressPlaces;
use tiprub_model::{CasingOptions, FeModel, Material, reduce_model, reduce_ring};
use tiprub_test_models as models;

mod common;
#[path = "../../../tests/guide.rs"]
mod guide;
use common::{nodes_at, straight_box};

const ROOT: f64 = 0.18;
const TIP: f64 = 0.25;
const GAP: f64 = 8e-4;
const SPEED: f64 = 1800.0;
/// Places of stress on the axis of the bar, as fractions of its length; meshes with 3 and 12 elements have nodes
/// there.
const PLACES: [f64; 3] = [1.0 / 3.0, 2.0 / 3.0, 1.0];

fn metal() -> Material {
    Material { young_modulus: 200e9, poisson_ratio: 0.0, expansion: 10e-6, ..Material::maraging_steel() }
}

/// Returns the bar with `elements` along its length.
fn bar(elements: usize, kind: ReductionKind) -> Rom {
    let [length, wide, high] = [TIP - ROOT, 0.006, 0.006];
    let mut mesh: Mesh = straight_box(ElementKind::Hex20, [elements, 2, 2], [length, wide, high]);
    for x in &mut mesh.nodes {
        *x = [x[0] + ROOT, x[1] - 0.5 * wide, x[2] - 0.5 * high];
    }
    let clamped = nodes_at(&mesh, 0, ROOT);
    let middle = nodes_at(&mesh, 0, TIP);
    let off_axis = |node: &usize| mesh.nodes[*node][1].hypot(mesh.nodes[*node][2]);
    let tip = *middle.iter().min_by(|a, b| off_axis(a).total_cmp(&off_axis(b))).unwrap();
    let on_axis =
        |x: f64| nodes_at(&mesh, 0, x).into_iter().min_by(|a, b| off_axis(a).total_cmp(&off_axis(b))).unwrap();
    let places = PLACES.map(|share| (format!("at_{:.0}", 100.0 * share), on_axis(ROOT + share * length))).to_vec();
    let options = ReductionOptions {
        name: "bar".into(),
        kind,
        modes: 6,
        checked_modes: 6,
        sectors: 8,
        frame: DisplacementFrame::Cylindrical,
        watched: Vec::new(),
        stress: StressPlaces { nodes: places, modes: 0 },
        damping_ratio: 0.01,
    };
    let model = FeModel::assembled(mesh, &metal(), String::new(), &silent).unwrap();
    let contact = [ContactPoint::at("tip", tip, 0.0)];
    reduce_model(model, &clamped, &contact, &options, Some(SPEED), &silent).unwrap().rom
}

fn ring() -> (Rom, f64) {
    let radius = TIP + GAP;
    let options = CasingOptions {
        name: "ring".into(),
        geometry: RingGeometry {
            contour: InnerContour::new(&[[-0.02, radius], [0.02, radius]]).unwrap(),
            thickness: 4e-3,
            flanges: [None, None],
        },
        counts: RingCounts { around: 72, through: 1, along: 4, flange: 1 },
        rings: ContactRings { around: 36, along: 3, axial: [-0.01, 0.01] },
        patches: [4, 1],
        fixed_interface_modes: 12,
        modes: 30,
        checked_modes: 10,
        support: RingSupport::Free,
        ..CasingOptions::default()
    };
    (reduce_ring(&options, &silent).unwrap().rom, options.material.expansion)
}

/// Creates a scene in which the bar rotates in the ring, with growth and both temperatures.
fn scene(blade: Rom, casing: Rom) -> Scene {
    let mut scene = models::round(blade);
    scene.settings.surfaces[0].moving = false;
    models::on_ring(&mut scene, casing, 0.01);
    let [rotor, ring] = &mut scene.settings.structures[..] else { unreachable!() };
    (rotor.thermal, rotor.spin.growth, rotor.speed) = (true, true, 0.0);
    *ring = StructureSettings { thermal: true, ..ring.clone() };
    scene.settings.contacts[0].gap = GAP;
    scene.settings.time.step = 5e-7;
    scene.settings.outputs.watched_sectors = vec![1];
    scene
}

/// Returns the static clearance at the tip (m) at this speed (rad/s) and these temperatures (K) of rotor and casing.
fn clearance(scene: &Scene, speed: f64, [rotor, casing]: [f64; 2]) -> f64 {
    let mut run = Simulation::new(scene).unwrap();
    models::set(&mut run, "speed", speed);
    models::set(&mut run, "rotor_temperature", rotor);
    (0..4).for_each(|patch| models::set_element(&mut run, "casing_temperature", patch, casing));
    run.initialise(0.0).unwrap();
    models::element(&run, "blade[1].clearance", 0)
}

#[test]
fn hot_running_clearance_matches_closed_form() {
    let (casing, casing_expansion) = ring();
    let scene = scene(bar(12, ReductionKind::FixedInterface), casing);
    let material = metal();
    for (state, speed, temperatures) in [
        ("cold, at rest", 0.0, [0.0, 0.0]),
        ("cold, running", SPEED, [0.0, 0.0]),
        ("blades warm", 0.0, [400.0, 0.0]),
        ("casing warm", 0.0, [0.0, 250.0]),
        ("hot, running", SPEED, [400.0, 250.0]),
        ("hot reslam", SPEED, [400.0, 60.0]),
    ] {
        let growth = material.density * speed * speed / material.young_modulus
            * (0.5 * TIP * TIP * (TIP - ROOT) - (TIP.powi(3) - ROOT.powi(3)) / 6.0);
        let expansion = material.expansion * temperatures[0] * (TIP - ROOT);
        let opening = casing_expansion * temperatures[1] * (TIP + GAP);
        let expected = GAP - growth - expansion + opening;
        let found = clearance(&scene, speed, temperatures);
        let (millimetres, error) = ([expected, found].map(|value| 1e3 * value), 1e9 * (found - expected));
        print_row!(
            "| {state} | {speed} | {} | {} | {:.4} | {:.4} | {error:.2} |",
            temperatures[0],
            temperatures[1],
            millimetres[0],
            millimetres[1]
        );
        assert!(error.abs() < 1.0, "{state}: {error} nm");
    }
    guide::hold("cargo test -p tiprub-model --test hot_clearance");
}

/// The free expansion at the contact nodes is that of the mesh for any kept modes, and agrees with the closed form,
/// since the basis contains static responses to forces there.
#[test]
fn both_reductions_reproduce_thermal_expansion_of_the_mesh() {
    let expected = metal().expansion * 100.0 * (TIP - ROOT);
    for (elements, tolerance) in [(3, 1e-3), (12, 1e-6)] {
        let kinds = [ReductionKind::FixedInterface, ReductionKind::FreeInterface];
        let found = kinds.map(|kind| {
            let rom = bar(elements, kind);
            let thermal = rom.extras.thermal.as_ref().unwrap();
            let patch = thermal.patches[0];
            assert!(thermal.patches.len() == 1 && (patch.angle[1] - TAU).abs() < 1e-12);
            let moved = &rom.contact_map * rom.stiffness.clone().cholesky().unwrap().solve(&thermal.loads) * 100.0;
            assert!(moved[(1, 0)].abs() < 1e-8 * expected && moved[(2, 0)].abs() < 1e-8 * expected);
            moved[(0, 0)] / expected - 1.0
        });
        println!("{elements} elements: {:.1e}, between the reductions {:.1e}", found[0], found[0] - found[1]);
        assert!(found[0].abs() < tolerance && (found[0] - found[1]).abs() < 1e-8, "{elements}: {found:?}");
    }
}

/// A warm rotating bar carries the centrifugal force of its outer part: σ = ρΩ²(b² − x²)/2, for any softening by heat
/// and any number of modes. The modes alone would give a constant, since they represent an end force.
#[test]
fn stress_of_hot_rotating_bar_matches_closed_form() {
    let root = metal().density * SPEED * SPEED * (TIP * TIP - ROOT * ROOT) / 2.0;
    for (kind, softening, factor) in
        [(ReductionKind::FixedInterface, 0.0, 1.0), (ReductionKind::FreeInterface, 3e-4, 1.1)]
    {
        let rom = bar(12, kind);
        let alone = {
            let load = nalgebra::DVector::from_column_slice(&rom.extras.spin.as_ref().unwrap().centrifugal_load);
            let moved = rom.stiffness.clone().cholesky().unwrap().solve(&load) * (SPEED * SPEED);
            &rom.extras.stress.as_ref().unwrap().map * moved
        };
        let mut scene = models::round(rom);
        let rotor = &mut scene.settings.structures[0];
        (rotor.thermal, rotor.spin.growth, rotor.speed, rotor.softening) = (true, true, SPEED, softening);
        rotor.frequency_factors = vec![factor; 8];
        scene.settings.contacts[0].gap = 2e-3;
        (scene.settings.outputs.stress, scene.settings.outputs.watched_sectors) = (true, vec![1]);
        let mut run = Simulation::new(&scene).unwrap();
        models::set(&mut run, "rotor_temperature", 400.0);
        run.initialise(0.0).unwrap();
        models::go(&mut run, 1e-4);
        for (place, share) in (0_u32..).zip(PLACES) {
            let x = ROOT + share * (TIP - ROOT);
            let expected = metal().density * SPEED * SPEED * (TIP * TIP - x * x) / 2.0;
            let found = models::element(&run, "blade[1].radial_stress", place);
            let modes = alone[6 * place as usize];
            println!(
                "{kind:?} at {x:.4} m: {:.2} MPa, {:.2} closed, {:.2} of the modes",
                found / 1e6,
                expected / 1e6,
                modes / 1e6
            );
            assert!((found - expected).abs() < 5e-3 * root, "{found:e} {expected:e}");
            assert!(place == 1 || (modes - expected).abs() > 0.1 * root, "the modes alone would do");
        }
    }
}
