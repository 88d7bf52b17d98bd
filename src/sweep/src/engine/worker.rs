//! Single runs of a sweep, on any thread.

use std::{
    collections::HashMap,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

use tiprub_core::Scene;
use tiprub_shell::{
    Failure, Result,
    native::{NativeRun, RunInputs, StartedRun},
    schedule::Schedule,
};

use super::SweepRequest;
use crate::{
    cases::{Case, CaseDigest},
    histories::History,
    models::RomStore,
    row::{Row, Status},
};

/// Largest number of cached results of slow checks.
const MAX_CACHED_CHECKS: usize = 256;
/// Largest number of times that a part writes results to the cache. With more values of friction or damping, other parts find few of their own values
/// there.
const MAX_CACHE_WRITES: usize = 16;
/// Parts of the names of parameters on which slow checks depend.
const CHECKED_PARAMETERS: [&str; 7] =
    ["friction", "damping", "internal_step", "scheme", "solver", "tolerance", "velocity"];

/// Returns a key for results of slow checks. A result has its own key in the simulation, so a coarse key here never changes a row.
fn checks_key(scene: &str, settings: &[(String, String)]) -> String {
    let matters = |name: &str| CHECKED_PARAMETERS.iter().any(|part| name.contains(part));
    let settings = settings.iter().filter(|(name, _)| matters(name));
    settings.fold(scene.to_owned(), |key, (name, value)| format!("{key}\n{name}={value}"))
}

/// Performs single runs, on any thread.
pub(super) struct Worker<'a> {
    request: &'a SweepRequest<'a>,
    first: usize,
    digests: &'a [CaseDigest],
    store: &'a RomStore<'a>,
    /// Last scene with its digest. Runs that differ only in start values share it.
    scene: Mutex<Option<(String, Arc<Scene>)>>,
    /// Results of slow checks, by the scene and the start values on which they may depend.
    checks: Mutex<HashMap<String, Arc<Vec<u8>>>>,
    /// Number of results for the cache.
    kept: AtomicUsize,
}

impl<'a> Worker<'a> {
    /// Creates a worker for a part that begins with the run `first` (from 0).
    pub(super) fn new(
        request: &'a SweepRequest<'a>,
        first: usize,
        digests: &'a [CaseDigest],
        store: &'a RomStore<'a>,
    ) -> Self {
        Self {
            request,
            first,
            digests,
            store,
            scene: Mutex::new(None),
            checks: Mutex::default(),
            kept: AtomicUsize::new(0),
        }
    }

    /// Performs a run (counted from 0). A panic fails only this run.
    pub(super) fn run(&self, run: usize) -> (Row, Option<History>) {
        let digest = &self.digests[run - self.first];
        let clock = Instant::now();
        let work = catch_unwind(AssertUnwindSafe(|| self.results(run, digest)));
        let result = work.unwrap_or_else(|_| {
            let remedy = "Report it to the developers, with the plan and the messages on the terminal";
            Err(Box::new((Status::Failed, Failure::new("tiprub", "an internal error stopped the run", remedy))))
        });
        let seconds = clock.elapsed().as_secs_f64();
        match result {
            Ok((results, schedule)) => {
                let request = self.request.plan.histories.as_ref();
                let history = request.map(|request| History::of(&results.recording, request));
                (Row::finished(&digest.run, &results, &schedule, seconds), history)
            }
            Err(end) => (Row::without_results(&digest.run, end.0, &end.1, seconds), None),
        }
    }

    fn results(&self, run: usize, digest: &CaseDigest) -> Result<(NativeRun, Schedule), Box<(Status, Failure)>> {
        let rejected = |failure| Box::new((Status::Refused, failure));
        let plan = self.request.plan;
        let case = Case::new(plan, run).map_err(rejected)?;
        let scene = self.scene(&case, &digest.scene).map_err(rejected)?;
        let schedule = plan.schedule(&scene.settings).map_err(rejected)?;
        let key = checks_key(&digest.scene, &case.settings);
        let known = self.checks.lock().ok().and_then(|checks| checks.get(&key).cloned());
        let known = known.unwrap_or_else(|| Arc::new(self.request.cache.checks(&scene)));
        let given = RunInputs { settings: &case.settings, checks: &known, ..RunInputs::default() };
        let started = StartedRun::new(&scene, &schedule, given).map_err(rejected)?;
        let results = started.finish(&|_| {}).map_err(|failure| Box::new((Status::Failed, failure)))?;
        if let Ok(mut checks) = self.checks.lock() {
            // The cache passes the first results to the other parts on this machine.
            let is_new = !checks.contains_key(&key) && *known != results.checks;
            if is_new && self.kept.fetch_add(1, Ordering::Relaxed) < MAX_CACHE_WRITES {
                self.request.cache.keep_checks(&scene, &results.checks);
            }
            if checks.len() >= MAX_CACHED_CHECKS {
                checks.clear();
            }
            checks.entry(key).or_insert_with(|| Arc::new(results.checks.clone()));
        }
        Ok((results, schedule))
    }

    fn scene(&self, case: &Case, digest: &str) -> Result<Arc<Scene>> {
        let last = self.scene.lock().ok().and_then(|last| last.clone());
        if let Some((_, scene)) = last.filter(|(other, _)| other == digest) {
            return Ok(scene);
        }
        let scene = Arc::new(case.scene(self.store)?);
        if let Ok(mut last) = self.scene.lock() {
            *last = Some((digest.to_owned(), scene.clone()));
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_differ_in_speed_share_slow_checks() {
        let key = |settings: &[(&str, &str)]| {
            let pairs = settings.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
            checks_key("scene", &pairs.collect::<Vec<_>>())
        };
        let base = key(&[("speed", "1"), ("friction_coefficient", "0.1")]);
        assert_eq!(key(&[("speed", "2"), ("friction_coefficient", "0.1"), ("gap_offset", "1e-5")]), base);
        assert_ne!(key(&[("speed", "1"), ("friction_coefficient", "0.2")]), base);
        assert_ne!(key(&[("speed", "1"), ("friction_coefficient", "0.1"), ("solver", "film")]), base);
    }
}
