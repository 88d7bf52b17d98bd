//! Accuracy of `galerkin` relative to its tolerance on random data: random rubs, errors at its shortest steps, energy
//! over very many switches, random contact problems.

mod mission;
mod sectors;

use mission::Mission;
use sectors::{Problems, SectorEnergy, Solutions};
use serde_json::{Value, json};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_shell::{
    Result,
    console::Console,
    sweep::{self, processors},
};
use tiprub_study::{Statement, Study, arguments::StudyCommon, machine};
use tiprub_test_models::{GAP, SeededRandom, bumps, rich_blade};

/// Number of sectors of the random rotors.
const SECTORS: usize = 4;
/// Communication step of all runs (s), and their number.
const H: f64 = 8e-5;
const STEPS: u32 = 100;
/// Requested tolerances; longest step (s) and tolerance of the reference, and of the run that must agree with it.
const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];
const TRUTH: [(f64, f64); 2] = [(1e-5, 1e-9), (2e-5, 1e-8)];
/// Largest difference of these runs for which the reference counts as known: a third of the smallest tolerance.
const KNOWN: f64 = 3e-6;
const SMALL: [f64; 4] = [1e-6, 1e-7, 1e-8, 1e-9];
const LONGEST: [f64; 3] = [8e-5, 4e-5, 2e-5];
/// Relative change of the clearance; a run is followed until the difference exceeds [`GROWN`] times as much.
const PERTURBATION: f64 = 1e-12;
const GROWN: f64 = 10.0;
/// Numbers of rubs, switches, contact problems of each degree and friction: of a quick study, and of a full one, a
/// million problems in all.
const RUBS: [usize; 2] = [12, 200];
const SWITCHES: [u64; 2] = [2_000, 100_000];
const TRIALS: [u64; 2] = [5_000, 125_000];

/// Returns a random rub.
fn random_rub(number: usize) -> Scene {
    let mut random = SeededRandom(1 + 7919 * number as u64);
    let mut scene = bumps(rich_blade(SECTORS));
    scene.settings.structures[0].speed = random.within(300.0, 2000.0);
    scene.settings.structures[0].damping_ratio = Some(random.scale(1e-4, 3e-2));
    scene.settings.contacts[0].friction = random.within(0.0, 0.3);
    scene.settings.surfaces[0].shape = if random.unit() < 0.5 {
        Shape::TwoLobe {
            depth: random.within(0.55, 0.9),
            width: random.within(0.1, 0.25),
            phase: random.within(0.0, 3.0),
        }
    } else {
        let order = 1 + u32::try_from(random.below(6)).unwrap_or(0);
        Shape::Lobes { amplitude: GAP * random.within(1.05, 1.5), order, phase: random.within(0.0, 3.0) }
    };
    scene
}

/// Displacements of all contact rows for each communication step, and the numbers of missed and accepted steps.
struct Ran {
    displacements: Vec<Vec<f64>>,
    steps: [u64; 2],
}

fn run(scene: &Scene, (longest, tolerance): (f64, f64), perturbation: f64) -> tiprub_core::Result<Ran> {
    let mut scene = scene.clone();
    (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::Galerkin, longest);
    scene.settings.time.tolerance = Some(tolerance);
    run_of(scene, perturbation)
}

/// Runs until a step is rejected: a blade that locks up exceeds small displacements.
fn run_of(mut scene: Scene, perturbation: f64) -> tiprub_core::Result<Ran> {
    scene.settings.contacts[0].gap *= 1.0 + perturbation;
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let mut displacements = Vec::new();
    for step in 0..STEPS {
        if simulation.do_step(f64::from(step) * H, H).is_err() {
            break;
        }
        displacements.push(simulation.system().bank().displacement().to_vec());
    }
    let effort = simulation.system().effort();
    Ok(Ran { displacements, steps: [effort.missed, effort.steps] })
}

/// Returns the number of communication steps until two fixed-step runs of the same equations with slightly different
/// starts differ by ten times the initial difference.
fn followed(scene: &Scene) -> tiprub_core::Result<usize> {
    let mut scene = scene.clone();
    (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::MasslessBoundary, 2e-7);
    let (plain, other) = (run_of(scene.clone(), 0.0)?, run_of(scene, PERTURBATION)?);
    let apart = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    let mut all = plain.displacements.iter().zip(&other.displacements).map(apart);
    let same = plain.displacements.len().min(other.displacements.len());
    Ok(all.position(|apart| apart > GROWN * PERTURBATION * GAP).unwrap_or(same))
}

