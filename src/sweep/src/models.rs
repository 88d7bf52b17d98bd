//! ROMs of a sweep, each read or reduced once.

use std::{
    cell::Cell,
    collections::HashMap,
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
};

use tiprub_core::Rom;
use tiprub_gallery::{
    builtin,
    rom_cache::{RomCache, content_digest, model_digest},
    scene_source::{self, SceneText},
};
use tiprub_shell::{Failure, Result, console::Console};

/// Sources of scenes and models that the program provides.
pub trait SweepSources: Sync {
    /// Returns the text of a scene, an FMU or a built-in scene.
    ///
    /// # Errors
    /// The file cannot be read, or is neither a scene nor an FMU with one.
    fn scene(&self, argument: &str) -> Result<SceneText>;

    /// Checks the arguments of `tiprub reduce` and returns the files that this command reads. `directory` is that of the plan.
    ///
    /// # Errors
    /// The arguments are wrong.
    fn reduction_files(&self, arguments: &str, directory: &Path) -> Result<Vec<PathBuf>>;

    /// Reduces the model of these arguments of `tiprub reduce`.
    ///
    /// # Errors
    /// The model cannot be reduced.
    fn reduce(&self, arguments: &str, directory: &Path, console: &Console) -> Result<Rom>;
}

/// Origin of a ROM.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum RomOrigin {
    /// Built-in model of this name.
    Builtin(String),
    /// ROM file.
    File(PathBuf),
    /// Arguments of `tiprub reduce`.
    Reduction(String),
}

impl RomOrigin {
    /// Returns the origin of the `rom` entry of a scene in this directory.
    pub fn of_scene(entry: &str, directory: &Path) -> Self {
        match entry.strip_prefix(scene_source::BUILTIN) {
            Some(name) => Self::Builtin(name.to_owned()),
            None => Self::File(directory.join(entry)),
        }
    }
}

impl fmt::Display for RomOrigin {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Builtin(name) => write!(out, "{}{name}", scene_source::BUILTIN),
            Self::File(path) => write!(out, "{}", path.display()),
            Self::Reduction(arguments) => write!(out, "tiprub reduce {arguments}"),
        }
    }
}

/// Digest of a ROM, and the ROM once it is needed.
struct StoredRom {
    /// SHA-256 of everything that determines the ROM.
    digest: String,
    /// ROM, or the reason why there is none.
    loaded: Option<Result<Arc<Rom>>>,
}

/// ROMs of a sweep. A ROM is identified by its content or by everything that determines it, and is loaded when the first run needs it.
pub struct RomStore<'a> {
    sources: &'a dyn SweepSources,
    /// Directory of the plan.
    directory: PathBuf,
    cache: &'a RomCache,
    /// Cache of the models that the plan reduces.
    reduced: RomCache,
    roms: HashMap<RomOrigin, StoredRom>,
}

/// Returns the digest of the content of a file, or the reason why it cannot be read.
fn file_digest(content: &std::io::Result<Vec<u8>>) -> String {
    content.as_ref().map_or_else(|error| format!("unreadable: {error}"), |bytes| content_digest(bytes))
}

/// Checks that a model still has the digest that is part of the digests of its runs.
fn check_unchanged(origin: &RomOrigin, before: &str, now: &str) -> Result<()> {
    if before == now {
        return Ok(());
    }
    let remedy = "Start the sweep again, and leave the files of the plan unchanged until it ends";
    Err(Failure::new(origin, "has changed since the sweep began", remedy))
}

/// First word of the names of files in the directory of reduced models.
const CACHED_NAME: &str = "model";

impl<'a> RomStore<'a> {
    /// Creates an empty store. `directory` is that of the plan; models that the plan reduces are cached in the directory `reduced`.
    pub fn new(sources: &'a dyn SweepSources, directory: &Path, cache: &'a RomCache, reduced: &Path) -> Self {
        let (directory, reduced) = (directory.to_owned(), RomCache::at(reduced));
        Self { sources, directory, cache, reduced, roms: HashMap::new() }
    }

