//! Contact nodes that are certainly open are not evaluated: in every step their gaps are lower bounds, smallest gaps are exact, and no
//! contact is missed.

use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{Closure, ContactSettings, Shape};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::disk::TestDisk;
use tiprub_test_models::{self as models, SeededRandom, flexible, go, real, rub, set, started};

const LENGTH: f64 = 2e-5;
const CLEARANCE: f64 = 3.56e-4;

/// Returns a rub in an elastic casing with two lobes or a round one, which random inputs move.
fn scene(rom: Rom, is_round: bool, all_sectors: bool) -> Scene {
    let mut scene = models::bumps(rom);
    flexible(&mut scene);
    if is_round {
        scene.settings.surfaces[0].shape = Shape::Circular {};
    }
    scene.settings.outputs.all_sectors = all_sectors;
    scene.settings.structures[0].whirl = true;
    scene.settings.time.step = 1e-6;
    scene
}

/// Compares gaps with those of a run that evaluates all of them.
fn compare_gaps(run: &Simulation, every: &Simulation, totals: &mut Totals) {
    for (gap, exact) in run.system().gaps().zip(every.system().gaps()).filter(|(_, exact)| exact.is_finite()) {
        assert!(gap - exact <= 1e-9 * CLEARANCE, "{gap:e} m is not a bound of {exact:e} m");
        totals.beyond = totals.beyond.max(gap - exact);
        totals.bounds += usize::from(exact - gap > 1e-6 * CLEARANCE);
        totals.gaps += 1;
    }
}

/// Compares the smallest gap of every node over all sectors and, if `all_sectors`, of every sector.
fn compare_smallest(run: &Simulation, every: &Simulation, all_sectors: bool) {
    let smallest = |run: &Simulation| {
        let structure = &run.system().structures()[0];
        let (gaps, lanes) = (structure.gaps(), structure.lanes());
        let least = |gaps: &mut dyn Iterator<Item = &f64>| gaps.copied().fold(f64::INFINITY, f64::min);
        let mut smallest: Vec<f64> = gaps.chunks(lanes).map(|row| least(&mut row.iter())).collect();
        for lane in 0..if all_sectors { structure.modes().sectors() } else { 0 } {
            smallest.push(least(&mut gaps.iter().skip(lane).step_by(lanes)));
        }
        smallest
    };
    for (own, expected) in smallest(run).iter().zip(&smallest(every)) {
        assert!((own - expected).abs() <= 1e-9 * CLEARANCE, "{own:e} m instead of {expected:e} m");
    }
}

/// The rubs are so irregular that a change of 2e-15 m grows to 1e-11 m in 3 ms. So each run is short.
#[test]
fn skipped_nodes_miss_no_contact() {
    let blade = || models::blade(12);
    let disk = || TestDisk::random(6, 2, 9, 0.25, 5).cyclic();
    let scenes = [
        scene(blade(), false, true),
        scene(blade(), true, false),
        scene(blade(), false, false),
        scene(disk(), false, false),
        scene(disk(), true, true),
    ];
    for (case, scene) in scenes.iter().enumerate() {
        let mut totals = Totals::default();
        (0..12).for_each(|seed| compare_runs(scene, LENGTH, 20 * case as u64 + seed, &mut totals));
        println!("case {case}: {totals:?}");
        assert!(totals.contacts > 100 && totals.bounds > totals.gaps / 20, "case {case}: {totals:?}");
        assert!(totals.worst <= 1e-6 * totals.largest, "case {case}: {totals:?}");
    }
}

/// With adaptive steps, blades that certainly stay open are left out of some steps. Inputs move the casing by up to
/// the clearance in a communication step, so that blades begin to touch within a communication step.
#[test]
fn blades_left_out_of_adaptive_steps_miss_no_contact() {
    let disk = || TestDisk::random(6, 2, 9, 0.25, 5).cyclic();
    let scenes = [scene(models::rich_blade(12), false, false), scene(disk(), false, false), scene(disk(), true, false)];
    for (case, mut scene) in scenes.into_iter().enumerate() {
        let time = &mut scene.settings.time;
        (time.scheme, time.step, time.tolerance) = (Scheme::Galerkin, 5e-5, Some(1e-2));
        let mut totals = Totals::default();
        (0..12).for_each(|seed| compare_runs(&scene, 5.0 * LENGTH, 20 * case as u64 + seed, &mut totals));
        println!("case {case}: {totals:?}");
        assert!(totals.contacts > 100, "case {case}: {totals:?}");
        assert!(totals.worst <= 1e-6 * totals.largest, "case {case}: {totals:?}");
    }
}

