//! Documentation page inside the FMU: `documentation/index.html`.

use std::fmt::Write as _;

use quick_xml::escape::escape;
use tiprub_core::Rom;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_cosim::variables::{Causality, DataType, Span, StartValue, Variable};

use crate::Description;
use crate::row::{meaning_of_span, rows, variability};
use crate::text::{clean, readable};

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:72em;margin:2em auto;padding:0 1em;\
color:#1c2430;background:#fff}h1,h2,h3{line-height:1.2;margin:1.6em 0 .5em}h1{margin-top:0}\
table{border-collapse:collapse;width:100%;margin:.5em 0 1.5em;font-size:.9em}\
th,td{text-align:left;vertical-align:top;padding:.35em .6em;border-bottom:1px solid #dfe4ea}\
th{background:#f3f5f8;position:sticky;top:0}td.number,th.number{text-align:right;font-variant-numeric:tabular-nums}\
code{font-size:.95em;background:#f3f5f8;padding:0 .2em;border-radius:3px}td:first-child{white-space:nowrap}\
dt{font-weight:600}dd{margin:0 0 .5em 1.5em}.warning{border-left:4px solid #c77700;padding-left:.8em}\
footer{margin-top:3em;color:#5a6675;font-size:.85em}";

/// Returns the page: the model, every variable, the relation of values to the step, limits, and the checks of the ROMs. It is self-contained and
/// opens without a network.
pub fn html(description: &Description) -> String {
    let mut page = String::new();
    let title = text(description.model_name);
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
    );
    model(&mut page, description);
    time(&mut page, description);
    variables(&mut page, description);
    list(&mut page, "Features of this scene", &description.features, "");
    list(&mut page, "Limits", &description.limits, "");
    list(&mut page, "Warnings", &description.warnings, " class=\"warning\"");
    structures(&mut page, description);
    footer(&mut page, description);
    page.push_str("</body>\n</html>\n");
    page
}

fn text(raw: &str) -> String {
    escape(clean(raw)).into_owned()
}

fn model(page: &mut String, description: &Description) {
    if !description.description.is_empty() {
        let _ = writeln!(page, "<p>{}</p>", text(description.description));
    }
    let _ = writeln!(page, "<p>{}</p>", text(description.about));
}

fn time(page: &mut String, description: &Description) {
    let experiment = &description.experiment;
    let _ = writeln!(
        page,
        "<h2>Running the FMU</h2>\n<p>Proposed experiment: from {} s to {} s with a communication step of {} s. Any \
         other step size works, including a varying one.</p>\n\
         <p>{} The column &#8220;value&#8221; \
         of the tables shows which of these applies:</p>\n<dl>",
        readable(experiment.start),
        readable(experiment.stop),
        readable(experiment.step),
        text(description.steps),
    );
    for span in [Span::Point, Span::Mean, Span::Window, Span::Total] {
        let (name, meaning) = meaning_of_span(span);
        let _ = writeln!(page, "<dt>{name}</dt><dd>{}</dd>", text(meaning));
    }
    page.push_str(
        "</dl>\n<p>Inputs are held over a step, or change linearly where the importer gives their derivatives or \
         intermediate values.</p>\n",
    );
}

fn variables(page: &mut String, description: &Description) {
    page.push_str("<h2>Variables</h2>\n<p>All values are in SI units; a common display unit is given in brackets. ");
    page.push_str("In FMI 2.0, each element of an array is a scalar; elements are numbered from 1.</p>\n");
    for (heading, causality) in [
        ("Inputs", Causality::Input),
        ("Parameters", Causality::Parameter),
        ("Outputs", Causality::Output),
        ("Local variables", Causality::Local),
        ("Independent variable", Causality::Independent),
    ] {
        let of_kind = |variable: &&Variable| variable.causality == causality;
        let mut chosen = description.table.variables().iter().filter(of_kind).peekable();
        if chosen.peek().is_none() {
            continue;
        }
        let _ = writeln!(
            page,
            "<h3>{heading}</h3>\n<table>\n<thead><tr><th>Name</th><th>Unit</th><th>Variability</th><th>Value</th>\
             <th>Range</th><th>Start</th><th>Description</th></tr></thead>\n<tbody>"
        );
        for variable in chosen {
            variable_row(page, variable);
        }
        page.push_str("</tbody>\n</table>\n");
    }
}

fn variable_row(page: &mut String, variable: &Variable) {
    let settable = variable.is_settable() || variable.causality == Causality::Independent;
    let span = if settable { "set" } else { meaning_of_span(variable.span).0 };
    let span = if variable.causality == Causality::Independent { "point" } else { span };
    let _ = writeln!(
        page,
        "<tr><td><code>{}</code></td><td>{}</td><td>{}</td><td>{span}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
        text(&array_name(variable)),
        text(&unit(variable)),
        variability(variable.variability),
        text(&range(variable)),
        text(&start(variable)),
        text(&variable.description),
    );
}

/// Returns `name`, or `name[1..n]`.
pub(crate) fn array_name(variable: &Variable) -> String {
    variable.dimension.map_or_else(|| variable.name.clone(), |size| format!("{}[1..{size}]", variable.name))
}

/// Returns the unit with the display unit in brackets, or the data type of variables without unit.
pub(crate) fn unit(variable: &Variable) -> String {
    match (variable.kind, variable.unit) {
        (DataType::Integer, _) => "whole number".into(),
        (DataType::Boolean, _) => "true or false".into(),
        (DataType::String, _) => "text".into(),
        (DataType::Enumeration(_), _) => "choice".into(),
        (DataType::Real, None) => "-".into(),
        (DataType::Real, Some(unit)) => match variable.display.and_then(|index| unit.display.get(index)) {
            Some((display, _)) => format!("{} ({display})", unit.name),
            None => unit.name.into(),
        },
    }
}

/// Describes the valid values.
pub(crate) fn range(variable: &Variable) -> String {
    if let DataType::Enumeration(enumeration) = variable.kind {
        let item = |(index, (name, _)): (usize, &(&str, &str))| format!("{} = {name}", index + 1);
        return enumeration.items.iter().enumerate().map(item).collect::<Vec<_>>().join(", ");
    }
    match (variable.min, variable.max) {
        (None, None) => String::new(),
        (Some(min), None) => format!("≥ {}", readable(min)),
        (None, Some(max)) => format!("≤ {}", readable(max)),
        (Some(min), Some(max)) => format!("{} to {}", readable(min), readable(max)),
    }
}

/// Returns the start value; for arrays the common value, or the first and the last.
pub(crate) fn start(variable: &Variable) -> String {
    match &variable.start {
        None => String::new(),
        Some(StartValue::Real(values)) => match values.as_slice() {
            [] => String::new(),
            [first, rest @ ..] if rest.iter().all(|value| value.to_bits() == first.to_bits()) => readable(*first),
            [first, .., last] => format!("{}, ..., {}", readable(*first), readable(*last)),
            [only] => readable(*only),
        },
        Some(StartValue::Integer(value)) => value.to_string(),
        Some(StartValue::Boolean(value)) => value.to_string(),
        Some(StartValue::String(value)) => value.clone(),
    }
}

fn list(page: &mut String, heading: &str, sentences: &[String], class: &str) {
    if sentences.is_empty() {
        return;
    }
    let _ = writeln!(page, "<h2>{heading}</h2>\n<ul{class}>");
    for sentence in sentences {
        let _ = writeln!(page, "<li>{}</li>", text(sentence));
    }
    page.push_str("</ul>\n");
}

fn structures(page: &mut String, description: &Description) {
    if !description.structures.is_empty() {
        page.push_str("<h2>Reduced-order models</h2>\n");
    }
    for (name, rom) in &description.structures {
        structure(page, name, rom);
    }
}

fn structure(page: &mut String, name: &str, rom: &Rom) {
    let frame = match rom.frame {
        DisplacementFrame::Cylindrical => "radial, tangential, axial",
        DisplacementFrame::Cartesian => "x, y, z",
    };
    let nodes = match rom.extras.grid {
        Some(grid) => format!("a grid of {} around the circumference and {} along the axis", grid.around, grid.along),
        None => rom.contact_nodes.iter().map(|node| node.name.as_str()).collect::<Vec<_>>().join(", "),
    };
    let _ = writeln!(
        page,
        "<h3>{}</h3>\n<p>{}</p>\n<p>{}; contact nodes per sector: {} \
         (components {frame}); modal damping ratio proposed by the model: {}.</p>",
        text(name),
        text(&rom.origin),
        size(rom),
        text(&nodes),
        readable(rom.damping_ratio),
    );
    extras(page, rom);
    checks(page, rom);
}

/// Writes spin matrices and thermal loads if the model has them.
fn extras(page: &mut String, rom: &Rom) {
    if let Some(spin) = &rom.extras.spin {
        let speed = readable(spin.largest_speed);
        let _ = writeln!(page, "<p>Effects of spin fitted for speeds up to {speed} rad/s.</p>");
    }
    if let Some(thermal) = &rom.extras.thermal {
        page.push_str(
            "<table>\n<thead><tr><th class=\"number\">Heated patch</th><th class=\"number\">Angles (deg)</th>\
             <th class=\"number\">Axial position (m)</th></tr></thead>\n<tbody>\n",
        );
        for (index, patch) in thermal.patches.iter().enumerate() {
            let [from, to] = patch.angle.map(|angle| significant(angle.to_degrees()));
            let [low, high] = patch.axial.map(significant);
            let _ = writeln!(
                page,
                "<tr><td class=\"number\">{}</td><td class=\"number\">{from} to {to}</td>\
                 <td class=\"number\">{low} to {high}</td></tr>",
                index + 1
            );
        }
        page.push_str("</tbody>\n</table>\n");
    }
}

/// Describes sectors and reduced coordinates.
fn size(rom: &Rom) -> String {
    if rom.is_cyclic() {
        let (sectors, largest, order) = (rom.sectors, rom.largest_nodal_diameter(), rom.total_order());
        return format!(
            "{sectors} coupled sectors, nodal diameters 0 to {largest}, {order} reduced coordinates in total"
        );
    }
    let plural = if rom.sectors == 1 { "" } else { "s" };
    format!("{} sector{plural} with {} reduced coordinates each", rom.sectors, rom.order())
}

/// Largest number of listed modes; coupled sectors may have hundreds.
const CHECKS_SHOWN: usize = 40;

fn checks(page: &mut String, rom: &Rom) {
    let columns: Vec<(&str, &[f64])> = [
        ("Full model (Hz)", rom.checks.full_frequencies.as_slice()),
        ("Reduced model (Hz)", rom.checks.reduced_frequencies.as_slice()),
        ("Frequency deviation (%)", rom.checks.frequency_deviation.as_slice()),
        ("Residual criterion (%)", rom.checks.residual_criterion.as_slice()),
    ]
    .into_iter()
    .filter(|(_, values)| !values.is_empty())
    .collect();
    let modes = columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let numbers = &rom.checks.nodal_diameters;
    if modes == 0 {
        page.push_str("<p>The ROM contains no checks of the reduction.</p>\n");
        return;
    }
    page.push_str("<table>\n<thead><tr><th class=\"number\">Mode</th>");
    if !numbers.is_empty() {
        page.push_str("<th class=\"number\">Nodal diameter</th>");
    }
    for (heading, _) in &columns {
        let _ = write!(page, "<th class=\"number\">{heading}</th>");
    }
    page.push_str("</tr></thead>\n<tbody>\n");
    for mode in 0..modes.min(CHECKS_SHOWN) {
        let _ = write!(page, "<tr><td class=\"number\">{}</td>", mode + 1);
        if let Some(number) = numbers.get(mode) {
            let _ = write!(page, "<td class=\"number\">{number}</td>");
        }
        for (_, values) in &columns {
            let value = values.get(mode).map_or_else(|| "-".into(), |value| significant(*value));
            let _ = write!(page, "<td class=\"number\">{value}</td>");
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody>\n</table>\n");
    if modes > CHECKS_SHOWN {
        let _ = writeln!(page, "<p>{} more modes were checked; the ROM file lists them.</p>", modes - CHECKS_SHOWN);
    }
}

/// Formats a value with six significant digits.
fn significant(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude != 0.0 && !(1e-3..1e6).contains(&magnitude) {
        return format!("{value:.3e}");
    }
    let decimals = [10.0, 100.0, 1e3, 1e4, 1e5].iter().filter(|limit| magnitude >= **limit).count();
    format!("{value:.*}", 5 - decimals)
}

fn footer(page: &mut String, description: &Description) {
    let scalars = rows(description.table, false).len();
    let _ = writeln!(
        page,
        "<footer>\n<p>{} scalar variables. Instantiation token <code>{}</code>. {} {}</p>\n<p>{}, {}. {} {}</p>\n</footer>",
        scalars,
        text(description.token),
        text(description.version),
        text(description.author),
        text(description.generation_tool),
        text(description.generated),
        text(description.copyright),
        text(description.license),
    );
}
