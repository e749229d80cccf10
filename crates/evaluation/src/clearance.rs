//! Clearance along recorded motions.

use std::collections::BTreeMap;

use needlebench_cell::{Cell, ClearanceClass};
use needlebench_clearance::{
    CertificateOptions, ClassMinima, ClearanceModel, Motion, MotionCertificate, Nearby, ROUNDING_M,
    RecordedMotion, certify, certify_sampled,
};
use needlebench_engine::Recording;
use needlebench_geometry::Separation;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};

use crate::report::ClassClearance;

/// Least clearance per class over a motion, and its course.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ClearanceSeries {
    /// Least clearance per class.
    pub minima: BTreeMap<ClearanceClass, ClassClearance>,
    /// Times of the samples, s.
    pub time_s: Vec<f64>,
    /// Clearance per class at those times, m.
    pub distance_m: BTreeMap<ClearanceClass, Vec<f64>>,
    /// What is nearest of arm and tool to what stands around them at those times; none where nothing is near.
    pub nearest: Vec<Option<Nearest>>,
    /// Names of the solids that `nearest` refers to.
    pub nearest_pairs: Vec<[String; 2]>,
}

/// The two solids that are nearest to each other at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Their class.
    pub class: ClearanceClass,
    /// Index of their names in [`ClearanceSeries::nearest_pairs`].
    pub pair: usize,
    /// Their nearest (or deepest) points, in the world.
    pub witness_points_m: [[f64; 3]; 2],
}

impl ClearanceSeries {
    /// Adds what is nearest in a posture of a cell.
    fn add_nearest(&mut self, cell: &Cell, minima: &ClassMinima) {
        let around = minima.iter().filter(|pair| pair.class.is_surroundings());
        let least =
            around.min_by(|a, b| a.separation.distance_m.total_cmp(&b.separation.distance_m));
        let found = least.map(|pair| {
            let (a, b) = pair.solid_names(cell);
            let known = self
                .nearest_pairs
                .iter()
                .position(|[x, y]| x == a && y == b);
            let index = known.unwrap_or_else(|| {
                self.nearest_pairs.push([a.to_owned(), b.to_owned()]);
                self.nearest_pairs.len() - 1
            });
            let Separation {
                point_on_a,
                point_on_b,
                ..
            } = pair.separation;
            Nearest {
                class: pair.class,
                pair: index,
                witness_points_m: [point_on_a, point_on_b].map(|point| [point.x, point.y, point.z]),
            }
        });
        self.nearest.push(found);
    }
}

/// Samples the clearance of a recorded motion every `period_s`, first and last state included.
///
/// The least clearance of the access zone is that of the hold phase.
pub fn measure_clearance(
    cell: &Cell,
    model: &ClearanceModel,
    trajectory: &JointTrajectory,
    recording: &Recording,
    period_s: f64,
) -> ClearanceSeries {
    let mut series = ClearanceSeries::default();
    let mut nearby = Nearby::default();
    for index in sample_indices(recording, period_s) {
        let time_s = recording.time_s[index];
        let minima = model.minimum_per_class_near(&recording.state[index].position, &mut nearby);
        let phase = trajectory.phase_at(time_s);
        series.time_s.push(time_s);
        series.add_nearest(cell, &minima);
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
                    Some(recording.engine.name),
                );
                series.minima.insert(pair.class, found);
            }
        }
    }
    series
}

/// Adds to a recording's least clearances their certified lower bounds, and replaces those that are undercut between
/// the samples.
///
/// What is certified is the recorded course itself, every step of it, linear in between: tracking
/// errors are part of it, and need no allowance of their own.
pub fn certify_recording(
    series: &mut ClearanceSeries,
    cell: &Cell,
    model: &ClearanceModel,
    trajectory: &JointTrajectory,
    recording: &Recording,
    tolerance_m: f64,
) {
    let position = recording.state.iter().map(|state| state.position);
    let motion = RecordedMotion::new(recording.time_s.clone(), position.collect(), trajectory);
    let engine = Some(recording.engine.name);
    certify_minima(
        &mut series.minima,
        cell,
        model,
        &motion,
        tolerance_m,
        engine,
    );
}

