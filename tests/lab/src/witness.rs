//! Reduced blades against the full, unreduced finite-element model, with time stepping and contact that share no code
//! with the product.

mod stress;

use std::f64::consts::{FRAC_PI_2, TAU};

use serde_json::{Value, json};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame};
use tiprub_core::scene::settings::Shape;
use tiprub_core::{Rom, Scene};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::{reduction::failure, scene_source};
use tiprub_model::{
    FeModel, Material, Rotor37Options,
    patches::tip_patches,
    progress::silent,
    reduce::{ContactPoint, ReductionKind, ReductionOptions, reduce_model},
    rotor37::{BladeMesh, MeshCounts, blade_mesh},
    stress::StressPlaces,
};
use tiprub_reference::{
    blade::{BladeHistory, BladeSteps, FullBlade, Gauge, TipPart},
    reduced::rub::BumpedCasing,
};
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{
    Picture, Sheet, Statement, Study, StudyFigure,
    arguments::StudyCommon,
    convergence::march::{RunSummary, march},
};

pub(crate) use stress::study as stress;

/// Time between samples (s).
const INTERVAL: f64 = 4e-6;
/// Angle from the middle of the tip at the start to that of the first bump (rad).
const AHEAD: f64 = 0.5;
/// Size of the models.
struct WitnessSize {
    mesh: MeshCounts,
    /// Number of samples: two touches, or one.
    samples: usize,
    /// Numbers of steps of the witness per sample, ascending.
    divisions: [u32; 3],
    /// Numbers of patches of the default and of the refined model.
    patches: [usize; 2],
    /// Numbers of modes of the default model, and of the refined one.
    modes: [usize; 2],
    /// Maximum number of rows of patches across the thickness.
    rows: usize,
}

const FULL: WitnessSize = WitnessSize {
    mesh: MeshCounts { chord: 12, thickness: 2, span: 20 },
    samples: 575,
    divisions: [4, 8, 16],
    patches: [9, 17],
    modes: [80, 400],
    rows: 3,
};
const QUICK: WitnessSize = WitnessSize {
    mesh: MeshCounts { chord: 4, thickness: 1, span: 6 },
    samples: 125,
    divisions: [2, 4, 8],
    patches: [3, 5],
    modes: [16, 50],
    rows: 2,
};

/// Contact of the tip.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Touching {
    Nodes(usize),
    /// Numbers of patches along the chord and of rows across the thickness.
    Patches(usize, usize),
    /// Gauss points of its faces, with this number along either direction of a face.
    Points(usize),
    /// The nodes of its outline: a tip with sharp sides.
    Sides,
}

impl Touching {
    fn name(self) -> String {
        match self {
            Self::Nodes(count) => format!("{count} nodes"),
            Self::Patches(count, 1) => format!("{count} patches"),
            Self::Patches(count, rows) => format!("{count} × {rows} patches"),
            Self::Points(each) => format!("{each} × {each} points of every face"),
            Self::Sides => "nodes of the sides".to_owned(),
        }
    }
}

/// A reduced model and the method with which the product steps it.
struct WitnessModel {
    name: &'static str,
    touching: Touching,
    modes: usize,
    method: (Scheme, Solver),
    /// Number of steps per sample.
    division: u32,
}

/// A run of the product, or the reason why it was rejected.
type WitnessRun = std::result::Result<RunSummary, String>;

/// Default method and step, which is followed by one with short steps, to assess the model alone, one without boundary
/// mass, and that of the paper.
const DEFAULT: ((Scheme, Solver), u32) = ((Scheme::ModalExact, Solver::Lcp), 8);
const FINE: ((Scheme, Solver), u32) = ((Scheme::ModalExact, Solver::Lcp), 64);
const MASSLESS: ((Scheme, Solver), u32) = ((Scheme::MasslessBoundary, Solver::Lcp), 8);
/// Tolerance of adaptive steps: small compared with the errors of the models.
const TOLERANCE: f64 = 1e-3;
/// Adaptive steps as long as the tolerance permits.
const GALERKIN: ((Scheme, Solver), u32) = ((Scheme::Galerkin, Solver::Lcp), 1);
const PAPER: ((Scheme, Solver), u32) = ((Scheme::CentralDifference, Solver::Film), 4);

