//! Matching against what was made up, and its refusals.

use nalgebra::{Translation3, UnitQuaternion};
use needlebench_kinematics::Pose;
use needlebench_numerics::random::NormalPairs;

use super::*;

/// The shipped phantom's eight, roughly.
const EIGHT_MM: [[f64; 3]; 8] = [
    [-45.0, -80.0, 91.0],
    [67.0, -70.0, 78.0],
    [-100.0, -52.0, 34.0],
    [106.0, -43.0, 9.0],
    [-119.0, -9.0, -28.0],
    [120.0, 0.0, 51.0],
    [19.0, -86.0, -71.0],
    [-65.0, -74.0, -48.0],
];

fn places(mm: &[[f64; 3]]) -> Vec<Point3<f64>> {
    mm.iter()
        .map(|p| Point3::from(Vector3::from(*p) / 1e3))
        .collect()
}

fn known(mm: &[[f64; 3]]) -> Vec<ReferenceMarker> {
    places(mm)
        .into_iter()
        .enumerate()
        .map(|(k, at)| ReferenceMarker::from_cad(format!("marker_{}", k + 1), at, 1e-4))
        .collect()
}

fn pose() -> Pose {
    let rotation = UnitQuaternion::from_euler_angles(0.3, -0.2, 2.5);
    Pose::from_parts(Translation3::new(0.1, -0.4, 0.2), rotation)
}

/// The known ones of this order, seen with 0.03 mm.
fn seen(mm: &[[f64; 3]], order: &[usize], random: &mut NormalPairs) -> Vec<Localised> {
    let places = places(mm);
    order
        .iter()
        .map(|&k| {
            let noise = Vector3::from_fn(|_, _| 3e-5 * random.next_normal());
            Localised::isotropic(pose().inverse() * places[k] + noise, 3e-5)
        })
        .collect()
}

fn pairs_of(order: &[usize]) -> Vec<MatchedPair> {
    let mut pairs: Vec<_> = order
        .iter()
        .enumerate()
        .map(|(detected, &reference)| MatchedPair {
            reference,
            detected,
        })
        .collect();
    pairs.sort();
    pairs
}

fn message(error: &VolumeError) -> String {
    error.to_string()
}

#[test]
fn any_order_with_missing_and_false_ones_is_found() {
    let mut random = NormalPairs::new(1);
    let reference = known(&EIGHT_MM);
    for order in [
        vec![7, 2, 5, 0, 1, 4, 3, 6],
        vec![6, 1, 3, 0],
        vec![4, 7, 2],
    ] {
        let mut detected = seen(&EIGHT_MM, &order, &mut random);
        for _ in 0..4 {
            let false_one = Point3::from(Vector3::from_fn(|_, _| random.uniform(-0.5, 0.5)));
            detected.push(Localised::isotropic(false_one, 3e-5));
        }
        let found = match_markers(&detected, &reference, &MatchOptions::default()).unwrap();
        assert_eq!(found.pairs, pairs_of(&order));
        assert_eq!(found.missing.len(), 8 - order.len());
        assert_eq!(
            found.unknown,
            (order.len()..order.len() + 4).collect::<Vec<_>>()
        );
        // Three of eight fit in more than one way, and are said to.
        let certain = found.second_best.is_none_or(|s| s.separation_sigmas > 3.0);
        assert_eq!(certain, order.len() > 3);
    }
}

#[test]
fn a_symmetric_set_is_refused_and_a_nearly_symmetric_one_warned_of() {
    let mut random = NormalPairs::new(2);
    let mut square = [
        [0.0, 0.0, 0.0],
        [50.0, 0.0, 0.0],
        [50.0, 50.0, 0.0],
        [0.0, 50.0, 0.0],
    ];
    let detect = |mm: &[[f64; 3]], random: &mut NormalPairs| {
        match_markers(
            &seen(mm, &[0, 1, 2, 3], random),
            &known(mm),
            &MatchOptions::default(),
        )
    };
    let refusal = message(&detect(&square, &mut random).unwrap_err());
    assert!(refusal.contains("another match is only"), "{refusal}");
    square[2][0] += 1.6;
    let warned = detect(&square, &mut random).unwrap();
    assert_eq!(warned.pairs, pairs_of(&[0, 1, 2, 3]));
    let second = warned.second_best.unwrap().separation_sigmas;
    assert!((1.0..3.0).contains(&second), "{second}");
    assert!(
        warned
            .remarks
            .iter()
            .any(|r| r.message.contains("ambiguous"))
    );
    square[2][0] += 15.0;
    let clear = detect(&square, &mut random).unwrap();
    assert!(clear.second_best.unwrap().separation_sigmas > 3.0);
    // Flat, so its mirror image is a turn of itself.
    assert!(
        clear
            .remarks
            .iter()
            .any(|r| r.message.contains("mirror-symmetric"))
    );
}

