//! Thermal loads: static effect of one kelvin of a patch on the structure.
//!
//! A patch is a set of elements with one temperature T above the reference, at which the mesh is free of stress. The
//! strain α T of its elements acts like the nodal forces f T with f = ∫ Bᵀ D α dV over the patch; loads of several
//! patches add up. Forces and moments of every f vanish, since a rigid motion causes no strain. The temperature jumps
//! at the edges of a patch: the loads represent the deformation of the whole, not the stress at these edges.

use core::f64::consts::{PI, TAU};
use std::collections::BTreeMap;

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_core::scene::rom::Thermal;
use tiprub_cosim::ThermalPatch;

use crate::element::{ElementKind, QuadraturePoint, thermal_load_of};
use crate::fe_model::FeModel;
use crate::material::Material;
use crate::mesh::{Element, Mesh};
use crate::sparse::tall_product;
use crate::{Error, Result};

/// Tolerance of the edge between two patches. Centroids within this fraction of a turn, or of the axial extent of the
/// mesh, belong to the patch that begins there, independent of rounding. Corners within this fraction of the extent
/// of the element lie on the edge.
const EDGE: f64 = 1e-9;

/// Returns equal patches, `around` × `along`, over a whole turn from θ = 0 and the axial positions `axial` (m); those
/// of one ring are consecutive.
///
/// # Examples
/// ```
/// let patches = tiprub_model::thermal::equal_patches(12, 2, [0.0, 0.1]);
/// assert_eq!(patches.len(), 24);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn equal_patches(around: usize, along: usize, axial: [f64; 2]) -> Vec<ThermalPatch> {
    let part = |[from, to]: [f64; 2], index: usize, count: usize| {
        [index, index + 1].map(|edge| if edge == count { to } else { from + (to - from) * edge as f64 / count as f64 })
    };
    let ring =
        |k| (0..around).map(move |i| ThermalPatch { angle: part([0.0, TAU], i, around), axial: part(axial, k, along) });
    (0..along).flat_map(ring).collect()
}

/// Returns the patch that contains the whole mesh.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
///
/// let patch = tiprub_model::thermal::whole_mesh(&mesh);
/// assert!(patch.axial[0] < 0.0 && patch.axial[1] > 0.02);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn whole_mesh(mesh: &Mesh) -> ThermalPatch {
    let axial = mesh.nodes.iter().map(|node| node[2]);
    let (low, high) = axial.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
    // Beyond the last centroid.
    let margin = 0.01 * (high - low);
    ThermalPatch { angle: [0.0, TAU], axial: [low - margin, high + margin] }
}

/// Returns the patch of every element: the one that contains its centroid (mean of its corners).
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
///
/// let patch = tiprub_model::thermal::whole_mesh(&mesh);
/// assert_eq!(tiprub_model::thermal::patch_of_elements(&mesh, &[patch])?, [Some(0); 3]);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for a patch without elements and for patches that overlap.
pub fn patch_of_elements(mesh: &Mesh, patches: &[ThermalPatch]) -> Result<Vec<Option<usize>>> {
    let (low, high) = mesh
        .nodes
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), node| (low.min(node[2]), high.max(node[2])));
    let slack = EDGE * (high - low);
    let mut filled = vec![false; patches.len()];
    let mut found = Vec::with_capacity(mesh.elements.len());
    for (number, element) in mesh.elements.iter().enumerate() {
        let [x, y, z] = centroid(mesh, element);
        let angle = y.atan2(x);
        let mut inside = (0..patches.len()).filter(|&patch| contains(&patches[patch], angle, z, slack));
        let first = inside.next();
        if let (Some(first), Some(second)) = (first, inside.next()) {
            return Err(Error::invalid(
                format!("thermal patches {} and {}", first + 1, second + 1),
                format!("both contain element {}", number + 1),
                "Give patches that do not overlap",
            ));
        }
        if let Some(patch) = first {
            filled[patch] = true;
        }
        found.push(first);
    }
    if let Some(empty) = filled.iter().position(|&filled| !filled) {
        let ThermalPatch { angle, axial } = patches[empty];
        return Err(Error::invalid(
            format!("thermal patch {}", empty + 1),
            format!("no element has its centroid at angles {angle:?} rad and axial positions {axial:?} m"),
            "Give fewer or larger patches, or refine the mesh",
        ));
    }
    Ok(found)
}

/// Part of an element that belongs to patches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ElementShare {
    /// No patch contains any part of it.
    Nothing,
    /// One patch contains all of it.
    Whole(usize),
    /// Borders of patches pass through it.
    Divided,
}

