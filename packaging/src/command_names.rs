//! Adds useful remedies to command lines that the parser rejects, and returns errors of the parser as JSON.

use std::{ffi::OsString, fmt::Write as _};

use clap::{
    CommandFactory, Parser,
    error::{ContextKind, ContextValue, ErrorKind},
};
use tiprub_format::name_hint;
use tiprub_shell::{Failure, console::Console};

use crate::cli::Cli;

/// Returns whether `--json` is among the arguments; after `--` it may be the name of a file.
pub fn asks_for_json(arguments: &[OsString]) -> bool {
    arguments.iter().take_while(|argument| *argument != "--").any(|argument| argument == "--json")
}

/// Returns the error of a command line in which the kind of model or the name of a study is missing or wrong; `None` if they are right. The
/// arguments do not include the name of the program.
pub fn check_names(arguments: &[OsString]) -> Option<Failure> {
    let words: Vec<String> = arguments.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let global = |word: &&String| ["--json", "--quiet", "-q"].contains(&word.as_str());
    let start = words.iter().position(|word| !global(&word))?;
    let rest = &words[start + 1..];
    match words[start].as_str() {
        "reduce" => reduce(rest),
        "study" => study(rest.iter().find(|word| !global(word))?),
        _ => None,
    }
}

fn study(name: &str) -> Option<Failure> {
    let known = subcommands("study");
    if name.starts_with('-') || name == "help" || known.iter().any(|known| known == name) {
        return None;
    }
    let remedy = format!("{}Choose {}; see `tiprub study --help`", hint(name, &known), listed(&known));
    Some(Failure::usage(format!("study {name}"), "no such study", remedy))
}

/// Returns the names of the subcommands of a command.
fn subcommands(of: &str) -> Vec<String> {
    let cli = Cli::command();
    let command = cli.find_subcommand(of).into_iter().flat_map(clap::Command::get_subcommands);
    command.map(|command| command.get_name().to_owned()).collect()
}

/// Returns the question whether a similar known name was meant; empty if no known name is similar.
fn hint(name: &str, known: &[String]) -> String {
    name_hint(name, known.iter().map(String::as_str))
}

/// Formats names as "`a`, `b` or `c`".
fn listed(names: &[String]) -> String {
    let mut text = String::new();
    for (index, name) in names.iter().enumerate() {
        let between = if index == 0 {
            ""
        } else if index + 1 == names.len() {
            " or "
        } else {
            ", "
        };
        let _ = write!(text, "{between}`{name}`");
    }
    text
}

/// Checks that the kind of model comes before options and files.
fn reduce(words: &[String]) -> Option<Failure> {
    let (own, global): (Vec<&String>, Vec<&String>) =
        words.iter().partition(|word| !["--json", "--quiet", "-q"].contains(&word.as_str()));
    let first = own.first()?.as_str();
    let models = subcommands("reduce");
    if ["-h", "--help", "help", "--version", "-V", "--"].contains(&first) || models.iter().any(|model| model == first) {
        return None;
    }
    let given = |option: &str| own.iter().any(|word| word.split('=').next() == Some(option));
    let shipped = own.iter().position(|word| models.iter().any(|model| model == *word));
    let is_file = first.contains(['.', '/', '\\']);
    let mut now: Vec<&str> = own.iter().map(|word| word.as_str()).collect();
    if let (true, Some(place)) = (first.starts_with('-'), shipped) {
        let model = now.remove(place);
        now.insert(0, model);
    } else if first.starts_with('-') && !given("--stiffness") && !own.iter().any(|word| is_mesh(word)) {
        return None;
    } else if first.starts_with('-') || is_file {
        let kind = if given("--contact-grid") {
            "casing-mesh"
        } else if given("--cyclic-low") || given("--cyclic-high") {
            "sector"
        } else {
            "blade"
        };
        now.insert(0, kind);
    } else {
        return Some(no_model(first, &models));
    }
    let line: Vec<String> = now.into_iter().chain(global.into_iter().map(String::as_str)).map(quoted).collect();
    let remedy = format!("Run `tiprub reduce {}`", line.join(" "));
    Some(Failure::usage(format!("reduce {first}"), "the kind of model must come first", remedy))
}

fn is_mesh(word: &str) -> bool {
    let lower = word.to_ascii_lowercase();
    !word.starts_with('-') && [".inp", ".msh"].iter().any(|end| lower.ends_with(end))
}

/// Returns the error of an unknown kind of model, with the similar name and the command for user meshes.
fn no_model(name: &str, models: &[String]) -> Failure {
    let remedy = format!(
        "{}Choose {}; for your own mesh (.inp or .msh), use `tiprub reduce blade FILE`",
        hint(name, models),
        listed(models)
    );
    Failure::usage(format!("reduce {name}"), "no such kind of model", remedy)
}

