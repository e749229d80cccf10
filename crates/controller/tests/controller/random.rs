//! What holds of any requests.

use nalgebra::{Vector3, Vector6};
use needlebench_controller::{Command, Event, Goal, Request, SetPoints};
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use needlebench_numerics::random::SplitMix64;
use needlebench_urscript::{MotionKind, Pace};

use crate::{Cell, MOST_RAD_S2, STOP, arm, goal, motion, start};

const SEQUENCES: u64 = 10_000;
const CYCLES: u32 = 20;

/// How far joints may go either way: limits of position that are met often, and ones that leave room for speed.
fn reach_rad(seed: u64) -> f64 {
    if seed.is_multiple_of(2) { 0.4 } else { 4.0 }
}

/// A value, at times one that nobody means.
fn number(random: &mut SplitMix64, low: f64, high: f64) -> f64 {
    match random.below(40) {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => -random.uniform(low, high),
        3 => 1e300,
        4 => 0.0,
        _ => random.uniform(low, high),
    }
}

fn joints(random: &mut SplitMix64, about: &Joints, most: f64) -> Joints {
    let mut joints = about.map(|value| value + random.uniform(-most, most));
    if random.below(4) == 0 {
        joints[random.below(6) as usize] = number(random, -7.0, 7.0);
    }
    joints
}

fn pace(random: &mut SplitMix64, most: f64) -> Pace {
    Pace {
        acceleration: number(random, 0.1, 4.0 * most),
        speed: number(random, 0.05, most),
        time_s: (random.below(4) == 0).then(|| number(random, 0.05, 2.0)),
    }
}

fn command(random: &mut SplitMix64, cell: &Cell) -> Command {
    let at = cell.position();
    let tcp = cell.base_from_tcp(&at);
    let near =
        |random: &mut SplitMix64, most: f64| Vector3::from_fn(|_, _| random.uniform(-most, most));
    let mut pose = Pose::from_parts(
        (tcp.translation.vector + near(random, 0.15)).into(),
        nalgebra::UnitQuaternion::from_scaled_axis(near(random, 0.5)) * tcp.rotation,
    );
    if random.below(20) == 0 {
        pose.translation.vector.y = number(random, -2.0, 2.0);
    }
    let blend_m = if random.below(2) == 0 {
        0.0
    } else {
        number(random, 0.0, 0.1)
    };
    match random.below(30) {
        0 => Command::PowerOn,
        1 => Command::ReleaseBrakes,
        2 => Command::Unlock,
        3 => Command::ReleaseEmergencyStop,
        4 => Command::CloseSafeguard,
        5 => Command::Pause,
        6 => Command::SetSpeed(number(random, 0.01, 1.0)),
        7 => match random.below(12) {
            0 => Command::PowerOff,
            1 => Command::PressEmergencyStop,
            2 => Command::ProtectiveStop,
            3 => Command::OpenSafeguard,
            4 => Command::Stop,
            _ => Command::Play,
        },
        8..=10 => Command::Play,
        11..=14 => motion(MotionKind::Joints {
            to: joints(random, &at, 1.0),
            pace: pace(random, 3.0),
            blend_m,
        }),
        15..=17 => motion(MotionKind::Line {
            to: pose,
            pace: pace(random, 0.5),
            blend_m,
        }),
        18 => motion(MotionKind::Process {
            to: pose,
            pace: pace(random, 0.5),
            blend_m,
        }),
        19 => motion(MotionKind::Circle {
            via_m: tcp.translation.vector + near(random, 0.1),
            to: pose,
            pace: pace(random, 0.5),
            blend_m,
        }),
        20..=22 => motion(MotionKind::Servo {
            to: joints(random, &at, 0.05),
            time_s: number(random, 0.002, 0.05),
            lookahead_s: number(random, 0.03, 0.2),
            gain: number(random, 100.0, 2000.0),
        }),
        23..=25 => goal(Goal::JointSpeed {
            speed: joints(random, &Joints::zeros(), 2.0),
            acceleration: number(random, 0.1, 20.0),
            time_s: (random.below(2) == 0).then(|| number(random, 0.0, 1.0)),
        }),
        26..=27 => goal(Goal::ToolSpeed {
            speed: Vector6::from_fn(|_, _| random.uniform(-0.5, 0.5)),
            acceleration: number(random, 0.1, 10.0),
            time_s: (random.below(2) == 0).then(|| number(random, 0.0, 1.0)),
        }),
        28 => motion(MotionKind::Stop {
            deceleration: number(random, 0.1, 20.0),
            is_linear: random.below(2) == 0,
        }),
        _ => motion(MotionKind::Stop {
            deceleration: -1.0,
            is_linear: false,
        }),
    }
}

