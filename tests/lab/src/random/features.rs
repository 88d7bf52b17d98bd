//! The features of a scene, with the names of the table.

use tiprub_core::Scene;
use tiprub_core::scene::settings::{BodyMotion, InputInterpolation, Interpolation, StructureSettings, SurfaceSettings};

/// A feature's name, and a function that returns whether a scene has it.
type SceneFeature = (&'static str, fn(&Scene) -> bool);

/// All features.
pub(crate) const FEATURES: [SceneFeature; 36] = [
    ("rotor", |scene| any_structure(scene, |own| own.motion == BodyMotion::Rotating)),
    ("free body", |scene| any_structure(scene, |own| own.motion == BodyMotion::Free)),
    ("two rotors", |scene| rotors(scene) > 1),
    ("several pairs", |scene| scene.settings.contacts.len() > 1),
    ("coupled sectors", |scene| scene.roms.iter().any(tiprub_core::Rom::is_cyclic)),
    ("flexible casing", |scene| any_surface(scene, |own| own.structure.is_some() && !own.rigid)),
    ("shared casing", |scene| {
        let carried = |own: &&SurfaceSettings| own.structure.is_some() && !own.rigid;
        rotors(scene) > 0 && scene.settings.surfaces.iter().filter(carried).count() > 1
    }),
    ("rigid open surface", |scene| any_surface(scene, |own| own.rigid)),
    ("spline", |scene| any_surface(scene, |own| own.spline.is_some())),
    ("facets", |scene| {
        any_surface(scene, |own| own.spline.is_some_and(|own| own.interpolation == Interpolation::Facets))
    }),
    ("moving casing", |scene| any_surface(scene, |own| own.moving)),
    ("ramp", |scene| any_surface(scene, |own| own.ramp_time > 0.0)),
    ("patches", |scene| scene.roms.iter().any(|rom| rom.contact_nodes[0].area > 0.0)),
    ("rows", |scene| scene.roms.iter().any(|rom| rom.rows() > 1)),
    ("heat patches", |scene| any_surface(scene, |own| own.patches.is_some())),
    ("mistuning", |scene| any_structure(scene, |own| !own.frequency_factors.is_empty())),
    ("sector gaps", |scene| scene.settings.contacts.iter().any(|contact| !contact.sector_gaps.is_empty())),
    ("modal damping", |scene| any_structure(scene, |own| !own.damping_ratios.is_empty())),
    ("excitation", |scene| any_structure(scene, |own| own.excitation.is_some())),
    ("initial motion", |scene| any_structure(scene, |own| !own.initial.is_empty())),
    ("stiffening", |scene| any_structure(scene, |own| own.spin.stiffening)),
    ("growth", |scene| any_structure(scene, |own| own.spin.growth)),
    ("Coriolis", |scene| any_structure(scene, |own| own.spin.coriolis)),
    ("rotor heat", |scene| any_structure(scene, |own| own.thermal && own.motion == BodyMotion::Rotating)),
    ("casing heat", |scene| any_structure(scene, |own| own.thermal && own.motion == BodyMotion::Still)),
    ("softening", |scene| any_structure(scene, |own| own.softening > 0.0)),
    ("casing load", |scene| any_structure(scene, |own| own.load.is_some())),
    ("stress", |scene| scene.settings.outputs.stress),
    ("plastic coating", |scene| coatings(scene, false)),
    ("cut coating", |scene| coatings(scene, true)),
    ("whirl", |scene| any_structure(scene, |own| own.whirl)),
    ("axial shift", |scene| any_structure(scene, |own| own.axial_shift)),
    ("friction", |scene| scene.settings.contacts.iter().any(|contact| contact.friction > 0.0)),
    ("slow sliding", |scene| any_structure(scene, |own| own.motion == BodyMotion::Rotating && own.speed.abs() < 30.0)),
    ("held inputs", |scene| scene.settings.time.input_interpolation == InputInterpolation::Hold),
    ("bounded steps", |scene| scene.settings.time.max_internal_steps.is_some()),
];

fn any_structure(scene: &Scene, has: impl Fn(&StructureSettings) -> bool) -> bool {
    scene.settings.structures.iter().any(has)
}

fn any_surface(scene: &Scene, has: impl Fn(&SurfaceSettings) -> bool) -> bool {
    scene.settings.surfaces.iter().any(has)
}

fn rotors(scene: &Scene) -> usize {
    scene.settings.structures.iter().filter(|own| own.motion == BodyMotion::Rotating).count()
}

fn coatings(scene: &Scene, cut: bool) -> bool {
    let coatings = scene.settings.contacts.iter().filter_map(|contact| contact.coating.as_ref());
    coatings.into_iter().any(|coating| coating.cutting.is_some() == cut)
}

/// Returns the indices in [`FEATURES`] of the features of a scene.
pub(crate) fn of(scene: &Scene) -> Vec<usize> {
    (0..FEATURES.len()).filter(|index| FEATURES[*index].1(scene)).collect()
}
