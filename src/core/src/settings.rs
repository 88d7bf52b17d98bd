//! The scene: every setting with its unit, default and range. `tiprub-format` reads it from TOML.

use serde::{Deserialize, Serialize};

use crate::{Error, Result, Rom};

/// Time-stepping scheme of the modal equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Explicit central differences, the paper's scheme (eq. 9); stable for ωh < 2.
    CentralDifference,
    /// Two-step recurrence that is exact in free flight and at rest under constant force (default).
    #[default]
    ModalExact,
    /// The highest modes, three per contact node, are quasi-static: contact acts through their residual flexibility
    /// (Monjaraz-Tec, Gross, Krack, J. Sound Vib. 2022); the other modes take the contact force one step later.
    MasslessBoundary,
}

/// Solver of the unilateral contact problem of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// The paper's forward-increment Lagrange multipliers (eqs 10-11): penetration detected once, equality there.
    Film,
    /// Linear complementarity over all contact nodes (default).
    #[default]
    Lcp,
    /// Coulomb friction with sticking: De Saxcé's form by Gauss-Seidel with exact local solutions.
    Coulomb,
}

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
        /// Depth factor (-): 1 makes the bump intrude by as much as the gap.
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

fn one() -> f64 {
    1.0
}

fn two_lobe_width() -> f64 {
    0.15
}

/// How a structure moves as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// Turns about the z axis with the input `speed`.
    #[default]
    Rotating,
    /// Stands still; `speed` does not exist.
    Still,
}

impl Default for Shape {
    fn default() -> Self {
        Self::Circular {}
    }
}

/// Effects of spin on a rotating structure, each off unless asked for. They need a ROM with spin matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SpinSettings {
    /// Centrifugal stiffening and spin softening.
    pub stiffening: bool,
    /// Centrifugal growth: the static load Ω²c.
    pub growth: bool,
    /// Coriolis force.
    pub coriolis: bool,
}

/// Radial line load amplitude·cos(order·θ − phase) on the contact grid of a structure that stands still.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSettings {
    /// Nodal diameter.
    pub order: u32,
    /// Start value of the amplitude input (N per metre of circumference, outward positive).
    #[serde(default)]
    pub amplitude: f64,
    /// Start value of the phase input (rad).
    #[serde(default)]
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
    pub motion: Motion,
    /// Start value of the speed input (rad/s).
    #[serde(default)]
    pub speed: f64,
    /// Modal damping ratio ξ (-), 0 ≤ ξ < 1; the ROM's own when absent.
    #[serde(default)]
    pub damping_ratio: Option<f64>,
    /// Effects of spin.
    #[serde(default)]
    pub spin: SpinSettings,
    /// Make the displacement of the shaft's centre in x and y inputs.
    #[serde(default)]
    pub whirl: bool,
    /// Make the axial displacement of the rotor an input.
    #[serde(default)]
    pub axial_shift: bool,
    /// Mistuning: factor on the natural frequencies of each sector, one value per sector; empty = all equal.
    #[serde(default)]
    pub frequency_factors: Vec<f64>,
    /// Make the temperatures of the ROM's patches inputs.
    #[serde(default)]
    pub thermal: bool,
    /// Nodal-diameter load with amplitude and phase as inputs.
    #[serde(default)]
    pub load: Option<LoadSettings>,
}

/// What happens to a surface spline where it closes around the circumference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Closure {
    /// Continuous first and second derivatives (fig. 8b of the paper; default).
    #[default]
    Smooth,
    /// Free ends that only meet in position at the seam θ = 0 (fig. 8a of the paper).
    FreeEnds,
}

/// How a surface runs between its data points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Bicubic uniform B-spline (default).
    #[default]
    Spline,
    /// Bilinear facets, whose normals jump from one to the next: only to compare with.
    Facets,
}

/// A surface through data points, with the closest point as the contact point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplineSettings {
    /// Data points around the circumference; those of the structure's contact grid where the surface has a structure.
    #[serde(default = "default_around")]
    pub around: usize,
    /// Rings of data points along the axis; those of the structure's contact grid where the surface has a structure.
    #[serde(default = "default_along")]
    pub along: usize,
    /// Closure around the circumference.
    #[serde(default)]
    pub closure: Closure,
    /// Between the data points.
    #[serde(default)]
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

/// Equal parts of the circumference and of the axial extent of the contact, for friction power.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchSettings {
    /// Parts around the circumference, the first from θ = 0.
    pub around: usize,
    /// Parts along the axis.
    #[serde(default = "one_part")]
    pub along: usize,
}

fn one_part() -> usize {
    1
}

/// One surface around the z axis, parallel to the tip contour of the structure it faces.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceSettings {
    /// Name by which contacts refer to it.
    pub name: String,
    /// Shape around the circumference.
    #[serde(default)]
    pub shape: Shape,
    /// Time over which the shape grows smoothly from circular to full (s), 0 = at once.
    #[serde(default)]
    pub ramp_time: f64,
    /// Make the shape amplitude factor, its rotation and the uniform radius change inputs.
    #[serde(default)]
    pub moving: bool,
    /// Structure that carries the surface and deforms it; its ROM needs a contact grid. Rigid where absent.
    #[serde(default)]
    pub structure: Option<String>,
    /// Surface spline through data points; the analytical surface of revolution where absent (always a spline on a
    /// structure).
    #[serde(default)]
    pub spline: Option<SplineSettings>,
    /// Friction power of each of these patches as an output; those of the ROM where the structure is thermal.
    #[serde(default)]
    pub patches: Option<PatchSettings>,
}

