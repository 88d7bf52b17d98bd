//! Lines of an input file: includes are expanded, and keywords are grouped with their parameters and data.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::super::source::{Open, SourceLine, beside, text_of};
use crate::Result;

/// Largest depth of nested includes; below, the largest total number of included files.
const LARGEST_DEPTH: usize = 16;
const LARGEST_COUNT: usize = 1000;
/// Largest total size of all included files (bytes).
const LARGEST_INCLUDED: usize = 1 << 30;
/// Largest total size of all repeated files (bytes). A list of nodes may belong to several sets, but nodes and
/// elements exist once. Lines in memory take up to thirty times their length in the file, so repetitions could expand
/// a few kilobytes to gigabytes.
const LARGEST_REPEATED: usize = 8 << 20;

/// Keyword line with its data lines.
#[derive(Debug)]
pub(super) struct Card {
    /// Upper case, one blank between words, without the star: `SOLID SECTION`.
    pub keyword: String,
    /// Name in upper case without blanks, and value as written, if any.
    pub parameters: Vec<(String, Option<String>)>,
    /// Line of the keyword.
    pub place: SourceLine,
    /// Data lines, without comments and empty lines.
    pub data: Vec<DataLine>,
}

/// Data line.
#[derive(Debug, Clone)]
pub(super) struct DataLine {
    /// Text without leading and trailing blanks.
    pub text: String,
    /// Line in the file.
    pub place: SourceLine,
}

impl DataLine {
    /// Iterates over the values between commas; an empty last value (a comma at the end) is omitted.
    pub(super) fn values(&self) -> impl Iterator<Item = &str> {
        self.text.trim_end_matches([',', ' ', '\t']).split(',').map(str::trim)
    }

    /// Returns whether the record continues in the next line.
    pub(crate) fn is_continued(&self) -> bool {
        self.text.ends_with(',')
    }
}

impl Card {
    /// Returns the value of a parameter; an error if it has no value.
    pub(super) fn parameter(&self, name: &str) -> Result<Option<&str>> {
        match self.parameters.iter().find(|(key, _)| key == name) {
            None => Ok(None),
            Some((_, Some(value))) if !value.is_empty() => Ok(Some(value)),
            Some(_) => {
                let problem = format!("parameter {name} of *{} has no value", self.keyword);
                Err(self.place.error(problem, format!("Write {name}=...")))
            }
        }
    }

    /// Returns the value of a required parameter.
    pub(super) fn required(&self, name: &str) -> Result<&str> {
        self.parameter(name)?.ok_or_else(|| {
            let problem = format!("*{} has no parameter {name}", self.keyword);
            self.place.error(problem, format!("Write *{}, {name}=...", self.keyword))
        })
    }

    /// Returns whether a parameter is given, with or without a value.
    pub(super) fn has(&self, name: &str) -> bool {
        self.parameters.iter().any(|(key, _)| key == name)
    }
}

/// Returns all cards of a file and of the files it includes.
pub(super) fn cards(path: &Path, bytes: &[u8], open: Open<'_>) -> Result<Vec<Card>> {
    let mut reader = LineReader {
        open,
        cards: Vec::new(),
        active: Vec::new(),
        count: 0,
        included: 0,
        known: HashSet::new(),
        repeated: 0,
        before_first_keyword: None,
    };
    reader.file(path.to_path_buf(), bytes)?;
    if let Some(place) = reader.before_first_keyword {
        let problem = "there is data before the first keyword";
        return Err(place.error(problem, "Give a CalculiX or Abaqus input file, whose keywords begin with `*`"));
    }
    Ok(reader.cards)
}

struct LineReader<'a> {
    open: Open<'a>,
    cards: Vec<Card>,
    active: Vec<PathBuf>,
    count: usize,
    /// Number of bytes of included files so far.
    included: usize,
    /// Digests of the contents of included files, which do not depend on the spelling of a path.
    known: HashSet<u64>,
    /// Number of bytes of files whose contents were included before.
    repeated: usize,
    before_first_keyword: Option<SourceLine>,
}

