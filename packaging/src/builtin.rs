//! Models that ship with tiprub, by the name after `builtin:` in a scene; reduced when first asked for.

use tiprub_core::Rom;
use tiprub_model::{
    CasingOptions, FeModel, Material, Mesh, Reduction, Rotor37Options,
    casing::{CASING37, ContactRings, Contour, Flange, RingCounts, RingGeometry, Support},
    cyclic::{CyclicBoundary, CyclicOptions, CyclicReduction, ModeSelection, reduce_cyclic},
    progress::{Listener, Progress, Stage},
    reduce_ring,
    rotor37::DESIGN_SPEED,
    stage::{GAP, SECTORS, SectorOptions, TIP_AXIAL, TIP_RADIUS, sector_mesh},
};

use crate::{Failure, Result, console::Console, reduction, rom_cache::RomCache};

/// The bladed disk of the stage.
pub const STAGE: &str = "stage";
/// The casing of the stage.
pub const STAGE_CASING: &str = "stage-casing";
/// The same two on coarse meshes, for tests and first looks: shapes alike, frequencies some percent off.
pub const STAGE_COARSE: &str = "stage-coarse";
/// See [`STAGE_COARSE`].
pub const STAGE_CASING_COARSE: &str = "stage-casing-coarse";

/// Every name that [`rom`] knows.
pub const NAMES: [&str; 7] =
    ["rotor37", "rotor37-spin", CASING37, STAGE, STAGE_CASING, STAGE_COARSE, STAGE_CASING_COARSE];

/// The paper's damping of disk and casing.
const DISK_DAMPING: f64 = 0.005;
const CASING_DAMPING: f64 = 0.03;
/// How far faces of neighbouring sectors may be apart, relative to the radius of the tips.
const PAIRING: f64 = 1e-6;

/// The model of this name; `None` where there is no such model.
pub fn rom(name: &str, cache: &RomCache, console: &Console) -> Option<Result<Rom>> {
    let blade = |spin| {
        let options = Rotor37Options { spin, ..Rotor37Options::default() };
        cache.get(name, &options, console, &|| Ok(reduction::rotor37(&options, console)?.rom))
    };
    let disk = |coarse| {
        let model = DiskModel::new(coarse);
        cache.get(name, &model, console, &|| Ok(model.reduce(console)?.0.rom))
    };
    Some(match name {
        "rotor37" => blade(None),
        "rotor37-spin" => blade(Some(DESIGN_SPEED)),
        CASING37 => {
            let options = CasingOptions::default();
            cache.get(name, &options, console, &|| Ok(reduction::casing(&options, console)?.rom))
        }
        STAGE => disk(false),
        STAGE_COARSE => disk(true),
        STAGE_CASING | STAGE_CASING_COARSE => {
            let options = ring_around_the_stage(name == STAGE_CASING_COARSE);
            cache.get(name, &options, console, &|| Ok(casing(&options, console)?.rom))
        }
        _ => return None,
    })
}

/// What the bladed disk of the stage is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskModel {
    sector: SectorOptions,
    material: Material,
    contact_nodes: usize,
    options: CyclicOptions,
}

impl DiskModel {
    /// Of the paper's size, or coarse.
    pub fn new(coarse: bool) -> Self {
        let options = CyclicOptions {
            name: if coarse { STAGE_COARSE } else { STAGE }.to_owned(),
            modes: ModeSelection::Families(if coarse { 12 } else { 25 }),
            checked_modes: if coarse { 6 } else { 10 },
            damping_ratio: DISK_DAMPING,
        };
        let sector = if coarse { SectorOptions::coarse() } else { SectorOptions::default() };
        Self { sector, material: Material::titanium(), contact_nodes: 3, options }
    }

    /// The reduction, and the mesh of one sector.
    ///
    /// # Errors
    /// Never with the options that ship.
    pub fn reduce(&self, console: &Console) -> Result<(CyclicReduction, Mesh)> {
        with_progress("Reducing the bladed disk", console, &|listener| {
            let sector = sector_mesh(&self.sector)?;
            let contact = sector.contact_points(self.contact_nodes)?;
            let [low, high] = [sector.mesh.set("CYCLIC_LOW")?, sector.mesh.set("CYCLIC_HIGH")?];
            let (boundary, _) = CyclicBoundary::pair(&sector.mesh.nodes, low, high, SECTORS, PAIRING * TIP_RADIUS)?;
            let clamped = sector.mesh.set("CLAMPED")?.to_vec();
            let (nodes, elements) = (sector.mesh.nodes.len(), sector.mesh.elements.len());
            let origin = format!(
                "Parametric stage of {SECTORS} sectors, each {nodes} nodes and {elements} quadratic prisms, {}, held at the bore",
                self.material.name
            );
            let mesh = sector.mesh.clone();
            let model = FeModel::assembled(sector.mesh, &self.material, origin, listener)?;
            Ok((reduce_cyclic(&model, &clamped, &contact, &boundary, &self.options, listener)?, mesh))
        })
    }
}

/// A flanged ring with the casing's clearance around the stage.
fn ring_around_the_stage(coarse: bool) -> CasingOptions {
    let margin = 0.03;
    let [low, high] = [TIP_AXIAL[0] - margin, TIP_AXIAL[1] + margin];
    let radius = TIP_RADIUS + GAP;
    let contour = Contour::new(&[[low, radius], [high, radius]]).expect("two points by growing z");
    let flanges = [Flange { thickness: 6e-3, height: 15e-3 }, Flange { thickness: 5e-3, height: 10e-3 }].map(Some);
    let counts = if coarse {
        RingCounts { around: 56, through: 1, along: 4, flange: 1 }
    } else {
        RingCounts { around: 112, through: 1, along: 12, flange: 2 }
    };
    CasingOptions {
        name: if coarse { STAGE_CASING_COARSE } else { STAGE_CASING }.to_owned(),
        geometry: RingGeometry { contour, thickness: 4e-3, flanges },
        counts,
        material: Material::steel(),
        support: Support::Low,
        rings: ContactRings { around: 28, along: 3, axial: [TIP_AXIAL[0] - 4e-3, TIP_AXIAL[1] + 4e-3] },
        patches: [0, 0],
        damping_ratio: CASING_DAMPING,
        ..CasingOptions::default()
    }
}

fn casing(options: &CasingOptions, console: &Console) -> Result<Reduction> {
    with_progress("Reducing the casing of the stage", console, &|listener| reduce_ring(options, listener))
}

const STAGES: [Stage; 6] =
    [Stage::Mesh, Stage::Assembly, Stage::FixedInterfaceModes, Stage::FullModes, Stage::ConstraintModes, Stage::Checks];

fn with_progress<T>(
    title: &str,
    console: &Console,
    reduce: &dyn Fn(Listener<'_>) -> tiprub_model::Result<T>,
) -> Result<T> {
    let task = console.task(title, Some(100 * STAGES.len() as u64));
    let listener = |progress: Progress| {
        let stage = STAGES.iter().position(|stage| *stage == progress.stage).unwrap_or(0);
        task.now(&format!("{title}: {}", progress.stage));
        task.at(percent(stage as f64 + progress.fraction));
    };
    reduce(&listener).map_err(|error| match error {
        tiprub_model::Error::Invalid { what, problem, remedy } => Failure::new(what, problem, remedy),
        other => Failure::from_below(title, other),
    })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=100 per stage")]
fn percent(stages: f64) -> u64 {
    (100.0 * stages.clamp(0.0, STAGES.len() as f64)) as u64
}
