//! ZIP archives, as portals of hospitals send them.

use std::io::{Cursor, Write};

use needlebench_volume::read::{ReadOptions, read_labels};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::made::{metaimage, nifti, read, read_as, read_slices, refusal, remarks, stack};

type Entries<'a> = Vec<(&'a str, Vec<u8>)>;

fn zipped(entries: &Entries, options: SimpleFileOptions) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        if name.ends_with('/') {
            archive.add_directory(*name, options).unwrap();
        } else {
            archive.start_file(*name, options).unwrap();
            archive.write_all(bytes).unwrap();
        }
    }
    archive.finish().unwrap().into_inner()
}

fn deflated(entries: &Entries) -> Vec<u8> {
    zipped(
        entries,
        SimpleFileOptions::default().compression_method(CompressionMethod::Deflated),
    )
}

/// A scan as a portal sends it, with what else is in such an archive.
fn sent() -> Entries<'static> {
    let names = [
        "study/series/IM0002",
        "study/series/IM0000",
        "study/series/IM0001",
    ];
    let mut entries = vec![
        ("study/", Vec::new()),
        ("study/README.txt", b"how to open it".to_vec()),
        ("study/.DS_Store", vec![7; 300]),
        // What macOS stores of a slice must not become one.
        ("__MACOSX/study/series/._IM0002", stack(9)[8].bytes()),
    ];
    entries.extend(
        names
            .into_iter()
            .zip(stack(3).iter().map(super::made::Slice::bytes)),
    );
    entries
}

#[test]
fn an_archive_is_read_as_the_folder_that_it_is() {
    let expected = read_slices(&stack(3), &ReadOptions::default()).unwrap();
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for bytes in [deflated(&sent()), zipped(&sent(), stored)] {
        let read = read_as("scan.zip", &bytes).unwrap();
        assert_eq!(read.volume, expected.volume);
        assert_eq!(read.description.files, 3);
        assert!(read.description.format.ends_with("in a ZIP archive"));
        assert!(
            !remarks(&read).contains("needlebench-"),
            "{}",
            remarks(&read)
        );
    }
}

#[test]
fn the_only_volume_of_another_format_is_read() {
    let expected = read_as("a.nii", &nifti(1, false)).unwrap();
    let alone = deflated(&vec![("a.nii", nifti(1, false))]);
    assert_eq!(read_as("a.zip", &alone).unwrap().volume, expected.volume);
    let mut pair = nifti(1, false);
    pair[344..348].copy_from_slice(b"ni1\0");
    pair[108..112].copy_from_slice(&0_f32.to_le_bytes());
    let voxels = pair.split_off(352);
    pair.truncate(348);
    let beside = deflated(&vec![
        ("x/a.hdr", pair),
        ("x/a.img", voxels),
        ("x/notes.txt", b"?".to_vec()),
    ]);
    assert_eq!(read_as("a.zip", &beside).unwrap().volume, expected.volume);
    let two = deflated(&vec![("a.nii", nifti(1, false)), ("b/b.mha", metaimage())]);
    let said = refusal(read_as("a.zip", &two));
    assert!(
        said.contains("2 volumes, such as a.nii and b/b.mha"),
        "{said}"
    );
    // Of masks the folder is to be named.
    assert!(said.contains("the folder, if they are masks"), "{said}");
}

#[test]
fn a_label_map_is_read_of_an_archive() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.zip");
    let bytes = super::made::layered_nrrd();
    std::fs::write(&path, deflated(&vec![("labels.seg.nrrd", bytes.clone())])).unwrap();
    let alone = folder.path().join("labels.seg.nrrd");
    std::fs::write(&alone, bytes).unwrap();
    let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
    let labels = |path| read_labels(path, &grid, &ReadOptions::default(), &false.into());
    assert_eq!(labels(&path).unwrap(), labels(&alone).unwrap());
}

#[test]
fn an_archive_that_is_empty_or_holds_no_volume_is_refused() {
    assert!(refusal(read_as("a.zip", &deflated(&vec![]))).contains("no files"));
    let hidden = vec![("x/", Vec::new()), ("x/.hidden", nifti(1, false))];
    assert!(refusal(read_as("a.zip", &deflated(&hidden))).contains("no files"));
    let texts = vec![("a.txt", b"aaaa".to_vec()), ("b.txt", b"bbbb".to_vec())];
    let said = refusal(read_as("a.zip", &deflated(&texts)));
    assert!(
        said.contains("none of its 2 files is a DICOM image"),
        "{said}"
    );
    let outside = vec![("../../a.nii", nifti(1, false))];
    assert!(refusal(read_as("a.zip", &deflated(&outside))).contains("outside of it"));
}

