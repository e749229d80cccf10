//! Surfaces of shapes as triangle meshes, for pictures and exporters.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::Point3;

use crate::shape::Shape;
use crate::triangle_mesh::TriangleMesh;

/// Fewest segments around a full circle: below this a cylinder no longer reads as round.
const MIN_SEGMENTS: u32 = 8;

/// Most segments around a full circle; bounds a sphere to 16 000 triangles.
const MAX_SEGMENTS: u32 = 128;

/// A ring of a surface of revolution about z.
#[derive(Debug, Clone, Copy)]
struct Ring {
    radius_m: f64,
    z_m: f64,
}

impl Shape {
    /// Closed triangle mesh of the surface, counter-clockwise seen from outside, in the shape's
    /// frame.
    ///
    /// Every vertex lies on the true surface, so the mesh is inscribed; no point of it is further
    /// than `chord_error_m` inside, as long as the bounds of 8 to 128 segments per full circle
    /// allow. A chord error that is zero, negative or NaN asks for the finest mesh. A convex
    /// polyhedron and a mesh are their own surface.
    pub fn surface(&self, chord_error_m: f64) -> TriangleMesh {
        match self {
            Self::Sphere { radius_m } => capsule(*radius_m, 0.0, chord_error_m),
            Self::Capsule {
                radius_m,
                half_length_m,
            } => capsule(*radius_m, *half_length_m, chord_error_m),
            Self::Cylinder {
                radius_m,
                half_length_m,
            } => {
                let rings = [-half_length_m, *half_length_m].map(|z_m| Ring {
                    radius_m: *radius_m,
                    z_m,
                });
                revolve(
                    -half_length_m,
                    &rings,
                    *half_length_m,
                    segments(*radius_m, chord_error_m),
                )
            }
            Self::Cuboid { half_extents_m } => {
                cuboid(half_extents_m.x, half_extents_m.y, half_extents_m.z)
            }
            Self::Convex(mesh) => mesh.0.clone(),
            Self::Mesh(mesh) => mesh.surface().clone(),
        }
    }
}

/// Segments of a full circle whose chords stay within `chord_error_m` of it: a multiple of four,
/// so that the quadrants are alike and the extreme points along x and y are vertices.
fn segments(radius_m: f64, chord_error_m: f64) -> u32 {
    // The sagitta of a chord over the half angle h is r (1 - cos h) = 2 r sin^2(h / 2).
    // NaN from a negative error passes through `clamp`.
    let sine = (chord_error_m / (2.0 * radius_m)).sqrt().clamp(0.0, 1.0);
    let half_angle_rad = 2.0 * libm::atan2(sine, (1.0 - sine * sine).sqrt());
    let wanted = (TAU / (2.0 * half_angle_rad)).ceil();
    let bounded = if wanted < f64::from(MIN_SEGMENTS) {
        MIN_SEGMENTS
    } else if wanted < f64::from(MAX_SEGMENTS) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "8 to 128"
        )]
        let count = wanted as u32;
        count
    } else {
        // NaN and infinity, from a chord error that is not positive, arrive here.
        MAX_SEGMENTS
    };
    bounded.next_multiple_of(4)
}

/// A capsule about z; a sphere when the segment has no length.
fn capsule(radius_m: f64, half_length_m: f64, chord_error_m: f64) -> TriangleMesh {
    // Facets of a doubly curved surface sag along both directions, and the two sagittas add up.
    let around = segments(radius_m, chord_error_m / 2.0);
    let per_quadrant = around / 4;
    // The sign of the centre tells the hemisphere, that of a zero too.
    let ring = |step: u32, centre_z_m: f64| {
        let latitude_rad = FRAC_PI_2 * f64::from(step) / f64::from(per_quadrant);
        let sign = if centre_z_m.is_sign_negative() {
            -1.0
        } else {
            1.0
        };
        Ring {
            radius_m: radius_m * libm::cos(latitude_rad),
            z_m: centre_z_m + sign * radius_m * libm::sin(latitude_rad),
        }
    };
    let mut rings: Vec<Ring> = (0..per_quadrant)
        .rev()
        .map(|step| ring(step, -half_length_m))
        .collect();
    // A sphere has one equator, not two that coincide.
    let upper_start = u32::from(half_length_m == 0.0);
    rings.extend((upper_start..per_quadrant).map(|step| ring(step, half_length_m)));
    revolve(
        -half_length_m - radius_m,
        &rings,
        half_length_m + radius_m,
        around,
    )
}

