//! Tables that are read again, and files that are none.

use std::path::Path;
use std::sync::Arc;

use needlebench_study::{
    CaseDesign, CaseEvaluator, MetricColumn, ParquetResults, RESULTS_FILE, Results, ResultsError,
    Row,
};
use parquet::data_type::Int64Type;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use super::folder::{Request, tables};
use super::synthetic::{SyntheticDesign, SyntheticEvaluator, columns};

const CASES: u64 = 300;

fn table() -> (tempfile::TempDir, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    Request::new(CASES, 64).run(folder.path()).unwrap();
    let bytes = std::fs::read(folder.path().join(RESULTS_FILE)).unwrap();
    (folder, bytes)
}

/// Opens and reads all of a file.
fn read(path: &Path) -> Result<u64, ResultsError> {
    let results = ParquetResults::open(path)?;
    let mut cases = 0;
    results.visit(&mut |_, _| cases += 1)?;
    Ok(cases)
}

/// Why bytes are no table.
fn refused(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table");
    std::fs::write(&path, bytes).unwrap();
    let error = read(&path).unwrap_err();
    assert_eq!(error.file, path.display().to_string());
    error.message
}

#[test]
fn what_is_read_is_what_was_computed() {
    let (folder, _) = table();
    let results = ParquetResults::open(&folder.path().join(RESULTS_FILE)).unwrap();
    let design = SyntheticDesign::new(CASES);
    assert_eq!(results.factors(), design.factors());
    assert_eq!(results.cases(), CASES);
    assert_eq!(results.study_id(), "5eed");
    assert_eq!(results.study_name(), "synthetic");
    assert_eq!(results.provenance(), &design.manifest(64).provenance);
    let mut worker = SyntheticEvaluator::FAST.worker();
    let mut next = 0;
    let mut visit = |values: &[_], found: &needlebench_study::CaseResult| {
        let expected = worker.evaluate(next).unwrap();
        assert_eq!(values, design.values(next));
        assert_eq!(found.case, next);
        for (found, expected) in found.rows.iter().zip(&expected.rows) {
            assert_eq!(found.configuration, expected.configuration);
            assert_eq!(found.outcome, expected.outcome);
            assert_eq!(found.detail, expected.detail);
            let bits = |row: &Row| {
                let columns = 0..columns().len();
                columns
                    .map(|column| row.get(column).map(f32::to_bits))
                    .collect::<Vec<_>>()
            };
            assert_eq!(bits(found), bits(expected));
        }
        next += 1;
    };
    results.visit(&mut visit).unwrap();
    assert_eq!(next, CASES);
}

#[test]
fn a_table_describes_its_columns() {
    let (folder, _) = table();
    let file = std::fs::File::open(folder.path().join(RESULTS_FILE)).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let metadata = reader.metadata().file_metadata();
    let pairs = metadata.key_value_metadata().unwrap();
    let get = |key: &str| {
        pairs
            .iter()
            .find(|pair| pair.key == key)
            .unwrap()
            .value
            .clone()
            .unwrap()
    };
    let described: serde_json::Value = serde_json::from_str(&get("needlebench.columns")).unwrap();
    let names: Vec<&str> = metadata
        .schema()
        .get_fields()
        .iter()
        .map(|field| field.name())
        .collect();
    assert_eq!(names.len(), 1 + 4 + 3 + columns().len());
    let metrics: Vec<MetricColumn> = serde_json::from_str(&get("needlebench.metrics")).unwrap();
    assert_eq!(metrics, columns());
    assert_eq!(&names[..3], ["case", "goal", "phantom_size"]);
    for name in names {
        assert!(described[name].is_string(), "{name}");
    }
    assert_eq!(described["tilt_deg"], "noise factor, deg");
    let provenance: serde_json::Value =
        serde_json::from_str(&get("needlebench.provenance")).unwrap();
    assert_eq!(provenance["program"]["name"], "needlebench");
}

#[test]
fn a_table_and_its_csv_have_the_same_cells() {
    let (folder, _) = table();
    let [_, csv] = tables(folder.path());
    let csv = String::from_utf8(csv).unwrap();
    let mut lines = csv.lines();
    let header = lines.next().unwrap();
    assert!(header.starts_with(
        "case,goal,phantom_size,tool,tilt_deg,configuration,outcome,detail,clearance_static_mm,"
    ));
    let results = ParquetResults::open(&folder.path().join(RESULTS_FILE)).unwrap();
    let mut visit = |_: &[_], case: &needlebench_study::CaseResult| {
        for row in &case.rows {
            let line = lines.next().unwrap();
            let line = line.replace("\"long, \"\"thin\"\"\"", "long");
            let cells: Vec<&str> = line.split(',').collect();
            assert_eq!(cells[0], case.case.to_string());
            assert_eq!(cells[6], row.outcome.name());
            assert_eq!(cells[7], row.detail);
            for (cell, value) in cells[8..].iter().zip(&row.values) {
                let number: f32 = if cell.is_empty() {
                    f32::NAN
                } else {
                    cell.parse().unwrap()
                };
                assert_eq!(number.to_bits(), value.to_bits());
            }
        }
    };
    results.visit(&mut visit).unwrap();
    assert_eq!(lines.next(), None);
}

