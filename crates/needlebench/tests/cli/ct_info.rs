//! `ct info`: what it says of a volume, and what it refuses.

use std::path::Path;

use crate::support::{Bench, Json, has_keys, holds};

const COLUMNS: u16 = 16;
const ROWS: u16 = 12;

/// A slice in explicit little endian, of air around a block at 40 HU, with a patient's name on it.
fn write_slice(path: &Path, height_mm: f64, series: u8, bytes_less: usize) {
    let mut data = vec![0; 128];
    data.extend(b"DICM");
    let mut element = |group: u16, number: u16, vr: &[u8; 2], value: &[u8]| {
        data.extend(group.to_le_bytes());
        data.extend(number.to_le_bytes());
        data.extend(vr);
        if vr == b"OW" {
            data.extend([0, 0]);
            data.extend(u32::try_from(value.len()).unwrap().to_le_bytes());
        } else {
            data.extend(u16::try_from(value.len()).unwrap().to_le_bytes());
        }
        data.extend(value);
    };
    let even = |text: String| {
        let pad = text.len() % 2;
        (text + &" ".repeat(pad)).into_bytes()
    };
    let pixels: Vec<u8> = (0..COLUMNS * ROWS)
        .flat_map(|at| if at % COLUMNS < 6 { 24_u16 } else { 1064 }.to_le_bytes())
        .collect();
    let short = |number: u16| number.to_le_bytes();
    element(0x0002, 0x0010, b"UI", b"1.2.840.10008.1.2.1\0");
    element(0x0008, 0x0060, b"CS", b"CT");
    element(0x0010, 0x0010, b"PN", b"Zyxwvut^Abcdefg ");
    element(0x0010, 0x0030, b"DA", b"19431127");
    element(0x0018, 0x0050, b"DS", b"5.0 ");
    element(0x0018, 0x0060, b"DS", b"120 ");
    element(0x0018, 0x1210, b"SH", b"B30f");
    element(0x0020, 0x000E, b"UI", &even(format!("1.2.{series}")));
    element(0x0020, 0x0011, b"IS", &even(series.to_string()));
    element(
        0x0020,
        0x0032,
        b"DS",
        &even(format!("-10\\20\\{height_mm}")),
    );
    element(0x0020, 0x0037, b"DS", b"1\\0\\0\\0\\1\\0 ");
    element(0x0028, 0x0002, b"US", &short(1));
    element(0x0028, 0x0004, b"CS", b"MONOCHROME2 ");
    element(0x0028, 0x0010, b"US", &short(ROWS));
    element(0x0028, 0x0011, b"US", &short(COLUMNS));
    element(0x0028, 0x0030, b"DS", b"0.75\\0.5");
    element(0x0028, 0x0100, b"US", &short(16));
    element(0x0028, 0x0101, b"US", &short(16));
    element(0x0028, 0x0102, b"US", &short(15));
    element(0x0028, 0x0103, b"US", &short(0));
    element(0x0028, 0x1052, b"DS", b"-1024 ");
    element(0x0028, 0x1053, b"DS", b"1 ");
    element(0x7FE0, 0x0010, b"OW", &pixels);
    data.truncate(data.len() - bytes_less);
    std::fs::write(path, data).unwrap();
}

fn series<'n>(bench: &Bench, name: &'n str, heights_mm: &[f64], number: u8) -> &'n str {
    let folder = bench.path(name);
    std::fs::create_dir_all(&folder).unwrap();
    for (at, height_mm) in heights_mm.iter().enumerate() {
        // Names in another order than places.
        let file = folder.join(format!("{number}-{:02}", 50 - at));
        write_slice(&file, *height_mm, number, 0);
    }
    name
}

#[test]
fn a_series_is_described_in_si_units() {
    let bench = Bench::new();
    let folder = series(&bench, "scan", &[0.0, 2.5, 5.0, 7.5], 4);
    let answer = bench
        .run(format!("ct info {folder} --json"))
        .exits_with(0)
        .json();
    has_keys(&answer, "schema_version ok findings remarks volume");
    let volume = &answer["volume"];
    assert_eq!(volume["size"], serde_json::json!([16, 12, 4]));
    assert_eq!(
        volume["spacing_m"],
        serde_json::json!([0.0005, 0.00075, 0.0025])
    );
    assert_eq!(volume["orientation"], "LPS");
    assert_eq!(volume["slice_thickness_m"], 0.005);
    assert_eq!(volume["source"]["kernel"], "B30f");
    assert_eq!(volume["source"]["tube_voltage_v"], 120_000.0);
    assert_eq!(volume["hu"]["minimum"], -1000);
    assert_eq!(volume["hu"]["maximum"], 40);
    assert_eq!(volume["hu"]["air_peak"], -1000);
    assert_eq!(volume["memory_bytes"], 16 * 12 * 4 * 2);
}

