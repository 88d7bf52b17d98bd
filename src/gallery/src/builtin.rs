//! Built-in models, by their name after `builtin:` in a scene; reduced on first use.

use std::fmt::Debug;

use tiprub_core::Rom;
use tiprub_field::shape_file;
use tiprub_format::closest_name;
use tiprub_model::{
    CasingOptions, Mesh, Rotor37Options, SurfaceShapes,
    casing::CASING37,
    cube::{CubeOptions, RingOptions, RingSide},
    cyclic::{CyclicReduction, ModeSelection, reduce_cyclic},
    reduce::ReductionKind,
    rotor37::{DESIGN_SPEED, MeshCounts, TipContact, blade_mesh},
    stage::{SectorCounts, SectorOptions, StageOptions, casing::StageCasingOptions, sector_mesh, stage_model},
};
use tiprub_shell::{Result, console::Console};

use crate::{
    known,
    reduction::{self, with_progress},
    rom_cache::{CachedModel, RomCache},
    scene_source::BUILTIN,
};

/// Rotor 37, recommended: nine patches along the chord in two rows at the sides of the tip.
pub(crate) const ROTOR37: &str = "rotor37";
/// Rotor 37 with one row of patches: contact is averaged over the thickness of the tip.
pub(crate) const ROTOR37_ONE_ROW: &str = "rotor37-one-row";
/// [`ROTOR37_ONE_ROW`] with spin matrices.
pub(crate) const ROTOR37_ONE_ROW_SPIN: &str = "rotor37-one-row-spin";
/// Rotor 37 as in the paper: Craig-Bampton modes and three contact nodes.
pub(crate) const ROTOR37_PAPER: &str = "rotor37-paper";

/// Bladed disk of the stage, recommended: nine patches along the chord of every blade in two rows.
pub(crate) const STAGE: &str = "stage";
/// Bladed disk of the stage with three contact nodes per blade, as in the paper.
pub(crate) const STAGE_NODES: &str = "stage-nodes";
/// Casing of the stage.
pub(crate) const STAGE_CASING: &str = "stage-casing";
/// [`STAGE_NODES`] on a coarse mesh, for tests and first trials: similar shapes, frequencies differ by some percent.
pub(crate) const STAGE_NODES_COARSE: &str = "stage-nodes-coarse";
/// [`STAGE_CASING`] on a coarse mesh.
pub(crate) const STAGE_CASING_COARSE: &str = "stage-casing-coarse";

/// Cube of the scene with a cube between two rings.
pub const CUBE: &str = "cube";
/// Rings of the scene with the cube, with their sides.
pub const RINGS: [(&str, RingSide); 2] = [("ring-left", RingSide::Left), ("ring-right", RingSide::Right)];

/// All names of models.
pub(crate) const NAMES: [&str; 13] = [
    ROTOR37,
    ROTOR37_ONE_ROW,
    ROTOR37_ONE_ROW_SPIN,
    ROTOR37_PAPER,
    CASING37,
    STAGE,
    STAGE_NODES,
    STAGE_CASING,
    STAGE_NODES_COARSE,
    STAGE_CASING_COARSE,
    CUBE,
    RINGS[0].0,
    RINGS[1].0,
];

/// Returns the remedy for an unknown name of a built-in model. It proposes a similar name if there is one.
pub fn unknown_model_remedy(name: &str) -> String {
    format!("{}Give a ROM file, or one of {}", hint_with_prefix(name, NAMES), with_prefix(&NAMES))
}

/// Returns the question whether a similar built-in name is meant, with its prefix; an empty text if there is none. A prefix of `name`, which
/// may be misspelt, does not count.
pub fn hint_with_prefix<'a>(name: &str, accepted: impl IntoIterator<Item = &'a str>) -> String {
    let name = name.rsplit_once(':').map_or(name, |(_, own)| own);
    closest_name(name, accepted).map_or(String::new(), |name| format!("Did you mean `{BUILTIN}{name}`? "))
}

/// Returns the names of built-in scenes or models with their prefix.
pub(crate) fn with_prefix(names: &[&str]) -> String {
    names.iter().map(|name| format!("{BUILTIN}{name}")).collect::<Vec<_>>().join(", ")
}

