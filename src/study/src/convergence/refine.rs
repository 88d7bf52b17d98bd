//! What a direction is in which a scene can be refined, its levels, and where models that are reduced again come from.

use tiprub_core::{Rom, Scene, settings::Scheme};
use tiprub_gallery::rom_cache::RomCache;
use tiprub_model::rotor37::TipContact;
use tiprub_shell::{Result, console::Console};

/// A ROM and what it was reduced from.
#[derive(Debug, Clone)]
pub struct Meshed {
    /// The ROM.
    pub rom: Rom,
    /// Nodes of the finite-element model.
    pub nodes: usize,
}

/// Where the ROM of the master comes from, if it can be reduced again.
pub trait RomSource {
    /// The ROM with `modes` modes beside the responses to contact and this tip, reduced again: from its own mesh, or from one of
    /// the [others](Self::others).
    ///
    /// # Errors
    /// Whatever the reduction refuses.
    fn reduce(&self, other: Option<usize>, modes: usize, tip: TipContact, console: &Console) -> Result<Meshed>;

    /// Returns the number of other meshes of the same structure.
    fn others(&self) -> usize;
}

/// One setting of a direction.
#[derive(Debug, Clone)]
pub struct RefinementLevel {
    /// Internal step (s), tolerance, number of modes, of contact nodes or of nodes of the mesh.
    pub value: f64,
    /// Whether the scene is as it stands.
    pub own: bool,
    /// The scene.
    pub scene: Scene,
    /// Internal steps per communication step; one over the tolerance where the scene goes by one.
    pub division: u32,
}

/// A setting that is refined while all others stay.
#[derive(Debug, Clone)]
pub struct RefinementDirection {
    /// For file names.
    pub name: &'static str,
    /// `modes of rotor`.
    pub title: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// The coarsest first; empty where there is nothing to refine.
    pub levels: Vec<RefinementLevel>,
    /// Parts that cannot be refined, and why; empty if all can.
    pub missing: String,
    /// All levels take a step shorter by this factor than the scene's, at which one of them is refused.
    pub shorter: Option<u32>,
}

impl RefinementDirection {
    pub(super) fn new(name: &'static str, title: String, unit: &'static str) -> Self {
        Self { name, title, unit, levels: Vec::new(), missing: String::new(), shorter: None }
    }

    /// Returns the size that the error of a level follows with a power: the step, one over the number of modes, the length of a patch, the edge of an
    /// element.
    pub fn size(&self, value: f64) -> f64 {
        match self.unit {
            SECONDS | OF_CLEARANCE => value,
            MESH_NODES => value.powf(-0.5),
            MODES_KEPT => 1.0 / value,
            _ => 1.0 / (value - 1.0).max(0.5),
        }
    }

    /// Say what cannot be refined, once.
    pub(super) fn misses(&mut self, why: String) {
        if !self.missing.contains(&why) {
            let between = if self.missing.is_empty() { "" } else { "; " };
            self.missing = format!("{}{between}{why}", self.missing);
        }
    }

    /// The same with shorter steps.
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

/// Whether a tolerance takes the place of the step.
pub(crate) fn is_adaptive(scene: &Scene) -> bool {
    scene.settings.time.scheme == Scheme::Galerkin
}

/// The scene with `division` internal steps per communication step, or a tolerance of one over that.
pub(crate) fn with_division(scene: &Scene, division: u32) -> Scene {
    let mut scene = scene.clone();
    if is_adaptive(&scene) {
        scene.settings.time.tolerance = Some(1.0 / f64::from(division));
    } else {
        scene.settings.time.step = scene.settings.experiment.communication_step / f64::from(division);
    }
    scene
}

/// Name of the direction of steps.
pub const STEP: &str = "step";
/// Name of the direction of contact nodes or patches.
pub const NODES: &str = "nodes";
/// Name of the direction of rows of patches across the thickness.
pub const ROWS: &str = "rows";
/// Name of the direction of meshes.
pub const MESH: &str = "mesh";
/// Spaces between contact points of the finest tip, times the scene's own.
pub const FINEST_TIP: usize = 4;
/// Units of values.
pub const SECONDS: &str = "s";
/// Unit of tolerances.
pub const OF_CLEARANCE: &str = "of the clearance";
pub(super) const MODES_KEPT: &str = "modes";
pub(super) const MESH_NODES: &str = "mesh nodes";

/// Names of the directions of structures, for files.
pub(super) const MODES: [&str; 8] =
    ["modes", "modes-2", "modes-3", "modes-4", "modes-5", "modes-6", "modes-7", "modes-8"];

/// Name of the direction of the modes of a structure.
pub fn modes_of(structure: usize) -> Option<&'static str> {
    MODES.get(structure).copied()
}

/// Data for reducing models again.
pub struct Again<'a> {
    /// Where the ROM of the master comes from, if that is a file and known.
    pub source: Option<&'a dyn RomSource>,
    /// Where models that ship are kept.
    pub cache: &'a RomCache,
    /// Mesh of the scene's model where it ships: 1, or what its elements along the edges are multiplied with.
    pub mesh: f64,
    /// Spaces between contact points of the finest tip, times its own; 2 of few levels.
    pub finest_tip: usize,
    /// Names of the directions; empty for all.
    pub only: &'a [String],
    /// Few levels.
    pub quick: bool,
    /// For progress.
    pub console: &'a Console,
}
