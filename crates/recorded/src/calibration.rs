//! How an arm's links differ from the nominal ones, from logged poses of the tool's point.
//!
//! The controller computes `actual_TCP_pose` from the measured angles with its factory calibration, so
//! that what is fitted is that calibration and the tool's pose, not where the tool really was: only an
//! outside measurement says that.
//!
//! Each joint origin has six numbers, which is more than poses can tell apart (an origin may slide
//! along its axis). A prior of the spread that factory calibrations have decides what poses leave open,
//! so that such numbers stay nominal.

use nalgebra::{DMatrix, DVector, Point3, UnitQuaternion, Vector3};
use needlebench_kinematics::{Chain, JOINT_COUNT, Pose, base_from_base_link, rotation_vector};
use serde::Serialize;

use crate::RecordedRun;
use crate::arm_fit::spread;

/// Rows that are fitted; neighbours of a run at 500 Hz are the same pose.
const ROWS: usize = 2000;

/// Standard deviations of a joint origin's six numbers about the nominal ones: those of nine UR3e stay
/// within 0.91 mm and 6.8 mrad.
const PRIOR_M: f64 = 0.5e-3;
const PRIOR_RAD: f64 = 3e-3;

/// Poses are taken to be this exact at first, and never to be more exact than digits of a log are.
const FIRST_ERROR_M: f64 = 1e-4;
const FIRST_ERROR_RAD: f64 = 3e-4;
const LEAST_ERROR: f64 = 1e-8;

/// Rounds of weights, and of Gauss and Newton within each.
const WEIGHTS: usize = 3;
const STEPS: usize = 8;

/// Parts of a run, each predicted from the others.
const PARTS: usize = 5;

/// A calibration is kept if its error on held-out rows is no more than this share of the error of nominal
/// lengths.
const WORTH: f64 = 0.5;

/// A number is shown by the run if its standard deviation is below this share of the prior's.
const SHOWN: f64 = 0.1;

/// Numbers per joint origin, and of all with the tool's pose.
const EACH: usize = 6;
const ORIGINS: usize = EACH * JOINT_COUNT;
const ALL: usize = ORIGINS + EACH;

const LINKS: [&str; JOINT_COUNT] = [
    "shoulder",
    "upper_arm",
    "forearm",
    "wrist_1",
    "wrist_2",
    "wrist_3",
];

/// Distances and angles between poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseError {
    /// Root mean square distance, m.
    pub rms_m: f64,
    /// Largest distance, m.
    pub largest_m: f64,
    /// Root mean square angle, rad.
    pub rms_rad: f64,
}

/// How a link's origin differs from the nominal one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CalibratedLink {
    /// Name of the link.
    pub link: &'static str,
    /// Distance from the nominal origin along the nominal frame's axes, m.
    pub shift_m: [f64; 3],
    /// Half of the 95 % interval of each, m; none where the run does not show it.
    pub shift_half_width_m: [Option<f64>; 3],
    /// Rotation vector from the nominal frame, rad.
    pub turn_rad: [f64; 3],
    /// Half of the 95 % interval of each, rad; none where the run does not show it.
    pub turn_half_width_rad: [Option<f64>; 3],
}

/// A calibration from a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationFit {
    /// Joints with their origins as fitted.
    #[serde(skip)]
    pub chain: Chain,
    /// Tool's point in the flange, as fitted with the calibration: position, m.
    pub tool_position_m: [f64; 3],
    /// Its rotation vector, rad.
    pub tool_rotation_rad: [f64; 3],
    /// The links.
    pub links: [CalibratedLink; JOINT_COUNT],
    /// Rows that were fitted.
    pub rows: usize,
    /// Nominal lengths with the tool that fits best.
    pub nominal: PoseError,
    /// Residual of the fit on its own rows; no measure of its accuracy.
    pub fitted: PoseError,
    /// Nominal lengths with a tool fitted to four fifths of the run, on the held-out fifth; all fifths in turn.
    pub nominal_held_out: PoseError,
    /// The same of the calibration.
    pub held_out: PoseError,
    /// From the first half of the run on the second.
    pub second_half: PoseError,
    /// Whether it predicts held-out rows well enough to be used: with no more than half of the error of nominal
    /// lengths.
    pub is_worth: bool,
}

/// A pose at joint angles.
struct Sample {
    q: needlebench_kinematics::Joints,
    base_from_tcp: Pose,
}

