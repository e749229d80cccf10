#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/harness.rs"]
mod harness;
use nalgebra::*;
use needlebench_cell::shape::*;
use needlebench_cell::*;
use needlebench_engine::*;
use needlebench_kinematics::*;
use std::sync::Arc;
use std::time::Instant;
fn ellipsoid(n: usize, a: [f64; 3]) -> Shape {
    let mut v = vec![];
    for i in 0..n {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let r = (1.0 - z * z).sqrt();
        let p = 2.399963229728653 * i as f64;
        v.push(Point3::new(
            a[0] * r * p.cos(),
            a[1] * r * p.sin(),
            a[2] * z,
        ));
    }
    Shape::Convex(Arc::new(ConvexMesh(TriangleMesh {
        vertices_m: v,
        triangles: vec![],
    })))
}
fn cpu() -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse::<f64>()
        .unwrap()
        * 1e-9
}
fn main() {
    let free = common::ur3(vec![]);
    let q = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);
    let exit = free.world_from_guide_exit(&q);
    let s = |name: String, shape, pose| Solid {
        name,
        shape,
        parent_from_shape: pose,
    };
    let mut skin = vec![s(
        "skin".into(),
        ellipsoid(400, [0.1, 0.05, 0.11]),
        exit * Pose::translation(0.0, 0.0, 0.11 + 0.025),
    )];
    for i in 0..10 {
        skin.push(s(
            format!("piece{i}"),
            ellipsoid(20, [0.1, 0.02, 0.01]),
            exit * Pose::translation(0.0, 0.0, 0.14 + 0.02 * i as f64),
        ));
    }
    let mut gantry = vec![];
    for i in 0..24 {
        let a = i as f64 * std::f64::consts::TAU / 24.0;
        gantry.push(s(
            format!("g{i}"),
            Shape::Cuboid {
                half_extents_m: Vector3::new(0.05, 0.1, 0.15),
            },
            Pose::translation(0.3 + 1.1 * a.cos(), -0.2 + 1.1 * a.sin(), 0.9),
        ));
    }
    let table = (0..6)
        .map(|i| {
            s(
                format!("t{i}"),
                Shape::Cuboid {
                    half_extents_m: Vector3::new(0.25, 0.3, 0.03),
                },
                Pose::translation(0.3, -1.0 + 0.3 * i as f64, -0.3),
            )
        })
        .collect();
    let mount = (0..4)
        .map(|i| {
            s(
                format!("m{i}"),
                Shape::Cuboid {
                    half_extents_m: Vector3::new(0.1, 0.1, 0.05),
                },
                free.robot.world_from_base_link
                    * Pose::translation(0.0, 0.0, -0.26 - 0.1 * i as f64),
            )
        })
        .collect();
    let b = |name: &str, kind, solids| CollisionBody {
        name: name.into(),
        kind,
        frame: Frame::World,
        solids,
    };
    let mut cell = common::ur3(vec![
        b("phantom", BodyKind::Phantom, skin),
        b("table", BodyKind::Table, table),
        b("gantry", BodyKind::Gantry, gantry),
        b("mount", BodyKind::Mount, mount),
    ]);
    // more arm solids
    let mut n = 0;
    for body in cell.bodies.iter_mut() {
        if let Frame::Link(_) = body.frame {
            if body.kind == BodyKind::Link {
                let base = body.solids[0].clone();
                while body.solids.len() < 4 {
                    let mut c = base.clone();
                    c.name = format!("{}x{}", c.name, body.solids.len());
                    c.parent_from_shape.translation.vector *= 0.9;
                    body.solids.push(c);
                }
            }
            n += body.solids.len();
        }
    }
    println!(
        "moving solids {n} static {}",
        cell.bodies
            .iter()
            .filter(|b| b.frame == Frame::World)
            .map(|b| b.solids.len())
            .sum::<usize>()
    );
    let servo = Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    };
    let reference = needlebench_kinematics::trajectory::JointState::at_rest(q);
    let steps = 20000;
    // servo alone
    let t0 = Instant::now();
    let mut acc = 0.0;
    for i in 0..steps {
        let o = servo.torque(
            &reference,
            &(q.add_scalar(1e-9 * i as f64)),
            &Joints::zeros(),
        );
        acc += o.torque_nm[0];
    }
    println!(
        "servo {:.2} us ({acc:.1})",
        t0.elapsed().as_secs_f64() * 1e6 / steps as f64
    );
    let mut bench = |plant: &mut dyn Plant| {
        for rep in 0..3 {
            let t0 = Instant::now();
            let mut st = plant.reset(&q).unwrap();
            let tr = t0.elapsed();
            let c0 = cpu();
            let t0 = Instant::now();
            for k in 0..steps {
                let w = (k as f64 * 1e-3).sin() * 0.02;
                let r = needlebench_kinematics::trajectory::JointState {
                    position: q.add_scalar(w * 0.1),
                    ..reference
                };
                let o = servo.torque(&r, &st.position, &st.velocity);
                st = plant.step(&o.torque_nm).unwrap();
            }
            println!(
                "{} rep {rep}: reset {:.1} us, step+servo {:.2} us wall {:.2} us cpu, contacts {:?}",
                plant.identity().name,
                tr.as_secs_f64() * 1e6,
                t0.elapsed().as_secs_f64() * 1e6 / steps as f64,
                (cpu() - c0) * 1e6 / steps as f64,
                st.contact
            );
        }
    };
    let mut rp = RapierPlant::new(&cell, 1e-3, &RapierSettings::default()).unwrap();
    bench(&mut rp);
    let empty = common::ur3(vec![]);
    let mut rp = RapierPlant::new(&empty, 1e-3, &RapierSettings::default()).unwrap();
    bench(&mut rp);
    if std::env::var("RAPIER_ONLY").is_ok() {
        return;
    }
    let mut h = harness::harness();
    for integ in [MujocoIntegrator::Implicit, MujocoIntegrator::Euler] {
        let mut mp = MujocoPlant::new(
            &mut h,
            &cell,
            1e-3,
            &MujocoSettings {
                integrator: integ,
                ..Default::default()
            },
        )
        .unwrap();
        bench(&mut mp);
    }
}
