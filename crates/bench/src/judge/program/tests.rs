//! Set-points of programs against closed forms.

use nalgebra::Vector3;
use needlebench_kinematics::trajectory::{Between, JointTrajectory, Phase};
use needlebench_kinematics::{JointLimit, JointLimits, Joints, Pose, UrModel};

use super::*;

const PERIOD_S: f64 = 2e-3;

fn kinematics() -> Kinematics {
    Kinematics::new(UrModel::Ur3e.geometry().chain()).unwrap()
}

fn start() -> Joints {
    Joints::from([0.1, -1.5, 1.2, -1.3, -1.4, 0.2])
}

/// The tool's point of all programs here.
fn flange_from_tcp() -> Pose {
    Pose::translation(0.0, 0.0, 0.1)
}

fn done(text: &str) -> Result<ProgramArm, ScriptError> {
    let limits = JointLimits(
        [JointLimit {
            lower_rad: -std::f64::consts::TAU,
            upper_rad: std::f64::consts::TAU,
            velocity_rad_s: std::f64::consts::PI,
            effort_nm: 50.0,
        }; 6],
    );
    let mut arm = ProgramArm::new(&kinematics(), limits, PERIOD_S, start());
    let installation = Installation {
        flange_from_tcp: Some(flange_from_tcp()),
    };
    evaluate(&parse(text)?, &mut arm, &installation)?;
    arm.finish()?;
    Ok(arm)
}

fn moved(text: &str) -> (ProgramArm, JointTrajectory) {
    let arm = done(text).unwrap_or_else(|error| panic!("{error}"));
    let motion =
        JointTrajectory::sampled(Phase::Travel, Between::Quintics, &arm.times_s, &arm.states);
    (arm, motion.unwrap())
}

/// Place of the tool's point in the controller's base frame, from forward kinematics alone.
fn tcp_m(joints: &Joints) -> Vector3<f64> {
    let pose = UrModel::Ur3e.geometry().base_from_flange(joints) * flange_from_tcp();
    pose.translation.vector
}

/// Places of the tool's point at many times, most of them between set-points.
fn places_m(motion: &JointTrajectory) -> Vec<(f64, Vector3<f64>)> {
    let count = 5003;
    (0..=count)
        .map(|index| {
            let time_s = motion.duration_s() * f64::from(index) / f64::from(count);
            (time_s, tcp_m(&motion.sample(time_s).position))
        })
        .collect()
}

