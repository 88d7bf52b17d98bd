//! Runs a part of a plan on several threads.

mod names;
mod worker;

use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

use tiprub_gallery::rom_cache::{RomCache, content_digest};
use tiprub_shell::{
    Failure, Result,
    console::Console,
    forecast::{Forecast, WorkPlan},
    sweep,
};
use tiprub_table::parquet_file;

use crate::{
    cases::{Case, CaseDigest},
    histories::{self, History, HistoryJournal},
    journal::Journal,
    models::{RomStore, SweepSources},
    part::Part,
    plan::Plan,
    plan_digest::{PLAN_FACT, check_results, plan_facts},
    result_file::{self, ROWS_FACT},
    row::{Row, Status},
};
use worker::Worker;

/// Request of a part of a sweep.
pub struct SweepRequest<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The part to run.
    pub part: Part,
    /// Parquet file to write.
    pub output: &'a Path,
    /// Number of runs at the same time.
    pub threads: usize,
    /// True once no new run may begin.
    pub stop: &'a AtomicBool,
    /// Scenes and models.
    pub sources: &'a dyn SweepSources,
    /// Cache of built-in models and of slow checks.
    pub cache: &'a RomCache,
    /// Destination of progress.
    pub console: &'a Console,
}

/// Files of a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepFiles {
    /// Results, one row per run.
    pub rows: PathBuf,
    /// Outputs over time, if the plan requests them.
    pub histories: PathBuf,
    /// Journal of rows; exists until the part is complete.
    pub journal: PathBuf,
    /// Journal of outputs over time; exists until the part is complete.
    pub history_journal: PathBuf,
    /// Directory of the models that the plan reduces; exists until the part is complete.
    pub models: PathBuf,
}

impl SweepFiles {
    /// Returns the files beside the results `output`.
    pub fn new(output: &Path) -> Self {
        let beside = |suffix: &str| {
            let name = output.file_name().unwrap_or_default().to_string_lossy();
            output.with_file_name(format!("{name}.{suffix}"))
        };
        Self {
            rows: output.to_owned(),
            histories: match output.extension() {
                Some(kind) if kind == "parquet" => output.with_extension("histories.parquet"),
                _ => beside("histories.parquet"),
            },
            journal: beside("journal"),
            history_journal: beside("histories-journal"),
            models: beside("models"),
        }
    }
}

/// Outcome of a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepOutcome {
    /// Runs of the plan.
    pub plan_runs: usize,
    /// Runs of the part.
    pub runs: usize,
    /// Runs of the part that were done before.
    pub resumed: usize,
    /// Runs that took all steps.
    pub finished: usize,
    /// Runs that were rejected before the first step.
    pub refused: usize,
    /// Runs in which a step failed.
    pub failed: usize,
    /// Reasons of refusals and failures, with the number of the first run (from 1) and the number of runs.
    pub reasons: Vec<(String, usize, usize)>,
    /// Number of runs with at least one warning or note.
    pub runs_with_warnings: usize,
    /// Identifiers of the warnings, with the number of the first run (from 1) and the number of runs.
    pub warnings: Vec<(String, usize, usize)>,
    /// False if the part was interrupted; its rows are then in the journal.
    pub is_complete: bool,
}

/// Runs a part, unless its results exist, and writes them. Runs that were done before are not repeated.
///
/// # Errors
/// A variable does not exist, a reduction has wrong arguments, or a file cannot be written. Rejected and failed runs are rows, not errors.
pub fn run(request: &SweepRequest) -> Result<SweepOutcome> {
    let (mut part, created) = PartRun::prepare(request)?;
    if !part.pending.is_empty() || part.results.is_empty() {
        part.check_names().inspect_err(|_| remove(&created))?;
    }
    part.run_pending()?;
    part.complete()
}

/// Numbers of runs that have the same text, such as a reason or the identifier of a warning.
#[derive(Debug, Default)]
struct RunsByText {
    /// Each text with the number of its first run (from 1) and its number of runs.
    texts: Vec<(String, usize, usize)>,
    /// Index of each text in `texts`.
    places: HashMap<String, usize>,
}

impl RunsByText {
    /// Counts a run that has this text.
    fn add(&mut self, text: &str, run: usize) {
        let place = *self.places.entry(text.to_owned()).or_insert(self.texts.len());
        match self.texts.get_mut(place) {
            Some((.., count)) => *count += 1,
            None => self.texts.push((text.to_owned(), run, 1)),
        }
    }
}

