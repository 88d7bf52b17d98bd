//! Derivatives: of outputs with respect to time at a communication point, and of outputs at the end of the last step
//! with respect to inputs over it.

use tiprub_cosim::variables::Variable;
use tiprub_cosim::{CoSimulation, Error, Result};

use crate::simulation::ThermalSimulation;
use crate::table::Item;

impl ThermalSimulation {
    /// Returns the rate of an output at the communication point.
    pub(crate) fn rate(&self, item: Item, element: usize) -> f64 {
        let (state, operator) = (&self.state, &self.operator);
        let heat: Vec<f64> = state.heat.iter().map(|input| input.at(0.0)).collect();
        let films = state.films.map(|input| input.at(0.0));
        let rate = |coordinate: usize| {
            operator.load(coordinate, &heat, films) - operator.rates[coordinate] * state.coordinates[coordinate]
        };
        let rates: Vec<f64> = (0..operator.rates.len()).map(rate).collect();
        let flow = |film: usize| {
            let back: f64 = operator.films[film].iter().zip(&state.coordinates).map(|(a, b)| a * b).sum();
            operator.conductances[film] * films[film] - back
        };
        match item {
            Item::Power(film) if state.last_length > 0.0 => {
                (flow(film) - state.powers[film]) / (0.5 * state.last_length)
            }
            _ => self.linear(item, element, &rates, [heat.iter().sum(), flow(0), flow(1)]).unwrap_or(0.0),
        }
    }

    /// Implements [`tiprub_cosim::CoSimulation::step_derivative`]. Exact: constant changes of heat over the step, and of temperatures with their
    /// actual course.
    pub(crate) fn differentiate_step(
        &self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Result<()> {
        let length = self.state.last_length;
        if length <= 0.0 {
            let remedy = "Request derivatives after a communication step";
            return Err(Error::invalid("derivatives", "no communication step has been done yet", remedy));
        }
        let mut heat = vec![0.0; self.model.patches.len()];
        let mut films = [0.0; 2];
        for (&input, &seed) in inputs.iter().zip(seed) {
            let (variable, element) = self.check_seed(input, seed)?;
            match self.item(variable) {
                Item::Heat => heat[element] += seed,
                Item::Film(index) => films[index] += seed,
                _ => {
                    return Err(refused(variable, "only heat and the gas and air temperatures act linearly"));
                }
            }
        }
        // A ramp begins where the previous step ended, whatever value is set.
        let begin = if self.state.last_ramped { [0.0; 2] } else { films };
        let mut change = vec![0.0; self.model.order()];
        let heats = self.operator.advance(length, &mut change, [&heat, &heat], [begin, films]);
        for (&output, sensitivity) in outputs.iter().zip(sensitivity) {
            let (variable, element) = self.table().locate(output)?;
            let item = self.item(variable);
            *sensitivity = match item {
                Item::Power(film) => heats[1 + film] / length,
                Item::Residual | Item::RelativeResidual => 0.0,
                _ => self
                    .linear(item, element, &change, heats)
                    .ok_or_else(|| refused(variable, "it is not an output"))?,
            };
        }
        Ok(())
    }
}

fn refused(variable: &Variable, problem: &str) -> Error {
    Error::invalid(format!("derivative involving `{}`", variable.name), problem, "Remove it from the request")
}
