//! Figures of the report, with their quantities, units and captions.

use std::fmt::Write as _;

use tiprub_core::VariableTable;
use tiprub_core::scene::settings::Shape;
use tiprub_cosim::variables::Quantity;
use tiprub_figure::{
    escape,
    picture::{self, MeshSurface, ProjectionFrame, ViewPoint, surface_of},
    plots::{Plot, Series},
    time_map::{Shows, TimeMap},
};
use tiprub_model::Reduction;
use tiprub_shell::{Failure, Result, recording::Recording};

use super::input::ReportInput;

/// Azimuth and elevation of the blade pictures (rad): suction side, leading edge to the left, slightly from above.
const AZIMUTH: f64 = 1.1;
const ELEVATION: f64 = 0.22;
/// Largest drawn displacement as a fraction of the height of the blade.
const DRAWN_DISPLACEMENT: f64 = 0.12;
/// Number of mode shapes shown.
const MODES_SHOWN: usize = 4;

/// Figure of the guide for error against run time.
const ERROR_PICTURE: &str = include_str!("../../../docs/error/rotor37-light-steps.svg");

/// Results of a run, found by quantity instead of by name.
pub struct Results<'a> {
    table: &'a VariableTable,
    recording: &'a Recording,
}

impl<'a> Results<'a> {
    /// Creates the results of a run of the scene with this table.
    pub fn new(table: &'a VariableTable, recording: &'a Recording) -> Self {
        Self { table, recording }
    }

    /// Returns the columns (one per element) of the variable with this quantity; empty if the scene has none.
    fn columns(&self, quantity: Quantity) -> Vec<Vec<f64>> {
        let Some(variable) = self.table.with_quantity(quantity) else { return Vec::new() };
        (0..variable.len()).filter_map(|index| self.recording.column(&variable.element_name(index))).collect()
    }

    /// Returns the column of a scalar quantity.
    pub fn column(&self, quantity: Quantity) -> Option<Vec<f64>> {
        self.columns(quantity).into_iter().next()
    }

    /// Returns the last value of a scalar quantity.
    pub fn last(&self, quantity: Quantity) -> Option<f64> {
        self.column(quantity)?.last().copied()
    }

    /// Returns the smallest and the largest value of a scalar quantity.
    pub fn extremes(&self, quantity: Quantity) -> Option<(f64, f64)> {
        let column = self.column(quantity)?;
        Some(
            column
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value))),
        )
    }

    /// Returns points of time in ms and value times `factor`.
    fn points(&self, column: &[f64], factor: f64) -> Vec<(f64, f64)> {
        self.recording.times.iter().zip(column).map(|(time, value)| (1e3 * time, factor * value)).collect()
    }

    /// Draws the contact nodes over time: lines for a few nodes, a map for more. Empty if the scene has no such output.
    fn per_node(&self, quantity: Quantity, nodes: &[String], (label, factor, shows): LabelledUnit) -> Result<String> {
        let columns = self.columns(quantity);
        if columns.is_empty() {
            return Ok(String::new());
        }
        let named = nodes.iter().map(|node| readable(node)).zip(&columns);
        if columns.len() <= MOST_LINES {
            let series = named.map(|(node, column)| Series::line(node, self.points(column, factor))).collect();
            let mut plot = Plot::new("time (ms)", label, series);
            plot.levels.extend((shows == Shows::Smallest).then(|| (0.0, "contact".into())));
            return plot.to_html();
        }
        let rows = named.map(|(node, column)| (node, column.iter().map(|value| factor * value).collect())).collect();
        let times = self.recording.times.iter().map(|time| 1e3 * time).collect();
        Ok(TimeMap { x_label: "time (ms)".into(), value_label: label.into(), rows, times, shows }.to_html())
    }

    fn series(&self, label: &str, quantity: Quantity, factor: f64) -> Option<Series> {
        self.column(quantity).map(|column| Series::line(label, self.points(&column, factor)))
    }
}

/// Label with unit, factor to that unit, and the value that a map shows.
type LabelledUnit = (&'static str, f64, Shows);

/// Largest number of contact nodes that are drawn as lines instead of a map.
const MOST_LINES: usize = 4;

/// Numbered figure.
#[derive(Clone)]
struct NumberedFigure {
    body: String,
    caption: String,
}

/// Returns all figures, numbered in order, as HTML.
pub(super) fn figures(input: &ReportInput<'_>) -> Result<Vec<(&'static str, String)>> {
    let results = Results::new(input.table, &input.native.recording);
    let mut number = 0;
    let mut section = |title: &'static str, figures: Vec<NumberedFigure>| {
        let mut html = String::new();
        for figure in figures {
            number += 1;
            let _ = writeln!(
                html,
                "<figure>{}<figcaption><b>Figure {number}.</b> {}</figcaption></figure>",
                figure.body, figure.caption
            );
        }
        (title, html)
    };
    Ok(vec![
        section("The blade", input.reduction.map(mode_shapes).into_iter().collect()),
        section("Clearances", [casing(input)?, clearances(input, &results)?].concat()),
        section("Contact forces", forces(input, &results)?),
        section("Energy", energies(&results)?),
        section("Error against run time", vec![error_study()]),
    ])
}

