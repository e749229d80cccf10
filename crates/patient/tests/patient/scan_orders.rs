//! A scan gives the same patient, whichever way its voxels are stored.

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_imaging::LesionSeed;
use needlebench_parallel::{Control, Silent};
use needlebench_patient::ct::{BuildOptions, GivenLabels, ScanBuild, build};
use needlebench_volume::read::{Description, ReadVolume};
use needlebench_volume::write::write_label_nifti;
use needlebench_volume::{AIR_HU, LabelMap, Volume, VoxelGrid};

const SPACING_MM: [f64; 3] = [3.0, 3.0, 4.0];
const SIZE: [usize; 3] = [90, 70, 50];

/// Outside this circle, off the middle, there is padding: it cuts the body on the right.
const CIRCLE_MM: f64 = 122.0;
const OFF_MIDDLE_MM: f64 = 10.0;

const NODULE_MM: [f64; 3] = [-68.0, 5.0, 12.0];

fn upright() -> VoxelGrid {
    let middle = [0, 1, 2].map(|axis| -0.5e-3 * SPACING_MM[axis] * (SIZE[axis] - 1) as f64);
    VoxelGrid::aligned(SIZE, SPACING_MM.map(|mm| 1e-3 * mm), Point3::from(middle)).unwrap()
}

fn is_in(place: Vector3<f64>, centre: [f64; 3], axes: [f64; 3]) -> bool {
    (place - Vector3::from(centre))
        .component_div(&Vector3::from(axes))
        .norm()
        < 1.0
}

/// An ellipse with two lungs, a spine and a nodule, and noise of air around it.
fn hu(place_m: &Point3<f64>) -> i16 {
    let mm = place_m.coords * 1e3;
    if libm::hypot(mm.x - OFF_MIDDLE_MM, mm.y) > CIRCLE_MM {
        return AIR_HU;
    }
    if libm::hypot(mm.x / 122.0, mm.y / 80.0) > 1.0 {
        return if (mm.x + mm.y + mm.z).rem_euclid(2.0) > 1.0 {
            -996
        } else {
            -1004
        };
    }
    if libm::hypot(mm.x, mm.y - 55.0) < 14.0 {
        return 700;
    }
    if is_in(mm, NODULE_MM, [12.0, 10.0, 14.0]) {
        return 40;
    }
    let in_lung = |x| is_in(mm, [x, 0.0, 0.0], [38.0, 55.0, 85.0]);
    if in_lung(-65.0) || in_lung(65.0) {
        -850
    } else {
        40
    }
}

/// A liver at the lower end, on the right.
fn label(place_m: &Point3<f64>) -> u16 {
    u16::from(is_in(
        place_m.coords * 1e3,
        [-50.0, -10.0, -88.0],
        [30.0, 25.0, 12.0],
    ))
}

/// The upright grid with its axes in this order and direction.
fn stored(order: [(usize, f64); 3]) -> VoxelGrid {
    let grid = upright();
    let steps: [_; 3] = order.map(|(row, sign)| grid.steps_m().column(row) * sign);
    let first = [0, 1, 2].map(|row| {
        let is_reversed = order.contains(&(row, -1.0));
        if is_reversed {
            (SIZE[row] - 1) as f64
        } else {
            0.0
        }
    });
    let first = grid.ct_from_index(&Point3::from(first));
    VoxelGrid::new(
        order.map(|(row, _)| SIZE[row]),
        Matrix3::from_columns(&steps),
        first,
    )
    .unwrap()
}

fn at_voxels<T>(grid: &VoxelGrid, value: impl Fn(&Point3<f64>) -> T) -> Vec<T> {
    let [nx, ny, nz] = grid.size();
    let all = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
    // The place to a micrometre, so that rounding does not depend on the order.
    let place = |index: [usize; 3]| {
        let place = grid.ct_from_index(&Point3::from(index.map(|each| each as f64)));
        place.map(|metres| (metres * 1e6).round() * 1e-6)
    };
    all.map(|index| value(&place(index))).collect()
}

