//! Cache of reduced built-in models, and of the results of slow checks of scenes, in the user's cache directory.
//!
//! The key of a file consists of everything that determines its content: the options of the model, the sources, the release and the file format. A
//! file is always verified: its first line repeats the key and states the SHA-256 of the ROM file that follows; if either does not match, the model
//! is reduced again. Files are written completely or not at all, so that two processes may fill the cache at the same time. A cache that cannot be
//! written does not stop the work.

use std::{
    fmt::Debug,
    fs,
    path::{Path, PathBuf},
    time::SystemTime,
};

use etcetera::BaseStrategy;
use sha2::{Digest, Sha256};
use tiprub_core::{Rom, Scene, Simulation};
use tiprub_field::shape_file;
use tiprub_model::{Reduction, SurfaceShapes, cyclic::CyclicReduction};
use tiprub_shell::{Result, console::Console, output_file};

/// Version of the layout of cached files.
const LAYOUT: &str = "1";
/// First word of a cached file.
const MARK: &str = "tiprub-cached-rom";
/// Environment variable for the directory; if it is empty, the cache is off.
const VARIABLE: &str = "TIPRUB_CACHE";
/// Largest file (bytes): the first line and a ROM.
const LARGEST: u64 = tiprub_format::LARGEST_ROM + (1 << 10);
/// Number of versions of one model that are cached: several options and releases may be in use side by side.
const MAX_VERSIONS: usize = 4;
/// Number of surfaces of one model that are cached.
const MAX_SHAPE_FILES: usize = 2;
/// Prefix and suffix of the names of files with results of checks, and the maximum number of these files.
const CHECKS_PREFIX: &str = "scene";
const CHECKS_SUFFIX: &str = ".checks";
const MAX_CHECK_FILES: usize = 16;

/// Maximum number of cached check results of a scene; one run has up to a few hundred.
const MAX_CHECKS: usize = 1 << 14;

/// Model to cache.
#[derive(Debug, Clone, PartialEq)]
pub struct CachedModel {
    /// Reduced-order model.
    pub rom: Rom,
    /// Surface with its displacements per reduced coordinate, if it is to be cached.
    pub shapes: Option<SurfaceShapes>,
}

impl From<Rom> for CachedModel {
    fn from(rom: Rom) -> Self {
        Self { rom, shapes: None }
    }
}

impl From<Reduction> for CachedModel {
    fn from(Reduction { rom, shapes, .. }: Reduction) -> Self {
        Self { rom, shapes }
    }
}

impl From<CyclicReduction> for CachedModel {
    fn from(CyclicReduction { rom, shapes, .. }: CyclicReduction) -> Self {
        Self { rom, shapes }
    }
}

/// Cache directory, if there is one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RomCache {
    directory: Option<PathBuf>,
}

impl RomCache {
    /// Returns a cache that stores and finds nothing.
    pub fn off() -> Self {
        Self { directory: None }
    }

    /// Returns a cache in this directory.
    pub fn at(directory: impl Into<PathBuf>) -> Self {
        Self { directory: Some(directory.into()) }
    }

    /// Returns the cache in the directory that the environment variable TIPRUB_CACHE names (off if it is empty), else in `tiprub` in the user's
    /// cache directory (XDG_CACHE_HOME, ~/.cache, or the equivalent of the system).
    pub fn of_user() -> Self {
        match std::env::var_os(VARIABLE) {
            Some(directory) if directory.is_empty() => Self::off(),
            Some(directory) => Self::at(directory),
            None => {
                Self { directory: etcetera::choose_base_strategy().ok().map(|base| base.cache_dir().join("tiprub")) }
            }
        }
    }

    /// Returns the cache directory; `None` if the cache is off.
    pub fn directory(&self) -> Option<&Path> {
        self.directory.as_deref()
    }

    /// Returns the model `name` with these options from the cache, or calls `make` and caches the result.
    ///
    /// # Errors
    /// The errors of `make`.
    pub fn get(
        &self,
        name: &str,
        options: &dyn Debug,
        console: &Console,
        make: &dyn Fn() -> Result<Rom>,
    ) -> Result<Rom> {
        self.get_model(name, options, console, &|| make().map(CachedModel::from))
    }

