//! NRRD files, made line by line.

use std::io::Write as _;
use std::sync::atomic::AtomicBool;

use nalgebra::Point3;
use needlebench_volume::read::{ReadLabels, ReadOptions, read_labels};
use needlebench_volume::{VolumeError, VoxelGrid};

use super::made::{BytesOf, SIZE, hu_at, read, read_as, refusal, remarks};

/// What sums of doubles leave of millimetres.
const ROUNDING_M: f64 = 1e-12;

/// The lines of a header, in the place of the volumes made here.
const HEADER: &str = "type: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 5 4 3\n\
     space directions: (0.5,0,0) (0,-0.75,0) (0.1,0,2)\nkinds: domain domain domain\nendian: little\nencoding: raw\n\
     space origin: (-10,20,30)\n";

/// A file of a header and what follows it.
fn file(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = format!("NRRD0004\n# Zyxwvut\n{header}\n").into_bytes();
    bytes.extend(data);
    bytes
}

fn voxels() -> Vec<u8> {
    let numbers = (0..SIZE.iter().product()).map(hu_at);
    numbers.flat_map(i16::to_le_bytes).collect()
}

fn changed(from: &str, to: &str) -> Vec<u8> {
    assert!(HEADER.contains(from), "{from}");
    file(&HEADER.replace(from, to), &voxels())
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn hu() -> Vec<i16> {
    (0..SIZE.iter().product()).map(hu_at).collect()
}

#[test]
fn voxels_are_placed_by_the_space_of_the_header() {
    for (space, signs) in [
        ("left-posterior-superior", [1.0, 1.0]),
        ("LPS", [1.0, 1.0]),
        ("right-anterior-superior", [-1.0, -1.0]),
        ("RAS", [-1.0, -1.0]),
        ("left-anterior-superior", [1.0, -1.0]),
        ("LAS", [1.0, -1.0]),
    ] {
        let read = read_as("a.nrrd", &changed("left-posterior-superior", space)).unwrap();
        assert_eq!(read.volume.hu, hu());
        let place = read.volume.grid.ct_from_index(&Point3::new(2.0, 3.0, 1.0));
        let expected = Point3::new(-8.9e-3 * signs[0], 17.75e-3 * signs[1], 32e-3);
        assert!((place - expected).norm() < ROUNDING_M, "{space}: {place}");
        assert_eq!(
            read.description.format,
            "NRRD, signed 16-bit, little-endian"
        );
    }
}

#[test]
fn every_type_is_read_by_every_name_in_both_byte_orders() {
    let cases: [(&[&str], BytesOf); 10] = [
        (&["signed char", "int8", "int8_t"], |hu| {
            vec![i8::try_from(hu).unwrap_or(0).cast_unsigned()]
        }),
        (&["uchar", "unsigned char", "uint8", "uint8_t"], |hu| {
            vec![u8::try_from(hu).unwrap_or(0)]
        }),
        (
            &[
                "short",
                "short int",
                "signed short",
                "signed short int",
                "int16",
                "int16_t",
            ],
            |hu| hu.to_le_bytes().to_vec(),
        ),
        (
            &[
                "ushort",
                "unsigned short",
                "unsigned short int",
                "uint16",
                "uint16_t",
            ],
            |hu| u16::try_from(hu).unwrap_or(0).to_le_bytes().to_vec(),
        ),
        (&["int", "signed int", "int32", "int32_t"], |hu| {
            i32::from(hu).to_le_bytes().to_vec()
        }),
        (&["uint", "unsigned int", "uint32", "uint32_t"], |hu| {
            u32::try_from(hu).unwrap_or(0).to_le_bytes().to_vec()
        }),
        (
            &[
                "longlong",
                "long long",
                "long long int",
                "signed long long",
                "signed long long int",
                "int64",
                "int64_t",
            ],
            |hu| i64::from(hu).to_le_bytes().to_vec(),
        ),
        (
            &[
                "ulonglong",
                "unsigned long long",
                "unsigned long long int",
                "uint64",
                "uint64_t",
            ],
            |hu| u64::try_from(hu).unwrap_or(0).to_le_bytes().to_vec(),
        ),
        (&["float"], |hu| f32::from(hu).to_le_bytes().to_vec()),
        (&["double"], |hu| f64::from(hu).to_le_bytes().to_vec()),
    ];
    for (names, bytes_of) in cases {
        let is_signed = bytes_of(-3) != bytes_of(0);
        let is_small = bytes_of(-1000) == bytes_of(0) && is_signed;
        let expected: Vec<i16> = hu()
            .into_iter()
            .map(|hu| match (is_signed, is_small) {
                (true, false) => hu,
                (true, true) => i16::from(i8::try_from(hu).unwrap_or(0)),
                (false, _) => hu.max(0),
            })
            .collect();
        for name in names {
            for order in ["little", "big"] {
                let data: Vec<u8> = hu()
                    .into_iter()
                    .flat_map(|hu| {
                        let mut bytes = bytes_of(hu);
                        if order == "big" {
                            bytes.reverse();
                        }
                        bytes
                    })
                    .collect();
                let header = HEADER
                    .replace("type: short", &format!("type: {name}"))
                    .replace("little", order);
                let read = read_as("a.nrrd", &file(&header, &data)).unwrap();
                assert_eq!(read.volume.hu, expected, "{name}, {order}");
            }
        }
    }
}

#[test]
fn voxels_are_found_whatever_their_layout() {
    let folder = tempfile::tempdir().unwrap();
    let detached = |name: &str, fields: &str, data: &[u8]| {
        let header = folder.path().join("a.nhdr");
        std::fs::write(
            &header,
            format!(
                "NRRD0005\r\n{}",
                format!("{HEADER}{fields}").replace('\n', "\r\n")
            ),
        )
        .unwrap();
        std::fs::write(folder.path().join(name), data).unwrap();
        read(&header, &ReadOptions::default())
    };
    let before = [b"one line\nanother\n12345".as_slice(), &voxels()].concat();
    let gzip = |fields: &str| HEADER.replace("encoding: raw", fields);
    let whole = [
        read_as("a.nrrd", &file(HEADER, &voxels())),
        read_as("a", &file(HEADER, &voxels())),
        read_as("a.nrrd.gz", &packed(&file(HEADER, &voxels()))),
        read_as("a.nrrd", &file(&gzip("encoding: gzip"), &packed(&voxels()))),
        read_as(
            "a.nrrd",
            &file(
                &gzip("encoding: gz\nbyteskip: 5"),
                &packed(&[b"12345".as_slice(), &voxels()].concat()),
            ),
        ),
        read_as(
            "a.nrrd",
            &file(&format!("{HEADER}line skip: 2\nbyte skip: 5\n"), &before),
        ),
        read_as(
            "a.nrrd",
            &file(&format!("{HEADER}lineskip: 2\nbyteskip: -1\n"), &before),
        ),
        detached("a.raw", "data file: a.raw\n", &voxels()),
        detached("b.raw", "datafile: ./b.raw\n", &voxels()),
        detached("c.raw", "data file: c.raw\nbyte skip: -1\n", &before),
        detached(
            "d e.raw",
            "data file: d e.raw\nline skip: 2\nbyte skip: 5\n",
            &before,
        ),
    ];
    for (at, read) in whole.into_iter().enumerate() {
        assert_eq!(read.unwrap().volume.hu, hu(), "{at}");
    }
}

#[test]
fn files_outside_the_folder_and_lists_of_files_are_refused() {
    for (name, word) in [
        ("/etc/hostname", "another folder"),
        ("../a.raw", "another folder"),
        ("sub/a.raw", "another folder"),
        ("a.raw", "beside the header"),
        ("LIST", "list of files"),
        ("a%03d.raw 1 3 1", "list of files"),
    ] {
        let said = refusal(read_as(
            "a.nhdr",
            &file(&format!("{HEADER}data file: {name}\n"), &[]),
        ));
        assert!(said.contains(word), "{name}: {said}");
    }
}

#[test]
fn axes_beside_those_in_space_are_taken_where_they_are_one_long() {
    for (sizes, directions, kinds) in [
        (
            "1 5 4 3",
            "none (0.5,0,0) (0,-0.75,0) (0.1,0,2)",
            "list domain domain domain",
        ),
        (
            "5 4 3 1",
            "(0.5,0,0) (0, -0.75, 0) (0.1,0,2) none",
            "domain domain domain time",
        ),
    ] {
        let header = HEADER
            .replace("dimension: 3", "dimension: 4")
            .replace("sizes: 5 4 3", &format!("sizes: {sizes}"))
            .replace("(0.5,0,0) (0,-0.75,0) (0.1,0,2)", directions)
            .replace("domain domain domain", kinds);
        assert_eq!(
            read_as("a.nrrd", &file(&header, &voxels()))
                .unwrap()
                .volume
                .hu,
            hu()
        );
        for (kind, word) in [
            ("list", "MultiVolume"),
            ("time", "in time"),
            ("RGB-color", "colours"),
            ("vector", "vectors"),
            ("3D-matrix", "matrices"),
        ] {
            let many = header
                .replace("sizes: 1 ", "sizes: 2 ")
                .replace("3 1\n", "3 2\n")
                .replace("kinds: list", &format!("kinds: {kind}"))
                .replace("domain time", &format!("domain {kind}"));
            let said = refusal(read_as("a.nrrd", &file(&many, &voxels().repeat(2))));
            assert!(said.contains(word), "{kind}: {said}");
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_its_line() {
    for (from, to, word) in [
        ("type: short", "type: block", "line 3, type"),
        ("type: short", "type: char", "unknown in NRRD"),
        ("type: short\n", "", "`type`"),
        ("dimension: 3", "dimension: 17", "17 axes"),
        ("dimension: 3", "dimension: 2", "2 axes"),
        ("sizes: 5 4 3", "sizes: 5 0 3", "line 6, sizes"),
        ("sizes: 5 4 3", "sizes: 5 -4 3", "`-4`"),
        (
            "sizes: 5 4 3",
            "sizes: 99999999999 99999999999 99999999999",
            "too many",
        ),
        (
            "sizes: 5 4 3",
            "sizes: 99999999999999999999999 4 3",
            "not a number of voxels",
        ),
        ("sizes: 5 4 3", "sizes: 8000 6000 300", "--max-memory"),
        ("sizes: 5 4 3", "sizes: 1024 1024 511", "truncated"),
        ("(0.5,0,0)", "(0,0,0)", "linearly dependent"),
        ("(0.5,0,0)", "(nan,0,0)", "not a finite number"),
        ("(0.5,0,0)", "(0.5,0)", "three dimensions"),
        ("(0.1,0,2)", "(0.1,0,2", "bracket"),
        ("(0.5,0,0) ", "", "2 directions"),
        ("(0.5,0,0)", "0.5", "(x,y,z)"),
        ("endian: little\n", "", "endian: little"),
        ("little", "middle", "not a byte order"),
        ("raw", "bzip2", "bzip2"),
        ("raw", "ascii", "written as text"),
        ("raw", "hex", "hexadecimal"),
        ("raw", "zipped", "unknown encoding"),
        ("raw", "gzip", "damaged"),
        ("raw", "raw\nbyte skip: -2", "byte skip"),
        ("raw", "raw\nline skip: x", "line skip"),
        ("raw", "raw\ntype: short", "line 3 states it, too"),
        ("raw", "raw\nnothing", "line 11"),
        (
            "raw",
            "raw\nspace units: \"mm\" \"m\" \"mm\"",
            "different units",
        ),
        (
            "raw",
            "raw\nspace units: \"px\" \"px\" \"px\"",
            "not a unit",
        ),
        ("raw", "raw\nspace units: \"m\" \"m\" \"m\"", "implausible"),
        (
            "left-posterior-superior",
            "scanner-xyz",
            "--assume-orientation",
        ),
        (
            "space: left-posterior-superior\n",
            "space dimension: 3\n",
            "--assume-orientation",
        ),
        ("left-posterior-superior", "LPST", "time"),
        ("left-posterior-superior", "upside-down", "unknown in NRRD"),
    ] {
        let said = refusal(read_as("a.nrrd", &changed(from, to)));
        assert!(said.contains(word), "{to}: no '{word}' in {said}");
        assert!(!said.contains("Zyxwvut"));
    }
    let said = refusal(read_as("a.nrrd", b"NRRD0009\n\n"));
    assert!(said.contains("known version"), "{said}");
    let whole = file(HEADER, &voxels());
    for length in 1..whole.len() {
        refusal(read_as("a.nrrd", &whole[..length]));
    }
    let more = read_as("a.nrrd", &[whole, vec![0]].concat()).unwrap();
    assert!(remarks(&more).contains("after the last voxel"));
}

#[test]
fn an_orientation_may_be_assumed() {
    let options = ReadOptions {
        assume_orientation: Some("LAS".parse().unwrap()),
        ..ReadOptions::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    let header = HEADER
        .replace("space: left-posterior-superior\n", "")
        .replace(
            "space directions: (0.5,0,0) (0,-0.75,0) (0.1,0,2)",
            "spacings: 0.5 0.75 2",
        );
    std::fs::write(&path, file(&header, &voxels())).unwrap();
    let read = read(&path, &options).unwrap();
    let place = read.volume.grid.ct_from_index(&Point3::new(4.0, 3.0, 2.0));
    assert!(
        (place - Point3::new(1e-3, -1.125e-3, 2e-3)).norm() < ROUNDING_M,
        "{place}"
    );
    assert!(remarks(&read).contains("LAS"));
}

/// Keys of 3D Slicer.
const KEYS: &str = "Segment0_ID:=Segment_1\nSegment0_Name:=Zwölf: lung left\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n\
     Segment0_Extent:=0 4 0 3 0 2\nSegment1_Name:=Segment_2\nSegment1_LabelValue:=1\nSegment1_Layer:=1\n\
     Segment1_Tags:=Segmentation.Status:inprogress|TerminologyEntry:Segmentation category and type - 3D Slicer General \
     Anatomy list~SCT^123037004^Anatomical Structure~SCT^39607008^Lung~SCT^24028007^Right~~^^~^^|\n\
     Segmentation_ContainedRepresentationNames:=Binary labelmap|Closed surface|\n\
     Segmentation_ReferenceImageExtentOffset:=1 1 0\n";

fn labels_of(header: &str, data: &[u8]) -> Result<ReadLabels, VolumeError> {
    let grid = read_as("a.nrrd", &file(HEADER, &voxels()))
        .unwrap()
        .volume
        .grid;
    labels_on(&grid, header, data)
}

fn labels_on(grid: &VoxelGrid, header: &str, data: &[u8]) -> Result<ReadLabels, VolumeError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seg.nrrd");
    std::fs::write(&path, file(header, data)).unwrap();
    read_labels(
        &path,
        grid,
        &ReadOptions::default(),
        &AtomicBool::new(false),
    )
}

fn layered(keys: &str) -> String {
    HEADER
        .replace("dimension: 3", "dimension: 4")
        .replace("sizes: 5", "sizes: 2 5")
        .replace("directions: ", "directions: none ")
        .replace("kinds: ", "kinds: list ")
        .replace("short", "unsigned char")
        + keys
}

#[test]
fn segments_in_layers_get_a_label_each_and_the_last_counts() {
    // Layers are beside each other: voxels 0 and 1 in the first segment, 1 and 2 in the second.
    let mut data = vec![0; 120];
    for at in [0, 2, 3, 5] {
        data[at] = 1;
    }
    let read = labels_of(&layered(KEYS), &data).unwrap();
    assert_eq!(read.labels.labels[..4], [1, 2, 2, 0]);
    let names = [
        (1, "Zwölf: lung left".to_owned()),
        (2, "Lung Right".to_owned()),
    ];
    assert_eq!(read.labels.names, names);
    let said: Vec<_> = read
        .remarks
        .iter()
        .map(|remark| remark.message.as_str())
        .collect();
    assert!(
        said.iter()
            .any(|said| said.starts_with("1 voxels are in several")),
        "{said:?}"
    );
    assert!(
        said.iter().any(|said| said.contains("from layer to layer")),
        "{said:?}"
    );
    // Values of their own are the labels; one without a segment is nothing.
    let own = KEYS.replace("Segment1_LabelValue:=1", "Segment1_LabelValue:=7");
    data[3] = 7;
    let read = labels_of(&layered(&own), &data).unwrap();
    assert_eq!(read.labels.labels[..4], [1, 7, 0, 0]);
    assert!(
        read.remarks
            .iter()
            .any(|remark| remark.message.contains("no segment"))
    );
    // As a CT it is none.
    let said = refusal(read_as("a.seg.nrrd", &file(&layered(KEYS), &data)));
    assert!(said.contains("2 layers"), "{said}");
}

#[test]
fn segments_in_one_layer_keep_their_values() {
    let keys = KEYS
        .replace("Segment1_LabelValue:=1", "Segment1_LabelValue:=9")
        .replace("Layer:=1", "Layer:=0");
    let mut data = vec![0; 60];
    data[..3].copy_from_slice(&[9, 1, 4]);
    let header = HEADER.replace("short", "uchar") + &keys;
    let read = labels_of(&header, &data).unwrap();
    assert_eq!(read.labels.labels[..4], [9, 1, 4, 0]);
    let names: Vec<_> = read
        .labels
        .names
        .iter()
        .map(|(label, name)| (*label, name.as_str()))
        .collect();
    assert_eq!(
        names,
        [(1, "Zwölf: lung left"), (4, "label 4"), (9, "Lung Right")]
    );
}

#[test]
fn segmentations_that_make_no_sense_are_refused() {
    let data = vec![0; 120];
    for (from, to, word) in [
        ("Segment1_Layer:=1", "Segment1_Layer:=2", "layer 2"),
        ("Segment1_Layer:=1", "Segment1_Layer:=0", "same value 1"),
        ("Segment1_Layer:=1", "Segment1_Layer:=x", "Segment1_Layer"),
        (
            "Segment1_LabelValue:=1",
            "Segment1_LabelValue:=0",
            "nothing",
        ),
        (
            "Segment1_LabelValue:=1",
            "Segment1_LabelValue:=70000",
            "Segment1_LabelValue",
        ),
        (
            "Segmentation_",
            "Segmentation_MasterRepresentation:=Fractional labelmap\nSegmentation_",
            "fractions",
        ),
    ] {
        let said = refusal(labels_of(&layered(&KEYS.replacen(from, to, 1)), &data));
        assert!(said.contains(word), "{to}: no '{word}' in {said}");
    }
    let said = refusal(labels_of(&layered(""), &data));
    assert!(said.contains("2 volumes"), "{said}");
}

#[test]
fn a_part_of_the_ct_is_placed_in_it() {
    // From voxel (1, 1, 0) on, with columns and rows the other way: 3 x 2 x 3.
    let header = HEADER
        .replace("short", "uchar")
        .replace("5 4 3", "3 2 3")
        .replace("(0.5,0,0) (0,-0.75,0)", "(-0.5,0,0) (0,0.75,0)")
        .replace("(-10,20,30)", "(-8.5,18.5,30)");
    let mut data = vec![0; 18];
    data[0] = 3;
    data[17] = 4;
    let read = labels_of(&header, &data).unwrap();
    let labelled: Vec<_> = (0..)
        .zip(&read.labels.labels)
        .filter(|(_, label)| **label > 0)
        .collect();
    // Voxel (3, 2, 0) and voxel (1, 1, 2).
    assert_eq!(labelled, [(13, &3), (46, &4)]);
    assert!(
        read.remarks[0]
            .message
            .contains("3 x 2 x 3 of the CT's 5 x 4 x 3")
    );
    for origin in ["(-8.4,18.5,30)", "(-8.5,20.75,30)", "(-9.5,18.5,30)"] {
        let elsewhere = header.replace("(-8.5,18.5,30)", origin);
        let said = refusal(labels_of(&elsewhere, &data));
        assert!(said.contains("another volume"), "{said}");
        assert!(said.contains("3 x 2 x 3 voxels"), "{said}");
    }
}
