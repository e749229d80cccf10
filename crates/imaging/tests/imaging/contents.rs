//! Blood with contrast medium in a chest of analytic solids.

use nalgebra::Point3;
use needlebench_imaging::{Label, Reconstruction};

use super::reconstruct::{MM, Solid, chest, grid, options, render, run};

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

fn label_at(made: &Reconstruction, at_mm: [f64; 3]) -> u16 {
    let grid = &made.labels.grid;
    let index = grid.index_from_ct(&(Point3::from(at_mm) * MM));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a voxel of the grid"
    )]
    let voxel = [index.x, index.y, index.z].map(|at| at.round() as usize);
    made.labels.labels[grid.offset(voxel)]
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
    for hu in [250.0, 300.0, 400.0, 500.0] {
        let mut solids = chest();
        solids.extend(blood(hu));
        let made = run(&render(&solids, grid()), &options()).unwrap();
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
    for hu in [220.0, 300.0, 400.0] {
        let mut solids = chest();
        solids.push(Solid(
            Box::new(|p| libm::hypot(p.x, p.y - 66.0) <= 13.0),
            hu,
        ));
        let made = run(&render(&solids, grid()), &options()).unwrap();
        assert_eq!(ml(&made, Label::ContrastVessels), 0.0, "{hu} HU");
        assert_eq!(label_at(&made, [0.0, 66.0, 0.0]), Label::Bone as u16);
    }
}
