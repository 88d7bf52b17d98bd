//! Reduction of the full conduction model to coordinates.
//!
//! The basis contains the uniform temperature, so that heat is conserved; the slowest eigenmodes of K + H_g + H_a and
//! C, for slow transients; and static responses to the heat of each patch and to gas and air, so that every steady
//! state at the given film coefficients is exact. Further static responses, without convection of the gas and with
//! four times its convection, make steady states at other factors accurate. Responses to heat that grows as exp(σt),
//! at σ of ten, a hundred and a thousand times the slowest rate, make the start of transients accurate, since
//! eigenmodes represent local, fast changes poorly (a rational Krylov space). The remaining error is measured.

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_cosim::ThermalPatch;
use tiprub_thermal::ConductionModel;

use super::{ConductionOptions, FullConduction};
use crate::casing::{CasingOptions, supported_ring};
use crate::eigen::{EigenModes, lowest_modes, positive_factor};
use crate::inner_surface::InnerSurface;
use crate::mesh::Mesh;
use crate::progress::{Listener, ReductionStage, report};
use crate::read::bounding_box;
use crate::sparse::{SparseMatrix, tall_product};
use crate::thermal::equal_patches;
use crate::{Error, Result};

/// Inverse iterations from the uniform temperature for an upper estimate of the slowest rate.
const ITERATIONS: usize = 10;
/// Fraction of the slowest rate that is used as the shift of the eigenvalue iteration.
const BELOW: f64 = 0.98;
/// Fraction of a vector that must remain after orthogonalisation; a vector with less depends on the vectors before.
const DEPENDENT: f64 = 1e-9;
/// Growth rates, as multiples of the slowest rate of decay, whose responses are in the basis.
const GROWTHS: [f64; 3] = [10.0, 100.0, 1000.0];
/// Factors of gas and air whose steady states are compared with the full model.
const CHECKED: [[f64; 2]; 6] = [[1.0, 1.0], [0.1, 1.0], [0.3, 1.0], [3.0, 1.0], [10.0, 1.0], [1.0, 10.0]];

/// Comparison of a steady state of the reduced model with that of the full one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyCheck {
    /// Factors of gas and air.
    pub factors: [f64; 2],
    /// Largest deviation of the mean temperature of a patch under heat of one patch, as a fraction of the largest.
    pub patches: f64,
    /// Largest deviation of the mean temperature of a heated surface, likewise.
    pub surfaces: f64,
}

/// Result of a reduction.
#[derive(Debug, Clone)]
pub struct ConductionReduction {
    /// Reduced model.
    pub model: ConductionModel,
    /// Numbers of nodes and elements of the mesh.
    pub counts: [usize; 2],
    /// Areas in the gas, in the air, and heated (m²).
    pub areas: [f64; 3],
    /// 1/λ of the slowest eigenmodes of the full model (s).
    pub time_constants: Vec<f64>,
    /// Checks of steady states.
    pub checks: Vec<SteadyCheck>,
}

/// Reduces the heat conduction of the casing that `reduce_ring` reduces: same mesh, same patches, heated between its
/// contact rings.
///
/// # Errors
/// The errors of [`supported_ring`] and [`reduce_conduction`].
pub fn reduce_ring_conduction(
    casing: &CasingOptions,
    options: &ConductionOptions,
    listener: Listener<'_>,
) -> Result<ConductionReduction> {
    report(listener, ReductionStage::Mesh, 0, 1);
    let ring = supported_ring(casing)?;
    let [around, along] = casing.patches;
    let patches = equal_patches(around, along, casing.geometry.contour.axial());
    report(listener, ReductionStage::Mesh, 1, 1);
    reduce_conduction(&ring.mesh, &patches, options, listener)
}

/// Reduces the conduction of a user mesh, a full ring about the z axis, with equal patches `[around, along]` over its
/// length. The [`InnerSurface`] of the `set` of nodes (all nodes if absent) is heated between the axial positions
/// `heated` (m; everywhere if absent).
///
/// # Errors
/// The errors of [`InnerSurface::find`] and [`reduce_conduction`].
pub fn reduce_mesh_conduction(
    mesh: &Mesh,
    (set, heated): (Option<&[usize]>, Option<[f64; 2]>),
    [around, along]: [usize; 2],
    options: &ConductionOptions,
    listener: Listener<'_>,
) -> Result<ConductionReduction> {
    let surface = InnerSurface::find(mesh, set, heated)?;
    let [low, high] = bounding_box(&mesh.nodes);
    let patches = equal_patches(around, along, [low[2], high[2]]);
    let heated = heated.unwrap_or_else(|| surface.axial());
    let options = ConductionOptions { heated, surface: Some(surface.corner_nodes()), ..options.clone() };
    reduce_conduction(mesh, &patches, &options, listener)
}

