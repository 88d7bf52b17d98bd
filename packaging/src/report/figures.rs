//! Figures of the report, with their quantities, units and captions.

use std::fmt::Write as _;

use tiprub_core::VariableTable;
use tiprub_core::scene::settings::{Shape, StructureSettings};
use tiprub_core::scene::shape::CompiledShape;
use tiprub_cosim::variables::{Quantity, Variable};
use tiprub_field::animation::{HitBlade, TipHistory};
use tiprub_figure::{
    campbell::{Campbell, SPEED_AXIS_FACTOR},
    escape,
    grid_map::{GridMap, MapRows, Shows},
    plots::{Plot, Series},
    polar::{Polar, PolarCurve},
};
use tiprub_shell::{Failure, Result, native::ParameterValue, recording::Recording};
use tiprub_study::map::prediction::FrequencyPrediction;
use tiprub_study::response::{Spectrogram, Spectrum};

use super::input::ReportInput;
use super::numbers::rounded;

/// Largest number of contact nodes that are drawn as lines instead of a map.
const MAX_LINES: usize = 4;
/// Smallest peak that the frequency range must include, as a fraction of the largest peak.
const SHOWN_PEAK: f64 = 0.18;
/// End of the frequency range, as a multiple of the highest frequency of these peaks.
const ABOVE: f64 = 1.2;
/// Number of modes that the frequency range must include.
const MIN_MODES: usize = 2;
/// Largest number of lines of modes.
const MAX_MODES: usize = 60;
/// Largest number of engine orders.
const MAX_ORDERS: usize = 36;
/// Decades of the spectrogram.
const DECADES: f64 = 2.0;

/// Results of a run, found by quantity instead of by name.
pub(super) struct Results<'a> {
    table: &'a VariableTable,
    recording: &'a Recording,
}

impl<'a> Results<'a> {
    /// Creates the results of a run of the scene with this table.
    pub(super) fn new(table: &'a VariableTable, recording: &'a Recording) -> Self {
        Self { table, recording }
    }

    /// Returns the column of a scalar quantity.
    pub(super) fn column(&self, quantity: Quantity) -> Option<Vec<f64>> {
        let variable = self.table.with_quantity(quantity)?;
        self.recording.column(&variable.element_name(0))
    }

    /// Returns the last value of a scalar quantity.
    pub(super) fn last(&self, quantity: Quantity) -> Option<f64> {
        self.column(quantity)?.last().copied()
    }

    /// Returns the points (ms, value) of a column.
    fn points(&self, column: &[f64]) -> Vec<(f64, f64)> {
        self.recording.times.iter().zip(column).map(|(time, value)| (1e3 * time, *value)).collect()
    }

    /// Returns a scalar quantity over time as a line.
    fn series(&self, label: &str, quantity: Quantity) -> Option<Series> {
        self.column(quantity).map(|column| Series::line(label, self.points(&column)))
    }
}

/// Figure with its caption.
struct Captioned {
    body: String,
    caption: String,
}

/// Returns all sections of figures, numbered in order, as title and HTML; sections without figures are omitted.
pub(super) fn sections(input: &ReportInput<'_>, blade: Option<&HitBlade>) -> Result<Vec<(&'static str, String)>> {
    let results = Results::new(input.table, &input.native.recording);
    let history = blade.and_then(|blade| Some((blade, input.capture.tip_history(blade)?)));
    let history = history.as_ref().map(|(blade, history)| (*blade, history));
    let mut number = 0;
    let mut section = |title: &'static str, figures: Vec<Captioned>| {
        let mut html = String::new();
        for Captioned { body, caption } in figures {
            number += 1;
            let caption = format!("<figcaption><b>Figure {number}.</b> {caption}</figcaption>");
            let _ = writeln!(html, "<figure>{body}{caption}</figure>");
        }
        (title, html)
    };
    let all = vec![
        section("Where do the tips touch?", [clearances(input)?, wear(input)].into_iter().flatten().collect()),
        section("How hard is the contact?", forces(input, &results, blade)?),
        section("Which vibration does it cause?", vibration(input, history)?),
        section("Where does the energy go?", energies(input, &results)?),
    ];
    Ok(all.into_iter().filter(|(_, html)| !html.is_empty()).collect())
}