    /// Returns a model as [`RomCache::get`] does; caches its surface, too.
    ///
    /// # Errors
    /// The errors of `make`.
    pub(crate) fn get_model(
        &self,
        name: &str,
        options: &dyn Debug,
        console: &Console,
        make: &dyn Fn() -> Result<CachedModel>,
    ) -> Result<Rom> {
        let Some(directory) = &self.directory else { return Ok(make()?.rom) };
        let key = key(name, options);
        let path = directory.join(format!("{name}-{}.rom", &key[..32]));
        match read(&path, &key) {
            Ok(rom) => {
                console.print_progress(format_args!(
                    "Using the cached model {name} from {} (use --no-cache to reduce it again)",
                    path.display()
                ));
                return Ok(rom);
            }
            Err(Some(problem)) => {
                console.print_progress(format_args!("{}: {problem}; reducing the model again", path.display()));
            }
            Err(None) => {}
        }
        let CachedModel { rom, shapes } = make()?;
        if let Some(shapes) = &shapes {
            self.keep_shapes(name, &rom, shapes, console);
        }
        let kept = output_file::only_a_file(&path).and_then(|()| output_file::write(&path, content(&rom, &key)));
        if let Err(failure) = kept {
            console.print_progress(format_args!("Model {name} is not cached: {failure}"));
        }
        prune(directory, name, ".rom", MAX_VERSIONS);
        Ok(rom)
    }

    /// Returns the cached surface of the model `name` with this ROM; `None` if there is none, or if it is damaged.
    pub fn shapes(&self, name: &str, rom: &Rom) -> Option<SurfaceShapes> {
        shape_file::read(&self.shapes_path(name, rom)?, rom).ok()
    }

    /// Caches the surface of a model. If the file cannot be written, the work continues without it.
    pub(crate) fn keep_shapes(&self, name: &str, rom: &Rom, shapes: &SurfaceShapes, console: &Console) {
        let (Some(directory), Some(path)) = (&self.directory, self.shapes_path(name, rom)) else { return };
        let kept =
            output_file::only_a_file(&path).and_then(|()| output_file::write(&path, shape_file::write(shapes, rom)));
        if let Err(failure) = kept {
            console.print_progress(format_args!("The surface of model {name} is not cached: {failure}"));
        }
        prune(directory, name, shape_file::SUFFIX, MAX_SHAPE_FILES);
    }

    fn shapes_path(&self, name: &str, rom: &Rom) -> Option<PathBuf> {
        let digest = shape_file::rom_digest(rom);
        Some(self.directory.as_ref()?.join(format!("{name}-{}{}", &digest[..32], shape_file::SUFFIX)))
    }

    /// Returns the results of slow checks of earlier runs of a scene, for
    /// [`Simulation::use_checks`](tiprub_core::Simulation::use_checks); empty if none are cached.
    pub fn checks(&self, scene: &Scene) -> Vec<u8> {
        let read = |path: PathBuf| {
            // Reading a pipe might block.
            let file = fs::metadata(&path).is_ok_and(|data| data.is_file());
            file.then(|| tiprub_format::read_file(&path, tiprub_format::LARGEST_CHECKS).ok()).flatten()
        };
        let file = self.checks_path(scene).and_then(read).unwrap_or_default();
        tiprub_format::read_checks(&file).to_vec()
    }

    /// Adds the results of slow checks to those of earlier runs of a scene, which may have had other parameters. If two processes write the file at
    /// the same time, only the results of one process are kept. If the file cannot be written, the run continues without it.
    pub fn keep_checks(&self, scene: &Scene, checks: &[u8]) {
        let (Some(directory), Some(path)) = (&self.directory, self.checks_path(scene)) else { return };
        let stored = self.checks(scene);
        let merged = Simulation::merge_checks(checks, &stored, MAX_CHECKS);
        if merged == stored {
            return;
        }
        let _ = output_file::only_a_file(&path)
            .and_then(|()| output_file::write(&path, tiprub_format::write_checks(&merged)));
        prune(directory, CHECKS_PREFIX, CHECKS_SUFFIX, MAX_CHECK_FILES);
    }

    /// Returns the path of the file of a scene. Each result in the file has a separate key, which includes models and
    /// parameters.
    fn checks_path(&self, scene: &Scene) -> Option<PathBuf> {
        let key = digest(format!("{:?}", scene.settings).as_bytes());
        Some(self.directory.as_ref()?.join(format!("{CHECKS_PREFIX}-{}{CHECKS_SUFFIX}", &key[..32])))
    }
}

