//! A thermal model as a file (safetensors), and the `resources/` directory of a thermal FMU.

use std::path::Path;

use nalgebra::DMatrix;
use safetensors::{Dtype, SafeTensors};
use tiprub_cosim::{Diagnostic, ThermalPatch};
use tiprub_thermal::ConductionModel;

use crate::Result;
use crate::load::{LARGEST_ROM, read_bytes};
use crate::resources::{INTACT, check_directory, instantiation_token, package_file, read_package};
use crate::rom_file::{Array, Arrays, Metadata, checksum, container, header, matrix};

/// File name of the model inside `resources/`.
pub const THERMAL_FILE: &str = "casing.thermal.safetensors";
const FORMAT: &str = "tiprub-thermal";
const VERSION: &str = "1";
const WRITE_AGAIN: &str = "Write the model again with `tiprub thermal`";

/// Resources of an instance of a thermal FMU.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalResources {
    /// The model.
    pub model: ConductionModel,
    /// Instantiation token that belongs to these resources.
    pub token: String,
    /// True if the FMI 3.0 description has arrays.
    pub fmi3_arrays: bool,
}

/// Returns the files of `resources/` of a thermal FMU, in fixed order with fixed content for a given model.
///
/// # Examples
/// ```
/// # let model = tiprub_test_models::wall();
///
/// # let directory = tempfile::tempdir()?;
/// for (name, bytes) in tiprub_format::thermal_resource_files(&model, false) {
///     std::fs::write(directory.path().join(name), bytes)?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn thermal_resource_files(model: &ConductionModel, fmi3_arrays: bool) -> Vec<(String, Vec<u8>)> {
    vec![(THERMAL_FILE.to_owned(), write_thermal(model)), package_file(fmi3_arrays)]
}

/// Reads the `resources/` directory of an unpacked thermal FMU.
///
/// # Examples
/// ```
/// # let model = tiprub_test_models::wall();
///
/// # let directory = tempfile::tempdir()?;
/// # for (name, bytes) in tiprub_format::thermal_resource_files(&model, false) {
/// #     std::fs::write(directory.path().join(name), bytes)?;
/// # }
/// let resources = tiprub_format::load_thermal_resources(directory.path())?;
/// assert_eq!(resources.model, model);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A [`Diagnostic`] for a file that is missing, unreadable or from another release; otherwise same as [`read_thermal`].
pub fn load_thermal_resources(directory: &Path) -> Result<ThermalResources> {
    check_directory(directory)?;
    let path = directory.join(THERMAL_FILE);
    let bytes = read_bytes(&path, LARGEST_ROM, INTACT)?;
    let model = read_thermal(&bytes, &path.display().to_string())?;
    let mut files = vec![(THERMAL_FILE.to_owned(), bytes)];
    let fmi3_arrays = read_package(directory, &mut files)?;
    Ok(ThermalResources { model, token: instantiation_token(&files), fmi3_arrays })
}

/// Returns the matrices of a model with their names in the file.
fn matrices(model: &ConductionModel) -> [(&'static str, &DMatrix<f64>); 7] {
    [
        ("conduction", &model.conduction),
        ("gas_convection", &model.gas_convection),
        ("ambient_convection", &model.ambient_convection),
        ("heat_loads", &model.heat_loads),
        ("patch_means", &model.patch_means),
        ("wetted_means", &model.wetted_means),
        ("places", &model.places),
    ]
}

/// Returns the bytes of a thermal model; equal models give equal bytes.
///
/// # Examples
/// ```
/// # let model = tiprub_test_models::wall();
///
/// let bytes = tiprub_format::write_thermal(&model);
/// assert_eq!(tiprub_format::read_thermal(&bytes, "wall")?, model);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_thermal(model: &ConductionModel) -> Vec<u8> {
    let mut arrays: Arrays =
        matrices(model).into_iter().map(|(name, values)| (name.to_owned(), matrix(values))).collect();
    let edges = model.patches.iter().flat_map(|patch| [patch.angle, patch.axial].concat()).collect();
    arrays.insert("patches".into(), Array { shape: vec![model.patches.len(), 4], values: edges });
    let mut metadata: Metadata = [
        ("format", FORMAT.to_owned()),
        ("format_version", VERSION.to_owned()),
        ("name", model.name.clone()),
        ("origin", model.origin.clone()),
        ("heat_capacity", model.heat_capacity.to_string()),
        ("element_time", model.element_time.to_string()),
    ]
    .into_iter()
    .map(|(key, value)| (key.to_owned(), value))
    .collect();
    metadata.insert("checksum".into(), checksum(&arrays, &metadata));
    container(&arrays, &metadata)
}

