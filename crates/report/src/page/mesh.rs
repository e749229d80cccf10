//! Surfaces small enough for a page: merged, thinned out, quantised.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::TriangleMesh;
use serde_json::{Value, json};

use super::pack::Pack;

/// Triangles of one merged surface above which it is thinned out.
pub(super) const MOST_TRIANGLES: usize = 16_000;
/// Edge of the cubes by which the first attempt merges vertices, m, and factor to the next one.
const FIRST_CUBE_M: f64 = 1e-3;
const NEXT_CUBE: f64 = 1.3;

/// The mesh with at most `most` triangles: vertices within a cube become their mean.
pub(super) fn thinned(mesh: &TriangleMesh, most: usize) -> TriangleMesh {
    let mut cube_m = FIRST_CUBE_M;
    // Vertices at one place count as one, whatever the number of triangles.
    let mut thin = clustered(mesh, 0.0);
    while thin.triangles.len() > most {
        thin = clustered(mesh, cube_m);
        cube_m *= NEXT_CUBE;
    }
    thin
}

/// Merges the vertices within cubes (at exactly the same place for an edge of 0) and leaves out the
/// triangles that vanish.
fn clustered(mesh: &TriangleMesh, cube_m: f64) -> TriangleMesh {
    let mut cells: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut sums: Vec<(Vector3<f64>, f64)> = Vec::new();
    let cell_of: Vec<u32> = mesh
        .vertices_m
        .iter()
        .map(|vertex| {
            let key = [vertex.x, vertex.y, vertex.z].map(|x| key(x, cube_m));
            let next = u32::try_from(sums.len()).expect("no more than vertices");
            let cell = *cells.entry(key).or_insert(next);
            if cell == next {
                sums.push((Vector3::zeros(), 0.0));
            }
            let (sum, count) = &mut sums[cell as usize];
            *sum += vertex.coords;
            *count += 1.0;
            cell
        })
        .collect();
    let triangles = mesh
        .triangles
        .iter()
        .map(|corners| corners.map(|corner| cell_of[corner as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    TriangleMesh {
        vertices_m: sums
            .into_iter()
            .map(|(sum, count)| Point3::from(sum / count))
            .collect(),
        triangles,
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "a cell is metres wide, cubes at least a millimetre; the bits stand for themselves"
)]
fn key(x: f64, cube_m: f64) -> i64 {
    if cube_m > 0.0 {
        (x / cube_m).floor() as i64
    } else {
        // The two zeros are one place.
        (x + 0.0).to_bits() as i64
    }
}

/// The same triangles with the vertices that they have, numbered as they come.
fn in_order_of_use(mesh: &TriangleMesh) -> TriangleMesh {
    let mut numbers: Vec<Option<u32>> = vec![None; mesh.vertices_m.len()];
    let mut vertices_m = Vec::new();
    let triangles = mesh
        .triangles
        .iter()
        .map(|corners| {
            corners.map(|corner| {
                *numbers[corner as usize].get_or_insert_with(|| {
                    vertices_m.push(mesh.vertices_m[corner as usize]);
                    u32::try_from(vertices_m.len() - 1).expect("no more than vertices")
                })
            })
        })
        .collect();
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

/// The document's part on a surface: corners in steps of 1 / 65535 of its box, and triangles.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within 0 and 65535"
)]
pub(super) fn surface(pack: &mut Pack, mesh: &TriangleMesh) -> Value {
    let mesh = in_order_of_use(&thinned(mesh, MOST_TRIANGLES));
    let (mut low, mut high) = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    for vertex in &mesh.vertices_m {
        low = low.inf(&vertex.coords);
        high = high.sup(&vertex.coords);
    }
    let step = (high - low).map(|extent| if extent > 0.0 { extent / 65535.0 } else { 1.0 });
    let codes: Vec<u16> = mesh
        .vertices_m
        .iter()
        .flat_map(|vertex| {
            let steps = (vertex.coords - low).component_div(&step);
            [steps.x, steps.y, steps.z].map(|x| x.round().clamp(0.0, 65535.0) as u16)
        })
        .collect();
    let indices = mesh.triangles.concat();
    json!({
        "low": [low.x, low.y, low.z],
        "step": [step.x, step.y, step.z],
        "vertices": pack.points(&codes),
        "triangles": pack.indices(&indices),
    })
}

#[cfg(test)]
mod tests {
    use needlebench_geometry::Shape;

    use super::*;

    /// Farthest that a vertex of the thinned ball may lie from the true one, m: the cubes' diagonals
    /// grow until the count is met.
    const BALL_M: f64 = 0.02;

    #[test]
    fn thinning_keeps_the_budget_and_the_shape() {
        let ball = Shape::Sphere { radius_m: 0.1 }.surface(1e-5);
        assert!(ball.triangles.len() > 5000);
        let thin = thinned(&ball, 1000);
        assert!((200..=1000).contains(&thin.triangles.len()));
        for vertex in &thin.vertices_m {
            assert!((vertex.coords.norm() - 0.1).abs() < BALL_M);
        }
    }

    #[test]
    fn surfaces_come_back_within_a_step() {
        let ball = Shape::Sphere { radius_m: 0.1 }.surface(1e-3);
        let mut pack = Pack::default();
        let document = surface(&mut pack, &ball);
        let back = super::super::pack::unpack::of_payload(&pack.payload(&document));
        let codes = back.column(&document["vertices"]);
        let triangles = back.column(&document["triangles"]);
        assert_eq!(triangles.len(), 3 * ball.triangles.len());
        let step_m = document["step"][0].as_f64().unwrap();
        assert!(step_m < 4e-6);
        for corner in triangles {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "an index"
            )]
            let at = 3 * corner as usize;
            let place: Vec<f64> = (0..3)
                .map(|k| {
                    document["low"][k].as_f64().unwrap()
                        + document["step"][k].as_f64().unwrap() * codes[at + k]
                })
                .collect();
            let radius_m = Vector3::from_row_slice(&place).norm();
            // Half a step per axis.
            assert!((radius_m - 0.1).abs() < step_m);
        }
    }
}
