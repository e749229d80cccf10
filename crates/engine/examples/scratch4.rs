#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/harness.rs"]
mod harness;
use nalgebra::*;
use needlebench_cell::shape::*;
use needlebench_cell::*;
use needlebench_engine::*;
use needlebench_kinematics::trajectory::*;
use needlebench_kinematics::*;
fn main() {
    let free = common::ur3(Vec::new());
    let servo = Servo {
        dynamics: free.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: free.robot.limits.efforts_nm(),
    };
    let mut h = harness::harness();
    let limits = MotionLimits {
        velocity: Joints::repeat(0.05),
        acceleration: Joints::repeat(1.0),
        jerk: Joints::repeat(50.0),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 0.5,
            jerk: 5.0,
        },
    };
    let q = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);
    let exit = free.world_from_guide_exit(&q);
    let tilted =
        exit * Pose::translation(0.0, 0.0, 0.004) * Pose::rotation(Vector3::new(0.3, 0.0, 0.0));
    let wall = CollisionBody {
        name: "wall".into(),
        kind: BodyKind::Table,
        frame: Frame::World,
        solids: vec![Solid {
            name: "wall".into(),
            shape: Shape::Cuboid {
                half_extents_m: Vector3::new(0.03, 0.03, 0.01),
            },
            parent_from_shape: tilted * Pose::translation(0.0, 0.0, 0.01),
        }],
    };
    let cell = common::ur3(vec![wall]);
    let d =
        free.robot.world_from_base_link.rotation.inverse() * (exit.rotation * Vector3::z()) * 0.008;
    let dq = free.robot.chain.jacobian(&q).try_inverse().unwrap()
        * Vector6::new(d.x, d.y, d.z, 0.0, 0.0, 0.0);
    for hold in [0.5, 1.0, 2.0, 4.0] {
        let t = JointTrajectory::starting_at(q)
            .then_straight_to(Phase::Transfer, q + dq, &limits)
            .then_hold(Phase::Hold, hold);
        let mut rp = RapierPlant::new(&cell, 1e-3, &RapierSettings::default()).unwrap();
        let r = simulate(&mut rp, &servo, &t, Hooks::default()).unwrap();
        let mut mp = MujocoPlant::new(&mut h, &cell, 1e-3, &MujocoSettings::default()).unwrap();
        let m = simulate(&mut mp, &servo, &t, Hooks::default()).unwrap();
        for x in [&r, &m] {
            let s = x.state.last().unwrap();
            let tau = x.torque_nm.last().unwrap();
            let tc = servo.dynamics.gravity_torque(&s.position) - tau;
            let n = tilted.rotation * Vector3::z(); // into wall
            let ex = cell.world_from_guide_exit(&s.position);
            let a = ex.rotation * Vector3::z();
            let radial = (n - a * n.dot(&a)).normalize();
            let p = ex.translation.vector + radial * 0.006;
            let depth = (p - tilted.translation.vector).dot(&n);
            let fl = cell.robot.world_from_flange(&s.position);
            let pf = fl.inverse_transform_point(&Point3::from(p)).coords;
            let b = cell.robot.world_from_base_link.rotation.inverse();
            let j = cell.robot.chain.jacobian_at(&s.position, &pf);
            let nb = b * (-n);
            let w = Vector6::new(nb.x, nb.y, nb.z, 0.0, 0.0, 0.0);
            let g = j.transpose() * w;
            let f = g.dot(&tc) / g.norm_squared();
            let tf = j.transpose().try_inverse().unwrap() * tc; // wrench at p
            let force = b.inverse() * Vector3::new(tf[0], tf[1], tf[2]);
            let mom = b.inverse() * Vector3::new(tf[3], tf[4], tf[5]);
            println!(
                "hold {hold} {}: F fit {f:.4} residual {:.3e} true depth {depth:.3e} contact {:?}; vel {:.1e}; lateral force {:.4} moment {:.2e} qd {:.1e}",
                x.engine.name,
                (tc - g * f).amax(),
                s.contact,
                s.velocity.amax(),
                (force + n * force.dot(&-n) * 1.0 * 1.0 - n * 0.0).norm(),
                mom.norm(),
                (x.state[x.state.len() - 1].position - x.state[x.state.len() - 101].position)
                    .amax()
                    / 0.1
            );
        }
        let tip = |s: &PlantState| (s.world_from_flange * Point3::new(0.0, 0.06, 0.25)).coords;
        println!(
            "   diff {:.3e} contact-point diff",
            (tip(r.state.last().unwrap()) - tip(m.state.last().unwrap())).norm()
        );
    }
}