/// Least clearances over a recording with their certified lower bounds: those of [`measure_clearance`] and
/// [`certify_recording`] together, but for the error of the distances (`1e-9 m`), at a small part of the cost.
pub fn recorded_clearance(
    cell: &Cell,
    model: &ClearanceModel,
    trajectory: &JointTrajectory,
    recording: &Recording,
    period_s: f64,
    tolerance_m: f64,
) -> BTreeMap<ClearanceClass, ClassClearance> {
    let position = recording.state.iter().map(|state| state.position);
    let motion = RecordedMotion::new(recording.time_s.clone(), position.collect(), trajectory);
    let samples_s: Vec<f64> = sample_indices(recording, period_s)
        .into_iter()
        .map(|index| recording.time_s[index])
        .collect();
    let options = CertificateOptions {
        tolerance_m,
        ..CertificateOptions::default()
    };
    let engine = Some(recording.engine.name);
    let mut minima = BTreeMap::new();
    let certificate = certify_sampled(model, &motion, &options, &samples_s);
    take_minima(&mut minima, cell, &certificate, engine);
    minima
}

/// Least clearances of a motion that has its certificate already.
pub fn certified_clearance(
    cell: &Cell,
    certificate: &MotionCertificate,
) -> BTreeMap<ClearanceClass, ClassClearance> {
    let mut minima = BTreeMap::new();
    take_minima(&mut minima, cell, certificate, None);
    minima
}

/// Least clearances of a planned motion with their certified lower bounds.
pub fn planned_clearance(
    cell: &Cell,
    model: &ClearanceModel,
    trajectory: &JointTrajectory,
    tolerance_m: f64,
) -> BTreeMap<ClearanceClass, ClassClearance> {
    let mut minima = BTreeMap::new();
    certify_minima(&mut minima, cell, model, trajectory, tolerance_m, None);
    minima
}

fn certify_minima(
    minima: &mut BTreeMap<ClearanceClass, ClassClearance>,
    cell: &Cell,
    model: &ClearanceModel,
    motion: &impl Motion,
    tolerance_m: f64,
    engine: Option<&str>,
) {
    let options = CertificateOptions {
        tolerance_m,
        ..CertificateOptions::default()
    };
    take_minima(minima, cell, &certify(model, motion, &options), engine);
}

fn take_minima(
    minima: &mut BTreeMap<ClearanceClass, ClassClearance>,
    cell: &Cell,
    certificate: &MotionCertificate,
    engine: Option<&str>,
) {
    for (class, found) in certificate.iter() {
        let attained = &found.attained;
        let nearer = minima
            .get(&class)
            .is_none_or(|known| attained.separation.distance_m < known.minimum_m);
        if nearer {
            let least = class_clearance(
                attained.solid_names(cell),
                &attained.separation,
                found.phase.name(),
                Some(found.time_s),
                engine,
            );
            minima.insert(class, least);
        }
        if let Some(least) = minima.get_mut(&class)
            && found.lower_bound_m.is_finite()
        {
            // The bound holds for samples too; only rounding could say otherwise.
            least.certified_lower_bound_m = Some(found.lower_bound_m.min(least.minimum_m));
        }
        if let Some(least) = minima.get_mut(&class) {
            least.behind_cuts_m = found.behind_cuts_m;
        }
    }
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
            let found = class_clearance(solids, &pair.separation, "final_posture", None, None);
            let behind_cuts_m = minima.behind_cuts_m(pair.class);
            (
                pair.class,
                ClassClearance {
                    behind_cuts_m,
                    ..found
                },
            )
        })
        .collect()
}

/// Clearance of the planned needle, from skin to target, from what it comes nearest to.
pub fn route_clearance(part: &str, separation: &Separation) -> ClassClearance {
    ClassClearance {
        // One exact distance that is never optimistic, but for rounding.
        certified_lower_bound_m: Some(separation.distance_m - ROUNDING_M),
        breath_allowance_m: None,
        ..class_clearance(("needle", part), separation, "insertion", None, None)
    }
}

pub(crate) fn class_clearance(
    (solid_a, solid_b): (&str, &str),
    separation: &Separation,
    phase: &'static str,
    time_s: Option<f64>,
    engine: Option<&str>,
) -> ClassClearance {
    ClassClearance {
        minimum_m: separation.distance_m,
        certified_lower_bound_m: None,
        breath_allowance_m: None,
        behind_cuts_m: None,
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