/// Returns a digest of everything that determines a model that this program reduces: its name, its options, the sources of the reduction, the release
/// and the kind of processor.
pub fn model_digest(name: &str, options: &dyn Debug) -> String {
    key(name, options)
}

/// Returns the key: everything that determines a model. The debug form of options is complete, and its numbers read back to the same bits.
fn key(name: &str, options: &dyn Debug) -> String {
    let versions = [LAYOUT, env!("CARGO_PKG_VERSION"), env!("TIPRUB_MODEL_SOURCES"), std::env::consts::ARCH];
    let mut hash = Sha256::new();
    for item in versions.into_iter().chain([name, &format!("{options:?}")]) {
        hash.update((item.len() as u64).to_le_bytes());
        hash.update(item);
    }
    hexadecimal(hash)
}

/// Returns the SHA-256 of bytes as hexadecimal digits.
pub fn content_digest(bytes: &[u8]) -> String {
    digest(bytes)
}

fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn digest(bytes: &[u8]) -> String {
    hexadecimal(Sha256::new_with_prefix(bytes))
}

fn content(rom: &Rom, key: &str) -> Vec<u8> {
    let bytes = tiprub_format::write_rom(rom);
    let first = format!("{MARK} {LAYOUT} {key} {}\n", digest(&bytes));
    [first.as_bytes(), &bytes].concat()
}

/// Reads the ROM in the file; `Err(None)` if there is no file, otherwise the problem of the file.
fn read(path: &Path, key: &str) -> Result<Rom, Option<String>> {
    let unreadable = |error: std::io::Error| {
        (error.kind() != std::io::ErrorKind::NotFound).then(|| format!("cannot be read ({error})"))
    };
    // Reading a pipe might block.
    if !fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(Some("is not a file".to_owned()));
    }
    let bytes = tiprub_format::read_file(path, LARGEST).map_err(unreadable)?;
    let damaged = || Some("is damaged".to_owned());
    let end = bytes.iter().position(|byte| *byte == b'\n').ok_or_else(damaged)?;
    let (first, rom) = (&bytes[..end], &bytes[end + 1..]);
    if first != format!("{MARK} {LAYOUT} {key} {}", digest(rom)).as_bytes() {
        return Err(damaged());
    }
    tiprub_format::read_rom(rom, &path.display().to_string()).map_err(|error| Some(error.to_string()))
}

