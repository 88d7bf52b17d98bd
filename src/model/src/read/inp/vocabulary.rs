//! Known keywords and element types, and their treatment.

use crate::element::ElementKind;

/// Meaning of an element type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ElementType {
    /// Element with the same formulation as in the program of the file.
    Solid(ElementKind),
    /// Element that is computed with the full integration of this kind instead of the rule of its type.
    Near(ElementKind),
    /// Points, lines and faces: omitted from the model, but their sets are kept.
    LowerDimension,
    /// Unsupported element: reason and remedy.
    Refused(&'static str, &'static str),
}

const MATRICES: &str = "Use quadratic elements (C3D20, C3D15, C3D10), or give the matrices: --stiffness and --mass";

/// Returns the meaning of an element type in upper case.
pub(super) fn element_type(name: &str) -> ElementType {
    use ElementType::{LowerDimension, Near, Refused, Solid};
    match name {
        "C3D4" => Solid(ElementKind::Tet4),
        "C3D10" => Solid(ElementKind::Tet10),
        // Two integration points in CalculiX and Abaqus, six here.
        "C3D6" => Near(ElementKind::Penta6),
        "C3D15" => Solid(ElementKind::Penta15),
        "C3D8" => Solid(ElementKind::Hex8),
        "C3D20" => Solid(ElementKind::Hex20),
        "C3D20R" => Near(ElementKind::Hex20),
        "C3D10M" | "C3D10HS" | "C3D10T" => Near(ElementKind::Tet10),
        "C3D8I" | "C3D8R" => {
            let reason = "uses incompatible modes or reduced integration against shear locking, which are not \
                          supported; with full integration, the bending stiffness would be far too high";
            Refused(reason, MATRICES)
        }
        "C3D5" | "C3D13" => Refused("is a pyramid", "Use tetrahedra, prisms and bricks only"),
        _ if ["T2D", "T3D", "B2", "B3", "CPS", "CPE", "CAX", "M3D", "SFM3D", "STRI", "R2D", "R3D"]
            .iter()
            .any(|start| name.starts_with(start)) =>
        {
            LowerDimension
        }
        _ if name.strip_prefix('S').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit())) => {
            LowerDimension
        }
        _ => Refused(
            "is not one of C3D4, C3D10, C3D6, C3D15, C3D8, C3D20",
            "Convert the mesh, or give the matrices: --stiffness and --mass",
        ),
    }
}

/// Treatment of a keyword that is not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UnreadKeyword {
    /// The keyword changes neither stiffness nor mass nor sets.
    Harmless,
    /// The keyword changes the computed model.
    Changes,
    /// The keyword is unknown.
    Unknown,
}

const HARMLESS: &[&str] = &[
    "HEADING",
    "PREPRINT",
    "RESTART",
    "AMPLITUDE",
    "ORIENTATION",
    "TRANSFORM",
    "SURFACE",
    "SURFACE INTERACTION",
    "SURFACE BEHAVIOR",
    "FRICTION",
    "INITIAL CONDITIONS",
    "PHYSICAL CONSTANTS",
    "TIME POINTS",
    "VALUES AT INFINITY",
    "CONDUCTIVITY",
    "SPECIFIC HEAT",
    "DAMPING",
    "PLASTIC",
    "CYCLIC HARDENING",
    "CREEP",
    "RATE DEPENDENT",
    "LATENT HEAT",
    "DEPVAR",
    "FILTER",
    "NODE PRINT",
    "NODE FILE",
    "EL PRINT",
    "EL FILE",
    "ELEMENT OUTPUT",
    "NODE OUTPUT",
    "OUTPUT",
    "CONTACT FILE",
    "CONTACT PRINT",
    "CYCLIC SYMMETRY MODEL",
    "SELECT CYCLIC SYMMETRY MODES",
    "FILE FORMAT",
    "END PART",
    "END INSTANCE",
    "END ASSEMBLY",
    "MONITOR",
    "NODE SET",
    "SECTION CONTROLS",
    "HOURGLASS STIFFNESS",
    "DAMAGE INITIATION",
    "DAMAGE EVOLUTION",
    "ELECTRICAL CONDUCTIVITY",
    "NO COMPRESSION",
    "DISTRIBUTION TABLE",
];

const CHANGING: &[&str] = &[
    "TIE",
    "EQUATION",
    "MPC",
    "RIGID BODY",
    "COUPLING",
    "KINEMATIC",
    "KINEMATIC COUPLING",
    "DISTRIBUTING",
    "DISTRIBUTING COUPLING",
    "SPRING",
    "DASHPOT",
    "MASS",
    "ROTARY INERTIA",
    "CONTACT PAIR",
    "GAP",
    "CLEARANCE",
    "PRE-TENSION SECTION",
    "SHELL SECTION",
    "SHELL GENERAL SECTION",
    "MEMBRANE SECTION",
    "BEAM SECTION",
    "BEAM GENERAL SECTION",
    "SUBSTRUCTURE PROPERTY",
    "USER ELEMENT",
    "UEL PROPERTY",
    "EMBEDDED ELEMENT",
    "CONNECTOR SECTION",
    "MATRIX INPUT",
    "MATRIX ASSEMBLE",
    "HYPERELASTIC",
    "HYPERFOAM",
    "USER MATERIAL",
    "DEFORMATION PLASTICITY",
    "CONTACT",
    "FASTENER",
    "NONSTRUCTURAL MASS",
    "SYSTEM",
    "NGEN",
    "NFILL",
    "NCOPY",
    "NMAP",
    "ELGEN",
    "ELCOPY",
    "PARAMETER",
    "SUBMODEL",
    "MODEL CHANGE",
    "IMPERFECTION",
    "ADAPTIVE MESH",
    "COHESIVE SECTION",
    "GASKET SECTION",
    "IMPORT",
];

/// Returns the treatment of a keyword that the reader does not act on.
pub(super) fn unread(keyword: &str) -> UnreadKeyword {
    if HARMLESS.contains(&keyword) {
        UnreadKeyword::Harmless
    } else if CHANGING.contains(&keyword) {
        UnreadKeyword::Changes
    } else {
        UnreadKeyword::Unknown
    }
}
