//! Reconstruction of chests of analytic solids, rendered by supersampling.

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_geometry::mesh::check_closed;
use needlebench_imaging::{
    FIRST_LESION, Label, LesionSeed, Levels, Lung, NotGrown, ReconstructOptions, Reconstruction,
    Side, reconstruct,
};
use needlebench_volume::{LabelMap, SurfaceTissue, Volume, VolumeError, VoxelGrid};

pub(super) const MM: f64 = 1e-3;

/// Voxels: coarse, so that the tests are quick.
const SPACING_MM: [f64; 3] = [2.5, 2.5, 3.0];
const SIZE: [usize; 3] = [144, 104, 64];

/// Samples along each edge of a voxel.
const SAMPLES: usize = 3;

/// Whether a place, in mm from the volume's middle, is inside.
pub(super) type Inside = Box<dyn Fn(&Vector3<f64>) -> bool>;

/// A solid in mm from the volume's middle, and its density.
pub(super) struct Solid(pub Inside, pub f64);

fn ellipsoid(at: [f64; 3], axes: [f64; 3]) -> Inside {
    let (at, axes) = (Vector3::from(at), Vector3::from(axes));
    Box::new(move |p| (p - at).component_div(&axes).norm() <= 1.0)
}

const LUNG_AXES_MM: [f64; 3] = [52.0, 68.0, 80.0];
const BODY_AXES_MM: [f64; 2] = [150.0, 100.0];
const NODULE_MM: [f64; 3] = [-70.0, 20.0, 10.0];
const NODULE_RADIUS_MM: f64 = 9.0;

fn left_lung() -> Solid {
    Solid(ellipsoid([72.0, 0.0, 0.0], LUNG_AXES_MM), -850.0)
}

fn right_lung() -> Solid {
    Solid(ellipsoid([-72.0, 0.0, 0.0], LUNG_AXES_MM), -850.0)
}

fn nodule() -> Solid {
    Solid(ellipsoid(NODULE_MM, [NODULE_RADIUS_MM; 3]), 40.0)
}

fn body_and_bed() -> Vec<Solid> {
    let [a, b] = BODY_AXES_MM;
    vec![
        // A shell of 4 mm that touches the back.
        Solid(
            Box::new(|p| (100.0..104.0).contains(&p.y) && p.x.abs() < 160.0),
            -100.0,
        ),
        Solid(
            Box::new(move |p| libm::hypot(p.x / a, p.y / b) <= 1.0),
            40.0,
        ),
        // A spine with marrow.
        Solid(Box::new(|p| libm::hypot(p.x, p.y - 66.0) <= 18.0), 700.0),
        Solid(Box::new(|p| libm::hypot(p.x, p.y - 66.0) <= 13.0), 180.0),
    ]
}

pub(super) fn chest() -> Vec<Solid> {
    let mut solids = body_and_bed();
    solids.extend([left_lung(), right_lung(), nodule()]);
    solids
}

pub(super) fn grid() -> VoxelGrid {
    let first =
        Point3::from([0, 1, 2].map(|axis| -0.5 * MM * SPACING_MM[axis] * (SIZE[axis] - 1) as f64));
    VoxelGrid::aligned(SIZE, SPACING_MM.map(|mm| mm * MM), first).unwrap()
}

pub(super) fn render(solids: &[Solid], grid: VoxelGrid) -> Volume {
    let at = |index: Point3<f64>| {
        let place = grid.ct_from_index(&index).coords / MM;
        let solid = solids.iter().rev().find(|solid| solid.0(&place));
        solid.map_or(-1000.0, |solid| solid.1)
    };
    let [nx, ny, nz] = grid.size();
    let voxels = |nx, ny, nz| {
        (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
    };
    // Where all corners of a voxel are alike it is of one solid: none is smaller.
    let corners: Vec<f64> = voxels(nx + 1, ny + 1, nz + 1)
        .map(|[i, j, k]| at(Point3::new(i as f64 - 0.5, j as f64 - 0.5, k as f64 - 0.5)))
        .collect();
    let corner = |[i, j, k]: [usize; 3], c: usize| {
        corners[((k + (c >> 2)) * (ny + 1) + j + (c >> 1 & 1)) * (nx + 1) + i + (c & 1)]
    };
    let sample = |at: usize| (at as f64 + 0.5) / SAMPLES as f64 - 0.5;
    let hu = voxels(nx, ny, nz).map(|voxel| {
        let first = corner(voxel, 0);
        if (1..8).all(|c| corner(voxel, c) == first) {
            return first;
        }
        let [i, j, k] = voxel.map(|index| index as f64);
        let sum: f64 = voxels(SAMPLES, SAMPLES, SAMPLES)
            .map(|[x, y, z]| at(Point3::new(i + sample(x), j + sample(y), k + sample(z))))
            .sum();
        sum / (SAMPLES * SAMPLES * SAMPLES) as f64
    });
    #[expect(clippy::cast_possible_truncation, reason = "Hounsfield units")]
    let hu = hu.map(|hu: f64| hu.round() as i16).collect();
    Volume {
        grid,
        hu,
        slice_thickness_m: None,
    }
}

pub(super) fn options() -> ReconstructOptions {
    ReconstructOptions::default()
}

fn seed(name: &str, at_mm: [f64; 3]) -> LesionSeed {
    LesionSeed {
        name: name.to_owned(),
        point_m: Point3::from(at_mm) * MM,
    }
}

pub(super) fn run(
    volume: &Volume,
    options: &ReconstructOptions,
) -> Result<Reconstruction, VolumeError> {
    reconstruct(volume, options, 2, &AtomicBool::new(false), &|_, _| {})
}

/// The label of the voxel at a place.
pub(super) fn label_at(made: &Reconstruction, at_mm: [f64; 3]) -> u16 {
    let grid = &made.labels.grid;
    let index = grid.index_from_ct(&(Point3::from(at_mm) * MM));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places in the volume"
    )]
    let voxel = [index.x, index.y, index.z].map(|at| at.round() as usize);
    made.labels.labels[grid.offset(voxel)]
}

