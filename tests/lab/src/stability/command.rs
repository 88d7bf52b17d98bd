//! `lab stability`: stiff and extreme cases, each in a separate process, with a verdict.

use tiprub_packaging::{
    cli::LibraryArguments,
    fmu::{FmiVersion, FmuPackage},
    library,
};
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console},
    output_file,
    places::{self, NamedFile},
    sweep,
};

use crate::{
    cli::LabStabilityArguments,
    stability::{self, CaseContext, StabilityCase, child, families::values, table::StabilityTable},
};

/// Runs the requested cases and writes the table.
///
/// # Errors
/// An unknown case, files that cannot be written, or a case that is neither correct nor rejected as expected.
pub(crate) fn run(arguments: &LabStabilityArguments, console: &Console) -> Result<CommandOutcome> {
    if let Some(name) = &arguments.child {
        let json = child::answer(name)?;
        return Ok(CommandOutcome { text: json.to_string(), json, ..CommandOutcome::default() });
    }
    let cases = chosen(arguments)?;
    let written = StabilityTable::FILES.map(|name| NamedFile::new("--out", arguments.out.join(name)));
    places::apart(&Vec::from_iter(NamedFile::option("--library", &arguments.library)), &written)?;
    // Checked before the long work, because it would fail afterwards.
    output_file::try_directory(&arguments.out)?;
    // Must live as long as the cases run.
    let fmus = if cases.iter().any(|case| case.imports) { Some(package(arguments, console)?) } else { None };
    let context = CaseContext { fmus: fmus.as_ref().map(|directory| directory.path().to_owned()) };
    let task = console.task("Stability", Some(cases.len() as u64));
    let threads = arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get);
    let rows = sweep::sweep(
        &cases,
        threads,
        |case| {
            let row = child::run(case, &context)?;
            if !row.verdict.is_sound() {
                task.line(&format!("{} {}: {}", row.verdict.name(), row.name, row.happened));
            }
            Ok(row)
        },
        |done| task.at(done as u64),
    )?;
    drop(task);
    let table = StabilityTable { rows };
    let outcome = table.write(&arguments.out)?;
    verdict(&table, &arguments.out).map_or(Ok(outcome), Err)
}

/// Maximum number of unsound cases that are named.
const NAMED: usize = 5;

/// Returns the failure of a table with cases that are neither correct nor rejected as expected.
fn verdict(table: &StabilityTable, directory: &std::path::Path) -> Option<Failure> {
    let unsound: Vec<String> = table.unsound().map(|row| format!("{} {}", row.verdict.name(), row.name)).collect();
    if unsound.is_empty() {
        return None;
    }
    let named = unsound[..unsound.len().min(NAMED)].join(", ");
    let more = if unsound.len() > NAMED { format!(" and {} more", unsound.len() - NAMED) } else { String::new() };
    let problem = format!(
        "{} of {} cases are neither correct nor rejected as expected: {named}{more}",
        unsound.len(),
        table.rows.len()
    );
    let remedy = format!("See {}", directory.join("index.html").display());
    Some(Failure::new("lab stability", problem, remedy))
}

/// Packages the scenes whose variables are tested as FMUs of both versions in a temporary directory.
fn package(arguments: &LabStabilityArguments, console: &Console) -> Result<tempfile::TempDir> {
    let chosen =
        LibraryArguments { library: arguments.library.iter().cloned().collect(), ..LibraryArguments::default() };
    let libraries = library::load(library::LibraryUnit::Scene, library::LibraryBuild::Released, &chosen, console)?;
    let directory = tempfile::tempdir()
        .map_err(|error| Failure::file(&std::env::temp_dir(), "cannot create a temporary directory", &error))?;
    for name in values::SCENES {
        let scene = values::scene(name);
        let package = FmuPackage::new(&scene, &libraries)?;
        for version in [FmiVersion::Two, FmiVersion::Three] {
            let path = directory.path().join(format!("{name}-{}.fmu", version.digit()));
            package.write(&path, version, Some(false))?;
        }
    }
    Ok(directory)
}

fn chosen(arguments: &LabStabilityArguments) -> Result<Vec<StabilityCase>> {
    let Some(prefix) = &arguments.case else { return Ok(stability::cases(arguments.quick)) };
    let cases = stability::named(prefix, arguments.quick);
    if cases.is_empty() {
        let cases = stability::cases(arguments.quick);
        let mut families: Vec<&str> = cases.iter().map(StabilityCase::family).chain(["judge"]).collect();
        families.sort_unstable();
        families.dedup();
        let of = if arguments.quick { " in quick mode" } else { "" };
        let problem = format!("no case{of} begins with `{prefix}`");
        return Err(Failure::usage("--case", problem, format!("Choose from {}", families.join(", "))));
    }
    Ok(cases)
}
