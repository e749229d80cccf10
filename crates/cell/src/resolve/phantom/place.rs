//! Where the phantom of a scenario lies.

use std::sync::Arc;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_kinematics::Pose;

use super::UnplacedPhantom;
use crate::Finding;
use crate::phantom::Phantom;
use crate::scenario::{PhantomSection, Posture, TableSection};
use crate::toml_text::TomlText;

/// The phantom, placed.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedPhantom {
    /// The phantom.
    pub phantom: Arc<Phantom>,
    /// Its place.
    pub world_from_phantom: Pose,
}

/// Pose of a phantom in the world.
pub(crate) fn place_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    table: Option<&TableSection>,
    phantom: &UnplacedPhantom,
) -> Result<Pose, Finding> {
    let mut world_from_phantom = Pose::from_parts(
        Translation3::from(Vector3::from(section.position_mm) * 1e-3),
        orientation(section),
    );
    if section.rest_on_table {
        let Some(table) = table else {
            return Err(toml
                .finding("phantom.rest_on_table", "there is no [table] to rest on")
                .hint("add a [table], or set `rest_on_table = false` and give the full position"));
        };
        check_over_table(toml, table, section.position_mm)?;
        let up = world_from_phantom.rotation.inverse() * Vector3::z();
        let lowest_m = phantom.lowest_m(&up);
        world_from_phantom.translation.vector.z =
            (table.top_height_mm + section.position_mm[2]) * 1e-3 - lowest_m;
    }
    Ok(world_from_phantom)
}

/// Refuses a phantom that rests on a table it does not lie over.
fn check_over_table(
    toml: &TomlText<'_>,
    table: &TableSection,
    position_mm: [f64; 3],
) -> Result<(), Finding> {
    let offset_mm = nalgebra::Rotation2::new(-table.yaw_deg.to_radians())
        * nalgebra::Vector2::new(
            position_mm[0] - table.center_mm[0],
            position_mm[1] - table.center_mm[1],
        );
    let over =
        offset_mm.x.abs() <= 0.5 * table.length_mm && offset_mm.y.abs() <= 0.5 * table.width_mm;
    if over {
        return Ok(());
    }
    Err(toml
        .finding(
            "phantom.position_mm",
            format!(
                "the phantom's middle lies {:.0} mm along and {:.0} mm across from the middle of \
                 the table, which is {:.0} by {:.0} mm",
                offset_mm.x, offset_mm.y, table.length_mm, table.width_mm
            ),
        )
        .hint("move it over the table, or set `rest_on_table = false`"))
}

/// Orientation of the phantom (left, posterior, superior) in the world.
fn orientation(section: &PhantomSection) -> UnitQuaternion<f64> {
    // With the head towards world x; columns are where left, posterior and superior point.
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let columns = match section.posture {
        Posture::Supine => [-y, -z, x],
        Posture::Prone => [y, z, x],
        Posture::LeftLateral => [-z, y, x],
        Posture::RightLateral => [z, -y, x],
    };
    let posture = UnitQuaternion::from_rotation_matrix(
        &nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&columns)),
    );
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), section.head_yaw_deg.to_radians())
        * posture
        * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), section.body_roll_deg.to_radians())
}
