//! Motions of programs against closed forms.

use nalgebra::{UnitQuaternion, Vector3, Vector6};
use needlebench_controller::{Blend, Command, Event, Goal};
use needlebench_kinematics::trajectory::{DoubleS, ProfileLimits};
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose, rotation_angle_between};
use needlebench_urscript::MotionKind;

use crate::{
    Cell, MOST_RAD_S2, RAMP_S, goal, motion, movej, movel, pace, servoj, speedj, start, stopj,
    within,
};

const PERIODS_S: [f64; 2] = [0.002, 0.008];

/// Of inverse kinematics at the length of the arm.
const RESIDUAL_M: f64 = 1e-9;

fn moved(joint: usize, by_rad: f64) -> Joints {
    let mut to = start();
    to[joint] += by_rad;
    to
}

/// A ramped trapezoid: `L / v + v / a + r` where it reaches its speed, and `a s (s - r) = L` for half of its time `s`
/// where it does not; the latter needs the acceleration to be reached.
#[test]
fn durations_and_peaks_of_joint_moves_are_those_of_ramped_trapezoids() {
    for period_s in PERIODS_S {
        for (way, a, v) in [
            (2.0, 1.4, 1.05),
            (0.7, 3.0, 1.0),
            (0.3, 1.4, 1.05),
            (0.08, 1.4, 1.05),
        ] {
            let mut cell = Cell::playing(period_s);
            let mut to = moved(0, way);
            to[3] -= 0.3 * way;
            cell.ask(movej(to, pace(a, v), 0.0));
            let took_s = cell.finish();
            let reaches = way >= v * (v / a + RAMP_S);
            let half_s = 0.5 * RAMP_S + (0.25 * RAMP_S * RAMP_S + way / a).sqrt();
            let expected_s = if reaches {
                way / v + v / a + RAMP_S
            } else {
                2.0 * half_s
            };
            assert!(
                took_s >= expected_s - 1e-9 && took_s < expected_s + period_s,
                "{took_s}"
            );
            let (fastest, hardest) = cell.peaks(0);
            let speed = if reaches { v } else { a * (half_s - RAMP_S) };
            // The fastest set-point is within half a period of the peak, from which the speed falls by a ramp.
            let off = 0.5 * a / RAMP_S * (0.5 * period_s).powi(2);
            assert!(
                fastest <= speed + 1e-9 && fastest >= speed - off - 1e-9,
                "{fastest} {speed}"
            );
            assert!(
                hardest <= a + 1e-9 && hardest > a * (1.0 - period_s / RAMP_S),
                "{hardest}"
            );
            assert!((cell.position() - to).amax() < 1e-12);
            assert!(cell.controller.is_steady());
        }
    }
}

/// Below the full acceleration: four phases of jerk, `L = 2 j u^3`.
#[test]
fn shortest_moves_do_not_reach_their_acceleration() {
    let (way, a) = (1e-3, 1.4);
    let mut cell = Cell::playing(0.002);
    cell.ask(movej(moved(4, way), pace(a, 1.05), 0.0));
    let took_s = cell.finish();
    let phase_s = libm::cbrt(way * RAMP_S / (2.0 * a));
    assert!(
        took_s >= 4.0 * phase_s - 1e-9 && took_s < 4.0 * phase_s + 0.002,
        "{took_s}"
    );
    let (_, hardest) = cell.peaks(0);
    assert!(hardest <= a * phase_s / RAMP_S + 1e-9, "{hardest}");
}

#[test]
fn a_time_counts_instead_of_speed_and_acceleration() {
    let mut cell = Cell::playing(0.002);
    cell.ask(movej(moved(1, 0.4), within(2.5), 0.0));
    assert!((cell.finish() - 2.5).abs() < 1e-9);
    let base_from_tcp = cell.base_from_tcp(&cell.position());
    let to = Pose::from_parts(
        (base_from_tcp.translation.vector + Vector3::z() * 0.05).into(),
        base_from_tcp.rotation,
    );
    cell.ask(movel(to, within(1.5), 0.0));
    assert!((cell.finish() - 1.5).abs() < 1e-9);
}

