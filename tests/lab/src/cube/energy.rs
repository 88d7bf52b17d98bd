//! Energy loss of the slow flight without friction, and its limit for small steps.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::Interpolation;
use tiprub_shell::{Failure, Result};
use tiprub_study::Statement;

use super::{END, FRICTIONLESS, PAPER_LOSS, product::Product};

/// Internal step of the built-in scene (s), and its divisors.
const STEP: f64 = 5e-7;
const DIVISORS: [f64; 3] = [1.0, 2.0, 5.0];
/// Interval of the energy records (s).
const RECORD: f64 = 1e-6;

/// Energy losses as fractions of the initial energy.
#[derive(Debug, Clone, Copy)]
struct EnergyShares {
    step: f64,
    /// Loss up to the lowest total energy.
    lost: f64,
    /// Loss without the curvature work up to then.
    without_gain: f64,
}

/// Losses for decreasing steps.
#[derive(Debug)]
pub(crate) struct Losses(Vec<EnergyShares>);

impl Losses {
    /// Runs the flight with every step.
    ///
    /// # Errors
    /// A flight that fails.
    pub(super) fn new(scene: &Scene) -> Result<Self> {
        DIVISORS.into_iter().map(|divisor| loss(scene, STEP / divisor)).collect::<Result<_>>().map(Self)
    }

    /// Returns the loss for h → 0, of first order, from the two smallest steps.
    fn limit(&self) -> f64 {
        let [.., coarse, fine] = self.0.as_slice() else { return f64::NAN };
        fine.lost + (fine.lost - coarse.lost) * fine.step / (coarse.step - fine.step)
    }

    /// States whether the loss without curvature work equals the limit of the loss.
    pub(super) fn statement(&self) -> Statement {
        let limit = self.limit();
        let off = self.0.iter().map(|loss| (loss.without_gain / limit - 1.0).abs()).fold(0.0, f64::max);
        let reported = self.0.iter().map(|loss| {
            let [lost, without] = [loss.lost, loss.without_gain].map(|share| 100.0 * share);
            format!("h = {} µs: {lost:.3} % ({without:.3} %)", 1e6 * loss.step)
        });
        Statement::tested(
            "Without friction, the loss without curvature work is within 5 % of the limit h → 0 at every step size",
            off < 0.05,
            format!(
                "loss (without curvature work) at {}; limit h → 0: {:.3} %; in the paper, at its step: {:.2} %",
                reported.collect::<Vec<_>>().join(", "),
                100.0 * limit,
                100.0 * PAPER_LOSS
            ),
        )
    }

    /// Returns the losses as a table.
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

    /// Returns the losses for programs.
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
