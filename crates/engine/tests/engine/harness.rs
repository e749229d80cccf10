//! The MuJoCo harness process and its Python environment.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use needlebench_engine::mujoco::{
    EnvironmentError, EnvironmentOptions, HarnessError, HarnessProcess, PlantHandle, ensure,
    ensure_with,
};

/// Generous: Python may start from a cold disk.
const TIMEOUT: Duration = Duration::from_mins(1);

const MASS_KG: f64 = 1.3;
const LENGTH_M: f64 = 0.4;
const INERTIA_KGM2: f64 = 0.02;
const ARMATURE_KGM2: f64 = 0.1;
const GRAVITY_M_PER_S2: f64 = 9.81;
const TIMESTEP_S: f64 = 1e-3;

/// A pendulum about y, hanging along -z at angle zero, with a site at its centre of mass and a
/// floor that it does not reach.
fn pendulum() -> String {
    format!(
        r#"<mujoco>
  <option timestep="{TIMESTEP_S}" gravity="0 0 -{GRAVITY_M_PER_S2}" integrator="Euler"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/>
    <body name="bob">
      <joint name="pivot" axis="0 1 0" armature="{ARMATURE_KGM2}"/>
      <inertial mass="{MASS_KG}" pos="0 0 -{LENGTH_M}" diaginertia="{INERTIA_KGM2} {INERTIA_KGM2} {INERTIA_KGM2}"/>
      <geom name="ball" type="sphere" size="0.05" pos="0 0 -{LENGTH_M}" mass="0"/>
      <site name="tip" pos="0 0 -{LENGTH_M}"/>
    </body>
  </worldbody>
</mujoco>"#
    )
}

/// Inertia about the pivot, as the joint feels it.
fn joint_inertia_kgm2() -> f64 {
    INERTIA_KGM2 + MASS_KG * LENGTH_M * LENGTH_M + ARMATURE_KGM2
}

fn gravity_torque_nm(q: f64) -> f64 {
    MASS_KG * GRAVITY_M_PER_S2 * LENGTH_M * libm::sin(q)
}

fn harness() -> HarnessProcess {
    let environment = ensure(&mut |line| eprintln!("{line}")).unwrap();
    HarnessProcess::start(&environment, TIMEOUT).unwrap()
}

fn pendulum_harness() -> (HarnessProcess, PlantHandle) {
    let mut harness = harness();
    let plant = harness.load(&pendulum(), "tip").unwrap();
    (harness, plant)
}

/// A few roundings of numbers of order one.
const ROUNDING: f64 = 1e-14;

#[track_caller]
fn assert_close(got: f64, expected: f64, tolerance: f64) {
    assert!(
        (got - expected).abs() <= tolerance,
        "{got} is not within {tolerance} of {expected}"
    );
}

#[test]
fn environment_reports_the_pinned_mujoco() {
    assert_eq!(harness().versions().mujoco, "4.0.0");
}

#[test]
fn loading_names_what_the_model_holds() {
    let (_harness, plant) = pendulum_harness();
    assert_eq!((plant.qpos_count, plant.dof_count), (1, 1));
    assert_eq!(plant.joint_names, ["pivot"]);
    assert_eq!(plant.body_names, ["world", "bob"]);
    assert_eq!(plant.geom_names, ["floor", "ball"]);
    assert_eq!(plant.timestep_s, TIMESTEP_S);
}

#[test]
fn one_step_of_a_pendulum_is_semi_implicit_euler() {
    let (mut harness, plant) = pendulum_harness();
    let (q, qd, tau) = (0.7, -0.4, 2.0);
    harness.reset(&plant, &[q], &[qd]).unwrap();
    let state = harness.step(&plant, &[tau]).unwrap();
    let qdd = (tau - gravity_torque_nm(q)) / joint_inertia_kgm2();
    let qd_after = qd + TIMESTEP_S * qdd;
    assert_close(state.qvel[0], qd_after, ROUNDING);
    assert_close(state.qpos[0], q + TIMESTEP_S * qd_after, ROUNDING);
    assert_eq!(state.time_s, TIMESTEP_S);
    assert_eq!(state.contact.count, 0);
    assert_eq!(state.contact.deepest_pair, None);
}

