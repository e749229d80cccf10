//! `results.parquet`, read again.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use bytes::{Buf, Bytes};
use needlebench_input::open_input;
use needlebench_kinematics::ik::Configuration;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::{
    ColumnChunkMetaData, ParquetMetaData, ParquetMetaDataReader, RowGroupMetaData,
};
use parquet::file::properties::ReaderProperties;
use parquet::file::reader::{ChunkReader, Length, RowGroupReader};
use parquet::file::serialized_reader::SerializedRowGroupReader;

use super::columns::{Columns, FactorColumn, ROWS, blank_case};
use super::manifest::Manifest;
use super::schema::{
    self, CASES_KEY, CRC_KEY, Column, Content, FACTORS_KEY, ID_KEY, METRICS_KEY, NAME_KEY,
    PROVENANCE_KEY, SUM_KEY, TABLE_VERSION, VERSION_KEY,
};
use super::seal;
use crate::{
    CaseResult, Factor, FactorKind, FactorValue, MetricColumn, Outcome, Results, ResultsError,
};

/// A complete `results.parquet`. Its row groups are read one at a time, each checked against the sum
/// that was written with it.
pub struct ParquetResults {
    path: PathBuf,
    file: Mutex<File>,
    metadata: ParquetMetaData,
    id: String,
    name: String,
    provenance: serde_json::Value,
    factors: Vec<Factor>,
    metrics: Vec<MetricColumn>,
    columns: Vec<Column>,
    cases: u64,
    checks: Vec<u32>,
}

