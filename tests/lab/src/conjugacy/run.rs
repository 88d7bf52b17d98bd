//! One scene run step by step: forces and moments on both sides, torque against shaft work, the ledger.

use tiprub_core::CoSimulation;
use tiprub_core::geometry::{Vector3, frame::PolarFrame, surface_spline::SurfaceSpline, wrench::Wrench};
use tiprub_core::scene::method::Solver;
use tiprub_core::scene::settings::{Shape, SplineSettings};
use tiprub_core::scene::shape::CompiledShape;
use tiprub_core::{
    Result, Scene, Simulation,
    system::{ContactEvent, Structure, System},
};

use crate::stability::{
    bodies::{HALF, LumpChain, Plate, Throw},
    models::{GAP, RADIUS, StabilityMethod, Tower, blade, bumps, on_ring},
    observe::{real, worse},
};

/// Length of the communication steps of a rotor (s), and their number.
const LENGTH: f64 = 1e-5;
const COUNT: u32 = 120;
/// Rate of whirl, shift and casing (rad/s).
const RATE: f64 = 900.0;
/// Angular acceleration of the rotor (rad/s²).
const RAMP: f64 = 4e4;

/// Surface that the contact nodes touch, and the moving parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SurfaceFeature {
    /// Rigid surface of revolution.
    Revolution,
    /// Rigid surface through data points.
    Spline,
    /// Flexible casing.
    Casing,
    /// Coupled sectors in a rigid casing.
    Disk,
    /// Coupled sectors in a flexible casing.
    DiskInCasing,
    /// Coating on a rigid casing.
    Coating,
    /// A free body between an elastic and a rigid plate.
    Free,
}

impl SurfaceFeature {
    /// All features.
    pub(crate) const ALL: [Self; 7] =
        [Self::Revolution, Self::Spline, Self::Casing, Self::Disk, Self::DiskInCasing, Self::Coating, Self::Free];

    /// Returns the name for the table.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Revolution => "surface of revolution",
            Self::Spline => "rigid spline",
            Self::Casing => "flexible casing",
            Self::Disk => "coupled sectors",
            Self::DiskInCasing => "coupled sectors, flexible casing",
            Self::Coating => "coating",
            Self::Free => "free body",
        }
    }

    /// Returns the known side of forces and moments.
    pub(crate) fn side(self) -> WrenchSide {
        match self {
            Self::Revolution | Self::Disk => WrenchSide::Surface,
            Self::Coating => WrenchSide::Dented,
            _ => WrenchSide::ControlPoints,
        }
    }

    /// Returns the scene of a rotor; `None` for the free body.
    fn rotor(self) -> Option<Scene> {
        let disk = || Tower { neighbour: 1e6, ..Tower::default() }.rom();
        let mut scene = match self {
            Self::Disk | Self::DiskInCasing => bumps(disk()),
            Self::Free => return None,
            _ => bumps(blade(12)),
        };
        match self {
            Self::Spline => scene.settings.surfaces[0].spline = Some(SplineSettings::default()),
            Self::Casing | Self::DiskInCasing => on_ring(&mut scene, 0.01),
            Self::Coating => tiprub_test_models::coating(&mut scene),
            Self::Revolution | Self::Disk | Self::Free => {}
        }
        Some(scene)
    }

    /// Returns the scene with friction, and with whirl and axial shift if there is a shaft. If `round`, the casing is
    /// round, for the torque.
    pub(crate) fn scene(self, friction: f64, moves: bool, round: bool) -> Scene {
        let Some(mut scene) = self.rotor() else {
            let left = Plate { stiffness: 1e7, ..Plate::left(HALF + 2e-4) };
            let right = Plate { stiffness: 0.0, radius: 0.18, ..Plate::right(HALF + 3e-4) };
            let throw = Throw {
                body: LumpChain::elastic(&[0.1, 0.15, 0.05], 2e7),
                velocity: [-5.0, 2.5, 0.5],
                plates: vec![left, right],
                friction,
                method: StabilityMethod::exact(Solver::Lcp),
                step: 1e-6,
            };
            let mut scene = throw.scene();
            scene.settings.outputs.energies = true;
            return scene;
        };
        let settings = &mut scene.settings;
        settings.contacts[0].friction = friction;
        (settings.structures[0].whirl, settings.structures[0].axial_shift) = (moves, moves);
        settings.outputs.energies = true;
        if round {
            settings.surfaces[0].shape = Shape::Circular {};
        }
        scene
    }
}

