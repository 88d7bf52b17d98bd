//! Tables and pictures of the study, written into the guide between its markers.

use std::path::Path;

use tiprub_shell::{Failure, Result, output_file};
use tiprub_study::Study;

/// Tables of the study (names of its files) and the pages that show them.
const TABLES: [(&str, &str); 4] = [
    ("summary-steps", "error-study.md"),
    ("summary-total", "error-study.md"),
    ("summary-limits", "error-study.md"),
    ("communication-steps", "co-simulation.md"),
];
/// The page and the block that state machine and date.
const MACHINE: (&str, &str) = ("machine", "error-study.md");
/// Directory of the pictures, next to the pages.
const PICTURES: &str = "error";

/// Replaces pictures and blocks of the guide in `directory`: complete blocks after a study of all scenes, otherwise
/// only the rows of the scenes that were run. Nothing is written if a block is missing.
///
/// # Errors
/// A missing page or block, or a file that cannot be written.
pub(super) fn write(study: &Study, directory: &Path, is_whole: bool) -> Result<()> {
    let fact = |name: &str| study.facts.iter().find(|(known, _)| known == name).map_or("", |(_, value)| value.as_str());
    let seconds = fact("processor time of the study");
    let machine = format!(
        "{}, processors used: {}, {}. The study took {seconds} of processor time.",
        fact("processor"),
        fact("processors available"),
        fact("date")
    );
    let mut blocks: Vec<_> = is_whole.then_some((MACHINE.0, MACHINE.1, machine)).into_iter().collect();
    for (name, page) in TABLES {
        let file = format!("{name}.md");
        let found = study.files.iter().find(|(known, ..)| *known == file);
        if found.is_none() && !is_whole {
            continue;
        }
        let (.., bytes) = found.ok_or_else(|| failed(directory, format!("the study has no table `{name}`")))?;
        // The heading of the page is the caption.
        let text = String::from_utf8_lossy(bytes);
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
        blocks.push((name, page, rows.join("\n")));
    }
    let mut pages: Vec<(&str, String)> = Vec::new();
    for (name, page, content) in blocks {
        let known = pages.iter().position(|(known, _)| *known == page);
        let index = match known {
            Some(index) => index,
            None => {
                let path = directory.join(page);
                let text = std::fs::read_to_string(&path).map_err(|error| failed(&path, error.to_string()))?;
                pages.push((page, text));
                pages.len() - 1
            }
        };
        let content = if is_whole { content } else { with_rows(&pages[index].1, name, &content) };
        let text = replaced(&pages[index].1, name, &content, fact("date"))
            .map_err(|problem| failed(&directory.join(page), problem))?;
        pages[index].1 = text;
    }
    for figure in &study.figures {
        output_file::write(&directory.join(PICTURES).join(format!("{}.svg", figure.name)), &figure.picture.svg)?;
    }
    pages.into_iter().try_for_each(|(page, text)| output_file::write(&directory.join(page), text))
}

fn failed(path: &Path, problem: String) -> Failure {
    Failure::new(path.display().to_string(), problem, "Set `--guide` to the directory `docs` of the sources")
}

/// Returns the table of a block of the page with the rows of the scenes in `table` replaced or added; the first cell of
/// a row is its scene.
fn with_rows(page: &str, name: &str, table: &str) -> String {
    let scene = |row: &str| row.split('|').nth(1).unwrap_or_default().to_owned();
    let begin = format!("<!-- written: lab error {name};");
    let block = page.split_once(&begin).and_then(|(_, rest)| rest.split_once("<!-- end -->"));
    let known = block.map_or("", |(block, _)| block);
    let mut added: Vec<&str> = table.lines().skip(2).collect();
    let mut rows = Vec::new();
    for row in known.lines().filter(|row| row.starts_with('|')) {
        if added.iter().any(|new| scene(new) == scene(row)) {
            // The new rows replace those of their scene where the first one is.
            let (own, others) = added.iter().copied().partition(|new| scene(new) == scene(row));
            rows.extend::<Vec<&str>>(own);
            added = others;
        } else if !table.lines().skip(2).any(|new| scene(new) == scene(row)) {
            rows.push(row);
        }
    }
    rows.extend(added);
    rows.join("\n")
}

/// Returns the page with the content of one block and its date replaced.
fn replaced(page: &str, name: &str, content: &str, date: &str) -> std::result::Result<String, String> {
    let begin = format!("<!-- written: lab error {name};");
    let end = "<!-- end -->";
    let missing = || format!("there is no block from `{begin} ... -->` to `{end}`");
    let (before, rest) = page.split_once(&begin).ok_or_else(missing)?;
    let (_, after) = rest.split_once(end).ok_or_else(missing)?;
    Ok(format!("{before}{begin} {date}, version {} -->\n{content}\n{end}{after}", env!("CARGO_PKG_VERSION")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "# Page\n\n<!-- written: lab error first; 2026-01-01, version 0 -->\n| old |\n<!-- end -->\n\ntext\n\n\
                        <!-- written: lab error second; 2026-01-01, version 0 -->\n<!-- end -->\n";

    #[test]
    fn replaces_a_block_and_keeps_the_rest() {
        let found = replaced(PAGE, "first", "| new |", "2026-11-25").unwrap();
        let expected = PAGE
            .replacen("2026-01-01, version 0", &format!("2026-11-25, version {}", env!("CARGO_PKG_VERSION")), 1)
            .replace("| old |", "| new |");
        assert_eq!(found, expected);
        assert!(replaced(PAGE, "third", "", "").unwrap_err().contains("lab error third"));
    }

    #[test]
    fn rows_of_a_scene_are_replaced_or_added() {
        let page = "<!-- written: lab error first; today -->\n| scene | error |\n|---|---|\n| a | 1 |\n| b | 2 |\n<!-- end -->\n| b | 3 |\n";
        let head = "| scene | error |\n|---|---|\n";
        assert_eq!(
            with_rows(page, "first", &format!("{head}| a | 5 |\n| a | 6 |")),
            format!("{head}| a | 5 |\n| a | 6 |\n| b | 2 |")
        );
        assert_eq!(
            with_rows(page, "first", &format!("{head}| c | 7 |")),
            format!("{head}| a | 1 |\n| b | 2 |\n| c | 7 |")
        );
    }

    #[test]
    fn the_guide_has_every_block() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
        for (name, page) in TABLES.into_iter().chain([MACHINE]) {
            let text = std::fs::read_to_string(docs.join(page)).unwrap();
            assert!(replaced(&text, name, "", "").is_ok(), "{page}: {name}");
        }
    }
}
