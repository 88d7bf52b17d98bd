//! Comparison of figures in the user guide with those that a test computes.
//!
//! The text of a chapter between `<!-- from: COMMAND -->` and `<!-- end -->` is the output of COMMAND. A test that
//! computes it prints it line by line (`print_row!`), and [`hold`] searches the printed lines for every line of the
//! block that contains numbers: all numbers of the line must occur in one of them, in the same order, rounded to the
//! digits shown.

#![allow(dead_code, unused_imports, unused_macros, reason = "each test takes its part")]

use std::{cell::RefCell, fs, path::PathBuf};

thread_local! {
    static TOLD: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Prints a line and keeps it for [`hold`].
macro_rules! print_row {
    ($($argument:tt)*) => { $crate::guide::tell(format!($($argument)*)) };
}
pub(crate) use print_row;

/// The rounding of the last digits of a sum depends on the compiler: numbers below this value only have to be equally
/// small.
const ROUNDING: f64 = 1e-10;
/// Permitted difference of a number in units of its last digit: half a unit is its rounding, and the printed line is
/// rounded too.
const OFF: f64 = 0.56;

/// A number as the guide shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    value: f64,
    /// One unit of its last digit.
    unit: f64,
    /// True if it is shown with a sign.
    signed: bool,
}

impl Shown {
    pub fn is(self, found: f64) -> bool {
        let (value, found) = if self.signed { (self.value, found) } else { (self.value.abs(), found.abs()) };
        let scientific = self.unit < 1e-10;
        let small = scientific && value.abs() < ROUNDING && found.abs() <= 10.0 * value.abs();
        small || (value - found).abs() <= OFF * self.unit
    }
}

/// Returns the numbers of a line; digits within words (hex8, L2) do not count.
pub fn numbers(line: &str) -> Vec<Shown> {
    let characters: Vec<char> = line.replace('−', "-").chars().collect();
    let (mut all, mut at) = (Vec::new(), 0);
    while at < characters.len() {
        let before = if at == 0 { ' ' } else { characters[at - 1] };
        if !characters[at].is_ascii_digit() || before.is_alphanumeric() || before == '_' {
            at += 1;
            continue;
        }
        let start = at;
        let mut text = String::new();
        let mut decimals = None;
        while at < characters.len() {
            let next = |ahead: usize| characters.get(at + ahead).is_some_and(char::is_ascii_digit);
            match characters[at] {
                digit if digit.is_ascii_digit() => {
                    decimals = decimals.map(|count: i32| count + 1);
                    text.push(digit);
                }
                '.' if decimals.is_none() && next(1) => {
                    decimals = Some(0);
                    text.push('.');
                }
                // 133,453 is one number; 1, 2 are two.
                ',' if decimals.is_none() && next(1) && next(2) && next(3) && !next(4) => {}
                _ => break,
            }
            at += 1;
        }
        let mut exponent = 0;
        if characters.get(at) == Some(&'e') {
            let digits: String = characters[at + 1..].iter().take_while(|c| **c == '-' || c.is_ascii_digit()).collect();
            if let Ok(power) = digits.parse::<i32>() {
                exponent = power;
                at += 1 + digits.len();
            }
        }
        // A word that begins with digits, such as 3D.
        if characters.get(at).is_some_and(|c| c.is_alphabetic()) {
            continue;
        }
        let sign = start.checked_sub(1).map(|sign| characters[sign]);
        let alone = start < 2 || !characters[start - 2].is_alphanumeric();
        let signed = alone && matches!(sign, Some('-' | '+'));
        let size: f64 = text.parse::<f64>().unwrap_or(f64::NAN) * 10_f64.powi(exponent);
        let value = if signed && sign == Some('-') { -size } else { size };
        all.push(Shown { value, unit: 10_f64.powi(exponent - decimals.unwrap_or(0)), signed });
    }
    all
}

/// Returns whether a printed line contains all numbers of a line of the guide, in order.
pub fn holds(found: &str, shown: &[Shown]) -> bool {
    let mut found = numbers(found).into_iter();
    shown.iter().all(|wanted| found.any(|number| wanted.is(number.value)))
}

/// Prints a line and keeps it.
pub fn tell(line: String) {
    println!("{line}");
    TOLD.with_borrow_mut(|all| all.push(line));
}

/// Returns name and text of the README and the chapters.
pub fn pages() -> Vec<(String, String)> {
    let mut root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    while !root.join("docs").is_dir() {
        assert!(root.pop(), "no directory docs above {}", env!("CARGO_MANIFEST_DIR"));
    }
    let chapters = fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = chapters.filter(|path| path.extension().is_some_and(|kind| kind == "md")).collect();
    paths.push(root.join("README.md"));
    paths.sort();
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

/// Returns all blocks of the guide: page, command, lines.
pub fn blocks() -> Vec<(String, String, String)> {
    let mut all = Vec::new();
    for (page, text) in pages() {
        for part in text.split("<!-- from: ").skip(1) {
            let (command, rest) = part.split_once(" -->\n").unwrap_or_else(|| panic!("{page}: no end of a mark"));
            let (block, _) = rest.split_once("<!-- end -->").unwrap_or_else(|| panic!("{page}, {command}: no end"));
            all.push((page.clone(), command.to_owned(), block.to_owned()));
        }
    }
    all
}

/// Returns whether this line separates the head of a table from its body.
fn divides(line: &str) -> bool {
    line.contains("|-") && line.chars().all(|c| "|-: ".contains(c))
}

/// Returns the lines of a block that are not among the printed ones; heads of tables are words.
pub fn missing<'a>(block: &'a str, found: &[String]) -> Vec<&'a str> {
    let after = block.lines().skip(1).chain([""]);
    let lines = block.lines().zip(after).filter(|(_, after)| !divides(after)).map(|(line, _)| (line, numbers(line)));
    let lines = lines.filter(|(_, shown)| !shown.is_empty());
    lines.filter(|(_, shown)| !found.iter().any(|line| holds(line, shown))).map(|(line, _)| line).collect()
}

/// Checks that the blocks from `command` contain what this test printed.
///
/// # Panics
/// If a line of the guide was not printed, or there is no such block.
#[track_caller]
pub fn hold(command: &str) {
    let own: Vec<_> = blocks().into_iter().filter(|block| block.1 == command).collect();
    assert!(!own.is_empty(), "no chapter has a block from `{command}`");
    TOLD.with_borrow(|reported| {
        for (page, _, block) in own {
            let missing = missing(&block, reported);
            assert!(
                missing.is_empty(),
                "{page}: `{command}` does not find\n{}\nbut\n{}",
                missing.join("\n"),
                reported.join("\n")
            );
        }
    });
}