#[test]
fn speeds_and_accelerations_beyond_the_arms_are_reduced_and_told() {
    let mut cell = Cell::playing(0.002);
    cell.ask(movej(moved(0, 3.0), pace(100.0, 50.0), 0.0));
    cell.finish();
    let (fastest, hardest) = cell.peaks(0);
    let speed = cell.arm.limits.0[0].velocity_rad_s;
    assert!((fastest - speed).abs() < 1e-9, "{fastest}");
    assert!((hardest - 0.5 * MOST_RAD_S2).abs() < 1e-9, "{hardest}");
    let told: Vec<(&str, f64, f64)> = cell
        .events
        .iter()
        .filter_map(|event| match event {
            Event::Reduced {
                what, asked, used, ..
            } => Some((*what, *asked, *used)),
            _ => None,
        })
        .collect();
    assert_eq!(told, [("v", 50.0, speed), ("a", 100.0, 0.5 * MOST_RAD_S2)]);
}

fn shifted(pose: &Pose, by_m: Vector3<f64>, turn: Vector3<f64>) -> Pose {
    Pose::from_parts(
        (pose.translation.vector + by_m).into(),
        UnitQuaternion::from_scaled_axis(turn) * pose.rotation,
    )
}

#[test]
fn the_tools_point_goes_straight_at_its_speed_and_turns_evenly() {
    for period_s in PERIODS_S {
        let mut cell = Cell::playing(period_s);
        let from = cell.base_from_tcp(&start());
        let (by_m, turn) = (
            Vector3::new(0.05, -0.12, 0.06),
            Vector3::new(0.2, -0.3, 0.4),
        );
        let to = shifted(&from, by_m, turn);
        cell.ask(movel(to, pace(1.2, 0.25), 0.0));
        let took_s = cell.finish();
        let expected_s = by_m.norm() / 0.25 + 0.25 / 1.2 + RAMP_S;
        assert!(took_s >= expected_s - 1e-9 && took_s < expected_s + period_s);
        let mut fastest = 0.0_f64;
        // Between set-points too: the quintic of one period leaves the line by far less than the residual.
        let samples = 4000;
        for k in 0..=samples {
            let time_s = cell.record.end_s() * f64::from(k) / f64::from(samples);
            let state = cell.record.sample(time_s);
            let found = cell.base_from_tcp(&state.position);
            let way = found.translation.vector - from.translation.vector;
            let share = way.dot(&by_m) / by_m.norm_squared();
            assert!((way - by_m * share).norm() < RESIDUAL_M, "{way}");
            let expected = UnitQuaternion::from_scaled_axis(turn * share) * from.rotation;
            assert!(rotation_angle_between(&found.rotation, &expected) < 1e-8);
            let point = crate::tcp().translation.vector;
            let jacobian = cell
                .arm
                .kinematics
                .chain
                .jacobian_at(&state.position, &point);
            fastest = fastest.max((jacobian * state.velocity).fixed_rows::<3>(0).norm());
        }
        // Where the jerk jumps by j between set-points, the quintic is off by some thousandths of j T^2.
        let off = 0.01 * 1.2 / RAMP_S * period_s.powi(2);
        assert!((fastest - 0.25).abs() < off, "{fastest}");
        let end = cell.base_from_tcp(&cell.position());
        assert!((end.translation.vector - to.translation.vector).norm() < RESIDUAL_M);
    }
}

#[test]
fn circles_have_their_radius_and_pass_the_place_between() {
    let mut cell = Cell::playing(0.002);
    let from = cell.base_from_tcp(&start());
    // About a centre at 0.08 m along y, in the plane of y and z.
    let (radius_m, centre) = (0.08, from.translation.vector + Vector3::y() * 0.08);
    let at =
        |angle: f64| centre + Vector3::new(0.0, -libm::cos(angle), libm::sin(angle)) * radius_m;
    let to = Pose::from_parts(at(2.0).into(), from.rotation);
    cell.ask(motion(MotionKind::Circle {
        via_m: at(0.7),
        to,
        pace: pace(0.5, 0.1),
        blend_m: 0.0,
    }));
    let took_s = cell.finish();
    let expected_s = 2.0 * radius_m / 0.1 + 0.1 / 0.5 + RAMP_S;
    assert!(
        took_s >= expected_s - 1e-9 && took_s < expected_s + 0.002,
        "{took_s}"
    );
    let mut nearest = f64::INFINITY;
    for state in cell.record.states() {
        let point = cell.base_from_tcp(&state.position).translation.vector;
        assert!(((point - centre).norm() - radius_m).abs() < RESIDUAL_M);
        assert!((point - from.translation.vector).x.abs() < RESIDUAL_M);
        nearest = nearest.min((point - at(0.7)).norm());
    }
    // Half a period at 0.1 m/s.
    assert!(nearest < 1.1e-4, "{nearest}");
    let end = cell.base_from_tcp(&cell.position());
    assert!((end.translation.vector - at(2.0)).norm() < RESIDUAL_M);
}