/// Returns the part of each element that belongs to patches.
///
/// # Errors
/// The errors of [`patch_of_elements`].
pub(crate) fn shares_of_elements(mesh: &Mesh, patches: &[ThermalPatch]) -> Result<Vec<ElementShare>> {
    let share = |(element, found): (&Element, Option<usize>)| {
        let corners = || element.nodes[..element.kind.corner_count()].iter().map(|&node| mesh.nodes[node]);
        let ends = |axis: usize| {
            let values = corners().map(|corner| corner[axis]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let [low, high] = ends(2);
        let slack = EDGE * (high - low);
        let [x, y, _] = centroid(mesh, element);
        // Angles of the corners relative to the middle of a patch.
        let within = |patch: &ThermalPatch| {
            let (middle, half) = (0.5 * (patch.angle[0] + patch.angle[1]), 0.5 * (patch.angle[1] - patch.angle[0]));
            let turned = (y.atan2(x) - middle + PI).rem_euclid(TAU) - PI;
            let around = corners().all(|[cx, cy, _]| {
                let off = (cy * x - cx * y).atan2(cx * x + cy * y);
                half > PI * (1.0 - EDGE) || (turned + off).abs() <= half + TAU * EDGE
            });
            around && low >= patch.axial[0] - slack && high <= patch.axial[1] + slack
        };
        match found {
            Some(patch) if within(&patches[patch]) => ElementShare::Whole(patch),
            // Even without a patch at its middle, the element may extend into one.
            None if patches.is_empty() => ElementShare::Nothing,
            _ => ElementShare::Divided,
        }
    };
    Ok(mesh.elements.iter().zip(patch_of_elements(mesh, patches)?).map(share).collect())
}

/// Groups the points of an integration rule by the patches that contain them.
pub(crate) fn patches_of_points(
    coordinates: &[[f64; 3]],
    (kind, rule): (ElementKind, &[QuadraturePoint]),
    patches: &[ThermalPatch],
) -> Vec<(usize, Vec<QuadraturePoint>)> {
    let mut found: BTreeMap<usize, Vec<QuadraturePoint>> = BTreeMap::new();
    for point in rule {
        let shape = kind.shape(point.point);
        let [x, y, z]: [f64; 3] =
            core::array::from_fn(|i| coordinates.iter().zip(shape.values).map(|(x, value)| x[i] * value).sum());
        if let Some(patch) = patches.iter().position(|patch| contains(patch, y.atan2(x), z, 0.0)) {
            found.entry(patch).or_default().push(*point);
        }
    }
    found.into_iter().collect()
}

/// Returns the nodal forces per kelvin of each patch, dofs (3·node + component) × patches (N/K). Elements across the
/// border of a patch contribute the integration points that lie in it, so that the loads of patches that fill the
/// mesh add up to that of the whole.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
/// # let steel = Material::steel();
///
/// let patch = tiprub_model::thermal::whole_mesh(&mesh);
/// let loads = tiprub_model::thermal::patch_loads(&mesh, &steel, &[patch])?;
/// // Thermal loads are in equilibrium.
/// let along_x: f64 = (0..16).map(|node| loads[(3 * node, 0)]).sum();
/// assert!(along_x.abs() < 1e-6 * loads.norm_max());
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// The errors of [`patch_of_elements`]; [`Error::NegativeJacobian`].
pub fn patch_loads(mesh: &Mesh, material: &Material, patches: &[ThermalPatch]) -> Result<Mat<f64>> {
    let mut loads = Mat::zeros(3 * mesh.nodes.len(), patches.len());
    for (number, (element, share)) in mesh.elements.iter().zip(shares_of_elements(mesh, patches)?).enumerate() {
        let coordinates = mesh.coordinates(element);
        let rule = element.kind.stiffness_rule();
        let parts = match share {
            ElementShare::Nothing => Vec::new(),
            ElementShare::Whole(patch) => vec![(patch, rule)],
            ElementShare::Divided => patches_of_points(&coordinates, (element.kind, &rule), patches),
        };
        for (patch, rule) in parts {
            let forces = thermal_load_of(element.kind, &coordinates, material, &rule, number)?;
            for (&node, force) in element.nodes.iter().zip(forces.as_chunks::<3>().0) {
                for component in 0..3 {
                    loads[(3 * node + component, patch)] += force[component];
                }
            }
        }
    }
    Ok(loads)
}

/// Thermal load of the whole structure.
pub(crate) struct UniformHeat {
    /// Nodal forces per kelvin, free dofs × 1 (N/K).
    pub(crate) forces: Mat<f64>,
    patches: Vec<ThermalPatch>,
}

/// Returns the load per kelvin of the whole structure, for a mesh of one material with thermal expansion.
pub(crate) fn uniform_heat(model: &FeModel, free: &[usize]) -> Result<Option<UniformHeat>> {
    let Some((mesh, material)) = model.mesh.as_ref().filter(|(_, material)| material.expansion != 0.0) else {
        return Ok(None);
    };
    let patches = vec![whole_mesh(mesh)];
    let forces = patch_loads(mesh, material, &patches)?;
    Ok(Some(UniformHeat { forces: Mat::from_fn(free.len(), 1, |row, _| forces[(free[row], 0)]), patches }))
}

impl UniformHeat {
    /// Transforms the load to reduced coordinates. These include static responses to contact forces, so that the free
    /// expansion of the contact nodes is that of the full model.
    pub(crate) fn reduced(&self, transformation: &Mat<f64>) -> Thermal {
        let loads = tall_product(transformation.as_ref(), self.forces.as_ref());
        Thermal { loads: DMatrix::from_fn(loads.nrows(), 1, |i, j| loads[(i, j)]), patches: self.patches.clone() }
    }
}

fn centroid(mesh: &Mesh, element: &Element) -> [f64; 3] {
    let corners = &element.nodes[..element.kind.corner_count()];
    core::array::from_fn(|i| corners.iter().map(|&node| mesh.nodes[node][i]).sum::<f64>() / corners.len() as f64)
}

/// Returns whether a point lies in a patch, its lower edges included.
fn contains(patch: &ThermalPatch, angle: f64, axial: f64, slack: f64) -> bool {
    let beyond = (angle - patch.angle[0]).rem_euclid(TAU);
    // Just below the edge counts as on it.
    let beyond = if beyond > TAU * (1.0 - EDGE) { 0.0 } else { beyond };
    let width = patch.angle[1] - patch.angle[0];
    // A patch around the whole circumference has no edge.
    let around = beyond < width - TAU * EDGE || width > TAU * (1.0 - EDGE);
    around && axial >= patch.axial[0] - slack && axial < patch.axial[1] - slack
}
