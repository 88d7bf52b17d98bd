//! `modelDescription.xml` of FMI 2.0 for co-simulation.

use tiprub_cosim::variables::DataType;

use crate::Description;
use crate::element::XmlElement;
use crate::row::{DescribedVariable, causality, rows_without_time, variability};
use crate::shared::{default_experiment, enumerations, items, log_categories, root_attributes, unit_definitions};
use crate::text::number;

/// Returns the model description of FMI 2.0: arrays are flattened to scalars `name[i]`, and time is not among the variables.
pub fn fmi2_xml(description: &Description) -> String {
    let rows = rows_without_time(description.table);
    let root = XmlElement::new("fmiModelDescription")
        .with("fmiVersion", "2.0")
        .with("modelName", description.model_name)
        .with("guid", description.token);
    root_attributes(root, description)
        .child(co_simulation(description))
        .children(unit_definitions(description))
        .children(type_definitions(description))
        .child(log_categories())
        .child(default_experiment(description))
        .child(XmlElement::new("ModelVariables").children(rows.iter().map(scalar_variable)))
        .child(model_structure(&rows))
        .document()
}

fn co_simulation(description: &Description) -> XmlElement {
    XmlElement::new("CoSimulation")
        .with("modelIdentifier", description.identifier)
        .with("needsExecutionTool", "false")
        .with("canHandleVariableCommunicationStepSize", "true")
        .with("canInterpolateInputs", "true")
        .with("maxOutputDerivativeOrder", "1")
        .with("canRunAsynchronuously", "false")
        .with("canBeInstantiatedOnlyOncePerProcess", "false")
        .with("canNotUseMemoryManagementFunctions", "true")
        .with("canGetAndSetFMUstate", "true")
        .with("canSerializeFMUstate", "true")
        .with("providesDirectionalDerivative", "false")
}

fn type_definitions(description: &Description) -> Option<XmlElement> {
    let definition = |enumeration: &'static tiprub_cosim::variables::Enumeration| {
        XmlElement::new("SimpleType")
            .with("name", enumeration.name)
            .with_text("description", enumeration.description)
            .child(XmlElement::new("Enumeration").children(items(enumeration)))
    };
    XmlElement::new("TypeDefinitions").children(enumerations(description).into_iter().map(definition)).unless_empty()
}

fn scalar_variable(row: &DescribedVariable) -> XmlElement {
    let variable = row.variable;
    XmlElement::new("ScalarVariable")
        .with("name", &row.name)
        .with("valueReference", row.reference.to_string())
        .with_text("description", &variable.description)
        .with("causality", causality(variable.causality))
        .with("variability", variability(variable.variability))
        .with_some("initial", row.initial())
        .child(typed(row))
}

fn typed(row: &DescribedVariable) -> XmlElement {
    let variable = row.variable;
    let [min, max] = row.bounds();
    let element = match variable.kind {
        DataType::Real => XmlElement::new("Real")
            .with_some("quantity", row.quantity())
            .with_some("unit", row.unit())
            .with_some("displayUnit", row.display_unit())
            .with_some("min", min)
            .with_some("max", max)
            .with_some("nominal", variable.nominal.map(number)),
        DataType::Integer => XmlElement::new("Integer").with_some("min", min).with_some("max", max),
        DataType::Boolean => XmlElement::new("Boolean"),
        DataType::String => XmlElement::new("String"),
        DataType::Enumeration(enumeration) => XmlElement::new("Enumeration").with("declaredType", enumeration.name),
    };
    element.with_some("start", row.start.as_ref())
}

/// Returns outputs and initial unknowns by index.
fn model_structure(rows: &[DescribedVariable]) -> XmlElement {
    let unknown = |row: &DescribedVariable| XmlElement::new("Unknown").with("index", row.index.to_string());
    let output = |row: &DescribedVariable| unknown(row).with("dependencies", row.output_dependencies());
    let initial = |row: &DescribedVariable| unknown(row).with_some("dependencies", row.initial_dependencies());
    let outputs = rows.iter().filter(|row| row.is_output()).map(output);
    let initial_unknowns = rows.iter().filter(|row| row.is_initial_unknown()).map(initial);
    XmlElement::new("ModelStructure")
        .children(XmlElement::new("Outputs").children(outputs).unless_empty())
        .children(XmlElement::new("InitialUnknowns").children(initial_unknowns).unless_empty())
}
