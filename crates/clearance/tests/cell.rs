mod common;
use common::{Variety, cell};
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::Joints;
use std::time::Instant;

#[test]
fn speed() {
    let cell = cell();
    let n: usize = cell.bodies.iter().map(|b| b.solids.len()).sum();
    let sp: usize = cell
        .pairs
        .iter()
        .map(|p| cell.bodies[p.a].solids.len() * cell.bodies[p.b].solids.len())
        .sum();
    println!("{n} solids {} pairs {sp} solid pairs", cell.pairs.len());
    let model = ClearanceModel::new(&cell);
    let mut v = Variety(1);
    let qs: Vec<Joints> = (0..2000).map(|_| v.joints()).collect();
    let near: Vec<Joints> = (0..2000)
        .map(|_| {
            Joints::new(0.3, -1.2, 1.5, -1.5, -1.5, 0.2)
                + Joints::from_fn(|_, _| v.between(-0.3, 0.3))
        })
        .collect();
    for (name, qs) in [("random", &qs), ("near", &near)] {
        let t = Instant::now();
        let mut sum = 0.0;
        let mut neg = 0;
        for q in qs {
            for c in model.minimum_per_class(q).iter() {
                sum += c.separation.distance_m;
                if c.separation.distance_m < 0.0 {
                    neg += 1
                }
            }
        }
        println!(
            "{name}: {:.1} us  sum {sum} neg {neg}",
            t.elapsed().as_secs_f64() * 1e6 / qs.len() as f64
        );
        let t = Instant::now();
        let mut sum = 0;
        for q in qs {
            if model.first_below(q, |_| 0.01).is_some() {
                sum += 1
            }
        }
        println!(
            "{name}: first_below {:.1} us  hits {sum}",
            t.elapsed().as_secs_f64() * 1e6 / qs.len() as f64
        );
        let t = Instant::now();
        let mut sum = 0.0;
        for q in qs.iter().take(200) {
            for c in model.all_pairs(q) {
                sum += c.separation.distance_m
            }
        }
        println!(
            "{name}: all_pairs {:.1} us {sum}",
            t.elapsed().as_secs_f64() * 1e6 / 200.0
        );
    }
}
