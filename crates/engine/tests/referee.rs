//! scratch
mod common;
#[path = "common/harness.rs"]
mod harness;
use nalgebra::{Point3, Vector3};
use needlebench_engine::*;
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::*;

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> MotionLimits {
    MotionLimits {
        velocity: Joints::repeat(velocity),
        acceleration: Joints::repeat(acceleration),
        jerk: Joints::repeat(jerk),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 0.5,
            jerk: 5.0,
        },
    }
}
fn tip(state: &PlantState) -> Vector3<f64> {
    (state.world_from_flange * Point3::new(0.0, 0.06, 0.25)).coords
}
#[test]
fn explore() {
    let cell = common::ur3(Vec::new());
    let start = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);
    let end = Joints::new(1.4, -1.0, 0.9, -2.0, -0.4, 1.3);
    let trajectory = JointTrajectory::starting_at(start)
        .then_straight_to(Phase::Transfer, end, &limits(1.5, 4.0, 40.0))
        .then_hold(Phase::Hold, 0.8);
    println!("duration {}", trajectory.duration_s());
    let servo = Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    };
    let mut harness = harness::harness();
    for h in [1e-3, 5e-4, 2.5e-4, 1e-4] {
        let mut recs: Vec<Recording> = Vec::new();
        let mut rapier = RapierPlant::new(&cell, h, &RapierSettings::default()).unwrap();
        recs.push(simulate(&mut rapier, &servo, &trajectory, Hooks::default()).unwrap());
        for integrator in [MujocoIntegrator::Implicit, MujocoIntegrator::Euler] {
            let mut mujoco = MujocoPlant::new(
                &mut harness,
                &cell,
                h,
                &MujocoSettings {
                    integrator,
                    ..Default::default()
                },
            )
            .unwrap();
            recs.push(simulate(&mut mujoco, &servo, &trajectory, Hooks::default()).unwrap());
        }
        for hold in [TorqueHold::AroundSample, TorqueHold::FromSample] {
            let mut plant = RefereePlant::new(
                &cell,
                h,
                &RefereeSettings {
                    hold,
                    ..Default::default()
                },
            )
            .unwrap();
            let closed = simulate(&mut plant, &servo, &trajectory, Hooks::default()).unwrap();
            println!("h {h} {hold:?} wall {:?}", closed.cost.wall);
            for rec in &recs {
                let d: Vec<f64> = rec
                    .state
                    .iter()
                    .zip(&closed.state)
                    .map(|(a, b)| (tip(a) - tip(b)).norm())
                    .collect();
                let v = rec
                    .state
                    .iter()
                    .zip(&closed.state)
                    .map(|(a, b)| (a.velocity - b.velocity).amax())
                    .fold(0., f64::max);
                // open loop
                let mut open = vec![plant.reset(&start).unwrap()];
                for t in &rec.torque_nm {
                    open.push(plant.step(t).unwrap());
                }
                let o: Vec<f64> = rec
                    .state
                    .iter()
                    .zip(&open)
                    .map(|(a, b)| (tip(a) - tip(b)).norm())
                    .collect();
                println!(
                    "{:?} closed peak {:.3e} settled {:.3e} vel {v:.3e}; open peak {:.3e}, at 1 s {:.3e} at 0.1s {:.3e}",
                    rec.engine.name,
                    d.iter().copied().fold(0., f64::max),
                    d[d.len() - 1],
                    o.iter().copied().fold(0., f64::max),
                    o[(1.0 / h) as usize],
                    o[(0.1 / h) as usize]
                );
            }
        }
    }
}
