//! The ROM file: safetensors with the arrays and metadata of [`crate::rom_layout`].

use std::collections::{BTreeMap, HashSet};

use nalgebra::DMatrix;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use sha2::{Digest, Sha256};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomChecks, RomExtras};
use tiprub_cosim::Diagnostic;

mod extras;
mod harmonics;
mod rub_errors;

use crate::Result;
use crate::remedy::name_remedy;
use crate::rom_layout::{ARRAYS, METADATA, NUMBER, ROM_FORMAT, ROM_FORMAT_VERSION, units_text};

const WRITE_AGAIN: &str = "Write the ROM again; the ROM file chapter of the user guide lists the arrays and metadata";

/// An array of the file: shape and values in row-major order.
pub(crate) struct Array {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f64>,
}

pub(crate) type Arrays = BTreeMap<String, Array>;
pub(crate) type Metadata = BTreeMap<String, String>;

/// Reads a ROM from the bytes of a ROM file; `origin` names the file in messages.
///
/// # Examples
/// ```
/// # let blade = tiprub_test_models::blade(1);
///
/// # let bytes = tiprub_format::write_rom(&blade);
/// let rom = tiprub_format::read_rom(&bytes, "blade.rom.safetensors")?;
/// println!("{} reduced coordinates", rom.order());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A [`Diagnostic`] with `origin`, the array or metadata entry, the expected and actual value, and the remedy. A returned
/// ROM has passed [`Rom::validate`].
/// A [`Diagnostic`] naming `origin`, the array or metadata entry, expected and found, and the remedy. The ROM returned
/// has passed [`Rom::validate`].
pub fn read_rom(bytes: &[u8], origin: &str) -> Result<Rom> {
    RomReader { origin }.read(bytes)
}

/// Maximum size of a header (bytes): names of ten thousand contact nodes, or the arrays of a thousand nodal diameters.
const LARGEST_HEADER: u64 = 4 << 20;

/// Returns length and content of the header of a safetensors container.
pub(crate) fn header(bytes: &[u8]) -> std::result::Result<(usize, safetensors::tensor::Metadata), SafeTensorError> {
    let length = bytes.first_chunk().map(|length| u64::from_le_bytes(*length));
    if length.is_some_and(|length| length > LARGEST_HEADER) {
        return Err(SafeTensorError::HeaderTooLarge);
    }
    SafeTensors::read_metadata(bytes)
}

struct RomReader<'a> {
    origin: &'a str,
}

