//! Stress at chosen nodes of a mesh: matrix rows that compute it from displacements, and the places where it is
//! largest.
//!
//! The stress at a node is the mean of the stresses of the elements around it, see [`crate::element::nodal_stress`].

use faer::Mat;
use nalgebra::{DMatrix, Matrix3};
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, STRESSES, WatchedPoints, von_mises};

use crate::element::nodal_stress;
use crate::fe_model::FeModel;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::reduce::{ContactPoint, ReductionOptions, contact_node, direction};
use crate::sparse::tall_product;
use crate::{Error, Result};

/// Places of stress recovery.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StressPlaces {
    /// Nodes by name.
    pub nodes: Vec<(String, usize)>,
    /// Number of the lowest modes whose places of largest stress are added, excluding clamped elements.
    pub modes: usize,
}

impl StressPlaces {
    /// Returns whether there are no places.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty() && self.modes == 0
    }
}

/// Stress at a node per displacement of the nodes around it: (node, component, value for each of the six stresses).
type StressRows = Vec<(usize, usize, [f64; STRESSES])>;

/// Computes the means over the elements around each of these nodes.
fn rows(mesh: &Mesh, material: &Material, nodes: &[usize]) -> Result<Vec<StressRows>> {
    let mut all = vec![(StressRows::new(), 0.0); nodes.len()];
    for (number, element) in mesh.elements.iter().enumerate() {
        for (local, node) in element.nodes.iter().enumerate() {
            for (place, _) in nodes.iter().enumerate().filter(|(_, own)| *own == node) {
                let coordinates = mesh.coordinates(element);
                let stress = nodal_stress(element.kind, &coordinates, material, local, number)?;
                let (rows, around) = &mut all[place];
                *around += 1.0;
                for (index, column) in stress.column_iter().enumerate() {
                    let values = std::array::from_fn(|component| column[component]);
                    rows.push((element.nodes[index / 3], index % 3, values));
                }
            }
        }
    }
    let mean = |(rows, around): (StressRows, f64)| {
        let share =
            |(node, axis, values): (usize, usize, [f64; STRESSES])| (node, axis, values.map(|one| one / around));
        rows.into_iter().map(share).collect()
    };
    Ok(all.into_iter().map(mean).collect())
}

/// Computes the stress components of these nodes per free degree of freedom, free dofs × 6·nodes, in the directions
/// of the frame at each node.
///
/// # Errors
/// The errors of [`nodal_stress`].
fn stress_rows(
    (mesh, material): (&Mesh, &Material),
    free: &[usize],
    nodes: &[usize],
    frame: DisplacementFrame,
) -> Result<Mat<f64>> {
    let mut loads = Mat::zeros(free.len(), STRESSES * nodes.len());
    for (place, rows) in rows(mesh, material, nodes)?.into_iter().enumerate() {
        let (cos, sin) =
            if frame == DisplacementFrame::Cylindrical { direction(mesh.nodes[nodes[place]]) } else { (1.0, 0.0) };
        for (node, axis, values) in rows {
            // Clamped degrees of freedom do not move.
            let Ok(row) = free.binary_search(&(3 * node + axis)) else { continue };
            for (component, value) in turned(values, cos, sin).into_iter().enumerate() {
                loads[(row, STRESSES * place + component)] += value;
            }
        }
    }
    Ok(loads)
}

/// Returns the stress per kelvin of an evenly heated isotropic body whose displacements are zero, in any directions
/// (Pa/K).
fn held_thermal_stress(material: &Material) -> [f64; STRESSES] {
    let (lambda, shear) = material.lame();
    let normal = -material.expansion * (3.0 * lambda + 2.0 * shear);
    [normal, normal, normal, 0.0, 0.0, 0.0]
}

/// Returns the stress in axes rotated about z.
fn turned([xx, yy, zz, xy, yz, zx]: [f64; STRESSES], cos: f64, sin: f64) -> [f64; STRESSES] {
    let tensor = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let axes = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
    let own = axes.transpose() * tensor * axes;
    [own[(0, 0)], own[(1, 1)], own[(2, 2)], own[(0, 1)], own[(1, 2)], own[(2, 0)]]
}

/// Returns all places by name and node: the named ones, then those where each mode (free dofs × modes) has its
/// largest von Mises stress. Elements with a clamped node are excluded there, since a clamped corner has no finite
/// stress.
///
/// # Errors
/// A node that does not exist, a repeated name, or more modes than were computed.
fn all_places(
    (mesh, material): (&Mesh, &Material),
    free: &[usize],
    modes: &Mat<f64>,
    asked: &StressPlaces,
) -> Result<Vec<(String, usize)>> {
    if asked.modes > modes.ncols() {
        let problem = format!("{} requested, but only {} modes were computed", asked.modes, modes.ncols());
        return Err(Error::invalid("points of largest stress", problem, "Request fewer"));
    }
    let mut places = asked.nodes.clone();
    for (name, node) in &places {
        if *node >= mesh.nodes.len() {
            let problem = format!("node {} does not exist; the mesh has {} nodes", node + 1, mesh.nodes.len());
            return Err(Error::invalid(format!("stress point `{name}`"), problem, "Choose nodes of the mesh"));
        }
    }
    for (mode, node) in largest((mesh, material), free, modes, asked.modes)?.into_iter().enumerate() {
        if let Some(node) = node.filter(|node| places.iter().all(|(_, own)| own != node)) {
            places.push((format!("mode_{}", mode + 1), node));
        }
    }
    let mut names: Vec<&str> = places.iter().map(|(name, _)| name.as_str()).collect();
    names.sort_unstable();
    if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::invalid(format!("stress point `{}`", pair[0]), "it appears twice", "List each only once"));
    }
    Ok(places)
}