/// Shows the error study of the laboratory, with the command that measures it on this machine.
fn error_study() -> NumberedFigure {
    // The picture has its own background and legend.
    let body = format!("<div class=\"scroll adapts\">{ERROR_PICTURE}</div>");
    let caption =
        "Error against run time of adaptive steps, fixed steps and the paper's method for a light rub of the \
                   built-in rotor 37, measured once (see docs/error-study.md in the sources). The demo does not repeat \
                   this study. To run it on this machine, use <code>tiprub study error builtin:rotor37</code>; with \
                   <code>--quick</code> it takes minutes."
            .to_owned();
    NumberedFigure { body, caption }
}

fn watched(input: &ReportInput<'_>) -> usize {
    input.scene.settings.outputs.watched_sectors.first().map_or(0, |sector| sector.saturating_sub(1))
}

fn node_names(input: &ReportInput<'_>) -> Vec<String> {
    input
        .scene
        .roms
        .first()
        .map_or_else(Vec::new, |rom| rom.contact_nodes.iter().map(|node| node.name.clone()).collect())
}

/// Returns a readable form of a name such as `leading_edge`.
fn readable(name: &str) -> String {
    match name {
        "mid_chord" => "mid-chord".into(),
        other => other.replace('_', " "),
    }
}

/// Draws the clearance of an undeformed blade around the circumference, for the first contact.
fn casing(input: &ReportInput<'_>) -> Result<Vec<NumberedFigure>> {
    let settings = &input.scene.settings;
    let Some(contact) = settings.contacts.first() else { return Ok(Vec::new()) };
    let Some(surface) = settings.surfaces.iter().find(|surface| surface.name == contact.slave) else {
        return Ok(Vec::new());
    };
    let shape = tiprub_core::scene::shape::CompiledShape::new(&surface.shape, contact.nominal_gap())
        .map_err(|error| Failure::from_core("casing shape", error))?;
    let clearance = |degrees: f64| contact.nominal_gap() + shape.evaluate(degrees.to_radians()).0;
    let points = (0..=720_u32).map(|half| f64::from(half) / 2.0).map(|degrees| (degrees, 1e6 * clearance(degrees)));
    let series = vec![Series::line("casing", points.collect())];
    let mut plot = Plot::new("angle around the casing (°)", "radial clearance (µm)", series);
    plot.height = 200;
    plot.levels.push((0.0, "tip of an undeformed blade".into()));
    let ramp = if surface.ramp_time > 0.0 {
        format!(", reached {} ms after the start", 1e3 * surface.ramp_time)
    } else {
        String::new()
    };
    let body = plot.to_html()?;
    let caption = format!(
        "Casing shape: radial clearance of an undeformed blade around the circumference{ramp}. The clearances below \
         are measured normal to the casing, which is parallel to the tip contour, and are slightly smaller."
    );
    Ok(vec![NumberedFigure { body, caption }])
}

fn clearances(input: &ReportInput<'_>, results: &Results<'_>) -> Result<Vec<NumberedFigure>> {
    let (sector, nodes) = (watched(input), node_names(input));
    let mut figures = Vec::new();
    let body = results.per_node(Quantity::Clearance(sector), &nodes, ("clearance (µm)", 1e6, Shows::Smallest))?;
    if !body.is_empty() {
        let caption = format!(
            "Clearance between blade {} and the casing at its contact nodes, at the communication points.{}",
            sector + 1,
            passing(input)
        );
        figures.push(NumberedFigure { body, caption });
    }
    Ok(figures)
}

