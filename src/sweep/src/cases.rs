//! Scene, models, start values and digest of one run.

use sha2::{Digest, Sha256};
use tiprub_core::Scene;
use tiprub_format::{LIBRARY_RELEASE, read_scene};
use tiprub_shell::{Failure, Result};
use tiprub_table::Cell;
use toml::Value;

use crate::{
    fields,
    models::{RomOrigin, RomStore},
    plan::{Plan, RomPattern, VariableTarget, field_value},
};

/// Name of the changed scene in messages, which are shortened by it.
pub(crate) const CHANGED_SCENE: &str = "the scene of this run";
/// Version of the digest and of the results of a row.
const ROW_VERSION: &str = "1";

/// Scene, values and outputs of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Scene with the values of the run (TOML).
    pub text: String,
    /// ROM of every structure.
    pub roms: Vec<RomOrigin>,
    /// Start values (name, value as text).
    pub settings: Vec<(String, String)>,
}

/// Digests of a case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CaseDigest {
    /// SHA-256 of scene and ROMs.
    pub scene: String,
    /// SHA-256 of everything that determines the results.
    pub run: String,
}

impl Case {
    /// Returns the case of a run (from 0).
    ///
    /// # Errors
    /// The scene has no such field or entry.
    pub fn new(plan: &Plan, run: usize) -> Result<Self> {
        let mut document = plan.document.clone();
        let (mut settings, mut has_changed) = (plan.set.clone(), false);
        for (variable, value) in plan.values(run) {
            match &variable.target {
                VariableTarget::StartValue(name) => settings.push((name.clone(), value.to_string())),
                VariableTarget::Field(path) => {
                    fields::set(&mut document, path, field_value(value))?;
                    has_changed = true;
                }
                VariableTarget::RomPart | VariableTarget::Label => {}
            }
        }
        let entries = document.get("structure").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        let entry = |table: &Value| table.get("rom").and_then(Value::as_str).unwrap_or_default().to_owned();
        let mut roms: Vec<RomOrigin> =
            entries.iter().map(|table| RomOrigin::of_scene(&entry(table), &plan.scene.directory)).collect();
        for rule in &plan.roms {
            roms[rule.structure] = match &rule.pattern {
                RomPattern::File(pattern) => RomOrigin::of_scene(&filled(plan, run, pattern), plan.directory()),
                RomPattern::Reduction(pattern) => RomOrigin::Reduction(filled(plan, run, pattern)),
            };
        }
        let text = if has_changed { document.to_string() } else { plan.scene.text.clone() };
        Ok(Self { text, roms, settings })
    }

    /// Returns the case of a run (counted from 0) in which the field of one variable (by index) has `value`, or its value in the scene (`None`).
    ///
    /// # Errors
    /// The scene has no such field or entry.
    pub(crate) fn with_field(plan: &Plan, run: usize, variable: usize, value: Option<&Cell>) -> Result<Self> {
        let mut document = plan.document.clone();
        for (index, (other, own)) in plan.values(run).enumerate() {
            let value = if index == variable { value } else { Some(own) };
            if let (VariableTarget::Field(path), Some(value)) = (&other.target, value) {
                fields::set(&mut document, path, field_value(value))?;
            }
        }
        Ok(Self { text: document.to_string(), ..Self::new(plan, run)? })
    }

    /// Returns the digests of the case.
    ///
    /// # Errors
    /// The arguments of a reduction are wrong.
    pub fn digest(&self, plan: &Plan, store: &mut RomStore) -> Result<CaseDigest> {
        let mut scene = vec![self.text.clone()];
        for rom in &self.roms {
            scene.push(store.digest(rom)?);
        }
        let scene = digest_of(scene.iter().map(String::as_str));
        let mut items = vec![ROW_VERSION.to_owned(), LIBRARY_RELEASE.to_owned(), scene.clone()];
        items.extend(plan.times.iter().map(|time| format!("{time:?}")));
        // Their order has no effect.
        let mut settings: Vec<_> = self.settings.iter().collect();
        settings.sort();
        items.extend(settings.into_iter().flat_map(|(name, value)| [name.clone(), value.clone()]));
        items.extend(plan.histories.iter().map(|request| format!("{request:?}")));
        Ok(CaseDigest { scene, run: digest_of(items.iter().map(String::as_str)) })
    }

    /// Returns the scene with its models.
    ///
    /// # Errors
    /// The scene is rejected, or a ROM cannot be read or reduced.
    pub fn scene(&self, store: &RomStore) -> Result<Scene> {
        read_scene(&self.text, CHANGED_SCENE, |index, structure| match self.roms.get(index) {
            Some(origin) => Ok::<_, Failure>((*store.get(origin)?).clone()),
            None => Err(Failure::new(&structure.rom, "is not loaded", "Report this to the developers")),
        })
    }
}

/// Replaces names in braces by the values of a run.
fn filled(plan: &Plan, run: usize, pattern: &str) -> String {
    plan.values(run).fold(pattern.to_owned(), |text, (variable, value)| {
        text.replace(&format!("{{{}}}", variable.name), &value.to_string())
    })
}

/// Returns the SHA-256 of texts with their lengths, as hexadecimal digits.
pub(crate) fn digest_of<'a>(items: impl Iterator<Item = &'a str>) -> String {
    let mut hash = Sha256::new();
    for item in items {
        hash.update((item.len() as u64).to_le_bytes());
        hash.update(item);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
