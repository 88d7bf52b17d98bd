//! Models that ship with tiprub, by the name after `builtin:` in a scene; reduced when first asked for.

use tiprub_core::Rom;
use tiprub_format::PAPER_SUFFIX;
use tiprub_model::{
    CasingOptions, Mesh, Rotor37Options,
    casing::CASING37,
    cube::{CubeOptions, RingOptions, Side},
    cyclic::{CyclicReduction, ModeSelection, reduce_cyclic},
    reduce::ReductionKind,
    rotor37::{DESIGN_SPEED, MeshCounts, Tip, blade_mesh},
    stage::{
        SectorCounts, SectorOptions, StageOptions,
        casing::{StageCasingOptions, reduce_stage_casing},
        sector_mesh, stage_model,
    },
};
use tiprub_shell::{Result, console::Console};

use crate::{
    known,
    reduction::{self, with_progress},
    rom_cache::RomCache,
};

/// The bladed disk of the stage, with contact nodes as the paper's.
pub(crate) const STAGE: &str = "stage";
/// The same with two rows of patches.
pub(crate) const STAGE_ROWS: &str = "stage-rows";
/// The casing of the stage.
pub(crate) const STAGE_CASING: &str = "stage-casing";
/// The same two on coarse meshes, for tests and first looks: shapes alike, frequencies some percent off.
pub(crate) const STAGE_COARSE: &str = "stage-coarse";
/// See [`STAGE_COARSE`].
pub(crate) const STAGE_CASING_COARSE: &str = "stage-casing-coarse";

/// The cube of the cube between two rings.
pub const CUBE: &str = "cube";
/// Its rings.
pub const RINGS: [(&str, Side); 2] = [("ring-left", Side::Left), ("ring-right", Side::Right)];

/// Rotor 37 with two rows of patches, which stand at the sides of its tip.
pub(crate) const ROWS: &str = "rotor37-rows";

/// Every name that [`rom`] knows.
#[cfg(test)]
pub(crate) const NAMES: [&str; 12] = [
    "rotor37",
    "rotor37-spin",
    ROWS,
    CASING37,
    STAGE,
    STAGE_ROWS,
    STAGE_CASING,
    STAGE_COARSE,
    STAGE_CASING_COARSE,
    CUBE,
    RINGS[0].0,
    RINGS[1].0,
];

/// The model of this name; `None` where there is no such model.
pub fn rom(name: &str, cache: &RomCache, console: &Console) -> Option<Result<Rom>> {
    let (whole, name) = (name, plain(name));
    let blade = |spin| {
        let options = Rotor37Options { spin, ..rotor37(whole) };
        let rom = cache.get(whole, &options, console, &|| Ok(reduction::rotor37(&options, console)?.rom))?;
        Ok(known::told(&options, rom))
    };
    let disk = || {
        let model = DiskModel::named(name);
        let rom = cache.get(name, &model, console, &|| Ok(model.reduce(console)?.0.rom))?;
        Ok(known::told(&model.options, rom))
    };
    Some(match name {
        "rotor37" | ROWS => blade(None),
        "rotor37-spin" => blade(Some(DESIGN_SPEED)),
        CASING37 => {
            let options = CasingOptions::default();
            cache.get(name, &options, console, &|| Ok(reduction::casing(&options, console)?.rom))
        }
        STAGE | STAGE_ROWS | STAGE_COARSE => disk(),
        STAGE_CASING | STAGE_CASING_COARSE => {
            let options = stage_casing(name == STAGE_CASING_COARSE);
            let title = "Reducing the casing of the stage";
            let reduce = || with_progress(title, console, &|listener| reduce_stage_casing(&options, listener));
            cache.get(name, &options, console, &|| Ok(reduce()?.rom))
        }
        CUBE => {
            let options = CubeOptions::default();
            cache.get(name, &options, console, &|| Ok(reduction::cube(&options, console)?.rom))
        }
        _ => {
            let (_, side) = RINGS.iter().find(|(ring, _)| *ring == name)?;
            let options = RingOptions::new(*side);
            cache.get(name, &options, console, &|| Ok(reduction::cube_ring(&options, console)?.rom))
        }
    })
}

/// Without the ending of the paper's models; those that have no other are the paper's.
fn plain(name: &str) -> &str {
    name.strip_suffix(PAPER_SUFFIX).unwrap_or(name)
}

/// The blade as it ships, with rows of patches, or as the paper has it.
fn rotor37(name: &str) -> Rotor37Options {
    match name {
        name if name.ends_with(PAPER_SUFFIX) => Rotor37Options::paper(),
        ROWS => Rotor37Options::in_rows(),
        _ => Rotor37Options::default(),
    }
}

/// Whether the contact nodes of a model can be chosen anew by their number: blades along their chord.
pub fn has_chord(name: &str) -> bool {
    name.starts_with("rotor37") || [STAGE, STAGE_ROWS, STAGE_COARSE].contains(&plain(name))
}

/// Meshes of blades beside the one that ships: numbers of elements along the edges, as factors on its own, the coarsest first.
pub const MESHES: [f64; 3] = [0.5, core::f64::consts::FRAC_1_SQRT_2, core::f64::consts::SQRT_2];