/// Returns a readable form of a name such as `leading_edge` or `patch_3_row_2`.
fn readable(name: &str) -> String {
    match name {
        "mid_chord" => "mid-chord".into(),
        other => other.replace('_', " "),
    }
}

fn clearances(input: &ReportInput<'_>) -> Result<Vec<Captioned>> {
    let mut figures = Vec::new();
    for own in input.capture.angle_clearances() {
        let smallest = PolarCurve {
            label: "smallest clearance of any blade during the run".into(),
            values: own.smallest.iter().map(|gap| 1e6 * gap.max(0.0)).collect(),
        };
        let rest = at_rest(input, &own.name, own.smallest.len())?;
        let curves = rest.into_iter().chain([smallest]).collect();
        let owner = if input.capture.angle_clearances().len() > 1 {
            format!(" of {}", escape(&own.name))
        } else {
            String::new()
        };
        figures.push(Captioned {
            body: Polar { label: "clearance (µm)".into(), curves }.to_html(),
            caption: format!(
                "Clearance{owner} around the casing, seen along the axis. The outer circle is the casing: where the curve \
                 reaches it, a tip touches. Angles are fixed in space."
            ),
        });
        let times = [own.times.first(), own.times.last()].map(|time| 1e3 * time.copied().unwrap_or(0.0));
        let micro = |row: &Vec<f64>| row.iter().map(|gap| 1e6 * gap.max(0.0)).collect();
        let map = GridMap {
            x_label: "time (ms)".into(),
            x_range: times,
            value_label: "clearance (µm)".into(),
            rows: MapRows::Scaled { label: "angle (°)".into(), range: [0.0, 360.0], marks: Vec::new() },
            values: own.over_time.iter().rev().map(micro).collect(),
            shows: Shows::Smallest,
            decades: None,
        };
        figures.push(Captioned {
            body: map.to_html(),
            caption: format!(
                "Smallest clearance{owner} at each angle around the casing over time. The strongest colour marks clearances close to 0."
            ),
        });
    }
    Ok(figures)
}

/// Returns the clearance (µm) of an undeformed blade from a casing with its prescribed shape, without elastic deformation.
fn at_rest(input: &ReportInput<'_>, rotor: &str, count: usize) -> Result<Option<PolarCurve>> {
    let settings = &input.scene.settings;
    let Some(contact) = settings.contacts.iter().find(|contact| contact.master == rotor) else { return Ok(None) };
    let surface = settings.surfaces.iter().find(|surface| surface.name == contact.slave);
    let Some(surface) = surface else { return Ok(None) };
    let shape = CompiledShape::new(&surface.shape, contact.nominal_gap())
        .map_err(|error| Failure::from_core("casing shape", error))?;
    let clearance = |index: usize| {
        let angle = std::f64::consts::TAU * (index as f64 + 0.5) / count as f64;
        1e6 * (contact.nominal_gap() + shape.evaluate(angle).0).max(0.0)
    };
    let label = match surface.shape {
        Shape::Circular {} => "undeformed blade and casing",
        _ => "undeformed blade, casing with its full prescribed shape",
    };
    Ok(Some(PolarCurve { label: label.into(), values: (0..count).map(clearance).collect() }))
}

fn wear(input: &ReportInput<'_>) -> Vec<Captioned> {
    let figure = |map: &tiprub_field::animation::WearMap| {
        let axial = map.axial.map(|z| 1e3 * z);
        let micro = |row: &Vec<f64>| row.iter().map(|depth| 1e6 * depth).collect();
        let picture = GridMap {
            x_label: "angle around the casing (°)".into(),
            x_range: [0.0, 360.0],
            value_label: "wear depth (µm)".into(),
            rows: MapRows::Scaled { label: "axial position (mm)".into(), range: axial, marks: Vec::new() },
            values: map.depth.iter().rev().map(micro).collect(),
            shows: Shows::Largest,
            decades: None,
        };
        let caption = format!("Wear depth of the coating of {} at the end of the run, unrolled.", escape(&map.name));
        Captioned { body: picture.to_html(), caption }
    };
    input.capture.wear().iter().map(figure).collect()
}

