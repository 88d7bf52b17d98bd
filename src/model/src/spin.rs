//! Effects of a steady spin about the z axis on a rotating structure, in the rotating frame.
//!
//! At speed Ω the structure is in the equilibrium u(Ω) of elastic and centrifugal forces, both of which are nonlinear
//! ([`Rotating::equilibrium`]). Small motions about it obey
//!
//! M ü + (D + 2ΩG) u̇ + K(Ω) (u - u(Ω)) = f, K(Ω) = K_T(u(Ω)) - Ω²M_xy, G = ∫ρ Nᵀ \[0 -1 0; 1 0 0; 0 0 0\] N,
//!
//! with the tangent stiffness K_T (elasticity of the deformed structure, its stress) and the spin softening -Ω²M_xy.
//! Craig-Bampton reduces each of these states with its constraint and fixed-interface modes, rotated so that the
//! coordinates and the mass matrix stay those of the resting structure; its stiffness K(Ω) is fitted by K₀ + Ω²K₁ +
//! Ω⁴K₂ through three speeds, 0, 0.6 Ω and Ω (`reduced_spin`). With separate modes a state needs no more coordinates
//! than the resting structure; the resting modes would represent the untwist with spurious membrane strain. The load
//! Ω²c + Ω⁴c₂ is such that its static response under K(Ω) is the growth u(Ω) of the contact nodes, exactly at 0.6 Ω
//! and Ω.
//!
//! The fit over the speed follows Sternchüss and Balmès, Proc. ISMA 2006, pp. 3925-3939.

mod equilibrium;
mod reduced;

pub use equilibrium::{Rotating, SpinningState, turned_about_axis, without_axial};
pub use reduced::SpinCheck;
pub(crate) use reduced::{ReducedSpin, Resting, SPARE_MODES, SpinningStates, reduced_spin};

use faer::Mat;
use nalgebra::{DMatrix, DVector};
use tiprub_core::Rom;
use tiprub_core::scene::rom::Spin;

use crate::craig_bampton::dense_modes;
use crate::fe_model::FeModel;
use crate::{Error, Result};

/// Returns the centrifugal force on the free dofs of the resting structure per Ω², ∫ρ Nᵀ(x, y, 0), one column (kg m).
pub(crate) fn centrifugal_load(model: &FeModel, free: &[usize]) -> Mat<f64> {
    let radial =
        Mat::from_fn(3 * model.nodes.len(), 1, |dof, _| if dof % 3 == 2 { 0.0 } else { model.nodes[dof / 3][dof % 3] });
    let load = model.mass.times(radial.as_ref());
    Mat::from_fn(free.len(), 1, |row, _| load[(free[row], 0)])
}

/// Returns the stiffness of a reduced model at a speed (rad/s): K₀ + Ω²K₁ + Ω⁴K₂.
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
/// # use tiprub_model::{FeModel, progress::silent, read::{ContactChoice, choose_contact_nodes}};
/// # let clamped = mesh.set("ROOT")?.to_vec();
/// # let tip = choose_contact_nodes(&mesh.nodes, mesh.set("TIP")?, &ContactChoice { count: Some(1), names: Vec::new() })?;
/// # let model = FeModel::assembled(mesh, &steel, "three cubes".into(), &silent)?;
/// # let rom = tiprub_model::reduce_model(model, &clamped, &tip, &options, Some(1000.0), &silent)?.rom;
///
/// let spin = rom.extras.spin.as_ref().expect("spin matrices");
/// let stiffness = tiprub_model::spin::stiffness_at(&rom.stiffness, spin, 500.0);
/// assert_eq!(stiffness.nrows(), rom.order());
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn stiffness_at(resting: &DMatrix<f64>, spin: &Spin, speed: f64) -> DMatrix<f64> {
    let square = speed * speed;
    resting + &spin.stiffness_speed2 * square + &spin.stiffness_speed4 * (square * square)
}

