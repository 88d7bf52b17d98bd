//! Patches as degrees of freedom: an exact change of variables u = T v of the full model.
//!
//! Every patch k has a pivot, a node whose displacement is replaced by that of the patch. With the weights w, the
//! directions R_p of node p (columns: the unit vectors of the patch components there), pivots P and the other nodes O
//! of patches
//!
//! ```text
//! R_kᵀ v_k = Σ_p w_kp R_pᵀ u_p  (k in P),   v_p = u_p  (elsewhere),   so that   u_P = R_P W_PP⁻¹ (R_Pᵀ v_P − W_PO R_Oᵀ v_O).
//! ```
//!
//! With K ← TᵀKT and M ← TᵀMT the mean displacements of patches are boundary degrees of freedom like those of contact
//! nodes: they can be held, condensed to, and rotated. Forces on patches are forces on pivots. Fill occurs in the
//! rows of the nodes of patches and of the neighbours of pivots.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Add, Mul};
use std::sync::Arc;

use faer::Mat;
use nalgebra::{DMatrix, Matrix3};
use tiprub_core::scene::rom::DisplacementFrame;

use crate::contact_point::{ContactPoint, clamped_point};
use crate::sparse::{Pattern, SparseMatrix};
use crate::{Error, Result};

/// Fraction of the largest weight of a patch that must remain at a pivot after elimination of the other patches;
/// below it, patches depend on each other.
const LEAST_PIVOT: f64 = 1e-6;
/// Largest number of entries that patches may add to the matrices: two such matrices take a gigabyte.
const MOST_ENTRIES: usize = 50_000_000;

/// Change of variables u = T v.
#[derive(Debug)]
pub(crate) struct PatchCoordinates {
    /// The contact, with each patch represented by its pivot.
    points: Vec<ContactPoint>,
    /// Degrees of freedom of the pivots, point by point.
    pivots: Vec<usize>,
    /// Degrees of freedom of all contact nodes, ascending.
    touched: Vec<usize>,
    /// u at the pivots from v at the touched ones.
    dependence: DMatrix<f64>,
}

impl PatchCoordinates {
    /// Creates the coordinates of contact with patches, `None` without patches, for matrices of the degrees of
    /// freedom `free` (3·node + component, ascending).
    ///
    /// # Errors
    /// [`Error::Invalid`] for patches that depend on each other, have a node that is not free, or have too many
    /// nodes.
    pub(crate) fn new(
        free: &[usize],
        nodes: &[[f64; 3]],
        contact: &[ContactPoint],
        frame: DisplacementFrame,
    ) -> Result<Option<Self>> {
        if contact.iter().all(|point| point.patch.is_empty()) {
            return Ok(None);
        }
        check_free(free, contact)?;
        let within: BTreeSet<usize> = contact.iter().flat_map(ContactPoint::weights).map(|(node, _)| node).collect();
        let within: Vec<usize> = within.into_iter().collect();
        let weights = weights(contact, &within);
        let places = pivots(&weights, contact)?;
        // [W_PP⁻¹, −W_PP⁻¹ W_PO], columns in the order of the nodes.
        let inverse = weights.select_columns(&places).try_inverse().ok_or_else(|| dependent(&contact[0]))?;
        let mut shares = -&inverse * &weights;
        places.iter().enumerate().for_each(|(patch, &place)| shares.set_column(place, &inverse.column(patch)));
        let turns: Vec<Matrix3<f64>> = within.iter().map(|&node| directions(nodes[node], frame)).collect();
        let dependence = DMatrix::from_fn(3 * contact.len(), 3 * within.len(), |i, j| {
            let turned = turns[places[i / 3]].row(i % 3).dot(&turns[j / 3].row(j % 3));
            shares[(i / 3, j / 3)] * turned
        });
        let chosen: Vec<usize> = places.iter().map(|&place| within[place]).collect();
        let point = |(&node, point): (&usize, &ContactPoint)| ContactPoint { node, patch: Vec::new(), ..point.clone() };
        Ok(Some(Self {
            points: chosen.iter().zip(contact).map(point).collect(),
            pivots: dofs(free, &chosen),
            touched: dofs(free, &within),
            dependence,
        }))
    }

