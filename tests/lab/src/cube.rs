//! The cube between two rings: the released simulation against independent methods on the full finite-element model
//! (the paper's section 5).

mod energy;
mod figures;
mod pairs;
mod patches;
mod product;
mod runs;
mod sizes;

use pairs::RunPair;
use patches::PatchStudy;
use runs::{A, B, BEST, C, CubeFlight, CubeRun, PAPER, STICKING, competitors, released};
use serde_json::json;
use sizes::SizeStudy;
use tiprub_core::Scene;
use tiprub_gallery::scene_source;
use tiprub_reference::compare::{asymmetry, exit_speed};
use tiprub_shell::{
    Failure, Result,
    console::{Console, Task},
};
use tiprub_study::{Statement, Study, machine};

use crate::cli::LabCubeArguments;

/// Speed of the paper's flight, and the lower one of its energies (m/s).
const FAST: f64 = 100.0;
const SLOW: f64 = 50.0;
const FRICTION: f64 = 0.15;
const FRICTIONLESS: CubeFlight = CubeFlight { speed: SLOW, friction: 0.0 };
/// End of the runs (s), and of the quick ones.
const END: f64 = 3e-3;
const QUICK_END: f64 = 2e-4;
/// Fraction of energy that the paper loses without friction.
const PAPER_LOSS: f64 = 1.0 - 1216.83 / 1218.75;

/// Largest difference of left and right that counts as rounding, and residual of a ledger that closes (relative).
const SYMMETRIC: f64 = 1e-6;
const LEDGER: f64 = 1e-12;
/// Kinetic energy of a blocked cube is below this fraction of the strain energy.
const AT_REST: f64 = 0.03;

/// All runs of one flight.
struct Flown {
    flight: CubeFlight,
    outcomes: Vec<CubeRun>,
    pairs: Vec<RunPair>,
}

impl Flown {
    fn outcome(&self, name: &str) -> Result<&CubeRun> {
        let missing = || Failure::new("lab cube", format!("there is no run `{name}`"), "");
        self.outcomes.iter().find(|outcome| outcome.name == name).ok_or_else(missing)
    }

    fn pair(&self, first: &str, second: &str) -> Option<&RunPair> {
        self.pairs.iter().find(|pair| pair.first == first && pair.second == second)
    }

    fn title(&self) -> String {
        format!("{} m/s, µ = {}", self.flight.speed, self.flight.friction)
    }
}

/// Runs the study: loads the models, runs all methods, compares.
///
/// # Errors
/// Models that cannot be created. A method that fails is a result.
pub(crate) fn study(arguments: &LabCubeArguments, console: &Console) -> Result<Study> {
    let LabCubeArguments { patches_only, common: arguments } = arguments;
    let quick = arguments.quick;
    let scene = scene_source::load("builtin:cube-between-rings", &arguments.cache.cache(), console)?;
    if *patches_only {
        let fast = CubeFlight { speed: FAST, friction: FRICTION };
        let end = quick.then_some(QUICK_END);
        return Ok(of_patches(&PatchStudy::new(
            &scene,
            (&fast, FRICTIONLESS),
            end,
            (&arguments.cache.cache(), console),
        )?));
    }
    let all = [(FAST, FRICTION), (FAST, 0.0), (SLOW, FRICTION), (SLOW, 0.0)]
        .map(|(speed, friction)| CubeFlight { speed, friction });
    let flights = if quick { &all[..1] } else { &all[..] };
    let planned: usize = flights.iter().map(|flight| competitors(flight, quick, *flight == all[0]).len()).sum();
    let task = console.task("Cube runs", Some(planned as u64));
    let mut done = 0;
    let mut flown = Vec::new();
    for flight in flights {
        flown.push(fly(flight, &scene, quick, *flight == all[0], (&task, &mut done))?);
    }
    drop(task);
    let a = flown[0].outcome(A)?.history().ok_or_else(|| Failure::new("lab cube", "method a failed", ""))?;
    let sizes = SizeStudy::new(&scene, &all[0], a, quick, (&arguments.cache.cache(), console))?;
    let end = quick.then_some(QUICK_END);
    let patches = PatchStudy::new(&scene, (&all[0], FRICTIONLESS), end, (&arguments.cache.cache(), console))?;
    report(&scene, &flown, &sizes, &patches, quick)
}

