//! Page of the report: main results, animation, figures and details.

use std::fmt::Write as _;

use tiprub_figure::{STYLE, escape};
use tiprub_shell::Result;

use super::input::ReportInput;
use super::{details, figures, summary::Summary, viewer};

/// Style sheet of the report, which follows the style sheet of all pages.
const OWN_STYLE: &str = include_str!("report.css");

/// Renders the whole page.
///
/// # Errors
/// A figure cannot be drawn, or the data of the animation cannot be compressed.
pub fn render(input: &ReportInput<'_>) -> Result<String> {
    let settings = &input.scene.settings;
    let title = escape(&settings.name);
    let blade = input.capture.hardest_hit();
    let summary = Summary::new(input);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title} - tiprub report</title>\n<style>\n{STYLE}{OWN_STYLE}</style>\n</head>\n<body>\n<main class=\"report\">\n"
    );
    let _ = writeln!(
        page,
        "<div class=\"top\"><header><h1>{title}</h1><p>{}</p>{}{}</header>",
        escape(&settings.description),
        summary.words(input, blade.as_ref()),
        summary.cards()
    );
    page.push_str(&viewer::section(input, blade.as_ref())?);
    page.push_str("</div>\n");
    for (title, html) in figures::sections(input, blade.as_ref())? {
        let _ = writeln!(page, "<section><h2>{title}</h2>{html}</section>");
    }
    page.push_str(&details::run_section(input));
    page.push_str(&details::rom_section(input.facts));
    page.push_str(&details::agreement_section(input));
    page.push_str(&details::scene_section(input));
    page.push_str(&details::files_section(input.files));
    let _ = write!(page, "<footer>tiprub {}</footer>\n</main>\n</body>\n</html>\n", env!("CARGO_PKG_VERSION"));
    Ok(page)
}