/// Describes the time between contacts, for casing shapes for which it is known.
fn passing(input: &ReportInput<'_>) -> &'static str {
    match input.scene.settings.surfaces.first().map(|surface| &surface.shape) {
        Some(Shape::TwoLobe { .. }) => {
            " The blade passes a bump of the casing twice per revolution and vibrates freely in between."
        }
        _ => "",
    }
}

fn forces(input: &ReportInput<'_>, results: &Results<'_>) -> Result<Vec<NumberedFigure>> {
    let (sector, nodes) = (watched(input), node_names(input));
    let mut figures = Vec::new();
    for (quantity, label, caption) in [
        (
            Quantity::NormalForce(sector),
            "normal force (N)",
            "Normal contact force on each node of blade {}, mean over the communication step (impulse / H).",
        ),
        (
            Quantity::TangentialForce(sector),
            "friction force (N)",
            "Friction force on each node of blade {}, mean over the communication step.",
        ),
    ] {
        let body = results.per_node(quantity, &nodes, (label, 1.0, Shows::Largest))?;
        if !body.is_empty() {
            figures.push(NumberedFigure { body, caption: caption.replace("{}", &(sector + 1).to_string()) });
        }
    }
    if let Some(series) = results.series("nodes in contact", Quantity::ContactCount, 1.0) {
        let mut plot = Plot::new("time (ms)", "nodes in contact (-)", vec![series]);
        plot.height = 190;
        let all = input.scene.roms.iter().map(|rom| rom.sectors * rom.contact_nodes.len()).sum::<usize>();
        figures.push(NumberedFigure {
            body: plot.to_html()?,
            caption: format!("Number of nodes in contact at the communication points, out of {all} on the whole disk."),
        });
    }
    if let Some(series) = results.series("torque", Quantity::Moment(2), 1.0) {
        let mut plot = Plot::new("time (ms)", "torque on the rotor (N·m)", vec![series]);
        plot.height = 220;
        figures.push(NumberedFigure {
            body: plot.to_html()?,
            caption:
                "Reaction torque of the casing on the shaft, mean over the communication step; negative values brake the rotor."
                    .into(),
        });
    }
    Ok(figures)
}

fn energies(results: &Results<'_>) -> Result<Vec<NumberedFigure>> {
    let mut figures = Vec::new();
    let vibration = [
        ("kinetic", Quantity::KineticEnergy),
        ("strain", Quantity::StrainEnergy),
        ("damping loss", Quantity::DampingLoss),
        ("impact loss", Quantity::ImpactLoss),
    ];
    let exchanged = [("external work", Quantity::ExternalWork), ("friction heat", Quantity::FrictionLoss)];
    for (list, height, caption) in [
        (
            &vibration[..],
            260,
            "Vibration energy of all blades, and the energy dissipated by damping and impacts since the start.",
        ),
        (
            &exchanged[..],
            200,
            "External work of the drive and the casing, and friction heat, since the start. The difference is the \
             vibration energy and the losses to damping and impacts (previous figure).",
        ),
    ] {
        let series: Vec<Series> =
            list.iter().filter_map(|(label, quantity)| results.series(label, *quantity, 1.0)).collect();
        if !series.is_empty() {
            let plot = Plot { height, ..Plot::new("time (ms)", "energy (J)", series) };
            figures.push(NumberedFigure { body: plot.to_html()?, caption: caption.into() });
        }
    }
    if let Some(column) = results.column(Quantity::EnergyResidualRelative) {
        let magnitude: Vec<f64> = column.iter().map(|value| value.abs()).collect();
        let mut plot = Plot::new(
            "time (ms)",
            "|residual| / energy (-)",
            vec![Series::line("residual", results.points(&magnitude, 1.0))],
        );
        (plot.height, plot.logarithmic) = (200, true);
        figures.push(NumberedFigure {
            body: plot.to_html()?,
            caption:
                "Residual of the energy balance: kinetic + strain + losses − initial − external work, relative to the \
                 initial energy and all work exchanged. Values around 1e-16 are round-off."
                    .into(),
        });
    }
    Ok(figures)
}

/// Draws the blade at rest with its contact nodes, and its first mode shapes.
fn mode_shapes(reduction: &Reduction) -> NumberedFigure {
    let surface = reduction.mesh.as_ref().map_or_else(MeshSurface::default, surface_of);
    let view = ViewPoint::of_blade(&surface, AZIMUTH, ELEVATION);
    let frame = ProjectionFrame::around(&surface, &view, 0.1);
    let marks: Vec<[f64; 3]> = reduction.rom.contact_nodes.iter().map(|node| cartesian(node.position)).collect();
    let mut body = String::from("<div class=\"shapes\">");
    let _ = write!(
        body,
        "<div>{}<span>mesh and contact nodes</span></div>",
        picture::draw(&surface, None, &marks, &frame, &view)
    );
    let radii = surface.points.iter().map(|point| point[0].hypot(point[1]));
    let (low, high) = radii.fold((f64::INFINITY, 0.0_f64), |(low, high), radius| (low.min(radius), high.max(radius)));
    for (mode, number) in reduction.modes.iter().take(MODES_SHOWN).zip(1..) {
        let largest =
            mode.shape.iter().map(|vector| vector.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max);
        let scale = DRAWN_DISPLACEMENT * (high - low) / f64::max(largest, f64::MIN_POSITIVE);
        let drawn = picture::draw(&surface, Some((&mode.shape, scale)), &[], &frame, &view);
        let _ = write!(body, "<div>{drawn}<span>mode {number}: {:.1} Hz</span></div>", mode.frequency);
    }
    let _ = write!(body, "</div><div class=\"scale\">{}</div>", picture::color_scale("0", "largest"));
    let caption = format!(
        "{}: finite-element surface with the contact nodes (red), and the first {} mode shapes at rest; the colour \
         shows the magnitude of the displacement.",
        escape(&reduction.rom.name),
        reduction.modes.len().min(MODES_SHOWN)
    );
    NumberedFigure { body, caption }
}

fn cartesian([radius, angle, z]: [f64; 3]) -> [f64; 3] {
    [radius * angle.cos(), radius * angle.sin(), z]
}