/// Creates the study of patches alone.
fn of_patches(patches: &PatchStudy) -> Study {
    Study {
        name: "cube",
        title: "A cube between two rings, with contact patches on its faces".into(),
        summary: "tiprub with contact patches instead of contact nodes on the faces of the cube.".into(),
        facts: machine::facts(),
        statements: patches.statements(),
        figures: Vec::new(),
        results: json!({ "patches": patches.json() }),
        files: vec![("tables.md".into(), "table in Markdown".into(), patches.markdown().into_bytes())],
    }
}

fn fly(
    flight: &CubeFlight,
    scene: &Scene,
    quick: bool,
    facets: bool,
    (task, done): (&Task, &mut u64),
) -> Result<Flown> {
    let mut outcomes = Vec::new();
    for competitor in competitors(flight, quick, facets) {
        task.now(&format!("{} m/s, µ = {}: {}", flight.speed, flight.friction, competitor.0));
        outcomes.push(runs::run(competitor, scene, flight, if quick { QUICK_END } else { END })?);
        *done += 1;
        task.at(*done);
    }
    let pairs = pairs::pairs(&outcomes, flight);
    Ok(Flown { flight: *flight, outcomes, pairs })
}

fn report(scene: &Scene, flown: &[Flown], sizes: &SizeStudy, patches: &PatchStudy, quick: bool) -> Result<Study> {
    let main = flown.first().ok_or_else(|| Failure::new("lab cube", "there are no runs", ""))?;
    let best = main.outcome(BEST)?;
    let mut figures = vec![figures::scene()];
    let touching = main.outcome(A)?.history().map_or(0.0, released);
    if let Some(history) = best.history() {
        figures.extend(figures::symmetry(BEST, history)?);
    }
    figures.extend(figures::node_1(&main.outcomes, FAST, touching + 1e-4)?);
    for (name, slow) in ["fig6b-energy-friction", "fig6a-energy"].into_iter().zip(flown.iter().skip(2)) {
        let who = if slow.flight.friction > 0.0 { STICKING } else { BEST };
        if let Some(history) = slow.outcome(who)?.history() {
            figures.push(figures::energies(name, &format!("{}, {who}", slow.title()), history)?);
        }
    }
    figures.push(figures::agreement(&main.pairs)?);
    let facts = machine::facts().into_iter().map(|(name, value)| format!("* {name}: {value}\n"));
    let mut tables = vec![format!("# A cube between two rings: all pairs of methods\n\n{}", facts.collect::<String>())];
    let flights =
        flown.iter().map(|flown| format!("## {}\n\n{}", flown.title(), pairs::markdown(&flown.outcomes, &flown.pairs)));
    tables.extend(flights);
    tables.push(sizes.markdown());
    tables.push(patches.markdown());
    let all = flown.iter().map(|flown| pairs::json(&flown.outcomes, &flown.pairs, &flown.flight));
    let mut energies = serde_json::Value::Null;
    let mut statements = meeting(main);
    statements.extend(at_any_speed(flown));
    statements.push(truncation(sizes));
    statements.extend(patches.statements());
    if !quick {
        let losses = energy::Losses::new(scene)?;
        statements.extend(slow(flown)?);
        statements.push(losses.statement());
        tables.push(losses.markdown());
        energies = losses.json();
        statements.push(times(main)?);
    }
    Ok(Study {
        name: "cube",
        title: "A cube between two rings".into(),
        summary: format!(
            "tiprub with reduced models compared with independent methods on the full finite-element model, in {} \
             cases.{}",
            flown.len(),
            if quick { " Quick mode: the first 0.2 ms of one case." } else { "" }
        ),
        facts: scene.roms.iter().map(|rom| (rom.name.clone(), rom.origin.clone())).collect(),
        statements,
        figures,
        results: json!({ "flights": all.collect::<Vec<_>>(), "sizes": sizes.json(), "patches": patches.json(), "energies": energies }),
        files: vec![("tables.md".into(), "all pairs and runs in Markdown".into(), tables.join("\n").into_bytes())],
    })
}

