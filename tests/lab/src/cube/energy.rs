//! What the slow flight without friction loses, and to what that tends with the step.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_core::{
    Scene,
    settings::{Interpolation, Scheme, Solver},
};
use tiprub_shell::{Failure, Result};
use tiprub_study::Statement;

use super::{END, FRICTIONLESS, PAPER_LOSS, product::Product};

/// Internal step that ships (s), and what it is divided by.
const STEP: f64 = 5e-7;
const DIVISORS: [f64; 3] = [1.0, 2.0, 5.0];
/// Records of the energies (s).
const RECORD: f64 = 1e-6;

/// Shares of the energy at the start.
#[derive(Debug, Clone, Copy)]
struct EnergyShares {
    step: f64,
    /// Up to the lowest total energy.
    lost: f64,
    /// The same without what curvature work had added by then.
    without_gain: f64,
}

/// Losses with smaller and smaller steps.
#[derive(Debug)]
pub(crate) struct Losses(Vec<EnergyShares>);

impl Losses {
    /// Fly with every step.
    ///
    /// # Errors
    /// A flight fails.
    pub(super) fn new(scene: &Scene) -> Result<Self> {
        DIVISORS.into_iter().map(|divisor| loss(scene, STEP / divisor)).collect::<Result<_>>().map(Self)
    }

    /// Loss for h → 0, of first order, from the two smallest steps.
    fn limit(&self) -> f64 {
        let [.., coarse, fine] = self.0.as_slice() else { return f64::NAN };
        fine.lost + (fine.lost - coarse.lost) * fine.step / (coarse.step - fine.step)
    }

    /// Whether the loss without curvature work is the one that the loss tends to.
    pub(super) fn statement(&self) -> Statement {
        let limit = self.limit();
        let off = self.0.iter().map(|loss| (loss.without_gain / limit - 1.0).abs()).fold(0.0, f64::max);
        let reported = self.0.iter().map(|loss| {
            let [lost, without] = [loss.lost, loss.without_gain].map(|share| 100.0 * share);
            format!("h = {} µs: {lost:.3} % ({without:.3} %)", 1e6 * loss.step)
        });
        Statement::tested(
            "Without friction, the loss without curvature work is within 5 % of the limit h → 0 at every step",
            off < 0.05,
            format!(
                "loss (without curvature work) at {}; limit h → 0: {:.3} %; in the paper, at its step: {:.2} %",
                reported.collect::<Vec<_>>().join(", "),
                100.0 * limit,
                100.0 * PAPER_LOSS
            ),
        )
    }

    /// As a table.
    pub(super) fn markdown(&self) -> String {
        let mut text = String::from(
            "## Energy at 50 m/s without friction\n\nlcp, modal-exact; loss up to the minimum of the total \
             energy.\n\n| h (µs) | loss | without curvature work |\n|---|---|---|\n",
        );
        for EnergyShares { step, lost, without_gain } in &self.0 {
            let _ = writeln!(text, "| {} | {:.3} % | {:.3} % |", 1e6 * step, 100.0 * lost, 100.0 * without_gain);
        }
        let _ = writeln!(text, "| → 0 | {:.3} % | |", 100.0 * self.limit());
        text
    }

    /// For programs.
    pub(super) fn json(&self) -> Value {
        let rows =
            self.0.iter().map(|loss| json!({"step": loss.step, "lost": loss.lost, "without_gain": loss.without_gain}));
        json!({ "rows": rows.collect::<Vec<_>>(), "limit": self.limit() })
    }
}

fn loss(scene: &Scene, step: f64) -> Result<EnergyShares> {
    let product =
        Product { solver: Solver::Lcp, scheme: Scheme::ModalExact, step, interpolation: Interpolation::Spline };
    let run = product
        .run(scene, &FRICTIONLESS, END, RECORD)
        .map_err(|error| Failure::new(format!("lab cube, h = {step} s"), error.to_string(), ""))?;
    let total = run.history.total();
    let lost = |energies: &mut dyn Iterator<Item = f64>| 1.0 - energies.fold(f64::INFINITY, f64::min) / total[0];
    Ok(EnergyShares {
        step,
        lost: lost(&mut total.iter().copied()),
        without_gain: lost(&mut total.iter().zip(&run.curvature).map(|(total, gain)| total - gain)),
    })
}
