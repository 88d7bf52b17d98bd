//! Contents of a ROM file: one list for reader, writer and user guide.

/// Value of the metadata entry `format`.
pub(crate) const ROM_FORMAT: &str = "tiprub-rom";
/// Value of the metadata entry `format_version`.
pub(crate) const ROM_FORMAT_VERSION: &str = "1";

/// One named array of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArrayLayout {
    /// Name in the file.
    pub name: &'static str,
    /// Shape in words: `n` reduced coordinates, `nodes` contact nodes of one sector.
    pub shape: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// True if every file must have it.
    pub required: bool,
    /// One sentence.
    pub description: &'static str,
}

/// One entry of the string metadata.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MetadataLayout {
    /// Key.
    pub name: &'static str,
    /// Default, if the entry is optional.
    pub default: Option<&'static str>,
    /// One sentence.
    pub description: &'static str,
}

const fn array(
    name: &'static str,
    shape: &'static str,
    unit: &'static str,
    required: bool,
    description: &'static str,
) -> ArrayLayout {
    ArrayLayout { name, shape, unit, required, description }
}

/// Number of [`ARRAYS`] that every structure may have; the others belong to structures with spin, heat or coupled
/// sectors, and only files with one of these mention it.
const GENERAL_ARRAYS: usize = 9;

