//! Points, vectors and matrices as plain rows of numbers in JSON.

/// A module for `#[serde(with = "..")]` that writes a value as arrays.
macro_rules! as_arrays {
    ($(#[$doc:meta])* $name:ident, $value:ty, $arrays:ty, $write:expr, $read:expr) => {
        $(#[$doc])*
        pub mod $name {
            use serde::{Deserialize, Deserializer, Serialize, Serializer};

            /// Writes it.
            pub fn serialize<S: Serializer>(value: &$value, to: S) -> Result<S::Ok, S::Error> {
                let write: fn(&$value) -> $arrays = $write;
                write(value).serialize(to)
            }

            /// Reads it.
            pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<$value, D::Error> {
                let read: fn($arrays) -> $value = $read;
                Ok(read(<$arrays>::deserialize(from)?))
            }
        }
    };
}

as_arrays!(
    /// x, y, z.
    point,
    nalgebra::Point3<f64>,
    [f64; 3],
    |value| value.coords.into(),
    nalgebra::Point3::from
);

as_arrays!(
    /// x, y, z.
    vector,
    nalgebra::Vector3<f64>,
    [f64; 3],
    |value| (*value).into(),
    nalgebra::Vector3::from
);

as_arrays!(
    /// Rows; only for symmetric matrices.
    symmetric3,
    nalgebra::Matrix3<f64>,
    [[f64; 3]; 3],
    |value| (*value).into(),
    nalgebra::Matrix3::from
);

as_arrays!(
    /// Rows; only for symmetric matrices.
    symmetric6,
    nalgebra::Matrix6<f64>,
    [[f64; 6]; 6],
    |value| (*value).into(),
    nalgebra::Matrix6::from
);

/// A rigid transform: `translation_m` and `rotation_quat_wxyz`.
pub mod pose {
    use nalgebra::{Quaternion, Translation3, UnitQuaternion};
    use needlebench_kinematics::Pose;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Plain {
        translation_m: [f64; 3],
        rotation_quat_wxyz: [f64; 4],
    }

    /// Writes it.
    pub fn serialize<S: Serializer>(pose: &Pose, to: S) -> Result<S::Ok, S::Error> {
        let q = pose.rotation;
        Plain {
            translation_m: pose.translation.vector.into(),
            rotation_quat_wxyz: [q.w, q.i, q.j, q.k],
        }
        .serialize(to)
    }

    /// Reads it; a quaternion that is off unit length by more than rounding is refused.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Pose, D::Error> {
        let plain = Plain::deserialize(from)?;
        let [w, i, j, k] = plain.rotation_quat_wxyz;
        let q = Quaternion::new(w, i, j, k);
        let off = (q.norm() - 1.0).abs();
        if off.is_nan() || off >= 1e-6 {
            return Err(D::Error::custom(format!(
                "rotation_quat_wxyz has length {}, not 1",
                q.norm()
            )));
        }
        Ok(Pose::from_parts(
            Translation3::from(plain.translation_m),
            UnitQuaternion::from_quaternion(q),
        ))
    }
}
