//! Natural frequencies against nodal diameter, with the engine orders of a speed: the interference (SAFE) diagram; and
//! the first mode shapes.

use serde_json::json;
use tiprub_figure::{
    picture::{self, MeshSurface, ProjectionFrame, ViewPoint, surface_of},
    plots::{Plot, Series, SeriesForm},
};
use tiprub_model::{
    Mesh,
    cyclic::{CyclicReduction, NodalDiameter},
    vtk::NodalField,
};
use tiprub_shell::{Failure, Result};
use tiprub_study::{Picture, Sheet, Statement, Study, StudyFigure, map::prediction::folded};

/// Azimuth and elevation of the pictures of a sector (rad).
const AZIMUTH: f64 = 1.0;
const ELEVATION: f64 = 0.3;
/// Largest drawn displacement, as a fraction of the sector's height.
const DRAWN_DISPLACEMENT: f64 = 0.08;
/// Families of frequencies in the diagram.
const FAMILIES: usize = 8;
/// Nodal diameters and modes whose shapes are drawn.
const SHAPES: [(usize, usize); 8] = [(0, 0), (2, 0), (2, 1), (2, 2), (4, 0), (4, 1), (28, 0), (28, 1)];
/// Relative fall of a frequency from one nodal diameter to the next that still counts as flat.
const FLAT: f64 = 1e-3;
/// Spread of a flat family (%).
const FLAT_SPREAD: f64 = 5.0;
/// Relative distance within which an engine order is considered to excite a mode.
const NEAR: f64 = 0.05;

