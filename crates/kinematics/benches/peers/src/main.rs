//! Closed-form inverse kinematics of the UR3 beside that of the crate `ik-geo`, on the same poses.
//!
//! For each set of poses: time per pose, the share of poses for which the posture that made the
//! pose is among the answers (or, where wrist 3 is free, one of its family), answers that miss the
//! pose by more than 1e-6, and the greatest residual of the others.

use std::hint::black_box;
use std::time::Instant;

use ik_geo::inverse_kinematics::auxiliary::Kinematics;
use ik_geo::inverse_kinematics::three_parallel_two_intersecting;
use nalgebra_032 as older;
use needlebench_kinematics::ik::{ClosedForm, Preference, closed_form_batch, closed_form_into};
use needlebench_kinematics::pose_sets::{PoseSet, rounded_to_f32};
use needlebench_numerics::random::SplitMix64;
use needlebench_kinematics::{
    Joints, Pose, UrGeometry, base_from_base_link, rotation_angle_between,
};

const POSES: usize = 2000;
const REPETITIONS: usize = 5;

/// An answer farther from the pose is wrong, m and rad.
const WRONG: f64 = 1e-6;

/// A joint farther from the wanted one is another posture, rad: rounding of a pose moves a double
/// root by its square root.
const SAME_RAD: f64 = 1e-6;

fn residual(geometry: &UrGeometry, pose: &Pose, q: &Joints) -> f64 {
    let found = geometry.base_from_flange(q);
    let shift = found.translation.vector - pose.translation.vector;
    let angle = rotation_angle_between(&found.rotation, &pose.rotation);
    let residual = shift.norm().max(angle);
    if residual.is_nan() {
        f64::INFINITY
    } else {
        residual
    }
}

/// The peer's arm: joint axes and the shifts between them at zero, by the product of exponentials.
struct Peer {
    arm: Kinematics<6, 7>,
    zero: older::Matrix3<f64>,
}

impl Peer {
    fn new(geometry: &UrGeometry) -> Self {
        let chain = geometry.chain();
        let links = chain
            .link_poses(&Joints::zeros())
            .map(|pose| base_from_base_link() * pose);
        let flange = geometry.base_from_flange(&Joints::zeros());
        let older_vector = |v: nalgebra::Vector3<f64>| older::Vector3::new(v.x, v.y, v.z);
        let mut arm = Kinematics::<6, 7>::new();
        let mut before = nalgebra::Vector3::zeros();
        for (i, link) in links.iter().enumerate() {
            let axis = link.rotation * nalgebra::Vector3::z();
            // Exact axes, as the peer's own examples have them.
            arm.h.set_column(i, &older_vector(axis.map(f64::round)));
            let mut shift = link.translation.vector - before;
            if i == 5 {
                // The last two axes intersect: shifts along the last one belong to the flange.
                shift -= axis * axis.dot(&shift);
            }
            arm.p.set_column(i, &older_vector(shift));
            before += shift;
        }
        let shift = flange.translation.vector - before;
        arm.p.set_column(6, &older_vector(shift));
        let zero = matrix(&flange).map(f64::round);
        Self { arm, zero }
    }

    fn solve(&self, pose: &Pose) -> Vec<Joints> {
        let position = pose.translation.vector;
        let position = older::Vector3::new(position.x, position.y, position.z);
        let rotation = matrix(pose) * self.zero.transpose();
        let (answers, least_squares) =
            three_parallel_two_intersecting(&rotation, &position, &self.arm);
        answers
            .iter()
            .zip(least_squares)
            .filter(|(_, nearest)| !nearest)
            .map(|(q, _)| Joints::from_fn(|i, _| q[i]))
            .collect()
    }
}

fn matrix(pose: &Pose) -> older::Matrix3<f64> {
    let r = pose.rotation.to_rotation_matrix();
    older::Matrix3::from_fn(|i, k| r[(i, k)])
}