/// Compares two runs with bounds of u1x, slowing and u1z.
fn near(flown: &Flown, first: &str, second: &str, bounds: [f64; 3], why: &str) -> Statement {
    let expected = format!("{second} agrees with {first}{why}: u1x, slowing and u1z of node 1 within {bounds:?} %");
    match flown.pair(first, second) {
        None => Statement::tested(expected, false, "one of the two runs failed"),
        Some(pair) => {
            let found = pair.found.touching.map(|share| 100.0 * share);
            let holds = found.iter().zip(bounds).all(|(share, bound)| *share <= bound);
            let [x, slowing, z] = found;
            Statement::tested(
                expected,
                holds,
                format!(
                    "{x:.3}, {slowing:.3}, {z:.3} % while node 1 is in contact; its force in windows {:.2} %, exit \
                     speed {:+.3} %",
                    100.0 * pair.found.windows,
                    100.0 * pair.found.exit
                ),
            )
        }
    }
}

fn meeting(main: &Flown) -> Vec<Statement> {
    let independent = ", which shares no time stepping, contact or reduction code with it";
    let mut all = vec![
        near(main, A, PAPER, [0.2, 0.5, 0.2], ", which solves the same equations on the full model"),
        near(main, A, BEST, [0.5, 1.0, 0.5], independent),
        near(main, B, BEST, [0.5, 1.0, 0.5], independent),
    ];
    if main.outcomes.iter().any(|outcome| outcome.name == C) {
        // With 5·10⁸ N/m nodes penetrate by 30 µm of 1 mm.
        all.push(near(main, BEST, C, [3.0, 3.0, 4.0], ", which has softer contact"));
    }
    all
}

/// States the error of reducing the rings.
fn truncation(sizes: &SizeStudy) -> Statement {
    let modal: Vec<_> = sizes.rings.iter().filter(|size| size.static_responses == 0).collect();
    let falls = modal.windows(2).all(|pair| (0..3).all(|i| pair[1].apart[i] < pair[0].apart[i]));
    let reported = modal.iter().map(|size| {
        let [x, slowing, z, _] = size.apart.map(|share| 100.0 * share);
        format!("{} modes: {x:.3}, {slowing:.3}, {z:.3} %", size.modes)
    });
    Statement::tested(
        "With more ring modes, u1x, slowing and u1z of tiprub come closer to method a",
        falls && modal.len() > 1,
        reported.collect::<Vec<_>>().join("; "),
    )
}

/// States properties of every flight.
fn at_any_speed(flown: &[Flown]) -> Vec<Statement> {
    let products = || flown.iter().flat_map(|flown| flown.outcomes.iter().map(move |outcome| (flown, outcome)));
    let products = || products().filter(|(_, outcome)| outcome.is_product());
    let ran = || products().filter_map(|(flown, outcome)| Some((flown, outcome, outcome.result.as_ref().ok()?)));
    let residual = ran().map(|(.., run)| run.residual).fold(0.0, f64::max);
    let failed: Vec<String> = flown
        .iter()
        .flat_map(|flown| flown.outcomes.iter().map(move |outcome| (flown, outcome)))
        .filter_map(|(flown, outcome)| {
            let problem = outcome.result.as_ref().err()?;
            Some(format!("{}, {}: {problem}", flown.title(), outcome.name))
        })
        .collect();
    let uneven: Vec<String> = ran()
        .map(|(flown, outcome, run)| {
            let [moved, force] = asymmetry(&run.history, f64::MAX);
            format!("{}, {}: {moved:.0e}, {force:.0e}", flown.title(), outcome.name)
        })
        .collect();
    // While the cube passes; at the end of a blocked flight rounding has grown with the vibration.
    let passing = ran().filter(|(flown, ..)| flown.flight.speed > SLOW || flown.flight.friction == 0.0);
    let apart: Vec<f64> = passing.flat_map(|(.., run)| asymmetry(&run.history, f64::MAX)).collect();
    vec![
        Statement::tested(
            format!(
                "Left and right are equal in every run in which the cube passes: ux and λ of nodes 1, 6, 85, 90 and \
                 31, 36, 91, 96 agree to accumulated rounding, {SYMMETRIC:e} (fig. 3)"
            ),
            !apart.is_empty() && apart.iter().all(|apart| *apart < SYMMETRIC),
            format!("largest differences of ux and λ relative to the largest values: {}", uneven.join("; ")),
        ),
        Statement::tested(
            format!("The energy balance closes in every tiprub run to {LEDGER:e} of the energy exchanged"),
            ran().count() > 0 && ran().all(|(.., run)| run.residual < LEDGER),
            format!("largest residual {residual:.1e}"),
        ),
        Statement::tested(
            "Every method completes its run",
            failed.is_empty(),
            if failed.is_empty() { "all of them".into() } else { failed.join("; ") },
        ),
    ]
}

