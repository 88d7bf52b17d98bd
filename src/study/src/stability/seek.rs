//! Searches for the largest step up to which all tried steps are accepted.

use serde::{Deserialize, Serialize};

/// Range of tried steps, times the highest angular frequency: from steps that resolve every mode well to far beyond.
pub const TRIED: [f64; 2] = [0.1, 1e3];
/// Number of halvings of the interval between an accepted and a rejected step.
const HALVINGS: u32 = 7;

/// Result of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Sought<E> {
    /// All steps are accepted, up to the largest tried (s).
    All(f64),
    /// Steps up to this one (s) are accepted; the reason why a longer one is not.
    Below(f64, E),
    /// No step is accepted, with the reason.
    None(E),
}

/// Doubles the step from the smallest on, then halves the interval between the last accepted and the first rejected step. `known` is the limit if no
/// other reason applies.
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
        // The known limit does not apply if another reason rejects shorter steps.
        let Sought::Below(step, _) = seek([1e-6, 1e-2], Some(3.1e-4), below(3e-4)) else { panic!("not found") };
        assert!(step < 3e-4);
    }

    #[test]
    fn distinguishes_all_stable_from_none_stable() {
        assert_eq!(seek([1e-6, 1e-2], None, below(1.0)), Sought::All(1e-2));
        assert_eq!(seek([1e-6, 1e-2], None, below(0.0)), Sought::None(1e-6));
    }
}
