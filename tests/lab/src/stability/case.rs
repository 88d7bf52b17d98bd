//! Cases, their possible ends, and the verdicts.

use std::path::PathBuf;

use serde_json::{Value, json};

/// Wall-clock limit of most cases (s): far above the time of any of them on a loaded machine.
const TIME_LIMIT: f64 = 120.0;

/// Expected end of a case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Expected {
    /// A correct result, and the reference that it is compared with.
    Right(String),
    /// An error that contains all words of one of these lists.
    Refused(Vec<Vec<String>>),
    /// Either of them; an error contains all words of one of the lists.
    Either(String, Vec<Vec<String>>),
}

impl Expected {
    /// Expects a correct result, compared with the reference `against`.
    pub(crate) fn right(against: impl Into<String>) -> Self {
        Self::Right(against.into())
    }

    /// Expects an error that contains all of these words.
    pub(crate) fn refused<const N: usize>(words: [&str; N]) -> Self {
        Self::refused_as(&[&words])
    }

    /// Expects an error that contains all words of one of these lists, if several errors are correct.
    pub(crate) fn refused_as(lists: &[&[&str]]) -> Self {
        Self::Refused(owned(lists))
    }

    /// Expects a correct result or such an error.
    pub(crate) fn either<const N: usize>(against: impl Into<String>, words: [&str; N]) -> Self {
        Self::either_as(against, &[&words])
    }

    /// Expects a correct result or an error that contains all words of one of these lists.
    pub(crate) fn either_as(against: impl Into<String>, lists: &[&[&str]]) -> Self {
        Self::Either(against.into(), owned(lists))
    }

    /// Returns the text for tables.
    pub(crate) fn to_text(&self) -> String {
        let named = |lists: &[Vec<String>]| {
            let lists: Vec<String> = lists.iter().map(|words| words.join(", ")).collect();
            format!("rejection naming {}", lists.join(" | "))
        };
        match self {
            Self::Right(against) => against.clone(),
            Self::Refused(lists) => named(lists),
            Self::Either(against, lists) => format!("{against}; or {}", named(lists)),
        }
    }
}

fn owned(lists: &[&[&str]]) -> Vec<Vec<String>> {
    lists.iter().map(|words| words.iter().map(|word| (*word).to_owned()).collect()).collect()
}

/// Returns a word that a message lacks, if none of the lists is complete. An empty word matches nothing.
fn unnamed(message: &str, lists: &[Vec<String>]) -> Option<String> {
    let named = |word: &String| !word.is_empty() && message.contains(word.as_str());
    if lists.iter().any(|words| !words.is_empty() && words.iter().all(named)) {
        return None;
    }
    let missing = |words: &Vec<String>| {
        let missing: Vec<&str> = words.iter().filter(|word| !named(word)).map(String::as_str).collect();
        missing.join(", ")
    };
    Some(lists.iter().map(missing).collect::<Vec<_>>().join(" | "))
}

/// One comparison, which holds if `found` is finite and at most `bound`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Check {
    /// The compared quantity.
    pub what: String,
    /// Magnitude of the difference.
    pub found: f64,
    /// Largest correct value.
    pub bound: f64,
}

impl Check {
    /// Creates the check of a quantity that may be at most `bound`.
    pub(crate) fn at_most(what: impl Into<String>, found: f64, bound: f64) -> Self {
        Self { what: what.into(), found, bound }
    }

    /// Creates the check of a condition.
    pub(crate) fn so(what: impl Into<String>, holds: bool) -> Self {
        Self::at_most(what, if holds { 0.0 } else { 1.0 }, 0.0)
    }

    /// Creates the check of the relative difference of two numbers.
    pub(crate) fn relative(what: impl Into<String>, found: f64, exact: f64, bound: f64) -> Self {
        Self::at_most(what, if exact == 0.0 { found.abs() } else { (found / exact - 1.0).abs() }, bound)
    }

    /// Returns whether the check holds; with NaN it does not.
    pub(crate) fn holds(&self) -> bool {
        self.found <= self.bound
    }

