//! NIfTI-1: one file, little endian, with both forms of its place in the world.

#![expect(
    clippy::cast_possible_truncation,
    reason = "the format's numbers are f32"
)]

use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::file::{go_on, write_whole};
use crate::{LabelMap, Volume, VolumeError, VoxelGrid};

/// Bytes of the header, and of it with the four that say that no extension follows.
const HEADER: i32 = 348;
const DATA_AT: usize = 352;
/// Codes of the format: types of data, millimetres, coordinates of the scanner.
const INT16: i16 = 4;
const UINT16: i16 = 512;
const MILLIMETRES: u8 = 2;
const SCANNER: i16 = 1;
/// Fastest level: of noise there is little to gain. 15 % larger than level 6 in a fifth of its time.
const LEVEL: u32 = 1;

/// Writes a volume as `.nii`, or compressed if the name ends in `.gz`.
///
/// The sform holds the grid as it is. The qform says the same where it can, of grids without shear; of a tilted gantry's
/// it is left out.
pub fn write_nifti(path: &Path, volume: &Volume, cancel: &AtomicBool) -> Result<(), VolumeError> {
    let header = header(&volume.grid, INT16, "CT, HU", path)?;
    write(
        path,
        &header,
        &volume.hu,
        slice_of(&volume.grid),
        i16::to_le_bytes,
        cancel,
    )
}

/// Writes a label map in the same way, as unsigned 16-bit integers; its names are not in the file.
pub fn write_label_nifti(
    path: &Path,
    map: &LabelMap,
    cancel: &AtomicBool,
) -> Result<(), VolumeError> {
    let header = header(&map.grid, UINT16, "labels", path)?;
    write(
        path,
        &header,
        &map.labels,
        slice_of(&map.grid),
        u16::to_le_bytes,
        cancel,
    )
}

fn slice_of(grid: &VoxelGrid) -> usize {
    grid.size()[0] * grid.size()[1]
}

fn write<T: Copy>(
    path: &Path,
    header: &[u8],
    values: &[T],
    per_slice: usize,
    bytes: impl Fn(T) -> [u8; 2] + Copy,
    cancel: &AtomicBool,
) -> Result<(), VolumeError> {
    let is_compressed = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    let all = |out: &mut dyn Write| -> io::Result<()> {
        out.write_all(header)?;
        let mut buffer = Vec::with_capacity(2 * per_slice);
        for slice in values.chunks(per_slice) {
            go_on(cancel)?;
            buffer.clear();
            buffer.extend(slice.iter().flat_map(|value| bytes(*value)));
            out.write_all(&buffer)?;
        }
        Ok(())
    };
    write_whole(path, |file| {
        if !is_compressed {
            return all(file);
        }
        let mut packed = GzEncoder::new(file, Compression::new(LEVEL));
        all(&mut packed)?;
        packed.finish().map(|_| ())
    })
}