/// Source of the forces and moments on the slave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WrenchSide {
    /// Forces on control points, at their positions.
    ControlPoints,
    /// The contact force at the position of the surface of revolution.
    Surface,
    /// A coating yields: the contact is inside it.
    Dented,
}

/// Results of a run; residuals are relative.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct ConjugacyRun {
    /// Number of contacts, summed over the steps.
    pub contacts: usize,
    /// Largest moment of a step about the axis of the casing, relative to Σ|F| r.
    pub axis_moment: f64,
    /// Sum of the forces on the slave's control points and on the master, relative to Σ|F|.
    pub force: f64,
    /// Sum of their moments about the origin, relative to Σ|F| r.
    pub moment: f64,
    /// Difference of the modal forces on the surface carrier from those of the control points' forces, relative to the
    /// largest.
    pub modal: f64,
    /// ∫ torque·speed dt plus the shaft's work, relative to all work exchanged.
    pub shaft: f64,
    /// Closure of the ledger, relative to all work exchanged.
    pub balance: f64,
    /// Curvature work, relative to all work exchanged.
    pub curvature: f64,
    /// All work exchanged (J).
    pub turnover: f64,
}

/// Runs a scene with steps of length `step` (s).
///
/// # Errors
/// A scene that is rejected or fails.
pub(crate) fn run(scene: &Scene, step: f64) -> Result<ConjugacyRun> {
    let mut scene = scene.clone();
    scene.settings.time.step = step;
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let (mut seen, mut supplied) = (ConjugacyRun::default(), 0.0);
    for _ in 0..COUNT {
        let begin = simulation.time();
        let speed = drive(&mut simulation, begin)?;
        simulation.begin_step(begin, LENGTH)?;
        while !simulation.advance()?.finished {
            look(&scene, &simulation, &mut seen);
        }
        look(&scene, &simulation, &mut seen);
        supplied += if simulation.table().find("torque").is_some() { real(&simulation, "torque") } else { 0.0 }
            * speed
            * LENGTH;
    }
    let ledger = simulation.system().ledger();
    seen.turnover = ledger.scale();
    seen.shaft = (supplied + ledger.shaft_work.value()).abs() / seen.turnover;
    seen.balance = real(&simulation, "energy_residual_relative").abs();
    seen.curvature = ledger.curvature_work.value() / seen.turnover;
    Ok(seen)
}

/// Sets a value and a rate for every input of the scene; returns the speed.
fn drive(simulation: &mut Simulation, time: f64) -> Result<f64> {
    let phase = RATE * time;
    let (sine, cosine) = phase.sin_cos();
    let speed = 1300.0 + RAMP * time;
    let closing = if time < 1e-3 { -0.45 } else { 0.0 };
    let inputs = [
        // Held over the communication step, so that its work is the mean torque times the speed.
        ("speed", speed, 0.0),
        ("whirl_x", 5e-5 * sine, 5e-5 * RATE * cosine),
        ("whirl_y", 5e-5 * (1.0 - cosine), 5e-5 * RATE * sine),
        ("axial_shift", 1e-5 * sine, 1e-5 * RATE * cosine),
        ("casing_radius_change", -0.45 * time.min(1e-3), closing),
        ("casing_shape_rotation", 3.0 * time, 3.0),
        ("casing_shape_factor", 1.0 + 0.1 * sine, 0.1 * RATE * cosine),
    ];
    for (name, value, slope) in inputs {
        if let Some(reference) = simulation.table().find(name).map(|row| row.reference) {
            simulation.set_real(reference, value)?;
            simulation.set_input_derivative(reference, 1, slope)?;
        }
    }
    Ok(speed)
}

