//! DICOM files, made byte by byte.

use nalgebra::Point3;
use needlebench_volume::read::ReadOptions;

use super::made::{SIZE, Slice, hu_at, read_as, read_slices, refusal, remarks, stack};

const SLOPE: u32 = 0x0028_1053;
const INTERCEPT: u32 = 0x0028_1052;

/// Of coordinates below a metre.
const ROUNDING_M: f64 = 1e-12;

fn plane_hu() -> Vec<i16> {
    (0..SIZE[0] * SIZE[1]).map(hu_at).collect()
}

fn default() -> ReadOptions {
    ReadOptions::default()
}

#[test]
fn slices_are_in_order_of_their_places_whatever_their_names() {
    let read = read_slices(&stack(4), &default()).unwrap();
    assert_eq!(read.volume.grid.size(), [5, 4, 4]);
    assert_eq!(read.volume.hu[..20], plane_hu());
    // Columns are 0.5 mm apart, rows 0.75: the second value of PixelSpacing is that between columns.
    let place = read.volume.grid.ct_from_index(&Point3::new(2.0, 1.0, 3.0));
    assert!(
        (place - Point3::new(-9e-3, 20.75e-3, 6e-3)).norm() < ROUNDING_M,
        "{place}"
    );
    assert_eq!(read.volume.slice_thickness_m, Some(2e-3));
    assert_eq!(read.description.files, 4);
}

#[test]
fn a_slope_of_unknown_vr_is_a_number_and_no_letter() {
    let slices: Vec<Slice> = stack(3)
        .into_iter()
        .map(|slice| {
            slice
                .with(SLOPE, *b"UN", "1")
                .with(INTERCEPT, *b"UN", "-1024")
        })
        .collect();
    let read = read_slices(&slices, &default()).unwrap();
    assert_eq!(read.volume.hu[..20], plane_hu());
}

#[test]
fn each_slice_has_its_own_slope_and_intercept() {
    let mut slices = stack(3);
    slices[1] = slices[1]
        .clone()
        .with(SLOPE, *b"DS", "2")
        .with(INTERCEPT, *b"DS", "-1100");
    let read = read_slices(&slices, &default()).unwrap();
    let stored: Vec<i16> = plane_hu().iter().map(|hu| 2 * (hu + 1024) - 1100).collect();
    assert_eq!(read.volume.hu[..20], plane_hu());
    assert_eq!(read.volume.hu[20..40], stored);
    assert!(remarks(&read).contains("differ between slices"));
}

#[test]
fn positions_that_lean_are_kept_as_shear() {
    let lean = |at: u32| Slice {
        position: format!("-10\\{}\\{}", 20.0 + 0.5 * f64::from(at), 2 * at),
        ..Slice::at(f64::from(at) * 2.0)
    };
    let read = read_slices(&(0..4).map(lean).collect::<Vec<_>>(), &default()).unwrap();
    let place = read.volume.grid.ct_from_index(&Point3::new(0.0, 0.0, 2.0));
    assert!((place - Point3::new(-10e-3, 21e-3, 4e-3)).norm() < ROUNDING_M);
    assert!((read.volume.grid.tilt_rad() - libm::atan(0.25_f64)).abs() < ROUNDING_M);
}

#[test]
fn a_missing_slice_is_refused_or_interpolated() {
    let mut slices = stack(6);
    slices.remove(2);
    let said = refusal(read_slices(&slices, &default()));
    assert!(
        said.contains("between 2.00 and 6.00 mm") && said.contains("--fill-gaps"),
        "{said}"
    );
    let options = ReadOptions {
        fill_gaps: true,
        ..default()
    };
    let read = read_slices(&slices, &options).unwrap();
    assert_eq!(read.volume.grid.size()[2], 6);
    assert_eq!(read.volume.hu[40..60], plane_hu());
    assert!(remarks(&read).contains("interpolated"));
}

