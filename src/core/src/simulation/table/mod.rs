//! The variable table of a scene: one row per thing an importer can see. Features that are off have no row.

mod features;
mod free;

use super::compile::{Roles, SMALL_FRACTION};
use super::patches::Patches;
use crate::contact::surface::Surface;
use crate::settings::{
    LONGEST_STEP, MAX_DAMPING, MAX_FRICTION, Motion, SHORTEST_STEP, Scene, SceneSettings, Shape, StructureSettings,
    SurfaceSettings,
};
use crate::variables::{
    Causality, Enumeration, Kind, Quantity, Span, Start, Unit, Variability, Variable, VariableTable,
};
use crate::{Error, Result, Rom};

/// rad/s.
static ANGULAR_SPEED: Unit =
    Unit { name: "rad/s", exponents: [0, 0, -1, 1, 0], display: &[("rpm", 9.549_296_585_513_72)] };
/// rad.
static ANGLE: Unit = Unit {
    name: "rad",
    exponents: [0, 0, 0, 1, 0],
    display: &[("deg", 57.295_779_513_082_32), ("rev", 0.159_154_943_091_895_35)],
};
/// m.
static LENGTH: Unit = Unit { name: "m", exponents: [0, 1, 0, 0, 0], display: &[("mm", 1e3), ("um", 1e6)] };
/// m/s.
static LINEAR_SPEED: Unit = Unit { name: "m/s", exponents: [0, 1, -1, 0, 0], display: &[] };
/// s.
static TIME: Unit = Unit { name: "s", exponents: [0, 0, 1, 0, 0], display: &[("ms", 1e3), ("us", 1e6)] };
/// N.
static FORCE: Unit = Unit { name: "N", exponents: [1, 1, -2, 0, 0], display: &[("kN", 1e-3)] };
/// N.m.
static TORQUE: Unit = Unit { name: "N.m", exponents: [1, 2, -2, 0, 0], display: &[] };
/// N.s.
static IMPULSE: Unit = Unit { name: "N.s", exponents: [1, 1, -1, 0, 0], display: &[] };
/// W.
static POWER: Unit = Unit { name: "W", exponents: [1, 2, -3, 0, 0], display: &[("kW", 1e-3)] };
/// J.
static ENERGY: Unit = Unit { name: "J", exponents: [1, 2, -2, 0, 0], display: &[("mJ", 1e3)] };

static SCHEMES: Enumeration = Enumeration {
    name: "Scheme",
    description: "Time-stepping scheme",
    items: &[
        ("central-difference", "Explicit central differences (eq. 9), stable for omega h < 2"),
        ("modal-exact", "Exact in free flight and under constant force"),
        ("massless-boundary", "Highest modes quasi-static; the others take contact forces one step later"),
    ],
};

static SOLVERS: Enumeration = Enumeration {
    name: "Solver",
    description: "Contact solver",
    items: &[
        ("film", "Forward-increment Lagrange multipliers: equality on the nodes that penetrate in the prediction"),
        ("lcp", "Complementarity over all contact nodes"),
        ("coulomb", "Coulomb friction with sticking"),
    ],
};

/// K; temperatures are differences from the reference, so that there is no degC.
static TEMPERATURE: Unit = Unit { name: "K", exponents: [0, 0, 0, 0, 1], display: &[] };
/// N/m.
static LINE_LOAD: Unit = Unit { name: "N/m", exponents: [1, 0, -2, 0, 0], display: &[("kN/m", 1e-3)] };
/// m³.
static VOLUME: Unit = Unit { name: "m3", exponents: [0, 3, 0, 0, 0], display: &[("mm3", 1e9)] };

/// What of a scene the variables depend on.
struct Parts<'a> {
    settings: &'a SceneSettings,
    master: &'a StructureSettings,
    rom: &'a Rom,
    surface: &'a SurfaceSettings,
    carrier: Option<(&'a StructureSettings, &'a Rom)>,
    /// Patches that friction power is gathered for.
    patches: usize,
}

impl<'a> Parts<'a> {
    fn new(scene: &'a Scene) -> Result<Self> {
        let roles = Roles::new(scene)?;
        let settings = &scene.settings;
        let structure = |index: usize| (&settings.structures[index], &scene.roms[index]);
        let (master, rom) = structure(roles.master);
        Ok(Self {
            settings,
            master,
            rom,
            surface: &settings.surfaces[roles.surface],
            carrier: roles.carrier.map(structure),
            patches: Patches::new(scene, roles).as_ref().map_or(0, Patches::len),
        })
    }
}

