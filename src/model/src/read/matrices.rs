//! Models from the matrices of another program: K, M and a table of nodes.
//!
//! | format | recognised by | dofs of a row |
//! |---|---|---|
//! | Matrix Market `coordinate`, `real`, `symmetric` or `general` | `%%MatrixMarket` | 3·node + component, nodes in the order of the table |
//! | CalculiX `*FREQUENCY, SOLVER=MATRIXSTORAGE` (`.sti`, `.mas`) | `.dof` beside it | `node.component` per line of the `.dof` file |
//! | Abaqus `*MATRIX OUTPUT, FORMAT=MATRIX INPUT` | five values per line | node and component in the line |
//! | Abaqus `FORMAT=COORDINATE` | three values per line | as Matrix Market |
//!
//! One triangle or both may be given. Dofs of clamped nodes may be missing.

mod formats;
mod node_table;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use faer::Mat;

use formats::{Labels, RawMatrix, read_matrix};
use node_table::{NodeTable, read_nodes};

use super::entries::{Entries, symmetric_pair};
use super::source::{about, open_file};
use super::{EngineAxis, Imported, Units};
use crate::Result;
use crate::fe_model::FeModel;
use crate::sparse::SparseMatrix;

/// Files of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MatrixFiles {
    /// K.
    pub stiffness: PathBuf,
    /// M.
    pub mass: PathBuf,
    /// Nodes: a table `node,x,y,z[,sets]`, or a mesh file whose nodes and sets are used.
    pub nodes: PathBuf,
    /// List of dofs of CalculiX, unless it is the file beside K with the extension `.dof`.
    pub dofs: Option<PathBuf>,
    /// Units of matrices and coordinates.
    pub units: Units,
    /// Engine axis in the files.
    pub axis: EngineAxis,
    /// Sets of nodes whose dofs the matrices omit, for formats whose rows do not name nodes.
    pub left_out: Vec<String>,
}

/// Reads a model from matrices.
///
/// # Errors
/// [`Error::File`](crate::Error::File); [`Error::Read`](crate::Error::Read) with file and line, and for matrices that
/// do not match each other or the nodes, are not symmetric, or include a mass that is not positive.
pub fn read_matrices(files: &MatrixFiles) -> Result<Imported> {
    let table = read_nodes(&files.nodes, files.units, files.axis)?;
    let dofs = dof_file(files)?;
    let rows = DofRows::new(files, &table)?;
    let stiffness = located(&files.stiffness, dofs.as_deref(), &rows)?;
    let mass = located(&files.mass, dofs.as_deref(), &rows)?;
    let mut notes = table.notes;
    let order = 3 * table.positions.len();
    let (stiffness, mut held) = mirrored(&files.stiffness, stiffness, order, files.units.matrix())?;
    let (mass, _) = mirrored(&files.mass, mass, order, files.units.matrix())?;
    let (mut stiffness, mass) = symmetric_pair(order, stiffness, mass);
    release(&mut stiffness, &mut held);
    let absent = absent_nodes(files, &table.numbers, &stiffness)?;
    check_mass(files, &table.numbers, &mass, &absent)?;
    if !absent.is_empty() {
        notes.push(format!("{} nodes have no dofs in the matrices and are treated as clamped", absent.len()));
    }
    let mut warnings = Vec::from_iter(check_inertia(&files.mass, &mass)?);
    if absent.is_empty() {
        warnings.extend(rigid_motion_warning(&table.positions, &stiffness));
    }
    let names = [&files.stiffness, &files.mass].map(|path| path.file_name().unwrap_or_default().to_string_lossy());
    Ok(Imported {
        model: FeModel {
            nodes: table.positions,
            sets: table.sets,
            stiffness,
            mass,
            mesh: None,
            origin: format!("Matrices {} and {}", names[0], names[1]),
        },
        node_numbers: table.numbers,
        materials: Vec::new(),
        absent,
        held: Vec::new(),
        notes,
        warnings,
    })
}

/// Returns `node.component` of each row as written by CalculiX.
fn dof_file(files: &MatrixFiles) -> Result<Option<Vec<(u64, u64)>>> {
    let beside = files.stiffness.with_extension("dof");
    let path = match &files.dofs {
        Some(path) => path.clone(),
        None if files.stiffness.extension().is_some_and(|extension| extension == "sti") => beside,
        None => return Ok(None),
    };
    formats::read_dofs(&path, &open_file(&path)?).map(Some)
}