/// The surface of revolution about z from the axis at `bottom_z_m` over `rings` (upwards) to the
/// axis at `top_z_m`.
fn revolve(bottom_z_m: f64, rings: &[Ring], top_z_m: f64, around: u32) -> TriangleMesh {
    let mut vertices_m = vec![Point3::new(0.0, 0.0, bottom_z_m)];
    let mut triangles = Vec::new();
    for ring in rings {
        vertices_m.extend((0..around).map(|step| {
            let (sine, cosine) = libm::sincos(TAU * f64::from(step) / f64::from(around));
            Point3::new(ring.radius_m * cosine, ring.radius_m * sine, ring.z_m)
        }));
    }
    vertices_m.push(Point3::new(0.0, 0.0, top_z_m));

    let mut first = 1;
    for level in 0..rings.len() {
        let next_level = first + around;
        for step in 0..around {
            let (a, b) = (first + step, first + (step + 1) % around);
            if level == 0 {
                triangles.push([0, b, a]);
            }
            if level + 1 == rings.len() {
                triangles.push([a, b, next_level]);
            } else {
                let (c, d) = (a + around, b + around);
                triangles.push([a, b, d]);
                triangles.push([a, d, c]);
            }
        }
        first = next_level;
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

/// The box with the given half edge lengths.
fn cuboid(x_m: f64, y_m: f64, z_m: f64) -> TriangleMesh {
    // Vertex index bits: 1 = +x, 2 = +y, 4 = +z.
    let vertices_m = (0..8)
        .map(|index: u32| {
            let side = |bit: u32, half_m: f64| if index & bit == 0 { -half_m } else { half_m };
            Point3::new(side(1, x_m), side(2, y_m), side(4, z_m))
        })
        .collect();
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::f64::consts::PI;
    use std::sync::Arc;

    use nalgebra::Vector3;

    use super::*;
    use crate::mesh::SolidMesh;
    use crate::triangle_mesh::ConvexMesh;

    const RADIUS_M: f64 = 0.06;
    const HALF_LENGTH_M: f64 = 0.2;
    const CHORD_ERROR_M: f64 = 2e-4;

    /// Rounding of a handful of operations on metre-sized coordinates.
    const ROUNDING_M: f64 = 1e-15;

    fn half_extents_m() -> Vector3<f64> {
        Vector3::new(0.1, 0.2, 0.3)
    }

    fn shapes() -> [Shape; 6] {
        let (radius_m, half_length_m) = (RADIUS_M, HALF_LENGTH_M);
        let cuboid = Shape::Cuboid {
            half_extents_m: half_extents_m(),
        };
        let convex = Shape::Convex(Arc::new(ConvexMesh(cuboid.surface(CHORD_ERROR_M))));
        let mesh = Shape::Mesh(Arc::new(SolidMesh::new(cuboid.surface(CHORD_ERROR_M))));
        [
            Shape::Sphere { radius_m },
            Shape::Cylinder {
                radius_m,
                half_length_m,
            },
            Shape::Capsule {
                radius_m,
                half_length_m,
            },
            cuboid,
            convex,
            mesh,
        ]
    }

    /// True volume in m3 and curved area in m2.
    fn volume_and_curved_area(shape: &Shape) -> (f64, f64) {
        let (r, l) = (RADIUS_M, 2.0 * HALF_LENGTH_M);
        let (ball, sphere) = (4.0 / 3.0 * PI * r.powi(3), 4.0 * PI * r * r);
        let (rod, tube) = (PI * r * r * l, 2.0 * PI * r * l);
        match shape {
            Shape::Sphere { .. } => (ball, sphere),
            Shape::Cylinder { .. } => (rod, tube),
            Shape::Capsule { .. } => (ball + rod, sphere + tube),
            Shape::Cuboid { .. } | Shape::Convex(_) | Shape::Mesh(_) => {
                (8.0 * half_extents_m().product(), 0.0)
            }
        }
    }

    fn corners(mesh: &TriangleMesh, triangle: [u32; 3]) -> [Point3<f64>; 3] {
        triangle.map(|index| mesh.vertices_m[index as usize])
    }

    fn distance_to_surface_m(shape: &Shape, p: &Point3<f64>) -> f64 {
        let across_m = libm::hypot(p.x, p.y);
        match shape {
            Shape::Sphere { radius_m } => (p.coords.norm() - radius_m).abs(),
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => (across_m - radius_m).max(p.z.abs() - half_length_m).abs(),
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => (libm::hypot(across_m, (p.z.abs() - half_length_m).max(0.0)) - radius_m).abs(),
            Shape::Cuboid { .. } | Shape::Convex(_) | Shape::Mesh(_) => {
                (p.coords.abs() - half_extents_m()).max().abs()
            }
        }
    }

    #[test]
    fn every_directed_edge_has_exactly_one_opposite() {
        for shape in shapes() {
            let mesh = shape.surface(CHORD_ERROR_M);
            let mut edges = BTreeSet::new();
            for [a, b, c] in &mesh.triangles {
                for edge in [(a, b), (b, c), (c, a)] {
                    assert!(edges.insert(edge), "{shape:?} repeats {edge:?}");
                }
            }
            assert!(
                edges.iter().all(|&(a, b)| edges.contains(&(b, a))),
                "{shape:?} is open"
            );
            let used: BTreeSet<_> = mesh.triangles.iter().flatten().collect();
            assert_eq!(
                used.len(),
                mesh.vertices_m.len(),
                "{shape:?} has unused vertices"
            );
            assert_eq!(
                mesh.vertices_m.len() + mesh.triangles.len(),
                edges.len() / 2 + 2
            );
        }
    }

    #[test]
    fn every_face_of_these_convex_shapes_turns_away_from_the_centre() {
        for shape in shapes() {
            let mesh = shape.surface(CHORD_ERROR_M);
            for &triangle in &mesh.triangles {
                let [a, b, c] = corners(&mesh, triangle);
                assert!(
                    (b - a).cross(&(c - a)).dot(&a.coords) > 0.0,
                    "{shape:?} {triangle:?}"
                );
            }
        }
    }

    #[test]
    fn vertices_are_on_the_surface_and_centroids_within_the_chord_error() {
        for shape in shapes() {
            let mesh = shape.surface(CHORD_ERROR_M);
            for p in &mesh.vertices_m {
                assert!(
                    distance_to_surface_m(&shape, p) <= ROUNDING_M,
                    "{shape:?} {p}"
                );
            }
            for &triangle in &mesh.triangles {
                let [a, b, c] = corners(&mesh, triangle);
                let centroid = Point3::from((a.coords + b.coords + c.coords) / 3.0);
                assert!(
                    distance_to_surface_m(&shape, &centroid) <= CHORD_ERROR_M,
                    "{shape:?}"
                );
            }
        }
    }

    #[test]
    fn volume_falls_short_by_at_most_the_curved_area_times_the_chord_error() {
        for shape in shapes() {
            let mesh = shape.surface(CHORD_ERROR_M);
            let volume_m3: f64 = mesh
                .triangles
                .iter()
                .map(|&triangle| corners(&mesh, triangle))
                .map(|[a, b, c]| a.coords.cross(&b.coords).dot(&c.coords) / 6.0)
                .sum();
            let (true_m3, curved_m2) = volume_and_curved_area(&shape);
            let missing_m3 = true_m3 - volume_m3;
            assert!(
                missing_m3 >= -ROUNDING_M,
                "{shape:?} is not inscribed: {missing_m3}"
            );
            assert!(
                missing_m3 <= curved_m2 * CHORD_ERROR_M + ROUNDING_M,
                "{shape:?}"
            );
        }
    }

    #[test]
    fn segment_count_is_bounded_whatever_the_chord_error() {
        let rim = |chord_error_m| segments(RADIUS_M, chord_error_m);
        assert_eq!(rim(1.0), MIN_SEGMENTS);
        for finest in [0.0, -1.0, f64::NAN, 1e-12] {
            assert_eq!(rim(finest), MAX_SEGMENTS, "{finest}");
        }
        assert!((MIN_SEGMENTS..MAX_SEGMENTS).contains(&rim(CHORD_ERROR_M)));
        assert_eq!(segments(0.0, CHORD_ERROR_M), MIN_SEGMENTS);
    }
}
