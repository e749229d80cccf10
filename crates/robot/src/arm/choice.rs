//! Which arm's data a URDF has.

use std::sync::Arc;

use needlebench_input::{Finding, Location};
use needlebench_kinematics::{UrGeometry, UrModel};
use serde::Serialize;

use super::{Arm, SAME_ARM_M, beside};

/// Agreement that is asked of an arm's lengths and those of its own URDF, m.
const OWN_LENGTHS_M: f64 = 1e-4;

/// Why an arm's data are a robot's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Recognition {
    /// The robot's URDF is the arm's own.
    Own,
    /// The scenario or the command line names the arm.
    Named,
    /// The robot has the arm's lengths.
    Lengths,
}

/// An arm and why it is a robot's.
pub(crate) type Choice = (Arc<Arm>, Recognition);

/// The arm whose data a URDF with these lengths has: the one that is named, the one whose own URDF it
/// is, or the one that ships with its lengths.
///
/// # Errors
/// An `arm.toml` beside the URDF that is wrong, or of which the URDF has other lengths.
pub(crate) fn choose_arm(
    named: Option<&Arc<Arm>>,
    urdf: &Location,
    geometry: &UrGeometry,
) -> Result<Option<Choice>, Finding> {
    let own = match named {
        Some(arm) if arm.urdf().is_same_file(urdf) => Some(Arc::clone(arm)),
        Some(arm) => return Ok(Some((Arc::clone(arm), Recognition::Named))),
        None => beside(urdf)?,
    };
    if let Some(arm) = own {
        let deviation_m = arm.deviation_m(geometry);
        if deviation_m > OWN_LENGTHS_M {
            return Err(Finding::new(
                arm.source.file.clone(),
                format!(
                    "the lengths differ from those of {} by up to {:.2} mm",
                    urdf.display(),
                    deviation_m * 1e3
                ),
            )
            .key("geometry")
            .hint(format!("the URDF has {}", in_words(geometry))));
        }
        return Ok(Some((arm, Recognition::Own)));
    }
    Ok(Arm::shipped()
        .iter()
        .map(|arm| (arm, arm.deviation_m(geometry)))
        .filter(|(_, deviation_m)| *deviation_m <= SAME_ARM_M)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(arm, _)| (Arc::clone(arm), Recognition::Lengths)))
}

/// The note on a robot without arm data.
pub(crate) fn note_on_no_arm(geometry: &UrGeometry) -> String {
    let (model, deviation_m) = UrModel::nearest(geometry);
    let whose = if deviation_m <= SAME_ARM_M {
        format!("those of a {model}, which is not shipped")
    } else {
        "not those of a shipped arm".to_owned()
    };
    let names: Vec<&str> = Arm::shipped_names().collect();
    format!(
        "arm data: none; the URDF's lengths are {whose} ({})",
        names.join(", ")
    )
}

fn in_words(geometry: &UrGeometry) -> String {
    let UrGeometry {
        d1,
        a2,
        a3,
        d4,
        d5,
        d6,
    } = geometry;
    format!("d1 {d1:.6}, a2 {a2:.6}, a3 {a3:.6}, d4 {d4:.6}, d5 {d5:.6}, d6 {d6:.6} m")
}