impl ParquetResults {
    /// Opens a table and checks that it is one of a study, that all of it is there, and that no bit of it
    /// has changed since it was written.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn open(path: &Path) -> Result<Self, ResultsError> {
        let fail = |message: String| failure(path, message);
        let (file, metadata) = metadata_of(path)?;
        let file_metadata = metadata.file_metadata();
        let get = |key: &str| {
            let pairs = file_metadata.key_value_metadata();
            pairs?.iter().find(|pair| pair.key == key)?.value.as_deref()
        };
        let version = get(VERSION_KEY).ok_or_else(|| {
            fail("is a Parquet file, but not the results of a needlebench study".to_owned())
        })?;
        if version != TABLE_VERSION.to_string() {
            return Err(fail(format!(
                "has schema version {version}; this program reads version {TABLE_VERSION}"
            )));
        }
        let sum =
            get(SUM_KEY).ok_or_else(|| fail(format!("is damaged: it has no SHA-256\n{HEAL}")))?;
        let whole = seal::is_whole(&file, sum);
        if !whole.map_err(|error| fail(format!("cannot be read: {error}")))? {
            return Err(fail(format!(
                "is damaged: its SHA-256 does not match\n{HEAL}"
            )));
        }
        let need =
            |key: &str| get(key).ok_or_else(|| fail(format!("has no {key} in its metadata")));
        let garbled = |key: &str| fail(format!("has an unreadable {key} in its metadata"));
        let factors: Vec<Factor> =
            serde_json::from_str(need(FACTORS_KEY)?).map_err(|_| garbled(FACTORS_KEY))?;
        let cases: u64 = need(CASES_KEY)?.parse().map_err(|_| garbled(CASES_KEY))?;
        let checks: Vec<u32> =
            serde_json::from_str(need(CRC_KEY)?).map_err(|_| garbled(CRC_KEY))?;
        let provenance =
            serde_json::from_str(need(PROVENANCE_KEY)?).map_err(|_| garbled(PROVENANCE_KEY))?;
        let metrics: Vec<MetricColumn> =
            serde_json::from_str(need(METRICS_KEY)?).map_err(|_| garbled(METRICS_KEY))?;
        let results = Self {
            id: need(ID_KEY)?.to_owned(),
            name: need(NAME_KEY)?.to_owned(),
            columns: schema::columns(&factors, &metrics),
            metrics,
            path: path.to_owned(),
            provenance,
            factors,
            cases,
            checks,
            file: Mutex::new(file),
            metadata,
        };
        results.check_layout().map_err(fail)?;
        Ok(results)
    }

    /// A table of a study that is known, of which nothing but the bytes of row groups and their sums is
    /// believed: each has to be checked by itself.
    pub(crate) fn open_damaged(path: &Path, manifest: &Manifest) -> Result<Self, ResultsError> {
        let (file, metadata) = metadata_of(path)?;
        let pairs = metadata.file_metadata().key_value_metadata();
        let stored = pairs
            .and_then(|pairs| pairs.iter().find(|pair| pair.key == CRC_KEY))
            .and_then(|pair| pair.value.as_deref());
        let checks = stored.and_then(|text| serde_json::from_str(text).ok());
        let results = Self {
            id: manifest.study_id.clone(),
            name: manifest.name.clone(),
            columns: schema::columns(&manifest.factors, &manifest.columns),
            metrics: manifest.columns.clone(),
            path: path.to_owned(),
            provenance: manifest.provenance.clone(),
            factors: manifest.factors.clone(),
            cases: manifest.cases,
            checks: checks.unwrap_or_default(),
            file: Mutex::new(file),
            metadata,
        };
        results
            .check_layout()
            .map_err(|message| failure(path, message))?;
        Ok(results)
    }

    /// CRC32 of the bytes of a row group, as it was written.
    pub(crate) fn check(&self, group: usize) -> u32 {
        self.checks[group]
    }

    /// Why it is not the table of a study, if it is not.
    pub(crate) fn other_than(&self, manifest: &Manifest) -> Option<&'static str> {
        let same = self.id == manifest.study_id
            && self.name == manifest.name
            && self.cases == manifest.cases
            && self.factors == manifest.factors
            && self.metrics == manifest.columns
            && self.provenance == manifest.provenance;
        (!same).then_some("is of another study")
    }

    /// Hash of everything that decides the results.
    pub fn study_id(&self) -> &str {
        &self.id
    }

    /// Name of the study.
    pub fn study_name(&self) -> &str {
        &self.name
    }

    /// Where the results come from.
    pub fn provenance(&self) -> &serde_json::Value {
        &self.provenance
    }

    pub(crate) fn table_columns(&self) -> &[Column] {
        &self.columns
    }

    pub(crate) fn groups(&self) -> usize {
        self.metadata.num_row_groups()
    }

    fn check_layout(&self) -> Result<(), String> {
        let found = self.metadata.file_metadata().schema();
        let expected = schema::parquet_schema(&self.columns);
        if found.get_fields() != expected.get_fields() {
            let names: Vec<&str> = found
                .get_fields()
                .iter()
                .map(|field| field.name())
                .collect();
            let wrong = expected
                .get_fields()
                .iter()
                .enumerate()
                .find(|(index, field)| found.get_fields().get(*index) != Some(field));
            return Err(match wrong {
                Some((_, field)) if names.contains(&field.name()) => {
                    format!("column {} has the wrong place or type", field.name())
                }
                Some((_, field)) => format!("has no column {}", field.name()),
                None => "has unknown columns".to_owned(),
            });
        }
        let groups = self.metadata.row_groups();
        let rows: u64 = groups.iter().map(rows_of).sum();
        if self.cases.checked_mul(ROWS as u64) != Some(rows) {
            return Err(format!(
                "is incomplete: it has {rows} rows; {} cases require {ROWS} each",
                self.cases
            ));
        }
        if groups.len() != self.checks.len()
            || groups
                .iter()
                .any(|group| !rows_of(group).is_multiple_of(ROWS as u64))
        {
            return Err("its row groups are not those of a study".to_owned());
        }
        Ok(())
    }

    /// A row group, and the number of its first case.
    pub(crate) fn group(&self, index: usize) -> Result<(u64, Columns), ResultsError> {
        let groups = self.metadata.row_groups();
        let first = groups[..index].iter().map(rows_of).sum::<u64>() / ROWS as u64;
        let fail = |message: String| {
            let place = format!("row group {index} (case {first} on)");
            failure(&self.path, format!("{place} {message}"))
        };
        let part = self.part(&groups[index]);
        let part = part.map_err(|error| fail(format!("cannot be read: {error}")))?;
        if crc32fast::hash(&part.bytes) != self.checks[index] {
            return Err(fail("is damaged: its CRC32 does not match".to_owned()));
        }
        let properties = ReaderProperties::builder().set_read_bloom_filter(false);
        let reader = SerializedRowGroupReader::new(
            Arc::new(part),
            &groups[index],
            self.metadata.page_index_for_row_group(index),
            Arc::new(properties.build()),
        );
        let columns = reader
            .and_then(|reader| self.decode(&reader, first))
            .map_err(|error| fail(format!("cannot be read: {}", text_of(&error))))?;
        Ok((first, columns))
    }

    /// The bytes of a row group.
    fn part(&self, group: &RowGroupMetaData) -> io::Result<Part> {
        let ranges = group.columns().iter().map(ColumnChunkMetaData::byte_range);
        let start = ranges
            .clone()
            .map(|(start, _)| start)
            .min()
            .unwrap_or_default();
        let length = ranges.map(|(_, length)| length).sum();
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(start))?;
        let mut bytes = Vec::new();
        (&*file).take(length).read_to_end(&mut bytes)?;
        Ok(Part {
            start,
            bytes: bytes.into(),
        })
    }

    fn decode(&self, group: &dyn RowGroupReader, first: u64) -> Result<Columns, ParquetError> {
        let rows = usize::try_from(rows_of(group.metadata())).map_err(|_| bad("too many rows"))?;
        let mut cases = Columns::new(&self.factors, self.metrics.len());
        cases.cases = rows / ROWS;
        for (index, column) in self.columns.iter().enumerate() {
            let reader = group.get_column_reader(index)?;
            self.decode_column(reader, column, first, rows, &mut cases)
                .map_err(|error| bad(&format!("column {}: {}", column.name, text_of(&error))))?;
        }
        Ok(cases)
    }

    fn decode_column(
        &self,
        reader: ColumnReader,
        column: &Column,
        first: u64,
        rows: usize,
        cases: &mut Columns,
    ) -> Result<(), ParquetError> {
        match (reader, column.content) {
            (ColumnReader::Int64ColumnReader(reader), Content::Case) => {
                let numbers = required(reader, rows)?;
                let expected = (first..).flat_map(|case| std::iter::repeat_n(case, ROWS));
                if numbers
                    .iter()
                    .zip(expected)
                    .any(|(number, case)| u64::try_from(*number) != Ok(case))
                {
                    return Err(bad("cases are not in order"));
                }
            }
            (ColumnReader::DoubleColumnReader(reader), Content::Number(factor)) => {
                let numbers =
                    per_case(&required(reader, rows)?, |a, b| a.to_bits() == b.to_bits())?;
                match (&mut cases.factors[factor], &self.factors[factor].kind) {
                    (FactorColumn::Levels(column), FactorKind::Levels(levels)) => {
                        for number in numbers {
                            let level =
                                levels.iter().position(|level| level.number == Some(number));
                            column.push(index_of(level)?);
                        }
                    }
                    (FactorColumn::Numbers(column), _) => *column = numbers,
                    (FactorColumn::Levels(_), _) => return Err(bad("a continuum with levels")),
                }
            }
            (ColumnReader::FloatColumnReader(mut reader), Content::Metric(metric)) => {
                let (mut values, mut present) = (Vec::new(), Vec::new());
                let (records, _, _) =
                    reader.read_records(rows, Some(&mut present), None, &mut values)?;
                if records != rows {
                    return Err(bad("rows are missing"));
                }
                let mut values = values.into_iter();
                let value = |present: i16| if present == 0 { None } else { values.next() };
                cases.metrics[metric] = present
                    .into_iter()
                    .map(value)
                    .map(|value| value.unwrap_or(f32::NAN))
                    .collect();
            }
            (ColumnReader::ByteArrayColumnReader(reader), content) => {
                let texts = required(reader, rows)?;
                match content {
                    Content::Label(factor) => {
                        let FactorKind::Levels(levels) = &self.factors[factor].kind else {
                            return Err(bad("a continuum with labels"));
                        };
                        let FactorColumn::Levels(column) = &mut cases.factors[factor] else {
                            return Err(bad("a continuum with labels"));
                        };
                        for text in per_case(&texts, |a, b| a == b)? {
                            let same = |label: &str| label.as_bytes() == text.data();
                            column.push(index_of(
                                levels.iter().position(|level| same(&level.label)),
                            )?);
                        }
                    }
                    Content::Configuration => {
                        let labels = Configuration::ALL.map(Configuration::label);
                        let expected = labels.iter().cycle();
                        if texts
                            .iter()
                            .zip(expected)
                            .any(|(text, label)| text.data() != label.as_bytes())
                        {
                            return Err(bad("configurations are not in order"));
                        }
                    }
                    Content::Outcome => {
                        for text in texts {
                            let same = |outcome: &Outcome| outcome.name().as_bytes() == text.data();
                            let index = Outcome::ALL.iter().position(same);
                            let index = u8::try_from(index_of(index)?).expect("few outcomes");
                            cases.outcomes.push(index);
                        }
                    }
                    Content::Detail => {
                        for text in texts {
                            let text = text.as_utf8()?;
                            let index = cases.text(text);
                            cases.details.push(index);
                        }
                    }
                    Content::Case | Content::Number(_) | Content::Metric(_) => {
                        return Err(bad("text in place of numbers"));
                    }
                }
            }
            _ => return Err(bad("another type than expected")),
        }
        Ok(())
    }
}