/// Number of runs of a plan and of a part, and how many of them have no row yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SweepSize {
    /// Runs of the plan.
    pub plan_runs: usize,
    /// Runs of the part.
    pub runs: usize,
    /// Runs of the part without a row; equal runs count once.
    pub pending: usize,
}

/// Checks a part like [`run`], up to its first run. Only the models of the first run are reduced, and none if the file of the part exists.
///
/// # Errors
/// The errors of [`run`].
pub fn check(request: &SweepRequest) -> Result<SweepSize> {
    let (mut part, created) = PartRun::prepare(request)?;
    // A part that exists was checked before.
    let checked = if part.results.is_empty() { part.check_names() } else { Ok(()) };
    remove(&created);
    checked?;
    let (runs, pending) = (part.digests.len(), part.pending.len());
    Ok(SweepSize { plan_runs: request.plan.design.runs(), runs, pending })
}

/// Removes journals without rows.
fn remove(created: &[PathBuf]) {
    for path in created {
        // The journal of histories exists only if the plan requests them.
        let _ = std::fs::remove_file(path);
    }
}

/// Part with its journals.
struct PartRun<'a> {
    request: &'a SweepRequest<'a>,
    files: SweepFiles,
    /// First run of the part (from 0).
    first: usize,
    /// Digests of the runs of the part, in their order.
    digests: Vec<CaseDigest>,
    /// Known rows by digest.
    rows: HashMap<String, Row>,
    /// Runs (from 0) to do; of equal runs only the first.
    pending: Vec<usize>,
    resumed: usize,
    journal: Journal,
    histories: Option<HistoryJournal>,
    /// True if the file of outputs over time was complete when this process began, or if the plan requests none.
    has_all_histories: bool,
    store: RomStore<'a>,
    /// Names of the means and totals of a run; empty if no scene of the plan was accepted.
    results: Vec<String>,
}

impl<'a> PartRun<'a> {
    /// Opens the journals, and finds the runs without a row. Also returns the journals that did not exist.
    fn prepare(request: &'a SweepRequest<'a>) -> Result<(Self, Vec<PathBuf>)> {
        let SweepRequest { plan, output, .. } = *request;
        let files = SweepFiles::new(output);
        let mut store = RomStore::new(request.sources, plan.directory(), request.cache, &files.models);
        let runs = request.part.runs(plan.design.runs());
        let first = runs.start;
        let digest = |run| Case::new(plan, run)?.digest(plan, &mut store);
        let in_plan = |failure: Failure| Failure { usage: true, ..failure }.at(plan.path.display());
        let digests: Vec<CaseDigest> = runs.map(digest).collect::<Result<_>>().map_err(in_plan)?;
        let journals = [&files.journal, &files.history_journal];
        let created: Vec<PathBuf> = journals.into_iter().filter(|path| !path.exists()).cloned().collect();
        // The journal is locked while it is open, so no other process writes the results.
        let (journal, found) = Journal::open(&files.journal)?;
        let (mut stored, mut results) = (Vec::new(), Vec::new());
        if output.exists() {
            let read = || check_results(plan, output).and_then(|()| result_file::read(output));
            (stored, results) = read().inspect_err(|_| remove(&created))?;
        }
        let digests_of = |rows: &[Row]| rows.iter().map(|row| row.digest.clone()).collect::<HashSet<_>>();
        let old = [digests_of(&stored), digests_of(&found)];
        let rows = stored.into_iter().chain(found).map(|row| (row.digest.clone(), row)).collect();
        let mut part = Self {
            request,
            files,
            first,
            digests,
            rows,
            pending: Vec::new(),
            resumed: 0,
            journal,
            histories: None,
            has_all_histories: false,
            store,
            results,
        };
        let checked = part.check_old_rows(old).and_then(|()| part.check_old_histories());
        if let Err(failure) = checked.and_then(|()| result_file::check_variable_names(plan, &part.results)) {
            remove(&created);
            return Err(failure);
        }
        let journal = &part.files.history_journal;
        part.histories = plan.histories.as_ref().map(|_| HistoryJournal::open(journal)).transpose()?;
        part.find_pending();
        Ok((part, created))
    }