#[test]
fn a_damaged_archive_is_refused_wherever_it_ends() {
    let whole = deflated(&sent());
    for length in (4..whole.len()).step_by(61) {
        let said = refusal(read_as("a.zip", &whole[..length]));
        assert!(said.contains("damaged or cut off"), "{length}: {said}");
    }
    // Within the bytes of a file: its sum says it.
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut changed = zipped(&sent(), stored);
    let at = changed
        .windows(4)
        .position(|bytes| bytes == b"DICM")
        .unwrap()
        + 600;
    changed[at] ^= 1;
    let said = refusal(read_as("a.zip", &changed));
    assert!(said.contains("damaged or cut off"), "{said}");
}

#[test]
fn files_with_the_same_name_are_refused() {
    let slices = stack(3);
    let files = ["s/IM0", "s/IM1", "s/IM2"].into_iter();
    let entries = files.zip(slices.iter().map(super::made::Slice::bytes));
    let mut bytes = deflated(&entries.collect());
    read_as("a.zip", &bytes).unwrap();
    // The last one is called as the one before, in its own header and in the directory.
    let mut at = 0;
    while let Some(next) = bytes[at..].windows(5).position(|five| five == b"s/IM2") {
        bytes[at + next + 4] = b'1';
        at += next + 5;
    }
    let said = refusal(read_as("a.zip", &bytes));
    assert!(said.contains("have the same name"), "{said}");
}

#[test]
fn encryption_and_other_methods_are_refused_by_name() {
    // The bit of encryption, and the method, of the local header and of the directory.
    let with = |offset: usize, value: u8| {
        let mut bytes = deflated(&vec![("a.nii", nifti(1, false))]);
        let directory = bytes
            .windows(4)
            .position(|four| four == b"PK\x01\x02")
            .unwrap();
        bytes[6 + offset] = value;
        bytes[directory + 8 + offset] = value;
        refusal(read_as("a.zip", &bytes))
    };
    let said = with(0, 1);
    assert!(
        said.contains("encrypted") && said.contains("password"),
        "{said}"
    );
    let said = with(2, 9);
    assert!(
        said.contains("Deflate64") && said.contains("unpack"),
        "{said}"
    );
}

#[test]
fn an_archive_takes_no_more_than_the_limit_whatever_it_states() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.zip");
    let options = ReadOptions {
        max_bytes: 1 << 20,
        ..ReadOptions::default()
    };
    let bytes = deflated(&vec![("a.nii", vec![0; 3 << 20])]);
    assert!(bytes.len() < 1 << 14);
    std::fs::write(&path, &bytes).unwrap();
    let said = refusal(read(&path, &options));
    assert!(
        said.contains("1 MiB") && said.contains("--max-memory"),
        "{said}"
    );
    // That states one byte.
    let mut lying = bytes;
    let directory = lying
        .windows(4)
        .position(|four| four == b"PK\x01\x02")
        .unwrap();
    lying[directory + 24..directory + 28].copy_from_slice(&1_u32.to_le_bytes());
    lying[22..26].copy_from_slice(&1_u32.to_le_bytes());
    std::fs::write(&path, &lying).unwrap();
    let said = refusal(read(&path, &options));
    assert!(said.contains("1 MiB") || said.contains("damaged"), "{said}");
    // Files that together are more.
    let both = deflated(&vec![("a", vec![1; 600_000]), ("b", vec![2; 600_000])]);
    std::fs::write(&path, &both).unwrap();
    let said = refusal(read(&path, &options));
    assert!(said.contains("more than the 1 MiB allowed"), "{said}");
    // The limit is said, and not what the files before have left of it.
    let options = ReadOptions {
        max_bytes: 3 << 20,
        ..ReadOptions::default()
    };
    let both = deflated(&vec![("a", vec![1; 2 << 20]), ("b", vec![2; 2 << 20])]);
    std::fs::write(&path, &both).unwrap();
    let said = refusal(read(&path, &options));
    assert!(said.contains("more than the 3 MiB allowed"), "{said}");
}
