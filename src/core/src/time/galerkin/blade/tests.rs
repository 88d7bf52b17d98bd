//! Whole rubs with every instruction set of the processor.

use crate::math::simd::{CHOSEN, InstructionSet};
use crate::scene::method::Scheme;
use crate::scene::rom::{ContactNode, DisplacementFrame, Rom, RomChecks, RomExtras};
use crate::scene::settings::{
    BodyMotion, ContactSettings, ExperimentSettings, OutputSettings, Preset, SceneSettings, Shape, StructureSettings,
    SurfaceSettings, TimeSettings,
};
use crate::{CoSimulation, Scene, Simulation};
use nalgebra::{DMatrix, DVector};

const SECTORS: usize = 3;

/// Blades of eight slow modes and the local flexibility of their nodes.
fn blades(nodes: usize) -> Rom {
    let order = 8 + 3 * nodes;
    let frequency = |mode: usize| {
        let mode = mode as f64;
        if mode < 8.0 { 850.0 * (1.0 + mode).powf(1.7) } else { 45_000.0 + 5_000.0 * mode }
    };
    let squares = (0..order).map(|mode| (std::f64::consts::TAU * frequency(mode)).powi(2));
    let shape = |row: usize, mode: usize| {
        let size = [0.25, 1.0, 0.4][row % 3];
        match mode.checked_sub(8) {
            None => 4.0 * size * (0.2 * (row / 3) as f64 + 1.3 * mode as f64 + 2.1 * (row % 3) as f64).cos(),
            Some(local) if local == row => 40.0,
            Some(_) => 0.3 * (mode as f64 + 1.9 * row as f64).sin(),
        }
    };
    let node = |node: usize| ContactNode {
        name: format!("node_{node}"),
        position: [0.25, 0.01 * (node % 3) as f64, 0.004 * node as f64],
        meridional_slope: -0.2 + 0.03 * node as f64,
        ..ContactNode::default()
    };
    Rom {
        name: "blade".into(),
        origin: "written down for a test".into(),
        sectors: SECTORS,
        frame: DisplacementFrame::Cylindrical,
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_diagonal(&DVector::from_iterator(order, squares)),
        damping_ratio: 0.005,
        contact_map: DMatrix::from_fn(3 * nodes, order, shape),
        contact_nodes: (0..nodes).map(node).collect(),
        checks: RomChecks::default(),
        extras: RomExtras::default(),
    }
}

fn rub(nodes: usize, shape: Shape, friction: f64) -> Scene {
    let rotor = StructureSettings {
        name: "rotor".into(),
        rom: "rotor".into(),
        motion: BodyMotion::Rotating,
        speed: 1300.0,
        ..StructureSettings::default()
    };
    let casing = SurfaceSettings { name: "casing".into(), shape, ramp_time: 3e-4, ..SurfaceSettings::default() };
    let contact = ContactSettings {
        master: "rotor".into(),
        slave: "casing".into(),
        gap: 3.5e-4,
        friction,
        ..ContactSettings::default()
    };
    let settings = SceneSettings {
        name: "rub".into(),
        description: String::new(),
        preset: Preset::None,
        accept_implausible: false,
        silence: Vec::new(),
        structures: vec![rotor],
        surfaces: vec![casing],
        contacts: vec![contact],
        time: TimeSettings { scheme: Scheme::Galerkin, step: 4e-5, tolerance: Some(1e-2), ..TimeSettings::default() },
        outputs: OutputSettings { watched_sectors: vec![2], all_sectors: true, ..OutputSettings::default() },
        experiment: ExperimentSettings { start: 0.0, stop: 0.01, communication_step: 4e-5 },
    };
    Scene { settings, roms: vec![blades(nodes)] }
}

/// Saved state and smallest clearances at the end of a run, and its number of trials.
fn run(scene: &Scene, instructions: InstructionSet) -> (Vec<u8>, Vec<u64>, u64) {
    CHOSEN.set(Some(instructions));
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.initialise(0.0).unwrap();
    let mut smallest = Vec::new();
    for _ in 0..40 {
        simulation.do_step(simulation.time(), 4e-5).unwrap();
        for name in ["clearance_minimum", "sector_clearance_minimum", "torque", "normal_force_peak"] {
            let reference = simulation.table().find(name).unwrap().reference;
            smallest.push(simulation.real(reference).unwrap().to_bits());
        }
    }
    CHOSEN.set(None);
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap();
    (state, smallest, simulation.system().effort().trials)
}

#[test]
fn every_instruction_set_gives_the_same_rub() {
    let bumps = Shape::TwoLobe { depth: 1.1, width: 0.15, phase: 0.0 };
    let table =
        Shape::Table { radius_change: (0..24).map(|i| -4.6e-4 * (f64::from(i) * 0.9).sin().max(0.0)).collect() };
    for (nodes, shape, friction) in
        [(3, bumps.clone(), 0.15), (8, bumps.clone(), 0.0), (9, bumps, 0.1), (1, table, 0.1)]
    {
        let scene = rub(nodes, shape, friction);
        let expected = run(&scene, InstructionSet::Baseline);
        assert!(expected.2 > 20 * SECTORS as u64, "{nodes} nodes: {} trials", expected.2);
        let widest = InstructionSet::detect();
        assert!(run(&scene, widest) == expected, "{nodes} nodes, {widest:?}");
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            assert!(run(&scene, InstructionSet::Avx2) == expected, "{nodes} nodes, AVX2");
        }
    }
}
