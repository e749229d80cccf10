//! Names of a calibrated arm's solutions.

use super::super::Configuration;
use super::super::numerical::Refined;
use super::Branch;
use crate::{Joints, UrGeometry};

/// Gives each solution the name that the signs of its posture have on the nominal arm.
///
/// A calibration moves the singularities by about `shift`, in rad of a joint and as a share of the
/// arm's length. Where two solutions would have the same name and a neighbouring name none, the
/// one nearer to the singularity between the two takes that one, if it is within the shift: they
/// are the two that meet there. What then is left over shares its name: there are more than
/// eight, or some names have none.
pub(super) fn named(geometry: &UrGeometry, solutions: &[Refined], shift: f64) -> Vec<Branch> {
    let mut branches: Vec<Branch> = solutions
        .iter()
        .map(|&solution| Branch {
            configuration: Configuration::of(geometry, &solution.joints),
            solution,
        })
        .collect();
    while let Some((index, name)) = cheapest_renaming(geometry, &branches, shift) {
        branches[index].configuration = name;
    }
    branches.sort_by(|a, b| {
        let name = |branch: &Branch| branch.configuration.index();
        let (p, q) = (&a.solution.joints, &b.solution.joints);
        let joints = || (0..6).map(|i| p[i].total_cmp(&q[i]));
        name(a)
            .cmp(&name(b))
            .then_with(|| joints().fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then))
    });
    branches
}

/// The row that has to be moved least, of those that share their name, for a name without a row.
fn cheapest_renaming(
    geometry: &UrGeometry,
    branches: &[Branch],
    shift: f64,
) -> Option<(usize, Configuration)> {
    let mut rows = [0_usize; 8];
    for branch in branches {
        rows[branch.configuration.index()] += 1;
    }
    if rows.iter().all(|count| *count <= 1) {
        return None;
    }
    let empty = Configuration::ALL
        .into_iter()
        .filter(|name| rows[name.index()] == 0);
    empty
        .flat_map(|name| {
            branches
                .iter()
                .enumerate()
                .filter(|(_, branch)| rows[branch.configuration.index()] > 1)
                .map(move |(index, branch)| {
                    (
                        against(geometry, &branch.solution.joints, name),
                        index,
                        name,
                    )
                })
        })
        .filter(|(cost, ..)| *cost <= shift)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, index, name)| (index, name))
}

/// How far a posture is on the wrong side of the singularities for a name: sines, and the wrist's
/// way ahead over the arm's length.
fn against(geometry: &UrGeometry, q: &Joints, configuration: Configuration) -> f64 {
    let Configuration {
        shoulder,
        elbow,
        wrist,
    } = configuration;
    let against = |value: f64, sign: f64| (-value * sign).max(0.0);
    let ahead = geometry.wrist_forward_m(q) / (geometry.a2 + geometry.a3).abs();
    // Elbow and wrist are named by their sines relative to the shoulder's sign.
    against(ahead, shoulder.sign())
        + against(libm::sin(q[2]), elbow.sign(shoulder))
        + against(libm::sin(q[4]), wrist.sign(shoulder))
}