/// Returns the model of this name; `None` if there is no such model.
pub fn rom(name: &str, cache: &RomCache, console: &Console) -> Option<Result<Rom>> {
    let model = BuiltinModel::named(name)?;
    let rom = cache.get_model(name, model.options(), console, &|| model.reduce(console));
    Some(rom.map(|rom| model.with_known_errors(rom)))
}

/// Returns the surface of the model of this name, whose ROM is given: from the cache, or from a new reduction. `None` if
/// there is no such model, or if the ROM is not that of this model.
pub fn shapes(name: &str, rom: &Rom, cache: &RomCache, console: &Console) -> Option<Result<SurfaceShapes>> {
    let model = BuiltinModel::named(name)?;
    if let Some(shapes) = cache.shapes(name, rom) {
        return Some(Ok(shapes));
    }
    let reduced = match model.reduce(console) {
        Ok(reduced) => reduced,
        Err(failure) => return Some(Err(failure)),
    };
    let shapes = reduced.shapes.filter(|_| shape_file::rom_digest(&reduced.rom) == shape_file::rom_digest(rom))?;
    cache.keep_shapes(name, rom, &shapes, console);
    Some(Ok(shapes))
}

/// Built-in model with its options; not yet reduced.
enum BuiltinModel {
    Rotor37(Rotor37Options),
    Disk(Box<DiskModel>),
    Casing(CasingOptions),
    StageCasing(StageCasingOptions),
    Cube(CubeOptions),
    CubeRing(RingOptions),
}

impl BuiltinModel {
    fn named(name: &str) -> Option<Self> {
        if let Some(options) = rotor37(name) {
            return Some(Self::Rotor37(options));
        }
        Some(match name {
            CASING37 => Self::Casing(CasingOptions::default()),
            STAGE | STAGE_NODES | STAGE_NODES_COARSE => Self::Disk(Box::new(DiskModel::named(name))),
            STAGE_CASING | STAGE_CASING_COARSE => Self::StageCasing(stage_casing(name == STAGE_CASING_COARSE)),
            CUBE => Self::Cube(CubeOptions::default()),
            _ => Self::CubeRing(RingOptions::new(RINGS.iter().find(|(ring, _)| *ring == name)?.1)),
        })
    }

    /// Returns the options, which determine the model.
    fn options(&self) -> &dyn Debug {
        match self {
            Self::Rotor37(options) => options,
            Self::Disk(model) => model.as_ref(),
            Self::Casing(options) => options,
            Self::StageCasing(options) => options,
            Self::Cube(options) => options,
            Self::CubeRing(options) => options,
        }
    }

    fn reduce(&self, console: &Console) -> Result<CachedModel> {
        Ok(match self {
            Self::Rotor37(options) => reduction::rotor37(options, console)?.into(),
            Self::Disk(model) => model.reduce(console)?.0.into(),
            Self::Casing(options) => reduction::casing(options, console)?.into(),
            Self::StageCasing(options) => reduction::stage_casing(options, console)?.into(),
            Self::Cube(options) => reduction::cube(options, console)?.into(),
            Self::CubeRing(options) => reduction::cube_ring(options, console)?.into(),
        })
    }

    fn with_known_errors(&self, rom: Rom) -> Rom {
        match self {
            Self::Rotor37(options) => known::with_known_errors(options, rom),
            Self::Disk(model) => known::with_known_errors(&model.options, rom),
            _ => rom,
        }
    }
}

/// Returns the options of the built-in blade with this name; `None` if there is no such blade.
fn rotor37(name: &str) -> Option<Rotor37Options> {
    match name {
        ROTOR37 => Some(Rotor37Options::default()),
        ROTOR37_ONE_ROW => Some(Rotor37Options::one_row()),
        ROTOR37_ONE_ROW_SPIN => Some(Rotor37Options { spin: Some(DESIGN_SPEED), ..Rotor37Options::one_row() }),
        ROTOR37_PAPER => Some(Rotor37Options::paper()),
        _ => None,
    }
}

/// Returns whether the number of contact nodes of a model can be chosen: true for blades, along their chord.
pub fn has_chord(name: &str) -> bool {
    rotor37(name).is_some() || [STAGE, STAGE_NODES, STAGE_NODES_COARSE].contains(&name)
}

