//! Tensile contact forces of `film`, which checks for penetration only once: nodes that other contacts push away are held closed and
//! pulled. This is reported, and ends a run if it is too large.
//!
//! The measure is the impulse on the node with the largest pull, as a fraction of that on the node with the largest push, since the start.
//! Blades of rotor 37 with nine patches, in a round casing that closes and stays, and rubbing against two bumps with a height of 0.2 and 3
//! clearances:
//!
//! | ω_max h | at rest, µ = 0 | at rest, µ = 0.15 | rubbing, height 0.2 | rubbing, height 3 |
//! |---|---|---|---|---|
//! | 1 | 0.001, correct | 0.002, correct | 0.004, 0.008 | 0.008 |
//! | 3 | 0.001, correct | 0.002, correct | 0.007, 0.010 | 0.02 |
//! | 6 | 0.22, off by 0.31 | 0.002, correct | 0.02, 0.01 | 0.06, 0.07 |
//! | 10 | 0.23, off by 0.31 | 0.003, correct | 0.02, 0.01 | 0.17, 0.13 |
//! | 20 | 0.24, off by 0.31 | 0.39, off by 0.49 | 0.02, 0.01 | 0.21, 0.17 |
//!
//! At rest, "off" is the difference from the complementary forces as a fraction of the largest. The place at which film comes to rest
//! depends on its history, so that no check at the start can predict it.

use tiprub_cosim::shown_time;
use tiprub_cosim::warning::Topic;

use super::Simulation;
use crate::limits::finding::Subject;
use crate::scene::settings::Preset;
use crate::system::StepFailure;
use crate::{Result, Warning};

/// Fractions from which pulling is reported, and from which it ends a run unless the preset is `paper`.
const TOLD: f64 = 0.03;
const REFUSED: f64 = 0.2;
/// Fraction of its clearance by which a node may be inside a surface at the end of a step. Forces of one step push a node in by an amount
/// that this step corrects, which is a small part of the clearance as long as steps are short: 4 % at most in random rubs in which `lcp`
/// agrees.
const INSIDE: f64 = 0.2;
/// From this fraction on it is reported, and again whenever it has grown by the factor `DEEPER`.
const INSIDE_TOLD: f64 = 0.05;
const DEEPER: f64 = 2.0;
/// Internal steps that contact must have lasted: the effect of a few of them is soon outweighed.
const LASTED: u64 = 100;

impl Simulation {
    /// Warns of a node that is pulled or left deep inside a surface, or ends the run.
    pub(super) fn check_pulling(&mut self, time: f64) -> Result<()> {
        if self.system.settings().solver.properties().complementary {
            return Ok(());
        }
        let is_paper = self.compiled.scene.settings.preset == Preset::Paper;
        for structure in 0..self.compiled.bodies.len() {
            let of = Subject::Body(structure);
            if let Some((node, share)) = self.system.left_inside(structure) {
                let goes_on = is_paper || self.is_free(structure);
                if share >= INSIDE && !goes_on {
                    return Err(self.fail(StepFailure::LeftInside { structure, node, share }, time));
                }
                let least = if goes_on { INSIDE } else { INSIDE_TOLD };
                if share >= least && self.diagnostics.reported.exceeds(Topic::FilmInside, of, share, DEEPER) {
                    let problem = self.left_inside(structure, node, share);
                    let then = if goes_on {
                        String::new()
                    } else {
                        format!(". The run ends if this reaches {:.0} %", 100.0 * INSIDE)
                    };
                    let problem = format!("up to t = {} s, {problem}{then}", shown_time(time));
                    let remedy = self.against_pulling(structure);
                    self.note(Warning::new(Topic::FilmInside, problem, remedy));
                }
            }
            let Some((node, share)) = self.system.pulling(structure, LASTED) else { continue };
            if share >= REFUSED && !is_paper {
                return Err(self.fail(StepFailure::Pulls { structure, node, share }, time));
            }
            if share >= TOLD && self.diagnostics.reported.is_first(Topic::FilmPulls, of) {
                let problem = self.pulls(structure, node, share);
                let then = if is_paper {
                    String::new()
                } else {
                    format!(". The run ends if this reaches {:.0} %", 100.0 * REFUSED)
                };
                let problem = format!("up to t = {} s, {problem}{then}", shown_time(time));
                self.note(Warning::new(Topic::FilmPulls, problem, self.against_pulling(structure)));
            }
        }
        Ok(())
    }

    /// Describes a node at which `film` pulls.
    pub(super) fn pulls(&self, structure: usize, node: usize, share: f64) -> String {
        format!(
            "film has applied a tensile impulse at contact node {}, {:.0} % of the impulse of the most loaded node: it \
             checks for penetration only once, and keeps nodes closed even if other nodes push them away. The forces of individual \
             nodes are wrong by about the same amount",
            self.compiled.node_name(structure, node),
            100.0 * share
        )
    }

    /// Describes a node that `film` left inside a surface.
    pub(super) fn left_inside(&self, structure: usize, node: usize, share: f64) -> String {
        let (surface, length) = if self.is_free(structure) {
            ("surface", "a thousandth of the extent of the contact nodes")
        } else {
            ("casing", "its clearance")
        };
        format!(
            "film has left contact node {} inside the {surface} by {:.2e} m, {} of {length}: it checks for penetration \
             only once, and forces on other nodes have pushed this node in",
            self.compiled.node_name(structure, node),
            share * self.system.clearance_of(structure, node),
            if share < 10.0 { format!("{:.0} %", 100.0 * share) } else { format!("{share:.1e} times the size") }
        )
    }

    /// Returns whether a master is a free body.
    fn is_free(&self, structure: usize) -> bool {
        self.compiled.bodies[structure].translations.is_some()
    }

    /// Returns the remedy.
    pub(super) fn against_pulling(&self, structure: usize) -> String {
        let settings = self.system.settings();
        let highest = self.compiled.bodies[structure].largest_frequency() * self.compiled.stiffest(structure);
        let lcp = if self.compiled.scene.settings.preset == Preset::Paper {
            "Remove `preset` and use solver = \"lcp\" to obtain complementary forces"
        } else {
            "Use solver = \"lcp\""
        };
        let resolved = settings.scheme.properties().resolved_up_to / highest;
        if self.system.step_size() > resolved {
            format!(
                "{lcp}, or set `time.step` (in the FMU `internal_step_max`) below {resolved:.2e} s to reduce the error"
            )
        } else {
            lcp.to_owned()
        }
    }
}
