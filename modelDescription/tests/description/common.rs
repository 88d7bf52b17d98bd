//! Synthetic table with every kind of variable, and a description with it.

use nalgebra::DMatrix;
use tiprub_core::scene::rom::{DisplacementFrame, RomChecks};
use tiprub_core::{Rom, VariableTable};
use tiprub_cosim::variables::*;
use tiprub_model_description::{DefaultExperiment, Description};
use tiprub_test_models::{node, structure};

pub static METRE: VariableUnit =
    VariableUnit { name: "m", quantity: "Length", exponents: [0, 1, 0, 0, 0], display: &[("mm", 1e3), ("µm", 1e6)] };
pub static SECOND: VariableUnit =
    VariableUnit { name: "s", quantity: "Time", exponents: [0, 0, 1, 0, 0], display: &[] };
pub static NEWTON: VariableUnit =
    VariableUnit { name: "N", quantity: "Force", exponents: [1, 1, -2, 0, 0], display: &[("kN", 1e-3)] };
pub static SPEED: VariableUnit = VariableUnit {
    name: "rad/s",
    quantity: "AngularVelocity",
    exponents: [0, 0, -1, 1, 0],
    display: &[("rpm", 30.0 / std::f64::consts::PI)],
};
pub static SCHEME: Enumeration = Enumeration {
    name: "Scheme",
    description: "Time-stepping scheme",
    items: &[("central_difference", "Explicit <central> differences"), ("modal_exact", "Exact in free flight")],
};

/// Returns a scalar output without a start value; the tests change it as needed.
fn variable(name: &str, kind: DataType, causality: Causality, variability: Variability) -> Variable {
    Variable {
        name: name.into(),
        reference: 0,
        dimension: None,
        kind,
        causality,
        variability,
        span: Span::Point,
        unit: None,
        display: None,
        min: None,
        max: None,
        nominal: None,
        start: None,
        description: format!("About {name}"),
        quantity: Quantity::Time,
        of: 0,
    }
}

pub fn table() -> VariableTable {
    use Causality::*;
    use Variability::*;
    let metres = |variable: Variable| Variable { unit: Some(&METRE), display: Some(1), ..variable };
    let variables = vec![
        Variable { unit: Some(&SECOND), ..variable("time", DataType::Real, Independent, Continuous) },
        Variable {
            unit: Some(&SPEED),
            display: Some(0),
            start: Some(StartValue::Real(vec![1800.0])),
            ..variable("rotor.speed", DataType::Real, Input, Continuous)
        },
        Variable {
            start: Some(StartValue::Real(vec![0.15])),
            min: Some(0.0),
            max: Some(2.0),
            description: "Friction coefficient: 0 ≤ µ & \"smooth\" < 2\nsecond line".into(),
            ..variable("casing.friction", DataType::Real, Parameter, Tunable)
        },
        metres(Variable {
            dimension: Some(3),
            start: Some(StartValue::Real(vec![3.5e-4, 3.6e-4, 1e-7])),
            min: Some(0.0),
            ..variable("sector_gap", DataType::Real, Parameter, Fixed)
        }),
        Variable {
            start: Some(StartValue::Integer(2)),
            ..variable("scheme", DataType::Enumeration(&SCHEME), Parameter, Fixed)
        },
        Variable {
            start: Some(StartValue::Boolean(true)),
            ..variable("energies", DataType::Boolean, Parameter, Fixed)
        },
        Variable {
            start: Some(StartValue::String("a \"b\" <c>".into())),
            ..variable("comment", DataType::String, Parameter, Fixed)
        },
        metres(Variable {
            dimension: Some(3),
            span: Span::Window,
            nominal: Some(1e-4),
            ..variable("blade[1].clearance", DataType::Real, Output, Continuous)
        }),
        Variable {
            unit: Some(&NEWTON),
            span: Span::Mean,
            nominal: Some(1e3),
            ..variable("contact.force", DataType::Real, Output, Discrete)
        },
        variable("steps", DataType::Integer, Output, Discrete),
        variable("in_contact", DataType::Boolean, Output, Discrete),
        Variable { start: Some(StartValue::Integer(36)), ..variable("sectors", DataType::Integer, Local, Constant) },
        Variable { span: Span::Total, ..variable("wall_time", DataType::Real, Local, Discrete) },
    ];
    VariableTable::new(variables).unwrap()
}

pub fn rom() -> Rom {
    let nodes = vec![node("leading_edge", [0.25, 0.0, 0.0], 0.0)];
    let rom = structure("blade", DMatrix::identity(2, 2), DMatrix::identity(2, 2), DMatrix::zeros(3, 2), nodes);
    let checks = RomChecks {
        full_frequencies: vec![812.345678, 2345.6],
        reduced_frequencies: vec![812.35, 2345.7],
        frequency_deviation: vec![5.3e-4, 0.0043],
        residual_criterion: vec![0.1],
        nodal_diameters: Vec::new(),
        ..RomChecks::default()
    };
    let origin = "hex20 mesh of <many> nodes".into();
    Rom { sectors: 36, frame: DisplacementFrame::Cylindrical, damping_ratio: 0.001, checks, origin, ..rom }
}

pub fn description<'a>(table: &'a VariableTable, rom: &'a Rom, fmi3_arrays: bool) -> Description<'a> {
    Description {
        model_name: "rotor37_rub",
        identifier: "tiprub",
        about: "It steps.",
        steps: "They are long.",
        token: "{01234567-89ab-cdef-0123-456789abcdef}",
        description: "Tip rub of 36 blades & a casing",
        generated: "2026-01-31T12:00:00Z",
        generation_tool: "tiprub 0.1.0",
        version: "0.1.0",
        author: "The tiprub developers",
        copyright: "© the tiprub developers",
        license: "MIT OR Apache-2.0",
        experiment: DefaultExperiment { start: 0.0, stop: 0.1, step: 1e-5 },
        fixed_internal_step: Some(1e-6),
        patches_of_roms: true,
        table,
        fmi3_arrays,
        structures: vec![("rotor", rom)],
        features: vec!["`casing` is carried by <ring>".into()],
        limits: vec!["Small displacements within <each> structure.".into()],
        warnings: vec!["ω·h = 2.5 > 2".into()],
    }
}