/// Other meshes of the built-in blades: factors on the numbers of elements along the edges, coarsest first.
pub const MESHES: [f64; 3] = [0.5, core::f64::consts::FRAC_1_SQRT_2, core::f64::consts::SQRT_2];

/// Differences of a model from the built-in one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelVariant {
    /// Factor on the number of modes.
    pub modes: f64,
    /// Contact of the tip, if the model [has a chord](has_chord).
    pub tip: TipContact,
    /// Factor on the number of elements along the edges, if the model has a chord; the number through the thickness stays.
    pub mesh: f64,
}

impl ModelVariant {
    /// Returns the name of the cached model.
    fn cache_name(&self, name: &str) -> String {
        let tip = match self.tip {
            TipContact::Nodes(count) => format!("nodes-{count}"),
            TipContact::Patches(count) => format!("patches-{count}"),
            TipContact::Rows([count, rows]) => format!("patches-{count}x{rows}"),
        };
        format!("{name}-modes-{:.3}-{tip}-mesh-{:.3}", self.modes, self.mesh)
    }
}

/// Returns a variant of the model of this name, from the cache or newly reduced. `None` if there is no such model, or none with more modes: the cube
/// has all.
pub fn refined(name: &str, other: ModelVariant, cache: &RomCache, console: &Console) -> Option<Result<Rom>> {
    let times = |modes: usize| scaled(modes, other.modes);
    let families = |selection: ModeSelection| match selection {
        ModeSelection::Families(modes) => ModeSelection::Families(times(modes)),
        other => other,
    };
    let keep = |options: &dyn core::fmt::Debug, make: &dyn Fn() -> Result<Rom>| {
        cache.get(&other.cache_name(name), options, console, make)
    };
    if let Some(defaults) = rotor37(name) {
        let mesh = rotor37_mesh(defaults.mesh, other.mesh);
        let options = Rotor37Options { mesh, tip: other.tip, modes: times(defaults.modes), ..defaults };
        return Some(keep(&options, &|| Ok(reduction::rotor37(&options, console)?.rom)));
    }
    Some(match name {
        STAGE | STAGE_NODES | STAGE_NODES_COARSE => {
            let DiskModel { name, options } = DiskModel::named(name);
            let kind = match other.tip {
                TipContact::Nodes(_) => StageOptions::default().kind,
                TipContact::Patches(_) | TipContact::Rows(_) => ReductionKind::FreeInterface,
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

/// Returns the number of nodes of the mesh of a model that [has a chord](has_chord), with this factor on its elements along the edges; otherwise
/// `None`.
///
/// # Errors
/// The factor leaves no element.
pub fn mesh_nodes(name: &str, mesh: f64) -> Option<Result<usize>> {
    let nodes = if let Some(blade) = rotor37(name) {
        blade_mesh(rotor37_mesh(blade.mesh, mesh)).map(|blade| blade.mesh.nodes.len())
    } else if has_chord(name) {
        let sector = DiskModel::named(name).options.sector;
        let options = SectorOptions { counts: stage_mesh(sector.counts, mesh), ..sector };
        sector_mesh(&options).map(|sector| sector.mesh.nodes.len())
    } else {
        return None;
    };
    Some(nodes.map_err(|error| reduction::failure(name, error)))
}

/// Scales the numbers of elements along chord and span; the number along the chord stays even, so that there is a middle.
fn rotor37_mesh(own: MeshCounts, factor: f64) -> MeshCounts {
    MeshCounts { chord: even(own.chord, factor), span: even(own.span, factor), ..own }
}

/// Scales the numbers of elements of a sector; the number through the thickness of the blade stays.
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

/// Scales a count to the nearest even number; a factor of 1 leaves it unchanged.
fn even(count: usize, factor: f64) -> usize {
    if (factor - 1.0).abs() < 1e-9 { count } else { 2 * scaled(count, 0.5 * factor).max(1) }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred modes at most")]
fn scaled(modes: usize, factor: f64) -> usize {
    (modes as f64 * factor).round() as usize
}

/// Returns name and options of the bladed disk of the stage with three contact nodes per blade, full size or coarse.
pub fn stage_nodes(coarse: bool) -> (&'static str, StageOptions) {
    if coarse {
        (STAGE_NODES_COARSE, StageOptions { modes: ModeSelection::Families(12), ..StageOptions::coarse() })
    } else {
        (STAGE_NODES, StageOptions::default())
    }
}

/// Returns name and options of the bladed disk of the stage, full size, with nine patches along the chord in two rows at the sides of the tips.
pub fn stage() -> (&'static str, StageOptions) {
    let options =
        StageOptions { tip: TipContact::Rows([9, 2]), kind: ReductionKind::FreeInterface, ..StageOptions::default() };
    (STAGE, options)
}

/// Bladed disk of the stage: its name and the options of its reduction.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskModel {
    name: &'static str,
    options: StageOptions,
}

impl DiskModel {
    /// Returns the disk with three contact nodes per blade, full size or coarse; not yet reduced.
    pub fn with_nodes(coarse: bool) -> Self {
        let (name, options) = stage_nodes(coarse);
        Self { name, options }
    }

    /// Returns the built-in disk with this name; [`STAGE`] for any other name.
    fn named(name: &str) -> Self {
        let (name, options) = match name {
            STAGE_NODES => stage_nodes(false),
            STAGE_NODES_COARSE => stage_nodes(true),
            _ => stage(),
        };
        Self { name, options }
    }

    /// Returns the disk with the given options.
    pub fn with_options(name: &'static str, options: StageOptions) -> Self {
        Self { name, options }
    }

    /// Reduces the disk; also returns the mesh of one sector.
    ///
    /// # Errors
    /// The reduction fails, which does not happen with the built-in options.
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

/// Returns the options of the casing of the stage, of the paper's size or with an eighth of the elements around.
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
    fn refines_built_in_models_by_name() {
        let console = Console::new(true, false);
        let with = |modes: f64| ModelVariant { modes, tip: TipContact::Nodes(0), mesh: 1.0 };
        let off = RomCache::off();
        let order = |modes: f64| refined("ring-left", with(modes), &off, &console).unwrap().unwrap().order();
        assert_eq!(order(0.5), 50);
        for name in [CUBE, "none"] {
            assert!(refined(name, with(2.0), &off, &console).is_none(), "{name}");
        }
        assert!(has_chord(ROTOR37_ONE_ROW_SPIN) && has_chord(STAGE) && !has_chord(STAGE_CASING) && !has_chord(CUBE));
    }

    /// A model read from its file equals the reduced model, so saved states and stored results of slow checks fit both.
    #[test]
    fn stored_models_equal_reduced_ones() {
        for (name, tip) in [
            (ROTOR37, TipContact::Rows([3, 2])),
            (ROTOR37_ONE_ROW_SPIN, TipContact::Patches(3)),
            (ROTOR37_PAPER, TipContact::Nodes(3)),
            (STAGE_NODES_COARSE, TipContact::Nodes(3)),
            (RINGS[0].0, TipContact::Nodes(0)),
        ] {
            let variant = ModelVariant { modes: 0.25, tip, mesh: MESHES[0] };
            let rom = refined(name, variant, &RomCache::off(), &Console::new(true, false)).unwrap().unwrap();
            let stored = tiprub_format::read_rom(&tiprub_format::write_rom(&rom), name).unwrap();
            assert!(stored == rom, "{name}");
        }
    }

    /// Each mesh differs: the number of nodes grows with the factor, and a factor of 1 gives the built-in mesh.
    #[test]
    fn mesh_factor_scales_the_node_count() {
        for name in [ROTOR37, ROTOR37_PAPER] {
            let own = rotor37(name).unwrap().mesh;
            assert_eq!(rotor37_mesh(own, 1.0), own, "{name}");
        }
        assert_eq!(stage_mesh(SectorCounts::default(), 1.0), SectorCounts::default());
        for name in [ROTOR37, ROTOR37_PAPER, STAGE] {
            let [coarsest, coarse, fine] = MESHES.map(|factor| mesh_nodes(name, factor).unwrap().unwrap());
            let own = mesh_nodes(name, 1.0).unwrap().unwrap();
            assert!(coarsest < coarse && coarse < own && own < fine, "{name}: {coarsest} {coarse} {own} {fine}");
        }
        assert!(mesh_nodes(CASING37, 1.0).is_none());
    }
}
