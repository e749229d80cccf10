//! Clearances of random postures as the program computes them, for what a page computes to be held against:
//! a line of JSON per posture.
//!
//! `postures SCENARIO COUNT`

use std::io::{BufWriter, Write};
use std::path::Path;

use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::Joints;
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::{Overrides, load_scenario};
use serde_json::json;

fn main() -> std::io::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scenario, count] = arguments.as_slice() else {
        panic!("usage: postures SCENARIO COUNT");
    };
    let count: usize = count.parse().expect("a number of postures");
    let resolved = load_scenario(Path::new(scenario), &Overrides::default())
        .unwrap_or_else(|findings| panic!("{findings:?}"));
    let model = ClearanceModel::new(&resolved.cell);
    let mut random = SplitMix64::new(1);
    let mut out = BufWriter::new(std::io::stdout().lock());
    for posture in 0..count {
        // Every other one about the start, where the arm works.
        let q = if posture % 2 == 0 {
            let limits = resolved.cell.robot.limits.0;
            Joints::from_fn(|joint, _| {
                let limit = limits[joint];
                random.uniform(limit.lower_rad.max(-7.0), limit.upper_rad.min(7.0))
            })
        } else {
            resolved.start + Joints::from_fn(|_, _| random.uniform(-0.7, 0.7))
        };
        let pairs = model.all_pairs(&q);
        let distances_m: Vec<f64> = pairs.iter().map(|it| it.separation.distance_m).collect();
        writeln!(
            out,
            "{}",
            json!({"joints": q.as_slice(), "distances_m": distances_m})
        )?;
    }
    out.flush()
}