/// Abradable coating on a surface: cells of rods that yield and harden (Legrand, Batailly, Pierre, J. Comput.
/// Nonlinear Dyn. 2012). Its unworn surface is where `gap` ends; the hard surface lies `thickness` behind it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoatingSettings {
    /// Thickness h₀ (m), > 0.
    pub thickness: f64,
    /// Modulus E (Pa), > 0.
    pub modulus: f64,
    /// Yield stress Y (Pa), ≥ 0.
    pub yield_stress: f64,
    /// Linear hardening modulus K (Pa), ≥ 0.
    pub hardening: f64,
    /// Cells around the circumference.
    pub cells_around: usize,
    /// Cells along the axis, over the axial extent of the contact nodes.
    pub cells_along: usize,
}

/// Whether the contact normal follows the meridional slope of the tip contour.
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
    /// Surface they meet.
    pub slave: String,
    /// Radial tip clearance of the undeformed structure (m), > 0.
    pub gap: f64,
    /// Clearance of each sector (m) where they differ; replaces `gap`, one value per sector.
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
    #[serde(default)]
    pub coating: Option<CoatingSettings>,
    /// Share of the friction heat that goes into the slave (-), 0 to 1; the patch outputs carry this share.
    #[serde(default)]
    pub heat_to_slave: Option<f64>,
}

/// Internal time stepping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeSettings {
    /// Scheme.
    #[serde(default)]
    pub scheme: Scheme,
    /// Largest internal step h (s); the step used divides the communication step evenly.
    pub step: f64,
}

/// What the FMU exposes beside the totals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OutputSettings {
    /// Sectors (1-based) with clearances and forces per contact node.
    pub watched_sectors: Vec<usize>,
    /// Smallest clearance and normal force of every sector.
    pub all_sectors: bool,
    /// Nodal-diameter amplitudes 0..=this of the radial tip displacement; absent = none.
    pub nodal_diameters: Option<usize>,
    /// Energy ledger.
    pub energies: bool,
    /// Values at the communication point in addition to averages over the step.
    pub instantaneous_forces: bool,
    /// Wear depth of every coating cell.
    pub wear: bool,
    /// Radial displacement of every contact-grid node of the flexible slave.
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
            wear: false,
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

/// The settings of a scene, without the ROMs it names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSettings {
    /// Name of the model; letters, digits, underscore.
    pub name: String,
    /// One or a few sentences for the importer's catalogue.
    #[serde(default)]
    pub description: String,
    /// Flexible structures.
    #[serde(rename = "structure")]
    pub structures: Vec<StructureSettings>,
    /// Rigid surfaces.
    #[serde(rename = "surface")]
    pub surfaces: Vec<SurfaceSettings>,
    /// Contact pairs.
    #[serde(rename = "contact")]
    pub contacts: Vec<ContactSettings>,
    /// Internal time stepping.
    pub time: TimeSettings,
    /// What to expose.
    #[serde(default)]
    pub outputs: OutputSettings,
    /// Default experiment.
    pub experiment: ExperimentSettings,
}

/// A complete scene: settings and one ROM per structure, in the same order.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Settings as written by the user.
    pub settings: SceneSettings,
    /// One ROM per entry of `settings.structures`.
    pub roms: Vec<Rom>,
}

impl SceneSettings {
    /// Check every value against its documented range, and the names against each other.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the field as written in the scene file.
    pub fn validate(&self) -> Result<()> {
        let word = |text: &str| {
            text.starts_with(|c: char| c.is_ascii_alphabetic())
                && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        };
        let names = self.structures.iter().map(|s| ("structure.name", &s.name));
        let names = names.chain(self.surfaces.iter().map(|s| ("surface.name", &s.name)));
        for (field, name) in names.chain([("name", &self.name)]) {
            if !word(name) {
                return Err(Error::invalid(
                    field,
                    format!("`{name}` is not a plain name"),
                    "Use letters, digits and underscores, starting with a letter",
                ));
            }
        }
        if self.structures.is_empty() || self.contacts.is_empty() {
            return Err(Error::invalid(
                "scene",
                format!("{} structures and {} contacts", self.structures.len(), self.contacts.len()),
                "A scene needs at least one [[structure]] and one [[contact]]",
            ));
        }
        for (index, structure) in self.structures.iter().enumerate() {
            structure.validate(&format!("structure[{}]", index + 1))?;
        }
        for (index, surface) in self.surfaces.iter().enumerate() {
            surface.validate(&format!("surface[{}]", index + 1))?;
        }
        self.validate_unique_names()?;
        for (index, contact) in self.contacts.iter().enumerate() {
            contact.validate(self, &format!("contact[{}]", index + 1))?;
        }
        within("time.step", self.time.step, SHORTEST_STEP, LONGEST_STEP)?;
        finite("experiment.start", self.experiment.start)?;
        positive("experiment.communication_step", self.experiment.communication_step, "s")?;
        if !(self.experiment.stop.is_finite() && self.experiment.stop > self.experiment.start) {
            return Err(Error::invalid(
                "experiment.stop",
                format!("{} s is not after experiment.start = {} s", self.experiment.stop, self.experiment.start),
                "Give a stop time after the start time",
            ));
        }
        if self.outputs.watched_sectors.contains(&0) {
            return Err(Error::invalid("outputs.watched_sectors", "sector 0", "Sectors are counted from 1"));
        }
        let mut seen = self.outputs.watched_sectors.clone();
        seen.sort_unstable();
        if seen.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(Error::invalid("outputs.watched_sectors", "a sector is listed twice", "List each sector once"));
        }
        Ok(())
    }
}

