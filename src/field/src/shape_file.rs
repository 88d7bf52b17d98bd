//! The shape file: surface of a model with its displacements per reduced coordinate of a ROM.
//!
//! It is a safetensors file beside the ROM, which it names by a digest. It never goes into an FMU.
//!
//! | array | type and shape | content |
//! |---|---|---|
//! | `points` | F64 \[points, 3\] | undeformed positions x, y, z (m) |
//! | `corners` | U32 \[corners\] | point indices of the corners of all faces, one face after the other |
//! | `ends` | U32 \[faces\] | end of each face in `corners` |
//! | `shapes_<n>` | F32 \[coordinates, points, 3\] | displacement along x, y, z per reduced coordinate of nodal diameter n (m) |
//! | `shapes_<n>_imaginary` | as `shapes_<n>` | imaginary part, for 0 < n < sectors/2 |

use std::{
    collections::BTreeMap,
    fs,
    io::Read as _,
    path::{Path, PathBuf},
};

use safetensors::{Dtype, SafeTensors};
use sha2::{Digest, Sha256};
use tiprub_core::Rom;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_model::{SurfaceShapes, shapes::DiameterShapes};
use tiprub_shell::{Failure, Result};

/// Extensions of a ROM file and of the shape file beside it.
const ROM_SUFFIX: &str = ".rom.safetensors";
/// End of the names of shape files.
pub const SUFFIX: &str = ".shapes.safetensors";
/// Values of the metadata entries `format` and `format_version`.
const FORMAT: &str = "tiprub-shapes";
const FORMAT_VERSION: &str = "1";
/// Largest shape file, and largest header (bytes).
const LARGEST: u64 = 1 << 30;
const LARGEST_HEADER: u64 = 1 << 20;

/// Array of a shape file: type, shape and little-endian bytes.
type Array = (Dtype, Vec<usize>, Vec<u8>);

/// Returns the path of the shape file beside a ROM file.
///
/// # Examples
/// ```
/// let path = tiprub_field::shape_file::beside("models/blade.rom.safetensors".as_ref());
/// assert_eq!(path.to_str(), Some("models/blade.shapes.safetensors"));
/// ```
pub fn beside(rom: &Path) -> PathBuf {
    let name = rom.file_name().unwrap_or_default().to_string_lossy();
    rom.with_file_name(format!("{}{SUFFIX}", name.strip_suffix(ROM_SUFFIX).unwrap_or(&name)))
}

