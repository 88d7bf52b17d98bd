//! Reduction bases of a blade: modes with the contact held or free, contact at nodes or patches. Error, largest steps
//! and cost against the number of modes.

use serde_json::{Value, json};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{Rom, Scene};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::{reduction, scene_source};
use tiprub_model::{
    Rotor37Options,
    reduce::ReductionKind,
    rotor37::{MeshCounts, TipContact},
};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::{
    Picture, Sheet, Statement, Study, StudyFigure,
    arguments::StudyCommon,
    convergence::march::{RunSummary, march},
    error::{
        run::{self, TimedRun},
        scene::SceneRun,
    },
    stability::structure::SingleStructure,
};

/// Time between samples (s).
const INTERVAL: f64 = 1e-5;
/// Steps per sample of the reference, and of runs that assess models.
const TRUE_DIVISION: u32 = 80;
const MODEL_DIVISION: u32 = 40;
/// Errors at which costs are compared.
const EQUAL: [f64; 2] = [3e-2, 1e-2];

/// Size of the models.
struct BasisSize {
    mesh: MeshCounts,
    modes: &'static [usize],
    /// With fewer modes, responses exceed the retained frequencies.
    covered: usize,
    /// Number of modes of the reference, and of the full model for the comparison of responses.
    true_modes: usize,
    checked: usize,
    patches: usize,
    samples: usize,
    /// Steps per sample of the timed runs, including the one that determines the time of a step.
    divisions: &'static [u32],
}

/// Steps per sample of the run that determines the time of a step.
const TYPICAL: u32 = 20;

const FULL: BasisSize = BasisSize {
    mesh: MeshCounts { chord: 16, thickness: 2, span: 20 },
    modes: &[8, 12, 20, 40, 80],
    covered: 20,
    true_modes: 320,
    checked: 30,
    patches: 9,
    samples: 349,
    divisions: &[1, 2, 3, 5, 10, TYPICAL, 40, 80],
};
const QUICK: BasisSize = BasisSize {
    mesh: MeshCounts { chord: 4, thickness: 1, span: 5 },
    modes: &[6, 12],
    covered: 12,
    true_modes: 60,
    checked: 12,
    patches: 3,
    samples: 130,
    divisions: &[2, 5, TYPICAL],
};

/// Contact of the tip, and the type of modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct BasisChoice {
    /// Number of patches; otherwise three nodes.
    patches: Option<usize>,
    kind: ReductionKind,
}

impl BasisChoice {
    /// Returns all choices, that of the paper first and the default last.
    fn all(patches: usize) -> [Self; 4] {
        let of =
            |patches| [ReductionKind::FixedInterface, ReductionKind::FreeInterface].map(|kind| Self { patches, kind });
        let ([a, b], [c, d]) = (of(None), of(Some(patches)));
        [a, b, c, d]
    }

    fn name(self) -> String {
        let contact = self.patches.map_or("3 nodes".to_owned(), |count| format!("{count} patches"));
        let kind = match self.kind {
            ReductionKind::FixedInterface => "Craig-Bampton",
            ReductionKind::FreeInterface => "free interface",
        };
        format!("{contact}, {kind}")
    }

    /// Reduces a model with `modes` modes.
    fn rom(self, size: &BasisSize, modes: usize, console: &Console) -> Result<Rom> {
        let tip = self.patches.map_or(TipContact::Nodes(3), TipContact::Patches);
        let own = Rotor37Options { mesh: size.mesh, tip, kind: self.kind, modes, ..Rotor37Options::default() };
        Ok(reduction::rotor37(&Rotor37Options { checked_modes: size.checked, ..own }, console)?.rom)
    }

    /// Runs the same contact with the largest number of modes.
    fn truth(self, size: &BasisSize, console: &Console) -> Result<RunSummary> {
        let rom = Self { kind: ReductionKind::FreeInterface, ..self }.rom(size, size.true_modes, console)?;
        marched(&scene(rom)?, TRUE_DIVISION, size.samples)
    }
}

/// Returns the light rub of rotor 37.
fn scene(rom: Rom) -> Result<Scene> {
    let mut scene = scene_source::rotor37_scene_with(rom)?;
    scene.settings.experiment.communication_step = INTERVAL;
    Ok(scene)
}