/// Where two moves are blended, within the sphere and nowhere else off the unblended ways, without a stop.
fn blended(first: Command, second: impl Fn(&Cell) -> Command, radius_m: f64) -> (Cell, Blend, f64) {
    let mut cell = Cell::playing(0.002);
    cell.ask(first);
    let first_s = cell.finish();
    let what = second(&cell);
    let begun = cell.record.states().len();
    cell.ask(what);
    cell.finish();
    let blend = cell
        .events
        .iter()
        .find_map(|event| match event {
            Event::Blend(blend) => Some(*blend),
            _ => None,
        })
        .expect("blended");
    assert!((blend.radius_m - radius_m).abs() < 1e-15 && blend.overlap_s > 0.01);
    // It does not stand in between.
    let states = cell.record.states();
    let slowest = states[begun - 30..begun + 60]
        .iter()
        .map(|state| state.velocity.amax())
        .fold(f64::INFINITY, f64::min);
    assert!(slowest > 0.02, "{slowest}");
    (cell, blend, first_s)
}

#[test]
fn blends_of_lines_stay_within_their_sphere_and_on_the_lines_outside() {
    let radius_m = 0.03;
    let from = Cell::new(0.002).base_from_tcp(&start());
    let corner = shifted(&from, Vector3::new(0.0, -0.15, 0.0), Vector3::zeros());
    let end = shifted(&corner, Vector3::new(0.0, 0.02, 0.14), Vector3::zeros());
    let first = movel(corner, pace(1.2, 0.25), radius_m);
    let (cell, blend, _) = blended(first, |_| movel(end, pace(1.2, 0.25), 0.0), radius_m);
    let [from, corner, end] = [from, corner, end].map(|pose| pose.translation.vector);
    let (mut nearest, mut entered) = (f64::INFINITY, 0);
    for state in cell.record.states() {
        let point = cell.base_from_tcp(&state.position).translation.vector;
        let off = |a: Vector3<f64>, b: Vector3<f64>| {
            let along = (b - a).normalize();
            let way = point - a;
            (way - along * way.dot(&along)).norm()
        };
        let to_corner = (point - corner).norm();
        nearest = nearest.min(to_corner);
        if to_corner <= radius_m {
            entered += 1;
        } else {
            assert!(off(from, corner).min(off(corner, end)) < RESIDUAL_M);
        }
    }
    assert!(entered > 50 && nearest > 1e-3, "{entered} {nearest}");
    let at_corner = cell.base_from_tcp(&blend.corner_rad).translation.vector;
    assert!((at_corner - corner).norm() < RESIDUAL_M);
    // The program was told in time: the blend begins where the sphere does, not later. Both moves have one profile.
    let profile = DoubleS::new(
        (corner - from).norm(),
        &ProfileLimits {
            velocity: 0.25,
            acceleration: 1.2,
            jerk: 1.2 / RAMP_S,
        },
    );
    assert!((profile.sample(blend.overlap_s).position - radius_m).abs() < 1e-8);
    let each_s = |way_m: f64| way_m / 0.25 + 0.25 / 1.2 + RAMP_S;
    let whole_s = each_s((corner - from).norm()) + each_s((end - corner).norm());
    assert!((cell.record.end_s() - 0.002 - (whole_s - blend.overlap_s)).abs() < 0.004);
}

