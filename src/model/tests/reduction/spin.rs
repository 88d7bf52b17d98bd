//! Centrifugal and Coriolis forces, spinning states and their reduction against closed forms.

use crate::common::{blade_steel, distorted_box, nodes_at, straight_box, wobble};
use faer::Mat;
use nalgebra::DMatrix;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_model::assembly::{Assembled, assemble, free_dofs};
use tiprub_model::craig_bampton::dense_modes;
use tiprub_model::element::ElementKind;
use tiprub_model::progress::silent;
use tiprub_model::reduce::{ContactPoint, ReductionKind, ReductionOptions, full_modes};
use tiprub_model::sparse::{SparseMatrix, principal_pair};
use tiprub_model::spin::{
    Rotating, SpinningState, frequencies_at, gyroscopic_frequencies, turned_about_axis, without_axial,
};
use tiprub_model::stress::StressPlaces;
use tiprub_model::{FeModel, Material, Mesh, Reduction, Result, reduce, reduce_model};

fn column(rows: usize, entry: impl Fn(usize) -> f64) -> Mat<f64> {
    Mat::from_fn(rows, 1, |i, _| entry(i))
}

/// A rigid body at speed Ω: its Coriolis force is 2m Ω×v, its centrifugal force mΩ² times the distance of its centre.
#[test]
fn spin_forces_on_rigid_body_act_at_its_centre_of_mass() {
    let (size, corner) = ([0.3, 0.04, 0.05], [0.2, -0.1, 0.4]);
    for kind in ElementKind::ALL {
        let mut mesh = distorted_box(kind, [3, 2, 2], size, wobble(0.1));
        mesh.nodes.iter_mut().for_each(|x| (0..3).for_each(|i| x[i] += corner[i]));
        let mass = assemble(&mesh, &blade_steel(0.3), &silent).unwrap().mass;
        let (dofs, weight) = (mass.order(), 8000.0 * size.iter().product::<f64>());
        let total = |forces: &Mat<f64>, i: usize| (0..dofs / 3).map(|node| forces[(3 * node + i, 0)]).sum::<f64>();
        let velocity = [1.5, -0.7, 0.4];
        let motion = column(dofs, |dof| velocity[dof % 3]);
        let all: Vec<usize> = (0..dofs).collect();
        let coriolis = mass.times(turned_about_axis(&all, &motion).as_ref());
        let centrifugal = without_axial(&mass).times(column(dofs, |dof| mesh.nodes[dof / 3][dof % 3]).as_ref());
        let centre: [f64; 3] = core::array::from_fn(|i| corner[i] + 0.5 * size[i]);
        for i in 0..3 {
            let exact = weight * [-velocity[1], velocity[0], 0.0][i];
            assert!((total(&coriolis, i) - exact).abs() < 1e-12 * weight, "{kind:?}: Coriolis {i}");
            let exact = weight * [centre[0], centre[1], 0.0][i];
            assert!((total(&centrifugal, i) - exact).abs() < 1e-12 * weight, "{kind:?}: centrifugal {i}");
        }
        // The Coriolis force does no work for any motion.
        let any = column(dofs, |dof| (1.7 * dof as f64).sin());
        let force = mass.times(turned_about_axis(&all, &any).as_ref());
        let power: f64 = (0..dofs).map(|dof| any[(dof, 0)] * force[(dof, 0)]).sum();
        let effort: f64 = (0..dofs).map(|dof| (any[(dof, 0)] * force[(dof, 0)]).abs()).sum();
        assert!(power.abs() < 1e-13 * effort, "{kind:?}: {power} of {effort}");
    }
}

/// A mass on springs k_x and k_y in the rotating frame has (ω² - k_x/m + Ω²)(ω² - k_y/m + Ω²) = 4Ω²ω².
#[test]
fn whirl_of_mass_on_two_springs_matches_closed_form() {
    let (kx, ky, speed): (f64, f64, f64) = (900.0, 1600.0, 11.0);
    let squares = [kx - speed * speed, ky - speed * speed];
    let gyroscopic = DMatrix::from_row_slice(2, 2, &[0.0, -2.0 * speed, 2.0 * speed, 0.0]);
    let half = 0.5 * (squares[0] + squares[1] + 4.0 * speed * speed);
    let root = (half * half - squares[0] * squares[1]).sqrt();
    let found = gyroscopic_frequencies(&squares, &gyroscopic);
    for (found, square) in found.iter().zip([half - root, half + root]) {
        let exact = square.sqrt() / core::f64::consts::TAU;
        assert!((found / exact - 1.0).abs() < 1e-12, "{found} Hz instead of {exact} Hz");
    }
    let still = gyroscopic_frequencies(&squares, &DMatrix::zeros(2, 2));
    assert!((still[0] * core::f64::consts::TAU / squares[0].sqrt() - 1.0).abs() < 1e-12);
}

