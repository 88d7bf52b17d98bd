//! Parquet files, compressed with Snappy.

use std::{io::BufWriter, path::Path, sync::Arc};

use parquet::{
    basic::{Compression, ConvertedType, LogicalType, Repetition, Type as PhysicalType},
    column::{reader::ColumnReader, writer::ColumnWriter},
    data_type::ByteArray,
    errors::ParquetError,
    file::{
        metadata::KeyValue,
        properties::{EnabledStatistics, WriterProperties},
        reader::{FileReader, SerializedFileReader},
        writer::SerializedFileWriter,
    },
    schema::types::{ColumnDescriptor, Type},
};
use tiprub_shell::{
    Failure, Result,
    output_file::{self, PendingFile},
};

use crate::{Cell, Column, ColumnType, Table};

/// Prefix of the columns that pandas adds for its row labels.
const PANDAS_INDEX: &str = "__index_level_";
/// Number of rows that are read in one piece.
const READ_ROWS: usize = 1 << 16;

/// Name and type of a column of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnLayout {
    /// Name.
    pub name: String,
    /// Type.
    pub kind: ColumnType,
    /// False if every row has a value.
    pub may_be_missing: bool,
}

impl ColumnLayout {
    /// Creates the layout of a column whose values may be missing.
    pub fn optional(name: impl Into<String>, kind: ColumnType) -> Self {
        Self { name: name.into(), kind, may_be_missing: true }
    }

    /// Creates the layout of a column with a value in every row.
    pub fn required(name: impl Into<String>, kind: ColumnType) -> Self {
        Self { name: name.into(), kind, may_be_missing: false }
    }

    fn schema(&self) -> parquet::errors::Result<Type> {
        let (physical, logical) = match self.kind {
            ColumnType::Integer => (PhysicalType::INT64, None),
            ColumnType::Real => (PhysicalType::DOUBLE, None),
            ColumnType::Boolean => (PhysicalType::BOOLEAN, None),
            ColumnType::Text => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let repetition = if self.may_be_missing { Repetition::OPTIONAL } else { Repetition::REQUIRED };
        let builder = Type::primitive_type_builder(&self.name, physical);
        builder.with_repetition(repetition).with_logical_type(logical).build()
    }
}

/// Parquet file that is being written; it appears under its name when it is finished.
pub struct ParquetWriter<'a> {
    target: &'a Path,
    layout: Vec<ColumnLayout>,
    file: SerializedFileWriter<BufWriter<PendingFile>>,
}

