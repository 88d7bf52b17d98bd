//! Files beside `modelDescription.xml`: terminals of FMI 3.0, and the list of related files of FMI-LS-REF.

use crate::Description;
use crate::element::XmlElement;
use crate::row::{DescribedVariable, rows};

/// Member of a terminal: its name there, the name of the variable without prefix and index, kind (FMI 3.0, section 2.4.9.2.2).
type TerminalMember = (&'static str, &'static str, &'static str);

/// Terminal: name, description, members. Forces, torques and heat flow out of the unit, since they act on connected units.
type Terminal = (&'static str, &'static str, &'static [TerminalMember]);

/// Terminals of each rotor.
const TERMINALS: [Terminal; 2] = [
    (
        "shaft",
        "Rotating flange of the rotor",
        &[("angle", "rotor_angle", SIGNAL), ("speed", "speed", SIGNAL), ("torque", "torque", OUTFLOW)],
    ),
    (
        "centre",
        "Centre of the shaft with its whirl and axial shift, and the contact forces and moments on it",
        &[
            ("x", "whirl_x", SIGNAL),
            ("y", "whirl_y", SIGNAL),
            ("z", "axial_shift", SIGNAL),
            ("force_x", "force_x", OUTFLOW),
            ("force_y", "force_y", OUTFLOW),
            ("force_z", "force_z", OUTFLOW),
            ("moment_x", "moment_x", OUTFLOW),
            ("moment_y", "moment_y", OUTFLOW),
        ],
    ),
];

/// Thermal ports of each casing patch, or of all patches if arrays are whole: of the contact, with the generated heat, and of the heat conduction,
/// which receives it. With several pairs there is none, because heat belongs to a pair and temperature to a structure.
const PATCHES: [Terminal; 2] = [
    (
        "casing_patch",
        "Thermal port of the casing",
        &[("temperature", "casing_temperature", SIGNAL), ("heat", "casing_friction_power", OUTFLOW)],
    ),
    (
        "casing_patch",
        "Thermal port of the casing",
        &[("temperature", "casing_temperature", SIGNAL), ("heat", "casing_heat", INFLOW)],
    ),
];

const SIGNAL: &str = "signal";
const INFLOW: &str = "inflow";
const OUTFLOW: &str = "outflow";

/// Returns `terminalsAndIcons.xml` of FMI 3.0; `None` if the scene has nothing to connect.
pub fn fmi3_terminals(description: &Description) -> Option<String> {
    let rows = rows(description.table, description.fmi3_arrays);
    let mut prefixes: Vec<&str> = Vec::new();
    for row in &rows {
        let (prefix, _, _) = parts(&row.name);
        if !prefixes.contains(&prefix) {
            prefixes.push(prefix);
        }
    }
    let rows = &rows;
    let of_prefix = |prefix: &&str| {
        let port = |terminal: &Terminal| terminal_of(rows, terminal, prefix, None);
        let patches = rows.iter().filter_map(|row| {
            let (of, base, index) = parts(&row.name);
            (description.patches_of_roms && of == *prefix && base == PATCHES[0].2[0].1).then_some(index)
        });
        let of_patch = |index| PATCHES.iter().filter_map(move |patch| terminal_of(rows, patch, prefix, index));
        let patches = patches.flat_map(of_patch);
        let turns = rows.iter().any(|row| row.name == format!("{prefix}speed"));
        TERMINALS.iter().filter(|_| turns).filter_map(port).chain(patches).collect::<Vec<_>>()
    };
    let terminals = XmlElement::new("Terminals").children(prefixes.iter().flat_map(of_prefix)).unless_empty()?;
    Some(XmlElement::new("fmiTerminalsAndIcons").with("fmiVersion", "3.0").child(terminals).document())
}

/// Returns a terminal with those members that the scene has; a single member does not make a terminal.
fn terminal_of(
    rows: &[DescribedVariable],
    (name, text, members): &Terminal,
    prefix: &str,
    index: Option<&str>,
) -> Option<XmlElement> {
    let suffix = index.map_or(String::new(), |index| format!("[{index}]"));
    let member = |(name, base, kind): &TerminalMember| {
        let variable = format!("{prefix}{base}{suffix}");
        rows.iter().any(|row| row.name == variable).then(|| {
            XmlElement::new("TerminalMemberVariable")
                .with("variableName", variable)
                .with("memberName", name)
                .with("variableKind", kind)
        })
    };
    let members: Vec<XmlElement> = members.iter().filter_map(member).collect();
    (members.len() > 1).then(|| {
        XmlElement::new("Terminal")
            .with("name", format!("{prefix}{name}{suffix}"))
            .with("matchingRule", "bus")
            .with("description", text)
            .children(members)
    })
}

/// Splits `rotor.speed[3]` into the prefix with its point, the base name and the index.
fn parts(name: &str) -> (&str, &str, Option<&str>) {
    let (name, index) = match name.strip_suffix(']').and_then(|name| name.rsplit_once('[')) {
        Some((name, index)) => (name, Some(index)),
        None => (name, None),
    };
    let at = name.rfind('.').map_or(0, |point| point + 1);
    (&name[..at], &name[at..], index)
}

/// Returns `fmi-ls-manifest.xml` of FMI-LS-REF 1.0.0-alpha.1, in `extra/org.fmi-standard.fmi-ls-ref`, with the roles of files of the FMU (`related`:
/// path from its root, MIME type, role, description).
pub fn references_manifest(related: &[(&str, &str, &str, &str)]) -> String {
    let file = |(path, kind, role, text): &(&str, &str, &str, &str)| {
        XmlElement::new("Related")
            .with("type", kind)
            .with("source", format!("../../{path}"))
            .with("role", role)
            .with("description", text)
    };
    XmlElement::new("fmiReferences")
        .with("xmlns:fmi-ls", "http://fmi-standard.org/fmi-ls-manifest")
        .with("fmi-ls:fmi-ls-name", "org.fmi-standard.fmi-ls-ref")
        .with("fmi-ls:fmi-ls-version", "1.0.0-alpha.1")
        .with(
            "fmi-ls:fmi-ls-description",
            "Layered Standard providing information on related files included in an FMU.",
        )
        .children(related.iter().map(file))
        .document()
}
