//! Where the phantom of a scenario lies.

use std::sync::Arc;

use nalgebra::{Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_geometry::Solid;
use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::Pose;
use needlebench_phantom::{Phantom, PhantomParameters, PhantomPart, Support, limbs};

use super::UnplacedPhantom;
use crate::scenario::{Arms, NO_MODEL, PhantomSection, Posture, TableSection};

/// The phantom, placed.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedPhantom {
    /// The phantom.
    pub phantom: Arc<Phantom>,
    /// Its place.
    pub world_from_phantom: Pose,
    /// Head and arms, as far as the scenario has them, and what a scan shows beside the body; phantom frame.
    pub limbs: Vec<PhantomPart>,
}

impl PlacedPhantom {
    /// How many of [`Self::outside`] are the chest, head and arms; what a scan shows beside the body follows.
    pub(crate) fn modelled(&self) -> usize {
        1 + self.modelled_limbs().len()
    }

    /// Head and arms without what a scan shows beside the body.
    pub fn modelled_limbs(&self) -> &[PhantomPart] {
        &self.limbs[..self.limbs.len() - self.phantom.beside.len()]
    }

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
        section.orientation(),
    );
    let down = world_from_phantom.rotation.inverse() * -Vector3::z();
    // How far the skin reaches down.
    let lowest_m = -phantom.lowest_m(&-down);
    if section.rest_on_table {
        let Some(table) = table else {
            return Err(toml
                .finding(
                    "phantom.rest_on_table",
                    "`rest_on_table` requires a [table]",
                )
                .hint("add a [table], or set `rest_on_table = false` and give the full position"));
        };
        check_over_table(toml, table, section.position_mm)?;
        world_from_phantom.translation.vector.z =
            (table.top_height_mm + section.position_mm[2]) * 1e-3 + lowest_m;
    }
    let mut limbs = match limb_sizes(toml, section, &phantom.phantom)? {
        Some(parameters) => {
            let support = Support {
                down: UnitVector3::new_normalize(down),
                depth_m: lowest_m,
            };
            limbs(parameters, section.arms, section.head, &support)
        }
        None => Vec::new(),
    };
    limbs.extend(phantom.phantom.beside.iter().cloned());
    Ok(PlacedPhantom {
        phantom: Arc::clone(&phantom.phantom),
        world_from_phantom,
        limbs,
    })
}

/// What is odd about a phantom whose place is given, over a table that it does not rest on by itself.
pub(crate) fn off_the_table(
    section: &PhantomSection,
    table: Option<&TableSection>,
    phantom: &UnplacedPhantom,
    placed: &PlacedPhantom,
) -> Option<String> {
    /// Deeper than a mattress gives way, higher than one is thick, mm.
    const USUAL_MM: [f64; 2] = [-20.0, 100.0];
    let table = table.filter(|_| !section.rest_on_table)?;
    let pose = &placed.world_from_phantom;
    let down = pose.rotation.inverse() * -Vector3::z();
    let lowest_m = pose.translation.vector.z + phantom.lowest_m(&-down);
    let over_mm = lowest_m * 1e3 - table.top_height_mm;
    if (USUAL_MM[0]..=USUAL_MM[1]).contains(&over_mm) {
        return None;
    }
    let side = if over_mm < 0.0 { "below" } else { "above" };
    Some(format!(
        "the patient's lowest point is {:.0} mm {side} the table's top: check `top_height_mm` under [table], and the base \
         placement",
        over_mm.abs()
    ))
}

/// The parameters of head and arms; none if neither is modelled.
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
            .hint("name a model whose parts the files replace, or omit the key")),
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
                "the phantom's origin is {:.0} mm along and {:.0} mm across from the centre of the \
                 table, which is {:.0} by {:.0} mm",
                offset_mm.x, offset_mm.y, table.length_mm, table.width_mm
            ),
        )
        .hint("move it over the table, or set `rest_on_table = false`"))
}

