//! Recovered stress of reduced blades in a rub, against that of the full finite-element model, by the number of modes.

use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};
use tiprub_core::scene::rom::{STRESSES, von_mises};
use tiprub_core::{CoSimulation, Rom, Simulation};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::reduction::failure;
use tiprub_model::{craig_bampton::dense_modes, stress::StressPlaces};
use tiprub_reference::blade::{BladeHistory, Gauge, equivalent};
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{
    Picture, Sheet, Statement, Study, StudyFigure, arguments::StudyCommon, error::measure::parts_apart,
};

use super::{FINE, GALERKIN, INTERVAL, Touching, WitnessModel, WitnessScene, percent};

/// Number of modes whose points of largest stress are evaluated.
const PLACES: usize = 6;

/// Results of a run, sample by sample.
struct StressHistory {
    /// Displacements of the watched points (m).
    displacements: Vec<Vec<f64>>,
    /// Six stress components at every point (Pa).
    stresses: Vec<Vec<f64>>,
    /// Von Mises stress at every point (Pa).
    equivalents: Vec<Vec<f64>>,
}

impl StressHistory {
    /// Converts the history of the full model.
    fn full(history: BladeHistory) -> (Self, Vec<Vec<f64>>) {
        let each = |sample: &Vec<f64>| places(sample).map(equivalent).collect();
        let equivalents = history.stresses.iter().map(each).collect();
        (Self { displacements: history.displacements, stresses: history.stresses, equivalents }, history.forces)
    }

    /// Returns the relative difference of the stress at one point from that of another run (L2).
    fn apart_at(&self, other: &Self, place: usize) -> f64 {
        let at = |all: &Vec<f64>| all[STRESSES * place..STRESSES * (place + 1)].to_vec();
        let of = |reported: &Self| reported.stresses.iter().map(at).collect::<Vec<_>>();
        parts_apart(&of(self), &of(other), &[STRESSES])
    }

    /// Returns the largest von Mises stress at every point (Pa).
    fn largest(&self) -> Vec<f64> {
        let count = self.equivalents.first().map_or(0, Vec::len);
        let of = |place: usize| self.equivalents.iter().fold(0.0, |most: f64, sample| most.max(sample[place]));
        (0..count).map(of).collect()
    }

    /// Returns the distance from another history.
    fn apart(&self, other: &Self) -> Apart {
        let of = |a: &[Vec<f64>], b: &[Vec<f64>]| parts_apart(a, b, &[b.first().map_or(0, Vec::len)]);
        let (own, others) = (self.largest(), other.largest());
        let most = (0..others.len()).max_by(|a, b| others[*a].total_cmp(&others[*b])).unwrap_or_default();
        let largest = |place: usize| (own[place] / others[place] - 1.0).abs();
        Apart {
            displacements: of(&self.displacements, &other.displacements),
            stresses: of(&self.stresses, &other.stresses),
            most: largest(most),
            worst: (0..others.len()).map(largest).fold(0.0, f64::max),
        }
    }
}

/// Returns the six components at every point.
fn places(sample: &[f64]) -> impl Iterator<Item = [f64; STRESSES]> {
    sample.chunks_exact(STRESSES).map(|all| std::array::from_fn(|component| all[component]))
}

/// Relative distances: of histories (L2), of the largest von Mises stress at the point with the largest value, and at
/// the point with the largest error.
#[derive(Debug, Clone, Copy)]
struct Apart {
    displacements: f64,
    stresses: f64,
    most: f64,
    worst: f64,
}

impl Apart {
    fn cells(self) -> String {
        [self.displacements, self.stresses, self.most, self.worst].map(percent).join(" | ")
    }

    fn json(self) -> Value {
        let Self { displacements, stresses, most, worst } = self;
        json!({ "displacements": displacements, "stress": stresses, "largest": most, "worst_place": worst })
    }
}

/// Returns the numbers of modes, ascending.
fn counts(quick: bool) -> &'static [usize] {
    if quick { &[4, 20, 120] } else { &[5, 10, 20, 40, 80, 160, 400] }
}

/// Returns the numbers of steps of the full model per sample, ascending.
fn divisions(quick: bool) -> &'static [u32] {
    if quick { &[4, 8, 16] } else { &[8, 16, 32] }
}

impl WitnessScene {
    fn stressed_rom(&self, reduced: &WitnessModel) -> Result<Rom> {
        self.rom_with(reduced, StressPlaces { modes: PLACES, ..StressPlaces::default() })
    }