fn apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let pairs = || a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
    let (square, size) = pairs().fold((0.0, 0.0), |(square, size), (a, b)| (square + (a - b) * (a - b), size + b * b));
    (square / size).sqrt()
}

/// Result of a rub.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ScatterRub {
    /// Errors over the tolerances.
    Followed([f64; 4]),
    /// No contact.
    Open,
    /// Rejected at its start, or not followed for three communication steps from the first contact.
    Lost,
    /// Two runs far finer than all tolerances disagree.
    Unknown,
}

fn errors(number: &usize) -> Result<ScatterRub> {
    let scene = random_rub(*number);
    let (Ok(window), [Ok(truth), Ok(other)]) = (followed(&scene), TRUTH.map(|of| run(&scene, of, 0.0))) else {
        return Ok(ScatterRub::Lost);
    };
    let Some(first) = truth.displacements.iter().position(|all| all.iter().any(|u| *u != 0.0)) else {
        return Ok(ScatterRub::Open);
    };
    let mut window = window.min(truth.displacements.len()).min(other.displacements.len());
    let mut runs = Vec::new();
    for tolerance in TOLERANCES {
        let Ok(ran) = run(&scene, (H, tolerance), 0.0) else { return Ok(ScatterRub::Lost) };
        window = window.min(ran.displacements.len());
        runs.push(ran);
    }
    if window < first + 3 {
        return Ok(ScatterRub::Lost);
    }
    let off = |ran: &Ran| apart(&ran.displacements[..window], &truth.displacements[..window]);
    if off(&other) > KNOWN {
        return Ok(ScatterRub::Unknown);
    }
    Ok(ScatterRub::Followed(std::array::from_fn(|index| off(&runs[index]) / TOLERANCES[index])))
}

/// Returns median, 95 % quantile and maximum of sorted values: the smallest value that the given fraction does not
/// exceed.
fn quantiles(sorted: &[f64]) -> [f64; 3] {
    let rank = |percent: usize| (sorted.len() * percent).div_ceil(100).saturating_sub(1);
    [rank(50), rank(95), rank(100)].map(|index| sorted.get(index).copied().unwrap_or(f64::NAN))
}

fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let head: Vec<String> = head.iter().map(|cell| (*cell).to_owned()).collect();
    let rows: String = rows.iter().map(|row| line(row)).collect();
    format!("{}|{}\n{rows}", line(&head), "---|".repeat(head.len()))
}

