//! NIfTI files, made byte by byte.

use std::io::Write as _;

use nalgebra::Point3;
use needlebench_volume::read::ReadOptions;

use super::made::{SIZE, hu_at, nifti, read, read_as, refusal, remarks};

/// What 32 bits leave of millimetres.
const ROUNDING_M: f64 = 1e-9;

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// NIfTI-1, little-endian, with bytes changed.
fn changed(at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut file = nifti(1, false);
    file[at..at + bytes.len()].copy_from_slice(bytes);
    file
}

#[test]
fn both_versions_in_both_byte_orders_are_read_in_lps_metres() {
    let hu: Vec<i16> = (0..SIZE.iter().product()).map(hu_at).collect();
    for version in [1, 2] {
        for is_big_endian in [false, true] {
            let read = read_as("a.nii", &nifti(version, is_big_endian)).unwrap();
            assert_eq!(read.volume.hu, hu);
            assert_eq!(read.volume.grid.size(), SIZE);
            // RAS (10 - 0.5 i, -20 + 0.75 j, 30 + 2 k) mm.
            let place = read.volume.grid.ct_from_index(&Point3::new(2.0, 3.0, 1.0));
            let expected = Point3::new(-9e-3, 17.75e-3, 32e-3);
            assert!((place - expected).norm() < ROUNDING_M, "{place}");
        }
    }
}

#[test]
fn gzip_in_several_members_is_one_file() {
    let file = nifti(1, false);
    let whole = read_as("a.nii", &file).unwrap();
    let members = [packed(&file[..100]), packed(&[]), packed(&file[100..])].concat();
    assert_eq!(read_as("a.nii.gz", &members).unwrap().volume, whole.volume);
    let garbage = [packed(&file), b"garbage".to_vec()].concat();
    let read = read_as("a.nii.gz", &garbage).unwrap();
    assert_eq!(read.volume, whole.volume);
    assert!(remarks(&read).contains("not gzip"), "{}", remarks(&read));
}

#[test]
fn what_is_cut_off_is_refused_wherever_it_is_cut() {
    let file = nifti(1, false);
    let small = packed(&file);
    for length in 0..file.len() {
        refusal(read_as("a.nii", &file[..length]));
    }
    // The last eight bytes are the sum: the voxels are there without it.
    for length in 0..small.len() - 9 {
        refusal(read_as("a.nii.gz", &small[..length]));
    }
    let read = read_as("a.nii.gz", &small[..small.len() - 2]).unwrap();
    assert!(remarks(&read).contains("before its checksum"));
    let mut damaged = small;
    let at = damaged.len() - 6;
    damaged[at] ^= 1;
    assert!(refusal(read_as("a.nii.gz", &damaged)).contains("damaged"));
}

#[test]
fn what_is_no_volume_of_numbers_is_refused_with_its_key() {
    let cases: [(usize, &[u8], &str); 10] = [
        (40, &[4, 0], ""),
        (40, &[9, 0], "dim[0]"),
        (44, &[0, 0], "dim[2]"),
        (70, &[128, 0], "colours"),
        (70, &[32, 0], "complex"),
        (70, &[8, 0], "bitpix"),
        (108, &[0, 0, 0x80, 0x3f], "vox_offset"),
        (254, &[0, 0], "--assume-orientation"),
        (344, b"ni1\0", ".hdr"),
        (344, b"\0\0\0\0", "ANALYZE"),
    ];
    for (at, bytes, word) in cases.into_iter().skip(1) {
        let said = refusal(read_as("a.nii", &changed(at, bytes)));
        assert!(said.contains(word), "no '{word}' in {said}");
    }
    let mut four = changed(40, &[4, 0]);
    four[48] = 2;
    assert!(refusal(read_as("a.nii", &four)).contains("2 volumes"));
    assert!(read_as("a.nii", &changed(40, &[4, 0])).is_ok());
}

#[test]
fn a_header_that_asks_for_too_much_is_refused_before_memory_is_taken() {
    // 8000 x 6000 x 300 voxels.
    let vast = changed(42, &[0x40, 0x1f, 0x70, 0x17, 0x2c, 1]);
    assert!(refusal(read_as("a.nii", &vast)).contains("--max-memory"));
    // 1024 x 1024 x 511 voxels are within the limit, and not in the file.
    let large = changed(42, &[0, 4, 0, 4, 0xff, 1]);
    assert!(refusal(read_as("a.nii", &large)).contains("truncated"));
    assert!(refusal(read_as("a.nii.gz", &packed(&large))).contains("truncated"));
}

#[test]
fn units_are_heeded_and_those_that_cannot_be_are_refused() {
    let metres = refusal(read_as("a.nii", &changed(123, &[1])));
    assert!(metres.contains("xyzt_units"), "{metres}");
    let unknown = read_as("a.nii", &changed(123, &[0])).unwrap();
    assert!(remarks(&unknown).contains("mm assumed"));
    let micrometres = refusal(read_as("a.nii", &changed(123, &[3])));
    assert!(micrometres.contains("0.000500 mm"), "{micrometres}");
}

#[test]
fn an_orientation_may_be_assumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nii");
    std::fs::write(&path, changed(254, &[0, 0])).unwrap();
    let options = ReadOptions {
        assume_orientation: Some("LAS".parse().unwrap()),
        ..ReadOptions::default()
    };
    let read = read(&path, &options).unwrap();
    let place = read.volume.grid.ct_from_index(&Point3::new(4.0, 3.0, 2.0));
    let expected = Point3::new(1e-3, -1.125e-3, 2e-3);
    assert!((place - expected).norm() < ROUNDING_M, "{place}");
    assert!(remarks(&read).contains("LAS"));
}

#[test]
fn forms_that_disagree_get_a_remark_and_the_sform_counts() {
    let read = read_as("a.nii", &changed(252, &[1, 0])).unwrap();
    assert!(
        remarks(&read).contains("the sform is used"),
        "{}",
        remarks(&read)
    );
    assert!((read.volume.grid.first_m().x + 10e-3).abs() < ROUNDING_M);
}

#[test]
fn a_pair_is_read_by_either_name() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = changed(344, b"ni1\0");
    file[108..112].copy_from_slice(&[0; 4]);
    std::fs::write(folder.path().join("a.hdr"), &file[..348]).unwrap();
    let image = folder.path().join("a.img");
    std::fs::write(&image, &file[352..]).unwrap();
    let whole = read_as("a.nii", &nifti(1, false)).unwrap();
    for name in ["a.hdr", "a.img"] {
        let read = read(&folder.path().join(name), &ReadOptions::default()).unwrap();
        assert_eq!(read.volume, whole.volume);
    }
    std::fs::remove_file(&image).unwrap();
    let said = refusal(read(&folder.path().join("a.hdr"), &ReadOptions::default()));
    assert!(said.contains("a.img"), "{said}");
}
