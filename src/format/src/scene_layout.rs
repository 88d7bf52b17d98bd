//! Contents of a scene file: one list for error messages and the user guide.

mod fields;

use tiprub_cosim::shown;

pub use fields::FIELDS;

/// One key of the scene file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SceneField {
    /// Dotted path without indices, for example `contact.gap`.
    pub path: &'static str,
    /// Type as TOML names it, with the SI unit if there is one.
    pub value: &'static str,
    /// Default, `None` if the key is required.
    pub default: Option<&'static str>,
    /// Accepted range; `{}` stands for the bounds of a number ([`SceneField::range`]).
    range: &'static str,
    /// One or two sentences.
    pub description: &'static str,
}

impl SceneField {
    /// Returns the accepted range with the bounds that are checked.
    pub fn range(&self) -> String {
        let Some((_, [low, high])) = fields::BOUNDS.iter().find(|(path, _)| *path == self.path) else {
            return self.range.to_owned();
        };
        // The smallest positive number stands for any positive value.
        let bounds = if low.to_bits() == 1 {
            format!("above 0, up to {}", shown(*high))
        } else {
            format!("{} to {}", shown(*low), shown(*high))
        };
        self.range.replace("{}", &bounds)
    }

    /// Returns the key without its table.
    pub fn key(&self) -> &'static str {
        self.path.rsplit('.').next().unwrap_or(self.path)
    }

    /// Returns the path of the table that holds the key; empty for the top level.
    pub fn table(&self) -> &'static str {
        self.path.rsplit_once('.').map_or("", |(table, _)| table)
    }
}

/// Tables that may be repeated: written `[[name]]`.
pub(crate) const REPEATED_TABLES: [&str; 3] = ["structure", "surface", "contact"];
/// Tables that appear once: written `[name]`.
pub(crate) const SINGLE_TABLES: [&str; 3] = ["time", "outputs", "experiment"];

/// Tables inside the repeated ones, each with an example: written inline, or below as `[structure.spin]`.
pub(crate) const INNER_TABLES: [(&str, &str); 8] = [
    ("structure.spin", "{ stiffening = true }"),
    ("structure.load", "{ order = 2, amplitude = 100.0 }"),
    ("structure.excitation", "{ order = 4, mode = 1, amplitude = 1.0 }"),
    ("surface.shape", "{ kind = \"circular\" } or with the keys of another kind"),
    ("surface.spline", "{ around = 72, along = 5 }"),
    ("surface.patches", "{ around = 8 }"),
    ("contact.coating", "{ thickness = 5e-3, modulus = 1e9, ... }"),
    ("contact.coating.cutting", "{ specific_energy = 5e8, normal_ratio = 1.0 }"),
];

/// Returns the header of a table in the file.
pub(crate) fn header(table: &str) -> String {
    match table.split_once('.') {
        Some((outer, inner)) => format!("`{inner}` of {}", header(outer)),
        None if table.is_empty() => "the top of the file, before the first [table]".to_owned(),
        None if REPEATED_TABLES.contains(&table) => format!("[[{table}]]"),
        None => format!("[{table}]"),
    }
}
