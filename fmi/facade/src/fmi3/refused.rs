//! Functions of capabilities that this FMU does not have: they are exported because importers look all of them up, and
//! rejected with a message. Their arguments are not touched.

use super::Boolean;
use crate::boundary::{In, Out, refused};

const MODEL_EXCHANGE: &str = "Model Exchange interface";
const SCHEDULED_EXECUTION: &str = "Scheduled Execution interface";
const EVENT_MODE: &str = "Event Mode";
const CLOCKS: &str = "clocks";
const DEPENDENCIES: &str = "per-element dependencies";
const CONFIGURATION: &str = "structural parameters";

refused! {
    fmi3EnterEventMode() EVENT_MODE;
    fmi3EnterStepMode() EVENT_MODE;
    fmi3EvaluateDiscreteStates() EVENT_MODE;
    fmi3UpdateDiscreteStates(
        _discreteStatesNeedUpdate: Out<Boolean>, _terminateSimulation: Out<Boolean>,
        _nominalsOfContinuousStatesChanged: Out<Boolean>, _valuesOfContinuousStatesChanged: Out<Boolean>,
        _nextEventTimeDefined: Out<Boolean>, _nextEventTime: Out<f64>
    ) EVENT_MODE;

    fmi3EnterConfigurationMode() CONFIGURATION;
    fmi3ExitConfigurationMode() CONFIGURATION;

    fmi3GetNumberOfVariableDependencies(_valueReference: u32, _nDependencies: Out<usize>) DEPENDENCIES;
    fmi3GetVariableDependencies(
        _dependent: u32, _elementIndicesOfDependent: Out<usize>, _independents: Out<u32>,
        _elementIndicesOfIndependents: Out<usize>, _dependencyKinds: Out<i32>, _nDependencies: usize
    ) DEPENDENCIES;

    fmi3GetIntervalDecimal(
        _valueReferences: In<u32>, _nValueReferences: usize, _intervals: Out<f64>, _qualifiers: Out<i32>
    ) CLOCKS;
    fmi3GetIntervalFraction(
        _valueReferences: In<u32>, _nValueReferences: usize,
        _counters: Out<u64>, _resolutions: Out<u64>, _qualifiers: Out<i32>
    ) CLOCKS;
    fmi3GetShiftDecimal(_valueReferences: In<u32>, _nValueReferences: usize, _shifts: Out<f64>) CLOCKS;
    fmi3GetShiftFraction(
        _valueReferences: In<u32>, _nValueReferences: usize, _counters: Out<u64>, _resolutions: Out<u64>
    ) CLOCKS;
    fmi3SetIntervalDecimal(_valueReferences: In<u32>, _nValueReferences: usize, _intervals: In<f64>) CLOCKS;
    fmi3SetIntervalFraction(
        _valueReferences: In<u32>, _nValueReferences: usize, _counters: In<u64>, _resolutions: In<u64>
    ) CLOCKS;
    fmi3SetShiftDecimal(_valueReferences: In<u32>, _nValueReferences: usize, _shifts: In<f64>) CLOCKS;
    fmi3SetShiftFraction(
        _valueReferences: In<u32>, _nValueReferences: usize, _counters: In<u64>, _resolutions: In<u64>
    ) CLOCKS;

    fmi3EnterContinuousTimeMode() MODEL_EXCHANGE;
    fmi3CompletedIntegratorStep(
        _noSetFMUStatePriorToCurrentPoint: Boolean, _enterEventMode: Out<Boolean>, _terminateSimulation: Out<Boolean>
    ) MODEL_EXCHANGE;
    fmi3SetTime(_time: f64) MODEL_EXCHANGE;
    fmi3SetContinuousStates(_continuousStates: In<f64>, _nContinuousStates: usize) MODEL_EXCHANGE;
    fmi3GetContinuousStateDerivatives(_derivatives: Out<f64>, _nContinuousStates: usize) MODEL_EXCHANGE;
    fmi3GetEventIndicators(_eventIndicators: Out<f64>, _nEventIndicators: usize) MODEL_EXCHANGE;
    fmi3GetContinuousStates(_continuousStates: Out<f64>, _nContinuousStates: usize) MODEL_EXCHANGE;
    fmi3GetNominalsOfContinuousStates(_nominals: Out<f64>, _nContinuousStates: usize) MODEL_EXCHANGE;
    fmi3GetNumberOfEventIndicators(_nEventIndicators: Out<usize>) MODEL_EXCHANGE;
    fmi3GetNumberOfContinuousStates(_nContinuousStates: Out<usize>) MODEL_EXCHANGE;

    fmi3ActivateModelPartition(_clockReference: u32, _activationTime: f64) SCHEDULED_EXECUTION;
}
