//! The scene: every setting with its unit, default and range. `tiprub-format` reads it from TOML.

mod coating;
pub(crate) mod relations;
pub mod rules;
mod surfaces;
mod time;
mod validation;

use serde::{Deserialize, Serialize};
use std::sync::Arc;
use tiprub_cosim::warning::Topic;

use crate::Rom;
use crate::math::real;
use crate::scene::method::Solver;
pub use coating::{CoatingSettings, CuttingSettings};
pub use surfaces::{Closure, Interpolation, PatchSettings, Shape, SplineSettings, SurfaceSettings};
pub use time::{ADAPTIVE_STEP, InputInterpolation, TOLERANCE, TimeSettings};

/// Returns whether a value is its default. Newer keys at their default are not written, so that older scenes are unchanged.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Returns whether a value is positive zero. A negative zero is written, so that it is read back bit by bit.
fn is_positive_zero(value: &f64) -> bool {
    value.to_bits() == 0
}

/// Reads exactly three numbers; a longer list is an error.
fn three<'de, D: serde::Deserializer<'de>>(source: D) -> std::result::Result<[f64; 3], D::Error> {
    let values = Vec::<f64>::deserialize(source)?;
    let length = values.len();
    values.try_into().map_err(|_| serde::de::Error::invalid_length(length, &"an array of length 3"))
}

fn is_at_rest(velocity: &[f64; 3]) -> bool {
    velocity.iter().all(is_positive_zero)
}

/// Rigid motion of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BodyMotion {
    /// Turns about the z axis with the input `speed`.
    #[default]
    Rotating,
    /// Stands still; the input `speed` does not exist.
    Still,
    /// Free body, on which only its contacts act: a Cartesian ROM whose stiffness has the three rigid translations in its null space.
    /// `velocity` is its initial velocity.
    Free,
}

/// Effects of spin on a rotating structure, each off unless requested. They need a ROM with spin matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SpinSettings {
    /// Centrifugal stiffening and spin softening.
    #[serde(skip_serializing_if = "is_default")]
    pub stiffening: bool,
    /// Centrifugal growth: the static load Ω²c.
    #[serde(skip_serializing_if = "is_default")]
    pub growth: bool,
    /// Coriolis force.
    #[serde(skip_serializing_if = "is_default")]
    pub coriolis: bool,
}

/// Radial line load amplitude·cos(order·θ − phase) on the contact grid of a structure that stands still.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSettings {
    /// Start value of the number of nodal diameters, below half the nodes around of the contact grid.
    pub order: u32,
    /// Start value of the amplitude input (N per metre of circumference, outward positive).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub amplitude: f64,
    /// Start value of the phase input (rad).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub phase: f64,
}

/// Component of a displacement or force at a contact node of a rotating structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ForceDirection {
    /// Away from the axis.
    Radial,
    /// Around the axis, towards increasing angles.
    Tangential,
    /// Along the axis.
    Axial,
}

/// Aerodynamic excitation by an engine order: the force on blade j of N is amplitude·cos(order·(θ_r + 2π(j − 1)/N) −
/// phase), a stationary pattern.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitationSettings {
    /// Start value of the engine order.
    pub order: u32,
    /// Mode family (1-based) that is loaded; all modes if absent. The load is the modal load of the force at `node`.
    /// Without a node, the force acts on the displacement component of a contact node that the mode moves most.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<usize>,
    /// Contact node at which the force acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
    /// Direction of the force at that node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<ForceDirection>,
    /// Start value of the amplitude input (N per blade).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub amplitude: f64,
    /// Start value of the phase input (rad).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub phase: f64,
}

/// Initial displacement and velocity of the blades in one mode family, given for the displacement component of a
/// contact node that the mode moves most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitialSettings {
    /// Mode family (1-based).
    pub mode: usize,
    /// Sector (1-based) that moves alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sector: Option<usize>,
    /// Nodal diameter n: blade j of N moves with cos(2πn(j − 1)/N − phase). All blades have the same motion if neither
    /// this nor `sector` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodal_diameter: Option<usize>,
    /// Phase of that pattern (rad).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub phase: f64,
    /// Start value of the displacement parameter (m).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub displacement: f64,
    /// Start value of the velocity parameter (m/s).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub velocity: f64,
}

