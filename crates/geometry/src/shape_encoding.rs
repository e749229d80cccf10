//! Bytes of shapes and solids.

use std::sync::Arc;

use crate::encoding::{Encode, Reader};
use crate::mesh::SolidMesh;
use crate::shape::{Shape, Solid};
use crate::triangle_mesh::ConvexMesh;

/// Without the pieces of a mesh, which are the engines'.
impl Encode for Shape {
    fn encode(&self, bytes: &mut Vec<u8>) {
        match self {
            Self::Sphere { radius_m } => {
                bytes.push(0);
                radius_m.encode(bytes);
            }
            Self::Cylinder {
                radius_m,
                half_length_m,
            } => {
                bytes.push(1);
                radius_m.encode(bytes);
                half_length_m.encode(bytes);
            }
            Self::Capsule {
                radius_m,
                half_length_m,
            } => {
                bytes.push(2);
                radius_m.encode(bytes);
                half_length_m.encode(bytes);
            }
            Self::Cuboid { half_extents_m } => {
                bytes.push(3);
                half_extents_m.encode(bytes);
            }
            Self::Convex(mesh) => {
                bytes.push(4);
                mesh.0.encode(bytes);
            }
            Self::Mesh(mesh) => {
                bytes.push(5);
                mesh.surface().encode(bytes);
            }
        }
    }
}

/// Without its name.
impl Encode for Solid {
    fn encode(&self, bytes: &mut Vec<u8>) {
        self.parent_from_shape.encode(bytes);
        self.shape.encode(bytes);
    }
}

impl Reader<'_> {
    /// A shape.
    pub fn shape(&mut self) -> Option<Shape> {
        Some(match self.byte()? {
            0 => Shape::Sphere {
                radius_m: self.number()?,
            },
            1 => Shape::Cylinder {
                radius_m: self.number()?,
                half_length_m: self.number()?,
            },
            2 => Shape::Capsule {
                radius_m: self.number()?,
                half_length_m: self.number()?,
            },
            3 => Shape::Cuboid {
                half_extents_m: self.vector()?,
            },
            4 => Shape::Convex(Arc::new(ConvexMesh(self.mesh()?))),
            5 => Shape::Mesh(Arc::new(SolidMesh::new(self.mesh()?))),
            _ => return None,
        })
    }

    /// A solid, which has no name.
    pub fn solid(&mut self) -> Option<Solid> {
        Some(Solid {
            name: String::new(),
            parent_from_shape: self.pose()?,
            shape: self.shape()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use needlebench_kinematics::Pose;

    use super::*;
    use crate::sample_solids::{cuboid, ell};

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
        let mut bytes = Vec::new();
        let solids = shapes.map(|shape| Solid {
            name: String::new(),
            shape,
            parent_from_shape: Pose::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(1.0, 2.0, 0.5)),
        });
        for solid in &solids {
            solid.encode(&mut bytes);
        }
        let mut reader = Reader(&bytes);
        for solid in &solids {
            assert_eq!(reader.solid().as_ref(), Some(solid));
        }
        assert!(reader.0.is_empty());
        for end in 0..bytes.len() {
            let mut cut = Reader(&bytes[..end]);
            let whole = std::iter::from_fn(|| cut.solid()).count();
            assert!(whole < solids.len());
        }
        assert!(Reader(&[9; 200]).shape().is_none());
    }
}