    /// Returns the names of the points, and the full model's gauges there.
    fn gauges(&self, rom: &Rom) -> Result<(Vec<String>, Vec<Gauge>)> {
        let missing = || Failure::new("lab stress", "the reduced model has no stress points", "");
        let mesh = &self.blade.mesh;
        let mut gauges = Vec::new();
        let points = &rom.extras.stress.as_ref().ok_or_else(missing)?.points;
        for point in points {
            let [radius, angle, axial] = point.position;
            let place = [radius * angle.cos(), radius * angle.sin(), axial];
            let off = |node: &[f64; 3]| (0..3).map(|i| (node[i] - place[i]).powi(2)).sum::<f64>();
            let all = mesh.nodes.iter().enumerate();
            let node = all.min_by(|a, b| off(a.1).total_cmp(&off(b.1))).map_or(0, |(node, _)| node);
            gauges.push(
                Gauge::at(mesh, &self.material, node).map_err(|error| failure("stress gauge of the blade", error))?,
            );
        }
        Ok((points.iter().map(|point| point.name.clone()).collect(), gauges))
    }

    /// Returns the heights of the points of a ROM between hub (0) and tip (1), at the mean radii of either.
    fn heights(&self, rom: &Rom) -> Vec<f64> {
        let mesh = &self.blade.mesh;
        let mean = |set: &str| {
            let nodes = mesh.sets.get(set).map_or(&[][..], Vec::as_slice);
            nodes.iter().map(|node| mesh.nodes[*node][0].hypot(mesh.nodes[*node][1])).sum::<f64>() / nodes.len() as f64
        };
        let (hub, tip) = (mean("hub"), mean("tip"));
        let points = rom.extras.stress.iter().flat_map(|stress| &stress.points);
        points.map(|point| (point.position[0] - hub) / (tip - hub)).collect()
    }

    /// Runs the product as an importer does, or returns the reason why it is rejected.
    fn told_by(&self, reduced: &WitnessModel, rom: Rom) -> Result<std::result::Result<StressHistory, String>> {
        let mut scene = self.scene_of(reduced, rom)?;
        scene.settings.outputs.watched_sectors = vec![1];
        scene.settings.outputs.stress = true;
        Ok(run(&scene, self.size.samples).map_err(|error| error.to_string()))
    }

    /// Compares the stress of equal forces at rest, ROM against full model; returns the difference relative to the
    /// largest stress.
    fn at_rest(&self, rom: &Rom, gauges: &[Gauge], touching: Touching) -> Result<f64> {
        let reported = |error| failure("blade at rest", error);
        let solve = || rom.stiffness.clone().cholesky();
        let held = solve().ok_or_else(|| Failure::new("lab stress", "the reduced model is not constrained", ""))?;
        let stress = rom.extras.stress.as_ref().map(|stress| stress.map.clone()).unwrap_or_default();
        let (mut off, mut largest) = (0.0_f64, 0.0_f64);
        for (index, point) in self.contact(touching)?.iter().enumerate() {
            // Inwards and backwards along the circumference, as in a rub.
            let push = [-1000.0, -150.0, 0.0];
            let mut force = DVector::zeros(rom.contact_map.nrows());
            force.rows_mut(3 * index, 3).copy_from_slice(&push);
            let found = &stress * held.solve(&(rom.contact_map.transpose() * force));
            let loads: Vec<_> = point
                .weights()
                .map(|(node, weight)| {
                    let [x, y, _] = self.blade.mesh.nodes[node];
                    let (sine, cosine) = y.atan2(x).sin_cos();
                    let [radial, tangential, axial] = push;
                    let force = [radial * cosine - tangential * sine, radial * sine + tangential * cosine, axial];
                    (node, force.map(|one| weight * one))
                })
                .collect();
            for (found, full) in found.iter().zip(self.full.at_rest(&loads, gauges).map_err(reported)?) {
                off = off.max((found - full).abs());
                largest = largest.max(full.abs());
            }
        }
        Ok(off / largest)
    }
}