/// Fits joint origins and the tool's pose; none where the log has no poses.
///
/// `nominal` is the arm without any calibration.
pub fn calibrate(run: &RecordedRun, nominal: &Chain) -> Option<CalibrationFit> {
    let samples: Vec<Sample> = spread(run.len(), ROWS)
        .filter_map(|row| {
            Some(Sample {
                q: run.actual_q[row],
                base_from_tcp: run.base_from_tcp(row)?,
            })
        })
        .collect();
    if samples.is_empty() {
        return None;
    }
    let all: Vec<&Sample> = samples.iter().collect();
    let tool_only = Fit::of(nominal, &all, false);
    let whole = Fit::of(nominal, &all, true);
    let part = |k: usize| k * samples.len() / PARTS..(k + 1) * samples.len() / PARTS;
    let held_out = |calibrated: bool| {
        let mut errors = Vec::new();
        for k in 0..PARTS {
            let kept = samples
                .iter()
                .enumerate()
                .filter(|(at, _)| !part(k).contains(at));
            let kept: Vec<&Sample> = kept.map(|(_, sample)| sample).collect();
            let fit = Fit::of(nominal, &kept, calibrated);
            errors.extend(samples[part(k)].iter().map(|sample| fit.error(sample)));
        }
        PoseError::of(&errors)
    };
    let (first, second) = all.split_at(all.len() / 2);
    let half = Fit::of(nominal, first, true);
    let (nominal_held_out, held_out) = (held_out(false), held_out(true));
    let tool = whole.tool;
    Some(CalibrationFit {
        chain: whole.chain,
        tool_position_m: tool.translation.vector.into(),
        tool_rotation_rad: rotation_vector(&tool.rotation).into(),
        links: whole.links(nominal),
        rows: samples.len(),
        nominal: tool_only.errors(&all),
        fitted: whole.errors(&all),
        nominal_held_out,
        held_out,
        second_half: half.errors(second),
        is_worth: held_out.rms_m <= WORTH * nominal_held_out.rms_m,
    })
}

impl PoseError {
    fn of(errors: &[[f64; 2]]) -> Self {
        let count = errors.len().max(1) as f64;
        let mean = |k: usize| (errors.iter().map(|e| e[k] * e[k]).sum::<f64>() / count).sqrt();
        Self {
            rms_m: mean(0),
            largest_m: errors.iter().map(|e| e[0]).fold(0.0, f64::max),
            rms_rad: mean(1),
        }
    }
}

struct Fit {
    chain: Chain,
    tool: Pose,
    /// Standard deviations of the numbers of the origins.
    deviations: [f64; ORIGINS],
}

impl Fit {
    /// Origins, if they are free, and tool from poses.
    fn of(nominal: &Chain, samples: &[&Sample], origins_are_free: bool) -> Self {
        let mut fit = Self {
            chain: *nominal,
            tool: first_tool(nominal, samples),
            deviations: [0.0; ORIGINS],
        };
        let (mut error_m, mut error_rad) = (FIRST_ERROR_M, FIRST_ERROR_RAD);
        for _ in 0..WEIGHTS {
            for _ in 0..STEPS {
                // Of poses that are so exact the prior of what they leave open is lost in the rounding of the
                // equations: they are then taken for less exact.
                let change = loop {
                    let step = fit.step(nominal, samples, origins_are_free, error_m, error_rad);
                    if let Some(change) = step {
                        break change;
                    }
                    error_m *= 2.0;
                    error_rad *= 2.0;
                };
                if change < 1e-12 {
                    break;
                }
            }
            let errors = fit.errors(samples);
            error_m = (errors.rms_m / 3.0_f64.sqrt()).max(LEAST_ERROR);
            error_rad = (errors.rms_rad / 3.0_f64.sqrt()).max(LEAST_ERROR);
        }
        fit
    }

    /// One step of Gauss and Newton; the largest change of any number, m or rad. None where rounding leaves the
    /// equations without a solution.
    fn step(
        &mut self,
        nominal: &Chain,
        samples: &[&Sample],
        origins_are_free: bool,
        error_m: f64,
        error_rad: f64,
    ) -> Option<f64> {
        let mut normal = DMatrix::<f64>::zeros(ALL, ALL);
        let mut right = DVector::<f64>::zeros(ALL);
        for sample in samples {
            let (columns, residual) = self.linear(sample);
            let weights = [error_m.powi(-2), error_rad.powi(-2)];
            for (a, column) in columns.iter().enumerate() {
                for (half, weight) in weights.iter().enumerate() {
                    right[a] += weight * column[half].dot(&residual[half]);
                    for (b, other) in columns.iter().enumerate().skip(a) {
                        normal[(a, b)] += weight * column[half].dot(&other[half]);
                    }
                }
            }
        }
        normal.fill_lower_triangle_with_upper_triangle();
        if origins_are_free {
            for (joint, (now, then)) in self.chain.joints.iter().zip(&nominal.joints).enumerate() {
                let off = then.parent_from_joint.inverse() * now.parent_from_joint;
                let turn = rotation_vector(&off.rotation);
                for k in 0..3 {
                    for (place, prior, value) in [
                        (EACH * joint + k, PRIOR_M, off.translation.vector[k]),
                        (EACH * joint + 3 + k, PRIOR_RAD, turn[k]),
                    ] {
                        normal[(place, place)] += prior.powi(-2);
                        right[place] -= value * prior.powi(-2);
                    }
                }
            }
        } else {
            for place in 0..ORIGINS {
                normal.row_mut(place).fill(0.0);
                normal.column_mut(place).fill(0.0);
                normal[(place, place)] = 1.0;
                right[place] = 0.0;
            }
        }
        // The tool is free; a little keeps the equations solvable where poses do not turn.
        for place in ORIGINS..ALL {
            normal[(place, place)] += 1.0;
        }
        let factor = normal.cholesky()?;
        let change = factor.solve(&right);
        let inverse = factor.inverse();
        for (place, deviation) in self.deviations.iter_mut().enumerate() {
            *deviation = inverse[(place, place)].max(0.0).sqrt();
        }
        let small = |place: usize| {
            let part = |k: usize| Vector3::from_fn(|i, _| change[place + k + i]);
            Pose::from_parts(part(0).into(), UnitQuaternion::from_scaled_axis(part(3)))
        };
        for (joint, each) in self.chain.joints.iter_mut().enumerate() {
            each.parent_from_joint *= small(EACH * joint);
            each.parent_from_joint.rotation.renormalize();
        }
        self.tool *= small(ORIGINS);
        self.tool.rotation.renormalize();
        Some(change.amax())
    }

