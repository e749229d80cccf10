//! Bytes of shapes and meshes, which give the same bits back: little-endian numbers, counts as 64 bits.

use nalgebra::{Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use needlebench_kinematics::Pose;

use crate::triangle_mesh::TriangleMesh;

/// What is appended to bytes.
pub trait Encode {
    /// Appends it.
    fn encode(&self, bytes: &mut Vec<u8>);
}

impl Encode for f64 {
    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

impl Encode for usize {
    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend((*self as u64).to_le_bytes());
    }
}

impl Encode for u32 {
    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

impl Encode for Vector3<f64> {
    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend(self.iter().flat_map(|number| number.to_le_bytes()));
    }
}

impl Encode for TriangleMesh {
    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.reserve(16 + 24 * self.vertices_m.len() + 12 * self.triangles.len());
        self.vertices_m.len().encode(bytes);
        self.triangles.len().encode(bytes);
        for vertex in &self.vertices_m {
            vertex.coords.encode(bytes);
        }
        for index in self.triangles.iter().flatten() {
            index.encode(bytes);
        }
    }
}

impl Encode for Pose {
    fn encode(&self, bytes: &mut Vec<u8>) {
        self.translation.vector.encode(bytes);
        for number in self.rotation.coords.iter() {
            number.encode(bytes);
        }
    }
}

/// Takes from the front of bytes; `None` where they end too early, or are none of these.
pub struct Reader<'a>(pub &'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    /// One byte.
    pub fn byte(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    /// A number.
    pub fn number(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    /// An index of 32 bits.
    pub fn index(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// A count.
    pub fn count(&mut self) -> Option<usize> {
        self.take()
            .and_then(|bytes| usize::try_from(u64::from_le_bytes(bytes)).ok())
    }

    /// Three numbers.
    pub fn vector(&mut self) -> Option<Vector3<f64>> {
        Some(Vector3::new(self.number()?, self.number()?, self.number()?))
    }

    /// `count` things of at least `bytes_each`, of which there may not be as many.
    pub fn list<T>(
        &mut self,
        count: usize,
        bytes_each: usize,
        mut read: impl FnMut(&mut Self) -> Option<T>,
    ) -> Option<Vec<T>> {
        if count.checked_mul(bytes_each)? > self.0.len() {
            return None;
        }
        let mut list = Vec::with_capacity(count);
        for _ in 0..count {
            list.push(read(self)?);
        }
        Some(list)
    }

    /// A pose, with the bits of its unit quaternion.
    pub fn pose(&mut self) -> Option<Pose> {
        let translation = Translation3::from(self.vector()?);
        let [i, j, k, w] = [
            self.number()?,
            self.number()?,
            self.number()?,
            self.number()?,
        ];
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        Some(Pose::from_parts(translation, rotation))
    }

    /// A mesh.
    pub fn mesh(&mut self) -> Option<TriangleMesh> {
        let (vertices, triangles) = (self.count()?, self.count()?);
        Some(TriangleMesh {
            vertices_m: self.list(vertices, 24, |reader| reader.vector().map(Point3::from))?,
            triangles: self.list(triangles, 12, |reader| {
                Some([reader.index()?, reader.index()?, reader.index()?])
            })?,
        })
    }
}
