//! MGH files, made byte by byte, and files of formats that are not read.

use std::io::Write as _;

use nalgebra::Point3;
use needlebench_volume::read::ReadOptions;

use super::made::{BytesOf, SIZE, hu_at, mgh, read, read_as, refusal, remarks};

/// What 32 bits leave of millimetres.
const ROUNDING_M: f64 = 1e-9;

fn hu() -> Vec<i16> {
    (0..SIZE.iter().product()).map(hu_at).collect()
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn changed(at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut file = mgh();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    file
}

#[test]
fn the_centre_is_that_of_half_the_size() {
    for (name, bytes) in [
        ("a.mgh", mgh()),
        ("a.mgz", packed(&mgh())),
        ("a", mgh()),
        ("a.gz", packed(&mgh())),
        ("a.nii.gz", packed(&mgh())),
    ] {
        let read = read_as(name, &bytes).unwrap();
        assert_eq!(read.volume.hu, hu());
        // c_ras (1, 2, 3) at index (2.5, 2, 1.5); columns to the left.
        let place = read.volume.grid.ct_from_index(&Point3::new(2.5, 2.0, 1.5));
        assert!(
            (place - Point3::new(-1e-3, -2e-3, 3e-3)).norm() < ROUNDING_M,
            "{place}"
        );
        let place = read.volume.grid.ct_from_index(&Point3::new(3.5, 4.0, 0.5));
        assert!(
            (place - Point3::new(-0.5e-3, -3.5e-3, 1e-3)).norm() < ROUNDING_M,
            "{place}"
        );
        // What follows the voxels is no surprise.
        assert!(!remarks(&read).contains("ignored"), "{}", remarks(&read));
    }
}

#[test]
fn every_type_is_read() {
    let cases: [(u8, BytesOf); 5] = [
        (0, |hu| vec![u8::try_from(hu).unwrap_or(0)]),
        (1, |hu| i32::from(hu).to_be_bytes().to_vec()),
        (3, |hu| f32::from(hu).to_be_bytes().to_vec()),
        (4, |hu| hu.to_be_bytes().to_vec()),
        (10, |hu| {
            u16::try_from(hu).unwrap_or(0).to_be_bytes().to_vec()
        }),
    ];
    for (code, bytes_of) in cases {
        let mut file = changed(20, &[0, 0, 0, code]);
        file.truncate(284);
        file.extend(hu().into_iter().flat_map(bytes_of));
        let read = read_as("a.mgh", &file).unwrap();
        let is_signed = !matches!(code, 0 | 10);
        let expected: Vec<i16> = hu()
            .into_iter()
            .map(|hu| if is_signed { hu } else { hu.max(0) })
            .collect();
        assert_eq!(read.volume.hu, expected, "{code}");
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_its_field() {
    let cases: [(usize, &[u8], &str); 9] = [
        (0, &[0, 0, 0, 2], "its version"),
        (4, &[0, 0, 0, 0], "width"),
        (8, &[0xff, 0, 0, 0], "height"),
        (
            4,
            &[
                0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff,
            ],
            "too many",
        ),
        (
            4,
            &[0, 0, 0x1f, 0x40, 0, 0, 0x17, 0x70, 0, 0, 1, 0x2c],
            "--max-memory",
        ),
        (16, &[0, 0, 0, 2], "2 volumes"),
        (20, &[0, 0, 0, 6], "tensors"),
        (28, &[0, 0], "--assume-orientation"),
        (42, &[0; 12], "linearly dependent"),
    ];
    for (at, bytes, word) in cases {
        let said = refusal(read_as("a.mgh", &changed(at, bytes)));
        assert!(said.contains(word), "no '{word}' in {said}");
    }
    let voxels = 284 + 2 * SIZE.iter().product::<usize>();
    for length in 1..voxels {
        refusal(read_as("a.mgh", &mgh()[..length]));
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mgh");
    std::fs::write(&path, changed(28, &[0, 0])).unwrap();
    let options = ReadOptions {
        assume_orientation: Some("RAS".parse().unwrap()),
        ..ReadOptions::default()
    };
    assert!(remarks(&read(&path, &options).unwrap()).contains("RAS"));
}

#[test]
fn other_formats_are_refused_by_their_names() {
    let npy: &[u8] = b"\x93NUMPY\x01\0";
    let cases: [(&str, &[u8], &str); 15] = [
        ("a", b"PK\x03\x04....", "ZIP"),
        ("a", b"# vtk DataFile Version 3.0\n", "VTK"),
        (
            "a",
            b"<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\">",
            "VTK",
        ),
        ("a.mat", b"MATLAB 5.0 MAT-file, ", "MATLAB"),
        ("a", npy, "NumPy"),
        ("a", b"\x89HDF\r\n\x1a\n", "MINC"),
        ("a", b"\x89PNG\r\n\x1a\n", "PNG"),
        ("a", b"\xff\xd8\xff\xe0", "JPEG"),
        ("a", b"II*\0....", "TIFF"),
        ("a.stl", b"solid a\n", "STL"),
        ("a.PAR", b"# === DATA DESCRIPTION FILE ====", "PAR"),
        ("a.raw", b"12345678", "without a header"),
        ("a", b"BZh9....", "bzip2"),
        ("a", b"what is this?", "NRRD"),
        ("a", b"NRRD00.01\n", "version"),
    ];
    for (name, bytes, word) in cases {
        let said = refusal(read_as(name, bytes));
        assert!(said.contains(word), "no '{word}' in {said}");
    }
    let said = refusal(read_as("a.gz", &packed(npy)));
    assert!(said.contains("gzip file of a NumPy array"), "{said}");
    let said = refusal(read_as("a.gz", &packed(b"what is this?")));
    assert!(said.contains("gzip file, but not"), "{said}");
}