#[test]
fn slices_at_one_place_are_refused_and_copies_are_not() {
    let mut slices = stack(4);
    slices.push(Slice::at(2.0));
    let read = read_slices(&slices, &default()).unwrap();
    assert!(remarks(&read).contains("duplicates"));
    slices[4].instance = "1.2.99".to_owned();
    let said = refusal(read_slices(&slices, &default()));
    assert!(
        said.contains("same position") && said.contains("IM00"),
        "{said}"
    );
}

#[test]
fn uneven_slices_are_interpolated() {
    let heights_mm = [0.0, 1.0, 2.0, 3.5, 5.0, 6.5];
    let slices: Vec<Slice> = heights_mm.into_iter().map(Slice::at).collect();
    let read = read_slices(&slices, &default()).unwrap();
    assert_eq!(read.volume.grid.size()[2], 7);
    assert!((read.volume.grid.spacing_m()[2] - 1e-3).abs() < ROUNDING_M);
    // All slices are the same: so is what lies between.
    assert!(read.volume.hu.chunks(20).all(|plane| plane == plane_hu()));
    assert!(remarks(&read).contains("slice spacing of 1.000 to 1.500 mm"));
}

#[test]
fn series_are_listed_and_never_mixed() {
    let mut slices = stack(3);
    slices.extend(
        stack(4)
            .into_iter()
            .map(|slice| Slice { series: 9, ..slice }),
    );
    let said = refusal(read_slices(&slices, &default()));
    assert!(
        said.contains("4: 3 slices") && said.contains("9: 4 slices"),
        "{said}"
    );
    let options = ReadOptions {
        series: Some("9".to_owned()),
        ..default()
    };
    assert_eq!(
        read_slices(&slices, &options).unwrap().volume.grid.size()[2],
        4
    );
}

#[test]
fn phases_of_one_series_are_told_apart() {
    // By acquisition, or by the time that all slices of a phase share.
    for (tag, vr, names) in [
        (0x0020_0012, *b"IS", ["1", "2"]),
        (0x0008_0032, *b"TM", ["100000.0", "100004.0"]),
    ] {
        let phase = |name: &str| {
            let instance = name.to_owned();
            stack(3).into_iter().map(move |slice| Slice {
                instance: format!("{}.{instance}", slice.instance),
                ..slice.with(tag, vr, instance.as_str())
            })
        };
        let slices: Vec<Slice> = names.into_iter().flat_map(phase).collect();
        let said = refusal(read_slices(&slices, &default()));
        assert!(
            said.contains("4.1: 3 slices") && said.contains("4.2: 3 slices"),
            "{said}"
        );
    }
}

#[test]
fn frames_without_positions_are_called_that() {
    let mut slice = Slice::at(0.0).with(0x0028_0008, *b"IS", "3");
    slice.pixels = slice.pixels.repeat(3);
    let said = refusal(read_as("a.dcm", &slice.bytes()));
    assert!(
        said.contains("frames 1 and 2 of 3 have the same position"),
        "{said}"
    );
}

#[test]
fn even_stacks_among_each_other_are_series_of_their_own() {
    let acquisition = |number: &'static str, shift_mm: f64| {
        (0..4).map(move |at| {
            Slice::at(f64::from(at) * 2.0 + shift_mm).with(0x0020_0012, *b"IS", number)
        })
    };
    let slices: Vec<Slice> = acquisition("1", 0.0).chain(acquisition("2", 4.7)).collect();
    let said = refusal(read_slices(&slices, &default()));
    assert!(
        said.contains("4.1: 4 slices") && said.contains("4.2: 4 slices"),
        "{said}"
    );
    // One behind the other they are one scan.
    let slices: Vec<Slice> = acquisition("1", 0.0).chain(acquisition("2", 8.0)).collect();
    let read = read_slices(&slices, &default()).unwrap();
    assert_eq!(read.volume.grid.size()[2], 8);
}