/// Reduces the conduction of a mesh around the z axis.
///
/// # Errors
/// The errors of [`FullConduction::new`], of the eigenvalue iteration, and of [`ConductionModel::validate`].
pub fn reduce_conduction(
    mesh: &Mesh,
    patches: &[ThermalPatch],
    options: &ConductionOptions,
    listener: Listener<'_>,
) -> Result<ConductionReduction> {
    // As for blades: threads of faer would split sums by the number of threads, on which the bits of the model would
    // depend.
    faer::set_global_parallelism(faer::Par::Seq);
    report(listener, ReductionStage::Assembly, 0, 1);
    let full = FullConduction::new(mesh, patches, options)?;
    report(listener, ReductionStage::Assembly, 1, 1);
    let nominal = full.operator([1.0; 2]);
    let modes = slowest_modes(&full.capacity, &nominal, options.modes, listener)?;
    let basis = basis(&full, &modes, options.films)?;
    report(listener, ReductionStage::Checks, 0, 1);
    let model = project(mesh, &full, &basis, (patches, options))?;
    model.validate()?;
    let mut checks = Vec::new();
    for factors in CHECKED {
        // The factor of a side without a film has no effect.
        if factors.iter().zip(options.films).all(|(factor, film)| film > 0.0 || (*factor - 1.0).abs() < f64::EPSILON) {
            checks.push(check(&full, &model, factors)?);
        }
    }
    report(listener, ReductionStage::Checks, 1, 1);
    Ok(ConductionReduction {
        model,
        counts: [mesh.nodes.len(), mesh.elements.len()],
        areas: full.areas,
        time_constants: modes.eigenvalues.iter().map(|rate| 1.0 / rate).collect(),
        checks,
    })
}

/// Computes the slowest eigenmodes of K + H. The rates of a casing with low conductivity are so close together that
/// the iteration cannot separate them from a shift of zero; from a shift just below the slowest one they are well
/// separated.
fn slowest_modes(
    capacity: &SparseMatrix,
    operator: &SparseMatrix,
    count: usize,
    listener: Listener<'_>,
) -> Result<EigenModes> {
    let held = positive_factor(operator, capacity, OPERATOR, NO_HOLD)?;
    let found = lowest_modes(capacity, &held, 0.0, count, ReductionStage::FullModes, listener);
    if !matches!(found, Err(Error::NotConverged { .. })) {
        return found;
    }
    let mut vector = Mat::from_fn(capacity.order(), 1, |_, _| 1.0);
    for _ in 0..ITERATIONS {
        vector = held.solve(capacity.times(vector.as_ref()));
    }
    let product = |matrix: &SparseMatrix| vector.col(0).transpose() * matrix.times(vector.as_ref()).col(0);
    let shift = BELOW * product(operator) / product(capacity);
    // Fails if the shift is not below the slowest rate after all.
    match operator.plus_scaled(-shift, capacity).factor(OPERATOR, NO_HOLD) {
        Ok(near) => lowest_modes(capacity, &near, shift, count, ReductionStage::FullModes, listener),
        Err(_) => found,
    }
}

const OPERATOR: &str = "K + H (conduction and films)";
const NO_HOLD: &str = "Check the mesh for disconnected parts";

/// Builds C-orthonormal vectors, the uniform temperature first; nodes × coordinates.
fn basis(full: &FullConduction, modes: &EigenModes, films: [f64; 2]) -> Result<Mat<f64>> {
    let nodes = full.capacity.order();
    let mut vectors: Vec<Mat<f64>> = vec![Mat::from_fn(nodes, 1, |_, _| 1.0), modes.shapes.clone()];
    // Without convection of the gas, the air alone must remove the heat.
    let still = [if films[1] > 0.0 { 0.0 } else { 0.05 }, 1.0];
    for factors in [[1.0, 1.0], still, [4.0, 1.0]] {
        vectors.push(response(full, factors, 0.0)?);
    }
    for growth in GROWTHS {
        vectors.push(response(full, [1.0; 2], growth * modes.eigenvalues[0])?);
    }
    let mut basis = Mat::<f64>::zeros(nodes, vectors.iter().map(Mat::ncols).sum());
    let mut size = 0;
    for vector in vectors.iter().flat_map(|part| (0..part.ncols()).map(move |k| part.get(.., k..k + 1))) {
        let mut column = vector.to_owned();
        let first = norm(full, &column);
        // The second pass removes the rounding errors of the first.
        for _pass in 0..2 {
            let weighted = full.capacity.times(column.as_ref());
            let before = basis.get(.., ..size);
            let part = tall_product(before, weighted.as_ref());
            column -= before * part;
        }
        let left = norm(full, &column);
        if left > DEPENDENT * first {
            basis.get_mut(.., size..size + 1).copy_from(&column);
            basis.col_mut(size).iter_mut().for_each(|value| *value /= left);
            size += 1;
        }
    }
    Ok(basis.get(.., ..size).to_owned())
}

fn norm(full: &FullConduction, column: &Mat<f64>) -> f64 {
    let weighted = full.capacity.times(column.as_ref());
    (column.col(0).transpose() * weighted.col(0)).max(0.0).sqrt()
}

