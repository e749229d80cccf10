//! Label maps of a CT.

use std::sync::atomic::AtomicBool;

use needlebench_volume::read::{ReadLabels, ReadOptions, read_labels};
use needlebench_volume::{VolumeError, VoxelGrid};

use super::made::{SIZE, Slice, item, nifti, read_as, refusal};

fn labels_as(name: &str, bytes: &[u8], grid: &VoxelGrid) -> Result<ReadLabels, VolumeError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read_labels(
        &path,
        grid,
        &ReadOptions::default(),
        &AtomicBool::new(false),
    )
}

/// The CT's file with labels for values: 7 in the first row.
fn labelled() -> Vec<u8> {
    let mut file = nifti(1, false);
    for index in 0..SIZE.iter().product::<usize>() {
        let label = if index < 3 { 7_i16 } else { 0 };
        file[352 + 2 * index..][..2].copy_from_slice(&label.to_le_bytes());
    }
    file
}

#[test]
fn labels_on_the_grid_of_the_ct_are_taken_as_they_are() {
    let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
    let read = labels_as("labels.nii", &labelled(), &grid).unwrap();
    assert_eq!(read.labels.labels[..4], [7, 7, 7, 0]);
    assert_eq!(read.labels.names, [(7, "label 7".to_owned())]);
    assert_eq!(read.labels.grid, grid);
}

#[test]
fn axes_that_run_the_other_way_are_turned_without_loss() {
    let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
    // Columns the other way: step 0.5 from RAS x = 8 instead of -0.5 from 10.
    let mut file = labelled();
    file[280..284].copy_from_slice(&0.5_f32.to_le_bytes());
    file[292..296].copy_from_slice(&8.0_f32.to_le_bytes());
    let read = labels_as("labels.nii", &file, &grid).unwrap();
    assert_eq!(read.labels.labels[..5], [0, 0, 7, 7, 7]);
}

#[test]
fn labels_of_another_volume_and_what_is_no_label_are_refused() {
    let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
    let mut file = labelled();
    file[292..296].copy_from_slice(&10.1_f32.to_le_bytes());
    let said = refusal(labels_as("labels.nii", &file, &grid));
    assert!(said.contains("0.100 mm from the CT's"), "{said}");
    let said = refusal(labels_as("labels.nii", &nifti(1, false), &grid));
    assert!(said.contains("-1000 is not a label"), "{said}");
}

/// A segmentation of the slices at 0 and 2 mm: bits of a pattern for each of two segments.
fn segmentation(kind: &str, positions: &[&str]) -> Vec<u8> {
    let short = |number: u16| number.to_le_bytes().to_vec();
    let segment = |number: u16, label: &str, meaning: &str, side: &str| {
        let side = item(&[(0x0008_0104, *b"LO", side.as_bytes().to_vec())]);
        let coded = item(&[
            (0x0008_0104, *b"LO", meaning.as_bytes().to_vec()),
            (0x0062_0011, *b"SQ", side),
        ]);
        item(&[
            (0x0062_0004, *b"US", short(number)),
            (0x0062_0005, *b"LO", label.as_bytes().to_vec()),
            (0x0062_000F, *b"SQ", coded),
        ])
    };
    let frames: Vec<u8> = (1..)
        .zip(positions)
        .flat_map(|(number, position)| {
            item(&[
                (
                    0x0020_9113,
                    *b"SQ",
                    item(&[(0x0020_0032, *b"DS", position.as_bytes().to_vec())]),
                ),
                (
                    0x0062_000A,
                    *b"SQ",
                    item(&[(0x0062_000B, *b"US", short(number))]),
                ),
            ])
        })
        .collect();
    // 20 pixels a frame, so that the second begins within a byte: pixels 0 and 1; pixels 1 and 19.
    let mut slice = Slice::at(0.0)
        .with(0x0008_0060, *b"CS", "SEG")
        .with(0x0028_0008, *b"IS", positions.len().to_string())
        .with(0x0062_0001, *b"CS", kind)
        .with(
            0x0062_0002,
            *b"SQ",
            [
                segment(1, "Lesion", "Mass", "Right"),
                segment(2, "Segment_2", "Lung", "Left"),
            ]
            .concat(),
        )
        .with(0x5200_9230, *b"SQ", frames);
    if kind == "BINARY" {
        slice = slice
            .with(0x0028_0100, *b"US", short(1))
            .with(0x0028_0101, *b"US", short(1))
            .with(0x0028_0102, *b"US", short(0));
        let bits: u64 = 0b11 | (1 << 21) | (1 << 39);
        slice.pixels = bits.to_le_bytes()[..6].to_vec();
    } else {
        slice = slice
            .with(0x0028_0100, *b"US", short(8))
            .with(0x0028_0101, *b"US", short(8))
            .with(0x0028_0102, *b"US", short(7))
            .with(0x0062_000E, *b"US", short(100));
        slice.pixels = vec![0; 40];
        slice.pixels[..3].copy_from_slice(&[49, 50, 100]);
    }
    slice.bytes()
}