/// Runs the study.
///
/// # Errors
/// A run that is rejected.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let which = usize::from(!arguments.quick);
    let numbers: Vec<usize> = (0..RUBS[which]).collect();
    let task = console.task("Random rubs", Some(numbers.len() as u64));
    let found = sweep::sweep(&numbers, processors(), errors, |done| task.at(done as u64))?;
    drop(task);
    let of_rub = |rub: &ScatterRub| if let ScatterRub::Followed(ratios) = rub { Some(*ratios) } else { None };
    let followed: Vec<[f64; 4]> = found.iter().filter_map(of_rub).collect();
    let [open, lost, unknown] = [ScatterRub::Open, ScatterRub::Lost, ScatterRub::Unknown]
        .map(|kind| found.iter().filter(|rub| **rub == kind).count());
    let mut ratios: [Vec<f64>; 4] = std::array::from_fn(|index| followed.iter().map(|one| one[index]).collect());
    ratios.iter_mut().for_each(|one| one.sort_by(f64::total_cmp));
    let of_ratios = ratios.each_ref().map(|one| quantiles(one));
    let left = left()?;
    let kept: Vec<Option<SectorEnergy>> =
        [1e-3, 1e-6, 1e-7].map(|tolerance| sectors::energy(tolerance, SWITCHES[which])).to_vec();
    let problems: Vec<Problems> = [2, 3]
        .into_iter()
        .flat_map(|degree| [0.0, 0.15, 0.3, 0.6].map(|friction| sectors::problems(degree, friction, TRIALS[which])))
        .collect();
    let solutions: Vec<Solutions> = [2, 3]
        .into_iter()
        .flat_map(|degree| {
            [0.0, 0.15, 0.3, 0.6].map(|friction| sectors::solutions(degree, friction, TRIALS[which] / 5))
        })
        .collect();
    let reported = |error| tiprub_shell::Failure::from_core("mission", error);
    let long = mission::long_steps(if arguments.quick { 1 } else { 10 }).map_err(reported)?;
    let hour = mission::hour(if arguments.quick { 100 } else { 1 }).map_err(reported)?;
    Ok(Study {
        name: "scatter",
        title: "Tolerance and energy in random rubs".into(),
        summary: "Random rubs of four blades with three contact nodes: relative L2 error of displacements against the \
                  tolerance, and the error at the shortest steps. Energy over very many contact changes, and contact \
                  problems of random sectors."
            .into(),
        facts: machine::facts(),
        statements: statements(&of_ratios, &kept, &problems, &solutions),
        figures: Vec::new(),
        results: json!({
            "rubs": followed.len(),
            "rubs_open": open,
            "rubs_lost": lost,
            "rubs_unknown": unknown,
            "milliseconds_of_long_steps": long,
            "mission": {
                "steps": hour.steps, "of_them_rubbing": hour.rubbing, "seconds": hour.seconds, "internal_steps": hour.internal,
                "switches_and_trials": hour.trials, "friction_loss": hour.friction, "residual": hour.residual,
            },
            "solutions": solutions.iter().map(|one| json!({
                "degree": one.degree, "friction": one.friction, "problems": one.problems, "none": one.none, "several": one.several,
            })).collect::<Vec<_>>(),
            "error_over_tolerance": of_ratios,
            "left": left.iter().map(|(longest, tolerance, error, steps)| json!([longest, tolerance, error, steps])).collect::<Vec<_>>(),
            "energy": kept.iter().flatten().map(|one| json!({
                "tolerance": one.tolerance, "switches": one.switches, "most": one.most, "left": one.left,
                "steps": one.effort.steps, "constant": one.effort.constant,
            })).collect::<Vec<Value>>(),
            "problems": problems.iter().map(|one| json!({
                "degree": one.degree, "friction": one.friction, "trials": one.trials, "unsolved": one.unsolved,
                "given_up": one.given_up,
            })).collect::<Vec<_>>(),
        }),
        files: vec![(
            "scatter.md".into(),
            "tables for the guide".into(),
            tables(&of_ratios, &left, (&kept, &problems, &solutions), (long, &hour)).into_bytes(),
        )],
    })
}

/// Errors with the shortest steps: longest step (s), tolerance, error, missed and accepted steps.
type Left = (f64, f64, f64, [u64; 2]);

fn left() -> Result<Vec<Left>> {
    let scene = bumps(rich_blade(SECTORS));
    let reported = |error: tiprub_core::Error| tiprub_shell::Failure::from_core("error at the shortest steps", error);
    let truth = run(&scene, (1e-5, 1e-9), 0.0).map_err(reported)?;
    let mut all = Vec::new();
    for longest in LONGEST {
        for tolerance in SMALL {
            let ran = run(&scene, (longest, tolerance), 0.0).map_err(reported)?;
            all.push((longest, tolerance, apart(&ran.displacements, &truth.displacements), ran.steps));
        }
    }
    Ok(all)
}

