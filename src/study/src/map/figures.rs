//! Figures of the interaction map with their numbers.

use tiprub_figure::plots::{Plot, Series};
use tiprub_shell::Result;

use super::{
    MODES, Map, SpeedResponse,
    findings::order_curve,
    picture::{HeatMap, LineKind, MapLine, SpeedColumn},
};
use crate::{Picture, Sheet, StudyFigure};

/// Decades of amplitude that the colour scale covers.
const DECADES: f64 = 4.0;
/// Number of points of a curved line.
const POINTS: u32 = 24;
/// Number of engine orders that have a separate curve.
const CURVES: usize = 3;

/// Returns all figures.
pub fn figures(map: &Map) -> Result<Vec<StudyFigure>> {
    let mut figures = vec![heat_map(map), amplitudes(map)?];
    figures.extend(contact(map)?);
    figures.extend(spectrum(map)?);
    Ok(figures)
}

fn lines(map: &Map) -> Vec<MapLine> {
    let range = [map.runs[0].speed, map.runs[map.runs.len() - 1].speed];
    let speed = |index: u32| range[0] + (range[1] - range[0]) * f64::from(index) / f64::from(POINTS);
    let mut lines = Vec::new();
    let most = (1_u32..10_000).take_while(|order| f64::from(*order) * range[0] / std::f64::consts::TAU < map.setup.top);
    for order in most {
        let excited = map.prediction.excites(order as usize);
        let turns = |speed: f64| (speed, f64::from(order) * speed / std::f64::consts::TAU);
        lines.push(MapLine {
            points: vec![turns(range[0]), turns(range[1])],
            label: if excited { format!("{order}Ω") } else { String::new() },
            kind: if excited { LineKind::Excited } else { LineKind::Silent },
        });
    }
    let shown = map
        .prediction
        .lines(range[0])
        .into_iter()
        .enumerate()
        .filter(|(_, mode)| *mode > 0.0 && *mode <= map.setup.top);
    for (index, _) in shown.take(MODES * 40) {
        let points = (0..=POINTS).map(|point| (speed(point), map.prediction.lines(speed(point))[index])).collect();
        lines.push(MapLine { points, label: String::new(), kind: LineKind::Mode });
    }
    lines
}

fn heat_map(map: &Map) -> StudyFigure {
    let micro: Vec<Option<Vec<f64>>> = map
        .runs
        .iter()
        .map(|run| Some(run.outcome.as_ref().ok()?.largest_blade[0].iter().map(|value| 1e6 * value).collect()))
        .collect();
    let largest = micro.iter().flatten().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    let resolution = |speed: f64| speed / std::f64::consts::TAU / map.setup.revolutions as f64;
    let columns = map.runs.iter().zip(&micro).map(|(run, amplitudes)| SpeedColumn {
        speed: run.speed,
        resolution: resolution(run.speed),
        amplitudes: amplitudes.as_deref(),
    });
    let picture = HeatMap {
        columns: columns.collect(),
        top: map.setup.top,
        range: [largest * 10_f64.powf(-DECADES), largest],
        lines: lines(map),
        marks: map.coincidences.iter().map(|one| (one.crossing.speed, one.crossing.frequency)).collect(),
    };
    let svg = picture.to_svg();
    StudyFigure {
        name: "map",
        caption: format!(
            "Displacement amplitude of the leading edge (largest of all blades) over angular velocity and frequency in \
             the rotating frame. Solid: engine orders that the casing excites; dotted: other engine orders; dashed: \
             natural frequencies{}; circles: predicted coincidences. Grey columns are rejected runs ({}).",
            if map.prediction.stiffening { " of the rotating blades" } else { " at rest" },
            map.runs.len() - map.answered().count()
        ),
        picture: Picture { html: svg.clone(), svg },
        sheet: map_sheet(map),
    }
}

fn map_sheet(map: &Map) -> Sheet {
    let mut sheet = Sheet::new([
        "speed (rad/s)",
        "frequency (Hz)",
        "leading edge of the first blade (m)",
        "trailing edge of the first blade (m)",
        "leading edge; largest of all blades (m)",
        "trailing edge; largest of all blades (m)",
    ]);
    for run in &map.runs {
        let Ok(response) = &run.outcome else {
            sheet.rows.push([vec![run.speed], vec![f64::NAN; 5]].concat());
            continue;
        };
        for bin in 0..response.first_blade[0].len() {
            let values = response.first_blade.iter().chain(&response.largest_blade).map(|spectrum| spectrum[bin]);
            sheet.rows.push([run.speed, bin as f64 * response.resolution].into_iter().chain(values).collect());
        }
    }
    sheet
}

/// Returns the excited orders of largest amplitude.
fn strongest_orders(map: &Map) -> Vec<usize> {
    let most = |order: usize| {
        order_curve(&map.runs, order, map.setup.revolutions).iter().map(|point| point.1).fold(0.0, f64::max)
    };
    let bins = map.answered().map(|(_, response)| response.first_blade[0].len()).min().unwrap_or(0);
    let orders =
        (1..).take_while(|order| order * map.setup.revolutions < bins).filter(|order| map.prediction.excites(*order));
    let mut orders: Vec<(usize, f64)> = orders.map(|order| (order, most(order))).collect();
    orders.sort_by(|a, b| b.1.total_cmp(&a.1));
    orders.into_iter().take(CURVES).map(|order| order.0).collect()
}

