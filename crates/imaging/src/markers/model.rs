//! What a marker on skin looks like in a scan: densities and their derivatives by everything that is unknown.
//!
//! Millimetres and thousands of HU, in axes of the slice: its rows' direction, across it, its normal.

use nalgebra::{SVector, Vector3};

use super::MarkerModel;
use super::edge::Edge;
use super::sphere::BlurredSphere;

/// Unknowns.
pub(crate) const UNKNOWNS: usize = 15;

/// One value per unknown.
pub type Unknowns = SVector<f64, UNKNOWNS>;

/// Place of an unknown in [`Unknowns`]. The marker's centre is the first three.
pub mod unknown {
    /// Height of the centre over the skin, mm.
    pub(crate) const HEIGHT: usize = 3;
    /// Tilt of the skin's normal along two directions of the skin.
    pub(crate) const TILT: usize = 4;
    /// Curvature of the skin: along the first direction, mixed, along the second, 1/mm.
    pub(crate) const CURVATURE: usize = 6;
    /// Tissue under the skin.
    pub(crate) const TISSUE: usize = 9;
    /// What is dense in the marker.
    pub(crate) const DENSE: usize = 10;
    /// Two layers of the holder.
    pub(crate) const LAYER: usize = 11;
    /// Radius over that of the model, mm.
    pub(crate) const RADIUS: usize = 13;
    /// Standard deviation of the blur over the assumed one, mm.
    pub(crate) const BLUR: usize = 14;
}

/// Air, thousands of HU.
pub(crate) const AIR: f64 = -1.0;

/// Everything about a marker in a scan that is the same for all of them.
#[derive(Debug)]
pub struct Appearance<'a> {
    /// The marker.
    pub marker: &'a MarkerModel,
    /// A ball of the dense part under the assumed blur.
    pub sphere: &'a BlurredSphere,
    /// Assumed standard deviation of the blur across the slice, mm.
    pub blur_mm: f64,
    /// Thickness of a slice, mm.
    pub thickness_mm: f64,
}

/// A marker with values for all its unknowns.
pub struct Posed<'a> {
    of: &'a Appearance<'a>,
    values: &'a Unknowns,
    normal: Vector3<f64>,
    along: [Vector3<f64>; 2],
    edge: Edge,
    /// Of a layer's side, as if it stood across the slice.
    rim: Edge,
    /// Centres of the balls that the dense part is made of, mm, and what the tilts move them by.
    balls: Vec<Ball>,
}

struct Ball {
    at: Vector3<f64>,
    by_tilt: [Vector3<f64>; 2],
}

impl<'a> Posed<'a> {
    /// `outward` is the normal at zero tilt.
    pub fn new(of: &'a Appearance<'a>, outward: &Vector3<f64>, values: &'a Unknowns) -> Self {
        let [t1, t2] = tangents(outward);
        let tilted = outward + t1 * values[unknown::TILT] + t2 * values[unknown::TILT + 1];
        let normal = tilted / tilted.norm();
        // The directions of the skin turn with its normal.
        let along = [t1, t2].map(|t| (t - normal * t.dot(&normal)).normalize());
        let center = values.fixed_rows::<3>(0).into_owned();
        let balls = of
            .marker
            .balls_mm()
            .into_iter()
            .map(|[u, v]| Ball {
                at: center + along[0] * u + along[1] * v,
                by_tilt: [-normal * u, -normal * v],
            })
            .collect();
        let blur_mm = (of.blur_mm + values[unknown::BLUR]).max(0.1);
        Self {
            of,
            values,
            normal,
            along,
            edge: Edge::new(normal.z, blur_mm, of.thickness_mm),
            rim: Edge::new(0.0, blur_mm, of.thickness_mm),
            balls,
        }
    }