#[test]
fn blends_of_joint_moves_and_of_both_kinds_stay_within_their_sphere() {
    let radius_m = 0.04;
    let mut corner = moved(0, 0.6);
    corner[2] += 0.2;
    let mut end = corner;
    end[1] += 0.5;
    end[2] -= 0.4;
    let joints = || movej(corner, pace(2.0, 1.0), radius_m);
    let tcp_at = |cell: &Cell, joints: &Joints| cell.base_from_tcp(joints).translation.vector;
    let check = |(cell, blend, first_s): (Cell, Blend, f64)| {
        let at_corner = tcp_at(&cell, &blend.corner_rad);
        // Two cycles ahead of the sphere.
        let enters = first_s / 0.002;
        let mut inside = 0;
        for (k, state) in cell.record.states().iter().enumerate() {
            let off = (tcp_at(&cell, &state.position) - at_corner).norm();
            let together =
                k as f64 > enters + 4.0 && (k as f64) < enters + blend.overlap_s / 0.002 - 4.0;
            assert!(!together || off <= radius_m * (1.0 + 1e-6), "{off}");
            inside += u32::from(together);
        }
        assert!(inside > 10, "{inside}");
        let (_, hardest) = cell.peaks(0);
        assert!(hardest <= MOST_RAD_S2);
        assert!(cell.trip().is_none());
    };
    check(blended(
        joints(),
        |_| movej(end, pace(2.0, 1.0), 0.0),
        radius_m,
    ));
    let line_on = |cell: &Cell| {
        let at = cell.base_from_tcp(&corner);
        movel(
            shifted(&at, Vector3::new(-0.1, 0.0, 0.08), Vector3::zeros()),
            pace(1.0, 0.3),
            0.0,
        )
    };
    check(blended(joints(), line_on, radius_m));
    let at = Cell::new(0.002).base_from_tcp(&start());
    let to = shifted(
        &at,
        Vector3::new(0.1, 0.05, 0.08),
        Vector3::new(0.1, 0.0, 0.0),
    );
    let line = movel(to, pace(1.0, 0.3), radius_m);
    check(blended(line, |_| movej(end, pace(2.0, 1.0), 0.0), radius_m));
}

#[test]
fn a_blend_that_nothing_follows_stands_in_its_corner() {
    let mut cell = Cell::playing(0.002);
    let to = moved(0, 0.5);
    cell.ask(movej(to, pace(2.0, 1.0), 0.05));
    cell.finish();
    assert!(!cell.controller.is_steady());
    cell.wait(2.0);
    assert!(cell.controller.is_steady());
    assert!((cell.position() - to).amax() < 1e-12);
    let done = cell
        .events
        .iter()
        .filter(|event| matches!(event, Event::Done { .. }));
    assert_eq!(done.count(), 1);
}

/// A step of `servoj`: the closed form of the filter, `servo_delay` later.
#[test]
fn servoj_answers_a_step_as_its_filter() {
    let (gain, lookahead_s, step) = (300.0_f64, 0.1, 0.01);
    let (omega, damping) = (gain.sqrt(), 0.5 * lookahead_s * gain.sqrt());
    for (period_s, most_off) in [(0.002, 0.012), (0.008, 0.05)] {
        let mut cell = Cell::playing(period_s);
        let begin_s = cell.controller.time_s();
        // To whole cycles: two at 500 Hz, one at 125 Hz.
        let delay_s = (0.004 / period_s).round() * period_s;
        let root = (1.0 - damping * damping).sqrt();
        for _ in 0..250 {
            cell.ask(servoj(moved(5, step), period_s));
            assert!(matches!(cell.events.last(), Some(Event::Done { .. })));
            let t = (cell.controller.time_s() - begin_s - delay_s).max(0.0);
            let (sin, cos) = libm::sincos(omega * root * t);
            let response = 1.0 - libm::exp(-damping * omega * t) * (cos + damping / root * sin);
            let found = (cell.position()[5] - start()[5]) / step;
            // The acceleration, 3 rad/s^2, is reached over one period: at most half of that later at the steepest.
            assert!(
                (found - response).abs() < most_off,
                "{t} {found} {response}"
            );
        }
        assert!((cell.position() - moved(5, step)).amax() < 2e-5);
    }
}

