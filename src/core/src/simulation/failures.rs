//! Messages for failed steps: cause, place and remedy.

use tiprub_cosim::shown_time;

use super::Simulation;
use super::checks::{OUT_OF_REACH, OUT_OF_REACH_REMEDY};
use super::clock::SimulationPhase;
use crate::Error;
use crate::system::{ContactPair, Curved, StepFailure};

impl Simulation {
    /// Returns the error of a step that should have ended at `time`; the simulation must be restored or reset afterwards.
    pub(super) fn fail(&mut self, failure: StepFailure, time: f64) -> Error {
        self.state.clock.phase = SimulationPhase::Failed;
        if failure == StepFailure::NonFinite {
            return Error::non_finite(self.state.clock.time, time, "Use a smaller internal step or smaller loads");
        }
        let (problem, remedy) = self.failure_texts(failure);
        Error::unstable(
            format!("at t = {} s (last good time {} s) {problem}", shown_time(time), shown_time(self.state.clock.time)),
            remedy,
        )
    }

    /// Returns the problem and the remedy.
    pub(super) fn failure_texts(&self, failure: StepFailure) -> (String, String) {
        let is_free = |structure: usize| self.compiled.bodies[structure].translations.is_some();
        match failure {
            StepFailure::Implausible { structure, .. } if is_free(structure) => {
                free_failure(self.compiled.structure_name(structure))
            }
            StepFailure::Unsolved { structure, .. } if is_free(structure) => self.unsolved(
                structure,
                self.compiled.structure_name(structure),
                if self.is_marched() {
                    "Use less friction, a larger `tolerance`, another maximum internal step, or the solver coulomb"
                } else {
                    "Use less friction, another internal step or the solver coulomb"
                },
            ),
            // The remedy is given elsewhere.
            StepFailure::NonFinite => ("the displacements are not finite".to_owned(), String::new()),
            StepFailure::Exhausted => (String::new(), String::new()),
            StepFailure::Implausible { structure, sector } => (
                format!(
                    "a contact node of {} is displaced by more than a tenth of its radius, has penetrated the \
                     casing by as much, or touches a flank of the casing shape that is steeper than 45°{}",
                    self.sector_name(structure, sector),
                    self.instability(structure)
                ),
                "Check gap, casing shape, loads and inputs; the model assumes small displacements".to_owned(),
            ),
            StepFailure::CarrierImplausible { structure } => self.carrier_failure(structure),
            StepFailure::Curved(curved) => self.curved_failure(curved),
            StepFailure::OutOfReach { structure, node, sector } => (
                format!(
                    "contact node {} of {} has left the casing surface in the axial direction: it is beyond the first \
                     or last ring by more than {OUT_OF_REACH}",
                    self.compiled.node_name(structure, node),
                    self.sector_name(structure, sector)
                ),
                OUT_OF_REACH_REMEDY.to_owned(),
            ),
            StepFailure::Unexplained { structure, node, sector, jump, explained } => {
                self.jump_texts((structure, node, sector), jump, explained)
            }
            StepFailure::Unbalanced { set, work, exchanged } => (
                format!(
                    "contact forces{} have added {work:.3e} J of spurious energy, out of {exchanged:.3e} J exchanged: \
                     contact normals rotate too far, or nodes move too far along curved surfaces, within an internal step (curvature work)",
                    self.of_set(set)
                ),
                "Use a smaller internal step".to_owned(),
            ),
            StepFailure::Gives { set, loss, given, exchanged } => self.gain_texts(set, loss, [given, exchanged]),
            StepFailure::Pulls { structure, node, share } => {
                (self.pulls(structure, node, share), self.against_pulling(structure))
            }
            StepFailure::LeftInside { structure, node, share } => {
                (self.left_inside(structure, node, share), self.against_pulling(structure))
            }
            StepFailure::TooFast { structure } => (
                format!(
                    "contact nodes of {} move by more than a tenth of the extent of the contact nodes in one internal \
                     step, and could pass through a surface undetected",
                    self.compiled.structure_name(structure)
                ),
                "Use a smaller internal step or a lower velocity".to_owned(),
            ),
            StepFailure::BehindEdge { structure, node } => self.edge_texts(structure, node),
            StepFailure::Unsolved { structure, sector } => self.unsolved(
                structure,
                &self.sector_name(structure, sector),
                if self.is_marched() {
                    "Use less friction, a larger `tolerance`, or another maximum internal step"
                } else {
                    "Use less friction or another internal step"
                },
            ),
        }
    }

    fn jump_texts(
        &self,
        (structure, node, sector): (usize, usize, usize),
        jump: f64,
        explained: f64,
    ) -> (String, String) {
        (
            format!(
                "the gap of contact node {} of {} has changed by {jump:.3e} m in two steps, but the motion of the node and the \
                 casing explains only {explained:.3e} m: the work of this contact cannot be determined",
                self.compiled.node_name(structure, node),
                self.sector_name(structure, sector)
            ),
            "Use a smaller internal step; if that does not help, the surface is folded or has more than one closest point \
             there"
                .to_owned(),
        )
    }