fn remarks(made: &Reconstruction) -> String {
    let messages = made.remarks.iter().map(|remark| remark.message.as_str());
    messages.collect::<Vec<_>>().join("\n")
}

fn ellipsoid_m3(axes_mm: [f64; 3]) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * axes_mm.iter().product::<f64>() * 1e-9
}

/// Distance of 99 % of a surface from that of the voxels over a voxel's edge: what the flat ends' edges lose.
const SURFACE_SHARE: f64 = 0.25;

/// Of volumes: a tenth of a voxel over their surface.
const VOLUME: f64 = 0.015;

#[test]
fn chest_is_taken_apart_into_closed_surfaces_of_the_right_size() {
    let volume = render(&chest(), grid());
    let mut options = options();
    options.lesions = vec![seed("nodule", NODULE_MM)];
    let made = run(&volume, &options).unwrap();
    let names: Vec<&str> = made
        .surfaces
        .iter()
        .map(|each| each.name.as_str())
        .collect();
    assert_eq!(
        names,
        ["skin", "lung_left", "lung_right", "bone", "nodule", "couch"]
    );
    for surface in &made.surfaces {
        let facts = check_closed(&surface.mesh).unwrap();
        // The back parts the bed in two where it lies on it.
        let components = if surface.name == "couch" { 2 } else { 1 };
        assert_eq!(
            (facts.components, facts.shared_edges),
            (components, 0),
            "{}",
            surface.name
        );
        assert!(
            surface.error.p99_m < SURFACE_SHARE * 2.5 * MM,
            "{} {:?}",
            surface.name,
            surface.error
        );
    }
    let height_mm = SPACING_MM[2] * SIZE[2] as f64;
    let [a, b] = BODY_AXES_MM;
    let body_m3 = std::f64::consts::PI * a * b * height_mm * 1e-9;
    for (at, wanted_m3) in [
        (0, body_m3),
        (1, ellipsoid_m3(LUNG_AXES_MM)),
        (2, ellipsoid_m3(LUNG_AXES_MM)),
    ] {
        let ratio = made.surfaces[at].volume_m3 / wanted_m3;
        assert!((ratio - 1.0).abs() < VOLUME, "{} {ratio}", names[at]);
    }
    // The bed is no part of the body, the nodule one of the lung.
    assert!(
        remarks(&made).contains("in contact with another object"),
        "{}",
        remarks(&made)
    );
    let label_at = |at_mm| label_at(&made, at_mm);
    assert_eq!(label_at([140.0, 102.0, 0.0]), Label::Couch as u16);
    assert_eq!(label_at([72.0, 0.0, 0.0]), Label::LungLeft as u16);
    assert_eq!(label_at([-72.0, -20.0, 0.0]), Label::LungRight as u16);
    assert_eq!(label_at([0.0, 66.0, 0.0]), Label::Bone as u16);
    assert_eq!(label_at([0.0, 0.0, 0.0]), Label::SoftTissue as u16);
    assert_eq!(label_at(NODULE_MM), FIRST_LESION);
    let lesion = &made.lesions[0];
    assert!(lesion.lesion.in_lung && !lesion.lesion.leaked && !lesion.lesion.cut_at_wall);
    let size = lesion.size.as_ref().unwrap();
    // A third of a voxel: partial volume makes small balls smaller.
    assert!(
        (size.equivalent_diameter_m / MM - 18.0).abs() < 0.8,
        "{size:?}"
    );
    assert!(
        (size.longest_m / MM - 18.0).abs() < 1.0 && (size.axial_width_m / MM - 18.0).abs() < 1.0
    );
    assert!((size.centroid_m - Point3::from(NODULE_MM) * MM).norm() < 0.1 * MM);
    assert_eq!(made.surfaces[4].organ.as_deref(), Some("lung_right"));
}

#[test]
fn threads_do_not_change_what_comes_out() {
    let volume = render(&chest(), grid());
    let once = |threads| {
        let made = reconstruct(
            &volume,
            &options(),
            threads,
            &AtomicBool::new(false),
            &|_, _| {},
        )
        .unwrap();
        made.surfaces
            .into_iter()
            .map(|each| each.mesh)
            .collect::<Vec<_>>()
    };
    assert_eq!(once(1), once(3));
}

