//! Functions against the states in which they are allowed, from the text of the standards: FMI 2.0.4 section 4.2.4 (table of allowed
//! calls against states) and FMI 3.0.2 sections 2.3 and 4.2 (text of each state). Letters are states; "-" is a function whose
//! capability this FMU does not claim.

/// FMI 2.0: I instantiated, N Initialization Mode, S stepComplete, F stepFailed, T terminated. Getters are allowed in I
/// beyond the standard, for values that have a start value.
pub const FMI2: &str = "
fmi2SetDebugLogging INSFT
fmi2SetupExperiment I
fmi2EnterInitializationMode I
fmi2ExitInitializationMode N
fmi2Terminate SF
fmi2Reset INSFT
fmi2GetReal INSFT
fmi2GetInteger INSFT
fmi2GetBoolean INSFT
fmi2GetString INSFT
fmi2SetReal INS
fmi2SetInteger INS
fmi2SetBoolean INS
fmi2SetString INS
fmi2GetFMUstate INSFT
fmi2SetFMUstate INSFT
fmi2FreeFMUstate INSFT
fmi2SerializedFMUstateSize INSFT
fmi2SerializeFMUstate INSFT
fmi2DeSerializeFMUstate INSFT
fmi2SetRealInputDerivatives INS
fmi2GetRealOutputDerivatives SFT
fmi2DoStep S
fmi2CancelStep
fmi2GetStatus SFT
fmi2GetRealStatus SFT
fmi2GetIntegerStatus SFT
fmi2GetBooleanStatus SFT
fmi2GetStringStatus SFT
fmi2GetDirectionalDerivative -
fmi2EnterEventMode -
fmi2NewDiscreteStates -
fmi2EnterContinuousTimeMode -
fmi2CompletedIntegratorStep -
fmi2SetTime -
fmi2SetContinuousStates -
fmi2GetDerivatives -
fmi2GetEventIndicators -
fmi2GetContinuousStates -
fmi2GetNominalsOfContinuousStates -
";

/// Functions not called on an instance that is used further, or on any instance.
pub const FMI2_APART: &str = "fmi2GetTypesPlatform fmi2GetVersion fmi2Instantiate fmi2FreeInstance";

/// FMI 3.0: as above, and U Intermediate Update Mode.
pub const FMI3: &str = "
fmi3SetDebugLogging INSUFT
fmi3EnterInitializationMode I
fmi3ExitInitializationMode N
fmi3Terminate SF
fmi3Reset INSFT
fmi3GetFloat32 INSUFT
fmi3GetFloat64 INSUFT
fmi3GetInt8 INSUFT
fmi3GetUInt8 INSUFT
fmi3GetInt16 INSUFT
fmi3GetUInt16 INSUFT
fmi3GetInt32 INSUFT
fmi3GetUInt32 INSUFT
fmi3GetInt64 INSUFT
fmi3GetUInt64 INSUFT
fmi3GetBoolean INSUFT
fmi3GetString INSUFT
fmi3GetBinary INSUFT
fmi3GetClock INSUFT
fmi3SetFloat32 INSU
fmi3SetFloat64 INSU
fmi3SetInt8 INSU
fmi3SetUInt8 INSU
fmi3SetInt16 INSU
fmi3SetUInt16 INSU
fmi3SetInt32 INSU
fmi3SetUInt32 INSU
fmi3SetInt64 INSU
fmi3SetUInt64 INSU
fmi3SetBoolean INSU
fmi3SetString INSU
fmi3SetBinary INSU
fmi3SetClock INSU
fmi3GetFMUState INSFT
fmi3SetFMUState INSFT
fmi3FreeFMUState INSFT
fmi3SerializedFMUStateSize INSFT
fmi3SerializeFMUState INSFT
fmi3DeserializeFMUState INSFT
fmi3GetOutputDerivatives SFT
fmi3DoStep S
fmi3GetNumberOfVariableDependencies -
fmi3GetVariableDependencies -
fmi3GetDirectionalDerivative -
fmi3GetAdjointDerivative -
fmi3EnterConfigurationMode -
fmi3ExitConfigurationMode -
fmi3EnterEventMode -
fmi3EnterStepMode -
fmi3EvaluateDiscreteStates -
fmi3UpdateDiscreteStates -
fmi3GetIntervalDecimal -
fmi3GetIntervalFraction -
fmi3GetShiftDecimal -
fmi3GetShiftFraction -
fmi3SetIntervalDecimal -
fmi3SetIntervalFraction -
fmi3SetShiftDecimal -
fmi3SetShiftFraction -
fmi3EnterContinuousTimeMode -
fmi3CompletedIntegratorStep -
fmi3SetTime -
fmi3SetContinuousStates -
fmi3GetContinuousStateDerivatives -
fmi3GetEventIndicators -
fmi3GetContinuousStates -
fmi3GetNominalsOfContinuousStates -
fmi3GetNumberOfEventIndicators -
fmi3GetNumberOfContinuousStates -
fmi3ActivateModelPartition -
";

pub const FMI3_APART: &str = "fmi3GetVersion fmi3InstantiateModelExchange fmi3InstantiateCoSimulation \
                          fmi3InstantiateScheduledExecution fmi3FreeInstance";

/// Returns the names of functions and states.
pub fn rows(table: &'static str) -> Vec<(&'static str, &'static str)> {
    let row = |line: &'static str| line.split_once(' ').unwrap_or((line, ""));
    table.lines().filter(|line| !line.is_empty()).map(row).collect()
}