    /// Checks that the part keeps all stored results: a complete part replaces its file. `stored` contains the digests in the file of results and in the journal.
    ///
    /// # Errors
    /// A file contains results of a run that the part does not have.
    fn check_old_rows(&self, stored: [HashSet<String>; 2]) -> Result<()> {
        let own: HashSet<&str> = self.digests.iter().map(|digest| digest.run.as_str()).collect();
        let is_result = |digest: &str| self.rows.get(digest).is_some_and(|row| !row.has_status(Status::Refused));
        for (path, digests) in [&self.files.rows, &self.files.journal].into_iter().zip(stored) {
            let lost = digests.iter().filter(|digest| !own.contains(digest.as_str()) && is_result(digest)).count();
            if lost == 0 {
                continue;
            }
            let runs = if lost == 1 { "run" } else { "runs" };
            let (what, reason) = match self.request.part {
                Part::WHOLE => {
                    ("the plan no longer has", "the plan, one of its files or the release of tiprub has changed")
                }
                _ => (
                    "this part does not have",
                    "it is of another part, or the plan, one of its files or the release of tiprub has changed",
                ),
            };
            let problem = format!("contains the results of {lost} {runs} that {what}, because {reason}");
            let remedy =
                "Write to another file or directory with --output (in Python: `output`), or move this file elsewhere";
            return Err(Failure::new(path.display(), problem, remedy));
        }
        Ok(())
    }

    /// Checks that writing outputs over time replaces none of other runs.
    ///
    /// # Errors
    /// The file exists and is not of a sweep, or it has the outputs of other runs.
    fn check_old_histories(&self) -> Result<()> {
        let path = &self.files.histories;
        if self.request.plan.histories.is_none() || !path.exists() {
            return Ok(());
        }
        let remedy = "Write to another file with --output, or move this one elsewhere";
        let facts = parquet_file::facts(path).unwrap_or_default();
        let Some((_, rows)) = facts.iter().find(|(key, _)| key == ROWS_FACT) else {
            return Err(Failure::new(
                path.display(),
                "exists and does not contain the outputs over time of a sweep",
                remedy,
            ));
        };
        if result_file::is_result(&facts) {
            let problem = "contains the results of another sweep, which outputs over time would replace";
            return Err(Failure::new(path.display(), problem, remedy));
        }
        if !self.files.rows.exists() && *rows != self.rows_digest() {
            return Err(Failure::new(path.display(), "contains the outputs over time of other runs", remedy));
        }
        Ok(())
    }

    fn find_pending(&mut self) {
        self.has_all_histories = self.histories.is_none() || self.has_complete_histories();
        let has_all_histories = self.has_all_histories;
        let has_history = |row: &Row| {
            let is_stored = self.histories.as_ref().is_none_or(|journal| journal.holds(&row.digest));
            has_all_histories || is_stored || !row.has_status(Status::Finished)
        };
        self.rows.retain(|_, row| has_history(row));
        let mut seen = HashSet::new();
        for (index, CaseDigest { run, .. }) in self.digests.iter().enumerate() {
            if self.rows.contains_key(run) {
                self.resumed += 1;
            } else if seen.insert(run.clone()) {
                self.pending.push(self.first + index);
            }
        }
    }

    /// Returns whether the file of histories belongs to the rows of this part.
    fn has_complete_histories(&self) -> bool {
        let path = &self.files.histories;
        let facts = if path.exists() { parquet_file::facts(path).unwrap_or_default() } else { Vec::new() };
        facts.into_iter().any(|(key, value)| key == ROWS_FACT && value == self.rows_digest())
    }

    fn rows_digest(&self) -> String {
        let all: Vec<&str> = self.digests.iter().map(|digest| digest.run.as_str()).collect();
        content_digest(all.join("\n").as_bytes())
    }

    fn case(&self, run: usize) -> Result<Case> {
        Case::new(self.request.plan, run)
    }

    fn load_models(&mut self, run: usize) -> Result<()> {
        for rom in &self.case(run)?.roms {
            self.store.load(rom, self.request.console)?;
        }
        Ok(())
    }