#[test]
fn turned_and_mirrored_grids_give_the_same_patient() {
    let upright = grid();
    let [i, j, k] = [0, 1, 2].map(|axis| upright.steps_m().column(axis).into_owned());
    let [nx, ny, _] = SIZE;
    let corner = upright.ct_from_index(&Point3::new((nx - 1) as f64, 0.0, 0.0));
    // Columns run to the right, and rows and columns are exchanged.
    for (size, steps, first) in [
        (SIZE, Matrix3::from_columns(&[-i, j, k]), corner),
        (
            [ny, nx, SIZE[2]],
            Matrix3::from_columns(&[j, i, k]),
            upright.first_m(),
        ),
    ] {
        let volume = render(&chest(), VoxelGrid::new(size, steps, first).unwrap());
        let made = run(&volume, &options()).unwrap();
        let left = made
            .surfaces
            .iter()
            .find(|each| each.name == "lung_left")
            .unwrap();
        let ratio = left.volume_m3 / ellipsoid_m3(LUNG_AXES_MM);
        assert!((ratio - 1.0).abs() < VOLUME);
        let middle = needlebench_geometry::mesh::centroid_m(&left.mesh);
        assert!(
            (middle - Point3::new(0.072, 0.0, 0.0)).norm() < MM,
            "{middle}"
        );
    }
}

#[test]
fn one_lung_and_none_are_said() {
    let mut solids = body_and_bed();
    let made = run(&render(&solids, grid()), &options()).unwrap();
    assert!(made.segmentation.lungs.lungs.is_empty());
    assert!(remarks(&made).contains("no lung with 0.3 l of air found"));
    solids.push(left_lung());
    let made = run(&render(&solids, grid()), &options()).unwrap();
    assert!(matches!(
        &made.segmentation.lungs.lungs[..],
        [Lung {
            side: Side::Left,
            ..
        }]
    ));
    assert!(remarks(&made).contains("one lung found, on the patient's left side"));
}

#[test]
fn what_is_dense_between_the_lungs_is_a_vessel_if_it_is_as_large_as_one() {
    for (radius_mm, is_vessel) in [(12.0, true), (5.0, false)] {
        let mut solids = chest();
        // Blood with contrast medium, or something calcified.
        solids.push(Solid(ellipsoid([0.0, -20.0, 0.0], [radius_mm; 3]), 350.0));
        let made = run(&render(&solids, grid()), &options()).unwrap();
        let has_vessel = made
            .surfaces
            .iter()
            .any(|surface| surface.name == "contrast_vessels");
        assert_eq!(has_vessel, is_vessel, "{radius_mm}: {}", remarks(&made));
        // Whatever it is, the needle keeps away from it.
        let bone = made.segmentation.bone.bone.count();
        let vessel = made.segmentation.bone.contrast.count();
        assert!(bone > 0 && (vessel > 0) == is_vessel);
    }
}

#[test]
fn merged_lungs_are_parted_at_their_connection() {
    let mut solids = chest();
    // A bridge of 8 mm: the anterior junction.
    solids.push(Solid(
        Box::new(|p| p.x.abs() < 30.0 && libm::hypot(p.y + 10.0, p.z) < 8.0),
        -850.0,
    ));
    let made = run(&render(&solids, grid()), &options()).unwrap();
    assert!(
        remarks(&made).contains("the lungs are connected"),
        "{}",
        remarks(&made)
    );
    assert_eq!(made.segmentation.lungs.lungs.len(), 2);
    for name in ["lung_left", "lung_right"] {
        let lung = made.surfaces.iter().find(|each| each.name == name).unwrap();
        let ratio = lung.volume_m3 / ellipsoid_m3(LUNG_AXES_MM);
        assert!((ratio - 1.0).abs() < 0.03, "{name} {ratio}");
    }
}

#[test]
fn field_of_view_that_cuts_the_body_is_said_with_its_side() {
    // 80 mm of the patient's left are not seen.
    let narrow = VoxelGrid::aligned(
        [112, SIZE[1], SIZE[2]],
        SPACING_MM.map(|mm| mm * MM),
        grid().first_m(),
    )
    .unwrap();
    let made = run(&render(&chest(), narrow), &options()).unwrap();
    assert_eq!(made.segmentation.body.cut_sides, ["left"]);
    assert!(
        remarks(&made).contains("cuts the body on its left side"),
        "{}",
        remarks(&made)
    );
    assert!(check_closed(&made.surfaces[0].mesh).is_ok());
}

fn refusal(error: &VolumeError) -> (Option<&str>, &str) {
    match error {
        VolumeError::Interrupted => (None, "interrupted"),
        VolumeError::Refused { place, message, .. } => (place.as_deref(), message),
    }
}