fn amplitudes(map: &Map) -> Result<StudyFigure> {
    let orders = strongest_orders(map);
    let deflection =
        |node: usize| map.answered().map(|(speed, response)| (speed, 1e6 * response.deflection[node])).collect();
    let mut series = vec![Series::line("leading edge", deflection(0)), Series::line("trailing edge", deflection(1))];
    for order in &orders {
        let curve = order_curve(&map.runs, *order, map.setup.revolutions).into_iter();
        series.push(Series::line(
            format!("{order}Ω, leading edge"),
            curve.map(|(speed, value)| (speed, 1e6 * value)).collect(),
        ));
    }
    let plot =
        Plot { logarithmic: true, height: 340, ..Plot::new("angular velocity (rad/s)", "amplitude (µm)", series) };
    let mut sheet = Sheet::new(["speed (rad/s)", "leading edge (m)", "trailing edge (m)"]);
    sheet.columns.extend(orders.iter().map(|order| format!("engine order {order}; leading edge (m)")));
    sheet.columns.extend(
        [
            "fraction of time in contact",
            "mean normal force (N)",
            "largest normal force (N)",
            "largest penetration (m)",
            "drift",
        ]
        .map(String::from),
    );
    for run in &map.runs {
        let Ok(response) = &run.outcome else {
            sheet.rows.push([vec![run.speed], vec![f64::NAN; sheet.columns.len() - 1]].concat());
            continue;
        };
        let bin = |order: &usize| response.largest_blade[0].get(order * map.setup.revolutions).copied();
        let mut row = vec![run.speed, response.deflection[0], response.deflection[1]];
        row.extend(orders.iter().map(|order| bin(order).unwrap_or(f64::NAN)));
        let SpeedResponse { contact_share, normal_force, largest_force, penetration, drift, .. } = response;
        row.extend([*contact_share, *normal_force, *largest_force, *penetration, *drift]);
        sheet.rows.push(row);
    }
    Ok(StudyFigure {
        name: "amplitudes",
        caption: "Largest distance of the tip nodes from their mean position over all blades, and amplitudes of the strongest engine \
                  orders, against angular velocity."
            .into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// Plots a quantity of every run against angular velocity.
fn against_speed(
    map: &Map,
    name: &'static str,
    [caption, column, axis]: [&str; 3],
    shown: f64,
    value: impl Fn(&SpeedResponse) -> f64,
) -> Result<StudyFigure> {
    let points: Vec<(f64, f64)> = map.answered().map(|(speed, response)| (speed, value(response))).collect();
    let series = Series::line("", points.iter().map(|(speed, value)| (*speed, shown * value)).collect());
    let plot = Plot { height: 260, ..Plot::new("angular velocity (rad/s)", axis, vec![series]) };
    let mut sheet = Sheet::new(["speed (rad/s)", column]);
    sheet.rows = points.into_iter().map(|(speed, value)| vec![speed, value]).collect();
    Ok(StudyFigure { name, caption: caption.into(), picture: Picture::plot(&plot)?, sheet })
}

fn contact(map: &Map) -> Result<[StudyFigure; 2]> {
    let time = [
        "Fraction of time in which a blade is in contact (mean of all blades) against angular velocity.",
        "fraction of time in contact",
        "fraction of time in contact (%)",
    ];
    let force = [
        "Sum of all normal forces (mean over time) against angular velocity.",
        "mean normal force (N)",
        "mean normal force (N)",
    ];
    Ok([
        against_speed(map, "contact", time, 100.0, |response| response.contact_share)?,
        against_speed(map, "normal-force", force, 1.0, |response| response.normal_force)?,
    ])
}

/// Plots the spectrum at the speed of the largest response.
fn spectrum(map: &Map) -> Result<Option<StudyFigure>> {
    let largest = map.answered().max_by(|a, b| a.1.deflection[0].total_cmp(&b.1.deflection[0]));
    let Some((speed, response)) = largest else { return Ok(None) };
    let points = |spectrum: &[f64]| {
        let bins = spectrum.iter().enumerate();
        bins.map(|(bin, value)| (bin as f64 * response.resolution, 1e6 * value)).collect::<Vec<_>>()
    };
    let [leading, trailing] = &response.first_blade;
    let series = vec![Series::line("leading edge", points(leading)), Series::line("trailing edge", points(trailing))];
    let plot = Plot { logarithmic: true, height: 320, ..Plot::new("frequency (Hz)", "amplitude (µm)", series) };
    let mut sheet = Sheet::new(["frequency (Hz)", "leading edge (m)", "trailing edge (m)"]);
    let rows = leading.iter().zip(trailing).enumerate();
    sheet.rows = rows.map(|(bin, (a, b))| vec![bin as f64 * response.resolution, *a, *b]).collect();
    Ok(Some(StudyFigure {
        name: "spectrum",
        caption: format!("Spectrum of the first blade at {speed:.2} rad/s, where the leading edge moves most."),
        picture: Picture::plot(&plot)?,
        sheet,
    }))
}
