//! Directions in which a scene can be refined; `refiner` creates the scenes of every level.

use tiprub_core::Scene;
use tiprub_shell::Result;

use super::{
    refine::{Again, MESH, MODES, MODES_KEPT, NODES, ROWS, RefinementDirection, STEP},
    refiner::Refiner,
};

/// Returns all directions of a scene; `own` is the number of internal steps per communication step, of which the levels take multiples.
///
/// # Errors
/// The source does not reproduce the ROM of the scene, or a reduction fails.
pub fn directions(scene: &Scene, own: u32, again: &Again) -> Result<Vec<RefinementDirection>> {
    let refiner = Refiner::checked(scene, own, again)?;
    let asked = |name: &str| again.only.is_empty() || again.only.iter().any(|only| only == name);
    let mut all = Vec::new();
    if asked(STEP) {
        all.push(refiner.steps());
    }
    for (index, name) in (0..scene.roms.len()).zip(MODES).filter(|(_, name)| asked(name)) {
        all.push(refiner.modes(index, name)?);
    }
    if asked(NODES) {
        all.push(refiner.nodes()?);
    }
    if asked(ROWS) {
        all.extend(refiner.rows()?);
    }
    if let Some(structure) = scene.settings.structures.get(MODES.len()).filter(|_| again.only.is_empty()) {
        all.push(RefinementDirection {
            missing: format!("the study refines the modes of at most {} structures", MODES.len()),
            ..RefinementDirection::new(
                "modes-more",
                format!("modes of {} and all further structures", structure.name),
                MODES_KEPT,
            )
        });
    }
    if asked(MESH) {
        all.push(refiner.meshes()?);
    }
    Ok(all)
}