    /// Returns the contact as nodes alone, with patches represented by nodes.
    pub(crate) fn points(&self) -> &[ContactPoint] {
        &self.points
    }

    /// Returns TᵀKT and TᵀMT, with a common pattern.
    ///
    /// # Errors
    /// [`Error::Invalid`] for patches with more nodes than the memory limit permits.
    pub(crate) fn transformed(
        &self,
        stiffness: &SparseMatrix,
        mass: &SparseMatrix,
    ) -> Result<(SparseMatrix, SparseMatrix)> {
        let old = &stiffness.pattern;
        let neighbours = self.pivots.iter().flat_map(|&dof| &old.rows[old.starts[dof]..old.starts[dof + 1]]);
        let near: BTreeSet<usize> = self.touched.iter().chain(neighbours).copied().collect();
        let near: Vec<usize> = near.into_iter().collect();
        if near.len() * self.touched.len() > MOST_ENTRIES {
            let nodes = self.touched.len() / 3;
            let problem = format!("{nodes} nodes would all be coupled to each other, which needs too much memory");
            let remedy = "Use a coarser mesh at the tip, contact nodes instead of patches, or free-interface modes if \
                          the hub is rigid";
            return Err(Error::invalid("contact patches", problem, remedy));
        }
        let pattern = Arc::new(self.filled(old, &near));
        let [stiffness, mass] = [stiffness, mass].map(|matrix| self.projected(matrix, &pattern, &near));
        Ok((stiffness, mass))
    }

