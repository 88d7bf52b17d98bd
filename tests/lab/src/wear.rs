//! One blade in a coating that closes on it: wear lobes compared with the blade vibrations per revolution.

mod spectrum;

use std::f64::consts::TAU;

use serde_json::json;
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_figure::plots::{Plot, Series, SeriesForm};
use tiprub_gallery::reduction;
use tiprub_model::{
    Rotor37Options,
    craig_bampton::dense_modes,
    rotor37::{MeshCounts, TipContact},
};
use tiprub_shell::{
    Failure, Result,
    console::Console,
    sweep::{self, processors},
};
use tiprub_study::{Picture, Sheet, Statement, Study, StudyFigure, arguments::StudyCommon, machine};

use spectrum::SpectralLine;

/// The scene of all runs, as the guide shows it.
const SCENE: &str = include_str!("wear/scene.toml");
/// Communication steps per revolution, and numbers of revolutions: of a run, until the casing stops, of a window,
/// before the first window.
const SAMPLES: u32 = 100;
const TURNS: u32 = 40;
const CLOSED: u32 = 32;
const WINDOW: u32 = 4;
const FIRST: u32 = 16;
/// Distance by which the casing closes (m).
const CLOSING: f64 = 4e-4;
/// Clearance of the blades that do not touch (m).
const AWAY: f64 = 5e-3;
/// Mean added wear of a window from which on it is evaluated (m): a twentieth of the closing.
const JUDGED: f64 = CLOSING / 20.0;
/// Multiples of the vibration frequency of the tip that are compared with the lobes.
const MULTIPLES: u32 = 3;
/// Number of lobes of the casing: wear and vibration are evaluated above it.
const CASING: u32 = 2;

/// A run: frequency of the first mode as a multiple of the speed, modes, the internal step (s), and cells around.
#[derive(Debug, Clone, Copy, PartialEq)]
struct WearCase {
    order: u32,
    modes: usize,
    step: f64,
    cells: usize,
}

const PLAIN: WearCase = WearCase { order: 6, modes: 40, step: 1.2e-6, cells: 360 };
const CASES: [WearCase; 6] = [
    PLAIN,
    WearCase { order: 5, ..PLAIN },
    WearCase { order: 4, ..PLAIN },
    WearCase { order: 4, step: 0.6e-6, ..PLAIN },
    WearCase { order: 4, modes: 80, ..PLAIN },
    WearCase { order: 4, cells: 720, ..PLAIN },
];

impl WearCase {
    fn reported(self) -> String {
        let other = [
            (self.modes > PLAIN.modes, ", twice the modes"),
            (self.step < PLAIN.step, ", half the step"),
            (self.cells > PLAIN.cells, ", cells of half the width"),
        ];
        other.iter().filter(|(so, _)| *so).map(|(_, text)| *text).collect()
    }
}

/// Results over some revolutions of a run.
#[derive(Debug, Clone)]
struct WearWindow {
    case: WearCase,
    speed: f64,
    /// Second mode without contact, per revolution.
    second: f64,
    /// Revolution at the end of the window.
    end: u32,
    /// Wear at the end of the window: mean and largest (m).
    wear: [f64; 2],
    /// Mean added wear (m).
    added: f64,
    /// Strongest vibrations of the tip, per revolution.
    swings: Vec<SpectralLine>,
    /// Largest orders of the added wear.
    lobes: Vec<SpectralLine>,
}

impl WearWindow {
    /// Returns whether the window is evaluated: while the casing closes, if there is enough new wear.
    fn judged(&self) -> bool {
        self.end <= CLOSED && self.added >= JUDGED
    }

    /// Returns the largest order of the new wear.
    fn order(&self) -> f64 {
        self.lobes.first().map_or(f64::NAN, |line| line.rate)
    }

    /// Returns the distance of that order from this multiple of the nearest vibration of the tip.
    fn apart(&self, multiple: u32) -> f64 {
        let apart = |line: &SpectralLine| (f64::from(multiple) * line.rate - self.order()).abs();
        self.swings.iter().map(apart).fold(f64::INFINITY, f64::min)
    }

    /// Returns the ratio of the nearest vibration to the second mode.
    fn swings_over_second(&self) -> f64 {
        let ratios = self.swings.iter().map(|line| line.rate / self.second);
        ratios.min_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs())).unwrap_or(f64::NAN)
    }

    fn row(&self) -> String {
        let lines = |lines: &[SpectralLine], digits: usize| {
            let each = lines.iter().map(|line| format!("{:.digits$}", line.rate));
            each.collect::<Vec<_>>().join(" and ")
        };
        let [mean, largest, added] = [self.wear[0], self.wear[1], self.added].map(|depth| 1e6 * depth);
        format!(
            "| {:.1}{} | {} | {} to {} | {added:.0} | {mean:.0}, {largest:.0} | {} | {} |\n",
            self.speed,
            self.case.reported(),
            self.case.order,
            self.end - WINDOW,
            self.end,
            lines(&self.swings, 2),
            lines(&self.lobes, 0)
        )
    }
}

