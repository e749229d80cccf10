//! The transform, what it leaves, and what it is good for.

use nalgebra::{Matrix3, Matrix6, Point3, Vector3};
use needlebench_kinematics::Pose;
use needlebench_kinematics::registration::{
    self as rigid, Localised, Residual, WeightedFit, displacement_covariance, leave_one_out,
};
use needlebench_numerics::{chi_square, normal};
use needlebench_volume::{Remark, VolumeError};
use serde::{Deserialize, Serialize};

use super::{MarkerMatch, ReferenceMarker, refused};

/// Probability with which a set without any moved marker is said to have one.
const FALSE_ALARM: f64 = 0.01;

/// A marker is named as the moved one if all others are this much less likely to be, in chi-square: three sigmas.
const NAMED_CHI_SQUARE: f64 = 9.0;

/// A turn less certain than this, rad, is refused: covariances are of first order in it.
const LARGEST_TURN_SIGMA_RAD: f64 = 0.1;

/// Whose places the markers were matched to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceFrame {
    /// The robot's base: markers touched by its needle.
    Robot,
    /// The phantom: markers by its drawing.
    Phantom,
}

/// What the fit to all other markers says of one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LeaveOneOut {
    /// From its known place to where the others put its detected one, in the reference frame.
    #[serde(with = "crate::serial::vector")]
    pub error_m: Vector3<f64>,
    /// Half width of the interval that such an error lies in along x, y and z, if the covariances hold and nothing has
    /// moved: 1 % over all markers.
    pub interval_m: [f64; 3],
    /// The error in units of its covariance, squared: three degrees of freedom.
    pub chi_square: f64,
    /// Probability of a larger chi-square if nothing has moved.
    pub probability: f64,
}

/// A marker that the registration rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegisteredMarker {
    /// What it is called.
    pub name: String,
    /// Which of the detected markers it is.
    pub detected: usize,
    /// From its known place to where the fit puts its detected one, in the reference frame.
    #[serde(with = "crate::serial::vector")]
    pub residual_m: Vector3<f64>,
    /// What that is on average if the covariances hold, rms.
    pub expected_residual_m: f64,
    /// What the other markers say of it; nothing where they determine no transform.
    pub leave_one_out: Option<LeaveOneOut>,
}

/// Where a target is, by registration, and how well that is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TargetError {
    /// The target in the reference frame.
    #[serde(with = "crate::serial::point")]
    pub at_m: Point3<f64>,
    /// Covariance of the registration's error there, m^2, without that of the target's own place in the images.
    #[serde(with = "crate::serial::symmetric3")]
    pub covariance_m2: Matrix3<f64>,
    /// Target registration error, rms.
    pub rms_m: f64,
}

/// Where the patient is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Registration {
    /// Whose frame `reference` is.
    pub frame: ReferenceFrame,
    /// Takes places of the CT to places of the reference frame.
    #[serde(with = "crate::serial::pose")]
    pub reference_from_ct: Pose,
    /// What small errors of the transform are counted about, in the reference frame.
    #[serde(with = "crate::serial::point")]
    pub about_m: Point3<f64>,
    /// Covariance of the transform's small error `(t, w)`, m and rad, in the axes of the reference frame: a place `p` is
    /// displaced by `t + w x (p - about_m)`.
    #[serde(with = "crate::serial::symmetric6")]
    pub covariance: Matrix6<f64>,
    /// In the order of the known markers.
    pub markers: Vec<RegisteredMarker>,
    /// Fiducial registration error, rms. It does not tell the error at the target.
    pub fre_rms_m: f64,
    /// What that is on average if the covariances hold.
    pub expected_fre_rms_m: f64,
    /// Residuals in units of their covariances, squared and summed.
    pub chi_square: f64,
    /// What the chi-square is on average if the covariances hold.
    pub degrees_of_freedom: usize,
    /// Probability of a larger chi-square if the covariances hold.
    pub probability: f64,
    /// Markers of which one has moved, or is not where the list says: one where it can be told, none where all agree.
    pub suspects: Vec<String>,
    /// What is worth knowing of it.
    pub remarks: Vec<Remark>,
}

impl Registration {
    /// Target registration error at a place given in the CT.
    pub fn tre(&self, target_in_ct_m: &Point3<f64>) -> TargetError {
        let at_m = self.reference_from_ct * target_in_ct_m;
        let covariance_m2 = displacement_covariance(&self.covariance, &(at_m - self.about_m));
        TargetError {
            at_m,
            covariance_m2,
            rms_m: covariance_m2.trace().max(0.0).sqrt(),
        }
    }
}