    /// Does the pending runs, and appends each row to the journal.
    fn run_pending(&mut self) -> Result<()> {
        let SweepRequest { stop, console, threads, .. } = *self.request;
        if self.pending.is_empty() {
            return Ok(());
        }
        if self.resumed > 0 {
            let (done, all) = (self.resumed, self.digests.len());
            console.print_progress(format_args!("{done} of {all} runs are already finished"));
        }
        for run in self.pending.clone() {
            if stop.load(Ordering::Relaxed) {
                return Ok(());
            }
            self.load_models(run)?;
        }
        let mut plan = WorkPlan::new(0.0);
        plan.plan(0, self.pending.len() as f64);
        let title = format!("Running {}", self.request.plan.name);
        let forecast = Forecast::new(console, &title, plan);
        let (rows, journal, histories) = (&mut self.rows, &mut self.journal, &mut self.histories);
        let worker = Worker::new(self.request, self.first, &self.digests, &self.store);
        let mut is_announced = false;
        let finished = |_, (row, history): (Row, Option<History>)| {
            if let (Some(journal), Some(history)) = (histories.as_mut(), history) {
                journal.append(&row.digest, &history)?;
            }
            journal.append(&row)?;
            rows.insert(row.digest.clone(), row);
            forecast.done(0, 1.0);
            Ok(())
        };
        let idle = || {
            if stop.load(Ordering::Relaxed) && !is_announced {
                is_announced = true;
                console.print_progress("Finishing the runs in progress; press Ctrl-C again to end without them");
            }
        };
        sweep::for_each(&self.pending, threads, stop, |run| worker.run(*run), finished, idle)
    }

    /// Writes the results and removes the journals if all rows are known.
    fn complete(mut self) -> Result<SweepOutcome> {
        let known = |digest: &CaseDigest| self.rows.contains_key(&digest.run);
        let is_complete = self.digests.iter().all(known);
        let outcome = self.outcome(is_complete);
        if !is_complete {
            return Ok(outcome);
        }
        let facts = self.facts();
        let numbers = (self.first + 1)..;
        let rows: Vec<(usize, &Row)> =
            numbers.zip(self.digests.iter().filter_map(|digest| self.rows.get(&digest.run))).collect();
        let has_new_histories = !self.has_all_histories;
        let table = result_file::table(self.request.plan, &rows, &self.results)?;
        if let Some(mut journal) = self.histories.take() {
            if has_new_histories {
                histories::write(&self.files.histories, &mut journal, &rows, &facts)?;
            }
            result_file::write(&self.files.rows, &table, &facts)?;
            journal.remove()?;
        } else {
            result_file::write(&self.files.rows, &table, &facts)?;
        }
        self.journal.remove()?;
        self.store.remove_reduced();
        Ok(outcome)
    }

    fn facts(&self) -> Vec<(&'static str, String)> {
        let SweepRequest { plan, part, .. } = *self.request;
        let own = [
            ("tiprub.release", env!("CARGO_PKG_VERSION").to_owned()),
            (PLAN_FACT, plan.name.clone()),
            ("tiprub.part", part.to_string()),
            (ROWS_FACT, self.rows_digest()),
        ];
        own.into_iter().chain(plan_facts(plan)).collect()
    }

    fn outcome(&self, is_complete: bool) -> SweepOutcome {
        let rows = || {
            let numbers = (self.first + 1)..;
            let known = |(run, digest): (usize, &CaseDigest)| Some((run, self.rows.get(&digest.run)?));
            numbers.zip(&self.digests).filter_map(known)
        };
        let count = |status| rows().filter(|(_, row)| row.has_status(status)).count();
        let (mut reasons, mut warnings, mut runs_with_warnings) = (RunsByText::default(), RunsByText::default(), 0);
        for (run, row) in rows() {
            if let Some(reason) = row.cell("reason") {
                reasons.add(&reason.to_string(), run);
            }
            let topics = row.warning_ids();
            runs_with_warnings += usize::from(!topics.is_empty());
            topics.iter().for_each(|topic| warnings.add(topic, run));
        }
        SweepOutcome {
            plan_runs: self.request.plan.design.runs(),
            runs: self.digests.len(),
            resumed: self.resumed,
            finished: count(Status::Finished),
            refused: count(Status::Refused),
            failed: count(Status::Failed),
            reasons: reasons.texts,
            runs_with_warnings,
            warnings: warnings.texts,
            is_complete,
        }
    }
}
