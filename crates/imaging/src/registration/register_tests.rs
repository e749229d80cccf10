//! Registrations of made-up markers: what they say of moved ones, and that their error is the simulated one.

use nalgebra::{Translation3, UnitQuaternion};
use needlebench_numerics::random::NormalPairs;

use super::*;
use crate::registration::MatchedPair;

const PLACES_MM: [[f64; 3]; 6] = [
    [-45.0, -80.0, 91.0],
    [67.0, -70.0, 78.0],
    [-100.0, -52.0, 34.0],
    [106.0, -43.0, 9.0],
    [19.0, -86.0, -71.0],
    [-65.0, -74.0, -48.0],
];

fn pose() -> Pose {
    let rotation = UnitQuaternion::from_euler_angles(0.3, -0.2, 2.5);
    Pose::from_parts(Translation3::new(0.1, -0.4, 0.2), rotation)
}

fn in_order(count: usize) -> MarkerMatch {
    MarkerMatch {
        pairs: (0..count)
            .map(|k| MatchedPair {
                reference: k,
                detected: k,
            })
            .collect(),
        missing: Vec::new(),
        unknown: Vec::new(),
        chi_square: 0.0,
        second_best: None,
        remarks: Vec::new(),
    }
}

/// Detected to 0.03 mm across and 0.1 mm along z, touched to 0.2 mm.
fn drawn(count: usize, random: &mut NormalPairs) -> (Vec<Localised>, Vec<ReferenceMarker>) {
    let slices = Vector3::new(3e-5, 3e-5, 1e-4);
    PLACES_MM[..count]
        .iter()
        .enumerate()
        .map(|(k, mm)| {
            let at = Point3::from(Vector3::from(*mm) / 1e3);
            let seen = at + slices.map(|s| s * random.next_normal());
            let touched = pose() * at + Vector3::from_fn(|_, _| 2e-4 * random.next_normal());
            let covariance = Matrix3::from_diagonal(&slices.map(|s| s * s));
            (
                Localised {
                    at_m: seen,
                    covariance_m2: covariance,
                },
                ReferenceMarker::touched(
                    format!("marker_{}", k + 1),
                    touched,
                    Matrix3::identity() * 4e-8,
                ),
            )
        })
        .unzip()
}

fn registered(detected: &[Localised], reference: &[ReferenceMarker]) -> Registration {
    register_weighted(
        &in_order(detected.len()),
        detected,
        reference,
        ReferenceFrame::Robot,
    )
    .unwrap()
}

#[test]
fn error_at_the_target_is_the_simulated_one() {
    const SAMPLES: usize = 2000;
    let mut random = NormalPairs::new(8);
    let target = Point3::new(0.03, 0.02, 0.01);
    let (mut seen, mut predicted, mut alarms) = (0.0, 0.0, 0);
    for _ in 0..SAMPLES {
        let (detected, reference) = drawn(6, &mut random);
        let registration = registered(&detected, &reference);
        let tre = registration.tre(&target);
        seen += (tre.at_m - pose() * target).norm_squared();
        predicted += tre.rms_m * tre.rms_m;
        alarms += usize::from(!registration.suspects.is_empty());
    }
    let ratio = (seen / predicted).sqrt();
    println!("simulated over predicted {ratio:.4}, false alarms {alarms} of {SAMPLES}");
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    // One in a hundred by construction (the bound of Bonferroni), and five standard deviations of its count.
    assert!(alarms < SAMPLES / 100 + 23, "{alarms}");
}

#[test]
fn the_moved_marker_is_named() {
    let mut random = NormalPairs::new(9);
    let mut named = 0;
    for trial in 0..30 {
        let (detected, mut reference) = drawn(6, &mut random);
        let moved = trial % 6;
        reference[moved].center_m += Vector3::new(1.5e-3, -1e-3, 1e-3);
        let registration = registered(&detected, &reference);
        let name = format!("marker_{}", moved + 1);
        assert!(
            registration.suspects.contains(&name),
            "{:?}",
            registration.suspects
        );
        if registration.suspects.len() == 1 {
            named += 1;
            let remark = registration
                .remarks
                .iter()
                .find(|r| r.place.as_deref() == Some(&name))
                .unwrap();
            assert!(remark.message.contains("it has moved"));
        }
        let left = registration.markers[moved].leave_one_out.unwrap();
        assert!(left.probability < 1e-3);
        assert!((0..3).any(|k| left.error_m[k].abs() > left.interval_m[k]));
    }
    assert!(named >= 25, "{named} of 30");
}

#[test]
fn few_markers_say_what_they_cannot_tell() {
    let mut random = NormalPairs::new(10);
    let (detected, mut reference) = drawn(4, &mut random);
    let three = registered(&detected[..3], &reference[..3]);
    assert!(three.markers.iter().all(|m| m.leave_one_out.is_none()));
    assert!(
        three
            .remarks
            .iter()
            .any(|r| r.message.contains("a fourth is required"))
    );
    reference[1].center_m.x += 4e-3;
    let four = registered(&detected, &reference);
    assert!(
        four.suspects.contains(&"marker_2".to_owned()),
        "{:?}",
        four.suspects
    );
}

#[test]
fn errors_stated_too_small_are_said_to_be() {
    let mut random = NormalPairs::new(11);
    let (mut detected, mut reference) = drawn(6, &mut random);
    let mut said = 0;
    for _ in 0..10 {
        (detected, reference) = drawn(6, &mut random);
        for (a, b) in detected.iter_mut().zip(&mut reference) {
            a.covariance_m2 /= 25.0;
            b.covariance_m2 /= 25.0;
        }
        let registration = registered(&detected, &reference);
        assert!(registration.probability < 0.01);
        said += usize::from(
            registration
                .remarks
                .iter()
                .any(|r| r.message.contains("too small")),
        );
    }
    assert!(said >= 8, "{said}");
    let nothing = register_weighted(&in_order(7), &detected, &reference, ReferenceFrame::Robot);
    assert!(
        nothing
            .unwrap_err()
            .to_string()
            .contains("not both in the lists")
    );
}

#[test]
fn markers_on_a_line_as_far_as_they_are_known_are_refused() {
    let line: Vec<_> = [[0.0, 0.0, 0.0], [0.05, 0.0, 2e-4], [0.1, 0.0, 0.0]]
        .iter()
        .map(|&p| Localised::isotropic(Point3::from(p), 2e-4))
        .collect();
    let reference: Vec<_> = line
        .iter()
        .map(|p| ReferenceMarker::from_cad("m", p.at_m, 1e-4))
        .collect();
    let refusal = register_weighted(&in_order(3), &line, &reference, ReferenceFrame::Phantom);
    assert!(
        refusal
            .unwrap_err()
            .to_string()
            .contains("do not determine the rotation")
    );
}

#[test]
fn what_is_written_is_read_again() {
    let (detected, reference) = drawn(5, &mut NormalPairs::new(12));
    let registration = registered(&detected, &reference);
    let text = serde_json::to_string(&registration).unwrap();
    assert!(
        text.contains(r#""frame":"robot""#) && text.contains("rotation_quat_wxyz"),
        "{text}"
    );
    let again: Registration = serde_json::from_str(&text).unwrap();
    let target = Point3::new(0.01, 0.02, 0.03);
    assert!((again.tre(&target).at_m - registration.tre(&target).at_m).norm() < 1e-15);
    assert_eq!(again.markers, registration.markers);
    assert!(
        serde_json::from_str::<Registration>(
            &text.replace("\"rotation_quat_wxyz\":[", "\"rotation_quat_wxyz\":[9")
        )
        .is_err()
    );
}
