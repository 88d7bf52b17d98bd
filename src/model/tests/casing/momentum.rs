//! Reaction of a support in motion against the momentum of the whole finite-element mesh, which is integrated
//! independently with the full matrices of all nodes under the contact force of the core. No basis and no reduced row
//! is shared.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::SupportRows as Rows;
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::casing::{
    CLAMPED, ContactRings, InnerContour, RingCounts, RingGeometry, RingMesh, RingSupport, supported_ring,
};
use tiprub_model::element::ElementKind;
use tiprub_model::progress::silent;
use tiprub_model::thermal::{equal_patches, patch_loads};
use tiprub_model::{CasingOptions, reduce_ring};
use tiprub_test_models::{self as models, element, go, move_on, real, set_element};

use crate::common::dense;

/// Clearance (m).
const GAP: f64 = 1e-5;
const AROUND: usize = 12;
const ALONG: usize = 2;
/// Number of patches around.
const PATCHES: usize = 3;

/// Returns a thick ring of 216 degrees of freedom, clamped at one end face, with the given numbers of fixed-interface
/// modes and modes.
fn ring(fixed_interface_modes: usize, modes: usize) -> CasingOptions {
    CasingOptions {
        geometry: RingGeometry {
            contour: InnerContour::new(&[[0.0, models::RADIUS], [0.06, models::RADIUS]]).unwrap(),
            thickness: 1e-2,
            flanges: [None, None],
        },
        counts: RingCounts { around: AROUND, through: 1, along: 3, flange: 1 },
        kind: ElementKind::Hex8,
        rings: ContactRings { around: AROUND, along: ALONG, axial: [0.02, 0.04] },
        support: RingSupport::Low,
        patches: [PATCHES, 1],
        fixed_interface_modes,
        modes,
        checked_modes: 10,
        damping_ratio: 0.0,
        ..CasingOptions::default()
    }
}

/// Whole mesh with the motion of its free nodes.
struct MovingMesh {
    ring: RingMesh,
    /// Stiffness of the free nodes.
    stiffness: DMatrix<f64>,
    mass: Cholesky<f64, Dyn>,
    /// Momentum and moment of momentum about the origin of the whole mesh per velocity of its free nodes, 6 × free.
    momentum: DMatrix<f64>,
    free: Vec<usize>,
    /// Thermal loads per kelvin of each patch.
    heat: DMatrix<f64>,
    /// Displacement of the free nodes at the current and the previous step.
    now: DVector<f64>,
    before: DVector<f64>,
}

impl MovingMesh {
    fn new(options: &CasingOptions) -> Self {
        let ring = supported_ring(options).unwrap();
        let nodes = &ring.mesh.nodes;
        let full = assemble(&ring.mesh, &options.material, &silent).unwrap();
        let free = free_dofs(nodes.len(), ring.mesh.set(CLAMPED).unwrap());
        let (stiffness, mass) = (dense(&full.stiffness), dense(&full.mass));
        let part = |matrix: &DMatrix<f64>| DMatrix::from_fn(free.len(), free.len(), |i, j| matrix[(free[i], free[j])]);
        // Rigid motions of all nodes.
        let motion = DMatrix::from_fn(6, 3 * nodes.len(), |row, dof| rigid(nodes[dof / 3], dof % 3)[row]);
        let momentum = (motion * &mass).select_columns(&free);
        let patches = equal_patches(PATCHES, 1, options.geometry.contour.axial());
        let heat = patch_loads(&ring.mesh, &options.material, &patches).unwrap();
        let heat = DMatrix::from_fn(free.len(), PATCHES, |i, k| heat[(free[i], k)]);
        let zero = DVector::zeros(free.len());
        Self {
            stiffness: part(&stiffness),
            mass: part(&mass).cholesky().unwrap(),
            momentum,
            heat,
            now: zero.clone(),
            before: zero,
            free,
            ring,
        }
    }

    /// Sets the static displacement under the temperatures (K).
    fn rest(&mut self, temperatures: &[f64; PATCHES]) {
        let load = &self.heat * DVector::from_column_slice(temperatures);
        self.now = self.stiffness.clone().cholesky().unwrap().solve(&load);
        self.before = self.now.clone();
    }

    /// Performs one step (s) of central differences under a force on a contact node (N); returns the rate of
    /// momentum.
    fn go(&mut self, step: f64, node: usize, force: [f64; 3], temperatures: &[f64; PATCHES]) -> DVector<f64> {
        let mut load = &self.heat * DVector::from_column_slice(temperatures) - &self.stiffness * &self.now;
        let first = self.free.binary_search(&(3 * self.ring.grid.nodes[node])).unwrap();
        force.iter().enumerate().for_each(|(axis, force)| load[first + axis] += force);
        self.mass.solve_mut(&mut load);
        let next = 2.0 * &self.now - &self.before + step * step * &load;
        self.before = std::mem::replace(&mut self.now, next);
        &self.momentum * load
    }