    fn edge_texts(&self, structure: usize, node: usize) -> (String, String) {
        (
            format!(
                "contact node {} has passed the edge of a surface and is already behind it: contact at edges is not \
                 modelled, and pushing the node out would be an impact of arbitrary strength",
                self.compiled.node_name(structure, node)
            ),
            "Extend the contact grid to cover the whole range of the nodes, or move one of the structures; check that \
             the normal of each contact grid (direction from row to row x direction along the rows) points to the master"
                .to_owned(),
        )
    }

    /// Returns the texts for a contact problem without a solution. Friction can cause this; without it only contacts that no motion opens
    /// immediately.
    fn unsolved(&self, structure: usize, name: &str, with_friction: &str) -> (String, String) {
        let sets = self.system.sets();
        let felt = |pair: &ContactPair| sets.of(pair.structure()) == sets.of(structure);
        if self.system.pairs().iter().any(|pair| felt(pair) && pair.parts.parameters.cutting > 0.0) {
            let problem = format!("the contact problem of {name} has no solution{}", self.instability(structure));
            return (problem, "Use a larger `normal_ratio`, less friction or another internal step".to_owned());
        }
        if self.system.pairs().iter().any(|pair| felt(pair) && pair.parts.parameters.friction > 0.0) {
            return (format!("the contact problem of {name} has no solution"), with_friction.to_owned());
        }
        (
            format!(
                "the contact problem of {name} has no solution: no motion of the modes moves all penetrating contact \
                 nodes out of the surface simultaneously"
            ),
            "Use a ROM with more modes or fewer contact nodes, or place the surfaces further apart".to_owned(),
        )
    }

    fn carrier_failure(&self, structure: usize) -> (String, String) {
        let open = self.system.pairs().iter().any(|pair| {
            pair.carrier().is_some_and(|carrier| carrier.structure == structure) && pair.gap().layout().is_none()
        });
        if open {
            let name = self.compiled.structure_name(structure);
            let problem = format!(
                "{name}, which carries a surface, is displaced by more than a tenth of the extent of the contact nodes"
            );
            return (problem, BESIDE_FLIGHT.to_owned());
        }
        let name = self.compiled.carrier_name(structure);
        (
            format!("the {name} is displaced by more than a tenth of the radius"),
            "Check its loads and temperatures; the model assumes small displacements".to_owned(),
        )
    }

    fn curved_failure(&self, curved: Curved) -> (String, String) {
        let problem = format!(
            "contact node {} of {} is displaced by {:.3e} m around the axis: gaps are linear in displacements, and the \
             neglected u²/2r = {:.2e} m is as large as the clearance of {:.2e} m{}",
            self.compiled.node_name(curved.structure, curved.node),
            self.sector_name(curved.structure, curved.sector),
            curved.moved,
            curved.error,
            curved.clearance,
            self.instability(curved.structure)
        );
        let remedy = "Check casing shape, friction, loads and inputs; the model assumes small displacements";
        (problem, remedy.to_owned())
    }

    /// Returns the name of a sector, with the name of its structure if there are several masters.
    pub(super) fn sector_name(&self, structure: usize, sector: usize) -> String {
        let of = match self.compiled.bodies.len() {
            1 => String::new(),
            _ => format!(" of {}", self.compiled.body(structure).0.name),
        };
        format!("sector {}{of}", sector + 1)
    }

    /// Returns the names of the structures of a set if there are several sets.
    pub(super) fn of_set(&self, set: usize) -> String {
        let sets = self.system.sets();
        if sets.count() == 1 {
            return String::new();
        }
        let names: Vec<&str> = sets.members(set).iter().map(|member| self.compiled.structure_name(*member)).collect();
        format!(" of {}", names.join(", "))
    }

    /// Describes growth of sliding contact of this structure, or of another one in its set, as the likely cause of a failure.
    fn instability(&self, structure: usize) -> String {
        let Some(limits) = &self.diagnostics.limits else { return String::new() };
        let sets = self.system.sets();
        let others = sets.members(sets.of(structure)).iter().copied();
        let mut bodies = std::iter::once(structure).chain(others).filter(|body| *body < self.state.inputs.rotors.len());
        let speed = |body: usize| self.state.inputs.rotors[body].speed.at(0.0);
        let found = bodies.find_map(|body| limits.grows(body, speed(body)));
        found.map_or_else(String::new, |finding| format!(". {}", self.compiled.warning(&finding)))
    }
}

const BESIDE_FLIGHT: &str =
    "Check positions and velocity; the model assumes small displacements relative to the rigid-body motion";

/// Returns the problem and the remedy of a failure that has a different meaning for a free body.
fn free_failure(name: &str) -> (String, String) {
    let problem = format!(
        "contact nodes of {name} have moved relative to each other, or into a surface, by more than a tenth of the \
         extent of the contact nodes"
    );
    (problem, BESIDE_FLIGHT.to_owned())
}