/// Dofs of the rows.
struct DofRows<'a> {
    table: &'a NodeTable,
    index: HashMap<u64, usize>,
    /// Nodes without the omitted ones, in the order of the table.
    kept: Vec<usize>,
    files: &'a MatrixFiles,
}

impl<'a> DofRows<'a> {
    fn new(files: &'a MatrixFiles, table: &'a NodeTable) -> Result<Self> {
        let index = table.numbers.iter().enumerate().map(|(index, &number)| (number, index)).collect();
        let mut left_out = vec![false; table.numbers.len()];
        for name in &files.left_out {
            // A set that does not exist is reported where it is to be clamped.
            let nodes = table.sets.get(name).map_or(&[][..], Vec::as_slice);
            nodes.iter().for_each(|&node| left_out[node] = true);
        }
        let kept = (0..table.numbers.len()).filter(|&node| !left_out[node]).collect();
        Ok(Self { table, index, kept, files })
    }

    fn dof(&self, path: &Path, node: u64, component: u64) -> Result<usize> {
        let component =
            usize::try_from(component).ok().filter(|component| (1..=3).contains(component)).ok_or_else(|| {
                let problem = format!("node {node} has degree of freedom {component}");
                about(
                    path,
                    problem,
                    "Use solid models with displacements 1, 2, 3 only, without rotations, pressure or temperature",
                )
            })?;
        let index = self.index.get(&node).ok_or_else(|| {
            let problem = format!("node {node} is not in {}", self.files.nodes.display());
            about(path, problem, "Give a node table of the same model")
        })?;
        Ok(3 * index + self.files.axis.place(component - 1))
    }

    /// Returns the dofs of the rows of a matrix whose rows are only counted.
    fn counted(&self, path: &Path, order: usize) -> Result<Vec<usize>> {
        let (all, kept) = (self.table.numbers.len(), self.kept.len());
        let nodes: Vec<usize> = if order == 3 * all {
            (0..all).collect()
        } else if order == 3 * kept {
            self.kept.clone()
        } else {
            let problem = format!(
                "it has {order} rows, but the nodes in {} have 3·{all} = {} degrees of freedom{}",
                self.files.nodes.display(),
                3 * all,
                if kept < all {
                    format!(" and 3·{kept} = {} without the clamped nodes", 3 * kept)
                } else {
                    String::new()
                }
            );
            let remedy =
                "Give matrices of all nodes, or of all nodes outside --clamp-set, in the order of the node table";
            return Err(about(path, problem, remedy));
        };
        let axis = self.files.axis;
        Ok(nodes.iter().flat_map(|node| (0..3).map(move |component| 3 * node + axis.place(component))).collect())
    }
}

/// Returns the entries of a matrix file by dofs of all nodes.
fn located(path: &Path, dofs: Option<&[(u64, u64)]>, rows: &DofRows<'_>) -> Result<Entries> {
    let RawMatrix { entries, labels } = read_matrix(path, &open_file(path)?)?;
    let dof_of = match (labels, dofs) {
        (Labels::Named(labels), _) => {
            labels.iter().map(|&(node, component)| rows.dof(path, node, component)).collect::<Result<Vec<_>>>()?
        }
        (Labels::Counted(order), Some(dofs)) => {
            if order != dofs.len() {
                let problem = format!("it has {order} rows, but the list of dofs has {}", dofs.len());
                let remedy = "Give the complete matrix and the .dof file of the same run (--dofs)";
                return Err(about(path, problem, remedy));
            }
            dofs.iter().map(|&(node, component)| rows.dof(path, node, component)).collect::<Result<Vec<_>>>()?
        }
        (Labels::Counted(order), None) => rows.counted(path, order)?,
    };
    let items = entries.items.into_iter().map(|(i, j, value)| (dof_of[i], dof_of[j], value)).collect();
    Ok(Entries { items })
}

/// Size of a diagonal entry above which it represents a dof that Abaqus holds.
const HELD: f64 = 1e35;
/// Largest difference between off-diagonal entries and their mirror images, as a fraction of the larger diagonal
/// entry.
const ASYMMETRY: f64 = 1e-8;

/// Position above the diagonal (or on it) with its mirror image.
struct MirrorPair {
    low: usize,
    high: usize,
    /// Sums of the entries above and below the diagonal.
    sums: [f64; 2],
    /// True if there are entries above and below the diagonal.
    given: [bool; 2],
}