/// States the energies at 50 m/s.
fn slow(flown: &[Flown]) -> Result<Vec<Statement>> {
    let flight = |friction: bool| {
        let missing = || Failure::new("lab cube", "there is no slow run", "");
        flown.iter().find(|f| f.flight.speed <= SLOW && (f.flight.friction > 0.0) == friction).ok_or_else(missing)
    };
    let (smooth, rough) = (flight(false)?, flight(true)?);
    let mut all = Vec::new();
    let losses: Vec<(&str, f64, f64)> = smooth
        .outcomes
        .iter()
        .filter_map(|outcome| Some((outcome, outcome.history()?)))
        .map(|(outcome, history)| {
            let total = history.total();
            let lost = 1.0 - total.iter().copied().fold(f64::INFINITY, f64::min) / total[0];
            (outcome.name, lost, exit_speed(history))
        })
        .collect();
    let listed = losses.iter().map(|(name, lost, exit)| format!("{name} {:.3} %, {exit:.2} m/s", 100.0 * lost));
    let product = losses.iter().filter(|(name, ..)| name.starts_with("product"));
    all.push(Statement::tested(
        "Without friction, the cube passes between the rings (fig. 6a)",
        product.clone().count() > 0 && product.clone().all(|(.., exit)| *exit > 45.0),
        format!("largest energy loss and exit speed of these runs: {}", listed.collect::<Vec<_>>().join("; ")),
    ));
    let rest = |outcome: &CubeRun| {
        let history = outcome.history()?;
        let (kinetic, strain) = (history.kinetic.last().copied()?, history.strain.last().copied()?);
        Some((kinetic, strain, asymmetry(history, f64::MAX)[0]))
    };
    let reported: Vec<String> = rough
        .outcomes
        .iter()
        .filter_map(|outcome| {
            let (kinetic, strain, uneven) = rest(outcome)?;
            Some(format!("{}: {kinetic:.2} J, {strain:.2} J, left/right {uneven:.0e}", outcome.name))
        })
        .collect();
    let at_rest: Vec<bool> = rough
        .outcomes
        .iter()
        .filter_map(|outcome| rest(outcome).map(|(kinetic, strain, _)| kinetic < AT_REST * strain))
        .collect();
    all.push(Statement::tested(
        format!(
            "With friction, every method stops the cube: its kinetic energy falls below {:.0} % of the remaining \
             strain energy (fig. 6b)",
            100.0 * AT_REST
        ),
        !at_rest.is_empty() && at_rest.iter().all(|still| *still),
        format!("kinetic and strain energy after 3 ms (initially 1218.75 J in total): {}", reported.join("; ")),
    ));
    Ok(all)
}

fn times(main: &Flown) -> Result<Statement> {
    let seconds =
        |name: &str| main.outcome(name).map(|outcome| outcome.history().map(|history| history.processor_time));
    let base = seconds(PAPER)?.unwrap_or(f64::NAN);
    let reported = main.outcomes.iter().filter_map(|outcome| {
        let time = outcome.history()?.processor_time;
        Some(format!("{} {time:.2} s ({:.2})", outcome.name, time / base))
    });
    Ok(Statement::remark(
        "Run times (in the paper, c is within 5 % of a, and b takes 10 times as long as a)",
        format!(
            "processor time of the steps (relative to the first tiprub run): {}",
            reported.collect::<Vec<_>>().join("; ")
        ),
    ))
}