impl WitnessSize {
    fn of(quick: bool) -> &'static Self {
        if quick { &QUICK } else { &FULL }
    }

    fn reduced(&self) -> Vec<WitnessModel> {
        let ([few, many], [own, most]) = (self.patches, self.modes);
        let one = |name, touching, modes, (method, division)| WitnessModel { name, touching, modes, method, division };
        let patches = Touching::Patches;
        let all = [
            one("paper model", Touching::Nodes(3), 20, PAPER),
            one("default", patches(few, 1), own, DEFAULT),
            one("short steps", patches(few, 1), own, FINE),
            one("more modes", patches(few, 1), most, FINE),
            one("more patches", patches(many, 1), most, FINE),
            one("two rows", patches(few, 2), own, DEFAULT),
            one("two rows, short steps", patches(few, 2), own, FINE),
            one("two rows, massless", patches(few, 2), own, MASSLESS),
            one("two rows, adaptive steps", patches(few, 2), own, GALERKIN),
            one("two rows, more modes", patches(few, 2), most, FINE),
            one("three rows, more modes", patches(few, 3), most, FINE),
            one("two rows, more patches", patches(many, 2), most, FINE),
        ];
        // Each checks at its start whether closed contact grows, which takes longer than the run.
        let quick = ["paper model", "default", "more modes", "two rows, more modes"];
        all.into_iter().filter(|one| self.rows > 2 || quick.contains(&one.name)).collect()
    }

    /// Returns the runs of the witness: contact, steps per sample. The last run of each contact has the shortest steps.
    fn witnesses(&self) -> Vec<(Touching, u32)> {
        let ([few, many], finest) = (self.patches, self.divisions[2]);
        let refined = self.divisions.iter().map(|division| (Touching::Patches(few, 1), *division));
        let sides = self.divisions[1..].iter().map(|division| (Touching::Sides, *division));
        let points = (2..=self.rows).map(|each| (Touching::Points(each), self.divisions[1]));
        let rows = (2..=self.rows).map(|rows| (few, rows));
        let more = [(many, 1), (many, 2)].into_iter().filter(|(_, rows)| self.rows > *rows);
        let others = rows.chain(more).map(|(count, rows)| (Touching::Patches(count, rows), finest));
        refined.chain(sides).chain(points).chain(others).chain([(Touching::Nodes(3), self.divisions[1])]).collect()
    }
}

/// The scene of rotor 37 with one undamped blade that soon reaches the first bump.
struct WitnessScene {
    size: &'static WitnessSize,
    material: Material,
    blade: BladeMesh,
    full: FullBlade,
    /// Angle of the middle of the tip (rad).
    middle: f64,
}

impl WitnessScene {
    fn new(quick: bool) -> Result<Self> {
        let size = WitnessSize::of(quick);
        let reported = |error| failure("full model of the blade", error);
        let material = Rotor37Options::default().material;
        let blade = blade_mesh(size.mesh).map_err(reported)?;
        let clamped = blade.mesh.set("hub").map_err(reported)?;
        let full = FullBlade::new(&blade.mesh, &material, clamped).map_err(reported)?;
        let mut setting = Self { size, material, full, middle: 0.0, blade };
        setting.middle = setting.parts(Touching::Patches(3, 1))?[1].angle();
        Ok(setting)
    }

    /// Returns the phase of the bumps (rad): one is ahead of the tip.
    fn phase(&self) -> f64 {
        self.middle + AHEAD - FRAC_PI_2
    }

    /// Returns the contact of a reduced model.
    fn contact(&self, touching: Touching) -> Result<Vec<ContactPoint>> {
        let mesh = &self.blade.mesh;
        let found = match touching {
            Touching::Nodes(count) => self.blade.contact_points(count),
            Touching::Patches(count, rows) => {
                let name = |index: usize| format!("patch_{}", index + 1);
                mesh.set("tip").and_then(|tip| tip_patches(mesh, tip, [count, rows], name))
            }
            Touching::Points(_) | Touching::Sides => {
                return Err(Failure::new("lab witness", "reduced models cannot have contact points or sides", ""));
            }
        };
        found.map_err(|error| failure("tip of the blade", error))
    }