/// Numbers of contacts, gaps and bounds, largest force (N), largest difference of a force (N), and largest excess of a bound
/// over its gap (m), which is rounding.
#[derive(Debug, Default)]
struct Totals {
    contacts: usize,
    gaps: usize,
    bounds: usize,
    largest: f64,
    beyond: f64,
    worst: f64,
}

/// Compares a run with one that evaluates all gaps, under the same random inputs.
fn compare_runs(scene: &Scene, length: f64, seed: u64, totals: &mut Totals) {
    let mut every = scene.clone();
    // The gaps of watched sectors are always evaluated.
    every.settings.outputs.watched_sectors = (1..=every.roms[0].sectors).collect();
    let (mut run, mut every, mut random) = (started(scene), started(&every), SeededRandom(seed));
    for step in 0..20_u32 {
        let time = f64::from(step) * length;
        let inputs = [
            ("casing_radius_change", -3.6e-4 * (8000.0 * time).sin() + random.within(-2e-5, 2e-5)),
            ("whirl_x", random.within(-3e-5, 3e-5)),
            ("whirl_y", random.within(-3e-5, 3e-5)),
        ];
        for run in [&mut run, &mut every] {
            inputs.iter().for_each(|(name, value)| set(run, name, *value));
            run.begin_step(time, length).unwrap();
        }
        loop {
            let finished = run.advance().unwrap().finished;
            every.advance().unwrap();
            compare_contacts(&run, &every, totals);
            compare_gaps(&run, &every, totals);
            compare_smallest(&run, &every, scene.settings.outputs.all_sectors);
            if finished {
                break;
            }
        }
        let [own, expected] = [&run, &every].map(|run| real(run, "clearance_minimum"));
        assert!((own - expected).abs() <= 1e-9 * CLEARANCE, "{own:e} m instead of {expected:e} m");
    }
}

/// Compares the contacts of the last internal step.
fn compare_contacts(run: &Simulation, every: &Simulation, totals: &mut Totals) {
    let (own, expected) = (run.system().events(), every.system().events());
    assert_eq!(own.len(), expected.len(), "{own:?} instead of {expected:?}");
    for (a, b) in own.iter().zip(expected) {
        assert_eq!((a.node, a.sector), (b.node, b.sector));
        totals.worst = totals.worst.max((a.normal - b.normal).abs());
        totals.largest = totals.largest.max(b.normal);
        totals.contacts += 1;
    }
}

/// Mid-chord nodes touch a surface with free ends. Their forces do not depend on the other nodes, which face other surfaces of the same ring
/// and never touch: smooth elastic ones, on which nodes could be skipped, or rigid ones.
#[test]
fn nodes_on_other_surfaces_of_a_ring_do_not_change_contact() {
    let of = |others_are_elastic: bool| {
        let mut scene = rub(6);
        scene.settings.time.step = 5e-7;
        flexible(&mut scene);
        let (contact, surface) = (scene.settings.contacts[0].clone(), scene.settings.surfaces[0].clone());
        scene.settings.contacts.clear();
        scene.settings.surfaces.clear();
        for nodes in ["leading", "mid", "trailing"] {
            let touches = nodes == "mid";
            let mut own = surface.clone();
            own.name = nodes.into();
            if touches {
                own.spline.get_or_insert_default().closure = Closure::FreeEnds;
            } else {
                own.shape = Shape::Circular {};
                own.structure = own.structure.filter(|_| others_are_elastic);
            }
            let gap = if touches { contact.gap } else { 20.0 * contact.gap };
            scene.settings.surfaces.push(own);
            let (nodes, slave) = (Some(nodes.into()), nodes.into());
            scene.settings.contacts.push(ContactSettings { nodes, slave, gap, ..contact.clone() });
        }
        let mut simulation = started(&scene);
        (0..100).for_each(|_| go(&mut simulation, 2e-5));
        ["friction_loss", "impact_loss", "kinetic_energy"].map(|name| real(&simulation, name))
    };
    let [elastic, rigid] = [true, false].map(of);
    assert!(rigid[1] > 0.0, "{rigid:?}");
    for (elastic, rigid) in elastic.into_iter().zip(rigid) {
        assert!((elastic - rigid).abs() < 1e-7 * rigid, "{elastic:e} {rigid:e}");
    }
}
