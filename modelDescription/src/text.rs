//! Numbers and texts in XML.

/// Formats a number as `xs:double`, in the shortest form that reads back to the same bits.
pub(crate) fn number(value: f64) -> String {
    if value.is_nan() {
        return "NaN".into();
    }
    if value.is_infinite() {
        return if value > 0.0 { "INF".into() } else { "-INF".into() };
    }
    let magnitude = value.abs();
    if magnitude != 0.0 && !(1e-4..1e7).contains(&magnitude) { format!("{value:e}") } else { format!("{value:?}") }
}

/// Formats a number for people: as [`number`], but whole numbers without decimals.
pub(crate) fn readable(value: f64) -> String {
    let text = number(value);
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// Cleans text for an attribute: line breaks and tabs become spaces, as XML readers convert them, and characters that XML 1.0 cannot represent
/// become the replacement character.
pub(crate) fn clean(text: &str) -> String {
    let replace = |c: char| match c {
        '\n' | '\r' | '\t' => ' ',
        '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => '\u{fffd}',
        other => other,
    };
    text.chars().map(replace).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_round_trip_bit_for_bit() {
        for value in [0.0, -0.0, 1.0, 0.1, 1e-6, 3.56e-4, 1800.0, 1e7, 2.2e-308, 5e-324, f64::MAX, -1.0 / 3.0] {
            assert_eq!(number(value).parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
        assert_eq!(number(1e-6), "1e-6");
        assert_eq!(number(1800.0), "1800.0");
        assert_eq!((number(f64::INFINITY).as_str(), number(f64::NEG_INFINITY).as_str()), ("INF", "-INF"));
    }

    #[test]
    fn replaces_characters_that_are_illegal_in_xml() {
        assert_eq!(clean("a\nb\tc\u{1}d\u{ffff}é"), "a b c\u{fffd}d\u{fffd}é");
    }
}