/// In what a model differs from the one that ships.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Other {
    /// Number of modes, as a factor on its own.
    pub modes: f64,
    /// What touches, where it [has a chord](has_chord).
    pub tip: Tip,
    /// Elements along the edges, as a factor on its own, where it has a chord: the number through the thickness stays.
    pub mesh: f64,
}

impl Other {
    /// For the name of what is kept.
    fn told(&self, name: &str) -> String {
        let tip = match self.tip {
            Tip::Nodes(count) => format!("nodes-{count}"),
            Tip::Patches(count) => format!("patches-{count}"),
            Tip::Rows([count, rows]) => format!("patches-{count}x{rows}"),
        };
        format!("{name}-modes-{:.3}-{tip}-mesh-{:.3}", self.modes, self.mesh)
    }
}

/// The model of this name in another form, as kept or made anew. `None` where there is no such model, or none with more modes: the
/// cube has all.
pub fn refined(name: &str, other: Other, cache: &RomCache, console: &Console) -> Option<Result<Rom>> {
    let times = |modes: usize| scaled(modes, other.modes);
    let families = |selection: ModeSelection| match selection {
        ModeSelection::Families(modes) => ModeSelection::Families(times(modes)),
        other => other,
    };
    let keep = |options: &dyn core::fmt::Debug, make: &dyn Fn() -> Result<Rom>| {
        cache.get(&other.told(name), options, console, make)
    };
    let of_blade = |spin| {
        let defaults = rotor37(name);
        let mesh = rotor37_mesh(defaults.mesh, other.mesh);
        let options = Rotor37Options { spin, mesh, tip: other.tip, modes: times(defaults.modes), ..defaults };
        keep(&options, &|| Ok(reduction::rotor37(&options, console)?.rom))
    };
    Some(match plain(name) {
        "rotor37" | ROWS => of_blade(None),
        "rotor37-spin" => of_blade(Some(DESIGN_SPEED)),
        name @ (STAGE | STAGE_ROWS | STAGE_COARSE) => {
            let (name, options) = stage_named(name);
            let kind = match other.tip {
                Tip::Nodes(_) => StageOptions::default().kind,
                Tip::Patches(_) | Tip::Rows(_) => ReductionKind::FreeInterface,
            };
            let sector = SectorOptions { counts: stage_mesh(options.sector.counts, other.mesh), ..options.sector };
            let options = StageOptions { modes: families(options.modes), tip: other.tip, kind, sector, ..options };
            let model = DiskModel::with_options(name, options);
            keep(&model, &|| Ok(model.reduce(console)?.0.rom))
        }
        CASING37 => {
            let defaults = CasingOptions::default();
            let fixed_interface_modes = times(defaults.fixed_interface_modes);
            let options = CasingOptions { modes: times(defaults.modes), fixed_interface_modes, ..defaults };
            keep(&options, &|| Ok(reduction::casing(&options, console)?.rom))
        }
        name @ (STAGE_CASING | STAGE_CASING_COARSE) => {
            let defaults = stage_casing(name == STAGE_CASING_COARSE);
            let fixed_interface_modes = times(defaults.fixed_interface_modes);
            let options = StageCasingOptions { modes: times(defaults.modes), fixed_interface_modes, ..defaults };
            keep(&options, &|| Ok(reduction::stage_casing(&options, console)?.rom))
        }
        name => {
            let (_, side) = RINGS.iter().find(|(ring, _)| *ring == name)?;
            let defaults = RingOptions::new(*side);
            let options = RingOptions { modes: times(defaults.modes), ..defaults };
            keep(&options, &|| Ok(reduction::cube_ring(&options, console)?.rom))
        }
    })
}

/// Nodes of the mesh of a model that [has a chord](has_chord), with so many times its elements along the edges; `None` of another.
///
/// # Errors
/// A factor that leaves no element.
pub fn mesh_nodes(name: &str, mesh: f64) -> Option<Result<usize>> {
    let nodes = match plain(name) {
        "rotor37" | "rotor37-spin" | ROWS => {
            blade_mesh(rotor37_mesh(rotor37(name).mesh, mesh)).map(|blade| blade.mesh.nodes.len())
        }
        name @ (STAGE | STAGE_ROWS | STAGE_COARSE) => {
            let sector = stage_named(name).1.sector;
            let options = SectorOptions { counts: stage_mesh(sector.counts, mesh), ..sector };
            sector_mesh(&options).map(|sector| sector.mesh.nodes.len())
        }
        _ => return None,
    };
    Some(nodes.map_err(|error| reduction::failure(name, error)))
}

/// Elements along chord and span times a factor; along the chord they stay even, so that there is a middle.
fn rotor37_mesh(own: MeshCounts, factor: f64) -> MeshCounts {
    MeshCounts { chord: even(own.chord, factor), span: even(own.span, factor), ..own }
}