fn forces(input: &ReportInput<'_>, results: &Results<'_>, blade: Option<&HitBlade>) -> Result<Vec<Captioned>> {
    let mut figures = Vec::new();
    if let Some(impulses) = input.native.recording.column("normal_impulse") {
        let times = &input.native.recording.times;
        let steps = times.windows(2).zip(impulses.iter().skip(1));
        let points: Vec<(f64, f64)> =
            steps.map(|(ends, impulse)| (1e3 * ends[1], impulse / (ends[1] - ends[0]))).collect();
        if impulses.iter().any(|impulse| *impulse != 0.0) {
            let plot =
                Plot { height: 220, ..Plot::new("time (ms)", "normal force (N)", vec![Series::line("force", points)]) };
            figures.push(Captioned {
                body: plot.to_html()?,
                caption: "Total normal force of all contacts, mean over each communication step.".into(),
            });
        }
    }
    if let Some(blade) = blade.filter(|blade| blade.force > 0.0) {
        let whose = input.blade_name(blade);
        let rows = input.capture.node_forces(blade);
        let times = input.capture.times();
        let body = if rows.is_empty() {
            String::new()
        } else if rows.len() <= MAX_LINES {
            let points =
                |values: &Vec<f64>| times.iter().zip(values).map(|(time, value)| (1e3 * time, *value)).collect();
            let series = rows.iter().map(|(node, values)| Series::line(readable(node), points(values))).collect();
            Plot::new("time (ms)", "normal force (N)", series).to_html()?
        } else {
            let (names, values) = rows.into_iter().map(|(node, values)| (readable(&node), values)).unzip();
            let range = [times.first(), times.last()].map(|time| 1e3 * time.copied().unwrap_or(0.0));
            let map = GridMap {
                x_label: "time (ms)".into(),
                x_range: range,
                value_label: "normal force (N)".into(),
                rows: MapRows::Named(names),
                values,
                shows: Shows::Largest,
                decades: None,
            };
            map.to_html()
        };
        if !body.is_empty() {
            figures.push(Captioned {
                body,
                caption: format!(
                    "Normal force on each contact node of {whose}, which is hit hardest. Values are means over a communication \
                     step; a long run shows the largest of several steps."
                ),
            });
        }
    }
    let torques = torques(input, results);
    if torques.iter().flat_map(|series| &series.points).any(|point| point.1 != 0.0) {
        let rotor = if torques.len() == 1 { "the rotor" } else { "each rotor" };
        let plot = Plot { height: 200, ..Plot::new("time (ms)", format!("torque on {rotor} (N·m)"), torques) };
        figures.push(Captioned {
            body: plot.to_html()?,
            caption: format!(
                "Torque of the contacts on {rotor}, mean over each communication step; negative values brake a rotor that \
                 turns in the positive direction."
            ),
        });
    }
    Ok(figures)
}

/// Returns the contact torque on each rotor over time, labelled with the name of the rotor if there are several.
fn torques(input: &ReportInput<'_>, results: &Results<'_>) -> Vec<Series> {
    let series = |rotor: &StructureSettings| {
        let variable = variable_of(input, rotor, Quantity::Moment(2))?;
        let column = results.recording.column(&variable.name)?;
        let label = if input.rotors().count() > 1 { rotor.name.as_str() } else { "torque" };
        Some(Series::line(label, results.points(&column)))
    };
    input.rotors().filter_map(series).collect()
}

/// Returns the scalar variable of a rotor with this quantity. With several rotors, its name starts with the name of the rotor.
fn variable_of<'a>(input: &ReportInput<'a>, rotor: &StructureSettings, quantity: Quantity) -> Option<&'a Variable> {
    let mut variables = input.table.variables().iter().filter(|variable| variable.quantity == quantity);
    let is_of_rotor = |name: &str| name.rsplit_once('.').is_none_or(|(owner, _)| owner == rotor.name);
    variables.find(|variable| is_of_rotor(&variable.name))
}

/// Returns the smallest and the largest absolute speed of a rotor during the run (rad/s).
fn speeds(input: &ReportInput<'_>, rotor: &StructureSettings) -> Option<[f64; 2]> {
    let name = &variable_of(input, rotor, Quantity::Speed)?.name;
    let driven = input.history.and_then(|history| history.range(name, [input.schedule.start, input.schedule.stop]));
    let [low, high] = driven.or_else(|| {
        let parameter = input.native.parameters.iter().find(|parameter| parameter.name == *name)?;
        let ParameterValue::Real(speed) = parameter.value else { return None };
        Some([speed; 2])
    })?;
    let slowest = if low * high < 0.0 { 0.0 } else { low.abs().min(high.abs()) };
    Some([slowest, low.abs().max(high.abs())])
}

