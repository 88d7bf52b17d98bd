//! Quantities by which code finds variables without their names.

/// Quantity of a variable, for code other than the reader of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Quantity {
    /// Simulated time.
    Time,
    /// Rotor speed Ω, input.
    Speed,
    /// Factor on the casing shape, input.
    ShapeFactor,
    /// Rotation of the casing shape, input.
    ShapeRotation,
    /// Uniform change of the casing radius, input.
    RadiusChange,
    /// Displacement of the shaft centre along x, y (whirl), z (axial shift) by component 0, 1, 2; input.
    ShaftDisplacement(usize),
    /// Temperature of each casing patch above the reference, input.
    CasingTemperature,
    /// Amplitude of the nodal-diameter load, input.
    LoadAmplitude,
    /// Phase of the nodal-diameter load, input.
    LoadPhase,
    /// Number of nodal diameters of the nodal-diameter load, parameter.
    LoadOrder,
    /// Amplitude and phase (component 0, 1) of the excitation of blades, input.
    Excitation(usize),
    /// Engine order, parameter.
    ExcitationOrder,
    /// Temperature of a rotor above the reference, input.
    RotorTemperature,
    /// Friction coefficient µ, parameter.
    Friction,
    /// Offset added to every clearance, parameter.
    GapOffset,
    /// Damping ratio ξ of a master, parameter.
    DampingRatio,
    /// Damping ratio ξ of a surface carrier, parameter.
    CarrierDampingRatio,
    /// Damping ratios ξ of the first modes of a master, parameter.
    ModeDamping,
    /// Damping ratios ξ of the first modes of a surface carrier, parameter.
    CarrierModeDamping,
    /// Initial displacement of blades, parameter.
    InitialDisplacement,
    /// Initial velocity of blades, parameter.
    InitialRate,
    /// Initial velocity of a free master along x, y, z (component 0, 1, 2), parameter.
    InitialVelocity(usize),
    /// Fraction of the friction heat that flows into the surface carrier, parameter.
    HeatToSlave,
    /// Largest internal step, parameter.
    StepMax,
    /// Scheme, parameter.
    SchemeChoice,
    /// Error tolerance of a step, parameter.
    Tolerance,
    /// Largest number of internal steps of a communication step, parameter.
    MaxInternalSteps,
    /// Number of threads, parameter.
    Threads,
    /// Solver, parameter.
    SolverChoice,
    /// Interpolation of inputs between communication points, parameter.
    InputInterpolation,
    /// Choice of derivatives over the last step, parameter.
    StepDerivatives,
    /// Initial rotor angle θ_r, parameter.
    InitialAngle,
    /// Ramp time of the casing shape, parameter.
    RampTime,
    /// Name of the scene, constant.
    SceneName,
    /// Rotor angle θ_r.
    RotorAngle,
    /// Gaps of a watched sector (0-based) at the communication point.
    Clearance(usize),
    /// Smallest gaps of a watched sector within the step.
    WatchedClearanceMinimum(usize),
    /// Mean normal forces of a watched sector.
    NormalForce(usize),
    /// Mean friction forces of a watched sector.
    TangentialForce(usize),
    /// Velocity of the centre of mass of a free master along x, y, z.
    CentreVelocity(usize),
    /// Displacements of all contact nodes of a free master along x, y, z.
    NodeDisplacement(usize),
    /// Mean moment of the contact forces about fixed x, y, z: on the rotor about the shaft centre (z: the torque), on a free master about
    /// the origin.
    Moment(usize),
    /// Largest λ of any node within the step.
    NormalForcePeak,
    /// Radial displacement of the contact grid of the flexible surface carrier.
    SlaveDisplacement,
    /// Nodes in contact at the communication point.
    ContactCount,
    /// Amplitude of the radial tip displacement per nodal diameter.
    NodalDiameterAmplitude,
    /// Kinetic energy.
    KineticEnergy,
    /// Strain energy.
    StrainEnergy,
    /// Damping loss.
    DampingLoss,
    /// Friction loss.
    FrictionLoss,
    /// Impact loss.
    ImpactLoss,
    /// Work of all inputs except loads.
    ExternalWork,
    /// Energy added by turning normals and curving surfaces within steps.
    CurvatureWork,
    /// Residual of the energy balance relative to initial energy and all work exchanged.
    EnergyResidualRelative,
    /// Current internal step.
    InternalStep,
    /// Output that only its reader uses.
    #[default]
    Output,
}
