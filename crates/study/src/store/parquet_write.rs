//! `results.parquet`, from blocks in the order of their cases.

use std::io;
use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use needlebench_kinematics::ik::Configuration;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::column::writer::{ColumnCloseResult, ColumnWriter, get_column_writer};
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedFileWriter, SerializedPageWriter, TrackedWrite};
use parquet::schema::types::{ColumnPath, SchemaDescriptor, TypePtr};

use super::atomic::AtomicFile;
use super::columns::{Columns, FactorColumn, ROWS};
use super::manifest::Manifest;
use super::ordered::in_order;
use super::schema::{self, CRC_KEY, Column, Content, SUM_KEY};
use super::seal;
use crate::{Factor, FactorKind, Outcome};

/// Cases of a row group: 65 536 rows, of which a reader needs about 15 MB.
pub(crate) const GROUP_CASES: u64 = 8192;

/// Of zstd. Most of a table is the noise of mantissas, which no level compresses.
const LEVEL: i32 = 3;

/// Why a table was not written.
#[derive(Debug)]
pub(crate) enum WriteError<E> {
    /// Its cases could not be had.
    Source(E),
    /// The file failed.
    File(io::Error),
}

impl<E> From<ParquetError> for WriteError<E> {
    fn from(error: ParquetError) -> Self {
        Self::File(match error {
            ParquetError::External(source) => match source.downcast::<io::Error>() {
                Ok(error) => *error,
                Err(source) => io::Error::other(source),
            },
            other => io::Error::other(other),
        })
    }
}

/// A row group, encoded.
struct Group {
    bytes: Bytes,
    columns: Vec<ColumnCloseResult>,
    crc: u32,
}

/// Writes the table of a study, row groups in parallel. `source` gives the cases from a number on, as
/// many as asked for. The bytes do not depend on the number of threads.
pub(crate) fn write<E: Send>(
    path: &Path,
    manifest: &Manifest,
    threads: usize,
    source: impl Fn(u64, u64) -> Result<Columns, E> + Sync,
    mut written: impl FnMut(u64) + Send,
) -> Result<(), WriteError<E>> {
    let layout = Layout::new(manifest);
    let file = AtomicFile::create(path).map_err(WriteError::File)?;
    let mut writer = SerializedFileWriter::new(
        file.file(),
        layout.schema.clone(),
        layout.properties.clone(),
    )?;
    let mut checks = Vec::new();
    in_order(
        manifest.cases.div_ceil(GROUP_CASES),
        threads,
        |index| {
            let first = index * GROUP_CASES;
            let columns = source(first, GROUP_CASES.min(manifest.cases - first));
            Ok(layout.encode(first, &columns.map_err(WriteError::Source)?)?)
        },
        |group: Group| {
            let mut writer = writer.next_row_group()?;
            for column in group.columns {
                writer.append_column(&group.bytes, column)?;
            }
            let rows = writer.close()?.num_rows();
            checks.push(group.crc);
            written(u64::try_from(rows).unwrap_or_default() / ROWS as u64);
            Ok::<(), WriteError<E>>(())
        },
    )?;
    let checks = serde_json::to_string(&checks).expect("numbers");
    writer.append_key_value_metadata(KeyValue::new(CRC_KEY.to_owned(), checks));
    // Last, so that nothing that looks like it comes behind it.
    writer.append_key_value_metadata(KeyValue::new(SUM_KEY.to_owned(), seal::BLANK.to_owned()));
    writer.close()?;
    seal::seal(file.file()).map_err(WriteError::File)?;
    file.commit().map_err(WriteError::File)
}

/// How the tables of a study look.
pub(crate) struct Layout<'a> {
    factors: &'a [Factor],
    columns: Vec<Column>,
    schema: TypePtr,
    descriptor: SchemaDescriptor,
    properties: WriterPropertiesPtr,
}

impl<'a> Layout<'a> {
    pub(crate) fn new(manifest: &'a Manifest) -> Self {
        let columns = schema::columns(&manifest.factors, &manifest.columns);
        let schema = schema::parquet_schema(&columns);
        Self {
            factors: &manifest.factors,
            descriptor: SchemaDescriptor::new(schema.clone()),
            properties: Arc::new(properties(manifest, &columns)),
            columns,
            schema,
        }
    }

    /// CRC32 of the row group that such cases make.
    pub(crate) fn crc(&self, first: u64, cases: &Columns) -> Option<u32> {
        self.encode(first, cases).ok().map(|group| group.crc)
    }

    fn encode(&self, first: u64, cases: &Columns) -> Result<Group, ParquetError> {
        let mut bytes = TrackedWrite::new(Vec::new());
        let mut columns = Vec::new();
        for (column, descriptor) in self.columns.iter().zip(self.descriptor.columns()) {
            let pages = Box::new(SerializedPageWriter::new(&mut bytes));
            let mut writer = get_column_writer(descriptor.clone(), self.properties.clone(), pages);
            self.fill(&mut writer, column.content, first, cases)?;
            columns.push(writer.close()?);
        }
        let bytes = Bytes::from(bytes.into_inner()?);
        Ok(Group {
            crc: crc32fast::hash(&bytes),
            bytes,
            columns,
        })
    }

