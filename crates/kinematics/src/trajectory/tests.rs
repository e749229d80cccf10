use super::*;
use crate::{UrGeometry, ik};
use nalgebra::{UnitVector3, Vector3};

fn limits() -> MotionLimits {
    MotionLimits {
        velocity: Joints::repeat(1.0),
        acceleration: Joints::repeat(1.4),
        jerk: Joints::repeat(10.0),
        line: ProfileLimits {
            velocity: 0.05,
            acceleration: 0.2,
            jerk: 1.0,
        },
    }
}

fn posture() -> Joints {
    Joints::from_column_slice(&[
        -0.735_08, -2.212_137, -1.882_823, 0.097_853, 1.274_286, 0.113_862,
    ])
}

fn motion() -> JointTrajectory {
    let chain = UrGeometry::UR3.chain();
    let down = UnitVector3::new_normalize(Vector3::new(0.2, 0.5, -0.8));
    let line = JointPath::line_ending_at(&chain, &posture(), &down, 0.08).unwrap();
    JointTrajectory::starting_at(Joints::from_column_slice(&[
        0.0, -1.5, -1.0, -1.5, 1.5, 0.0,
    ]))
    .then_straight_to(Phase::Transfer, line.start(), &limits())
    .then_along(Phase::Approach, line, &limits())
    .then_hold(Phase::Hold, 0.5)
}

/// Finite differences at 1e-4 s of a motion whose jerk is below 10 rad/s^3.
const DIFFERENCE_TOLERANCE: f64 = 2e-3;

#[test]
fn velocity_and_acceleration_are_the_derivatives_of_position() {
    let trajectory = motion();
    let h = 1e-4;
    for k in 1..400 {
        let t = trajectory.duration_s() * f64::from(k) / 400.0;
        let (before, at, after) = (
            trajectory.sample(t - h),
            trajectory.sample(t),
            trajectory.sample(t + h),
        );
        let velocity = (after.position - before.position) / (2.0 * h);
        let acceleration = (after.velocity - before.velocity) / (2.0 * h);
        assert!(
            (velocity - at.velocity).amax() < DIFFERENCE_TOLERANCE,
            "t = {t}"
        );
        assert!(
            (acceleration - at.acceleration).amax() < DIFFERENCE_TOLERANCE,
            "t = {t}"
        );
    }
}

#[test]
fn all_limits_are_kept_and_one_is_reached() {
    let (trajectory, limits) = (motion(), limits());
    let mut fastest: f64 = 0.0;
    for k in 0..=4000 {
        let state = trajectory.sample(trajectory.duration_s() * f64::from(k) / 4000.0);
        for i in 0..JOINT_COUNT {
            assert!(state.velocity[i].abs() <= limits.velocity[i] * (1.0 + 1e-9));
            assert!(state.acceleration[i].abs() <= limits.acceleration[i] * (1.0 + 1e-9));
            fastest = fastest.max(state.velocity[i].abs() / limits.velocity[i]);
        }
    }
    assert!(fastest > 0.99);
}

#[test]
fn the_flange_stays_on_the_line() {
    /// Ten times the worst deviation seen on this line.
    const DEVIATION_M: f64 = 1e-9;
    let chain = UrGeometry::UR3.chain();
    let direction = UnitVector3::new_normalize(Vector3::new(0.2, 0.5, -0.8));
    let path = JointPath::line_ending_at(&chain, &posture(), &direction, 0.2).unwrap();
    let end = chain.base_link_from_flange(&posture());
    for k in 0..=1000 {
        let s = 0.2 * f64::from(k) / 1000.0;
        let pose = chain.base_link_from_flange(&path.sample(s).position);
        let planned = end.translation.vector - direction.into_inner() * (0.2 - s);
        assert!((pose.translation.vector - planned).norm() < DEVIATION_M);
        assert!(crate::rotation_angle_between(&pose.rotation, &end.rotation) < DEVIATION_M);
    }
}

#[test]
fn profiles_cover_their_length_in_every_regime() {
    let limits = ProfileLimits {
        velocity: 1.0,
        acceleration: 2.0,
        jerk: 10.0,
    };
    for length in [1e-6, 0.01, 0.1, 0.5, 1.0, 10.0] {
        let profile = DoubleS::new(length, &limits);
        let end = profile.sample(profile.duration_s());
        assert!((end.position - length).abs() < 1e-12 * length.max(1.0));
        let middle = profile.sample(0.5 * profile.duration_s());
        assert!((middle.position - 0.5 * length).abs() < 1e-12);
        let mut last = profile.sample(0.0);
        for k in 1..=1000 {
            let state = profile.sample(profile.duration_s() * f64::from(k) / 1000.0);
            assert!(state.position >= last.position);
            assert!(state.velocity <= 1.0 + 1e-12 && state.acceleration.abs() <= 2.0 + 1e-12);
            last = state;
        }
    }
}

#[test]
fn a_line_out_of_the_workspace_is_refused() {
    let chain = UrGeometry::UR3.chain();
    let geometry = UrGeometry::UR3;
    let out =
        UnitVector3::new_normalize(-chain.base_link_from_flange(&posture()).translation.vector);
    let error = JointPath::line_ending_at(&chain, &posture(), &out, 0.6).unwrap_err();
    assert!(matches!(
        error,
        LineError::OutOfReach { .. } | LineError::Singular { .. }
    ));
    assert!(
        ik::Configuration::of(&geometry, &posture())
            .label()
            .starts_with("Right-Up")
    );
}

#[test]
fn pieces_meet_and_straight_ones_have_the_peaks_of_their_leading_joint() {
    let motion = motion();
    let pieces: Vec<Piece> = motion.pieces().collect();
    assert_eq!(pieces[0].start_s, 0.0);
    assert!(
        pieces
            .windows(2)
            .all(|pair| pair[0].end_s == pair[1].start_s)
    );
    assert!((pieces.last().unwrap().end_s - motion.duration_s()).abs() < 1e-12);
    let mut straight = 0;
    for piece in &pieces {
        let PieceCourse::Straight {
            leading,
            speed_rad_s,
            acceleration_rad_s2,
        } = piece.course
        else {
            continue;
        };
        straight += 1;
        let states = (0..=2000).map(|k| {
            motion.sample(piece.start_s + (piece.end_s - piece.start_s) * f64::from(k) / 2000.0)
        });
        let (mut speed, mut acceleration) = (0.0_f64, 0.0_f64);
        for state in states {
            assert!(state.velocity[leading].abs() >= state.velocity.amax() - 1e-12);
            speed = speed.max(state.velocity[leading].abs());
            acceleration = acceleration.max(state.acceleration[leading].abs());
        }
        // The samples are no farther from the peak than a two-thousandth of the motion.
        assert!((speed - speed_rad_s).abs() < 1e-6, "{speed} {speed_rad_s}");
        assert!(
            acceleration <= acceleration_rad_s2 * (1.0 + 1e-12)
                && acceleration > 0.99 * acceleration_rad_s2,
            "{acceleration} {acceleration_rad_s2}"
        );
    }
    assert!(straight > 0);
}
