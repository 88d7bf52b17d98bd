//! Reduction of a mesh to a checked reduced-order model.

mod held;
mod outcome;
mod response;

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, ReductionBasis, RomChecks, WatchedPoints};
use tiprub_cosim::shown;

use crate::assembly::{Assembled, free_dofs};
use crate::contact_point::clamped_point;
use crate::craig_bampton::{CraigBampton, dense_modes};
use crate::eigen::{EigenModes, lowest_modes, positive_factor};
use crate::fe_model::FeModel;
use crate::free_interface::free_interface;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::progress::{Listener, ReductionStage, report, silent};
use crate::shapes::{Surface, SurfaceShapes};
use crate::sparse::{Factor, SparseMatrix, principal_pair, tall_product};
use crate::spin::{
    ReducedSpin, Resting, Rotating, SPARE_MODES, SpinCheck, SpinningStates, centrifugal_load, reduced_spin,
};
use crate::stress::{StressPlaces, recovered_stress};
use crate::thermal::uniform_heat;
use crate::{Error, Result};

pub use crate::contact_point::ContactPoint;
pub(crate) use held::HeldContact;
use outcome::build_rom;
pub(crate) use outcome::{contact_node, description, direction, element_names, interface, responses};
use response::{ContactResponse, with_responses};

/// Coordinates of a structure in addition to its static responses to contact forces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReductionKind {
    /// Modes of the structure with its contact nodes held (Craig and Bampton), as in the paper.
    #[default]
    FixedInterface,
    /// Modes of the structure as it is supported, with exact residual flexibility (MacNeal, Rubin).
    FreeInterface,
}

impl ReductionKind {
    /// Returns the basis as named in the ROM.
    pub(crate) fn basis(self) -> ReductionBasis {
        match self {
            Self::FixedInterface => ReductionBasis::FixedInterface,
            Self::FreeInterface => ReductionBasis::FreeInterface,
        }
    }
}

/// Options of a reduction.
#[derive(Debug, Clone, PartialEq)]
pub struct ReductionOptions {
    /// Name of the structure.
    pub name: String,
    /// Kind of the modes.
    pub kind: ReductionKind,
    /// Number of modes.
    pub modes: usize,
    /// Number of modes of the full model that are computed and compared with the reduced ones.
    pub checked_modes: usize,
    /// Number of identical uncoupled copies around the axis.
    pub sectors: usize,
    /// Directions of the contact displacements.
    pub frame: DisplacementFrame,
    /// Points whose displacements the ROM reports in addition to those of the contact nodes.
    pub watched: Vec<ContactPoint>,
    /// Places whose stress the ROM recovers; requires a mesh of one material.
    pub stress: StressPlaces,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

/// Mode of the full model, for figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Natural frequency (Hz).
    pub frequency: f64,
    /// Displacement (x, y, z) of every node of the mesh, mass-normalised (1/√kg).
    pub shape: Vec<[f64; 3]>,
}

/// Reduced-order model with the data of its reduction.
#[derive(Debug, Clone)]
pub struct Reduction {
    /// The reduced-order model, checks included.
    pub rom: Rom,
    /// Mesh of the model; `None` for a model from matrices or of several materials.
    pub mesh: Option<Mesh>,
    /// Material of all elements of that mesh.
    pub material: Option<Material>,
    /// Number of nodes of the full model.
    pub nodes: usize,
    /// Modes of the full model, ascending.
    pub modes: Vec<Mode>,
    /// Largest relative residual of these modes, see [`EigenModes::residuals`].
    pub largest_residual: f64,
    /// Number of degrees of freedom that are not clamped.
    pub free_dofs: usize,
    /// All natural angular frequencies of the reduced model (rad/s), ascending; the last one bounds explicit steps.
    pub reduced_angular_frequencies: Vec<f64>,
    /// Natural frequencies with the contact nodes held (Hz).
    pub fixed_interface_frequencies: Vec<f64>,
    /// Accuracy of the spin arrays at half the largest speed and at the largest; empty if they were not requested.
    pub spin_checks: Vec<SpinCheck>,
    /// Surface of the mesh with its displacements per reduced coordinate; `None` without a mesh.
    pub shapes: Option<SurfaceShapes>,
}