/// Every array.
pub const ARRAYS: [ArrayLayout; 34] = [
    array("mass", "[n, n]", "kg", true, "Reduced mass matrix of one sector: symmetric, positive definite."),
    array("stiffness", "[n, n]", "N/m", true, "Reduced stiffness matrix: symmetric, positive semidefinite."),
    array(
        "contact_map",
        "[nodes, 3, n]",
        "m per unit coordinate",
        true,
        "Displacement components of each contact node caused by each reduced coordinate.",
    ),
    array(
        "contact_positions",
        "[nodes, 3]",
        "m, rad, m (cylindrical) or m (cartesian)",
        true,
        "Undeformed positions: (r, theta, z) or (x, y, z).",
    ),
    array(
        "contact_meridional_slopes",
        "[nodes]",
        "1",
        false,
        "Slope dr/dz of the tip contour at each contact node; zero if omitted.",
    ),
    array("full_frequencies", "[modes]", "Hz", false, "Natural frequencies of the full model, ascending."),
    array("reduced_frequencies", "[modes]", "Hz", false, "Natural frequencies of the reduced model, ascending."),
    array("frequency_deviation", "[modes]", "%", false, "Frequency deviation per mode."),
    array("residual_criterion", "[modes]", "%", false, "Residual convergence criterion per mode."),
    array(
        "stiffness_speed2",
        "[n, n]",
        "kg",
        false,
        "Stiffness per square of the speed: centrifugal stiffening and spin softening, symmetric. A file has all spin \
         arrays and `largest_speed`, or none of them.",
    ),
    array("stiffness_speed4", "[n, n]", "kg s^2", false, "Stiffness per fourth power of the speed, symmetric."),
    array("coriolis", "[n, n]", "kg", false, "G of the Coriolis force 2ΩG q': skew-symmetric."),
    array("centrifugal_load", "[n]", "kg m", false, "Centrifugal force per square of the speed."),
    array(
        "centrifugal_load_speed4",
        "[n]",
        "kg m s^2",
        false,
        "Additional centrifugal force on the stretched structure per fourth power of the speed; ignored without \
         stiffening.",
    ),
    array(
        "thermal_loads",
        "[n, patches]",
        "N/K",
        false,
        "Force on the reduced coordinates per kelvin of each patch above the reference. Requires `thermal_patches`.",
    ),
    array(
        "thermal_patches",
        "[patches, 4]",
        "rad, rad, m, m",
        false,
        "Extent of each patch: start and end angle, start and end axial position.",
    ),
    array(
        "mass_<n>",
        "[m, m, 2]",
        "kg",
        false,
        "Reduced mass matrix of nodal diameter n = 1, 2, ... up to half of `sectors`: Hermitian, positive definite; \
         the last index is 0 for the real part and 1 for the imaginary part. `m` may differ between nodal diameters. \
         `mass`, `stiffness` and `contact_map` then belong to n = 0.",
    ),
    array(
        "stiffness_<n>",
        "[m, m, 2]",
        "N/m",
        false,
        "Reduced stiffness matrix of nodal diameter n: Hermitian, positive semidefinite. A file has all three arrays \
         for every n, or none of them.",
    ),
    array(
        "contact_map_<n>",
        "[nodes, 3, m, 2]",
        "m per unit coordinate",
        false,
        "Displacement components of each contact node caused by each reduced coordinate of nodal diameter n.",
    ),
    array(
        "nodal_diameters",
        "[modes]",
        "1",
        false,
        "Nodal diameter of each mode in the arrays of frequencies, deviations and criteria; only with coupled sectors.",
    ),
    array(
        "contact_areas",
        "[nodes]",
        "m^2",
        false,
        "Area of each contact patch: the integral of its weight function over the tip; 0 for a contact node.",
    ),
    array(
        "contact_lengths",
        "[nodes]",
        "m",
        false,
        "Length of each contact patch along the chord; 0 for a contact node.",
    ),
    array(
        "flexibility_deviation",
        "[nodes]",
        "%",
        false,
        "Deviation of the static flexibility at each contact node or patch from the full model.",
    ),
    array(
        "response_frequencies",
        "[frequencies]",
        "Hz",
        false,
        "Frequencies at which the forced response was compared with that of the full model, ascending.",
    ),
    array(
        "response_deviation",
        "[frequencies]",
        "%",
        false,
        "Deviation of the forced response at the contact nodes from that of the full model, at each of \
         `response_frequencies`.",
    ),
    array(
        "watched_map",
        "[points, 3, n]",
        "m per unit coordinate",
        false,
        "Displacement components of each watched point (a point without contact) caused by each reduced coordinate. \
         Requires `watched_positions` and `watched_names`; not supported with coupled sectors.",
    ),
    array(
        "watched_positions",
        "[points, 3]",
        "m, rad, m (cylindrical) or m (cartesian)",
        false,
        "Undeformed positions of the watched points, in the same form as `contact_positions`.",
    ),
    array(
        "stress_map",
        "[places, 6, n]",
        "Pa per unit coordinate",
        false,
        "Stress components 11, 22, 33, 12, 23, 31 at the stress points, in the directions of a contact node at the same \
         point. Requires `stress_positions` and `stress_names`; not supported with coupled sectors.",
    ),
    array(
        "stress_positions",
        "[places, 3]",
        "m, rad, m (cylindrical) or m (cartesian)",
        false,
        "Undeformed positions of the stress points, in the same form as `contact_positions`.",
    ),
    array(
        "stress_thermal",
        "[places, 6, patches]",
        "Pa/K",
        false,
        "Static stress of the full structure at the stress points per kelvin of each patch, without contact: D(Bu - alpha) \
         with the displacements u under the thermal load. Requires `stress_map` and `thermal_loads`; needed by scenes \
         that output the stress of a heated rotor.",
    ),
    array(
        "stress_centrifugal",
        "[places, 6]",
        "Pa s^2",
        false,
        "Static stress of the full structure at the stress points per square of the speed, without contact and stiffening. \
         Requires `stress_map` and `centrifugal_load`; needed by scenes that output the stress of a rotor with \
         centrifugal growth.",
    ),
    array(
        "support_stiffness",
        "[6, n]",
        "N or N m per unit coordinate",
        false,
        "Force of the support on the structure along fixed x, y, z and its moment about x, y, z through the origin, \
         caused by each reduced coordinate: the rows of the full stiffness matrix at the held nodes. Requires \
         `support_mass` and sectors = 1.",
    ),
    array(
        "support_mass",
        "[6, n]",
        "kg or kg m",
        false,
        "Force and moment of the support caused by the acceleration of each reduced coordinate: the rows of the full \
         mass matrix at the held nodes.",
    ),
    array(
        "support_thermal",
        "[6, patches]",
        "N/K or N m/K",
        false,
        "Thermal load of each patch on the held nodes, carried by the support; zero if omitted.",
    ),
];

/// Arrays of a structure with spin: all or none.
pub(crate) const SPIN_ARRAYS: [&str; 5] =
    ["stiffness_speed2", "stiffness_speed4", "coriolis", "centrifugal_load", "centrifugal_load_speed4"];
