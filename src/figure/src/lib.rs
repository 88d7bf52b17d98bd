//! Everything that is drawn: line plots, waterfalls, maps of cells, pictures of meshes, tables, and the style of the pages they stand on.

pub(crate) mod axis;
pub mod cells;
pub(crate) mod decimate;
pub mod picture;
pub mod plots;
pub mod table;
pub mod time_map;
pub mod waterfall;

/// Style sheet of the pages.
pub const STYLE: &str = include_str!("../page.css");

/// Text for HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
