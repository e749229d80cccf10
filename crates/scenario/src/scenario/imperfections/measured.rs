//! Measured covariances, instead of assumed errors.

use nalgebra::Matrix3;
use needlebench_input::{Finding, TomlText};

use super::{ImagingBlock, RegistrationBlock};

/// The covariance of a position, mm^2, along the axes of the phantom: `[xx, yy, zz, xy, xz, yz]`.
pub type CovarianceMm2 = [f64; 6];

/// Minimum ratio of the smallest to the largest variance in any direction: below it, rounding decides the sign.
const LEAST_SHARE: f64 = 1e-9;

/// Minimum variance in any direction, mm^2: a standard deviation of 0.1 um, below that of any scan.
const LEAST_VARIANCE_MM2: f64 = 1e-8;

const COVARIANCE_HINT: &str = "[xx, yy, zz, xy, xz, yz] in mm^2: squares of the standard deviations along the \
                               phantom's axes, then the covariances, each at most sqrt(xx yy) and so on";

/// As a matrix, m^2.
pub(crate) fn covariance_m2([xx, yy, zz, xy, xz, yz]: CovarianceMm2) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * 1e-6
}

/// Checks the measured covariances of the markers.
pub(super) fn check_markers(
    toml: &TomlText<'_>,
    place: &str,
    block: &RegistrationBlock,
) -> Vec<Finding> {
    let Some(covariances) = &block.covariance_mm2 else {
        return Vec::new();
    };
    let key = format!("{place}.covariance_mm2");
    let markers_key = format!("{place}.markers_mm");
    let is_default =
        block.localisation_error_mm == RegistrationBlock::default().localisation_error_mm;
    let mut findings = contradiction(toml, place, "localisation_error_mm", is_default);
    let (given, wanted) = (covariances.len(), block.markers_mm.len());
    // What a study changes has no text, and no places in it.
    let are_assumed = toml.span_of(place).is_some() && toml.span_of(&markers_key).is_none();
    if are_assumed {
        findings.push(
            toml.finding(&key, "covariances are given without their markers")
                .hint(
                    "add `markers_mm = [[left, posterior, superior], ...]`, the measured positions",
                ),
        );
    } else if given != wanted {
        findings.push(
            toml.finding(&key, format!("{given} covariances for {wanted} markers"))
                .hint("one `[xx, yy, zz, xy, xz, yz]` for each of `markers_mm`, in their order"),
        );
    }
    let each = covariances.iter().enumerate();
    findings.extend(each.filter_map(|(index, covariance)| {
        let what = format!("the covariance of marker {}", index + 1);
        not_positive(toml, &format!("{key}[{index}]"), &what, covariance)
    }));
    findings
}

/// Checks the measured covariance of the target.
pub(super) fn check_target(toml: &TomlText<'_>, place: &str, block: &ImagingBlock) -> Vec<Finding> {
    let Some(covariance) = &block.covariance_mm2 else {
        return Vec::new();
    };
    let default = ImagingBlock::default();
    let mut findings = contradiction(toml, place, "voxel_mm", block.voxel_mm == default.voxel_mm);
    let is_default = block.reader_mm == default.reader_mm;
    findings.extend(contradiction(toml, place, "reader_mm", is_default));
    let key = format!("{place}.covariance_mm2");
    let what = "the covariance of the target";
    findings.extend(not_positive(toml, &key, what, covariance));
    findings
}

/// A finding about an assumption beside a measurement; `is_default` where the value may not have been given.
fn contradiction(
    toml: &TomlText<'_>,
    block: &str,
    assumed: &str,
    is_default: bool,
) -> Vec<Finding> {
    let key = format!("{block}.{assumed}");
    if is_default && toml.span_of(&key).is_none() {
        return Vec::new();
    }
    let message = format!("`{assumed}` contradicts `covariance_mm2`");
    vec![
        toml.finding(&key, message)
            .hint("an error is either measured or assumed: remove one of them"),
    ]
}

/// A finding about a matrix that is not positive definite.
fn not_positive(
    toml: &TomlText<'_>,
    key: &str,
    what: &str,
    covariance: &CovarianceMm2,
) -> Option<Finding> {
    let variances_mm2 = (covariance_m2(*covariance) * 1e6).symmetric_eigenvalues();
    let (least, most) = (variances_mm2.min(), variances_mm2.max());
    if least >= LEAST_VARIANCE_MM2.max(LEAST_SHARE * most) {
        return None;
    }
    let message = format!(
        "{what} has a variance of {least:.3e} mm^2 in one direction, and {most:.3e} mm^2 in another: it is \
         not positive definite"
    );
    Some(toml.finding(key, message).hint(COVARIANCE_HINT))
}
