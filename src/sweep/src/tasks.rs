//! Independent tasks of a study. Their results are stored in journals in one directory, so that an interrupted study continues, and several
//! machines can share its work.

use std::{
    cell::Cell as Counter,
    collections::HashMap,
    fmt::Debug,
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

use serde::{Serialize, de::DeserializeOwned};
use tiprub_core::Scene;
use tiprub_format::{LIBRARY_RELEASE, write_rom};
use tiprub_gallery::rom_cache::content_digest;
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_table::Cell;

use crate::{cases::digest_of, journal::Journal, part::Part, row::Row};

/// Names of the values in a row: the result, and the digest of everything that determines the results of all tasks.
const RESULT: &str = "result";
const SHARED: &str = "shared";
/// Suffix of the file names of journals.
const SUFFIX: &str = ".journal";

/// Journals of a study. While they are open, no other process can open them.
#[derive(Debug)]
pub struct TaskJournals {
    /// Journal to which results are appended.
    journal: Journal,
    /// Other journals of the study in the directory.
    others: Vec<Journal>,
    /// Known results (JSON) by the digest of their task.
    known: HashMap<String, String>,
    part: Part,
    /// Digest of everything that determines the results of all tasks.
    shared: String,
    /// Path of the journal to which results are appended.
    path: PathBuf,
}

/// Results of the tasks of a study.
#[derive(Debug)]
pub enum TaskResults<R> {
    /// Results of all tasks, in their order.
    All(Vec<R>),
    /// The tasks of one part are done.
    Part(FinishedPart),
}

/// Part of a study whose tasks are done.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FinishedPart {
    /// The part.
    pub part: Part,
    /// Number of tasks of the part.
    pub tasks: usize,
    /// Number of tasks of the study.
    pub all: usize,
    /// Journal with the results.
    pub journal: PathBuf,
}

impl TaskJournals {
    /// Opens or creates the journal of a part of the study `name` in a directory. The whole study also reads the journals of its parts. `shared`
    /// contains everything that determines the results of all tasks.
    ///
    /// # Errors
    /// A file cannot be read or written, is not a journal, belongs to a study with other options, or another process has it open.
    pub fn open(directory: &Path, name: &str, part: Part, shared: &[String]) -> Result<Self> {
        let path = directory.join(format!("{name}{}{SUFFIX}", part.file_suffix()));
        let shared = digest_of([name, LIBRARY_RELEASE].into_iter().chain(shared.iter().map(String::as_str)));
        let open = |path: &Path| {
            let (journal, rows) = Journal::open(path)?;
            let is_same_study = |row: &Row| matches!(row.cell(SHARED), Some(Cell::Text(digest)) if *digest == shared);
            if rows.iter().all(is_same_study) {
                return Ok((journal, rows));
            }
            let problem = format!(
                "contains {} results of this study with another scene, other options or another release",
                rows.len()
            );
            let remedy =
                "Use the scene, options and release of the file, give another directory with --out, or remove the file";
            Err(Failure::new(path.display(), problem, remedy))
        };
        let (journal, mut rows) = open(&path)?;
        let mut others = Vec::new();
        if part == Part::WHOLE {
            for other in file_names(directory)? {
                let suffix = other.strip_prefix(name).and_then(|rest| rest.strip_suffix(SUFFIX));
                if suffix.is_some_and(|suffix| suffix.starts_with('-')) {
                    let (journal, found) = open(&directory.join(other))?;
                    others.push(journal);
                    rows.extend(found);
                }
            }
        }
        let result = |row: Row| match row.cell(RESULT) {
            Some(Cell::Text(json)) => Some((row.digest.clone(), json.clone())),
            _ => None,
        };
        let known = rows.into_iter().filter_map(result).collect();
        Ok(Self { journal, others, known, part, shared, path })
    }

    /// Runs the tasks of the part that have no result yet, on `threads` threads. `kind` distinguishes tasks with equal values. `progress` receives
    /// the number of finished tasks, including those with a stored result: after every task, and a few times per second between tasks. A result that
    /// JSON cannot represent is not stored.
    ///
    /// # Errors
    /// A task fails (the first failure is returned), or a journal cannot be written.
    pub fn run<T: Debug + Sync, R: Serialize + DeserializeOwned + Send>(
        &mut self,
        kind: &str,
        items: &[T],
        threads: usize,
        work: impl Fn(&T) -> Result<R> + Sync,
        console: &Console,
        progress: impl Fn(usize),
    ) -> Result<TaskResults<R>> {
        let digests: Vec<String> =
            items.iter().map(|item| digest_of([&self.shared, kind, &format!("{item:?}")].into_iter())).collect();
        let known = |digest: &String| self.known.get(digest).and_then(|json| serde_json::from_str(json).ok());
        let mut results: Vec<Option<R>> = digests.iter().map(known).collect();
        let range = self.part.runs(items.len());
        let pending: Vec<usize> = range.clone().filter(|task| results[*task].is_none()).collect();
        let done = Counter::new(range.len() - pending.len());
        if done.get() > 0 {
            let done = done.get();
            console.print_progress(format_args!("{done} of {} runs are already finished", range.len()));
        }
        progress(done.get());
        let (stop, mut failed) = (AtomicBool::new(false), None);
        let finished = |index: usize, result: Result<R>| {
            let (task, result) = match result {
                Ok(result) => (pending[index], result),
                Err(failure) => {
                    // Tasks in progress are completed and stored.
                    stop.store(true, Ordering::Relaxed);
                    failed.get_or_insert(failure);
                    return Ok(());
                }
            };
            let json = serde_json::to_string(&result).unwrap_or_default();
            if serde_json::from_str::<R>(&json).is_ok() {
                let cells =
                    vec![(SHARED.to_owned(), Cell::Text(self.shared.clone())), (RESULT.to_owned(), Cell::Text(json))];
                self.journal.append(&Row { digest: digests[task].clone(), cells })?;
            }
            results[task] = Some(result);
            done.set(done.get() + 1);
            progress(done.get());
            Ok(())
        };
        sweep::for_each(&pending, threads, &stop, |task| work(&items[*task]), finished, || progress(done.get()))?;
        if let Some(failure) = failed {
            return Err(failure);
        }
        if self.part != Part::WHOLE {
            let (part, journal) = (self.part, self.path.clone());
            return Ok(TaskResults::Part(FinishedPart { part, tasks: range.len(), all: items.len(), journal }));
        }
        let lost = || Failure::new("study", "a worker thread ended unexpectedly", "Report this to the developers");
        results.into_iter().map(|result| result.ok_or_else(lost)).collect::<Result<_>>().map(TaskResults::All)
    }