/// Evaluates the forces and moments of the last internal step.
fn look(scene: &Scene, simulation: &Simulation, seen: &mut ConjugacyRun) {
    let system = simulation.system();
    let events = system.events();
    if events.is_empty() {
        return;
    }
    seen.contacts += events.len();
    let (mut force, mut moment, mut scale, mut axis) = (Vector3::zeros(), Vector3::zeros(), 0.0, 0.0);
    for event in events {
        let Wrench { point, force: own, .. } = event.wrench;
        let own_moment = point.cross(&own);
        force += own;
        moment += own_moment;
        scale += own.norm();
        axis += own_moment[2];
    }
    let (slave_force, slave_moment, modal) = reaction(scene, simulation);
    seen.axis_moment = worse(seen.axis_moment, axis.abs() / (RADIUS * scale));
    for i in 0..3 {
        seen.force = worse(seen.force, (force[i] + slave_force[i]).abs() / scale);
        seen.moment = worse(seen.moment, (moment[i] + slave_moment[i]).abs() / (RADIUS * scale));
    }
    seen.modal = worse(seen.modal, modal);
}

/// Returns force and moment on the touched surface, with its positions: the control points of surfaces through data
/// points, the casing's radius at the angle of the contact for a surface of revolution. The third value is the
/// error of modal forces.
fn reaction(scene: &Scene, simulation: &Simulation) -> (Vector3, Vector3, f64) {
    let system = simulation.system();
    let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
    let zeros = |structure: &Structure| vec![0.0; structure.contact_force().len()];
    let mut expected: Vec<Vec<f64>> = system.structures().iter().map(zeros).collect();
    for event in system.events() {
        let Some((surface, place, rotation)) = surface_of(simulation, event) else {
            let point = on_revolution(scene, simulation, event);
            force -= event.wrench.force;
            moment -= point.cross(&event.wrench.force);
            continue;
        };
        let carrier = system.pairs()[event.pair].carrier();
        for (index, weight) in surface.weights(place).iter() {
            let point = PolarFrame::new(rotation).fixed(surface.control_points()[index]);
            let acts = -weight * event.wrench.force;
            force += acts;
            moment += point.cross(&acts);
            let Some(carrier) = carrier else { continue };
            let bank = system.structures()[carrier.structure].modes();
            for (component, value) in acts.iter().enumerate() {
                let shapes = bank.contact_row(carrier.first_row + 3 * index + component);
                let modal = &mut expected[carrier.structure];
                modal.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum += value * shape);
            }
        }
    }
    (force, moment, modal_residual(system, &expected))
}

fn modal_residual(system: &System, expected: &[Vec<f64>]) -> f64 {
    let (mut off, mut largest) = (0.0_f64, 0.0_f64);
    for (slave, expected) in system.structures().iter().zip(expected) {
        for (found, expected) in slave.contact_force().iter().zip(expected) {
            (off, largest) = (off.max((found - expected).abs()), largest.max(expected.abs()));
        }
    }
    if largest > 0.0 { off / largest } else { 0.0 }
}

/// Returns the surface through data points, the surface point and the rotation of the surface (rad) of a contact.
fn surface_of<'a>(
    simulation: &'a Simulation,
    event: &ContactEvent,
) -> Option<(&'a SurfaceSpline, tiprub_core::geometry::surface_spline::ClosestPoint, f64)> {
    let system = simulation.system();
    let (structure, pair) = (&system.structures()[event.structure], &system.pairs()[event.pair]);
    let place = *structure.geometry().places.get(structure.index(event.node, event.sector))?;
    Some((pair.gap().spline()?, place, pair.drive_now().shape_rotation))
}

/// Returns the point of the casing of revolution at the angle of a contact (m).
fn on_revolution(scene: &Scene, simulation: &Simulation, event: &ContactEvent) -> Vector3 {
    let [x, y, z] = event.wrench.point.into();
    let (settings, drive) = (&scene.settings, simulation.system().pairs()[event.pair].drive_now());
    let node = &scene.roms[0].contact_nodes[event.node];
    let angle = y.atan2(x);
    let shape = CompiledShape::new(&settings.surfaces[0].shape, GAP)
        .map_or(0.0, |shape| shape.evaluate(angle - drive.shape_rotation).0);
    let radius = node.position[0]
        + GAP
        + drive.radius_change
        + drive.shape_factor * shape
        + node.meridional_slope * (z - node.position[2]);
    Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
}
