//! Command-line arguments of the studies.

use std::{ffi::OsStr, path::PathBuf};

use clap::Args;
use tiprub_core::Scene;
use tiprub_cosim::{Diagnostic, warning::Topic};
use tiprub_format::name_hint;
use tiprub_gallery::{rom_cache::RomCache, scene_source};
use tiprub_shell::console::Console;
use tiprub_sweep::part::Part;

/// Options of all studies.
#[derive(Debug, Args)]
pub struct StudyCommon {
    /// Output directory of the study; created if missing [default: study-STUDY].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Run a quick form of the study with few, short runs. It takes from seconds to a few minutes, depending on the study and the scene.
    /// The remaining time is printed.
    #[arg(long)]
    pub quick: bool,
    /// Changes to the scene.
    #[command(flatten)]
    pub options: SceneOptions,
    /// Cache of built-in models.
    #[command(flatten)]
    pub cache: CacheArguments,
}

impl StudyCommon {
    /// Returns the directory for all files of the study `name`.
    pub fn directory(&self, name: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| PathBuf::from(format!("study-{name}")))
    }
}

/// Arguments of `tiprub study map`.
#[derive(Debug, Args)]
pub struct MapArguments {
    /// Scene file (TOML), or a built-in scene.
    #[arg(value_name = "SCENE", default_value = "builtin:rotor37")]
    pub scene: String,
    /// Angular velocities (rad/s): first, last and count [default: 141 values from 0.8 to 1.5 times the speed at which
    /// twice the lowest engine order of the casing meets the first mode, but no higher than the largest speed of the model].
    #[arg(long, value_name = "FROM:TO:COUNT", value_parser = speeds)]
    pub speeds: Option<Speeds>,
    /// Number of parallel runs [default: one per processor].
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub threads: Option<std::num::NonZero<usize>>,
    /// Revolutions in the window of the Fourier transform; the frequency resolution is 1/N of the rotational frequency
    /// [default: 64].
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub revolutions: Option<std::num::NonZero<usize>>,
    /// Start-up revolutions before the window [default: the casing's ramp plus five decay times of the first mode, within 20 to
    /// 400].
    #[arg(long, value_name = "N", value_parser = transient)]
    pub transient: Option<usize>,
    /// Run only this part of the angular velocities, so that several machines can share them, and store the results in the
    /// output directory. The same command without --part reads the results of all parts from there, runs the missing
    /// angular velocities, and makes the map.
    #[arg(long, value_name = "K/N")]
    pub part: Option<Part>,
    /// Start value of an input or parameter, such as friction_coefficient=0 or gap_offset=1e-5; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment, allow_hyphen_values = true)]
    pub set: Vec<(String, String)>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `tiprub study error`.
#[derive(Debug, Args)]
pub struct ErrorArguments {
    /// Scene file (TOML), or a built-in scene such as `builtin:rotor37`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Window in which errors are measured, from the start of the experiment (s); it ends earlier if nearly identical
    /// runs diverge [default: until 400 communication steps after the first contact].
    #[arg(long, value_name = "T", value_parser = positive, allow_negative_numbers = true)]
    pub window: Option<f64>,
    /// Start value of an input or parameter; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment, allow_hyphen_values = true)]
    pub set: Vec<(String, String)>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `tiprub study stability`.
#[derive(Debug, Args)]
pub struct StabilityArguments {
    /// Scene file (TOML), or a built-in scene such as `builtin:rotor37`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Friction coefficients: first, last and count [default: 11 values from 0 to 1, or to twice that of the scene if
    /// larger].
    #[arg(long, value_name = "FROM:TO:COUNT", value_parser = frictions, allow_hyphen_values = true)]
    pub friction: Option<NumberRange>,
    /// Speeds (rad/s): first, last and count; negative values mean reverse rotation [default: -1, 0.5, 1 and 1.5 times that of
    /// the scene].
    #[arg(long, value_name = "FROM:TO:COUNT", value_parser = range, allow_hyphen_values = true)]
    pub speeds: Option<NumberRange>,
    /// Internal steps (s): first, last and count, logarithmically spaced [default: 9 values from 1/16 to 16 times that of
    /// the scene].
    #[arg(long, value_name = "FROM:TO:COUNT", value_parser = steps, allow_hyphen_values = true)]
    pub steps: Option<NumberRange>,
    /// Number of parallel checks [default: one per processor].
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub threads: Option<std::num::NonZero<usize>>,
    /// Start value of an input or parameter; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment, allow_hyphen_values = true)]
    pub set: Vec<(String, String)>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `tiprub study convergence`.
#[derive(Debug, Args)]
pub struct ConvergenceArguments {
    /// Scene file (TOML), or a built-in scene such as `builtin:rotor37`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Also write the ROM of the master with the errors that were determined; `tiprub run` and `tiprub inspect` print them.
    #[arg(long, value_name = "FILE")]
    pub into: Option<PathBuf>,
    /// Overwrite the --into file if it exists.
    #[arg(long, requires = "into")]
    pub force: bool,
    /// Window in which runs are compared, from the start of the experiment (s); it ends earlier if nearly identical
    /// runs diverge [default: until 400 communication steps after the first contact].
    #[arg(long, value_name = "T", value_parser = positive, allow_negative_numbers = true)]
    pub window: Option<f64>,
    /// Number of parallel runs [default: one per processor].
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub threads: Option<std::num::NonZero<usize>>,
    /// Start value of an input or parameter; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment, allow_hyphen_values = true)]
    pub set: Vec<(String, String)>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// A range of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NumberRange {
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of values, including both ends.
    pub count: usize,
}

impl NumberRange {
    /// Returns all values, ascending and evenly spaced.
    pub fn values(&self) -> Vec<f64> {
        self.shares().map(|share| self.from + (self.to - self.from) * share).collect()
    }

