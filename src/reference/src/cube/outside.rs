//! Histories that other programs wrote as tables, for comparison of node 1.

use tiprub_model::{Error, Result};

use super::history::CubeHistory;

/// Columns of a table, in order; lines that begin with `#` or with `t` are skipped.
pub const COLUMNS: &str = "t,u1x,u1y,u1z,lambda1,left,vy";

/// Reads time, displacement of node 1 (m), its mean normal force since the row before (N), that of the whole left
/// face, and the velocity of the centre of the cube along y (m/s). Quantities that a table lacks stay zero; a row at
/// t = 0 is added.
///
/// # Errors
/// [`Error::Invalid`] for a row that is not seven numbers, or times that do not increase.
pub fn read(text: &str, speed: f64) -> Result<CubeHistory> {
    let mut history = CubeHistory { method: "outside".into(), ..CubeHistory::default() };
    push(&mut history, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -speed]);
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.starts_with(['#', 't'])) {
        let numbers: Vec<f64> = line.split(',').filter_map(|word| word.trim().parse().ok()).collect();
        let row = <[f64; 7]>::try_from(numbers.as_slice()).ok();
        let later = |row: &[f64; 7]| history.times.last().is_some_and(|last| row[0] > *last);
        let row = row.filter(later).ok_or_else(|| {
            let problem = format!("line {} is not a row of seven numbers ({COLUMNS}) with increasing time", index + 1);
            Error::invalid("table of another code", problem, "Write the table again")
        })?;
        push(&mut history, row);
    }
    history.step = history.times.get(1).copied().unwrap_or_default();
    Ok(history)
}

fn push(history: &mut CubeHistory, [time, x, y, z, first, left, speed]: [f64; 7]) {
    let mut corners = [[0.0; 3]; 8];
    corners[0] = [x, y, z];
    history.times.push(time);
    history.corners.push(corners);
    history.corner_forces.push([first, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    history.forces.push([left, 0.0]);
    history.velocity.push([0.0, speed, 0.0]);
}
