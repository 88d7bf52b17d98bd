//! The reduced-order model of one structure, as plain data.
//!
//! A ROM is the result of a Craig-Bampton (or any other linear) reduction of a finite-element model: small dense mass and stiffness
//! matrices and the map from reduced coordinates to the displacement of the contact nodes. `sectors` identical copies of it are arranged
//! around the axis: uncoupled (blades on a rigid hub), or coupled, with a small pencil per nodal diameter ([`Harmonic`]). `sectors = 1` is
//! a single general structure.

mod cyclic;
mod grid;
mod watched;

use nalgebra::{ComplexField, DMatrix};
use tiprub_cosim::{ThermalPatch, bounds, shown};

use crate::scene::ranges;
use crate::{Error, Result};
pub use cyclic::Harmonic;
pub(crate) use cyclic::cholesky;
pub use watched::{STRESSES, WatchedPoints, von_mises};

/// Largest number of sectors of a ROM. Bladed disks have tens to a few hundred; a damaged or malicious file must not exhaust the memory,
/// which would end the process of the importer.
pub const MAX_SECTORS: usize = 10_000;

/// Directions of the three displacement components of a contact node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DisplacementFrame {
    /// (radial, tangential, axial) at the position of the node, turning with the structure.
    Cylindrical,
    /// (x, y, z), fixed to the structure.
    Cartesian,
}

/// One contact node or contact patch of the first sector.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ContactNode {
    /// Name used in variable names and plots, for example `leading_edge`.
    pub name: String,
    /// Undeformed position: (r, θ, z) in m, rad, m for [`DisplacementFrame::Cylindrical`], otherwise (x, y, z) in m.
    pub position: [f64; 3],
    /// Slope dr/dz of the tip contour in the meridional plane at this node (the casing runs parallel to it).
    pub meridional_slope: f64,
    /// Area that a patch represents, the integral of its weight over the tip (m²); 0 for a node.
    pub area: f64,
    /// Length along the chord that a patch represents, the integral of its weight along the chord (m); 0 for a node.
    pub length: f64,
}

/// Meaning of the coordinates of a ROM besides static responses to contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReductionBasis {
    /// Modes with the contact nodes held (Craig-Bampton), or unknown.
    #[default]
    FixedInterface,
    /// Modes of the structure with its supports only (MacNeal, Rubin).
    FreeInterface,
}

/// Errors that a reduction causes in a rub: errors of the displacements of the tip (relative L2) compared with the limit of refinement.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RubErrors {
    /// Description of the scene on which they were measured.
    pub found_on: String,
    /// Error by the number of modes; `None` if unknown.
    pub modes: Option<f64>,
    /// Error by the number of contact patches or nodes along the chord.
    pub patches: Option<f64>,
    /// Error by the number of rows of patches across the thickness.
    pub rows: Option<f64>,
    /// Error by the mesh.
    pub mesh: Option<f64>,
}

impl RubErrors {
    /// Returns whether all errors are unknown.
    pub fn is_empty(&self) -> bool {
        [self.modes, self.patches, self.rows, self.mesh].iter().all(Option::is_none)
    }
}

/// Agreement of the reduced model with the full one. Vectors are empty if the ROM is from another program.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RomChecks {
    /// Natural frequencies of the full finite-element model (Hz), ascending.
    pub full_frequencies: Vec<f64>,
    /// Natural frequencies of the reduced model (Hz), ascending, same modes.
    pub reduced_frequencies: Vec<f64>,
    /// Frequency deviation per mode (%), eq. 13 of the paper.
    pub frequency_deviation: Vec<f64>,
    /// Residual convergence criterion per mode (%), eq. 12 of the paper.
    pub residual_criterion: Vec<f64>,
    /// Nodal diameter of each mode of a structure with coupled sectors, otherwise empty. A mode with 0 < 2n < sectors represents two modes
    /// of the whole disk.
    pub nodal_diameters: Vec<u32>,
    /// Deviation of the static flexibility at each contact node or patch from the full model (%).
    pub flexibility_deviation: Vec<f64>,
    /// Frequencies (Hz) of the forced responses that were compared, ascending.
    pub response_frequencies: Vec<f64>,
    /// Deviation of the forced response at the contact nodes from that of the full model at each of these frequencies (%), all contact
    /// nodes and directions together.
    pub response_deviation: Vec<f64>,
    /// Errors in a rub, if they are known.
    pub rub_errors: Option<RubErrors>,
}

