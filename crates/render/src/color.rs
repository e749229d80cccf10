//! Colours: stored as sRGB, lit and mixed in proportion to light.

use nalgebra::Vector3;

/// Red, green and blue in proportion to light, 0 to 1.
pub(crate) type Light = Vector3<f32>;

/// Steps of the way from light to sRGB: a step is below half a level even in the dark.
const ENCODER_STEPS: u16 = 8192;

/// The light of an sRGB value, 0 to 1 (IEC 61966-2-1).
fn decoded(value: f32) -> f32 {
    let value = value.clamp(0.0, 1.0);
    if value <= 0.04045 {
        value / 12.92
    } else {
        libm::powf((value + 0.055) / 1.055, 2.4)
    }
}

/// The light of an sRGB colour, 0 to 1.
pub(crate) fn light([red, green, blue]: [f32; 3]) -> Light {
    Light::new(decoded(red), decoded(green), decoded(blue))
}

/// From light to sRGB bytes, by table.
#[derive(Debug)]
pub(crate) struct Encoder {
    bytes: Vec<u8>,
}

impl Encoder {
    pub fn new() -> Self {
        let encoded = |step: u16| {
            let light = f32::from(step) / f32::from(ENCODER_STEPS - 1);
            let value = if light <= 0.0031308 {
                light * 12.92
            } else {
                1.055 * libm::powf(light, 1.0 / 2.4) - 0.055
            };
            byte(value * 255.0)
        };
        Self {
            bytes: (0..ENCODER_STEPS).map(encoded).collect(),
        }
    }

    /// Values outside 0 to 1 are clamped.
    pub fn encode(&self, light: &Light) -> [u8; 3] {
        [light.x, light.y, light.z].map(|value| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped; NaN becomes zero"
            )]
            let step = (value.clamp(0.0, 1.0) * f32::from(ENCODER_STEPS - 1) + 0.5) as usize;
            self.bytes[step]
        })
    }
}

fn byte(value: f32) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "rounding into 0 to 255 is what is wanted"
    )]
    let byte = value.round().clamp(0.0, 255.0) as u8;
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_the_way_to_light_and_back() {
        let encoder = Encoder::new();
        for value in 0..=u8::MAX {
            let encoded = encoder.encode(&light([f32::from(value) / 255.0; 3]));
            assert_eq!(encoded, [value; 3]);
        }
    }

    #[test]
    fn senseless_light_is_clamped() {
        let encoder = Encoder::new();
        let senseless = Light::new(-1.0, 2.0, f32::NAN);
        assert_eq!(encoder.encode(&senseless), [0, 255, 0]);
    }
}
