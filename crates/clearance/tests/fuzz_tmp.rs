mod common;
use common::*;
use nalgebra::*;
use needlebench_cell::shape::Shape;
use needlebench_clearance::*;
use needlebench_kinematics::Pose;
use std::time::Instant;

fn extreme(v: &mut Variety) -> Shape {
    let mut s = || 10f64.powf(v.between(-3.5, 0.3));
    let (a, b, c) = (s(), s(), s());
    match v.between(0.0, 5.0) as u32 {
        0 => Shape::Sphere { radius_m: a },
        1 => Shape::Cylinder {
            radius_m: a,
            half_length_m: b,
        },
        2 => Shape::Capsule {
            radius_m: a,
            half_length_m: b,
        },
        3 => Shape::Cuboid {
            half_extents_m: Vector3::new(a, b, c),
        },
        _ => ellipsoid(
            v.between(3.0, 21.0) as u32,
            v.between(3.0, 21.0) as u32,
            Vector3::new(a, b, c),
        ),
    }
}
#[test]
fn fuzz() {
    let mut v = Variety(7);
    for aligned in [false, true] {
        let (mut wg, mut ws, mut wr, mut wt, mut wm) = (0f64, 0f64, 0f64, 0f64, 0f64);
        let mut np = 0;
        let mut slow = 0f64;
        let mut over = [0; 4];
        let mut ns = 0;
        let n = 300000;
        for i in 0..n {
            let (sa, sb) = (extreme(&mut v), extreme(&mut v));
            let (a, b) = (PreparedShape::new(&sa), PreparedShape::new(&sb));
            let (ra, rb) = (a.bounding_sphere_m().1, b.bounding_sphere_m().1);
            let mut pa = v.pose(0.5 * (ra + rb));
            let mut pb = v.pose(0.5 * (ra + rb));
            if aligned {
                let mut al = |p: &mut Pose| {
                    let k = (v.between(0.0, 4.0) as i32, v.between(0.0, 3.0) as usize);
                    p.rotation = UnitQuaternion::from_axis_angle(
                        &[Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][k.1],
                        f64::from(k.0) * std::f64::consts::FRAC_PI_2,
                    );
                    for j in 0..3 {
                        if v.between(0.0, 1.0) < 0.5 {
                            p.translation.vector[j] = 0.0;
                        }
                    }
                };
                al(&mut pa);
                al(&mut pb);
                if v.between(0.0, 1.0) < 0.3 {
                    pb.translation = pa.translation;
                }
            }
            let t = Instant::now();
            let s = separation(&a, &pa, &b, &pb);
            let dt = t.elapsed().as_secs_f64();
            let d = s.distance_m;
            if dt > slow {
                slow = dt;
                if dt > 1e-3 {
                    println!("slow {dt:.2e} {sa:?} {sb:?} {pa:?} {pb:?} {d}");
                }
            }
            assert!(d.is_finite());
            let w = (s.point_on_b - s.point_on_a);
            let gap = (w - s.normal.into_inner() * d).norm();
            if gap > wg {
                wg = gap;
            }
            if d > 0.0 {
                ns += 1;
                if gap > 1e-10 {
                    over[0] += 1
                }
                if gap > 1e-9 {
                    over[1] += 1
                }
                if gap > 1e-8 {
                    over[2] += 1;
                    if over[2] < 5 {
                        println!("gap {gap:.2e} {d} {sa:?} {sb:?}");
                    }
                }
            } else {
                np += 1;
            }
            let r = separation(&b, &pb, &a, &pa);
            let e = (r.distance_m - d).abs();
            if e > 1e-8 && over[3] < 10 {
                over[3] += 1;
                println!("sym {e:.2e}: {d} {} {sa:?} | {sb:?}", r.distance_m);
                if !matches!(sa, Shape::Convex(_)) && !matches!(sb, Shape::Convex(_)) {
                    println!("{pa:?} {pb:?}")
                }
            }
            if d > 0.0 {
                ws = ws.max(e)
            } else {
                wr = wr.max(e)
            }
            let m = Translation3::from(s.normal.into_inner() * d) * pa;
            let t = separation(&a, &m, &b, &pb).distance_m.abs();
            if t > 1e-8 && over[3] < 10 {
                over[3] += 1;
                println!("touch {t:.2e}: {d} {sa:?} | {sb:?}");
            }
            if t > wt {
                wt = t
            }
            let g = v.pose(1.0);
            let e = (separation(&a, &(g * pa), &b, &(g * pb)).distance_m - d).abs();
            wm = wm.max(e);
        }
        println!(
            "aligned {aligned} n {n} sep {ns} pen {np} gap {wg:.2e} over {over:?} sym sep {ws:.2e} pen {wr:.2e} touch {wt:.2e} move {wm:.2e} slowest {slow:.2e}"
        );
    }
}