/// Spin softening alone: a bar that only stretches along x has ω² - Ω².
#[test]
fn spin_softening_is_the_square_of_the_speed() {
    let mesh = straight_box(ElementKind::Hex8, [8, 1, 1], [0.4, 0.05, 0.05]);
    let assembled = assemble(&mesh, &blade_steel(0.0), &silent).unwrap();
    let free: Vec<usize> =
        (0..3 * mesh.nodes.len()).filter(|dof| dof % 3 == 0 && mesh.nodes[dof / 3][0] > 0.0).collect();
    let squares = |speed: f64| {
        let softened = assembled.stiffness.plus_scaled(-speed * speed, &without_axial(&assembled.mass));
        let (stiffness, mass) = principal_pair(&softened, &assembled.mass, &free);
        full_modes(&stiffness, &mass, false, 4, &silent).unwrap().modes.eigenvalues
    };
    for (slow, fast) in squares(0.0).into_iter().zip(squares(5000.0)) {
        assert!(((slow - fast) / 5000.0_f64.powi(2) - 1.0).abs() < 1e-6, "{slow} {fast}");
    }
}

struct SpinningBody {
    mesh: Mesh,
    material: Material,
    assembled: Assembled,
    free: Vec<usize>,
}

impl SpinningBody {
    fn clamped(mesh: Mesh, material: Material, clamped: &[usize]) -> Self {
        let assembled = assemble(&mesh, &material, &silent).unwrap();
        let free = free_dofs(mesh.nodes.len(), clamped);
        Self { mesh, material, assembled, free }
    }

    fn pencil(&self) -> (SparseMatrix, SparseMatrix) {
        principal_pair(&self.assembled.stiffness, &self.assembled.mass, &self.free)
    }

    fn at(&self, speed: f64) -> tiprub_model::Result<SpinningState> {
        let body = Rotating::new(&self.mesh, &self.material, &self.assembled, &self.free, &self.pencil().0)?;
        body.equilibrium(speed, body.at_rest())
    }
}

/// Returns a beam along x from the axis, with a square section and its middle line on y = z = 0.
fn beam(elements: usize, length: f64, height: f64, poisson_ratio: f64) -> SpinningBody {
    let mut mesh = straight_box(ElementKind::Hex20, [elements, 1, 1], [length, height, height]);
    mesh.nodes.iter_mut().for_each(|x| (1..3).for_each(|i| x[i] -= 0.5 * height));
    let clamped = nodes_at(&mesh, 0, 0.0);
    SpinningBody::clamped(mesh, blade_steel(poisson_ratio), &clamped)
}

/// A thin rod stretched by 3 %: with P = E(λ³ - λ)/2 and ρΩ²x along it, (3λ⁴ - 2λ²)/8 + ρΩ²x²/2E is constant, and λ =
/// 1 at the tip; so L = ∫dx/λ(x) from the root to the displaced tip.
#[test]
fn stretch_of_spinning_rod_matches_closed_form() {
    let (length, speed) = (0.5, 3.2e3);
    let body = beam(10, length, 0.002, 0.0);
    let state = body.at(speed).unwrap();
    let load = 8000.0 * speed * speed / 200e9;
    let stretch = |tip: f64, x: f64| ((1.0 + 2.0 * (1.0 + 3.0 * load * (tip * tip - x * x)).sqrt()) / 3.0).sqrt();
    let resting_length = |tip: f64| {
        let count = 2000;
        let part = |i: usize| {
            let weight = if i == 0 || i == count { 1.0 } else { [2.0, 4.0][i % 2] };
            weight / stretch(tip, tip * i as f64 / count as f64)
        };
        (0..=count).map(part).sum::<f64>() * tip / count as f64 / 3.0
    };
    let (mut low, mut high) = (length, 2.0 * length);
    for _ in 0..60 {
        let tip = 0.5 * (low + high);
        if resting_length(tip) < length { low = tip } else { high = tip }
    }
    let growth = low - length;
    let tip = nodes_at(&body.mesh, 0, length)[0];
    let found = state.displacement[(body.free.binary_search(&(3 * tip)).unwrap(), 0)];
    println!("growth {found:.8} m, closed form {growth:.8} m ({} corrections)", state.iterations);
    assert!(growth > 0.03 * length && (found / growth - 1.0).abs() < 1e-6, "{found} {growth}");
    assert!(state.iterations <= 8 && state.residual < 1e-9, "{} {:e}", state.iterations, state.residual);
}