#[test]
fn bytes_count_before_names() {
    let whole = Slice::at(0.0).bytes();
    let expected = read_as("a.dcm", &whole).unwrap().volume;
    for name in ["a.img", "a.nii", "a"] {
        assert_eq!(read_as(name, &whole).unwrap().volume, expected, "{name}");
    }
    // A preamble may be anything, also the length of another format's header.
    let mut other = whole.clone();
    other[..4].copy_from_slice(&348_i32.to_le_bytes());
    assert_eq!(read_as("a.dcm", &other).unwrap().volume, expected);
}

#[test]
fn elements_with_vrs_are_read_so_whatever_the_file_says() {
    let whole = Slice {
        syntax: "1.2.840.10008.1.2",
        ..Slice::at(0.0)
    };
    let read = read_as("a.dcm", &whole.bytes()).unwrap();
    assert_eq!(read.volume.hu, plane_hu());
    assert!(
        remarks(&read).contains("implicit VRs"),
        "{}",
        remarks(&read)
    );
}

#[test]
fn more_frames_than_pixels_are_refused() {
    let slice = Slice::at(0.0).with(0x0028_0008, *b"IS", "60000");
    let said = refusal(read_as("a.dcm", &slice.bytes()));
    assert!(
        said.contains("60000 frames, but has pixels of 1") && said.contains("copy or export"),
        "{said}"
    );
}

#[test]
fn numbers_that_are_not_finite_are_refused_with_their_element() {
    let position: Vec<u8> = [0.0, f64::NAN, 0.0]
        .into_iter()
        .flat_map(f64::to_le_bytes)
        .collect();
    let slice = Slice::at(0.0).with(0x0020_0032, *b"FD", position);
    let said = refusal(read_as("a.dcm", &slice.bytes()));
    assert!(
        said.contains("(0020,0032)") && said.contains("not a number"),
        "{said}"
    );
}

#[test]
fn texts_command_no_terminal() {
    let slice = Slice::at(0.0).with(0x0018_1210, *b"SH", "\x1b[31mB30f\x07");
    let read = read_as("a.dcm", &slice.bytes()).unwrap();
    assert_eq!(read.description.kernel.as_deref(), Some("[31mB30f"));
}

#[test]
fn padding_is_air_and_does_not_count() {
    let mut slices = stack(3);
    for slice in &mut slices {
        slice.pixels[..2].copy_from_slice(&10_u16.to_le_bytes());
        *slice = slice
            .clone()
            .with(0x0028_0120, *b"US", 10_u16.to_le_bytes());
    }
    let read = read_slices(&slices, &default()).unwrap();
    assert_eq!(read.volume.hu[0], -1000);
    assert_eq!(read.description.padding_voxels, 3);
    // Water, by slope and intercept: whoever wrote it may mean it.
    for slice in &mut slices {
        *slice = slice
            .clone()
            .with(0x0028_0120, *b"US", 1024_u16.to_le_bytes());
    }
    let read = read_slices(&slices, &default()).unwrap();
    assert_eq!(read.volume.hu[0], 10 - 1024);
    assert!(remarks(&read).contains("not applied"));
}

#[test]
fn what_is_missing_or_foreign_is_refused_with_its_element() {
    let every = |change: &dyn Fn(Slice) -> Slice| {
        let slices: Vec<Slice> = stack(3).into_iter().map(change).collect();
        refusal(read_slices(&slices, &default()))
    };
    let without = |tag: u32| every(&move |slice: Slice| slice.without(tag));
    assert!(without(0x0020_0032).contains("ImagePositionPatient"));
    assert!(without(0x0020_0037).contains("ImageOrientationPatient"));
    assert!(without(0x0028_0030).contains("PixelSpacing"));
    assert!(without(0x0028_0100).contains("(0028,0100)"));
    let with = |tag: u32, vr: [u8; 2], value: &str| {
        every(&|slice: Slice| slice.with(tag, vr, value.as_bytes()))
    };
    assert!(with(0x0008_0060, *b"CS", "MR").contains("MR, not CT"));
    assert!(with(0x0028_0004, *b"CS", "RGB").contains("colours"));
    assert!(with(0x0028_0030, *b"DS", "0.5").contains("1 numbers instead of 2"));
    assert!(with(0x0028_0030, *b"DS", "0,5\\0,5").contains("not a number"));
    assert!(with(SLOPE, *b"DS", "0").contains("slope is 0"));
    assert!(with(0x0020_0037, *b"DS", "1\\0\\0\\1\\0\\0").contains("not perpendicular"));
}

