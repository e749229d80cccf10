//! The phantom of a scenario: shipped, from the user's files, or both; and where it lies.

use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_kinematics::Pose;

use crate::files::{Location, source_of};
use crate::fixtures::TableParameters;
use crate::goal::PlacedPhantom;
use crate::model::ModelSource;
use crate::phantom::{Phantom, PhantomError, PhantomParameters};
use crate::scenario::{PhantomSection, Posture, Scenario};
use crate::toml_text::TomlText;
use crate::user_parts::with_user_parts;
use crate::{Finding, nearest_name};

/// Value of `model` for a phantom of the user's parts alone.
const NO_MODEL: &str = "none";

/// A phantom in its place, and the files that it is made of.
pub(crate) struct FoundPhantom {
    pub placed: PlacedPhantom,
    /// Parameter file, unless the phantom is of the user's parts alone.
    pub model: Option<ModelSource>,
    /// Files of the user's parts.
    pub parts: Vec<ModelSource>,
}

pub(crate) fn place_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    scenario: &Scenario,
    base: &Path,
    notes: &mut Vec<String>,
) -> Result<FoundPhantom, Finding> {
    let (shipped, model) = if section.model == NO_MODEL {
        check_no_model(toml, section)?;
        (None, None)
    } else {
        let (phantom, source) = shipped_phantom(toml, section, base)?;
        (Some(phantom), Some(source))
    };
    let (phantom, parts) = match shipped {
        Some(phantom) if section.parts.is_empty() => (phantom, Vec::new()),
        shipped => with_user_parts(toml, &section.parts, shipped, base, notes)?,
    };
    let mut world_from_phantom = Pose::from_parts(
        Translation3::from(Vector3::from(section.position_mm) * 1e-3),
        orientation(section),
    );
    if section.rest_on_table {
        let Some(table) = &scenario.table else {
            return Err(toml
                .finding("phantom.rest_on_table", "there is no [table] to rest on")
                .hint("add a [table], or set `rest_on_table = false` and give the full position"));
        };
        check_over_table(toml, table, section.position_mm)?;
        let skin = phantom.skin();
        // A polyhedron is its own surface, whatever the fineness.
        let lowest_m = skin
            .shape
            .surface(0.0)
            .vertices_m
            .iter()
            .map(|vertex| {
                (world_from_phantom.rotation * (skin.parent_from_shape * vertex).coords).z
            })
            .fold(f64::INFINITY, f64::min);
        world_from_phantom.translation.vector.z =
            (table.top_height_mm + section.position_mm[2]) * 1e-3 - lowest_m;
    }
    Ok(FoundPhantom {
        placed: PlacedPhantom {
            phantom,
            world_from_phantom,
        },
        model,
        parts,
    })
}

/// A phantom without a model is what its parts are.
fn check_no_model(toml: &TomlText<'_>, section: &PhantomSection) -> Result<(), Finding> {
    for (name, given) in [
        ("breadth_mm", section.breadth_mm),
        ("depth_mm", section.depth_mm),
        ("length_mm", section.length_mm),
    ] {
        if given.is_some() {
            return Err(toml
                .finding(
                    &format!("phantom.{name}"),
                    format!("`{name}` contradicts `model = \"{NO_MODEL}\"`"),
                )
                .hint("the parts have the size of their files"));
        }
    }
    Ok(())
}

/// The phantom that a parameter file describes.
fn shipped_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    base: &Path,
) -> Result<(Phantom, ModelSource), Finding> {
    let location = Location::of_model(&section.model, "chest_phantom", "toml", base);
    let bytes = location.read().map_err(|error| {
        let names = Location::builtin_names("chest_phantom", "toml");
        toml.finding("phantom.model", format!("{}: {error}", location.display()))
            .hint(
                match nearest_name(&section.model, names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!(
                        "a path, `{NO_MODEL}` for [[phantom.parts]] alone, or one of {}",
                        names.join(", ")
                    ),
                },
            )
    })?;
    let file = location.display();
    let text = String::from_utf8(bytes)
        .map_err(|error| Finding::new(&file, format!("not UTF-8 text: {error}")))?;
    let parameter_text = TomlText::parse(&file, &text)?;
    let mut parameters: PhantomParameters = parameter_text.deserialize()?;
    let sizes = [
        (&mut parameters.breadth_mm, section.breadth_mm),
        (&mut parameters.depth_mm, section.depth_mm),
        (&mut parameters.length_mm, section.length_mm),
    ];
    let mut resized = false;
    for (size, wanted) in sizes {
        if let Some(wanted) = wanted {
            *size = wanted;
            resized = true;
        }
    }
    let phantom = Phantom::build(&parameters).map_err(|error| {
        if resized {
            let key = match &error {
                PhantomError::OutOfRange { key, .. } => format!("phantom.{key}"),
                _ => "phantom".to_owned(),
            };
            toml.finding(&key, error.to_string())
                .hint("lengths are in millimetres; leave a size out to take the model's own")
        } else {
            Finding::new(&file, error.to_string())
        }
    })?;
    Ok((phantom, source_of(file, text.as_bytes())))
}

/// Refuses a phantom that rests on a table it does not lie over.
fn check_over_table(
    toml: &TomlText<'_>,
    table: &TableParameters,
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
