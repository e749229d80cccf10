//! Times of batch inverse kinematics in Rust, ns a pose, as lines `name<TAB>ns`: what `python/benches/ik.py` is held
//! against.

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Quaternion, Translation3, Unit};
use needlebench_kinematics::ik::{
    ClosedForm, Preference, Tolerance, closed_form_batch_within, closed_form_within,
};
use needlebench_kinematics::{LimitPolicy, Pose, UrGeometry, UrModel};

/// Poses at a time, as from Python: they and their answers fit into the nearest caches.
const CHUNK: usize = 256;

fn main() {
    let geometry = UrGeometry::UR3;
    let limits = LimitPolicy::of_ros(UrModel::Ur3).limits_of(UrModel::Ur3);
    let preference = Preference {
        seed: None,
        limits: Some(&limits),
    };
    let few = poses();
    let many: Vec<Pose> = few.iter().copied().cycle().take(1_000_000).collect();
    let tolerance = Tolerance::default();
    let into = |poses: &[Pose], out: &mut [ClosedForm]| {
        for (poses, out) in poses.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
            closed_form_batch_within(&geometry, poses, preference, tolerance, out);
        }
        black_box(out);
    };
    let anew = |poses: &[Pose]| {
        let mut out = Vec::with_capacity(poses.len());
        for poses in poses.chunks(CHUNK) {
            let first = out.len();
            out.resize(first + poses.len(), ClosedForm::BLANK);
            closed_form_batch_within(&geometry, poses, preference, tolerance, &mut out[first..]);
        }
        black_box(out);
    };
    let mut few_out = vec![ClosedForm::BLANK; few.len()];
    let mut many_out = vec![ClosedForm::BLANK; many.len()];
    tell("1024 into memory that exists", few.len(), 2000, || {
        into(&few, &mut few_out);
    });
    tell("1024 into new memory", few.len(), 2000, || anew(&few));
    tell("1000000 into memory that exists", many.len(), 5, || {
        into(&many, &mut many_out);
    });
    tell("1000000 into new memory", many.len(), 5, || anew(&many));
    tell("one", 1000, 50, || {
        for pose in &few[..1000] {
            let mut out = ClosedForm::BLANK;
            closed_form_within(&geometry, black_box(pose), preference, tolerance, &mut out);
            black_box(out);
        }
    });
}

/// The poses of the file that is named: position (m) and quaternion w, x, y, z, as doubles of this machine.
fn poses() -> Vec<Pose> {
    let file = std::env::args().nth(1).expect("a file of poses is named");
    let bytes = std::fs::read(file).expect("the file can be read");
    let numbers: Vec<f64> = bytes
        .as_chunks()
        .0
        .iter()
        .map(|each| f64::from_ne_bytes(*each))
        .collect();
    let pose = |&[x, y, z, w, i, j, k]: &[f64; 7]| {
        let rotation = Unit::new_unchecked(Quaternion::new(w, i, j, k));
        Pose::from_parts(Translation3::new(x, y, z), rotation)
    };
    numbers.as_chunks().0.iter().map(pose).collect()
}

/// Least time of several, by the poses.
fn tell(name: &str, poses: usize, repeats: u32, mut work: impl FnMut()) {
    let mut least = f64::INFINITY;
    for _ in 0..repeats {
        let started = Instant::now();
        work();
        least = least.min(started.elapsed().as_secs_f64());
    }
    println!("{name}\t{:.2}", least / poses as f64 * 1e9);
}