#[test]
fn people_read_it_within_eighty_columns() {
    let bench = Bench::new();
    let folder = series(&bench, "scan", &[0.0, 2.5, 5.0, 7.5], 4);
    let text = bench
        .run_with(&[("COLUMNS", Some("80"))], format!("ct info {folder}"))
        .exits_with(0)
        .stdout;
    holds(
        &text,
        [
            "16 x 12 x 4 voxels",
            "0.5000 x 0.7500 x 2.5000 mm",
            "5.000 mm: slices overlap by 2.500 mm",
            "LPS (columns, rows, slices increase towards left, back, head)",
            "-1000 to 40",
            "peak at -1000 HU",
        ],
    );
    let first = text.lines().next().unwrap_or_default().len();
    assert!(
        text.lines().all(|line| line.len() <= first.max(80)),
        "{text}"
    );
}

#[test]
fn nothing_of_the_patient_is_printed() {
    let bench = Bench::new();
    let good = series(&bench, "good", &[0.0, 2.5, 5.0], 4);
    let gap = series(&bench, "gap", &[0.0, 2.5, 7.5, 10.0, 12.5, 15.0], 4);
    let two = series(&bench, "two", &[0.0, 2.5], 4);
    series(&bench, "two", &[0.0, 2.5], 5);
    for (folder, status) in [(good, 0), (gap, 2), (two, 2)] {
        for options in ["ct info", "ct info --json"] {
            let answer = bench.run(format!("{options} {folder}")).exits_with(status);
            for word in ["Zyxwvut", "Abcdefg", "19431127"] {
                assert!(!answer.stdout.contains(word), "{answer:?}");
                assert!(!answer.stderr.contains(word), "{answer:?}");
            }
        }
    }
}

#[test]
fn a_missing_slice_is_refused_and_filled_when_asked() {
    let bench = Bench::new();
    let folder = series(&bench, "gap", &[0.0, 2.5, 7.5, 10.0, 12.5, 15.0], 4);
    let refused = bench.run(format!("ct info {folder}")).exits_with(2).stderr;
    holds(&refused, ["missing between 2.50 and 7.50 mm"]);
    assert!(refused.contains("hint"), "{refused}");
    let filled = bench
        .run(format!("ct info {folder} --fill-gaps --json"))
        .exits_with(0)
        .json();
    assert_eq!(filled["volume"]["size"][2], 7);
    let remark = filled["remarks"][0]["message"].word();
    assert!(remark.contains("interpolated"), "{remark}");
}

#[test]
fn series_are_listed_and_never_mixed() {
    let bench = Bench::new();
    let folder = series(&bench, "two", &[0.0, 2.5], 4);
    series(&bench, "two", &[0.0, 2.5, 5.0], 5);
    let answer = bench
        .run(format!("ct info {folder} --json"))
        .exits_with(2)
        .json();
    let finding = &answer["findings"][0];
    has_keys(finding, "file message hint");
    let hint = finding["hint"].word();
    holds(
        hint,
        ["4: 2 slices of 16 x 12, axial, 5 mm thick, kernel B30f"],
    );
    assert!(hint.contains("5: 3 slices"), "{hint}");
    let chosen = bench
        .run(format!("ct info {folder} --json --series 5"))
        .exits_with(0)
        .json();
    assert_eq!(chosen["volume"]["size"][2], 3);
}

#[test]
fn what_cannot_be_read_names_the_file() {
    let bench = Bench::new();
    let folder = series(&bench, "cut", &[0.0, 2.5, 5.0], 4);
    write_slice(&bench.path("cut").join("4-49"), 2.5, 4, 10);
    let refused = bench.run(format!("ct info {folder}")).exits_with(2).stderr;
    holds(&refused, ["4-49", "truncated"]);
    let missing = bench.run("ct info no_such_scan.nii").exits_with(2).stderr;
    assert!(missing.contains("no_such_scan.nii"), "{missing}");
    let small = series(&bench, "small", &[0.0, 2.5, 5.0], 4);
    bench
        .run(format!("ct info {small} --max-memory 0"))
        .exits_with(2);
}
