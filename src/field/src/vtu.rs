//! Writer of VTK files (`.vtu`) with many times and one mesh: arrays that stay the same are encoded once.
//!
//! The format is XML `UnstructuredGrid` with appended raw data, little-endian, in blocks that are compressed with zlib.

use std::io::Write;

use flate2::{Compression, write::ZlibEncoder};
use tiprub_shell::{Failure, Result};

/// Bytes per compressed block.
const BLOCK: usize = 1 << 16;
/// Compression of arrays that are encoded once, and of those that change with time: compression makes the latter a
/// seventh smaller and takes ten times longer.
const THOROUGH: u32 = 6;
const QUICK: u32 = 0;

/// Cell types of VTK (vtkCellType.h).
pub mod cell {
    /// One point.
    pub const VERTEX: u8 = 1;
    /// Connected points.
    pub const POLY_LINE: u8 = 4;
    /// Triangle.
    pub const TRIANGLE: u8 = 5;
    /// Quadrilateral.
    pub const QUAD: u8 = 9;
}

/// Number type of an array in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NumberType {
    /// Single precision.
    Float32,
    /// Unsigned byte.
    UInt8,
    /// Signed whole number of 32 bits.
    Int32,
}

/// Named array, encoded for a file.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedArray {
    name: String,
    kind: NumberType,
    components: usize,
    data: Vec<u8>,
}

impl EncodedArray {
    /// Encodes numbers that change with time; they are rounded to single precision.
    ///
    /// # Errors
    /// The compression fails, which needs a lack of memory.
    pub fn reals(name: &str, components: usize, values: &[f32]) -> Result<Self> {
        Self::new(
            name,
            NumberType::Float32,
            components,
            &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>(),
            QUICK,
        )
    }

    /// Encodes whole numbers that stay the same.
    ///
    /// # Errors
    /// As for [`EncodedArray::reals`].
    pub fn whole(name: &str, values: &[i32]) -> Result<Self> {
        Self::new(
            name,
            NumberType::Int32,
            1,
            &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>(),
            THOROUGH,
        )
    }

    /// Encodes bytes that stay the same.
    ///
    /// # Errors
    /// As for [`EncodedArray::reals`].
    pub fn bytes(name: &str, values: &[u8]) -> Result<Self> {
        Self::new(name, NumberType::UInt8, 1, values, THOROUGH)
    }

    fn new(name: &str, kind: NumberType, components: usize, bytes: &[u8], level: u32) -> Result<Self> {
        let failure = |error: std::io::Error| {
            Failure::new(format!("array {name}"), format!("cannot be compressed: {error}"), "Free some memory")
        };
        let mut blocks = Vec::with_capacity(bytes.len().div_ceil(BLOCK));
        for block in bytes.chunks(BLOCK) {
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(level));
            encoder.write_all(block).map_err(failure)?;
            blocks.push(encoder.finish().map_err(failure)?);
        }
        // Number of blocks, their size, the size of the last one if it is smaller, and the compressed sizes.
        let mut data = Vec::new();
        let sizes = [blocks.len(), BLOCK, bytes.len() % BLOCK].into_iter().chain(blocks.iter().map(Vec::len));
        sizes.for_each(|size| data.extend((size as u64).to_le_bytes()));
        blocks.iter().for_each(|block| data.extend(block));
        Ok(Self { name: name.to_owned(), kind, components, data })
    }
}

/// Cells of a mesh, encoded for a file.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedCells {
    count: usize,
    arrays: [EncodedArray; 3],
}

impl EncodedCells {
    /// Encodes cells: point indices of all cells one after the other, the end of each cell, and its [type](cell).
    ///
    /// # Errors
    /// As for [`EncodedArray::reals`].
    pub fn new(corners: &[i32], ends: &[i32], types: &[u8]) -> Result<Self> {
        let arrays = [
            EncodedArray::whole("connectivity", corners)?,
            EncodedArray::whole("offsets", ends)?,
            EncodedArray::bytes("types", types)?,
        ];
        Ok(Self { count: types.len(), arrays })
    }
}

/// Content of a file.
#[derive(Debug, Clone, Copy)]
pub struct Content<'a> {
    /// Positions of the points (m), x, y, z.
    pub points: &'a [f32],
    /// Cells.
    pub cells: &'a EncodedCells,
    /// Fields at the points.
    pub point_fields: &'a [EncodedArray],
    /// Fields of the cells.
    pub cell_fields: &'a [EncodedArray],
}

/// Returns the bytes of a file.
///
/// # Errors
/// As for [`EncodedArray::reals`].
pub fn write(content: Content<'_>) -> Result<Vec<u8>> {
    let points = [EncodedArray::reals("Points", 3, content.points)?];
    let sections: [(&str, &[EncodedArray]); 4] = [
        ("Points", &points),
        ("Cells", &content.cells.arrays),
        ("PointData", content.point_fields),
        ("CellData", content.cell_fields),
    ];
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n",
        content.points.len() / 3,
        content.cells.count
    );
    let mut offset = 0;
    for (section, arrays) in sections {
        text.push_str(&format!("<{section}>\n"));
        for array in arrays {
            text.push_str(&format!(
                "<DataArray Name=\"{}\" type=\"{:?}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{offset}\"/>\n",
                array.name, array.kind, array.components
            ));
            offset += array.data.len();
        }
        text.push_str(&format!("</{section}>\n"));
    }
    text.push_str("</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_");
    let mut bytes = text.into_bytes();
    bytes.reserve(offset + 40);
    sections.into_iter().flat_map(|(_, arrays)| arrays).for_each(|array| bytes.extend(&array.data));
    bytes.extend(b"\n</AppendedData>\n</VTKFile>\n");
    Ok(bytes)
}