fn vibration(input: &ReportInput<'_>, history: Option<(&HitBlade, &TipHistory)>) -> Result<Vec<Captioned>> {
    let Some((blade, history)) = history else { return Ok(Vec::new()) };
    let spacing = input.capture.spacing();
    let micro: Vec<f64> = history.values.iter().map(|value| 1e6 * value).collect();
    let Some(spectrum) = Spectrum::from_samples(&micro, spacing)? else { return Ok(Vec::new()) };
    let whose = input.blade_name(blade);
    let what = format!("{} displacement of {whose} at its {}", history.direction, escape(&readable(&history.node)));
    let rotor = input.rotors().find(|rotor| rotor.name == blade.name);
    let speeds = rotor.and_then(|rotor| speeds(input, rotor)).filter(|[_, fastest]| *fastest > 0.0);
    let prediction = rotor.and_then(|rotor| {
        predict_frequencies(input, rotor, speeds.map_or(0.0, |[_, fastest]| SPEED_AXIS_FACTOR * fastest))
    });
    let first = input.native.recording.times.first().copied().unwrap_or(0.0);
    let nyquist = 0.5 / spacing;
    let modes = prediction.as_ref().map(|own| own.modes(0, 0.0)).unwrap_or_default();
    let needed = modes.get(MIN_MODES - 1).or(modes.last()).copied().unwrap_or(0.0);
    let peaks = spectrum.peaks();
    let largest = peaks.iter().map(|peak| peak.1).fold(0.0, f64::max);
    let highest = peaks.iter().filter(|peak| peak.1 >= SHOWN_PEAK * largest).map(|peak| peak.0).fold(0.0, f64::max);
    let top = (ABOVE * highest).max(1.15 * needed).clamp(4.0 * spectrum.resolution, nyquist);
    let mut figures = Vec::new();
    if let (Some(prediction), Some(speeds)) = (&prediction, speeds) {
        figures.push(campbell(prediction, speeds, top, &spectrum, &what));
    }
    if let Some(found) = Spectrogram::from_samples(&micro, first, spacing)? {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of frequencies")]
        let count = ((top / found.resolution).ceil() as usize).clamp(2, found.amplitudes[0].len());
        let row = |bin: usize| found.amplitudes.iter().map(|column| column[bin]).collect();
        let marks = modes.iter().filter(|hertz| **hertz < top).zip(1..).take(6);
        let marks = marks.map(|(hertz, number)| (*hertz, format!("mode {number}: {hertz:.0} Hz"))).collect();
        let highest = found.resolution * (count as f64 - 0.5);
        let map = GridMap {
            x_label: "time (ms)".into(),
            x_range: found.times.map(|time| 1e3 * time),
            value_label: "amplitude (µm)".into(),
            rows: MapRows::Scaled { label: "frequency (Hz)".into(), range: [0.0, highest], marks },
            values: (0..count).rev().map(row).collect(),
            shows: Shows::Largest,
            decades: Some(DECADES),
        };
        figures.push(Captioned {
            body: map.to_html(),
            caption: format!(
                "Spectrogram of the {what}. Windows of {:.3} ms distinguish frequencies that are {:.0} Hz apart; values between \
                 them are interpolated. Lines are natural frequencies {} at rest.",
                1e3 * found.window,
                1.0 / found.window,
                if input.scene.roms.iter().any(tiprub_core::Rom::is_cyclic) { "of nodal diameter 0" } else { "of a blade" }
            ),
        });
    }
    Ok(figures)
}

/// Predicts the natural frequencies of a rotor up to a speed (rad/s); `None` if the rotor is not the master of a contact, or if the prediction fails.
fn predict_frequencies(
    input: &ReportInput<'_>,
    rotor: &StructureSettings,
    fastest: f64,
) -> Option<FrequencyPrediction> {
    // The prediction uses the master of the first contact, and the first surface as its casing.
    let mut scene = input.scene.clone();
    let settings = &mut scene.settings;
    settings.contacts.sort_by_key(|contact| contact.master != rotor.name);
    let casing = settings.contacts.first().filter(|contact| contact.master == rotor.name)?.slave.clone();
    settings.surfaces.sort_by_key(|surface| surface.name != casing);
    FrequencyPrediction::with_settings(&scene, input.settings, fastest).ok()
}