/// One flexible structure.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructureSettings {
    /// Name by which contacts refer to it.
    pub name: String,
    /// ROM file, relative to the scene file; or `builtin:rotor37`.
    pub rom: String,
    /// Rigid motion.
    #[serde(default)]
    pub motion: BodyMotion,
    /// Start value of the speed input (rad/s).
    #[serde(default)]
    pub speed: f64,
    /// Start value of the velocity of the whole body along x, y, z (m/s); for free bodies only.
    #[serde(default, deserialize_with = "three", skip_serializing_if = "is_at_rest")]
    pub velocity: [f64; 3],
    /// Modal damping ratio ξ (-), 0 ≤ ξ < 1; that of the ROM if absent.
    #[serde(default)]
    pub damping_ratio: Option<f64>,
    /// Damping ratios ξ (-) of the first modes, of each nodal diameter if sectors are coupled; `damping_ratio` applies to the others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub damping_ratios: Vec<f64>,
    /// Effects of spin.
    #[serde(default, skip_serializing_if = "is_default")]
    pub spin: SpinSettings,
    /// Makes the displacement of the shaft centre in x and y inputs.
    #[serde(default, skip_serializing_if = "is_default")]
    pub whirl: bool,
    /// Makes the axial displacement of the rotor an input.
    #[serde(default, skip_serializing_if = "is_default")]
    pub axial_shift: bool,
    /// Mistuning: factor on the natural frequencies of each sector, one value per sector; empty = all equal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frequency_factors: Vec<f64>,
    /// Makes the temperatures of the ROM's patches inputs; for a rotor one temperature.
    #[serde(default, skip_serializing_if = "is_default")]
    pub thermal: bool,
    /// Fraction of its elastic stiffness that a rotor loses per kelvin (1/K).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub softening: f64,
    /// Nodal-diameter load with amplitude and phase as inputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<LoadSettings>,
    /// Excitation by an engine order, with amplitude and phase as inputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excitation: Option<ExcitationSettings>,
    /// Initial motion of the blades.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub initial: Vec<InitialSettings>,
}

/// Direction of the contact normal with respect to the meridional slope of the tip contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Meridian {
    /// The normal is perpendicular to the casing contour parallel to the tip (default).
    #[default]
    Contour,
    /// No axial component of the normal: the paper's assumption for the stage application.
    Cylinder,
}

/// One contact pair: master nodes of a structure against a slave.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactSettings {
    /// Structure whose contact nodes are the masters.
    pub master: String,
    /// Surface that they can touch.
    pub slave: String,
    /// Prefix of the names of the contact nodes in this pair; all nodes if absent. No two pairs of one structure may contain the same node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<String>,
    /// Radial tip clearance of the undeformed structure (m), > 0; absent (0) for a free master, whose gaps follow from
    /// the positions in both ROMs.
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub gap: f64,
    /// Clearance of each sector (m) if they differ; replaces `gap`, which may then be absent. One value per sector.
    #[serde(default)]
    pub sector_gaps: Vec<f64>,
    /// Coulomb friction coefficient µ (-), 0 ≤ µ ≤ 2.
    #[serde(default)]
    pub friction: f64,
    /// Solver of the contact problem.
    #[serde(default)]
    pub solver: Solver,
    /// Direction of the normal in the meridional plane.
    #[serde(default)]
    pub meridian: Meridian,
    /// Abradable coating of the slave.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coating: Option<CoatingSettings>,
    /// Fraction of the friction heat that flows into the slave (-), 0 to 1; the patch outputs contain this fraction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slave_heat_fraction: Option<f64>,
}

impl ContactSettings {
    /// Clearance to which the law of two bumps refers (m): `gap`, or the mean of `sector_gaps` if they replace it.
    pub fn nominal_gap(&self) -> f64 {
        if self.gap != 0.0 || self.sector_gaps.is_empty() {
            return self.gap;
        }
        self.sector_gaps.iter().sum::<f64>() / real(self.sector_gaps.len())
    }
}

