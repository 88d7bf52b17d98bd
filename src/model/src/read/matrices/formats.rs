//! Matrix files: Matrix Market, matrix storage of CalculiX, Abaqus text.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::super::entries::Entries;
use super::super::source::{SourceLine, about, number, text_of};
use crate::Result;

/// Labels of the rows of a matrix.
#[derive(Debug)]
pub(super) enum Labels {
    /// Number of rows that are counted from the first.
    Counted(usize),
    /// Node number and component (from 1) of each row.
    Named(Vec<(u64, u64)>),
}

/// Matrix as read from a file.
#[derive(Debug)]
pub(super) struct RawMatrix {
    pub entries: Entries,
    pub labels: Labels,
}

/// Largest number of rows of a matrix; larger numbers in a header are not trusted.
const LARGEST_ORDER: usize = 30_000_000;

/// Reads a matrix in any of the formats.
pub(super) fn read_matrix(path: &Path, bytes: &[u8]) -> Result<RawMatrix> {
    let text = text_of(bytes);
    let file: Arc<str> = path.display().to_string().into();
    let lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (line.trim(), SourceLine { file: Arc::clone(&file), line: index + 1 }));
    if text.starts_with("%%MatrixMarket") {
        return matrix_market(path, lines);
    }
    let mut lines = lines.filter(|(line, _)| !line.is_empty() && !line.starts_with('*')).peekable();
    let fields = lines.peek().map_or(0, |(line, _)| values(line).count());
    match fields {
        3 => counted(path, lines),
        5 => named(path, lines),
        _ => {
            let problem = "the file is not a matrix with lines ROW, COLUMN, VALUE or NODE, DOF, NODE, DOF, VALUE";
            Err(about(
                path,
                problem,
                "Give a Matrix Market, CalculiX .sti/.mas, or Abaqus MATRIX INPUT or COORDINATE file",
            ))
        }
    }
}

fn values(line: &str) -> impl Iterator<Item = &str> {
    line.split([',', ' ', '\t']).filter(|value| !value.is_empty())
}

fn wrong_line(line: &str, place: &SourceLine, wanted: &str) -> crate::Error {
    place.error(format!("`{line}` is not of the form {wanted}"), "Correct the line, or export the matrix again")
}

/// Reads the coordinate format of Matrix Market (NIST, Matrix Market exchange formats).
fn matrix_market<'a>(path: &Path, mut lines: impl Iterator<Item = (&'a str, SourceLine)>) -> Result<RawMatrix> {
    let (header, place) = lines.next().unwrap_or(("", SourceLine { file: "".into(), line: 0 }));
    let words: Vec<String> = header.split_whitespace().skip(1).map(str::to_lowercase).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let symmetric = match words.as_slice() {
        ["matrix", "coordinate", "real" | "integer" | "double", "symmetric"] => true,
        ["matrix", "coordinate", "real" | "integer" | "double", "general"] => false,
        _ => {
            let problem = format!("`{header}` is not a real symmetric or general matrix in coordinate form");
            return Err(place.error(problem, "Write `%%MatrixMarket matrix coordinate real symmetric`"));
        }
    };
    let mut lines = lines.filter(|(line, _)| !line.is_empty() && !line.starts_with('%'));
    let (line, place) = lines.next().ok_or_else(|| about(path, "the size line is missing", "Export it again"))?;
    let sizes: Vec<usize> = values(line).filter_map(|value| value.parse().ok()).collect();
    let &[order, columns, count] = sizes.as_slice() else {
        return Err(wrong_line(line, &place, "ROWS COLUMNS ENTRIES"));
    };
    if order != columns || order == 0 || order > LARGEST_ORDER {
        return Err(
            place.error(format!("a stiffness or mass matrix cannot be {order} × {columns}"), "Give a square matrix")
        );
    }
    let mut entries = Entries::default();
    let mut triangles = [false; 2];
    for (line, place) in lines {
        let entry @ (row, column, value) = entry(line, &place)?;
        if row >= order || column >= order {
            return Err(place.error(format!("the row or column exceeds {order}"), "Export the matrix again"));
        }
        if value != 0.0 && row != column {
            triangles[usize::from(row > column)] = true;
        }
        if symmetric && triangles == [true; 2] {
            let problem = "a `symmetric` matrix has entries on both sides of the diagonal";
            return Err(place.error(problem, "Give only one triangle, or declare the matrix `general`"));
        }
        entries.items.push(entry);
    }
    if entries.items.len() != count {
        let problem = format!("it has {} entries, but declares {count}", entries.items.len());
        return Err(about(path, problem, "Export the complete matrix again"));
    }
    if !symmetric && order > 1 && triangles != [true; 2] && triangles != [false; 2] {
        let problem = "a `general` matrix has entries on one side of the diagonal only";
        return Err(about(path, problem, "Declare the matrix `symmetric`, or give both triangles"));
    }
    Ok(RawMatrix { entries, labels: Labels::Counted(order) })
}

