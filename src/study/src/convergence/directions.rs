//! In which directions a scene can be refined; `refiner` makes the scenes at every level of each.

use tiprub_core::Scene;
use tiprub_shell::Result;

use super::{
    refine::{Again, MESH, MODES, MODES_KEPT, NODES, ROWS, RefinementDirection, STEP},
    refiner::Refiner,
};

/// All directions of a scene; steps are in multiples of `own` per communication step.
///
/// # Errors
/// A source that does not give the ROM of the scene, and what its reduction refuses.
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
