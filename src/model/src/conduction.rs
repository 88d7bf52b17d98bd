//! Heat conduction of a casing: finite elements on the mesh of its mechanical model, reduced for the thermal unit.
//!
//! C Ṫ + (K + s_g H_g + s_a H_a) T = heat, with the heat capacity C = ∫ρc N Nᵀ, conduction K = ∫k ∇N·∇N, and films H =
//! ∫h N Nᵀ on the surface in the gas and on that in the air. Faces that face the axis are in the gas, the end faces
//! are adiabatic, all others are in the air. Heat is distributed evenly over the heated surface of a patch, which is
//! the part of the gas-side surface between two axial positions, usually the outermost contact rings; faces across a
//! border are cut there. Patches are those of the mechanical model, with the same numbers.

mod reduction;
mod surfaces;

pub use reduction::{
    ConductionReduction, SteadyCheck, reduce_conduction, reduce_mesh_conduction, reduce_ring_conduction,
};
pub use surfaces::Surfaces;

use std::sync::Arc;

use faer::Mat;
use nalgebra::DMatrix;
use rayon::prelude::*;
use tiprub_cosim::ThermalPatch;
use tiprub_cosim::shown;

use crate::assembly::neighbours;
use crate::element::{conduction, consistent_mass, shape_integrals};
use crate::mesh::Mesh;
use crate::sparse::{Pattern, SparseMatrix};
use crate::thermal::{ElementShare, patches_of_points, shares_of_elements};
use crate::{Error, Result};

/// Thermal properties of a material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conductor {
    /// Conductivity k (W/(m K)).
    pub conductivity: f64,
    /// Specific heat capacity c (J/(kg K)).
    pub specific_heat: f64,
}

impl Conductor {
    /// Returns the diffusivity k/(ρc) at a density (m²/s).
    pub fn diffusivity(&self, density: f64) -> f64 {
        self.conductivity / (density * self.specific_heat)
    }

    /// Returns the properties of carbon steel at 20 °C: k = 54 − 0.0333·20, c = 425 + 0.773·20 − 1.69e-3·20² +
    /// 2.22e-6·20³ (EN 1993-1-2, 3.4.1.3 and 3.4.1.2).
    pub fn steel() -> Self {
        Self { conductivity: 53.3, specific_heat: 439.8 }
    }

    /// Returns the properties of Ti-6Al-4V, annealed, at room temperature (ASM).
    pub fn titanium() -> Self {
        Self { conductivity: 6.7, specific_heat: 526.3 }
    }
}

/// Options of the reduction of a conduction model.
#[derive(Debug, Clone, PartialEq)]
pub struct ConductionOptions {
    /// Name of the model.
    pub name: String,
    /// Density ρ (kg/m³).
    pub density: f64,
    /// Material.
    pub conductor: Conductor,
    /// Film coefficients h of the gas inside and of the air outside (W/(m² K)); one may be 0.
    pub films: [f64; 2],
    /// Axial positions (m) between which faces in the gas are heated.
    pub heated: [f64; 2],
    /// Corner nodes of the faces that are heated; all faces in the gas if absent.
    pub surface: Option<Vec<usize>>,
    /// Number of eigenmodes, in addition to the uniform temperature and the static responses.
    pub modes: usize,
}

/// Default film coefficient of the gas (W/(m² K)): of the order of a turbulent boundary layer at the wall of a
/// compressor.
pub const GAS_FILM: f64 = 500.0;
/// Default film coefficient of the air outside (W/(m² K)): weak forced convection.
pub const AMBIENT_FILM: f64 = 25.0;
/// Default number of eigenmodes.
pub const MODES: usize = 20;

impl ConductionOptions {
    pub(crate) fn validate(&self) -> Result<()> {
        if self.modes == 0 {
            return Err(Error::invalid("thermal model, number of modes", "it is zero", "Request at least one"));
        }
        for (what, value) in [
            ("density (kg/m³)", self.density),
            ("conductivity (W/(m K))", self.conductor.conductivity),
            ("specific heat capacity (J/(kg K))", self.conductor.specific_heat),
        ] {
            if !(value.is_finite() && value > 0.0) {
                let problem = format!("{} is not positive", shown(value));
                let remedy = "Give a positive value in SI units";
                return Err(Error::invalid(format!("thermal model, {what}"), problem, remedy));
            }
        }
        if self.films.iter().any(|film| !(film.is_finite() && *film >= 0.0))
            || self.films.iter().all(|film| *film <= 0.0)
        {
            let problem = format!("{} inside and {} outside are invalid", shown(self.films[0]), shown(self.films[1]));
            let remedy = "Give non-negative values, at least one of them above 0: there is no steady state without convection. \
                          The inputs gas_convection_factor and ambient_convection_factor of the FMU can switch convection off";
            return Err(Error::invalid("thermal model, film coefficients (W/(m² K))", problem, remedy));
        }
        Ok(())
    }
}

/// Full model.
#[derive(Debug, Clone)]
pub struct FullConduction {
    /// C (J/K).
    pub capacity: SparseMatrix,
    /// K (W/K).
    pub conduction: SparseMatrix,
    /// H of the gas and of the air (W/K).
    pub films: [SparseMatrix; 2],
    /// ∫ N dA / A of the surfaces in the gas and in the air, nodes × 2.
    pub wetted: Mat<f64>,
    /// ∫ N dV / V of each patch, nodes × patches.
    pub patch_means: Mat<f64>,
    /// ∫ N dA / A of the heated surface of each patch, nodes × patches; also the load of one watt on that patch.
    pub heat: Mat<f64>,
    /// Corner nodes of heated faces, ascending.
    pub places: Vec<usize>,
    /// Areas in the gas, in the air, and heated (m²).
    pub areas: [f64; 3],
    /// Largest depth of an element under the heated surface (m).
    pub depth: f64,
}