#[test]
fn files_that_are_no_tables_are_told_apart() {
    assert_eq!(refused(b""), "is empty");
    assert_eq!(refused(b"PAR1"), "is not a Parquet file");
    assert_eq!(
        refused(b"case,goal,outcome\n0,a,ok\n"),
        "is not a Parquet file"
    );
    let missing = read(Path::new("no/such/file")).unwrap_err().to_string();
    assert!(
        missing.starts_with("no/such/file: cannot be opened: "),
        "{missing}"
    );
}

#[test]
fn a_foreign_parquet_file_is_refused() {
    let schema = parse_message_type("message m { REQUIRED INT64 case; }").unwrap();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column
        .typed::<Int64Type>()
        .write_batch(&[1, 2], None, None)
        .unwrap();
    column.close().unwrap();
    group.close().unwrap();
    let bytes = writer.into_inner().unwrap();
    assert_eq!(
        refused(&bytes),
        "is a Parquet file, but not the results of a needlebench study"
    );
}

#[test]
fn a_table_cut_off_anywhere_is_refused() {
    let (_folder, bytes) = table();
    for part in 1..20 {
        let end = bytes.len() * part / 20;
        let message = refused(&bytes[..end]);
        let expected = format!("is cut off: it has {end} bytes and no footer");
        assert!(message.starts_with(&expected), "{message}");
    }
    let message = refused(&bytes[..bytes.len() - 1]);
    assert!(message.starts_with("is cut off"), "{message}");
    // Something missing in the middle.
    let cut = [&bytes[..20_000], &bytes[21_000..]].concat();
    assert!(refused(&cut).contains("is damaged: "));
}

/// Bits that are flipped, one at a time, in each part of the table.
const FLIPS: usize = 200;

#[test]
fn a_flipped_bit_is_found_wherever_it_is() {
    let (folder, bytes) = table();
    let path = folder.path().join("flipped");
    let footer = u32::from_le_bytes(bytes[bytes.len() - 8..][..4].try_into().unwrap()) as usize;
    let rows = bytes.len() - 8 - footer;
    // As many in the rows as in the footer with all that it says, and every bit of both ends.
    let spread = |from: usize, to: usize| {
        (0..FLIPS).map(move |at| (from + (to - 1 - from) * at / (FLIPS - 1), at % 8))
    };
    let ends = (0..4).chain(bytes.len() - 8..bytes.len());
    let ends = ends.flat_map(|at| (0..8).map(move |bit| (at, bit)));
    for (at, bit) in spread(4, rows)
        .chain(spread(rows, bytes.len() - 8))
        .chain(ends)
    {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << bit;
        std::fs::write(&path, flipped).unwrap();
        assert!(
            read(&path).is_err(),
            "bit {bit} of byte {at} of {}",
            bytes.len()
        );
    }
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(read(&path), Ok(CASES));
}

#[test]
fn the_sum_and_the_version_are_found_to_be_changed_bit_by_bit() {
    let (folder, bytes) = table();
    let path = folder.path().join("flipped");
    for key in ["needlebench.sha256", "needlebench.schema_version"] {
        let key = key.as_bytes();
        let at = bytes
            .windows(key.len())
            .rposition(|window| window == key)
            .unwrap();
        // The key, and a text behind it.
        for at in at - 2..at + key.len() + 3 {
            for bit in 0..8 {
                let mut flipped = bytes.clone();
                flipped[at] ^= 1 << bit;
                std::fs::write(&path, flipped).unwrap();
                assert!(
                    read(&path).is_err(),
                    "bit {bit} of byte {at} of {}",
                    bytes.len()
                );
            }
        }
    }
}

/// The table as if another version had written it, and without a sum.
fn of_version(version: u8) -> Vec<u8> {
    let (_folder, mut bytes) = table();
    let sum = b"needlebench.sha256";
    let at = bytes
        .windows(sum.len())
        .rposition(|window| window == sum)
        .unwrap();
    bytes[at + 12..at + sum.len()].copy_from_slice(b"unused");
    let key = b"needlebench.schema_version";
    let at = bytes
        .windows(key.len())
        .position(|window| window == key)
        .unwrap()
        + key.len();
    // Thrift: field, length, text.
    assert_eq!(&bytes[at..at + 3], [0x18, 1, b'3']);
    bytes[at + 2] = version;
    bytes
}

#[test]
fn a_table_of_another_version_is_refused() {
    for version in [b'1', b'2', b'4'] {
        let expected = format!(
            "has schema version {}; this program reads version 3",
            char::from(version)
        );
        assert_eq!(refused(&of_version(version)), expected);
    }
}

#[test]
fn a_table_without_a_sum_is_refused() {
    assert!(refused(&of_version(b'3')).starts_with("is damaged: it has no SHA-256"));
}