fn statements(
    ratios: &[[f64; 3]; 4],
    kept: &[Option<SectorEnergy>],
    problems: &[Problems],
    solutions: &[Solutions],
) -> Vec<Statement> {
    let worst =
        ratios.iter().fold([0.0_f64; 2], |most, [median, most_of, _]| [most[0].max(*median), most[1].max(*most_of)]);
    let gained = kept.iter().flatten().fold(0.0, |most: f64, one| most.max(one.most - 1.0));
    let given_up: u64 = problems.iter().map(|one| one.given_up).sum();
    let plain: u64 = problems.iter().filter(|one| one.friction == 0.0).map(|one| one.unsolved).sum();
    vec![
        Statement::tested(
            "The error is within half the tolerance for half of the random rubs, and within three times the tolerance \
             for 95 %"
                .to_owned(),
            worst[0] < 0.5 && worst[1] < 3.0,
            format!("median {:.2}, 95th percentile {:.2} at the worst tolerance", worst[0], worst[1]),
        ),
        Statement::tested(
            "Contact changes never add energy".to_owned(),
            kept.iter().all(Option::is_some) && gained < 1e-9,
            format!("gain of at most {gained:.0e}"),
        ),
        Statement::tested(
            "Without friction, a solution of every contact problem is found".to_owned(),
            plain == 0,
            format!("{plain} were not solved"),
        ),
        Statement::tested(
            "Without friction, every contact problem has exactly one solution".to_owned(),
            solutions.iter().all(|one| one.friction > 0.0 || one.none + one.several == 0),
            format!(
                "with friction, up to {} have no solution, up to {} have several",
                solutions.iter().map(|one| one.none).max().unwrap_or(0),
                solutions.iter().map(|one| one.several).max().unwrap_or(0)
            ),
        ),
        Statement::remark(
            "Time spans of random sectors in which no step was short enough".to_owned(),
            format!("{given_up} spans"),
        ),
    ]
}

fn tables(
    ratios: &[[f64; 3]; 4],
    left: &[Left],
    (kept, problems, solutions): (&[Option<SectorEnergy>], &[Problems], &[Solutions]),
    (long, hour): ([f64; 2], &Mission),
) -> String {
    let ratios: Vec<Vec<String>> = TOLERANCES
        .iter()
        .zip(ratios)
        .map(|(tolerance, of)| {
            std::iter::once(format!("{tolerance:e}")).chain(of.map(|one| format!("{one:.2}"))).collect()
        })
        .collect();
    let left: Vec<Vec<String>> = left
        .chunks(SMALL.len())
        .map(|row| {
            let cell = |(_, _, error, [missed, steps]): &Left| format!("{error:.1e} ({missed} of {steps})");
            std::iter::once(format!("{} µs", (1e6 * row[0].0).round())).chain(row.iter().map(cell)).collect()
        })
        .collect();
    let kept: Vec<Vec<String>> = kept
        .iter()
        .flatten()
        .map(|one| {
            let of = [one.switches, one.effort.steps, one.effort.constant].map(|count| count.to_string());
            let shares = [format!("{:.1e}", one.most - 1.0), format!("{:.4}", one.left)];
            std::iter::once(format!("{:e} m", one.tolerance)).chain(of).chain(shares).collect()
        })
        .collect();
    let row = |degree: usize, friction: f64, counts: [u64; 3]| -> Vec<String> {
        let counts = counts.map(|count| count.to_string());
        [degree.to_string(), friction.to_string()].into_iter().chain(counts).collect()
    };
    let problems: Vec<Vec<String>> =
        problems.iter().map(|one| row(one.degree, one.friction, [one.trials, one.unsolved, one.given_up])).collect();
    let solutions: Vec<Vec<String>> =
        solutions.iter().map(|one| row(one.degree, one.friction, [one.problems, one.none, one.several])).collect();
    let hour = vec![
        format!("{}, {}", hour.steps, hour.rubbing),
        format!("{:.2} s, {:.2} s", hour.seconds[0], hour.seconds[1]),
        hour.internal.to_string(),
        hour.trials.to_string(),
        format!("{:.3e} J", hour.friction),
        format!("{:.0e}", hour.residual),
    ];
    [
        table(&["tolerance", "median of error / tolerance", "95 %", "maximum"], &ratios),
        table(&["longest step", "tolerance 1e-6", "1e-7", "1e-8", "1e-9"], &left),
        table(
            &["tolerance", "switches", "steps", "with constant force", "largest energy gain (-)", "final energy (-)"],
            &kept,
        ),
        table(&["degree", "µ", "problems", "initially unsolved", "finally unsolved"], &problems),
        table(&["without contact", "with a rub"], &[long.map(|time| format!("{time:.3} ms")).to_vec()]),
        table(&["degree", "µ", "problems", "no solution", "several"], &solutions),
        table(
            &[
                "steps: all, with rub",
                "time: without, with rub",
                "internal steps in the rub",
                "trials",
                "friction heat",
                "energy residual",
            ],
            &[hour],
        ),
    ]
    .join("\n")
}
