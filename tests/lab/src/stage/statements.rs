//! Statements that compare the stage with the paper's figures 11 and 12.

use tiprub_shell::Result;
use tiprub_study::Statement;

use super::{RAMP_PERIODS, Run, SHOWN, StageCasing, StageSetup, nearest, warnings};

/// Ratio of nodal diameter 4 to 2 below which nodal diameter 4 counts as negligible.
const NEGLIGIBLE: f64 = 0.1;
/// Minimum number of touches of a node for repeated contact.
const OFTEN: usize = 2;
/// Largest residual of a ledger that closes, relative to the energy exchanged.
const LEDGER: f64 = 1e-9;

/// Returns the statements about one casing.
pub(super) fn of(setup: &StageSetup, casing: StageCasing, runs: &[Run], names: &[String]) -> Result<Vec<Statement>> {
    let [numerator, denominator] = [SHOWN[1], SHOWN[0]];
    let share = |run: &Run| run.effective(numerator, setup.full()) / run.effective(denominator, setup.full());
    let shares: Vec<(f64, f64)> = runs.iter().map(|run| (run.speed, share(run))).collect();
    let shares = if runs.iter().all(|run| run.ended.is_none()) { shares } else { Vec::new() };
    let resonance = format!(
        "contact twice per revolution also excites the blades at four times the speed, in resonance with the first mode of nodal \
         diameter 4 at {:.1} rad/s ({:.2} of the critical speed)",
        setup.second_resonance,
        setup.second_resonance / setup.critical_speed()
    );
    let deepest = runs.iter().map(|run| -run.least_clearance).fold(0.0, f64::max);
    let warned = warnings(runs.iter());
    let mut all = vec![
        reaches_end(runs),
        all_nodes_touch(nearest(setup, runs)?, names, setup.gap()),
        contact_everywhere(runs),
        Statement::remark(
            "Residual penetrations (fig. 11)",
            format!(
                "largest at any communication point of any run: {deepest} m. The solver lcp closes contact gaps in each step \
                 exactly, so this value does not measure the error; the chapter Validation gives the error due to the rotation of \
                 normals within a step"
            ),
        ),
        prevails(&shares, setup.critical_speed()),
        becomes_negligible(&shares, &resonance),
        ledger(runs),
        Statement::remark("Warnings of the runs", if warned.is_empty() { "none".into() } else { warned.join("; ") }),
    ];
    for statement in &mut all {
        statement.expected = format!("{}: {}", capital(casing.name()), statement.expected);
    }
    Ok(all)
}

fn capital(word: &str) -> String {
    word[..1].to_uppercase() + &word[1..]
}

/// Checks that the clearances of all three nodes return to zero several times each, as in the paper.
pub(crate) fn all_nodes_touch(run: &Run, names: &[String], gap: f64) -> Statement {
    let nodes = names.iter().zip(run.least.iter().zip(&run.touches));
    let reported = nodes.map(|(name, (least, touches))| {
        format!("{} {:.3} of the clearance at rest, {touches} contacts", name.replace('_', " "), least / gap)
    });
    Statement::tested(
        "The clearance of each of the three nodes of blade 1 reaches zero repeatedly (fig. 11)",
        !run.touches.is_empty() && run.touches.iter().all(|count| *count >= OFTEN),
        format!(
            "smallest clearances at {:.1} rad/s, and contacts after the first {RAMP_PERIODS} periods: {}",
            run.speed,
            reported.collect::<Vec<_>>().join("; ")
        ),
    )
}

fn reaches_end(runs: &[Run]) -> Statement {
    let ended: Vec<String> =
        runs.iter().filter_map(|run| Some(format!("{:.1} rad/s: {}", run.speed, run.ended.as_ref()?))).collect();
    let found = match ended.first() {
        None => format!("all {}", runs.len()),
        Some(first) => format!("{} of {} end early; {first}", ended.len(), runs.len()),
    };
    Statement::tested("Every run is completed", ended.is_empty(), found)
}

fn contact_everywhere(runs: &[Run]) -> Statement {
    let touched = runs.iter().filter(|run| run.largest_force > 0.0).count();
    Statement::tested(
        "There is contact at every angular velocity",
        touched == runs.len(),
        format!("at {touched} of {} angular velocities", runs.len()),
    )
}

fn listed(shares: &[(f64, f64)]) -> String {
    shares.iter().map(|(speed, share)| format!("{share:.2} at {speed:.0}")).collect::<Vec<_>>().join(", ")
}

/// Checks runs above the resonance of nodal diameter 2 only: undecided without such a run.
pub(crate) fn prevails(shares: &[(f64, f64)], critical: f64) -> Statement {
    let expected = format!(
        "Nodal diameter {}, that of the oval, dominates nodal diameter {} in every run at or above the critical speed",
        SHOWN[0], SHOWN[1]
    );
    let fast: Vec<(f64, f64)> = shares.iter().copied().filter(|(speed, _)| *speed >= critical).collect();
    if fast.is_empty() {
        return Statement::remark(
            expected,
            format!("undecided: no run at or above {critical:.1} rad/s, or some runs end early"),
        );
    }
    let found =
        format!("effective amplitude of nodal diameter 4 relative to that of 2 (speeds in rad/s): {}", listed(&fast));
    Statement::tested(expected, fast.iter().all(|(_, share)| *share < 1.0), found)
}

/// Checks the statement of the paper about its figure 12: the ratio falls monotonically, and is negligible in the end.
pub(crate) fn becomes_negligible(shares: &[(f64, f64)], resonance: &str) -> Statement {
    let expected = format!(
        "Nodal diameter {} becomes negligible compared with {} as the angular velocity increases (fig. 12): the ratio \
         of their amplitudes falls from each angular velocity to the next and ends below {NEGLIGIBLE}",
        SHOWN[1], SHOWN[0]
    );
    let found = format!("ratios (speeds in rad/s): {}; {resonance}", listed(shares));
    if shares.len() < 3 {
        let why = format!("undecided: fewer than three angular velocities, or runs that end early; {found}");
        return Statement::remark(expected, why);
    }
    let falls = shares.windows(2).all(|pair| pair[1].1 < pair[0].1);
    Statement::tested(expected, falls && shares.last().is_some_and(|(_, share)| *share < NEGLIGIBLE), found)
}

fn ledger(runs: &[Run]) -> Statement {
    let largest = runs.iter().map(|run| run.energy_residual).fold(0.0, f64::max);
    Statement::tested(
        format!("The energy balance closes in every run to {LEDGER:e} of the energy exchanged"),
        runs.iter().all(|run| run.energy_residual < LEDGER),
        format!("largest residual {largest:.1e}"),
    )
}
