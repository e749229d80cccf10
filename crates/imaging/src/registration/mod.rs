//! Which marker is which, and where the patient therefore is.
//!
//! Markers found in a volume are matched to places where markers are known to be (by construction, or touched with the
//! needle's tip) by their distances, in any order, with missing and false ones; then a rigid transform is fitted in
//! units of everybody's covariance. What counts is the error at the target ([`Registration::tre`]). The residuals of
//! the markers themselves (FRE) do not tell it.

mod matching;
mod register;

pub use matching::{Alternative, MarkerMatch, MatchOptions, MatchedPair, match_markers};
pub use register::{
    LeaveOneOut, ReferenceFrame, RegisteredMarker, Registration, TargetError, register_weighted,
};

use nalgebra::{Matrix3, Point3};
use needlebench_kinematics::registration::Localised;
use serde::{Deserialize, Serialize};

/// Where a place of reference comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceSource {
    /// From the drawing of what carries the marker.
    Cad,
    /// Touched by the needle's tip.
    Touched,
}

/// A marker whose place is known apart from the CT: in the robot's or in the phantom's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceMarker {
    /// What it is called.
    pub name: String,
    /// Centre of its sphere or disc.
    #[serde(with = "crate::serial::point")]
    pub center_m: Point3<f64>,
    /// Covariance of that place's error, m^2.
    #[serde(with = "crate::serial::symmetric3")]
    pub covariance_m2: Matrix3<f64>,
    /// Where it comes from.
    pub source: ReferenceSource,
}

impl ReferenceMarker {
    /// From a drawing, made to `sigma_m` along each axis.
    pub fn from_cad(name: impl Into<String>, center_m: Point3<f64>, sigma_m: f64) -> Self {
        Self {
            name: name.into(),
            center_m,
            covariance_m2: Matrix3::from_diagonal_element(sigma_m * sigma_m),
            source: ReferenceSource::Cad,
        }
    }

    /// Touched by the needle's tip, with the arm's covariance there, m^2, in the axes of the robot's base.
    pub fn touched(
        name: impl Into<String>,
        center_m: Point3<f64>,
        covariance_m2: Matrix3<f64>,
    ) -> Self {
        Self {
            name: name.into(),
            center_m,
            covariance_m2,
            source: ReferenceSource::Touched,
        }
    }

    /// Its place and covariance.
    pub fn localised(&self) -> Localised {
        Localised {
            at_m: self.center_m,
            covariance_m2: self.covariance_m2,
        }
    }
}

/// What is said of points that cannot be registered, with their names.
fn refused(
    error: needlebench_kinematics::registration::RegistrationError,
    name: impl Fn(usize) -> String,
) -> needlebench_volume::VolumeError {
    use needlebench_kinematics::registration::RegistrationError as E;
    let message = error.to_string();
    let refused = needlebench_volume::VolumeError::refused(message);
    match error {
        E::BadCoordinate { index, .. } | E::BadCovariance { index } => refused.at(name(index)),
        E::Collinear { .. } | E::Undetermined => {
            refused.hint("place one marker well off the line through the others")
        }
        E::TooFew { .. } => refused.hint(
            "at least three markers that are not collinear are \
                                          required",
        ),
        _ => refused,
    }
}