fn marched(scene: &Scene, division: u32, samples: usize) -> Result<RunSummary> {
    let scene = with(scene, Scheme::ModalExact, division);
    march(&scene, &[], division, samples).map_err(|why| Failure::new("light rub", why, ""))
}

fn with(scene: &Scene, scheme: Scheme, division: u32) -> Scene {
    SceneRun::changed(scene, (scheme, Solver::Lcp), INTERVAL / f64::from(division), 0.0)
}

/// A successful run: error against the reference of the same contact, and processor time per simulated millisecond (s).
#[derive(Debug, Clone, Copy)]
struct Timed {
    modes: usize,
    scheme: Scheme,
    step: f64,
    error: f64,
    seconds: f64,
}

/// Results of a model.
struct BasisModel {
    basis: BasisChoice,
    modes: usize,
    /// Largest relative errors of the static flexibility at the contact and of the forced response.
    flexibility: f64,
    response: f64,
    /// Errors of displacements against the same contact with the largest number of modes, and against patches with the
    /// largest number of modes.
    same: f64,
    patches: f64,
    /// Error against the same contact with massless-boundary, which removes the inertia of the contact.
    massless: f64,
    /// Limits of central differences, modal-exact, massless-boundary with closed contact (s), if there are any.
    limits: Vec<(&'static str, Option<f64>)>,
    /// Processor time of an internal step of all blades (s).
    step_time: f64,
    timed: Vec<Timed>,
}

/// Runs a model with all schemes and steps.
fn timed(scene: &Scene, modes: usize, truth: &RunSummary, size: &BasisSize) -> Vec<Timed> {
    let schemes = Scheme::RECURRENCES;
    let samples = size.samples;
    let configurations = schemes.iter().flat_map(|scheme| size.divisions.iter().map(|division| (*scheme, *division)));
    let of = |(scheme, division): (Scheme, u32)| {
        let scene = with(scene, scheme, division);
        let found = march(&scene, &[], division, samples).ok()?;
        let start = || {
            SceneRun::with_start_values(&scene, INTERVAL, division, &[]).map(|run| Box::new(run) as Box<dyn TimedRun>)
        };
        let seconds = run::time(&start, samples, 1, None).ok()?;
        Some(Timed {
            modes,
            scheme,
            step: INTERVAL / f64::from(division),
            error: found.changes(truth)[0]?,
            seconds: seconds / (1e3 * INTERVAL * samples as f64),
        })
    };
    configurations.filter_map(of).collect()
}

fn model(
    basis: BasisChoice,
    modes: usize,
    size: &BasisSize,
    truths: [&RunSummary; 2],
    console: &Console,
) -> Result<BasisModel> {
    let rom = basis.rom(size, modes, console)?;
    let failed = |error: tiprub_core::Error| Failure::from_below("reduced blade", error);
    let limits = SingleStructure::new(&rom, rom.damping_ratio, 0.0).map_err(failed)?.step_limits(None);
    let worst = |values: &[f64]| values.iter().fold(0.0, |most: f64, value| most.max(value.abs())) / 100.0;
    let (flexibility, response) = (worst(&rom.checks.flexibility_deviation), worst(&rom.checks.response_deviation));
    let scene = scene(rom)?;
    let own = marched(&scene, MODEL_DIVISION, size.samples)?;
    let [same, patches] = truths.map(|truth| own.changes(truth)[0].unwrap_or(f64::NAN));
    let massless = march(&with(&scene, Scheme::MasslessBoundary, MODEL_DIVISION), &[], MODEL_DIVISION, size.samples);
    let massless = massless.ok().and_then(|run| run.changes(truths[0])[0]).unwrap_or(f64::NAN);
    let timed = timed(&scene, modes, truths[0], size);
    let typical = INTERVAL / f64::from(TYPICAL);
    let judged = timed.iter().find(|one| one.scheme == Scheme::ModalExact && (one.step / typical - 1.0).abs() < 1e-9);
    let step_time = judged.map_or(f64::NAN, |one| one.seconds * one.step * 1e3);
    let limits = limits.iter().map(|limit| (limit.scheme, limit.below())).collect();
    Ok(BasisModel { basis, modes, flexibility, response, same, patches, massless, limits, step_time, timed })
}

/// Returns the cheapest run of a basis within an error.
fn cheapest(all: &[BasisModel], basis: BasisChoice, error: f64) -> Option<Timed> {
    let runs = all.iter().filter(|found| found.basis == basis).flat_map(|found| &found.timed);
    runs.filter(|one| one.error <= error).min_by(|a, b| a.seconds.total_cmp(&b.seconds)).copied()
}

fn table(all: &[BasisModel], frequency: f64) -> String {
    let mut text = format!(
        "| contact, basis | modes | flexibility error | response error up to {:.1} kHz | rub error | rub error, \
         massless-boundary | rub error against patches | largest step: central-difference | modal-exact | \
         massless-boundary | µs per step |\n|---|---|---|---|---|---|---|---|---|---|---|\n",
        1e-3 * frequency
    );
    for one in all {
        let limit = |name: &str| {
            let found = one.limits.iter().find(|(scheme, _)| *scheme == name).and_then(|(_, limit)| *limit);
            found.map_or("rejected".to_owned(), |limit| format!("{:.2} µs", 1e6 * limit))
        };
        text.push_str(&format!(
            "| {} | {} | {:.0e} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {} | {} | {} | {:.0} |\n",
            one.basis.name(),
            one.modes,
            one.flexibility,
            one.response,
            one.same,
            one.massless,
            one.patches,
            limit(Scheme::CentralDifference.name()),
            limit(Scheme::ModalExact.name()),
            limit(Scheme::MasslessBoundary.name()),
            1e6 * one.step_time,
        ));
    }
    text
}

fn cost_table(all: &[BasisModel], bases: &[BasisChoice]) -> String {
    let mut text = String::from(
        "| contact, basis | error | lowest cost: modes, scheme, step | ms per simulated ms | relative to the first row \
         of \
         this error |\n|---|---|---|---|---|\n",
    );
    for error in EQUAL {
        let first = cheapest(all, bases[0], error);
        for basis in bases {
            let (how, cost, ratio) = match cheapest(all, *basis, error) {
                None => ("not reached".to_owned(), "–".to_owned(), "–".to_owned()),
                Some(one) => (
                    format!("{}, {}, {:.3} µs", one.modes, one.scheme.name(), 1e6 * one.step),
                    format!("{:.1}", 1e3 * one.seconds),
                    first.map_or("–".to_owned(), |first| format!("{:.2}", one.seconds / first.seconds)),
                ),
            };
            text.push_str(&format!("| {} | {error:.0e} | {how} | {cost} | {ratio} |\n", basis.name()));
        }
    }
    text
}

fn figure(all: &[BasisModel], bases: &[BasisChoice]) -> Result<StudyFigure> {
    let of = |basis: BasisChoice| all.iter().filter(move |one| one.basis == basis);
    let line = |basis: &BasisChoice| of(*basis).map(|one| (one.modes as f64, one.same.log10())).collect();
    let series = bases.iter().map(|basis| Series::line(basis.name(), line(basis))).collect();
    let plot = Plot { marked: true, ..Plot::new("modes", "log10 of the displacement error", series) };
    let mut sheet = Sheet::new([
        "basis",
        "modes",
        "flexibility",
        "response",
        "rub",
        "rub, massless-boundary",
        "rub, against patches",
    ]);
    for (index, basis) in bases.iter().enumerate() {
        let row = |one: &BasisModel| {
            vec![index as f64, one.modes as f64, one.flexibility, one.response, one.same, one.massless, one.patches]
        };
        sheet.rows.extend(of(*basis).map(row));
    }
    Ok(StudyFigure {
        name: "modes",
        caption: "Displacement error of a light rub, relative to the model with the same contact and the most modes."
            .into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

fn statements(all: &[BasisModel], bases: &[BasisChoice], covered: usize) -> Vec<Statement> {
    let pairs = || {
        bases.chunks(2).flat_map(|pair| {
            let of = |basis: BasisChoice| all.iter().filter(move |one| one.basis == basis);
            of(pair[0]).zip(of(pair[1]))
        })
    };
    let flexibility = all.iter().map(|one| one.flexibility).fold(0.0, f64::max);
    let reported = |value: &dyn Fn(&BasisModel) -> f64| {
        let each = pairs().map(|(held, free)| format!("{:.1e} / {:.1e}", value(held), value(free)));
        each.collect::<Vec<_>>().join("; ")
    };
    let last = |basis: BasisChoice| all.iter().rfind(|one| one.basis == basis);
    let smaller = bases.chunks(2).all(|pair| match (last(pair[0]), last(pair[1])) {
        (Some(held), Some(free)) => free.same < held.same,
        _ => false,
    });
    let massless = |one: &BasisModel| one.limits.iter().find(|limit| limit.0 == Scheme::MasslessBoundary.name())?.1;
    let steps: Vec<String> = all
        .iter()
        .filter_map(|one| Some(format!("{}, {}: {:.1} µs", one.basis.name(), one.modes, 1e6 * massless(one)?)))
        .collect();
    vec![
        Statement::tested(
            "The static flexibility at the contact is exact to 1e-6 with any number of modes",
            flexibility < 1e-6,
            format!("largest deviation {flexibility:.0e}"),
        ),
        Statement::tested(
            format!(
                "With {covered} or more modes, free-interface modes have a smaller forced-response error than the same \
                 number of fixed-interface modes"
            ),
            pairs().filter(|(held, _)| held.modes >= covered).all(|(held, free)| free.response < held.response),
            reported(&|one| one.response),
        ),
        Statement::tested(
            "With the most modes, free-interface modes also have a smaller error in a light rub",
            smaller,
            reported(&|one| one.same),
        ),
        Statement::tested(
            "With the most modes and no inertia at the contact (massless-boundary), free-interface modes have a \
             smaller error",
            bases.chunks(2).all(|pair| match (last(pair[0]), last(pair[1])) {
                (Some(held), Some(free)) => free.massless < held.massless,
                _ => false,
            }),
            reported(&|one| one.massless),
        ),
        Statement::remark("Largest steps of massless-boundary with closed contact", steps.join("; ")),
    ]
}

fn results(all: &[BasisModel]) -> Value {
    let run = |one: &Timed| json!({ "scheme": one.scheme.name(), "step": one.step, "error": one.error, "seconds_per_ms": one.seconds });
    let row = |one: &BasisModel| {
        json!({
            "basis": one.basis.name(), "modes": one.modes, "flexibility": one.flexibility, "response": one.response,
            "rub": one.same, "rub_massless": one.massless, "rub_against_patches": one.patches, "limits": one.limits, "step_seconds": one.step_time,
            "runs": one.timed.iter().map(run).collect::<Vec<_>>(),
        })
    };
    Value::Array(all.iter().map(row).collect())
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, a run at short steps that fails, a plot that cannot be drawn.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let size = if arguments.quick { &QUICK } else { &FULL };
    let quiet = Console::new(true, false);
    let bases = BasisChoice::all(size.patches);
    let task = console.task("Reducing and running models", Some((bases.len() * size.modes.len() + 2) as u64));
    let truths = [bases[0].truth(size, &quiet)?, bases[3].truth(size, &quiet)?];
    let mut all = Vec::new();
    for (index, basis) in bases.iter().enumerate() {
        for modes in size.modes {
            all.push(model(*basis, *modes, size, [&truths[index / 2], &truths[1]], &quiet)?);
            task.at(all.len() as u64 + 2);
        }
    }
    let rom = bases[3].rom(size, size.modes[0], &quiet)?;
    let frequency = rom.checks.response_frequencies.iter().copied().fold(0.0, f64::max);
    let MeshCounts { chord, thickness, span } = size.mesh;
    let tables = [table(&all, frequency), cost_table(&all, &bases)].join("\n");
    Ok(Study {
        name: "bases",
        title: "Reduction basis of a blade".into(),
        summary: format!(
            "Rotor 37 with contact nodes or patches, reduced with fixed-interface or free-interface modes. Errors are \
             in the displacements of the leading edge, mid-chord and trailing edge in a light rub, relative to {} \
             free-interface modes and steps of {:e} s.",
            size.true_modes,
            INTERVAL / f64::from(TRUE_DIVISION)
        ),
        facts: vec![
            ("mesh".into(), format!("{chord} × {thickness} × {span} quadratic bricks")),
            ("window".into(), format!("{:.2} ms", 1e3 * INTERVAL * size.samples as f64)),
            ("forced response up to".into(), format!("{frequency:.0} Hz")),
        ],
        statements: statements(&all, &bases, size.covered),
        figures: vec![figure(&all, &bases)?],
        results: results(&all),
        files: vec![("bases.md".into(), "tables for the guide".into(), tables.into_bytes())],
    })
}