    fn parts(&self, touching: Touching) -> Result<Vec<TipPart>> {
        let mesh = &self.blade.mesh;
        let tip = mesh.set("tip").map_err(|error| failure("tip of the blade", error))?;
        match touching {
            Touching::Points(each) => return Ok(TipPart::points(mesh, tip, each)),
            Touching::Sides => return Ok(TipPart::outline(mesh, tip)),
            Touching::Nodes(_) | Touching::Patches(..) => {}
        }
        let part = |point: &ContactPoint| TipPart::mean(&mesh.nodes, point.weights(), point.meridional_slope);
        Ok(self.contact(touching)?.iter().map(part).collect())
    }

    fn rom(&self, reduced: &WitnessModel) -> Result<Rom> {
        self.rom_with(reduced, StressPlaces::default())
    }

    fn rom_with(&self, reduced: &WitnessModel, stress: StressPlaces) -> Result<Rom> {
        let reported = |error| failure("reduction of the blade", error);
        let options = ReductionOptions {
            name: "rotor37".into(),
            kind: match reduced.touching {
                Touching::Nodes(_) => ReductionKind::FixedInterface,
                _ => ReductionKind::FreeInterface,
            },
            modes: reduced.modes,
            checked_modes: 10,
            sectors: 1,
            frame: DisplacementFrame::Cylindrical,
            watched: self.blade.contact_points(3).map_err(reported)?,
            stress,
            damping_ratio: 0.0,
        };
        let (mesh, contact) = (self.blade.mesh.clone(), self.contact(reduced.touching)?);
        let clamped = self.blade.mesh.set("hub").map_err(reported)?;
        let model = FeModel::assembled(mesh, &self.material, String::new(), &silent).map_err(reported)?;
        Ok(reduce_model(model, clamped, &contact, &options, None, &silent).map_err(reported)?.rom)
    }

    /// Returns the scene for a reduced model.
    fn scene(&self, reduced: &WitnessModel) -> Result<Scene> {
        self.scene_of(reduced, self.rom(reduced)?)
    }

    fn scene_of(&self, reduced: &WitnessModel, rom: Rom) -> Result<Scene> {
        let mut settings = scene_source::settings("builtin:rotor37-one-row")?;
        let surface = &mut settings.surfaces[0];
        surface.ramp_time = 0.0;
        if let Shape::TwoLobe { phase, .. } = &mut surface.shape {
            *phase = self.phase();
        }
        settings.structures[0].damping_ratio = Some(0.0);
        settings.experiment.communication_step = INTERVAL;
        settings.time.step = INTERVAL / f64::from(reduced.division);
        (settings.time.scheme, settings.contacts[0].solver) = reduced.method;
        settings.time.tolerance = settings.time.scheme.properties().adaptive.then_some(TOLERANCE);
        Ok(Scene { settings, roms: vec![rom] })
    }

    /// Runs the scene, or returns the reason why it is rejected.
    fn run_reduced(&self, reduced: &WitnessModel) -> Result<WitnessRun> {
        Ok(march(&self.scene(reduced)?, &[], reduced.division, self.size.samples))
    }

    /// Runs the full model, with stress at gauges.
    fn run_full(&self, touching: Touching, division: u32, gauges: &[Gauge]) -> Result<BladeHistory> {
        let reported = |error| failure("full model of the blade", error);
        let settings = scene_source::settings("builtin:rotor37-one-row")?;
        let Shape::TwoLobe { depth, width, .. } = settings.surfaces[0].shape else {
            return Err(Failure::new("lab witness", "the scene has no bumps", ""));
        };
        let contact = &settings.contacts[0];
        let obstacle = BumpedCasing {
            clearance: contact.gap,
            speed: settings.structures[0].speed,
            friction: contact.friction,
            bumps: [2.0 * contact.gap * depth, width, 0.0],
        };
        let parts: Vec<TipPart> = self.parts(touching)?.into_iter().map(|part| part.turned(-self.phase())).collect();
        let steps = BladeSteps { interval: INTERVAL, division, samples: self.size.samples };
        self.full.march(&parts, &obstacle, steps, (&self.watched()?, gauges)).map_err(reported)
    }

