//! Clearance along recorded motions, and of the planned needle.

use std::collections::BTreeMap;

use needlebench_cell::phantom::Tissue;
use needlebench_cell::{Cell, ClearanceClass, Goal, PlacedPhantom};
use needlebench_clearance::{ClassMinima, ClearanceModel, Separation, segment_clearance};
use needlebench_engine::Recording;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};

use crate::report::ClassClearance;

/// Least clearance per class over a motion, and its course.
#[derive(Debug, Clone, PartialEq)]
pub struct ClearanceSeries {
    /// Least clearance per class.
    pub minima: BTreeMap<ClearanceClass, ClassClearance>,
    /// Times of the samples, s.
    pub time_s: Vec<f64>,
    /// Clearance per class at those times, m.
    pub distance_m: BTreeMap<ClearanceClass, Vec<f64>>,
}

/// Samples the clearance of a recorded motion every `period_s`, first and last state included.
///
/// The least clearance of the needle corridor is that while the arm holds its place.
pub fn measure_clearance(
    cell: &Cell,
    model: &ClearanceModel,
    trajectory: &JointTrajectory,
    recording: &Recording,
    period_s: f64,
) -> ClearanceSeries {
    let mut series = ClearanceSeries {
        minima: BTreeMap::new(),
        time_s: Vec::new(),
        distance_m: BTreeMap::new(),
    };
    for index in sample_indices(recording, period_s) {
        let time_s = recording.time_s[index];
        let minima = model.minimum_per_class(&recording.state[index].position);
        let phase = trajectory.phase_at(time_s);
        series.time_s.push(time_s);
        for pair in minima.iter() {
            series
                .distance_m
                .entry(pair.class)
                .or_default()
                .push(pair.separation.distance_m);
            let nearer = series
                .minima
                .get(&pair.class)
                .is_none_or(|known| pair.separation.distance_m < known.minimum_m);
            // Needle and hand come only when the guide stands in its place.
            let counts = pair.class != ClearanceClass::NeedleCorridor || phase == Phase::Hold;
            if nearer && counts {
                let found = class_clearance(
                    pair.solid_names(cell),
                    &pair.separation,
                    phase.name(),
                    Some(time_s),
                    Some(&recording.engine.name),
                );
                series.minima.insert(pair.class, found);
            }
        }
    }
    series
}

/// Indices of the states that are written and checked: every `period_s`, and the last one.
pub fn sample_indices(recording: &Recording, period_s: f64) -> Vec<usize> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at least 1"
    )]
    let stride = (period_s / recording.timestep_s).round().max(1.0) as usize;
    let last = recording.state.len() - 1;
    let mut indices: Vec<usize> = (0..=last).step_by(stride).collect();
    if indices.last() != Some(&last) {
        indices.push(last);
    }
    indices
}

/// Clearances of one posture, for configurations that were not simulated.
pub fn posture_clearance(
    cell: &Cell,
    minima: &ClassMinima,
) -> BTreeMap<ClearanceClass, ClassClearance> {
    minima
        .iter()
        .map(|pair| {
            let solids = pair.solid_names(cell);
            (
                pair.class,
                class_clearance(solids, &pair.separation, "final_posture", None, None),
            )
        })
        .collect()
}

fn class_clearance(
    (solid_a, solid_b): (&str, &str),
    separation: &Separation,
    phase: &'static str,
    time_s: Option<f64>,
    engine: Option<&str>,
) -> ClassClearance {
    ClassClearance {
        minimum_m: separation.distance_m,
        certified_lower_bound_m: None,
        pair: [solid_a.to_owned(), solid_b.to_owned()],
        witness_points_m: [
            separation.point_on_a.coords.into(),
            separation.point_on_b.coords.into(),
        ],
        phase,
        time_s,
        engine: engine.map(str::to_owned),
    }
}

/// Clearance of the planned needle, from skin to target, from bone, vessels and organs.
///
/// The organ that contains the target is left out: the needle has to enter it. Lesions and the
/// skin do not count.
pub fn needle_route(cell: &Cell, placed: &PlacedPhantom, goal: &Goal) -> Option<ClassClearance> {
    let entry = goal.entry_m?;
    let parts: Vec<_> = placed
        .phantom
        .parts
        .iter()
        .filter(|part| matches!(part.tissue, Tissue::Bone | Tissue::Vessel | Tissue::Organ))
        .filter(|part| goal.target_organ.is_none() || part.organ != goal.target_organ)
        .map(|part| part.solid.clone())
        .collect();
    segment_clearance(
        &entry,
        &goal.target_m,
        0.5 * cell.tool.needle.outer_diameter_m,
        &parts,
        &placed.world_from_phantom,
    )
    .into_iter()
    .zip(&parts)
    .min_by(|(a, _), (b, _)| a.distance_m.total_cmp(&b.distance_m))
    .map(|(separation, solid)| {
        class_clearance(
            ("needle", &solid.name),
            &separation,
            "insertion",
            None,
            None,
        )
    })
}
