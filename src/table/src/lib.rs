//! Tables of typed columns with missing values, as Parquet files, and from CSV files.
//!
//! - [`table`]: columns and values;
//! - [`parquet_file`]: Parquet files, written in groups of rows, completely or not at all;
//! - [`csv_file`]: CSV files, whose columns get the narrowest type that fits all their values;
//! - [`recording_file`]: results of one run as a Parquet file.
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

pub mod csv_file;
pub mod parquet_file;
pub mod recording_file;
pub mod table;

pub use table::{Cell, Column, ColumnType, Table};