/// Reads ROW COLUMN VALUE, rows and columns from 1.
fn entry(line: &str, place: &SourceLine) -> Result<(usize, usize, f64)> {
    let mut fields = values(line);
    let (row, column, value, rest) = (fields.next(), fields.next(), fields.next(), fields.next());
    let index = |text: Option<&str>| text.and_then(|text| text.parse::<usize>().ok()).filter(|&index| index >= 1);
    match (index(row), index(column), value.and_then(number), rest) {
        (Some(row), Some(column), Some(value), None) if row.max(column) <= LARGEST_ORDER => {
            Ok((row - 1, column - 1, value))
        }
        _ => Err(wrong_line(line, place, "ROW COLUMN VALUE with finite numbers and indices from 1")),
    }
}

fn counted<'a>(path: &Path, lines: impl Iterator<Item = (&'a str, SourceLine)>) -> Result<RawMatrix> {
    let items = lines.map(|(line, place)| entry(line, &place)).collect::<Result<Vec<_>>>()?;
    let order = items.iter().map(|entry| entry.0.max(entry.1) + 1).max().unwrap_or(0);
    if order > 3 * items.len() {
        return Err(about(
            path,
            format!("it has {order} rows, but only {} entries", items.len()),
            "Export the complete matrix again",
        ));
    }
    check_repeated(path, &items, |index| (index + 1).to_string())?;
    Ok(RawMatrix { entries: Entries { items }, labels: Labels::Counted(order) })
}

/// Rejects repeated entries: CalculiX and Abaqus write every entry once, so a repeated one means that a file was
/// appended to. (In Matrix Market files repeated entries add up, as its readers define it.)
fn check_repeated(path: &Path, items: &[(usize, usize, f64)], name: impl Fn(usize) -> String) -> Result<()> {
    let mut places: Vec<(usize, usize)> = items.iter().map(|&(row, column, _)| (row, column)).collect();
    places.sort_unstable();
    match places.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => {
            let problem = format!("entry ({}, {}) appears twice", name(pair[0].0), name(pair[0].1));
            Err(about(path, problem, "Export the matrix again into a new file"))
        }
        None => Ok(()),
    }
}

/// Reads NODE, DOF, NODE, DOF, VALUE.
fn named<'a>(path: &Path, lines: impl Iterator<Item = (&'a str, SourceLine)>) -> Result<RawMatrix> {
    let (mut labels, mut index, mut entries) = (Vec::new(), HashMap::new(), Entries::default());
    for (line, place) in lines {
        let fields: Vec<&str> = values(line).collect();
        let &[row, row_dof, column, column_dof, value] = fields.as_slice() else {
            return Err(wrong_line(line, &place, "NODE, DOF, NODE, DOF, VALUE"));
        };
        let mut dof = |node: &str, component: &str| -> Result<usize> {
            let node = node.parse::<i64>().map_err(|_| wrong_line(line, &place, "NODE, DOF, NODE, DOF, VALUE"))?;
            let Some(node) = u64::try_from(node).ok().filter(|&node| node > 0) else {
                let problem = format!("node {node} is an internal node of the program that wrote the matrix");
                return Err(
                    place.error(problem, "Export matrices of solid elements only, without constraints that add nodes")
                );
            };
            let component = component.parse().map_err(|_| wrong_line(line, &place, "NODE, DOF, NODE, DOF, VALUE"))?;
            Ok(*index.entry((node, component)).or_insert_with(|| {
                labels.push((node, component));
                labels.len() - 1
            }))
        };
        let (row, column) = (dof(row, row_dof)?, dof(column, column_dof)?);
        let value = number(value).ok_or_else(|| wrong_line(line, &place, "NODE, DOF, NODE, DOF, VALUE"))?;
        entries.items.push((row, column, value));
    }
    check_repeated(path, &entries.items, |index| format!("{}.{}", labels[index].0, labels[index].1))?;
    Ok(RawMatrix { entries, labels: Labels::Named(labels) })
}

/// Reads the `.dof` file of CalculiX: node.component of each row, one per line.
pub(super) fn read_dofs(path: &Path, bytes: &[u8]) -> Result<Vec<(u64, u64)>> {
    let text = text_of(bytes);
    let file: Arc<str> = path.display().to_string().into();
    let lines =
        text.lines().enumerate().map(|(index, line)| (index + 1, line.trim())).filter(|(_, line)| !line.is_empty());
    let dof = |(line, text): (usize, &str)| {
        let parts = text.split_once('.').and_then(|(node, dof)| Some((node.parse().ok()?, dof.parse().ok()?)));
        parts.ok_or_else(|| wrong_line(text, &SourceLine { file: Arc::clone(&file), line }, "NODE.DOF"))
    };
    let dofs: Vec<(u64, u64)> = lines.map(dof).collect::<Result<_>>()?;
    let mut sorted = dofs.clone();
    sorted.sort_unstable();
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        let problem = format!("degree of freedom {}.{} appears twice", pair[0].0, pair[0].1);
        return Err(about(path, problem, "Export the file again"));
    }
    Ok(dofs)
}