impl SceneSettings {
    fn validate_unique_names(&self) -> Result<()> {
        let names = self.structures.iter().map(|s| &s.name).chain(self.surfaces.iter().map(|s| &s.name));
        let mut sorted: Vec<&String> = names.collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            None => Ok(()),
            Some(pair) => Err(Error::invalid(
                "name",
                format!("`{}` is used by two structures or surfaces", pair[0]),
                "Give each structure and surface a name of its own",
            )),
        }
    }
}

impl StructureSettings {
    fn validate(&self, at: &str) -> Result<()> {
        finite(&format!("{at}.speed"), self.speed)?;
        if let Some(ratio) = self.damping_ratio {
            within(&format!("{at}.damping_ratio"), ratio, 0.0, MAX_DAMPING)?;
        }
        if self.motion == Motion::Still && self.speed != 0.0 {
            return Err(Error::invalid(
                format!("{at}.speed"),
                format!("{} rad/s for a structure that stands still", self.speed),
                "Remove the speed, or set motion = \"rotating\"",
            ));
        }
        Ok(())
    }
}

impl SurfaceSettings {
    fn validate(&self, at: &str) -> Result<()> {
        within(&format!("{at}.ramp_time"), self.ramp_time, 0.0, 1e9)?;
        match &self.shape {
            Shape::Circular {} => Ok(()),
            Shape::Lobes { amplitude, order, phase } => {
                finite(&format!("{at}.shape.amplitude"), *amplitude)?;
                finite(&format!("{at}.shape.phase"), *phase)?;
                if *order == 0 {
                    let remedy = "Use order ≥ 1, or gap and radius change for a uniform clearance";
                    return Err(Error::invalid(format!("{at}.shape.order"), "0 lobes", remedy));
                }
                Ok(())
            }
            Shape::TwoLobe { depth, width, phase } => {
                finite(&format!("{at}.shape.depth"), *depth)?;
                finite(&format!("{at}.shape.phase"), *phase)?;
                within(&format!("{at}.shape.width"), *width, 1e-3, 0.25)
            }
            Shape::Table { radius_change } => {
                crate::contact::surface::Surface::new(&Shape::Table { radius_change: radius_change.clone() }, 0.0)
                    .map(|_| ())
            }
        }
    }
}

impl ContactSettings {
    fn validate(&self, scene: &SceneSettings, at: &str) -> Result<()> {
        let structures: Vec<&str> = scene.structures.iter().map(|s| s.name.as_str()).collect();
        let surfaces: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        for (field, name, known) in [("master", &self.master, &structures), ("slave", &self.slave, &surfaces)] {
            if !known.contains(&name.as_str()) {
                return Err(Error::invalid(
                    format!("{at}.{field}"),
                    format!("`{name}` is not defined"),
                    format!("Use one of: {}", known.join(", ")),
                ));
            }
        }
        positive(&format!("{at}.gap"), self.gap, "m")?;
        self.sector_gaps.iter().try_for_each(|gap| positive(&format!("{at}.sector_gaps"), *gap, "m"))?;
        within(&format!("{at}.friction"), self.friction, 0.0, MAX_FRICTION)
    }
}

/// Shortest internal step accepted (s): far below the period of any mode of a blade.
pub const SHORTEST_STEP: f64 = 1e-12;
/// Longest internal step accepted (s): far above it.
pub const LONGEST_STEP: f64 = 1.0;
/// Largest friction coefficient accepted.
pub const MAX_FRICTION: f64 = 2.0;
/// Largest damping ratio accepted.
pub const MAX_DAMPING: f64 = 0.99;

fn finite(field: &str, value: f64) -> Result<()> {
    if value.is_finite() { Ok(()) } else { Err(Error::invalid(field, format!("{value}"), "Give a finite number")) }
}

fn positive(field: &str, value: f64, unit: &str) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(Error::invalid(field, format!("{value} {unit}"), "Give a finite value > 0"))
    }
}

fn within(field: &str, value: f64, low: f64, high: f64) -> Result<()> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(Error::invalid(field, format!("{value}"), format!("Give a value between {low:?} and {high:?}")))
    }
}