/// Rotating cantilever from the axis, frequency parameters ω L² √(ρA/EI) of out-of-plane bending at η = Ω L²
/// √(ρA/EI): Wright, Smith, Thresher, Wang, J. Appl. Mech. 49, 1982. In the plane ω² is smaller by Ω².
#[test]
fn rotating_cantilever_frequencies_match_literature() {
    let (length, height) = (1.0, 0.01);
    let body = beam(24, length, height, 0.0);
    let unit = (200e9 * height * height / 12.0 / 8000.0_f64).sqrt() / (length * length);
    let table = [(0.0, 3.5160, 22.0345), (1.0, 3.6816, 22.1810), (2.0, 4.1373, 22.6149), (5.0, 6.4495, 25.4461)];
    for (eta, first, second) in table {
        let state = body.at(eta * unit).unwrap();
        let modes = full_modes(&state.stiffness, &body.pencil().1, false, 4, &silent).unwrap().modes;
        let parameter = |k: usize| modes.eigenvalues[k].sqrt() / unit;
        println!("η {eta}: {:.4} {:.4} ({first} {second})", parameter(1), parameter(3));
        assert!((parameter(1) / first - 1.0).abs() < 1e-3 && (parameter(3) / second - 1.0).abs() < 2e-3);
        for pair in [0, 2] {
            let gap = (modes.eigenvalues[pair + 1] - modes.eigenvalues[pair]) / (unit * unit);
            assert!((gap - eta * eta).abs() < 1e-3 * (1.0 + eta * eta), "η {eta}: {gap}");
        }
    }
}

#[test]
fn rejects_invalid_spin_requests() {
    let body = beam(4, 0.5, 0.02, 0.3);
    let too_fast = body.at(1e6).unwrap_err().to_string();
    assert!(
        too_fast.starts_with("static equilibrium at 1000000 rad/s: the strain of")
            && too_fast.contains("educe the largest speed"),
        "{too_fast}"
    );
    let all: Vec<usize> = (0..3 * body.mesh.nodes.len()).collect();
    let free = Rotating::new(&body.mesh, &body.material, &body.assembled, &all, &body.assembled.stiffness);
    assert!(free.unwrap_err().to_string().contains("no node is clamped"));
    for speed in [0.0, -3.0, f64::NAN, f64::INFINITY] {
        let (mesh, clamped, contact) = blade();
        let error = spinning(mesh, &clamped, &contact, &options(DisplacementFrame::Cartesian), speed);
        assert!(error.unwrap_err().to_string().starts_with("largest speed: "), "{speed}");
    }
    let (mesh, clamped, contact) = blade();
    let still =
        reduce(mesh, &blade_steel(0.3), &clamped, &contact, &options(DisplacementFrame::Cartesian), &silent).unwrap();
    assert!(frequencies_at(&still.rom, 100.0, true).unwrap_err().to_string().contains("no spin matrices"));
}

/// Returns a pre-twisted blade away from the axis, its root nodes, and two contact nodes at its tip.
fn blade() -> (Mesh, Vec<usize>, Vec<ContactPoint>) {
    let (length, root) = (0.12, 0.2);
    let mut mesh = straight_box(ElementKind::Hex20, [8, 1, 4], [length, 0.004, 0.05]);
    let clamped = nodes_at(&mesh, 0, 0.0);
    let tip = nodes_at(&mesh, 0, length);
    let near = |y: f64, z: f64| {
        let distance = |node: &usize| (mesh.nodes[*node][1] - y).hypot(mesh.nodes[*node][2] - z);
        *tip.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    };
    let contact = [("front", near(0.0, 0.0)), ("rear", near(0.0, 0.05))]
        .map(|(name, node)| ContactPoint::at(name, node, 0.0))
        .to_vec();
    for [x, y, z] in &mut mesh.nodes {
        let angle = 0.5 + 0.6 * *x / length;
        let (across, along) = (*y - 0.002, *z - 0.025);
        (*y, *z) = (across * angle.cos() - along * angle.sin(), across * angle.sin() + along * angle.cos());
        *x += root;
    }
    (mesh, clamped, contact)
}

fn spinning(
    mesh: Mesh,
    clamped: &[usize],
    contact: &[ContactPoint],
    options: &ReductionOptions,
    speed: f64,
) -> Result<Reduction> {
    let model = FeModel::assembled(mesh, &blade_steel(0.3), String::new(), &silent)?;
    reduce_model(model, clamped, contact, options, Some(speed), &silent)
}

fn options(frame: DisplacementFrame) -> ReductionOptions {
    ReductionOptions {
        name: "blade".into(),
        kind: ReductionKind::FixedInterface,
        modes: 12,
        checked_modes: 6,
        sectors: 1,
        frame,
        watched: Vec::new(),
        stress: StressPlaces::default(),
        damping_ratio: 0.01,
    }
}