    fn to_text(&self) -> String {
        if self.bound == 0.0 {
            return if self.holds() { self.what.clone() } else { format!("not fulfilled: {}", self.what) };
        }
        format!("{} {:.1e} (at most {:.0e})", self.what, self.found, self.bound)
    }

    /// Returns the used fraction of the bound.
    fn share(&self) -> f64 {
        if self.found.is_nan() {
            f64::INFINITY
        } else if self.found == 0.0 {
            0.0
        } else {
            self.found / self.bound
        }
    }
}

/// End of a case whose process was not killed.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct CaseEnd {
    /// The error, if there was one.
    pub refusal: Option<String>,
    /// Comparisons.
    pub checks: Vec<Check>,
    /// Further figures for the table.
    pub remarks: Vec<String>,
}

impl CaseEnd {
    /// Creates a result with its checks.
    pub(crate) fn answer(checks: Vec<Check>) -> Self {
        Self { checks, ..Self::default() }
    }

    /// Creates an end with an error.
    pub(crate) fn refused(message: impl ToString) -> Self {
        Self { refusal: Some(message.to_string()), ..Self::default() }
    }

    /// Converts the outcome of work that the core may reject.
    pub(crate) fn of(outcome: tiprub_core::Result<Vec<Check>>) -> Self {
        outcome.map_or_else(Self::refused, Self::answer)
    }

    /// Adds a figure for the table.
    pub(crate) fn remark(mut self, text: impl Into<String>) -> Self {
        self.remarks.push(text.into());
        self
    }

    /// Returns the text for the parent process.
    pub(crate) fn to_json(&self) -> Value {
        // Numbers as bits, because JSON supports neither NaN nor infinity.
        let checks = self
            .checks
            .iter()
            .map(|check| json!({ "what": check.what, "found": check.found.to_bits(), "bound": check.bound.to_bits() }));
        json!({ "refusal": self.refusal, "checks": checks.collect::<Vec<_>>(), "remarks": self.remarks })
    }

    /// Reads the output of a child process.
    pub(crate) fn from_json(value: &Value) -> Option<Self> {
        let number = |value: &Value| value.as_u64().map(f64::from_bits);
        let check = |check: &Value| {
            let what = check["what"].as_str()?.to_owned();
            Some(Check { what, found: number(&check["found"])?, bound: number(&check["bound"])? })
        };
        let text = |value: &Value| value.as_str().map(String::from);
        Some(Self {
            refusal: text(&value["refusal"]),
            checks: value["checks"].as_array()?.iter().map(check).collect::<Option<_>>()?,
            remarks: value["remarks"].as_array()?.iter().map(text).collect::<Option<_>>()?,
        })
    }
}

/// Verdict on a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CaseVerdict {
    /// A correct result.
    Right,
    /// Rejected as expected, before the first step.
    Refused,
    /// Ended in a step, with the expected error.
    Ended,
    /// A wrong result, a wrong error, or a result where an error is expected.
    Wrong,
    /// The process terminated abnormally: panic, abort, signal.
    Crashed,
    /// The process did not end in time.
    Hung,
}

impl CaseVerdict {
    /// All verdicts, in the order of a table.
    pub(crate) const ALL: [Self; 6] = [Self::Right, Self::Refused, Self::Ended, Self::Wrong, Self::Crashed, Self::Hung];

    /// Returns whether the verdict is as expected.
    pub(crate) fn is_sound(self) -> bool {
        matches!(self, Self::Right | Self::Refused | Self::Ended)
    }

    /// Returns the name of the verdict.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Refused => "refused",
            Self::Ended => "ended",
            Self::Wrong => "WRONG",
            Self::Crashed => "CRASHED",
            Self::Hung => "HUNG",
        }
    }
}

/// Text in a message that ends a run in a step.
const IN_A_STEP: &str = "last good time";