    /// Returns the radial displacement of a contact node (m).
    fn radial(&self, node: usize) -> f64 {
        let node = self.ring.grid.nodes[node];
        let [x, y, _] = self.ring.mesh.nodes[node];
        let first = self.free.binary_search(&(3 * node)).unwrap();
        (x * self.now[first] + y * self.now[first + 1]) / x.hypot(y)
    }
}

/// Returns the force and moment about the origin of a unit force along an axis.
fn rigid([x, y, z]: [f64; 3], axis: usize) -> [f64; 6] {
    match axis {
        0 => [1.0, 0.0, 0.0, 0.0, z, -y],
        1 => [0.0, 1.0, 0.0, -z, 0.0, x],
        _ => [0.0, 0.0, 1.0, y, -x, 0.0],
    }
}

/// Excitation of the casing.
#[derive(Clone, Copy)]
struct CasingDrive {
    /// Amplitude (m) and frequency (Hz) of the motion of the shaft, which presses a pin against the casing.
    push: [f64; 2],
    /// Frequency of the pin on its spring (Hz).
    pin: f64,
    /// Sliding speed of the pin (rad/s).
    speed: f64,
    /// Temperatures of the patches (K).
    heat: [f64; PATCHES],
}

/// Impacts that excite all modes of a warm casing.
const BLOWS: CasingDrive = CasingDrive { push: [3e-8, 1e4], pin: 2000.0, speed: 1e-5, heat: [0.02, 0.0, -0.01] };
/// Single soft push.
const PUSH: CasingDrive = CasingDrive { push: [3e-8, 2e3], pin: 2e4, speed: 0.05, heat: [0.0; PATCHES] };

/// Creates a scene with a pin on a spring in front of the first node of the second ring, against which the shaft
/// presses it.
fn scene(casing: Rom, drive: CasingDrive, scheme: Scheme, step: f64) -> Scene {
    let pin = vec![models::node("pin", [models::RADIUS, 0.0, 0.04], 0.0)];
    let shape = |row: usize, _: usize| if row == 0 { 3.0 } else { 0.0 };
    let mut scene = models::round(models::modal("pin", &[drive.pin], shape, pin));
    models::on_ring(&mut scene, casing, 0.0);
    let settings = &mut scene.settings;
    settings.surfaces[0].moving = false;
    settings.structures[0].speed = drive.speed;
    settings.structures[0].whirl = true;
    settings.structures[1].thermal = true;
    settings.contacts[0].gap = GAP;
    // Impacts make the tip vibrate faster than it slides, so that sticking must be possible.
    (settings.contacts[0].friction, settings.contacts[0].solver) = (0.4, Solver::Coulomb);
    (settings.time.scheme, settings.time.step) = (scheme, step);
    settings.outputs.casing_forces = true;
    settings.outputs.support_reaction = true;
    settings.outputs.slave_displacement = true;
    scene
}

const ROWS: [&str; 6] = ["force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"];
/// Duration of the comparison; below, the length of means (s).
const LENGTH: f64 = 4e-4;
const MEAN: f64 = 2e-5;

fn start(scene: &Scene, heat: &[f64; PATCHES]) -> Simulation {
    let mut run = Simulation::new(scene).unwrap();
    for (patch, value) in (0..).zip(heat) {
        set_element(&mut run, "casing_temperature", patch, *value);
    }
    run.initialise(0.0).unwrap();
    run
}

/// Deviations of contact force and reaction from the rate of momentum: relative to the largest reaction of all steps,
/// and of means.
#[derive(Debug, Default)]
struct Off {
    force: f64,
    moment: f64,
    mean_force: f64,
    mean_moment: f64,
    /// Radial displacement of the contact nodes, relative to the largest.
    moved: f64,
}

impl std::fmt::Display for Off {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { force, moment, mean_force, mean_moment, moved } = self;
        write!(
            out,
            "force {force:.1e}, moment {moment:.1e}; means {mean_force:.1e}, {mean_moment:.1e}; moved {moved:.1e}"
        )
    }
}

