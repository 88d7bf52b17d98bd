//! Suggestions for misspelt names.

use strsim::{damerau_levenshtein, jaro_winkler};

/// Similarity of two names (0 to 1) above which one is proposed for the other.
const CLOSE: f64 = 0.9;
/// Smallest number of letters of a word that identifies a name.
const SHORTEST_WORD: usize = 3;

/// Returns the accepted name that is most similar to `given`. If no name is similar enough, single words of the names
/// are compared. `None` if they are not similar either.
///
/// # Examples
/// ```
/// use tiprub_format::closest_name;
///
/// let names = ["speed", "friction_coefficient"];
/// assert_eq!(closest_name("sped", names), Some("speed"));
/// assert_eq!(closest_name("contact.friction", names), Some("friction_coefficient"));
/// assert_eq!(closest_name("viscosity", names), None);
/// ```
pub fn closest_name<'a>(given: &str, accepted: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let given = normalised(given);
    let similarity = |name: &str| jaro_winkler(&given, &normalised(name));
    let mut accepted: Vec<&str> = accepted.into_iter().collect();
    // `max_by` returns the last of several equally similar names, so the order is reversed to prefer the first.
    accepted.reverse();
    let best = *accepted.iter().max_by(|a, b| similarity(a).total_cmp(&similarity(b)))?;
    let distance = damerau_levenshtein(&given, &normalised(best));
    let allowed = (given.chars().count() / 4).max(2);
    if distance <= allowed || similarity(best) > CLOSE {
        return Some(best);
    }
    let word_similarity = |name: &&str| {
        let name = normalised(name);
        let pairs = words(&given).flat_map(|given| words(&name).map(move |word| jaro_winkler(given, word)));
        pairs.fold(0.0, f64::max)
    };
    let similar = accepted.into_iter().filter(|name| word_similarity(name) > CLOSE);
    similar
        .max_by(|a, b| word_similarity(a).total_cmp(&word_similarity(b)).then(similarity(a).total_cmp(&similarity(b))))
}

/// Returns the words of a name that are long enough to identify it.
fn words(name: &str) -> impl Iterator<Item = &str> {
    name.split(|letter: char| !letter.is_alphanumeric()).filter(|word| word.chars().count() >= SHORTEST_WORD)
}

/// Returns the name without differences in case and between `-` and `_`, which are the most common slips and do not
/// count.
fn normalised(name: &str) -> String {
    name.to_lowercase().replace('-', "_")
}

/// Returns the question `Did you mean `x`? ` if an accepted name is close, otherwise an empty text. For `rpm`, returns the conversion to `speed`.
///
/// # Examples
/// ```
/// assert_eq!(tiprub_format::name_hint("sped", ["speed"]), "Did you mean `speed`? ");
/// assert_eq!(tiprub_format::name_hint("sped", ["torque"]), "");
/// ```
pub fn name_hint<'a>(given: &str, accepted: impl IntoIterator<Item = &'a str>) -> String {
    let accepted: Vec<&str> = accepted.into_iter().collect();
    if given == "rpm" && accepted.contains(&"speed") {
        return "Use `speed`, in rad/s: 1 rpm is 0.10472 rad/s. ".to_owned();
    }
    closest_name(given, accepted).map_or(String::new(), |name| format!("Did you mean `{name}`? "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn converts_revolutions_per_minute() {
        assert!(name_hint("rpm", ["rom", "speed"]).contains("`speed`, in rad/s"));
        assert_eq!(name_hint("rpm", ["rom"]), "Did you mean `rom`? ");
    }

    #[test]
    fn suggests_typos_but_not_unrelated_names() {
        let names = ["gap", "friction", "sector_gaps", "master", "slave"];
        assert_eq!(closest_name("gpa", names), Some("gap"));
        assert_eq!(closest_name("Sector-Gaps", names), Some("sector_gaps"));
        assert_eq!(closest_name("frction", names), Some("friction"));
        assert_eq!(closest_name("viscosity", names), None);
        assert_eq!(closest_name("x", []), None);
        let start_values = ["speed", "friction_coefficient", "gap_offset", "tolerance", "internal_step_max"];
        for (given, name) in [
            ("frction", Some("friction_coefficient")),
            ("SPEED", Some("speed")),
            ("structure[1].speed", Some("speed")),
            ("time.step", Some("internal_step_max")),
            ("clearance", None),
            ("mu", None),
        ] {
            assert_eq!(closest_name(given, start_values), name, "{given}");
        }
    }
}
