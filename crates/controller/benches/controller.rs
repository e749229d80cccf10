//! One cycle of each kind of motion, in the middle of it, and of those that begin one: of a UR3e at 500 Hz. The core's
//! mark is 0.1 ms a cycle, with an engine: twenty times real time.
//!
//! `cargo bench -p needlebench-controller --bench controller`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::{UnitQuaternion, Vector3, Vector6};
use needlebench_controller::{
    ArmData, Command, Controller, Event, Goal, Measured, Move, Origin, Request, StopData,
};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Joints, LimitPolicy, Pose, UrModel, base_from_base_link};
use needlebench_urscript::{MotionKind, Pace};

const PACE: Pace = Pace {
    acceleration: 1.2,
    speed: 0.25,
    time_s: None,
};

fn cell() -> (Controller, Measured, Pose) {
    let start = Joints::from([0.1, -1.7, 1.9, -1.8, -1.4, 0.2]);
    let arm = ArmData {
        kinematics: Kinematics::new(UrModel::Ur3e.geometry().chain()).unwrap(),
        limits: LimitPolicy::FULL_TURNS.limits_of(UrModel::Ur3e),
        acceleration_rad_s2: Joints::repeat(16.0),
        period_s: 0.002,
        ramp_s: 0.14,
        servo_delay_s: 0.004,
        stop: StopData {
            deceleration_rad_s2: 15.0,
            ramp_s: 0.04,
        },
    };
    let measured = Measured {
        position: start,
        wall_s: f64::NAN,
    };
    let pose = base_from_base_link() * arm.kinematics.base_link_from_flange(&start);
    let mut controller = Controller::new(&arm, start, true).unwrap();
    controller.cycle(&measured, &[request(Command::Play)]);
    (controller, measured, pose)
}

fn request(what: Command) -> Request {
    let from = Origin {
        door: 0,
        client: 0,
        arrival: 0,
    };
    Request { from, what }
}

fn movement(goal: Goal) -> Request {
    request(Command::Move(Box::new(Move {
        flange_from_tcp: Pose::identity(),
        goal,
    })))
}

fn line(from: &Pose, by_m: Vector3<f64>, blend_m: f64) -> Request {
    let to = Pose::from_parts(
        (from.translation.vector + by_m).into(),
        UnitQuaternion::from_scaled_axis(by_m) * from.rotation,
    );
    movement(Goal::Motion(MotionKind::Line {
        to,
        pace: PACE,
        blend_m,
    }))
}

fn cycles(criterion: &mut Criterion) {
    let (idle, measured, pose) = cell();
    let start = measured.position;
    let joints = movement(Goal::Motion(MotionKind::Joints {
        to: start + Joints::repeat(0.5),
        pace: PACE,
        blend_m: 0.0,
    }));
    let to_corner = line(&pose, Vector3::new(0.0, 0.1, 0.05), 0.03);
    let servo = movement(Goal::Motion(MotionKind::Servo {
        to: start + Joints::repeat(0.01),
        time_s: 0.002,
        lookahead_s: 0.1,
        gain: 300.0,
    }));
    let joint_speed = movement(Goal::JointSpeed {
        speed: Joints::repeat(0.2),
        acceleration: 2.0,
        time_s: None,
    });
    let tool_speed = movement(Goal::ToolSpeed {
        speed: Vector6::new(0.02, 0.02, 0.02, 0.1, 0.0, 0.0),
        acceleration: 1.0,
        time_s: None,
    });
    let mut group = criterion.benchmark_group("cycle");
    let mut measure = |name: &str, controller: &Controller, requests: &[Request]| {
        group.bench_function(name, |bencher| {
            bencher.iter_batched_ref(
                || controller.clone(),
                |controller| controller.cycle(&measured, requests),
                BatchSize::SmallInput,
            );
        });
    };
    measure("idle", &idle, &[]);
    for (name, begin) in [
        ("movej", joints),
        ("movel", to_corner.clone()),
        ("servoj", servo),
        ("speedj", joint_speed),
        ("speedl", tool_speed),
    ] {
        let begin = [begin];
        measure(&format!("{name}, its first"), &idle, &begin);
        let mut moving = idle.clone();
        moving.cycle(&measured, &begin);
        for _ in 0..100 {
            moving.cycle(&measured, &[]);
        }
        measure(name, &moving, &[]);
    }
    // The cycle that finds the corner, the one that finds when the blend begins, and one within it.
    let mut moving = idle.clone();
    let mut before = moving.clone();
    let mut requests = vec![to_corner];
    loop {
        let cycle = moving.cycle(&measured, &requests);
        let is_done = |event: &Event| matches!(event, Event::Done { .. });
        if cycle.events.iter().any(is_done) {
            break;
        }
        before = moving.clone();
        requests.clear();
    }
    measure("movel, its corner", &before, &[]);
    let corner = Pose::from_parts(
        (pose.translation.vector + Vector3::new(0.0, 0.1, 0.05)).into(),
        pose.rotation,
    );
    let next = [line(&corner, Vector3::new(0.1, 0.0, 0.0), 0.0)];
    measure("movel, blended into", &moving, &next);
    moving.cycle(&measured, &next);
    for _ in 0..20 {
        moving.cycle(&measured, &[]);
    }
    measure("movel, two blended", &moving, &[]);
    group.finish();
}

criterion_group!(benches, cycles);
criterion_main!(benches);