/// Returns the verdict on an end, and its explanation.
pub(crate) fn judge(expected: &Expected, happened: &CaseEnd) -> (CaseVerdict, String) {
    let failed: Vec<String> = happened.checks.iter().filter(|check| !check.holds()).map(Check::to_text).collect();
    let remarks = happened.remarks.iter().map(|remark| format!("; {remark}")).collect::<String>();
    let words = match expected {
        Expected::Right(_) => None,
        Expected::Refused(words) | Expected::Either(_, words) => Some(words),
    };
    match (&happened.refusal, words) {
        (Some(message), None) => (CaseVerdict::Wrong, format!("rejected: {message}")),
        (Some(message), Some(words)) => {
            if let Some(missing) = unnamed(message, words) {
                return (CaseVerdict::Wrong, format!("rejected without naming {missing}: {message}"));
            }
            if !failed.is_empty() {
                return (CaseVerdict::Wrong, format!("{}; rejected: {message}", failed.join("; ")));
            }
            let verdict = if message.contains(IN_A_STEP) { CaseVerdict::Ended } else { CaseVerdict::Refused };
            (verdict, format!("{message}{remarks}"))
        }
        (None, _) if !failed.is_empty() => (CaseVerdict::Wrong, format!("{}{remarks}", failed.join("; "))),
        (None, _) if matches!(expected, Expected::Refused(_)) => (CaseVerdict::Wrong, "was not rejected".to_owned()),
        (None, _) if happened.checks.is_empty() => (CaseVerdict::Wrong, "nothing was compared".to_owned()),
        (None, _) => (CaseVerdict::Right, format!("{}{remarks}", tightest(&happened.checks))),
    }
}

/// Returns the check with the largest used fraction of its bound, which represents all.
fn tightest(checks: &[Check]) -> String {
    let most = checks.iter().max_by(|a, b| a.share().total_cmp(&b.share()));
    let others = match checks.len() {
        0 | 1 => String::new(),
        count => format!("; {} more", count - 1),
    };
    most.map_or_else(String::new, |check| format!("{}{others}", check.to_text()))
}

/// Data that a case may use in addition to its models.
#[derive(Debug, Clone, Default)]
pub(crate) struct CaseContext {
    /// Directory of packaged FMUs, if the parent created some.
    pub fmus: Option<PathBuf>,
}

/// The work of a case.
type CaseWork = Box<dyn Fn(&CaseContext) -> CaseEnd + Send + Sync>;

/// One row of the table.
pub(crate) struct StabilityCase {
    /// Family, slash, and the distinguishing part: `step-limit/central-difference/lcp/h=0.9`.
    pub name: String,
    /// Expected end.
    pub expected: Expected,
    /// True if the quick table includes it.
    pub quick: bool,
    /// True if it needs packaged FMUs.
    pub imports: bool,
    /// Wall-clock limit (s).
    pub limit: f64,
    work: CaseWork,
}

impl std::fmt::Debug for StabilityCase {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{}", self.name)
    }
}

impl StabilityCase {
    /// Creates a case of the full table.
    pub(crate) fn new(
        name: impl Into<String>,
        expected: Expected,
        work: impl Fn(&CaseContext) -> CaseEnd + Send + Sync + 'static,
    ) -> Self {
        let (name, work) = (name.into(), Box::new(work));
        Self { name, expected, quick: false, imports: false, limit: TIME_LIMIT, work }
    }

    /// Adds the case to the quick table if `so`.
    pub(crate) fn quick(self, so: bool) -> Self {
        Self { quick: so, ..self }
    }

    /// Sets another time limit (s).
    pub(crate) fn within(self, limit: f64) -> Self {
        Self { limit, ..self }
    }

    /// Marks the case as one that needs packaged FMUs.
    pub(crate) fn importing(self) -> Self {
        Self { imports: true, ..self }
    }

    /// Returns the part before the first slash.
    pub(crate) fn family(&self) -> &str {
        self.name.split('/').next().unwrap_or(&self.name)
    }

    /// Runs the case in this process.
    pub(crate) fn run(&self, context: &CaseContext) -> CaseEnd {
        (self.work)(context)
    }
}

/// A list of cases.
pub(crate) trait Cases {
    /// Adds a case whose work gives checks or an error; also to the quick table, if `quick`.
    fn add(
        &mut self,
        quick: bool,
        name: impl Into<String>,
        expected: Expected,
        work: impl Fn() -> tiprub_core::Result<Vec<Check>> + Send + Sync + 'static,
    );
}

