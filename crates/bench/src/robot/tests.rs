//! Programs with an arm in an engine, against the engine's own replay and closed forms.

use needlebench_controller::Controller;
use needlebench_engine::{ENGINES, Hooks, PlantState, Recording, run_motions};
use needlebench_evaluation::judged::ProgramEvent;
use needlebench_kinematics::trajectory::{Between, JointTrajectory, Phase};
use needlebench_kinematics::{Pose, base_from_base_link, rotation_vector};
use needlebench_scenario::{Overrides, load_scenario};
use needlebench_urscript::{Host, Place, Request};

use super::host::RobotHost;
use super::*;

/// Joint moves with a blend, a move of the tool that depends on what is measured, `servoj`, speeds that the end of the
/// program cuts off.
const MIXED: &str = "
def mixed():
  set_tcp(p[0.02, -0.03, 0.12, 0.1, 0.2, 0.3])
  q = get_actual_joint_positions()
  movej([q[0] + 0.2, q[1] - 0.1, q[2] + 0.1, q[3], q[4], q[5]], a = 1.0, v = 0.8, r = 0.02)
  movej([q[0], q[1] - 0.2, q[2] + 0.2, q[3], q[4], q[5]], a = 1.0, v = 0.8)
  movel(pose_add(get_actual_tcp_pose(), p[0, 0, 0.03, 0, 0, 0]), a = 0.3, v = 0.1)
  i = 0
  q = get_actual_joint_positions()
  while i < 50:
    q[5] = q[5] + 0.002
    servoj(q, t = get_steptime(), lookahead_time = 0.05, gain = 300)
    i = i + 1
  end
  stopj(2.0)
  speedj([0, 0, 0, 0, 0.2, 0], 1.0, 0.3)
end
";

fn resolved(name: &str) -> ResolvedScenario {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    load_scenario(&folder.join(name), &Overrides::default()).unwrap()
}

fn asked(until: Until, time_limit_s: f64) -> RobotOptions {
    RobotOptions {
        until,
        time_limit_s,
        installed: InstalledTcp::GuideExit,
        goal: None,
        beside: false,
    }
}

fn ran(resolved: &ResolvedScenario, text: &str, asked: &RobotOptions) -> (Ran, Recording) {
    let model = ClearanceModel::new(&resolved.cell);
    let setup = Setup::new(resolved, &model).unwrap();
    let program = Program::load(text).unwrap_or_else(|error| panic!("{error}"));
    let cancel = AtomicBool::new(false);
    run_in(&setup, program, ENGINES[0], asked, &cancel, Keep::Steps).unwrap()
}

/// Of the ideal arm at 125 Hz, and of one with delays, noise, friction and elasticity.
#[test]
fn the_live_recording_is_its_own_replay_bit_for_bit() {
    for name in ["table3.toml", "imperfect.toml"] {
        let resolved = resolved(name);
        let (ran, live) = ran(&resolved, MIXED, &asked(Until::Program, 30.0));
        assert_eq!(ran.end, ProgramEnd::Finished, "{}", ran.detail);
        let (period_s, states) = (ran.set_points.period_s(), ran.set_points.states());
        let times_s: Vec<f64> = (0..states.len()).map(|k| k as f64 * period_s).collect();
        let between = Between::Quintics;
        let motion = JointTrajectory::sampled(Phase::Replay, between, &times_s, states).unwrap();

        let model = ClearanceModel::new(&resolved.cell);
        let setup = Setup::new(&resolved, &model).unwrap();
        let mut replayed = None;
        let mut ended = |_, result| replayed = Some(result);
        let job = setup.job(&motion);
        let (pool, settings) = (EnginePool::new(&ENGINES[..1]), setup.motion_settings());
        let hooks = Hooks::default();
        let done = run_motions(&pool, ENGINES[0], &[job], settings, hooks, &mut ended);
        assert!(done.error.is_none(), "{:?}", done.error);
        let replayed: Recording = replayed.unwrap().unwrap();
        assert!(live.steps() > 2000, "{}", live.steps());
        assert_eq!(live.steps(), replayed.steps());
        assert!(live.time_s == replayed.time_s && live.state == replayed.state);
        assert!(live.torque_nm == replayed.torque_nm && live.drive_nm == replayed.drive_nm);
        // No step begins at the end, where a trajectory has its last curve and the record its last set-point.
        let end = live.steps();
        assert!(live.reference[..end] == replayed.reference[..end]);
    }
}

#[test]
fn the_same_program_does_the_same_twice() {
    let resolved = resolved("imperfect.toml");
    let [one, two] = [(); 2].map(|()| ran(&resolved, MIXED, &asked(Until::Program, 30.0)).0);
    assert_eq!(one.set_points, two.set_points);
    assert_eq!(one.lines, two.lines);
    assert_eq!(one.log.events, two.log.events);
}

fn kinds(events: &[ProgramEvent]) -> Vec<(&str, Option<usize>)> {
    events.iter().map(|each| (each.kind, each.line)).collect()
}

