//! What is tried: directions about a target, and base placements about a patient.

use needlebench_kinematics::{NotUrGeometry, UrGeometry};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::MountKind;

/// Step between directions, deg: 3 mm on skin that is 60 mm away.
const STEP_DEG: f64 = 3.0;

/// Azimuths and elevations in whole degrees, evenly over the sphere.
pub(super) fn directions() -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    let rows = (180.0 / STEP_DEG).round();
    let mut row = 1.0;
    while row < rows {
        let elevation = STEP_DEG * row - 90.0;
        let count = (360.0 * libm::cos(elevation.to_radians()) / STEP_DEG)
            .round()
            .max(1.0);
        let mut place = 0.0;
        while place < count {
            let azimuth = (360.0 * place / count).round();
            found.push([in_half_turn(azimuth), elevation]);
            place += 1.0;
        }
        row += 1.0;
    }
    found
}

/// A direction and those around it by up to a grid's step, one degree apart.
pub(super) fn around([azimuth, elevation]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let offsets = [-2.0, -1.0, 0.0, 1.0, 2.0];
    offsets.into_iter().flat_map(move |up| {
        offsets.into_iter().map(move |across| {
            [
                in_half_turn(azimuth + across),
                (elevation + up).clamp(-89.0, 89.0),
            ]
        })
    })
}

/// In (-180, 180].
fn in_half_turn(degrees: f64) -> f64 {
    let turned = degrees.rem_euclid(360.0);
    if turned > 180.0 {
        turned - 360.0
    } else {
        turned
    }
}

/// A base placement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BasePlace {
    pub position_mm: [f64; 3],
    pub rpy_deg: [f64; 3],
}

/// Steps of the grid of places, as shares of what upper arm and forearm reach together.
struct Steps {
    along: &'static [f64],
    across: &'static [f64],
    up: &'static [f64],
}

/// Beside the table: along it from mid-chest, out from its edge, over its upper face.
const BESIDE: Steps = Steps {
    along: &[
        -1.0, -0.85, -0.7, -0.55, -0.4, -0.2, 0.0, 0.2, 0.4, 0.55, 0.7, 0.85, 1.0,
    ],
    across: &[0.15, 0.3, 0.45],
    up: &[0.15, 0.35, 0.55, 0.75],
};

/// Over it, from a ceiling: across from its middle.
const OVER: Steps = Steps {
    along: &[-0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8],
    across: &[-0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8],
    up: &[1.4, 1.7, 2.0],
};

/// Half the width of what the robot stands beside where there is no table, mm: a broad patient.
const NO_TABLE_HALF_MM: f64 = 250.0;

/// Places about the patient for a base that is carried as the scenario's, in whole centimetres. Empty without a
/// patient.
///
/// A base on a column, a wedge or a rail stands at either side of the table and looks at it; one that hangs is over
/// the patient and keeps its yaw; one at a wall is moved along it and up.
///
/// # Errors
/// [`NotUrGeometry`] if the robot is not a UR arm.
pub(super) fn places(resolved: &ResolvedScenario) -> Result<Vec<BasePlace>, NotUrGeometry> {
    let Some(patient) = &resolved.phantom else {
        return Ok(Vec::new());
    };
    let scenario = &resolved.scenario;
    let robot = &resolved.cell.robot;
    let geometry = UrGeometry::of_chain(&robot.chain)?;
    let reach_mm = 1e3 * (geometry.a2.abs() + geometry.a3.abs());
    let chest_mm = patient.world_from_phantom.translation.vector * 1e3;
    let table = scenario.table.as_ref();
    let yaw_deg = table.map_or(0.0, |table| table.yaw_deg);
    let top_mm = table.map_or(chest_mm.z, |table| table.top_height_mm);
    let half_mm = table.map_or(NO_TABLE_HALF_MM, |table| 0.5 * table.width_mm);
    // The table's middle line, beside the patient.
    let (sine, cosine) = libm::sincos(yaw_deg.to_radians());
    let off_mm = table.map_or(0.0, |table| {
        let [x, y] = table.center_mm;
        (y - chest_mm.y) * cosine - (x - chest_mm.x) * sine
    });
    let at = |along: f64, across_mm: f64, up: f64, rpy_deg: [f64; 3]| {
        let (along_mm, across_mm) = (along * reach_mm, off_mm + across_mm);
        let position_mm = [
            chest_mm.x + along_mm * cosine - across_mm * sine,
            chest_mm.y + along_mm * sine + across_mm * cosine,
            top_mm + up * reach_mm,
        ];
        BasePlace {
            position_mm: position_mm.map(|mm| (mm / 10.0).round() * 10.0),
            rpy_deg,
        }
    };
    let [roll, pitch, yaw] = scenario.robot.base_rpy_deg.unwrap_or_default();
    let position = robot.world_from_base_link.translation.vector * 1e3;
    let kind = scenario.mount.as_ref().map(|mount| mount.kind);
    let mut found = Vec::new();
    match kind {
        Some(MountKind::Ceiling) => {
            for along in OVER.along {
                for across in OVER.across {
                    for up in OVER.up {
                        found.push(at(*along, across * reach_mm, *up, [roll, pitch, yaw]));
                    }
                }
            }
        }
        Some(MountKind::Wall) => {
            let beside_mm = (position.y - chest_mm.y) * cosine - (position.x - chest_mm.x) * sine;
            for along in BESIDE.along {
                for up in BESIDE.up {
                    found.push(at(*along, beside_mm - off_mm, *up, [roll, pitch, yaw]));
                }
            }
        }
        Some(MountKind::Column | MountKind::Wedge | MountKind::TableRail) | None => {
            for side in [1.0, -1.0] {
                let facing = in_half_turn(yaw_deg - side * 90.0).rem_euclid(360.0);
                for along in BESIDE.along {
                    for out in BESIDE.across {
                        let across_mm = side * (half_mm + out * reach_mm);
                        for up in BESIDE.up {
                            found.push(at(*along, across_mm, *up, [roll, pitch, facing]));
                        }
                    }
                }
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn directions_are_whole_degrees_evenly_over_the_sphere() {
        let found = directions();
        assert!(found.iter().flatten().all(|deg| deg.fract() == 0.0));
        assert!(
            found
                .iter()
                .all(|[azimuth, _]| (-180.0..=180.0).contains(azimuth))
        );
        #[expect(clippy::cast_possible_truncation, reason = "whole degrees")]
        let different: BTreeSet<[i32; 2]> = found
            .iter()
            .map(|each| each.map(|deg| deg as i32))
            .collect();
        assert_eq!(different.len(), found.len());
        // 4 pi over the square of a step.
        let wanted = 4.0 * std::f64::consts::PI / STEP_DEG.to_radians().powi(2);
        assert!(
            (found.len() as f64 / wanted - 1.0).abs() < 0.02,
            "{}",
            found.len()
        );
    }
}
