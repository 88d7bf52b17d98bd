//! Runs of cases in separate processes: their output, or how they ended.

use std::{
    env,
    io::Read,
    path::PathBuf,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use tiprub_shell::{Failure, Result};

use super::{CaseContext, CaseEnd, CaseVerdict, StabilityCase, judge};

/// Interval at which a child is polled.
const PATIENCE: Duration = Duration::from_millis(4);
/// Name of the environment variable with the directory of packaged FMUs for a child.
const FMUS: &str = "TIPRUB_STABILITY_FMUS";
/// Number of last characters of the output of a crashed child.
const LAST_WORDS: usize = 300;

/// One completed row of the table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StabilityRow {
    /// Name of the case.
    pub name: String,
    /// Expected end.
    pub expected: String,
    /// Actual end.
    pub happened: String,
    /// Verdict.
    pub verdict: CaseVerdict,
    /// Wall-clock time (s).
    pub seconds: f64,
}

/// Returns the path of this program, even if its file has been replaced since the start (Linux).
fn program() -> std::io::Result<PathBuf> {
    let running = PathBuf::from("/proc/self/exe");
    if running.exists() { Ok(running) } else { env::current_exe() }
}

/// Runs a case in a child process and returns the verdict.
///
/// # Errors
/// A child process that cannot be started.
pub(crate) fn run(case: &StabilityCase, context: &CaseContext) -> Result<StabilityRow> {
    let clock = Instant::now();
    let lost = |error: std::io::Error| Failure::new("child process", error, "Free memory and try again");
    let mut command = Command::new(program().map_err(lost)?);
    command.args(["--quiet", "stability", "--child", &case.name]);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    if let Some(fmus) = &context.fmus {
        command.env(FMUS, fmus);
    }
    let mut child = command.spawn().map_err(lost)?;
    // Both pipes are emptied while the child runs, so that it never blocks.
    let stdout = drain(child.stdout.take());
    let stderr = drain(child.stderr.take());
    let code = wait(&mut child, Duration::from_secs_f64(case.limit)).map_err(lost)?;
    let [stdout, stderr] = [stdout, stderr].map(|thread| thread.join().unwrap_or_default());
    let (verdict, happened) = match code {
        None => (CaseVerdict::Hung, format!("did not end within {} s", case.limit)),
        Some(ended) => read(case, &ended, &stdout, &stderr),
    };
    let seconds = clock.elapsed().as_secs_f64();
    Ok(StabilityRow { name: case.name.clone(), expected: case.expected.to_text(), happened, verdict, seconds })
}

fn read(case: &StabilityCase, ended: &str, stdout: &str, stderr: &str) -> (CaseVerdict, String) {
    let written = stdout.lines().last().and_then(|line| serde_json::from_str(line).ok());
    match written.as_ref().and_then(CaseEnd::from_json).filter(|_| ended.is_empty()) {
        Some(happened) => judge(&case.expected, &happened),
        None => {
            let words: Vec<char> = stderr.trim().chars().collect();
            let words: String = words[words.len().saturating_sub(LAST_WORDS)..].iter().collect();
            let ended = if ended.is_empty() { "ended without a result" } else { ended };
            (CaseVerdict::Crashed, format!("{ended}: {}", words.replace('\n', " ")))
        }
    }
}

fn drain(pipe: Option<impl Read + Send + 'static>) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        // A broken pipe appears as a missing result.
        let _ = pipe.map(|mut pipe| pipe.read_to_end(&mut bytes));
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Waits for the end of a child; returns an empty text on success, `None` if it had to be killed.
fn wait(child: &mut Child, limit: Duration) -> std::io::Result<Option<String>> {
    let clock = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(if status.success() { String::new() } else { format!("{status}") }));
        }
        if clock.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(PATIENCE);
    }
}

/// Runs the case of this name in the child and returns the text for stdout.
///
/// # Errors
/// An unknown case.
pub(crate) fn answer(name: &str) -> Result<serde_json::Value> {
    let case = super::named(name, false).into_iter().find(|case| case.name == name);
    let case = case.ok_or_else(|| Failure::usage("--child", format!("there is no case {name}"), ""))?;
    let context = CaseContext { fmus: env::var_os(FMUS).map(Into::into) };
    Ok(case.run(&context).to_json())
}