fn rom(quick: bool, modes: usize, console: &Console) -> Result<Rom> {
    let options = Rotor37Options {
        mesh: match quick {
            true => MeshCounts { chord: 8, thickness: 1, span: 10 },
            false => MeshCounts { chord: 16, thickness: 2, span: 20 },
        },
        tip: TipContact::Patches(9),
        modes,
        ..Rotor37Options::default()
    };
    Ok(reduction::rotor37(&options, console)?.rom)
}

/// Returns the scene, and the second mode per revolution.
fn scene(rom: &Rom, case: WearCase) -> Result<(Scene, f64)> {
    let mut settings = tiprub_format::parse_scene(SCENE, "scene of the study")?;
    let (squares, _) = dense_modes(&rom.stiffness, &rom.mass).map_err(|error| reduction::failure("modes", error))?;
    let speed = squares[0].sqrt() / f64::from(case.order);
    let turn = TAU / speed;
    settings.structures[0].speed = speed;
    settings.surfaces[0].ramp_time = 0.5 * turn;
    let contact = &mut settings.contacts[0];
    contact.sector_gaps = std::iter::once(contact.gap).chain(vec![AWAY; rom.sectors - 1]).collect();
    if let Some(coating) = &mut contact.coating {
        coating.cells_around = case.cells;
    }
    settings.time.step = case.step;
    settings.experiment.stop = f64::from(TURNS) * turn;
    settings.experiment.communication_step = turn / f64::from(SAMPLES);
    Ok((Scene { settings, roms: vec![rom.clone()] }, squares[1].sqrt() / speed))
}

/// Returns the clearance of the first patch at all communication points, and the wear map after every revolution (m).
fn run(scene: &Scene) -> tiprub_core::Result<(Vec<f64>, Vec<Vec<f64>>)> {
    let mut simulation = Simulation::new(scene)?;
    let find = |name: &str| simulation.table().find(name).map_or((0, 0), |row| (row.reference, row.len()));
    let [(closing, _), (clearance, _), (wear, cells)] =
        ["casing_radius_change", "blade[1].clearance", "wear_depth"].map(find);
    simulation.initialise(0.0)?;
    let step = scene.settings.experiment.communication_step;
    let (mut clearances, mut maps) = (Vec::new(), vec![vec![0.0; cells]]);
    for sample in 1..=SAMPLES * TURNS {
        // An input reaches its value at the end of the step.
        let share = f64::from(sample) / f64::from(SAMPLES * CLOSED);
        simulation.set_real(closing, -CLOSING * share.min(1.0))?;
        simulation.do_step(f64::from(sample - 1) * step, step)?;
        clearances.push(simulation.real(clearance)?);
        if sample % SAMPLES == 0 {
            let cell = |cell: usize| simulation.real(wear + u32::try_from(cell).unwrap_or_default());
            maps.push((0..cells).map(cell).collect::<Result<_, _>>()?);
        }
    }
    Ok((clearances, maps))
}

fn windows(roms: &[(usize, Rom)], case: &WearCase) -> Result<Vec<WearWindow>> {
    let rom = roms.iter().find(|(modes, _)| *modes == case.modes).unwrap_or(&roms[0]);
    let (scene, second) = scene(&rom.1, *case)?;
    let (clearances, maps) = run(&scene).map_err(|error| Failure::from_core(format!("lab wear, {case:?}"), error))?;
    let ends = (FIRST + WINDOW..=TURNS).step_by(WINDOW as usize);
    let window = |end: u32| {
        let [first, last] = [end - WINDOW, end].map(|turn| turn as usize);
        let (before, after) = (&maps[first], &maps[last]);
        let new: Vec<f64> = after.iter().zip(before).map(|(after, before)| after - before).collect();
        let mean = |map: &[f64]| map.iter().sum::<f64>() / map.len() as f64;
        let samples = &clearances[first * SAMPLES as usize..last * SAMPLES as usize];
        WearWindow {
            case: *case,
            speed: scene.settings.structures[0].speed,
            second,
            end,
            wear: [mean(after), after.iter().copied().fold(0.0, f64::max)],
            added: mean(&new),
            swings: spectrum::swings(samples, SAMPLES, CASING),
            lobes: spectrum::lobes(&new, CASING),
        }
    };
    Ok(ends.map(window).collect())
}

fn table(windows: &[WearWindow]) -> String {
    let head = "| speed (rad/s) | first mode per revolution, without contact | revolutions | new wear (µm) | wear at \
                the end: mean, largest (µm) | strongest tip vibrations per revolution | lobes of the new wear \
                |\n|---|---|---|---|---|---|---|\n";
    std::iter::once(head.to_owned()).chain(windows.iter().map(WearWindow::row)).collect()
}