impl Cases for Vec<StabilityCase> {
    fn add(
        &mut self,
        quick: bool,
        name: impl Into<String>,
        expected: Expected,
        work: impl Fn() -> tiprub_core::Result<Vec<Check>> + Send + Sync + 'static,
    ) {
        self.push(StabilityCase::new(name, expected, move |_| CaseEnd::of(work())).quick(quick));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(expected: Expected, happened: CaseEnd) -> CaseVerdict {
        judge(&expected, &happened).0
    }

    #[test]
    fn answer_is_right_only_if_all_comparisons_hold() {
        let right = || Expected::right("x");
        let within = Check::at_most("a", 1e-12, 1e-9);
        assert_eq!(verdict(right(), CaseEnd::answer(vec![within.clone()])), CaseVerdict::Right);
        assert_eq!(verdict(right(), CaseEnd::answer(vec![])), CaseVerdict::Wrong);
        for found in [2e-9, f64::NAN, f64::INFINITY] {
            let beyond = Check::at_most("b", found, 1e-9);
            assert_eq!(verdict(right(), CaseEnd::answer(vec![within.clone(), beyond])), CaseVerdict::Wrong);
        }
        assert_eq!(verdict(right(), CaseEnd::answer(vec![Check::so("c", false)])), CaseVerdict::Wrong);
        assert_eq!(verdict(right(), CaseEnd::refused("h is too long")), CaseVerdict::Wrong);
    }

    #[test]
    fn rejection_counts_only_if_expected_and_named() {
        let refused = || Expected::refused(["µ", "h ="]);
        assert_eq!(verdict(refused(), CaseEnd::refused("µ = 2 with h = 1 s")), CaseVerdict::Refused);
        assert_eq!(verdict(refused(), CaseEnd::refused("µ = 2")), CaseVerdict::Wrong);
        let several = || Expected::refused_as(&[&["µ", "h ="], &["load"]]);
        assert_eq!(verdict(several(), CaseEnd::refused("the load is 1e300")), CaseVerdict::Refused);
        assert_eq!(verdict(several(), CaseEnd::refused("µ = 2")), CaseVerdict::Wrong);
        let ended = CaseEnd::refused("at t = 2 s (last good time 1 s) the load is 1e300");
        assert_eq!(verdict(several(), ended), CaseVerdict::Ended);
        // Without words there is no expectation: no error counts.
        for nothing in [Expected::refused([""]), Expected::refused([]), Expected::refused_as(&[])] {
            assert_eq!(verdict(nothing, CaseEnd::refused("no")), CaseVerdict::Wrong);
        }
        let answer = CaseEnd::answer(vec![Check::so("a", true)]);
        assert_eq!(verdict(refused(), answer.clone()), CaseVerdict::Wrong);
        let either = || Expected::either("x", ["µ"]);
        assert_eq!(verdict(either(), answer), CaseVerdict::Right);
        assert_eq!(verdict(either(), CaseEnd::refused("µ")), CaseVerdict::Refused);
        let spoiled = CaseEnd { checks: vec![Check::so("a", false)], ..CaseEnd::refused("µ") };
        assert_eq!(verdict(either(), spoiled), CaseVerdict::Wrong);
    }

    #[test]
    fn case_result_round_trips_between_processes() {
        let happened = CaseEnd {
            refusal: Some("no".into()),
            checks: vec![Check::at_most("a", f64::NAN, 0.1), Check::at_most("b", 1.0 / 3.0, f64::INFINITY)],
            remarks: vec!["c".into()],
        };
        let text = happened.to_json().to_string();
        let back = CaseEnd::from_json(&serde_json::from_str(&text).unwrap()).unwrap();
        assert_eq!(back.to_json(), happened.to_json());
        assert!(back.checks[0].found.is_nan() && back.checks[1].bound.is_infinite());
        assert_eq!(CaseEnd::from_json(&json!({})), None);
    }
}