impl LineReader<'_> {
    fn file(&mut self, path: PathBuf, bytes: &[u8]) -> Result<()> {
        let (text, name) = (text_of(bytes), Arc::from(path.display().to_string()));
        self.active.push(path);
        // A keyword line that ends with a comma continues in the next line.
        let mut keyword: Option<(String, SourceLine)> = None;
        for (index, line) in text.lines().enumerate() {
            let line = line.trim();
            let place = SourceLine { file: Arc::clone(&name), line: index + 1 };
            if line.starts_with("**") || line.is_empty() {
                continue;
            }
            if let Some((begun, _)) = &mut keyword {
                begun.push_str(line);
            } else if let Some(begun) = line.strip_prefix('*') {
                keyword = Some((begun.to_owned(), place));
            } else {
                self.data(line, place);
            }
            if keyword.as_ref().is_some_and(|(text, _)| !text.ends_with(',')) {
                self.keyword(keyword.take())?;
            }
        }
        self.keyword(keyword)?;
        self.active.pop();
        Ok(())
    }

    fn data(&mut self, line: &str, place: SourceLine) {
        match self.cards.last_mut() {
            Some(card) => card.data.push(DataLine { text: line.to_owned(), place }),
            None => _ = self.before_first_keyword.get_or_insert(place),
        }
    }

    fn keyword(&mut self, line: Option<(String, SourceLine)>) -> Result<()> {
        let Some((text, place)) = line else { return Ok(()) };
        let mut parts = text.split(',');
        let words: Vec<String> = parts.next().unwrap_or("").split_whitespace().map(str::to_uppercase).collect();
        let parameters = parts.filter(|part| !part.trim().is_empty()).map(parameter).collect();
        let card = Card { keyword: words.join(" "), parameters, place, data: Vec::new() };
        if card.keyword == "INCLUDE" {
            return self.include(&card);
        }
        // *NODE, INPUT=file and *ELEMENT, INPUT=file: data lines in a separate file.
        let elsewhere = match card.keyword.as_str() {
            "NODE" | "ELEMENT" | "NSET" | "ELSET" => card.parameter("INPUT")?.map(str::to_owned),
            _ => None,
        };
        let place = card.place.clone();
        self.cards.push(card);
        elsewhere.map_or(Ok(()), |written| self.open_beside(&written, &place))
    }

    fn include(&mut self, card: &Card) -> Result<()> {
        let written = card.required("INPUT")?.to_owned();
        self.open_beside(&written, &card.place)
    }

    fn open_beside(&mut self, written: &str, place: &SourceLine) -> Result<()> {
        let current = self.active.last().cloned().unwrap_or_default();
        let path = beside(&current, written);
        self.count += 1;
        if self.active.contains(&path) || self.active.len() >= LARGEST_DEPTH || self.count > LARGEST_COUNT {
            let problem = format!("{} is included recursively, too deeply or too often", path.display());
            return Err(place.error(problem, "Include every file only once"));
        }
        let bytes = (self.open)(&path).map_err(|error| {
            place.error(format!("the included file cannot be read: {error}"), "Place included files next to this one")
        })?;
        self.included = self.included.saturating_add(bytes.len());
        if self.included > LARGEST_INCLUDED {
            let problem = format!("with {}, the included files exceed 1 GiB in total", path.display());
            return Err(place.error(problem, "Include every file only once, or use a smaller mesh"));
        }
        let mut digest = DefaultHasher::new();
        bytes.hash(&mut digest);
        if !self.known.insert(digest.finish()) {
            self.repeated = self.repeated.saturating_add(bytes.len());
        }
        if self.repeated > LARGEST_REPEATED {
            let problem = format!(
                "with {}, more than {} MiB of the included data is duplicated",
                path.display(),
                LARGEST_REPEATED >> 20
            );
            return Err(place.error(problem, "Include every file only once"));
        }
        self.file(path, &bytes)
    }
}

fn parameter(part: &str) -> (String, Option<String>) {
    let (name, value) = match part.split_once('=') {
        Some((name, value)) => (name, Some(value.trim().trim_matches('"').trim().to_owned())),
        None => (part, None),
    };
    (name.split_whitespace().collect::<String>().to_uppercase(), value)
}
