//! Conversion of errors of the TOML library to messages that a user can act on.
//!
//! The library reports a span of the text and a sentence. The field path is recovered by searching the parsed document
//! for that span; inside the tagged table `shape`, for which the library reports only the whole table, the key or value
//! is found by its name or by its description in the sentence.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use tiprub_cosim::Diagnostic;

use crate::remedy::name_remedy;
use crate::scene_layout::{FIELDS, INNER_TABLES, REPEATED_TABLES, SINGLE_TABLES, header};

/// A syntactically correct scene file.
pub(crate) struct Document<'a> {
    pub text: &'a str,
    pub origin: &'a str,
    pub root: &'a DeTable<'a>,
}

/// Returns line and column, both from 1, of a byte offset; columns count characters.
pub(crate) fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset.min(text.len())).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |index| index + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// A key, table or value of the document. `fields` is the path without indices, as in [`FIELDS`].
struct TomlNode<'a> {
    path: String,
    fields: String,
    span: Range<usize>,
    value: &'a DeValue<'a>,
}

impl<'a> Document<'a> {
    /// Adds the place to the error of a field that [`SceneSettings::validate`](tiprub_core::scene::settings::SceneSettings::validate)
    /// names by its path, with or without indices; it has a position if the document holds exactly one such field.
    pub(crate) fn locate(&self, Diagnostic { what: path, problem, remedy, .. }: Diagnostic) -> Diagnostic {
        let bare = path.replace('`', "");
        let mut candidates: Vec<_> = self.places().into_iter().filter(|place| place.path == bare).collect();
        if candidates.is_empty() {
            candidates = self.places().into_iter().filter(|place| place.fields == bare).collect();
            candidates.retain(|place| !place.path.ends_with(']'));
        }
        let only = candidates.first().filter(|first| candidates.iter().all(|place| place.path == first.path));
        let what = only.map_or(&path, |place| &place.path);
        // A missing key is reported at its table.
        let table = || {
            let (table, _) = bare.rsplit_once('.')?;
            self.places().into_iter().rfind(|place| place.path == table)
        };
        let span = only.map(|place| place.span.clone()).or_else(|| Some(table()?.span));
        self.error(span, what, problem, remedy)
    }

    /// Returns whether the document has the key at this path, indices counted from 1.
    pub(crate) fn holds(&self, path: &str) -> bool {
        self.places().iter().any(|place| place.path == path)
    }

    /// Returns line and column of the key at this path.
    pub(crate) fn position(&self, path: &str) -> Option<(usize, usize)> {
        let place = self.places().into_iter().find(|place| place.path == path)?;
        Some(position(self.text, place.span.start))
    }

    fn error(&self, span: Option<Range<usize>>, what: &str, problem: String, remedy: String) -> Diagnostic {
        scene_error(self.origin, span.map(|span| position(self.text, span.start)), what, problem, remedy)
    }

    fn places(&self) -> Vec<TomlNode<'a>> {
        let mut places = Vec::new();
        collect_table(self.root, "", "", &mut places);
        places
    }

    /// Returns the narrowest node that covers `span`; of equally narrow ones the deepest.
    fn covering(&self, span: &Range<usize>) -> Option<TomlNode<'a>> {
        let covers = |place: &TomlNode| place.span.start <= span.start && span.end <= place.span.end;
        let candidates = self.places().into_iter().filter(covers);
        candidates.min_by_key(|place| (place.span.len(), std::cmp::Reverse(place.path.matches(['.', '[']).count())))
    }
}

fn collect_table<'a>(table: &'a DeTable<'a>, path: &str, fields: &str, places: &mut Vec<TomlNode<'a>>) {
    for (key, value) in table {
        let name: &str = key.get_ref();
        let join = |head: &str| if head.is_empty() { name.to_owned() } else { format!("{head}.{name}") };
        let (path, fields) = (join(path), join(fields));
        places.push(TomlNode { path: path.clone(), fields: fields.clone(), span: key.span(), value: value.get_ref() });
        collect_value(value, &path, &fields, places);
    }
}

