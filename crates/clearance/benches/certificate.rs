//! Time and effort of certificates on the cell of Table 3.
//!
//! `cargo bench -p needlebench-clearance --bench certificate`

use std::time::{Duration, Instant};

use needlebench_clearance::{
    CertificateOptions, ClearanceModel, Motion, MotionBound, MotionCertificate, Span, certify,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};

#[path = "../tests/clearance/common/motions.rs"]
mod motions;

/// Runs of each certificate; the fastest counts.
const RUNS: usize = 7;

/// One phase of a trajectory.
struct Part<'t>(&'t JointTrajectory, Phase);

impl Motion for Part<'_> {
    fn position(&self, time_s: f64) -> Joints {
        Motion::position(self.0, time_s)
    }

    fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints {
        self.0.chord_deviation(from_s, to_s)
    }

    fn spans(&self) -> Vec<Span> {
        let mut spans = Motion::spans(self.0);
        spans.retain(|span| span.phase == self.1);
        spans
    }
}

fn fastest(run: impl Fn() -> MotionCertificate) -> (Duration, MotionCertificate) {
    let mut best = Duration::MAX;
    let mut certificate = None;
    for _ in 0..RUNS {
        let started = Instant::now();
        let found = run();
        best = best.min(started.elapsed());
        certificate = Some(found);
    }
    (best, certificate.expect("it ran"))
}

fn main() {
    let resolved = motions::shipped("table3.toml");
    let model = ClearanceModel::new(&resolved.cell);
    let motions = motions::motions(&resolved, &[]);
    println!("table3: every class to 0.1 mm, fastest of {RUNS} runs");
    println!(
        "{:10} {:>2} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11}",
        "phase", "", "bound", "ms", "postures", "intervals", "distances", "planes", "widest"
    );
    for phase in [Phase::Approach, Phase::Transfer] {
        for (k, motion) in motions.iter().enumerate() {
            for (name, bound) in [
                ("planes", MotionBound::Planes),
                ("Lipschitz", MotionBound::Lipschitz),
            ] {
                if bound == MotionBound::Lipschitz && (phase == Phase::Transfer && k > 0) {
                    continue;
                }
                let options = CertificateOptions {
                    bound,
                    ..CertificateOptions::default()
                };
                let part = Part(motion, phase);
                let (time, found) = fastest(|| certify(&model, &part, &options));
                let widest_m = found
                    .iter()
                    .map(|(_, class)| class.width_m())
                    .fold(0.0, f64::max);
                println!(
                    "{:10} {k:>2} {name:>9} {:>9.3} {:>9} {:>9} {:>9} {:>9} {:>8.4} mm",
                    phase.name(),
                    time.as_secs_f64() * 1e3,
                    found.effort.postures,
                    found.effort.intervals,
                    found.effort.distances,
                    found.effort.planes,
                    widest_m * 1e3,
                );
            }
        }
    }
}