/// Distance of a point from the piece between two others.
fn off_piece_m(point: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let way = to - from;
    let share = ((point - from).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
    (point - from - way * share).norm()
}

fn moved_by(x: f64, y: f64, z: f64) -> String {
    format!("pose_add(here, p[{x}, {y}, {z}, 0, 0, 0])")
}

#[test]
fn a_line_is_straight_between_its_set_points_too() {
    let text = format!(
        "here = get_target_tcp_pose() movel({}, v = 0.1)",
        moved_by(0.04, -0.1, 0.05)
    );
    let (arm, motion) = moved(&text);
    let from = tcp_m(&start());
    let to = from + Vector3::new(0.04, -0.1, 0.05);
    for (time_s, place) in places_m(&motion) {
        let off_m = off_piece_m(&place, &from, &to);
        assert!(off_m < 1e-9, "{off_m:e} m at {time_s} s");
    }
    assert!((tcp_m(&motion.end()) - to).norm() < 1e-9);
    let length_m = (to - from).norm();
    // Too slow for the full acceleration: the speed is reached by two ramps of the jerk.
    let expected_s = length_m / 0.1 + 2.0 * (0.1 * leg::RAMP_S / 1.2_f64).sqrt();
    assert!((motion.duration_s() - expected_s).abs() < 1e-9);
    // Every cycle, and the end.
    assert!(
        arm.times_s
            .windows(2)
            .all(|pair| pair[1] - pair[0] < 1.26 * PERIOD_S)
    );
}

#[test]
fn a_circle_is_round_and_goes_through_its_place() {
    // Three quarters of a circle of 30 mm about a centre beside the begin.
    let text = format!(
        "here = get_target_tcp_pose()\nmovec({}, {}, v = 0.1)",
        moved_by(0.03, 0.03, 0.0),
        moved_by(0.03, -0.03, 0.0)
    );
    let (_, motion) = moved(&text);
    let from = tcp_m(&start());
    let centre = from + Vector3::new(0.03, 0.0, 0.0);
    let via = from + Vector3::new(0.03, 0.03, 0.0);
    let mut nearest_m = f64::INFINITY;
    for (time_s, place) in places_m(&motion) {
        let off_m = ((place - centre).norm() - 0.03)
            .abs()
            .max((place - centre).z.abs());
        assert!(off_m < 1e-9, "{off_m:e} m at {time_s} s");
        nearest_m = nearest_m.min((place - via).norm());
    }
    assert!(nearest_m < 1e-4);
    assert!((tcp_m(&motion.end()) - (from + Vector3::new(0.03, -0.03, 0.0))).norm() < 1e-9);
    let length_m = 0.03 * 1.5 * std::f64::consts::PI;
    let expected_s = length_m / 0.1 + 2.0 * (0.1 * leg::RAMP_S / 1.2_f64).sqrt();
    assert!((motion.duration_s() - expected_s).abs() < 1e-9);
}

#[test]
fn blends_stay_on_the_lines_and_within_the_radius_of_the_corner() {
    let radius_m = 0.015;
    for second in [[0.0, -0.06, 0.06], [-0.06, -0.06, 0.0], [0.0, -0.12, 0.0]] {
        let [x, y, z] = second;
        let text = format!(
            "here = get_target_tcp_pose()\nmovel({}, v = 0.2, r = {radius_m})\nmovel({}, v = 0.2)",
            moved_by(0.0, -0.06, 0.0),
            moved_by(x, y, z)
        );
        let (arm, motion) = moved(&text);
        assert!(arm.assumed.contains(&Assumed::Blends));
        let from = tcp_m(&start());
        let corner = from + Vector3::new(0.0, -0.06, 0.0);
        let to = from + Vector3::new(x, y, z);
        let mut nearest_m = f64::INFINITY;
        for (time_s, place) in places_m(&motion) {
            let off_m = off_piece_m(&place, &from, &corner).min(off_piece_m(&place, &corner, &to));
            let corner_m = (place - corner).norm();
            nearest_m = nearest_m.min(corner_m);
            assert!(
                off_m < 1e-9 || corner_m < radius_m * (1.0 + 1e-6),
                "{off_m:e} {time_s}"
            );
        }
        let plain = text.replace(&format!("r = {radius_m}"), "r = 0");
        let (_, stopping) = moved(&plain);
        assert!(motion.duration_s() < stopping.duration_s() - 0.05);
        let bent = Vector3::new(x, y, z) != Vector3::new(0.0, -0.12, 0.0);
        // A corner is not passed; a straight line stays one.
        assert_eq!(nearest_m > 1e-4, bent, "{nearest_m}");
    }
}

#[test]
fn joint_moves_blend_within_the_radius_too_and_joints_move_smoothly() {
    let radius_m = 0.03;
    let text = "q = get_target_joint_positions()\nq[0] = q[0] + 0.6\nmovej(q, a = 1.2, v = 0.8, r = 0.03)\n\
                q[2] = q[2] - 0.5\nmovej(q, a = 1.2, v = 0.8)";
    let (_, motion) = moved(text);
    let mut corner = start();
    corner[0] += 0.6;
    let corner_m = tcp_m(&corner);
    let mut mixed = 0;
    for step in 0..=4000 {
        let state = motion.sample(motion.duration_s() * f64::from(step) / 4000.0);
        if state.velocity[0].abs() > 1e-6 && state.velocity[2].abs() > 1e-6 {
            mixed += 1;
            assert!((tcp_m(&state.position) - corner_m).norm() < radius_m * (1.0 + 1e-6));
        }
        // Each joint moves in one move alone: its acceleration is that of the move, and what a quintic adds.
        assert!(
            state.acceleration.amax() < 1.2 * 1.01,
            "{}",
            state.acceleration
        );
    }
    assert!(mixed > 20);
    let mut end = corner;
    end[2] -= 0.5;
    assert!((motion.end() - end).amax() < 1e-12);
}

#[test]
fn radii_that_overlap_are_refused_with_their_line() {
    let text = format!(
        "here = get_target_tcp_pose()\nmovel({}, r = 0.03)\nmovel({}, r = 0.02)\nmovel({})",
        moved_by(0.0, -0.1, 0.0),
        moved_by(0.0, -0.1, 0.04),
        moved_by(0.0, 0.0, 0.04)
    );
    let error = done(&text).unwrap_err();
    assert_eq!((error.place.line, error.place.column), (3, 1));
    assert!(
        error.message.contains("30.0 mm") && error.message.contains("40.0 mm"),
        "{error}"
    );
}

#[test]
fn motions_follow_each_other_in_time() {
    let text = "q = get_target_joint_positions()\nsleep(0.5)\nq[5] = q[5] + 0.3\nmovej(q, t = 2)\nsleep(1)\n\
                i = 0\nwhile i < 50:\n  i = i + 1\n  q[4] = q[4] + 0.0002\n  servoj(q, t = 0.008)\nend\nstopj(2)\n";
    let (arm, motion) = moved(text);
    let mut before_stream = start();
    before_stream[5] += 0.3;
    for (time_s, expected) in [(0.25, start()), (2.5, before_stream), (3.0, before_stream)] {
        assert!(
            (motion.sample(time_s).position - expected).amax() < 1e-12,
            "{time_s}"
        );
    }
    // 50 targets at 0.025 rad/s, then a stop from there at 2 rad/s^2, and one cycle at rest.
    let expected_s = 3.5 + 0.4 + 0.025 / 2.0 + PERIOD_S;
    assert!((motion.duration_s() - expected_s).abs() < 1e-9);
    let mut end = before_stream;
    end[4] += 0.01 + 0.025 * 0.025 / 4.0;
    assert!((motion.end() - end).amax() < 1e-9);
    let in_stream = motion.sample(3.7);
    assert!((in_stream.velocity[4] - 0.025).abs() < 1e-9);
    assert_eq!(
        arm.lines[arm.times_s.partition_point(|time_s| *time_s < 1.5)],
        4
    );
    assert_eq!(
        arm.lines[arm.times_s.partition_point(|time_s| *time_s < 3.7)],
        10
    );
}

#[test]
fn what_the_arm_cannot_do_is_refused_with_its_line() {
    for (text, line, part) in [
        ("movel(p[3, 0, 0, 0, 0, 0])", 1, "leaves the workspace"),
        (
            "h = get_target_tcp_pose() movec(pose_add(h, p[0, 0.01, 0, 0, 0, 0]), pose_add(h, p[0, 0.02, 0, 0, 0, 0]))",
            1,
            "lie on a line",
        ),
        (
            "x = 1\nmovej([90, 0, 0, 0, 0, 0])",
            2,
            "more than a revolution",
        ),
        (
            "servoj([1e308, 0, 0, 0, 0, 0])",
            1,
            "more than a revolution",
        ),
        ("servoj([0, 0, 0, 0, 0, 0], t = 0.001)", 1, "period"),
        ("\nsleep(1e6)", 2, "lasts more than"),
        ("movej([0, 0, 0, 0, 0, 0], v = 1e-9)", 1, "lasts more than"),
        (
            "movej([0, 0, 0, 0, 0, 0], a = 1e308, v = 1e308)",
            1,
            "no course",
        ),
        (
            "q = get_target_joint_positions() while True: q[0] = -q[0] movej(q) end",
            1,
            "lasts more than",
        ),
        (
            "servoj([0.2, -1.5, 1.2, -1.3, -1.4, 0.2], t = 1)\nstopl(1)",
            2,
            "only stopj",
        ),
        // The wrist's centre through the axis of the shoulder.
        (
            "here = get_target_tcp_pose()\nmovel(p[-here[0], -here[1], here[2], here[3], here[4], here[5]])",
            2,
            "line",
        ),
    ] {
        let error = done(text).expect_err(text);
        assert_eq!(error.place.line, line, "{text}: {error}");
        assert!(error.message.contains(part), "{text}: {error}");
    }
}

#[test]
fn a_pose_is_reached_by_the_joints_nearest_to_the_posture_before() {
    let text = "q = [0.3, -1.4, 1.1, -1.2, -1.5, 3.5]\nmovej(q)\nx = get_target_tcp_pose()\n\
                r = [0.2, -1.4, 1.1, -1.2, -1.5, 3.4]\nmovej(r)\nmovej(x)";
    let (arm, motion) = moved(text);
    let expected = Joints::from([0.3, -1.4, 1.1, -1.2, -1.5, 3.5]);
    assert!((motion.end() - expected).amax() < 1e-9, "{}", motion.end());
    assert!(arm.assumed.contains(&Assumed::Inverse));
}