impl RomReader<'_> {
    fn read(&self, bytes: &[u8]) -> Result<Rom> {
        let (arrays, metadata) = self.content(bytes)?;
        let rom = self.rom(&arrays, &metadata)?;
        self.checksum(&arrays, &metadata)?;
        rom.validate().map_err(|error| error.into_diagnostic().at(self.origin))?;
        Ok(rom)
    }

    fn error(&self, what: impl ToString, problem: impl ToString, remedy: impl ToString) -> Diagnostic {
        Diagnostic::new(what, problem, remedy).at(self.origin)
    }

    /// Returns arrays and metadata of the container, with names and data types checked.
    fn content(&self, bytes: &[u8]) -> Result<(Arrays, Metadata)> {
        let (_, header) = header(bytes).map_err(|error| self.container_error(&error, bytes))?;
        let metadata: Metadata = header.metadata().iter().flatten().map(|(k, v)| (k.clone(), v.clone())).collect();
        self.check_format(&metadata)?;
        let known: Vec<&str> = METADATA.iter().map(|entry| entry.name).collect();
        if let Some(unknown) = metadata.keys().find(|key| !known.contains(&key.as_str())) {
            return Err(self.error(
                format!("metadata `{unknown}`"),
                "unknown metadata entry",
                name_remedy(unknown, &known),
            ));
        }
        let container = SafeTensors::deserialize(bytes).map_err(|error| self.container_error(&error, bytes))?;
        let mut views = container.tensors();
        views.sort_by(|a, b| a.0.cmp(&b.0));
        let known: Vec<&str> = ARRAYS.iter().map(|array| array.name).collect();
        let mut arrays = Arrays::new();
        for (name, view) in views {
            let listed = known.contains(&name.as_str()) && !name.contains(NUMBER);
            if !listed && harmonics::parts(&name).is_none() {
                let remedy = name_remedy(&name, &known);
                return Err(self.error(format!("array `{name}`"), "unknown array", remedy));
            }
            if view.dtype() != Dtype::F64 {
                return Err(self.error(
                    format!("array `{name}`"),
                    format!("found data type {:?}, expected F64", view.dtype()),
                    "Convert it to 64-bit floating point before saving; in NumPy, use `.astype(numpy.float64)`",
                ));
            }
            let (words, _) = view.data().as_chunks::<8>();
            let values = words.iter().map(|word| f64::from_le_bytes(*word)).collect();
            arrays.insert(name, Array { shape: view.shape().to_vec(), values });
        }
        Ok((arrays, metadata))
    }

    fn container_error(&self, error: &SafeTensorError, bytes: &[u8]) -> Diagnostic {
        let problem = match error {
            SafeTensorError::HeaderTooSmall => format!("only {} bytes, too short for a header", bytes.len()),
            SafeTensorError::HeaderTooLarge | SafeTensorError::InvalidHeaderLength => {
                format!(
                    "header length does not match the file size of {} bytes or exceeds {LARGEST_HEADER} bytes",
                    bytes.len()
                )
            }
            SafeTensorError::MetadataIncompleteBuffer => {
                format!("header does not match the {} bytes found: the file is truncated or damaged", bytes.len())
            }
            other => format!("damaged header ({other})"),
        };
        self.error("not a readable safetensors file", problem, "Copy the file again, or write it again")
    }

    fn check_format(&self, metadata: &Metadata) -> Result<()> {
        let format = metadata.get("format").map(String::as_str);
        if format != Some(ROM_FORMAT) {
            return Err(self.error(
                "metadata `format`",
                format!("found {}, expected \"{ROM_FORMAT}\": not a tiprub ROM file", quoted(format)),
                "Use a file written by `tiprub reduce`, or add the metadata listed in the ROM file chapter of the user \
                 guide",
            ));
        }
        let version = metadata.get("format_version").map(String::as_str);
        if version != Some(ROM_FORMAT_VERSION) {
            return Err(self.error(
                "metadata `format_version`",
                format!("found {}, expected \"{ROM_FORMAT_VERSION}\"", quoted(version)),
                "Use the tiprub release that wrote the file, or write the ROM again with this release",
            ));
        }
        Ok(())
    }

    fn rom(&self, arrays: &Arrays, metadata: &Metadata) -> Result<Rom> {
        let mass = self.required(arrays, "mass", 2)?;
        let order = mass.shape[0];
        let positions = self.required(arrays, "contact_positions", 2)?;
        let nodes = positions.shape[0];
        self.shape("mass", mass, &[order, order], "square")?;
        let stiffness = self.required(arrays, "stiffness", 2)?;
        self.shape("stiffness", stiffness, &[order, order], "same shape as `mass`")?;
        self.shape("contact_positions", positions, &[nodes, 3], "three coordinates per node")?;
        let map = self.required(arrays, "contact_map", 3)?;
        let reason = "nodes as in `contact_positions`, 3 components, coordinates as in `mass`";
        self.shape("contact_map", map, &[nodes, 3, order], reason)?;
        let sectors = self.number(metadata, "sectors")?;
        let harmonics = self.harmonics(arrays, sectors, nodes)?;
        Ok(Rom {
            name: self.entry(metadata, "name")?.to_owned(),
            origin: metadata.get("origin").cloned().unwrap_or_default(),
            sectors,
            frame: self.frame(metadata)?,
            mass: DMatrix::from_row_slice(order, order, &mass.values),
            stiffness: DMatrix::from_row_slice(order, order, &stiffness.values),
            damping_ratio: if metadata.contains_key("damping_ratio") {
                self.number(metadata, "damping_ratio")?
            } else {
                0.0
            },
            contact_map: DMatrix::from_row_slice(3 * nodes, order, &map.values),
            contact_nodes: self.contact_nodes(arrays, metadata, positions)?,
            checks: RomChecks {
                full_frequencies: self.check_values(arrays, "full_frequencies")?,
                reduced_frequencies: self.check_values(arrays, "reduced_frequencies")?,
                frequency_deviation: self.check_values(arrays, "frequency_deviation")?,
                residual_criterion: self.check_values(arrays, "residual_criterion")?,
                nodal_diameters: self.nodal_diameters(arrays, sectors, harmonics.is_empty())?,
                flexibility_deviation: self.check_values(arrays, "flexibility_deviation")?,
                response_frequencies: self.check_values(arrays, "response_frequencies")?,
                response_deviation: self.check_values(arrays, "response_deviation")?,
                rub_errors: self.rub_errors(metadata)?,
            },
            extras: RomExtras { harmonics, ..self.extras(arrays, metadata, order)? },
        })
    }

    fn required<'a>(&self, arrays: &'a Arrays, name: &str, dimensions: usize) -> Result<&'a Array> {
        let layout = ARRAYS.iter().find(|array| array.name == name).map_or("", |array| array.shape);
        let what = format!("array `{name}`");
        let Some(array) = arrays.get(name) else {
            let held = arrays.keys().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
            let problem = format!("missing; the file contains {}", if held.is_empty() { "no arrays" } else { &held });
            return Err(self.error(what, problem, format!("Add it with shape {layout}")));
        };
        if array.shape.len() != dimensions {
            return Err(self.error(what, format!("found shape {:?}, expected {layout}", array.shape), WRITE_AGAIN));
        }
        Ok(array)
    }

    fn shape(&self, name: &str, array: &Array, expected: &[usize], reason: &str) -> Result<()> {
        if array.shape == expected {
            return Ok(());
        }
        let problem = format!("found shape {:?}, expected {expected:?} ({reason})", array.shape);
        Err(self.error(format!("array `{name}`"), problem, WRITE_AGAIN))
    }

    fn contact_nodes(&self, arrays: &Arrays, metadata: &Metadata, positions: &Array) -> Result<Vec<ContactNode>> {
        let nodes = positions.shape[0];
        let each = |name: &str| match arrays.get(name) {
            None => Ok(vec![0.0; nodes]),
            Some(array) => {
                self.shape(name, array, &[nodes], "nodes as in `contact_positions`")?;
                Ok(array.values.clone())
            }
        };
        let [slopes, areas, lengths] =
            [each("contact_meridional_slopes")?, each("contact_areas")?, each("contact_lengths")?];
        let names = match metadata.get("contact_names") {
            None => (1..=nodes).map(|index| format!("node_{index}")).collect(),
            Some(text) => self.point_names("contact_names", text, nodes)?,
        };
        let (triples, _) = positions.values.as_chunks::<3>();
        let node = |(index, name): (usize, String)| ContactNode {
            name,
            position: triples[index],
            meridional_slope: slopes[index],
            area: areas[index],
            length: lengths[index],
        };
        Ok(names.into_iter().enumerate().map(node).collect())
    }

    fn point_names(&self, key: &str, text: &str, nodes: usize) -> Result<Vec<String>> {
        let what = format!("metadata `{key}`");
        let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
        if names.len() != nodes {
            let positions = key.replace("names", "positions");
            let problem = format!("found {} names, expected {nodes} (as in `{positions}`)", names.len());
            return Err(self.error(what, problem, "Give one name per point, separated by commas"));
        }
        let mut known = HashSet::with_capacity(names.len());
        for name in &names {
            let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
            if !starts_well || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                let remedy = "Use letters, digits and underscores, not starting with a digit";
                return Err(self.error(what, format!("{name:?} cannot be part of a variable name"), remedy));
            }
            if !known.insert(name.as_str()) {
                return Err(self.error(what, format!("{name:?} appears twice"), "Use unique names"));
            }
        }
        Ok(names)
    }

    fn check_values(&self, arrays: &Arrays, name: &str) -> Result<Vec<f64>> {
        let Some(array) = arrays.get(name) else { return Ok(Vec::new()) };
        self.shape(name, array, &[array.values.len()], "a vector")?;
        if let Some(index) = array.values.iter().position(|value| !value.is_finite()) {
            let problem = format!("entry {index} is {}", array.values[index]);
            return Err(self.error(format!("array `{name}`"), problem, "Omit the array if a value is unknown"));
        }
        Ok(array.values.clone())
    }

    fn entry<'a>(&self, metadata: &'a Metadata, key: &str) -> Result<&'a str> {
        let layout = METADATA.iter().find(|entry| entry.name == key).map_or("", |entry| entry.description);
        let value = metadata.get(key).ok_or_else(|| {
            self.error(format!("metadata `{key}`"), "missing", format!("Add it to the metadata as a string: {layout}"))
        })?;
        Ok(value)
    }

    fn number<T: std::str::FromStr>(&self, metadata: &Metadata, key: &str) -> Result<T> {
        let text = self.entry(metadata, key)?;
        text.trim().parse().map_err(|_| {
            let layout = METADATA.iter().find(|entry| entry.name == key).map_or("", |entry| entry.description);
            let remedy = format!("Expected here: {layout}");
            self.error(format!("metadata `{key}`"), format!("{text:?} is not a valid number"), remedy)
        })
    }

    fn frame(&self, metadata: &Metadata) -> Result<DisplacementFrame> {
        match self.entry(metadata, "frame")? {
            "cylindrical" => Ok(DisplacementFrame::Cylindrical),
            "cartesian" => Ok(DisplacementFrame::Cartesian),
            other => Err(self.error(
                "metadata `frame`",
                format!("unknown frame {other:?}"),
                name_remedy(other, &["cylindrical", "cartesian"]),
            )),
        }
    }

    fn checksum(&self, arrays: &Arrays, metadata: &Metadata) -> Result<()> {
        let Some(stated) = metadata.get("checksum") else { return Ok(()) };
        let found = checksum(arrays, metadata);
        if *stated == found {
            return Ok(());
        }
        Err(self.error(
            "metadata `checksum`",
            format!("stated \"{stated}\", computed \"{found}\": the content was damaged or changed after writing"),
            "Copy the file again; if you changed it on purpose, remove the entry `checksum` from the metadata",
        ))
    }
}

