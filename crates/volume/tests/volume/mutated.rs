//! Files with random bytes changed, cut and repeated: an answer or a refusal, never a panic.

use std::io::Write as _;

use proptest::prelude::*;

use super::made::{Slice, layered_nrrd, metaimage, mgh, nifti, read_as};
use needlebench_volume::read::{ReadOptions, read_labels};

/// Changes of a file: where (as a share of its length), what, and how.
fn changes() -> impl Strategy<Value = Vec<(f64, u8, u8)>> {
    proptest::collection::vec((0.0..1.0_f64, any::<u8>(), 0..4_u8), 1..12)
}

fn changed(mut bytes: Vec<u8>, changes: &[(f64, u8, u8)]) -> Vec<u8> {
    for (share, value, way) in changes {
        if bytes.is_empty() {
            break;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an index"
        )]
        let at = (share * bytes.len() as f64) as usize;
        match way {
            0 => bytes[at] = *value,
            1 => bytes[at] ^= 1 << (value % 8),
            2 => bytes.truncate(at),
            _ => {
                let end = (at + usize::from(*value)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    bytes
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn changed_nifti_is_answered(changes in changes(), version in 1..3_u8, is_big_endian: bool) {
        let _ = read_as("a.nii", &changed(nifti(version, is_big_endian), &changes));
    }

    #[test]
    fn changed_gzip_is_answered(changes in changes()) {
        let _ = read_as("a.nii.gz", &changed(packed(&nifti(1, false)), &changes));
        let _ = read_as("a.nii.gz", &packed(&changed(nifti(1, false), &changes)));
    }

    #[test]
    fn changed_nrrd_metaimage_and_mgh_are_answered(changes in changes()) {
        let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in [("a.nrrd", layered_nrrd()), ("a.mha", metaimage()), ("a.mgh", mgh())] {
            let bytes = changed(bytes, &changes);
            let _ = read_as(name, &bytes);
            let path = folder.path().join(name);
            std::fs::write(&path, &bytes).unwrap();
            let never = std::sync::atomic::AtomicBool::new(false);
            let _ = read_labels(&path, &grid, &ReadOptions::default(), &never);
        }
    }

    #[test]
    fn changed_structure_set_is_answered(changes in changes()) {
        let grid = read_as("a.nii", &nifti(1, false)).unwrap().volume.grid;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("RS.dcm");
        std::fs::write(&path, changed(super::structure_set::made(), &changes)).unwrap();
        let never = std::sync::atomic::AtomicBool::new(false);
        let _ = read_labels(&path, &grid, &ReadOptions::default(), &never);
    }

    #[test]
    fn changed_dicom_is_answered(changes in changes()) {
        let slice = Slice::at(1.0).with(0x5200_9230, *b"SQ", [
            0xFE, 0xFF, 0x00, 0xE0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE, 0xFF, 0x0D, 0xE0, 0, 0, 0, 0,
        ]);
        let _ = read_as("a.dcm", &changed(slice.bytes(), &changes));
    }
}