fn header(
    grid: &VoxelGrid,
    datatype: i16,
    description: &str,
    path: &Path,
) -> Result<Vec<u8>, VolumeError> {
    let mut header = vec![0; DATA_AT];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &HEADER.to_le_bytes());
    put(40, &3i16.to_le_bytes());
    for (axis, size) in grid.size().into_iter().enumerate() {
        let size = i16::try_from(size).map_err(|_| {
            VolumeError::refused(format!(
                "{size} voxels along one axis; NIfTI-1 allows 32767"
            ))
            .at(path.display().to_string())
        })?;
        put(42 + 2 * axis, &size.to_le_bytes());
    }
    for axis in 3..7 {
        put(42 + 2 * axis, &1i16.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &16i16.to_le_bytes());
    let world = World::of(grid);
    let spacing = grid.spacing_m().map(|step_m| (1e3 * step_m) as f32);
    for (slot, value) in [world.handedness, spacing[0], spacing[1], spacing[2]]
        .into_iter()
        .enumerate()
    {
        put(76 + 4 * slot, &value.to_le_bytes());
    }
    put(108, &(DATA_AT as f32).to_le_bytes());
    put(112, &1f32.to_le_bytes());
    put(123, &[MILLIMETRES]);
    put(148, description.as_bytes());
    if let Some(quaternion) = world.quaternion {
        put(252, &SCANNER.to_le_bytes());
        for (slot, value) in quaternion.iter().chain(&world.first_mm).enumerate() {
            put(256 + 4 * slot, &(*value as f32).to_le_bytes());
        }
    }
    put(254, &SCANNER.to_le_bytes());
    for row in 0..3 {
        let steps = [0, 1, 2].map(|column| world.steps_mm[(row, column)]);
        for (slot, value) in steps.into_iter().chain([world.first_mm[row]]).enumerate() {
            put(280 + 16 * row + 4 * slot, &(value as f32).to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    Ok(header)
}

/// A grid in the world of NIfTI: +x to the right, +y to the front, millimetres.
struct World {
    steps_mm: Matrix3<f64>,
    first_mm: [f64; 3],
    /// -1 where the third axis of the rotation is to be turned round.
    handedness: f32,
    /// Of the rotation, without its real part, which is not negative; none of a sheared grid.
    quaternion: Option<[f64; 3]>,
}

impl World {
    fn of(grid: &VoxelGrid) -> Self {
        /// Cosine between axes from which on a grid is sheared: less than the last digit of a float.
        const SHEARED: f64 = 1e-6;
        let flip = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
        let steps_mm = flip * grid.steps_m() * 1e3;
        let first = flip * grid.first_m().coords * 1e3;
        let mut axes = steps_mm;
        for mut axis in axes.column_iter_mut() {
            axis.normalize_mut();
        }
        let is_left_handed = axes.determinant() < 0.0;
        if is_left_handed {
            axes.column_mut(2).neg_mut();
        }
        let is_square = (axes.transpose() * axes - Matrix3::identity()).amax() < SHEARED;
        let quaternion = is_square.then(|| {
            let rotation = Rotation3::from_matrix_unchecked(axes);
            let turned = UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
            let sign = if turned.w < 0.0 { -1.0 } else { 1.0 };
            [turned.i, turned.j, turned.k].map(|part| sign * part)
        });
        Self {
            steps_mm,
            first_mm: first.into(),
            handedness: if is_left_handed { -1.0 } else { 1.0 },
            quaternion,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn floats(header: &[u8], at: usize, count: usize) -> Vec<f32> {
        header[at..at + 4 * count]
            .chunks_exact(4)
            .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
            .collect()
    }

    #[test]
    fn both_forms_say_the_same_of_a_turned_left_handed_grid() {
        /// Of millimetres as floats, some hundred of them.
        const FLOAT_MM: f64 = 5e-5;
        let turn = Rotation3::from_euler_angles(0.3, -0.2, 2.9);
        let steps = turn.matrix() * Matrix3::from_diagonal(&Vector3::new(7e-4, 8e-4, -1.5e-3));
        let grid = VoxelGrid::new([4, 5, 6], steps, Point3::new(-0.15, 0.12, 0.3)).unwrap();
        let header = header(&grid, INT16, "CT", Path::new("a.nii")).unwrap();
        let form = floats(&header, 280, 12);
        let quaternion = floats(&header, 256, 6);
        let spacing = floats(&header, 76, 4);
        // As the format's documentation puts it.
        let [b, c, d] = [0, 1, 2].map(|k| f64::from(quaternion[k]));
        let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
        let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(a, b, c, d));
        for axis in 0..3 {
            let mut direction = Vector3::zeros();
            direction[axis] = f64::from(spacing[axis + 1]);
            if axis == 2 {
                direction *= f64::from(spacing[0]);
            }
            let step = rotation * direction;
            for row in 0..3 {
                let of_sform = f64::from(form[4 * row + axis]);
                assert!((step[row] - of_sform).abs() < FLOAT_MM);
            }
        }
        assert_eq!([form[3], form[7], form[11]], [150.0, -120.0, 300.0]);
        assert_eq!(&quaternion[3..], [150.0, -120.0, 300.0]);
    }

    #[test]
    fn a_sheared_grid_has_no_quaternion() {
        let steps = Matrix3::new(7e-4, 0.0, 0.0, 0.0, 7e-4, 4e-4, 0.0, 0.0, 1e-3);
        let grid = VoxelGrid::new([4, 5, 6], steps, Point3::origin()).unwrap();
        let header = header(&grid, INT16, "CT", Path::new("a.nii")).unwrap();
        assert_eq!(&header[252..256], [0, 0, 1, 0]);
    }

    #[test]
    fn sizes_beyond_the_format_are_refused() {
        let grid = VoxelGrid::aligned([40_000, 1, 1], [1e-3; 3], Point3::origin()).unwrap();
        let error = header(&grid, INT16, "CT", Path::new("a.nii")).unwrap_err();
        let VolumeError::Refused { message, .. } = error else {
            panic!("{error}");
        };
        assert!(
            message.contains("40000") && message.contains("32767"),
            "{message}"
        );
    }
}
