//! The paper's figures as SVG.

use std::path::Path;

use plotters::prelude::*;
use tiprub_reference::cube::history::History;

const COLOURS: [RGBColor; 4] =
    [RGBColor(20, 60, 160), RGBColor(200, 60, 30), RGBColor(30, 130, 60), RGBColor(120, 60, 140)];

struct Curve<'a> {
    name: &'a str,
    times: &'a [f64],
    values: Vec<f64>,
}

/// Lines over time in ms up to `end` (s).
fn lines(path: &Path, title: &str, unit: &str, end: f64, curves: &[Curve<'_>]) {
    let seen = || curves.iter().flat_map(|curve| curve.times.iter().zip(&curve.values)).filter(|(t, _)| **t <= end);
    let (low, high) = seen().fold((0.0_f64, 0.0_f64), |(low, high), (_, y)| (low.min(*y), high.max(*y)));
    let margin = 0.05 * (high - low);
    let root = SVGBackend::new(path, (760, 420)).into_drawing_area();
    root.fill(&WHITE).expect("the picture can be drawn");
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 18))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..end * 1e3, low - margin..high + margin)
        .expect("the axes are sound");
    chart.configure_mesh().x_desc("time (ms)").y_desc(unit).light_line_style(TRANSPARENT).draw().expect("axes");
    for (index, curve) in curves.iter().enumerate() {
        let style = COLOURS[index % COLOURS.len()].stroke_width(1);
        let points = curve.times.iter().zip(&curve.values).filter(|(t, _)| **t <= end).map(|(t, y)| (t * 1e3, *y));
        chart
            .draw_series(LineSeries::new(points, style))
            .expect("a line can be drawn")
            .label(curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
    }
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK)
        .draw()
        .expect("the legend can be drawn");
    root.present().expect("the picture can be written");
}

/// Mean over ±`reach` samples: forces of single steps carry the impacts of lumped nodes.
fn smoothed(values: &[f64], reach: usize) -> Vec<f64> {
    (0..values.len())
        .map(|i| {
            let window = &values[i.saturating_sub(reach)..(i + reach + 1).min(values.len())];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

/// Figure 3: corners of the left face over those of the right.
pub fn symmetry(directory: &Path, history: &History) {
    let names = ["1", "6", "85", "90", "31", "36", "91", "96"];
    let corner = |i: usize, values: &dyn Fn(usize) -> f64| Curve {
        name: names[i],
        times: &history.times,
        values: (0..history.times.len()).map(values).collect(),
    };
    let moved: Vec<Curve<'_>> = (0..8).map(|i| corner(i, &|k| history.corners[k][i][0] * 1e3)).collect();
    lines(&directory.join("fig3a.svg"), "ux of corner nodes", "displacement (mm)", 3e-3, &moved);
    let force: Vec<Curve<'_>> = (0..8)
        .map(|i| {
            let raw: Vec<f64> = history.corner_forces.iter().map(|forces| forces[i]).collect();
            Curve { name: names[i], times: &history.times, values: smoothed(&raw, 5) }
        })
        .collect();
    lines(&directory.join("fig3b.svg"), "contact force on corner nodes, mean over 11 µs", "force (N)", 3e-3, &force);
}

fn component(history: &History, component: usize, factor: f64) -> Vec<f64> {
    history.first(component).iter().map(|u| u * factor).collect()
}

/// Figure 4: u1x, u1y, u1z, λ1.
pub fn comparison(directory: &Path, runs: &[&(&str, History)]) {
    for (index, (name, unit, factor)) in
        [("u1x", "mm", 1e3), ("u1y", "m", 1.0), ("u1z", "mm", 1e3)].into_iter().enumerate()
    {
        let curves: Vec<Curve<'_>> = runs
            .iter()
            .map(|(label, history)| Curve {
                name: label,
                times: &history.times,
                values: component(history, index, factor),
            })
            .collect();
        let file = format!("fig4{}.svg", ["a", "b", "c"][index]);
        lines(&directory.join(file), name, &format!("displacement ({unit})"), 3e-3, &curves);
    }
    forces(&directory.join("fig4d.svg"), 3e-3, runs);
}

fn forces(path: &Path, end: f64, runs: &[&(&str, History)]) {
    let curves: Vec<Curve<'_>> = runs
        .iter()
        .map(|(label, history)| Curve {
            name: label,
            times: &history.times,
            values: smoothed(&history.first_force(), 5),
        })
        .collect();
    lines(path, "contact force on node 1, mean over 11 µs", "force (N)", end, &curves);
}

/// Figure 5: all three methods while node 1 touches.
pub fn superposition(directory: &Path, runs: &[&(&str, History)]) {
    for (index, name) in [(0, "u1x"), (2, "u1z")] {
        let curves: Vec<Curve<'_>> = runs
            .iter()
            .map(|(label, history)| Curve {
                name: label,
                times: &history.times,
                values: component(history, index, 1e3),
            })
            .collect();
        lines(&directory.join(format!("fig5-{name}.svg")), name, "displacement (mm)", 5e-4, &curves);
    }
    forces(&directory.join("fig5-lambda1.svg"), 5e-4, runs);
}

/// Figure 6: energies.
pub fn energies(directory: &Path, name: &str, history: &History) {
    let curve = |name: &'static str, values: Vec<f64>| Curve { name, times: &history.times, values };
    let curves = [
        curve("total", history.total()),
        curve("kinetic", history.kinetic.clone()),
        curve("strain", history.strain.clone()),
    ];
    lines(&directory.join(format!("fig6-{name}.svg")), "energy at 50 m/s", "energy (J)", 3e-3, &curves);
}
