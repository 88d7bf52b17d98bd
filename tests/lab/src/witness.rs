//! Reduced blades against the full finite-element model, which nothing was reduced of, stepped and touched by other code than the
//! product's.

use std::f64::consts::{FRAC_PI_2, TAU};

use serde_json::{Value, json};
use tiprub_core::{
    Scene,
    settings::{Scheme, Shape, Solver},
};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::{
    reduction::{self, failure},
    scene_source,
};
use tiprub_model::{
    Rotor37Options,
    reduce::ReductionKind,
    rotor37::{BladeMesh, MeshCounts, Tip, blade_mesh},
};
use tiprub_reference::{
    blade::{Blade, Part, Steps},
    reduced::rub::Obstacle,
};
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{
    Figure, Picture, Sheet, Statement, Study,
    arguments::StudyCommon,
    convergence::march::{Marched, march},
};

/// Time between samples (s).
const INTERVAL: f64 = 4e-6;
/// From the middle of the tip at the start to that of the first bump (rad).
const AHEAD: f64 = 0.5;
/// Points of a face of the tip along either direction, where contact is at points.
const EACH: usize = 2;

/// How big it is.
struct Size {
    mesh: MeshCounts,
    /// Samples: two touches, or one.
    samples: usize,
    /// Steps of the witness in a sample, ascending.
    divisions: [u32; 3],
    /// Patches of the default and of the refined model.
    patches: [usize; 2],
    /// Modes of the default model, then of refined ones.
    modes: [usize; 3],
}

const FULL: Size = Size {
    mesh: MeshCounts { chord: 12, thickness: 2, span: 20 },
    samples: 575,
    divisions: [4, 8, 16],
    patches: [9, 17],
    modes: [80, 200, 500],
};
const QUICK: Size = Size {
    mesh: MeshCounts { chord: 4, thickness: 1, span: 6 },
    samples: 125,
    divisions: [2, 4, 8],
    patches: [5, 9],
    modes: [20, 50, 100],
};

/// What of the tip touches.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Touching {
    Nodes(usize),
    Patches(usize),
    /// Means across the thickness at Gauss's points along the chord.
    Lines,
    /// Gauss's points of its faces.
    Points,
}

impl Touching {
    fn name(self) -> String {
        match self {
            Self::Nodes(count) => format!("{count} nodes"),
            Self::Patches(count) => format!("{count} patches"),
            Self::Lines => format!("{EACH} lines across per element"),
            Self::Points => format!("{EACH} × {EACH} points of every face"),
        }
    }
}

/// A reduced model and how the product steps it.
struct Reduced {
    name: &'static str,
    touching: Touching,
    modes: usize,
    method: (Scheme, Solver),
    /// Steps in a sample.
    division: u32,
}

/// Default method and step; short steps, that the model alone is judged; and the paper's.
const DEFAULT: ((Scheme, Solver), u32) = ((Scheme::ModalExact, Solver::Lcp), 8);
const FINE: ((Scheme, Solver), u32) = ((Scheme::ModalExact, Solver::Lcp), 64);
const PAPER: ((Scheme, Solver), u32) = ((Scheme::CentralDifference, Solver::Film), 4);

impl Size {
    fn of(quick: bool) -> &'static Self {
        if quick { &QUICK } else { &FULL }
    }

    fn reduced(&self) -> Vec<Reduced> {
        let ([few, many], [own, more, most]) = (self.patches.map(Touching::Patches), self.modes);
        let one = |name, touching, modes, (method, division)| Reduced { name, touching, modes, method, division };
        vec![
            one("the paper's", Touching::Nodes(3), 20, PAPER),
            one("default", few, own, DEFAULT),
            one("short steps", few, own, FINE),
            one("more modes", few, more, FINE),
            one("most modes", few, most, FINE),
            one("more patches", many, own, FINE),
            one("more patches and modes", many, most, FINE),
        ]
    }

    /// Runs of the witness: what touches, steps in a sample. The last of patches is that of the shortest steps.
    fn witnesses(&self) -> Vec<(Touching, u32)> {
        let ([few, many], finest) = (self.patches.map(Touching::Patches), self.divisions[2]);
        let refined = self.divisions.iter().map(|division| (few, *division));
        let points = self.divisions[1..].iter().map(|division| (Touching::Points, *division));
        refined.chain(points).chain([(many, finest), (Touching::Lines, finest), (Touching::Nodes(3), finest)]).collect()
    }
}

