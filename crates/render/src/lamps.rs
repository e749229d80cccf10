//! Lights, and the shading of surfaces.

use nalgebra::Vector3;

use crate::camera::View;
use crate::color::Light;
use crate::geometry::Material;

/// Lights that move with the camera: a key light above its left shoulder, a fill light at its
/// right, and the sky.
#[derive(Debug)]
pub(crate) struct Lamps {
    /// Towards the key light, in the world.
    pub key_in_world: Vector3<f64>,
    key: Vector3<f32>,
    fill: Vector3<f32>,
    sky: Vector3<f32>,
}

impl Lamps {
    pub fn new(view: &View) -> Self {
        let world_from_eye = view.eye_from_world.transpose();
        let right: Vector3<f64> = world_from_eye.column(0).into();
        let forward: Vector3<f64> = world_from_eye.column(2).into();
        let level = Vector3::new(forward.x, forward.y, 0.0);
        // The sky is at least as strong as the sum of the others, so the length is never zero.
        let key_in_world = (Vector3::z() * 1.1 - right * 0.4 - level * 0.5)
            .try_normalize(f64::MIN_POSITIVE)
            .unwrap_or_else(Vector3::z);
        let unit = |vector: Vector3<f64>| {
            let turned = view.eye_from_world * vector;
            turned
                .try_normalize(f64::MIN_POSITIVE)
                .unwrap_or_else(Vector3::z)
                .cast::<f32>()
        };
        Self {
            key_in_world,
            key: unit(key_in_world),
            fill: unit(right * 0.8 - forward * 0.6 + Vector3::z() * 0.1),
            sky: unit(Vector3::z()),
        }
    }

    /// Light and opacity of a material whose surface has the normal, seen from `towards_eye`.
    pub fn shade(
        &self,
        material: &Material,
        normal: Vector3<f32>,
        towards_eye: Vector3<f32>,
    ) -> (Light, f32) {
        if !material.shaded {
            return (material.light, material.opacity);
        }
        let towards_eye = unit(towards_eye).unwrap_or_else(|| -Vector3::z());
        let normal = unit(normal).unwrap_or(towards_eye);
        let facing = normal.dot(&towards_eye);
        let normal = if facing < 0.0 { -normal } else { normal };
        let grazing = (1.0 - facing.abs()).max(0.0);

        let on_key = normal.dot(&self.key);
        let diffuse = 0.30
            + 0.10 * normal.dot(&self.sky)
            + 0.58 * on_key.max(0.0)
            + 0.20 * normal.dot(&self.fill).max(0.0);
        let rim = 1.0 - 0.45 * grazing * grazing * grazing;
        // Phong's highlight: the mirrored ray against the key light.
        let mirrored = 2.0 * on_key * facing.abs() - self.key.dot(&towards_eye);
        let gloss = 0.12 * mirrored.max(0.0).powi(16);
        let light = material.light * (diffuse * rim) + Light::repeat(gloss);

        if material.is_opaque() {
            return (light, 1.0);
        }
        // A thin skin hides more where it is seen at a grazing angle; this is what shows its form.
        let edge = grazing * grazing * grazing;
        (
            light,
            material.opacity + (1.0 - material.opacity) * 0.55 * edge,
        )
    }
}

/// The direction of a vector, if it has one.
fn unit(vector: Vector3<f32>) -> Option<Vector3<f32>> {
    let squared = vector.norm_squared();
    (squared > 1e-12).then(|| vector * (1.0 / squared.sqrt()))
}
