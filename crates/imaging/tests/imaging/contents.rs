//! Blood with contrast medium, cartilage, gas and lungs that are not as usual, in a chest of analytic solids.

use nalgebra::Point3;
use needlebench_imaging::{Label, Reconstruction, Side};
use needlebench_numerics::random::SplitMix64;
use needlebench_volume::{SurfaceTissue, Volume, VoxelGrid};

use super::reconstruct::{Inside, Solid, chest, grid, label_at, options, render, run};

fn ball(at: [f64; 3], radius: f64, hu: f64) -> Solid {
    Solid(
        Box::new(move |p| (p - nalgebra::Vector3::from(at)).norm() <= radius),
        hu,
    )
}

fn ml(made: &Reconstruction, label: Label) -> f64 {
    let voxel_ml = 1e6 * made.labels.grid.steps_m().determinant().abs();
    let count = made.labels.labels.iter().filter(|&&at| at == label as u16);
    count.count() as f64 * voxel_ml
}

fn said(made: &Reconstruction, words: &str) -> bool {
    made.remarks
        .iter()
        .any(|remark| remark.message.contains(words))
}

const HEART_MM: f64 = 19.0;
const AORTA_MM: f64 = 11.0;

/// A heart, and an aorta that touches the front of the spine.
fn blood(hu: f64) -> [Solid; 2] {
    [
        ball([0.0, -20.0, 0.0], HEART_MM, hu),
        Solid(
            Box::new(|p| libm::hypot(p.x + 4.0, p.y - 38.0) <= AORTA_MM),
            hu,
        ),
    ]
}

#[test]
fn blood_with_contrast_medium_that_touches_the_spine_is_no_bone() {
    let plain = run(&render(&chest(), grid()), &options()).unwrap();
    let bone_ml = ml(&plain, Label::Bone);
    assert_eq!(ml(&plain, Label::ContrastVessels), 0.0);
    let height_mm = 64.0 * 3.0;
    let pi = std::f64::consts::PI;
    let wanted_ml = 1e-3 * pi * (4.0 / 3.0 * HEART_MM.powi(3) + AORTA_MM * AORTA_MM * height_mm);
    // Also where the least density of bone is in the middle of its noise.
    for (hu, noise) in [(190.0, 21), (250.0, 0), (300.0, 0), (400.0, 0), (500.0, 0)] {
        let mut solids = chest();
        solids.extend(blood(hu));
        let mut volume = render(&solids, grid());
        let mut random = SplitMix64::new(1);
        for value in &mut volume.hu {
            *value += i16::try_from(random.next_u64() % (2 * noise + 1)).unwrap();
            *value -= i16::try_from(noise).unwrap();
        }
        let made = run(&volume, &options()).unwrap();
        let (found, bone) = (ml(&made, Label::ContrastVessels), ml(&made, Label::Bone));
        assert!(
            (found / wanted_ml - 1.0).abs() < 0.1,
            "{hu} HU: {found} of {wanted_ml} ml"
        );
        assert!(
            (bone / bone_ml - 1.0).abs() < 0.06,
            "{hu} HU: {bone} of {bone_ml} ml of bone"
        );
        assert!(said(&made, "density of contrast-enhanced blood"));
    }
}

#[test]
fn dense_marrow_in_its_shell_is_bone() {
    // Between heart and spine, where pools are looked for.
    const MIDDLE_MM: f64 = 20.0;
    let within =
        |radius: f64| -> Inside { Box::new(move |p| libm::hypot(p.x, p.y - MIDDLE_MM) <= radius) };
    for hu in [220.0, 300.0, 400.0] {
        for has_shell in [true, false] {
            let mut solids = chest();
            solids.push(ball([0.0, -25.0, 0.0], HEART_MM, hu));
            if has_shell {
                solids.push(Solid(within(17.0), 800.0));
            }
            solids.push(Solid(within(13.0), hu));
            let made = run(&render(&solids, grid()), &options()).unwrap();
            let wanted = if has_shell {
                Label::Bone
            } else {
                Label::ContrastVessels
            };
            let found = label_at(&made, [0.0, MIDDLE_MM, 0.0]);
            assert_eq!(found, wanted as u16, "{hu} HU, shell {has_shell}");
            let heart = label_at(&made, [0.0, -25.0, 0.0]);
            assert_eq!(heart, Label::ContrastVessels as u16, "{hu} HU");
        }
    }
}

