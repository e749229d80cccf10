//! Vectors against scalars, fast against careful, families against scans.

use std::f64::consts::PI;

use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use needlebench_numerics::random::SplitMix64;

use super::super::{Elbow, wrap_angle};
use super::*;
use crate::pose_sets::{PoseSet, rounded_to_f32};
use crate::{JointLimit, rotation_angle_between};

const UR3: UrGeometry = UrGeometry::UR3;

/// Twice the worst residual seen over 1e6 generic and singular poses, m and rad: rounding of the
/// rows and of this check's forward kinematics.
const RESIDUAL: f64 = 1e-14;

/// The two paths differ by the order of two roundings; conditioning within the fast path's bounds
/// raises that to this, rad.
const PATHS_AGREE_RAD: f64 = 1e-10;

const ASKED: Asked<'_> = Asked {
    geometry: &UR3,
    preference: Preference {
        seed: None,
        limits: None,
    },
    tolerance: Tolerance::ROUNDING,
};

fn careful(pose: &Pose) -> ClosedForm {
    let mut out = ClosedForm::BLANK;
    careful::solve(&UR3, pose, ASKED.preference, ASKED.tolerance, &mut out);
    out
}

fn residual(pose: &Pose, q: &Joints) -> f64 {
    let found = UR3.base_from_flange(q);
    (found.translation.vector - pose.translation.vector)
        .norm()
        .max(rotation_angle_between(&found.rotation, &pose.rotation))
}

fn difference(a: &Joints, b: &Joints) -> f64 {
    (a - b).map(|d| wrap_angle(d).abs()).max()
}

/// Every level of vector instructions that this machine has.
fn levels() -> Vec<Level> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let narrower = [
        best.as_sse2().map(Simd::level),
        best.as_sse4_2().map(Simd::level),
        best.as_avx2().map(Simd::level),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let narrower: [Option<Level>; 0] = [];
    narrower
        .into_iter()
        .flatten()
        .chain([best, Level::baseline()])
        .collect()
}

fn solved(level: Level, pose: &Pose) -> ClosedForm {
    let mut out = ClosedForm::BLANK;
    solve_at(level, &ASKED, pose, &mut out);
    out
}

/// To the last bit: shards of a study are computed on machines of several kinds.
#[test]
fn all_widths_give_the_same_rows() {
    let mut random = SplitMix64::new(21);
    for set in PoseSet::ALL {
        for _ in 0..500 {
            let q = set.sample(&UR3, &mut random, 0.0);
            let pose = UR3.base_from_flange(&q);
            let reference = solved(Level::baseline(), &pose);
            for level in levels() {
                assert_eq!(solved(level, &pose), reference, "{set:?} {level:?}");
            }
        }
    }
}

#[test]
fn a_batch_gives_the_rows_of_single_poses() {
    let mut random = SplitMix64::new(22);
    // Not a multiple of any width, with singular poses in between.
    let poses: Vec<Pose> = (0..203)
        .map(|i| {
            let set = PoseSet::ALL[if i % 5 == 0 {
                i % PoseSet::ALL.len()
            } else {
                0
            }];
            UR3.base_from_flange(&set.sample(&UR3, &mut random, 0.0))
        })
        .collect();
    for level in levels() {
        let mut batch = vec![ClosedForm::BLANK; poses.len()];
        batch_at(level, &ASKED, &poses, &mut batch);
        for (pose, found) in poses.iter().zip(&batch) {
            assert_eq!(*found, solved(Level::baseline(), pose), "{level:?}");
        }
    }
}