#[test]
fn reported_pose_belongs_to_the_reported_position() {
    let (mut harness, plant) = pendulum_harness();
    let at_rest = harness.reset(&plant, &[0.3], &[20.0]).unwrap();
    let moved = harness.step(&plant, &[0.0]).unwrap();
    assert!((moved.qpos[0] - at_rest.qpos[0]).abs() > 0.01);
    for state in [at_rest, moved] {
        let q = state.qpos[0];
        assert_close(state.site_position_m.x, -LENGTH_M * libm::sin(q), ROUNDING);
        assert_close(state.site_position_m.z, -LENGTH_M * libm::cos(q), ROUNDING);
        assert_close(state.site_rotation[(0, 2)], libm::sin(q), ROUNDING);
        assert_close(state.site_rotation[(2, 0)], -libm::sin(q), ROUNDING);
        assert_close(state.world_from_site().rotation.angle(), q, ROUNDING);
    }
}

#[test]
fn inverse_dynamics_of_a_pendulum_match_the_closed_form() {
    let (mut harness, plant) = pendulum_harness();
    let before = harness.reset(&plant, &[0.1], &[0.2]).unwrap();
    let (q, qd, qdd) = (0.9, 1.5, -3.0);
    let dynamics = harness.inverse(&plant, &[q], &[qd], &[qdd]).unwrap();
    let gravity_nm = gravity_torque_nm(q);
    assert_close(dynamics.gravity_nm[0], gravity_nm, ROUNDING);
    // One joint has no Coriolis torque.
    assert_close(dynamics.bias_nm[0], gravity_nm, ROUNDING);
    assert_close(dynamics.mass_matrix[(0, 0)], joint_inertia_kgm2(), ROUNDING);
    assert_close(
        dynamics.torque_nm[0],
        joint_inertia_kgm2() * qdd + gravity_nm,
        ROUNDING,
    );
    assert_eq!(dynamics.world_from_body.len(), 2);
    assert_close(dynamics.world_from_body[1].rotation.angle(), q, ROUNDING);
    // The running state is not touched.
    let after = harness.step(&plant, &[0.0]).unwrap();
    assert_close(after.qpos[0], before.qpos[0], 1e-3);
}

#[test]
fn same_reset_and_torques_give_the_same_bits() {
    let (mut harness, plant) = pendulum_harness();
    let mut run = || {
        harness.reset(&plant, &[0.5], &[0.0]).unwrap();
        let mut last = None;
        for k in 0..200 {
            let tau = libm::sin(f64::from(k));
            last = Some(harness.step(&plant, &[tau]).unwrap());
        }
        last.unwrap()
    };
    assert_eq!(run(), run());
}

#[test]
fn plants_in_one_process_are_independent() {
    let (mut harness, first) = pendulum_harness();
    let second = harness.load(&pendulum(), "tip").unwrap();
    harness.reset(&first, &[0.1], &[0.0]).unwrap();
    harness.reset(&second, &[0.2], &[0.0]).unwrap();
    harness.step(&first, &[50.0]).unwrap();
    let state = harness.step(&second, &[0.0]).unwrap();
    assert!(state.qvel[0] < 0.0);
    assert_eq!(state.time_s, TIMESTEP_S);
}