/// Quotes a word for a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+\\".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// Parses the command line of a program. Help and errors end the program here, errors as JSON if requested.
pub fn parsed<C: Parser>(asked: &Console) -> C {
    C::try_parse().unwrap_or_else(|error| {
        if let Some(failure) = failure(&error, C::command().get_name()) {
            asked.answer(&failure);
            if !asked.prints_errors() {
                std::process::exit(error.exit_code());
            }
        }
        error.exit()
    })
}

/// Splits an error of clap into place, problem and remedy; `None` for help, which is no failure.
pub(crate) fn failure(error: &clap::Error, program: &str) -> Option<Failure> {
    if error.exit_code() == 0 {
        return None;
    }
    let help = &format!("See `{program} --help` or the `--help` of the command");
    let text = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        Some(ContextValue::Strings(all)) => Some(all.join(", ")),
        _ => None,
    };
    let what = text(ContextKind::InvalidArg).or_else(|| text(ContextKind::InvalidSubcommand));
    let what = what.unwrap_or_else(|| "command line".to_owned());
    let missing = [ErrorKind::MissingSubcommand, ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand];
    if missing.contains(&error.kind()) {
        let known =
            text(ContextKind::ValidSubcommand).map_or(String::new(), |known| format!("Choose one of {known}. "));
        return Some(Failure::usage(what, "a command is missing", format!("{known}{help}")));
    }
    let reported = error.render().to_string();
    let problem = reported.split("\n\nUsage:").next().unwrap_or(&reported).trim().trim_start_matches("error: ");
    // Hints of clap follow after an empty line.
    let (problem, hints) = problem.split_once("\n\n").unwrap_or((problem, ""));
    let hints = hints.lines().map(|line| line.trim().trim_start_matches("tip: ").trim_end_matches('.'));
    let hints = hints.filter(|line| !line.is_empty() && !line.starts_with("For more information"));
    let remedy: Vec<&str> = hints.chain([help.as_str()]).collect();
    let lines: Vec<&str> = problem.lines().map(str::trim).collect();
    Some(Failure::usage(what, lines.join(" "), remedy.join(". ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<OsString> {
        line.split_whitespace().map(OsString::from).collect()
    }

    #[test]
    fn proposes_the_missing_model_kind() {
        for (line, now) in [
            (
                "reduce blade.inp --contact-set TIP --clamp-set ROOT --sectors 36",
                "blade blade.inp --contact-set TIP --clamp-set ROOT --sectors 36",
            ),
            ("--json reduce ./b.msh --spin 9", "blade ./b.msh --spin 9"),
            (
                "reduce s.inp --sectors 9 --cyclic-low A --cyclic-high B -q",
                "sector s.inp --sectors 9 --cyclic-low A --cyclic-high B -q",
            ),
            ("reduce r.inp --contact-grid=24x3", "casing-mesh r.inp --contact-grid=24x3"),
            (
                "reduce --stiffness K.mtx --mass M.mtx --nodes n.csv",
                "blade --stiffness K.mtx --mass M.mtx --nodes n.csv",
            ),
            ("reduce --modes 30 rotor37", "rotor37 --modes 30"),
            ("reduce -o x.rom --contact-set TIP bar.inp", "blade -o x.rom --contact-set TIP bar.inp"),
        ] {
            let failure = check_names(&words(line)).unwrap_or_else(|| panic!("{line}"));
            assert_eq!(failure.remedy, format!("Run `tiprub reduce {now}`"), "{line}");
            assert_eq!(failure.exit_code(), 2);
            let parsed = Cli::try_parse_from(words(&format!("tiprub reduce {now}")));
            assert!(parsed.is_ok(), "{now}: {}", parsed.unwrap_err());
        }
        for line in [
            "reduce",
            "reduce --help",
            "reduce rotor37 --modes 30",
            "reduce help",
            "run a.toml",
            "reduce --modes 3",
            "",
        ] {
            assert_eq!(check_names(&words(line)), None, "{line}");
        }
    }

    #[test]
    fn proposes_known_names_for_unknown_ones() {
        let failure = check_names(&words("reduce rotor38")).unwrap();
        assert!(failure.remedy.starts_with("Did you mean `rotor37`? Choose `blade`, "), "{failure}");
        assert!(check_names(&words("study tip")).unwrap().remedy.starts_with("Choose `map`, "));
        let failure = check_names(&words("study stabilty")).unwrap();
        assert!(failure.remedy.starts_with("Did you mean `stability`? Choose `map`, "), "{failure}");
        for line in ["study map", "study error --help", "study --help", "study"] {
            assert_eq!(check_names(&words(line)), None, "{line}");
        }
    }

    #[test]
    fn quotes_words_that_a_shell_would_split() {
        assert_eq!(quoted("my blade.inp"), "'my blade.inp'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert_eq!(quoted("-0.02:0.256,0.04:0.245"), "-0.02:0.256,0.04:0.245");
    }
}
