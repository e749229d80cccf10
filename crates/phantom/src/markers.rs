//! Black-and-white discs on the skin, with or without a sphere that CT sees.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{Point3, UnitVector3, Vector3};

use super::half_spaces::HalfSpaces;
use super::parameters::MarkerParameters;
use super::solids::{ball, cuboid, cylinder, facing, pose};
use super::{Marker, MarkerSphere, PhantomError, PhantomParameters, PhantomPart, Tissue};
use crate::MarkerKind;

const WHITE_RGBA: [f32; 4] = [0.97, 0.97, 0.97, 1.0];
const BLACK_RGBA: [f32; 4] = [0.04, 0.04, 0.04, 1.0];
const CARRIER_RGBA: [f32; 4] = [0.86, 0.88, 0.90, 0.6];
const SPHERE_RGBA: [f32; 4] = [0.45, 0.48, 0.52, 1.0];
/// The black quadrants are a film of this thickness on the disc, m.
const FILM_M: f64 = 1e-4;
/// Largest height of a marker as a share of the half length: clear of the rounded ends.
const HEIGHT_SHARE: f64 = 0.9;

/// Marker and its parts: the white disc, then two opposite black squares; then what carries the disc, if anything does,
/// and the sphere in it.
///
/// The marker stands on the plane of the face that the ray meets, which supports the convex skin: it touches the skin
/// and never enters it, also where it reaches beyond that face.
pub(super) fn marker(
    placement: &MarkerParameters,
    parameters: &PhantomParameters,
    skin: &HalfSpaces,
) -> Result<(Marker, Vec<PhantomPart>), PhantomError> {
    let off_skin = || PhantomError::MarkerOffSkin {
        marker: placement.name.clone(),
        height_mm: placement.height_mm,
        limit_mm: HEIGHT_SHARE * 0.5 * parameters.length_mm,
    };
    if placement.height_mm.abs() > HEIGHT_SHARE * 0.5 * parameters.length_mm {
        return Err(off_skin());
    }
    let (sine, cosine) = libm::sincos(placement.azimuth_deg.to_radians());
    let direction = UnitVector3::new_normalize(Vector3::new(sine, -cosine, 0.0));
    let axis = Point3::new(0.0, 0.0, 1e-3 * placement.height_mm);
    let (_, leave_m) = skin.clip_line(&axis, &direction).ok_or_else(off_skin)?;
    let on_skin = axis + leave_m * direction.into_inner();
    let normal = skin.nearest_normal(&on_skin).ok_or_else(off_skin)?;

    let radius_m = 0.5e-3 * parameters.marker_diameter_mm;
    let sphere_m = match parameters.marker_kind {
        MarkerKind::Disc => None,
        MarkerKind::CtSphere => Some(1e-3 * parameters.marker_sphere_mm),
    };
    let above_skin = |height_m: f64| on_skin + height_m * normal.into_inner();
    let under_disc_m = sphere_m.unwrap_or(0.0);
    let under_disc = above_skin(under_disc_m);
    let face = above_skin(under_disc_m + 1e-3 * parameters.marker_thickness_mm);
    let part = |solid: needlebench_geometry::Solid, color_rgba| PhantomPart {
        name: solid.name.clone(),
        tissue: Tissue::Marker,
        organ: Some(placement.name.clone()),
        solid,
        color_rgba,
    };
    let white = cylinder(placement.name.clone(), under_disc, face, radius_m);
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
    let mut parts = vec![
        part(white, WHITE_RGBA),
        part(black(1, 1.0), BLACK_RGBA),
        part(black(2, -1.0), BLACK_RGBA),
    ];
    let sphere = sphere_m.map(|diameter_m| MarkerSphere {
        center_m: above_skin(0.5 * diameter_m),
        diameter_m,
    });
    if let Some(sphere) = &sphere {
        let carrier = format!("{}.carrier", placement.name);
        let carrier = cylinder(carrier, on_skin, under_disc, radius_m);
        let name = format!("{}.sphere", placement.name);
        let dense = ball(name, sphere.center_m, 0.5 * sphere.diameter_m);
        parts.extend([part(carrier, CARRIER_RGBA), part(dense, SPHERE_RGBA)]);
    }
    let marker = Marker {
        name: placement.name.clone(),
        center_m: face,
        normal,
        sphere,
    };
    Ok((marker, parts))
}
