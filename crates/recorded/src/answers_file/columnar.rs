//! Answers in binary files: Parquet, and arrays of NumPy.

use bytes::Bytes;
use needlebench_input::Finding;
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;

use super::cells::{Cell, Columns};
use super::{HINT, Made};

pub(super) const NPY_MAGIC: &[u8] = b"\x93NUMPY";
pub(super) const PARQUET_MAGIC: &[u8] = b"PAR1";

/// Reads a Parquet file with a row for each answer.
pub(super) fn parquet(file: &str, bytes: Vec<u8>) -> Result<Made, Finding> {
    let fail = |error: parquet::errors::ParquetError| {
        let message = format!("not a Parquet file that can be read: {error}");
        let hint = "write it with plain columns, uncompressed or with zstd; or write a CSV file";
        Finding::new(file, message).hint(hint)
    };
    let reader = SerializedFileReader::new(Bytes::from(bytes)).map_err(fail)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let names = schema.columns().iter();
    let names: Vec<String> = names
        .map(|column| column.path().parts().join("."))
        .collect();
    let mut made = Made::default();
    let columns = Columns::of(file, names, &mut made)?;
    for (index, row) in reader.get_row_iter(None).map_err(fail)?.enumerate() {
        let row = row.map_err(fail)?;
        let cells: Vec<Cell> = row
            .get_column_iter()
            .map(|(_, field)| cell(field))
            .collect();
        columns.take(&cells, None, &mut made).map_err(|finding| {
            let message = format!("row {}: {}", index + 1, finding.message);
            Finding { message, ..finding }
        })?;
    }
    Ok(made)
}

fn cell(field: &Field) -> Cell {
    match field {
        Field::Double(value) => Cell::Number(*value),
        Field::Float(value) => Cell::Number(f64::from(*value)),
        Field::Int(value) => Cell::Number(f64::from(*value)),
        Field::Str(text) => Cell::Text(text.clone()),
        other => Cell::Text(other.to_string()),
    }
}

/// Reads an array of `n` rows of six joint positions.
///
/// The format is NumPy's (NEP 1): magic, version, length of the header, the header as a dictionary of Python, the values.
pub(super) fn npy(file: &str, bytes: &[u8]) -> Result<Made, Finding> {
    let refuse = |message: String| {
        let hint = "save it with numpy.save: an array of n x 6 of float64 or float32, in C order";
        Finding::new(file, message).hint(hint)
    };
    let cut = || refuse("the array is cut off".to_owned());
    let version = *bytes.get(NPY_MAGIC.len()).ok_or_else(cut)?;
    let (length_bytes, begin) = if version < 2 { (2, 10) } else { (4, 12) };
    let written = bytes.get(8..begin).ok_or_else(cut)?;
    let length = written
        .iter()
        .take(length_bytes)
        .rev()
        .fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
    let values_at = begin.checked_add(length).ok_or_else(cut)?;
    let header = bytes.get(begin..values_at).ok_or_else(cut)?;
    let header = String::from_utf8_lossy(header);
    let after = |key: &str| {
        let (_, rest) = header.split_once(key)?;
        Some(rest.trim_start_matches(['\'', '"', ':', ' ']))
    };
    let kind = after("descr").and_then(|rest| rest.split(['\'', '"']).next());
    let read: fn(&[u8]) -> f64 = match kind {
        Some("<f8") => |value| f64::from_le_bytes(value.try_into().unwrap_or_default()),
        Some("<f4") => |value| f64::from(f32::from_le_bytes(value.try_into().unwrap_or_default())),
        kind => {
            let kind = kind.unwrap_or("unknown");
            return Err(refuse(format!("the values are of the type `{kind}`")));
        }
    };
    let size = if kind == Some("<f4") { 4 } else { 8 };
    if after("fortran_order").is_some_and(|rest| rest.starts_with("True")) {
        return Err(refuse("the array is in Fortran's order".to_owned()));
    }
    let shape = after("shape").and_then(|rest| rest.strip_prefix('(')?.split(')').next());
    let shape = shape.unwrap_or_default();
    let parts = shape.split(',').map(str::trim);
    let numbers = parts.filter(|part| !part.is_empty()).map(str::parse);
    let sizes: Vec<usize> = numbers.collect::<Result<_, _>>().unwrap_or_default();
    let rows = match sizes[..] {
        [JOINT_COUNT] => 1,
        [rows, JOINT_COUNT] => rows,
        _ => {
            return Err(refuse(format!(
                "the array has the shape ({shape}), not n x 6"
            )));
        }
    };
    let values = &bytes[values_at..];
    let expected = rows.checked_mul(JOINT_COUNT * size);
    if expected != Some(values.len()) {
        let message = format!(
            "{} bytes of values for {rows} x {JOINT_COUNT}",
            values.len()
        );
        return Err(refuse(message));
    }
    let mut made = Made::default();
    let names = JOINT_NAMES.map(str::to_owned).to_vec();
    let columns = Columns::of(file, names, &mut made).map_err(|finding| finding.hint(HINT))?;
    for row in values.chunks_exact(JOINT_COUNT * size) {
        let row: Vec<Cell> = row
            .chunks_exact(size)
            .map(|value| Cell::Number(read(value)))
            .collect();
        columns.take(&row, None, &mut made)?;
    }
    Ok(made)
}