/// What came of a sequence: for the comparison of two runs, and for counts.
struct Run {
    record: SetPoints,
    events: Vec<Event>,
}

fn run(seed: u64, cycles: u32) -> Run {
    let mut random = SplitMix64::new(seed);
    let mut arm = arm(if seed.is_multiple_of(4) { 0.008 } else { 0.002 });
    for (i, limit) in arm.limits.0.iter_mut().enumerate() {
        limit.lower_rad = start()[i] - reach_rad(seed);
        limit.upper_rad = start()[i] + reach_rad(seed);
    }
    let mut cell = Cell::of(&arm);
    cell.off = joints(&mut random, &Joints::zeros(), 0.05);
    cell.ask(Command::Play);
    let mut from = Vec::new();
    for _ in 0..cycles {
        let mut requests = Vec::new();
        while random.below(3) == 0 {
            let what = command(&mut random, &cell);
            from.push(cell.origin());
            requests.push(Request {
                from: from[from.len() - 1],
                what,
            });
        }
        cell.cycle(&requests);
        // Motions have time to get somewhere.
        if random.below(3) == 0 {
            for _ in 0..random.below(40) {
                cell.cycle(&[]);
            }
        }
    }
    // One answer each; a move that waited may turn out to have no course.
    for from in from {
        let answers = cell.events.iter().filter(|event| match event {
            Event::Accepted { from: of } | Event::Refused { from: of, .. } => *of == from,
            _ => false,
        });
        assert!((1..=2).contains(&answers.count()), "{seed}");
    }
    Run {
        record: cell.record,
        events: cell.events,
    }
}

#[test]
fn no_requests_move_the_arm_out_of_its_limits_or_apart() {
    let most_rad_s = arm(0.002).limits.velocities_rad_s();
    let (mut trips, mut dones, mut refusals, mut stops) = (0_u32, 0_u32, 0_u32, 0_u32);
    let (mut worst, mut between) = ([0.0_f64; 2], [0.0_f64; 2]);
    for seed in 0..SEQUENCES {
        let run = run(seed, CYCLES);
        let t = run.record.period_s();
        let states = run.record.states();
        for (k, pair) in states.windows(2).enumerate() {
            let (a, b) = (pair[0], pair[1]);
            for share in [0.25, 0.5, 0.75] {
                let inside = run.record.sample((k as f64 + share) * t);
                between = [
                    between[0].max(inside.velocity.component_div(&most_rad_s).amax()),
                    between[1].max(inside.acceleration.amax()),
                ];
            }
            for i in 0..JOINT_COUNT {
                let (q, v, w) = (b.position[i], b.velocity[i], b.acceleration[i]);
                assert!(q.is_finite() && v.is_finite() && w.is_finite(), "{seed}");
                assert!(v.abs() <= most_rad_s[i] * (1.0 + 1e-6), "{seed} {k}: {v}");
                // Stops decelerate by less than that here.
                assert!(w.abs() <= MOST_RAD_S2 * (1.0 + 1e-6), "{seed} {k}: {w}");
                let off = (q - start()[i]).abs();
                assert!(off <= reach_rad(seed) + 1e-9, "{seed} {k}: {off}");
                // The course is twice continuously differentiable: what its ends say agrees.
                let mean = (b.position[i] - a.position[i]) / t;
                let ends = 0.5 * (a.velocity[i] + b.velocity[i]);
                worst[0] = worst[0].max((mean - ends).abs() / t);
                let mean = (b.velocity[i] - a.velocity[i]) / t;
                let ends = 0.5 * (a.acceleration[i] + b.acceleration[i]);
                worst[1] = worst[1].max((mean - ends).abs());
            }
        }
        for event in &run.events {
            match event {
                Event::Trip { .. } => trips += 1,
                Event::Done { .. } => dones += 1,
                Event::Refused { .. } => refusals += 1,
                Event::Stopping { .. } => stops += 1,
                _ => {}
            }
        }
    }
    assert!(trips > 500 && dones > 2000 && refusals > 5000 && stops > 2000);
    // Accelerations go from 16 to -16 rad/s^2 at most over a period, linearly (Newmark): d a / 12. Otherwise jerk jumps
    // within a period: j T / 8 at 375 rad/s^3 and 8 ms, for each of its phases that end there.
    assert!(
        worst[0] < 32.0 / 12.0 * 1.001 && worst[1] < 2.0,
        "{worst:?}"
    );
}

#[test]
fn the_same_requests_give_the_same_bits() {
    for seed in 0..200 {
        let [one, other] = [run(seed, CYCLES), run(seed, CYCLES)];
        assert_eq!(one.record, other.record);
        // NaN of refused values is not equal to itself.
        assert_eq!(format!("{:?}", one.events), format!("{:?}", other.events));
    }
}