fn ct() -> VoxelGrid {
    super::made::read_slices(&super::made::stack(3), &ReadOptions::default())
        .unwrap()
        .volume
        .grid
}

#[test]
fn a_binary_segmentation_is_placed_by_its_positions() {
    let file = segmentation("BINARY", &["-10\\20\\4", "-10\\20\\0"]);
    let read = labels_as("seg.dcm", &file, &ct()).unwrap();
    let labelled: Vec<(usize, u16)> = (0..)
        .zip(read.labels.labels.iter().copied())
        .filter(|(_, label)| *label > 0)
        .collect();
    assert_eq!(labelled, [(1, 2), (19, 2), (40, 1), (41, 1)]);
    let names = [(1, "Lesion".to_owned()), (2, "Lung Left".to_owned())];
    assert_eq!(read.labels.names, names);
}

#[test]
fn fractions_are_cut_at_half_with_a_remark() {
    let file = segmentation("FRACTIONAL", &["-10\\20\\0", "-10\\20\\2"]);
    let read = labels_as("seg.dcm", &file, &ct()).unwrap();
    assert_eq!(read.labels.labels[..4], [0, 1, 1, 0]);
    assert!(read.remarks[0].message.contains("fractional"));
}

#[test]
fn a_segmentation_of_another_place_is_refused() {
    let file = segmentation("BINARY", &["-10\\20\\0", "-10\\20\\3"]);
    let said = refusal(labels_as("seg.dcm", &file, &ct()));
    assert!(
        said.contains("1.000 mm") && said.contains("frame 2"),
        "{said}"
    );
    let said = refusal(labels_as("ct.dcm", &Slice::at(0.0).bytes(), &ct()));
    assert!(said.contains("not a segmentation"), "{said}");
}

/// The CT's file as a mask, with 1 at these voxels.
fn mask(voxels: &[usize]) -> Vec<u8> {
    let mut file = nifti(1, false);
    for index in 0..SIZE.iter().product::<usize>() {
        let value = i16::from(voxels.contains(&index));
        file[352 + 2 * index..][..2].copy_from_slice(&value.to_le_bytes());
    }
    file
}

fn folder(files: &[(&str, Vec<u8>)]) -> Result<ReadLabels, VolumeError> {
    let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    read_labels(
        folder.path(),
        &grid,
        &ReadOptions::default(),
        &AtomicBool::new(false),
    )
}

#[test]
fn a_folder_of_masks_is_one_label_map() {
    // Columns the other way: voxels 9 and 8 are 5 and 6 of the CT.
    let mut flipped = mask(&[9, 8]);
    flipped[280..284].copy_from_slice(&0.5_f32.to_le_bytes());
    flipped[292..296].copy_from_slice(&8.0_f32.to_le_bytes());
    let read = folder(&[
        ("lung_upper_lobe_left.nii", mask(&[0, 1, 2, 3])),
        ("lung_nodules.nii", mask(&[1])),
        ("rib_left_7.nii", flipped),
        ("spleen.nii", mask(&[])),
        ("statistics.json", b"{}".to_vec()),
    ])
    .unwrap();
    assert!(read.is_numbered_here);
    // Numbers in the order of the names; the nodule hides the lobe.
    assert_eq!(read.labels.labels[..8], [2, 1, 2, 2, 0, 3, 3, 0]);
    let names = [
        (1, "lung_nodules"),
        (2, "lung_upper_lobe_left"),
        (3, "rib_left_7"),
    ];
    let names = names.map(|(label, name)| (label, name.to_owned()));
    assert_eq!(read.labels.names, names);
    let said: Vec<&str> = read.remarks.iter().map(|it| &*it.message).collect();
    assert!(said[0].contains("masks of 4 structures"), "{said:?}");
    assert!(said[1].starts_with("1 voxels are in several"), "{said:?}");
    assert!(
        said[2].contains("nothing was found of `spleen`"),
        "{said:?}"
    );
}

