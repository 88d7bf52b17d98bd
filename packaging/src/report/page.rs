//! Page around the figures: header, key figures, tables, links.

use std::fmt::Write as _;

use tiprub_core::scene::settings::SceneSettings;
use tiprub_cosim::variables::Quantity;
use tiprub_figure::{STYLE, escape};
use tiprub_shell::Result;
use tiprub_study::estimate;

use super::input::{ReportFile, ReportInput};
use super::sections::{Results, figures};
use crate::rom_facts::{CheckRow, OmittedRows, ROWS_SHOWN, RomFacts, not_negative_zero, order_text, sectors_text};

/// Renders the whole page.
///
/// # Errors
/// A plot cannot be drawn.
pub fn render(input: &ReportInput<'_>) -> Result<String> {
    let title = escape(&input.scene.settings.name);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title} - tiprub report</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n"
    );
    page.push_str(&header(input));
    let mut figures = figures(input)?.into_iter();
    if let Some((title, html)) = figures.next() {
        let _ = writeln!(page, "<section><h2>{title}</h2>{html}</section>");
    }
    page.push_str(&rom_section(input.facts));
    for (title, html) in figures.filter(|(_, html)| !html.is_empty()) {
        let _ = writeln!(page, "<section><h2>{title}</h2>{html}</section>");
    }
    page.push_str(&run_section(input));
    page.push_str(&agreement_section(input));
    page.push_str(&scene_section(input));
    page.push_str(&files_section(input.files));
    let _ = write!(page, "<footer>tiprub {}</footer>\n</main>\n</body>\n</html>\n", env!("CARGO_PKG_VERSION"));
    Ok(page)
}

fn header(input: &ReportInput<'_>) -> String {
    let settings = &input.scene.settings;
    let results = Results::new(input.table, &input.native.recording);
    let stepping = input.native.stepping.as_secs_f64();
    let simulated = input.schedule.stop - input.schedule.start;
    let per_step = 1e6 * stepping / input.native.internal_steps as f64;
    let exact = input.imported.iter().all(|run| run.agreement.is_exact());
    let mut cards = vec![
        ("simulated".into(), format!("{} ms", rounded(1e3 * simulated)), revolutions(&results)),
        (
            "computing time per simulated second".into(),
            format!("{} s", rounded(stepping / simulated)),
            "stepping only, on one core".to_string(),
        ),
        ("per internal step".into(), format!("{} µs", rounded(per_step)), step_of(settings).into()),
    ];
    if let Some((_, peak)) = results.extremes(Quantity::NormalForcePeak) {
        cards.push((
            "largest contact force".into(),
            format!("{} N", rounded(peak)),
            "one node, one internal step".into(),
        ));
    }
    if let Some((low, high)) = results.extremes(Quantity::EnergyResidualRelative) {
        cards.push(("energy residual".into(), scientific(low.abs().max(high.abs())), "relative, largest".into()));
    }
    if !input.imported.is_empty() {
        let labels: Vec<&str> = input.imported.iter().map(|run| run.label.as_str()).collect();
        let verdict = if exact { "bit for bit" } else { "different" };
        cards.push(("agreement".into(), verdict.into(), format!("{} and native", labels.join(", "))));
    }
    let mut html = format!("<header><h1>{}</h1><p>{}</p>", escape(&settings.name), escape(&settings.description));
    html.push_str("<div class=\"cards\">");
    for (label, value, note) in cards {
        let label: String = label;
        let _ = write!(html, "<div><span>{label}</span><b>{value}</b><small>{note}</small></div>");
    }
    html.push_str("</div></header>\n");
    html
}

fn revolutions(results: &Results<'_>) -> String {
    let turned = results.column(Quantity::RotorAngle).and_then(|angles| Some(angles.last()? - angles.first()?));
    turned.map_or_else(String::new, |angle| format!("{} revolutions", rounded(angle / std::f64::consts::TAU)))
}

fn rom_section(facts: &[RomFacts]) -> String {
    let mut html = String::from("<section><h2>Reduced-order model</h2>");
    for fact in facts {
        let rom = &fact.rom;
        let _ = write!(html, "<p>{}.</p>", escape(rom.origin.trim_end_matches('.')));
        let nodes: Vec<&str> = rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
        let steps: Vec<String> =
            fact.step_limits.iter().map(|limit| format!("{} {}", limit.scheme, escape(&limit.to_text()))).collect();
        let friction = fact.solvable_friction.map_or("-".into(), |value| format!("{value}"));
        html.push_str(&table(&[
            ("sectors", sectors_text(rom)),
            ("reduced coordinates", order_text(rom)),
            ("contact nodes", escape(&nodes.join(", "))),
            (
                "largest angular frequency ω<sub>max</sub>",
                format!("{} rad/s", scientific(fact.largest_angular_frequency)),
            ),
            ("all internal steps accepted below", format!("{}: {}", fact.steps_hold_for(), steps.join("; "))),
            (
                "all modes resolved up to",
                format!("{} s (2/ω<sub>max</sub>)", scientific(fact.central_difference_limit)),
            ),
            ("contact problem solvable up to µ", format!("{friction} (all nodes closed; tried up to 2)")),
            ("locks up above µ*", escape(&fact.lock_up_text())),
        ]));
        html.push_str(&checks_table(&fact.checks()));
    }
    html.push_str("</section>\n");
    html
}