/// Reduces a mesh to its contact nodes and fixed-interface modes.
///
/// The reduced coordinates are the displacements of the contact nodes in `options.frame`, node by node, then the
/// fixed-interface modes; so `contact_map` is \[I 0\]. A structure without clamped nodes keeps its rigid-body modes.
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
/// # let options = tiprub_model::reduce::ReductionOptions {
/// #     name: "bar".into(),
/// #     kind: tiprub_model::reduce::ReductionKind::FreeInterface,
/// #     modes: 4,
/// #     checked_modes: 4,
/// #     sectors: 1,
/// #     frame: tiprub_core::scene::rom::DisplacementFrame::Cylindrical,
/// #     watched: Vec::new(),
/// #     stress: Default::default(),
/// #     damping_ratio: 0.005,
/// # };
///
/// # use tiprub_model::{progress::silent, read::{ContactChoice, choose_contact_nodes}};
/// let clamped = mesh.set("ROOT")?.to_vec();
/// let tip = choose_contact_nodes(&mesh.nodes, mesh.set("TIP")?, &ContactChoice { count: Some(2), names: Vec::new() })?;
/// let reduction = tiprub_model::reduce(mesh, &steel, &clamped, &tip, &options, &silent)?;
/// assert_eq!(reduction.rom.contact_nodes.len(), 2);
/// println!("first natural frequency: {:.1} Hz", reduction.rom.checks.full_frequencies[0]);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for contact nodes that are clamped, repeated or on the axis; the errors of assembly, eigenvalue
/// iteration and ROM validation.
pub fn reduce(
    mesh: Mesh,
    material: &Material,
    clamped: &[usize],
    contact: &[ContactPoint],
    options: &ReductionOptions,
    listener: Listener<'_>,
) -> Result<Reduction> {
    check_nodes(&mesh.nodes, clamped, contact, options.frame)?;
    let model = FeModel::assembled(mesh, material, String::new(), listener)?;
    reduce_model(model, clamped, contact, options, None, listener)
}