#[derive(Default)]
struct Score {
    found: usize,
    wrong: usize,
    worst: f64,
    nanoseconds: f64,
}

fn score(
    geometry: &UrGeometry,
    cases: &[(Joints, Pose)],
    answers: &[Vec<Joints>],
    nanoseconds: f64,
) -> Score {
    let mut score = Score {
        nanoseconds,
        ..Score::default()
    };
    for ((made_of, pose), answers) in cases.iter().zip(answers) {
        let free = made_of[4].sin().abs() < 1e-14;
        // Of a family any member will do: the shoulder tells families apart.
        let joints = if free { 1 } else { 6 };
        let mut hit = false;
        for q in answers {
            let residual = residual(geometry, pose, q);
            if residual > WRONG {
                score.wrong += 1;
                continue;
            }
            score.worst = score.worst.max(residual);
            hit |= (0..joints).all(|i| {
                let turns = (q[i] - made_of[i]) / std::f64::consts::TAU;
                (turns - turns.round()).abs() * std::f64::consts::TAU < SAME_RAD
            });
        }
        score.found += usize::from(hit);
    }
    score
}

fn timed<T>(mut work: impl FnMut() -> T) -> (T, f64) {
    let mut best = f64::INFINITY;
    let mut answer = work();
    for _ in 0..REPETITIONS {
        let started = Instant::now();
        answer = black_box(work());
        best = best.min(started.elapsed().as_secs_f64());
    }
    (answer, best / POSES as f64 * 1e9)
}

fn rows(answers: &[ClosedForm]) -> Vec<Vec<Joints>> {
    answers
        .iter()
        .map(|answer| answer.solutions().map(|row| row.joints).collect())
        .collect()
}

fn main() {
    let geometry = UrGeometry::UR3;
    let peer = Peer::new(&geometry);
    let preference = Preference::default();
    println!("| poses | away (rad) | solver | ns/pose | found (%) | wrong | residual |");
    println!("|---|---|---|---|---|---|---|");
    for set in PoseSet::ALL {
        for away_rad in [Some(0.0), Some(1e-9), Some(1e-6), Some(1e-3), None] {
            if set == PoseSet::Generic && away_rad.is_some_and(|away| away > 0.0) {
                continue;
            }
            let mut random = SplitMix64::new(1);
            let cases: Vec<(Joints, Pose)> = (0..POSES)
                .map(|_| {
                    let q = set.sample(&geometry, &mut random, away_rad.unwrap_or(0.0));
                    let pose = geometry.base_from_flange(&q);
                    let pose = away_rad.map_or_else(|| rounded_to_f32(&pose), |_| pose);
                    (q, pose)
                })
                .collect();
            let poses: Vec<Pose> = cases.iter().map(|(_, pose)| *pose).collect();
            let mut out = vec![ClosedForm::BLANK; POSES];
            let ((), time) = timed(|| {
                for (pose, out) in poses.iter().zip(&mut out) {
                    closed_form_into(&geometry, pose, preference, out);
                }
            });
            let one = score(&geometry, &cases, &rows(&out), time);
            let ((), time) = timed(|| closed_form_batch(&geometry, &poses, preference, &mut out));
            let batch = score(&geometry, &cases, &rows(&out), time);
            let (answers, time) =
                timed(|| -> Vec<_> { poses.iter().map(|pose| peer.solve(pose)).collect() });
            let theirs = score(&geometry, &cases, &answers, time);
            let away = away_rad.map_or("rounded to f32".to_owned(), |away| format!("{away:.0e}"));
            for (name, score) in [("one by one", one), ("batch", batch), ("ik-geo", theirs)] {
                println!(
                    "| {} | {away} | {name} | {:.0} | {:.2} | {} | {:.0e} |",
                    set.name(),
                    score.nanoseconds,
                    100.0 * score.found as f64 / POSES as f64,
                    score.wrong,
                    score.worst
                );
            }
        }
    }
}