fn checks_table(checks: &[CheckRow]) -> String {
    if checks.is_empty() {
        return "<p>This ROM contains no checks.</p>".into();
    }
    let coupled = checks[0].nodal_diameter.is_some();
    let mut html = format!(
        "<table class=\"numbers\"><thead><tr><th>mode</th>{}<th>full model (Hz)</th><th>reduced (Hz)</th>\
         <th>frequency deviation, eq. 13 (%)</th><th>residual criterion, eq. 12 (%)</th></tr></thead><tbody>",
        if coupled { "<th>nodal diameter</th>" } else { "" }
    );
    for (row, mode) in checks.iter().zip(1..).take(ROWS_SHOWN) {
        let number = row.nodal_diameter.map_or(String::new(), |number| format!("<td>{number}</td>"));
        let _ = write!(
            html,
            "<tr><td>{mode}</td>{number}<td>{:.3}</td><td>{:.3}</td><td>{:.5}</td><td>{:.5}</td></tr>",
            row.full,
            row.reduced,
            not_negative_zero(row.deviation),
            not_negative_zero(row.residual)
        );
    }
    html.push_str("</tbody></table>");
    if let Some(rest) = OmittedRows::of(checks, ROWS_SHOWN) {
        let _ = write!(
            html,
            "<p>{} more modes up to {:.1} Hz: deviation at most {:.5} %, residual at most {:.5} %.</p>",
            rest.count,
            rest.frequency,
            not_negative_zero(rest.deviation),
            not_negative_zero(rest.residual)
        );
    }
    html
}

fn run_section(input: &ReportInput<'_>) -> String {
    let (native, schedule) = (input.native, input.schedule);
    let stepping = native.stepping.as_secs_f64();
    let simulated = schedule.stop - schedule.start;
    let results = Results::new(input.table, &native.recording);
    let mut rows = vec![
        ("communication steps", format!("{} of H = {} s", schedule.count, scientific(schedule.step))),
        ("internal steps", native.internal_steps.to_string()),
        ("stepping time", format!("{} s", rounded(stepping))),
        ("computing time per internal step", format!("{} µs", rounded(1e6 * stepping / native.internal_steps as f64))),
        ("computing time per simulated second", format!("{} s", rounded(stepping / simulated))),
    ];
    let settings = &input.scene.settings;
    if let Some(tolerance) = settings.time.step_tolerance() {
        rows.insert(2, ("adaptive steps", format!("tolerance {} of the clearance", scientific(tolerance))));
    } else if let Some(step) = results.last(Quantity::InternalStep) {
        rows.insert(2, ("internal step h", format!("{} s", scientific(step))));
    }
    let energies = [
        ("friction loss", Quantity::FrictionLoss),
        ("damping loss", Quantity::DampingLoss),
        ("impact loss", Quantity::ImpactLoss),
        ("external work", Quantity::ExternalWork),
    ];
    for (label, quantity) in energies {
        if let Some(value) = results.last(quantity) {
            rows.push((label, format!("{} J", rounded(value))));
        }
    }
    let mut html = format!("<section><h2>The run</h2>{}", table(&rows));
    for warning in &native.warnings {
        let [problem, remedy] = warning.lines();
        let (word, id) = (warning.level().name(), warning.topic().id());
        let _ = write!(html, "<p class=\"warning\"><b>{word} [{id}]</b> {}<br>{}</p>", escape(problem), escape(remedy));
    }
    if !input.estimates.is_empty() {
        let _ = write!(html, "<p>{}.</p>", escape(&estimate::errors_text(input.estimates)));
    }
    html.push_str(&paper_part(input, &results));
    html.push_str("<h3>Wall times</h3>");
    let durations: Vec<(&str, String)> =
        input.durations.iter().map(|(what, seconds)| (what.as_str(), format!("{} s", rounded(*seconds)))).collect();
    html.push_str(&table(&durations));
    html.push_str("</section>\n");
    html
}

/// Describes the motion in an internal step of a scene.
fn step_of(settings: &SceneSettings) -> &'static str {
    if settings.time.scheme.properties().adaptive { "one blade, native" } else { "whole disk, native" }
}