impl Results for ParquetResults {
    fn factors(&self) -> &[Factor] {
        &self.factors
    }

    fn columns(&self) -> &[MetricColumn] {
        &self.metrics
    }

    fn cases(&self) -> u64 {
        self.cases
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(&[FactorValue], &CaseResult),
    ) -> Result<(), ResultsError> {
        let mut values = Vec::new();
        let mut result = blank_case();
        for index in 0..self.groups() {
            let (first, cases) = self.group(index)?;
            for place in 0..cases.cases {
                cases.get(place, &mut values, &mut result);
                result.case = first + place as u64;
                visit(&values, &result);
            }
        }
        Ok(())
    }
}

/// What to do about a damaged table.
const HEAL: &str =
    "hint: recompute damaged cases with `needlebench study STUDY --resume`, or copy the file again";

/// Opens a file and reads its footer.
fn metadata_of(path: &Path) -> Result<(File, ParquetMetaData), ResultsError> {
    let fail = |message: String| failure(path, message);
    let mut file = open_input(path).map_err(|error| fail(format!("cannot be opened: {error}")))?;
    check_ends(&mut file).map_err(fail)?;
    let metadata = ParquetMetaDataReader::new()
        .parse_and_finish(&file)
        .map_err(|error| fail(format!("is damaged: {}\n{HEAL}", text_of(&error))))?;
    Ok((file, metadata))
}

