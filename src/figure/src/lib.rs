//! Drawing of line plots, waterfall, Campbell and polar diagrams, maps of cells and values, pictures of meshes and tables, and the style of their pages.

pub(crate) mod axis;
pub mod campbell;
pub mod cells;
pub(crate) mod decimate;
pub mod grid_map;
pub mod picture;
pub mod plots;
pub mod polar;
pub mod table;
pub mod waterfall;

/// Style sheet of the pages.
pub const STYLE: &str = include_str!("../page.css");

/// Escapes text for HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
