//! The paper's figures 1 and 3 to 6 with the curves of all methods.

use tiprub_figure::{
    picture::{self, MeshSurface, ProjectionFrame, ViewPoint, surface_of},
    plots::{Plot, Series, SeriesForm},
};
use tiprub_model::cube::{RingSide, cube_mesh, ring_mesh};
use tiprub_reference::{compare::windowed, cube::history::CubeHistory};
use tiprub_shell::{Failure, Result};
use tiprub_study::{Picture, Sheet, StudyFigure};

use super::{
    pairs::{self, RunPair},
    runs::CubeRun,
};

/// Forces are drawn as means over this time (s), because the impact of a node with mass takes one step.
const MEAN: f64 = 1e-5;
const CORNERS: [&str; 8] = ["1", "6", "85", "90", "31", "36", "91", "96"];
const AXES: [&str; 3] = ["x", "y", "z"];
const TIME: &str = "time (ms)";

/// Draws the three meshes at the start.
pub(super) fn scene() -> StudyFigure {
    let mut whole = MeshSurface::default();
    let mut marks = Vec::new();
    let cube = cube_mesh();
    for mesh in [&cube, &ring_mesh(RingSide::Left), &ring_mesh(RingSide::Right)] {
        let surface = surface_of(mesh);
        let first = whole.points.len();
        whole.points.extend(surface.points);
        whole.faces.extend(surface.faces.into_iter().map(|face| face.map(|node| first + node)));
    }
    for set in ["CORNERS_LEFT", "CORNERS_RIGHT"] {
        marks.extend(cube.sets[set].iter().map(|&node| cube.nodes[node]));
    }
    let view = ViewPoint::of_blade(&whole, 1.1, 0.45);
    let svg = picture::draw(&whole, None, &marks, &ProjectionFrame::around(&whole, &view, 0.05), &view);
    let mut sheet = Sheet::new(["x (m)", "y (m)", "z (m)"]);
    sheet.rows = marks.iter().map(|place| place.to_vec()).collect();
    StudyFigure {
        name: "scene",
        caption:
            "The cube before it enters the gap between the two rings. Dots mark the corners of its contact faces, circles the \
             hidden ones (figs 1 and 2)."
                .into(),
        picture: Picture { html: svg.clone(), svg },
        sheet,
    }
}

/// Returns mean forces over the windows that lie within the times, at their middles.
fn means(times: &[f64], force: &[f64]) -> Vec<(f64, f64)> {
    let end = times.last().copied().unwrap_or(0.0);
    let windows = windowed(times, force, MEAN, end);
    windows.iter().enumerate().map(|(index, mean)| (1e3 * MEAN * (index as f64 + 0.5), *mean)).collect()
}

fn line(times: &[f64], values: impl Iterator<Item = f64>, end: f64) -> Vec<(f64, f64)> {
    times.iter().zip(values).filter(|(time, _)| **time <= end).map(|(time, value)| (1e3 * time, value)).collect()
}

/// Returns a sheet of adjacent columns; shorter ones end with empty cells.
fn sheet(series: &[(String, Vec<(f64, f64)>)]) -> Sheet {
    let mut sheet = Sheet::default();
    sheet.columns.push(TIME.into());
    sheet.columns.extend(series.iter().map(|(name, _)| name.clone()));
    let longest = series.iter().map(|(_, points)| points.len()).max().unwrap_or(0);
    for row in 0..longest {
        let time = series.iter().find_map(|(_, points)| points.get(row)).map_or(0.0, |point| point.0);
        let value = |points: &Vec<(f64, f64)>| points.get(row).map_or(f64::NAN, |point| point.1);
        sheet.rows.push([time].into_iter().chain(series.iter().map(|(_, points)| value(points))).collect());
    }
    sheet
}

fn figure(
    name: &'static str,
    caption: String,
    unit: &str,
    curves: Vec<(String, Vec<(f64, f64)>)>,
) -> Result<StudyFigure> {
    let series = curves.iter().map(|(label, points)| Series::line(label.clone(), points.clone()));
    let plot = Plot { height: 340, ..Plot::new(TIME, unit, series.collect()) };
    Ok(StudyFigure { name, caption, picture: Picture::plot(&plot)?, sheet: sheet(&curves) })
}

/// Draws fig. 3: corners of both faces of one run.
pub(super) fn symmetry(name: &str, history: &CubeHistory) -> Result<Vec<StudyFigure>> {
    let end = f64::MAX;
    let moved = (0..8).map(|corner| {
        let values = history.corners.iter().map(move |corners| 1e3 * corners[corner][0]);
        (format!("node {}", CORNERS[corner]), line(&history.times, values, end))
    });
    let force = (0..8).map(|corner| {
        let values: Vec<f64> = history.corner_forces.iter().map(|forces| forces[corner]).collect();
        (format!("node {}", CORNERS[corner]), means(&history.times, &values))
    });
    Ok(vec![
        figure("fig3a-ux", format!("ux of the corners, {name} (fig. 3a)."), "ux (mm)", moved.collect())?,
        figure(
            "fig3b-lambda",
            format!("Normal force on the corners, {name}, averaged over 10 µs (fig. 3b)."),
            "λ (N)",
            force.collect(),
        )?,
    ])
}