/// Reads a thermal model; `origin` names the file in messages.
///
/// # Examples
/// ```
/// # let model = tiprub_test_models::wall();
///
/// # let bytes = tiprub_format::write_thermal(&model);
/// let model = tiprub_format::read_thermal(&bytes, "casing.thermal.safetensors")?;
/// println!("{} patches", model.patches.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A [`Diagnostic`] with `origin`, the array or metadata entry, and the remedy. A returned model has passed
/// [`ConductionModel::validate`].
pub fn read_thermal(bytes: &[u8], origin: &str) -> Result<ConductionModel> {
    let refuse = |what: String, problem: String| Diagnostic::new(what, problem, WRITE_AGAIN).at(origin);
    let damaged =
        |error: safetensors::SafeTensorError| refuse("not a readable safetensors file".into(), error.to_string());
    let (_, header) = header(bytes).map_err(damaged)?;
    let metadata: Metadata = header.metadata().iter().flatten().map(|(k, v)| (k.clone(), v.clone())).collect();
    for (key, expected) in [("format", FORMAT), ("format_version", VERSION)] {
        let found = metadata.get(key).map_or("nothing", String::as_str);
        if found != expected {
            return Err(refuse(format!("metadata `{key}`"), format!("found {found:?}, expected {expected:?}")));
        }
    }
    let mut arrays = Arrays::new();
    for (name, view) in SafeTensors::deserialize(bytes).map_err(damaged)?.tensors() {
        let problem = if view.dtype() != Dtype::F64 {
            Some(format!("found data type {:?}, expected F64", view.dtype()))
        } else {
            (view.shape().len() != 2).then(|| format!("found {} dimensions, expected 2", view.shape().len()))
        };
        if let Some(problem) = problem {
            return Err(refuse(format!("array `{name}`"), problem));
        }
        let values = view.data().as_chunks::<8>().0.iter().map(|word| f64::from_le_bytes(*word)).collect();
        arrays.insert(name, Array { shape: view.shape().to_vec(), values });
    }
    if metadata.get("checksum") != Some(&checksum(&arrays, &metadata)) {
        return Err(refuse("metadata `checksum`".into(), "it does not match the content: the file was changed".into()));
    }
    let array = |name: &str| {
        let found = arrays.get(name).ok_or_else(|| refuse(format!("array `{name}`"), "missing".into()))?;
        Ok(DMatrix::from_row_slice(found.shape[0], found.shape[1], &found.values))
    };
    let entry =
        |key: &str| metadata.get(key).cloned().ok_or_else(|| refuse(format!("metadata `{key}`"), "missing".into()));
    let number = |key: &str| {
        let text = entry(key)?;
        text.parse().map_err(|_| refuse(format!("metadata `{key}`"), format!("{text:?} is not a number")))
    };
    let edges = array("patches")?;
    if edges.ncols() != 4 {
        return Err(refuse("array `patches`".into(), format!("found {} columns, expected 4", edges.ncols())));
    }
    let patch = |row: usize| {
        let [first, last, low, high] = [0, 1, 2, 3].map(|column| edges[(row, column)]);
        ThermalPatch { angle: [first, last], axial: [low, high] }
    };
    let model = ConductionModel {
        name: entry("name")?,
        origin: entry("origin")?,
        heat_capacity: number("heat_capacity")?,
        element_time: number("element_time")?,
        conduction: array("conduction")?,
        gas_convection: array("gas_convection")?,
        ambient_convection: array("ambient_convection")?,
        heat_loads: array("heat_loads")?,
        patch_means: array("patch_means")?,
        wetted_means: array("wetted_means")?,
        places: array("places")?,
        patches: (0..edges.nrows()).map(patch).collect(),
    };
    model.validate().map_err(|error| error.into_diagnostic().at(origin))?;
    Ok(model)
}
