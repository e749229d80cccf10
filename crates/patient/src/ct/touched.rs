//! Where the robot has the markers of a synthetic scan.

use nalgebra::{Point3, Vector3};
use needlebench_numerics::random::NormalPairs;
use needlebench_scenario::scenario::MarkerKind;
use needlebench_scenario::{ListedMarker, MarkerFrame, MarkerList};

use super::SyntheticScan;

/// Drawn apart from the noise, which has the seed itself.
const APART: u64 = 0x5ca1_ab1e_0000_0017;

/// Everything random of a scan but its noise.
pub(super) struct Draws(NormalPairs);

impl Draws {
    pub(super) fn new(seed: u64) -> Self {
        Self(NormalPairs::new(seed ^ APART))
    }

    pub(super) fn normal(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.0.next_normal())
    }

    /// From -0.5 to 0.5 along each axis.
    pub(super) fn uniform(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.0.uniform(-0.5, 0.5))
    }
}

/// The list of the markers of a scan that CT sees: in the robot's `base_link`, digitised with this standard deviation
/// along each axis, where there is a robot; else by the phantom's drawing. None without such markers.
pub fn marker_list(scan: &SyntheticScan, kind: MarkerKind, touch_m: f64) -> Option<MarkerList> {
    let mut draws = Draws::new(scan.truth.seed);
    let (frame, place_of) = match scan.robot_from_ct {
        Some(pose) => (MarkerFrame::BaseLink, pose),
        None => (MarkerFrame::Drawing, scan.ct_from_phantom.inverse()),
    };
    let mut sphere_m = None;
    let mut markers = Vec::new();
    for marker in &scan.truth.markers {
        let error = draws.normal(touch_m);
        let Some(center_m) = marker.sphere_center_m else {
            continue;
        };
        sphere_m = marker.sphere_diameter_m;
        let place = place_of * Point3::from(center_m) + error;
        markers.push(ListedMarker {
            name: marker.name.clone(),
            // To a tenth of a micrometre, which is how such lists are written.
            position_mm: place
                .coords
                .map(|metres| (metres * 1e7).round() / 1e4)
                .into(),
            sd_mm: None,
        });
    }
    Some(MarkerList {
        frame,
        sphere_mm: (sphere_m? * 1e6).round() / 1e3,
        carrier: kind == MarkerKind::CtSphere,
        sd_mm: (touch_m * 1e6).round() / 1e3,
        placement_mm: None,
        markers,
    })
}