/// From whatever motion: the arm stands where it said, within a bound from its speed `v` and acceleration `w` alone.
///
/// The acceleration is gone after the ramp `r` at the latest, the speed `v + w r / 2` then after `v / a` and ramps,
/// and a joint goes no farther than at this speed all the time; half of it but for the ramps.
#[test]
fn stops_from_any_motion_are_as_long_as_told() {
    let mut moving = 0;
    for seed in 0..2000 {
        let mut random = SplitMix64::new(seed);
        let mut cell = Cell::playing(0.002);
        for _ in 0..12 {
            let what = command(&mut random, &cell);
            if matches!(what, Command::Move(_) | Command::Play) {
                cell.ask(what);
                cell.wait(random.uniform(0.0, 0.1));
            }
        }
        let from = *cell.controller.set_point();
        cell.events.clear();
        cell.ask(if seed.is_multiple_of(2) {
            Command::ProtectiveStop
        } else {
            Command::PressEmergencyStop
        });
        let Some(Event::Stopping { way_rad, .. }) = cell
            .events
            .iter()
            .find(|event| matches!(event, Event::Stopping { .. }))
            .copied()
        else {
            continue;
        };
        cell.wait(1.0);
        assert!(cell.controller.is_steady(), "{seed}");
        let way = cell.position() - from.position;
        assert!((way - way_rad).amax() < 1e-9, "{seed}");
        let (v, w) = (from.velocity.amax(), from.acceleration.amax());
        let (a, r) = (STOP.deceleration_rad_s2, STOP.ramp_s);
        let most = (v + 0.5 * w * r) * (0.5 * v / a + 2.0 * r);
        assert!(way.amax() <= most + 1e-9, "{seed}: {} {most}", way.amax());
        moving += u32::from(v > 0.1);
    }
    assert!(moving > 300, "{moving}");
}

/// Programs of blended moves: each within its sphere while two move, and all of them done.
#[test]
fn chains_of_blends_stay_within_their_spheres() {
    let (mut blends, mut inside) = (0, 0);
    for seed in 0..200 {
        let mut random = SplitMix64::new(seed);
        let mut cell = Cell::playing(0.002);
        // The last blend, with the time until which both move.
        let mut sphere: Option<(Vector3<f64>, f64, [f64; 2])> = None;
        for _ in 0..6 {
            let at = cell.position();
            let blend_m = random.uniform(0.005, 0.05);
            let mut near = |most: f64| Vector3::from_fn(|_, _| random.uniform(-most, most));
            let kind = if seed.is_multiple_of(3) {
                let from = cell.base_from_tcp(&at);
                MotionKind::Line {
                    to: Pose::from_parts(
                        (from.translation.vector + near(0.1)).into(),
                        nalgebra::UnitQuaternion::from_scaled_axis(near(0.2)) * from.rotation,
                    ),
                    pace: crate::pace(0.8, 0.15),
                    blend_m,
                }
            } else {
                let [a, b] = [near(0.3), near(0.3)];
                MotionKind::Joints {
                    to: at + Joints::new(a.x, a.y, a.z, b.x, b.y, b.z),
                    pace: crate::pace(2.0, 0.8),
                    blend_m,
                }
            };
            cell.events.clear();
            let mut cycle = cell.ask(motion(kind));
            let done = |event: &Event| matches!(event, Event::Done { .. });
            loop {
                for event in &cycle.events {
                    if let Event::Blend(blend) = event {
                        let corner = cell.base_from_tcp(&blend.corner_rad).translation.vector;
                        // It may wait for the sphere for as long as the program was told ahead.
                        let from_s = cycle.time_s + 3.0 * 0.002;
                        let until_s = cycle.time_s - 0.002 + blend.overlap_s;
                        sphere = Some((corner, blend.radius_m, [from_s, until_s]));
                        blends += 1;
                    }
                }
                if let Some((corner, radius_m, [from_s, until_s])) = sphere
                    && (from_s..until_s).contains(&cycle.time_s)
                {
                    let point = cell.base_from_tcp(&cell.position()).translation.vector;
                    let off = (point - corner).norm();
                    assert!(off <= radius_m * (1.0 + 1e-6), "{seed}: {off} {radius_m}");
                    inside += 1;
                }
                if cell.trip().is_some() || cell.events.iter().any(done) {
                    break;
                }
                assert!(cell.controller.time_s() < 60.0, "{seed}");
                cycle = cell.cycle(&[]);
            }
            if cell.trip().is_some() {
                break;
            }
        }
    }
    assert!(blends > 500 && inside > 20_000, "{blends} {inside}");
}