/// Fits the transform to matched markers, in units of both sides' covariances, and holds every marker against the
/// others.
///
/// # Errors
/// Fewer than three pairs or pairs that are not in the lists; markers on one line, also as far as they are known.
pub fn register_weighted(
    matched: &MarkerMatch,
    detected: &[Localised],
    reference: &[ReferenceMarker],
    frame: ReferenceFrame,
) -> Result<Registration, VolumeError> {
    let mut from = Vec::with_capacity(matched.pairs.len());
    let mut to = Vec::with_capacity(matched.pairs.len());
    for pair in &matched.pairs {
        let (Some(seen), Some(known)) =
            (detected.get(pair.detected), reference.get(pair.reference))
        else {
            return Err(VolumeError::refused(format!(
                "detected {} and known marker {} are not both in the lists of {} and {}",
                pair.detected + 1,
                pair.reference + 1,
                detected.len(),
                reference.len()
            )));
        };
        from.push(*seen);
        to.push(known.localised());
    }
    let name = |index: usize| reference[matched.pairs[index].reference].name.clone();
    let fit = rigid::register_weighted(&from, &to).map_err(|error| refused(error, name))?;
    check_turn(&fit)?;
    let left_out = leave_one_out(&from, &to);
    let probability = probability_above(fit.chi_square, fit.degrees_of_freedom());
    let (suspects, remarks) = verdict(&fit, probability, &left_out, &name);
    let markers = (matched
        .pairs
        .iter()
        .zip(&fit.residuals)
        .zip(&left_out)
        .enumerate())
    .map(|(index, ((pair, residual), left_out))| RegisteredMarker {
        name: name(index),
        detected: pair.detected,
        residual_m: residual.error_m,
        expected_residual_m: residual.covariance_m2.trace().max(0.0).sqrt(),
        leave_one_out: left_out.as_ref().map(|left| summary(left, from.len())),
    })
    .collect();
    let (fre_rms_m, expected_fre_rms_m) = fit.fre_rms_and_expected_m();
    Ok(Registration {
        frame,
        reference_from_ct: fit.to_from_from,
        about_m: fit.about_m,
        covariance: fit.covariance,
        markers,
        fre_rms_m,
        expected_fre_rms_m,
        chi_square: fit.chi_square,
        degrees_of_freedom: fit.degrees_of_freedom(),
        probability,
        suspects,
        remarks,
    })
}

fn probability_above(chi_square: f64, degrees_of_freedom: usize) -> f64 {
    chi_square::probability_above(chi_square, degrees_of_freedom as f64)
}

/// Points on a line to within what is known of them determine no turn about it.
fn check_turn(fit: &WeightedFit) -> Result<(), VolumeError> {
    let turns = fit.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let sigma_rad = turns.symmetric_eigenvalues().max().max(0.0).sqrt();
    if sigma_rad <= LARGEST_TURN_SIGMA_RAD {
        return Ok(());
    }
    Err(VolumeError::refused(format!(
        "the markers do not determine the rotation (standard deviation {:.0} deg): they are \
         collinear within their uncertainty",
        sigma_rad.to_degrees()
    ))
    .hint("place one marker well off the line through the others"))
}

fn summary(left: &Residual, count: usize) -> LeaveOneOut {
    let factor = normal::quantile(1.0 - FALSE_ALARM / (6.0 * count as f64));
    LeaveOneOut {
        error_m: left.error_m,
        interval_m: [0, 1, 2].map(|k| factor * left.covariance_m2[(k, k)].max(0.0).sqrt()),
        chi_square: left.chi_square,
        probability: probability_above(left.chi_square, 3),
    }
}

/// Which markers are suspected, and what to say of the whole.
fn verdict(
    fit: &WeightedFit,
    probability: f64,
    left_out: &[Option<Residual>],
    name: &impl Fn(usize) -> String,
) -> (Vec<String>, Vec<Remark>) {
    let mut remarks = vec![Remark::new(
        "the marker residuals (FRE) do not predict the target registration error (TRE): use the TRE",
    )];
    let count = left_out.len();
    if left_out.iter().all(Option::is_none) {
        remarks.push(Remark::new(format!(
            "with {count} markers a moved marker cannot be detected: a fourth is required"
        )));
    }
    let mut order: Vec<(usize, &Residual)> = left_out
        .iter()
        .enumerate()
        .filter_map(|(index, left)| left.as_ref().map(|left| (index, left)))
        .collect();
    order.sort_by(|a, b| b.1.chi_square.total_cmp(&a.1.chi_square));
    let threshold = FALSE_ALARM / count as f64;
    let worst = order.first().copied();
    let moved = worst.filter(|(_, left)| probability_above(left.chi_square, 3) < threshold);
    let suspects: Vec<usize> = moved.map_or(Vec::new(), |(_, worst)| {
        order
            .iter()
            .filter(|(_, left)| worst.chi_square - left.chi_square < NAMED_CHI_SQUARE)
            .map(|&(index, _)| index)
            .collect()
    });
    let scale = (fit.chi_square / fit.degrees_of_freedom().max(1) as f64).sqrt();
    match (suspects.as_slice(), moved) {
        (&[one], Some((_, left))) => remarks.push(moved_remark(one, left, name)),
        ([_, _, ..], _) => {
            let names: Vec<String> = suspects.iter().map(|&index| name(index)).collect();
            remarks.push(Remark::new(format!(
                "one of {} is not at its position in the list; which one cannot be determined",
                names.join(", ")
            )));
        }
        _ if probability < FALSE_ALARM => remarks.push(Remark::new(format!(
            "the residuals are {scale:.1} times what the stated errors allow, at no particular \
             marker: the stated errors, and so the TRE, are too small"
        ))),
        _ if probability > 1.0 - FALSE_ALARM => remarks.push(Remark::new(format!(
            "the residuals are {scale:.1} times the expected ones: the stated errors are too \
             large"
        ))),
        _ => {}
    }
    if let Some((_, left)) = moved
        && count > 4
        && probability_above(
            fit.chi_square - left.chi_square,
            fit.degrees_of_freedom() - 3,
        ) < FALSE_ALARM
    {
        remarks.push(Remark::new(
            "the markers disagree even without the worst one: more than one has moved, or the \
             stated errors are too small",
        ));
    }
    (suspects.into_iter().map(name).collect(), remarks)
}

fn moved_remark(index: usize, left: &Residual, name: &impl Fn(usize) -> String) -> Remark {
    let mm = left.error_m * 1e3;
    Remark::new(format!(
        "is not at its position in the list: by the other markers it is ({:+.2}, {:+.2}, {:+.2}) \
         mm from it; it has moved or was poorly detected: omit it or measure it again",
        mm.x, mm.y, mm.z
    ))
    .at(name(index))
}

#[cfg(test)]
#[path = "register_tests.rs"]
mod tests;
