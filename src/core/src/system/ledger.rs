//! Energy ledger: kinetic + strain = initial + external work + curvature work + load work + excitation work + step changes − damping −
//! friction − impact losses − wear work.
//!
//! All terms belong to the discrete equations (see [`crate::modes::schemes`]), so the residual of the balance measures rounding and
//! programming errors, not the truncation error of the scheme.

use tiprub_cosim::{Sum, persist_fields};

/// Defines the ledger from the list of its sums.
macro_rules! ledger {
    ($count:literal: $($(#[$text:meta])* $sum:ident),* $(,)?) => {
        /// Work and losses since the start (J).
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct Ledger {
            /// Kinetic plus strain energy at the start.
            pub initial: f64,
            $($(#[$text])* pub $sum: Sum,)*
        }

        persist_fields!(Ledger { initial, $($sum),* });

        impl Ledger {
            fn sums(&mut self) -> [&mut Sum; $count] {
                [$(&mut self.$sum),*]
            }
        }
    };
}

ledger! { 17:
    /// Loss by modal damping.
    damping_loss,
    /// Friction heat: µλ times the slip, which includes the rigid motion.
    friction_loss,
    /// Energy that the contact nodes lose when a gap closes within a step.
    impact_loss,
    /// Work of the coating's normal force on the approaching blades.
    wear_work,
    /// Work of cutting the coating: specific cutting energy times volume.
    cutting_work,
    /// Energy consumed by the wear of the cells, not part of the balance: ∫(Y + Kε_p) dε_p of compressed cells, and
    /// `cutting_work`, cell by cell, of cut cells.
    wear_energy,
    /// Work of centrifugal, thermal and nodal-diameter loads.
    load_work,
    /// Work of the excitation of blades.
    excitation_work,
    /// Work of the shaft through the contacts, −∫ torque dθ_r; for obstacles at rest, the work of sliding along them.
    shaft_work,
    /// Work of the shaft on rotors whose modes depend on the speed: change of strain energy by stiffening.
    stiffening_work,
    /// Work of whirl, −∫ F·de.
    whirl_work,
    /// Work of axial shift.
    shift_work,
    /// Work of the prescribed motion of the casing along the contact normals.
    casing_work,
    /// Difference between the work of contact forces in the scheme and all other terms, caused by turning normals and
    /// curved surfaces within a step. It vanishes with the step length.
    curvature_work,
    /// Energy added or removed when the state is converted to another step size.
    step_change,
    /// Sum of the magnitudes of all external work, the scale of the residual.
    turnover,
    /// Sum of the magnitudes of the work that contact forces do on the structures, in both directions.
    contact_work,
}

impl Ledger {
    /// Work of all inputs except loads (J): shaft, whirl, axial shift, moving casing.
    pub fn external_work(&self) -> f64 {
        let mut sum = Sum::default();
        self.inputs().into_iter().for_each(|work| sum.add(work.value()));
        sum.value()
    }

    fn inputs(&self) -> [Sum; 5] {
        [self.shaft_work, self.stiffening_work, self.whirl_work, self.shift_work, self.casing_work]
    }

    fn losses(&self) -> [Sum; 5] {
        [self.damping_loss, self.friction_loss, self.impact_loss, self.wear_work, self.cutting_work]
    }

    /// Returns the sum of the entries of two sets of structures.
    pub fn with(mut self, other: &Self) -> Self {
        self.initial += other.initial;
        let mut other = *other;
        self.sums().into_iter().zip(other.sums()).for_each(|(sum, term)| sum.add(term.value()));
        self
    }

    /// Residual of the energy balance (J): expected minus actual energy, where `mechanical` is the current kinetic and strain energy.
    pub fn residual(&self, mechanical: f64) -> f64 {
        let mut balance = Sum::default();
        balance.add(self.initial);
        let gains = self.inputs().into_iter().chain([self.curvature_work, self.step_change]);
        gains.for_each(|work| balance.add(work.value()));
        self.losses().into_iter().for_each(|loss| balance.add(-loss.value()));
        [self.load_work, self.excitation_work].into_iter().for_each(|work| balance.add(work.value()));
        balance.add(-mechanical);
        balance.value()
    }

    /// Returns the sum of all supplied and lost energy (J).
    pub fn exchanged(&self) -> f64 {
        self.scale() + self.losses().iter().map(|loss| loss.value().abs()).sum::<f64>()
    }

    /// Energy supplied to vibration since the start by forces times velocities (J): work of inputs and loads and step changes,
    /// less friction heat, damping loss and work on the coating. Impacts only dissipate energy and are left out.
    pub fn supplied(&self) -> f64 {
        let put_in = self.external_work() + self.load_work.value() + self.step_change.value();
        let put_in = put_in + self.excitation_work.value();
        let left = put_in - self.friction_loss.value() - self.damping_loss.value();
        left - self.wear_work.value() - self.cutting_work.value()
    }

    /// Returns the scale of the residual (J): initial energy plus all exchanged external work.
    pub fn scale(&self) -> f64 {
        self.initial.abs() + self.turnover.value()
    }
}
