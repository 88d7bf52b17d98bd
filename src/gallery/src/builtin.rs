//! Models that ship with tiprub, by the name after `builtin:` in a scene; reduced when first asked for.

use tiprub_core::Rom;
use tiprub_format::PAPER_SUFFIX;
use tiprub_model::{
    CasingOptions, Mesh, Rotor37Options,
    casing::CASING37,
    cube::{CubeOptions, RingOptions, Side},
    cyclic::{CyclicReduction, ModeSelection, reduce_cyclic},
    rotor37::{DESIGN_SPEED, Tip},
    stage::{
        StageOptions,
        casing::{StageCasingOptions, reduce_stage_casing},
        stage_model,
    },
};
use tiprub_shell::{Result, console::Console};

use crate::{
    reduction::{self, with_progress},
    rom_cache::RomCache,
};

/// The bladed disk of the stage.
pub(crate) const STAGE: &str = "stage";
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

/// Every name that [`rom`] knows.
#[cfg(test)]
pub(crate) const NAMES: [&str; 10] = [
    "rotor37",
    "rotor37-spin",
    CASING37,
    STAGE,
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
        cache.get(whole, &options, console, &|| Ok(reduction::rotor37(&options, console)?.rom))
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

/// The blade as it ships, or as the paper has it.
fn rotor37(name: &str) -> Rotor37Options {
    if name.ends_with(PAPER_SUFFIX) { Rotor37Options::paper() } else { Rotor37Options::default() }
}

/// Whether the contact nodes of a model can be chosen anew by their number: blades along their chord.
pub fn has_chord(name: &str) -> bool {
    name.starts_with("rotor37") || [STAGE, STAGE_COARSE].contains(&plain(name))
}

/// The model of this name with another number of modes, as a factor on its own, and another tip where it [has a
/// chord](has_chord); made anew and not kept. `None` where there is no such model, or none with more modes: the cube has all.
pub fn refined(name: &str, factor: f64, tip: Tip, console: &Console) -> Option<Result<Rom>> {
    let times = |modes: usize| scaled(modes, factor);
    let families = |selection: ModeSelection| match selection {
        ModeSelection::Families(modes) => ModeSelection::Families(times(modes)),
        other => other,
    };
    let defaults = rotor37(name);
    let blade = |spin| Rotor37Options { spin, tip, modes: times(defaults.modes), ..defaults.clone() };
    let name = plain(name);
    Some(match name {
        "rotor37" => reduction::rotor37(&blade(None), console).map(|reduction| reduction.rom),
        "rotor37-spin" => reduction::rotor37(&blade(Some(DESIGN_SPEED)), console).map(|reduction| reduction.rom),
        STAGE | STAGE_COARSE => {
            let (name, options) = stage(name == STAGE_COARSE);
            let options = StageOptions { modes: families(options.modes), tip, ..options };
            DiskModel::with_options(name, options).reduce(console).map(|(reduction, _)| reduction.rom)
        }
        CASING37 => {
            let defaults = CasingOptions::default();
            let fixed_interface_modes = times(defaults.fixed_interface_modes);
            let options = CasingOptions { modes: times(defaults.modes), fixed_interface_modes, ..defaults };
            reduction::casing(&options, console).map(|reduction| reduction.rom)
        }
        STAGE_CASING | STAGE_CASING_COARSE => {
            let defaults = stage_casing(name == STAGE_CASING_COARSE);
            let fixed_interface_modes = times(defaults.fixed_interface_modes);
            let options = StageCasingOptions { modes: times(defaults.modes), fixed_interface_modes, ..defaults };
            reduction::stage_casing(&options, console).map(|reduction| reduction.rom)
        }
        _ => {
            let (_, side) = RINGS.iter().find(|(ring, _)| *ring == name)?;
            let defaults = RingOptions::new(*side);
            let options = RingOptions { modes: times(defaults.modes), ..defaults };
            reduction::cube_ring(&options, console).map(|reduction| reduction.rom)
        }
    })
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
        let order = |factor: f64| refined("ring-left", factor, Tip::Nodes(0), &console).unwrap().unwrap().order();
        assert_eq!(order(0.5), 50);
        assert!(
            refined(CUBE, 2.0, Tip::Nodes(0), &console).is_none()
                && refined("none", 2.0, Tip::Nodes(0), &console).is_none()
        );
        assert!(has_chord("rotor37-spin") && has_chord(STAGE) && !has_chord(STAGE_CASING) && !has_chord(CUBE));
    }
}
