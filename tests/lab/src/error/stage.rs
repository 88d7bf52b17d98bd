//! Scene 6: the stage of coupled sectors in its flexible casing.

use nalgebra::Complex;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{Rom, Scene};
use tiprub_gallery::{builtin::DiskModel, rom_cache::RomCache, scene_source};
use tiprub_model::{cyclic::ModeSelection, stage::StageOptions};
use tiprub_reference::reduced::disk::{CasingModel, Pencil, StageReference, StageScene};
use tiprub_shell::{Failure, Result, console::Console};

use super::{
    competitor::EquationFamily,
    outside::Softness,
    turning::{TurningCase, TurningFacts},
};

/// Component modes per nodal diameter.
const MODES: [usize; 3] = [4, 8, 16];
const QUICK_MODES: [usize; 2] = [2, 4];
/// Time between samples (s).
const INTERVAL: f64 = 2e-5;
/// Time over which the lobes grow (s), shorter than in the built-in scene; the casing touches from about half of it on.
const RAMP: f64 = 1.5e-3;
/// Number of samples of the window.
const SAMPLES: usize = 125;
const QUICK_SAMPLES: usize = 75;
/// Number of windows over which the divergence of runs is checked, and internal steps per sample.
const LONG: (usize, u32) = (2, 16);
const DIVISIONS: [u32; 6] = [4, 8, 12, 16, 32, 64];
const QUICK_DIVISIONS: [u32; 3] = [2, 8, 16];
const REFERENCES: (u32, u32) = (256, 128);
const QUICK_REFERENCES: (u32, u32) = (64, 64);
/// Internal steps per sample of the outside methods, whose steps take ten times as long.
const OUTSIDE_DIVISIONS: [u32; 3] = [8, 16, 32];
/// Contact stiffness of soft methods (N/m) per node, the penetration they may cause, and the distance up to which a
/// node is included (m).
const SOFTNESS: Softness = Softness { stiffness: 1e8, tolerance: 5e-6, margin: 2e-5 };

/// Reduces the disk on its coarse mesh with several numbers of modes (or loads it from the cache).
///
/// # Errors
/// A failed reduction; never with the built-in model.
pub(crate) fn stage(quick: bool, cache: &RomCache, console: &Console) -> Result<TurningCase<StageScene>> {
    let coarse = scene_source::stage_scene(true, cache, console)?;
    let mut sizes = Vec::new();
    for &modes in if quick { &QUICK_MODES[..] } else { &MODES[..] } {
        let mut scene = coarse.clone();
        scene.roms[0] = disk(modes, cache, console)?;
        scene.settings.surfaces[0].ramp_time = RAMP;
        let outside = outside(&scene)
            .ok_or_else(|| Failure::new("stage", "the mass matrix of the disk is not positive definite", ""))?;
        sizes.push((modes, scene, outside));
    }
    let description = "56 coupled sectors (coarse mesh) in an elastic casing that becomes oval until the blades touch \
                       it, µ = 0.15. The total error is relative to the reference with the most component modes.";
    let facts = TurningFacts {
        name: "stage-coarse",
        figures: ["stage-coarse-steps", "stage-coarse-total"],
        title: "Stage on a coarse mesh",
        description: description.into(),
        size_name: "modes per nodal diameter",
        interval: INTERVAL,
        samples: [if quick { QUICK_SAMPLES } else { SAMPLES }, 5],
        long: LONG,
        divisions: if quick { QUICK_DIVISIONS.to_vec() } else { DIVISIONS.to_vec() },
        outside_divisions: (!quick).then(|| OUTSIDE_DIVISIONS.to_vec()),
        references: if quick { QUICK_REFERENCES } else { REFERENCES },
        families: [vec![EquationFamily::MASSLESS, EquationFamily::STICKING], Vec::new()],
        softness: SOFTNESS,
    };
    TurningCase::new(facts, sizes)
}

fn disk(modes: usize, cache: &RomCache, console: &Console) -> Result<Rom> {
    let options = StageOptions { modes: ModeSelection::Count(modes), ..StageOptions::coarse() };
    let model = DiskModel::with_options("stage-study", options);
    cache.get(&format!("stage-study-{modes}"), &model, console, &|| Ok(model.reduce(console)?.0.rom))
}

/// Converts the scene to the reference crate; features without support there (spin, whirl, mistuning, heat) are off in
/// this scene.
fn outside(scene: &Scene) -> Option<StageScene> {
    let (disk, ring, settings) = (&scene.roms[0], &scene.roms[1], &scene.settings);
    let (surface, contact) = (&settings.surfaces[0], &settings.contacts[0]);
    let Shape::Lobes { amplitude, order, phase } = surface.shape else { return None };
    let complex = |matrix: &nalgebra::DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let zero = Pencil {
        mass: complex(&disk.mass),
        stiffness: complex(&disk.stiffness),
        contact_map: complex(&disk.contact_map),
    };
    let others = disk.extras.harmonics.iter().map(|harmonic| Pencil {
        mass: harmonic.mass.clone(),
        stiffness: harmonic.stiffness.clone(),
        contact_map: harmonic.contact_map.clone(),
    });
    let load = settings.structures[1].load?;
    StageScene::new(StageReference {
        pencils: std::iter::once(zero).chain(others).collect(),
        tips: disk.contact_nodes.iter().map(|node| node.position).collect(),
        sectors: disk.sectors,
        damping: settings.structures[0].damping_ratio.unwrap_or(disk.damping_ratio),
        casing: CasingModel {
            mass: ring.mass.clone(),
            stiffness: ring.stiffness.clone(),
            contact_map: ring.contact_map.clone(),
            positions: ring.contact_nodes.iter().map(|node| node.position).collect(),
            around: ring.extras.grid?.around,
            damping: settings.structures[1].damping_ratio.unwrap_or(ring.damping_ratio),
            load: [load.amplitude, f64::from(load.order), load.phase],
        },
        clearance: contact.gap,
        speed: settings.structures[0].speed,
        friction: contact.friction,
        lobes: [amplitude, f64::from(order), phase, surface.ramp_time],
    })
}
