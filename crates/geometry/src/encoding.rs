//! Values as bytes, which give the same bits back: those of `postcard`, all of them.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// The bytes of a value.
///
/// # Panics
/// For a value that `serde` cannot write, such as a sequence of unknown length: none of ours.
pub fn encode(value: &impl Serialize) -> Vec<u8> {
    postcard::to_allocvec(value).expect("memory takes all")
}

/// The value of bytes; `None` where they end too early, go on behind it, or are none of these.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes(bytes).ok()?;
    rest.is_empty().then_some(value)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Vector3;
    use needlebench_kinematics::Pose;

    use super::*;
    use crate::mesh::SolidMesh;
    use crate::sample_solids::{cuboid, ell};
    use crate::shape::{Shape, Solid};
    use crate::triangle_mesh::{ConvexMesh, TriangleMesh};

    #[test]
    fn every_shape_comes_back_bit_for_bit() {
        let shapes = [
            Shape::Sphere { radius_m: 0.1 },
            Shape::Cylinder {
                radius_m: 0.1,
                half_length_m: 0.3,
            },
            Shape::Capsule {
                radius_m: 0.2,
                half_length_m: 1.0 / 3.0,
            },
            Shape::Cuboid {
                half_extents_m: Vector3::new(0.1, 0.2, 0.7),
            },
            Shape::Convex(Arc::new(ConvexMesh(cuboid([0.1, 0.2, 0.3])))),
            Shape::Mesh(Arc::new(SolidMesh::new(ell()))),
        ];
        let solids: Vec<Solid> = shapes
            .into_iter()
            .map(|shape| Solid {
                name: String::new(),
                shape,
                parent_from_shape: Pose::new(
                    Vector3::new(0.1, 0.2, 0.3),
                    Vector3::new(1.0, 2.0, 0.5),
                ),
            })
            .collect();
        let bytes = encode(&solids);
        assert_eq!(decode(&bytes), Some(solids));
        for end in 0..bytes.len() {
            assert_eq!(decode::<Vec<Solid>>(&bytes[..end]), None);
        }
        assert_eq!(decode::<Vec<Solid>>(&[&bytes[..], &[0]].concat()), None);
        assert_eq!(decode::<Shape>(&[9; 200]), None);
    }

    #[test]
    fn a_length_beyond_the_bytes_takes_no_memory() {
        assert_eq!(
            decode::<TriangleMesh>(&[255, 255, 255, 255, 255, 255, 255, 127]),
            None
        );
    }
}