/// Effects of a steady speed Ω about the z axis on one structure, in its reduced coordinates.
///
/// M q̈ + (D + 2ΩG) q̇ + (K + Ω²K₁ + Ω⁴K₂) q = f + Ω²c + Ω⁴c₂ in the rotating frame; K₁ contains both spin softening and centrifugal
/// stiffening.
#[derive(Debug, Clone, PartialEq)]
pub struct Spin {
    /// K₁, n × n, symmetric (kg for physical coordinates).
    pub stiffness_speed2: DMatrix<f64>,
    /// K₂, n × n, symmetric (kg·s²).
    pub stiffness_speed4: DMatrix<f64>,
    /// G, n × n, skew-symmetric (kg): Coriolis force 2ΩG q̇.
    pub coriolis: DMatrix<f64>,
    /// c, n values: centrifugal force per Ω² (kg·m).
    pub centrifugal_load: Vec<f64>,
    /// c₂, n values (kg·m·s²). K(Ω) is the stiffness of small motions about the stretched shape, so that the load in equilibrium with this
    /// shape is not Ω²c alone. With the stiffness K at rest instead of K(Ω), Ω²c alone is correct.
    pub centrifugal_load_speed4: Vec<f64>,
    /// Largest |Ω| for which K₁ and K₂ were fitted (rad/s).
    pub largest_speed: f64,
}

/// Number of components of a support force: forces along x, y, z (N) and moments about x, y, z through the origin
/// (N·m).
pub const SUPPORT_ROWS: usize = 6;

/// Rows of the finite-element equations at the constrained nodes, which a reduction omits. R = S_K q + S_M q̈ − S_T T
/// contains the force and the moment of the support on the structure, in fixed directions and about the origin.
///
/// With the six rigid motions r of the constrained nodes s and the displacements u = Vq of the free nodes f, S_K =
/// rᵀK_sf V and S_M = rᵀM_sf V. S_T = rᵀf_s contains the loads f per kelvin of each patch.
#[derive(Debug, Clone, PartialEq)]
pub struct SupportRows {
    /// S_K, 6 × n (N or N·m per unit coordinate).
    pub stiffness: DMatrix<f64>,
    /// S_M, 6 × n (kg or kg·m for coordinates that are displacements).
    pub mass: DMatrix<f64>,
    /// S_T, 6 × patches (N/K or N·m/K); no columns without thermal loads.
    pub thermal: DMatrix<f64>,
}

/// Thermal loads of one structure.
#[derive(Debug, Clone, PartialEq)]
pub struct Thermal {
    /// Force on the reduced coordinates per kelvin of each patch above the reference, n × patches (N/K).
    pub loads: DMatrix<f64>,
    /// Positions of the patches.
    pub patches: Vec<ThermalPatch>,
}

/// Contact nodes that form a grid: node `along · around + i` is the i-th of row `along`.
///
/// A closed grid is a ring around the z axis in a cylindrical frame: rows (rings) in order of increasing z, nodes of a ring at increasing
/// angles 2π/around apart, at least 4 × 2. An open grid is a quadrilateral grid of any shape in a Cartesian frame with four free edges, at
/// least 2 × 2; with s increasing along a row and t from row to row, contact with the surface S(s, t) through its nodes is on the side to
/// which S_t × S_s points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ContactGrid {
    /// Nodes of a row: around the circumference if the grid is closed.
    pub around: usize,
    /// Rows: rings along the axis if the grid is closed.
    pub along: usize,
    /// True if the last node of a row is followed by its first.
    pub closed: bool,
}