#[test]
fn what_is_no_mask_of_the_ct_is_refused_by_the_name_of_its_file() {
    let mut elsewhere = mask(&[3]);
    elsewhere[292..296].copy_from_slice(&10.1_f32.to_le_bytes());
    for (bytes, word) in [
        (elsewhere, "0.100 mm from the CT's"),
        (labelled_twice(), "several labels, 7 and 8"),
        (nifti(1, false), "-1000 is not a label"),
        (super::made::layered_nrrd(), "2 layers"),
    ] {
        let said = refusal(folder(&[("aorta.nii", mask(&[0])), ("heart.nii", bytes)]));
        assert!(said.contains("heart.nii") && said.contains(word), "{said}");
    }
    let said = refusal(folder(&[("aorta.nii", mask(&[]))]));
    assert!(said.contains("no voxel has a label"), "{said}");
}

fn labelled_twice() -> Vec<u8> {
    let mut file = labelled();
    file[352..354].copy_from_slice(&8_i16.to_le_bytes());
    file
}

/// With extensions before the voxels: one of AFNI with a name in it, and a table of labels.
fn with_table(mut file: Vec<u8>, table: &str) -> Vec<u8> {
    let mut extensions = Vec::new();
    for (code, text) in [(4_i32, "<AFNI>Zyxwvut</AFNI>"), (0, table)] {
        let size = (8 + text.len()).next_multiple_of(16);
        let mut extension = i32::try_from(size).unwrap().to_le_bytes().to_vec();
        extension.extend(code.to_le_bytes());
        extension.extend(text.as_bytes());
        extension.resize(size, 0);
        extensions.extend(extension);
    }
    file[348] = 1;
    let offset = u16::try_from(352 + extensions.len()).unwrap();
    file[108..112].copy_from_slice(&f32::from(offset).to_le_bytes());
    file.splice(352..352, extensions);
    file
}

#[test]
fn names_in_the_header_of_nifti_are_those_of_the_labels() {
    let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
    let table = "<CaretExtension><VolumeInformation Index=\"0\"><LabelTable>\
                 <Label Key=\"7\" Red=\"1\"><![CDATA[rib_left_7]]></Label>\n\
                 <Label Key=\"9\" Red=\"1\"><![CDATA[spleen]]></Label></LabelTable></VolumeInformation></CaretExtension>";
    let read = labels_as("labels.nii", &with_table(labelled_twice(), table), &grid).unwrap();
    assert_eq!(read.labels.labels[..4], [8, 7, 7, 0]);
    let names = [(7, "rib_left_7".to_owned()), (8, "label 8".to_owned())];
    assert_eq!(read.labels.names, names);
    let said: Vec<&str> = read.remarks.iter().map(|it| &*it.message).collect();
    assert!(
        said[0].contains("nothing was found of `spleen`"),
        "{said:?}"
    );
    // A table that is damaged takes no label away.
    let (cut, _) = table.split_once("_left_7").unwrap();
    let read = labels_as("labels.nii", &with_table(labelled(), cut), &grid).unwrap();
    assert_eq!(read.labels.names, [(7, "label 7".to_owned())]);
    assert!(read.remarks[0].message.contains("is cut off"));
    assert!(!format!("{:?}", read.remarks).contains("Zyxwvut"));
}

#[test]
fn kinds_of_segmentations_in_one_folder_are_named() {
    let structures = super::structure_set::made();
    let bits = || segmentation("BINARY", &["-10\\20\\4", "-10\\20\\0"]);
    let read = folder(&[
        ("aorta.nii", mask(&[0])),
        ("RS.dcm", structures.clone()),
        ("seg.dcm", bits()),
        ("notes.txt", b"?".to_vec()),
    ])
    .unwrap();
    let said: Vec<&str> = read.remarks.iter().map(|it| &*it.message).collect();
    assert!(
        said.iter().any(|said| said
            .starts_with("DICOM files beside the masks are ignored (2, such as `RS.dcm`)")),
        "{said:?}"
    );
    let said = refusal(folder(&[("RS.dcm", structures), ("seg.dcm", bits())]));
    assert!(
        said.contains("an RT structure set and a segmentation: RS.dcm and seg.dcm"),
        "{said}"
    );
}