    fn fill(
        &self,
        writer: &mut ColumnWriter<'_>,
        content: Content,
        first: u64,
        cases: &Columns,
    ) -> Result<(), ParquetError> {
        match writer {
            ColumnWriter::Int64ColumnWriter(writer) => {
                let first = i64::try_from(first).expect("a design has at most 2^53 cases");
                let numbers: Vec<i64> = per_row((first..).take(cases.cases)).collect();
                writer.write_batch(&numbers, None, None)?;
            }
            ColumnWriter::DoubleColumnWriter(writer) => {
                let Content::Number(factor) = content else {
                    unreachable!("numbers of factors are doubles");
                };
                let numbers: Vec<f64> = match (&cases.factors[factor], &self.factors[factor].kind) {
                    (FactorColumn::Levels(column), FactorKind::Levels(levels)) => {
                        let number = |level: &u32| levels[*level as usize].number;
                        per_row(column.iter().map(|level| number(level).unwrap_or(f64::NAN)))
                            .collect()
                    }
                    (FactorColumn::Numbers(numbers), _) => {
                        per_row(numbers.iter().copied()).collect()
                    }
                    (FactorColumn::Levels(_), _) => unreachable!("a continuum has no levels"),
                };
                writer.write_batch(&numbers, None, None)?;
            }
            ColumnWriter::FloatColumnWriter(writer) => {
                let Content::Metric(metric) = content else {
                    unreachable!("metrics are floats");
                };
                let column = &cases.metrics[metric];
                let values: Vec<f32> = column
                    .iter()
                    .copied()
                    .filter(|value| !value.is_nan())
                    .collect();
                let present: Vec<i16> = column
                    .iter()
                    .map(|value| i16::from(!value.is_nan()))
                    .collect();
                writer.write_batch(&values, Some(&present), None)?;
            }
            ColumnWriter::ByteArrayColumnWriter(writer) => {
                let texts = |names: &[&'static str]| -> Vec<ByteArray> {
                    names.iter().map(|name| ByteArray::from(*name)).collect()
                };
                let values: Vec<ByteArray> = match content {
                    Content::Label(factor) => {
                        let (FactorColumn::Levels(column), FactorKind::Levels(levels)) =
                            (&cases.factors[factor], &self.factors[factor].kind)
                        else {
                            unreachable!("labels are those of levels");
                        };
                        let labels: Vec<ByteArray> = levels
                            .iter()
                            .map(|level| level.label.as_str().into())
                            .collect();
                        per_row(column.iter().map(|level| labels[*level as usize].clone()))
                            .collect()
                    }
                    Content::Configuration => {
                        let labels = texts(&Configuration::ALL.map(Configuration::label));
                        (0..cases.cases)
                            .flat_map(|_| labels.iter().cloned())
                            .collect()
                    }
                    Content::Outcome => {
                        let names = texts(&Outcome::ALL.map(Outcome::name));
                        let name = |outcome: &u8| names[usize::from(*outcome)].clone();
                        cases.outcomes.iter().map(name).collect()
                    }
                    Content::Detail => {
                        let texts: Vec<ByteArray> = cases
                            .texts
                            .iter()
                            .map(|text| text.as_str().into())
                            .collect();
                        cases
                            .details
                            .iter()
                            .map(|text| texts[*text as usize].clone())
                            .collect()
                    }
                    Content::Case | Content::Number(_) | Content::Metric(_) => {
                        unreachable!("numbers are no text")
                    }
                };
                writer.write_batch(&values, None, None)?;
            }
            _ => unreachable!("the schema has four types"),
        }
        Ok(())
    }
}

/// Every value once per row of its case.
fn per_row<T: Clone>(values: impl Iterator<Item = T>) -> impl Iterator<Item = T> {
    values.flat_map(|value| std::iter::repeat_n(value, ROWS))
}

fn properties(manifest: &Manifest, columns: &[Column]) -> WriterProperties {
    let level = ZstdLevel::try_new(LEVEL).expect("a level of zstd");
    let metadata = schema::metadata(manifest, columns);
    let metadata = metadata
        .into_iter()
        .map(|(key, value)| KeyValue::new(key.to_owned(), value))
        .collect();
    let rows = usize::try_from(GROUP_CASES).expect("a few thousand") * ROWS;
    let mut builder = WriterProperties::builder()
        .set_compression(Compression::ZSTD(level))
        .set_statistics_enabled(EnabledStatistics::Chunk)
        // A column of a row group is one page: nothing to index.
        .set_offset_index_disabled(true)
        .set_data_page_row_count_limit(rows)
        .set_key_value_metadata(Some(metadata));
    for column in columns {
        let path = ColumnPath::from(column.name.as_str());
        let encoding = match column.content {
            Content::Case => Encoding::DELTA_BINARY_PACKED,
            Content::Metric(_) => Encoding::BYTE_STREAM_SPLIT,
            _ => continue,
        };
        builder = builder
            .set_column_dictionary_enabled(path.clone(), false)
            .set_column_encoding(path, encoding);
    }
    builder.build()
}