impl FullConduction {
    /// Assembles the full model.
    ///
    /// # Errors
    /// Invalid options or mesh; patches without elements or without a heated face.
    pub fn new(mesh: &Mesh, patches: &[ThermalPatch], options: &ConductionOptions) -> Result<Self> {
        options.validate()?;
        mesh.validate()?;
        if patches.is_empty() {
            let remedy = "Define at least one, for example with --patches 12x1";
            return Err(Error::invalid("thermal model, patches", "none defined", remedy));
        }
        let pattern = Arc::new(node_pattern(mesh));
        let surfaces = Surfaces::new(mesh, options.heated, options.surface.as_deref())?;
        let (conduction, capacity) = volumes(mesh, options, &pattern)?;
        let films = [0, 1].map(|side| surfaces.film(mesh, &pattern, side, options.films[side]));
        Ok(Self {
            wetted: surfaces.wetted_means(mesh),
            heat: surfaces.heat(mesh, patches)?,
            patch_means: patch_means(mesh, patches)?,
            places: surfaces.places(mesh),
            areas: surfaces.areas(mesh),
            depth: surfaces.depth(mesh)?,
            conduction,
            capacity,
            films,
        })
    }

    /// Returns K + s_g H_g + s_a H_a.
    pub fn operator(&self, factors: [f64; 2]) -> SparseMatrix {
        self.conduction.plus_scaled(factors[0], &self.films[0]).plus_scaled(factors[1], &self.films[1])
    }

    /// Returns H 1, the heat from gas and air per kelvin, nodes × 2 (W/K).
    pub fn film_loads(&self) -> Mat<f64> {
        let ones = Mat::from_fn(self.capacity.order(), 1, |_, _| 1.0);
        let loads = [0, 1].map(|side| self.films[side].times(ones.as_ref()));
        Mat::from_fn(self.capacity.order(), 2, |i, side| loads[side][(i, 0)])
    }
}

/// Returns the pattern of the node neighbours.
fn node_pattern(mesh: &Mesh) -> Pattern {
    let lists = neighbours(mesh);
    let mut starts = vec![0];
    starts.extend(lists.iter().scan(0, |end, list| {
        *end += list.len();
        Some(*end)
    }));
    Pattern { starts, rows: lists.concat() }
}

/// Adds a dense matrix of some nodes.
fn add(pattern: &Pattern, values: &mut [f64], nodes: &[usize], entry: impl Fn(usize, usize) -> f64) {
    for (b, &column) in nodes.iter().enumerate() {
        let start = pattern.starts[column];
        let rows = &pattern.rows[start..pattern.starts[column + 1]];
        for (a, &row) in nodes.iter().enumerate() {
            let place = rows.binary_search(&row).expect("the sparsity pattern contains all element pairs");
            values[start + place] += entry(a, b);
        }
    }
}

/// Computes K and C.
fn volumes(mesh: &Mesh, options: &ConductionOptions, pattern: &Arc<Pattern>) -> Result<(SparseMatrix, SparseMatrix)> {
    let stored = options.density * options.conductor.specific_heat;
    let of_elements: Vec<Result<[DMatrix<f64>; 2]>> = mesh
        .elements
        .par_iter()
        .enumerate()
        .map(|(number, element)| {
            let coordinates = mesh.coordinates(element);
            Ok([
                conduction(element.kind, &coordinates, options.conductor.conductivity, number)?,
                consistent_mass(element.kind, &coordinates, stored, number)?,
            ])
        })
        .collect();
    let [mut first, mut second] = [0, 1].map(|_| vec![0.0; pattern.rows.len()]);
    for (element, pair) in mesh.elements.iter().zip(of_elements) {
        let [conducted, stored] = pair?;
        add(pattern, &mut first, &element.nodes, |a, b| conducted[(a, b)]);
        add(pattern, &mut second, &element.nodes, |a, b| stored[(a, b)]);
    }
    let matrix = |values| SparseMatrix { pattern: Arc::clone(pattern), values };
    Ok((matrix(first), matrix(second)))
}

/// Computes ∫ N dV / V of each patch; elements across a border contribute the integration points of their mass matrix
/// that lie in the patch.
fn patch_means(mesh: &Mesh, patches: &[ThermalPatch]) -> Result<Mat<f64>> {
    let mut means = Mat::<f64>::zeros(mesh.nodes.len(), patches.len());
    let mut volumes = vec![0.0; patches.len()];
    for (number, (element, share)) in mesh.elements.iter().zip(shares_of_elements(mesh, patches)?).enumerate() {
        let coordinates = mesh.coordinates(element);
        let parts = match share {
            ElementShare::Nothing => Vec::new(),
            ElementShare::Whole(patch) => {
                let products = consistent_mass(element.kind, &coordinates, 1.0, number)?;
                vec![(patch, products.row_sum().iter().copied().collect::<Vec<f64>>())]
            }
            ElementShare::Divided => {
                patches_of_points(&coordinates, (element.kind, &element.kind.mass_rule()), patches)
                    .into_iter()
                    .map(|(patch, rule)| Ok((patch, shape_integrals(element.kind, &coordinates, &rule, number)?)))
                    .collect::<Result<_>>()?
            }
        };
        for (patch, integrals) in parts {
            for (&node, part) in element.nodes.iter().zip(integrals) {
                means[(node, patch)] += part;
                volumes[patch] += part;
            }
        }
    }
    Ok(Mat::from_fn(mesh.nodes.len(), patches.len(), |i, k| means[(i, k)] / volumes[k]))
}