/// Reduces a model, from a mesh or from the matrices of another program, as [`reduce`] does.
///
/// With a `largest_speed` (rad/s), the effects of spin up to it are added, in [`tiprub_core::scene::rom::RomExtras::spin`],
/// see [`crate::spin`]; the rest of the ROM stays the same to the last bit.
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
/// # let options = tiprub_model::reduce::ReductionOptions {
/// #     name: "bar".into(),
/// #     kind: tiprub_model::reduce::ReductionKind::FreeInterface,
/// #     modes: 4,
/// #     checked_modes: 4,
/// #     sectors: 1,
/// #     frame: tiprub_core::scene::rom::DisplacementFrame::Cylindrical,
/// #     watched: Vec::new(),
/// #     stress: Default::default(),
/// #     damping_ratio: 0.005,
/// # };
///
/// # use tiprub_model::{FeModel, progress::silent, read::{ContactChoice, choose_contact_nodes}};
/// let clamped = mesh.set("ROOT")?.to_vec();
/// let tip = choose_contact_nodes(&mesh.nodes, mesh.set("TIP")?, &ContactChoice { count: Some(1), names: Vec::new() })?;
/// let model = FeModel::assembled(mesh, &steel, "three cubes".into(), &silent)?;
/// // With the effects of spin up to 1000 rad/s.
/// let reduction = tiprub_model::reduce_model(model, &clamped, &tip, &options, Some(1000.0), &silent)?;
/// assert!(reduction.rom.extras.spin.is_some());
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// The errors of [`reduce`]; [`Error::Invalid`] for a speed that is not finite and positive, for effects of spin
/// without a mesh or without clamped nodes, and if the structure has no equilibrium with the centrifugal force.
pub fn reduce_model(
    model: FeModel,
    clamped: &[usize],
    contact: &[ContactPoint],
    options: &ReductionOptions,
    largest_speed: Option<f64>,
    listener: Listener<'_>,
) -> Result<Reduction> {
    if let Some(speed) = largest_speed {
        check_speed(speed)?;
    }
    check_nodes(&model.nodes, clamped, contact, options.frame)?;
    // Threads of faer would split sums by the number of threads, but the bits of a ROM must not depend on it.
    faer::set_global_parallelism(faer::Par::Seq);
    let free = free_dofs(model.nodes.len(), clamped);
    let (stiffness, mass) = principal_pair(&model.stiffness, &model.mass, &free);
    // In the reduced model a free structure is only restrained by modes and inertia, which come from the same
    // iteration.
    let relieved = options.kind == ReductionKind::FreeInterface && clamped.is_empty();
    let own = if relieved { options.modes } else { 0 };
    let full = full_modes(&stiffness, &mass, clamped.is_empty(), options.checked_modes.max(own), listener)?;
    let own = full.modes.lowest(own);
    let full = full.truncated(options.checked_modes);
    let loads = contact_loads(&free, &model.nodes, contact, options.frame)?;
    let component_modes = |stiffness: &SparseMatrix, modes: usize, listener: Listener<'_>| match options.kind {
        ReductionKind::FixedInterface => {
            let held = HeldContact::new(&free, &model.nodes, contact, options.frame)?;
            held.craig_bampton(stiffness, &mass, modes, listener)
        }
        ReductionKind::FreeInterface if relieved => {
            let held = HeldContact::new(&free, &model.nodes, contact, options.frame)?;
            held.free_interface(stiffness, &mass, &own, listener)
        }
        ReductionKind::FreeInterface => free_interface(stiffness, &mass, loads.as_ref(), modes, listener),
    };
    let craig_bampton = component_modes(&stiffness, options.modes, listener)?;
    report(listener, ReductionStage::Checks, 0, 1);
    let (squares, vectors) = dense_modes(&craig_bampton.stiffness, &craig_bampton.mass)?;
    let checks = compare(&full, &mass, &craig_bampton, &squares, &vectors);
    let seen = ContactResponse { squares: &squares, shapes: vectors.rows(0, loads.ncols()).into_owned() };
    let checks = with_responses(checks, &full, &mass, &loads, &seen, options.frame);
    report(listener, ReductionStage::Checks, 1, 1);
    let spin = |speed| -> Result<ReducedSpin> {
        let resting = Resting { model: &craig_bampton, mass: &mass, free: &free, contact: loads.as_ref() };
        let states = spinning_states(&model, &free, &stiffness, speed, listener)?;
        let modes = (options.modes + SPARE_MODES).min(free.len() - loads.ncols());
        let middle = component_modes(&states.middle.stiffness, modes, &silent)?;
        report(listener, ReductionStage::Spin, 4, 6);
        let largest = component_modes(&states.largest.stiffness, modes, &silent)?;
        report(listener, ReductionStage::Spin, 5, 6);
        let spin = reduced_spin(&states, resting, &middle, &largest, options.checked_modes)?;
        report(listener, ReductionStage::Spin, 6, 6);
        Ok(spin)
    };
    let spin = largest_speed.map(spin).transpose()?;
    let (spin, spin_checks) = spin.map_or((None, Vec::new()), |ReducedSpin { spin, checks }| (Some(spin), checks));
    let mut rom = build_rom(&model, clamped.len(), contact, options, &craig_bampton, checks);
    rom.extras.spin = spin;
    let heat = uniform_heat(&model, &free)?;
    rom.extras.thermal = heat.as_ref().map(|heat| heat.reduced(&craig_bampton.transformation));
    rom.extras.watched = watched(&model, &free, &craig_bampton.transformation, options)?;
    if let Some(places) = recovered_stress(&model, &free, &full.modes.shapes, options)? {
        rom.extras.stress = Some(places.reduced(&craig_bampton.transformation));
        // An unsupported structure expands without stress.
        let moved = heat.map(|heat| if clamped.is_empty() { None } else { Some(full.responses(heat.forces)) });
        rom.extras.stress_thermal = moved.map(|moved| places.thermal(moved));
        if rom.extras.spin.is_some() {
            rom.extras.stress_centrifugal = Some(places.elastic(&full.responses(centrifugal_load(&model, &free))));
        }
    }
    let fixed_interface_frequencies = craig_bampton.fixed_interface_frequencies;
    let surface = model.mesh.as_ref().map(|(mesh, _)| Surface::new(mesh, &[]));
    let shapes = surface.map(|surface| surface.real(&free, &craig_bampton.transformation, None));
    let reduction = Reduction::new(rom, &full.modes, &free, &squares, (model.nodes.len(), model.mesh))?;
    Ok(Reduction { spin_checks, fixed_interface_frequencies, shapes, ..reduction })
}

fn check_speed(speed: f64) -> Result<()> {
    if speed.is_finite() && speed > 0.0 {
        return Ok(());
    }
    let problem = format!("{} rad/s is not positive and finite", shown(speed));
    Err(Error::invalid("largest speed", problem, "Give the largest speed of the simulation"))
}

