//! `tiprub package`: writes .fmu files for a scene.

use std::path::{Path, PathBuf};

use serde_json::json;
use tiprub_gallery::scene_source;
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, shown_path, warnings_json},
};

use crate::{
    cli::{FmiChoice, PackageArguments},
    fmu::{FmiVersion, FmuPackage},
    library::{self, LibraryBuild, LibraryUnit},
};

/// Loads the scene, finds the library, and writes the archives.
///
/// # Errors
/// The scene is wrong, there is no library, or files cannot be written.
pub fn run(arguments: &PackageArguments, console: &Console) -> Result<CommandOutcome> {
    // Problems of the command line are reported before any work; a library is built only after the scene was accepted.
    targets(arguments.fmi, &arguments.output, "model")?;
    let given = !arguments.libraries.library.is_empty();
    let load = || library::load(LibraryUnit::Scene, LibraryBuild::Released, &arguments.libraries, console);
    let libraries = given.then(load).transpose()?;
    let scene = arguments.options.load(&arguments.scene, &arguments.cache.cache(), console)?;
    let targets = targets(arguments.fmi, &arguments.output, &scene.settings.name)?;
    let libraries = libraries.map_or_else(load, Ok)?;
    let package =
        FmuPackage::new(&scene, &libraries).map_err(|failure| scene_source::located(&arguments.scene, failure))?;
    let arrays = (arguments.arrays || arguments.scalars).then_some(arguments.arrays);
    for (version, path) in &targets {
        console.print_progress(format_args!("Writing {}", path.display()));
        package.write(path, *version, arrays)?;
    }
    let platforms: Vec<&str> = libraries.iter().map(|library| library.platform.tuple()).collect();
    let text: Vec<String> = targets
        .iter()
        .map(|(version, path)| format!("FMI {}.0: {} ({} kB)", version.digit(), path.display(), size(path) / 1000))
        .chain([format!("for {}", platforms.join(", "))])
        .collect();
    let files: Vec<_> = targets
        .iter()
        .map(|(version, path)| json!({"fmi": version.digit().to_string(), "file": shown_path(path), "bytes": size(path)}))
        .collect();
    let [warnings, details] = warnings_json(package.warnings());
    let json = json!({
        "model": scene.settings.name, "fmus": files, "platforms": platforms, "warnings": warnings, "warning_details": details,
    });
    Ok(CommandOutcome {
        text: text.join("\n"),
        warnings: package.warnings().to_vec(),
        json,
        ..CommandOutcome::default()
    })
}

pub(crate) fn size(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |metadata| metadata.len())
}

/// Returns the files to write: NAME_fmi2.fmu and NAME_fmi3.fmu in a directory, or one named file.
pub(crate) fn targets(fmi: FmiChoice, output: &Path, name: &str) -> Result<Vec<(FmiVersion, PathBuf)>> {
    let versions = match fmi {
        FmiChoice::Two => vec![FmiVersion::Two],
        FmiChoice::Three => vec![FmiVersion::Three],
        FmiChoice::Both => vec![FmiVersion::Two, FmiVersion::Three],
    };
    let is_file = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("fmu")) && !output.is_dir();
    match (is_file, versions.as_slice()) {
        (true, [version]) => Ok(vec![(*version, output.to_path_buf())]),
        (true, _) => Err(Failure::usage(
            format!("--output {}", output.display()),
            "names one file for two FMUs",
            "Give a directory, or choose one with --fmi 2 or --fmi 3",
        )),
        (false, _) => {
            let target = |version: FmiVersion| output.join(format!("{name}_fmi{}.fmu", version.digit()));
            Ok(versions.into_iter().map(|version| (version, target(version))).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distinguishes_files_from_directories() {
        let both = targets(FmiChoice::Both, Path::new("out"), "rub").unwrap();
        let paths: Vec<_> = both.iter().map(|(_, path)| path.display().to_string()).collect();
        assert_eq!(paths, ["out/rub_fmi2.fmu", "out/rub_fmi3.fmu"]);
        let one = targets(FmiChoice::Three, Path::new("a/x.fmu"), "rub").unwrap();
        assert_eq!(one, [(FmiVersion::Three, PathBuf::from("a/x.fmu"))]);
        let failure = targets(FmiChoice::Both, Path::new("x.fmu"), "rub").unwrap_err();
        assert!(failure.usage && failure.problem.contains("two FMUs"), "{failure}");
    }
}