fn campbell(
    prediction: &FrequencyPrediction,
    speeds: [f64; 2],
    top: f64,
    spectrum: &Spectrum,
    what: &str,
) -> Captioned {
    let [slowest, fastest] = speeds;
    let last = SPEED_AXIS_FACTOR * fastest;
    let grid: Vec<f64> = (0..=12).map(|index| last * f64::from(index) / 12.0).collect();
    let columns: Vec<Vec<f64>> = grid.iter().map(|speed| prediction.lines(*speed)).collect();
    let lines = (0..columns[0].len()).filter(|mode| (0.0..top).contains(&columns[0][*mode]) && columns[0][*mode] > 0.0);
    let modes =
        lines.take(MAX_MODES).map(|mode| grid.iter().zip(&columns).map(|(x, column)| (*x, column[mode])).collect());
    let hertz = |order: usize| order as f64 * fastest / std::f64::consts::TAU;
    let orders = (1..=MAX_ORDERS).take_while(|order| hertz(*order) <= top);
    let response: Vec<(f64, f64)> =
        spectrum.amplitudes.iter().enumerate().map(|(bin, value)| (bin as f64 * spectrum.resolution, *value)).collect();
    let peaks: Vec<(f64, f64)> = spectrum.peaks().into_iter().filter(|peak| peak.0 <= top).collect();
    let strongest = peaks.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
    let strongest = strongest.map_or(String::new(), |(found, amplitude)| {
        let order = if slowest < fastest {
            String::new()
        } else {
            format!(" ({:.2} times the rotational frequency)", found * std::f64::consts::TAU / fastest)
        };
        format!(" The largest amplitude, {} µm, is at {found:.0} Hz{order}.", rounded(amplitude))
    });
    let marks = if slowest < fastest {
        let [slowest, fastest] = speeds.map(rounded);
        format!(
            "and peaks of the run over its range of speeds, {slowest} rad/s to {fastest} rad/s (horizontal bars). The speed \
             varied, so the peaks belong to no single speed"
        )
    } else {
        "and peaks of the run at its speed (circles)".to_owned()
    };
    let campbell = Campbell {
        speeds,
        top,
        modes: modes.collect(),
        orders: orders.map(|order| (order, prediction.excites(order))).collect(),
        response,
        peaks,
        response_label: "amplitude (µm)".into(),
    };
    Captioned {
        body: campbell.to_html(),
        caption: format!(
            "Campbell diagram with the response to the rub. Left: natural frequencies (solid), engine orders (dotted; numbered \
             and drawn stronger if the casing excites them), {marks}. Right: amplitude of the {what} over the whole run.{strongest}"
        ),
    }
}

fn energies(input: &ReportInput<'_>, results: &Results<'_>) -> Result<Vec<Captioned>> {
    let mut figures = Vec::new();
    let works =
        if input.rotors().next().is_some() { "External work of the drive and the casing" } else { "External work" };
    let exchange = format!(
        "{works}, and friction heat, since the start. Their difference is the vibration energy and the losses to damping and \
         impacts."
    );
    let vibration = [
        ("kinetic", Quantity::KineticEnergy),
        ("strain", Quantity::StrainEnergy),
        ("damping loss", Quantity::DampingLoss),
        ("impact loss", Quantity::ImpactLoss),
    ];
    let exchanged = [("external work", Quantity::ExternalWork), ("friction heat", Quantity::FrictionLoss)];
    for (list, caption) in [
        (
            &vibration[..],
            "Vibration energy of all structures, and the energy dissipated by damping and impacts since the start.",
        ),
        (&exchanged[..], exchange.as_str()),
    ] {
        let series = list.iter().filter_map(|(label, quantity)| results.series(label, *quantity));
        let series: Vec<Series> = series.filter(|series| series.points.iter().any(|point| point.1 != 0.0)).collect();
        if !series.is_empty() {
            let plot = Plot { height: 220, ..Plot::new("time (ms)", "energy (J)", series) };
            figures.push(Captioned { body: plot.to_html()?, caption: caption.into() });
        }
    }
    Ok(figures)
}