fn collect_value<'a>(value: &'a Spanned<DeValue<'a>>, path: &str, fields: &str, places: &mut Vec<TomlNode<'a>>) {
    places.push(TomlNode { path: path.into(), fields: fields.into(), span: value.span(), value: value.get_ref() });
    match value.get_ref() {
        DeValue::Table(table) => collect_table(table, path, fields, places),
        DeValue::Array(array) => {
            for (index, element) in array.iter().enumerate() {
                collect_value(element, &format!("{path}[{}]", index + 1), fields, places);
            }
        }
        _ => {}
    }
}

/// Returns an error at a position of a scene file: line and column, both from 1, where known.
pub(crate) fn scene_error(
    origin: &str,
    position: Option<(usize, usize)>,
    what: &str,
    problem: impl ToString,
    remedy: impl ToString,
) -> Diagnostic {
    let position = position.map(|(line, column)| format!(":{line}:{column}")).unwrap_or_default();
    Diagnostic::new(what, problem, remedy).at(format!("{origin}{position}"))
}

/// Returns the error for a document that does not match the settings.
pub(crate) fn diagnose(document: &Document, error: &toml::de::Error) -> Diagnostic {
    let message = error.message();
    // The library reports a missing key at the top level with the empty span at the start of the text.
    let place = error.span().filter(|span| !span.is_empty()).and_then(|span| document.covering(&span));
    if let Some(name) = quoted(message, "missing field") {
        return missing(document, place, name);
    }
    let Some(place) = place else {
        let remedy = "See the scene file chapter of the user guide".into();
        return document.error(error.span(), "scene", message.to_owned(), remedy);
    };
    if let Some(name) = quoted(message, "unknown field") {
        return unknown_key(document, &place, name, &accepted(message));
    }
    if let Some(name) = quoted(message, "unknown variant") {
        let remedy = name_remedy(name, &accepted(message));
        return document.error(Some(place.span), &place.path, format!("\"{name}\" is not an accepted value"), remedy);
    }
    wrong_value(document, place, message)
}

fn missing(document: &Document, place: Option<TomlNode>, name: &str) -> Diagnostic {
    let (path, fields) = place.as_ref().map_or(("", ""), |place| (&place.path, &place.fields));
    let join = |head: &str| if head.is_empty() { name.to_owned() } else { format!("{head}.{name}") };
    let remedy = match FIELDS.iter().find(|field| field.path == join(fields)) {
        Some(field) => format!("Add `{name} = ...` to {}: {}", header(fields), requirement(field.path)),
        None => format!("Add a table {}", header(name)),
    };
    document.error(place.as_ref().map(|place| place.span.clone()), &join(path), "missing".into(), remedy)
}

fn unknown_key(document: &Document, place: &TomlNode, name: &str, accepted: &[&str]) -> Diagnostic {
    // The span covers the key itself, or (in `shape`) the table that holds it.
    let is_key = place.path.rsplit('.').next() == Some(name);
    let path = if is_key { place.path.clone() } else { format!("{}.{name}", place.path) };
    let span = document.places().into_iter().find(|other| other.path == path).map(|other| other.span);
    let mut remedy = name_remedy(name, accepted);
    let table = if is_key { place.fields.rsplit_once('.').map_or("", |(table, _)| table) } else { &place.fields };
    if FIELDS.iter().any(|field| field.key() == name && field.table() == table) {
        remedy = format!("`{name}` belongs to another `kind` of {}. {remedy}", header(table));
    } else if let Some(field) = FIELDS.iter().find(|field| field.key() == name) {
        remedy = format!("`{name}` belongs to {}. {remedy}", header(field.table()));
    }
    document.error(span.or(Some(place.span.clone())), &path, "unknown key".into(), remedy)
}

fn wrong_value(document: &Document, place: TomlNode, message: &str) -> Diagnostic {
    let rest = message.strip_prefix("invalid type: ").or(message.strip_prefix("invalid value: "));
    let (found, expected) = rest.and_then(|rest| rest.rsplit_once(", expected ")).unzip();
    let place = match found {
        Some(found) if place.fields == "surface.shape" => culprit(document, &place.path, found).unwrap_or(place),
        _ => place,
    };
    let problem = match (found, expected) {
        (Some(found), Some(expected)) => format!("found {found}, expected {}", plain(expected)),
        _ => message.to_owned(),
    };
    let requirement = requirement(&place.fields);
    let remedy = if requirement.is_empty() {
        "See the scene file chapter of the user guide".into()
    } else {
        format!("Expected here: {requirement}")
    };
    document.error(Some(place.span), &place.path, problem, remedy)
}