/// The scene: that of rotor 37, one blade without damping that meets the first bump soon.
struct Setting {
    size: &'static Size,
    options: Rotor37Options,
    blade: BladeMesh,
    full: Blade,
    /// Angle of the middle of the tip (rad).
    middle: f64,
}

impl Setting {
    fn new(quick: bool) -> Result<Self> {
        let size = Size::of(quick);
        let told = |error| failure("the full blade", error);
        let options = Rotor37Options { mesh: size.mesh, ..Rotor37Options::default() };
        let blade = blade_mesh(size.mesh).map_err(told)?;
        let clamped = blade.mesh.set("hub").map_err(told)?;
        let full = Blade::new(&blade.mesh, &options.material, clamped).map_err(told)?;
        let mut setting = Self { size, options, full, middle: 0.0, blade };
        setting.middle = setting.parts(Touching::Patches(3))?[1].angle();
        Ok(setting)
    }

    /// Phase of the bumps (rad): one is ahead of the tip.
    fn phase(&self) -> f64 {
        self.middle + AHEAD - FRAC_PI_2
    }

    fn parts(&self, touching: Touching) -> Result<Vec<Part>> {
        let told = |error| failure("the tip of the full blade", error);
        let points = || Ok(Part::points(&self.blade.mesh, self.blade.mesh.set("tip").map_err(told)?, EACH));
        let contact = match touching {
            Touching::Points => return points(),
            Touching::Lines => return Ok(self.across(&points()?)),
            Touching::Nodes(count) => self.blade.contact_points(count),
            Touching::Patches(count) => self.blade.contact_patches(count),
        };
        let nodes = &self.blade.mesh.nodes;
        Ok(contact
            .map_err(told)?
            .iter()
            .map(|point| Part::mean(nodes, point.weights(), point.meridional_slope))
            .collect())
    }

    /// Points of the tip's faces as means across the thickness.
    fn across(&self, points: &[Part]) -> Vec<Part> {
        // Elements follow each other along the chord, then across; in a face the second parameter runs across.
        let MeshCounts { chord, thickness, .. } = self.size.mesh;
        let line = |place: usize| {
            let one = |(other, across): (usize, usize)| points[(other * chord * EACH + place) * EACH + across].clone();
            let all = (0..thickness).flat_map(|other| (0..EACH).map(move |across| (other, across)));
            Part::together(&all.map(one).collect::<Vec<_>>())
        };
        (0..chord * EACH).map(line).collect()
    }

    /// The scene around a reduced model.
    fn scene(&self, reduced: &Reduced, console: &Console) -> Result<Scene> {
        let (tip, kind) = match reduced.touching {
            Touching::Nodes(count) => (Tip::Nodes(count), ReductionKind::FixedInterface),
            Touching::Patches(count) => (Tip::Patches(count), ReductionKind::FreeInterface),
            Touching::Lines | Touching::Points => return Err(Failure::new("study witness", "no model is reduced to lines or points", "")),
        };
        let options = Rotor37Options { tip, kind, modes: reduced.modes, ..self.options.clone() };
        let mut rom = reduction::rotor37(&options, console)?.rom;
        rom.sectors = 1;
        let mut settings = scene_source::settings("builtin:rotor37")?;
        let surface = &mut settings.surfaces[0];
        surface.ramp_time = 0.0;
        if let Shape::TwoLobe { phase, .. } = &mut surface.shape {
            *phase = self.phase();
        }
        settings.structures[0].damping_ratio = Some(0.0);
        settings.experiment.communication_step = INTERVAL;
        settings.time.step = INTERVAL / f64::from(reduced.division);
        (settings.time.scheme, settings.contacts[0].solver) = reduced.method;
        Ok(Scene { settings, roms: vec![rom] })
    }

    fn run_reduced(&self, reduced: &Reduced, console: &Console) -> Result<Marched> {
        let scene = self.scene(reduced, console)?;
        march(&scene, &[], reduced.division, self.size.samples).map_err(|why| Failure::new(reduced.name, why, ""))
    }

