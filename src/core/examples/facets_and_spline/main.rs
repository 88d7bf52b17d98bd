//! What facets do to a blade that slides along them, and what a spline through the same points does instead.
//!
//! `cargo run --release -p tiprub-core --example facets_and_spline -- forces.csv docs/images/facets-and-spline.svg`
//! writes the contact force of every step, the picture of the documentation, and prints the largest changes.

#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod plot;
mod sliding;

use std::fmt::Write as _;

use plot::{PlotLine, PlotPanel, draw};
use sliding::{AROUND, SPEED, STEP, SlidingHistory, casing, slide};
use tiprub_core::scene::settings::{Closure, Interpolation};

const KINDS: [(&str, &str, Closure, Interpolation); 3] = [
    ("facets", "#d67018", Closure::Smooth, Interpolation::Facets),
    ("spline, free ends at 180°", "#248c76", Closure::FreeEnds, Interpolation::Spline),
    ("spline, smooth", "#1f5da0", Closure::Smooth, Interpolation::Spline),
];

fn main() -> std::io::Result<()> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let path = |index: usize, default: &str| paths.get(index).cloned().unwrap_or_else(|| default.to_owned());
    let histories = KINDS.map(|(_, _, closure, interpolation)| slide(&casing(closure, interpolation)));
    println!("{AROUND} data points around, {SPEED} rad/s, step {STEP:e} s");
    for ((name, ..), history) in KINDS.iter().zip(&histories) {
        let largest = history.changes().into_iter().fold(0.0, f64::max);
        let [least, most] = history.range();
        println!("{name:>26}: force {least:.2} to {most:.2} N, largest change in one step {largest:.3e} N");
    }
    std::fs::write(path(0, "facets-and-spline.csv"), table(&histories))?;
    std::fs::write(path(1, "facets-and-spline.svg"), picture(&histories))
}

fn table(histories: &[SlidingHistory; 3]) -> String {
    let mut csv = "angle_deg,facets_N,free_ends_N,smooth_N\n".to_owned();
    for (index, angle) in histories[0].angle.iter().enumerate() {
        let _ = write!(csv, "{angle:.5}");
        histories.iter().for_each(|history| {
            let _ = write!(csv, ",{:.9e}", history.force[index]);
        });
        csv.push('\n');
    }
    csv
}

fn picture(histories: &[SlidingHistory; 3]) -> String {
    let forces = histories.each_ref().map(|history| history.force.iter().map(|force| force / 1e3).collect::<Vec<_>>());
    let changes = histories.each_ref().map(SlidingHistory::changes);
    let panels = [
        PlotPanel {
            label: "contact force (kN)",
            range: [0.0, 2.5],
            spacing: 0.5,
            logarithmic: false,
            series: series(&forces),
        },
        PlotPanel {
            label: "change per step (N)",
            range: [-4.0, 6.0],
            spacing: 2.0,
            logarithmic: true,
            series: series(&changes),
        },
    ];
    draw(&histories[0].angle, &panels, "Contact force of a node sliding around a casing of facets and of a spline")
}

fn series(values: &[Vec<f64>; 3]) -> Vec<PlotLine<'_>> {
    let lines = KINDS.iter().zip(values);
    lines.map(|((label, color, ..), values)| PlotLine { label, color, values }).collect()
}