#[test]
fn seeds_that_are_in_no_lesion_are_refused_by_name() {
    let volume = render(&chest(), grid());
    for (at_mm, word) in [
        ([0.0, 0.0, 900.0], "outside the volume"),
        ([170.0, 0.0, 0.0], "outside the body"),
        ([72.0, 0.0, 0.0], "in air"),
        ([0.0, 0.0, 0.0], "cannot be separated from"),
        ([f64::NAN, 0.0, 0.0], "outside the volume"),
    ] {
        let mut options = options();
        // One does not keep the others from being grown.
        options.lesions = vec![seed("wrong", at_mm), seed("nodule", NODULE_MM)];
        let made = run(&volume, &options).unwrap();
        assert_eq!(made.lesions[0].lesion.name, "nodule");
        let [NotGrown { name, error }] = &made.not_grown[..] else {
            panic!("{:?}", made.not_grown);
        };
        assert_eq!(name, "wrong");
        let (place, message) = refusal(error);
        assert!(remarks(&made).contains(message));
        assert!(
            place.is_some_and(|place| place.contains("lesion `wrong`")),
            "{error:?}"
        );
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn nodule_at_a_vessel_and_at_the_wall_is_cut_there() {
    let mut solids = chest();
    // A vessel through the nodule, to the mediastinum.
    solids.push(Solid(
        Box::new(|p| libm::hypot(p.y - 20.0, p.z - 10.0) < 3.0 && (-70.0..0.0).contains(&p.x)),
        40.0,
    ));
    // Half in the wall.
    solids.push(Solid(ellipsoid([122.0, 0.0, 0.0], [8.0; 3]), 40.0));
    let mut options = options();
    options.lesions = vec![
        seed("at_vessel", NODULE_MM),
        seed("at_wall", [119.0, 0.0, 0.0]),
    ];
    let made = run(&render(&solids, grid()), &options).unwrap();
    let [at_vessel, at_wall] = &made.lesions[..] else {
        panic!("two lesions");
    };
    let diameter_mm = at_vessel.size.as_ref().unwrap().equivalent_diameter_m / MM;
    assert!((diameter_mm - 18.0).abs() < 1.5, "{diameter_mm}");
    assert!(!at_vessel.lesion.leaked);
    assert!(
        at_wall.lesion.cut_at_wall && !at_wall.lesion.leaked,
        "{:?}",
        at_wall.size
    );
    let volume_m3 = at_wall.size.as_ref().unwrap().volume_m3;
    // Two thirds of it are in the lung, less a voxel that the wall's closing may lose.
    let ball_m3 = ellipsoid_m3([8.0; 3]);
    assert!(
        (0.2..0.7).contains(&(volume_m3 / ball_m3)),
        "{}",
        volume_m3 / ball_m3
    );
}

#[test]
fn what_is_no_patient_is_refused() {
    let empty = Volume {
        grid: grid(),
        hu: vec![-1000; grid().len()],
        slice_thickness_m: None,
    };
    assert!(
        refusal(&run(&empty, &options()).err().unwrap())
            .1
            .contains("denser than")
    );
    let short = Volume {
        hu: vec![0; 5],
        ..empty.clone()
    };
    assert!(
        refusal(&run(&short, &options()).err().unwrap())
            .1
            .contains("voxels")
    );
    let steps = Matrix3::new(1e-3, 3e-4, 0.0, 0.0, 1e-3, 0.0, 0.0, 0.0, 1e-3);
    let sheared = Volume {
        grid: VoxelGrid::new(SIZE, steps, Point3::origin()).unwrap(),
        ..empty.clone()
    };
    assert!(
        refusal(&run(&sheared, &options()).err().unwrap())
            .1
            .contains("perpendicular")
    );
    let [i, j, k] = [0, 1, 2].map(|axis| grid().steps_m().column(axis).into_owned());
    let sagittal = Matrix3::from_columns(&[j, k, i]);
    let sagittal = Volume {
        grid: VoxelGrid::new([SIZE[1], SIZE[2], SIZE[0]], sagittal, Point3::origin()).unwrap(),
        ..empty.clone()
    };
    let refused = run(&sagittal, &options()).err().unwrap();
    let (_, message) = refusal(&refused);
    assert!(message.contains("PSL"), "{message}");
    let mut wrong = options();
    wrong.levels = Levels {
        skin_hu: 300.0,
        ..Levels::default()
    };
    assert!(
        refusal(&run(&empty, &wrong).err().unwrap())
            .1
            .contains("levels")
    );
    // A solid block has no air around it, nor has a chest of which air is 0, or whose values have the other sign.
    let patient = render(&chest(), grid());
    for hu in [
        vec![40; grid().len()],
        patient.hu.iter().map(|hu| hu + 1000).collect(),
        patient.hu.iter().map(|hu| -hu).collect(),
    ] {
        let other = Volume {
            hu,
            ..patient.clone()
        };
        let error = run(&other, &options()).err().unwrap();
        let (_, message) = refusal(&error);
        assert!(message.contains("no air is around"), "{message}");
    }
    let steps_m = SPACING_MM.map(|mm| mm * 1e-6);
    let in_metres = Volume {
        grid: VoxelGrid::aligned(SIZE, steps_m, Point3::origin()).unwrap(),
        ..patient.clone()
    };
    let error = run(&in_metres, &options()).err().unwrap();
    let (_, message) = refusal(&error);
    assert!(message.contains("mm large"), "{message}");
    let stop = reconstruct(&patient, &options(), 1, &AtomicBool::new(true), &|_, _| {});
    assert_eq!(stop.err(), Some(VolumeError::Interrupted));
}

/// A label map of the chest, by the density of its voxels.
fn given(volume: &Volume) -> LabelMap {
    let middle = SIZE[0] / 2;
    let labels = volume.hu.iter().enumerate().map(|(at, &hu)| match hu {
        -900..-600 if at % SIZE[0] >= middle => 10,
        -900..-600 => 11,
        100.. => 3,
        _ => 0,
    });
    LabelMap {
        grid: volume.grid.clone(),
        labels: labels.collect(),
        names: [
            (3, "vertebrae_T8"),
            (10, "lung_lower_lobe_left"),
            (11, "Right Lung"),
            (12, "wombat"),
        ]
        .map(|(label, name)| (label, name.to_owned()))
        .to_vec(),
    }
}

#[test]
fn label_map_from_elsewhere_stands_for_what_it_has() {
    let volume = render(&chest(), grid());
    let mut options = options();
    options.labels = Some(given(&volume));
    options.lesions = vec![seed("nodule", NODULE_MM)];
    let made = run(&volume, &options).unwrap();
    let names: Vec<&str> = made
        .surfaces
        .iter()
        .map(|each| each.name.as_str())
        .collect();
    assert_eq!(
        names,
        [
            "skin",
            "lung_left",
            "lung_right",
            "vertebrae",
            "nodule",
            "couch"
        ]
    );
    assert!(remarks(&made).contains("12 `wombat`"));
    assert_eq!(made.surfaces[1].level_hu, None);
    assert_eq!(made.surfaces[3].tissue, SurfaceTissue::Bone);
    let left = &made.surfaces[1];
    assert!(check_closed(&left.mesh).is_ok());
    // Half a voxel over its surface.
    assert!(
        (left.volume_m3 / ellipsoid_m3(LUNG_AXES_MM) - 1.0).abs() < 0.06,
        "{}",
        left.volume_m3
    );
    let named = |name: &str| {
        made.labels
            .names
            .iter()
            .find(|each| each.1 == name)
            .unwrap()
            .0
    };
    assert_eq!(named("nodule"), FIRST_LESION);
    // What was given stays but where the lesion is, and the rest of the body is what was found here, under free numbers.
    let soft = named("soft_tissue");
    assert!(soft >= 1000 && named("wombat") == 12);
    let given = &options.labels.as_ref().unwrap().labels;
    for (given, label) in given.iter().zip(&made.labels.labels) {
        assert!(label == given || *label == FIRST_LESION || (*given == 0 && *label >= 1000));
    }
    let count = |label: u16| {
        made.labels
            .labels
            .iter()
            .filter(|each| **each == label)
            .count()
    };
    assert!(count(soft) > count(3) && count(FIRST_LESION) > 0);
}

/// A dense ball on the skin, of a millilitre at most, is a marker and no bone; the same ball under 8 mm of skin is bone.
#[test]
fn a_lung_of_the_label_map_is_in_the_body_where_its_air_leaks_out() {
    // Through a wall of less than a voxel, as a pneumothorax with a drain has it.
    let hole = Solid(
        Box::new(|p| libm::hypot(p.y, p.z) < 12.0 && p.x > 100.0),
        -1000.0,
    );
    let mut solids = chest();
    solids.push(hole);
    let volume = render(&solids, grid());
    let mut options = ReconstructOptions::default();
    let made = run(&volume, &options).unwrap();
    let litres = |made: &Reconstruction| {
        let skin = made
            .surfaces
            .iter()
            .find(|each| each.tissue == SurfaceTissue::Skin);
        1e3 * skin.unwrap().volume_m3
    };
    let leaking_l = litres(&made);
    options.labels = Some(LabelMap {
        labels: given_lungs(&volume),
        grid: volume.grid.clone(),
        names: vec![(1, "lung_left".to_owned()), (2, "lung_right".to_owned())],
    });
    let made = run(&volume, &options).unwrap();
    let [x, y, z] = LUNG_AXES_MM;
    let lung_l = 1e3 * ellipsoid_m3([x, y, z]);
    let more_l = litres(&made) - leaking_l;
    assert!((more_l / lung_l - 1.0).abs() < 0.1, "{more_l} {lung_l}");
}

/// Labels of the left and the right lung.
fn given_lungs(volume: &Volume) -> Vec<u16> {
    let solids = [left_lung(), right_lung()];
    let [nx, ny, _] = volume.grid.size();
    let label = |at: usize| {
        let index = [at % nx, at / nx % ny, at / (nx * ny)].map(|each| each as f64);
        let place = volume.grid.ct_from_index(&Point3::from(index)).coords / MM;
        let lung = solids.iter().position(|solid| solid.0(&place));
        lung.map_or(0, |lung| u16::try_from(lung + 1).unwrap())
    };
    (0..volume.hu.len()).map(label).collect()
}

/// With its rows or slices in the other order, as a file has it whose orientation is wrong.
fn reversed(volume: &Volume, axis: usize) -> Volume {
    let size = volume.grid.size();
    let [nx, ny, _] = size;
    let hu = (0..volume.hu.len()).map(|at| {
        let mut voxel = [at % nx, at / nx % ny, at / (nx * ny)];
        voxel[axis] = size[axis] - 1 - voxel[axis];
        volume.hu[volume.grid.offset(voxel)]
    });
    Volume {
        hu: hu.collect(),
        ..volume.clone()
    }
}

#[test]
fn a_patient_who_is_upside_down_in_the_file_is_refused() {
    let mut solids = chest();
    // Sternum and trachea.
    solids.push(Solid(
        Box::new(|p| p.x.abs() < 15.0 && (-92.0..-84.0).contains(&p.y) && p.z.abs() < 60.0),
        400.0,
    ));
    solids.push(Solid(
        Box::new(|p| libm::hypot(p.x, p.y - 20.0) <= 8.0 && p.z > 20.0),
        -1000.0,
    ));
    let volume = render(&solids, grid());
    run(&volume, &ReconstructOptions::default()).unwrap();
    let refused = |axis: usize| {
        let error = run(&reversed(&volume, axis), &ReconstructOptions::default()).unwrap_err();
        refusal(&error).1.to_owned()
    };
    let said = refused(1);
    assert!(said.starts_with("the spine is in front"), "{said}");
    let said = refused(2);
    assert!(
        said.starts_with("the trachea leaves the lungs at their lower end"),
        "{said}"
    );
}

#[test]
fn what_lies_on_the_skin_is_no_bone() {
    let clear = run(&render(&chest(), grid()), &options()).unwrap();
    let bones = |made: &Reconstruction| {
        let bone = made
            .labels
            .names
            .iter()
            .find(|each| each.1 == "bone")
            .unwrap()
            .0;
        made.labels
            .labels
            .iter()
            .filter(|each| **each == bone)
            .count()
    };
    let body = &clear.labels;
    let middle = [SIZE[0] / 2, SIZE[1] / 2, SIZE[2] / 2];
    // The skin to the front of the middle.
    let skin_j = (0..SIZE[1])
        .find(|&j| body.labels[body.grid.offset([middle[0], j, middle[2]])] != 0)
        .unwrap();
    let ball_mm = 4.5;
    let with_ball = |deep_mm: f64| {
        let mut volume = render(&chest(), grid());
        let step_mm = SPACING_MM[1];
        let centre_j = skin_j as f64 + deep_mm / step_mm;
        for k in 0..SIZE[2] {
            for j in 0..SIZE[1] {
                for i in 0..SIZE[0] {
                    let way = [
                        (i as f64 - middle[0] as f64) * SPACING_MM[0],
                        (j as f64 - centre_j) * step_mm,
                        (k as f64 - middle[2] as f64) * SPACING_MM[2],
                    ];
                    if way.iter().map(|mm| mm * mm).sum::<f64>().sqrt() <= ball_mm {
                        let at = volume.grid.offset([i, j, k]);
                        volume.hu[at] = 1200;
                    }
                }
            }
        }
        bones(&run(&volume, &options()).unwrap())
    };
    let ball = 4.0 / 3.0 * std::f64::consts::PI * f64::powi(ball_mm, 3)
        / SPACING_MM.iter().product::<f64>();
    assert_eq!(with_ball(-3.0), bones(&clear));
    let under = with_ball(8.0 + ball_mm) as f64 - bones(&clear) as f64;
    assert!(under > 0.5 * ball, "{under} of {ball}");
}

#[test]
fn label_map_of_another_grid_is_refused() {
    let volume = render(&chest(), grid());
    let mut map = given(&volume);
    map.grid = VoxelGrid::aligned(SIZE, SPACING_MM.map(|mm| mm * MM), Point3::origin()).unwrap();
    let mut options = options();
    options.labels = Some(map);
    let error = run(&volume, &options).err().unwrap();
    assert_eq!(refusal(&error).0, Some("label map"));
    assert!(refusal(&error).1.contains("corners"));
}

/// What is found without a label map, and with one of these labels by voxel and density.
fn with_map(names: &[(u16, &str)], label: impl Fn([usize; 3], i16) -> u16) -> [Reconstruction; 2] {
    let volume = render(&chest(), grid());
    let mut options = options();
    let clear = run(&volume, &options).unwrap();
    let labels = volume.hu.iter().enumerate().map(|(at, &hu)| {
        let voxel = [
            at % SIZE[0],
            at / SIZE[0] % SIZE[1],
            at / (SIZE[0] * SIZE[1]),
        ];
        label(voxel, hu)
    });
    options.labels = Some(LabelMap {
        grid: volume.grid.clone(),
        labels: labels.collect(),
        names: names
            .iter()
            .map(|(label, name)| (*label, (*name).to_owned()))
            .collect(),
    });
    let made = run(&volume, &options).unwrap();
    [clear, made]
}

/// Voxels of what is called so in a label map.
fn voxels_of(made: &Reconstruction, called: &[&str]) -> Vec<bool> {
    let numbers: Vec<u16> = made
        .labels
        .names
        .iter()
        .filter(|(_, name)| called.contains(&name.as_str()))
        .map(|(label, _)| *label)
        .collect();
    let labels = made.labels.labels.iter();
    labels.map(|label| numbers.contains(label)).collect()
}

fn lacks(whole: &[bool], part: &[bool]) -> usize {
    let pairs = whole.iter().zip(part);
    pairs.filter(|(whole, part)| **part && !**whole).count()
}

#[test]
fn a_map_of_one_vertebra_leaves_the_other_bones() {
    let half = SIZE[2] / 2;
    let [clear, made] = with_map(&[(3, "vertebrae_T8")], |[_, _, k], hu| {
        3 * u16::from(hu >= 100 && k < half)
    });
    let bone = voxels_of(&made, &["bone", "vertebrae_T8"]);
    assert_eq!(lacks(&bone, &voxels_of(&clear, &["bone"])), 0);
    let surface = |name: &str| made.surfaces.iter().find(|each| each.name == name);
    let (mapped, other) = (
        surface("vertebrae").unwrap(),
        surface("other_bone").expect("half of the bone is not in the map"),
    );
    assert_eq!(other.tissue, SurfaceTissue::Bone);
    let all = clear.surfaces.iter().find(|each| each.name == "bone");
    let share = (mapped.volume_m3 + other.volume_m3) / all.unwrap().volume_m3;
    assert!((0.9..1.2).contains(&share), "{share}");
    assert!(remarks(&made).contains("of the bone found in the volume, which stay bone"));
}

#[test]
fn labels_without_a_meaning_change_nothing() {
    for name in ["left_out", "lung"] {
        let [clear, made] = with_map(&[(1, name), (2, "liver")], |_, _| 1);
        for found in ["bone", "lung_left", "lung_right"] {
            let (here, there) = (voxels_of(&made, &[found]), voxels_of(&clear, &[found]));
            assert_eq!(here, there, "{name} {found}");
        }
        let areas = |made: &Reconstruction| -> Vec<(String, f64)> {
            let each = made.surfaces.iter();
            each.map(|each| (each.name.clone(), each.volume_m3))
                .collect()
        };
        assert_eq!(areas(&made), areas(&clear), "{name}");
    }
}

#[test]
fn an_outside_holds_what_is_in_it_and_a_hull_is_no_body() {
    let [clear, made] = with_map(&[(1, "body")], |_, hu| u16::from(hu > -2000));
    for found in ["bone", "lung_left", "lung_right"] {
        let (here, there) = (voxels_of(&made, &[found]), voxels_of(&clear, &[found]));
        assert_eq!(here, there, "{found}");
    }
    let [_, hull] = with_map(&[(1, "skin")], |[i, _, _], _| u16::from(i < SIZE[0] / 8));
    assert!(remarks(&hull).contains("the skin is taken from the volume"));
    let skin = hull.surfaces.iter().find(|each| each.name == "skin");
    assert!(skin.unwrap().level_hu.is_some());
}

#[test]
fn an_outside_beside_labels_of_what_is_in_it_is_not_hollow() {
    // Lungs have voxels of their own, and no label at all in the upper half.
    let names = [(1, "body"), (2, "lung_left"), (3, "lung_right")];
    let [clear, made] = with_map(&names, |[i, _, k], hu| match hu {
        i16::MIN..=-950 => 0,
        -949..=-600 if k >= SIZE[2] / 2 => 0,
        -949..=-600 if i >= SIZE[0] / 2 => 2,
        -949..=-600 => 3,
        _ => 1,
    });
    let skin_m3 = |made: &Reconstruction| {
        let skin = made.surfaces.iter().find(|each| each.name == "skin");
        skin.map(|skin| (skin.volume_m3, check_closed(&skin.mesh).unwrap().components))
    };
    let (Some((before_m3, _)), Some((after_m3, components))) = (skin_m3(&clear), skin_m3(&made))
    else {
        panic!("both have a skin");
    };
    // The bed is at its back in the map.
    assert!(
        (after_m3 / before_m3 - 1.0).abs() < 0.06,
        "{after_m3} {before_m3}"
    );
    assert_eq!(components, 1);
}

#[test]
fn one_lobe_is_not_the_lung() {
    let half = SIZE[2] / 2;
    let [clear, made] = with_map(&[(10, "lung_upper_lobe_left")], |[i, _, k], hu| {
        10 * u16::from((-900..-600).contains(&hu) && i >= SIZE[0] / 2 && k >= half)
    });
    let lung = voxels_of(
        &made,
        &["lung_left", "lung_upper_lobe_left", "lung_vessels"],
    );
    assert_eq!(lacks(&lung, &voxels_of(&clear, &["lung_left"])), 0);
    let volume = |made: &Reconstruction| {
        let lung = made.surfaces.iter().find(|each| each.name == "lung_left");
        lung.unwrap().volume_m3
    };
    let share = volume(&made) / volume(&clear);
    assert!((0.95..1.1).contains(&share), "{share}");
}

/// Two nodules under one label: one of them was pointed at, and has the name of the seed.
#[test]
fn lesions_of_a_label_map_are_lesions_with_its_outline() {
    const OTHER_MM: [f64; 3] = [70.0, 0.0, -20.0];
    let mut solids = chest();
    solids.push(Solid(ellipsoid(OTHER_MM, [NODULE_RADIUS_MM; 3]), 40.0));
    let volume = render(&solids, grid());
    let [nx, ny, _] = SIZE;
    let label = |at: usize| {
        let index = [at % nx, at / nx % ny, at / (nx * ny)].map(|each| each as f64);
        let place = volume.grid.ct_from_index(&Point3::from(index)).coords / MM;
        let near = |at_mm: [f64; 3]| (place - Vector3::from(at_mm)).norm() <= NODULE_RADIUS_MM;
        u16::from(near(NODULE_MM) || near(OTHER_MM)) * 7
    };
    let mut options = options();
    options.lesions = vec![seed("pointed_at", NODULE_MM)];
    options.labels = Some(LabelMap {
        labels: (0..volume.hu.len()).map(label).collect(),
        grid: volume.grid.clone(),
        names: vec![(7, "lung_nodules".to_owned())],
    });
    let made = run(&volume, &options).unwrap();
    let mut names: Vec<&str> = made
        .lesions
        .iter()
        .map(|each| each.lesion.name.as_str())
        .collect();
    names.sort_unstable();
    assert_eq!(names, ["lung_nodules_1", "pointed_at"]);
    assert!(remarks(&made).contains("lesions with its outlines: 2"));
    for each in &made.lesions {
        let size = each.size.as_ref().unwrap();
        let at_mm = if each.lesion.name == "pointed_at" {
            NODULE_MM
        } else {
            OTHER_MM
        };
        let error = size.centroid_m - Point3::from(at_mm) * MM;
        assert!(error.norm() < 0.5 * MM && each.lesion.in_lung, "{error}");
        let sigma_m = size.centroid_covariance_m2[(2, 2)].sqrt();
        assert!((0.5 * MM..0.7 * MM).contains(&sigma_m), "{sigma_m}");
        assert!(
            made.labels
                .names
                .iter()
                .any(|(_, name)| *name == each.lesion.name)
        );
    }
    assert!(
        made.labels
            .names
            .iter()
            .all(|(_, name)| name != "lung_nodules")
    );
}

/// 150 blocks of 8 voxels, one of 27 and one of a single voxel, 4 voxels apart in the right half.
fn noise([i, j, k]: [usize; 3]) -> bool {
    const PER_ROW: usize = 16;
    let (block, at) = ([i / 4, j / 4], [i % 4, j % 4, k % 4]);
    let number = block[1] * PER_ROW + block[0];
    let side = match number {
        0 => 3,
        1 => 1,
        _ => 2,
    };
    block[0] < PER_ROW && number < 152 && k / 4 == 5 && at.iter().all(|&each| each < side)
}

#[test]
fn of_many_lesions_of_a_map_the_largest_are_taken() {
    let volume = render(&chest(), grid());
    let [nx, ny, _] = SIZE;
    let label = |at: usize| u16::from(noise([at % nx, at / nx % ny, at / (nx * ny)]));
    let mut options = options();
    let labels: Vec<u16> = (0..volume.hu.len()).map(label).collect();
    // The seed is in the last of all.
    let index = [28.0, 36.0, 20.0];
    let point_m = volume.grid.ct_from_index(&Point3::from(index));
    options.lesions = vec![LesionSeed {
        name: "pointed_at".to_owned(),
        point_m,
    }];
    options.labels = Some(LabelMap {
        labels,
        grid: volume.grid.clone(),
        names: vec![(1, "tumor".to_owned())],
    });
    let made = run(&volume, &options).unwrap();
    assert_eq!(made.lesions.len(), 100);
    let said = remarks(&made);
    assert!(said.contains("it has 151 separate lesions"), "{said}");
    assert!(said.contains("51 are omitted"), "{said}");
    assert!(
        said.contains("1 parts of lesions with less than 8"),
        "{said}"
    );
    let has = |name: &str| made.lesions.iter().any(|each| each.lesion.name == name);
    assert!(has("pointed_at"));
    // In the order of the data, which the 27 voxels begin.
    let first = &made.lesions[0].lesion;
    assert_eq!((first.name.as_str(), first.mask.count()), ("tumor_1", 27));
    let cancelled = AtomicBool::new(true);
    let stopped = reconstruct(&volume, &options, 1, &cancelled, &|_, _| {});
    assert_eq!(stopped.unwrap_err(), VolumeError::Interrupted);
}

#[test]
fn lesions_have_labels_where_a_map_uses_all_below_a_thousand() {
    let volume = render(&chest(), grid());
    let count = volume.hu.len();
    let mut labels = vec![0; count];
    // Outside of the body, where they hide nothing.
    for (label, place) in (100..1100).zip(&mut labels) {
        *place = label;
    }
    let mut options = options();
    options.lesions = vec![seed("nodule", NODULE_MM)];
    options.labels = Some(LabelMap {
        labels,
        grid: volume.grid.clone(),
        names: (100..1100)
            .map(|label| (label, format!("parcel {label}")))
            .collect(),
    });
    let made = run(&volume, &options).unwrap();
    let voxels = voxels_of(&made, &["nodule"])
        .into_iter()
        .filter(|&is| is)
        .count();
    assert_eq!(voxels, made.lesions[0].lesion.mask.count());
    let bone = voxels_of(&made, &["bone"])
        .into_iter()
        .filter(|&is| is)
        .count();
    assert!(bone > 1000, "{bone}");
}