/// Returns displacements and stress at the communication points.
fn run(scene: &tiprub_core::Scene, samples: usize) -> tiprub_core::Result<StressHistory> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    let names = ["radial", "tangential", "axial", "radial_tangential", "tangential_axial", "axial_radial", "von_mises"];
    let rows = names.map(|name| simulation.table().find(&format!("blade[1].{name}_stress")));
    let count = rows[0].map_or(0, tiprub_cosim::variables::Variable::len);
    let rows = rows.map(|row| row.map_or(0, |row| row.reference));
    let mut reported = StressHistory { displacements: Vec::new(), stresses: Vec::new(), equivalents: Vec::new() };
    for sample in 0..samples {
        simulation.do_step(sample as f64 * INTERVAL, INTERVAL)?;
        let read = |row: u32, place: usize| simulation.real(row + u32::try_from(place).unwrap_or_default());
        let mut stresses = Vec::with_capacity(STRESSES * count);
        for place in 0..count {
            for row in &rows[..STRESSES] {
                stresses.push(read(*row, place)?);
            }
        }
        let equivalents = (0..count).map(|place| read(rows[STRESSES], place)).collect::<Result<_, _>>()?;
        reported.displacements.push(simulation.watched_displacements());
        reported.stresses.push(stresses);
        reported.equivalents.push(equivalents);
    }
    Ok(reported)
}

/// Runs the reduced model under the forces of every step of the full model, with the steps of the latter, which
/// isolates the effect of the missing modes.
fn pushed(rom: &Rom, forces: &[Vec<f64>], division: u32) -> Result<StressHistory> {
    let (squares, shapes) = dense_modes(&rom.stiffness, &rom.mass).map_err(|error| failure("modes", error))?;
    let loads = (&rom.contact_map * &shapes).transpose();
    let seen = |map: Option<&DMatrix<f64>>| map.map_or_else(|| DMatrix::zeros(0, shapes.ncols()), |map| map * &shapes);
    let watched = seen(rom.extras.watched.as_ref().map(|watched| &watched.map));
    let stressed = seen(rom.extras.stress.as_ref().map(|stress| &stress.map));
    let h = INTERVAL / f64::from(division);
    let (mut u, mut v) = (DVector::zeros(squares.len()), DVector::<f64>::zeros(squares.len()));
    let mut reported = StressHistory { displacements: Vec::new(), stresses: Vec::new(), equivalents: Vec::new() };
    for (step, force) in forces.iter().enumerate() {
        let push = &loads * DVector::from_column_slice(force);
        for (mode, square) in squares.iter().enumerate() {
            let quarter = 0.25 * h * h * square;
            let next = ((1.0 - quarter) * v[mode] + h * (push[mode] - square * u[mode])) / (1.0 + quarter);
            u[mode] += 0.5 * h * (v[mode] + next);
            v[mode] = next;
        }
        if (step + 1) % division as usize == 0 {
            let stresses = (&stressed * &u).as_slice().to_vec();
            reported.displacements.push((&watched * &u).as_slice().to_vec());
            reported.equivalents.push(places(&stresses).map(von_mises).collect());
            reported.stresses.push(stresses);
        }
    }
    Ok(reported)
}

/// All results of the study.
struct StressResult {
    names: Vec<String>,
    /// Heights of the points as fractions of the distance from hub to tip.
    heights: Vec<f64>,
    /// Runs of the full model by steps per sample, ascending, and the mean forces of the one with the shortest steps.
    full: Vec<(u32, StressHistory)>,
    /// Runs by the number of modes: under the full model's forces, and in an independent rub or the reason why that is
    /// rejected.
    reduced: Vec<(usize, StressHistory, std::result::Result<StressHistory, String>)>,
    /// Default model with adaptive steps: its number of modes, and its rub.
    ships: (usize, StressHistory),
    /// Difference of stress at rest with the smallest number of modes.
    rest: f64,
}

impl StressResult {
    /// Returns the full model with its shortest steps.
    fn witness(&self) -> &StressHistory {
        &self.full[self.full.len() - 1].1
    }

    /// Returns the rows: name, distance under the same forces and in the same rub.
    fn rows(&self) -> Vec<(String, Option<Apart>, Option<Apart>)> {
        let witness = self.witness();
        let own = self.full[..self.full.len() - 1].iter().map(|(division, reported)| {
            (
                format!("full model, steps of {} µs", 1e6 * INTERVAL / f64::from(*division)),
                None,
                Some(reported.apart(witness)),
            )
        });
        let reduced = self.reduced.iter().map(|(modes, forced, rubbed)| {
            let rubbed = rubbed.as_ref().ok().map(|reported| reported.apart(witness));
            (format!("{modes} modes"), Some(forced.apart(witness)), rubbed)
        });
        let (modes, reported) = &self.ships;
        let ships = (format!("{modes} modes, default tolerance"), None, Some(reported.apart(witness)));
        own.chain(reduced).chain([ships]).collect()
    }
}