#[test]
fn speedj_reaches_its_speed_and_goes_on_until_the_next_motion() {
    let (a, v) = (2.0, 0.8);
    let mut speed = Joints::zeros();
    speed[2] = v;
    speed[4] = -0.4;
    let mut cell = Cell::playing(0.002);
    cell.ask(speedj(speed, a, None));
    let took_s = cell.finish();
    assert!(
        took_s >= v / a + RAMP_S - 1e-9 && took_s < v / a + RAMP_S + 0.002,
        "{took_s}"
    );
    cell.wait(0.3);
    assert!((cell.controller.set_point().velocity - speed).amax() < 1e-12);
    let at = cell.position();
    cell.ask(stopj(a));
    let stop_s = cell.finish();
    assert!(stop_s >= v / a + RAMP_S - 1e-9 && stop_s < v / a + RAMP_S + 0.002);
    // v^2 / 2a and half of the ramp, all joints on one line.
    let way = cell.position() - at;
    assert!(
        (way[2] - (0.5 * v * v / a + 0.5 * v * RAMP_S)).abs() < 1e-9,
        "{}",
        way[2]
    );
    assert!((way[4] + 0.5 * way[2]).abs() < 1e-9);
    // With a time the program goes on before the speed is reached, and the joints still do.
    let begin = cell.events.len();
    cell.ask(speedj(speed, a, Some(0.1)));
    assert!((cell.finish() - 0.1).abs() < 1e-9);
    cell.wait(1.0);
    assert!((cell.controller.set_point().velocity - speed).amax() < 1e-12);
    let done = |event: &&Event| matches!(event, Event::Done { .. });
    assert_eq!(cell.events[begin..].iter().filter(done).count(), 1);
}

#[test]
fn speedl_moves_the_tools_point_as_told_and_stopl_keeps_its_line() {
    let mut cell = Cell::playing(0.002);
    let from = cell.base_from_tcp(&start());
    let speed = Vector6::new(0.03, -0.06, 0.02, 0.1, 0.0, 0.2);
    cell.ask(goal(Goal::ToolSpeed {
        speed,
        acceleration: 0.5,
        time_s: None,
    }));
    let [v, turning] = [0, 3].map(|row| speed.fixed_rows::<3>(row).norm());
    // The rotation leads: 0.22 rad/s and 0.5 rad/s^2.
    let reach_s = turning / 0.5 + RAMP_S;
    let took_s = cell.finish();
    assert!(
        took_s >= reach_s - 1e-9 && took_s < reach_s + 0.002,
        "{took_s} {reach_s}"
    );
    cell.wait(0.5);
    let twist = |cell: &Cell| {
        let state = cell.controller.set_point();
        let chain = &cell.arm.kinematics.chain;
        let twist =
            chain.jacobian_at(&state.position, &crate::tcp().translation.vector) * state.velocity;
        // The base of the controller is turned by half a turn.
        Vector6::new(
            -twist[0], -twist[1], twist[2], -twist[3], -twist[4], twist[5],
        )
    };
    assert!((twist(&cell) - speed).amax() < 1e-9, "{}", twist(&cell));
    cell.ask(motion(MotionKind::Stop {
        deceleration: 0.5,
        is_linear: true,
    }));
    cell.finish();
    assert!(cell.controller.is_steady());
    let line = Vector3::new(speed[0], speed[1], speed[2]).normalize();
    let turn = Vector3::new(speed[3], speed[4], speed[5]);
    for state in cell.record.states() {
        let pose = cell.base_from_tcp(&state.position);
        let way = pose.translation.vector - from.translation.vector;
        let along = way.dot(&line);
        assert!((way - line * along).norm() < RESIDUAL_M);
        let expected = UnitQuaternion::from_scaled_axis(turn * (along / v)) * from.rotation;
        assert!(rotation_angle_between(&pose.rotation, &expected) < 1e-8);
    }
}

/// Positions, velocities and accelerations of the record belong together: in all kinds of motions one after the other
/// without a stop, differences of positions over a period are the mean velocity to `j T^2 / 12`.
#[test]
fn set_points_are_one_course() {
    let mut cell = Cell::playing(0.002);
    let mut speed = Joints::repeat(0.3);
    speed[1] = -0.5;
    let tool = Goal::ToolSpeed {
        speed: Vector6::new(0.05, 0.02, -0.03, 0.1, 0.0, 0.0),
        acceleration: 0.8,
        time_s: None,
    };
    let motions = [
        movej(moved(0, 1.0), pace(3.0, 1.0), 0.0),
        speedj(speed, 3.0, None),
        servoj(moved(3, 0.1), 0.002),
        goal(tool),
        stopj(4.0),
        movej(moved(1, 0.3), pace(3.0, 1.0), 0.0),
        speedj(-speed, 3.0, None),
        movej(start(), pace(3.0, 1.0), 0.0),
    ];
    for what in motions {
        cell.ask(what);
        cell.wait(0.15);
    }
    cell.finish();
    assert!(cell.trip().is_none());
    let mut worst = [0.0_f64; 2];
    for pair in cell.record.states().windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let t = 0.002;
        let of_position = (b.position - a.position) / t - (a.velocity + b.velocity) * 0.5
            + (b.acceleration - a.acceleration) * (t / 12.0);
        let of_velocity = (b.velocity - a.velocity) / t - (a.acceleration + b.acceleration) * 0.5;
        worst[0] = worst[0].max(of_position.amax());
        worst[1] = worst[1].max(of_velocity.amax());
    }
    // Where a phase of jerk ends within a period: j T^2 / 8 of velocity over T, with 100 rad/s^3 and more of stops.
    assert!(worst[0] < 2e-4 && worst[1] < 0.2, "{worst:?}");
    assert!((0..JOINT_COUNT).all(|i| cell.position()[i].is_finite()));
}