/// Returns the digest by which a shape file names its ROM: SHA-256 over the data that define the reduced coordinates.
/// Damping and the results of checks are not part of it.
///
/// # Examples
/// ```
/// let blade = tiprub_test_models::blade(1);
/// assert_eq!(tiprub_field::shape_file::rom_digest(&blade).len(), 64);
/// ```
pub fn rom_digest(rom: &Rom) -> String {
    let mut hash = Sha256::new();
    let mut put = |values: &mut dyn Iterator<Item = f64>| {
        let bytes: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    let is_cartesian = rom.frame == DisplacementFrame::Cartesian;
    put(&mut [rom.sectors as f64, f64::from(u8::from(is_cartesian))].into_iter());
    for matrix in [&rom.mass, &rom.stiffness, &rom.contact_map] {
        put(&mut matrix.iter().copied());
    }
    put(&mut rom.contact_nodes.iter().flat_map(|node| node.position));
    for harmonic in &rom.extras.harmonics {
        for matrix in [&harmonic.mass, &harmonic.stiffness, &harmonic.contact_map] {
            put(&mut matrix.iter().flat_map(|value| [value.re, value.im]));
        }
    }
    hexadecimal(hash)
}

fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the bytes of a shape file; equal shapes and ROMs give equal bytes.
pub fn write(shapes: &SurfaceShapes, rom: &Rom) -> Vec<u8> {
    let arrays = arrays(shapes);
    let metadata = BTreeMap::from([
        ("checksum", checksum(&arrays)),
        ("format", FORMAT.to_owned()),
        ("format_version", FORMAT_VERSION.to_owned()),
        ("name", rom.name.clone()),
        ("rom", rom_digest(rom)),
    ]);
    // As for ROM files: the writer of the library does not give the same bytes in every run.
    let mut header = serde_json::Map::new();
    header.insert("__metadata__".into(), serde_json::json!(metadata));
    let mut end = 0;
    for (name, (kind, shape, bytes)) in &arrays {
        let start = end;
        end += bytes.len();
        let entry = serde_json::json!({ "data_offsets": [start, end], "dtype": format!("{kind:?}"), "shape": shape });
        header.insert(name.clone(), entry);
    }
    let mut text = serde_json::Value::Object(header).to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let mut file = Vec::with_capacity(8 + text.len() + end);
    file.extend((text.len() as u64).to_le_bytes());
    file.extend(text);
    arrays.values().for_each(|(_, _, bytes)| file.extend(bytes));
    file
}

fn arrays(shapes: &SurfaceShapes) -> BTreeMap<String, Array> {
    let points = shapes.points.len();
    let whole = |values: &[u32]| {
        (Dtype::U32, vec![values.len()], values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
    };
    let positions = shapes.points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    let mut arrays = BTreeMap::from([
        ("points".to_owned(), (Dtype::F64, vec![points, 3], positions)),
        ("corners".to_owned(), whole(&shapes.corners)),
        ("ends".to_owned(), whole(&shapes.ends)),
    ]);
    for (n, own) in shapes.diameters.iter().enumerate() {
        let array = |values: &[f32]| {
            let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            (Dtype::F32, vec![own.order, points, 3], bytes)
        };
        arrays.insert(format!("shapes_{n}"), array(&own.real));
        if !own.imaginary.is_empty() {
            arrays.insert(format!("shapes_{n}_imaginary"), array(&own.imaginary));
        }
    }
    arrays
}

fn checksum(arrays: &BTreeMap<String, Array>) -> String {
    let mut hash = Sha256::new();
    for (name, (_, shape, bytes)) in arrays {
        hash.update(format!("{name} {shape:?} {}\n", bytes.len()));
        hash.update(bytes);
    }
    hexadecimal(hash)
}

/// Finds the shape file of a ROM among these files: the first whose digest is that of the ROM.
///
/// # Errors
/// The file with the digest is damaged.
pub fn find(rom: &Rom, files: impl IntoIterator<Item = PathBuf>) -> Result<Option<SurfaceShapes>> {
    let digest = rom_digest(rom);
    let is_own = |path: &PathBuf| header(path).is_some_and(|metadata| metadata.get("rom") == Some(&digest));
    files.into_iter().find(is_own).map(|path| read(&path, rom)).transpose()
}

/// Returns the shape files in a directory, in alphabetical order; if `first` is among them, it comes first.
pub fn in_directory(directory: &Path, first: Option<&Path>) -> Vec<PathBuf> {
    let directory = if directory.as_os_str().is_empty() { Path::new(".") } else { directory };
    let entries = fs::read_dir(directory).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.to_string_lossy().ends_with(SUFFIX)).collect();
    let name = first.and_then(Path::file_name);
    files.sort_by_key(|path| (path.file_name() != name, path.clone()));
    files
}

/// Reads the metadata of a shape file; `None` if it is not a shape file of this version.
fn header(path: &Path) -> Option<BTreeMap<String, String>> {
    let mut file = tiprub_format::open_file(path).ok()?;
    let mut length = [0; 8];
    file.read_exact(&mut length).ok()?;
    let length = u64::from_le_bytes(length);
    if length > LARGEST_HEADER {
        return None;
    }
    let mut text = Vec::new();
    file.take(length).read_to_end(&mut text).ok()?;
    let header: serde_json::Value = serde_json::from_slice(&text).ok()?;
    let metadata: BTreeMap<String, String> = serde_json::from_value(header.get("__metadata__")?.clone()).ok()?;
    let is = |key: &str, value: &str| metadata.get(key).is_some_and(|found| found == value);
    (is("format", FORMAT) && is("format_version", FORMAT_VERSION)).then_some(metadata)
}

/// Reads the shape file of a ROM.
///
/// # Errors
/// The file cannot be read, is damaged, or does not belong to the ROM.
pub fn read(path: &Path, rom: &Rom) -> Result<SurfaceShapes> {
    let bytes =
        tiprub_format::read_file(path, LARGEST).map_err(|error| Failure::file(path, "cannot be read", &error))?;
    let damaged = |problem: &str| {
        Failure::new(path.display(), problem, "Remove the file, or write it again with `tiprub reduce`")
    };
    let metadata = header(path).ok_or_else(|| damaged("is not a shape file of this release"))?;
    if metadata.get("rom") != Some(&rom_digest(rom)) {
        return Err(damaged("belongs to another ROM"));
    }
    parsed(&bytes, &metadata, rom).ok_or_else(|| damaged("is a damaged shape file"))
}

/// Returns the content of a file; `None` if it is damaged or does not fit the ROM.
fn parsed(bytes: &[u8], metadata: &BTreeMap<String, String>, rom: &Rom) -> Option<SurfaceShapes> {
    let container = SafeTensors::deserialize(bytes).ok()?;
    let single = |values: &[u8]| values.as_chunks().0.iter().map(|word| f32::from_le_bytes(*word)).collect();
    let whole = |values: &[u8]| values.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect::<Vec<u32>>();
    let array = |name: &str, kind: Dtype, shape: &[Option<usize>]| -> Option<&[u8]> {
        let view = container.tensor(name).ok()?;
        let fits = view.shape().len() == shape.len()
            && view.shape().iter().zip(shape).all(|(found, expected)| expected.is_none_or(|size| size == *found));
        (fits && view.dtype() == kind).then(|| view.data())
    };
    let words = array("points", Dtype::F64, &[None, Some(3)])?;
    let values: Vec<f64> = words.as_chunks().0.iter().map(|word| f64::from_le_bytes(*word)).collect();
    let points = values.as_chunks::<3>().0.to_vec();
    let orders = core::iter::once(rom.order()).chain(rom.extras.harmonics.iter().map(|own| own.mass.nrows()));
    let diameter = |(n, order): (usize, usize)| {
        let shape = [Some(order), Some(points.len()), Some(3)];
        let real = single(array(&format!("shapes_{n}"), Dtype::F32, &shape)?);
        let imaginary = format!("shapes_{n}_imaginary");
        let imaginary = if container.tensor(&imaginary).is_ok() {
            single(array(&imaginary, Dtype::F32, &shape)?)
        } else {
            Vec::new()
        };
        Some(DiameterShapes { order, real, imaginary })
    };
    let shapes = SurfaceShapes {
        diameters: orders.enumerate().map(diameter).collect::<Option<_>>()?,
        corners: whole(array("corners", Dtype::U32, &[None])?),
        ends: whole(array("ends", Dtype::U32, &[None])?),
        points,
    };
    let increases = shapes.ends.windows(2).all(|pair| pair[0] < pair[1]);
    let ends = shapes.ends.last().map_or(0, |end| *end as usize);
    let exists = |corner: &u32| (*corner as usize) < shapes.points.len();
    let is_sound = increases && ends == shapes.corners.len() && shapes.corners.iter().all(exists);
    (is_sound && metadata.get("checksum") == Some(&checksum(&arrays(&shapes)))).then_some(shapes)
}
