//! What the shipped arm's enclosing primitives cost: how far they are from the manufacturer's surfaces.

use nalgebra::Point3;
use needlebench_cell::{Robot, placed};
use needlebench_geometry::mesh::{SurfaceIndex, area_m2, points_on};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::Joints;
use serde::Serialize;

use crate::RobotDescription;

/// Samples on the surface of a link, about.
const SAMPLES: f64 = 20_000.0;

/// How much denser the samples are by which a protrusion is found: it is the unsafe side, and a
/// distance from primitives costs little.
const FINER: f64 = 5.0;

/// How far the tessellated primitives may be inside the true ones, m.
const CHORD_ERROR_M: f64 = 1e-5;

/// The shipped arm's primitives of one link beside the surface of the robot in use.
///
/// Measured on samples of either surface; distances are exact for each sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinkEnclosure {
    /// Short name of the link.
    pub link: String,
    /// Mean distance from the link's surface, over the outer surface of its primitives: what a
    /// clearance by the primitives is too small by.
    pub mean_overhang_m: f64,
    /// Largest such distance.
    pub worst_overhang_m: f64,
    /// How far the link's surface reaches out of the primitives at most; negative: it is inside
    /// everywhere, by that much at least.
    pub worst_protrusion_m: f64,
    /// Distance between neighbouring samples; a fifth of it for the protrusion.
    pub sample_spacing_m: f64,
}

/// Compares the enclosing primitives of an arm's own URDF with the meshes of the robot that has its
/// data, link by link.
///
/// Empty for the arm's own URDF itself, for an arm whose shapes enclose nothing that is known, for a
/// robot without meshes, and for one whose joint origins a calibration has replaced: its link frames are
/// no longer where its URDF drew them.
pub fn enclosures(robot: &Robot, description: &RobotDescription) -> Vec<LinkEnclosure> {
    if description.meshes.is_empty() || description.calibration.is_some() {
        return Vec::new();
    }
    let known = known_envelopes(robot, description);
    robot
        .all_links()
        .zip(&known)
        .filter(|(link, _)| !link.solids.is_empty())
        .map(|(link, primitives)| compare(&link.name, &link.solids, primitives))
        .collect()
}

/// The enclosing primitives of base and moving links in a robot's link frames, by the arm's own URDF; empty where
/// nothing is known of it, and of the arm's own URDF itself.
pub(super) fn known_envelopes(robot: &Robot, description: &RobotDescription) -> Vec<Vec<Solid>> {
    let used = description.arm.as_ref();
    let used = used.filter(|used| used.has_its_lengths() && used.arm.data.enclosure.is_some());
    let Some(nominal) = used.and_then(|used| used.nominal.as_ref()) else {
        return Vec::new();
    };
    // Two descriptions of one arm may turn their link frames differently; at zero angles the links
    // are in the same place.
    let zero = Joints::zeros();
    let (theirs, ours) = (
        robot.chain.link_poses(&zero),
        nominal.chain.link_poses(&zero),
    );
    let moving = nominal.links.iter().zip(theirs.iter().zip(&ours));
    let moving =
        moving.map(|(link, (theirs, ours))| placed(&link.solids, &(theirs.inverse() * ours)));
    std::iter::once(nominal.base.solids.clone())
        .chain(moving)
        .collect()
}

/// How far the outer surface of solids is outside something, m.
#[expect(clippy::struct_field_names, reason = "their unit")]
pub(super) struct Overhang {
    pub mean_m: f64,
    pub worst_m: f64,
    /// Distance between neighbouring samples.
    pub spacing_m: f64,
}

/// Samples the outer surface of solids, about `samples` times: what is within another of them is not outside.
pub(super) fn overhang(
    solids: &[Solid],
    samples: f64,
    distance_m: impl Fn(&Point3<f64>) -> f64,
) -> Overhang {
    let surfaces: Vec<SurfaceIndex> = solids.iter().map(surface_in_parent).collect();
    let area: f64 = surfaces.iter().map(|each| area_m2(each.mesh())).sum();
    let spacing_m = (area / samples).sqrt();
    let (mut sum_m, mut count, mut worst_m) = (0.0, 0_u32, 0.0_f64);
    for (index, surface) in surfaces.iter().enumerate() {
        for point in points_on(surface.mesh(), spacing_m) {
            let is_hidden = solids.iter().enumerate().any(|(other, solid)| {
                other != index && signed_distance_m(solid, &point) < -CHORD_ERROR_M
            });
            if is_hidden {
                continue;
            }
            let over_m = distance_m(&point).max(0.0);
            worst_m = worst_m.max(over_m);
            sum_m += over_m;
            count += 1;
        }
    }
    Overhang {
        mean_m: sum_m / f64::from(count.max(1)),
        worst_m,
        spacing_m,
    }
}

/// The distance of the nearest of several bodies.
pub(super) fn nearest_m(distances_m: impl Iterator<Item = f64>) -> f64 {
    distances_m.fold(f64::INFINITY, f64::min)
}

