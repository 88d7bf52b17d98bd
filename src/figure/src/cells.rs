//! Maps of answers: panels of coloured cells, each with a symbol for its kind and a tooltip.

use std::fmt::Write as _;

use crate::escape;

/// Width of the picture and sizes in it (SVG units).
const WIDTH: f64 = 920.0;
const LEFT: f64 = 84.0;
const CELL: [f64; 2] = [30.0, 22.0];
const ABOVE: f64 = 30.0;
const BELOW: f64 = 56.0;
const LEGEND: f64 = 34.0;

/// Kind of answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CellKind {
    /// Label in the legend.
    pub label: String,
    /// Colour of the cell.
    pub color: &'static str,
    /// Symbol in the cell, so that the meaning does not depend on colour alone.
    pub sign: &'static str,
}

/// One cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    /// Index of the kind.
    pub kind: usize,
    /// Text of the tooltip.
    pub words: String,
}

/// One panel, with rows from top to bottom.
#[derive(Debug, Clone, PartialEq)]
pub struct CellPanel {
    /// Title above the panel.
    pub title: String,
    /// Rows of cells, each as long as the list of columns.
    pub cells: Vec<Vec<Cell>>,
    /// Row and column of the framed cell.
    pub framed: Option<(usize, usize)>,
}

/// All panels, with common columns and rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    /// Label of the column axis.
    pub x_label: String,
    /// Label of the row axis.
    pub y_label: String,
    /// Column labels, from left to right.
    pub columns: Vec<String>,
    /// Row labels, from top to bottom.
    pub rows: Vec<String>,
    /// Kinds of answers.
    pub kinds: Vec<CellKind>,
    /// Panels of the map.
    pub panels: Vec<CellPanel>,
}

impl Cells {
    /// Returns the number of panels side by side, and the size of one panel.
    fn layout(&self) -> (usize, [f64; 2]) {
        let width = LEFT + CELL[0] * self.columns.len() as f64 + 14.0;
        let height = ABOVE + CELL[1] * self.rows.len() as f64 + BELOW;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few panels")]
        let beside = ((WIDTH / width) as usize).clamp(1, self.panels.len().max(1));
        (beside, [width, height])
    }

    /// Returns the complete SVG file.
    pub fn to_svg(&self) -> String {
        let (beside, [width, height]) = self.layout();
        let lines = self.panels.len().div_ceil(beside) as f64;
        let [all, tall] = [WIDTH.max(width), lines * height + LEGEND];
        let mut svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {all} {tall}" font-family="sans-serif" font-size="13" fill="#343a42"><rect width="{all}" height="{tall}" fill="#fff"/>"##
        );
        for (index, panel) in self.panels.iter().enumerate() {
            let place = [width * (index % beside) as f64, height * (index / beside) as f64];
            self.draw_panel(panel, place, &mut svg);
        }
        self.draw_legend(lines * height + 14.0, &mut svg);
        svg.push_str("</svg>\n");
        svg
    }

    fn draw_panel(&self, panel: &CellPanel, [x, y]: [f64; 2], svg: &mut String) {
        let (left, top) = (x + LEFT, y + ABOVE);
        let [wide, high] = [CELL[0] * self.columns.len() as f64, CELL[1] * self.rows.len() as f64];
        text(svg, [left, y + 20.0], "start", &panel.title);
        for (row, (cells, label)) in panel.cells.iter().zip(&self.rows).enumerate() {
            let above = top + CELL[1] * row as f64;
            text(svg, [left - 6.0, above + 16.0], "end", label);
            for (column, cell) in cells.iter().enumerate() {
                self.draw_cell(cell, [left + CELL[0] * column as f64, above], svg);
            }
        }
        // Labels of many columns would overlap.
        let every = self.columns.iter().map(|label| label.chars().count()).max().unwrap_or(0).div_ceil(4).max(1);
        for (column, label) in self.columns.iter().enumerate().step_by(every) {
            text(svg, [left + CELL[0] * (column as f64 + 0.5), top + high + 16.0], "middle", label);
        }
        text(svg, [left + 0.5 * wide, top + high + 36.0], "middle", &self.x_label);
        text(svg, [left - 6.0, y + 20.0], "end", &self.y_label);
        if let Some((row, column)) = panel.framed {
            let [cell_x, cell_y] = [left + CELL[0] * column as f64, top + CELL[1] * row as f64];
            let _ = write!(
                svg,
                r##"<rect x="{cell_x}" y="{cell_y}" width="{}" height="{}" fill="none" stroke="#14161a" stroke-width="2.5"/>"##,
                CELL[0], CELL[1]
            );
        }
    }

    fn draw_cell(&self, cell: &Cell, [x, y]: [f64; 2], svg: &mut String) {
        let CellKind { color, sign, .. } = &self.kinds[cell.kind];
        let _ = write!(
            svg,
            r##"<g><title>{}</title><rect x="{x}" y="{y}" width="{}" height="{}" fill="{color}" stroke="#fff"/>"##,
            escape(&cell.words),
            CELL[0],
            CELL[1]
        );
        text(svg, [x + 0.5 * CELL[0], y + 16.0], "middle", sign);
        svg.push_str("</g>");
    }

    fn draw_legend(&self, y: f64, svg: &mut String) {
        let mut x = 14.0;
        for CellKind { label, color, sign } in &self.kinds {
            let _ = write!(svg, r#"<rect x="{x}" y="{}" width="22" height="16" fill="{color}"/>"#, y - 4.0);
            text(svg, [x + 11.0, y + 9.0], "middle", sign);
            text(svg, [x + 28.0, y + 9.0], "start", label);
            x += 48.0 + 7.2 * label.chars().count() as f64;
        }
    }
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, text: &str) {
    let _ = write!(svg, r#"<text x="{x}" y="{y}" text-anchor="{anchor}">{}</text>"#, escape(text));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_shows_its_kind_and_its_words() {
        let kind = |label: &str, color, sign| CellKind { label: label.into(), color, sign };
        let cell = |kind, words: &str| Cell { kind, words: words.into() };
        let panel = |title: &str| CellPanel {
            title: title.into(),
            cells: vec![vec![cell(0, "fine"), cell(1, "µ < 0.5")]],
            framed: Some((0, 1)),
        };
        let cells = Cells {
            x_label: "µ".into(),
            y_label: "h".into(),
            columns: vec!["0".into(), "1".into()],
            rows: vec!["1e-6".into()],
            kinds: vec![kind("right", "#cfe3d4", "+"), kind("refused", "#d99", "×")],
            panels: vec![panel("one"), panel("two")],
        };
        let svg = cells.to_svg();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("<title>").count(), 4);
        assert!(svg.contains("<title>µ &lt; 0.5</title>") && svg.contains(">×<") && svg.contains(">two<"), "{svg}");
        assert_eq!(svg.matches("stroke-width=\"2.5\"").count(), 2, "framed once in each panel");
    }
}