#[test]
fn compression_that_is_not_read_says_how_to_convert() {
    let said = refusal(read_slices(
        &stack(2)
            .into_iter()
            .map(|slice| Slice {
                syntax: "1.2.840.10008.1.2.4.100",
                ..slice
            })
            .collect::<Vec<_>>(),
        &default(),
    ));
    for word in ["MPEG2", "dcmdjpeg", "gdcmconv"] {
        assert!(said.contains(word), "no '{word}' in {said}");
    }
}

#[test]
fn a_file_cut_off_anywhere_is_refused() {
    let whole = Slice::at(0.0).bytes();
    assert!(read_as("a.dcm", &whole).is_ok());
    for length in 0..whole.len() {
        refusal(read_as("a.dcm", &whole[..length]));
    }
}

#[test]
fn a_broken_file_in_a_folder_is_named() {
    let (folder, path) = super::made::folder(&stack(4));
    let bytes = Slice::at(2.0).bytes();
    std::fs::write(folder.path().join("broken.dcm"), &bytes[..300]).unwrap();
    let said = refusal(super::made::read(&path, &default()));
    assert!(said.contains("broken.dcm"), "{said}");
}

#[test]
fn files_without_meta_group_or_preamble_are_read() {
    let whole = Slice::at(0.0).bytes();
    let expected = read_as("a.dcm", &whole).unwrap().volume;
    // The preamble and its mark are 132 bytes, the transfer syntax 28.
    for start in [132, 160] {
        assert_eq!(
            read_as("a.dcm", &whole[start..]).unwrap().volume,
            expected,
            "{start}"
        );
    }
}

#[test]
fn size_is_held_against_file_and_limit_before_memory_is_taken() {
    let large = Slice::at(0.0)
        .with(0x0028_0030, *b"DS", "0.05\\0.05")
        .with(0x0028_0010, *b"US", u16::MAX.to_le_bytes())
        .with(0x0028_0011, *b"US", u16::MAX.to_le_bytes());
    assert!(refusal(read_as("a.dcm", &large.bytes())).contains("--max-memory"));
    let smaller = large.with(0x0028_0010, *b"US", 32000_u16.to_le_bytes());
    assert!(refusal(read_as("a.dcm", &smaller.bytes())).contains("truncated"));
}

#[test]
fn nothing_of_the_patient_is_in_any_value() {
    let mut slices = stack(3);
    let read = read_slices(&slices, &default()).unwrap();
    slices.remove(1);
    slices.push(Slice::at(4.001));
    let said = [
        format!("{:?}", (&read.remarks, &read.description)),
        refusal(read_slices(&slices, &default())),
        refusal(read_as("a.dcm", &Slice::at(0.0).bytes()[..400])),
    ]
    .concat();
    for word in ["Zyxwvut", "Abcdefg", "7318264", "19431127"] {
        assert!(!said.contains(word), "{word} in {said}");
    }
}

#[test]
fn threads_change_nothing() {
    let (_folder, path) = super::made::folder(&stack(9));
    let never = std::sync::atomic::AtomicBool::new(false);
    let read = |threads| needlebench_volume::read::read_volume(&path, &default(), threads, &never);
    assert_eq!(read(1), read(4));
    never.store(true, std::sync::atomic::Ordering::Relaxed);
    assert_eq!(read(1), Err(needlebench_volume::VolumeError::Interrupted));
}