fn find(setting: &WitnessScene, quick: bool, console: &Console) -> Result<StressResult> {
    let size = setting.size;
    let touching = Touching::Patches(size.patches[0], 2);
    let model = |modes: usize, (method, division)| WitnessModel { name: "", touching, modes, method, division };
    let roms: Vec<Rom> =
        counts(quick).iter().map(|modes| setting.stressed_rom(&model(*modes, FINE))).collect::<Result<_>>()?;
    let (names, gauges) = setting.gauges(&roms[0])?;
    let heights = setting.heights(&roms[0]);
    let rest = setting.at_rest(&roms[0], &gauges, touching)?;
    let divisions = divisions(quick);
    let task = console.task("Full model of the blade", Some(divisions.len() as u64));
    let march = |division: &u32| setting.run_full(touching, *division, &gauges).map(StressHistory::full);
    let mut full = sweep::sweep(divisions, sweep::processors(), march, |done| task.at(done as u64))?;
    let forces = full.last_mut().map(|(_, forces)| std::mem::take(forces)).unwrap_or_default();
    let full = divisions.iter().copied().zip(full.into_iter().map(|(reported, _)| reported)).collect();
    let finest = divisions[divisions.len() - 1];
    let task = console.task("Reduced models of the blade", Some(roms.len() as u64));
    let all: Vec<(usize, Rom)> = counts(quick).iter().copied().zip(roms).collect();
    let rub = |(modes, rom): &(usize, Rom)| {
        let forced = pushed(rom, &forces, finest)?;
        Ok((*modes, forced, setting.told_by(&model(*modes, FINE), rom.clone())?))
    };
    let reduced = sweep::sweep(&all, sweep::processors(), rub, |done| task.at(done as u64))?;
    let by_tolerance = model(size.modes[0], GALERKIN);
    let ships = setting.told_by(&by_tolerance, setting.stressed_rom(&by_tolerance)?)?;
    let ships = ships.map_err(|why| Failure::new("lab stress", why, ""))?;
    Ok(StressResult { names, heights, full, reduced, ships: (by_tolerance.modes, ships), rest })
}

fn tables(found: &StressResult) -> String {
    let rows = found.rows();
    let head = "displacements | stress | largest von Mises | at the worst place |\n|---|---|---|---|---|\n";
    let mut text = format!("| with the forces of the full model | {head}");
    for (name, forced, _) in rows.iter().filter(|row| row.1.is_some()) {
        text.push_str(&format!("| {name} | {} |\n", forced.map(Apart::cells).unwrap_or_default()));
    }
    text.push_str(&format!("\n| with its own contact forces | {head}"));
    for (name, forced, rubbed) in &rows {
        match rubbed {
            Some(apart) => text.push_str(&format!("| {name} | {} |\n", apart.cells())),
            None if forced.is_some() => text.push_str(&format!("| {name}: rejected |  |  |  |  |\n")),
            None => {}
        }
    }
    text.push_str(
        "\n| place | height | largest von Mises: full model (MPa) | default model (MPa) | stress error: default model \
         | full model, steps twice as long |\n\
         |---|---|---|---|---|---|\n",
    );
    let (full, ships) = (found.witness().largest(), found.ships.1.largest());
    let coarser = &found.full[found.full.len() - 2].1;
    for (place, name) in found.names.iter().enumerate() {
        let apart = |reported: &StressHistory| percent(reported.apart_at(found.witness(), place));
        text.push_str(&format!(
            "| `{name}` | {:.0} % | {:.1} | {:.1} | {} | {} |\n",
            100.0 * found.heights[place],
            1e-6 * full[place],
            1e-6 * ships[place],
            apart(&found.ships.1),
            apart(coarser)
        ));
    }
    text
}

