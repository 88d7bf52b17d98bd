//! Runs of the methods of `tiprub-reference`.

use tiprub_reference::reduced::{
    ReducedMethod, ReducedScene,
    augmented::{Augmented, NewmarkOptions},
    moreau::Moreau,
    penalty::Penalty,
};

use super::{
    competitor::Competitor,
    run::{StepExtremes, TimedRun},
};

/// Softness of contact in a scene, for augmented Lagrangian and penalty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Softness {
    /// Contact stiffness of the softer penalty (N/m); the augmented Lagrangian has ten times as much.
    pub stiffness: f64,
    /// Penetration that the augmented Lagrangian permits (m).
    pub tolerance: f64,
    /// Distance up to which nodes are included (m).
    pub margin: f64,
}

/// A run of a method of the reference crate.
pub(crate) struct OutsideRun<'a, S: ReducedScene> {
    scene: &'a S,
    method: Box<dyn ReducedMethod + 'a>,
    step: f64,
    steps: u64,
    /// Internal steps per sample.
    division: u32,
}

impl<'a, S: ReducedScene> OutsideRun<'a, S> {
    /// Starts from the initial state of the scene, with `division` steps per sample `interval` (s).
    ///
    /// # Errors
    /// A step that the method rejects; a competitor that does not belong to the reference crate.
    pub(crate) fn new(
        scene: &'a S,
        competitor: Competitor,
        interval: f64,
        division: u32,
        softness: Softness,
    ) -> Result<Self, String> {
        let step = interval / f64::from(division);
        let Softness { stiffness, tolerance, margin } = softness;
        let method: Box<dyn ReducedMethod + 'a> = match competitor {
            Competitor::Moreau => Box::new(Moreau::new(scene, step)),
            Competitor::Augmented => {
                Box::new(Augmented::new(scene, step, NewmarkOptions { penalty: 10.0 * stiffness, tolerance, margin }))
            }
            Competitor::Penalty(times) => Box::new(Penalty::new(scene, step, f64::from(times) * stiffness)?),
            Competitor::Core(..) | Competitor::Full(_) => {
                return Err("this method is not in the reference crate".into());
            }
        };
        Ok(Self { scene, method, step, steps: 0, division })
    }

    #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
    fn one(&mut self, seen: Option<&mut StepExtremes>) -> Result<(), String> {
        let step = self.method.step()?;
        self.steps += 1;
        if let Some(seen) = seen {
            let forces = step.forces.iter().map(|(_, force)| *force);
            seen.add(self.steps as f64 * self.step, self.step, forces, step.least_gap);
        }
        Ok(())
    }
}

impl<S: ReducedScene> TimedRun for OutsideRun<'_, S> {
    fn advance(&mut self) -> Result<(), String> {
        (0..self.division).try_for_each(|_| self.one(None))
    }

    fn watch(&mut self, seen: &mut StepExtremes) -> Result<(), String> {
        (0..self.division).try_for_each(|_| self.one(Some(seen)))
    }

    fn displacements(&self) -> Vec<f64> {
        self.scene.observed(self.method.state().0)
    }

    fn energy(&self) -> f64 {
        let potential: f64 = self.scene.load().iter().zip(self.method.state().0).map(|(f, q)| f * q).sum();
        self.method.energy() - potential
    }

    fn residual(&self) -> Option<f64> {
        None
    }
}