/// Returns the engine order that excites a mode of a nodal diameter at the nearest frequency, among those up to `most`.
fn nearest_order(number: usize, frequency: f64, turns: f64, sectors: usize) -> Option<usize> {
    let most = (1.5 * frequency / turns).ceil().max(2.0 * sectors as f64);
    let orders = (1_u32..).take_while(|order| f64::from(*order) <= most).map(|order| order as usize);
    let distance = |order: &usize| (frequency - *order as f64 * turns).abs();
    orders.filter(|order| folded(*order, sectors).0 == number).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Draws modes and engine orders.
fn diagram(diameters: &[NodalDiameter], sectors: usize, speed: f64) -> Result<StudyFigure> {
    let turns = speed / std::f64::consts::TAU;
    let kept = |diameter: &NodalDiameter| diameter.full_frequencies.iter().take(FAMILIES).copied().collect::<Vec<_>>();
    let top = diameters.iter().flat_map(kept).fold(0.0, f64::max) * 1.05;
    let drawn = diameters.iter().map(|diameter| kept(diameter).len()).max().unwrap_or(0);
    let mut series = Vec::new();
    for family in 0..drawn {
        let points = diameters
            .iter()
            .filter_map(|diameter| Some((diameter.number as f64, *diameter.full_frequencies.get(family)?)));
        let label = if family == 0 { "modes of the disk" } else { "" };
        let points: Vec<_> = points.collect();
        series.push(Series::line("", points.clone()).drawn(SeriesForm::Thin, 0));
        series.push(Series::line(label, points).drawn(SeriesForm::Dots, 0));
    }
    let orders = (0..).map_while(|order: u32| (f64::from(order) * turns <= top).then_some(order as usize));
    let points: Vec<_> = orders.map(|order| (folded(order, sectors).0 as f64, order as f64 * turns)).collect();
    series.push(Series::line("", points.clone()).drawn(SeriesForm::Thin, 1));
    let label = format!("engine orders at {speed:.0} rad/s");
    series.push(Series::line(label, points).drawn(SeriesForm::Dots, 1));
    let plot = Plot { height: 480, ..Plot::new("nodal diameter (-)", "frequency (Hz)", series) };
    let mut sheet = Sheet::new([
        "nodal diameter",
        "mode",
        "full model (Hz)",
        "reduced model (Hz)",
        "nearest engine order",
        "engine-order frequency (Hz)",
        "resonance speed (rad/s)",
    ]);
    for diameter in diameters {
        for ((full, reduced), mode) in diameter.full_frequencies.iter().zip(&diameter.reduced_frequencies).zip(1_u32..)
        {
            let order = nearest_order(diameter.number, *full, turns, sectors).unwrap_or(0) as f64;
            let meeting = if order > 0.0 { std::f64::consts::TAU * full / order } else { f64::NAN };
            sheet.rows.push(vec![
                diameter.number as f64,
                f64::from(mode),
                *full,
                *reduced,
                order,
                order * turns,
                meeting,
            ]);
        }
    }
    Ok(StudyFigure {
        name: "interference",
        caption: format!(
            "First {drawn} natural frequencies at rest against nodal diameter, and the engine orders at {speed:.1} \
             rad/s. A stationary disturbance with k waves around the circumference excites the blades at k times the \
             speed, in nodal diameter k; beyond half the number of sectors the line is folded back. A mode on the line \
             is resonant. The frequencies are those in the rotating frame, without centrifugal and gyroscopic effects."
        ),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// Draws mode shapes of one sector, at the phase of largest displacement.
fn shapes(mesh: &Mesh, diameters: &[NodalDiameter]) -> StudyFigure {
    let surface: MeshSurface = surface_of(mesh);
    let view = ViewPoint::of_blade(&surface, AZIMUTH, ELEVATION);
    let frame = ProjectionFrame::around(&surface, &view, 0.1);
    let radii = surface.points.iter().map(|point| point[0].hypot(point[1]));
    let (low, high) = radii.fold((f64::INFINITY, 0.0_f64), |(low, high), radius| (low.min(radius), high.max(radius)));
    let last = diameters.len().saturating_sub(1);
    let mut html = String::from("<div class=\"shapes\">");
    let mut sheet = Sheet::new(["nodal diameter", "mode", "frequency (Hz)"]);
    let mut single = String::new();
    for (number, mode) in SHAPES.map(|(number, mode)| (number.min(last), mode)) {
        let Some(shape) = diameters.get(number).and_then(|diameter| diameter.shapes.get(mode)) else { continue };
        let frequency = diameters[number].full_frequencies[mode];
        let real = at_largest(shape);
        let largest = real.iter().map(|vector| length(*vector)).fold(f64::MIN_POSITIVE, f64::max);
        let scale = DRAWN_DISPLACEMENT * (high - low) / largest;
        let drawn = picture::draw(&surface, Some((&real, scale)), &[], &frame, &view);
        html.push_str(&format!("<div>{drawn}<span>n = {number}, mode {}: {frequency:.1} Hz</span></div>", mode + 1));
        if single.is_empty() {
            single = drawn;
        }
        sheet.rows.push(vec![number as f64, mode as f64 + 1.0, frequency]);
    }
    html.push_str(&format!("</div><div class=\"scale\">{}</div>", picture::color_scale("0", "largest")));
    StudyFigure {
        name: "shapes",
        caption:
            "Mode shapes of one sector at the instant of its largest displacement; the next sector moves in the same way with \
             a phase shift of 2πn/N. The colour shows the magnitude of the displacement. The file contains only the first mode shape."
                .into(),
        picture: Picture { svg: single, html },
        sheet,
    }
}

/// Returns the real displacements of a complex shape at the phase in which the displacement of its largest node is
/// maximal.
fn at_largest(shape: &[[nalgebra::Complex<f64>; 3]]) -> Vec<[f64; 3]> {
    let square = |vector: &[nalgebra::Complex<f64>; 3]| vector.iter().map(nalgebra::Complex::norm_sqr).sum::<f64>();
    let largest = shape.iter().max_by(|a, b| square(a).total_cmp(&square(b)));
    // |Re(v e^(iφ))|² is largest at φ = −arg(v·v)/2.
    let turn = largest.map_or(0.0, |vector| {
        let dot: nalgebra::Complex<f64> = vector.iter().map(|component| component * component).sum();
        -0.5 * dot.im.atan2(dot.re)
    });
    let (sine, cosine) = turn.sin_cos();
    shape.iter().map(|vector| vector.map(|component| component.re * cosine - component.im * sine)).collect()
}

fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|component| component * component).sum::<f64>().sqrt()
}

/// States that disk and blade modes interact: a family of blades is flat over the nodal diameters, the disk stiffens
/// with their number.
fn flat_families(diameters: &[NodalDiameter]) -> Statement {
    let half = &diameters[diameters.len() / 2..];
    let first = |diameter: &NodalDiameter| diameter.full_frequencies.first().copied().unwrap_or(f64::NAN);
    let (low, high) = half.iter().map(first).fold((f64::INFINITY, 0.0_f64), |(low, high), f| (low.min(f), high.max(f)));
    let spread = 100.0 * (high / low - 1.0);
    Statement::tested(
        format!(
            "In the upper half of the nodal diameters, the first frequency is constant within {FLAT_SPREAD} %, as for \
             blades on a stiff disk"
        ),
        half.len() > 1 && spread < FLAT_SPREAD,
        format!(
            "first frequency from {low:.1} to {high:.1} Hz ({spread:.2} %) at nodal diameters {} to {}",
            diameters.len() / 2,
            diameters.len() - 1
        ),
    )
}

fn disk_stiffens(diameters: &[NodalDiameter]) -> Statement {
    let first: Vec<f64> = diameters.iter().filter_map(|diameter| diameter.full_frequencies.first().copied()).collect();
    // A family of blades is flat, but mesh and curvature of the diagram cause a slight decrease.
    let fall = first.windows(2).skip(1).map(|pair| 1.0 - pair[1] / pair[0]).fold(0.0, f64::max);
    let [zero, low, high] = [first.first(), first.get(1), first.last()].map(|one| one.copied().unwrap_or(f64::NAN));
    Statement::tested(
        format!(
            "From nodal diameter 1 upwards, the lowest frequency rises with the nodal diameter (any drop is below {} %) \
             from disk-dominated to blade-dominated modes",
            100.0 * FLAT
        ),
        fall < FLAT && high > low,
        format!(
            "{low:.1} Hz at nodal diameter 1, {high:.1} Hz at {}; largest drop between successive nodal diameters \
             {:.1e} %. Umbrella mode of the disk at nodal diameter 0: {zero:.1} Hz",
            first.len().saturating_sub(1),
            100.0 * fall
        ),
    )
}

/// States the modes that an engine order excites within [`NEAR`] at this speed, lowest orders first.
fn resonances(sheet: &Sheet) -> Statement {
    let near = sheet.rows.iter().filter(|row| (row[5] / row[2] - 1.0).abs() < NEAR && row[1] <= 3.0);
    let mut near: Vec<&Vec<f64>> = near.collect();
    near.sort_by(|a, b| a[4].total_cmp(&b[4]));
    let texts = near.iter().take(6).map(|row| {
        format!("engine order {} (n = {}, mode {}, {:.0} Hz, at {:.0} rad/s)", row[4], row[0], row[1], row[2], row[6])
    });
    let texts: Vec<String> = texts.collect();
    let found = if texts.is_empty() { "none".into() } else { texts.join("; ") };
    Statement::remark(
        format!("Engine orders within {:.0} % of one of the first three modes at this speed", 100.0 * NEAR),
        found,
    )
}

/// Returns the modes drawn as a VTK file of the sector, for ParaView and others.
fn vtk(mesh: &Mesh, diameters: &[NodalDiameter]) -> Result<Vec<u8>> {
    let mut fields = Vec::new();
    for (number, mode) in SHAPES {
        if let Some(shape) = diameters.get(number).and_then(|diameter| diameter.shapes.get(mode)) {
            fields.extend(NodalField::mode(&format!("n{number}_mode{}", mode + 1), shape));
        }
    }
    tiprub_model::vtk::write(mesh, &fields).map_err(|error| Failure::from_below("VTK file", error))
}

/// Creates the study of a reduction of the sector `mesh`, with the engine orders of `speed` (rad/s); without a speed,
/// the one at which an oval casing excites the first mode of nodal diameter 2.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn study(reduction: &CyclicReduction, mesh: &Mesh, speed: Option<f64>, quick: bool) -> Result<Study> {
    let diameters = &reduction.nodal_diameters;
    let sectors = reduction.rom.sectors;
    let oval = diameters.get(2).and_then(|diameter| diameter.full_frequencies.first()).copied();
    let critical = oval.map(|frequency| std::f64::consts::PI * frequency);
    let speed = speed.or(critical).unwrap_or(1.0);
    let diagram = diagram(diameters, sectors, speed)?;
    let mut statements = vec![flat_families(diameters), disk_stiffens(diameters), resonances(&diagram.sheet)];
    if let Some(critical) = critical {
        statements.push(Statement::remark(
            "Critical speed of an oval casing (engine order 2, first mode of nodal diameter 2)",
            format!("{critical:.1} rad/s ({:.0} rpm)", critical * 30.0 / std::f64::consts::PI),
        ));
    }
    let families =
        |diameter: &NodalDiameter| diameter.full_frequencies.iter().take(FAMILIES).copied().collect::<Vec<_>>();
    let rom = &reduction.rom;
    Ok(Study {
        name: "modes",
        title: "Modes of the bladed disk".into(),
        summary: format!(
            "Natural frequencies and mode shapes of {} for every nodal diameter.{}",
            rom.name,
            if quick { " Quick mode: a coarse mesh, for a first look only." } else { "" }
        ),
        facts: vec![
            ("model".into(), rom.origin.clone()),
            ("sectors".into(), sectors.to_string()),
            ("nodes and elements of one sector".into(), format!("{}, {}", mesh.nodes.len(), mesh.elements.len())),
            (
                "speed for the engine orders".into(),
                format!("{speed:.2} rad/s ({:.0} rpm)", speed * 30.0 / std::f64::consts::PI),
            ),
        ],
        statements,
        results: json!({
            "speed": speed,
            "critical_speed_of_an_oval_casing": critical,
            "frequencies_hz": diameters.iter().map(families).collect::<Vec<_>>(),
        }),
        figures: vec![diagram, shapes(mesh, diameters)],
        files: vec![("shapes.vtu".into(), "mode shapes of one sector for ParaView".into(), vtk(mesh, diameters)?)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the frequencies of a chain of equal blades coupled through their feet.
    fn chain(number: usize, sectors: usize) -> NodalDiameter {
        let sine = (std::f64::consts::PI * number as f64 / sectors as f64).sin();
        let frequencies: Vec<f64> = [100.0, 250.0].map(|f: f64| (f * f + 4.0 * 300.0 * sine * sine).sqrt()).to_vec();
        NodalDiameter {
            number,
            reduced_frequencies: frequencies.clone(),
            frequency_deviation: vec![0.0; 2],
            residual_criterion: vec![0.0; 2],
            fixed_interface_frequencies: Vec::new(),
            shapes: Vec::new(),
            full_frequencies: frequencies,
        }
    }

    #[test]
    fn finds_the_nearest_engine_order_of_a_nodal_diameter() {
        // 10 revolutions per second, 12 sectors: n = 2 is excited by the orders 2, 10, 14, 22 ...
        assert_eq!(nearest_order(2, 95.0, 10.0, 12), Some(10));
        assert_eq!(nearest_order(2, 130.0, 10.0, 12), Some(14));
        assert_eq!(nearest_order(0, 5.0, 10.0, 12), Some(12));
    }

    #[test]
    fn diagram_contains_all_modes_and_both_kinds_of_dots() {
        let diameters: Vec<_> = (0..=6).map(|number| chain(number, 12)).collect();
        let figure = diagram(&diameters, 12, 62.831_853_071_795_86).unwrap();
        assert_eq!(figure.sheet.rows.len(), 14);
        let row = &figure.sheet.rows[4];
        assert_eq!((row[0], row[1], row[4]), (2.0, 1.0, 10.0));
        assert!((row[6] - std::f64::consts::TAU * row[2] / 10.0).abs() < 1e-12);
        assert!(figure.picture.svg.contains("engine orders at 63 rad/s"));
        assert_eq!(disk_stiffens(&diameters).holds, Some(true));
        assert_eq!(flat_families(&diameters).holds, Some(true));
        let falling: Vec<_> = (0..=6).map(|number| chain(6 - number, 12)).collect();
        assert_eq!(disk_stiffens(&falling).holds, Some(false));
        // A family that falls to the last but one and rises by one step is not rising.
        let valley: Vec<_> = (0..=6).map(|number: usize| chain(if number == 6 { 1 } else { 5 - number }, 12)).collect();
        assert_eq!(disk_stiffens(&valley).holds, Some(false));
    }

    #[test]
    fn mode_shape_is_shown_at_maximum_displacement() {
        let complex = nalgebra::Complex::new;
        let zero = complex(0.0, 0.0);
        let shape = [[complex(0.0, 2.0), zero, zero], [complex(1.0, 0.0), zero, zero]];
        let real = at_largest(&shape);
        assert!((real[0][0].abs() - 2.0).abs() < 1e-12 && real[1][0].abs() < 1e-12);
    }
}