/// Draws fig. 4: node 1 over the whole run, and fig. 5: λ1 while it touches (to `touching`, s).
pub(super) fn node_1(outcomes: &[CubeRun], speed: f64, touching: f64) -> Result<Vec<StudyFigure>> {
    let runs: Vec<_> = outcomes.iter().filter_map(|outcome| Some((outcome.name, outcome.history()?))).collect();
    let mut figures = Vec::new();
    let files = ["fig4a-u1x", "fig4b-u1y", "fig4c-u1z"];
    for (axis, name) in files.into_iter().enumerate() {
        let curve = |(label, history): &(&str, &CubeHistory)| {
            let values = history.first(axis).into_iter().map(|value| 1e3 * value);
            ((*label).to_owned(), line(&history.times, values, f64::MAX))
        };
        let unit = format!("u1{} (mm)", AXES[axis]);
        let caption = format!("Displacement of node 1 along {} at {speed} m/s (fig. 4).", AXES[axis]);
        figures.push(figure(name, caption, &unit, runs.iter().map(curve).collect())?);
    }
    let force = |end: f64| {
        let curve = |(label, history): &(&str, &CubeHistory)| {
            let points = means(&history.times, &history.first_force());
            ((*label).to_owned(), points.into_iter().filter(|(time, _)| *time <= 1e3 * end).collect())
        };
        runs.iter().map(curve).collect::<Vec<_>>()
    };
    let whole = "Normal force on node 1, averaged over 10 µs (fig. 4d).".to_owned();
    figures.push(figure("fig4d-lambda1", whole, "λ1 (N)", force(f64::MAX))?);
    let near = "Normal force on node 1 during contact, averaged over 10 µs (fig. 5).".to_owned();
    figures.push(figure("fig5-lambda1", near, "λ1 (N)", force(touching))?);
    Ok(figures)
}

/// Draws fig. 6: energies of one run.
pub(super) fn energies(name: &'static str, label: &str, history: &CubeHistory) -> Result<StudyFigure> {
    let curve = |label: &str, values: Vec<f64>| (label.to_owned(), line(&history.times, values.into_iter(), f64::MAX));
    let curves = vec![
        curve("total", history.total()),
        curve("kinetic", history.kinetic.clone()),
        curve("strain", history.strain.clone()),
    ];
    figure(name, format!("Energies of all bodies, {label} (fig. 6)."), "energy (J)", curves)
}

/// Draws all pairs: picture on a logarithmic axis, table below.
pub(super) fn agreement(pairs: &[RunPair]) -> Result<StudyFigure> {
    let mut sheet = Sheet::new(["pair", "u1x (%)", "slowing (%)", "u1z (%)", "lambda1 in windows (%)"]);
    let places = [0, 1, 2, 4];
    for (index, pair) in pairs.iter().enumerate() {
        let shares = pair.shares();
        sheet.rows.push([(index + 1) as f64].into_iter().chain(places.map(|place| 100.0 * shares[place])).collect());
    }
    if sheet.rows.is_empty() {
        return Err(Failure::new("lab cube", "fewer than two runs completed", "See the messages of the runs"));
    }
    let names = ["u1x", "slowing", "u1z", "λ1 in windows"];
    let series = names.iter().enumerate().map(|(column, name)| {
        let points = sheet.rows.iter().map(|row| (row[0], row[column + 1])).collect();
        Series::line(*name, points).drawn(SeriesForm::Dots, column)
    });
    let plot = Plot {
        logarithmic: true,
        height: 320,
        ..Plot::new("pair (row of the table)", "relative L2 difference (%)", series.collect())
    };
    let mut picture = Picture::plot(&plot)?;
    picture.html.push_str(&pairs::html(pairs));
    Ok(StudyFigure {
        name: "pairs",
        caption: "All pairs of methods: relative L2 differences of node 1 during contact and of its force in windows \
                  of 20 µs; the other columns are ratios minus one."
            .into(),
        picture,
        sheet,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 N to the last record, which lies within a window: a mean that included the missing part would be smaller.
    #[test]
    fn force_curve_ends_with_the_last_complete_window() {
        let times: Vec<f64> = (0..=104).map(|index| f64::from(index) * 1e-6).collect();
        let points = means(&times, &vec![100.0; times.len()]);
        assert_eq!(points.len(), 10, "{points:?}");
        assert!(points.iter().all(|(_, force)| (force - 100.0).abs() < 1e-9), "{points:?}");
        assert!((points[9].0 - 0.095).abs() < 1e-12, "{points:?}");
        // A window that ends with the records is complete.
        assert_eq!(means(&times[..=100], &vec![100.0; 101]).len(), 10);
    }

    #[test]
    fn short_columns_are_padded_with_nan() {
        let column = |name: &str, count: u32| {
            (name.to_owned(), (0..count).map(|index| (f64::from(index), 2.0)).collect::<Vec<_>>())
        };
        let rows = sheet(&[column("long", 3), column("short", 2)]).rows;
        assert_eq!(rows[..2], [vec![0.0, 2.0, 2.0], vec![1.0, 2.0, 2.0]]);
        assert!(rows[2][1].to_bits() == 2.0_f64.to_bits() && rows[2][2].is_nan(), "{rows:?}");
    }

    /// Some of the eight corners are behind the cube or a ring.
    #[test]
    fn scene_picture_hides_occluded_parts() {
        let svg = scene().picture.svg;
        let circles: Vec<&str> = svg.split("<circle ").skip(1).collect();
        let hidden = circles.iter().filter(|circle| circle.contains(r#"fill="none""#)).count();
        assert!(circles.len() == 8 && (1..8).contains(&hidden), "{hidden} of {}", circles.len());
    }
}