    /// How position and orientation change with each number, in `base`, and what they are short of.
    fn linear(&self, sample: &Sample) -> ([[Vector3<f64>; 2]; ALL], [Vector3<f64>; 2]) {
        let base = base_from_base_link();
        let mut parent = base;
        let mut origins = [Pose::identity(); JOINT_COUNT];
        for (i, joint) in self.chain.joints.iter().enumerate() {
            origins[i] = parent * joint.parent_from_joint;
            parent = origins[i] * UnitQuaternion::from_axis_angle(&joint.axis, sample.q[i]);
        }
        let flange = parent * self.chain.wrist_3_from_flange;
        let tcp = flange * self.tool;
        let mut columns = [[Vector3::zeros(); 2]; ALL];
        for (joint, frame) in origins.iter().chain([&tcp]).enumerate() {
            let rotation = frame.rotation.to_rotation_matrix().into_inner();
            let arm = tcp.translation.vector - frame.translation.vector;
            for k in 0..3 {
                let axis = rotation.column(k).into_owned();
                columns[EACH * joint + k] = [axis, Vector3::zeros()];
                columns[EACH * joint + 3 + k] = [axis.cross(&arm), axis];
            }
        }
        let off = sample.base_from_tcp.rotation * tcp.rotation.inverse();
        let residual = [
            sample.base_from_tcp.translation.vector - tcp.translation.vector,
            rotation_vector(&off),
        ];
        (columns, residual)
    }

    /// Distance (m) and angle (rad) of a sample from where the fit has it.
    fn error(&self, sample: &Sample) -> [f64; 2] {
        let tcp = base_from_base_link() * self.chain.base_link_from_flange(&sample.q) * self.tool;
        let off = sample.base_from_tcp.rotation * tcp.rotation.inverse();
        let distance = sample.base_from_tcp.translation.vector - tcp.translation.vector;
        [distance.norm(), rotation_vector(&off).norm()]
    }

    fn errors(&self, samples: &[&Sample]) -> PoseError {
        let errors: Vec<[f64; 2]> = samples.iter().map(|sample| self.error(sample)).collect();
        PoseError::of(&errors)
    }

    fn links(&self, nominal: &Chain) -> [CalibratedLink; JOINT_COUNT] {
        std::array::from_fn(|joint| {
            let [now, then] =
                [&self.chain, nominal].map(|chain| chain.joints[joint].parent_from_joint);
            let off = then.inverse() * now;
            let half_width = |k: usize, prior: f64| {
                let deviation = self.deviations[EACH * joint + k];
                (deviation < SHOWN * prior).then_some(1.96 * deviation)
            };
            CalibratedLink {
                link: LINKS[joint],
                shift_m: off.translation.vector.into(),
                shift_half_width_m: std::array::from_fn(|k| half_width(k, PRIOR_M)),
                turn_rad: rotation_vector(&off.rotation).into(),
                turn_half_width_rad: std::array::from_fn(|k| half_width(3 + k, PRIOR_RAD)),
            }
        })
    }
}

/// Where the first sample has the tool, with the mean position of all.
fn first_tool(nominal: &Chain, samples: &[&Sample]) -> Pose {
    let base = base_from_base_link();
    let count = samples.len() as f64;
    let flange = |sample: &Sample| base * nominal.base_link_from_flange(&sample.q);
    let mean: Vector3<f64> = samples
        .iter()
        .map(|sample| {
            let at = Point3::from(sample.base_from_tcp.translation.vector);
            flange(sample).inverse_transform_point(&at).coords / count
        })
        .sum();
    let first = samples[0];
    let rotation = flange(first).rotation.inverse() * first.base_from_tcp.rotation;
    Pose::from_parts(mean.into(), rotation)
}
