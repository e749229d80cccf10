//! Inverse kinematics of poses drawn at random.

use std::f64::consts::PI;
use std::hint::black_box;

use needlebench_kinematics::ik::{
    ClosedForm, DampedOptions, GaussNewtonOptions, Numerical, Preference, closed_form_batch,
    closed_form_into,
};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::{Joints, Pose, UrGeometry};
use needlebench_numerics::random::SplitMix64;

/// Does the operation so often, each time for another pose.
pub fn run(operation: &str, count: usize) {
    let geometry = UrGeometry::UR3;
    let chain = geometry.chain();
    let numerical = Numerical::new(&chain);
    let mut random = SplitMix64::new(1);
    let mut out = vec![ClosedForm::BLANK; count];
    let postures: Vec<Joints> = (0..count)
        .map(|_| PoseSet::Generic.sample(&geometry, &mut random, 0.0))
        .collect();
    let in_base: Vec<Pose> = postures
        .iter()
        .map(|q| geometry.base_from_flange(q))
        .collect();
    let in_base_link: Vec<Pose> = postures
        .iter()
        .map(|q| chain.base_link_from_flange(q))
        .collect();
    let starts: Vec<Joints> = postures
        .iter()
        .map(|q| match operation {
            "damped" => Joints::from_fn(|_, _| random.uniform(-PI, PI)),
            _ => q.map(|joint| joint + random.uniform(-0.1, 0.1)),
        })
        .collect();
    let preference = Preference::default();
    match operation {
        "one_pose" => {
            for (pose, out) in in_base.iter().zip(&mut out) {
                closed_form_into(&geometry, pose, preference, out);
            }
        }
        "batch" => closed_form_batch(&geometry, &in_base, preference, &mut out),
        "gauss_newton" => {
            let options = GaussNewtonOptions::default();
            for (pose, start) in in_base_link.iter().zip(&starts) {
                black_box(numerical.gauss_newton(pose, start, &options));
            }
        }
        "damped" => {
            let options = DampedOptions::default();
            for (pose, start) in in_base_link.iter().zip(&starts) {
                black_box(numerical.damped(pose, start, &options));
            }
        }
        other => panic!("no operation `{other}`"),
    }
    black_box(&out);
}
