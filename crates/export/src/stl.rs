//! Surfaces as binary STL.

use needlebench_geometry::TriangleMesh;

/// What the 80 bytes of the head say; binary files must not begin with `solid`.
const HEAD: &[u8] = b"needlebench export, m";

/// A binary STL file: coordinates are rounded to single precision, by less than 6e-8 of their size.
pub(crate) fn stl(mesh: &TriangleMesh) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes[..HEAD.len()].copy_from_slice(HEAD);
    let count = u32::try_from(mesh.triangles.len()).expect("meshes are far below 2^32 triangles");
    bytes.extend(count.to_le_bytes());
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|index| mesh.vertices_m[index as usize]);
        let normal = (b - a).cross(&(c - a));
        let normal = normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        for point in [normal, a.coords, b.coords, c.coords] {
            for coordinate in point.iter() {
                bytes.extend(single(*coordinate).to_le_bytes());
            }
        }
        bytes.extend([0, 0]);
    }
    bytes
}

/// The nearest number of single precision; zero has no sign.
#[expect(
    clippy::cast_possible_truncation,
    reason = "rounding is what is wanted"
)]
pub(crate) fn single(value: f64) -> f32 {
    value as f32 + 0.0
}
