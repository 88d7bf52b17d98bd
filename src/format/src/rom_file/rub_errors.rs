//! Rub errors of a reduction, if they have been determined.

use tiprub_core::scene::rom::RubErrors;

use super::{Metadata, RomReader};
use crate::Result;
use crate::remedy::name_remedy;

/// Entries of the metadata.
const ERRORS: &str = "rub_errors";
const FOUND_ON: &str = "rub_errors_found_on";
/// Sources of errors.
const DIRECTIONS: [&str; 4] = ["modes", "patches", "rows", "mesh"];

impl RomReader<'_> {
    pub(super) fn rub_errors(&self, metadata: &Metadata) -> Result<Option<RubErrors>> {
        let Some(text) = metadata.get(ERRORS) else {
            if metadata.contains_key(FOUND_ON) {
                let problem = format!("given without `{ERRORS}`");
                return Err(self.error(format!("metadata `{FOUND_ON}`"), problem, "Remove it, or add the errors"));
            }
            return Ok(None);
        };
        let mut found = [None; DIRECTIONS.len()];
        for part in text.split(',') {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let place = DIRECTIONS.iter().position(|direction| *direction == name.trim());
            let value = value.trim().parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
            match (place, value) {
                (Some(place), Some(value)) if found[place].is_none() => found[place] = Some(value),
                (None, _) => {
                    let remedy = name_remedy(name.trim(), &DIRECTIONS);
                    let problem = format!("{part:?} does not name a known error");
                    return Err(self.error(format!("metadata `{ERRORS}`"), problem, remedy));
                }
                _ => {
                    let problem = format!("{part:?} is repeated or is not a non-negative number");
                    return Err(self.error(
                        format!("metadata `{ERRORS}`"),
                        problem,
                        "Write each error once, for example modes=0.01,mesh=0.02",
                    ));
                }
            }
        }
        let [modes, patches, rows, mesh] = found;
        let found_on = metadata.get(FOUND_ON).cloned().unwrap_or_default();
        Ok(Some(RubErrors { found_on, modes, patches, rows, mesh }))
    }
}

/// Returns the metadata entries; empty if no error is known.
pub(super) fn metadata(errors: &RubErrors) -> Vec<(&'static str, String)> {
    let known = DIRECTIONS.iter().zip([errors.modes, errors.patches, errors.rows, errors.mesh]);
    let known: Vec<String> = known.filter_map(|(name, error)| Some(format!("{name}={}", error?))).collect();
    if known.is_empty() {
        return Vec::new();
    }
    let on = (!errors.found_on.is_empty()).then(|| (FOUND_ON, errors.found_on.clone()));
    std::iter::once((ERRORS, known.join(","))).chain(on).collect()
}
