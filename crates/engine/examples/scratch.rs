#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/harness.rs"]
mod harness;
use needlebench_engine::*;
use needlebench_kinematics::trajectory::*;
use needlebench_kinematics::*;
fn main() {
    let cell = common::ur3(Vec::new());
    let servo = Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    };
    let mut h = harness::harness();
    for (vel, acc, jerk) in [(1.05, 1.4, 10.0), (1.5, 4.0, 40.0), (3.0, 8.0, 100.0)] {
        let limits = MotionLimits {
            velocity: Joints::repeat(vel),
            acceleration: Joints::repeat(acc),
            jerk: Joints::repeat(jerk),
            line: ProfileLimits {
                velocity: 0.1,
                acceleration: 0.5,
                jerk: 5.0,
            },
        };
        let a = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);
        let b = Joints::new(1.4, -1.0, 0.9, -2.0, -0.4, 1.3);
        let t = JointTrajectory::starting_at(a)
            .then_straight_to(Phase::Transfer, b, &limits)
            .then_hold(Phase::Hold, 1.0);
        for dt in [1e-3, 1e-4] {
            let mut rp = RapierPlant::new(&cell, dt, &RapierSettings::default()).unwrap();
            let r = simulate(&mut rp, &servo, &t, Hooks::default()).unwrap();
            for integrator in [MujocoIntegrator::Euler, MujocoIntegrator::Implicit] {
                let mut mp = MujocoPlant::new(
                    &mut h,
                    &cell,
                    dt,
                    &MujocoSettings {
                        integrator,
                        ..Default::default()
                    },
                )
                .unwrap();
                let m = simulate(&mut mp, &servo, &t, Hooks::default()).unwrap();
                let tip = |s: &PlantState| {
                    (s.world_from_flange * nalgebra::Point3::new(0.0, 0.06, 0.25)).coords
                };
                let mut peak = 0.0f64;
                let mut at = 0.0;
                let mut joint = 0.0f64;
                for k in 0..r.state.len() {
                    let d = (tip(&r.state[k]) - tip(&m.state[k])).norm();
                    joint = joint.max((r.state[k].position - m.state[k].position).amax());
                    if d > peak {
                        peak = d;
                        at = r.time_s[k];
                    }
                }
                let settled =
                    (tip(&r.state.last().unwrap()) - tip(&m.state.last().unwrap())).norm();
                let track = |x: &Recording| {
                    let mut w = 0.0f64;
                    for k in 0..x.state.len() {
                        let reft = (cell.robot.world_from_flange(&x.reference[k].position)
                            * nalgebra::Point3::new(0.0, 0.06, 0.25))
                        .coords;
                        w = w.max((reft - tip(&x.state[k])).norm());
                    }
                    w
                };
                let end = |x: &Recording| {
                    (cell.robot.world_from_flange(&t.end())
                        * nalgebra::Point3::new(0.0, 0.06, 0.25))
                    .coords
                        - tip(x.state.last().unwrap())
                };
                println!(
                    "vel {vel} acc {acc} dt {dt} T {:.2} {integrator:?}: peak {peak:.3e} m at {at:.3} joint {joint:.2e}; settled {settled:.3e}; tracking r {:.3e} m {:.3e}; end r {:.2e} m {:.2e}; sat {} {}; wall us/step r {:.2} m {:.2}",
                    t.duration_s(),
                    track(&r),
                    track(&m),
                    end(&r).norm(),
                    end(&m).norm(),
                    r.saturated_steps,
                    m.saturated_steps,
                    r.cost.wall.as_secs_f64() * 1e6 / r.steps() as f64,
                    m.cost.wall.as_secs_f64() * 1e6 / m.steps() as f64
                );
            }
        }
    }
}