/// Groups entries by pairs of positions, in the order of rows and columns.
fn pairs(entries: &Entries, scale: f64) -> Vec<MirrorPair> {
    let place = |&(i, j, value): &(usize, usize, f64)| (i.min(j), i.max(j), usize::from(i > j), scale * value);
    let mut items: Vec<(usize, usize, usize, f64)> = entries.items.iter().map(place).collect();
    items.sort_by_key(|&(low, high, side, _)| (low, high, side));
    let mut pairs: Vec<MirrorPair> = Vec::new();
    for (low, high, side, value) in items {
        if pairs.last().is_none_or(|pair| (pair.low, pair.high) != (low, high)) {
            pairs.push(MirrorPair { low, high, sums: [0.0; 2], given: [false; 2] });
        }
        if let Some(pair) = pairs.last_mut() {
            pair.sums[side] += value;
            pair.given[side] = true;
        }
    }
    pairs
}

/// Returns both triangles from one or both, scaled, and the dofs that are held by a huge diagonal entry.
///
/// A file with one triangle, in its own row order, contains each pair of dofs once, in either order.
fn mirrored(path: &Path, entries: Entries, order: usize, scale: f64) -> Result<(Entries, Vec<usize>)> {
    let held =
        entries.items.iter().filter(|&&(i, j, value)| i == j && value.abs() > HELD).map(|entry| entry.0).collect();
    let pairs = pairs(&entries, scale);
    drop(entries);
    let mut diagonal = vec![0.0_f64; order];
    pairs.iter().filter(|pair| pair.low == pair.high).for_each(|pair| diagonal[pair.low] = pair.sums[0].abs());
    let square = pairs.iter().any(|pair| pair.given == [true; 2]);
    let mut items = Vec::with_capacity(2 * pairs.len());
    for MirrorPair { low, high, sums: [above, below], .. } in pairs {
        let share = (above - below).abs() / diagonal[low].max(diagonal[high]).max(f64::MIN_POSITIVE);
        if square && low != high && share > ASYMMETRY {
            let (row, column) = (low + 1, high + 1);
            let problem = format!(
                "it is not symmetric: entry ({row}, {column}) and its mirror image differ by {share:.1e} of the \
                 diagonal (row and column numbers run over all {order} degrees of freedom)"
            );
            let remedy = "Export it without gyroscopic, follower-load and friction terms";
            return Err(about(path, problem, remedy));
        }
        let value = if square && low != high { 0.5 * (above + below) } else { above + below };
        items.push((low, high, value));
        if low != high {
            items.push((high, low, value));
        }
    }
    Ok((Entries { items }, held))
}

/// Removes held dofs from the stiffness, as if they were absent.
fn release(stiffness: &mut SparseMatrix, held: &mut Vec<usize>) {
    held.sort_unstable();
    held.dedup();
    let is_held = |dof: usize, held: &[usize]| held.binary_search(&dof).is_ok();
    for column in 0..stiffness.order() {
        for entry in stiffness.pattern.starts[column]..stiffness.pattern.starts[column + 1] {
            if is_held(column, held) || is_held(stiffness.pattern.rows[entry], held) {
                stiffness.values[entry] = 0.0;
            }
        }
    }
}

fn diagonal(matrix: &SparseMatrix, dof: usize) -> f64 {
    let range = matrix.pattern.starts[dof]..matrix.pattern.starts[dof + 1];
    let found = matrix.pattern.rows[range.clone()].binary_search(&dof);
    found.map_or(0.0, |offset| matrix.values[range.start + offset])
}

/// Returns the nodes without any stiffness. A node that lacks one or two directions is rejected.
fn absent_nodes(files: &MatrixFiles, numbers: &[u64], stiffness: &SparseMatrix) -> Result<Vec<usize>> {
    let mut absent = Vec::new();
    for (node, number) in numbers.iter().enumerate() {
        let present = [0, 1, 2].map(|component| diagonal(stiffness, 3 * node + component) != 0.0);
        if !present.contains(&true) {
            absent.push(node);
        } else if present.contains(&false) {
            let problem = format!("node {number} has stiffness in some directions only (x, y, z: {present:?})");
            let remedy = "Export the matrices without boundary conditions, and clamp whole nodes with --clamp-set";
            return Err(about(&files.stiffness, problem, remedy));
        }
        if let Some(component) = (0..3).find(|component| diagonal(stiffness, 3 * node + component) < 0.0) {
            let problem = format!("the diagonal entry of node {number}, direction {}, is negative", component + 1);
            return Err(about(&files.stiffness, problem, "Check whether K and M are swapped or the signs are wrong"));
        }
    }
    if absent.len() == numbers.len() {
        return Err(about(&files.stiffness, "it has no entries", "Export the matrix again"));
    }
    Ok(absent)
}