impl<'a> ParquetWriter<'a> {
    /// Begins a file with these columns. `facts` are stored in the file as keys and values.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn new(target: &'a Path, layout: Vec<ColumnLayout>, facts: &[(&str, String)]) -> Result<Self> {
        let failed = |error| unwritable(target, &error);
        let columns: parquet::errors::Result<Vec<_>> =
            layout.iter().map(|column| column.schema().map(Arc::new)).collect();
        let columns = columns.map_err(failed)?;
        let schema = Type::group_type_builder("table").with_fields(columns).build().map_err(failed)?;
        let facts = facts.iter().map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone())).collect();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true)
            .set_created_by(concat!("tiprub ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_key_value_metadata(Some(facts))
            .build();
        let draft = BufWriter::new(output_file::begin(target)?);
        let file = SerializedFileWriter::new(draft, Arc::new(schema), Arc::new(properties)).map_err(failed)?;
        Ok(Self { target, layout, file })
    }

    /// Writes a group of rows. The table has the columns of the file, in any order; columns that it lacks are missing in these rows.
    ///
    /// # Errors
    /// The disk is full, or a value is missing or has the wrong type.
    pub fn write_rows(&mut self, table: &Table) -> Result<()> {
        let rows = table.rows();
        let columns: Vec<Option<&Column>> = self.layout.iter().map(|layout| table.column(&layout.name)).collect();
        self.write_columns(rows, |index, layout, writer| match columns[index] {
            Some(column) => write_cells(writer, layout, &column.cells),
            None => write_cells(writer, layout, &vec![None; rows]),
        })
    }

    /// Writes a group of rows whose columns are all required real numbers: `values` returns those of a column.
    ///
    /// # Errors
    /// The disk is full.
    pub fn write_reals(&mut self, rows: usize, mut values: impl FnMut(usize) -> Vec<f64>) -> Result<()> {
        self.write_columns(rows, |index, layout, writer| match writer {
            ColumnWriter::DoubleColumnWriter(writer) => writer.write_batch(&values(index), None, None).map(drop),
            _ => Err(ParquetError::General(format!("column `{}` has no real numbers", layout.name))),
        })
    }

    fn write_columns(
        &mut self,
        rows: usize,
        mut write: impl FnMut(usize, &ColumnLayout, &mut ColumnWriter) -> parquet::errors::Result<()>,
    ) -> Result<()> {
        if rows == 0 {
            return Ok(());
        }
        let mut group = || {
            let mut group = self.file.next_row_group()?;
            let mut columns = self.layout.iter().enumerate();
            while let (Some(mut writer), Some((index, layout))) = (group.next_column()?, columns.next()) {
                write(index, layout, writer.untyped())?;
                writer.close()?;
            }
            group.close().map(drop)
        };
        group().map_err(|error| unwritable(self.target, &error))
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// The disk is full, or the file cannot be renamed.
    pub fn finish(self) -> Result<()> {
        let draft = self.file.into_inner().map_err(|error| unwritable(self.target, &error))?;
        let draft =
            draft.into_inner().map_err(|error| Failure::file(self.target, "cannot be written", error.error()))?;
        output_file::persist(draft, self.target)
    }
}

fn unwritable(target: &Path, error: &ParquetError) -> Failure {
    Failure::new(target.display(), format!("cannot be written: {error}"), "Check the path and the disk")
}

/// Writes the values of a column, with their definition levels if values may be missing.
fn write_cells(
    writer: &mut ColumnWriter,
    layout: &ColumnLayout,
    cells: &[Option<Cell>],
) -> parquet::errors::Result<()> {
    let wrong =
        || ParquetError::General(format!("column `{}` has a missing value or one of another type", layout.name));
    if !layout.may_be_missing && cells.iter().any(Option::is_none) {
        return Err(wrong());
    }
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let levels = layout.may_be_missing.then_some(levels.as_slice());
    macro_rules! write {
        ($writer:expr, $variant:ident, $value:expr) => {{
            let value = |cell: &Cell| if let Cell::$variant(value) = cell { Ok($value(value)) } else { Err(wrong()) };
            let values = cells.iter().flatten().map(value).collect::<parquet::errors::Result<Vec<_>>>()?;
            $writer.write_batch(&values, levels, None).map(drop)
        }};
    }
    match writer {
        ColumnWriter::Int64ColumnWriter(writer) => write!(writer, Integer, |value: &i64| *value),
        ColumnWriter::DoubleColumnWriter(writer) => write!(writer, Real, |value: &f64| *value),
        ColumnWriter::BoolColumnWriter(writer) => write!(writer, Boolean, |value: &bool| *value),
        ColumnWriter::ByteArrayColumnWriter(writer) => {
            write!(writer, Text, |value: &String| ByteArray::from(value.as_bytes().to_vec()))
        }
        _ => Err(wrong()),
    }
}

/// Writes a table as a file with one group of rows.
///
/// # Errors
/// The file cannot be written.
pub fn write(target: &Path, table: &Table, facts: &[(&str, String)]) -> Result<()> {
    let layout = |column: &Column| ColumnLayout::optional(column.name.clone(), column.kind);
    let mut file = ParquetWriter::new(target, table.columns.iter().map(layout).collect(), facts)?;
    file.write_rows(table)?;
    file.finish()
}

/// Reads a table without nested columns. Row labels of pandas are left out.
///
/// # Errors
/// The file cannot be opened, is damaged, or has a column of a type that has no [`ColumnType`].
pub fn read(path: &Path) -> Result<Table> {
    let file = tiprub_format::open_file(path).map_err(|error| Failure::file(path, "cannot be opened", &error))?;
    let remedy =
        "Write the file again with Snappy compression, and with columns of integers, real numbers, text or Booleans";
    let failed = |error: ParquetError| Failure::new(path.display(), format!("cannot be read: {error}"), remedy);
    let file = SerializedFileReader::new(file).map_err(failed)?;
    let schema = file.metadata().file_metadata().schema_descr_ptr();
    let mut columns = Vec::new();
    for (index, descriptor) in schema.columns().iter().enumerate() {
        let name = descriptor.path().parts().join(".");
        if name.starts_with(PANDAS_INDEX) {
            continue;
        }
        let mut cells = Vec::new();
        for group in 0..file.num_row_groups() {
            let group = file.get_row_group(group).map_err(failed)?;
            let reader = group.get_column_reader(index).map_err(failed)?;
            read_cells(reader, descriptor, &mut cells).map_err(failed)?;
        }
        columns.push(Column { kind: column_type(descriptor).map_err(failed)?, name, cells });
    }
    Ok(Table { columns })
}

/// Annotations of columns of integers.
const INTEGERS: [ConvertedType; 9] = [
    ConvertedType::NONE,
    ConvertedType::INT_8,
    ConvertedType::INT_16,
    ConvertedType::INT_32,
    ConvertedType::INT_64,
    ConvertedType::UINT_8,
    ConvertedType::UINT_16,
    ConvertedType::UINT_32,
    ConvertedType::UINT_64,
];

/// Returns the facts that a file stores as keys and values.
///
/// # Errors
/// The file cannot be opened or is damaged.
pub fn facts(path: &Path) -> Result<Vec<(String, String)>> {
    let file = tiprub_format::open_file(path).map_err(|error| Failure::file(path, "cannot be opened", &error))?;
    let file = SerializedFileReader::new(file).map_err(|error| {
        Failure::new(path.display(), format!("cannot be read: {error}"), "Check that this is the intended file")
    })?;
    let facts = file.metadata().file_metadata().key_value_metadata().cloned().unwrap_or_default();
    Ok(facts.into_iter().filter_map(|fact| Some((fact.key, fact.value?))).collect())
}

fn column_type(descriptor: &ColumnDescriptor) -> parquet::errors::Result<ColumnType> {
    let name = descriptor.path().string();
    if descriptor.max_rep_level() > 0 || descriptor.path().parts().len() > 1 {
        return Err(ParquetError::General(format!("column `{name}` is nested")));
    }
    let annotated = descriptor.converted_type();
    // Times in nanoseconds have a logical type, but no converted type.
    if let Some(logical) = descriptor.logical_type_ref()
        && !matches!(logical, LogicalType::Integer { .. } | LogicalType::String | LogicalType::Enum | LogicalType::Json)
        && matches!(descriptor.physical_type(), PhysicalType::INT32 | PhysicalType::INT64)
    {
        return Err(ParquetError::General(format!("column `{name}` has the unsupported type {logical:?}")));
    }
    match (descriptor.physical_type(), annotated) {
        // Such an annotation gives the numbers another meaning, for example a decimal number or a date.
        (PhysicalType::INT32 | PhysicalType::INT64, other) if !INTEGERS.contains(&other) => {
            Err(ParquetError::General(format!("column `{name}` has the unsupported type {other}")))
        }
        (PhysicalType::BYTE_ARRAY, ConvertedType::DECIMAL) => {
            Err(ParquetError::General(format!("column `{name}` has the unsupported type {annotated}")))
        }
        (PhysicalType::BOOLEAN, _) => Ok(ColumnType::Boolean),
        (PhysicalType::INT32 | PhysicalType::INT64, _) => Ok(ColumnType::Integer),
        (PhysicalType::FLOAT | PhysicalType::DOUBLE, _) => Ok(ColumnType::Real),
        (PhysicalType::BYTE_ARRAY, _) => Ok(ColumnType::Text),
        (other, _) => Err(ParquetError::General(format!("column `{name}` has the unsupported type {other}"))),
    }
}

/// Appends the values of one column of a group of rows.
fn read_cells(
    reader: ColumnReader,
    descriptor: &ColumnDescriptor,
    cells: &mut Vec<Option<Cell>>,
) -> parquet::errors::Result<()> {
    column_type(descriptor)?;
    let is_optional = descriptor.max_def_level() > 0;
    macro_rules! read {
        ($reader:expr, $cell:expr) => {{
            let mut reader = $reader;
            let convert: fn(_) -> parquet::errors::Result<Cell> = $cell;
            loop {
                let (mut levels, mut values) = (Vec::new(), Vec::new());
                let wanted = is_optional.then_some(&mut levels);
                let (rows, ..) = reader.read_records(READ_ROWS, wanted, None, &mut values)?;
                if rows == 0 {
                    return Ok(());
                }
                let mut values = values.into_iter().map(convert);
                if !is_optional {
                    levels = vec![0; rows];
                }
                for level in levels {
                    let is_present = level == descriptor.max_def_level();
                    cells.push(if is_present { values.next().transpose()? } else { None });
                }
            }
        }};
    }
    let is_unsigned = matches!(descriptor.converted_type(), ConvertedType::UINT_32 | ConvertedType::UINT_64);
    match reader {
        ColumnReader::Int32ColumnReader(reader) if is_unsigned => {
            read!(reader, |value: i32| Ok(Cell::Integer(i64::from(value.cast_unsigned()))))
        }
        ColumnReader::Int64ColumnReader(reader) if is_unsigned => read!(reader, |value: i64| {
            let too_large = || ParquetError::General("a whole number exceeds 9223372036854775807".to_owned());
            i64::try_from(value.cast_unsigned()).map(Cell::Integer).map_err(|_| too_large())
        }),
        ColumnReader::BoolColumnReader(reader) => read!(reader, |value| Ok(Cell::Boolean(value))),
        ColumnReader::Int32ColumnReader(reader) => read!(reader, |value| Ok(Cell::Integer(i64::from(value)))),
        ColumnReader::Int64ColumnReader(reader) => read!(reader, |value| Ok(Cell::Integer(value))),
        ColumnReader::FloatColumnReader(reader) => read!(reader, |value| Ok(Cell::Real(f64::from(value)))),
        ColumnReader::DoubleColumnReader(reader) => read!(reader, |value| Ok(Cell::Real(value))),
        ColumnReader::ByteArrayColumnReader(reader) => {
            read!(reader, |bytes: ByteArray| Ok(Cell::Text(bytes.as_utf8()?.to_owned())))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Table {
        let column = |name: &str, cells: Vec<Option<Cell>>| Column::new(name, cells);
        Table {
            columns: vec![
                column("run", (1..=3).map(|run| Some(Cell::Integer(run))).collect()),
                column("front.gap", vec![Some(Cell::Real(1.0 / 3.0)), None, Some(Cell::Real(f64::NAN))]),
                column("status", vec![Some(Cell::Text("µ\n".into())), Some(Cell::Text(String::new())), None]),
                column("good", vec![None, Some(Cell::Boolean(true)), Some(Cell::Boolean(false))]),
            ],
        }
    }

    fn is_identical(one: &Table, two: &Table) -> bool {
        one.columns.len() == two.columns.len()
            && one.columns.iter().zip(&two.columns).all(|(one, two)| {
                let same = |(one, two): (&Option<Cell>, &Option<Cell>)| match (one, two) {
                    (Some(one), Some(two)) => one.is_identical(two),
                    (one, two) => one.is_none() && two.is_none(),
                };
                one.name == two.name
                    && one.kind == two.kind
                    && one.cells.len() == two.cells.len()
                    && one.cells.iter().zip(&two.cells).all(same)
            })
    }

    #[test]
    fn written_tables_read_back_to_the_same_bits() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.parquet");
        write(&path, &sample(), &[("plan", "x".to_owned())]).unwrap();
        assert!(is_identical(&read(&path).unwrap(), &sample()));
        assert_eq!(facts(&path).unwrap(), [("plan".to_owned(), "x".to_owned())]);
        // The same table gives the same bytes.
        let again = root.path().join("b.parquet");
        write(&again, &sample(), &[("plan", "x".to_owned())]).unwrap();
        assert_eq!(std::fs::read(path).unwrap(), std::fs::read(again).unwrap());
    }

    #[test]
    fn groups_of_rows_are_joined_and_absent_columns_are_missing() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.parquet");
        let layout = |column: &Column| ColumnLayout::optional(column.name.clone(), column.kind);
        let table = sample();
        let mut file = ParquetWriter::new(&path, table.columns.iter().map(layout).collect(), &[]).unwrap();
        file.write_rows(&table).unwrap();
        let mut part = table.clone();
        part.columns.swap_remove(1);
        file.write_rows(&part).unwrap();
        file.finish().unwrap();
        let joined = read(&path).unwrap();
        assert_eq!(joined.rows(), 6);
        assert!(joined.column("front.gap").unwrap().cells[3..].iter().all(Option::is_none));
        assert_eq!(joined.column("good").unwrap().cells[3..], table.column("good").unwrap().cells);
    }

    #[test]
    fn empty_and_damaged_files_are_distinguished() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.parquet");
        let empty =
            Table { columns: vec![Column { name: "run".into(), kind: ColumnType::Integer, cells: Vec::new() }] };
        write(&path, &empty, &[]).unwrap();
        assert_eq!(read(&path).unwrap(), empty);
        std::fs::write(&path, b"PAR1 no").unwrap();
        let failure = read(&path).unwrap_err();
        assert!(failure.problem.starts_with("cannot be read: ") && failure.what.contains("a.parquet"), "{failure}");
        assert!(read(&root.path().join("none")).is_err());
    }

    /// Decimal numbers and dates must not be read as the integers that store them.
    #[test]
    fn rejects_decimal_numbers_and_dates() {
        use parquet::{data_type::Int32Type, schema::parser::parse_message_type};
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.parquet");
        for (annotation, is_number) in [("", true), (" (INT_16)", true), (" (DECIMAL(4,1))", false), (" (DATE)", false)]
        {
            let schema = parse_message_type(&format!("message schema {{ required int32 a{annotation}; }}")).unwrap();
            let properties = Arc::new(WriterProperties::default());
            let file = std::fs::File::create(&path).unwrap();
            let mut file = SerializedFileWriter::new(file, Arc::new(schema), properties).unwrap();
            let mut group = file.next_row_group().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<Int32Type>().write_batch(&[1605], None, None).unwrap();
            column.close().unwrap();
            group.close().unwrap();
            file.close().unwrap();
            match read(&path) {
                Ok(table) => {
                    assert!(is_number && table.columns[0].cells == [Some(Cell::Integer(1605))], "{annotation}")
                }
                Err(failure) => assert!(!is_number && failure.problem.contains("column `a`"), "{failure}"),
            }
        }
    }

    /// Unsigned whole numbers keep their values, and times are not read as numbers.
    #[test]
    fn unsigned_numbers_keep_their_values() {
        use parquet::{data_type::Int64Type, schema::parser::parse_message_type};
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.parquet");
        let written = |annotation: &str, value: i64| {
            let schema = parse_message_type(&format!("message schema {{ required int64 a ({annotation}); }}")).unwrap();
            let file = std::fs::File::create(&path).unwrap();
            let mut file = SerializedFileWriter::new(file, Arc::new(schema), Arc::default()).unwrap();
            let mut group = file.next_row_group().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<Int64Type>().write_batch(&[value], None, None).unwrap();
            column.close().unwrap();
            group.close().unwrap();
            file.close().unwrap();
            read(&path).map(|table| table.columns[0].cells[0].clone())
        };
        assert_eq!(written("UINT_64", 1 << 40).unwrap(), Some(Cell::Integer(1 << 40)));
        assert_eq!(written("INTEGER(64,false)", 7).unwrap(), Some(Cell::Integer(7)));
        assert_eq!(written("INT_64", -1).unwrap(), Some(Cell::Integer(-1)));
        assert!(written("UINT_64", -1).unwrap_err().problem.contains("exceeds"));
        for annotation in ["TIMESTAMP(NANOS,true)", "TIME(NANOS,true)", "TIMESTAMP_MICROS"] {
            assert!(written(annotation, 5).unwrap_err().problem.contains("unsupported type"), "{annotation}");
        }
    }

    #[test]
    fn values_of_another_type_are_rejected() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.parquet");
        let mut file = ParquetWriter::new(&path, vec![ColumnLayout::required("a", ColumnType::Real)], &[]).unwrap();
        let table = |cell| Table { columns: vec![Column::new("a", vec![cell])] };
        assert!(file.write_rows(&table(None)).is_err());
        assert!(!path.exists());
    }
}
