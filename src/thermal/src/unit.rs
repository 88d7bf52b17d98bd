//! The simulation as a co-simulation unit. A communication step is one internal step, so there is no time in between at which it could end,
//! and outputs always belong to the last communication point.

use tiprub_cosim::persist::{Persist, StateReader, StateWriter, check_length, damaged, to_bytes};
use tiprub_cosim::variables::{Causality, Value, Variable};
use tiprub_cosim::{CoSimulation, Error, Input, Result, StepProgress, Sum, VariableValues, Warning, bounds, shown};

use crate::outputs::stored;
use crate::simulation::ThermalSimulation;
use crate::state::{CREATED, FAILED, FINGERPRINT_BYTES, LARGEST, READY, ThermalState};
use crate::table::{FACTORS, HEAT, HOLD, Item, STEADY, TEMPERATURES};

/// Largest difference between a communication point and the time of the simulation, as a fraction of H, as in the
/// contact unit.
const TIME_TOLERANCE: f64 = 1e-3;

impl CoSimulation for ThermalSimulation {
    fn variables(&self) -> &VariableValues {
        &self.state.values
    }

    fn is_initialised(&self) -> bool {
        self.state.phase != CREATED
    }

    fn set(&mut self, reference: u32, value: Value) -> Result<()> {
        let (variable, element) = self.check(reference, value)?;
        match self.item(variable) {
            Item::Heat => self.state.heat[element].request(value.number(), 0.0),
            Item::Film(index) => self.state.films[index].request(value.number(), 0.0),
            _ => {}
        }
        self.state.values[reference as usize] = value.number();
        Ok(())
    }

    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()> {
        let (variable, element) = self.check_input_derivative(reference, order, value)?;
        match self.item(variable) {
            Item::Heat => self.state.heat[element].request_slope(value, 0.0),
            Item::Film(index) => self.state.films[index].request_slope(value, 0.0),
            Item::Factor(_) if value == 0.0 => {}
            _ => {
                let what = format!("derivative of `{}`", variable.name);
                let problem = "only heat and the gas and air temperatures can vary within a step";
                return Err(Error::invalid(what, problem, "Set its value at communication points"));
            }
        }
        Ok(())
    }

    /// Computes the derivative under the inputs at the communication point; for means over the step, it is taken from the middle of the
    /// step to that point.
    fn output_derivative(&self, reference: u32, order: i32) -> Result<f64> {
        let (variable, element) = self.table().locate(reference)?;
        variable.check_derivative(element, Causality::Output, order)?;
        Ok(self.rate(self.item(variable), element))
    }

    fn courses(&self) -> Vec<u8> {
        to_bytes(&[&self.state.heat, &self.state.films])
    }

    fn restore_courses(&mut self, courses: &[u8]) {
        let reader = &mut StateReader::new(courses);
        self.state.heat.restore(reader);
        self.state.films.restore(reader);
    }

    fn initialise(&mut self, start_time: f64) -> Result<()> {
        bounds::at_most("start time", start_time, bounds::TIME)?;
        self.state.phase = CREATED;
        self.state.factors_used = self.state.convection_factors(&self.items);
        self.state.heat.iter_mut().chain(&mut self.state.films).for_each(Input::act_immediately);
        self.follow_factors();
        if self.state.value(&self.items, Item::InitialState) >= STEADY {
            self.start_steady()?;
        } else {
            // The uniform temperature is the first coordinate of the model.
            let first = self.model.heat_capacity.sqrt() * self.state.value(&self.items, Item::InitialTemperature);
            let row = self.operator.vectors.row(0);
            self.state.coordinates.iter_mut().zip(row.iter()).for_each(|(z, share)| *z = share * first);
        }
        let state = &mut self.state;
        (state.time, state.last_length, state.last_ramped) = (start_time, 0.0, false);
        (state.powers, state.totals, state.exchanged) = ([0.0; 2], [Sum::default(); 3], 0.0);
        state.initial_heat = stored(&self.operator, &state.coordinates);
        state.phase = READY;
        self.compute_outputs();
        Ok(())
    }

    fn reset(&mut self) {
        self.state = ThermalState::new(self.state.values.clone(), self.model.patches.len(), self.model.order());
        self.under_way = None;
        self.follow_factors();
    }

    fn time(&self) -> f64 {
        self.state.time
    }