    /// Computes TᵀKT and TᵀMT for patches of few nodes that are spread over the mesh: only the nodes of a patch and
    /// the neighbours of its pivot are coupled.
    pub(crate) fn transformed_sparsely(
        &self,
        stiffness: &SparseMatrix,
        mass: &SparseMatrix,
    ) -> (SparseMatrix, SparseMatrix) {
        let old = &stiffness.pattern;
        let mut row = vec![usize::MAX; old.order()];
        self.pivots.iter().enumerate().for_each(|(index, &dof)| row[dof] = index);
        // Each degree of freedom of u as a combination of those of v.
        let parts: Vec<Vec<(usize, f64)>> = (0..self.pivots.len())
            .map(|pivot| {
                let own = self.touched.iter().enumerate().map(|(j, &dof)| (dof, self.dependence[(pivot, j)]));
                own.filter(|(_, share)| *share != 0.0).collect()
            })
            .collect();
        let alone: Vec<[(usize, f64); 1]> = (0..old.order()).map(|dof| [(dof, 1.0)]).collect();
        let part = |dof: usize| row.get(dof).and_then(|&row| parts.get(row)).map_or(&alone[dof][..], Vec::as_slice);
        let mut added: BTreeMap<(usize, usize), [f64; 2]> = BTreeMap::new();
        for column in 0..old.order() {
            for entry in old.starts[column]..old.starts[column + 1] {
                let other = old.rows[entry];
                if row[column] == usize::MAX && row[other] == usize::MAX {
                    continue;
                }
                let values = [stiffness.values[entry], mass.values[entry]];
                for &(b, share) in part(column) {
                    for &(a, other) in part(other) {
                        // Half from each triangle, so that rounding leaves the matrices symmetric.
                        for place in [(b, a), (a, b)] {
                            let sums = added.entry(place).or_default();
                            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += 0.5 * share * other * value);
                        }
                    }
                }
            }
        }
        let mut pattern = Pattern { starts: vec![0], rows: Vec::with_capacity(old.rows.len()) };
        let mut values = [Vec::with_capacity(old.rows.len()), Vec::with_capacity(old.rows.len())];
        for column in 0..old.order() {
            let mut entries: BTreeMap<usize, [f64; 2]> =
                added.range((column, 0)..(column + 1, 0)).map(|(&(_, row), &sums)| (row, sums)).collect();
            for entry in old.starts[column]..old.starts[column + 1] {
                let other = old.rows[entry];
                if row[column] == usize::MAX && row[other] == usize::MAX {
                    let sums = entries.entry(other).or_default();
                    *sums = [sums[0] + stiffness.values[entry], sums[1] + mass.values[entry]];
                }
            }
            for (other, sums) in entries {
                pattern.rows.push(other);
                values.iter_mut().zip(sums).for_each(|(values, sum)| values.push(sum));
            }
            pattern.starts.push(pattern.rows.len());
        }
        let pattern = Arc::new(pattern);
        let [stiffness, mass] = values.map(|values| SparseMatrix { pattern: Arc::clone(&pattern), values });
        (stiffness, mass)
    }

    fn filled(&self, old: &Pattern, near: &[usize]) -> Pattern {
        let mut pattern = Pattern { starts: vec![0], rows: Vec::with_capacity(old.rows.len()) };
        for column in 0..old.order() {
            let own = &old.rows[old.starts[column]..old.starts[column + 1]];
            let added: &[usize] = match (self.touched.binary_search(&column), near.binary_search(&column)) {
                (Ok(_), _) => near,
                (_, Ok(_)) => &self.touched,
                _ => &[],
            };
            let first = pattern.rows.len();
            pattern.rows.extend(own.iter().chain(added));
            if !added.is_empty() {
                let mut rows = pattern.rows.split_off(first);
                rows.sort_unstable();
                rows.dedup();
                pattern.rows.append(&mut rows);
            }
            pattern.starts.push(pattern.rows.len());
        }
        pattern
    }

    /// Computes TᵀAT: without rows and columns of pivots A is unchanged, and DᵀA_P + A_PᵀD + DᵀA_PP D is added, with
    /// D as the rows of T of the pivots.
    fn projected(&self, matrix: &SparseMatrix, pattern: &Arc<Pattern>, near: &[usize]) -> SparseMatrix {
        let mut place = vec![usize::MAX; matrix.order()];
        near.iter().enumerate().for_each(|(index, &dof)| place[dof] = index);
        let mut is_pivot = vec![false; matrix.order()];
        self.pivots.iter().for_each(|&dof| is_pivot[dof] = true);
        let mut dependence = DMatrix::zeros(self.pivots.len(), near.len());
        self.touched
            .iter()
            .enumerate()
            .for_each(|(j, &dof)| dependence.set_column(place[dof], &self.dependence.column(j)));
        let own = matrix.block(&self.pivots, &self.pivots);
        let beside = matrix.block(&self.pivots, near);
        let own = DMatrix::from_fn(self.pivots.len(), self.pivots.len(), |i, j| own[(i, j)]);
        let beside = DMatrix::from_fn(self.pivots.len(), near.len(), |i, j| match is_pivot[near[j]] {
            true => 0.0,
            false => beside[(i, j)],
        });
        let half = dependence.tr_mul(&(beside + 0.5 * own * &dependence));
        let mut values = vec![0.0; pattern.rows.len()];
        let old = &matrix.pattern;
        for column in 0..matrix.order() {
            let range = pattern.starts[column]..pattern.starts[column + 1];
            let (rows, values) = (&pattern.rows[range.clone()], &mut values[range]);
            let mut at = 0;
            for entry in old.starts[column]..old.starts[column + 1] {
                let row = old.rows[entry];
                at += rows[at..].partition_point(|&other| other < row);
                if !is_pivot[row] && !is_pivot[column] {
                    values[at] = matrix.values[entry];
                }
            }
            if place[column] != usize::MAX {
                for (&row, value) in rows.iter().zip(values).filter(|(row, _)| place[**row] != usize::MAX) {
                    let (i, j) = (place[row], place[column]);
                    *value += half[(i, j)] + half[(j, i)];
                }
            }
        }
        SparseMatrix { pattern: Arc::clone(pattern), values }
    }

    /// Returns u at the degrees of freedom of the pivots from v.
    pub(crate) fn displaced<V: Copy + Add<Output = V> + Mul<f64, Output = V>>(
        &self,
        zero: V,
        v: impl Fn(usize) -> V,
    ) -> Vec<(usize, V)> {
        let own = |(row, &dof): (usize, &usize)| {
            let share = |(j, &other): (usize, &usize)| v(other) * self.dependence[(row, j)];
            (dof, self.touched.iter().enumerate().map(share).fold(zero, |sum, value| sum + value))
        };
        self.pivots.iter().enumerate().map(own).collect()
    }

    /// Transforms columns of forces f on u to forces on v, Tᵀf.
    pub(crate) fn project(&self, forces: &mut Mat<f64>) {
        for k in 0..forces.ncols() {
            let own: Vec<f64> = self.pivots.iter().map(|&dof| forces[(dof, k)]).collect();
            self.pivots.iter().for_each(|&dof| forces[(dof, k)] = 0.0);
            for (j, &dof) in self.touched.iter().enumerate() {
                forces[(dof, k)] += self.dependence.column(j).iter().zip(&own).map(|(d, f)| d * f).sum::<f64>();
            }
        }
    }

    /// Transforms columns v to u = T v.
    pub(crate) fn restore(&self, columns: &mut Mat<f64>) {
        for k in 0..columns.ncols() {
            let own = self.displaced(0.0, |dof| columns[(dof, k)]);
            own.into_iter().for_each(|(dof, value)| columns[(dof, k)] = value);
        }
    }
}

