//! Results of one run as a Parquet file.

use std::path::Path;

use tiprub_shell::{Result, recording::Recording};

use crate::{
    ColumnType,
    parquet_file::{ColumnLayout, ParquetWriter},
};

/// Number of values in a group of rows: 32 MB.
const GROUP_VALUES: usize = 1 << 22;

/// Writes a column `time` (s) and one column per output, all of real numbers; integers and enumeration items are whole numbers, booleans are 0 and 1.
/// `facts` are stored in the file as keys and values.
///
/// # Errors
/// The file cannot be written.
pub fn write(target: &Path, recording: &Recording, facts: &[(&str, String)]) -> Result<()> {
    let names = ["time".to_owned()].into_iter().chain(recording.names.iter().cloned());
    let layout = names.map(|name| ColumnLayout::required(name, ColumnType::Real)).collect();
    let mut file = ParquetWriter::new(target, layout, facts)?;
    let group = (GROUP_VALUES / (recording.names.len() + 1)).max(1);
    for first in (0..recording.rows()).step_by(group) {
        let rows = first..(first + group).min(recording.rows());
        file.write_reals(rows.len(), |column| match column.checked_sub(1) {
            None => recording.times[rows.clone()].to_vec(),
            Some(column) => rows.clone().map(|row| recording.row(row)[column]).collect(),
        })?;
    }
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cell, parquet_file};

    #[test]
    fn file_has_the_bits_of_the_recording() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.parquet");
        let recording = Recording {
            names: vec!["blade[1].clearance[1]".into(), "odd,name".into()],
            times: vec![0.0, 0.1],
            values: vec![1.0 / 3.0, -0.0, 5e-324, 1e300],
        };
        write(&path, &recording, &[("scene", "a".to_owned())]).unwrap();
        let table = parquet_file::read(&path).unwrap();
        let bits = |name: &str| -> Vec<u64> {
            let cells = &table.column(name).unwrap().cells;
            cells.iter().map(|cell| if let Some(Cell::Real(value)) = cell { value.to_bits() } else { 1 }).collect()
        };
        for (name, values) in
            [("time", [0.0, 0.1]), ("blade[1].clearance[1]", [1.0 / 3.0, 5e-324]), ("odd,name", [-0.0, 1e300])]
        {
            assert_eq!(bits(name), values.map(f64::to_bits), "{name}");
        }
    }
}