    /// Returns all values, ascending and evenly spaced on a logarithmic scale.
    pub fn geometric(&self) -> Vec<f64> {
        self.shares().map(|share| self.from * (self.to / self.from).powf(share)).collect()
    }

    fn shares(&self) -> impl Iterator<Item = f64> {
        let last = self.count.saturating_sub(1).max(1) as f64;
        (0..self.count).map(move |index| index as f64 / last)
    }
}

/// Parses two increasing numbers and a count of at most `most`.
fn counted(text: &str, most: usize) -> Option<NumberRange> {
    let parts: Vec<&str> = text.split(':').collect();
    let [from, to, count] = parts.as_slice() else { return None };
    let range = NumberRange { from: from.parse().ok()?, to: to.parse().ok()?, count: count.parse().ok()? };
    let growing = range.from.is_finite() && range.from < range.to && range.to.is_finite();
    (growing && (2..=most).contains(&range.count)).then_some(range)
}

/// Maximum number of values of one range, so that the map of answers stays readable.
const MOST_ANSWERS: usize = 200;

fn range(text: &str) -> Result<NumberRange, String> {
    counted(text, MOST_ANSWERS).ok_or_else(|| {
        "give two increasing numbers and a count from 2 to 200 as FROM:TO:COUNT, for example -1700:1700:5".into()
    })
}

fn frictions(text: &str) -> Result<NumberRange, String> {
    counted(text, MOST_ANSWERS).filter(|range| range.from >= 0.0).ok_or_else(|| {
        "give increasing friction coefficients (0 or more) and a count from 2 to 200 as FROM:TO:COUNT, for example \
         0:0.5:11"
            .into()
    })
}

fn steps(text: &str) -> Result<NumberRange, String> {
    counted(text, MOST_ANSWERS).filter(|range| range.from > 0.0).ok_or_else(|| {
        "give increasing positive steps in s and a count from 2 to 200 as FROM:TO:COUNT, for example 1e-7:1e-5:9".into()
    })
}

/// Range of angular velocities (rad/s).
pub type Speeds = NumberRange;

/// Changes of the command line to a scene.
#[derive(Debug, Clone, Default, Args)]
pub struct SceneOptions {
    /// Suppress warnings with this identifier, such as `flutter`; may be repeated. A packaged FMU does not log them either.
    #[arg(long, value_name = "ID", value_parser = topic)]
    pub silence: Vec<String>,
    /// Accept implausible values (tips faster than 1500 m/s, lengths that look like millimetres) with a warning.
    #[arg(long)]
    pub accept_implausible: bool,
}

impl SceneOptions {
    /// Loads a scene and sets the keys that these options change.
    ///
    /// # Errors
    /// The errors of [`scene_source::load`].
    pub fn load(&self, name: impl AsRef<OsStr>, cache: &RomCache, console: &Console) -> tiprub_shell::Result<Scene> {
        let mut scene = scene_source::load(name, cache, console)?;
        scene.settings.accept_implausible |= self.accept_implausible;
        scene.settings.silence.extend(self.silence.iter().cloned());
        Ok(scene)
    }
}

/// Parses the identifier of a warning.
fn topic(text: &str) -> Result<String, String> {
    let found = Topic::find("--silence", text).map(|topic| topic.id().to_owned());
    found.map_err(|error| {
        let Diagnostic { problem, remedy, .. } = error.into_diagnostic();
        format!("{problem}. {}{remedy}", name_hint(text, Topic::ALL.iter().map(|topic| topic.id())))
    })
}

/// Whether built-in models are kept from one command to the next.
#[derive(Debug, Clone, Default, Args)]
pub struct CacheArguments {
    /// Reduce built-in models again instead of using the cache. By default they are cached in the directory that the
    /// environment variable TIPRUB_CACHE names, or in `tiprub` in the user's cache directory.
    #[arg(long)]
    pub no_cache: bool,
}

impl CacheArguments {
    /// Returns the cache to use.
    pub fn cache(&self) -> RomCache {
        if self.no_cache { RomCache::off() } else { RomCache::of_user() }
    }
}

/// Maximum number of revolutions before the window; more would take days.
const MOST_TRANSIENT: usize = 1_000_000;

fn transient(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| *count <= MOST_TRANSIENT);
    count.ok_or_else(|| format!("give a number of revolutions, at most {MOST_TRANSIENT}"))
}

/// Parses a whole number of at least 1.
///
/// # Errors
/// The text is not a whole number of at least 1.
pub fn positive_count(text: &str) -> Result<std::num::NonZero<usize>, String> {
    text.parse().map_err(|_| "give a whole number of 1 or more".into())
}

/// Parses a positive number.
///
/// # Errors
/// The text is not a positive number.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a positive number".into()),
    }
}

/// Parses `FROM:TO:COUNT`, a range of positive angular velocities.
///
/// # Errors
/// The text is not such a range.
pub fn speeds(text: &str) -> Result<Speeds, String> {
    counted(text, 1000).filter(|speeds| speeds.from > 0.0).ok_or_else(|| {
        "give increasing positive angular velocities in rad/s and a count from 2 to 1000 as FROM:TO:COUNT, for example \
         400:1600:25"
            .into()
    })
}

/// Parses `NAME=VALUE`.
///
/// # Errors
/// The text is not such an assignment.
pub fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
            Ok((name.trim().to_string(), value.trim().to_string()))
        }
        _ => Err("give NAME=VALUE, for example speed=1700".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_invalid_or_excessive_transients() {
        assert_eq!(transient("0"), Ok(0));
        for wrong in ["1000001", "18446744073709551616", "-1", ""] {
            assert!(transient(wrong).is_err(), "{wrong}");
        }
    }
}