#[test]
fn programs_end_in_their_own_ways_at_their_own_places() {
    let resolved = resolved("robot/biopsy.toml");
    let limit = asked(Until::Program, 2.0);
    for (text, end, detail, last) in [
        (
            "def p():\n  textmsg(\"a\")\n  halt\nend\n",
            ProgramEnd::Halted,
            "the program halted",
            1,
        ),
        (
            "def p():\n  x = [1, 2]\n  movej([0, 0, x[2], 0, 0, 0])\nend\n",
            ProgramEnd::Exception,
            "runtime exception at line 3, column ",
            3,
        ),
        // Refused by the controller, not by the language.
        (
            "def p():\n  servoj([0, 0, 0, 0, 0, 0], t = 0.002, lookahead_time = 5, gain = 300)\nend\n",
            ProgramEnd::Exception,
            "runtime exception at line 2, column 3: lookahead_time is 5 s, outside [0.03, 0.2] s",
            2,
        ),
        (
            "def p():\n  speedl([0, 0, -0.5, 0, 0, 0], 1.0)\n  sleep(5)\nend\n",
            ProgramEnd::ProtectiveStop,
            "protective stop at line 2, column 3: ",
            2,
        ),
        (
            "def p():\n  while True:\n    sync()\n  end\nend\n",
            ProgramEnd::TimeLimit,
            "the program had not ended after 2 s",
            1,
        ),
        (
            "def p():\n  while True:\n    x = 1\n  end\nend\n",
            ProgramEnd::ProtectiveStop,
            "protective stop at line 1, column 1: the program `p` computed for 1 s",
            1,
        ),
    ] {
        let (ran, _) = ran(&resolved, text, &limit);
        assert_eq!(ran.end, end, "{text} {}", ran.detail);
        assert!(ran.detail.starts_with(detail), "{} {detail}", ran.detail);
        assert_eq!(kinds(&ran.log.events).last(), Some(&("end", Some(last))));
        let states = ran.set_points.states();
        assert_eq!(states.len(), ran.lines.len());
        let speed = states.last().unwrap().velocity.amax();
        assert!(speed <= 0.0, "{text} {speed}");
    }
}

/// Stands for the scenario's hold, and no longer.
#[test]
fn a_run_until_the_hold_ends_with_the_hold() {
    let resolved = resolved("robot/biopsy.toml");
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/robot");
    let text = std::fs::read_to_string(folder.join("never_ends.script")).unwrap();
    let (ran, _) = ran(&resolved, &text, &asked(Until::Hold, 30.0));
    assert_eq!(ran.end, ProgramEnd::AsAsked);
    let states = ran.set_points.states();
    let still = states
        .iter()
        .rev()
        .take_while(|each| each.velocity.amax() <= 0.0);
    let stood_s = (still.count() - 1) as f64 * ran.set_points.period_s();
    let hold_s = resolved.scenario.motion.hold_s;
    assert!((stood_s - hold_s).abs() < 3.0 * 0.002, "{stood_s} {hold_s}");
}

/// Central differences over 1e-6 s are off by their square, and by rounding.
const DIFFERENCE: f64 = 1e-8;

#[test]
fn the_tools_speed_is_the_change_of_its_pose() {
    let resolved = resolved("robot/biopsy.toml");
    let (period_s, kinematics) = controller_of(&resolved).unwrap();
    let arm = arm(&resolved, period_s, &kinematics);
    let tcp = Pose::new(
        nalgebra::Vector3::new(0.02, -0.03, 0.12),
        nalgebra::Vector3::new(0.3, 0.1, -0.2),
    );
    let (q, qd) = (
        Joints::from([0.1, -1.7, 1.9, -1.8, -1.4, 0.2]),
        Joints::from([0.3, -0.2, 0.4, 0.1, -0.5, 0.7]),
    );
    let mut host = RobotHost::new(&arm, &q, Some(tcp));
    let plant = PlantState {
        position: q,
        velocity: qd,
        world_from_flange: Pose::identity(),
        contact: needlebench_engine::Contact::default(),
    };
    host.see(&plant, &Controller::new(&arm, q, true).unwrap());
    let h = 1e-6;
    let pose = |time_s: f64| {
        base_from_base_link() * kinematics.base_link_from_flange(&(q + qd * time_s)) * tcp
    };
    let (before, after) = (pose(-h), pose(h));
    let linear = (after.translation.vector - before.translation.vector) / (2.0 * h);
    let angular = rotation_vector(&(after.rotation * before.rotation.inverse())) / (2.0 * h);
    let found = host.state().tool_speed;
    for i in 0..3 {
        assert!(
            (found[i] - linear[i]).abs() < DIFFERENCE,
            "{found:?} {linear}"
        );
        assert!(
            (found[i + 3] - angular[i]).abs() < DIFFERENCE,
            "{found:?} {angular}"
        );
    }
    // What is not simulated is refused and not left out.
    let circle = Request::ServoCircle {
        to: tcp,
        acceleration: 1.0,
        speed: 0.1,
        blend_m: 0.0,
        flange_from_tcp: tcp,
    };
    assert!(host.begin(&circle, Place::START).is_err());
}

#[test]
fn a_step_that_does_not_fit_a_cycle_is_refused() {
    let resolved = resolved("robot/biopsy.toml");
    assert_eq!(steps(&resolved, 0.002, 0.001).unwrap(), 2);
    assert_eq!(steps(&resolved, 0.008, 0.0004).unwrap(), 20);
    let error = steps(&resolved, 0.002, 0.0015).unwrap_err();
    assert_eq!(error.key.as_deref(), Some("engines.timestep_ms"));
    assert!(steps(&resolved, 0.002, 0.004).is_err());
}
