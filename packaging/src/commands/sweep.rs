//! `tiprub sweep`: runs a plan, or a part of it, with one row of results per run.

use std::{
    collections::HashMap,
    fmt::Write as _,
    sync::{Arc, atomic::AtomicBool},
    time::Instant,
};

use serde_json::json;
use signal_hook::{consts, flag};
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, shown_path},
    sweep,
};
use tiprub_sweep::{
    engine::{self, SweepFiles, SweepOutcome, SweepRequest},
    plan::Plan,
    plan_digest::{plan_digest, plan_facts},
};

use crate::{cli::SweepArguments, sweep_sources::ProgramSources};

/// Exit code of a program that the user ends with Ctrl-C a second time, as shells report it.
const ENDED_BY_USER: i32 = 128 + 2;
/// Number of different reasons that are listed.
const MOST_REASONS: usize = 5;

/// Runs the part, or checks it. If no run of a whole plan finished, the outcome contains a failure.
///
/// # Errors
/// The plan is wrong, a file cannot be written, or the user interrupts the sweep. Rejected and failed runs are no errors.
pub fn run(arguments: &SweepArguments, console: &Console) -> Result<CommandOutcome> {
    let sources = ProgramSources::default();
    let plan = Plan::load(&arguments.plan, &sources)?;
    let digest = || {
        let program = std::env::current_exe()
            .map_err(|error| Failure::new("tiprub", format!("its executable cannot be found: {error}"), ""))?;
        plan_digest(&plan, &program, &sources)
    };
    if let Some(given) = &arguments.digest
        && !given.eq_ignore_ascii_case(&digest()?)
    {
        if given.len() != 64 || !given.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            let remedy = "Give the 64 hexadecimal digits that `tiprub sweep --check` prints";
            return Err(Failure::usage(format!("--digest {given}"), "is not a digest", remedy));
        }
        let problem = "the program, the plan, or a file that it names differs from those of the digest";
        let remedy = "Install the same release and give the same files on all machines";
        return Err(Failure::new(plan.path.display(), problem, remedy));
    }
    let (output, cache, stop) = (arguments.output(), arguments.cache.cache(), stop_flag()?);
    let request = SweepRequest {
        plan: &plan,
        part: arguments.part(),
        output: &output,
        threads: arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get),
        stop: &stop,
        sources: &sources,
        cache: &cache,
        console,
    };
    if arguments.check {
        return check(&request, &digest()?);
    }
    let clock = Instant::now();
    let outcome = engine::run(&request)?;
    if !outcome.is_complete {
        return Err(interrupted(&outcome, &request));
    }
    let seconds = clock.elapsed().as_secs_f64();
    let has_histories = plan.histories.is_some();
    let files = SweepFiles::new(&output);
    let json = json!({
        "plan": shown_path(&plan.path),
        "part": request.part.to_string(),
        "plan_runs": outcome.plan_runs,
        "runs": outcome.runs,
        "finished": outcome.finished,
        "refused": outcome.refused,
        "failed": outcome.failed,
        "finished_before": outcome.resumed,
        "reasons": outcome.reasons.iter().map(|(reason, run, count)| json!({
            "reason": reason, "first_run": run, "runs": count,
        })).collect::<Vec<_>>(),
        "runs_with_warnings": outcome.runs_with_warnings,
        "warning_counts": outcome.warnings.iter().map(|(id, run, count)| json!({
            "id": id, "first_run": run, "runs": count,
        })).collect::<Vec<_>>(),
        "seconds": seconds,
        "output": shown_path(&output),
        "histories": has_histories.then(|| shown_path(&files.histories)),
    });
    let mut text = summary(&outcome, &request);
    let _ = write!(text, "written: {}", output.display());
    if has_histories {
        let _ = write!(text, "\nwritten: {}", files.histories.display());
    }
    // A part succeeds even if none of its runs finished, because workflow managers repeat a part that failed.
    let failure = if arguments.part.is_none() { no_run_finished(&outcome, &request) } else { None };
    Ok(CommandOutcome { text, json, failure, ..CommandOutcome::default() })
}

