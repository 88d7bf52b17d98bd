//! Remedies for names that are not accepted.

/// Returns `Did you mean `x`? Accepted here: `x`, `y`, `z``. The question is omitted if no name is similar, or without the
/// feature `suggestions`.
pub(crate) fn name_remedy(given: &str, accepted: &[&str]) -> String {
    if accepted.is_empty() {
        return "No further keys are accepted here".to_owned();
    }
    let list = accepted.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    format!("{}Accepted here: {list}", question(given, accepted))
}

#[cfg(feature = "suggestions")]
fn question(given: &str, accepted: &[&str]) -> String {
    crate::suggestion::name_hint(given, accepted.iter().copied())
}

#[cfg(not(feature = "suggestions"))]
fn question(_given: &str, _accepted: &[&str]) -> &'static str {
    ""
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_accepted_names() {
        assert_eq!(name_remedy("viscosity", &["gap"]), "Accepted here: `gap`");
        assert_eq!(name_remedy("viscosity", &[]), "No further keys are accepted here");
    }

    #[cfg(feature = "suggestions")]
    #[test]
    fn suggests_a_similar_name() {
        assert_eq!(name_remedy("gpa", &["gap", "speed"]), "Did you mean `gap`? Accepted here: `gap`, `speed`");
    }
}
