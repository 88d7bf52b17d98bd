//! Tables of text for the page and for the guide.

use crate::escape;

/// Table with a caption.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Caption.
    pub caption: String,
    /// Headings.
    pub columns: Vec<String>,
    /// Rows, each as long as the headings.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Creates an empty table.
    pub fn new<const N: usize>(caption: impl Into<String>, columns: [&str; N]) -> Self {
        Self { caption: caption.into(), columns: columns.map(String::from).to_vec(), rows: Vec::new() }
    }

    /// Returns the table as HTML for the page, optionally folded.
    pub fn to_html(&self, folded: bool) -> String {
        let cells = |tag: &str, cells: &[String]| -> String {
            cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect()
        };
        let rows: String = self.rows.iter().map(|row| format!("<tr>{}</tr>", cells("td", row))).collect();
        let head = cells("th", &self.columns);
        let table = format!("<table class=\"numbers\"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>");
        let caption = escape(&self.caption);
        match folded {
            true => format!("<details><summary>{caption}</summary>{table}</details>"),
            false => format!("<p>{caption}</p>{table}"),
        }
    }

    /// Returns the table as Markdown for the guide.
    pub fn to_markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(self.columns.len()));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}\n\n{}{rule}{rows}", self.caption, line(&self.columns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_and_html_contain_every_cell() {
        let mut table = Table::new("errors < 1", ["method", "error"]);
        table.rows.push(vec!["film".into(), "1e-3".into()]);
        assert_eq!(table.to_markdown(), "errors < 1\n\n| method | error |\n|---|---|\n| film | 1e-3 |\n");
        let html = table.to_html(false);
        assert!(html.contains("errors &lt; 1") && html.contains("<td>film</td><td>1e-3</td>"));
    }
}