fn compare(link: &str, solids: &[Solid], primitives: &[Solid]) -> LinkEnclosure {
    let surfaces: Vec<SurfaceIndex> = solids.iter().map(surface_in_parent).collect();
    let over = overhang(primitives, SAMPLES, |point| {
        nearest_m(surfaces.iter().map(|each| each.signed_distance_m(point)))
    });
    let worst_protrusion_m = surfaces
        .iter()
        .flat_map(|surface| points_on(surface.mesh(), over.spacing_m / FINER))
        .map(|point| {
            nearest_m(
                primitives
                    .iter()
                    .map(|each| signed_distance_m(each, &point)),
            )
        })
        .fold(f64::NEG_INFINITY, f64::max);
    LinkEnclosure {
        link: link.to_owned(),
        mean_overhang_m: over.mean_m,
        worst_overhang_m: over.worst_m,
        worst_protrusion_m,
        sample_spacing_m: over.spacing_m,
    }
}

/// A solid's surface in the frame of its link.
pub(super) fn surface_in_parent(solid: &Solid) -> SurfaceIndex {
    let mut mesh = solid.shape.surface(CHORD_ERROR_M);
    for vertex in &mut mesh.vertices_m {
        *vertex = solid.parent_from_shape * *vertex;
    }
    SurfaceIndex::new(mesh)
}

/// Distance of a point of the link from a solid, m: negative inside. Exact for the primitives.
pub(super) fn signed_distance_m(solid: &Solid, point: &Point3<f64>) -> f64 {
    let local = solid.parent_from_shape.inverse() * point;
    // From the distances beyond a body's extents along independent directions.
    let beyond = |out: &[f64]| {
        let outside = out.iter().map(|each| each.max(0.0).powi(2)).sum::<f64>();
        let inside = out.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        outside.sqrt() + inside.min(0.0)
    };
    match &solid.shape {
        Shape::Sphere { radius_m } => local.coords.norm() - radius_m,
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => beyond(&[
            libm::hypot(local.x, local.y) - radius_m,
            local.z.abs() - half_length_m,
        ]),
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => {
            let on_axis = local.z.clamp(-half_length_m, *half_length_m);
            (local - Point3::new(0.0, 0.0, on_axis)).norm() - radius_m
        }
        Shape::Cuboid { half_extents_m } => {
            beyond((local.coords.abs() - half_extents_m).as_slice())
        }
        Shape::Convex(_) | Shape::Mesh(_) => surface_in_parent(solid).signed_distance_m(point),
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::sync::Arc;

    use nalgebra::Vector3;
    use needlebench_geometry::SolidMesh;
    use needlebench_geometry::sample_solids::bowl;
    use needlebench_kinematics::Pose;

    use super::*;

    /// Samples are 2 mm apart and never at the very edge.
    const SAMPLED_M: f64 = 1.5e-3;

    fn solid(shape: Shape) -> Solid {
        Solid {
            name: String::new(),
            shape,
            parent_from_shape: Pose::translation(0.0, 0.0, 0.025),
        }
    }

    #[test]
    fn distances_from_primitives_are_signed() {
        let cuboid = solid(Shape::Cuboid {
            half_extents_m: Vector3::new(0.01, 0.02, 0.03),
        });
        let at = |x, y, z| signed_distance_m(&cuboid, &Point3::new(x, y, z));
        assert!((at(0.013, 0.024, 0.025) - 0.005).abs() < 1e-15);
        assert!((at(0.0, 0.0, 0.025) + 0.01).abs() < 1e-15);
        let can = solid(Shape::Cylinder {
            radius_m: 0.01,
            half_length_m: 0.025,
        });
        let far = signed_distance_m(&can, &Point3::new(0.0, 0.013, 0.054));
        assert!((far - 0.005).abs() < 1e-15);
    }

    #[test]
    fn can_around_a_bowl_costs_the_depth_of_the_bowl() {
        let bowl = Solid {
            name: String::new(),
            shape: Shape::Mesh(Arc::new(SolidMesh::new(bowl()))),
            parent_from_shape: Pose::identity(),
        };
        let can = |radius_m| {
            vec![solid(Shape::Cylinder {
                radius_m,
                half_length_m: 0.026,
            })]
        };
        let found = compare("bowl", std::slice::from_ref(&bowl), &can(0.051));
        // Over the middle of the cavity, which is 40 mm wide on either side and 40 mm deep.
        let middle_m = libm::hypot(0.04_f64, 0.001);
        assert!(found.worst_overhang_m < middle_m + 1e-3);
        assert!(found.worst_overhang_m > middle_m - SAMPLED_M);
        // Lid: a disc of 40 mm over the cavity, at most as far as its distance from the rim.
        let lid_m2 = PI * 0.04 * 0.04;
        let can_m2 = 2.0 * PI * 0.051 * (0.052 + 0.051);
        let lower_m = lid_m2 / can_m2 * 0.04 / 3.0;
        assert!(found.mean_overhang_m > lower_m, "{found:?}");
        assert!(found.mean_overhang_m < lower_m + 2e-3, "{found:?}");
        assert!((found.worst_protrusion_m + 0.001).abs() < 1e-9, "{found:?}");
        // A can that is too narrow by 2 mm.
        let found = compare("bowl", &[bowl], &can(0.048));
        assert!((found.worst_protrusion_m - 0.002).abs() < 1e-9, "{found:?}");
    }
}
