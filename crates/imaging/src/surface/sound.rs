//! Surfaces as they will be written, without triangles that rounding makes flat.

use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::has_no_area;

/// Share of the way to the middle of its neighbours that a corner of a flat triangle goes in a round.
const STEP: f64 = 0.1;

/// Rounds after which what is flat is left: it takes one or two.
const ROUNDS: usize = 10;

/// The surface with its vertices rounded as binary STL has them, in mm to single precision, and corners of flat triangles moved
/// towards their neighbours: by a tenth of their distance, which a flat triangle has hardly any of. Which triangles there are
/// stays.
pub fn sound(mut mesh: TriangleMesh) -> TriangleMesh {
    round(&mut mesh);
    for _ in 0..ROUNDS {
        let mut corners: Vec<u32> = mesh
            .triangles
            .iter()
            .filter(|triangle| has_no_area(&mesh, **triangle))
            .flatten()
            .copied()
            .collect();
        if corners.is_empty() {
            break;
        }
        corners.sort_unstable();
        corners.dedup();
        let moved: Vec<_> = corners
            .iter()
            .map(|corner| {
                let around = mesh
                    .triangles
                    .iter()
                    .filter(|triangle| triangle.contains(corner));
                let others = around.flatten().filter(|other| *other != corner);
                let (sum, count) =
                    others.fold((nalgebra::Vector3::zeros(), 0.0), |(sum, count), other| {
                        (sum + mesh.vertices_m[*other as usize].coords, count + 1.0)
                    });
                let at = mesh.vertices_m[*corner as usize];
                at + (sum / count - at.coords) * STEP
            })
            .collect();
        for (corner, at) in corners.into_iter().zip(moved) {
            mesh.vertices_m[corner as usize] = at;
        }
        round(&mut mesh);
    }
    mesh
}

fn round(mesh: &mut TriangleMesh) {
    for vertex in &mut mesh.vertices_m {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "single precision is what is wanted"
        )]
        let rounded = vertex
            .coords
            .map(|metres| f64::from((metres * 1e3) as f32) * 1e-3);
        vertex.coords = rounded;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_geometry::mesh::check_closed;
    use needlebench_geometry::sample_solids;

    #[test]
    fn flat_triangles_get_an_area_and_others_stay() {
        let good = sample_solids::torus(24, 12);
        assert_eq!(sound(good.clone()).triangles, good.triangles);
        let mut flat = good;
        // Two neighbours at one place, and another pair a nanometre apart.
        let [a, b, _] = flat.triangles[0];
        flat.vertices_m[a as usize] = flat.vertices_m[b as usize];
        let [a, b, _] = flat.triangles[200];
        flat.vertices_m[a as usize] = flat.vertices_m[b as usize];
        flat.vertices_m[a as usize].x += 1e-12;
        assert!(check_closed(&flat).is_err());
        let mended = sound(flat);
        check_closed(&mended).unwrap();
    }
}