/// How a posture lies with the head towards world x.
fn posture(posture: Posture) -> UnitQuaternion<f64> {
    // Columns are where left, posterior and superior point.
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let columns = match posture {
        Posture::Supine => [-y, -z, x],
        Posture::Prone => [y, z, x],
        Posture::LeftLateral => [-z, y, x],
        Posture::RightLateral => [z, -y, x],
    };
    UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(
        nalgebra::Matrix3::from_columns(&columns),
    ))
}

impl PhantomSection {
    /// Orientation of the phantom (left, posterior, superior) in the world.
    pub fn orientation(&self) -> UnitQuaternion<f64> {
        let about = |axis: nalgebra::Unit<Vector3<f64>>, degrees: f64| {
            UnitQuaternion::from_axis_angle(&axis, degrees.to_radians())
        };
        let (across, up) = (Vector3::y_axis(), Vector3::z_axis());
        // What is nothing turns nothing, to the last bit.
        let raised = if self.head_up_deg == 0.0 {
            posture(self.posture)
        } else {
            about(across, -self.head_up_deg) * posture(self.posture)
        };
        about(up, self.head_yaw_deg) * raised * about(up, self.body_roll_deg)
    }

    /// Lays the phantom so that its frame is there in the world, whatever the table: in the posture that comes nearest, with
    /// the turns that are left. To rounding: 1e-6 mm and 1e-9 deg.
    pub fn set_pose(&mut self, world_from_phantom: &Pose) {
        let head = world_from_phantom.rotation * Vector3::z();
        let down = world_from_phantom.rotation.inverse() * -Vector3::z();
        self.posture = match (down.x.abs() > down.y.abs(), down.x > 0.0, down.y < 0.0) {
            (true, true, _) => Posture::LeftLateral,
            (true, false, _) => Posture::RightLateral,
            (false, _, true) => Posture::Prone,
            (false, _, false) => Posture::Supine,
        };
        let rounded = |value: f64, per_unit: f64| (value * per_unit).round() / per_unit + 0.0;
        let degrees = |angle: f64| rounded(angle.to_degrees(), 1e9);
        self.head_yaw_deg = degrees(libm::atan2(head.y, head.x));
        self.head_up_deg = degrees(libm::atan2(head.z, libm::hypot(head.x, head.y)));
        self.body_roll_deg = 0.0;
        let rest = self.orientation().inverse() * world_from_phantom.rotation;
        self.body_roll_deg = degrees(rest.scaled_axis().z);
        let place = world_from_phantom.translation.vector;
        self.position_mm = place.map(|metres| rounded(metres * 1e3, 1e6)).into();
        self.rest_on_table = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_set_in_every_posture() {
        for (posture, down) in [
            (Posture::Supine, Vector3::y()),
            (Posture::Prone, -Vector3::y()),
            (Posture::LeftLateral, Vector3::x()),
            (Posture::RightLateral, -Vector3::x()),
        ] {
            let mut section = PhantomSection {
                posture,
                ..PhantomSection::default()
            };
            assert!((section.orientation().inverse() * -Vector3::z() - down).norm() < 1e-12);
            section.head_yaw_deg = 123.0;
            section.head_up_deg = 7.0;
            section.body_roll_deg = -11.0;
            let wanted = Pose::from_parts(Translation3::new(0.1, -0.2, 0.9), section.orientation());
            let mut set = PhantomSection::default();
            set.set_pose(&wanted);
            assert_eq!(set.posture, posture);
            assert!((set.head_up_deg - 7.0).abs() < 1e-8, "{set:?}");
            assert!(set.orientation().angle_to(&wanted.rotation) < 1e-10);
            assert_eq!(set.position_mm, [100.0, -200.0, 900.0]);
        }
    }

    #[test]
    fn a_lifted_head_is_higher_whatever_the_posture() {
        for posture in [
            Posture::Supine,
            Posture::Prone,
            Posture::LeftLateral,
            Posture::RightLateral,
        ] {
            let section = PhantomSection {
                posture,
                head_up_deg: 10.0,
                head_yaw_deg: 40.0,
                ..PhantomSection::default()
            };
            let head = section.orientation() * Vector3::z();
            assert!((head.z - libm::sin(10_f64.to_radians())).abs() < 1e-12);
        }
    }
}
