//! Nodes of a model from matrices.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use super::super::source::{SourceLine, about, number, open_file, text_of};
use super::super::{EngineAxis, Units, mesh_file};
use crate::Result;

/// Nodes with their numbers and sets.
#[derive(Debug)]
pub(super) struct NodeTable {
    /// Numbers in the order of the table; for a mesh file, ascending.
    pub numbers: Vec<u64>,
    /// Coordinates (m).
    pub positions: Vec<[f64; 3]>,
    /// Named sets of indices, ascending.
    pub sets: BTreeMap<String, Vec<usize>>,
    pub notes: Vec<String>,
}

/// Reads a table `node,x,y,z[,sets]` (sets separated by blanks or semicolons), or the nodes and sets of a mesh file.
pub(super) fn read_nodes(path: &Path, units: Units, axis: EngineAxis) -> Result<NodeTable> {
    let bytes = open_file(path)?;
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase()).unwrap_or_default();
    let table = match extension.to_str() {
        Some("inp" | "msh") => of_mesh(path, &bytes)?,
        _ => of_table(path, &text_of(&bytes))?,
    };
    let scale = units.length();
    Ok(NodeTable {
        positions: table.positions.iter().map(|node| axis.turned(node.map(|x| scale * x))).collect(),
        ..table
    })
}

fn of_mesh(path: &Path, bytes: &[u8]) -> Result<NodeTable> {
    let file = mesh_file(path, bytes, Some(0.0), &open_file)?;
    let (numbered, mut notes, _) = file.draft.into_mesh(1.0, EngineAxis::Z, &path.display().to_string())?;
    let mut order: Vec<usize> = (0..numbered.nodes.len()).collect();
    order.sort_by_key(|&index| numbered.nodes[index]);
    let mut position = vec![0; order.len()];
    order.iter().enumerate().for_each(|(new, &old)| position[old] = new);
    let renamed = |nodes: &[usize]| {
        let mut nodes: Vec<usize> = nodes.iter().map(|&node| position[node]).collect();
        nodes.sort_unstable();
        nodes
    };
    notes.push(format!("nodes and sets are taken from {}, in the order of the node numbers", path.display()));
    Ok(NodeTable {
        numbers: order.iter().map(|&index| numbered.nodes[index]).collect(),
        positions: order.iter().map(|&index| numbered.mesh.nodes[index]).collect(),
        sets: numbered.mesh.sets.iter().map(|(name, nodes)| (name.clone(), renamed(nodes))).collect(),
        notes,
    })
}

fn of_table(path: &Path, text: &str) -> Result<NodeTable> {
    let file: Arc<str> = path.display().to_string().into();
    let mut table = NodeTable { numbers: Vec::new(), positions: Vec::new(), sets: BTreeMap::new(), notes: Vec::new() };
    let mut seen = BTreeSet::new();
    for (index, line) in text.lines().map(str::trim).enumerate() {
        let place = || SourceLine { file: Arc::clone(&file), line: index + 1 };
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        // The first line may be a header.
        if table.numbers.is_empty() && fields[0].eq_ignore_ascii_case("node") {
            continue;
        }
        let position = fields.get(1..4).and_then(|xyz| xyz.iter().map(|x| number(x)).collect::<Option<Vec<f64>>>());
        let node = fields[0].parse::<u64>().ok();
        let (Some(node), Some(&[x, y, z]), true) = (node, position.as_deref(), fields.len() <= 5) else {
            let remedy = "Write NODE,X,Y,Z or NODE,X,Y,Z,SETS with set names separated by blanks";
            return Err(place().error(format!("`{line}` is not a line of a node table"), remedy));
        };
        if !seen.insert(node) {
            return Err(place().error(format!("node {node} appears twice"), "Give every node a unique number"));
        }
        for name in fields.get(4).unwrap_or(&"").split([' ', ';']).filter(|name| !name.is_empty()) {
            table.sets.entry(name.to_owned()).or_default().push(table.numbers.len());
        }
        table.numbers.push(node);
        table.positions.push([x, y, z]);
    }
    if table.numbers.is_empty() {
        return Err(about(path, "it has no nodes", "Write one line NODE,X,Y,Z[,SETS] per node"));
    }
    Ok(table)
}