/// Outputs of the FMU in addition to the totals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OutputSettings {
    /// Sectors (1-based) with clearances and forces per contact node.
    pub watched_sectors: Vec<usize>,
    /// Smallest clearance and normal force of every sector.
    pub all_sectors: bool,
    /// Nodal-diameter amplitudes from 0 to this number, of the radial tip displacement; absent = none.
    pub nodal_diameters: Option<usize>,
    /// Energy ledger.
    pub energies: bool,
    /// Values at the communication point in addition to averages over the step.
    pub instantaneous_forces: bool,
    /// Stress of watched sectors at the places at which the ROMs recover it.
    #[serde(skip_serializing_if = "is_default")]
    pub stress: bool,
    /// Number of modes of watched sectors, from the lowest, whose amplitudes are outputs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modal_amplitudes: Option<usize>,
    /// Displacements of the contact nodes of watched sectors.
    #[serde(skip_serializing_if = "is_default")]
    pub tip_displacements: bool,
    /// Force and moment on every surface around an axis.
    #[serde(skip_serializing_if = "is_default")]
    pub casing_forces: bool,
    /// Force and moment of the support on the casing.
    #[serde(skip_serializing_if = "is_default")]
    pub support_reaction: bool,
    /// Wear depth of every coating cell.
    #[serde(skip_serializing_if = "is_default")]
    pub wear: bool,
    /// Mean wear depth around the circumference and along the axis.
    #[serde(skip_serializing_if = "is_default")]
    pub wear_profile: bool,
    /// Radial displacement of every contact-grid node of the flexible slave.
    #[serde(skip_serializing_if = "is_default")]
    pub slave_displacement: bool,
}

impl Default for OutputSettings {
    fn default() -> Self {
        Self {
            watched_sectors: vec![1],
            all_sectors: false,
            nodal_diameters: None,
            energies: true,
            instantaneous_forces: false,
            stress: false,
            modal_amplitudes: None,
            tip_displacements: false,
            casing_forces: false,
            support_reaction: false,
            wear: false,
            wear_profile: false,
            slave_displacement: false,
        }
    }
}

/// Proposal for the importer: start, stop and communication step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentSettings {
    /// Start time (s).
    #[serde(default)]
    pub start: f64,
    /// Stop time (s).
    pub stop: f64,
    /// Communication step H (s).
    pub communication_step: f64,
}

/// Scheme and solver in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Individual settings (default).
    #[default]
    None,
    /// The paper's method: central differences and the film of eq. 11.
    Paper,
}

/// Settings of a scene, without its ROMs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSettings {
    /// Name of the model; letters, digits, underscore.
    pub name: String,
    /// Description in one or a few sentences for the importer's catalogue.
    #[serde(default)]
    pub description: String,
    /// Scheme and solver in one word.
    #[serde(default, skip_serializing_if = "is_default")]
    pub preset: Preset,
    /// True if implausible values ([`crate::limits::plausibility`]) are warnings instead of errors.
    #[serde(default, skip_serializing_if = "is_default")]
    pub accept_implausible: bool,
    /// Identifiers of silenced warnings ([`tiprub_cosim::warning::Topic::id`]).
    #[serde(default, skip_serializing_if = "is_default")]
    pub silence: Vec<String>,
    /// Flexible structures.
    #[serde(rename = "structure")]
    pub structures: Vec<StructureSettings>,
    /// Surfaces, rigid or carried by a structure.
    #[serde(rename = "surface")]
    pub surfaces: Vec<SurfaceSettings>,
    /// Contact pairs.
    #[serde(rename = "contact")]
    pub contacts: Vec<ContactSettings>,
    /// Internal time stepping.
    #[serde(default)]
    pub time: TimeSettings,
    /// Optional outputs.
    #[serde(default)]
    pub outputs: OutputSettings,
    /// Default experiment.
    pub experiment: ExperimentSettings,
}

impl SceneSettings {
    /// Returns whether warnings about a topic are silenced.
    pub fn is_silenced(&self, topic: Topic) -> bool {
        self.silence.iter().any(|id| id == topic.id())
    }
}

/// A complete scene: settings and one ROM per structure, in the same order.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Settings as written by the user.
    pub settings: SceneSettings,
    /// One ROM per entry of `settings.structures`.
    pub roms: Vec<Rom>,
}

/// Clones the scene.
impl From<&Scene> for Arc<Scene> {
    fn from(scene: &Scene) -> Self {
        Self::new(scene.clone())
    }
}