fn figure(found: &StressResult) -> Result<StudyFigure> {
    let largest = found.witness().largest();
    let most = (0..largest.len()).max_by(|a, b| largest[*a].total_cmp(&largest[*b])).unwrap_or_default();
    let few = found.reduced.iter().find_map(|(modes, _, rubbed)| Some((*modes, rubbed.as_ref().ok()?)));
    let mut shown = vec![("full model".to_owned(), found.witness()), ("default model".to_owned(), &found.ships.1)];
    shown.extend(few.map(|(modes, reported)| (format!("{modes} modes"), reported)));
    let time = |sample: usize| 1e3 * (sample + 1) as f64 * INTERVAL;
    let line = |reported: &StressHistory| -> Vec<(f64, f64)> {
        reported.equivalents.iter().enumerate().map(|(sample, all)| (time(sample), 1e-6 * all[most])).collect()
    };
    let series = shown.iter().map(|(name, reported)| Series::line(name.as_str(), line(reported))).collect();
    let mut sheet = Sheet::new(["time (ms)"]);
    sheet.columns.extend(shown.iter().map(|(name, _)| format!("{name} (MPa)")));
    for sample in 0..found.ships.1.equivalents.len() {
        let values = shown.iter().map(|(_, reported)| 1e-6 * reported.equivalents[sample][most]);
        sheet.rows.push([time(sample)].into_iter().chain(values).collect());
    }
    Ok(StudyFigure {
        name: "von-mises",
        caption: format!(
            "Von Mises stress at `{}`, the location of the largest stress, while the blade passes the bumps.",
            found.names[most]
        ),
        picture: Picture::plot(&Plot::new("time (ms)", "von Mises stress (MPa)", series))?,
        sheet,
    })
}

fn statements(found: &StressResult) -> Vec<Statement> {
    let witness = found.witness();
    let apart: Vec<Apart> = found.reduced.iter().map(|(_, forced, _)| forced.apart(witness)).collect();
    let (first, last) = (apart[0], apart[apart.len() - 1]);
    let coarser = found.full[found.full.len() - 2].1.apart(witness);
    let ships = found.ships.1.apart(witness);
    let most =
        found.reduced.last().and_then(|(_, _, rubbed)| rubbed.as_ref().ok()).map(|reported| reported.apart(witness));
    vec![
        Statement::tested(
            "With the fewest modes, the static stress agrees with that of the full model to 1e-6",
            found.rest < 1e-6,
            format!("{:.0e} of the largest with {} modes", found.rest, found.reduced[0].0),
        ),
        Statement::tested(
            "Under the contact forces of the full model, the stress error decreases with the number of modes, to an \
             eighth of that with the fewest",
            last.stresses < 0.125 * first.stresses && apart.windows(2).all(|pair| pair[1].stresses < pair[0].stresses),
            apart.iter().map(|one| percent(one.stresses)).collect::<Vec<_>>().join(", "),
        ),
        Statement::tested(
            "With its own contact forces, the model with the most modes differs from the full model by at most twice \
             the change due to halving the steps of the full model",
            most.is_some_and(|most| most.stresses < 2.0 * coarser.stresses),
            format!(
                "stress error {}, change due to halving {}",
                most.map_or_else(|| "rejected".to_owned(), |most| percent(most.stresses)),
                percent(coarser.stresses)
            ),
        ),
        Statement::tested(
            "The default model gives the largest von Mises stress of the rub to within 5 %",
            ships.most < 0.05,
            format!(
                "{} at the location of the largest stress, {} at the worst location",
                percent(ships.most),
                percent(ships.worst)
            ),
        ),
    ]
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, a run of the full model or of the default model that fails, a plot that cannot be
/// drawn.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let setting = WitnessScene::new(arguments.quick)?;
    let found = find(&setting, arguments.quick, console)?;
    let rows = found.rows().into_iter().map(|(name, forced, rubbed)| {
        json!({ "run": name, "same_forces": forced.map(Apart::json), "same_rub": rubbed.map(Apart::json) })
    });
    let refused = found
        .reduced
        .iter()
        .filter_map(|(modes, _, rubbed)| Some(json!({ "modes": modes, "why": rubbed.as_ref().err()? })));
    let largest = json!({ "full": found.witness().largest(), "ships": found.ships.1.largest() });
    Ok(Study {
        name: "stress",
        title: "Stress of reduced blades compared with full finite elements".into(),
        summary: format!(
            "One blade of rotor 37, without damping, passes bumps on its casing with two rows of contact patches at \
             its tip. The reference is the full finite-element model with {} degrees of freedom and independent time \
             integration, contact and stress recovery. Stresses are compared where six modes have their largest \
             stress.{}",
            setting.full.order(),
            if arguments.quick { " Quick mode: a coarse mesh and one contact." } else { "" }
        ),
        facts: vec![("places".into(), found.names.join(", "))],
        statements: statements(&found),
        figures: vec![figure(&found)?],
        results: json!({
            "runs": rows.collect::<Vec<_>>(), "refused": refused.collect::<Vec<_>>(), "rest": found.rest,
            "largest_von_mises": largest,
        }),
        files: vec![("stress.md".into(), "tables for the guide".into(), tables(&found).into_bytes())],
    })
}
