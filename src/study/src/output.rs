//! Writes a study as files: one HTML page, an SVG and a CSV per figure, `results.json`, and further files of the study.

use std::{fmt::Write as _, path::Path};

use tiprub_figure::{STYLE, escape};
use tiprub_shell::{Result, console::CommandOutcome, output_file};

use super::Study;

/// File name of the page.
pub const PAGE: &str = "index.html";
/// File name of the facts, statements and results in JSON.
pub const RESULTS: &str = "results.json";

/// Writes all files into `directory` and returns a summary.
///
/// # Errors
/// A file cannot be written.
pub fn write(study: &Study, directory: &Path) -> Result<CommandOutcome> {
    output_file::create_directory(directory)?;
    for figure in &study.figures {
        output_file::write(&directory.join(format!("{}.svg", figure.name)), &figure.picture.svg)?;
        output_file::write(&directory.join(format!("{}.csv", figure.name)), figure.sheet.to_csv())?;
    }
    for (name, _, bytes) in &study.files {
        output_file::write(&directory.join(name), bytes)?;
    }
    let mut json = study.to_json();
    output_file::write(&directory.join(RESULTS), format!("{json:#}\n"))?;
    output_file::write(&directory.join(PAGE), page(study))?;
    json["page"] = directory.join(PAGE).display().to_string().into();
    let text = format!("{}\nopen {}", study.to_text(), directory.join(PAGE).display());
    Ok(CommandOutcome { text, json, ..CommandOutcome::default() })
}

fn page(study: &Study) -> String {
    let title = escape(&study.title);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title} - tiprub study</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <header><h1>{title}</h1><p>{}</p></header>\n",
        escape(&study.summary)
    );
    page.push_str("<section><h2>Expected results</h2><table><thead><tr><th>expected</th><th>confirmed</th><th>found</th></tr></thead><tbody>");
    for statement in &study.statements {
        let _ = write!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&statement.expected),
            statement.verdict(),
            escape(&statement.found)
        );
    }
    page.push_str("</tbody></table></section>\n<section><h2>Figures</h2>");
    for (figure, number) in study.figures.iter().zip(1..) {
        let _ = writeln!(
            page,
            "<figure>{}<figcaption><b>Figure {number}.</b> {} <a href=\"{2}.csv\">numbers</a>, <a href=\"{2}.svg\">picture</a></figcaption></figure>",
            figure.picture.html,
            escape(&figure.caption),
            figure.name
        );
    }
    page.push_str("</section>\n<section><h2>Facts</h2><table><tbody>");
    for (name, value) in &study.facts {
        let _ = write!(page, "<tr><th>{}</th><td>{}</td></tr>", escape(name), escape(value));
    }
    page.push_str("</tbody></table></section>\n<section><h2>Files</h2><table><tbody>");
    let own = [(RESULTS, "facts, statements and results in machine-readable form")];
    let more = study.files.iter().map(|(name, meaning, _)| (name.as_str(), meaning.as_str()));
    for (name, meaning) in own.into_iter().chain(more) {
        let _ = write!(page, "<tr><th><a href=\"{0}\">{0}</a></th><td>{1}</td></tr>", escape(name), escape(meaning));
    }
    let _ = write!(
        page,
        "</tbody></table></section>\n<footer>tiprub {}</footer>\n</main>\n</body>\n</html>\n",
        env!("CARGO_PKG_VERSION")
    );
    page
}