fn spinning_states(
    model: &FeModel,
    free: &[usize],
    stiffness: &SparseMatrix,
    speed: f64,
    listener: Listener<'_>,
) -> Result<SpinningStates> {
    let Some((mesh, material)) = &model.mesh else {
        let problem = "the model has no mesh with a single material";
        return Err(Error::invalid(
            "effects of spin",
            problem,
            "Omit them, or give a mesh file with a single material",
        ));
    };
    let assembled = Assembled { stiffness: model.stiffness.clone(), mass: model.mass.clone() };
    let body = Rotating::new(mesh, material, &assembled, free, stiffness)?;
    SpinningStates::find(&body, speed, &|done| report(listener, ReductionStage::Spin, done, 6))
}

/// Modes of the full model, with the factor and shift of their iteration.
#[derive(Debug, Clone)]
pub struct FullModes {
    /// The modes.
    pub modes: EigenModes,
    /// K - σM.
    shifted: SparseMatrix,
    /// Factor of the matrix.
    factor: Factor,
    /// σ.
    shift: f64,
}

impl FullModes {
    /// Keeps the first `count` modes only.
    pub(crate) fn truncated(self, count: usize) -> Self {
        Self { modes: self.modes.lowest(count), ..self }
    }

    /// Returns the static displacements of the structure under these loads, (K - σM)⁻¹ f, free dofs × loads.
    pub(crate) fn responses(&self, loads: Mat<f64>) -> Mat<f64> {
        self.factor.solve(loads)
    }
}

/// Computes the lowest modes of a structure; `free` if it can move as a rigid body, which requires a negative shift.
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
/// # use tiprub_model::{FeModel, assembly::free_dofs, progress::silent, sparse::principal_pair};
/// let free = free_dofs(mesh.nodes.len(), mesh.set("ROOT")?);
/// let model = FeModel::assembled(mesh, &steel, String::new(), &silent)?;
/// let (stiffness, mass) = principal_pair(&model.stiffness, &model.mass, &free);
/// let full = tiprub_model::reduce::full_modes(&stiffness, &mass, false, 3, &silent)?;
/// assert_eq!(full.modes.frequencies().len(), 3);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::NotPositiveDefinite`] for an unsupported structure without `free`; the errors of [`lowest_modes`].
pub fn full_modes(
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    free: bool,
    count: usize,
    listener: Listener<'_>,
) -> Result<FullModes> {
    // tr K / tr M is of the order of the highest ω²; a millionth of it lies among the lowest elastic ones.
    let shift = if free { -1e-6 * stiffness.trace() / mass.trace() } else { 0.0 };
    let shifted = stiffness.plus_scaled(-shift, mass);
    let factor = positive_factor(
        &shifted,
        mass,
        "K (stiffness of the supported structure)",
        "Clamp at least three nodes that are not on one line, to prevent rigid-body motion",
    )?;
    let modes = lowest_modes(mass, &factor, shift, count.min(mass.order()), ReductionStage::FullModes, listener)?;
    Ok(FullModes { modes, shifted, factor, shift })
}

/// Computes the frequency deviation (eq. 13) and residual convergence criterion (eq. 12) of the lowest modes, both in
/// %.
///
/// Eq. 12: ε = rᵀKr / (zᵀTᵀKTz) with r = K⁻¹(K - ω²M)Tz, ω and z of the reduced model. For a free structure K - σM
/// replaces K, so that the norm exists.
pub(crate) fn compare(
    full: &FullModes,
    mass: &SparseMatrix,
    reduced: &CraigBampton,
    squares: &[f64],
    vectors: &DMatrix<f64>,
) -> RomChecks {
    let count = full.modes.eigenvalues.len().min(squares.len());
    let small = Mat::from_fn(vectors.nrows(), count, |i, k| vectors[(i, k)]);
    let shapes = &reduced.transformation * &small;
    let mut residuals = full.factor.solve(mass.times(shapes.as_ref()));
    for k in 0..count {
        for i in 0..shapes.nrows() {
            residuals[(i, k)] = shapes[(i, k)] - (squares[k] - full.shift) * residuals[(i, k)];
        }
    }
    let energy = |columns: &Mat<f64>| -> Vec<f64> {
        let forces = full.shifted.times(columns.as_ref());
        (0..count).map(|k| columns.col(k).transpose() * forces.col(k)).collect()
    };
    let residual_criterion =
        energy(&residuals).iter().zip(energy(&shapes)).map(|(residual, strain)| residual / strain * 100.0).collect();
    let to_hertz = |square: &f64| square.max(0.0).sqrt() / core::f64::consts::TAU;
    let full_frequencies: Vec<f64> = full.modes.eigenvalues[..count].iter().map(to_hertz).collect();
    let reduced_frequencies: Vec<f64> = squares[..count].iter().map(to_hertz).collect();
    // A rigid-body mode has no relative deviation.
    let deviation = |(f, r): (&f64, &f64)| if *f > 0.0 { (r - f) / f * 100.0 } else { 0.0 };
    let frequency_deviation = full_frequencies.iter().zip(&reduced_frequencies).map(deviation).collect();
    RomChecks { full_frequencies, reduced_frequencies, frequency_deviation, residual_criterion, ..RomChecks::default() }
}