/// Returns the static growth of a reduced model at a speed (rad/s): K(Ω)⁻¹ (Ω²c + Ω⁴c₂), in reduced coordinates.
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
/// # use tiprub_model::{FeModel, progress::silent, read::{ContactChoice, choose_contact_nodes}};
/// # let clamped = mesh.set("ROOT")?.to_vec();
/// # let tip = choose_contact_nodes(&mesh.nodes, mesh.set("TIP")?, &ContactChoice { count: Some(1), names: Vec::new() })?;
/// # let model = FeModel::assembled(mesh, &steel, "three cubes".into(), &silent)?;
/// # let rom = tiprub_model::reduce_model(model, &clamped, &tip, &options, Some(1000.0), &silent)?.rom;
///
/// let spin = rom.extras.spin.as_ref().expect("spin matrices");
/// let growth = tiprub_model::spin::static_growth(&rom.stiffness, spin, 500.0)?;
/// // Radial displacement of the first contact node.
/// assert!((&rom.contact_map * growth)[0] > 0.0);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::NotPositiveDefinite`] if K(Ω) is not positive definite, as at speeds far beyond the fitted ones.
pub fn static_growth(resting: &DMatrix<f64>, spin: &Spin, speed: f64) -> Result<DVector<f64>> {
    let factor = stiffness_at(resting, spin, speed).cholesky().ok_or_else(|| Error::NotPositiveDefinite {
        matrix: format!("K (reduced stiffness at {speed} rad/s)"),
        remedy: format!("Stay within the {} rad/s that the spin matrices were fitted for", spin.largest_speed),
    })?;
    let square = speed * speed;
    let (second, fourth) = (&spin.centrifugal_load, &spin.centrifugal_load_speed4);
    let load = DVector::from_iterator(
        second.len(),
        second.iter().zip(fourth).map(|(second, fourth)| square * (second + square * fourth)),
    );
    Ok(factor.solve(&load))
}

/// Returns the natural frequencies (Hz) at a speed (rad/s), ascending, with or without the Coriolis force, undamped.
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
/// # use tiprub_model::{FeModel, progress::silent, read::{ContactChoice, choose_contact_nodes}};
/// # let clamped = mesh.set("ROOT")?.to_vec();
/// # let tip = choose_contact_nodes(&mesh.nodes, mesh.set("TIP")?, &ContactChoice { count: Some(1), names: Vec::new() })?;
/// # let model = FeModel::assembled(mesh, &steel, "three cubes".into(), &silent)?;
/// # let rom = tiprub_model::reduce_model(model, &clamped, &tip, &options, Some(1000.0), &silent)?.rom;
///
/// // Rotation stiffens a clamped blade.
/// let [resting, turning] = [0.0, 1000.0].map(|speed| tiprub_model::spin::frequencies_at(&rom, speed, false));
/// assert!(turning?[0] > resting?[0]);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for a ROM without spin matrices, [`Error::NotPositiveDefinite`] for an invalid mass matrix.
pub fn frequencies_at(rom: &Rom, speed: f64, coriolis: bool) -> Result<Vec<f64>> {
    let Some(spin) = &rom.extras.spin else {
        let remedy = "Reduce the model with `--spin` and the largest speed";
        return Err(Error::invalid(format!("ROM `{}`", rom.name), "it has no spin matrices", remedy));
    };
    let (squares, vectors) = dense_modes(&stiffness_at(&rom.stiffness, spin, speed), &rom.mass)?;
    let strength = if coriolis { 2.0 * speed } else { 0.0 };
    Ok(gyroscopic_frequencies(&squares, &(vectors.transpose() * &spin.coriolis * &vectors * strength)))
}

/// Returns the natural frequencies (Hz), ascending, of q̈ + g q̇ + diag(ω²) q = 0 with a skew-symmetric g (1/s) and
/// `squares` ω².
///
/// With Λ = diag(ω) the motion is d/dt (Λq, q̇) = A (Λq, q̇), A = \[0 Λ; -Λ -g\] skew-symmetric: its eigenvalues are
/// ±iω, so the eigenvalues of AᵀA are the squares, each twice.
///
/// # Examples
/// ```
/// let frequencies = tiprub_model::spin::gyroscopic_frequencies(&[1.0, 4.0], &nalgebra::DMatrix::zeros(2, 2));
/// assert!((frequencies[0] - 0.5 / std::f64::consts::PI).abs() < 1e-12);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn gyroscopic_frequencies(squares: &[f64], gyroscopic: &DMatrix<f64>) -> Vec<f64> {
    let order = squares.len();
    let mut system = DMatrix::zeros(2 * order, 2 * order);
    system.view_mut((order, order), (order, order)).copy_from(&-gyroscopic);
    for (k, square) in squares.iter().enumerate() {
        let omega = square.max(0.0).sqrt();
        system[(k, order + k)] = omega;
        system[(order + k, k)] = -omega;
    }
    let mut doubled: Vec<f64> = (system.transpose() * &system).symmetric_eigenvalues().iter().copied().collect();
    doubled.sort_by(f64::total_cmp);
    let mean = |pair: &[f64]| (0.5 * (pair[0] + pair[1])).max(0.0).sqrt() / core::f64::consts::TAU;
    doubled.chunks_exact(2).map(mean).collect()
}