/// Compares a run of the core with the mesh; `change` modifies the rows of the support.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most thousands of steps")]
fn compare(options: &CasingOptions, drive: CasingDrive, scheme: Scheme, step: f64, change: impl Fn(&mut Rows)) -> Off {
    let (mut mesh, mut casing) = (MovingMesh::new(options), reduce_ring(options, &silent).unwrap().rom);
    change(casing.extras.support.as_mut().unwrap());
    let mut run = start(&scene(casing, drive, scheme, step), &drive.heat);
    mesh.rest(&drive.heat);
    // The contact point is on the surface, outside the pin by the clearance, which determines the lever arm of
    // forces.
    let [x, y, z] = mesh.ring.mesh.nodes[mesh.ring.grid.nodes[AROUND]];
    let out = (models::RADIUS + GAP) / x.hypot(y);
    let place = [out * x, out * y, z];
    let window = (MEAN / step).round() as u32;
    let (mut off, mut largest) = ([[0.0_f64; 6]; 2], [[0.0_f64; 6]; 2]);
    let (mut sums, mut moved) = ([[0.0_f64; 6]; 2], [0.0_f64; 2]);
    for index in 1..=(LENGTH / step).round() as u32 {
        let phase = std::f64::consts::TAU * drive.push[1] * step * f64::from(index);
        let push = GAP + drive.push[0] * (1.0 - phase.cos());
        move_on(&mut run, "whirl_x", push, 0.0);
        go(&mut run, step);
        let force = ["x", "y", "z"].map(|axis| real(&run, &format!("casing_force_{axis}")));
        let rate = mesh.go(step, AROUND, force, &drive.heat);
        for row in 0..6 {
            let acting: f64 = (0..3).map(|axis| rigid(place, axis)[row] * force[axis]).sum();
            let reaction = real(&run, &format!("support_{}", ROWS[row]));
            let left = acting + reaction - rate[row];
            (off[0][row], largest[0][row]) = (off[0][row].max(left.abs()), largest[0][row].max(reaction.abs()));
            (sums[0][row], sums[1][row]) = (sums[0][row] + left, sums[1][row] + reaction);
            if index.is_multiple_of(window) {
                let [left, reaction] = [sums[0][row], sums[1][row]].map(|sum| (sum / f64::from(window)).abs());
                (off[1][row], largest[1][row]) = (off[1][row].max(left), largest[1][row].max(reaction));
                (sums[0][row], sums[1][row]) = (0.0, 0.0);
            }
        }
        for node in 0..AROUND * ALONG {
            let reported = element(&run, "casing_displacement", u32::try_from(node).unwrap());
            moved = [moved[0].max((reported - mesh.radial(node)).abs()), moved[1].max(reported.abs())];
        }
    }
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let share = |of: usize, rows: std::ops::Range<usize>| most(&off[of][rows.clone()]) / most(&largest[of][rows]);
    assert!(largest[1][0] > 1e6 * drive.push[0] && largest[1][5] > 1e4 * drive.push[0], "{largest:?}");
    Off {
        force: share(0, 0..3),
        moment: share(0, 3..6),
        mean_force: share(1, 0..3),
        mean_moment: share(1, 3..6),
        moved: moved[0] / moved[1],
    }
}

/// With all modes, central differences of the core and of the mesh are identical: contact force and reaction equal
/// the rate of momentum of the mesh in every step. No row of the support can be omitted.
#[test]
fn support_reaction_balances_the_momentum_of_the_mesh() {
    let options = ring(144, 1000);
    let off = |size: f64, change: &dyn Fn(&mut Rows)| {
        let drive = CasingDrive {
            push: [size * BLOWS.push[0], BLOWS.push[1]],
            heat: BLOWS.heat.map(|one| size * one),
            ..BLOWS
        };
        compare(&options, drive, Scheme::CentralDifference, 2e-7, change)
    };
    let [found, smaller] = [1.0, 0.1].map(|size| off(size, &|_| ()));
    println!("all modes, every step: {found}\na tenth of the motion: {smaller}");
    let without = [
        off(1.0, &|rows| rows.mass.fill(0.0)),
        off(1.0, &|rows| rows.stiffness.fill(0.0)),
        off(1.0, &|rows| rows.thermal.fill(0.0)),
    ];
    println!("without S_M: {}\nwithout S_K: {}\nwithout S_T: {}", without[0], without[1], without[2]);
    assert!([found.force, found.moment, found.moved].iter().all(|off| *off < 1e-6), "{found}");
    for off in &without {
        assert!(off.moved < 1e-6 && off.force > 0.2 && off.moment > 0.2, "{off}");
    }
}

/// With fewer modes the equation of the free nodes only holds in the space of the modes: the momentum error is that
/// of modal truncation for a soft push, and that of the step if steps differ from those of the mesh.
#[test]
fn momentum_converges_to_the_mesh_with_more_modes() {
    let of_modes = |fixed: usize, modes: usize, change: &dyn Fn(&mut Rows)| {
        let found = compare(&ring(fixed, modes), PUSH, Scheme::CentralDifference, 2e-7, change);
        println!("{fixed} fixed-interface modes, {modes} modes: {found}");
        found
    };
    for modes in [[6, 24, 96].map(|fixed| [fixed, 1000]), [6, 24, 96].map(|modes| [144, modes])] {
        let found = modes.map(|[fixed, modes]| of_modes(fixed, modes, &|_| ()));
        let means = found.each_ref().map(|off| off.mean_force.max(off.mean_moment));
        assert!(means.array_windows().all(|[few, more]| *more < 0.5 * few) && means[2] < 5e-4, "{means:?}");
    }
    let without = of_modes(96, 1000, &|rows| rows.mass.fill(0.0));
    assert!(without.mean_force > 1e-3 && without.mean_moment > 1e-3, "{without}");
    let steps = [2e-7, 1e-7].map(|step| {
        let found = compare(&ring(144, 1000), PUSH, Scheme::ModalExact, step, |_| ());
        println!("all modes, modal-exact, step {step}: {found}");
        found.force
    });
    assert!(steps[0] < 3e-4 && steps[0] / steps[1] > 3.0, "{steps:?}");
}
