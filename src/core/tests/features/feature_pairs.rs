//! Every pair of features, with fixed and with adaptive steps: either the energy balance closes while inputs move, and
//! states continue, or the scene is rejected by a rule. The table is in the guide.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::DMatrix;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::{STRESSES, SUPPORT_ROWS, SupportRows, Thermal, WatchedPoints};
use tiprub_core::scene::settings::{CuttingSettings, ExcitationSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::ThermalPatch;
use tiprub_test_models::{self as models, bits, disk::TestDisk, go, lattice, real, saved, set, started};

use crate::checks::disturb;

type Feature = (&'static str, fn(&mut Scene));

const FEATURES: [Feature; 15] = [
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
    ("rows", |scene| {
        let rom = &mut scene.roms[0];
        rom.contact_nodes.iter_mut().for_each(|node| node.area = 2e-5);
        rom.extras.rows = Some(rom.contact_nodes.len());
    }),
    ("coupled sectors", |scene| {
        let extras = std::mem::take(&mut scene.roms[0].extras);
        scene.roms[0] = TestDisk::random(4, 3, 18, 0.1, 7).cyclic();
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
    rom.extras.support = Some(SupportRows { stiffness: rows(1e6), mass: rows(0.1), thermal });
}

/// Returns four blades that rub, whose ROM has the data for every feature.
fn rubbing() -> Scene {
    let mut rom = models::rich_blade(4);
    let order = rom.order();
    let loads = DMatrix::from_fn(order, 1, |row, _| 2.0 + 1.5 * (row as f64).sin());
    rom.extras.thermal = Some(Thermal { loads, patches: vec![ThermalPatch { angle: [0.0, TAU], axial: [-1.0, 1.0] }] });
    rom.extras.spin = Some(models::spin(order));
    let map = DMatrix::from_fn(STRESSES, order, |row, mode| 1e11 * ((row + mode) as f64).sin());
    rom.extras.stress = Some(WatchedPoints { map, points: vec![rom.contact_nodes[0].clone()] });
    rom.extras.stress_thermal = Some(DMatrix::from_element(STRESSES, 1, 1e5));
    rom.extras.stress_centrifugal = Some(DMatrix::from_element(STRESSES, 1, 10.0));
    models::bumps(rom)
}

/// Combines two features in one scene. Coupled sectors replace the ROM, so they come first.
fn together(first: Feature, second: Feature) -> Scene {
    let mut scene = rubbing();
    let mut pair = [first, second];
    pair.sort_by_key(|(name, _)| *name != "coupled sectors");
    pair.into_iter().for_each(|(_, change)| change(&mut scene));
    scene
}

fn with_fixed_steps(mut scene: Scene) -> Scene {
    (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::ModalExact, 1e-6);
    scene
}

fn with_adaptive_steps(mut scene: Scene) -> Scene {
    (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::Galerkin, 5e-5);
    scene.settings.time.tolerance = Some(1e-2);
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

/// Returns whether the balance of a scene closes and its states continue, or the rule that rejects it.
fn outcome(name: &str, scene: &Scene) -> Result<(), String> {
    let rejected = |error: tiprub_core::Error| {
        assert!(matches!(error, tiprub_core::Error::Invalid { .. }), "{name}: {error}");
        error.to_string()
    };
    let mut run = Simulation::new(scene).map_err(rejected)?;
    run.initialise(0.0).map_err(rejected)?;
    let worst = steps(&mut run, 0, 40);
    assert!(worst < 1e-9, "{name}: {worst:e}");
    let state = saved(&run);
    let mut other = started(scene);
    other.restore_state(&state).unwrap();
    let ends = [&mut run, &mut other].map(|run| {
        steps(run, 40, 8);
        bits(run)
    });
    assert!(ends[0] == ends[1], "{name}: a state does not continue with the same bits");
    Ok(())
}

/// The table of the guide and the rules below it.
struct Matrix {
    text: String,
    /// Rules, and the pairs that each of them rejects.
    rules: BTreeMap<String, Vec<String>>,
    /// Rejections of single features, which are not repeated for pairs.
    alone: BTreeSet<(&'static str, String)>,
}

impl Matrix {
    /// Returns the cell of a pair: both, fixed steps only, or rejected.
    fn cell(&mut self, [first, second]: [&'static str; 2], scene: &Scene) -> &'static str {
        let pair = if first == second { first.to_owned() } else { format!("{first} with {second}") };
        let fixed = outcome(&format!("{pair}, fixed steps"), &with_fixed_steps(scene.clone()));
        let adaptive = outcome(&format!("{pair}, adaptive steps"), &with_adaptive_steps(scene.clone()));
        let (cell, rule, steps) = match (fixed, adaptive) {
            (Ok(()), Ok(())) => return "yes",
            (Ok(()), Err(rule)) => ("fixed", rule, " (adaptive steps)"),
            (Err(rule), Err(_)) => ("no", rule, ""),
            (Err(rule), Ok(())) => panic!("{pair}: only adaptive steps are accepted: {rule}"),
        };
        let rule = rule.split(". ").next().unwrap_or(&rule).to_owned();
        if first == second {
            self.alone.insert((first, rule.clone()));
        } else if [first, second].iter().any(|one| self.alone.contains(&(*one, rule.clone()))) {
            return cell;
        }
        self.rules.entry(rule).or_default().push(pair + steps);
        cell
    }
}

#[test]
fn every_pair_of_features_runs_or_is_rejected_by_a_rule() {
    let mut matrix = Matrix { text: String::new(), rules: BTreeMap::new(), alone: BTreeSet::new() };
    let count = FEATURES.len();
    let mut cells = vec![vec![""; count + 1]; count];
    // Single features first.
    let pairs = (0..count).flat_map(|apart| (0..count - apart).map(move |row| (row, row + apart)));
    for (row, column) in pairs {
        let [first, second] = [FEATURES[row], FEATURES[column]];
        cells[row][column] = matrix.cell([first.0, second.0], &together(first, second));
    }
    for (row, (name, change)) in FEATURES.iter().enumerate() {
        let mut scene = lattice::squeezed();
        change(&mut scene);
        cells[row][count] = matrix.cell([name, "a free body"], &scene);
    }
    let names: Vec<&str> = FEATURES.iter().map(|(name, _)| *name).chain(["a free body"]).collect();
    let _ = writeln!(matrix.text, "| | {} |\n|---{}|", names.join(" | "), "|---".repeat(names.len()));
    for (name, row) in names.iter().zip(&cells) {
        let _ = writeln!(matrix.text, "| {name} | {} |", row.join(" | "));
    }
    matrix.text.push('\n');
    for (rule, pairs) in &matrix.rules {
        let _ = writeln!(matrix.text, "* {}: {rule}", pairs.join("; "));
    }
    compare(&matrix.text);
}

/// Compares the generated part of the page; `UPDATE_SNAPSHOTS=1` writes it.
fn compare(expected: &str) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/feature-pairs.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let begin = "<!-- generated: pairs of features -->\n";
    let (before, rest) = text.split_once(begin).expect("start mark");
    let (found, after) = rest.split_once("<!-- end of generated part -->").expect("end mark");
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        let text = format!("{before}{begin}{expected}<!-- end of generated part -->{after}");
        std::fs::write(page, text).unwrap();
    } else {
        let difference = expected.lines().zip(found.lines()).find(|(expected, found)| expected != found);
        assert_eq!(difference, None, "run with UPDATE_SNAPSHOTS=1 to write the page anew");
        assert_eq!(expected, found);
    }
}
