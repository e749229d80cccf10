//! Normals at the corners of triangles, for smooth shading.

use nalgebra::Vector3;
use needlebench_geometry::TriangleMesh;

/// Faces that meet at a smaller angle than this shade as one smooth surface: 40 degrees, between
/// the facets of coarse round shapes and the edges of boxes and chamfers.
const CREASE_COSINE: f64 = 0.766;

/// A normal (unit, or zero where the face has none) for each corner of each triangle, in the mesh's
/// frame.
///
/// Vertices at exactly the same place count as one, as mesh files often repeat them. Triangles with
/// indices out of range or vertices that are not finite have zero normals.
pub(crate) fn corner_normals(mesh: &TriangleMesh) -> Vec<[Vector3<f64>; 3]> {
    let places = &places(mesh);
    let faces: Vec<Face> = mesh
        .triangles
        .iter()
        .map(|&triangle| face(mesh, triangle))
        .collect();

    // The corners that meet at each place, as ranges of one list.
    let mut starts = vec![0; mesh.vertices_m.len() + 1];
    let corners = || {
        mesh.triangles
            .iter()
            .enumerate()
            .flat_map(|(face, triangle)| {
                triangle
                    .iter()
                    .enumerate()
                    .filter_map(move |(corner, &vertex)| {
                        Some((face, corner, *places.get(vertex as usize)?))
                    })
            })
    };
    for (_, _, place) in corners() {
        starts[place as usize + 1] += 1;
    }
    for place in 1..starts.len() {
        starts[place] += starts[place - 1];
    }
    let mut meeting = vec![(0, 0); starts[starts.len() - 1]];
    let mut next = starts.clone();
    for (face, corner, place) in corners() {
        meeting[next[place as usize]] = (face, corner);
        next[place as usize] += 1;
    }

    let mut normals: Vec<[Vector3<f64>; 3]> = faces.iter().map(|face| [face.normal; 3]).collect();
    for (face, corner, place) in corners() {
        let own = faces[face].normal;
        let sum: Vector3<f64> = meeting[starts[place as usize]..starts[place as usize + 1]]
            .iter()
            .map(|&(other, at)| (&faces[other].normal, faces[other].weights[at]))
            .filter(|(normal, _)| normal.dot(&own) >= CREASE_COSINE)
            .map(|(normal, weight)| normal * weight)
            .sum();
        normals[face][corner] = sum.try_normalize(f64::MIN_POSITIVE).unwrap_or(own);
    }
    normals
}

struct Face {
    normal: Vector3<f64>,
    /// Weight of the normal at each corner.
    weights: [f64; 3],
}

/// The weights are those of N. Max, "Weights for computing vertex normals from facet normals"
/// (Journal of Graphics Tools 4(2), 1999): exact on spheres, and even on split quads.
fn face(mesh: &TriangleMesh, triangle: [u32; 3]) -> Face {
    let corners = triangle.map(|index| mesh.vertices_m.get(index as usize));
    let [Some(a), Some(b), Some(c)] = corners else {
        return Face {
            normal: Vector3::zeros(),
            weights: [0.0; 3],
        };
    };
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let cross = ab.cross(&-ca);
    let double_area = cross.norm();
    if double_area > 0.0 && double_area.is_finite() {
        let [ab, bc, ca] = [ab, bc, ca].map(|edge| edge.norm_squared());
        let weights = [ca * ab, ab * bc, bc * ca].map(|product| double_area / product);
        Face {
            normal: cross / double_area,
            weights,
        }
    } else {
        Face {
            normal: Vector3::zeros(),
            weights: [0.0; 3],
        }
    }
}

/// For each vertex, the first vertex (in the order of the coordinates) at the same place.
fn places(mesh: &TriangleMesh) -> Vec<u32> {
    let vertices = &mesh.vertices_m;
    let count = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
    // Adding zero makes the two zeros one.
    let key = |index: u32| vertices[index as usize].coords.data.0[0].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..count).collect();
    order.sort_unstable_by_key(|&index| (key(index), index));
    let mut places = vec![0; vertices.len()];
    let mut place = 0;
    for (position, &index) in order.iter().enumerate() {
        if position == 0 || key(order[position - 1]) != key(index) {
            place = index;
        }
        places[index as usize] = place;
    }
    places
}

#[cfg(test)]
mod tests {

    use needlebench_geometry::Shape;

    use super::*;

    /// Rounding of unit vectors.
    const ROUNDING: f64 = 1e-12;

    fn at_corners(mesh: &TriangleMesh) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> {
        mesh.triangles
            .iter()
            .zip(corner_normals(mesh))
            .flat_map(|(triangle, normals)| {
                triangle
                    .iter()
                    .zip(normals)
                    .map(|(&vertex, normal)| (mesh.vertices_m[vertex as usize].coords, normal))
                    .collect::<Vec<_>>()
            })
    }

    #[test]
    fn a_fine_sphere_is_smooth() {
        let mesh = Shape::Sphere { radius_m: 0.5 }.surface(1e-3);
        for (position, normal) in at_corners(&mesh) {
            assert!(
                (normal - position / 0.5).norm() < ROUNDING,
                "{position} {normal}"
            );
        }
    }

    #[test]
    fn a_cylinder_is_smooth_around_and_sharp_at_the_rims() {
        let mesh = Shape::Cylinder {
            radius_m: 0.1,
            half_length_m: 0.4,
        }
        .surface(1e-4);
        let (mut caps, mut walls) = (0, 0);
        for (position, normal) in at_corners(&mesh) {
            if normal.z.abs() > 0.5 {
                assert!((normal.z - position.z.signum()).abs() < ROUNDING);
                caps += 1;
            } else {
                let radial = Vector3::new(position.x, position.y, 0.0) / 0.1;
                assert!((normal - radial).norm() < ROUNDING, "{position} {normal}");
                walls += 1;
            }
        }
        assert_eq!(caps, walls);
    }

    #[test]
    fn repeated_vertices_shade_like_shared_ones() {
        let shared = Shape::Sphere { radius_m: 0.5 }.surface(1e-3);
        let corner = |&index: &u32| shared.vertices_m[index as usize];
        let soup = TriangleMesh {
            vertices_m: shared.triangles.iter().flatten().map(corner).collect(),
            triangles: (0..)
                .map(|n| [3 * n, 3 * n + 1, 3 * n + 2])
                .take(shared.triangles.len())
                .collect(),
        };
        for (one, other) in corner_normals(&shared).iter().zip(corner_normals(&soup)) {
            assert!(
                one.iter()
                    .zip(other)
                    .all(|(a, b)| (a - b).norm() < ROUNDING)
            );
        }
    }

    #[test]
    fn defective_triangles_have_no_normal() {
        let mut mesh = Shape::Sphere { radius_m: 0.5 }.surface(1e-2);
        mesh.triangles = vec![[0, 1, 1], [0, 1, 9999], [0, 1, 2]];
        mesh.vertices_m[2].x = f64::NAN;
        assert_eq!(corner_normals(&mesh), [[Vector3::zeros(); 3]; 3]);
    }
}