#[test]
fn every_row_of_every_set_solves_its_pose() {
    let mut random = SplitMix64::new(23);
    for set in PoseSet::ALL {
        for away_rad in [0.0, 1e-9, 1e-7, 1e-5, 1e-3] {
            for single_precision in [false, true] {
                for _ in 0..100 {
                    let q = set.sample(&UR3, &mut random, away_rad);
                    let mut pose = UR3.base_from_flange(&q);
                    if single_precision {
                        pose = rounded_to_f32(&pose);
                    }
                    for row in closed_form(&UR3, &pose, Some(&q)).solutions() {
                        let residual = residual(&pose, &row.joints);
                        assert!(residual <= RESIDUAL, "{set:?} {away_rad:e}: {residual:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn the_posture_of_an_exactly_singular_pose_is_found() {
    // Rounding of a pose moves a double root by its square root.
    const DOUBLE_ROOT_RAD: f64 = 1e-6;
    let mut random = SplitMix64::new(24);
    for set in PoseSet::ALL {
        let (mut lost, count) = (0, 1000);
        for _ in 0..count {
            let q = set.sample(&UR3, &mut random, 0.0);
            let pose = UR3.base_from_flange(&q);
            let found = closed_form(&UR3, &pose, Some(&q));
            lost += usize::from(
                !found
                    .solutions()
                    .any(|row| difference(&row.joints, &q) < DOUBLE_ROOT_RAD),
            );
        }
        // Postures whose other singularity is near by chance lose more digits than the bound.
        assert!(lost <= count / 50, "{set:?}: {lost} of {count}");
    }
}

#[test]
fn the_careful_path_confirms_the_fast_one() {
    let mut random = SplitMix64::new(25);
    for _ in 0..3000 {
        let q = PoseSet::Generic.sample(&UR3, &mut random, 0.0);
        let pose = UR3.base_from_flange(&q);
        let fast = closed_form(&UR3, &pose, None);
        let careful = careful(&pose);
        assert_eq!(fast.certificate(), careful.certificate());
        assert_eq!(fast.exists, careful.exists);
        for (a, b) in fast.solutions().zip(careful.solutions()) {
            assert!(difference(&a.joints, &b.joints) < PATHS_AGREE_RAD);
        }
        assert_eq!(
            fast.count() as usize + fast.unreachable(&UR3, &pose).count(),
            8
        );
    }
}

/// The bounds under `CERTAIN_*` in `lanes`: what the fast path computes for poses at its edge is
/// off from extended precision by less than the margin that makes its signs certain.
#[test]
fn bounds_of_the_fast_path_hold() {
    let bounds = Bounds::new(&UR3, Tolerance::ROUNDING);
    let mut random = SplitMix64::new(26);
    let mut edge = 0;
    for _ in 0..20_000 {
        let set = PoseSet::ALL[1 + random.below(7) as usize];
        let away_rad = libm::pow(10.0_f64, random.uniform(-5.0, -2.0));
        let q = set.sample(&UR3, &mut random, away_rad);
        let pose = UR3.base_from_flange(&q);
        let mut fast = ClosedForm::BLANK;
        if !one_pose_at(*LEVEL, &UR3, &bounds, &pose, &mut fast) {
            continue;
        }
        edge += 1;
        let careful = careful(&pose);
        assert_eq!(fast.exists, careful.exists, "{q}");
        // sin q3 is off by the error of its square over twice itself.
        for row in fast.solutions() {
            assert!(residual(&pose, &row.joints) <= RESIDUAL);
        }
    }
    assert!(edge > 2000, "{edge} poses at the edge");
}

#[test]
fn a_pose_that_is_not_finite_has_no_rows() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut pose = UR3.base_from_flange(&Joints::repeat(0.4));
        pose.translation = Translation3::new(bad, 0.1, 0.2);
        let found = closed_form(&UR3, &pose, None);
        assert_eq!(found.count(), 0);
        assert!(
            found
                .unreachable(&UR3, &pose)
                .all(|(_, reason)| reason == Unreachable::NotFinite)
        );
        pose = UR3.base_from_flange(&Joints::repeat(0.4));
        pose.rotation = UnitQuaternion::new_unchecked(Quaternion::new(bad, 0.0, 0.0, 0.0));
        assert_eq!(closed_form(&UR3, &pose, None).count(), 0);
    }
}

#[test]
fn a_family_is_where_its_members_are() {
    let mut random = SplitMix64::new(27);
    let mut families = 0;
    for _ in 0..300 {
        let q = PoseSet::Wrist.sample(&UR3, &mut random, 0.0);
        let pose = UR3.base_from_flange(&q);
        let found = closed_form(&UR3, &pose, Some(&q));
        for shoulder in [Shoulder::Right, Shoulder::Left] {
            let Some(family) = found.free_wrist(&UR3, &pose, shoulder) else {
                continue;
            };
            families += 1;
            let inside = |q6: f64| {
                family.intervals_rad().any(|(from, to)| {
                    let turned = from + (q6 - from).rem_euclid(2.0 * PI);
                    turned <= to
                })
            };
            for step in 0..72 {
                let q6 = -PI + 0.01 + f64::from(step) * PI / 36.0;
                let member = family.member(Elbow::Up, q6);
                // Near the ends of an interval both may be right within rounding.
                let solves = residual(&pose, &member) < 1e-9;
                assert_eq!(solves, inside(q6), "{family:?} {q6}");
            }
            // The nearest is a member, and no reachable one is nearer.
            let wanted = random.uniform(-PI, PI);
            let nearest = family.nearest_q6(wanted).expect("the family is not empty");
            assert!(residual(&pose, &family.member(Elbow::Down, nearest)) < RESIDUAL);
            let distance = wrap_angle(nearest - wanted).abs();
            let nearer = (1..100).any(|step| {
                let ahead = distance * 0.99 * f64::from(step) / 100.0;
                inside(wanted + ahead) || inside(wanted - ahead)
            });
            assert!(distance < 1e-12 || !nearer);
        }
    }
    assert!(families > 100);
}

#[test]
fn a_free_wrist_keeps_joint_limits_where_it_can() {
    // Wrist 1 confined to a quarter turn.
    let wide = JointLimit {
        lower_rad: -2.0 * PI,
        upper_rad: 2.0 * PI,
        velocity_rad_s: 1.0,
        effort_nm: 1.0,
    };
    let mut limits = JointLimits([wide; 6]);
    limits.0[3].lower_rad = -1.0;
    limits.0[3].upper_rad = 0.5;
    let q = Joints::from_column_slice(&[0.3, -1.2, 1.4, -0.5, 0.0, 0.8]);
    let pose = UR3.base_from_flange(&q);
    let far = Joints::from_column_slice(&[0.3, -1.2, 1.4, 1.5, 0.0, 2.8]);
    let preference = Preference {
        seed: Some(&far),
        limits: Some(&limits),
    };
    let mut out = ClosedForm::BLANK;
    closed_form_into(&UR3, &pose, preference, &mut out);
    let inside = |row: &ClosedFormSolution| limits.first_violation(&row.joints).is_none();
    assert!(out.solutions().any(|row| inside(&row)));
    assert!(
        out.solutions()
            .all(|row| residual(&pose, &row.joints) < RESIDUAL)
    );
}

/// A row of a pose in few digits misses it by no more than was allowed, each of position and
/// orientation; a shoulder and an elbow that both touch add up.
const TOUCHING: f64 = 1.5;

#[test]
fn a_pose_in_single_precision_has_the_posture_that_made_it() {
    // At a double root a rounding of 1e-7 is its square root in the joints, and where two of them
    // meet its fourth root.
    const DOUBLE_ROOT_RAD: f64 = 5e-3;
    const FOURTH_ROOT_RAD: f64 = 0.1;
    let tolerance = Tolerance::default();
    let mut random = SplitMix64::new(28);
    for set in [PoseSet::Shoulder, PoseSet::Elbow, PoseSet::ElbowShoulder] {
        let (mut lost, mut touching, count) = (0, 0, 1000);
        for _ in 0..count {
            let q = set.sample(&UR3, &mut random, 0.0);
            let pose = rounded_to_f32(&UR3.base_from_flange(&q));
            let mut found = ClosedForm::BLANK;
            closed_form_within(&UR3, &pose, Preference::default(), tolerance, &mut found);
            for row in found.solutions() {
                let residual = residual(&pose, &row.joints);
                let allowed = if row.touching {
                    TOUCHING * tolerance.m
                } else {
                    RESIDUAL
                };
                assert!(residual <= allowed, "{set:?}: {residual:e}");
                touching += usize::from(row.touching);
            }
            let within = if set == PoseSet::ElbowShoulder {
                FOURTH_ROOT_RAD
            } else {
                DOUBLE_ROOT_RAD
            };
            lost += usize::from(
                !found
                    .solutions()
                    .any(|row| difference(&row.joints, &q) < within),
            );
        }
        assert!(touching > count / 4, "{set:?}: {touching}");
        assert!(lost <= count / 50, "{set:?}: {lost} of {count}");
    }
}

#[test]
fn rows_that_the_pose_denies_are_touching() {
    // Stretched, and half a micrometre farther.
    let q = Joints::from_column_slice(&[0.3, -1.2, 0.0, -0.5, 1.1, 0.8]);
    let mut pose = UR3.base_from_flange(&q);
    let beyond = (pose.translation.vector - Vector3::new(0.0, 0.0, UR3.d1)).normalize();
    pose.translation.vector += beyond * 5e-7;
    let mut found = ClosedForm::BLANK;
    let rows_within = |m: f64, found: &mut ClosedForm| {
        let tolerance = Tolerance { m, rad: 1e-9 };
        closed_form_within(&UR3, &pose, Preference::default(), tolerance, found);
        found
            .solutions()
            .filter(|row| difference(&row.joints, &q) < 0.01)
            .map(|row| row.touching)
            .collect::<Vec<_>>()
    };
    assert_eq!(rows_within(1e-7, &mut found), []);
    assert_eq!(rows_within(1e-6, &mut found), [true]);
    // Away from the edge nothing touches.
    let mut random = SplitMix64::new(29);
    for _ in 0..1000 {
        let pose = UR3.base_from_flange(&PoseSet::Generic.sample(&UR3, &mut random, 0.0));
        let tolerance = Tolerance::default();
        closed_form_within(&UR3, &pose, Preference::default(), tolerance, &mut found);
        let exact = closed_form(&UR3, &pose, None);
        let untouched = |found: &ClosedForm| found.exists & !found.touching;
        assert_eq!(untouched(&found), untouched(&exact));
    }
}

#[test]
fn a_position_out_of_this_world_and_no_rotation_are_no_pose() {
    let good = UR3.base_from_flange(&Joints::repeat(0.4));
    for far_m in [1e7, 1e160, 1e200, 1e300, f64::MAX] {
        let mut pose = good;
        pose.translation = Translation3::new(0.1, -far_m, 0.2);
        let found = closed_form(&UR3, &pose, None);
        assert_eq!(
            (found.count(), found.certificate()),
            (0, Certificate::NotAPose)
        );
        let reasons: Vec<_> = found.unreachable(&UR3, &pose).collect();
        assert!(reasons.len() == 8);
        assert!(
            reasons
                .iter()
                .all(|(_, reason)| reason.missing_m() == far_m)
        );
    }
    for norm in [0.0, 1e-200, 0.999, 1.001, 1.00001, 2.0, 1e200] {
        let mut pose = good;
        let scaled = good.rotation.into_inner() * norm;
        pose.rotation = UnitQuaternion::new_unchecked(scaled);
        let found = closed_form(&UR3, &pose, None);
        assert_eq!(
            (found.count(), found.certificate()),
            (0, Certificate::NotAPose),
            "{norm}"
        );
        let mut reasons = found.unreachable(&UR3, &pose);
        assert!(reasons.all(|(_, reason)| reason == Unreachable::NotARotation));
    }
    // A rounding of single precision is none of the rows' business.
    for norm in [1.0 - 5e-7, 1.0 + 1e-7, 1.0 + 5e-7] {
        let mut pose = good;
        pose.rotation = UnitQuaternion::new_unchecked(good.rotation.into_inner() * norm);
        let found = closed_form(&UR3, &pose, None);
        assert_eq!(found.certificate(), Certificate::Complete);
        assert!(
            found
                .solutions()
                .all(|row| residual(&good, &row.joints) < 10.0 * RESIDUAL)
        );
    }
}