/// Returns the node where each of the first modes has its largest stress.
fn largest(
    (mesh, material): (&Mesh, &Material),
    free: &[usize],
    modes: &Mat<f64>,
    count: usize,
) -> Result<Vec<Option<usize>>> {
    let row = |node: usize, axis: usize| free.binary_search(&(3 * node + axis)).ok();
    let clamped = |node: usize| (0..3).all(|axis| row(node, axis).is_none());
    let nodes = mesh.nodes.len();
    let (mut sums, mut around) = (vec![[0.0; STRESSES]; count * nodes], vec![0.0_f64; nodes]);
    let counted = if count == 0 { &[][..] } else { &mesh.elements[..] };
    for (number, element) in counted.iter().enumerate() {
        if element.nodes.iter().any(|node| clamped(*node)) {
            continue;
        }
        let coordinates = mesh.coordinates(element);
        let rows: Vec<_> = element.nodes.iter().flat_map(|node| (0..3).map(|axis| row(*node, axis))).collect();
        for (local, node) in element.nodes.iter().enumerate() {
            let stress = nodal_stress(element.kind, &coordinates, material, local, number)?;
            around[*node] += 1.0;
            for (column, row) in stress.column_iter().zip(&rows) {
                let Some(row) = *row else { continue };
                for mode in 0..count {
                    let sum = sums[mode * nodes + node].iter_mut();
                    sum.zip(column.iter()).for_each(|(sum, value)| *sum += value * modes[(row, mode)]);
                }
            }
        }
    }
    let place = |mode: usize| {
        let seen = (0..nodes).filter(|node| around[*node] > 0.0);
        let stress = seen.map(|node| (node, von_mises(sums[mode * nodes + node].map(|one| one / around[node]))));
        stress.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(node, _)| node)
    };
    Ok((0..count).map(place).collect())
}

/// Places of stress recovery with their matrix rows.
pub(crate) struct RecoveredStress {
    points: Vec<ContactNode>,
    /// Stress per displacement, free dofs × 6·places, in the directions of the contact nodes (Pa/m).
    rows: Mat<f64>,
    /// Stress per kelvin if all displacements are zero (Pa/K).
    held: [f64; STRESSES],
}

/// Returns the places that `options` name and those of the largest stress of modes (free dofs × modes); `None` if
/// none are requested.
///
/// # Errors
/// A model without a mesh of one material; the errors of [`all_places`].
pub(crate) fn recovered_stress(
    model: &FeModel,
    free: &[usize],
    modes: &Mat<f64>,
    options: &ReductionOptions,
) -> Result<Option<RecoveredStress>> {
    if options.stress.is_empty() {
        return Ok(None);
    }
    let Some((mesh, material)) = &model.mesh else {
        let problem = "the model has no mesh with a single material";
        return Err(Error::invalid(
            "stress",
            problem,
            "Omit the stress points, or use a mesh file with a single material",
        ));
    };
    let places = all_places((mesh, material), free, modes, &options.stress)?;
    let nodes: Vec<usize> = places.iter().map(|(_, node)| *node).collect();
    let rows = stress_rows((mesh, material), free, &nodes, options.frame)?;
    let point = |(name, node)| contact_node(&model.nodes, &ContactPoint::at(name, node, 0.0), options.frame);
    let points = places.into_iter().map(point).collect();
    Ok(Some(RecoveredStress { points, rows, held: held_thermal_stress(material) }))
}

impl RecoveredStress {
    /// Returns the stress per reduced coordinate.
    pub(crate) fn reduced(&self, transformation: &Mat<f64>) -> WatchedPoints {
        let map = tall_product(self.rows.as_ref(), transformation.as_ref());
        let map = DMatrix::from_fn(map.nrows(), map.ncols(), |i, j| map[(i, j)]);
        WatchedPoints { map, points: self.points.clone() }
    }

    /// Returns the stresses of displacements (free dofs × 1), 6·places × 1.
    pub(crate) fn elastic(&self, moved: &Mat<f64>) -> DMatrix<f64> {
        let stress = tall_product(self.rows.as_ref(), moved.as_ref());
        DMatrix::from_fn(stress.nrows(), 1, |row, _| stress[(row, 0)])
    }

    /// Returns the static stress per kelvin, 6·places × 1 (Pa/K), for the displacements per kelvin under the thermal
    /// load (free dofs × 1); zero for an unsupported structure, whose expansion causes no stress.
    pub(crate) fn thermal(&self, moved: Option<Mat<f64>>) -> DMatrix<f64> {
        let Some(moved) = moved else { return DMatrix::zeros(self.rows.ncols(), 1) };
        let mut stress = self.elastic(&moved);
        stress.iter_mut().enumerate().for_each(|(row, stress)| *stress += self.held[row % STRESSES]);
        stress
    }
}
