//! Directions of refinement, their levels, and the sources from which models are reduced again.

use tiprub_core::{Rom, Scene};
use tiprub_gallery::rom_cache::RomCache;
use tiprub_model::rotor37::TipContact;
use tiprub_shell::{Result, console::Console};

/// ROM with the size of the model that it was reduced from.
#[derive(Debug, Clone)]
pub struct Meshed {
    /// The ROM.
    pub rom: Rom,
    /// Nodes of the finite-element model.
    pub nodes: usize,
}

/// Source of the ROM of the master, from which it can be reduced again.
pub trait RomSource {
    /// Reduces the model with `modes` modes beside the contact responses and with this tip, from its own mesh or from one of the
    /// [others](Self::others).
    ///
    /// # Errors
    /// The reduction fails.
    fn reduce(&self, other: Option<usize>, modes: usize, tip: TipContact, console: &Console) -> Result<Meshed>;

    /// Returns the number of other meshes of the same structure.
    fn others(&self) -> usize;
}

/// One setting of a direction.
#[derive(Debug, Clone)]
pub struct RefinementLevel {
    /// Internal step (s), tolerance, number of modes, of contact nodes or of nodes of the mesh.
    pub value: f64,
    /// True if this is the unchanged scene.
    pub own: bool,
    /// The scene.
    pub scene: Scene,
    /// Internal steps per communication step; with adaptive steps, the inverse of the tolerance.
    pub division: u32,
}

/// Setting that is refined while all others stay fixed.
#[derive(Debug, Clone)]
pub struct RefinementDirection {
    /// Name for files.
    pub name: &'static str,
    /// Title, such as `modes of rotor`.
    pub title: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// Levels, coarsest first; empty if there is nothing to refine.
    pub levels: Vec<RefinementLevel>,
    /// Parts that cannot be refined, with the reasons; empty if all can.
    pub missing: String,
    /// Factor by which all levels shorten the step of the scene, because one of them is rejected with it.
    pub shorter: Option<u32>,
}

impl RefinementDirection {
    pub(super) fn new(name: &'static str, title: String, unit: &'static str) -> Self {
        Self { name, title, unit, levels: Vec::new(), missing: String::new(), shorter: None }
    }

    /// Returns the size of a level, a power of which is proportional to the error: the step, the inverse of the number of modes, the length of a
    /// patch, the edge of an element.
    pub fn size(&self, value: f64) -> f64 {
        match self.unit {
            SECONDS | OF_CLEARANCE => value,
            MESH_NODES => value.powf(-0.5),
            MODES_KEPT => 1.0 / value,
            _ => 1.0 / (value - 1.0).max(0.5),
        }
    }

    /// Adds the reason why something cannot be refined, once.
    pub(super) fn misses(&mut self, why: String) {
        if !self.missing.contains(&why) {
            let between = if self.missing.is_empty() { "" } else { "; " };
            self.missing = format!("{}{between}{why}", self.missing);
        }
    }

    /// Returns the direction with shorter steps.
    pub fn stepped(&self, shorter: u32) -> Self {
        let mut finer = Self { shorter: Some(shorter), ..self.clone() };
        for level in &mut finer.levels {
            level.division = level.division.saturating_mul(shorter);
            if !is_adaptive(&level.scene) {
                level.scene.settings.time.step /= f64::from(shorter);
            } else {
                level.scene.settings.time.tolerance = Some(1.0 / f64::from(level.division));
            }
        }
        finer
    }
}

/// Returns whether the scene uses a tolerance instead of a step.
pub(crate) fn is_adaptive(scene: &Scene) -> bool {
    scene.settings.time.scheme.properties().adaptive
}

/// Returns the scene with `division` internal steps per communication step, or with the tolerance 1/`division`.
pub(crate) fn with_division(scene: &Scene, division: u32) -> Scene {
    let mut scene = scene.clone();
    if is_adaptive(&scene) {
        scene.settings.time.tolerance = Some(1.0 / f64::from(division));
    } else {
        scene.settings.time.step = scene.settings.experiment.communication_step / f64::from(division);
    }
    scene
}

/// Name of the direction that refines the step.
pub const STEP: &str = "step";
/// Name of the direction that refines contact nodes or patches.
pub const NODES: &str = "nodes";
/// Name of the direction that adds rows of patches across the thickness.
pub const ROWS: &str = "rows";
/// Name of the direction that refines the mesh.
pub const MESH: &str = "mesh";
/// Number of intervals between contact points of the finest tip, relative to the scene.
pub const FINEST_TIP: usize = 4;
/// Unit of internal steps.
pub const SECONDS: &str = "s";
/// Unit of tolerances.
pub const OF_CLEARANCE: &str = "of the clearance";
pub(super) const MODES_KEPT: &str = "modes";
pub(super) const MESH_NODES: &str = "mesh nodes";

/// Names of the directions that refine the modes of a structure, for files.
pub(super) const MODES: [&str; 8] =
    ["modes", "modes-2", "modes-3", "modes-4", "modes-5", "modes-6", "modes-7", "modes-8"];

/// Returns the name of the direction that refines the modes of a structure.
pub fn modes_of(structure: usize) -> Option<&'static str> {
    MODES.get(structure).copied()
}

/// Data for reducing models again.
pub struct Again<'a> {
    /// Origin of the ROM of the master, if it is a known file.
    pub source: Option<&'a dyn RomSource>,
    /// Cache of the built-in models.
    pub cache: &'a RomCache,
    /// Mesh of the scene's model if it is a built-in one: 1, or the factor for the number of elements along the edges.
    pub mesh: f64,
    /// Number of intervals between contact points of the finest tip, relative to the scene; 2 with few levels.
    pub finest_tip: usize,
    /// Names of the directions; empty for all.
    pub only: &'a [String],
    /// True for few levels.
    pub quick: bool,
    /// Console for progress.
    pub console: &'a Console,
}
