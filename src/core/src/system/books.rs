//! The energy ledger's entries of contact.

use super::slave::carrier_of;
use super::{ContactEvent, System, frame_of};
use crate::contact::gap::{Drive, Geometry, dot};
use crate::contact::spline_gap::Frame;

impl System {
    /// Enter the work of all contacts that acted over the step just done.
    pub(super) fn book_all(&mut self, drive: &Drive) {
        if self.is_delayed() {
            let mut events = std::mem::take(&mut self.events_before);
            for event in &mut events {
                event.friction_heat = self.book(event, drive, true);
            }
            self.events_before = events;
        } else {
            let mut events = std::mem::take(&mut self.events);
            for event in &mut events {
                event.friction_heat = self.book(event, drive, false);
            }
            self.events = events;
        }
    }

    /// Enter one contact's work into the ledger; returns its friction heat (J).
    ///
    /// The work on both structures is f·(u⁺ − u⁻)/2 with u the relative displacement. Its normal part splits into what
    /// the approach of the node costs (λ times half the change of gap) and what prescribed motion does; its
    /// tangential part into the heat, friction force times slip, and what the prescribed sliding supplies. On a
    /// coating the approach is what its rods absorb.
    fn book(&mut self, event: &ContactEvent, drive: &Drive, before: bool) -> f64 {
        let index = event.node * self.lanes + event.sector;
        let geometry = if before { &self.geometry_before } else { &self.state.geometry };
        let normal = geometry.normal_at(index);
        let angle = if before { self.state.angle_before } else { self.state.angle };
        let moved = self.relative_motion(event, index, geometry, angle);
        let tangential: [f64; 3] = std::array::from_fn(|i| event.force[i] - event.normal * normal[i]);
        // A node of a free master that comes over an edge had no gap to close: its motion is the approach.
        let (now, oldest) = (self.state.gap[index], self.gap_oldest[index]);
        let approach = if oldest.is_finite() { -0.5 * (now - oldest) } else { -dot(normal, moved) };
        let closing = event.normal * approach;
        let pushed = event.normal * dot(normal, moved) + closing;
        let supplied = -dot(tangential, self.law.sliding_velocity(event.node, index, drive)) * self.bank.step();
        let heat = supplied - dot(tangential, moved);
        let ledger = &mut self.state.ledger;
        let worn = event.coating * approach;
        ledger.wear_work.add(worn);
        ledger.impact_loss.add(closing - worn);
        ledger.friction_loss.add(heat);
        ledger.external_work.add(pushed + supplied);
        ledger.turnover.add(pushed.abs() + supplied.abs());
        heat
    }

    /// Half the displacement of a node relative to the slave over the last two steps (m), in its own directions.
    #[inline(always)]
    pub(super) fn relative_motion(
        &self,
        event: &ContactEvent,
        index: usize,
        geometry: &Geometry,
        angle: f64,
    ) -> [f64; 3] {
        let (lanes, now) = (self.lanes, self.bank.displacement());
        let (node, sector) = (event.node, event.sector);
        let mut moved: [f64; 3] = std::array::from_fn(|component| {
            let row = (3 * node + component) * lanes + sector;
            0.5 * (now[row] - self.displacement_oldest[row])
        });
        if let Some((slave, surface)) = carrier_of(&self.slaves, &self.law, node) {
            let slave = slave.moved(surface, geometry.places[index], self.frame(index, angle));
            moved = std::array::from_fn(|i| moved[i] - slave[i]);
        }
        moved
    }

    /// Directions of a node's own frame at a rotor angle (rad).
    pub(super) fn frame(&self, index: usize, rotor_angle: f64) -> Frame {
        frame_of(&self.law, index, rotor_angle)
    }
}