/// Values that nobody means are refused by name, and change nothing.
#[test]
fn absurd_values_are_refused_by_name() {
    let bad = f64::NAN;
    let pose = Cell::new(0.002).base_from_tcp(&start());
    let far = Pose::translation(1e3, 0.0, 0.0);
    let line = |to: Pose, pace, blend_m| movel(to, pace, blend_m);
    let servo = |gain: f64, lookahead_s: f64, time_s: f64| {
        motion(MotionKind::Servo {
            to: start(),
            time_s,
            lookahead_s,
            gain,
        })
    };
    let via = |via_m: Vector3<f64>| {
        motion(MotionKind::Circle {
            via_m,
            to: shifted(&pose, Vector3::x() * 0.1, Vector3::zeros()),
            pace: pace(1.0, 0.1),
            blend_m: 0.0,
        })
    };
    let tool = |linear: f64| {
        goal(Goal::ToolSpeed {
            speed: Vector6::new(linear, 0.0, 0.0, 0.0, 0.0, 0.0),
            acceleration: 1.0,
            time_s: None,
        })
    };
    let on_the_line = pose.translation.vector + Vector3::x() * 0.05;
    let cases = [
        (
            movej(moved(2, bad), pace(1.0, 1.0), 0.0),
            "elbow is NaN rad",
        ),
        (movej(moved(5, 1e5), pace(1.0, 1.0), 0.0), "wrist_3 is 1000"),
        (
            movej(moved(2, 0.1), pace(bad, 1.0), 0.0),
            "a is NaN rad/s^2",
        ),
        (movej(moved(2, 0.1), pace(1.0, 0.0), 0.0), "v is 0 rad/s"),
        (movej(moved(2, 0.1), within(-1.0), 0.0), "t is -1 s"),
        (movej(moved(2, 0.1), within(1e5), 0.0), "a, v or t"),
        (movej(moved(2, 0.1), pace(1.0, 1.0), -0.1), "r is -0.1 m"),
        (line(far, pace(1.0, 1.0), 0.0), "the end is no pose"),
        (line(pose, pace(1.0, f64::INFINITY), 0.0), "v is inf m/s"),
        (via(on_the_line), "begin, place between and end"),
        (via(Vector3::repeat(bad)), "the place between is NaN m"),
        (
            servo(3000.0, 0.1, 0.002),
            "gain is 3000 1/s^2, outside [100, 2000]",
        ),
        (
            servo(300.0, 0.01, 0.002),
            "lookahead_time is 0.01 s, outside [0.03, 0.2]",
        ),
        (servo(300.0, 0.1, bad), "t is NaN s"),
        (
            speedj(Joints::repeat(bad), 1.0, None),
            "shoulder_pan is NaN",
        ),
        (speedj(Joints::zeros(), 0.0, None), "a is 0 rad/s^2"),
        (tool(bad), "the speed of the tool is NaN m/s"),
        (stopj(-1.0), "a is -1"),
    ];
    for (what, expected) in cases {
        let mut cell = Cell::playing(0.002);
        cell.ask(what);
        let [refusal] = cell.refusals()[..] else {
            panic!("not refused: {expected}");
        };
        let text = refusal.to_string();
        assert!(text.starts_with(expected), "{text}, not {expected}");
        cell.wait(0.1);
        assert_eq!(cell.position(), start());
        assert!(cell.controller.is_steady());
    }
}
