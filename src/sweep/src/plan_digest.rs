//! Digest of the program, a plan, and all files that the plan names. Machines that share a sweep compare it before they load a model.

use std::path::Path;

use tiprub_gallery::rom_cache::{RomCache, content_digest};
use tiprub_shell::{Failure, Result};

use crate::{
    cases::Case,
    models::{RomStore, SweepSources},
    plan::{self, Plan, VariableTarget},
};

/// Returns the SHA-256 of the executable `program`, the plan, its scene and table, and the ROMs of all of its runs. No model is loaded.
///
/// # Errors
/// The program or the plan cannot be read, or a reduction has wrong arguments. Any other file that cannot be read gives another digest.
pub fn plan_digest(plan: &Plan, program: &Path, sources: &dyn SweepSources) -> Result<String> {
    let content = |path: &Path| std::fs::read(path).map(|bytes| content_digest(&bytes));
    let needed = |path: &Path| content(path).map_err(|error| Failure::file(path, "cannot be read", &error));
    let mut items = vec![needed(program)?, needed(&plan.path)?, content_digest(plan.scene.text.as_bytes())];
    items.extend(plan::input_files(&plan.path).iter().map(|path| content(path).unwrap_or_default()));
    let cache = RomCache::off();
    let mut store = RomStore::new(sources, plan.directory(), &cache, Path::new(""));
    let is_rom = |target: &VariableTarget| matches!(target, VariableTarget::Field(path) if path.ends_with("rom"));
    let varies = !plan.roms.is_empty() || plan.variables.iter().any(|variable| is_rom(&variable.target));
    let runs = if varies { plan.design.runs() } else { plan.design.runs().min(1) };
    let mut last = Vec::new();
    for run in 0..runs {
        let roms = Case::new(plan, run)?.roms;
        if roms != last {
            items.extend(roms.iter().map(|rom| store.digest(rom)).collect::<Result<Vec<_>>>()?);
            last = roms;
        }
    }
    Ok(content_digest(items.join("\n").as_bytes()))
}