/// Quantities that do not depend on the coordinates: frequencies and growth at any speed are the same in both frames;
/// and the resting part of the ROM is the same as without spin, to the last bit.
#[test]
fn spin_adds_arrays_without_changing_the_rest_of_the_rom() {
    let steel = blade_steel(0.3);
    let both = [DisplacementFrame::Cartesian, DisplacementFrame::Cylindrical].map(|frame| {
        let (mesh, clamped, contact) = blade();
        spinning(mesh, &clamped, &contact, &options(frame), 1200.0).unwrap()
    });
    let (mesh, clamped, contact) = blade();
    let still = reduce(mesh, &steel, &clamped, &contact, &options(DisplacementFrame::Cylindrical), &silent).unwrap();
    assert!(still.rom.extras.spin.is_none() && still.spin_checks.is_empty());
    let mut stripped = both[1].rom.clone();
    let spin = stripped.extras.spin.take().unwrap();
    assert!(stripped == still.rom);
    assert!(spin.coriolis == -spin.coriolis.transpose() && spin.coriolis.amax() > 0.0);
    assert!(spin.stiffness_speed2 == spin.stiffness_speed2.transpose());
    assert!(spin.stiffness_speed4 == spin.stiffness_speed4.transpose());
    assert_eq!(spin.largest_speed.to_bits(), 1200.0_f64.to_bits());
    for speed in [300.0, 840.0, 1200.0] {
        let [first, second] = [0, 1].map(|k| frequencies_at(&both[k].rom, speed, true).unwrap());
        for (a, b) in first.iter().zip(&second) {
            assert!((a / b - 1.0).abs() < 1e-8, "{speed} rad/s: {a} {b}");
        }
    }
    for (a, b) in both[0].spin_checks.iter().zip(&both[1].spin_checks) {
        assert!((a.growth_deviation() - b.growth_deviation()).abs() < 0.2, "{a:?} {b:?}");
        for (mode, deviation) in b.frequency_deviation().iter().enumerate() {
            println!("{} rad/s, mode {}: {deviation:.4} %", b.speed, mode + 1);
            assert!(deviation.abs() < 0.5);
        }
        println!("{} rad/s, growth: {:.4} %", b.speed, b.growth_deviation());
        assert!(b.growth_deviation() < 0.5);
    }
    assert!(both[1].spin_checks[1].growth_deviation() < 1e-6, "exact at the largest speed");
}

#[test]
fn spin_works_without_component_modes() {
    let (mesh, clamped, contact) = blade();
    let options = ReductionOptions { modes: 0, ..options(DisplacementFrame::Cylindrical) };
    let reduction = spinning(mesh, &clamped, &contact, &options, 1200.0).unwrap();
    assert_eq!(reduction.rom.order(), 6);
    let (checked, largest) = (&reduction.spin_checks[0], &reduction.spin_checks[1]);
    assert!(checked.growth_deviation() < 1.0 && largest.growth_deviation() < 1e-6, "{}", checked.growth_deviation());
}

/// With all modes kept, the reduced model about a spinning state must have the spectrum of the spinning state, except
/// for the neglected change of the residual mass of the interface, which is zero in that case.
#[test]
fn all_modes_reproduce_the_fitted_speed_exactly() {
    let mesh = straight_box(ElementKind::Hex8, [4, 1, 2], [0.12, 0.006, 0.05]);
    let mut mesh = mesh;
    mesh.nodes.iter_mut().for_each(|x| x[0] += 0.2);
    let clamped = nodes_at(&mesh, 0, 0.2);
    let tip = nodes_at(&mesh, 0, 0.32)[0];
    let contact = [ContactPoint::at("tip", tip, 0.0)];
    let free = 3 * (mesh.nodes.len() - clamped.len());
    let options = ReductionOptions { modes: free - 3, ..options(DisplacementFrame::Cylindrical) };
    let reduction = spinning(mesh, &clamped, &contact, &options, 1500.0).unwrap();
    let check = &reduction.spin_checks[1];
    for deviation in check.frequency_deviation() {
        assert!(deviation.abs() < 1e-5, "{:?}", check.frequency_deviation());
    }
    assert!(check.growth_deviation() < 1e-6, "{}", check.growth_deviation());
    // The fit includes the resting model, too.
    let (resting, _) = dense_modes(&reduction.rom.stiffness, &reduction.rom.mass).unwrap();
    let found = frequencies_at(&reduction.rom, 0.0, true).unwrap();
    for (square, frequency) in resting.iter().zip(found) {
        assert!((frequency * core::f64::consts::TAU / square.sqrt() - 1.0).abs() < 1e-5);
    }
}
