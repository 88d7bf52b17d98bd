//! The scene: every setting with its unit, default and range. `tiprub-format` reads it from TOML.

mod blades;
mod coating;
pub(crate) mod relations;
pub mod rules;
mod time;
mod validation;

use serde::{Deserialize, Serialize};
use std::sync::Arc;
use tiprub_cosim::warning::Topic;

use crate::Rom;
use crate::scene::method::Solver;
pub use blades::{ExcitationSettings, ForceDirection, InitialSettings};
pub use coating::{CoatingSettings, CuttingSettings};
pub use time::{ADAPTIVE_STEP, InputInterpolation, TOLERANCE, TimeSettings};

/// Shape of a rigid surface of revolution: radial clearance change around the circumference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// Perfectly round: the clearance is the gap everywhere.
    Circular {},
    /// Harmonic lobes: the casing radius changes by −amplitude·cos(order·θ − phase).
    Lobes {
        /// Amplitude (m).
        amplitude: f64,
        /// Number of lobes around the circumference.
        order: u32,
        /// Phase (rad).
        #[serde(default)]
        phase: f64,
    },
    /// Two smooth bumps half a turn apart: clearance c(1 − 2·depth·exp(−((mod(θ − phase, π)/π − ½)/width)²)), c the gap.
    TwoLobe {
        /// Depth factor (-): at 1 the bump overlaps the undeformed tip by as much as the gap.
        #[serde(default = "one")]
        depth: f64,
        /// Width parameter of the bump (-), fraction of half a turn.
        #[serde(default = "two_lobe_width")]
        width: f64,
        /// Phase (rad).
        #[serde(default)]
        phase: f64,
    },
    /// Table of the change of casing radius (m) at equally spaced angles starting at θ = 0, periodic cubic between.
    Table {
        /// Change of casing radius (m), at least 4 values; positive opens the clearance.
        radius_change: Vec<f64>,
    },
}

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

fn one() -> f64 {
    1.0
}

fn two_lobe_width() -> f64 {
    0.15
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

impl Default for Shape {
    fn default() -> Self {
        Self::Circular {}
    }
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

/// Continuation of a surface spline around the circumference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Closure {
    /// Continuous first and second derivatives (fig. 8b of the paper; default).
    #[default]
    Smooth,
    /// Free ends that only meet in position at the seam θ = 0 (fig. 8a of the paper).
    FreeEnds,
}

/// Interpolation between the data points of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Bicubic uniform B-spline (default).
    #[default]
    Spline,
    /// Bilinear facets, whose normals jump from one to the next: only for comparison.
    Facets,
}

/// A surface through data points, with the closest point as the contact point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplineSettings {
    /// Number of data points around the circumference; that of the structure's contact grid if the surface has a structure.
    #[serde(default = "default_around", skip_serializing_if = "is_default_around")]
    pub around: usize,
    /// Number of rings of data points along the axis; that of the structure's contact grid if the surface has a structure.
    #[serde(default = "default_along", skip_serializing_if = "is_default_along")]
    pub along: usize,
    /// Closure around the circumference.
    #[serde(default, skip_serializing_if = "is_default")]
    pub closure: Closure,
    /// Interpolation between the data points.
    #[serde(default, skip_serializing_if = "is_default")]
    pub interpolation: Interpolation,
}

impl Default for SplineSettings {
    fn default() -> Self {
        Self {
            around: default_around(),
            along: default_along(),
            closure: Closure::default(),
            interpolation: Interpolation::default(),
        }
    }
}

fn default_around() -> usize {
    72
}

fn default_along() -> usize {
    5
}

fn is_default_around(around: &usize) -> bool {
    *around == default_around()
}

fn is_default_along(along: &usize) -> bool {
    *along == default_along()
}

/// Equal parts of the circumference and of the axial extent of the contact, for friction power.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchSettings {
    /// Number of parts around the circumference, the first from θ = 0.
    pub around: usize,
    /// Number of parts along the axis.
    #[serde(default = "one_part", skip_serializing_if = "is_one_part")]
    pub along: usize,
}

fn one_part() -> usize {
    1
}

fn is_one_part(parts: &usize) -> bool {
    *parts == one_part()
}

/// One surface: around the z axis and parallel to the tip contour of its rotor, or through the open contact grid of a structure if its
/// master is a free body.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceSettings {
    /// Name by which contacts refer to it.
    pub name: String,
    /// Shape around the circumference.
    #[serde(default)]
    pub shape: Shape,
    /// Time over which the shape grows smoothly from circular to full (s), 0 = immediately.
    #[serde(default)]
    pub ramp_time: f64,
    /// Makes the amplitude factor of the shape, its rotation and the uniform radius change inputs.
    #[serde(default)]
    pub moving: bool,
    /// Structure that carries the surface and deforms it; its ROM needs a contact grid. The surface is rigid if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub structure: Option<String>,
    /// True if the structure only defines the position of the surface and does not deform it. For free bodies only.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rigid: bool,
    /// Surface spline through data points; the analytical surface of revolution if absent (always a spline on a structure).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spline: Option<SplineSettings>,
    /// Patches whose friction power is an output; the heated patches of the ROM if absent and the structure is thermal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patches: Option<PatchSettings>,
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
        #[expect(clippy::cast_precision_loss, reason = "at most as many as sectors")]
        let count = self.sector_gaps.len() as f64;
        self.sector_gaps.iter().sum::<f64>() / count
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