fn quoted(value: Option<&str>) -> String {
    value.map_or_else(|| "nothing".to_owned(), |value| format!("{value:?}"))
}

/// Computes SHA-256 over metadata (without the checksum itself) and arrays, both by name, every item with its length.
pub(crate) fn checksum(arrays: &Arrays, metadata: &Metadata) -> String {
    let mut hash = Sha256::new();
    let mut item = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    for (key, value) in metadata.iter().filter(|(key, _)| *key != "checksum") {
        item(key.as_bytes());
        item(value.as_bytes());
    }
    for (name, array) in arrays {
        item(name.as_bytes());
        item(format!("{:?}", array.shape).as_bytes());
        item(&little_endian(&array.values));
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn little_endian(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Returns the bytes of a ROM file; equal ROMs give equal bytes.
///
/// A ROM that does not pass [`Rom::validate`], or whose contact node names are not distinct identifiers, gives a file
/// that [`read_rom`] rejects.
///
/// # Examples
/// ```
/// # let blade = tiprub_test_models::blade(1);
///
/// let bytes = tiprub_format::write_rom(&blade);
/// assert_eq!(tiprub_format::read_rom(&bytes, "blade")?, blade);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_rom(rom: &Rom) -> Vec<u8> {
    let arrays = rom_arrays(rom);
    let mut metadata = rom_metadata(rom, &arrays);
    metadata.insert("checksum".into(), checksum(&arrays, &metadata));
    container(&arrays, &metadata)
}

fn rom_metadata(rom: &Rom, arrays: &Arrays) -> Metadata {
    let frame = match rom.frame {
        DisplacementFrame::Cylindrical => "cylindrical",
        DisplacementFrame::Cartesian => "cartesian",
    };
    let names = names(&rom.contact_nodes);
    let mut extras = extras::metadata(&rom.extras);
    extras.extend(rom.checks.rub_errors.iter().flat_map(rub_errors::metadata));
    [
        ("format", ROM_FORMAT.to_owned()),
        ("format_version", ROM_FORMAT_VERSION.to_owned()),
        ("name", rom.name.clone()),
        ("origin", rom.origin.clone()),
        ("sectors", rom.sectors.to_string()),
        ("frame", frame.to_owned()),
        ("damping_ratio", rom.damping_ratio.to_string()),
        ("contact_names", names),
        ("units", units_text(|name| arrays.contains_key(&name.replace(NUMBER, "1")))),
    ]
    .into_iter()
    .chain(extras)
    .map(|(key, value)| (key.to_owned(), value))
    .collect()
}

fn names(points: &[ContactNode]) -> String {
    points.iter().map(|point| point.name.as_str()).collect::<Vec<_>>().join(",")
}

/// Converts a matrix: the file stores rows, nalgebra columns.
pub(crate) fn matrix(matrix: &DMatrix<f64>) -> Array {
    Array { shape: vec![matrix.nrows(), matrix.ncols()], values: matrix.transpose().as_slice().to_vec() }
}

fn list(values: Vec<f64>, shape: Vec<usize>) -> Array {
    Array { shape, values }
}

fn rom_arrays(rom: &Rom) -> Arrays {
    let nodes = rom.contact_nodes.len();
    let mut arrays = vec![
        ("mass", matrix(&rom.mass)),
        ("stiffness", matrix(&rom.stiffness)),
        ("contact_map", Array { shape: vec![nodes, 3, rom.contact_map.ncols()], ..matrix(&rom.contact_map) }),
        ("contact_positions", list(rom.contact_nodes.iter().flat_map(|node| node.position).collect(), vec![nodes, 3])),
        (
            "contact_meridional_slopes",
            list(rom.contact_nodes.iter().map(|node| node.meridional_slope).collect(), vec![nodes]),
        ),
    ];
    let extents = |extent: fn(&ContactNode) -> f64| rom.contact_nodes.iter().map(extent).collect::<Vec<_>>();
    for (name, extents) in
        [("contact_areas", extents(|node| node.area)), ("contact_lengths", extents(|node| node.length))]
    {
        if extents.iter().any(|extent| *extent > 0.0) {
            arrays.push((name, list(extents, vec![nodes])));
        }
    }
    let checks = &rom.checks;
    for (name, values) in [
        ("full_frequencies", &checks.full_frequencies),
        ("reduced_frequencies", &checks.reduced_frequencies),
        ("frequency_deviation", &checks.frequency_deviation),
        ("residual_criterion", &checks.residual_criterion),
        ("flexibility_deviation", &checks.flexibility_deviation),
        ("response_frequencies", &checks.response_frequencies),
        ("response_deviation", &checks.response_deviation),
    ] {
        if !values.is_empty() {
            arrays.push((name, list(values.clone(), vec![values.len()])));
        }
    }
    arrays.extend(extras::arrays(&rom.extras));
    let named = arrays.into_iter().map(|(name, array)| (name.to_owned(), array));
    named.chain(harmonics::arrays(rom)).collect()
}

/// Writes the safetensors container: header length, JSON header padded to 8 bytes, data. The library's writer is not
/// used because it takes the metadata from a hash map, whose order, and therefore the bytes, differ from run to run.
/// Keys are inserted in alphabetical order, so that serde_json gives the same text whether or not it preserves
/// insertion order.
pub(crate) fn container(arrays: &Arrays, metadata: &Metadata) -> Vec<u8> {
    let mut header = serde_json::Map::new();
    header.insert("__metadata__".into(), serde_json::json!(metadata));
    let mut data = Vec::new();
    for (name, array) in arrays {
        let start = data.len();
        data.extend(little_endian(&array.values));
        let entry = serde_json::json!({ "data_offsets": [start, data.len()], "dtype": "F64", "shape": array.shape });
        header.insert(name.clone(), entry);
    }
    let mut text = serde_json::Value::Object(header).to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let mut bytes = (text.len() as u64).to_le_bytes().to_vec();
    bytes.extend(text);
    bytes.extend(data);
    bytes
}
