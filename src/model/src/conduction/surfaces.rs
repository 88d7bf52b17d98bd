//! Surface of a casing: faces in the gas, in the air and heated faces, with integrals over them.

use core::f64::consts::TAU;
use std::collections::BTreeSet;
use std::sync::Arc;

use faer::Mat;
use tiprub_cosim::ThermalPatch;

use super::add;
use crate::element::{ElementKind, consistent_mass};
use crate::inner_surface::{InnerFace, outer_faces};
use crate::mesh::Mesh;
use crate::sparse::{Pattern, SparseMatrix};
use crate::{Error, Result};

/// Axial positions closer than this fraction of the length coincide.
const SAME: f64 = 1e-9;

/// Outer faces, grouped by the fluid around them.
#[derive(Debug, Clone)]
pub struct Surfaces {
    /// Faces in the gas and in the air.
    sides: [Vec<InnerFace>; 2],
    /// Faces in the gas that are heated at least in part.
    heated: Vec<InnerFace>,
    /// Axial limits of the heated zone (m).
    axial: [f64; 2],
}

impl Surfaces {
    /// Finds the outer faces of the mesh; those in the gas are heated between the axial positions `heated` (m), faces
    /// across these limits in part. If corner nodes of a `surface` are given, only its faces are heated.
    ///
    /// # Errors
    /// No face in the gas, or none that is heated.
    pub fn new(mesh: &Mesh, heated: [f64; 2], surface: Option<&[usize]>) -> Result<Self> {
        let mut named = vec![surface.is_none(); mesh.nodes.len()];
        surface.into_iter().flatten().for_each(|&node| named[node] = true);
        let axial = mesh.nodes.iter().map(|node| node[2]);
        let [low, high] = axial.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| [a.min(z), b.max(z)]);
        let slack = SAME * (high - low);
        let mut surfaces = Self { sides: [Vec::new(), Vec::new()], heated: Vec::new(), axial: heated };
        for face in outer_faces(mesh) {
            let corners = face.corner_positions(mesh);
            let at = |end: f64| corners.iter().all(|corner| (corner[2] - end).abs() <= slack);
            if at(low) || at(high) {
                continue;
            }
            if !face.looks_inward(mesh) {
                surfaces.sides[1].push(face);
                continue;
            }
            surfaces.sides[0].push(face);
            if face.corner_nodes(mesh).iter().all(|&node| named[node]) && face.meets(mesh, &all_round(heated)) {
                surfaces.heated.push(face);
            }
        }
        let [gas, _] = &surfaces.sides;
        if gas.is_empty() || surfaces.heated.is_empty() {
            let which = if gas.is_empty() { "no face of the mesh faces the axis" } else { "there is no gas-side face" };
            let problem = format!("{which} between z = {} m and {} m", heated[0], heated[1]);
            let remedy = "Give axial positions within the casing, whose axis must be z";
            return Err(Error::invalid("thermal model, heated surface", problem, remedy));
        }
        Ok(surfaces)
    }

    /// Assembles ∫ h N Nᵀ dA of the faces in the gas (`side` 0) or in the air (1).
    pub(super) fn film(&self, mesh: &Mesh, pattern: &Arc<Pattern>, side: usize, film: f64) -> SparseMatrix {
        let mut values = vec![0.0; pattern.rows.len()];
        for face in &self.sides[side] {
            let element = &mesh.elements[face.element];
            face.integrate(mesh, |shape, area| {
                add(pattern, &mut values, &element.nodes, |a, b| film * area * shape[a] * shape[b]);
            });
        }
        SparseMatrix { pattern: Arc::clone(pattern), values }
    }

    /// Returns ∫ N dA / A of each side; zeros for a side without faces.
    pub(super) fn wetted_means(&self, mesh: &Mesh) -> Mat<f64> {
        let mut means = Mat::zeros(mesh.nodes.len(), 2);
        for (side, faces) in self.sides.iter().enumerate() {
            add_means(mesh, faces.iter().map(|face| (face, side)), &mut means);
        }
        normalised(means)
    }

    /// Returns ∫ N dA / A of the heated surface of each patch; faces across its borders are cut there.
    ///
    /// # Errors
    /// A patch without a heated surface.
    pub(super) fn heat(&self, mesh: &Mesh, patches: &[ThermalPatch]) -> Result<Mat<f64>> {
        let mut means = Mat::zeros(mesh.nodes.len(), patches.len());
        let [from, to] = self.axial;
        for (column, patch) in patches.iter().enumerate() {
            let [low, high] = patch.axial;
            let within = ThermalPatch { angle: patch.angle, axial: [low.max(from), high.min(to)] };
            for face in &self.heated {
                let nodes = &mesh.elements[face.element].nodes;
                face.integrate_within(mesh, &within, |shape, area| {
                    nodes.iter().zip(shape).for_each(|(&node, value)| means[(node, column)] += value * area);
                });
            }
        }
        let empty = (0..patches.len()).find(|&patch| means.col(patch).iter().all(|value| *value == 0.0));
        empty.map_or_else(
            || Ok(normalised(means)),
            |patch| {
                let what = format!("thermal model, patch {}", patch + 1);
                Err(Error::invalid(
                    what,
                    "no heated face lies in it",
                    "Use one row of patches, or heat the full length",
                ))
            },
        )
    }

    /// Returns the corner nodes of heated faces, ascending.
    pub(super) fn places(&self, mesh: &Mesh) -> Vec<usize> {
        let nodes = self
            .heated
            .iter()
            .flat_map(|face| face.corners.iter().map(|&corner| mesh.elements[face.element].nodes[corner]));
        nodes.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Returns the largest depth of an element under a heated face (m): its volume over the area of the face, times
    /// three if the opposite end is a corner and two if it is an edge.
    ///
    /// # Errors
    /// An element without volume.
    pub(super) fn depth(&self, mesh: &Mesh) -> Result<f64> {
        let mut deepest = 0.0_f64;
        for face in &self.heated {
            let element = &mesh.elements[face.element];
            let products = consistent_mass(element.kind, &mesh.coordinates(element), 1.0, face.element)?;
            let mut area = 0.0;
            face.integrate(mesh, |_, part| area += part);
            let ends = match (element.kind, face.corners.len()) {
                (ElementKind::Tet4 | ElementKind::Tet10, _) => 3.0,
                (ElementKind::Penta6 | ElementKind::Penta15, 4) => 2.0,
                _ => 1.0,
            };
            deepest = deepest.max(ends * products.sum() / area);
        }
        Ok(deepest)
    }

    /// Returns the areas in the gas, in the air and heated (m²).
    pub(super) fn areas(&self, mesh: &Mesh) -> [f64; 3] {
        let part = all_round(self.axial);
        let area = |faces: &[InnerFace], part: Option<&ThermalPatch>| {
            let mut total = 0.0;
            for face in faces {
                match part {
                    Some(part) => face.integrate_within(mesh, part, |_, area| total += area),
                    None => face.integrate(mesh, |_, area| total += area),
                }
            }
            total
        };
        [area(&self.sides[0], None), area(&self.sides[1], None), area(&self.heated, Some(&part))]
    }
}

/// Returns the patch around the whole circumference between two axial positions.
fn all_round(axial: [f64; 2]) -> ThermalPatch {
    ThermalPatch { angle: [0.0, TAU], axial }
}

/// Adds ∫ N dA of faces to columns.
fn add_means<'a>(mesh: &Mesh, faces: impl Iterator<Item = (&'a InnerFace, usize)>, means: &mut Mat<f64>) {
    for (face, column) in faces {
        let nodes = &mesh.elements[face.element].nodes;
        face.integrate(mesh, |shape, area| {
            nodes.iter().zip(shape).for_each(|(&node, value)| means[(node, column)] += value * area);
        });
    }
}

/// Scales columns so that each sums to one.
fn normalised(means: Mat<f64>) -> Mat<f64> {
    let totals: Vec<f64> = (0..means.ncols()).map(|k| means.col(k).iter().sum::<f64>()).collect();
    Mat::from_fn(means.nrows(), means.ncols(), |i, k| if totals[k] > 0.0 { means[(i, k)] / totals[k] } else { 0.0 })
}