/// A file that is empty, no Parquet, or cut off, told apart before anything is decoded.
fn check_ends(file: &mut File) -> Result<(), String> {
    const MAGIC: [u8; 4] = *b"PAR1";
    let unreadable = |error: io::Error| format!("cannot be read: {error}");
    let length = file.metadata().map_err(unreadable)?.len();
    if length == 0 {
        return Err("is empty".to_owned());
    }
    let mut ends = [[0; 4]; 2];
    if length >= 12 {
        file.read_exact(&mut ends[0]).map_err(unreadable)?;
        file.seek(SeekFrom::End(-4)).map_err(unreadable)?;
        file.read_exact(&mut ends[1]).map_err(unreadable)?;
    }
    match ends.map(|end| end == MAGIC) {
        [true, true] => Ok(()),
        [true, false] => Err(format!(
            "is cut off: it has {length} bytes and no footer\n{HEAL}"
        )),
        _ => Err("is not a Parquet file".to_owned()),
    }
}

/// A part of a file, at the offsets that it has there.
struct Part {
    start: u64,
    bytes: Bytes,
}

impl Length for Part {
    fn len(&self) -> u64 {
        self.start + self.bytes.len() as u64
    }
}

impl ChunkReader for Part {
    type T = bytes::buf::Reader<Bytes>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        let at = start
            .checked_sub(self.start)
            .and_then(|at| usize::try_from(at).ok());
        let at = at.filter(|at| *at <= self.bytes.len());
        let at = at.ok_or_else(|| bad("a column lies outside its row group"))?;
        Ok(self.bytes.slice(at..).reader())
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let bytes = self.get_read(start)?.into_inner();
        if length > bytes.len() {
            return Err(bad("a column lies outside its row group"));
        }
        Ok(bytes.slice(..length))
    }
}

fn rows_of(group: &RowGroupMetaData) -> u64 {
    u64::try_from(group.num_rows()).unwrap_or_default()
}

/// All values of a column without gaps.
fn required<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: usize,
) -> Result<Vec<T::T>, ParquetError> {
    let mut values = Vec::with_capacity(rows);
    let (records, _, _) = reader.read_records(rows, None, None, &mut values)?;
    if records == rows && values.len() == rows {
        Ok(values)
    } else {
        Err(bad("rows are missing"))
    }
}

/// One value per case, which all its rows have.
fn per_case<T: Clone>(values: &[T], same: impl Fn(&T, &T) -> bool) -> Result<Vec<T>, ParquetError> {
    let (cases, _) = values.as_chunks::<ROWS>();
    if cases
        .iter()
        .any(|case| case.iter().any(|value| !same(value, &case[0])))
    {
        return Err(bad("rows of a case differ"));
    }
    Ok(cases.iter().map(|case| case[0].clone()).collect())
}

fn index_of(position: Option<usize>) -> Result<u32, ParquetError> {
    position
        .and_then(|position| u32::try_from(position).ok())
        .ok_or_else(|| bad("a value that the study does not have"))
}

fn bad(message: &str) -> ParquetError {
    ParquetError::General(message.to_owned())
}

/// Without the library's prefix.
fn text_of(error: &ParquetError) -> String {
    match error {
        ParquetError::General(message) | ParquetError::EOF(message) => message.clone(),
        other => other.to_string(),
    }
}

fn failure(path: &Path, message: String) -> ResultsError {
    ResultsError {
        file: path.display().to_string(),
        message,
    }
}