fn check_mass(files: &MatrixFiles, numbers: &[u64], mass: &SparseMatrix, absent: &[usize]) -> Result<()> {
    for (node, number) in numbers.iter().enumerate() {
        if absent.binary_search(&node).is_ok() {
            continue;
        }
        if let Some(component) = (0..3).find(|component| diagonal(mass, 3 * node + component) <= 0.0) {
            let value = diagonal(mass, 3 * node + component);
            let problem = format!("node {number}, direction {}, has mass {value:e} on the diagonal", component + 1);
            return Err(about(
                &files.mass,
                problem,
                "Give the mass matrix of the same model: every node that can move needs mass",
            ));
        }
    }
    Ok(())
}

/// Inertia of a motion along one axis, as a fraction of Σ|M|, below which there is none; a stiffness matrix yields
/// round-off.
const NO_INERTIA: f64 = 1e-6;
/// Largest relative difference of the inertia along the three axes.
const UNEQUAL: f64 = 0.01;

/// Checks that a mass resists motion along each axis equally. A stiffness in its place resists none, or (without
/// clamped nodes) each differently.
fn check_inertia(path: &Path, mass: &SparseMatrix) -> Result<Option<String>> {
    let (mut inertia, mut size) = ([0.0_f64; 3], 0.0_f64);
    for column in 0..mass.order() {
        for entry in mass.pattern.starts[column]..mass.pattern.starts[column + 1] {
            if mass.pattern.rows[entry] % 3 == column % 3 {
                inertia[column % 3] += mass.values[entry];
                size += mass.values[entry].abs() / 3.0;
            }
        }
    }
    let [low, high] = inertia.iter().fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], &x| [low.min(x), high.max(x)]);
    let [x, y, z] = inertia;
    if low <= NO_INERTIA * size {
        let problem = format!("the mass along x, y, z is practically zero ({x:.3e}, {y:.3e}, {z:.3e})");
        return Err(about(path, problem, "Check whether stiffness and mass are swapped"));
    }
    Ok((high > (1.0 + UNEQUAL) * low).then(|| {
        format!(
            "the mass along x, y and z differs ({x:.4e}, {y:.4e}, {z:.4e} kg): check that it is the mass matrix of \
             solid elements only"
        )
    }))
}

/// Strain of a rigid motion, as a fraction of Σ|K||u|, that exceeds the round-off of printed numbers.
const STRAINED: f64 = 1e-5;

/// Warns if rigid motions strain a model without boundary conditions: translations if it is supported, rotations also
/// if the nodes do not belong to the rows.
fn rigid_motion_warning(nodes: &[[f64; 3]], stiffness: &SparseMatrix) -> Option<String> {
    let motion = |kind: usize, [x, y, z]: [f64; 3]| match kind {
        0 => [1.0, 0.0, 0.0],
        1 => [0.0, 1.0, 0.0],
        2 => [0.0, 0.0, 1.0],
        3 => [0.0, -z, y],
        4 => [z, 0.0, -x],
        _ => [-y, x, 0.0],
    };
    let centre: [f64; 3] = core::array::from_fn(|i| nodes.iter().map(|node| node[i]).sum::<f64>() / nodes.len() as f64);
    let about_centre = |node: [f64; 3]| core::array::from_fn(|i| node[i] - centre[i]);
    let motions = Mat::from_fn(3 * nodes.len(), 6, |dof, kind| motion(kind, about_centre(nodes[dof / 3]))[dof % 3]);
    let forces = stiffness.times(motions.as_ref());
    let absolute = SparseMatrix {
        pattern: std::sync::Arc::clone(&stiffness.pattern),
        values: stiffness.values.iter().map(|value| value.abs()).collect(),
    };
    let sizes = absolute.times(Mat::from_fn(motions.nrows(), 6, |i, k| motions[(i, k)].abs()).as_ref());
    let share = |kind: usize| forces.col(kind).norm_max() / sizes.col(kind).norm_max().max(f64::MIN_POSITIVE);
    let most = |kinds: [usize; 3]| kinds.map(share).into_iter().fold(0.0, f64::max);
    let (translations, rotations) = (most([0, 1, 2]), most([3, 4, 5]));
    if translations > STRAINED {
        return Some(format!(
            "a translation of the whole model strains it (by {translations:.1e}): check for springs to ground and \
             missing dofs. The matrices are used unchanged"
        ));
    }
    (rotations > STRAINED).then(|| {
        format!(
            "a rotation of the whole model strains it (by {rotations:.1e}), but a translation does not: check that the \
             nodes are in the order of the rows and have the right coordinates"
        )
    })
}