/// Checks that all three degrees of freedom of every node are free.
fn check_free(free: &[usize], contact: &[ContactPoint]) -> Result<()> {
    let moves = |(node, _): (usize, f64)| (0..3).all(|axis| free.binary_search(&(3 * node + axis)).is_ok());
    contact.iter().find(|point| !point.weights().all(moves)).map_or(Ok(()), |point| Err(clamped_point(point)))
}

/// Returns the positions of the degrees of freedom of nodes among the free ones.
fn dofs(free: &[usize], nodes: &[usize]) -> Vec<usize> {
    let first = |node: usize| free.partition_point(|dof| *dof < 3 * node);
    nodes.iter().flat_map(|&node| (0..3).map(move |axis| first(node) + axis)).collect()
}

/// Returns the weights, patches × nodes; a single contact node has the weight one.
fn weights(contact: &[ContactPoint], nodes: &[usize]) -> DMatrix<f64> {
    let mut weights = DMatrix::zeros(contact.len(), nodes.len());
    for (row, point) in contact.iter().enumerate() {
        for (node, weight) in point.weights() {
            weights[(row, nodes.partition_point(|&other| other < node))] += weight;
        }
    }
    weights
}

/// Returns the unit vectors of the components of contact displacements at a node as columns.
fn directions([x, y, _]: [f64; 3], frame: DisplacementFrame) -> Matrix3<f64> {
    match frame {
        DisplacementFrame::Cartesian => Matrix3::identity(),
        DisplacementFrame::Cylindrical => {
            let radius = x.hypot(y);
            let (cos, sin) = (x / radius, y / radius);
            Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
        }
    }
}

/// Chooses a node for every patch by elimination with complete pivoting, so that W_PP is as well conditioned as the
/// weights permit.
fn pivots(weights: &DMatrix<f64>, contact: &[ContactPoint]) -> Result<Vec<usize>> {
    let mut left = weights.clone();
    left.row_iter_mut().for_each(|mut row| row /= row.amax());
    let mut chosen = vec![usize::MAX; contact.len()];
    for _patch in contact {
        let open = (0..contact.len()).filter(|&row| chosen[row] == usize::MAX);
        let entries = open.flat_map(|row| (0..left.ncols()).map(move |column| (row, column)));
        // The first of equal entries, so that the choice does not depend on rounding.
        let (row, column) = entries.fold((usize::MAX, 0), |best, at| match best.0 {
            usize::MAX => at,
            _ if left[at].abs() > left[best].abs() => at,
            _ => best,
        });
        if left[(row, column)].abs() < LEAST_PIVOT {
            return Err(dependent(&contact[row]));
        }
        chosen[row] = column;
        for other in (0..contact.len()).filter(|&other| chosen[other] == usize::MAX) {
            let factor = left[(other, column)] / left[(row, column)];
            for k in 0..left.ncols() {
                let part = factor * left[(row, k)];
                left[(other, k)] -= part;
            }
        }
    }
    Ok(chosen)
}