    /// The full model; energy that its steps lose or make beside what contact supplies.
    fn run_witness(&self, touching: Touching, division: u32) -> Result<(Marched, f64)> {
        let told = |error| failure("the full blade", error);
        let settings = scene_source::settings("builtin:rotor37")?;
        let Shape::TwoLobe { depth, width, .. } = settings.surfaces[0].shape else {
            return Err(Failure::new("study witness", "the scene has no bumps", ""));
        };
        let contact = &settings.contacts[0];
        let obstacle = Obstacle {
            clearance: contact.gap,
            speed: settings.structures[0].speed,
            friction: contact.friction,
            bumps: [2.0 * contact.gap * depth, width, 0.0],
        };
        let parts: Vec<Part> = self.parts(touching)?.into_iter().map(|part| part.turned(-self.phase())).collect();
        let watched = self.blade.contact_points(3).map_err(told)?;
        let nodes: Vec<usize> = watched.iter().map(|point| point.node).collect();
        let steps = Steps { interval: INTERVAL, division, samples: self.size.samples };
        let found = self.full.march(&parts, &obstacle, steps, &nodes).map_err(told)?;
        let place = |node: &usize| {
            let [x, y, z] = self.blade.mesh.nodes[*node];
            [x.hypot(y), y.atan2(x), z]
        };
        let marched = Marched {
            nodes: nodes.iter().map(place).collect(),
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
struct Runs {
    witnesses: Vec<((Touching, u32), Marched)>,
    reduced: Vec<(Reduced, Marched)>,
    /// Largest residual of energy of a witness.
    residual: f64,
}

impl Runs {
    /// The witness with this contact and the shortest steps.
    fn witness(&self, touching: Touching) -> Result<&Marched> {
        let missing = || Failure::new("study witness", format!("no witness with {}", touching.name()), "");
        self.witnesses.iter().rev().find(|((other, _), _)| *other == touching).map(|(_, run)| run).ok_or_else(missing)
    }

    fn row(&self, name: String, run: &Marched, touching: Touching) -> Result<Row> {
        Ok(Row {
            name,
            own: run.changes(self.witness(touching)?),
            points: run.changes(self.witness(Touching::Points)?),
        })
    }

    fn rows(&self) -> Result<Vec<Row>> {
        let witnesses = self.witnesses.iter().map(|((touching, division), run)| {
            let step = 1e6 * INTERVAL / f64::from(*division);
            self.row(format!("full model, {}, {step} µs", touching.name()), run, *touching)
        });
        let reduced = self.reduced.iter().map(|(model, run)| {
            let step = 1e6 * INTERVAL / f64::from(model.division);
            let Reduced { name, touching, modes, .. } = model;
            self.row(format!("{name}: {}, {modes} modes, {step} µs", touching.name()), run, *touching)
        });
        witnesses.chain(reduced).collect()
    }
}

/// One run against the full model with the same contact and with contact at points: displacements, impulse, friction work, peak force,
/// strain energy.
struct Row {
    name: String,
    own: [Option<f64>; 5],
    points: [Option<f64>; 5],
}

impl Row {
    fn displacement(&self) -> f64 {
        self.own[0].unwrap_or(f64::NAN)
    }
}

fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "| run | displacements | impulse | friction work | peak force | displacements, points | impulse | friction work |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    let shown = |value: &Option<f64>| match value {
        Some(0.0) | None => "–".to_owned(),
        Some(value) => format!("{:.2} %", 100.0 * value),
    };
    for row in rows {
        let cells: Vec<String> = row.own[..4].iter().chain(&row.points[..3]).map(shown).collect();
        text.push_str(&format!("| {} | {} |\n", row.name, cells.join(" | ")));
    }
    text
}

fn figure(runs: &Runs, size: &Size) -> Result<Figure> {
    let witness = runs.witness(Touching::Patches(size.patches[0]))?;
    let points = runs.witness(Touching::Points)?;
    let named = |name: &str| runs.reduced.iter().find(|(model, _)| model.name == name).map(|(_, run)| run);
    let shown = [
        ("full model, patches", Some(witness)),
        ("full model, points", Some(points)),
        ("default", named("default")),
        ("the paper's", named("the paper's")),
    ];
    let time = |sample: usize| 1e3 * (sample + 1) as f64 * INTERVAL;
    // Radial displacement of the trailing edge, the third node.
    let line = |run: &Marched| {
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
    Ok(Figure {
        name: "trailing-edge",
        caption: "The blade passes the bumps: full finite elements, the default reduction, and the paper's.".into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

fn statements(rows: &[Row], runs: &Runs) -> Result<Vec<Statement>> {
    let find = |start: &str| {
        let missing = || Failure::new("study witness", format!("no run `{start}`"), "");
        rows.iter().find(|row| row.name.starts_with(start)).ok_or_else(missing)
    };
    let (coarse, fine) = (&rows[0], &rows[1]);
    let [short, more, most] = ["short steps:", "more modes:", "most modes:"].map(find);
    let [short, more, most] = [short?.displacement(), more?.displacement(), most?.displacement()];
    let (default, paper) = (find("default:")?, find("the paper's:")?);
    let (refined, all) = (find("more patches and modes:")?, &default.points);
    let of = |row: &Row| row.points[0].unwrap_or(f64::NAN);
    Ok(vec![
        Statement::tested(
            "The witness balances its energy to rounding that grows through the steps, 1e-6",
            runs.residual < 1e-6,
            format!("{:.0e} of the largest energy", runs.residual),
        ),
        Statement::tested(
            "Shorter steps bring the witness nearer to its own limit",
            fine.displacement() < 0.75 * coarse.displacement(),
            format!(
                "displacements change by {} from four times its step, by {} from twice",
                percent(coarse.displacement()),
                percent(fine.displacement())
            ),
        ),
        Statement::tested(
            "More modes bring the reduced model to the full one with the same patches, as near as the witness knows itself",
            most < short && most < 1.5 * fine.displacement(),
            format!("displacements {} , {} and {} away", percent(short), percent(more), percent(most)),
        ),
        Statement::tested(
            "Patches and modes together bring it to the full one with contact at points of the faces",
            of(refined) <= of(default),
            format!("displacements {} away, {} before", percent(of(refined)), percent(of(default))),
        ),
        Statement::tested(
            "The default model is nearer to the full one with contact at points than the paper's, by a factor of five",
            5.0 * of(default) < of(paper),
            format!(
                "displacements {}, impulse {}, friction work {}; the paper's displacements {}",
                percent(of(default)),
                percent(all[1].unwrap_or(f64::NAN)),
                percent(all[2].unwrap_or(f64::NAN)),
                percent(of(paper))
            ),
        ),
    ])
}

fn results(rows: &[Row]) -> Value {
    let names = ["displacements", "impulse", "friction_work", "peak_force", "strain_energy"];
    let of = |values: &[Option<f64>; 5]| -> serde_json::Map<String, Value> {
        names.iter().zip(values).map(|(name, value)| ((*name).to_owned(), json!(value))).collect()
    };
    Value::Array(
        rows.iter()
            .map(|row| json!({ "run": row.name, "same_contact": of(&row.own), "points": of(&row.points) }))
            .collect(),
    )
}

/// The study.
///
/// # Errors
/// A model that cannot be reduced, a run that fails, a plot that cannot be drawn.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let setting = Setting::new(arguments.quick)?;
    let size = setting.size;
    let quiet = Console::new(true, false);
    let task = console.task("The full blade rubs", Some(size.witnesses().len() as u64));
    // The longest first.
    let mut asked = size.witnesses();
    asked.sort_by_key(|(_, division)| std::cmp::Reverse(*division));
    let run = |(touching, division): &(Touching, u32)| setting.run_witness(*touching, *division);
    let found = sweep::sweep(&asked, sweep::processors(), run, |done| task.at(done as u64))?;
    let residual = found.iter().map(|(_, residual)| *residual).fold(0.0, f64::max);
    let mut witnesses: Vec<_> = asked.into_iter().zip(found).map(|(what, (run, _))| (what, run)).collect();
    let order = size.witnesses();
    witnesses.sort_by_key(|(what, _)| order.iter().position(|other| other == what));
    let marched = |reduced: Reduced| setting.run_reduced(&reduced, &quiet).map(|run| (reduced, run));
    let reduced = size.reduced().into_iter().map(marched).collect::<Result<_>>()?;
    let runs = Runs { witnesses, reduced, residual };
    let rows = runs.rows()?;
    let MeshCounts { chord, thickness, span } = size.mesh;
    Ok(Study {
        name: "witness",
        title: "Reduced blades against full finite elements".into(),
        summary: format!(
            "One blade of rotor 37, without damping, passes bumps of its casing. The witness is the whole finite-element model, {} \
             degrees of freedom, without any reduction, stepped implicitly with contact of its own.{}",
            setting.full.order(),
            if arguments.quick { " Quick form: a coarse mesh and one touch." } else { "" }
        ),
        facts: vec![
            ("mesh".into(), format!("{chord} × {thickness} × {span} quadratic bricks")),
            ("window".into(), format!("{:.2} ms", 1e3 * INTERVAL * size.samples as f64)),
            ("turned by".into(), format!("{:.2} turns", 1800.0 * INTERVAL * size.samples as f64 / TAU)),
        ],
        statements: statements(&rows, &runs)?,
        figures: vec![figure(&runs, size)?],
        results: results(&rows),
        files: vec![("witness.md".into(), "the table of the guide".into(), table(&rows).into_bytes())],
    })
}
