//! Parts of a plan.

use std::{fmt, ops::Range, str::FromStr};

/// Part of a plan, counted from 1: neighbouring runs, and equal numbers of them up to one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    number: usize,
    count: usize,
}

/// Largest number of parts.
const MOST_PARTS: usize = 1_000_000;

impl Part {
    /// The whole plan.
    pub const WHOLE: Self = Self { number: 1, count: 1 };

    /// Creates part `number` of `count`; `None` if there is no such part.
    pub fn new(number: usize, count: usize) -> Option<Self> {
        ((1..=count).contains(&number) && count <= MOST_PARTS).then_some(Self { number, count })
    }

    /// Returns the runs of this part (from 0) if the plan has `runs` runs. Every run is in exactly one part.
    pub fn runs(self, runs: usize) -> Range<usize> {
        // No overflow: 64 bits hold runs and parts up to a million each.
        let end = |number: usize| {
            let product = number as u128 * runs as u128 / self.count as u128;
            usize::try_from(product).unwrap_or(runs)
        };
        end(self.number - 1)..end(self.number)
    }

    /// Returns the text for file names, with leading zeros so that names sort by number; empty for the whole plan.
    pub fn file_suffix(self) -> String {
        let digits = self.count.to_string().len();
        if self.count == 1 { String::new() } else { format!("-{:0digits$}-of-{}", self.number, self.count) }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}/{}", self.number, self.count)
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text
            .split_once('/')
            .and_then(|(number, count)| Self::new(number.trim().parse().ok()?, count.trim().parse().ok()?));
        parsed.ok_or_else(|| {
            format!("give a part as NUMBER/COUNT with 1 ≤ NUMBER ≤ COUNT ≤ {MOST_PARTS}, for example 17/1000")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_exactly_one_part() {
        for runs in [0, 1, 2, 7, 24, 1000, 1001] {
            for count in [1, 2, 3, 7, 24, 1000, 2000] {
                let parts = (1..=count).map(|number| Part::new(number, count).unwrap().runs(runs));
                let all: Vec<usize> = parts.clone().flatten().collect();
                assert_eq!(all, (0..runs).collect::<Vec<_>>(), "{runs} runs, {count} parts");
                let sizes: Vec<usize> = parts.map(|part| part.len()).collect();
                assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1, "{sizes:?}");
            }
        }
    }

    #[test]
    fn parts_are_parsed_and_named() {
        assert_eq!("17/1000".parse(), Ok(Part::new(17, 1000).unwrap()));
        assert_eq!(Part::new(17, 1000).unwrap().file_suffix(), "-0017-of-1000");
        assert_eq!(Part::WHOLE.file_suffix(), "");
        for wrong in ["0/3", "4/3", "1", "1/0", "a/b", "-1/3", "1/2/3", "1/10000000"] {
            assert!(wrong.parse::<Part>().is_err(), "{wrong}");
        }
    }
}