    /// Density at a place, thousands of HU; fills in its derivatives.
    pub fn density(&self, place: &Vector3<f64>, by: &mut Unknowns) -> f64 {
        by.fill(0.0);
        let offset = place - self.values.fixed_rows::<3>(0);
        let outwards = self.normal.dot(&offset);
        let (u, v) = (self.along[0].dot(&offset), self.along[1].dot(&offset));
        AIR + self.tissue(outwards, u, v, by)
            + self.layers(outwards, u, v, by)
            + self.dense(place, by)
    }

    fn tissue(&self, outwards: f64, u: f64, v: f64, by: &mut Unknowns) -> f64 {
        let bend = self.values.fixed_rows::<3>(unknown::CURVATURE);
        let sag = 0.5 * (bend[0] * u * u + 2.0 * bend[1] * u * v + bend[2] * v * v);
        let depth = -outwards - self.values[unknown::HEIGHT] - sag;
        let contrast = self.values[unknown::TISSUE] - AIR;
        let share = self.edge.share(depth);
        let slope = contrast * share.depth;
        let sag_by = [bend[0] * u + bend[1] * v, bend[1] * u + bend[2] * v];
        self.shift(slope, sag_by, [u, v, outwards], by);
        by[unknown::HEIGHT] -= slope;
        by[unknown::CURVATURE] -= slope * 0.5 * u * u;
        by[unknown::CURVATURE + 1] -= slope * u * v;
        by[unknown::CURVATURE + 2] -= slope * 0.5 * v * v;
        by[unknown::TISSUE] += share.value;
        by[unknown::BLUR] += contrast * share.blur;
        contrast * share.value
    }

    /// Derivatives of something that gets denser by `slope` per mm inwards, by the centre and the tilts.
    fn shift(&self, slope: f64, sag_by: [f64; 2], [u, v, outwards]: [f64; 3], by: &mut Unknowns) {
        let inwards = self.normal + self.along[0] * sag_by[0] + self.along[1] * sag_by[1];
        for axis in 0..3 {
            by[axis] += slope * inwards[axis];
        }
        by[unknown::TILT] -= slope * (u - sag_by[0] * outwards);
        by[unknown::TILT + 1] -= slope * (v - sag_by[1] * outwards);
    }

    fn layers(&self, outwards: f64, u: f64, v: f64, by: &mut Unknowns) -> f64 {
        let mut sum = 0.0;
        for (index, layer) in self.of.marker.layers.iter().enumerate() {
            let across = libm::hypot(u, v).max(1e-6);
            let rim = self.rim.share(layer.radius_m * 1e3 - across);
            if rim.value <= 0.0 {
                continue;
            }
            let below = self.edge.share(outwards - layer.bottom_m * 1e3);
            let above = self.edge.share(outwards - layer.top_m * 1e3);
            let contrast = self.values[unknown::LAYER + index] - AIR;
            let inside = below.value - above.value;
            let value = rim.value * inside;
            let slope = -contrast * rim.value * (below.depth - above.depth);
            self.shift(slope, [0.0; 2], [u, v, outwards], by);
            let outer = contrast * rim.depth * inside / across;
            let moved = (self.along[0] * u + self.along[1] * v) * outer;
            for axis in 0..3 {
                by[axis] += moved[axis];
            }
            by[unknown::TILT] += outer * u * outwards;
            by[unknown::TILT + 1] += outer * v * outwards;
            by[unknown::LAYER + index] += value;
            by[unknown::BLUR] +=
                contrast * (rim.value * (below.blur - above.blur) + rim.blur * inside);
            sum += contrast * value;
        }
        sum
    }

