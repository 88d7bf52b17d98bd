//! The paper's method in NumPy (`paper.py`), run as a separate process.

use std::path::Path;
use std::process::Command;

use nalgebra::DMatrix;
use serde_json::{Value, json};
use tiprub_reference::reduced::rub::BladeScene;

use super::{SAMPLE, TimedRub, dense};

const SCRIPT: &str = include_str!("paper.py");
/// Variables that limit the libraries below NumPy to one thread.
const THREADS: [&str; 4] = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"];

/// Returns the reason if this Python cannot import NumPy.
fn missing(python: &Path) -> Option<String> {
    let output = Command::new(python).args(["-c", "import numpy"]).output();
    let why = match output {
        Ok(output) if output.status.success() => return None,
        Ok(_) => "it cannot import NumPy".to_owned(),
        Err(error) => error.to_string(),
    };
    Some(format!("skipped: {}: {why}. Install NumPy, or give another interpreter with --python", python.display()))
}

/// Returns the little-endian bytes of matrices, row by row.
fn bytes_of<'a>(matrices: impl IntoIterator<Item = &'a DMatrix<f64>>) -> Vec<u8> {
    // The storage is column by column, so that of the transpose is row by row.
    let values = matrices.into_iter().flat_map(|matrix| matrix.transpose().iter().copied().collect::<Vec<_>>());
    values.flat_map(f64::to_le_bytes).collect()
}

/// Runs `milliseconds` with steps of `step` (s), of which a millisecond contains a whole number.
///
/// # Errors
/// NumPy is missing, or the script fails.
pub(super) fn run(python: &Path, scene: &BladeScene, step: f64, milliseconds: u32) -> Result<TimedRub, String> {
    if let Some(why) = missing(python) {
        return Err(why);
    }
    let blades = scene.blades();
    let tips = DMatrix::from_fn(blades.tips.len(), 3, |node, column| {
        let tip = blades.tips[node];
        [tip.radius, tip.angle, tip.slope][column]
    });
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most some ten thousand")]
    let steps = (SAMPLE / step).round() as u64;
    let header = json!({
        "order": blades.mass.nrows(), "nodes": blades.tips.len(), "sectors": blades.sectors, "step": step,
        "samples": milliseconds, "steps_per_sample": steps, "speed": blades.obstacle.speed,
        "friction": blades.obstacle.friction, "clearance": blades.obstacle.clearance, "bumps": blades.obstacle.bumps,
    });
    let matrices = bytes_of([&blades.mass, &blades.stiffness, &dense::damping(scene), &blades.contact_map, &tips]);
    let unreadable = |error: std::io::Error| format!("temporary files of the NumPy run: {error}");
    let directory = tempfile::tempdir().map_err(unreadable)?;
    let script = directory.path().join("paper.py");
    for (path, bytes) in [
        (&script, SCRIPT.as_bytes()),
        (&directory.path().join("scene.json"), header.to_string().as_bytes()),
        (&directory.path().join("matrices.bin"), &matrices),
    ] {
        std::fs::write(path, bytes).map_err(unreadable)?;
    }
    let mut command = Command::new(python);
    command.arg(&script).arg(directory.path()).envs(THREADS.map(|name| (name, "1")));
    let output = command.output().map_err(|error| format!("{}: {error}", python.display()))?;
    if !output.status.success() {
        return Err(format!("the script failed: {}", String::from_utf8_lossy(&output.stderr)));
    }
    let answer: Option<Value> = serde_json::from_slice(&output.stdout).ok();
    let seconds = answer.and_then(|answer| answer["seconds"].as_f64()).ok_or("the script printed no time")?;
    let bytes = std::fs::read(directory.path().join("displacements.bin")).map_err(unreadable)?;
    let (numbers, _) = bytes.as_chunks();
    Ok(TimedRub { displacements: numbers.iter().map(|number| f64::from_le_bytes(*number)).collect(), seconds })
}