#[test]
fn resting_contact_bears_the_weight() {
    // A 2 kg ball on a slide, which has settled on the floor after 2 s.
    let mjcf = r#"<mujoco><option timestep="0.001" gravity="0 0 -9.81"/><worldbody>
        <geom name="floor" type="plane" size="1 1 1"/>
        <body><joint type="slide" axis="0 0 1"/><site name="s"/>
        <geom name="ball" type="sphere" size="0.1" mass="2" pos="0 0 0.1"/></body>
        </worldbody></mujoco>"#;
    let mut harness = harness();
    let plant = harness.load(mjcf, "s").unwrap();
    let free = harness.reset(&plant, &[0.5], &[0.0]).unwrap();
    assert_eq!(free.contact.count, 0);
    let distance = harness.distance(&plant, [0, 1], 10.0).unwrap().unwrap();
    assert_close(distance.distance_m, 0.5, ROUNDING);
    assert_close(distance.point_on_second_m.z, 0.5, ROUNDING);
    assert_eq!(harness.distance(&plant, [0, 1], 0.1).unwrap(), None);

    let mut state = harness.reset(&plant, &[0.0], &[0.0]).unwrap();
    for _ in 0..2000 {
        state = harness.step(&plant, &[0.0]).unwrap();
    }
    // Of the weight; the contact approaches its rest exponentially.
    assert_close(state.contact.normal_force_n / (2.0 * 9.81), 1.0, 1e-6);
    assert_eq!(state.contact.count, 1);
    assert_eq!(state.contact.strongest_pair, Some([0, 1]));
    assert_eq!(state.contact.deepest_pair, Some([0, 1]));
    assert_close(
        state.contact.deepest_penetration_m,
        -state.qpos[0],
        1e-9, // the contact is of the step's start
    );

    let lifted = harness.reset(&plant, &[0.5], &[0.0]).unwrap();
    assert_eq!(lifted.contact, free.contact);
}

#[test]
fn model_that_does_not_compile_gives_mujocos_own_words() {
    let mut harness = harness();
    let refused = harness.load("<mujoco><nonsense/></mujoco>", "tip");
    let Err(HarnessError::Engine { during, message }) = refused else {
        panic!("{refused:?}");
    };
    assert_eq!(during, "LOAD");
    assert!(message.contains("nonsense"), "{message}");
    // The process lives on.
    assert!(harness.load(&pendulum(), "tip").is_ok());
}

#[test]
fn missing_site_is_named() {
    let error = harness().load(&pendulum(), "flange").unwrap_err();
    assert!(error.to_string().contains("flange"), "{error}");
}

#[test]
fn unstable_simulation_is_an_error() {
    let (mut harness, plant) = pendulum_harness();
    harness.reset(&plant, &[0.0], &[0.0]).unwrap();
    let error = harness.step(&plant, &[f64::NAN]).unwrap_err();
    assert!(error.to_string().contains("unstable"), "{error}");
    // A reset mends it.
    harness.reset(&plant, &[0.0], &[0.0]).unwrap();
    harness.step(&plant, &[0.0]).unwrap();
}

#[test]
fn vector_of_the_wrong_length_is_refused() {
    let (mut harness, plant) = pendulum_harness();
    let refused = harness.step(&plant, &[0.0; 6]);
    assert_eq!(
        refused,
        Err(HarnessError::Length {
            what: "tau",
            expected: 1,
            got: 6
        })
    );
}

#[cfg(unix)]
#[test]
fn harness_ignores_an_interrupt() {
    let (mut harness, plant) = pendulum_harness();
    signal(&harness, "-INT");
    harness.reset(&plant, &[0.0], &[0.0]).unwrap();
    harness.step(&plant, &[0.0]).unwrap();
}

#[cfg(unix)]
#[test]
fn harness_killed_in_mid_run_has_died() {
    let (mut harness, plant) = pendulum_harness();
    harness.reset(&plant, &[0.0], &[0.0]).unwrap();
    signal(&harness, "-KILL");
    // The signal may arrive after one more answer.
    let error = (0..1000)
        .find_map(|_| harness.step(&plant, &[0.0]).err())
        .unwrap();
    let HarnessError::Died { status, during, .. } = &error else {
        panic!("{error:?}");
    };
    assert_eq!(*during, "STEP");
    assert!(status.contains("signal: 9"), "{status}");
    // It stays dead, and says so at once.
    assert_eq!(harness.step(&plant, &[0.0]), Err(error));
}