/// Removes all versions of a file except the newest `kept`. Ignores files that cannot be removed.
fn prune(directory: &Path, name: &str, end: &str, kept: usize) {
    let Ok(entries) = fs::read_dir(directory) else { return };
    let is_version = |path: &Path| {
        let file = path.file_name().and_then(|file| file.to_str()).unwrap_or_default();
        let key = file.strip_prefix(name).and_then(|rest| rest.strip_prefix('-')?.strip_suffix(end));
        key.is_some_and(|key| key.len() == 32 && key.bytes().all(|byte| byte.is_ascii_hexdigit()))
    };
    let mut versions: Vec<(SystemTime, PathBuf)> = entries
        .flatten()
        .filter(|entry| is_version(&entry.path()))
        .filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path())))
        .collect();
    versions.sort();
    for (_, path) in versions.iter().rev().skip(kept) {
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use nalgebra::DMatrix;
    use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomChecks, RomExtras};

    use super::*;
    use tiprub_shell::Failure;

    fn rom(stiffness: f64) -> Rom {
        Rom {
            name: "spring".into(),
            origin: String::new(),
            sectors: 3,
            frame: DisplacementFrame::Cylindrical,
            mass: DMatrix::identity(3, 3),
            stiffness: DMatrix::identity(3, 3) * stiffness,
            damping_ratio: 0.0,
            contact_map: DMatrix::identity(3, 3),
            contact_nodes: vec![ContactNode {
                name: "tip".into(),
                position: [0.2, 0.0, 0.0],
                meridional_slope: 0.0,
                ..ContactNode::default()
            }],
            checks: RomChecks::default(),
            extras: RomExtras::default(),
        }
    }

    /// Cache in a temporary directory that counts how often a model is made; its options are the stiffness.
    struct Bench {
        root: tempfile::TempDir,
        made: Cell<usize>,
    }

    impl Bench {
        fn new() -> Self {
            Self { root: tempfile::tempdir().unwrap(), made: Cell::new(0) }
        }

        #[track_caller]
        fn get(&self, name: &str, stiffness: f64) {
            let make = || {
                self.made.set(self.made.get() + 1);
                Ok(rom(stiffness))
            };
            let cache = RomCache::at(self.root.path());
            assert_eq!(cache.get(name, &stiffness, &Console::new(true, false), &make), Ok(rom(stiffness)));
        }

        fn files(&self) -> Vec<PathBuf> {
            let mut files: Vec<_> =
                fs::read_dir(self.root.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
            files.sort();
            files
        }
    }

    #[test]
    fn model_is_reduced_once_per_name_and_options() {
        let bench = Bench::new();
        for (name, stiffness, made) in
            [("a", 1.0, 1), ("a", 1.0, 1), ("a", 1.0 + f64::EPSILON, 2), ("b", 1.0, 3), ("a", 1.0, 3), ("b", 1.0, 3)]
        {
            bench.get(name, stiffness);
            assert_eq!(bench.made.get(), made, "{name} {stiffness}");
        }
        assert_eq!(bench.files().len(), 3);
    }

    #[test]
    fn damaged_cache_files_never_give_a_wrong_model() {
        let bench = Bench::new();
        bench.get("a", 1.0);
        let path = &bench.files()[0];
        let good = fs::read(path).unwrap();
        let line = good.iter().position(|byte| *byte == b'\n').unwrap();
        // The file is complete and valid, but for other options.
        let other = content(&rom(9.0), &key("a", &9.0));
        let mut damaged = vec![good[..good.len() / 2].to_vec(), Vec::new(), b"hello".to_vec(), other];
        damaged.push([&good[..line], &tiprub_format::write_rom(&rom(9.0))].concat());
        damaged.push(tiprub_format::write_rom(&rom(9.0)));
        for index in (0..good.len()).step_by(37) {
            let mut bytes = good.clone();
            bytes[index] ^= 1;
            damaged.push(bytes);
        }
        for (bytes, count) in damaged.iter().zip(2..) {
            fs::write(path, bytes).unwrap();
            bench.get("a", 1.0);
            assert_eq!(bench.made.get(), count);
            assert_eq!(fs::read(path).unwrap(), good, "the file is made good again");
        }
    }

    #[test]
    fn caches_no_failures_and_works_without_a_cache() {
        let root = tempfile::tempdir().unwrap();
        let console = Console::new(true, false);
        let failure = || Err(Failure::new("a", "b", "c"));
        assert_eq!(RomCache::at(root.path()).get("a", &1, &console, &failure), failure());
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
        let file = root.path().join("file");
        fs::write(&file, "").unwrap();
        let made = RomCache::at(file.join("below")).get("a", &1, &console, &|| Ok(rom(1.0)));
        assert_eq!(made, Ok(rom(1.0)));
    }

    #[cfg(unix)]
    #[test]
    fn named_pipe_in_the_cache_does_not_block() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join(format!("a-{}.rom", &key("a", &1)[..32]));
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let (done, answer) = std::sync::mpsc::channel();
        let cache = RomCache::at(root.path());
        std::thread::spawn(move || {
            let refused = read(&path, &key("a", &1)).unwrap_err();
            let taken = cache.get("a", &1, &Console::new(true, false), &|| Ok(rom(1.0)));
            done.send((refused, taken)).is_ok()
        });
        let (refused, made) = answer.recv_timeout(std::time::Duration::from_secs(20)).expect("an answer");
        assert_eq!((refused.as_deref(), made), (Some("is not a file"), Ok(rom(1.0))));
    }

    #[test]
    fn old_versions_are_removed_and_other_models_kept() {
        let bench = Bench::new();
        bench.get("a-fine", 0.5);
        for version in 0..MAX_VERSIONS + 3 {
            bench.get("a", version as f64);
        }
        assert_eq!(bench.files().len(), MAX_VERSIONS + 1);
        assert!(bench.files()[MAX_VERSIONS].file_name().unwrap().to_str().unwrap().starts_with("a-fine"));
    }

    #[test]
    fn disabled_cache_still_returns_the_model() {
        let made = RomCache::off().get("a", &1, &Console::new(true, false), &|| Ok(rom(1.0)));
        assert_eq!(made, Ok(rom(1.0)));
    }
}
