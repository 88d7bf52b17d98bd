//! The largest step up to which all that are tried are accepted.

/// Steps tried, times the highest angular frequency: from where every mode is resolved well to far beyond.
pub const TRIED: [f64; 2] = [0.1, 1e3];
/// Halvings of the interval between a step that is accepted and one that is not.
const HALVINGS: u32 = 7;

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub enum Sought<E> {
    /// All are accepted, the largest tried.
    All(f64),
    /// Shorter steps are accepted, and why a longer one is not.
    Below(f64, E),
    /// None is: why.
    None(E),
}

/// From the smallest step on by doubling, then by halving between the last that is accepted and the first that is not. `known` is
/// where the limit is if nothing else stands in the way.
pub fn seek<E>([low, high]: [f64; 2], known: Option<f64>, mut accepts: impl FnMut(f64) -> Result<(), E>) -> Sought<E> {
    let (mut good, mut bad) = (0.0, low);
    let mut why = loop {
        match accepts(bad) {
            Err(why) if good == 0.0 => return Sought::None(why),
            Err(why) => break why,
            Ok(()) if bad >= high => return Sought::All(high),
            Ok(()) => (good, bad) = (bad, (2.0 * bad).min(high)),
        }
    };
    let known = known.filter(|known| good < *known && *known <= bad);
    if let Some(known) = known.filter(|known| accepts(known * (1.0 - 1e-6)).is_ok()) {
        return Sought::Below(known, why);
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (good + bad);
        match accepts(middle) {
            Ok(()) => good = middle,
            Err(reason) => (bad, why) = (middle, reason),
        }
    }
    Sought::Below(good, why)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn below(limit: f64) -> impl Fn(f64) -> Result<(), f64> {
        move |step| if step < limit { Ok(()) } else { Err(step) }
    }

    #[test]
    fn finds_the_limit_within_one_percent_or_exactly() {
        let Sought::Below(step, why) = seek([1e-6, 1e-2], None, below(3.1e-4)) else { panic!("not found") };
        assert!(step < 3.1e-4 && step > 0.99 * 3.1e-4 && why >= 3.1e-4, "{step} {why}");
        let Sought::Below(step, _) = seek([1e-6, 1e-2], Some(3.1e-4), below(3.1e-4)) else { panic!("not found") };
        assert_eq!(step.to_bits(), 3.1e-4_f64.to_bits());
        // What is known does not hold where something else refuses before.
        let Sought::Below(step, _) = seek([1e-6, 1e-2], Some(3.1e-4), below(3e-4)) else { panic!("not found") };
        assert!(step < 3e-4);
    }

    #[test]
    fn distinguishes_all_stable_from_none_stable() {
        assert_eq!(seek([1e-6, 1e-2], None, below(1.0)), Sought::All(1e-2));
        assert_eq!(seek([1e-6, 1e-2], None, below(0.0)), Sought::None(1e-6));
    }
}