/// Optional data of a ROM, which only some scenes need.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RomExtras {
    /// Effects of spin.
    pub spin: Option<Spin>,
    /// Thermal loads.
    pub thermal: Option<Thermal>,
    /// Contact nodes as a grid through which a surface spline can be laid.
    pub grid: Option<ContactGrid>,
    /// Nodal diameters 1 ..= sectors/2 of coupled sectors; those of diameter 0 are the ROM's own matrices. Empty for uncoupled sectors and
    /// single structures.
    pub harmonics: Vec<Harmonic>,
    /// Watched points.
    pub watched: Option<WatchedPoints>,
    /// Places at which stress is recovered.
    pub stress: Option<WatchedPoints>,
    /// Static stress of the full model at these places per kelvin of each patch, 6·places × patches (Pa/K), for the supported structure
    /// without contact.
    pub stress_thermal: Option<DMatrix<f64>>,
    /// Static stress at these places per Ω² of the centrifugal load on the structure at rest, 6·places × 1 (Pa s²).
    pub stress_centrifugal: Option<DMatrix<f64>>,
    /// Forces on the held nodes.
    pub support: Option<SupportRows>,
    /// Meaning of the coordinates.
    pub basis: ReductionBasis,
    /// Number of rows of contact patches across the thickness of the tip, one row after the other, with equal patches along the chord;
    /// `None` for one row, or nodes.
    pub rows: Option<usize>,
}

/// Reduced-order model of one structure.
#[derive(Debug, Clone, PartialEq)]
pub struct Rom {
    /// Name of the structure.
    pub name: String,
    /// Origin: mesh counts, material, reduction, in one or a few sentences.
    pub origin: String,
    /// Number of identical copies around the axis (1 to [`MAX_SECTORS`]); uncoupled unless there are harmonics.
    pub sectors: usize,
    /// Directions of the displacement components.
    pub frame: DisplacementFrame,
    /// Reduced mass matrix, n × n (kg for physical coordinates), symmetric positive definite.
    pub mass: DMatrix<f64>,
    /// Reduced stiffness matrix, n × n, symmetric positive semidefinite.
    pub stiffness: DMatrix<f64>,
    /// Modal damping ratio proposed by the author of the ROM; the scene may override it.
    pub damping_ratio: f64,
    /// Displacement of the contact nodes, 3·nodes × n; rows (node, component).
    pub contact_map: DMatrix<f64>,
    /// The contact nodes of the first sector.
    pub contact_nodes: Vec<ContactNode>,
    /// Quality of the reduction.
    pub checks: RomChecks,
    /// Spin, heat, contact grid: empty for most structures.
    pub extras: RomExtras,
}

impl Rom {
    /// Number of reduced coordinates of one sector.
    pub fn order(&self) -> usize {
        self.mass.nrows()
    }

    /// Returns whether all contact nodes are patches with an area and a length along the chord.
    pub fn has_patches(&self) -> bool {
        self.contact_nodes.iter().all(|node| node.area > 0.0 && node.length > 0.0)
    }

    /// Checks shapes, finiteness, symmetry and definiteness.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the array and the remedy.
    pub fn validate(&self) -> Result<()> {
        self.validate_basics()?;
        for (index, node) in self.contact_nodes.iter().enumerate() {
            self.validate_place(&format!("ROM array `contact_positions`, node {}", index + 1), node)?;
            let what = format!("ROM array `contact_meridional_slopes`, node {}", index + 1);
            bounds::at_most(&what, node.meridional_slope, ranges::SLOPE)?;
            for (name, value, most) in [
                ("contact_areas", node.area, ranges::POSITION * ranges::POSITION),
                ("contact_lengths", node.length, ranges::POSITION),
            ] {
                bounds::within(&format!("ROM array `{name}`, node {}", index + 1), value, 0.0, most)?;
            }
        }
        symmetric("mass", &self.mass, "symmetric", 1.0)?;
        symmetric("stiffness", &self.stiffness, "symmetric", 1.0)?;
        if self.mass.clone().cholesky().is_none() {
            return refuse("ROM array `mass`", "not positive definite");
        }
        self.validate_spin()?;
        self.validate_thermal()?;
        self.validate_grid()?;
        self.validate_rows()?;
        self.validate_watched()?;
        self.validate_support()?;
        self.validate_harmonics()
    }

