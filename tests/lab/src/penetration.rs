//! Penetration between the points of adaptive steps: gaps of all contact nodes, sampled at short intervals and computed
//! from the displacements by a formula that shares no code with the product.

use std::f64::consts::{PI, TAU};

use serde_json::{Value, json};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_gallery::{rom_cache::RomCache, scene_source};
use tiprub_shell::{
    Failure, Result,
    console::Console,
    sweep::{self, processors},
};
use tiprub_study::{Statement, Study, arguments::StudyCommon, machine};
use tiprub_test_models::{bumps, ringing_blade};

/// Interval between samples (s) of a quick study and of a full one.
const INTERVAL: [f64; 2] = [5e-7, 1e-7];
/// Duration of a random rub, and of a rub of rotor 37 (s).
const DURATION: [f64; 2] = [8e-3, 2.1e-2];
/// Number of random rubs of a quick study and of a full one.
const RUBS: [u64; 2] = [6, 200];
/// Random rub whose impacts need the shortest steps.
const HARDEST: u64 = 22;
/// Tolerances of rotor 37 and of the random rubs.
const TOLERANCES: [f64; 3] = [1e-2, 1e-3, 1e-4];
/// Depths of the bumps in the rubs of rotor 37: as in the scene, and a heavy rub.
const DEPTHS: [(&str, f64); 2] = [("light", 0.6), ("heavy", 1.2)];
const SECTORS: usize = 4;
/// Difference between a sampled gap and the gap of the product that counts as rounding, as a fraction of the clearance;
/// and the fraction of open nodes whose gaps must agree. In steps in which a node also touches, the gap of the product is
/// a polynomial, so it differs.
const ROUNDING: f64 = 1e-11;
const AGREEING: f64 = 0.9;
/// Largest penetration, as a fraction of the tolerance. The error of the search is at most 0.3 of the
/// tolerance.
const ALLOWED: f64 = 1.3;

/// A rub against two bumps.
#[derive(Debug, Clone)]
struct PenetrationCase {
    name: String,
    scene: Scene,
    tolerance: f64,
    interval: f64,
    duration: f64,
}

/// Deepest penetrations of a rub as fractions of the tolerance.
#[derive(Debug, Clone)]
struct Penetration {
    name: String,
    tolerance: f64,
    samples: u64,
    /// Deepest penetration of nodes without a force, and of nodes with a force.
    deepest: [f64; 2],
    /// Number of samples of open nodes whose gap agrees with that of the product.
    agreeing: u64,
    /// Number of samples with a force.
    touched: u64,
}

/// A contact node of one sector: radius (m), angle at the start (rad) and slope of the meridian.
#[derive(Debug, Clone, Copy)]
struct Tip {
    radius: f64,
    angle: f64,
    slope: f64,
}

/// Casing with two bumps: clearance (m), height of the bumps (m), and their width as a fraction of half a turn.
#[derive(Debug, Clone, Copy)]
struct Bumps {
    clearance: f64,
    height: f64,
    width: f64,
}

impl Bumps {
    /// Returns the gap (m) of a tip displaced by `moved` (m; radial, tangential, axial) after the rotor has turned by an angle (rad).
    fn gap(&self, tip: Tip, turned: f64, moved: [f64; 3]) -> f64 {
        let angle = (tip.angle + turned + moved[1] / tip.radius).rem_euclid(PI);
        let away = (angle / PI - 0.5) / self.width;
        let bump = -self.height * (-away * away).exp();
        let slope = -2.0 * away / (PI * self.width) * bump / tip.radius;
        let open = self.clearance + bump - moved[0] + tip.slope * moved[2];
        open / (1.0 + slope * slope + tip.slope * tip.slope).sqrt()
    }
}

/// Returns a random rub of blades with lightly damped modes at high frequencies.
fn random_rub(seed: u64, interval: f64) -> PenetrationCase {
    let mut scene = bumps(ringing_blade(SECTORS, seed));
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.2, width: 0.15, phase: 0.0 };
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.time.step = 8e-5;
    let tolerance = TOLERANCES[1 + usize::from(seed.is_multiple_of(2))];
    PenetrationCase { name: format!("random {seed}"), scene, tolerance, interval, duration: DURATION[0] }
}

/// Returns the rubs of rotor 37 at all tolerances.
fn rotor_rubs(console: &Console, interval: f64) -> Result<Vec<PenetrationCase>> {
    let scene = scene_source::load("builtin:rotor37", &RomCache::of_user(), console)?;
    let mut cases = Vec::new();
    for (name, depth) in DEPTHS {
        for tolerance in TOLERANCES {
            let mut scene = scene.clone();
            if let Shape::TwoLobe { depth: of_scene, .. } = &mut scene.settings.surfaces[0].shape {
                *of_scene = depth;
            }
            let name = format!("rotor 37, {name}");
            cases.push(PenetrationCase { name, scene, tolerance, interval, duration: DURATION[1] });
        }
    }
    Ok(cases)
}

/// Runs a rub and compares all gaps with the formula, once the bumps have grown.
fn sample(case: &PenetrationCase) -> Result<Penetration> {
    run(case).map_err(|error| Failure::from_core(format!("lab penetration, {}", case.name), error))
}