pub(crate) fn check_nodes(
    nodes: &[[f64; 3]],
    clamped: &[usize],
    contact: &[ContactPoint],
    frame: DisplacementFrame,
) -> Result<()> {
    let touching = contact.iter().flat_map(ContactPoint::weights).map(|(node, _)| node);
    for node in clamped.iter().copied().chain(touching) {
        if node >= nodes.len() {
            let problem = format!("node {} does not exist; the mesh has {} nodes", node + 1, nodes.len());
            return Err(Error::invalid("clamped or contact nodes", problem, "Choose nodes of the mesh"));
        }
    }
    for (index, point) in contact.iter().enumerate() {
        let what = || format!("contact node `{}`", point.name);
        if point.weights().any(|(node, _)| clamped.contains(&node)) {
            return Err(clamped_point(point));
        }
        let on_axis = |(node, _): (usize, f64)| nodes[node][0].hypot(nodes[node][1]) <= 0.0;
        if frame == DisplacementFrame::Cylindrical && point.weights().any(on_axis) {
            let problem = "it lies on the z axis, where the radial direction is undefined";
            return Err(Error::invalid(what(), problem, "Choose another node or the Cartesian frame"));
        }
        let same = |other: &ContactPoint| other.patch.is_empty() && point.patch.is_empty() && other.node == point.node;
        if contact[..index].iter().any(|other| same(other) || other.name == point.name) {
            return Err(Error::invalid(what(), "its node or name appears twice", "List every contact node only once"));
        }
    }
    Ok(())
}

/// Returns unit forces on the contact coordinates, free dofs × 3·points: the three directions of each node in
/// `frame`, distributed over the nodes of a patch in the directions of each node.
fn contact_loads(
    free: &[usize],
    nodes: &[[f64; 3]],
    contact: &[ContactPoint],
    frame: DisplacementFrame,
) -> Result<Mat<f64>> {
    let mut loads = Mat::zeros(free.len(), 3 * contact.len());
    for (index, point) in contact.iter().enumerate() {
        for (node, weight) in point.weights() {
            let (cos, sin) = if frame == DisplacementFrame::Cylindrical { direction(nodes[node]) } else { (1.0, 0.0) };
            for (component, unit) in [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
                for (axis, share) in unit.into_iter().enumerate() {
                    let row = free.binary_search(&(3 * node + axis)).map_err(|_| clamped_point(point))?;
                    loads[(row, 3 * index + component)] = weight * share;
                }
            }
        }
    }
    Ok(loads)
}

/// Returns the displacements of the watched points per reduced coordinate, in the directions of the contact nodes.
fn watched(
    model: &FeModel,
    free: &[usize],
    transformation: &Mat<f64>,
    options: &ReductionOptions,
) -> Result<Option<WatchedPoints>> {
    if options.watched.is_empty() {
        return Ok(None);
    }
    let rows = contact_loads(free, &model.nodes, &options.watched, options.frame)?;
    let map = tall_product(rows.as_ref(), transformation.as_ref());
    let map = DMatrix::from_fn(map.nrows(), map.ncols(), |i, j| map[(i, j)]);
    let points = options.watched.iter().map(|point| {
        let ContactNode { name, position, .. } = contact_node(&model.nodes, point, options.frame);
        ContactNode { name, position, ..ContactNode::default() }
    });
    Ok(Some(WatchedPoints { map, points: points.collect() }))
}