    fn dense(&self, place: &Vector3<f64>, by: &mut Unknowns) -> f64 {
        let within = self
            .of
            .marker
            .layer_around()
            .map(|layer| unknown::LAYER + layer);
        let contrast = self.values[unknown::DENSE] - within.map_or(AIR, |layer| self.values[layer]);
        let widened = self.values[unknown::RADIUS];
        let softened = self.values[unknown::BLUR];
        let weight = self.of.marker.ball_weight();
        let mut sum = 0.0;
        for ball in &self.balls {
            let offset = place - ball.at;
            let across = libm::hypot(offset.x, offset.y);
            let share = self.of.sphere.share(across, offset.z);
            if share.value == 0.0 && share.blur == 0.0 {
                continue;
            }
            sum += weight * (share.value + widened * share.radius + softened * share.blur);
            let slope = contrast * weight;
            let towards = if across > 0.0 {
                share.across / across
            } else {
                0.0
            };
            let gradient =
                Vector3::new(towards * offset.x, towards * offset.y, share.along) * -slope;
            for axis in 0..3 {
                by[axis] += gradient[axis];
            }
            by[unknown::TILT] += gradient.dot(&ball.by_tilt[0]);
            by[unknown::TILT + 1] += gradient.dot(&ball.by_tilt[1]);
            by[unknown::RADIUS] += slope * share.radius;
            by[unknown::BLUR] += slope * share.blur;
        }
        by[unknown::DENSE] += sum;
        if let Some(layer) = within {
            by[layer] -= sum;
        }
        contrast * sum
    }

    /// The skin's outward normal.
    pub fn normal(&self) -> Vector3<f64> {
        self.normal
    }
}

/// Two directions across a unit vector.
fn tangents(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let least = normal.iamin();
    let first = normal.cross(&Vector3::ith(least, 1.0)).normalize();
    [first, normal.cross(&first)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_differences() {
        for marker in [
            MarkerModel::phantom_sphere(8e-3),
            MarkerModel::ring_disc(16e-3, 2e-3, 2e-3),
        ] {
            let sphere = BlurredSphere::new(marker.ball_radius_m() * 1e3, 0.55, 2.5);
            let of = Appearance {
                marker: &marker,
                sphere: &sphere,
                blur_mm: 0.55,
                thickness_mm: 2.5,
            };
            let outward = Vector3::new(0.3, -0.8, 0.4).normalize();
            let mut values = Unknowns::zeros();
            values[unknown::HEIGHT] = marker.height_m * 1e3;
            values[unknown::TILT] = 0.02;
            values[unknown::CURVATURE] = 0.008;
            values[unknown::CURVATURE + 2] = 0.004;
            values[unknown::TISSUE] = 0.04;
            values[unknown::DENSE] = 1.2;
            values[unknown::LAYER] = -0.9;
            values[unknown::LAYER + 1] = 0.1;
            let (mut by, mut unused) = (Unknowns::zeros(), Unknowns::zeros());
            let mut largest = [0.0_f64; UNKNOWNS];
            let mut worst = [0.0_f64; UNKNOWNS];
            for place in [
                [0.4, 1.0, 2.9],
                [3.1, -2.2, 0.7],
                [-1.0, 2.9, -3.0],
                [0.6, -4.3, 1.5],
                [-2.0, 7.0, 3.0],
            ] {
                let place = Vector3::from(place);
                Posed::new(&of, &outward, &values).density(&place, &mut by);
                for k in 0..UNKNOWNS {
                    let h = if k < 3 { 0.05 } else { 0.01 };
                    let (mut more, mut less) = (values, values);
                    more[k] += h;
                    less[k] -= h;
                    let slope = (Posed::new(&of, &outward, &more).density(&place, &mut unused)
                        - Posed::new(&of, &outward, &less).density(&place, &mut unused))
                        / (2.0 * h);
                    largest[k] = largest[k].max(slope.abs());
                    worst[k] = worst[k].max((slope - by[k]).abs());
                }
            }
            for k in 0..UNKNOWNS {
                // A tilt also changes an edge's blur along the slices, which is left out: it moves nothing.
                let is_tilt = k == unknown::TILT || k == unknown::TILT + 1;
                let share = if is_tilt { 0.25 } else { 0.1 };
                assert!(
                    worst[k] < share * largest[k] + 1e-3,
                    "{k}: {} of {}",
                    worst[k],
                    largest[k]
                );
            }
        }
    }
}
