//! What programs do.

use needlebench_kinematics::{Joints, Pose, pose_from_rotation_vector, rotation_angle_between};
use needlebench_urscript::{Motion, MotionKind};

use crate::test_arm::{TestArm, start};
use crate::test_host::{TestHost, done};

/// A hundred roundings of positions (m) and angles (rad) of order 1.
const ROUNDING: f64 = 1e-14;

/// A hundred times the residual of the closed form.
const IK: f64 = 1e-10;

fn ran(text: &str) -> TestHost {
    done(text, None).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn motions(text: &str) -> Vec<Motion> {
    ran(text).motions
}

/// The numbers that a program gives away by `out(NUMBER)`.
fn numbers(text: &str) -> Vec<f64> {
    ran(&text.replace("out(", "write_output_float_register(0, ")).numbers
}

#[test]
fn expressions_are_worth_what_arithmetic_says() {
    for (text, expected) in [
        ("1 + 2 * 3 - 4 / 8", 6.5),
        ("7 % 4 + -(-2)", 5.0),
        ("norm([3, 4]) + norm(-2)", 7.0),
        ("pow(2, 10) + sqrt(2.25) + floor(2.7) + ceil(0.2)", 1028.5),
        ("sin(d2r(90)) + cos(0) + tan(0)", 2.0),
        (
            "r2d(atan2(1, 1)) + r2d(acos(0)) + r2d(asin(1)) + atan(0)",
            225.0,
        ),
        ("log(2, 8)", 3.0),
        (
            "length([1, [2, 3], 4]) + get_list_length([]) + str_len(\"abc\")",
            6.0,
        ),
        ("([1, 2] + [3, 4] * 2 - [1, 1] / 2)[1]", 9.5),
        ("[[1, 2], [3, 4]][1, 0] + p[1, 2, 3, 4, 5, 6][5]", 9.0),
        ("to_num(str_cat(\"1\", 2.5))", 12.5),
        ("normalize([0, 5])[1]", 1.0),
        ("get_steptime() * 500", 1.0),
        ("point_dist(p[0, 3, 0, 1, 0, 0], p[4, 0, 0, 0, 1, 0])", 5.0),
    ] {
        let found = numbers(&format!("out({text})"));
        assert!(
            (found[0] - expected).abs() < 1e-12 * expected,
            "{text}: {found:?}"
        );
    }
    for (text, expected) in [
        ("1 < 2 and not 2 <= 1", true),
        ("1 > 2 or 3 >= 3", true),
        ("True xor True", false),
        (
            "\"a\" == \"a\" and [1, 2] != [1, 3] and p[0,0,0,0,0,0] == p[0,0,0,0,0,0]",
            true,
        ),
        ("str_empty(\"\")", true),
        ("False and 1 / 0 == 1", false),
        (
            "get_inverse_kin_has_solution(p[9, 9, 9, 0, 0, 0], tcp = p[0,0,0,0,0,0])",
            false,
        ),
    ] {
        let found = numbers(&format!("if {text}: out(1) else: out(2) end"));
        assert_eq!(found[0] < 1.5, expected, "{text}");
    }
}

#[test]
fn names_hold_where_the_language_says() {
    // A free name in a function is the global one if there is any, else its own.
    let text = "def program():\n  local a = 1\n  def f(x, y = 10):\n    a = a + x\n    b = y\n    local a = 100\n    \
                return a + b\n  end\n  out(f(2))\n  out(f(2, y = 20))\n  out(a)\nend\n";
    assert_eq!(numbers(text), [110.0, 120.0, 5.0]);
    // Lists are values.
    let text = "a = [1, 2] b = a b[0] = 7 out(a[0]) out(b[0])";
    assert_eq!(numbers(text), [1.0, 7.0]);
    let text = "def f(l): l[0] = 9 return l end a = [1, 2] b = f(a) out(a[0]) out(b[0])";
    assert_eq!(numbers(text), [1.0, 9.0]);
    let text =
        "m = [[1, 2], [3, 4]] m[1, 0] = 8 out(m[1][0]) q = p[1, 2, 3, 0, 0, 0] q[2] = 5 out(q[2])";
    assert_eq!(numbers(text), [8.0, 5.0]);
    let text = "def f(): global g = 3 end f() out(g)";
    assert_eq!(numbers(text), [3.0]);
}

#[test]
fn branches_and_loops_go_on_as_written() {
    let text = "i = 0\nwhile True:\n  i = i + 1\n  if i == 2:\n    continue\n  elif i == 5:\n    break\n  end\n  \
                out(i)\nend\n";
    assert_eq!(numbers(text), [1.0, 3.0, 4.0]);
    let text = "def fib(n): if n < 2: return n end return fib(n - 1) + fib(n - 2) end out(fib(15))";
    assert_eq!(numbers(text), [610.0]);
    let text = "def stop(): halt end out(1) stop() out(2)";
    assert_eq!(numbers(text), [1.0]);
}

#[test]
fn what_the_program_is_is_found() {
    for text in [
        "def main(): out(1) end",
        "def main(): out(1) end main()",
        "def f(x): out(x) end def main(): f(1) end main()",
        "def f(x): out(x) end f(1)",
        "out(1)",
        "def main():\n def main(): out(1) end\n main()\nend",
    ] {
        assert_eq!(numbers(text), [1.0], "{text}");
    }
}

#[test]
fn moves_have_the_manuals_defaults_and_take_joints_or_poses() {
    let q = "[0.2, -1.4, 1.1, -1.3, -1.4, 0.3]";
    let text = format!(
        "set_tcp(p[0, 0, 0.1, 0, 0, 0])\nmovej({q})\nmovel({q})\nx = get_forward_kin({q})\n\
         movej(x, 0.5, 0.4, r = 0.01)\n         movel(x, t = 2)\nmovep(x, a = 1, v = 0.1, r = 0.02)\n\
         servoj({q}, 0, 0, 0.008, 0.05, 500)\nservoj({q})\nstopj(2)\n\
         movej(get_inverse_kin(x, qnear = {q}))"
    );
    let all = motions(&text);
    assert_eq!(all.len(), 9);
    let joints = Joints::from([0.2, -1.4, 1.1, -1.3, -1.4, 0.3]);
    let tcp = Pose::translation(0.0, 0.0, 0.1);
    let arm = TestArm::new();
    let pose = arm.base_from_flange(&joints) * tcp;
    assert_eq!(all[1].flange_from_tcp, Some(tcp));
    match &all[0].kind {
        MotionKind::Joints { to, pace, blend_m } => {
            assert_eq!((*to, *blend_m), (joints, 0.0));
            assert_eq!(
                (pace.acceleration, pace.speed, pace.time_s),
                (1.4, 1.05, None)
            );
        }
        other => panic!("{other:?}"),
    }
    match &all[1].kind {
        MotionKind::Line { to, pace, .. } => {
            assert!((to.translation.vector - pose.translation.vector).amax() < ROUNDING);
            assert_eq!(
                (pace.acceleration, pace.speed, pace.time_s),
                (1.2, 0.25, None)
            );
        }
        other => panic!("{other:?}"),
    }
    match &all[2].kind {
        MotionKind::Joints { to, pace, blend_m } => {
            assert!((to - joints).amax() < IK, "{to}");
            assert_eq!((pace.acceleration, pace.speed, *blend_m), (0.5, 0.4, 0.01));
        }
        other => panic!("{other:?}"),
    }
    assert!(matches!(&all[3].kind, MotionKind::Line { pace, .. } if pace.time_s == Some(2.0)));
    assert!(matches!(&all[4].kind, MotionKind::Process { blend_m, .. } if *blend_m == 0.02));
    assert!(matches!(
        &all[5].kind,
        MotionKind::Servo { time_s, lookahead_s, gain, .. }
            if (*time_s, *lookahead_s, *gain) == (0.008, 0.05, 500.0)
    ));
    assert!(matches!(
        &all[6].kind,
        MotionKind::Servo { time_s, lookahead_s, gain, .. }
            if (*time_s, *lookahead_s, *gain) == (0.002, 0.1, 300.0)
    ));
    assert!(matches!(&all[8].kind, MotionKind::Joints { to, .. } if (to - joints).amax() < IK));
    let lines: Vec<usize> = all.iter().map(|motion| motion.place.line).collect();
    assert_eq!(lines, [2, 3, 5, 6, 7, 8, 9, 10, 11]);
}

#[test]
fn circles_go_through_a_place_with_the_manuals_defaults() {
    let text = "set_tcp(p[0, 0, 0.1, 0, 0, 0])\nhere = get_target_tcp_pose()\n\
                via = pose_add(here, p[0.02, 0.02, 0, 0, 0, 0])\n\
                movec(via, pose_add(here, p[0.04, 0, 0, 0, 0, 0]), r = 0.01)";
    let all = motions(text);
    let tcp = Pose::translation(0.0, 0.0, 0.1);
    let here = TestArm::new().base_from_flange(&start()) * tcp;
    match &all[0].kind {
        MotionKind::Circle {
            via_m,
            to,
            pace,
            blend_m,
        } => {
            let off = via_m - here.translation.vector;
            assert!((off - nalgebra::Vector3::new(0.02, 0.02, 0.0)).amax() < ROUNDING);
            let off = to.translation.vector - here.translation.vector;
            assert!((off - nalgebra::Vector3::new(0.04, 0.0, 0.0)).amax() < ROUNDING);
            assert_eq!((pace.acceleration, pace.speed, *blend_m), (1.2, 0.25, 0.01));
        }
        other => panic!("{other:?}"),
    }
}

/// The pose that a program's expression is worth.
fn pose(expression: &str) -> Pose {
    let zero = "[0, 0, 0, 0, 0, 0]";
    let text = format!("set_tcp({expression}) movel({zero})");
    motions(&text)[0].flange_from_tcp.unwrap()
}

#[test]
fn poses_are_transforms() {
    let (a, b) = (
        "p[0.1, 0.2, 0.3, 0.4, -0.5, 0.6]",
        "p[-0.3, 0.1, 0.05, 1.1, 0.2, -0.7]",
    );
    let of = |numbers: [f64; 6]| {
        let [x, y, z, rx, ry, rz] = numbers;
        pose_from_rotation_vector([x, y, z].into(), [rx, ry, rz].into())
    };
    let (pa, pb) = (
        of([0.1, 0.2, 0.3, 0.4, -0.5, 0.6]),
        of([-0.3, 0.1, 0.05, 1.1, 0.2, -0.7]),
    );
    let same = |text: String, expected: Pose| {
        let found = pose(&text);
        let off_m = (found.translation.vector - expected.translation.vector).amax();
        let off_rad = rotation_angle_between(&found.rotation, &expected.rotation);
        assert!(
            off_m < ROUNDING && off_rad < ROUNDING,
            "{text}: {off_m:e} {off_rad:e}"
        );
    };
    // Against matrices, which know nothing of quaternions.
    let product = pa.to_homogeneous() * pb.to_homogeneous();
    let found = pose(&format!("pose_trans({a}, {b})")).to_homogeneous();
    assert!((found - product).amax() < ROUNDING);
    let inverse = pose(&format!("pose_inv({a})")).to_homogeneous() * pa.to_homogeneous();
    assert!((inverse - nalgebra::Matrix4::identity()).amax() < ROUNDING);
    same(format!("pose_add(pose_sub({a}, {b}), {b})"), pa);
    same(format!("interpolate_pose({a}, {b}, 0)"), pa);
    same(format!("interpolate_pose({a}, {b}, 1)"), pb);
    // Half the way twice is the whole way.
    let half = format!("interpolate_pose({a}, {b}, 0.5)");
    let [to_half, on] = [(pa, pose(&half)), (pose(&half), pb)]
        .map(|(from, to)| rotation_angle_between(&from.rotation, &to.rotation));
    let whole = rotation_angle_between(&pa.rotation, &pb.rotation);
    assert!((to_half - on).abs() < ROUNDING && (to_half + on - whole).abs() < ROUNDING);
    // Roll, pitch and yaw: about x by 0.3, then about the fixed y and z.
    let axis =
        |x: f64, y: f64, z: f64| pose_from_rotation_vector([0.0; 3].into(), [x, y, z].into());
    let expected = axis(0.0, 0.0, -1.0) * axis(0.0, 0.7, 0.0) * axis(0.3, 0.0, 0.0);
    let text = "def f(): v = rpy2rotvec([0.3, 0.7, -1]) w = rpy2rotvec(rotvec2rpy(v)) \
                return p[0, 0, 0, w[0], w[1], w[2]] end";
    let found = motions(&format!("{text} set_tcp(f()) movel([0,0,0,0,0,0])"))[0]
        .flange_from_tcp
        .unwrap();
    assert!(rotation_angle_between(&found.rotation, &expected.rotation) < ROUNDING);
}

#[test]
fn the_arm_is_where_the_last_motion_ends() {
    let text = "q = get_target_joint_positions()\nq[0] = q[0] + 0.1\nmovej(q)\nr = get_target_joint_positions()\n\
                r[5] = r[5] - 0.2\nmovej(r)\n";
    let all = motions(text);
    let mut expected = start();
    expected[0] += 0.1;
    expected[5] -= 0.2;
    assert!(
        matches!(&all[1].kind, MotionKind::Joints { to, .. } if (to - expected).amax() < ROUNDING)
    );
}

#[test]
fn the_graphical_editors_head_is_carried_out() {
    let text = r#"def Needle():
  set_safety_mode_transition_hardness(1)
  set_gravity([0.0, 0.0, 9.82])
  set_tcp(p[0.0,0.0,0.2,0.0,0.0,0.0])
  set_target_payload(1.5, [0.0, 0.01, 0.05], [0.1, 0.1, 0.1, 0.0, 0.0, 0.0])
  set_tool_voltage(0)
  step_count_1f = 0.0
  thread Step_Counter_Thread_1f():
    while (True):
      step_count_1f = step_count_1f + 1.0
      sync()
    end
  end
  run Step_Counter_Thread_1f()
  global Waypoint_1_q=[0.2, -1.4, 1.1, -1.3, -1.4, 0.3]
  $ 1 "Robot Program"
  movej(Waypoint_1_q, a=1.3962634015954636, v=1.0471975511965976)
  textmsg("there ", Waypoint_1_q[0])
  popup("Needle?", blocking=True)
  set_standard_digital_out(0, True)
end
"#;
    let host = ran(text);
    assert_eq!(host.motions.len(), 1);
    assert_eq!(host.belief.payload_kg, Some(1.5));
    assert_eq!(host.belief.centre_m, Some([0.0, 0.01, 0.05]));
    assert_eq!(host.belief.gravity_m_s2, Some([0.0, 0.0, 9.82]));
    let said = |part: &str| host.trace.iter().filter(|each| each.contains(part)).count();
    assert_eq!(said("not simulated: settings of the controller"), 2);
    assert_eq!((said("there 0.2"), said("popup Needle?")), (1, 1));
    assert_eq!(said("DigitalOutput[0] = Truth(true)"), 1);
}

#[test]
fn the_installations_tcp_counts_until_the_program_sets_one() {
    let text =
        "movel([0, -1, 1, -1, -1, 0]) set_tcp(p[0, 0, 0.3, 0, 0, 0]) movel([0, -1, 1, -1, -1, 0])";
    let installed = Pose::translation(0.0, 0.0, 0.1);
    let host = done(text, Some(installed)).unwrap();
    assert_eq!(host.motions[0].flange_from_tcp, Some(installed));
    assert_eq!(
        host.motions[1].flange_from_tcp,
        Some(Pose::translation(0.0, 0.0, 0.3))
    );
}