    /// Returns the nodes whose displacements are compared.
    fn watched(&self) -> Result<Vec<usize>> {
        let points = self.blade.contact_points(3).map_err(|error| failure("full model of the blade", error))?;
        Ok(points.iter().map(|point| point.node).collect())
    }

    /// Runs the full model; also returns the energy that its steps lose or gain in addition to the contact.
    fn run_witness(&self, touching: Touching, division: u32) -> Result<(RunSummary, f64)> {
        let found = self.run_full(touching, division, &[])?;
        let place = |node: &usize| {
            let [x, y, z] = self.blade.mesh.nodes[*node];
            ContactNode { position: [x.hypot(y), y.atan2(x), z], ..ContactNode::default() }
        };
        let marched = RunSummary {
            points: self.watched()?.iter().map(place).collect(),
            impulse: found.impulses.iter().sum(),
            friction_work: found.friction_work.last().copied().unwrap_or_default(),
            peak_force: found.impulses.iter().fold(0.0, |most: f64, impulse| most.max(impulse / INTERVAL)),
            strain_energy: found.strain.iter().sum::<f64>() / found.strain.len() as f64,
            displacements: found.displacements,
        };
        Ok((marched, found.residual))
    }
}

/// All runs.
struct WitnessRuns {
    witnesses: Vec<((Touching, u32), RunSummary)>,
    reduced: Vec<(WitnessModel, WitnessRun)>,
    /// Largest residual of energy of a witness.
    residual: f64,
}

impl WitnessRuns {
    /// Returns the witness with this contact and the shortest steps.
    fn witness(&self, touching: Touching) -> Result<&RunSummary> {
        let missing =
            || Failure::new("lab witness", format!("there is no full-model run with {}", touching.name()), "");
        self.witnesses.iter().rev().find(|((other, _), _)| *other == touching).map(|(_, run)| run).ok_or_else(missing)
    }

    fn row(&self, name: String, run: &RunSummary, touching: Touching) -> Result<WitnessRow> {
        Ok(WitnessRow {
            name,
            impulse: run.impulse,
            friction_work: run.friction_work,
            own: run.changes(self.witness(touching)?),
            sides: run.changes(self.witness(Touching::Sides)?),
            finest: true,
        })
    }

    fn rows(&self) -> Result<Vec<WitnessRow>> {
        let witnesses = self.witnesses.iter().map(|((touching, division), run)| {
            let step = 1e6 * INTERVAL / f64::from(*division);
            let row = self.row(format!("full model, {}, {step} µs", touching.name()), run, *touching)?;
            Ok(WitnessRow { finest: std::ptr::eq(self.witness(*touching)?, run), ..row })
        });
        let reduced = self.reduced.iter().map(|(model, run)| {
            let step = 1e6 * INTERVAL / f64::from(model.division);
            let WitnessModel { name, touching, modes, .. } = model;
            let name = format!("{name}: {}, {modes} modes, {step} µs", touching.name());
            match run {
                Ok(run) => self.row(name, run, *touching),
                Err(_) => Ok(WitnessRow { name: format!("{name}: rejected"), finest: true, ..WitnessRow::default() }),
            }
        });
        witnesses.chain(reduced).collect()
    }
}

/// One run against the full model with the same contact and with contact at its sides: displacements, impulse, friction work, peak force,
/// strain energy.
#[derive(Default)]
struct WitnessRow {
    name: String,
    /// Impulse (N·s).
    impulse: f64,
    /// Friction work (J).
    friction_work: f64,
    own: [Option<f64>; 5],
    sides: [Option<f64>; 5],
    /// False for the full model if another run of it has shorter steps.
    finest: bool,
}

impl WitnessRow {
    fn displacement(&self) -> f64 {
        self.own[0].unwrap_or(f64::NAN)
    }
}

fn shown(value: &Option<f64>) -> String {
    match value {
        Some(0.0) | None => "–".to_owned(),
        Some(value) => format!("{:.2} %", 100.0 * value),
    }
}