fn dependent(point: &ContactPoint) -> Error {
    Error::invalid(
        format!("contact patch `{}`", point.name),
        "its displacement depends on those of the other patches",
        "Remove contact nodes or patches that coincide, or use fewer patches",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(order: usize, reach: usize, entry: impl Fn(usize, usize) -> f64) -> SparseMatrix {
        let mut pattern = Pattern { starts: vec![0], rows: Vec::new() };
        let mut values = Vec::new();
        for column in 0..order {
            for row in column.saturating_sub(reach)..(column + reach + 1).min(order) {
                pattern.rows.push(row);
                values.push(entry(row.min(column), row.max(column)));
            }
            pattern.starts.push(pattern.rows.len());
        }
        SparseMatrix { pattern: Arc::new(pattern), values }
    }

    fn patch(name: &str, patch: &[(usize, f64)]) -> ContactPoint {
        ContactPoint { patch: patch.to_vec(), ..ContactPoint::at(name, patch[0].0, 0.0) }
    }

    /// Two patches with common nodes, and a node: compares TᵀAT with T column by column, and checks the means of unit
    /// vectors.
    #[test]
    fn the_change_of_variables_is_exact() {
        let nodes: Vec<[f64; 3]> =
            (0..7).map(|i| [(0.7 * f64::from(i)).cos(), (0.7 * f64::from(i)).sin(), f64::from(i)]).collect();
        let contact = [
            patch("a", &[(1, 0.5), (2, 0.25), (3, 0.25)]),
            patch("b", &[(2, 0.2), (3, 0.9), (5, -0.1)]),
            ContactPoint::at("c", 6, 0.0),
        ];
        // The first node is clamped.
        let free: Vec<usize> = (3..21).collect();
        let own = PatchCoordinates::new(&free, &nodes, &contact, DisplacementFrame::Cylindrical).unwrap().unwrap();
        let whole = matrix(18, 4, |i, j| if i == j { 9.0 } else { ((7 * i + 3 * j) as f64).sin() });
        let (found, same) = own.transformed(&whole, &whole).unwrap();
        assert!(found.values == same.values && found.pattern == same.pattern);
        let (sparse, same) = own.transformed_sparsely(&whole, &whole);
        assert!(sparse.values == same.values && sparse.pattern == same.pattern);
        let mut turned = Mat::<f64>::identity(18, 18);
        own.restore(&mut turned);
        let all: Vec<usize> = (0..18).collect();
        let expected = turned.transpose() * whole.block(&all, &all) * &turned;
        for found in [found, sparse] {
            assert!((found.block(&all, &all) - &expected).norm_max() < 1e-12 * expected.norm_max());
        }
        let mut forces = whole.block(&all, &all);
        own.project(&mut forces);
        assert!((forces - turned.transpose() * whole.block(&all, &all)).norm_max() < 1e-12);
        for (index, point) in contact.iter().enumerate() {
            let pivot = own.points()[index].node;
            for (component, v) in (0..3).flat_map(|component| (0..18).map(move |v| (component, v))) {
                let axis = |node: usize| {
                    directions(nodes[node], DisplacementFrame::Cylindrical).column(component).into_owned()
                };
                let at = |node: usize, k: usize| turned[(3 * node + k - 3, v)];
                let mean: f64 = point
                    .weights()
                    .map(|(node, weight)| weight * (0..3).map(|k| axis(node)[k] * at(node, k)).sum::<f64>())
                    .sum();
                let unit = if v / 3 + 1 == pivot { axis(pivot)[v % 3] } else { 0.0 };
                assert!((mean - unit).abs() < 1e-13, "{}: {mean} {unit}", point.name);
            }
        }
    }

    #[test]
    fn rejects_a_tip_with_too_many_nodes_before_allocation() {
        let count = 2400;
        let nodes: Vec<[f64; 3]> = (0..count).map(|i| [1.0, 0.0, i as f64]).collect();
        let all: Vec<(usize, f64)> = (0..count).map(|node| (node, 1.0 / count as f64)).collect();
        let free: Vec<usize> = (0..3 * count).collect();
        let own =
            PatchCoordinates::new(&free, &nodes, &[patch("a", &all)], DisplacementFrame::Cylindrical).unwrap().unwrap();
        let whole = matrix(3 * count, 0, |_, _| 1.0);
        let error = own.transformed(&whole, &whole).unwrap_err().to_string();
        assert!(error.contains("2400 nodes would all be coupled"), "{error}");
    }
}