fn run(case: &PenetrationCase) -> tiprub_core::Result<Penetration> {
    let PenetrationCase { name, scene, tolerance, interval, duration } = case;
    let mut scene = scene.clone();
    (scene.settings.time.scheme, scene.settings.time.tolerance) = (Scheme::Galerkin, Some(*tolerance));
    let (contact, surface, rom) = (&scene.settings.contacts[0], &scene.settings.surfaces[0], &scene.roms[0]);
    let Shape::TwoLobe { depth, width, .. } = surface.shape else { unreachable!("all rubs have two bumps") };
    let clearance = contact.nominal_gap();
    let casing = Bumps { clearance, height: 2.0 * clearance * depth, width };
    let (grown, sectors, speed) = (surface.ramp_time, rom.sectors, scene.settings.structures[0].speed);
    let tips: Vec<Tip> = rom
        .contact_nodes
        .iter()
        .map(|node| Tip { radius: node.position[0], angle: node.position[1], slope: node.meridional_slope })
        .collect();
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let mut found = Penetration {
        name: name.clone(),
        tolerance: *tolerance,
        samples: 0,
        deepest: [0.0; 2],
        agreeing: 0,
        touched: 0,
    };
    for step in 0.. {
        let time = f64::from(step) * interval;
        if time >= *duration {
            break;
        }
        simulation.do_step(time, *interval)?;
        let now = f64::from(step + 1) * interval;
        if now <= grown + interval {
            continue;
        }
        let structure = &simulation.system().structures()[0];
        let (bank, lanes) = (simulation.system().bank(), structure.lanes());
        for sector in 0..sectors {
            for (node, tip) in tips.iter().enumerate() {
                let moved = [0, 1, 2].map(|c| bank.displacement()[(3 * node + c) * lanes + sector]);
                let turned = speed * now + TAU * sector as f64 / sectors as f64;
                let gap = casing.gap(*tip, turned, moved);
                let is_touching = structure.multiplier(node, sector) > 0.0;
                found.samples += 1;
                found.touched += u64::from(is_touching);
                // Only in steps in which a node touches, its gap in the product is a polynomial.
                let is_exact = (gap - structure.gap(node, sector)).abs() < ROUNDING * clearance;
                let stays_open = !is_touching && is_exact;
                found.agreeing += u64::from(stays_open);
                let deepest = &mut found.deepest[usize::from(!stays_open)];
                *deepest = deepest.max(-gap / (tolerance * clearance));
            }
        }
    }
    Ok(found)
}

/// Returns a table of the results.
fn table(found: &[Penetration]) -> String {
    let mut page = String::from(
        "| rub | tolerance | samples | with a force | deepest / tolerance: open in the step | touching in the step |\n\
         |---|---|---|---|---|---|\n",
    );
    for one in found {
        page += &format!(
            "| {} | {:.0e} | {} | {} | {:.3} | {:.3} |\n",
            one.name, one.tolerance, one.samples, one.touched, one.deepest[0], one.deepest[1]
        );
    }
    page
}

/// Runs the study.
///
/// # Errors
/// If a run fails.
pub(crate) fn study(common: &StudyCommon, console: &Console) -> Result<Study> {
    let which = usize::from(!common.quick);
    let interval = INTERVAL[which];
    let mut cases: Vec<PenetrationCase> = (1..=RUBS[which]).map(|seed| random_rub(seed, interval)).collect();
    if common.quick {
        cases.push(random_rub(HARDEST, INTERVAL[1]));
    } else {
        cases.extend(rotor_rubs(console, interval)?);
    }
    let task = console.task("Sampling rubs between the points of steps", Some(cases.len() as u64));
    let found = sweep::sweep(&cases, processors(), sample, |done| task.at(done as u64))?;
    drop(task);
    let [open, touching] = [0, 1].map(|of| found.iter().map(|one| one.deepest[of]).fold(0.0, f64::max));
    let share = |one: &Penetration| one.agreeing as f64 / (one.samples - one.touched) as f64;
    let least = found.iter().map(share).fold(1.0, f64::min);
    let touched = found.iter().filter(|one| one.touched > 0).count();
    let statements = vec![
        Statement::tested(
            "Nodes that stay open in a step penetrate by no more than 1.3 of the tolerance at any sample",
            open < ALLOWED,
            format!("at most {open:.3} of the tolerance"),
        ),
        Statement::tested(
            "Nodes that touch in a step penetrate by no more than 1.3 of the tolerance at any sample",
            touching < ALLOWED,
            format!("at most {touching:.3} of the tolerance"),
        ),
        Statement::tested("Blades touch in every rub", touched == found.len(), format!("{touched} of {}", found.len())),
        Statement::tested(
            "The gaps of open nodes agree with those of the product to rounding, except in steps in which they also touch",
            least > AGREEING,
            format!("at least {:.2} % in every rub", 100.0 * least),
        ),
    ];
    let results: Vec<Value> = found
        .iter()
        .map(|one| {
            json!({
                "rub": one.name, "tolerance": one.tolerance, "samples": one.samples, "touching": one.touched,
                "deepest": one.deepest, "agreeing": one.agreeing,
            })
        })
        .collect();
    Ok(Study {
        name: "penetration",
        title: "Penetration between the points of steps".into(),
        summary: format!(
            "All gaps of {} rubs with adaptive steps, every {:.1} µs: the deepest penetration as a fraction of the \
             tolerance.",
            found.len(),
            1e6 * interval
        ),
        facts: machine::facts(),
        statements,
        figures: Vec::new(),
        results: Value::Array(results),
        files: vec![("penetration.md".into(), "table of the results".into(), table(&found).into_bytes())],
    })
}