fn figure(windows: &[WearWindow]) -> Result<StudyFigure> {
    let mut sheet = Sheet::new([
        "first mode per revolution",
        "second mode per revolution",
        "modes",
        "cells",
        "step (s)",
        "revolution at the end",
        "new wear (m)",
        "mean wear (m)",
        "largest wear (m)",
        "tip vibrations 1 per revolution",
        "amplitude 1 (m)",
        "tip vibrations 2 per revolution",
        "amplitude 2 (m)",
        "lobes 1",
        "wear amplitude 1 (m)",
        "lobes 2",
        "wear amplitude 2 (m)",
    ]);
    for window in windows {
        let WearWindow { case, second, end, wear, added, swings, lobes, .. } = window;
        let line = |lines: &[SpectralLine], index: usize| {
            lines.get(index).map_or([f64::NAN; 2], |line| [line.rate, line.amplitude])
        };
        let [modes, cells] = [case.modes, case.cells].map(|count| count as f64);
        let mut row = vec![f64::from(case.order), *second, modes, cells, case.step, f64::from(*end), *added];
        row.extend(
            wear.iter().chain([line(swings, 0), line(swings, 1), line(lobes, 0), line(lobes, 1)].as_flattened()),
        );
        sheet.rows.push(row);
    }
    let points = windows
        .iter()
        .filter(|window| window.judged())
        .flat_map(|window| window.swings.iter().map(|line| (line.rate, window.order())));
    let series = vec![
        Series::line("equal numbers", vec![(0.0, 0.0), (20.0, 20.0)]).drawn(SeriesForm::Thin, 1),
        Series::line("windows of revolutions", points.collect()).drawn(SeriesForm::Dots, 0),
    ];
    Ok(StudyFigure {
        name: "lobes",
        caption: "Dominant order of the wear added in a window of revolutions against the tip vibrations per \
                  revolution in the same window, while the casing contracts."
            .into(),
        picture: Picture::plot(&Plot::new("vibrations per revolution", "lobes of the new wear", series))?,
        sheet,
    })
}

fn statements(windows: &[WearWindow]) -> Vec<Statement> {
    let judged: Vec<&WearWindow> = windows.iter().filter(|window| window.judged()).collect();
    let nearest = |window: &WearWindow| (1..=MULTIPLES).map(|of| window.apart(of)).fold(f64::INFINITY, f64::min);
    let farthest = judged.iter().map(|window| nearest(window)).fold(0.0, f64::max);
    let once = judged.iter().filter(|window| window.apart(1) < 1.0).count();
    let lowest = |window: &WearWindow| window.swings.iter().map(|line| line.rate).fold(f64::INFINITY, f64::min);
    let ratios = judged.iter().map(|window| lowest(window) / f64::from(window.case.order));
    let stiffened = ratios.fold(f64::INFINITY, f64::min);
    let last = windows.iter().filter(|window| window.end == TURNS);
    vec![
        Statement::tested(
            "While the casing contracts, the number of lobes of new wear is an integer adjacent to the number of tip vibrations per \
             revolution, or to two or three times that number",
            !judged.is_empty() && farthest < 1.0,
            format!(
                "differences of at most {farthest:.2} in {} windows that add at least {:.0} µm; {once} of them are adjacent \
                 to the number of tip vibrations itself",
                judged.len(),
                1e6 * JUDGED
            ),
        ),
        Statement::tested(
            "The tip vibrations per revolution exceed those of the first mode without contact",
            !judged.is_empty() && stiffened > 1.1,
            format!("at least {stiffened:.2} times the first mode"),
        ),
        Statement::remark(
            "Final tip vibration nearest in frequency to the second mode without contact",
            last.map(|window| format!("{:.3} times the second mode", window.swings_over_second()))
                .collect::<Vec<_>>()
                .join(", "),
        ),
    ]
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, or a run that is rejected.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let roms = [PLAIN.modes, 2 * PLAIN.modes].into_iter().take(if arguments.quick { 1 } else { 2 });
    let roms: Vec<(usize, Rom)> =
        roms.map(|modes| Ok((modes, rom(arguments.quick, modes, console)?))).collect::<Result<_>>()?;
    let cases = if arguments.quick { &CASES[2..3] } else { &CASES[..] };
    let task = console.task("Coating runs", Some(cases.len() as u64));
    let found = sweep::sweep(cases, processors(), |case| windows(&roms, case), |done| task.at(done as u64))?;
    drop(task);
    let windows: Vec<WearWindow> = found.into_iter().flatten().collect();
    Ok(Study {
        name: "wear",
        title: "Wear of the coating".into(),
        summary: format!(
            "One blade of rotor 37 in a coated casing whose radius decreases by {CLOSING:e} m over {CLOSED} of {TURNS} \
             revolutions: wear lobes compared with tip vibrations.{}",
            if arguments.quick { " Quick mode: one speed, a coarse mesh." } else { "" }
        ),
        facts: machine::facts(),
        statements: statements(&windows),
        figures: vec![figure(&windows)?],
        results: json!(windows.iter().map(|window| json!({
            "order": window.case.order, "modes": window.case.modes, "cells": window.case.cells, "step": window.case.step,
            "end": window.end, "added": window.added, "wear": window.wear, "apart": window.apart(1), "second": window.second,
            "swings": window.swings.iter().map(|line| line.rate).collect::<Vec<_>>(),
            "lobes": window.lobes.iter().map(|line| line.rate).collect::<Vec<_>>(),
        })).collect::<Vec<_>>()),
        files: vec![("wear.md".into(), "table for the guide".into(), table(&windows).into_bytes())],
    })
}
