//! Errors of adaptive steps as measured in other rubs. They need no second run.

use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{BodyMotion, SceneSettings, TimeSettings};

/// Largest error of the displacements (relative L2, all patches, three revolutions) divided by the tolerance, rounded up: 0.92 at 1e-4, in a light
/// rub, a heavy rub and rubs with mistuned blades, without friction and at other speeds. After three revolutions small differences grow in heavy
/// rubs, with any tolerance.
///
/// Source: nine rubs of rotor 37, communication steps of 80 µs, against a tolerance of 1e-6. `lab bench` repeats them and compares them with this value.
const ERROR_PER_TOLERANCE: f64 = 1.0;
/// Smallest tolerance for which this relation was measured. With smaller tolerances, errors are below this value, but decrease more slowly.
const SMALLEST: f64 = 1e-4;
/// Description of the rubs.
pub(super) const RUBS: &str = "rubs of rotor 37, three revolutions";
/// Start values that replace settings of [`TimeSettings`].
const STEP_VALUES: [&str; 3] = ["scheme", "internal_step_max", "tolerance"];

/// Returns the time settings of a run: those of the scene, replaced by start values (name, value as text).
pub fn time_in_use(settings: &SceneSettings, set: &[(String, String)]) -> TimeSettings {
    let mut time = settings.time.clone();
    for (name, value) in set {
        match name.as_str() {
            "tolerance" => time.tolerance = value.parse().ok().or(time.tolerance),
            "internal_step_max" => time.step = value.parse().unwrap_or(time.step),
            "scheme" => time.scheme = scheme_of_text(value).unwrap_or(time.scheme),
            _ => {}
        }
    }
    time
}

/// Returns the scheme with this name or number, as start values give it.
fn scheme_of_text(text: &str) -> Option<Scheme> {
    Scheme::ALL.into_iter().find(|scheme| scheme.name() == text || text.parse() == Ok(scheme.number()))
}

/// Returns the scene with the time settings of the run, and the start values that do not replace them.
pub(super) fn with_time_in_use(scene: &Scene, set: &[(String, String)]) -> (Scene, Vec<(String, String)>) {
    let mut scene = scene.clone();
    scene.settings.time = time_in_use(&scene.settings, set);
    let others = set.iter().filter(|(name, _)| !STEP_VALUES.contains(&name.as_str()));
    (scene, others.cloned().collect())
}

/// Returns the largest error of the displacements that steps caused in measured rubs with the tolerance of the scene, or the reason why it is
/// unknown. `set` contains the start values that [`with_time_in_use`] did not apply.
pub(super) fn step_bound(scene: &Scene, set: &[(String, String)]) -> Result<f64, String> {
    let Some(tolerance) = scene.settings.time.step_tolerance() else {
        return Err("it has not been measured for fixed steps: use `tiprub run --estimate`".into());
    };
    if !is_measured_kind(scene) {
        return Err(
            "it has been measured only for uncoupled blades that slide on rigid surfaces: use `tiprub run --estimate`"
                .into(),
        );
    }
    if set.iter().any(|(name, _)| name == "solver") {
        return Err("it has not been measured for start values of the solver: use `tiprub run --estimate`".into());
    }
    Ok(ERROR_PER_TOLERANCE * tolerance.max(SMALLEST))
}

/// Returns whether the scene has only uncoupled blades that slide on rigid surfaces.
fn is_measured_kind(scene: &Scene) -> bool {
    let settings = &scene.settings;
    let is_rotor =
        |name: &str| settings.structures.iter().any(|one| one.name == name && one.motion != BodyMotion::Free);
    settings.surfaces.iter().all(|surface| surface.structure.is_none() || surface.rigid)
        && settings.contacts.iter().all(|contact| contact.solver == Solver::Lcp && is_rotor(&contact.master))
        && scene.roms.iter().all(|rom| !rom.is_cyclic())
}

#[cfg(test)]
mod tests {
    use tiprub_core::scene::settings::TOLERANCE;

    use super::*;
    use crate::convergence::rows::tests::scene;

    fn with(change: impl Fn(&mut Scene)) -> Result<f64, String> {
        let mut scene = scene(2);
        (scene.settings.time.scheme, scene.settings.time.tolerance) = (Scheme::ADAPTIVE, Some(2e-2));
        change(&mut scene);
        step_bound(&scene, &[])
    }

    #[test]
    fn bound_follows_the_tolerance() {
        assert_eq!(with(|_| {}), Ok(2e-2));
        assert_eq!(with(|scene| scene.settings.time.tolerance = None), Ok(TOLERANCE));
        assert_eq!(with(|scene| scene.settings.time.tolerance = Some(1e-7)), Ok(SMALLEST));
    }

    #[test]
    fn bound_is_unknown_for_scenes_that_were_not_measured() {
        let fixed = with(|scene| scene.settings.time.scheme = Scheme::ModalExact).unwrap_err();
        assert!(fixed.contains("fixed steps") && fixed.contains("--estimate"), "{fixed}");
        let changes: [fn(&mut Scene); 3] = [
            |scene| scene.settings.contacts[0].solver = Solver::Coulomb,
            |scene| scene.settings.surfaces[0].structure = Some("ring".into()),
            |scene| scene.settings.structures[0].motion = BodyMotion::Free,
        ];
        for change in changes {
            let why = with(change).unwrap_err();
            assert!(why.contains("only for uncoupled blades") && why.contains("--estimate"), "{why}");
        }
        let mut adaptive = scene(2);
        adaptive.settings.time.scheme = Scheme::ADAPTIVE;
        let why = step_bound(&adaptive, &[("solver".into(), "coulomb".into())]).unwrap_err();
        assert!(why.contains("start values of the solver"), "{why}");
    }

    #[test]
    fn scheme_has_the_same_effect_by_name_and_by_number() {
        let mut scene = scene(2);
        for own in Scheme::ALL {
            scene.settings.time.scheme = own;
            for scheme in Scheme::ALL {
                for text in [scheme.name().to_owned(), scheme.number().to_string()] {
                    let time = time_in_use(&scene.settings, &[("scheme".into(), text)]);
                    assert_eq!(time.scheme, scheme);
                }
            }
        }
    }

    #[test]
    fn start_values_replace_time_settings() {
        let mut scene = scene(2);
        scene.settings.time.tolerance = Some(1e-3);
        let adaptive = Scheme::ADAPTIVE.number().to_string();
        let set = [("tolerance", "1e-4"), ("speed", "1200"), ("scheme", &adaptive), ("internal_step_max", "2e-6")];
        let set = set.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let (changed, others) = with_time_in_use(&scene, &set);
        let time = &changed.settings.time;
        assert_eq!((time.scheme, time.step, time.tolerance), (Scheme::ADAPTIVE, 2e-6, Some(1e-4)));
        assert_eq!(others, [set[1].clone()]);
        assert_eq!(time_in_use(&scene.settings, &[]), scene.settings.time);
    }
}
