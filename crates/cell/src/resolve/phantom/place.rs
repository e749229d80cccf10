//! Where the phantom of a scenario lies.

use std::sync::Arc;

use nalgebra::{Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_geometry::Solid;
use needlebench_kinematics::Pose;

use super::UnplacedPhantom;
use crate::Finding;
use crate::phantom::{Phantom, PhantomParameters, PhantomPart, Support, limbs};
use crate::scenario::{Arms, NO_MODEL, PhantomSection, Posture, TableSection};
use crate::toml_text::TomlText;

/// The phantom, placed.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedPhantom {
    /// The phantom.
    pub phantom: Arc<Phantom>,
    /// Its place.
    pub world_from_phantom: Pose,
    /// Head and arms, as far as the scenario has them; phantom frame.
    pub limbs: Vec<PhantomPart>,
}

impl PlacedPhantom {
    /// What of the patient can be touched, in the world: the skin of the chest, then head and arms.
    pub fn outside(&self) -> impl Iterator<Item = Solid> {
        let limbs = self.limbs.iter().map(|part| &part.solid);
        let solids = std::iter::once(self.phantom.skin()).chain(limbs);
        solids.map(|solid| Solid {
            parent_from_shape: self.world_from_phantom * solid.parent_from_shape,
            ..solid.clone()
        })
    }
}

/// Lays a phantom into the world.
pub(crate) fn place_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    table: Option<&TableSection>,
    phantom: &UnplacedPhantom,
) -> Result<PlacedPhantom, Finding> {
    let mut world_from_phantom = Pose::from_parts(
        Translation3::from(Vector3::from(section.position_mm) * 1e-3),
        orientation(section),
    );
    let down = world_from_phantom.rotation.inverse() * -Vector3::z();
    // How far the skin reaches down.
    let lowest_m = -phantom.lowest_m(&-down);
    if section.rest_on_table {
        let Some(table) = table else {
            return Err(toml
                .finding("phantom.rest_on_table", "there is no [table] to rest on")
                .hint("add a [table], or set `rest_on_table = false` and give the full position"));
        };
        check_over_table(toml, table, section.position_mm)?;
        world_from_phantom.translation.vector.z =
            (table.top_height_mm + section.position_mm[2]) * 1e-3 + lowest_m;
    }
    let limbs = match limb_sizes(toml, section, &phantom.phantom)? {
        Some(parameters) => {
            let support = Support {
                down: UnitVector3::new_normalize(down),
                depth_m: lowest_m,
            };
            limbs(parameters, section.arms, section.head, &support)
        }
        None => Vec::new(),
    };
    Ok(PlacedPhantom {
        phantom: Arc::clone(&phantom.phantom),
        world_from_phantom,
        limbs,
    })
}

/// What head and arms are made after; none if none are wanted.
fn limb_sizes<'p>(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    phantom: &'p Phantom,
) -> Result<Option<&'p PhantomParameters>, Finding> {
    let (key, wanted) = match section.arms {
        Arms::None => ("head", section.head),
        Arms::Beside | Arms::Overhead => ("arms", true),
    };
    match &phantom.parameters {
        _ if !wanted => Ok(None),
        Some(parameters) => Ok(Some(parameters)),
        None => Err(toml
            .finding(
                &format!("phantom.{key}"),
                format!("`{key}` has no size: `model` is `{NO_MODEL}`"),
            )
            .hint("name a model and let the parts replace what they stand for, or leave it out")),
    }
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