    /// Checks the data that every ROM has.
    fn validate_basics(&self) -> Result<()> {
        let (order, nodes) = (self.order(), self.contact_nodes.len());
        if order == 0 {
            return refuse("ROM array `mass`", format!("shape {:?} is empty", self.mass.shape()));
        }
        if nodes == 0 {
            return refuse("ROM array `contact_positions`", "no contact nodes");
        }
        array("mass", &self.mass, (order, order), bounds::MATRIX)?;
        array("stiffness", &self.stiffness, (order, order), bounds::MATRIX)?;
        array("contact_map", &self.contact_map, (3 * nodes, order), ranges::MAP)?;
        if self.sectors == 0 {
            return refuse("ROM metadata `sectors`", "zero sectors");
        }
        if self.sectors > MAX_SECTORS {
            let problem = format!("{} sectors exceed the limit of {MAX_SECTORS}", self.sectors);
            return refuse("ROM metadata `sectors`", problem);
        }
        if !(0.0..1.0).contains(&self.damping_ratio) {
            let problem = format!("{} is outside 0 ≤ ξ < 1", shown(self.damping_ratio));
            return refuse("ROM metadata `damping_ratio`", problem);
        }
        Ok(())
    }

    /// Checks that lengths are plausible for a machine in metres.
    fn validate_place(&self, what: &str, node: &ContactNode) -> Result<()> {
        let finite = node.position.iter().all(|value| value.is_finite());
        let radius_positive = self.frame == DisplacementFrame::Cartesian || node.position[0] > 0.0;
        if !finite || !radius_positive {
            let problem = format!("{:?} is not finite, or its radius is not positive", node.position);
            return refuse(what, problem);
        }
        let mut lengths = &node.position[..];
        if self.frame == DisplacementFrame::Cylindrical {
            bounds::within(what, node.position[0], ranges::SMALLEST_RADIUS, ranges::POSITION)?;
            bounds::at_most(what, node.position[1], ranges::ANGLE)?;
            lengths = &node.position[2..];
        }
        lengths.iter().try_for_each(|length| bounds::at_most(what, *length, ranges::POSITION))
    }

    fn validate_spin(&self) -> Result<()> {
        let Some(spin) = &self.extras.spin else { return Ok(()) };
        let order = self.order();
        for (name, matrix, kind, sign) in [
            ("stiffness_speed2", &spin.stiffness_speed2, "symmetric", 1.0),
            ("stiffness_speed4", &spin.stiffness_speed4, "symmetric", 1.0),
            ("coriolis", &spin.coriolis, "skew-symmetric", -1.0),
        ] {
            array(name, matrix, (order, order), bounds::MATRIX)?;
            symmetric(name, matrix, kind, sign)?;
        }
        let loads =
            [("centrifugal_load", &spin.centrifugal_load), ("centrifugal_load_speed4", &spin.centrifugal_load_speed4)];
        for (name, load) in loads {
            array(name, &DMatrix::from_column_slice(load.len(), 1, load), (order, 1), bounds::MATRIX)?;
        }
        if !(spin.largest_speed.is_finite() && spin.largest_speed > 0.0) {
            let problem = format!("{} rad/s is not a finite positive speed", shown(spin.largest_speed));
            return refuse("ROM metadata `largest_speed`", problem);
        }
        bounds::at_most("ROM metadata `largest_speed`", spin.largest_speed, ranges::SPEED)
    }