/// Returns a failure if the sweep has runs and none of them finished.
fn no_run_finished(SweepOutcome { runs, finished, .. }: &SweepOutcome, request: &SweepRequest) -> Option<Failure> {
    let problem = match (runs, finished) {
        (1.., 0) => "no run finished",
        _ => return None,
    };
    let remedy = format!("Correct the plan; the column `reason` of {} contains the reasons", request.output.display());
    Some(Failure::new(request.plan.path.display(), problem, remedy))
}

/// Checks the plan without running it.
fn check(request: &SweepRequest, digest: &str) -> Result<CommandOutcome> {
    let size = engine::check(request)?;
    let text = format!(
        "the plan has {} {}; part {} has {} {}; not finished: {}\ndigest: {digest}",
        size.plan_runs,
        run_or_runs(size.plan_runs),
        request.part,
        size.runs,
        run_or_runs(size.runs),
        size.pending
    );
    let json = json!({
        "plan_runs": size.plan_runs,
        "part": request.part.to_string(),
        "runs": size.runs,
        "pending": size.pending,
        "digest": digest,
        "facts": plan_facts(request.plan).into_iter().collect::<HashMap<_, _>>(),
        "output": shown_path(request.output),
    });
    Ok(CommandOutcome { text, json, ..CommandOutcome::default() })
}

/// Returns a flag that Ctrl-C and a request to end set. If they come a second time, the program ends immediately; the journal permits that.
fn stop_flag() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [consts::SIGINT, consts::SIGTERM] {
        let registered = flag::register_conditional_shutdown(signal, ENDED_BY_USER, stop.clone())
            .and_then(|_| flag::register(signal, stop.clone()));
        registered.map_err(|error| Failure::new("Ctrl-C", format!("cannot be handled: {error}"), ""))?;
    }
    Ok(stop)
}

fn interrupted(outcome: &SweepOutcome, request: &SweepRequest) -> Failure {
    let done = outcome.finished + outcome.refused + outcome.failed;
    let journal = SweepFiles::new(request.output).journal;
    Failure::new(
        "tiprub sweep",
        format!("interrupted after {done} of {} runs, which are in {}", outcome.runs, journal.display()),
        "Run the same command again to continue with the other runs",
    )
}

/// Returns the singular or the plural of "run" for a number of runs.
fn run_or_runs(count: usize) -> &'static str {
    if count == 1 { "run" } else { "runs" }
}

fn summary(outcome: &SweepOutcome, request: &SweepRequest) -> String {
    let SweepOutcome {
        plan_runs, runs, resumed, finished, refused, failed, reasons, runs_with_warnings, warnings, ..
    } = outcome;
    let of_plan = if plan_runs == runs {
        String::new()
    } else {
        format!(" (part {} of a plan with {plan_runs} {})", request.part, run_or_runs(*plan_runs))
    };
    let mut text =
        format!("{runs} {}{of_plan}: {finished} finished, {refused} refused, {failed} failed\n", run_or_runs(*runs));
    if *resumed > 0 {
        let _ = writeln!(text, "{resumed} of them were done before");
    }
    for (reason, run, count) in reasons.iter().take(MOST_REASONS) {
        let runs = if *count == 1 { format!("run {run}") } else { format!("{count} runs, the first is {run}") };
        let _ = writeln!(text, "  {runs}: {reason}");
    }
    if reasons.len() > MOST_REASONS {
        let _ = writeln!(text, "  and {} other reasons in the column `reason`", reasons.len() - MOST_REASONS);
    }
    if *runs_with_warnings > 0 {
        let each: Vec<String> = warnings.iter().map(|(id, _, count)| format!("{id} in {count}")).collect();
        let _ = writeln!(
            text,
            "{runs_with_warnings} {} with warnings or notes: {}",
            run_or_runs(*runs_with_warnings),
            each.join(", ")
        );
    }
    text
}