/// Arrays of watched points: both or none.
pub(crate) const WATCHED_ARRAYS: [&str; 2] = ["watched_map", "watched_positions"];
/// Arrays of points with stress: both or none.
pub(crate) const STRESS_ARRAYS: [&str; 2] = ["stress_map", "stress_positions"];
/// Static stress of a structure with thermal loads, and of one with spin.
pub(crate) const STRESS_THERMAL: &str = "stress_thermal";
pub(crate) const STRESS_CENTRIFUGAL: &str = "stress_centrifugal";
/// Arrays of a support: both or none; the third one requires thermal loads.
pub(crate) const SUPPORT_ARRAYS: [&str; 2] = ["support_stiffness", "support_mass"];
pub(crate) const SUPPORT_THERMAL: &str = "support_thermal";
/// Arrays of a structure with thermal loads: both or none.
pub(crate) const THERMAL_ARRAYS: [&str; 2] = ["thermal_loads", "thermal_patches"];

const fn entry(name: &'static str, default: Option<&'static str>, description: &'static str) -> MetadataLayout {
    MetadataLayout { name, default, description }
}

/// Every metadata entry.
pub const METADATA: [MetadataLayout; 18] = [
    entry("format", None, "Always `tiprub-rom`."),
    entry("format_version", None, "Always `1`."),
    entry("name", None, "Name of the structure."),
    entry("origin", Some(""), "Source of the model: mesh, material, reduction; free text."),
    entry(
        "sectors",
        None,
        "Number of identical sectors around the axis, 1 to 10000; 1 means a single structure. The sectors are \
         uncoupled unless the file has arrays for nodal diameters above 0.",
    ),
    entry("frame", None, "`cylindrical` or `cartesian`: directions of positions and displacements."),
    entry("damping_ratio", Some("0"), "Modal damping ratio, at least 0 and below 1; a scene may override it."),
    entry("contact_names", Some("node_1,node_2,..."), "Names of the contact nodes, separated by commas."),
    entry(
        "largest_speed",
        Some(""),
        "Largest speed (rad/s) for which the spin arrays are valid; required with them and not allowed without them.",
    ),
    entry(
        "contact_grid",
        Some(""),
        "`around,along`, for example `72,5`: the contact nodes form a grid on a closed ring that can carry a surface. \
         Node k·around + i is the i-th node of ring k; rings are in order of increasing z, and angles increase by \
         2π/around. `around,along,open`: the contact nodes form a grid with four free edges (frame `cartesian`); node \
         k·around + i is the i-th node of row k.",
    ),
    entry("watched_names", Some(""), "Names of the watched points, separated by commas."),
    entry("stress_names", Some(""), "Names of the stress points, separated by commas."),
    entry(
        "basis",
        Some("craig-bampton"),
        "`craig-bampton`: modes with the contact nodes held; `free-interface`: modes of the supported structure with \
         the contact nodes free.",
    ),
    entry(
        "contact_rows",
        Some("1"),
        "Number of rows of contact patches across the thickness of the tip. Patch row·(nodes/rows) + i is the i-th \
         patch along the chord in its row; rows run from one side of the tip to the other.",
    ),
    entry(
        "rub_errors",
        Some(""),
        "Known discretisation errors in a rub: relative errors of the tip displacements, for example \
         `modes=0.01,patches=0.02,rows=0.1,mesh=0.03`.",
    ),
    entry("rub_errors_found_on", Some(""), "Description of the scene for which `rub_errors` were determined."),
    entry("units", Some(""), "Shapes and units as text for human readers: one line per array."),
    entry("checksum", Some(""), "SHA-256 of the content, checked if present; omit it if you write the file yourself."),
];

/// Arrays of one nodal diameter above 0, with the placeholder for its number in their names.
pub(crate) const HARMONIC_ARRAYS: [&str; 3] = ["mass_<n>", "stiffness_<n>", "contact_map_<n>"];
pub(crate) const NUMBER: &str = "<n>";

/// Returns the text of the metadata entry `units` of a file, given which arrays it holds.
pub(crate) fn units_text(holds: impl Fn(&str) -> bool) -> String {
    let (general, special) = ARRAYS.split_at(GENERAL_ARRAYS);
    let listed = general.iter().chain(special.iter().filter(|array| holds(array.name)));
    listed.map(|array| format!("{} {}: {}", array.name, array.shape, array.unit)).collect::<Vec<_>>().join("\n")
}