/// Collects rows and hands out references.
struct Builder {
    variables: Vec<Variable>,
    next: u32,
}

impl Builder {
    fn push(&mut self, quantity: Quantity, name: impl Into<String>, description: impl Into<String>) -> &mut Variable {
        self.close();
        self.variables.push(Variable {
            name: name.into(),
            reference: self.next,
            dimension: None,
            kind: Kind::Real,
            causality: Causality::Output,
            variability: Variability::Continuous,
            span: Span::Point,
            unit: None,
            display: None,
            min: None,
            max: None,
            nominal: None,
            start: None,
            description: description.into(),
            quantity,
        });
        self.variables.last_mut().unwrap_or_else(|| unreachable!("just pushed"))
    }

    /// Account for the references of the last row, whose dimension is known by now.
    fn close(&mut self) {
        self.next = self
            .variables
            .last()
            .map_or(0, |last| last.reference.saturating_add(u32::try_from(last.len()).unwrap_or(u32::MAX)));
    }

    fn input(
        &mut self,
        quantity: Quantity,
        name: &str,
        unit: Option<&'static Unit>,
        start: f64,
        text: &str,
    ) -> &mut Variable {
        let variable = self.push(quantity, name, text);
        variable.causality = Causality::Input;
        variable.unit = unit;
        variable.start = Some(Start::Real(vec![start]));
        variable
    }

    fn parameter(
        &mut self,
        quantity: Quantity,
        name: &str,
        unit: Option<&'static Unit>,
        start: f64,
        text: &str,
    ) -> &mut Variable {
        let variable = self.input(quantity, name, unit, start, text);
        variable.causality = Causality::Parameter;
        variable.variability = Variability::Fixed;
        variable
    }

    fn choice(&mut self, quantity: Quantity, name: &str, choices: &'static Enumeration, start: i32, text: &str) {
        let variable = self.parameter(quantity, name, None, 0.0, text);
        variable.kind = Kind::Enumeration(choices);
        variable.start = Some(Start::Integer(start));
    }