fn built(order: [(usize, f64); 3]) -> ScanBuild {
    let grid = stored(order);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("labels.nii.gz");
    let labels = LabelMap {
        labels: at_voxels(&grid, label),
        grid: grid.clone(),
        names: vec![(1, "liver".to_owned())],
    };
    write_label_nifti(&file, &labels, &AtomicBool::new(false)).unwrap();
    let read = ReadVolume {
        volume: Volume {
            hu: at_voxels(&grid, hu),
            grid,
            slice_thickness_m: Some(4e-3),
        },
        remarks: Vec::new(),
        description: Description::default(),
    };
    let options = BuildOptions {
        lesions: vec![LesionSeed {
            name: "nodule".to_owned(),
            point_m: Point3::from(NODULE_MM.map(|mm| 1e-3 * mm)),
        }],
        labels: Some(GivenLabels {
            file,
            names: vec![(1, "liver".to_owned())],
        }),
        max_bytes: u64::MAX,
        ..BuildOptions::default()
    };
    let control = Control {
        threads: 1,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    build(read, &options, &control).unwrap()
}

#[test]
fn sagittal_and_coronal_stacks_give_the_patient_of_axial_ones() {
    let wanted = built([(0, 1.0), (1, 1.0), (2, 1.0)]);
    let sides = |build: &ScanBuild| build.seen.made.segmentation.body.cut_sides.clone();
    let has = |side| sides(&wanted).contains(&side);
    assert!(has("right") && !has("left"), "{:?}", sides(&wanted));
    let size = |build: &ScanBuild| build.seen.made.lesions[0].size.clone().unwrap();
    // Axial, of 28 mm along the patient and 24 by 20 mm across.
    let axial_mm = [size(&wanted).axial_longest_m, size(&wanted).axial_width_m].map(|m| 1e3 * m);
    assert!((22.0..26.0).contains(&axial_mm[0]), "{axial_mm:?}");
    assert!((18.0..22.0).contains(&axial_mm[1]), "{axial_mm:?}");
    let overview = wanted.overview();
    assert!(
        overview
            .iter()
            .any(|row| row.name == "liver" && row.volume_m3.is_some())
    );
    // Every order of the axes, the directions of which are told by the bits of its number.
    for (number, rows) in [
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
        [0, 1, 2],
    ]
    .into_iter()
    .enumerate()
    {
        let bits = number + 1;
        let sign = |axis: usize| if bits >> axis & 1 == 1 { -1.0 } else { 1.0 };
        let order = [0, 1, 2].map(|axis| (rows[axis], sign(axis)));
        let build = built(order);
        assert_eq!(build.seen.volume.hu, wanted.seen.volume.hu, "{order:?}");
        let labels = |build: &ScanBuild| build.seen.made.labels.labels.clone();
        assert_eq!(labels(&build), labels(&wanted), "{order:?}");
        assert_eq!(sides(&build), sides(&wanted), "{order:?}");
        let said = |build: &ScanBuild| {
            build
                .remarks
                .iter()
                .map(|each| each.message.clone())
                .collect::<Vec<_>>()
        };
        // That its slices are not axial is all that is said of it besides.
        let mut heard = said(&build);
        let before = heard.len();
        heard.retain(|each| !each.starts_with("the slices are not axial"));
        let is_axial = order[2].0 == 2;
        assert_eq!(before - heard.len(), usize::from(!is_axial), "{order:?}");
        assert_eq!(heard, said(&wanted), "{order:?}");
        // Places differ by rounding alone.
        let [a, b] = [&build, &wanted].map(|build| {
            let size = size(build);
            let skin_m3 = build.seen.made.skin().unwrap().volume_m3;
            [
                size.volume_m3,
                size.longest_m,
                size.axial_longest_m,
                size.axial_width_m,
                skin_m3,
            ]
        });
        for (a, b) in a.into_iter().zip(b) {
            assert!((a / b - 1.0).abs() < 1e-9, "{order:?} {a} {b}");
        }
    }
}
