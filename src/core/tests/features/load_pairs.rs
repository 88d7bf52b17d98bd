//! Heat, softening, stiffening, growth, mistuning, stress and the reaction of a support, each with every other feature: the energy balance
//! closes while inputs move, and states continue; or the scene is rejected by a rule.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use tiprub_core::rom::{Patch, STRESSES, SUPPORT_ROWS, Support, Thermal, Watched};
use tiprub_core::settings::{CuttingSettings, ExcitationSettings, Scheme, Solver};
use tiprub_core::{Scene, Simulation};
use tiprub_test_models::{self as models, bits, disk::Disk, go, lattice, real, saved, set, started, try_started};

use crate::checks::disturb;

type Feature = (&'static str, fn(&mut Scene));

/// The first seven are combined with all.
const FEATURES: [Feature; 14] = [
    ("heat", |scene| scene.settings.structures[0].thermal = true),
    ("softening", |scene| {
        let rotor = &mut scene.settings.structures[0];
        (rotor.thermal, rotor.softening) = (true, 4e-4);
    }),
    ("stiffening", |scene| scene.settings.structures[0].spin.stiffening = true),
    ("growth", |scene| scene.settings.structures[0].spin.growth = true),
    ("mistuning", |scene| {
        let factors = (0..scene.roms[0].sectors).map(|sector| 1.0 + 0.03 * (sector as f64).sin());
        scene.settings.structures[0].frequency_factors = factors.collect();
    }),
    ("stress", |scene| {
        (scene.settings.outputs.stress, scene.settings.outputs.watched_sectors) = (true, vec![1]);
    }),
    ("support reaction", |scene| {
        flexible(scene);
        scene.settings.outputs.support_reaction = true;
    }),
    ("excitation", |scene| {
        scene.settings.structures[0].excitation = Some(ExcitationSettings {
            order: 2,
            mode: Some(1),
            node: None,
            direction: None,
            amplitude: 3.0,
            phase: 0.0,
        });
    }),
    ("wear, pressed in", models::coating),
    ("wear, cut", |scene| {
        let mut coating = models::coating_of(1e-3, [500, 7]);
        (coating.modulus, coating.yield_stress, coating.hardening, coating.contact_width) = (0.0, 0.0, 0.0, None);
        coating.cutting = Some(CuttingSettings { specific_energy: 1e8, normal_ratio: 1.0 });
        scene.settings.contacts[0].coating = Some(coating);
    }),
    ("whirl", |scene| {
        (scene.settings.structures[0].whirl, scene.settings.structures[0].axial_shift) = (true, true);
    }),
    ("flexible casing", flexible),
    ("sticking", |scene| scene.settings.contacts[0].solver = Solver::Coulomb),
    ("coupled sectors", |scene| {
        let extras = std::mem::take(&mut scene.roms[0].extras);
        scene.roms[0] = Disk::random(4, 3, 18, 0.1, 7).cyclic();
        let rom = &mut scene.roms[0];
        let size = rom.mass[(0, 0)];
        (rom.extras.spin, rom.extras.thermal) = (extras.spin, extras.thermal);
        rom.extras.spin.iter_mut().flat_map(|spin| &mut spin.centrifugal_load).for_each(|load| *load *= size);
        rom.extras.thermal.iter_mut().for_each(|thermal| thermal.loads *= size);
    }),
];

fn flexible(scene: &mut Scene) {
    if scene.settings.structures.len() > 1 {
        return;
    }
    models::flexible(scene);
    let rom = &mut scene.roms[1];
    let rows =
        |size: f64| DMatrix::from_fn(SUPPORT_ROWS, rom.order(), |row, mode| size * ((row + 2 * mode) as f64).sin());
    let thermal = DMatrix::zeros(SUPPORT_ROWS, rom.extras.thermal.as_ref().map_or(0, |thermal| thermal.patches.len()));
    rom.extras.support = Some(Support { stiffness: rows(1e6), mass: rows(0.1), thermal });
}

/// Four blades that rub, whose ROM has what any feature needs.
fn rubbing() -> Scene {
    let mut rom = models::rich_blade(4);
    let order = rom.order();
    let loads = DMatrix::from_fn(order, 1, |row, _| 2.0 + 1.5 * (row as f64).sin());
    rom.extras.thermal = Some(Thermal { loads, patches: vec![Patch { angle: [0.0, TAU], axial: [-1.0, 1.0] }] });
    rom.extras.spin = Some(models::spin(order));
    let map = DMatrix::from_fn(STRESSES, order, |row, mode| 1e11 * ((row + mode) as f64).sin());
    rom.extras.stress = Some(Watched { map, points: vec![rom.contact_nodes[0].clone()] });
    rom.extras.stress_thermal = Some(DMatrix::from_element(STRESSES, 1, 1e5));
    rom.extras.stress_centrifugal = Some(DMatrix::from_element(STRESSES, 1, 10.0));
    let mut scene = models::bumps(rom);
    (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::ModalExact, 1e-6);
    scene
}

fn steps(run: &mut Simulation, from: u32, count: u32) -> f64 {
    let mut worst = 0.0_f64;
    for index in from..from + count {
        disturb(run, index);
        if run.table().find("rotor_temperature").is_some() {
            set(run, "rotor_temperature", 4.0 * f64::from(index));
        }
        go(run, 5e-5);
        worst = worst.max(real(run, "energy_residual_relative").abs());
    }
    worst
}

/// What comes of a scene: the largest residual of its balance, or which rule rejects it.
fn outcome(scene: &Scene) -> Result<f64, String> {
    let mut run = try_started(scene).map_err(|error| error.to_string())?;
    let worst = steps(&mut run, 0, 40);
    let state = saved(&run);
    let mut other = started(scene);
    other.restore_state(&state).unwrap();
    let ends = [&mut run, &mut other].map(|run| {
        steps(run, 40, 8);
        bits(run)
    });
    assert!(ends[0] == ends[1], "a state does not continue with the same bits");
    Ok(worst)
}

#[test]
fn every_pair_of_loads_and_features_closes_its_balance_or_is_rejected() {
    for (name, change) in &FEATURES[..7] {
        let mut cells = Vec::new();
        for (other, second) in &FEATURES {
            let mut scene = rubbing();
            // Coupled sectors bring their own ROM.
            second(&mut scene);
            change(&mut scene);
            let rejected =
                *other == "coupled sectors" && ["softening", "stiffening", "mistuning", "stress"].contains(name);
            match outcome(&scene) {
                Ok(worst) => {
                    assert!(!rejected && worst < 1e-9, "{name} with {other}: {worst:e}");
                    cells.push(format!("{worst:.0e}"));
                }
                Err(problem) => {
                    assert!(rejected, "{name} with {other}: {problem}");
                    cells.push("rejected".into());
                }
            }
        }
        // A free body has no speed, no temperature and no sectors.
        let mut scene = lattice::squeezed();
        change(&mut scene);
        let accepted = *name != "support reaction" && Simulation::new(&scene).is_ok();
        assert!(!accepted, "{name} of a free body");
        println!("| {name} | {} | rejected |", cells.join(" | "));
    }
}