/// Compares both models and methods at the end of the same run.
fn paper_part(input: &ReportInput<'_>, own: &Results<'_>) -> String {
    let Some((table, run)) = input.paper else { return String::new() };
    let paper = Results::new(table, &run.recording);
    let mut html = String::from(
        "<h3>Comparison with the paper's model and method</h3><p>The same rub with <code>preset = \"paper\"</code>: \
         Craig-Bampton modes, three contact nodes, central differences, the film of eq. 11. Three points do \
         not resolve the tip.</p>\
         <table class=\"numbers\"><thead><tr><th>at the end</th><th>this run</th><th>the paper's</th></tr></thead><tbody>",
    );
    for (label, quantity) in
        [("strain energy (J)", Quantity::StrainEnergy), ("friction loss (J)", Quantity::FrictionLoss)]
    {
        let [own, paper] = [own, &paper].map(|results| results.last(quantity).map_or("-".into(), rounded));
        let _ = write!(html, "<tr><td>{label}</td><td>{own}</td><td>{paper}</td></tr>");
    }
    let times = [input.native, run].map(|run| rounded(1e6 * run.stepping.as_secs_f64() / run.internal_steps as f64));
    let simulated = input.schedule.stop - input.schedule.start;
    let rates = [input.native, run].map(|run| rounded(run.stepping.as_secs_f64() / simulated));
    let _ = write!(
        html,
        "<tr><td>computing time per simulated second (s)</td><td>{}</td><td>{}</td></tr>\
         <tr><td>computing time per internal step (µs)</td><td>{} ({})</td><td>{} (whole disk)</td></tr>",
        rates[0],
        rates[1],
        times[0],
        step_of(&input.scene.settings).trim_end_matches(", native"),
        times[1]
    );
    html.push_str("</tbody></table>");
    html
}

fn agreement_section(input: &ReportInput<'_>) -> String {
    if input.imported.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<section><h2>FMU against native run</h2><p>Each FMU was unzipped, loaded and driven through its C interface as an \
         importer does, with the same communication points as the native run.</p>\
         <table class=\"numbers\"><thead><tr><th>run</th><th>communication points</th><th>outputs</th>\
         <th>values that differ in any bit</th><th>largest difference</th><th>time in doStep (s)</th></tr></thead><tbody>",
    );
    let _ = write!(
        html,
        "<tr><td>native</td><td>{}</td><td>{}</td><td>-</td><td>-</td><td>{}</td></tr>",
        input.native.recording.rows(),
        input.native.recording.names.len(),
        rounded(input.native.stepping.as_secs_f64())
    );
    for run in input.imported {
        let agreement = &run.agreement;
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&run.label),
            agreement.points,
            agreement.variables,
            agreement.different,
            agreement.largest,
            rounded(run.stepping)
        );
    }
    html.push_str("</tbody></table></section>\n");
    html
}

fn scene_section(input: &ReportInput<'_>) -> String {
    format!(
        "<section><h2>Scene</h2><details><summary>All settings, defaults included</summary><pre>{}</pre></details></section>\n",
        escape(&tiprub_format::write_scene(&input.scene.settings))
    )
}

fn files_section(files: &[ReportFile]) -> String {
    let mut html = String::from("<section><h2>Files</h2><table><tbody>");
    for file in files {
        let _ = write!(
            html,
            "<tr><th><a href=\"{0}\">{0}</a></th><td>{1}</td><td class=\"size\">{2:.1} kB</td></tr>",
            escape(&file.name),
            escape(&file.meaning),
            file.bytes as f64 / 1e3
        );
    }
    html.push_str("</tbody></table></section>\n");
    html
}

/// Returns a table of names and values; values are HTML.
fn table(rows: &[(&str, String)]) -> String {
    let mut html = String::from("<table><tbody>");
    for (name, value) in rows {
        let _ = write!(html, "<tr><th>{name}</th><td>{value}</td></tr>");
    }
    html.push_str("</tbody></table>");
    html
}

/// Formats a value with three significant digits.
fn rounded(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if !(1e-3..1e6).contains(&value.abs()) {
        return scientific(value);
    }
    let (mut digits, mut magnitude) = (2_usize, value.abs());
    while magnitude >= 10.0 && digits > 0 {
        magnitude /= 10.0;
        digits -= 1;
    }
    while magnitude < 1.0 {
        magnitude *= 10.0;
        digits += 1;
    }
    format!("{value:.digits$}")
}

/// Formats a value with at most four significant digits; powers of ten are written out.
fn scientific(value: f64) -> String {
    let text = format!("{value:.3e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
            let power = format!("·10<sup>{}</sup>", exponent.replace('-', "−"));
            format!("{mantissa}{}", if exponent == "0" { "" } else { &power })
        }
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!([1234.5, 0.01234, 9.876, 0.0, 123.4].map(rounded), ["1234", "0.0123", "9.88", "0", "123"]);
        assert_eq!(scientific(1.234567e-7), "1.235·10<sup>−7</sup>");
        assert_eq!(format!("{:.5}", not_negative_zero(-1e-9)), "0.00000");
        assert_eq!(scientific(2.0), "2");
        assert_eq!(scientific(1e-5), "1·10<sup>−5</sup>");
    }

    #[test]
    fn text_is_escaped_in_the_page() {
        assert_eq!(escape("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    }
}
