//! MetaImage files, made line by line.

use std::io::Write as _;

use nalgebra::Point3;
use needlebench_volume::read::ReadOptions;

use super::made::{BytesOf, SIZE, hu_at, read, read_as, refusal, remarks};

/// What sums of doubles leave of millimetres.
const ROUNDING_M: f64 = 1e-12;

/// The lines of a header, in the place of the volumes made here. Columns run along (0, 1, 0).
const HEADER: &str = "ObjectType = Image\nNDims = 3\nComment = Zyxwvut\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
     CompressedData = False\nTransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = -10 20 30\nCenterOfRotation = 0 0 0\n\
     AnatomicalOrientation = PLI\nElementSpacing = 0.5 0.75 2\nDimSize = 5 4 3\nElementType = MET_SHORT\n\
     ElementDataFile = LOCAL\n";

fn file(header: &str, data: &[u8]) -> Vec<u8> {
    [header.as_bytes(), data].concat()
}

fn hu() -> Vec<i16> {
    (0..SIZE.iter().product()).map(hu_at).collect()
}

fn voxels() -> Vec<u8> {
    hu().into_iter().flat_map(i16::to_le_bytes).collect()
}

fn changed(from: &str, to: &str) -> Vec<u8> {
    assert!(HEADER.contains(from), "{from}");
    file(&HEADER.replace(from, to), &voxels())
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn rows_of_the_matrix_are_directions_of_axes() {
    for (from, to) in [
        ("", ""),
        ("TransformMatrix", "Rotation"),
        ("TransformMatrix", "Orientation"),
        ("Offset", "Origin"),
        ("Offset", "Position"),
        ("NDims = 3", "NDims=3"),
    ] {
        let read = read_as("a", &changed(from, to)).unwrap();
        assert_eq!(read.volume.hu, hu());
        let place = read.volume.grid.ct_from_index(&Point3::new(2.0, 3.0, 1.0));
        assert!(
            (place - Point3::new(-12.25e-3, 21e-3, 32e-3)).norm() < ROUNDING_M,
            "{place}"
        );
    }
    let four = HEADER
        .replace("NDims = 3", "NDims = 4")
        .replace("0 1 0 -1 0 0 0 0 1", "0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1")
        .replace("20 30", "20 30 0")
        .replace("0.75 2", "0.75 2 1")
        .replace("5 4 3", "5 4 3 1");
    let read = read_as("a.mha", &file(&four, &voxels())).unwrap();
    let place = read.volume.grid.ct_from_index(&Point3::new(2.0, 3.0, 1.0));
    assert!(
        (place - Point3::new(-12.25e-3, 21e-3, 32e-3)).norm() < ROUNDING_M,
        "{place}"
    );
}

#[test]
fn every_type_is_read_in_both_byte_orders() {
    let cases: [(&str, BytesOf); 12] = [
        ("MET_CHAR", |hu| {
            vec![i8::try_from(hu).unwrap_or(0).cast_unsigned()]
        }),
        ("MET_UCHAR", |hu| vec![u8::try_from(hu).unwrap_or(0)]),
        ("MET_SHORT", |hu| hu.to_le_bytes().to_vec()),
        ("MET_USHORT", |hu| {
            u16::try_from(hu).unwrap_or(0).to_le_bytes().to_vec()
        }),
        ("MET_INT", |hu| i32::from(hu).to_le_bytes().to_vec()),
        ("MET_UINT", |hu| {
            u32::try_from(hu).unwrap_or(0).to_le_bytes().to_vec()
        }),
        ("MET_LONG", |hu| i32::from(hu).to_le_bytes().to_vec()),
        ("MET_ULONG", |hu| {
            u32::try_from(hu).unwrap_or(0).to_le_bytes().to_vec()
        }),
        ("MET_LONG_LONG", |hu| i64::from(hu).to_le_bytes().to_vec()),
        ("MET_ULONG_LONG", |hu| {
            u64::try_from(hu).unwrap_or(0).to_le_bytes().to_vec()
        }),
        ("MET_FLOAT", |hu| f32::from(hu).to_le_bytes().to_vec()),
        ("MET_DOUBLE", |hu| f64::from(hu).to_le_bytes().to_vec()),
    ];
    for (name, bytes_of) in cases {
        for (order, key) in [
            ("False", "ElementByteOrderMSB"),
            ("True", "ElementByteOrderMSB"),
            ("True", "BinaryDataByteOrderMSB"),
        ] {
            let data: Vec<u8> = hu()
                .into_iter()
                .flat_map(|hu| {
                    let mut bytes = bytes_of(hu);
                    if order == "True" {
                        bytes.reverse();
                    }
                    bytes
                })
                .collect();
            let header = HEADER
                .replace(
                    "BinaryDataByteOrderMSB = False",
                    &format!("{key} = {order}"),
                )
                .replace("MET_SHORT", name);
            let read = read_as("a.mha", &file(&header, &data)).unwrap();
            let expected: Vec<i16> = hu()
                .into_iter()
                .map(|hu| match name {
                    "MET_CHAR" => i16::from(i8::try_from(hu).unwrap_or(0)),
                    name if name.starts_with("MET_U") => hu.max(0),
                    _ => hu,
                })
                .collect();
            assert_eq!(read.volume.hu, expected, "{name}, {key} = {order}");
        }
    }
}

#[test]
fn voxels_are_found_whatever_their_layout() {
    let zlib = HEADER.replace("CompressedData = False", "CompressedData = True");
    let read_packed = read_as("a.mha", &file(&zlib, &packed(&voxels()))).unwrap();
    assert_eq!(read_packed.volume.hu, hu());
    assert!(read_packed.description.format.ends_with("zlib"));
    let begins = format!("HeaderSize = -1\n{HEADER}");
    let read_last = read_as(
        "a.mha",
        &file(&begins, &[b"12".as_slice(), &voxels()].concat()),
    );
    assert_eq!(read_last.unwrap().volume.hu, hu());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mhd");
    let before = [b"12345".as_slice(), &voxels()].concat();
    for (text, data) in [
        (HEADER.to_owned(), voxels()),
        (format!("HeaderSize = 5\n{HEADER}"), before.clone()),
        (format!("HeaderSize = -1\n{HEADER}"), before),
        (zlib, packed(&voxels())),
    ] {
        std::fs::write(
            &path,
            text.replace("LOCAL", "a b.raw").replace('\n', "\r\n"),
        )
        .unwrap();
        std::fs::write(folder.path().join("a b.raw"), data).unwrap();
        let read = read(&path, &ReadOptions::default()).unwrap();
        assert_eq!(read.volume.hu, hu());
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_its_line() {
    for (from, to, word) in [
        ("Image", "Tube", "line 1, ObjectType"),
        ("NDims = 3", "NDims = 2", "2 axes"),
        ("NDims = 3", "NDims = x", "line 2, NDims"),
        ("NDims = 3", "NDims = 3\nNDims = 3", "line 2 states it, too"),
        ("5 4 3", "5 4", "2 lengths"),
        ("5 4 3", "5 0 3", "not a number of voxels"),
        ("5 4 3", "99999999999 99999999999 99999999999", "too many"),
        ("5 4 3", "8000 6000 300", "--max-memory"),
        ("5 4 3", "1024 1024 511", "truncated"),
        ("MET_SHORT", "MET_SHORT_ARRAY", "arrays"),
        ("MET_SHORT", "short", "not a type"),
        ("BinaryData = True", "BinaryData = False", "text"),
        (
            "BinaryData = True",
            "BinaryData = perhaps",
            "neither True nor False",
        ),
        (
            "BinaryData = True",
            "ElementByteOrderMSB = True",
            "two byte orders",
        ),
        ("CompressedData = False", "CompressedData = True", "damaged"),
        (
            "CompressedData = False",
            "CompressedData = True\nHeaderSize = -1",
            "HeaderSize",
        ),
        ("CompressedData = False", "HeaderSize = -2", "HeaderSize"),
        (
            "CompressedData = False",
            "ElementNumberOfChannels = 3",
            "3 numbers a voxel",
        ),
        ("CompressedData = False", "DistanceUnits = px", "not a unit"),
        (
            "CompressedData = False",
            "DistanceUnits = um",
            "DistanceUnits",
        ),
        (
            "CompressedData = False",
            "ElementToIntensityFunctionSlope = 2",
            "some programs",
        ),
        (
            "TransformMatrix = 0 1 0 -1 0 0 0 0 1\n",
            "",
            "--assume-orientation",
        ),
        (
            "ElementSpacing = 0.5 0.75 2\n",
            "",
            "write it into the header, in mm",
        ),
        (
            "0 1 0 -1 0 0 0 0 1",
            "0 1 0 0 1 0 0 0 1",
            "linearly dependent",
        ),
        ("0 1 0 -1 0 0 0 0 1", "0 1 0 -1", "4 numbers, not 9"),
        ("-10 20 30", "-10 inf 30", "not a finite number"),
        ("LOCAL", "LIST", "list of files"),
        ("LOCAL", "a%03d.raw 1 3 1", "list of files"),
        ("LOCAL", "/etc/hostname", "another folder"),
        ("LOCAL", "../a.raw", "another folder"),
        ("LOCAL", "a.raw", "beside the header"),
        ("ElementDataFile = LOCAL\n", "", "truncated"),
    ] {
        let mut bytes = changed(from, to);
        if to.is_empty() && from.starts_with("ElementDataFile") {
            bytes.truncate(HEADER.len() - from.len());
        }
        let said = refusal(read_as("a.mha", &bytes));
        let is_told = said.contains(word) || said.contains("`ElementDataFile`");
        assert!(is_told, "{to}: no '{word}' in {said}");
        assert!(!said.contains("Zyxwvut"));
    }
    let whole = file(HEADER, &voxels());
    for length in 1..whole.len() {
        refusal(read_as("a.mha", &whole[..length]));
    }
    let more = read_as("a.mha", &[whole, vec![0]].concat()).unwrap();
    assert!(remarks(&more).contains("after the last voxel"));
}