    /// Returns the digest of a ROM. It is not reduced for this.
    ///
    /// # Errors
    /// The arguments of a reduction are wrong. A ROM file that cannot be read is no error here, but of each run that needs it.
    pub fn digest(&mut self, origin: &RomOrigin) -> Result<String> {
        if let Some(stored) = self.roms.get(origin) {
            return Ok(stored.digest.clone());
        }
        let digest = match origin {
            RomOrigin::Builtin(name) => model_digest(name, &"built-in"),
            RomOrigin::File(path) => file_digest(&tiprub_format::read_file(path, tiprub_format::LARGEST_ROM)),
            RomOrigin::Reduction(arguments) => self.reduction_digest(arguments)?,
        };
        self.roms.insert(origin.clone(), StoredRom { digest: digest.clone(), loaded: None });
        Ok(digest)
    }

    fn reduction_digest(&self, arguments: &str) -> Result<String> {
        let files = self.sources.reduction_files(arguments, &self.directory)?;
        let content = |path: &PathBuf| file_digest(&tiprub_format::read_file(path, tiprub_format::LARGEST_ROM));
        Ok(model_digest(arguments, &files.iter().map(content).collect::<Vec<String>>()))
    }

    /// Reads or reduces a ROM, unless this has been done. A failure is kept for the runs that need the ROM.
    ///
    /// # Errors
    /// The errors of [`RomStore::digest`], or a file has changed since its digest was computed.
    pub fn load(&mut self, origin: &RomOrigin, console: &Console) -> Result<()> {
        let digest = self.digest(origin)?;
        if self.roms.get(origin).is_some_and(|stored| stored.loaded.is_some()) {
            return Ok(());
        }
        let rom = match origin {
            RomOrigin::Builtin(name) => builtin::rom(name, self.cache, console).unwrap_or_else(|| {
                let remedy = builtin::unknown_model_remedy(name);
                Err(Failure::new(origin, "there is no such built-in model", remedy))
            }),
            RomOrigin::File(path) => {
                let bytes = tiprub_format::read_file(path, tiprub_format::LARGEST_ROM);
                check_unchanged(origin, &digest, &file_digest(&bytes))?;
                let bytes = bytes.map_err(|error| Failure::file(path, "cannot be read", &error));
                bytes.and_then(|bytes| Ok(tiprub_format::read_rom(&bytes, &path.display().to_string())?))
            }
            RomOrigin::Reduction(arguments) => {
                let has_changed = Cell::new(false);
                let reduce = || {
                    let rom = self.sources.reduce(arguments, &self.directory, console);
                    let unchanged = check_unchanged(origin, &digest, &self.reduction_digest(arguments)?);
                    has_changed.set(unchanged.is_err());
                    unchanged.and(rom)
                };
                // The messages of this cache refer to options of built-in models.
                let quiet = Console::new(true, false);
                let rom = self.reduced.get(&format!("{CACHED_NAME}-{}", &digest[..12]), &digest, &quiet, &reduce);
                if has_changed.get() {
                    return rom.map(drop);
                }
                rom
            }
        };
        self.roms.insert(origin.clone(), StoredRom { digest, loaded: Some(rom.map(Arc::new)) });
        Ok(())
    }

    /// Returns a loaded ROM.
    ///
    /// # Errors
    /// The ROM cannot be read or reduced.
    pub fn get(&self, origin: &RomOrigin) -> Result<Arc<Rom>> {
        let loaded = self.roms.get(origin).and_then(|stored| stored.loaded.clone());
        loaded.unwrap_or_else(|| Err(Failure::new(origin, "is not loaded", "Report this to the developers")))
    }

    /// Removes the cached models that the plan reduced, with their directory.
    pub fn remove_reduced(&self) {
        let Some(directory) = self.reduced.directory() else { return };
        let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
        let is_cached = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            name.starts_with(&format!("{CACHED_NAME}-")) && name.ends_with(".rom")
        };
        for path in entries.map(|entry| entry.path()).filter(is_cached) {
            let _ = std::fs::remove_file(path);
        }
        // Fails if other files are in the directory, which then remain.
        let _ = std::fs::remove_dir(directory);
    }
}
