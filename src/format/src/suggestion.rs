//! Suggestions for misspelt names.

use strsim::{damerau_levenshtein, jaro_winkler};

/// Returns the accepted name closest to `given`, if one is close enough.
pub(crate) fn closest<'a>(given: &str, accepted: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let given = normalised(given);
    let similarity = |name: &str| jaro_winkler(&given, &normalised(name));
    let best = accepted.into_iter().max_by(|a, b| similarity(a).total_cmp(&similarity(b)))?;
    let distance = damerau_levenshtein(&given, &normalised(best));
    let allowed = (given.chars().count() / 3).max(2);
    (distance <= allowed || similarity(best) > 0.9).then_some(best)
}

/// Returns the name without differences in case and between `-` and `_`, which are the most common slips and do not
/// count.
fn normalised(name: &str) -> String {
    name.to_lowercase().replace('-', "_")
}

/// Returns `Did you mean `x`? Accepted here: `x`, `y`, `z`` (the question only if a name is close).
pub(crate) fn remedy(given: &str, accepted: &[&str]) -> String {
    if accepted.is_empty() {
        return "No further keys are accepted here".to_owned();
    }
    let list = accepted.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match closest(given, accepted.iter().copied()) {
        Some(name) => format!("Did you mean `{name}`? Accepted here: {list}"),
        None => format!("Accepted here: {list}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggests_typos_but_not_unrelated_names() {
        let names = ["gap", "friction", "sector_gaps", "master", "slave"];
        assert_eq!(closest("gpa", names), Some("gap"));
        assert_eq!(closest("Sector-Gaps", names), Some("sector_gaps"));
        assert_eq!(closest("frction", names), Some("friction"));
        assert_eq!(closest("viscosity", names), None);
        assert_eq!(closest("x", []), None);
        assert_eq!(remedy("viscosity", &["gap"]), "Accepted here: `gap`");
        assert_eq!(remedy("viscosity", &[]), "No further keys are accepted here");
    }
}