    fn validate_thermal(&self) -> Result<()> {
        let Some(thermal) = &self.extras.thermal else { return Ok(()) };
        if thermal.patches.is_empty() {
            return refuse("ROM array `thermal_loads`", "no patches");
        }
        array("thermal_loads", &thermal.loads, (self.order(), thermal.patches.len()), ranges::THERMAL_LOAD)?;
        for (index, patch) in thermal.patches.iter().enumerate() {
            let what = format!("ROM array `thermal_patches`, patch {}", index + 1);
            let finite = patch.angle.iter().chain(&patch.axial).all(|value| value.is_finite());
            let turn = patch.angle[1] - patch.angle[0];
            let ordered =
                turn > 0.0 && turn <= std::f64::consts::TAU * (1.0 + 1e-12) && patch.axial[0] < patch.axial[1];
            if !(finite && ordered) {
                let problem = format!(
                    "angles {:?} rad and axial positions {:?} m do not define a patch",
                    patch.angle, patch.axial
                );
                return refuse(what, problem);
            }
            patch.angle.iter().try_for_each(|value| bounds::at_most(&what, *value, ranges::ANGLE))?;
            patch.axial.iter().try_for_each(|value| bounds::at_most(&what, *value, ranges::POSITION))?;
        }
        Ok(())
    }

    fn validate_support(&self) -> Result<()> {
        let Some(support) = &self.extras.support else { return Ok(()) };
        let patches = self.extras.thermal.as_ref().map_or(0, |thermal| thermal.patches.len());
        let order = self.order();
        array("support_stiffness", &support.stiffness, (SUPPORT_ROWS, order), bounds::MATRIX)?;
        array("support_mass", &support.mass, (SUPPORT_ROWS, order), bounds::MATRIX)?;
        array("support_thermal", &support.thermal, (SUPPORT_ROWS, patches), ranges::THERMAL_LOAD)?;
        if self.sectors != 1 {
            let problem = format!("not supported for a ROM with {} sectors", self.sectors);
            let remedy = "Remove it, or use a ROM with one sector";
            return Err(Error::invalid("ROM array `support_stiffness`", problem, remedy));
        }
        Ok(())
    }
}

/// Rejects data of a ROM.
fn refuse(what: impl ToString, problem: impl ToString) -> Result<()> {
    let remedy = "Regenerate the ROM with `tiprub reduce`, or see the ROM file chapter of the user guide";
    Err(Error::invalid(what, problem, remedy))
}

/// Checks the shape of an array, and that its entries are finite, and small enough that squares do not overflow.
fn array<T: ComplexField<RealField = f64>>(
    name: &str,
    matrix: &DMatrix<T>,
    expected: (usize, usize),
    most: f64,
) -> Result<()> {
    let what = format!("ROM array `{name}`");
    if matrix.shape() != expected {
        return refuse(what, format!("shape {:?} found, {expected:?} expected", matrix.shape()));
    }
    let is_invalid = |value: &T| size(value).is_nan() || size(value) > most;
    let Some(index) = matrix.iter().position(is_invalid) else { return Ok(()) };
    let (row, column, value) = (index % matrix.nrows(), index / matrix.nrows(), size(&matrix[index]));
    let problem = if value.is_finite() {
        format!("entry of magnitude {} at ({row}, {column}) exceeds {}", shown(value), shown(most))
    } else {
        format!("non-finite entry at ({row}, {column})")
    };
    refuse(what, problem)
}

/// Checks that a matrix is Hermitian, or symmetric if it is real (`sign` 1), or skew-symmetric (−1).
fn symmetric<T: ComplexField<RealField = f64>>(name: &str, matrix: &DMatrix<T>, kind: &str, sign: f64) -> Result<()> {
    let (asymmetry, most) = (largest(&(matrix - matrix.adjoint() * T::from_real(sign))), largest(matrix));
    if asymmetry <= 1e-8 * most {
        return Ok(());
    }
    let problem = format!("not {kind}: deviation {asymmetry:.3e}, largest entry {most:.3e}");
    refuse(format!("ROM array `{name}`"), problem)
}

/// Magnitude of an entry.
fn size<T: ComplexField<RealField = f64>>(value: &T) -> f64 {
    libm::hypot(value.clone().real(), value.clone().imaginary())
}

/// Largest magnitude of an entry.
fn largest<T: ComplexField<RealField = f64>>(matrix: &DMatrix<T>) -> f64 {
    matrix.iter().fold(0.0, |most: f64, value| most.max(size(value)))
}
