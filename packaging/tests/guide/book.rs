//! Tests the guide as a book: no dead link, anchor, image or path, no missing page, and no unknown command.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Component, Path, PathBuf},
    process::Command,
};

/// Folders of the packages whose tests and examples the guide names.
const PACKAGES: [(&str, &str); 7] = [
    ("tiprub", "packaging"),
    ("tiprub-core", "src/core"),
    ("tiprub-format", "src/format"),
    ("tiprub-model", "src/model"),
    ("tiprub-model-description", "modelDescription"),
    ("tiprub-reference", "src/reference"),
    ("tiprub-tests", "tests/rust"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

/// Returns the pages in `folder` of the sources, with their paths in the sources.
fn pages_in(folder: &str) -> Vec<(PathBuf, String)> {
    let entries = fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = entries.filter(|path| path.extension().is_some_and(|kind| kind == "md")).collect();
    paths.sort();
    let name = |path: &PathBuf| Path::new(folder).join(path.file_name().unwrap());
    paths.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

/// Returns the pages in the root of the sources and all chapters, without the changelog, which describes earlier versions.
fn pages() -> Vec<(PathBuf, String)> {
    let mut all = pages_in("");
    all.retain(|(path, _)| path.as_path() != Path::new("CHANGELOG.md"));
    all.extend(pages_in("docs"));
    assert!(all.len() > 30);
    all
}

/// Splits a page into its text and its lines of code, fenced or indented.
fn split(text: &str) -> (String, Vec<String>) {
    let (mut prose, mut code, mut fenced) = (String::new(), Vec::new(), false);
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if fenced || line.starts_with("    ") {
            code.push(line.trim().to_owned());
        }
        if !fenced {
            prose += line;
            prose.push('\n');
        }
    }
    (prose, code)
}

/// Returns the text between backticks.
fn spans(prose: &str) -> Vec<String> {
    let paragraphs = prose.split("\n\n").flat_map(|text| text.split('`').skip(1).step_by(2));
    paragraphs.map(|span| span.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// Returns the targets of links and images.
fn targets(prose: &str) -> Vec<String> {
    let paragraph = |text: &str| text.split('`').step_by(2).collect::<Vec<_>>().join("`");
    let without_code: Vec<_> = prose.split("\n\n").map(paragraph).collect();
    let text = without_code.join("\n\n");
    let after = text.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    after.map(|(target, _)| target.trim().to_owned()).collect()
}

/// Returns the anchors of a page, one per heading, as GitHub and mdBook create them.
fn anchors(prose: &str) -> BTreeSet<String> {
    let mut counts = BTreeMap::<String, usize>::new();
    let headings = prose.lines().filter(|line| line.starts_with('#'));
    let anchor = |line: &str| {
        let title = line.trim_start_matches('#').trim().to_lowercase();
        let mut anchor: String = title.split(' ').collect::<Vec<_>>().join("-");
        anchor.retain(|c| c.is_alphanumeric() || c == '-' || c == '_');
        let count = counts.entry(anchor.clone()).or_default();
        *count += 1;
        if *count == 1 { anchor } else { format!("{anchor}-{}", *count - 1) }
    };
    headings.map(anchor).collect()
}

/// Returns a path without `..`.
fn plain(path: &Path) -> PathBuf {
    path.components().fold(PathBuf::new(), |mut plain, part| {
        if part == Component::ParentDir {
            assert!(plain.pop(), "{} leaves the sources", path.display());
        } else {
            plain.push(part);
        }
        plain
    })
}

/// Returns the problem of a link on the page `page`; a book contains only files of its own folder.
fn dead(page: &Path, target: &str, pages: &BTreeMap<PathBuf, BTreeSet<String>>) -> Option<String> {
    if target.starts_with("https://") {
        return None;
    }
    let (file, anchor) = target.split_once('#').map_or((target, None), |(file, anchor)| (file, Some(anchor)));
    let path = if file.is_empty() { page.to_owned() } else { plain(&page.parent().unwrap().join(file)) };
    if !root().join(&path).exists() {
        return Some("there is no such file".into());
    }
    if page.starts_with("docs") && !path.starts_with("docs") {
        return Some("it leaves the book".into());
    }
    let anchor = anchor?;
    match pages.get(&path) {
        Some(known) if known.contains(anchor) => None,
        Some(known) => Some(format!("there is no such heading, but {known:?}")),
        None => Some("only pages have anchors".into()),
    }
}

#[test]
fn guide_has_no_dead_links() {
    let pages: Vec<_> = pages().into_iter().map(|(path, text)| (path, split(&text).0)).collect();
    let known: BTreeMap<_, _> = pages.iter().map(|(path, prose)| (path.clone(), anchors(prose))).collect();
    let (mut wrong, mut count) = (Vec::new(), 0);
    for (page, prose) in &pages {
        for target in targets(prose) {
            count += 1;
            let problem = dead(page, &target, &known);
            wrong.extend(problem.map(|problem| format!("{}: {target}: {problem}", page.display())));
        }
    }
    assert!(count > 200, "{count}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // A dead link is detected.
    let page = Path::new("docs/README.md");
    for (target, problem) in [
        ("theory-14.md", "no such file"),
        ("theory-05-contact.md#eq-12", "no such heading"),
        ("../README.md", "leaves the book"),
        ("images/none.svg", "no such file"),
        ("images/film-sub-steps.svg#one", "only pages"),
    ] {
        assert!(dead(page, target, &known).is_some_and(|found| found.contains(problem)), "{target}");
    }
}

/// Paths of the sources that the pages name exist, such as `src/core/src/contact/film.rs`.
#[test]
fn guide_has_no_dead_paths() {
    let roots = ["src/", "tests/", "fmi/", "packaging/", "modelDescription/", "docs/", ".ci/"];
    let (mut wrong, mut count) = (Vec::new(), 0);
    for (page, text) in pages() {
        for span in spans(&split(&text).0) {
            let path = span.split("::").next().unwrap();
            let named = path.chars().all(|c| c.is_ascii_alphanumeric() || "/._-".contains(c));
            if named && roots.iter().any(|root| path.starts_with(root)) {
                count += 1;
                if !root().join(path).exists() {
                    wrong.push(format!("{}: {path}", page.display()));
                }
            }
        }
    }
    assert!(count > 30, "{count}");
    assert!(wrong.is_empty(), "there is no\n{}", wrong.join("\n"));
}

#[test]
fn every_page_is_listed_once_and_every_picture_is_used() {
    let summary = fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let mut listed: Vec<_> = targets(&summary).iter().map(|target| Path::new("docs").join(target)).collect();
    listed.sort();
    let chapters = pages_in("docs").into_iter().map(|(path, _)| path);
    let chapters: Vec<_> = chapters.filter(|path| path.as_path() != Path::new("docs/SUMMARY.md")).collect();
    assert_eq!(listed, chapters);
    let pages = pages().into_iter().map(|(path, text)| (path, targets(&split(&text).0)));
    let used: BTreeSet<PathBuf> = pages
        .flat_map(|(page, targets)| targets.into_iter().map(move |target| page.parent().unwrap().join(target)))
        .collect();
    for folder in ["images", "error", "cube"] {
        for entry in fs::read_dir(root().join("docs").join(folder)).unwrap() {
            let picture = Path::new("docs").join(folder).join(entry.unwrap().file_name());
            assert!(used.contains(&picture), "no page shows {}", picture.display());
        }
    }
}

/// Returns the names under "Commands:" in the help of a command.
fn commands_of(words: &[&str]) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO_BIN_EXE_tiprub")).args(words).arg("--help").output().unwrap();
    assert!(output.status.success(), "{words:?} --help: {}", String::from_utf8_lossy(&output.stderr));
    let help = String::from_utf8(output.stdout).unwrap();
    let section = help.split_once("\nCommands:\n").map_or("", |(_, rest)| rest.split("\n\n").next().unwrap());
    let names = section.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.filter_map(|line| line.split_whitespace().next()).map(String::from).collect()
}

/// Returns the word of a command line that is not a command although the program expects one.
fn unknown<'a>(line: &'a str, known: &mut BTreeMap<Vec<&'a str>, BTreeSet<String>>) -> Option<&'a str> {
    let mut before = Vec::new();
    for word in line.split_whitespace().skip(1) {
        let commands = known.entry(before.clone()).or_insert_with(|| commands_of(&before));
        let placeholder = word.starts_with(['-', '.', '…']) || word.chars().all(|c| c.is_ascii_uppercase());
        if commands.is_empty() || placeholder {
            return None;
        }
        if !commands.contains(word) {
            return Some(word);
        }
        before.push(word);
    }
    None
}

#[test]
fn every_documented_command_is_valid() {
    let mut shown = Vec::new();
    for (page, text) in pages() {
        let (prose, code) = split(&text);
        let lines =
            code.into_iter().chain(spans(&prose)).map(|line| line.replace("cargo run --release -- ", "tiprub "));
        shown.extend(lines.filter(|line| line.starts_with("tiprub ")).map(|line| (page.clone(), line)));
    }
    assert!(shown.len() > 50, "{}", shown.len());
    let mut known = BTreeMap::new();
    let unknown_words = shown.iter().filter_map(|(page, line)| {
        let word = unknown(line, &mut known)?;
        Some(format!("{}: `{line}`: there is no `{word}`", page.display()))
    });
    let wrong: Vec<_> = unknown_words.collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // The commands are found, and an error is detected.
    assert!(known[&vec![]].contains("package") && known[&vec!["study"]].contains("map"));
    for (line, word) in [("tiprub packge scene.toml", "packge"), ("tiprub study errors SCENE", "errors")] {
        assert_eq!(unknown(line, &mut known), Some(word));
    }
}

/// Returns the sources of a test or an example of this name: its file, or all files of its folder.
pub fn sources(folder: &Path, name: &str) -> String {
    if let Ok(text) = fs::read_to_string(folder.join(format!("{name}.rs"))) {
        return text;
    }
    let Ok(entries) = fs::read_dir(folder.join(name)) else { return String::new() };
    entries.filter_map(|entry| fs::read_to_string(entry.unwrap().path()).ok()).collect()
}

/// `cargo test -p PACKAGE --test NAME` and `--example NAME` name existing targets.
#[test]
fn every_named_test_and_example_exists() {
    let mut count = 0;
    for (page, text) in pages() {
        let (prose, code) = split(&text);
        for line in code.into_iter().chain(spans(&prose)) {
            let words: Vec<_> = line.split(' ').collect();
            let after = |flag: &str, at: usize| (words[at] == flag).then(|| words.get(at + 1).copied().unwrap_or(""));
            let package = (0..words.len()).find_map(|at| after("-p", at));
            let Some(folder) = PACKAGES.iter().find(|known| Some(known.0) == package).map(|known| root().join(known.1))
            else {
                continue;
            };
            for at in 0..words.len() {
                // The package of the whole-product tests has them beside its library.
                let tests = if package == Some("tiprub-tests") { folder.clone() } else { folder.join("tests") };
                let test = after("--test", at).map(|name| (tests, name));
                let example = after("--example", at).map(|name| (folder.join("examples"), name));
                let Some((folder, name)) = test.or(example) else { continue };
                count += 1;
                let found = sources(&folder, name);
                assert!(!found.is_empty(), "{}: `{line}`: there is no {name} in {}", page.display(), folder.display());
            }
        }
    }
    assert!(count > 30, "{count}");
}
