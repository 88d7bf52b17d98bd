//! Formatting of numbers for readers.

/// Formats a value with three significant digits.
pub(super) fn rounded(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if !(1e-3..1e6).contains(&value.abs()) {
        return scientific(value);
    }
    // 0.9997 is rounded to 1.00, so the rounded value determines the number of digits.
    let three = format!("{value:.2e}").parse().unwrap_or(value);
    let (mut digits, mut magnitude) = (2_usize, f64::abs(three));
    while magnitude >= 10.0 && digits > 0 {
        magnitude /= 10.0;
        digits -= 1;
    }
    while magnitude < 1.0 {
        magnitude *= 10.0;
        digits += 1;
    }
    format!("{value:.digits$}")
}

/// Formats a value as HTML with at most four significant digits and a power of ten.
pub(super) fn scientific(value: f64) -> String {
    let text = format!("{value:.3e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
            let power = format!("·10<sup>{}</sup>", exponent.replace('-', "−"));
            format!("{mantissa}{}", if exponent == "0" { "" } else { &power })
        }
        None => text,
    }
}

/// Formats a value with three significant digits and a prefix of its unit, without a line break between them.
pub(super) fn with_prefix(value: f64, unit: &str) -> String {
    const PREFIXES: [(f64, &str); 7] =
        [(1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")];
    let magnitude = value.abs();
    // 999.6 is rounded to 1.00 with the next prefix.
    let found = PREFIXES.into_iter().find(|(factor, _)| magnitude >= 0.9995 * factor);
    let (factor, prefix) = found.filter(|_| magnitude > 0.0).unwrap_or((1.0, ""));
    format!("{}\u{a0}{prefix}{unit}", rounded(value / factor).replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!([1234.5, 0.01234, 9.876, 0.0, 123.4].map(rounded), ["1234", "0.0123", "9.88", "0", "123"]);
        assert_eq!(scientific(1.234567e-7), "1.235·10<sup>−7</sup>");
        assert_eq!(scientific(2.0), "2");
        assert_eq!(scientific(1e-5), "1·10<sup>−5</sup>");
    }

    #[test]
    fn units_have_prefixes() {
        let texts = [20588.1, 999.7, 0.00042, 1.5e-6, -210.296, 0.0].map(|value| with_prefix(value, "N"));
        let plain = texts.map(|text| text.replace('\u{a0}', " "));
        assert_eq!(plain, ["20.6 kN", "1.00 kN", "420 µN", "1.50 µN", "−210 N", "0 N"]);
    }
}
