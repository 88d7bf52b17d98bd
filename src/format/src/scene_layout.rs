//! What a scene file contains: one list for error messages and the user guide.

/// One key of the scene file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SceneField {
    /// Dotted path without indices, for example `contact.gap`.
    pub path: &'static str,
    /// Type, as TOML has it; with the SI unit where there is one.
    pub value: &'static str,
    /// Default, `None` where the key must be given.
    pub default: Option<&'static str>,
    /// Accepted range.
    pub range: &'static str,
    /// One or two sentences.
    pub description: &'static str,
}

impl SceneField {
    /// The key alone.
    pub fn key(&self) -> &'static str {
        self.path.rsplit('.').next().unwrap_or(self.path)
    }

    /// Path of the table that holds the key; empty for the top level.
    pub fn table(&self) -> &'static str {
        self.path.rsplit_once('.').map_or("", |(table, _)| table)
    }
}

/// Tables that may be repeated: written `[[name]]`.
pub const REPEATED_TABLES: [&str; 3] = ["structure", "surface", "contact"];
/// Tables that appear once: written `[name]`.
pub const SINGLE_TABLES: [&str; 3] = ["time", "outputs", "experiment"];

/// How a table is written in the file; the inline table `shape` belongs to `[[surface]]`.
pub fn header(table: &str) -> String {
    match table {
        "" => "the top of the file, before the first [table]".to_owned(),
        "surface.shape" => "`shape` of [[surface]]".to_owned(),
        name if REPEATED_TABLES.contains(&name) => format!("[[{name}]]"),
        name => format!("[{name}]"),
    }
}

const fn field(
    path: &'static str,
    value: &'static str,
    default: Option<&'static str>,
    range: &'static str,
    description: &'static str,
) -> SceneField {
    SceneField { path, value, default, range, description }
}

/// Every key, in file order.
pub const FIELDS: [SceneField; 35] = [
    field("name", "text", None, "letters, digits, underscore; starts with a letter", "Name of the model."),
    field("description", "text", Some("empty"), "any", "One or a few sentences for the importer's catalogue."),
    field("structure.name", "text", None, "as `name` of the scene", "Name by which contacts refer to it."),
    field(
        "structure.rom",
        "text",
        None,
        "a file, or `builtin:` and a name",
        "ROM file, relative to the scene file, or a model that comes with tiprub, such as `builtin:rotor37`.",
    ),
    field(
        "structure.motion",
        "text",
        Some("`rotating`"),
        "`rotating`, `still`",
        "Rigid motion: turning about the z axis with the input `speed`, or standing still.",
    ),
    field(
        "structure.speed",
        "number, rad/s",
        Some("0"),
        "finite; 0 for `still`",
        "Start value of the speed input, about +z.",
    ),
    field(
        "structure.damping_ratio",
        "number",
        Some("that of the ROM"),
        "0 to 0.99",
        "Modal damping ratio, the same for all modes.",
    ),
    field("surface.name", "text", None, "as `name` of the scene", "Name by which contacts refer to it."),
    field("surface.shape", "table", None, "see the shapes below", "Shape around the circumference."),
    field(
        "surface.shape.kind",
        "text",
        None,
        "`circular`, `lobes`, `two-lobe`, `table`",
        "Which shape; it decides which of the other keys exist.",
    ),
    field(
        "surface.shape.amplitude",
        "number, m",
        None,
        "finite",
        "`lobes`: the casing radius changes by −amplitude·cos(order·θ − phase).",
    ),
    field("surface.shape.order", "whole number", None, "≥ 1", "`lobes`: number of lobes around the circumference."),
    field(
        "surface.shape.phase",
        "number, rad",
        Some("0"),
        "finite",
        "`lobes`, `two-lobe`: angle by which it is turned.",
    ),
    field(
        "surface.shape.depth",
        "number",
        Some("1"),
        "finite",
        "`two-lobe`: depth factor; 1 makes a bump intrude by as much as the gap.",
    ),
    field(
        "surface.shape.width",
        "number",
        Some("0.15"),
        "0.001 to 0.25",
        "`two-lobe`: width of a bump as a fraction of half a turn.",
    ),
    field(
        "surface.shape.radius_change",
        "list of numbers, m",
        None,
        "at least 4 values",
        "`table`: change of casing radius at equally spaced angles from θ = 0, positive opens the clearance; periodic \
         cubic in between.",
    ),
    field(
        "surface.ramp_time",
        "number, s",
        Some("0"),
        "0 to 1e9",
        "Time over which the shape grows smoothly from circular to full; 0 is at once.",
    ),
    field(
        "surface.moving",
        "true or false",
        Some("false"),
        "",
        "Make the amplitude factor of the shape, its rotation and a uniform change of radius inputs.",
    ),
    field("contact.master", "text", None, "name of a structure", "Structure whose contact nodes are the masters."),
    field("contact.slave", "text", None, "name of a surface", "Surface they meet."),
    field(
        "contact.gap",
        "number, m",
        None,
        "> 0, up to a tenth of the radius",
        "Radial tip clearance of the undeformed structure.",
    ),
    field(
        "contact.sector_gaps",
        "list of numbers, m",
        Some("empty"),
        "> 0, one value per sector",
        "Clearance of each sector where they differ; replaces `gap`.",
    ),
    field("contact.friction", "number", Some("0"), "0 to 2", "Coulomb friction coefficient µ; 0 leaves friction out."),
    field(
        "contact.solver",
        "text",
        Some("`lcp`"),
        "`lcp`, `film`",
        "Solver of the contact problem of one step: linear complementarity over all contact nodes, or the forward \
         increment Lagrange multipliers of the original paper.",
    ),
    field(
        "contact.meridian",
        "text",
        Some("`contour`"),
        "`contour`, `cylinder`",
        "Direction of the contact normal in the meridional plane: perpendicular to the tip contour, or purely radial.",
    ),
    field(
        "time.scheme",
        "text",
        Some("`modal-exact`"),
        "`modal-exact`, `central-difference`",
        "Time-stepping scheme of the modal equations.",
    ),
    field(
        "time.step",
        "number, s",
        None,
        "1e-12 to 1",
        "Largest internal step; the step used divides the communication step evenly.",
    ),
    field(
        "outputs.watched_sectors",
        "list of whole numbers",
        Some("[1]"),
        "from 1 to the number of sectors, each once",
        "Sectors with clearances and forces per contact node.",
    ),
    field(
        "outputs.all_sectors",
        "true or false",
        Some("false"),
        "",
        "Smallest clearance and normal force of every sector.",
    ),
    field(
        "outputs.nodal_diameters",
        "whole number",
        Some("none"),
        "≤ half the number of sectors",
        "Amplitudes of the nodal diameters 0 up to this of the radial tip displacement.",
    ),
    field("outputs.energies", "true or false", Some("true"), "", "The energy ledger and its residual."),
    field(
        "outputs.instantaneous_forces",
        "true or false",
        Some("false"),
        "",
        "Values at the communication point, beside the averages over the step.",
    ),
    field("experiment.start", "number, s", Some("0"), "finite", "Start time proposed to the importer."),
    field("experiment.stop", "number, s", None, "> start", "Stop time proposed to the importer."),
    field("experiment.communication_step", "number, s", None, "> 0", "Communication step proposed to the importer."),
];
