//! Principal pivoting after R. W. Cottle and G. B. Dantzig (Linear Algebra Appl. 1, 1968), one contact at a time.
//!
//! All contacts except the violated ones fulfil their conditions. The force on one violated contact is increased while the closed contacts
//! stay closed; a contact whose multiplier falls to zero opens, and one whose gap falls to zero closes, until the driven contact itself is
//! closed. Fulfilled conditions stay fulfilled, so that for every P-matrix the number of violated contacts falls to zero. The method needs
//! about as many factorisations as contacts change, whereas block exchanges, when they work, need a handful for all.

use super::{ContactSolver, SolverOutcome, ZERO_FRACTION};

impl ContactSolver {
    /// Solves from the current active set, with up to `limit` factorisations.
    pub(super) fn drive_all(&mut self, gap_scale: f64, limit: usize) -> SolverOutcome {
        let mut factorisations = 0;
        while factorisations < limit {
            factorisations += self.start_drive();
            let violated = |slack: &f64| *slack < -ZERO_FRACTION * gap_scale;
            if !self.slack[..self.size].iter().any(violated) {
                return SolverOutcome::direct(self.settle(gap_scale), factorisations);
            }
            while factorisations < limit {
                let open = (0..self.size).filter(|node| !self.active[*node] && violated(&self.slack[*node]));
                let Some(deepest) = open.min_by(|a, b| self.slack[*a].total_cmp(&self.slack[*b])) else { break };
                let spent = self.drive(deepest, gap_scale, limit - factorisations);
                factorisations += spent.factorisations;
                if !spent.solved {
                    return SolverOutcome::direct(false, factorisations);
                }
            }
        }
        SolverOutcome::direct(false, factorisations)
    }

    /// Opens contacts with tensile forces until there are none; multipliers and slacks of that set are the start. Returns the number of
    /// factorisations.
    fn start_drive(&mut self) -> usize {
        for factorisations in 1.. {
            self.solve_active(None);
            let pulling = |node: &usize| self.multipliers[*node] < 0.0;
            if !(0..self.size).any(|node| pulling(&node)) {
                self.correct_gaps();
                self.pressure.copy_from_slice(&self.multipliers);
                self.slack.copy_from_slice(&self.corrected);
                for member in &self.members {
                    self.slack[*member] = 0.0;
                }
                return factorisations;
            }
            for node in 0..self.size {
                self.active[node] &= self.multipliers[node] >= 0.0;
            }
        }
        unreachable!("every round opens a contact")
    }

    /// Drives one violated contact until it is closed. Fails if its force does not open it, or if the limit is reached.
    fn drive(&mut self, driven: usize, gap_scale: f64, limit: usize) -> SolverOutcome {
        for factorisations in 1..=limit {
            self.solve_active(Some(driven));
            self.correct_by(driven);
            let opening = self.corrected[driven];
            if opening.is_nan() || opening <= ZERO_FRACTION * self.delassus[(driven, driven)] {
                return SolverOutcome::direct(false, factorisations);
            }
            let (step, blocking) = self.blocking(driven, -self.slack[driven] / opening, gap_scale);
            for node in 0..self.size {
                self.pressure[node] += step * self.multipliers[node];
                self.slack[node] += step * self.corrected[node];
            }
            self.pressure[driven] += step;
            self.active[blocking] = !self.active[blocking];
            self.slack[blocking] = 0.0;
            if blocking == driven {
                return SolverOutcome::direct(true, factorisations);
            }
            self.pressure[blocking] = 0.0;
        }
        SolverOutcome::direct(false, limit)
    }

    /// Computes the gap of every node per multiplier of the driven node while closed contacts stay closed; 0 for those.
    fn correct_by(&mut self, driven: usize) {
        let size = self.size;
        self.corrected[..size].copy_from_slice(&self.delassus.as_slice()[driven * self.delassus.nrows()..][..size]);
        for member in &self.members {
            let (multiplier, column) = (self.multipliers[*member], self.delassus.column(*member));
            for (moved, flexibility) in self.corrected[..size].iter_mut().zip(column.iter()) {
                *moved += flexibility * multiplier;
            }
        }
        for member in &self.members {
            self.corrected[*member] = 0.0;
        }
    }

    /// Returns the longest step up to `step` that keeps every fulfilled condition, and the contact that ends it.
    fn blocking(&self, driven: usize, step: f64, gap_scale: f64) -> (f64, usize) {
        let mut shortest = (step, driven);
        for node in (0..self.size).filter(|node| *node != driven) {
            let (value, rate) = if self.active[node] {
                (self.pressure[node], self.multipliers[node])
            } else {
                (self.slack[node], self.corrected[node])
            };
            let fulfilled = self.active[node] || value >= -ZERO_FRACTION * gap_scale;
            if fulfilled && rate < 0.0 && value.max(0.0) < -rate * shortest.0 {
                shortest = (value.max(0.0) / -rate, node);
            }
        }
        shortest
    }
}