#[cfg(unix)]
fn signal(harness: &HarnessProcess, name: &str) {
    let id = harness.process_id().to_string();
    assert!(
        Command::new("kill")
            .args([name, &id])
            .status()
            .unwrap()
            .success()
    );
}

/// What the harness answers to these bytes before its input ends, and its exit status.
fn answer_to(request: &[u8]) -> (Vec<u8>, Option<i32>) {
    let environment = ensure(&mut |_| {}).unwrap();
    let mut child = Command::new(environment.python)
        .args(["-I", "-m", "needlebench_harness"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(request).unwrap();
    let output = child.wait_with_output().unwrap();
    (output.stdout, output.status.code())
}

#[test]
fn malformed_requests_are_answered_with_an_error_and_the_end() {
    let requests: [(&[u8], &str); 5] = [
        (b"\x63\0\0\0\0\0\0\0", "unknown request kind 99"),
        (b"\x04\0\0\0\x01\0\0\0x", "cannot name a plant"),
        (b"\x04\0\0\0\x08\0\0\0\x05\0\0\0\0\0\0\0", "plant 5 of 0"),
        (b"GET / HTTP/1.1\r\n", "allowed are"),
        (b"\x01\0", "ends inside a frame"),
    ];
    for (request, reason) in requests {
        let (answer, status) = answer_to(request);
        let text = String::from_utf8_lossy(&answer[8..]);
        assert_eq!(answer[..4], [0xFF, 0, 0, 0]);
        assert_eq!(
            answer[4..8],
            u32::try_from(text.len()).unwrap().to_le_bytes()
        );
        assert!(text.contains(reason), "{text}");
        assert_eq!(status, Some(3), "{text}");
    }
}

#[test]
fn harness_ends_when_its_input_ends() {
    assert_eq!(answer_to(b""), (Vec::new(), Some(0)));
}

/// A stand-in for the harness: a Python script.
fn stand_in(script: &str, timeout: Duration) -> Result<HarnessProcess, HarnessError> {
    let environment = ensure(&mut |_| {}).unwrap();
    let mut command = Command::new(environment.python);
    command.args(["-I", "-c", script]);
    HarnessProcess::start_command(command, timeout)
}

/// Answers HELLO properly.
const WELCOME: &str = "
import struct, sys, time
source, sink = sys.stdin.buffer.raw, sys.stdout.buffer.raw
source.read(12)
text = lambda s: struct.pack('<I', len(s)) + s
answer = struct.pack('<II', 3, 3) + text(b'4.0.0') + text(b'3') + text(b'2')
sink.write(struct.pack('<II', 0x81, len(answer)) + answer)
";

#[test]
fn hanging_harness_is_killed_at_the_time_limit() {
    let limit = Duration::from_secs(3);
    let mut harness = stand_in(
        &format!("{WELCOME}\nprint('thinking', file=sys.stderr)\ntime.sleep(600)"),
        limit,
    )
    .unwrap();
    let asked = Instant::now();
    let error = harness.load(&pendulum(), "tip").unwrap_err();
    let waited = asked.elapsed();
    assert_eq!(
        error,
        HarnessError::TimedOut {
            seconds: 3.0,
            during: "LOAD",
            stderr_tail: "thinking".into()
        }
    );
    assert!(waited >= limit && waited < limit + TIMEOUT, "{waited:?}");
}

#[test]
fn harness_that_never_says_hello_is_killed_at_the_time_limit() {
    let error = stand_in("import time; time.sleep(600)", Duration::from_millis(500)).unwrap_err();
    assert!(matches!(
        error,
        HarnessError::TimedOut {
            during: "HELLO",
            ..
        }
    ));
}

#[test]
fn garbage_is_a_protocol_error() {
    for (script, got) in [
        ("print('Hello, I am no harness!')", "claims"),
        (
            "import struct, sys; sys.stdout.buffer.write(struct.pack('<III', 0x81, 4, 9))",
            "do not decode",
        ),
        (
            "import struct, sys; sys.stdout.buffer.write(struct.pack('<II', 0x83, 0))",
            "kind 0x83",
        ),
        (
            "import struct, sys; sys.stdout.buffer.write(struct.pack('<II', 0x81, 0) + b'more')",
            "behind the answer",
        ),
    ] {
        let error = stand_in(script, TIMEOUT).unwrap_err();
        assert!(
            matches!(error, HarnessError::Protocol { .. }),
            "{script}: {error:?}"
        );
        assert!(error.to_string().contains(got), "{error}");
    }
}

#[test]
fn dying_harness_leaves_its_last_words() {
    let error = stand_in("import sys; sys.exit('no room left')", TIMEOUT).unwrap_err();
    let HarnessError::Died {
        during,
        status,
        stderr_tail,
    } = error
    else {
        panic!("{error:?}");
    };
    assert_eq!(during, "HELLO");
    assert!(status.contains('1'), "{status}");
    assert_eq!(stderr_tail, "no room left");
}

#[test]
fn command_that_does_not_exist_cannot_be_started() {
    let error = HarnessProcess::start_command(Command::new("/no/such/harness"), TIMEOUT);
    assert!(matches!(error, Err(HarnessError::Start { .. })));
}

fn options(cache_dir: &Path) -> EnvironmentOptions {
    EnvironmentOptions {
        cache_dir: Some(cache_dir.to_owned()),
        ..EnvironmentOptions::from_process()
    }
}

#[test]
fn missing_python_is_an_error_with_a_hint() {
    let empty = tempfile::tempdir().unwrap();
    let options = EnvironmentOptions {
        python: None,
        search_path: Some(empty.path().into()),
        ..options(empty.path())
    };
    let error = ensure_with(&options, &mut |_| {}).unwrap_err();
    assert!(matches!(error, EnvironmentError::NoPython { .. }));
    let message = error.to_string();
    assert!(
        message.contains("hint: ") && message.contains("NEEDLEBENCH_PYTHON"),
        "{message}"
    );
}

#[cfg(unix)]
#[test]
fn unsuitable_pythons_are_listed_with_what_is_wrong() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let python = folder.path().join("python3");
    let answer = "#!/bin/sh\necho 3.9.18 64 cpython 1 /usr/bin/python3\n";
    fs::write(&python, answer).unwrap();
    fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
    let options = EnvironmentOptions {
        python: None,
        search_path: Some(folder.path().into()),
        ..options(folder.path())
    };
    let message = ensure_with(&options, &mut |_| {}).unwrap_err().to_string();
    assert!(
        message.contains("3.9.18 is too old") && message.contains(python.to_str().unwrap()),
        "{message}"
    );
}

#[test]
fn chosen_python_that_does_not_run_is_an_error_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let options = EnvironmentOptions {
        python: Some("/no/such/python".into()),
        ..options(folder.path())
    };
    let error = ensure_with(&options, &mut |_| {}).unwrap_err();
    assert!(matches!(error, EnvironmentError::ChosenPython { .. }));
    assert!(error.to_string().contains("hint: "), "{error}");
}

#[test]
fn unwritable_cache_is_an_error_with_a_hint() {
    // Below a file; a folder without permissions would not stop root.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let error = ensure_with(&options(&file.join("cache")), &mut |_| {}).unwrap_err();
    assert!(matches!(error, EnvironmentError::Unwritable { .. }));
    assert!(
        error.to_string().contains("NEEDLEBENCH_CACHE_DIR"),
        "{error}"
    );
}

#[test]
fn environment_is_made_once() {
    let first = ensure(&mut |_| {}).unwrap();
    let mut lines = 0;
    let second = ensure(&mut |_| lines += 1).unwrap();
    assert_eq!(first, second);
    assert_eq!(lines, 0);
}
