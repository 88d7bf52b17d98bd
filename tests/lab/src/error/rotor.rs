//! The paper's model: blades of rotor 37 with three contact nodes, in a light and in a heavy rub against a casing with two bumps.

use tiprub_core::Rom;
use tiprub_core::scene::settings::Shape;
use tiprub_gallery::{reduction, rom_cache::RomCache, scene_source};
use tiprub_model::{Rotor37Options, rotor37::MeshCounts};
use tiprub_reference::reduced::rub::BladeScene;
use tiprub_shell::{Result, console::Console};

use crate::beside::blades_of;

use super::{
    competitor::EquationFamily,
    outside::Softness,
    turning::{TurningCase, TurningFacts},
};

/// Component modes in addition to the constraint modes.
const MODES: [usize; 3] = [8, 20, 40];
const QUICK_MODES: [usize; 2] = [4, 12];
/// Depth of the bumps, which intrude by 2·depth − 1 of the gap.
const LIGHT: f64 = 0.6;
const HEAVY: f64 = 1.0;
/// Time between samples (s): a fiftieth of the period of the first bending mode.
const INTERVAL: f64 = 1e-5;
/// Number of samples of the window: one revolution.
const SAMPLES: usize = 349;
const QUICK_SAMPLES: usize = 150;
/// Number of windows over which the divergence of runs is checked, and internal steps per sample.
const LONG: (usize, u32) = (3, 20);
/// Internal steps per sample; the limit of central differences is at 5.8.
const DIVISIONS: [u32; 8] = [1, 2, 5, 6, 10, 20, 40, 80];
const QUICK_DIVISIONS: [u32; 5] = [2, 5, 10, 20, 40];
/// Internal steps per sample of the references: of the product and of Moreau-Jean.
const REFERENCES: (u32, u32) = (1280, 640);
const QUICK_REFERENCES: (u32, u32) = (320, 160);
/// Contact stiffness of soft methods (N/m) per node, the penetration they may cause, and the distance up to which a
/// node is included (m).
const SOFTNESS: Softness = Softness { stiffness: 1e8, tolerance: 5e-6, margin: 2e-5 };

/// Depth of the bumps.
#[derive(Debug, Clone, Copy)]
pub(crate) enum BumpDepth {
    Light,
    Heavy,
}

/// Reduces the blade (or loads it from the cache) with several numbers of modes.
///
/// # Errors
/// A failed reduction; never with the built-in model.
pub(crate) fn rotor(
    rub: BumpDepth,
    quick: bool,
    cache: &RomCache,
    console: &Console,
) -> Result<TurningCase<BladeScene>> {
    let (name, figures, title, intrusion, bumps) = match rub {
        BumpDepth::Light => {
            let figures = ["rotor37-paper-light-steps", "rotor37-paper-light-total"];
            ("rotor37-paper-light", figures, "The paper's model, light rub", "a fifth of the gap", LIGHT)
        }
        BumpDepth::Heavy => {
            let figures = ["rotor37-paper-heavy-steps", "rotor37-paper-heavy-total"];
            ("rotor37-paper-heavy", figures, "The paper's model, heavy rub", "the whole gap", HEAVY)
        }
    };
    let mut sizes = Vec::new();
    for &modes in if quick { &QUICK_MODES[..] } else { &MODES[..] } {
        let rom = blade(modes, quick, cache, console)?;
        let mut scene = scene_source::rotor37_scene_with(rom)?;
        if let Shape::TwoLobe { depth, .. } = &mut scene.settings.surfaces[0].shape {
            *depth = bumps;
        }
        let outside = blades_of(&scene)?;
        sizes.push((modes, scene, outside));
    }
    let description = format!(
        "36 blades of rotor 37 with three contact nodes each, at design speed, rub with µ = 0.15 against a rigid \
         casing with two bumps. The interference is {intrusion}. The total error is relative to the reference with the \
         most component modes."
    );
    let facts = TurningFacts {
        name,
        figures,
        title,
        description,
        size_name: "component modes",
        interval: INTERVAL,
        samples: [if quick { QUICK_SAMPLES } else { SAMPLES }, 10],
        long: LONG,
        divisions: if quick { QUICK_DIVISIONS.to_vec() } else { DIVISIONS.to_vec() },
        outside_divisions: None,
        references: if quick { QUICK_REFERENCES } else { REFERENCES },
        families: [
            vec![EquationFamily::MASSLESS, EquationFamily::STICKING, EquationFamily::BOTH],
            vec![EquationFamily::MASSLESS],
        ],
        softness: SOFTNESS,
    };
    TurningCase::new(facts, sizes)
}

fn blade(modes: usize, quick: bool, cache: &RomCache, console: &Console) -> Result<Rom> {
    let defaults = Rotor37Options::paper();
    let mesh = if quick { MeshCounts { chord: 4, thickness: 1, span: 4 } } else { defaults.mesh };
    let options = Rotor37Options { modes, mesh, ..defaults };
    let name = if quick { "rotor37-study-coarse" } else { "rotor37-study" };
    cache.get(&format!("{name}-{modes}"), &options, console, &|| Ok(reduction::rotor37(&options, console)?.rom))
}