/// The same of a sector; through the thickness of the blade they stay.
fn stage_mesh(own: SectorCounts, factor: f64) -> SectorCounts {
    let times = |count: usize| if count == 0 { 0 } else { scaled(count, factor).max(1) };
    SectorCounts {
        chord: even(own.chord, factor),
        span: times(own.span),
        thickness: own.thickness,
        side: times(own.side),
        overhang: times(own.overhang),
        rim: times(own.rim),
        web: [even(own.web[0], factor), times(own.web[1])],
        bore: own.bore.map(times),
    }
}

/// As a factor that is 1 leaves it; else the next even number.
fn even(count: usize, factor: f64) -> usize {
    if (factor - 1.0).abs() < 1e-9 { count } else { 2 * scaled(count, 0.5 * factor).max(1) }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred modes at most")]
fn scaled(modes: usize, factor: f64) -> usize {
    (modes as f64 * factor).round() as usize
}

/// Name and options of the bladed disk of the stage, of the paper's size or coarse.
pub fn stage(coarse: bool) -> (&'static str, StageOptions) {
    if coarse {
        (STAGE_COARSE, StageOptions { modes: ModeSelection::Families(12), ..StageOptions::coarse() })
    } else {
        (STAGE, StageOptions::default())
    }
}

/// The disk of this name; of every other that of the paper's size.
fn stage_named(name: &str) -> (&'static str, StageOptions) {
    match name {
        STAGE_ROWS => (STAGE_ROWS, stage_in_rows()),
        name => stage(name == STAGE_COARSE),
    }
}

/// Of the paper's size, with nine patches along the chord in two rows, which stand at the sides of the tips.
pub fn stage_in_rows() -> StageOptions {
    StageOptions { tip: Tip::Rows([9, 2]), kind: ReductionKind::FreeInterface, ..StageOptions::default() }
}

/// The bladed disk of the stage, of the paper's size or coarse.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskModel {
    name: &'static str,
    options: StageOptions,
}

impl DiskModel {
    /// What is reduced; nothing is done yet.
    pub fn new(coarse: bool) -> Self {
        let (name, options) = stage(coarse);
        Self { name, options }
    }

    /// The disk of a name that ships.
    fn named(name: &str) -> Self {
        let (name, options) = stage_named(name);
        Self { name, options }
    }

    /// The disk with options of one's own.
    pub fn with_options(name: &'static str, options: StageOptions) -> Self {
        Self { name, options }
    }

    /// The reduction, and the mesh of one sector.
    ///
    /// # Errors
    /// Never with the options that ship.
    pub fn reduce(&self, console: &Console) -> Result<(CyclicReduction, Mesh)> {
        with_progress("Reducing the bladed disk", console, &|listener| {
            let stage = stage_model(&self.options, listener)?;
            let options = self.options.cyclic(self.name);
            let (contact, boundary) = (&stage.contact, &stage.boundary);
            let reduction = reduce_cyclic(&stage.model, &stage.clamped, contact, boundary, &options, listener)?;
            let mesh = stage.model.mesh.map(|(mesh, _)| mesh).unwrap_or_default();
            Ok((reduction, mesh))
        })
    }
}

/// The casing of the stage, of the paper's size or with an eighth of the elements around.
pub fn stage_casing(coarse: bool) -> StageCasingOptions {
    let defaults = StageCasingOptions::default();
    if coarse {
        StageCasingOptions { name: STAGE_CASING_COARSE.into(), around: defaults.around / 8, ..defaults }
    } else {
        StageCasingOptions { name: STAGE_CASING.into(), ..defaults }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_refined_by_name() {
        let console = Console::new(true, false);
        let with = |modes: f64| Other { modes, tip: Tip::Nodes(0), mesh: 1.0 };
        let off = RomCache::off();
        let order = |modes: f64| refined("ring-left", with(modes), &off, &console).unwrap().unwrap().order();
        assert_eq!(order(0.5), 50);
        for name in [CUBE, "none"] {
            assert!(refined(name, with(2.0), &off, &console).is_none(), "{name}");
        }
        assert!(has_chord("rotor37-spin") && has_chord(STAGE) && !has_chord(STAGE_CASING) && !has_chord(CUBE));
    }

    /// Every other mesh is one: its nodes grow with the factor, and a factor of 1 is the mesh that ships.
    #[test]
    fn other_meshes_are_coarser_and_finer() {
        for (name, own) in [("rotor37", rotor37("rotor37").mesh), ("rotor37-paper", rotor37("rotor37-paper").mesh)] {
            assert_eq!(rotor37_mesh(own, 1.0), own, "{name}");
        }
        assert_eq!(stage_mesh(SectorCounts::default(), 1.0), SectorCounts::default());
        for name in ["rotor37", "rotor37-paper", STAGE] {
            let [coarsest, coarse, fine] = MESHES.map(|factor| mesh_nodes(name, factor).unwrap().unwrap());
            let own = mesh_nodes(name, 1.0).unwrap().unwrap();
            assert!(coarsest < coarse && coarse < own && own < fine, "{name}: {coarsest} {coarse} {own} {fine}");
        }
        assert!(mesh_nodes(CASING37, 1.0).is_none());
    }
}
