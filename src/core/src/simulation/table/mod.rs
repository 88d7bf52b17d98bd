//! The variable table of a scene: one row per thing an importer can see. Features that are off have no row.

mod builder;
mod contacts;
mod features;
mod free;
mod outputs;
mod units;

use super::compile::{Roles, SMALL_FRACTION};
use super::outputs::Reader;
use super::patches::Patches;
use crate::contact::surface::Surface;
use crate::settings::{InputInterpolation, Motion, Scene, SceneSettings, Shape, StructureSettings, SurfaceSettings};
use crate::variables::{Quantity, Variability, VariableTable};
use crate::{Result, Rom, ranges};
use builder::{Builder, RAMPED};
use units::{ANGLE, ANGULAR_SPEED, TIME};
pub use units::{LENGTH, SCHEMES, SOLVERS};

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

/// Build the table of a validated scene, and what fills its outputs, in their order.
///
/// # Errors
/// A watched sector or nodal diameter the ROM does not have.
pub fn build(scene: &Scene) -> Result<(VariableTable, Vec<Reader>)> {
    if scene.settings.free_master().is_some() {
        return free::build(scene);
    }
    let scene = &Parts::new(scene)?;
    let mut table = Builder::default();
    table.time();
    inputs(&mut table, scene)?;
    features::inputs(&mut table, scene);
    parameters(&mut table, scene);
    features::parameters(&mut table, scene);
    outputs::totals(&mut table, scene);
    outputs::watched(&mut table, scene)?;
    outputs::fields(&mut table, scene)?;
    features::outputs(&mut table, scene);
    if scene.settings.outputs.energies {
        outputs::energies(&mut table, scene);
    }
    contacts::internal_steps(&mut table, scene.settings);
    table.finish()
}

/// Lengths beyond this are not small against the radius of the contact nodes (m).
fn largest_length(scene: &Parts) -> f64 {
    let radii = scene.rom.contact_nodes.iter().map(|node| node.position[0]);
    SMALL_FRACTION * radii.fold(f64::INFINITY, f64::min)
}

fn inputs(table: &mut Builder, scene: &Parts) -> Result<()> {
    let structure = scene.master;
    if structure.motion == Motion::Rotating {
        let speed = table.input(
            Quantity::Speed,
            "speed",
            Some(&ANGULAR_SPEED),
            structure.speed,
            "Speed of the rotor about +z; held over a step, or linear with a derivative",
        );
        speed.display = Some(0);
        speed.nominal = Some(1000.0);
        (speed.min, speed.max) = (Some(-ranges::SPEED), Some(ranges::SPEED));
    }
    let surface = scene.surface;
    if surface.moving {
        let change = table.moving_input(
            Quantity::RadiusChange,
            "casing_radius_change",
            Some(&LENGTH),
            0.0,
            "Uniform change of the casing radius; positive opens every clearance",
        );
        (change.nominal, change.display) = (Some(1e-4), Some(1));
        (change.min, change.max) = (Some(-largest_length(scene)), Some(largest_length(scene)));
        if surface.shape != (Shape::Circular {}) {
            let factor = table.moving_input(
                Quantity::ShapeFactor,
                "casing_shape_factor",
                None,
                1.0,
                "Factor on the casing shape (0 = round, 1 = as in the scene)",
            );
            let change = Surface::new(&surface.shape, scene.settings.contacts[0].nominal_gap())?.largest_change();
            let largest = if change > 0.0 { largest_length(scene) / change } else { 1.0 };
            (factor.min, factor.max) = (Some(-largest), Some(largest));
            if scene.carrier.is_none() {
                table.moving_input(
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
        table.friction(contact, "Coulomb friction coefficient between tip and casing");
    }
    let offset = table.parameter(
        Quantity::GapOffset,
        "gap_offset",
        Some(&LENGTH),
        0.0,
        "Added to the radial clearance of every sector",
    );
    offset.description += RAMPED;
    (offset.display, offset.nominal, offset.variability) = (Some(1), Some(1e-4), Variability::Tunable);
    (offset.min, offset.max) = (Some(-largest_length(scene)), Some(largest_length(scene)));
    let ratio = scene.master.damping_ratio.unwrap_or(scene.rom.damping_ratio);
    table.damping(Quantity::DampingRatio, "damping_ratio", ratio, "Modal damping ratio of the rotor");
    table.methods(settings);
    if features::has_moving_inputs(scene) || settings.time.input_interpolation == InputInterpolation::Hold {
        table.input_interpolation(settings);
    }
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
        (ramp.min, ramp.max) = (Some(0.0), Some(ranges::TIME));
    }
    table.scene_name(settings);
}

/// A scene that gives no friction coefficient has no friction variables.
fn has_friction(scene: &Parts) -> bool {
    scene.settings.contacts[0].friction > 0.0
}
