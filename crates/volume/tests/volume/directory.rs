//! Discs with a DICOMDIR.

use std::fs;
use std::path::{Path, PathBuf};

use needlebench_volume::read::ReadOptions;

use super::made::{Slice, item, read, read_slices, refusal, remarks, stack, write};

/// An index that names files.
fn index(names: &[&str]) -> Vec<u8> {
    let mut records = Vec::new();
    // A record of the patient names no file.
    for name in std::iter::once(None).chain(names.iter().copied().map(Some)) {
        let mut record = vec![(0x0004_1430, *b"CS", b"IMAGE".to_vec())];
        record.extend(name.map(|name| (0x0004_1500, *b"CS", name.as_bytes().to_vec())));
        record.push((0x0010_0010, *b"PN", b"Zyxwvut^Abcdefg".to_vec()));
        records.extend(item(&record));
    }
    let mut bytes = vec![0; 128];
    bytes.extend(b"DICM");
    write(&mut bytes, 0x0002_0002, *b"UI", b"1.2.840.10008.1.3.10");
    write(&mut bytes, 0x0002_0010, *b"UI", b"1.2.840.10008.1.2.1");
    write(&mut bytes, 0x0004_1130, *b"CS", b"DISC");
    write(&mut bytes, 0x0004_1220, *b"SQ", &records);
    bytes
}

/// A disc of slices, with another series beside the folder that the index names.
fn disc(names: &[&str]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("DICOM/A0")).unwrap();
    for (at, slice) in stack(4).iter().enumerate() {
        fs::write(folder.path().join(format!("DICOM/A0/I{at}")), slice.bytes()).unwrap();
    }
    let other = Slice {
        series: 9,
        ..Slice::at(0.0)
    };
    fs::create_dir(folder.path().join("other")).unwrap();
    for height in 0..3 {
        let slice = Slice {
            position: format!("0\\0\\{height}"),
            instance: format!("1.3.{height}"),
            ..other.clone()
        };
        fs::write(folder.path().join(format!("other/{height}")), slice.bytes()).unwrap();
    }
    let path = folder.path().join("DICOMDIR");
    fs::write(&path, index(names)).unwrap();
    (folder, path)
}

fn read_path(
    path: &Path,
) -> Result<needlebench_volume::read::ReadVolume, needlebench_volume::VolumeError> {
    read(path, &ReadOptions::default())
}

const ALL: [&str; 4] = [
    "DICOM\\A0\\I0",
    "DICOM\\A0\\I1",
    "DICOM\\A0\\I2",
    "DICOM\\A0\\I3",
];

#[test]
fn an_index_is_read_as_the_files_that_it_names() {
    let expected = read_slices(&stack(4), &ReadOptions::default()).unwrap();
    let (folder, path) = disc(&ALL);
    let read = read_path(&path).unwrap();
    assert_eq!(read.volume, expected.volume);
    assert!(!remarks(&read).contains("DICOMDIR"), "{}", remarks(&read));
    // The folder holds more than its index.
    assert!(refusal(read_path(folder.path())).contains("2 series"));
}

#[test]
fn names_are_found_as_other_systems_write_them() {
    let (folder, path) = disc(&ALL);
    fs::rename(folder.path().join("DICOM"), folder.path().join("dicom")).unwrap();
    fs::rename(
        folder.path().join("dicom/A0/I3"),
        folder.path().join("dicom/A0/i3.;1"),
    )
    .unwrap();
    let read = read_path(&path).unwrap();
    assert_eq!(read.description.files, 4);
}

#[test]
fn files_that_are_missing_are_said() {
    let (folder, path) = disc(&ALL);
    fs::remove_file(folder.path().join("DICOM/A0/I3")).unwrap();
    let read = read_path(&path).unwrap();
    assert_eq!(read.volume.grid.size()[2], 3);
    let said = remarks(&read);
    assert!(
        said.contains("1 of the 4 files") && said.contains("DICOM/A0/I3"),
        "{said}"
    );
    fs::remove_dir_all(folder.path().join("other")).unwrap();
    assert!(remarks(&read_path(folder.path()).unwrap()).contains("1 of the 4 files"));
    fs::remove_dir_all(folder.path().join("DICOM")).unwrap();
    let said = refusal(read_path(&path));
    assert!(
        said.contains("none of the 4 files") && said.contains("whole disc"),
        "{said}"
    );
}

#[test]
fn an_index_leads_nowhere_else() {
    let (folder, _) = disc(&ALL);
    let path = folder.path().join("other/DICOMDIR");
    for name in [
        "..\\DICOM\\A0\\I0",
        "../DICOM/A0/I0",
        "\\DICOM\\A0\\I0",
        ".",
    ] {
        fs::write(&path, index(&[name])).unwrap();
        let said = refusal(read_path(&path));
        assert!(said.contains("none of the 1 files"), "{name}: {said}");
    }
    fs::write(&path, index(&[])).unwrap();
    assert!(refusal(read_path(&path)).contains("names no files"));
}
