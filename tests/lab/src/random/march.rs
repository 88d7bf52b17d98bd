//! A scene stepped through its communication steps, natively or through the C interface of an FMU.

use tiprub_core::{CoSimulation, Error, Simulation};
use tiprub_cosim::variables::{Causality, DataType};
use tiprub_tests::{OK, WARNING, fmi2, fmi3};

use super::inputs::{RandomInput, courses};
use super::scenes::RandomScene;

/// Interface of an instance that can be stepped.
pub(crate) trait SteppedInstance {
    /// Sets an input, with its slope if there is one.
    fn set(&mut self, reference: u32, value: f64, slope: Option<f64>) -> Result<(), String>;
    /// Performs one communication step.
    fn step(&mut self, time: f64, length: f64) -> Result<(), String>;
    /// Returns values as bits.
    fn bits(&self, references: &[u32]) -> Vec<u64>;
}

/// Common data of all runs of a scene.
#[derive(Debug)]
pub(crate) struct RandomPlan {
    courses: Vec<RandomInput>,
    /// References of all real outputs.
    pub outputs: Vec<u32>,
    /// Start of each communication step, and the end of the last (s).
    pub times: Vec<f64>,
    lengths: Vec<f64>,
    slopes: bool,
}

/// Outputs after each communication step, and the reason if the run ended early.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct OutputRecord {
    /// Outputs as bits, for each communication step.
    pub points: Vec<Vec<u64>>,
    /// Message of the step that failed.
    pub end: Option<String>,
}

impl RandomPlan {
    /// Creates the plan of a scene with the variable table of `simulation`, which has not started.
    pub(crate) fn new(trial: &RandomScene, simulation: &Simulation) -> Self {
        let mut times = vec![0.0];
        for length in &trial.lengths {
            times.push(times[times.len() - 1] + length);
        }
        let rows = simulation.table().variables().iter();
        let outputs = rows.filter(|row| row.causality == Causality::Output && row.kind == DataType::Real);
        let outputs = outputs.flat_map(|row| (row.reference..).take(row.len())).collect();
        let slopes = trial.slopes;
        Self { courses: courses(trial, simulation), outputs, times, lengths: trial.lengths.clone(), slopes }
    }

    /// Returns the number of communication steps.
    pub(crate) fn len(&self) -> usize {
        self.lengths.len()
    }

    /// Returns the length of a communication step (s).
    pub(crate) fn length(&self, index: usize) -> f64 {
        self.lengths[index]
    }

    /// Returns the references of all inputs.
    pub(crate) fn inputs(&self) -> Vec<u32> {
        self.courses.iter().map(|course| course.reference).collect()
    }

    /// Sets the inputs of a communication step: to their values at its end, or with slopes to those at its start.
    pub(crate) fn set_inputs(&self, face: &mut impl SteppedInstance, index: usize) -> Result<(), String> {
        for course in &self.courses {
            if self.slopes {
                let (value, slope) = course.at(self.times[index]);
                face.set(course.reference, value, Some(slope))?;
            } else {
                face.set(course.reference, course.at(self.times[index + 1]).0, None)?;
            }
        }
        Ok(())
    }

    /// Performs one communication step with its inputs.
    pub(crate) fn step(&self, face: &mut impl SteppedInstance, index: usize) -> Result<Vec<u64>, String> {
        self.set_inputs(face, index)?;
        face.step(self.times[index], self.lengths[index])?;
        Ok(face.bits(&self.outputs))
    }

    /// Runs from a communication point to the end, or as far as possible.
    pub(crate) fn march<F: SteppedInstance>(
        &self,
        face: &mut F,
        from: usize,
        mut look: impl FnMut(&F, usize),
    ) -> OutputRecord {
        let mut record = OutputRecord::default();
        for index in from..self.len() {
            match self.step(face, index) {
                Ok(point) => record.points.push(point),
                Err(end) => {
                    record.end = Some(end);
                    break;
                }
            }
            look(face, index);
        }
        record
    }
}

impl OutputRecord {
    /// Returns the part after a communication point.
    pub(crate) fn from(&self, index: usize) -> Self {
        Self { points: self.points[index.min(self.points.len())..].to_vec(), end: self.end.clone() }
    }

    /// Returns a description of the first difference from another record; ends are compared by their message.
    pub(crate) fn differs(&self, other: &Self, plan: &RandomPlan, from: usize) -> Option<String> {
        for (index, (own, other)) in self.points.iter().zip(&other.points).enumerate() {
            let off = own.iter().zip(other).position(|(own, other)| own != other);
            if let Some(place) = off {
                let [own, other] = [own[place], other[place]].map(f64::from_bits);
                let (step, reference) = (from + index + 1, plan.outputs[place]);
                return Some(format!("output {reference} is {own:e}, not {other:e}, after communication step {step}"));
            }
        }
        if self.points.len() != other.points.len() {
            let [own, other] = [self, other].map(|record| {
                let end = record.end.as_deref().unwrap_or("reached the end");
                format!("{} steps ({end})", record.points.len())
            });
            return Some(format!("it completes {own} instead of {other}"));
        }
        let ends = [self, other].map(|record| record.end.as_deref().unwrap_or_default());
        (!ends[0].contains(ends[1])).then(|| format!("it ends with {:?} instead of {:?}", ends[0], ends[1]))
    }
}

fn text(error: Error) -> String {
    error.to_string()
}

impl SteppedInstance for Simulation {
    fn set(&mut self, reference: u32, value: f64, slope: Option<f64>) -> Result<(), String> {
        self.set_real(reference, value).map_err(text)?;
        slope.map_or(Ok(()), |slope| self.set_input_derivative(reference, 1, slope).map_err(text))
    }

    fn step(&mut self, time: f64, length: f64) -> Result<(), String> {
        self.do_step(time, length).map_err(text)
    }

    fn bits(&self, references: &[u32]) -> Vec<u64> {
        references.iter().map(|reference| self.real(*reference).unwrap_or(f64::NAN).to_bits()).collect()
    }
}

fn accepted(status: i32, log: impl FnOnce() -> String) -> Result<(), String> {
    if status == OK || status == WARNING { Ok(()) } else { Err(log()) }
}

impl SteppedInstance for fmi2::Fmi2TestSlave<'_> {
    fn set(&mut self, reference: u32, value: f64, slope: Option<f64>) -> Result<(), String> {
        accepted(self.set_reals(&[reference], &[value]), || self.log())?;
        slope.map_or(Ok(()), |slope| accepted(self.set_derivatives(&[reference], 1, &[slope]), || self.log()))
    }

    fn step(&mut self, time: f64, length: f64) -> Result<(), String> {
        accepted(fmi2::Fmi2TestSlave::step(self, time, length), || self.log())
    }

    fn bits(&self, references: &[u32]) -> Vec<u64> {
        self.reals(references).into_iter().map(f64::to_bits).collect()
    }
}

impl SteppedInstance for fmi3::Fmi3TestSlave<'_> {
    fn set(&mut self, reference: u32, value: f64, _slope: Option<f64>) -> Result<(), String> {
        accepted(self.set_reals(&[reference], &[value]), || self.log())
    }

    fn step(&mut self, time: f64, length: f64) -> Result<(), String> {
        accepted(fmi3::Fmi3TestSlave::step(self, time, length).status, || self.log())
    }

    fn bits(&self, references: &[u32]) -> Vec<u64> {
        self.reals(references, references.len()).into_iter().map(f64::to_bits).collect()
    }
}
