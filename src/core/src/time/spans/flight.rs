//! Free flight over many spans: blades whose vibration is below the tolerance and that nothing comes near.

use super::Galerkin;
use crate::geometry::PrescribedMotion;
use crate::geometry::wrench::At;
use crate::modes::sectors::Sectors;
use crate::system::{ContactPair, Structure, System};

impl System {
    /// Advances all sectors in free flight by `length` (s) to the time described by `drives`; rotors turn by `turns` relative to
    /// the shapes (rad), with one entry of both per pair. During the flight, prescribed motion is linear in time, except that of
    /// the rotor. Returns false, without any change, if something may come near or if blades vibrate by more than the tolerance.
    pub(crate) fn fly(&mut self, drives: &[PrescribedMotion], turns: &[f64], length: f64) -> bool {
        let Self { structures, pairs, .. } = self;
        for structure in structures.iter_mut() {
            let Some(mut galerkin) = structure.galerkin.take() else { return false };
            let mut lowest = std::mem::take(&mut structure.lowest_in_span);
            let free = structure.is_free(&mut galerkin, &mut lowest, pairs, (drives, turns));
            (structure.galerkin, structure.lowest_in_span) = (Some(galerkin), lowest);
            if !free {
                return false;
            }
        }
        for (pair, drive) in pairs.iter_mut().zip(drives) {
            pair.move_to(drive, length);
        }
        for structure in structures {
            let Some(mut galerkin) = structure.galerkin.take() else { continue };
            let sectors = structure.fly(&mut galerkin, length);
            structure.galerkin = Some(galerkin);
            self.counted.effort.steps += sectors;
            self.counted.effort.flights += sectors;
        }
        self.events.now.clear();
        self.events.before.clear();
        self.find_gaps(true);
        self.counted.steps += 1;
        true
    }
}

impl Structure {
    /// Returns whether no sector touches anything, vibrates by more than the tolerance or can touch during the flight; `lowest`
    /// then contains the smallest gaps during the flight.
    fn is_free(
        &self,
        galerkin: &mut Galerkin,
        lowest: &mut [f64],
        pairs: &[ContactPair],
        (ends, turns): (&[PrescribedMotion], &[f64]),
    ) -> bool {
        let Galerkin { tables, marcher, state, demand, .. } = galerkin;
        let Some(bank) = self.bank() else { return false };
        (0..self.modes().sectors()).all(|sector| {
            bank.read_sector(sector, &mut state.position, &mut state.velocity);
            let reach = marcher.largest_displacements(&tables[bank.set_number(sector)], state);
            reach.iter().all(|reach| *reach <= demand.tolerance)
                && (0..self.nodes()).all(|node| {
                    let index = self.index(node, sector);
                    let Some(pair) = self.pair_of[node] else { return true };
                    let at = At { node, index, drive: pairs[pair].drive_now() };
                    let reach = std::array::from_fn(|component| reach[3 * node + component]);
                    let least = pairs[pair].gap().least(at, &ends[pair], turns[pair], reach).unwrap_or(0.0);
                    lowest[index] = least;
                    self.history.multiplier[index] == 0.0 && least > 0.0
                })
        })
    }

    /// Advances all sectors and returns their number.
    fn fly(&mut self, galerkin: &mut Galerkin, length: f64) -> u64 {
        self.begin_span();
        let sectors = self.modes().sectors();
        let Galerkin { tables, flights, marcher, state, .. } = galerkin;
        flights.iter_mut().for_each(|flight| flight.set_length(length));
        state.forces.fill(0.0);
        if let Sectors::Uncoupled(bank) = self.modes_mut() {
            for sector in 0..sectors {
                let set = bank.set_number(sector);
                bank.read_sector(sector, &mut state.position, &mut state.velocity);
                let loss = flights[set].take(&mut state.position, &mut state.velocity);
                let moved = marcher.displacements(&tables[set], state);
                bank.write_sector(sector, &state.position, &state.velocity, &state.forces, moved);
                bank.lose(sector, loss);
            }
            bank.flush();
        }
        self.step_control.level.fill(0);
        sectors as u64
    }
}
