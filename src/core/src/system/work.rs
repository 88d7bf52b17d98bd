//! The energy ledger's entries of contact.

use super::slave::carrier_of;
use super::{ContactEvent, System, frame_of};
use crate::contact::gap::{Drive, Geometry, dot};
use crate::contact::spline_gap::Frame;
use crate::contact::wrench::{At, Motion};

/// What one contact did over a step (J).
#[derive(Debug, Clone, Copy, Default)]
struct Work {
    shaft: f64,
    whirl: f64,
    shift: f64,
    casing: f64,
    heat: f64,
    /// Half of what the gap has closed by over two steps (m).
    approach: f64,
    /// Of the node that stops at the surface.
    closing: f64,
    /// By the scheme, on both structures.
    exact: f64,
}

impl Work {
    /// What has no other name.
    fn curvature(&self) -> f64 {
        self.exact + self.heat + self.closing - (self.shaft + self.whirl + self.shift + self.casing)
    }
}

impl System {
    /// Enter the work of all contacts that acted over the step just done, whose prescribed motion was `motion`.
    pub(super) fn book_all(&mut self, motion: &Motion) {
        let delayed = self.is_delayed();
        let centred = motion.centred(&self.state.motion);
        let mut events = std::mem::take(if delayed { &mut self.events_before } else { &mut self.events });
        for event in &mut events {
            event.friction_heat = self.book(event, &centred, delayed);
        }
        *(if delayed { &mut self.events_before } else { &mut self.events }) = events;
    }

    /// Enter one contact's work into the ledger; returns its friction heat (J).
    fn book(&mut self, event: &ContactEvent, motion: &Motion, before: bool) -> f64 {
        let work = self.work_of(event, motion, before);
        let (curvature, worn) = (work.curvature(), event.coating * work.approach);
        let ledger = &mut self.state.ledger;
        ledger.wear_work.add(worn);
        ledger.impact_loss.add(work.closing - worn);
        ledger.friction_loss.add(work.heat);
        ledger.shaft_work.add(work.shaft);
        ledger.whirl_work.add(work.whirl);
        ledger.shift_work.add(work.shift);
        ledger.casing_work.add(work.casing);
        ledger.curvature_work.add(curvature);
        ledger.turnover.add(work.shaft.abs() + work.whirl.abs() + work.shift.abs() + work.casing.abs());
        work.heat
    }

    /// The work on both structures is f·(u⁺ − u⁻)/2 with u the relative displacement. It is what inputs do, force times
    /// prescribed motion, less the friction heat, friction force times slip, and what the approach of the node costs, λ
    /// times half the change of gap, but for what turns and curves within the step. On a coating the approach is what its
    /// rods absorb.
    fn work_of(&self, event: &ContactEvent, motion: &Motion, before: bool) -> Work {
        let (node, index) = (event.node, event.node * self.lanes + event.sector);
        let geometry = if before { &self.geometry_before } else { &self.state.geometry };
        let drive = if before { &self.drive_before } else { &self.state.drive };
        let (normal, at) = (geometry.normal_at(index), At { node, index, drive });
        let moved = self.relative_motion(event, index, geometry, drive);
        let tangential: [f64; 3] = std::array::from_fn(|i| event.force[i] - event.normal * normal[i]);
        let spin = self.law.spin_motion(at, event.point, motion);
        let shaft = self.law.shaft_motion(at, event.point, motion);
        let surface = self.law.surface_motion(at, event.point, normal, &geometry.places, motion);
        let slip: [f64; 3] = std::array::from_fn(|i| moved[i] + spin[i] + shaft[i]);
        // A node of a free master that comes over an edge had no gap to close: its motion is the approach.
        let (now, oldest) = (self.state.gap[index], self.gap_oldest[index]);
        let approach = if oldest.is_finite() { -0.5 * (now - oldest) } else { -dot(normal, moved) };
        let [x, y, z] = event.wrench.force;
        Work {
            shaft: -dot(event.force, spin),
            whirl: -(x * motion.shaft[0] + y * motion.shaft[1]),
            shift: -z * motion.shaft[2],
            casing: event.normal * surface,
            heat: -dot(tangential, slip),
            approach,
            closing: event.normal * approach,
            exact: dot(event.force, moved),
        }
    }

    /// Half the displacement of a node relative to the slave over the last two steps (m), in its own directions.
    #[inline(always)]
    pub(super) fn relative_motion(
        &self,
        event: &ContactEvent,
        index: usize,
        geometry: &Geometry,
        drive: &Drive,
    ) -> [f64; 3] {
        let (lanes, now) = (self.lanes, self.bank.displacement());
        let (node, sector) = (event.node, event.sector);
        let mut moved: [f64; 3] = std::array::from_fn(|component| {
            let row = (3 * node + component) * lanes + sector;
            0.5 * (now[row] - self.displacement_oldest[row])
        });
        if let Some((slave, surface)) = carrier_of(&self.slaves, &self.law, node) {
            let slave = slave.moved(surface, geometry.places[index], self.frame(index, drive.rotor_angle));
            moved = std::array::from_fn(|i| moved[i] - slave[i]);
        }
        moved
    }

    /// Directions of a node's own frame at a rotor angle (rad).
    pub(super) fn frame(&self, index: usize, rotor_angle: f64) -> Frame {
        frame_of(&self.law, index, rotor_angle)
    }
}