/// Without what is to the left of a plane.
fn cut_left(volume: &Volume, from: usize) -> Volume {
    let [nx, ny, nz] = volume.grid.size();
    let rows = volume.hu.chunks_exact(nx);
    Volume {
        grid: VoxelGrid::new(
            [from, ny, nz],
            *volume.grid.steps_m(),
            volume.grid.ct_from_index(&Point3::origin()),
        )
        .unwrap(),
        hu: rows.flat_map(|row| row[..from].to_vec()).collect(),
        slice_thickness_m: None,
    }
}

#[test]
fn a_lung_in_a_narrow_field_of_view_keeps_its_side() {
    let mut solids = chest();
    // Ribs at the right side are denser than what is seen of the spine.
    solids.push(Solid(
        Box::new(|p| {
            let wall = libm::hypot(p.x / 140.0, p.y / 92.0);
            (0.93..1.0).contains(&wall) && p.x < -60.0
        }),
        700.0,
    ));
    let whole = render(&solids, grid());
    // The grid's middle is the body's: with the spine, and without it.
    for columns in [86, 66, 60] {
        let made = run(&cut_left(&whole, columns), &options()).unwrap();
        let lungs = &made.segmentation.lungs.lungs;
        assert!(
            matches!(&lungs[..], [lung] if lung.side == Side::Right),
            "{columns} columns: {:?}",
            made.remarks
        );
    }
}

/// A sternum, and a cartilage from it to the end of a rib on either side, in the wall in front of the lungs.
fn sternum_and_cartilages(hu: f64) -> Vec<Solid> {
    // Along an ellipse in the wall.
    let along = |x: f64| -84.0 * (1.0 - (x / 134.0).powi(2)).sqrt();
    let mut solids = vec![Solid(
        Box::new(|p| p.x.abs() < 16.0 && (-88.0..-78.0).contains(&p.y) && p.z.abs() < 70.0),
        500.0,
    )];
    for z in [-40.0, 0.0, 40.0] {
        let near = move |p: &nalgebra::Vector3<f64>| {
            libm::hypot(p.y - along(p.x.abs().min(133.0)), p.z - z) <= 7.0
        };
        solids.push(Solid(
            Box::new(move |p| (14.0..75.0).contains(&p.x.abs()) && near(p)),
            hu,
        ));
        solids.push(Solid(
            Box::new(move |p| (75.0..110.0).contains(&p.x.abs()) && near(p)),
            600.0,
        ));
    }
    solids
}

#[test]
fn costal_cartilage_is_found_between_rib_and_sternum() {
    let mut solids = chest();
    solids.extend(sternum_and_cartilages(105.0));
    let made = run(&render(&solids, grid()), &options()).unwrap();
    let at = |x: f64, z: f64| [x, -84.0 * (1.0 - (x / 134.0).powi(2)).sqrt(), z];
    for z in [-40.0, 0.0, 40.0] {
        for x in [-60.0, -35.0, 35.0, 60.0] {
            assert_eq!(
                label_at(&made, at(x, z)),
                Label::Cartilage as u16,
                "{x} {z}"
            );
        }
        assert_eq!(label_at(&made, at(90.0, z)), Label::Bone as u16);
    }
    // Between two of them is muscle.
    assert_eq!(label_at(&made, at(45.0, 20.0)), Label::SoftTissue as u16);
    let surface = made
        .surfaces
        .iter()
        .find(|surface| surface.name == "costal_cartilages");
    assert_eq!(surface.unwrap().tissue, SurfaceTissue::Bone);
    assert!(!said(&made, "hardly any costal cartilage"));
    // As dense as muscle it is not seen, which is said.
    let mut solids = chest();
    solids.extend(sternum_and_cartilages(45.0));
    let made = run(&render(&solids, grid()), &options()).unwrap();
    assert_eq!(ml(&made, Label::Cartilage), 0.0);
    assert!(said(&made, "hardly any costal cartilage"));
}

