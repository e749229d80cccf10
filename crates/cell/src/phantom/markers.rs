//! Black-and-white discs on the skin.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{Point3, UnitVector3, Vector3};

use super::half_spaces::HalfSpaces;
use super::parameters::MarkerParameters;
use super::solids::{cuboid, cylinder, facing, pose};
use super::{Marker, PhantomError, PhantomParameters, PhantomPart, Tissue};

const WHITE_RGBA: [f32; 4] = [0.97, 0.97, 0.97, 1.0];
const BLACK_RGBA: [f32; 4] = [0.04, 0.04, 0.04, 1.0];
/// The black quadrants are a film of this thickness on the disc, m.
const FILM_M: f64 = 1e-4;
/// Largest height of a marker as a share of the half length: clear of the rounded ends.
const HEIGHT_SHARE: f64 = 0.9;

/// Marker and its parts: the white disc, then two opposite black squares.
///
/// The disc lies on the plane of the face that the ray meets, which supports the convex skin: the
/// disc touches the skin and never enters it, also where it reaches beyond that face.
pub(super) fn marker(
    placement: &MarkerParameters,
    parameters: &PhantomParameters,
    skin: &HalfSpaces,
) -> Result<(Marker, [PhantomPart; 3]), PhantomError> {
    let off_skin = || PhantomError::MarkerOffSkin {
        marker: placement.name.clone(),
        height_mm: placement.height_mm,
        limit_mm: HEIGHT_SHARE * 0.5 * parameters.length_mm,
    };
    if placement.height_mm.abs() > HEIGHT_SHARE * 0.5 * parameters.length_mm {
        return Err(off_skin());
    }
    let (sine, cosine) = placement.azimuth_deg.to_radians().sin_cos();
    let direction = UnitVector3::new_normalize(Vector3::new(sine, -cosine, 0.0));
    let axis = Point3::new(0.0, 0.0, 1e-3 * placement.height_mm);
    let (_, leave_m) = skin.clip_line(&axis, &direction).ok_or_else(off_skin)?;
    let on_skin = axis + leave_m * direction.into_inner();
    let normal = skin.nearest_normal(&on_skin).ok_or_else(off_skin)?;

    let radius_m = 0.5e-3 * parameters.marker_diameter_mm;
    let face = on_skin + 1e-3 * parameters.marker_thickness_mm * normal.into_inner();
    let part = |solid: needlebench_geometry::Solid, color_rgba| PhantomPart {
        name: solid.name.clone(),
        tissue: Tissue::Marker,
        organ: Some(placement.name.clone()),
        solid,
        color_rgba,
    };
    let white = cylinder(placement.name.clone(), on_skin, face, radius_m);
    // The squares meet at the disc's centre; their far corners lie on its rim.
    let side_m = FRAC_1_SQRT_2 * radius_m;
    let rotation = facing(&normal);
    let black = |number: u32, sign: f64| {
        let offset = rotation * Vector3::new(sign * 0.5 * side_m, sign * 0.5 * side_m, 0.0);
        let center = face + offset + 0.5 * FILM_M * normal.into_inner();
        cuboid(
            format!("{}.black_{number}", placement.name),
            Vector3::new(0.5 * side_m, 0.5 * side_m, 0.5 * FILM_M),
            pose(center, rotation),
        )
    };
    let parts = [
        part(white, WHITE_RGBA),
        part(black(1, 1.0), BLACK_RGBA),
        part(black(2, -1.0), BLACK_RGBA),
    ];
    let marker = Marker {
        name: placement.name.clone(),
        center_m: face,
        normal,
    };
    Ok((marker, parts))
}
