//! Whether a point is inside a closed surface.

use nalgebra::Vector3;

use super::tree::{MeshTree, Parts};

/// Distance from the box around everything that is no rounding, relative to its size.
const BOX_SLACK: f64 = 1e-9;

/// Rays that meet an edge exactly are tried again in another direction; three in a row do not.
const DIRECTIONS: usize = 8;

/// Whether the surface winds about the point. The point must not be on the surface.
///
/// Counts the crossings of a ray, outwards plus one and inwards minus one: the exact winding
/// number of a closed surface, so parts may overlap, and cavities are outside.
pub(crate) fn is_inside(tree: &MeshTree, point: &Vector3<f64>) -> bool {
    let root = tree.root();
    if (root.nearest(point) - point).norm() > BOX_SLACK * root.radius_m() {
        return false;
    }
    let away = (point - root.centre)
        .try_normalize(0.0)
        .unwrap_or_else(Vector3::z);
    let mut skew = Vector3::new(0.31, 0.17, 0.23);
    for _ in 0..DIRECTIONS {
        if let Some(winding) = crossings(tree, point, &(away + skew)) {
            return winding != 0;
        }
        skew = Vector3::new(-skew.y * 0.83, skew.z * 1.37, skew.x * 0.71);
    }
    // Every ray met an edge: not seen. Inside is the safe answer.
    true
}

fn crossings(tree: &MeshTree, point: &Vector3<f64>, direction: &Vector3<f64>) -> Option<i32> {
    let mut winding = 0;
    let mut stack = vec![0];
    while let Some(index) = stack.pop() {
        if !tree.node(index).is_met(point, direction) {
            continue;
        }
        match tree.parts(index) {
            Parts::Boxes(boxes) => stack.extend(boxes),
            Parts::Triangles(triangles) => {
                for triangle in triangles {
                    winding += crossing(&triangle.map(|corner| corner - point), direction)?;
                }
            }
        }
    }
    Some(winding)
}

/// How a ray from the origin crosses a triangle; `None` if it meets an edge.
fn crossing(&[a, b, c]: &[Vector3<f64>; 3], direction: &Vector3<f64>) -> Option<i32> {
    // The same two corners give the same number but for the sign, to the bit: a ray between two
    // triangles that share an edge crosses one of them.
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| direction.dot(&from.cross(&to)));
    let left = sides.iter().all(|&side| side > 0.0);
    let right = sides.iter().all(|&side| side < 0.0);
    if !left && !right {
        let may_touch = sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&s| s <= 0.0);
        let flat = (b - a).cross(&(c - a)) == Vector3::zeros();
        return if may_touch && !flat { None } else { Some(0) };
    }
    let normal = (b - a).cross(&(c - a));
    let ahead = normal.dot(&a) * normal.dot(direction) > 0.0;
    Some(match (ahead, left) {
        (false, _) => 0,
        (true, true) => 1,
        (true, false) => -1,
    })
}