    fn output(
        &mut self,
        quantity: Quantity,
        name: impl Into<String>,
        span: Span,
        unit: Option<(&'static Unit, f64)>,
        text: impl Into<String>,
    ) -> &mut Variable {
        let variable = self.push(quantity, name, text);
        variable.span = span;
        if let Some((unit, nominal)) = unit {
            variable.unit = Some(unit);
            variable.nominal = Some(nominal);
        }
        variable
    }
}

/// Build the table of a validated scene.
///
/// # Errors
/// A watched sector or nodal diameter the ROM does not have.
pub fn build(scene: &Scene) -> Result<VariableTable> {
    if scene.settings.free_master().is_some() {
        return free::build(scene);
    }
    let scene = &Parts::new(scene)?;
    let mut table = Builder { variables: Vec::new(), next: 0 };
    let time = table.push(Quantity::Time, "time", "Simulated time");
    time.causality = Causality::Independent;
    time.unit = Some(&TIME);
    inputs(&mut table, scene)?;
    features::inputs(&mut table, scene);
    parameters(&mut table, scene);
    features::parameters(&mut table, scene);
    totals(&mut table, scene);
    watched(&mut table, scene)?;
    fields(&mut table, scene)?;
    features::outputs(&mut table, scene);
    if scene.settings.outputs.energies {
        energies(&mut table, scene);
    }
    internal_steps(&mut table, scene.settings);
    VariableTable::new(table.variables)
}

fn internal_steps(table: &mut Builder, settings: &SceneSettings) {
    let internal = table.output(
        Quantity::InternalStep,
        "internal_step",
        Span::Point,
        Some((&TIME, settings.time.step)),
        "Internal time step in use",
    );
    internal.variability = Variability::Discrete;
    let steps = table.output(
        Quantity::InternalSteps,
        "internal_steps",
        Span::Total,
        None,
        "Internal steps done since the start",
    );
    steps.variability = Variability::Discrete;
}

/// Lengths beyond this are not small against the radius of the contact nodes (m).
fn largest_length(scene: &Parts) -> f64 {
    let radii = scene.rom.contact_nodes.iter().map(|node| node.position[0]);
    SMALL_FRACTION * radii.fold(f64::INFINITY, f64::min)
}

fn inputs(table: &mut Builder, scene: &Parts) -> Result<()> {
    let structure = scene.master;
    if structure.motion == Motion::Rotating {
        let speed =
            table.input(Quantity::Speed, "speed", Some(&ANGULAR_SPEED), structure.speed, "Speed of the rotor about +z");
        speed.display = Some(0);
        speed.nominal = Some(1000.0);
    }
    let surface = scene.surface;
    if surface.moving {
        let change = table.input(
            Quantity::RadiusChange,
            "casing_radius_change",
            Some(&LENGTH),
            0.0,
            "Uniform change of the casing radius; positive opens every clearance",
        );
        (change.nominal, change.display) = (Some(1e-4), Some(1));
        (change.min, change.max) = (Some(-largest_length(scene)), Some(largest_length(scene)));
        if surface.shape != (Shape::Circular {}) {
            let factor = table.input(
                Quantity::ShapeFactor,
                "casing_shape_factor",
                None,
                1.0,
                "Factor on the casing shape (0 = round, 1 = as in the scene)",
            );
            let change = Surface::new(&surface.shape, scene.settings.contacts[0].gap)?.largest_change();
            let largest = if change > 0.0 { largest_length(scene) / change } else { 1.0 };
            (factor.min, factor.max) = (Some(-largest), Some(largest));
            if scene.carrier.is_none() {
                table.input(
                    Quantity::ShapeRotation,
                    "casing_shape_rotation",
                    Some(&ANGLE),
                    0.0,
                    "Rotation of the casing shape about +z",
                );
            }
        }
    }
    Ok(())
}

fn parameters(table: &mut Builder, scene: &Parts) {
    let settings = &scene.settings;
    let contact = &settings.contacts[0];
    if has_friction(scene) {
        let friction = table.parameter(
            Quantity::Friction,
            "friction_coefficient",
            None,
            contact.friction,
            "Coulomb friction coefficient between tip and casing",
        );
        (friction.min, friction.max, friction.variability) = (Some(0.0), Some(MAX_FRICTION), Variability::Tunable);
    }
    let offset = table.parameter(
        Quantity::GapOffset,
        "gap_offset",
        Some(&LENGTH),
        0.0,
        "Added to the radial clearance of every sector",
    );
    (offset.display, offset.nominal, offset.variability) = (Some(1), Some(1e-4), Variability::Tunable);
    (offset.min, offset.max) = (Some(-largest_length(scene)), Some(largest_length(scene)));
    let ratio = scene.master.damping_ratio.unwrap_or(scene.rom.damping_ratio);
    let damping =
        table.parameter(Quantity::DampingRatio, "damping_ratio", None, ratio, "Modal damping ratio of the rotor");
    (damping.min, damping.max) = (Some(0.0), Some(MAX_DAMPING));
    let step = table.parameter(
        Quantity::StepMax,
        "internal_step_max",
        Some(&TIME),
        settings.time.step,
        "Largest internal time step; the step in use divides the communication step evenly",
    );
    (step.min, step.max) = (Some(SHORTEST_STEP), Some(LONGEST_STEP));
    (step.nominal, step.display) = (Some(settings.time.step), Some(1));
    let scheme = settings.time.scheme as i32 + 1;
    table.choice(Quantity::SchemeChoice, "scheme", &SCHEMES, scheme, "Time-stepping scheme");
    table.choice(Quantity::SolverChoice, "solver", &SOLVERS, contact.solver as i32 + 1, "Contact solver");
    let angle = table.parameter(
        Quantity::InitialAngle,
        "initial_rotor_angle",
        Some(&ANGLE),
        0.0,
        "Angle of the rotor about +z at the start",
    );
    angle.display = Some(0);
    if scene.surface.shape != (Shape::Circular {}) {
        let ramp = table.parameter(
            Quantity::RampTime,
            "casing_ramp_time",
            Some(&TIME),
            scene.surface.ramp_time,
            "Time over which the casing shape grows smoothly from round to full after the start",
        );
        (ramp.min, ramp.max) = (Some(0.0), Some(1e9));
    }
    let name = table.push(Quantity::SceneName, "scene", "Name of the scene this FMU was made from");
    (name.kind, name.causality, name.variability) = (Kind::String, Causality::Local, Variability::Constant);
    name.start = Some(Start::String(settings.name.clone()));
}

/// A scene that gives no friction coefficient has no friction variables.
fn has_friction(scene: &Parts) -> bool {
    scene.settings.contacts[0].friction > 0.0
}

fn totals(table: &mut Builder, scene: &Parts) {
    let gap = Some((&LENGTH, scene.settings.contacts[0].gap));
    let (force, nodes) = (Some((&FORCE, 100.0)), scene.rom.contact_nodes.len());
    table
        .output(Quantity::RotorAngle, "rotor_angle", Span::Point, Some((&ANGLE, 1.0)), "Angle of the rotor about +z")
        .display = Some(0);
    table
        .output(
            Quantity::ClearanceMinimum,
            "clearance_minimum",
            Span::Window,
            gap,
            "Smallest clearance of the whole disk within the communication step, normal to the casing",
        )
        .display = Some(1);
    let each = table.output(
        Quantity::NodeClearanceMinimum,
        "node_clearance_minimum",
        Span::Window,
        gap,
        format!(
            "Smallest clearance over all sectors within the communication step, per contact node ({})",
            node_list(scene)
        ),
    );
    (each.dimension, each.display) = (Some(nodes), Some(1));
    for (component, axis) in ["x", "y", "z"].into_iter().enumerate() {
        table.output(
            Quantity::Force(component),
            format!("force_{axis}"),
            Span::Mean,
            force,
            format!("Contact force on the rotor along fixed {axis}, mean over the communication step"),
        );
    }
    table.output(
        Quantity::Torque,
        "torque",
        Span::Mean,
        Some((&TORQUE, 10.0)),
        "Torque of the contact forces on the rotor about +z, mean over the communication step",
    );
    table.output(
        Quantity::NormalForcePeak,
        "normal_force_peak",
        Span::Window,
        force,
        "Largest normal force of any contact node in any internal step of the communication step (grows as 1/h for impacts)",
    );
    table.output(
        Quantity::NormalImpulse,
        "normal_impulse",
        Span::Window,
        Some((&IMPULSE, 1e-3)),
        "Sum of the normal impulses of all contact nodes within the communication step",
    );
    if has_friction(scene) {
        table.output(
            Quantity::FrictionPower,
            "friction_power",
            Span::Mean,
            Some((&POWER, 100.0)),
            "Friction heat per time, mean over the communication step",
        );
    }
    let count = table.output(
        Quantity::ContactCount,
        "contact_count",
        Span::Point,
        None,
        "Contact nodes touching at the communication point",
    );
    (count.kind, count.variability) = (Kind::Integer, Variability::Discrete);
    let touching = table.output(
        Quantity::InContact,
        "in_contact",
        Span::Point,
        None,
        "Whether any contact node touches at the communication point",
    );
    (touching.kind, touching.variability) = (Kind::Boolean, Variability::Discrete);
}

fn node_list(scene: &Parts) -> String {
    let names: Vec<&str> = scene.rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
    names.join(", ")
}

fn watched(table: &mut Builder, scene: &Parts) -> Result<()> {
    let rom = scene.rom;
    let (gap, force) = (Some((&LENGTH, scene.settings.contacts[0].gap)), Some((&FORCE, 100.0)));
    for sector in &scene.settings.outputs.watched_sectors {
        if *sector == 0 || *sector > rom.sectors {
            return Err(Error::invalid(
                "outputs.watched_sectors",
                format!("sector {sector} of {}", rom.sectors),
                "Use sector numbers from 1 to the number of sectors of the ROM",
            ));
        }
        let (index, list) = (sector - 1, node_list(scene));
        let rows = watched_rows(index, [gap, force], scene.settings.outputs.instantaneous_forces, has_friction(scene));
        for (quantity, name, span, unit, text) in rows {
            let name = format!("blade[{sector}].{name}");
            let variable = table.output(quantity, name, span, unit, format!("{text} ({list})"));
            variable.dimension = Some(rom.contact_nodes.len());
            variable.display = unit.filter(|(unit, _)| **unit == LENGTH).map(|_| 1);
        }
    }
    Ok(())
}

/// Quantity, name, span, unit and description of an output per contact node.
type NodeRow = (Quantity, &'static str, Span, Option<(&'static Unit, f64)>, &'static str);

/// Outputs over the contact nodes of a sector (0-based); units of gaps and forces.
fn watched_rows(
    index: usize,
    [gap, force]: [Option<(&'static Unit, f64)>; 2],
    instantaneous: bool,
    friction: bool,
) -> impl Iterator<Item = NodeRow> {
    let rows: [NodeRow; 6] = [
        (
            Quantity::Clearance(index),
            "clearance",
            Span::Point,
            gap,
            "Clearance normal to the casing at the communication point",
        ),
        (
            Quantity::WatchedClearanceMinimum(index),
            "clearance_minimum",
            Span::Window,
            gap,
            "Smallest clearance within the communication step",
        ),
        (
            Quantity::NormalForce(index),
            "normal_force",
            Span::Mean,
            force,
            "Normal contact force, mean over the communication step",
        ),
        (
            Quantity::TangentialForce(index),
            "tangential_force",
            Span::Mean,
            force,
            "Magnitude of the friction force (axial part included), mean over the communication step",
        ),
        (
            Quantity::NormalForceNow(index),
            "normal_force_now",
            Span::Point,
            force,
            "Normal contact force of the last internal step",
        ),
        (
            Quantity::TangentialForceNow(index),
            "tangential_force_now",
            Span::Point,
            force,
            "Friction force of the last internal step",
        ),
    ];
    rows.into_iter().filter(move |row| match row.0 {
        Quantity::TangentialForce(_) => friction,
        Quantity::NormalForceNow(_) => instantaneous,
        Quantity::TangentialForceNow(_) => instantaneous && friction,
        _ => true,
    })
}

fn fields(table: &mut Builder, scene: &Parts) -> Result<()> {
    let (outputs, sectors) = (&scene.settings.outputs, scene.rom.sectors);
    let gap = scene.settings.contacts[0].gap;
    if outputs.all_sectors {
        let clearance = table.output(
            Quantity::SectorClearanceMinimum,
            "sector_clearance_minimum",
            Span::Window,
            Some((&LENGTH, gap)),
            "Smallest clearance of each sector within the communication step",
        );
        (clearance.dimension, clearance.display) = (Some(sectors), Some(1));
        let force = table.output(
            Quantity::SectorNormalForce,
            "sector_normal_force",
            Span::Mean,
            Some((&FORCE, 100.0)),
            "Normal contact force of each sector, mean over the communication step",
        );
        force.dimension = Some(sectors);
    }
    if let Some(largest) = outputs.nodal_diameters {
        if largest > sectors / 2 {
            return Err(Error::invalid(
                "outputs.nodal_diameters",
                format!("{largest} with {sectors} sectors"),
                format!("Use at most {}", sectors / 2),
            ));
        }
        let amplitude = table.output(
            Quantity::NodalDiameterAmplitude,
            "nodal_diameter_amplitude",
            Span::Point,
            Some((&LENGTH, gap)),
            "Amplitude of the radial displacement of the middle contact node per nodal diameter 0, 1, 2, …",
        );
        (amplitude.dimension, amplitude.display) = (Some(largest + 1), Some(1));
    }
    Ok(())
}

fn energies(table: &mut Builder, scene: &Parts) {
    let rows = [
        (
            Quantity::KineticEnergy,
            "kinetic_energy",
            Span::Point,
            "Kinetic energy of the vibration in the rotating frame",
        ),
        (Quantity::StrainEnergy, "strain_energy", Span::Point, "Strain energy"),
        (Quantity::DampingLoss, "damping_loss", Span::Total, "Energy lost by modal damping since the start"),
        (Quantity::FrictionLoss, "friction_loss", Span::Total, "Friction heat since the start"),
        (
            Quantity::ImpactLoss,
            "impact_loss",
            Span::Total,
            "Energy lost by contact nodes stopping at the casing since the start",
        ),
        (
            Quantity::WearWork,
            "wear_work",
            Span::Total,
            "Work of the coating's normal force against the approach of the blades since the start",
        ),
        (
            Quantity::LoadWork,
            "load_work",
            Span::Total,
            "Work of centrifugal, thermal and nodal-diameter loads since the start",
        ),
        (
            Quantity::ExternalWork,
            "external_work",
            Span::Total,
            "Work of shaft and moving casing through the contacts since the start",
        ),
        (
            Quantity::StepChangeEnergy,
            "step_change_energy",
            Span::Total,
            "Energy added by changes of the internal step since the start",
        ),
        (Quantity::EnergyResidual, "energy_residual", Span::Point, "Closure residual of the energy ledger"),
    ];
    let exists = |quantity| match quantity {
        Quantity::FrictionLoss => has_friction(scene),
        Quantity::WearWork => scene.settings.contacts[0].coating.is_some(),
        Quantity::LoadWork => features::is_loaded(scene),
        _ => true,
    };
    for (quantity, name, span, text) in rows.into_iter().filter(|row| exists(row.0)) {
        table.output(quantity, name, span, Some((&ENERGY, 1.0)), text);
    }
    table.output(
        Quantity::EnergyResidualRelative,
        "energy_residual_relative",
        Span::Point,
        None,
        "Closure residual relative to the initial energy plus all work exchanged",
    );
}