/// Rejects `[contact]` instead of `[[contact]]` and vice versa. Checked before the settings are deserialised, because
/// the library would accept a list of values instead of a table of named ones.
pub(crate) fn check_brackets(document: &Document) -> Result<(), Diagnostic> {
    for (key, value) in document.root {
        let name: &str = key.get_ref();
        let all_tables = |list: &DeArray| list.iter().all(|element| element.get_ref().is_table());
        let problem = if REPEATED_TABLES.contains(&name) && !value.get_ref().as_array().is_some_and(all_tables) {
            "expected a list of tables"
        } else if SINGLE_TABLES.contains(&name) && !value.get_ref().is_table() {
            "expected a single table"
        } else {
            continue;
        };
        let problem = format!("found {}, {problem}", value.get_ref().type_str());
        return Err(document.error(Some(key.span()), name, problem, format!("Write {}", header(name))));
    }
    let example =
        |place: &TomlNode| INNER_TABLES.iter().find(|(table, _)| place.fields == *table).map(|(_, text)| *text);
    match document.places().into_iter().find(|place| example(place).is_some() && !place.value.is_table()) {
        Some(place) => {
            let problem = format!("found {}, expected a table", place.value.type_str());
            let remedy = format!("Write it as {}", example(&place).unwrap_or_default());
            Err(document.error(Some(place.span), &place.path, problem, remedy))
        }
        None => Ok(()),
    }
}

/// Returns the first value below `path` that the library would describe as `found`.
fn culprit<'a>(document: &Document<'a>, path: &str, found: &str) -> Option<TomlNode<'a>> {
    let below = format!("{path}.");
    document
        .places()
        .into_iter()
        .filter(|place| place.path.starts_with(&below) && description(place.value) == found)
        .max_by_key(|place| place.path.len())
}

/// Returns a value as the TOML library names it in messages.
fn description(value: &DeValue) -> String {
    match value {
        DeValue::String(text) => format!("string {text:?}"),
        DeValue::Integer(number) => i64::from_str_radix(&number.as_str().replace('_', ""), number.radix())
            .map_or_else(|_| "integer".into(), |number| format!("integer `{number}`")),
        DeValue::Float(number) => {
            let text =
                number.as_str().replace('_', "").parse::<f64>().map_or(String::new(), |number| number.to_string());
            format!("floating point `{text}{}`", if text.contains('.') { "" } else { ".0" })
        }
        DeValue::Boolean(value) => format!("boolean `{value}`"),
        DeValue::Array(_) => "sequence".into(),
        DeValue::Table(_) => "map".into(),
        DeValue::Datetime(_) => "date".into(),
    }
}

/// Returns type, range and meaning of a field, for a remedy; empty for unknown paths.
pub(crate) fn requirement(fields: &str) -> String {
    let Some(field) = FIELDS.iter().find(|field| field.path == fields) else { return String::new() };
    let range = field.range();
    let range = if range.is_empty() { range } else { format!(" ({range})") };
    format!("{}{range}. {}", field.value, field.description.trim_end_matches('.'))
}

/// Translates the library's names of Rust types to plain words.
fn plain(expected: &str) -> &str {
    match expected {
        "f64" => "a number",
        "u32" | "usize" => "a non-negative whole number",
        "a sequence" => "a list",
        "a boolean" => "true or false",
        other => other,
    }
}

/// Returns the names that a message of the library lists after `expected`, each between backticks.
fn accepted(message: &str) -> Vec<&str> {
    let list = message.split_once(", expected ").map_or("", |(_, list)| list);
    list.split('`').skip(1).step_by(2).collect()
}

/// Returns the name quoted in a message such as "unknown field `x`, expected ...".
fn quoted<'a>(message: &'a str, start: &str) -> Option<&'a str> {
    let rest = message.strip_prefix(start)?.strip_prefix(" `")?;
    Some(rest.split_once("`, ").map_or_else(|| rest.trim_end_matches('`'), |(name, _)| name))
}
