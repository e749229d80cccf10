#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/harness.rs"]
mod harness;
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
    for tilt in [0.0f64, 0.3] {
        let wall = CollisionBody {
            name: "wall".into(),
            kind: BodyKind::Table,
            frame: Frame::World,
            solids: vec![Solid {
                name: "wall".into(),
                shape: Shape::Cuboid {
                    half_extents_m: nalgebra::Vector3::new(0.03, 0.03, 0.01),
                },
                parent_from_shape: exit
                    * Pose::translation(0.0, 0.0, 0.002 + 0.006 * tilt.sin())
                    * Pose::rotation(nalgebra::Vector3::new(tilt, 0.0, 0.0))
                    * Pose::translation(0.0, 0.0, 0.01),
            }],
        };
        let cell = common::ur3(vec![wall]);
        let d = free.robot.world_from_base_link.rotation.inverse()
            * (exit.rotation * nalgebra::Vector3::z())
            * 0.006;
        let dq = free.robot.chain.jacobian(&q).try_inverse().unwrap()
            * nalgebra::Vector6::new(d.x, d.y, d.z, 0.0, 0.0, 0.0);
        let t = JointTrajectory::starting_at(q)
            .then_straight_to(Phase::Transfer, q + dq, &limits)
            .then_hold(Phase::Hold, 1.0);
        let tip =
            |s: &PlantState| (s.world_from_flange * nalgebra::Point3::new(0.0, 0.06, 0.10)).coords;
        for friction in [0.0, 0.3] {
            let mut rs = vec![];
            let mut ms = vec![];
            for (f, z, sw) in [
                (694.0, 1.0, 10usize),
                (1e3, 1.0, 10),
                (1e4, 1.0, 10),
                (1e4, 1.0, 50),
                (1e3, 5.0, 10),
                (1e5, 1.0, 10),
                (60.0, 10.0, 10),
            ] {
                let s = RapierSettings {
                    contact_natural_frequency_hz: f,
                    contact_damping_ratio: z,
                    contact_sweeps: sw,
                    friction,
                    ..Default::default()
                };
                let mut rp = RapierPlant::new(&cell, 1e-3, &s).unwrap();
                match simulate(&mut rp, &servo, &t, Hooks::default()) {
                    Ok(r) => {
                        let l = r.state.last().unwrap();
                        let maxpen = r
                            .state
                            .iter()
                            .map(|s| s.contact.deepest_penetration_m)
                            .fold(0.0, f64::max);
                        let maxf = r
                            .state
                            .iter()
                            .map(|s| s.contact.normal_force_n)
                            .fold(0.0, f64::max);
                        println!(
                            "tilt {tilt} mu {friction} R f {f} z {z} sw {sw}: {:?} maxpen {maxpen:.2e} maxF {maxf:.1} move(last100) {:.1e}",
                            l.contact,
                            (tip(l) - tip(&r.state[r.state.len() - 100])).norm()
                        );
                        rs.push(r);
                    }
                    Err(e) => println!("R {f} {z}: {e}"),
                }
            }
            for (k, b, imp) in [
                (1e6, 1e3, 0.95),
                (1e6, 2e3, 0.95),
                (1e6, 1e3, 0.99),
                (1e6, 1e3, 0.999),
                (1e7, 1e3, 0.95),
                (1e5, 500.0, 0.99),
            ] {
                let s = MujocoSettings {
                    contact_stiffness_per_s2: k,
                    contact_damping_per_s: b,
                    contact_impedance: imp,
                    friction,
                    ..Default::default()
                };
                let mut mp = MujocoPlant::new(&mut h, &cell, 1e-3, &s).unwrap();
                match simulate(&mut mp, &servo, &t, Hooks::default()) {
                    Ok(r) => {
                        let l = r.state.last().unwrap();
                        let maxpen = r
                            .state
                            .iter()
                            .map(|s| s.contact.deepest_penetration_m)
                            .fold(0.0, f64::max);
                        let maxf = r
                            .state
                            .iter()
                            .map(|s| s.contact.normal_force_n)
                            .fold(0.0, f64::max);
                        println!(
                            "tilt {tilt} mu {friction} M k {k} b {b} d {imp}: {:?} maxpen {maxpen:.2e} maxF {maxf:.1} move {:.1e}",
                            l.contact,
                            (tip(l) - tip(&r.state[r.state.len() - 100])).norm()
                        );
                        ms.push(r);
                    }
                    Err(e) => println!("M {k} {b}: {e}"),
                }
            }
            for r in &rs {
                let mut line = String::new();
                for m in &ms {
                    let mut pk = 0.0f64;
                    for k in 0..r.state.len() {
                        pk = pk.max((tip(&r.state[k]) - tip(&m.state[k])).norm());
                    }
                    line += &format!(
                        "{:.1e}/{:.1e} ",
                        (tip(r.state.last().unwrap()) - tip(m.state.last().unwrap())).norm(),
                        pk
                    );
                }
                println!("  settled/peak diff: {line}");
            }
        }
    }
}