/// A trachea between the lungs.
fn trachea() -> Solid {
    Solid(
        Box::new(|p| libm::hypot(p.x, p.y - 20.0) <= 8.0 && p.z > 20.0),
        -1000.0,
    )
}

#[test]
fn gas_in_a_stomach_is_neither_airway_nor_lung() {
    let mut solids = chest();
    solids.push(trachea());
    // 18 ml beneath the left lung, in front.
    let (at, axes) = ([25.0, -60.0, -72.0], [15.0, 14.0, 20.0]);
    solids.push(Solid(
        Box::new(move |p| {
            (p - nalgebra::Vector3::from(at))
                .component_div(&nalgebra::Vector3::from(axes))
                .norm()
                <= 1.0
        }),
        -990.0,
    ));
    let made = run(&render(&solids, grid()), &options()).unwrap();
    assert_eq!(label_at(&made, at), Label::Gas as u16);
    assert_eq!(label_at(&made, [0.0, 20.0, 50.0]), Label::Airways as u16);
    assert!(ml(&made, Label::Airways) < 20.0);
}

#[test]
fn air_without_lung_is_kept_apart_and_said() {
    let mut solids = chest();
    solids.push(trachea());
    // A pneumothorax: the front of the left lung.
    solids.push(Solid(
        Box::new(|p| {
            let lung = nalgebra::Vector3::new((p.x - 72.0) / 52.0, p.y / 68.0, p.z / 80.0);
            lung.norm() <= 1.0 && p.y < -25.0
        }),
        -1000.0,
    ));
    let made = run(&render(&solids, grid()), &options()).unwrap();
    assert_eq!(label_at(&made, [72.0, -45.0, 0.0]), Label::NoLung as u16);
    assert_eq!(label_at(&made, [72.0, 20.0, 0.0]), Label::LungLeft as u16);
    assert_eq!(
        label_at(&made, [-72.0, -45.0, 0.0]),
        Label::LungRight as u16
    );
    assert!(
        said(&made, "on the patient's left side; bullae"),
        "{:?}",
        made.remarks
    );
}

#[test]
fn a_single_lung_across_the_midline_is_not_cut_in_two() {
    // The right lung was taken out; the left one reaches over in front of the heart.
    let mut solids = chest();
    solids.push(Solid(
        Box::new(|p| {
            let lung = nalgebra::Vector3::new((p.x + 72.0) / 52.0, p.y / 68.0, p.z / 80.0);
            lung.norm() <= 1.02 && p.y > -20.0
        }),
        20.0,
    ));
    solids.push(Solid(
        Box::new(|p| p.x.abs() < 50.0 && (-50.0..-22.0).contains(&p.y) && p.z.abs() < 40.0),
        -850.0,
    ));
    let made = run(&render(&solids, grid()), &options()).unwrap();
    let lungs = &made.segmentation.lungs.lungs;
    assert!(matches!(&lungs[..], [lung] if lung.side == Side::Left));
    assert!(said(&made, "taken for a single lung"));
    assert!(said(&made, "routes stay out of its half"));
}

#[test]
fn a_lung_that_is_much_smaller_than_the_other_is_said() {
    let mut solids = chest();
    // An effusion fills its back.
    solids.push(Solid(
        Box::new(|p| {
            let lung = nalgebra::Vector3::new((p.x - 72.0) / 52.0, p.y / 68.0, p.z / 80.0);
            lung.norm() <= 1.02 && p.y > -5.0
        }),
        10.0,
    ));
    let made = run(&render(&solids, grid()), &options()).unwrap();
    assert!(said(&made, "lung_left has 0."), "{:?}", made.remarks);
    assert!(said(&made, "effusion"));
}
