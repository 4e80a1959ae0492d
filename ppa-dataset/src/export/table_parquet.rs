//! The table as Parquet.

use std::sync::Arc;

use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use super::table::{Table, Values};

impl Table {
    /// The table as a Parquet file of one row group; missing values are null. Whole numbers are unsigned.
    pub fn to_parquet(&self) -> Vec<u8> {
        self.written()
            .expect("memory takes columns of their own types")
    }

    fn written(&self) -> Result<Vec<u8>, ParquetError> {
        let fields = self.columns.iter().map(|column| {
            let (of_type, logical) = match column.values {
                Values::Text(_) => ("BYTE_ARRAY", " (UTF8)"),
                Values::Count(_) => ("INT64", " (UINT_64)"),
                Values::Real(_) => ("DOUBLE", ""),
            };
            format!("OPTIONAL {of_type} {}{logical};", column.name)
        });
        let schema = format!("message files {{ {} }}", fields.collect::<String>());
        // The default includes the library's version, so the bytes would change with every update.
        let properties = WriterProperties::builder().set_created_by("ppa".to_owned());
        let schema = Arc::new(parse_message_type(&schema)?);
        let mut writer =
            SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties.build()))?;
        let mut group = writer.next_row_group()?;
        for column in &self.columns {
            write_column(&mut group, &column.values)?;
        }
        group.close()?;
        writer.into_inner()
    }
}

fn write_column(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: &Values,
) -> Result<(), ParquetError> {
    let mut column = group
        .next_column()?
        .expect("the schema has a field per column");
    match values {
        Values::Text(values) => {
            let there = values
                .iter()
                .flatten()
                .map(|text| ByteArray::from(text.as_str()));
            let there: Vec<_> = there.collect();
            column
                .typed::<ByteArrayType>()
                .write_batch(&there, Some(&present(values)), None)?;
        }
        Values::Count(values) => {
            // Parquet stores unsigned numbers in the bits of signed ones.
            let there: Vec<_> = values.iter().flatten().map(|count| *count as i64).collect();
            column
                .typed::<Int64Type>()
                .write_batch(&there, Some(&present(values)), None)?;
        }
        Values::Real(values) => {
            let there: Vec<_> = values.iter().flatten().copied().collect();
            column
                .typed::<DoubleType>()
                .write_batch(&there, Some(&present(values)), None)?;
        }
    }
    column.close()
}

/// Definition levels: 1 for a value, 0 for null.
fn present<T>(values: &[Option<T>]) -> Vec<i16> {
    values
        .iter()
        .map(|value| i16::from(value.is_some()))
        .collect()
}
