//! Details below the figures: reduced-order models, the run, agreement of FMUs, scene and files.

use std::fmt::Write as _;

use tiprub_cosim::variables::Quantity;
use tiprub_figure::escape;
use tiprub_shell::extremes::six_digits;
use tiprub_study::estimate;

use super::figures::Results;
use super::input::{ReportFile, ReportInput};
use super::numbers::{rounded, scientific};
use crate::rom_facts::{CheckRow, OmittedRows, ROWS_SHOWN, RomFacts, not_negative_zero, order_text, sectors_text};

/// Maximum number of inputs over time that are listed.
const MAX_INPUTS: usize = 24;

/// Returns the section about the reduced-order models; empty without facts about them.
pub(super) fn rom_section(facts: &[RomFacts]) -> String {
    if facts.is_empty() {
        return String::new();
    }
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

/// Returns the section about the run, with its warnings and computing times.
pub(super) fn run_section(input: &ReportInput<'_>) -> String {
    let (native, schedule) = (input.native, input.schedule);
    let stepping = native.stepping.as_secs_f64();
    let simulated = schedule.stop - schedule.start;
    let results = Results::new(input.table, &native.recording);
    let mut rows = vec![
        ("communication steps", format!("{} of H = {} s", schedule.count, scientific(schedule.step))),
        ("internal steps", native.internal_steps.to_string()),
        ("stepping time", format!("{} s", rounded(stepping))),
        ("computing time per simulated second", format!("{} s", rounded(stepping / simulated))),
    ];
    if native.internal_steps > 0 {
        let per_step = 1e6 * stepping / native.internal_steps as f64;
        rows.insert(3, ("computing time per internal step", format!("{} µs", rounded(per_step))));
    }
    let time = estimate::time_in_use(&input.scene.settings, input.settings);
    if let Some(tolerance) = time.step_tolerance() {
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
    if let Some(column) = results.column(Quantity::EnergyResidualRelative) {
        let largest = column.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        rows.push(("largest energy residual, relative", scientific(largest)));
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
    if !input.durations.is_empty() {
        html.push_str("<h3>Wall times</h3>");
        let durations: Vec<(&str, String)> =
            input.durations.iter().map(|(what, seconds)| (what.as_str(), format!("{} s", rounded(*seconds)))).collect();
        html.push_str(&table(&durations));
    }
    html.push_str("</section>\n");
    html
}

/// Returns the section that compares FMUs with the native run; empty without imported runs.
pub(super) fn agreement_section(input: &ReportInput<'_>) -> String {
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

/// Returns the section with all settings of the scene.
pub(super) fn scene_section(input: &ReportInput<'_>) -> String {
    let replaced: Vec<String> = input
        .settings
        .iter()
        .map(|(name, value)| format!("<code>{} = {}</code>", escape(name), escape(value)))
        .collect();
    let start_values = match &replaced[..] {
        [] => String::new(),
        values => format!(" In this run, start values replace settings of the scene: {}.", values.join(", ")),
    };
    let inputs_over_time = input.history.map_or(String::new(), |history| {
        let names = history.variables();
        let mut listed: Vec<String> =
            names.iter().take(MAX_INPUTS).map(|name| format!("<code>{}</code>", escape(name))).collect();
        if names.len() > MAX_INPUTS {
            listed.push(format!("and {} more", names.len() - MAX_INPUTS));
        }
        format!(" Inputs over time come from the file <code>{}</code>: {}.", escape(history.name()), listed.join(", "))
    });
    let schedule = input.schedule;
    format!(
        "<section><h2>Scene</h2><p>The run is from {} s to {} s, with communication steps of {} s.{start_values}{inputs_over_time}</p>\
         <details><summary>All settings of the scene, defaults included</summary><pre>{}</pre></details></section>\n",
        six_digits(schedule.start),
        six_digits(schedule.stop),
        six_digits(schedule.step),
        escape(&tiprub_format::write_scene(&input.scene.settings))
    )
}

/// Returns the section with the files beside the report; empty without files.
pub(super) fn files_section(files: &[ReportFile]) -> String {
    if files.is_empty() {
        return String::new();
    }
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