    /// Removes the journals, after the results of the study have been written.
    ///
    /// # Errors
    /// A file cannot be removed.
    pub fn remove(self) -> Result<()> {
        self.others.into_iter().chain([self.journal]).try_for_each(Journal::remove)
    }
}

/// Returns the names of the files of a directory.
fn file_names(directory: &Path) -> Result<Vec<String>> {
    let failed = |error: std::io::Error| Failure::file(directory, "cannot be read", &error);
    let entries = fs::read_dir(directory).map_err(failed)?.collect::<std::io::Result<Vec<_>>>().map_err(failed)?;
    Ok(entries.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect())
}

/// Returns a digest of the settings and the ROMs of a scene.
pub fn scene_digest(scene: &Scene) -> String {
    // The debug form is complete, and its numbers read back to the same bits.
    let settings = format!("{:?}", scene.settings);
    let roms: Vec<String> = scene.roms.iter().map(|rom| content_digest(&write_rom(rom))).collect();
    digest_of([settings.as_str()].into_iter().chain(roms.iter().map(String::as_str)))
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// Squares numbers, and also returns those for which the task ran.
    fn squares(directory: &Path, part: Part, shared: &str, items: &[f64]) -> (Result<TaskResults<f64>>, Vec<f64>) {
        let tried = Mutex::new(Vec::new());
        let work = |item: &f64| {
            tried.lock().unwrap().push(*item);
            if *item < 0.0 { Err(Failure::new("run", "diverged", "")) } else { Ok(item * item) }
        };
        let console = Console::new(true, false);
        let mut journals = TaskJournals::open(directory, "map", part, &[shared.to_owned()]).unwrap();
        let results = journals.run("square", items, 2, work, &console, |_| {});
        let mut tried = tried.into_inner().unwrap();
        tried.sort_by(f64::total_cmp);
        (results, tried)
    }

    fn all(results: Result<TaskResults<f64>>) -> Vec<f64> {
        match results {
            Ok(TaskResults::All(results)) => results,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn failed_study_continues_without_repeating_tasks() {
        let root = tempfile::tempdir().unwrap();
        let items: Vec<f64> = (1..=20).map(|item| f64::from(item) / 3.0).collect();
        let mut broken = items.clone();
        broken[15] = -1.0;
        let (failed, first) = squares(root.path(), Part::WHOLE, "scene", &broken);
        assert_eq!(failed.unwrap_err().problem, "diverged");
        let (results, second) = squares(root.path(), Part::WHOLE, "scene", &items);
        let expected: Vec<f64> = items.iter().map(|item| item * item).collect();
        assert_eq!(all(results), expected);
        // Every task ran once.
        let mut tried = [first, second].concat();
        tried.retain(|item| *item > 0.0);
        tried.sort_by(f64::total_cmp);
        assert_eq!(tried, items);
        // The results of this scene are neither used for another scene nor lost.
        let other = TaskJournals::open(root.path(), "map", Part::WHOLE, &["another scene".to_owned()]).unwrap_err();
        assert!(other.problem.contains("20 results"), "{other}");
        let (results, third) = squares(root.path(), Part::WHOLE, "scene", &items);
        assert_eq!((all(results), third), (expected, Vec::new()));
    }

    #[test]
    fn parts_are_combined_and_missing_tasks_run() {
        let root = tempfile::tempdir().unwrap();
        let items: Vec<f64> = (0..10).map(f64::from).collect();
        for number in [1, 3] {
            let part = Part::new(number, 3).unwrap();
            let (results, tried) = squares(root.path(), part, "scene", &items);
            let Ok(TaskResults::Part(finished)) = results else { panic!("{results:?}") };
            assert_eq!((finished.tasks, finished.all), (tried.len(), 10));
            assert!(finished.journal.ends_with(format!("map-{number}-of-3.journal")), "{finished:?}");
        }
        let (results, tried) = squares(root.path(), Part::WHOLE, "scene", &items);
        assert_eq!(all(results), items.iter().map(|item| item * item).collect::<Vec<_>>());
        assert_eq!(tried, [3.0, 4.0, 5.0]);
        let journals = TaskJournals::open(root.path(), "map", Part::WHOLE, &["scene".to_owned()]).unwrap();
        assert_eq!(journals.others.len(), 2);
        journals.remove().unwrap();
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
    }

    #[test]
    fn infinite_results_are_returned_but_not_stored() {
        let root = tempfile::tempdir().unwrap();
        for _ in 0..2 {
            let (results, tried) = squares(root.path(), Part::WHOLE, "scene", &[1.0 / 3.0, 1e200]);
            let third = 1.0_f64 / 3.0;
            assert_eq!(all(results), [third * third, f64::INFINITY]);
            assert!(tried.contains(&1e200));
        }
    }
}