#[test]
fn a_regular_grid_does_not_take_forever() {
    let grid: Vec<[f64; 3]> = (0..25)
        .map(|k| [30.0 * f64::from(k % 5), 30.0 * f64::from(k / 5), 0.0])
        .collect();
    let order: Vec<usize> = (0..25).collect();
    let detected = seen(&grid, &order, &mut NormalPairs::new(3));
    let refusal = match_markers(&detected, &known(&grid), &MatchOptions::default()).unwrap_err();
    assert!(
        message(&refusal).contains("another match is only")
            || message(&refusal).contains("too many ways")
    );
}

#[test]
fn a_mirrored_volume_is_refused_and_said_so() {
    let order = [0, 1, 2, 3, 4, 5, 6, 7];
    let detected: Vec<_> = seen(&EIGHT_MM, &order, &mut NormalPairs::new(4))
        .iter()
        .map(mirrored)
        .collect();
    let refusal =
        match_markers(&detected, &known(&EIGHT_MM), &MatchOptions::default()).unwrap_err();
    assert!(
        message(&refusal).contains("left and right exchanged"),
        "{refusal}"
    );
}

#[test]
fn what_cannot_be_matched_is_refused() {
    let mut random = NormalPairs::new(5);
    let reference = known(&EIGHT_MM);
    let options = MatchOptions::default();
    let two = seen(&EIGHT_MM, &[0, 1], &mut random);
    assert!(
        message(&match_markers(&two, &reference, &options).unwrap_err()).contains("fewer than 3")
    );
    let line = known(&[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [35.0, 0.0, 0.0]]);
    let three = seen(&EIGHT_MM, &[0, 1, 2], &mut random);
    assert!(message(&match_markers(&three, &line, &options).unwrap_err()).contains("on a line"));
    // Metres taken for millimetres.
    let wrong_unit: Vec<_> = seen(&EIGHT_MM, &[0, 1, 2, 3], &mut random)
        .into_iter()
        .map(|p| Localised {
            at_m: p.at_m * 1e3,
            ..p
        })
        .collect();
    assert!(match_markers(&wrong_unit, &reference, &options).is_err());
    let mut bad = seen(&EIGHT_MM, &[0, 1, 2, 3], &mut random);
    bad[1].covariance_m2[(0, 0)] = f64::NAN;
    assert!(match_markers(&bad, &reference, &options).is_err());
    let many = vec![two[0]; 65];
    assert!(match_markers(&many, &reference, &options).is_err());
}

#[test]
fn a_marker_far_from_its_place_is_missing_and_the_remark_says_where_it_may_be() {
    let mut reference = known(&EIGHT_MM);
    reference[4].center_m.z += 0.009;
    let order = [0, 1, 2, 3, 4, 5, 6, 7];
    let detected = seen(&EIGHT_MM, &order, &mut NormalPairs::new(6));
    let found = match_markers(&detected, &reference, &MatchOptions::default()).unwrap();
    assert_eq!((found.missing, found.unknown), (vec![4], vec![4]));
    let remark = found
        .remarks
        .iter()
        .find(|r| r.place.as_deref() == Some("marker_5"))
        .unwrap();
    assert!(
        remark.message.contains("detected 5 is 9.0 mm from there"),
        "{}",
        remark.message
    );
}

#[test]
fn wide_covariances_along_z_still_match() {
    let order = [3, 1, 7, 0, 2, 6, 5, 4];
    let mut random = NormalPairs::new(7);
    let mut detected = seen(&EIGHT_MM, &order, &mut random);
    for marker in &mut detected {
        marker.covariance_m2[(2, 2)] = 1.5e-3_f64.powi(2);
        marker.at_m.z += 1.5e-3 * random.next_normal();
    }
    let found = match_markers(&detected, &known(&EIGHT_MM), &MatchOptions::default()).unwrap();
    assert_eq!(found.pairs, pairs_of(&order));
}
