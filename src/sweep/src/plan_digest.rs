//! Digest of the program, a plan, and all files that the plan names. Machines that share a sweep compare it before they load a model.

use std::path::Path;

use tiprub_gallery::rom_cache::{RomCache, content_digest};
use tiprub_shell::{Failure, Result};
use tiprub_table::parquet_file;

use crate::{
    cases::Case,
    models::{RomStore, SweepSources},
    plan::{self, Plan, VariableTarget},
};

/// Key of the name of the plan in the metadata of result files.
pub(crate) const PLAN_FACT: &str = "tiprub.plan";

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

/// Returns the metadata of result files that identify a plan: the digest of its path, and the digest of its text, its scene, and the files that
/// it names.
pub fn plan_facts(plan: &Plan) -> [(&'static str, String); 2] {
    let path = std::fs::canonicalize(&plan.path).unwrap_or_else(|_| plan.path.clone());
    let text = std::fs::read(&plan.path).unwrap_or_default();
    let mut content = vec![content_digest(&text), content_digest(plan.scene.text.as_bytes())];
    let files = plan::input_files(&plan.path);
    content.extend(files.iter().map(|path| std::fs::read(path).map_or(String::new(), |bytes| content_digest(&bytes))));
    [
        ("tiprub.plan_path", content_digest(path.as_os_str().as_encoded_bytes())),
        ("tiprub.plan_content", content_digest(content.join("\n").as_bytes())),
    ]
}

/// Checks that an existing result file belongs to the plan at this path, or to a copy of it.
///
/// # Errors
/// The file contains the results of another plan.
pub(crate) fn check_results(plan: &Plan, output: &Path) -> Result<()> {
    let found = parquet_file::facts(output).unwrap_or_default();
    let differs = |(own, digest): &(&str, String)| found.iter().any(|(key, value)| key == own && value != digest);
    if plan_facts(plan).iter().all(differs) {
        let problem = match found.iter().find(|(key, _)| key == PLAN_FACT) {
            Some((_, name)) if *name != plan.name => {
                format!("contains the results of the plan `{name}`, not of `{}`", plan.path.display())
            }
            _ => format!("contains the results of another plan that is also named `{}`", plan.name),
        };
        let remedy =
            "Write to another file or directory with --output (in Python: `output`), or move this file elsewhere";
        return Err(Failure::new(output.display(), problem, remedy));
    }
    Ok(())
}