/// Returns tables of every run against the full model with the same contact, then of each contact against that at the
/// nodes of the outline: the full model with its shortest steps, and the reduced ones.
fn tables(rows: &[WitnessRow]) -> String {
    let mut text = String::from(
        "| run | impulse (N·s) | friction work (J) | against the full model with the same contact: displacements | \
         impulse | friction work |\n|---|---|---|---|---|---|\n",
    );
    for WitnessRow { name, impulse, friction_work, own, .. } in rows {
        let cells: Vec<String> = own[..3].iter().map(shown).collect();
        text.push_str(&format!("| {name} | {impulse:.4} | {friction_work:.2} | {} |\n", cells.join(" | ")));
    }
    text.push_str(
        "\n| contact | impulse (N·s) | friction work (J) | against the full model with contact at the sides: \
         displacements | impulse | friction work |\n|---|---|---|---|---|---|\n",
    );
    for WitnessRow { name, impulse, friction_work, sides, .. } in rows.iter().filter(|row| row.finest) {
        let cells: Vec<String> = sides[..3].iter().map(shown).collect();
        text.push_str(&format!("| {name} | {impulse:.4} | {friction_work:.2} | {} |\n", cells.join(" | ")));
    }
    text
}

fn figure(runs: &WitnessRuns, size: &WitnessSize) -> Result<StudyFigure> {
    let witness = runs.witness(Touching::Patches(size.patches[0], 1))?;
    let sides = runs.witness(Touching::Sides)?;
    let named =
        |name: &str| runs.reduced.iter().find(|(model, _)| model.name == name).and_then(|(_, run)| run.as_ref().ok());
    let shown = [
        ("full model, patches", Some(witness)),
        ("full model, sides", Some(sides)),
        ("default", named("default")),
        ("two rows", named("two rows, more modes")),
        ("paper model", named("paper model")),
    ];
    let time = |sample: usize| 1e3 * (sample + 1) as f64 * INTERVAL;
    // Radial displacement of the trailing edge, the third node.
    let line = |run: &RunSummary| {
        run.displacements.iter().enumerate().map(|(sample, all)| (time(sample), 1e6 * all[6])).collect::<Vec<_>>()
    };
    let all: Vec<(&str, Vec<(f64, f64)>)> =
        shown.into_iter().filter_map(|(name, run)| Some((name, line(run?)))).collect();
    let series = all.iter().map(|(name, points)| Series::line(*name, points.clone())).collect();
    let plot = Plot::new("time (ms)", "radial displacement of the trailing edge (µm)", series);
    let mut sheet = Sheet::new(["time (ms)"]);
    sheet.columns.extend(all.iter().map(|(name, _)| format!("{name} (µm)")));
    for sample in 0..size.samples {
        let values = all.iter().map(|(_, points)| points[sample].1);
        sheet.rows.push([time(sample)].into_iter().chain(values).collect());
    }
    Ok(StudyFigure {
        name: "trailing-edge",
        caption: "The blade passes the bumps: full finite-element model, default reduced model, and the paper's \
             model."
            .into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

fn statements(rows: &[WitnessRow], runs: &WitnessRuns) -> Result<Vec<Statement>> {
    let find = |start: &str| {
        let missing = || Failure::new("lab witness", format!("there is no run `{start}`"), "");
        rows.iter().find(|row| row.name.starts_with(start)).ok_or_else(missing)
    };
    let (coarse, fine) = (&rows[0], &rows[1]);
    let (default, more, paper) = (find("default:")?, find("more modes:")?, find("paper model:")?);
    let full = find("full model, 9 × 2").or_else(|_| find("full model, 3 × 2"))?;
    let two = find("two rows, more modes:")?;
    let [of, left] = [0, 1].map(|which| move |row: &WitnessRow| row.sides[which].unwrap_or(f64::NAN));
    Ok(vec![
        Statement::tested(
            "The energy balance of the full model closes to accumulated rounding, 1e-6",
            runs.residual < 1e-6,
            format!("{:.0e} of the largest energy", runs.residual),
        ),
        Statement::tested(
            "The full model converges with shorter steps",
            fine.displacement() < 0.75 * coarse.displacement(),
            format!(
                "displacements differ by {} with four times the step, by {} with twice the step",
                percent(coarse.displacement()),
                percent(fine.displacement())
            ),
        ),
        Statement::tested(
            "With more modes, the reduced model converges to the full model with the same patches, within the step \
             error of the full model",
            more.displacement() < default.displacement() && more.displacement() < 1.5 * fine.displacement(),
            format!(
                "displacements differ by {}, with fewer modes by {}",
                percent(more.displacement()),
                percent(default.displacement())
            ),
        ),
        Statement::tested(
            "Two rows of patches at the sides of the tip represent contact at its sides: the impulse error is less \
             than a third of that with one row",
            3.0 * left(two) < left(default) && 3.0 * left(full) < left(default) && of(two) < of(default),
            format!(
                "impulse error {} with one row, {} with two rows, {} for the full model with two rows; displacement \
                 error {} and {}",
                percent(left(default)),
                percent(left(two)),
                percent(left(full)),
                percent(of(default)),
                percent(of(two))
            ),
        ),
        Statement::tested(
            "The default model is closer to the full model with contact at the sides than the paper's model",
            of(default) < of(paper),
            format!(
                "errors of displacements {}, impulse {}, friction work {}; displacements of the paper's model {}",
                percent(of(default)),
                percent(default.sides[1].unwrap_or(f64::NAN)),
                percent(default.sides[2].unwrap_or(f64::NAN)),
                percent(of(paper))
            ),
        ),
    ])
}

fn results(rows: &[WitnessRow], runs: &WitnessRuns) -> Value {
    let names = ["displacements", "impulse", "friction_work", "peak_force", "strain_energy"];
    let of = |values: &[Option<f64>; 5]| -> serde_json::Map<String, Value> {
        names.iter().zip(values).map(|(name, value)| ((*name).to_owned(), json!(value))).collect()
    };
    let row = |row: &WitnessRow| {
        json!({
            "run": row.name, "impulse": row.impulse, "friction_work": row.friction_work, "same_contact": of(&row.own),
            "sides": of(&row.sides),
        })
    };
    let refused =
        runs.reduced.iter().filter_map(|(model, run)| Some(json!({ "run": model.name, "why": run.as_ref().err()? })));
    json!({ "runs": rows.iter().map(row).collect::<Vec<_>>(), "refused": refused.collect::<Vec<_>>() })
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, a run that fails, a plot that cannot be drawn.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let setting = WitnessScene::new(arguments.quick)?;
    let size = setting.size;
    let task = console.task("Full model of the blade", Some(size.witnesses().len() as u64));
    // The longest runs first.
    let mut asked = size.witnesses();
    asked.sort_by_key(|(_, division)| std::cmp::Reverse(*division));
    let run = |(touching, division): &(Touching, u32)| setting.run_witness(*touching, *division);
    let found = sweep::sweep(&asked, sweep::processors(), run, |done| task.at(done as u64))?;
    let residual = found.iter().map(|(_, residual)| *residual).fold(0.0, f64::max);
    let mut witnesses: Vec<_> = asked.into_iter().zip(found).map(|(what, (run, _))| (what, run)).collect();
    let order = size.witnesses();
    witnesses.sort_by_key(|(what, _)| order.iter().position(|other| other == what));
    let marched = |reduced: WitnessModel| setting.run_reduced(&reduced).map(|run| (reduced, run));
    let reduced = size.reduced().into_iter().map(marched).collect::<Result<_>>()?;
    let runs = WitnessRuns { witnesses, reduced, residual };
    let rows = runs.rows()?;
    let MeshCounts { chord, thickness, span } = size.mesh;
    Ok(Study {
        name: "witness",
        title: "Reduced blades compared with full finite elements".into(),
        summary: format!(
            "One blade of rotor 37, without damping, passes bumps on its casing. The reference is the full \
             finite-element model with {} degrees of freedom, integrated implicitly with an independent contact \
             algorithm.{}",
            setting.full.order(),
            if arguments.quick { " Quick mode: a coarse mesh and one contact." } else { "" }
        ),
        facts: vec![
            ("mesh".into(), format!("{chord} × {thickness} × {span} quadratic bricks")),
            ("window".into(), format!("{:.2} ms", 1e3 * INTERVAL * size.samples as f64)),
            ("rotation".into(), format!("{:.2} turns", 1800.0 * INTERVAL * size.samples as f64 / TAU)),
        ],
        statements: statements(&rows, &runs)?,
        figures: vec![figure(&runs, size)?],
        results: results(&rows, &runs),
        files: vec![("witness.md".into(), "tables for the guide".into(), tables(&rows).into_bytes())],
    })
}