/// Computes the responses to one watt in each patch and to one kelvin of the gas and of the air that grow at the rate
/// `growth` (1/s, 0 for steady states); nodes × (patches + 2).
fn response(full: &FullConduction, factors: [f64; 2], growth: f64) -> Result<Mat<f64>> {
    let (patches, films) = (full.heat.ncols(), full.film_loads());
    let loads = Mat::from_fn(full.capacity.order(), patches + 2, |i, k| {
        if k < patches { full.heat[(i, k)] } else { films[(i, k - patches)] }
    });
    let operator = full.operator(factors).plus_scaled(growth, &full.capacity);
    Ok(operator.factor(OPERATOR, NO_HOLD)?.solve(loads))
}

fn project(
    mesh: &Mesh,
    full: &FullConduction,
    basis: &Mat<f64>,
    (patches, options): (&[ThermalPatch], &ConductionOptions),
) -> Result<ConductionModel> {
    let order = basis.ncols();
    let product = |matrix: &SparseMatrix| {
        let product = tall_product(basis.as_ref(), matrix.times(basis.as_ref()).as_ref());
        DMatrix::from_fn(order, order, |i, j| 0.5 * (product[(i, j)] + product[(j, i)]))
    };
    let means = |columns: &Mat<f64>| {
        let product = tall_product(columns.as_ref(), basis.as_ref());
        DMatrix::from_fn(columns.ncols(), order, |i, j| product[(i, j)])
    };
    let ones = Mat::from_fn(full.capacity.order(), 1, |_, _| 1.0);
    let heat_capacity = ones.col(0).transpose() * full.capacity.times(ones.as_ref()).col(0);
    let mut conduction = product(&full.conduction);
    // A uniform temperature causes no conduction; the entries are rounding errors.
    conduction.row_mut(0).fill(0.0);
    conduction.column_mut(0).fill(0.0);
    let mut heat_loads = means(&full.heat).transpose();
    heat_loads.row_mut(0).fill(1.0 / heat_capacity.sqrt());
    let mut wetted_means = means(&full.wetted);
    if full.areas[1] == 0.0 {
        return Err(Error::invalid(
            "thermal model",
            "no face of the mesh is exposed to the ambient air",
            "Check the mesh, whose axis must be z",
        ));
    }
    let mut patch_means = means(&full.patch_means);
    let mut places = DMatrix::from_fn(full.places.len(), order, |i, j| basis[(full.places[i], j)]);
    for rows in [&mut wetted_means, &mut patch_means, &mut places] {
        rows.column_mut(0).fill(1.0 / heat_capacity.sqrt());
    }
    Ok(ConductionModel {
        name: options.name.clone(),
        origin: origin(mesh, full, order, options),
        heat_capacity,
        conduction,
        gas_convection: product(&full.films[0]),
        ambient_convection: product(&full.films[1]),
        heat_loads,
        patch_means,
        wetted_means,
        places,
        patches: patches.to_vec(),
        element_time: full.depth * full.depth / options.conductor.diffusivity(options.density),
    })
}

fn origin(mesh: &Mesh, full: &FullConduction, order: usize, options: &ConductionOptions) -> String {
    format!(
        "{} nodes, {} elements; rho = {} kg/m3, c = {} J/(kg K), k = {} W/(m K); films of {} W/(m2 K) on {:.6} m2 inside and {} on {:.6} m2 \
         outside; heated {:.6} m2 from z = {} m to {} m; {} modes and steady-state responses, {order} coordinates",
        mesh.nodes.len(),
        mesh.elements.len(),
        options.density,
        options.conductor.specific_heat,
        options.conductor.conductivity,
        options.films[0],
        full.areas[0],
        options.films[1],
        full.areas[1],
        full.areas[2],
        options.heated[0],
        options.heated[1],
        options.modes,
    )
}

/// Compares steady states under one watt in each patch.
fn check(full: &FullConduction, model: &ConductionModel, factors: [f64; 2]) -> Result<SteadyCheck> {
    let patches = full.heat.ncols();
    let exact = response(full, factors, 0.0)?;
    let exact = exact.get(.., ..patches);
    let matrix = &model.conduction + &model.gas_convection * factors[0] + &model.ambient_convection * factors[1];
    let reduced = matrix
        .cholesky()
        .ok_or_else(|| Error::NotPositiveDefinite { matrix: "K + H (reduced)".into(), remedy: NO_HOLD.into() })?;
    let reduced = reduced.solve(&model.heat_loads);
    let deviation = |rows: &DMatrix<f64>, columns: &Mat<f64>| {
        let exact = tall_product(columns.as_ref(), exact);
        let found = rows * &reduced;
        let pairs = || (0..patches).flat_map(|i| (0..patches).map(move |j| (i, j)));
        let largest = pairs().map(|(i, j)| exact[(i, j)].abs()).fold(0.0, f64::max);
        pairs().map(|(i, j)| (exact[(i, j)] - found[(i, j)]).abs()).fold(0.0, f64::max) / largest
    };
    Ok(SteadyCheck {
        factors,
        patches: deviation(&model.patch_means, &full.patch_means),
        surfaces: deviation(&model.heat_loads.transpose(), &full.heat),
    })
}