    fn take_notes(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.notes)
    }

    fn begin_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        if self.state.phase != READY {
            let remedy = "Initialise, reset or restore the instance";
            return Err(Error::invalid("step", "the simulation is not at a communication point", remedy));
        }
        bounds::within("communication step", step_size, bounds::SHORTEST_STEP, bounds::TIME)?;
        bounds::at_most("end of the communication step", current_time + step_size, bounds::TIME)?;
        let time = self.state.time;
        // Written so that NaN is rejected.
        let off = (current_time - time).abs();
        if off.is_nan() || off > TIME_TOLERANCE * step_size {
            let problem = format!("{} s, but the simulation is at {} s", shown(current_time), shown(time));
            let remedy = "Start the step at the current time of the simulation";
            return Err(Error::invalid("start of the communication step", problem, remedy));
        }
        let heat = self.state.heat.iter().map(|input| (input, &HEAT));
        let films = self.state.films.iter().map(|input| (input, &TEMPERATURES));
        for (input, range) in heat.chain(films) {
            let end = input.requested_value(step_size);
            if !range.contains(&end) {
                let problem =
                    format!("its derivative leads to {} at the end of the step, which is out of range", shown(end));
                let remedy = "Set a new value or derivative";
                return Err(Error::invalid("input", problem, remedy));
            }
        }
        self.under_way = Some([current_time + step_size, step_size]);
        if step_size < self.model.element_time && !self.warned {
            self.warned = true;
            self.notes.push(self.unresolved(step_size));
        }
        Ok(())
    }

    fn advance(&mut self) -> Result<StepProgress> {
        let Some([end, length]) = self.under_way.take() else {
            return Err(Error::invalid("step", "no step was begun", "Begin a step first"));
        };
        self.change_factors();
        let ramp = self.state.value(&self.items, Item::Interpolation) < HOLD;
        let state = &mut self.state;
        state.heat.iter_mut().for_each(Input::act_immediately);
        for film in &mut state.films {
            if ramp { film.ramp(0.0, length) } else { film.act_immediately() }
        }
        for (heat, offset) in self.heat.iter_mut().zip([0.0, length]) {
            heat.iter_mut().zip(&state.heat).for_each(|(heat, input)| *heat = input.at(offset));
        }
        let films = [0.0, length].map(|offset| state.films.map(|film| film.at(offset)));
        let heat = [&self.heat[0][..], &self.heat[1]];
        let heats = self.operator.advance(length, &mut state.coordinates, heat, films);
        for (total, heat) in state.totals.iter_mut().zip(heats) {
            total.add(heat);
            state.exchanged += heat.abs();
        }
        state.powers = [heats[1] / length, heats[2] / length];
        state.heat.iter_mut().chain(&mut state.films).for_each(|input| input.shift(length));
        (state.time, state.last_length, state.last_ramped) = (end, length, ramp);
        self.compute_outputs();
        if let Some(wrong) = self.state.values.iter().position(|value| !value.is_finite()) {
            self.state.phase = FAILED;
            let remedy = format!("Check heat and convection factors; value reference {wrong} became non-finite first");
            return Err(Error::non_finite(end - length, end, remedy));
        }
        Ok(StepProgress { time: end, finished: true })
    }

    fn is_stepping(&self) -> bool {
        self.under_way.is_some()
    }

    fn state_size(&self) -> usize {
        let mut writer = StateWriter::new(&mut []);
        self.state.save(&mut writer);
        FINGERPRINT_BYTES + writer.written()
    }

    fn save_state(&self, buffer: &mut [u8]) -> Result<()> {
        check_length(buffer.len(), self.state_size(), "this model")?;
        let (head, body) = buffer.split_at_mut(FINGERPRINT_BYTES);
        head.copy_from_slice(&self.fingerprint.to_le_bytes());
        self.state.save(&mut StateWriter::new(body));
        Ok(())
    }

    fn restore_state(&mut self, buffer: &[u8]) -> Result<()> {
        check_length(buffer.len(), self.state_size(), "this model")?;
        let (head, body) = buffer.split_at(FINGERPRINT_BYTES);
        if head != self.fingerprint.to_le_bytes() {
            return damaged("it belongs to another model");
        }
        let mut reader = StateReader::new(body);
        reader.up_to(LARGEST);
        self.state.check(&mut reader);
        if let Some(fault) = reader.fault() {
            return damaged(fault);
        }
        let mut state = self.state.clone();
        state.restore(&mut StateReader::new(body));
        state.values.check_values()?;
        let factors = [state.convection_factors(&self.items), state.factors_used];
        let factors_fit = factors.iter().flatten().all(|factor| FACTORS.contains(factor));
        // Inputs without a ramp have an infinite end.
        let infinite_ends = state.heat.iter().chain(&state.films).filter(|input| !input.is_ramp()).count();
        if reader.infinite() != infinite_ends || state.phase > FAILED || !factors_fit || state.last_length < 0.0 {
            return damaged("it contains invalid values");
        }
        self.state = state;
        self.under_way = None;
        self.follow_factors();
        Ok(())
    }

    fn step_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Result<()> {
        self.differentiate_step(outputs, inputs, seed, sensitivity)
    }
}

impl ThermalSimulation {
    pub(crate) fn item(&self, variable: &Variable) -> Item {
        let row = self.table().variables().iter().position(|other| other.reference == variable.reference);
        row.map_or(Item::Constant, |row| self.items[row])
    }
}
