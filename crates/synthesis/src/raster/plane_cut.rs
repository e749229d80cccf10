//! How much of a box is on one side of a plane.

use nalgebra::Vector3;

/// Points `p` with `normal . p <= offset_m` are inside; `normal` is of unit length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plane {
    pub normal: Vector3<f64>,
    pub offset_m: f64,
}

impl Plane {
    /// Height above the plane, m; negative inside.
    #[inline]
    pub fn height_m(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.offset_m
    }

    /// Half of the extent across the plane of a box with these half edges, m.
    #[inline]
    pub fn reach_m(&self, half: &Vector3<f64>) -> f64 {
        reach_m(&self.normal, half)
    }
}

/// Half of the extent along a direction of a box with these half edges, m.
#[inline]
pub(crate) fn reach_m(direction: &Vector3<f64>, half: &Vector3<f64>) -> f64 {
    direction.x.abs() * half.x + direction.y.abs() * half.y + direction.z.abs() * half.z
}

/// Share of a box that lies below a plane: the box has these half edges, and its centre is `height_m` above the plane.
///
/// The closed form of volume-of-fluid methods (Scardovelli and Zaleski, J Comput Phys 164:228, 2000); exact.
#[inline]
pub(crate) fn share_below(normal: &Vector3<f64>, half: &Vector3<f64>, height_m: f64) -> f64 {
    /// Shares of the reach below this count as this: their cubes would be lost in rounding. 1e-7 of a cell.
    const LEAST: f64 = 1e-7;
    let extent = [
        normal.x.abs() * half.x,
        normal.y.abs() * half.y,
        normal.z.abs() * half.z,
    ];
    let reach = extent[0] + extent[1] + extent[2];
    if height_m >= reach {
        return 0.0;
    }
    if height_m <= -reach {
        return 1.0;
    }
    // The plane's distance from the lowest corner, of the largest one.
    let depth = 0.5 * (1.0 - height_m / reach);
    let below_middle = depth.min(1.0 - depth);
    let [a, b, c] = extent.map(|each| (each / reach).max(LEAST));
    let (least, greatest) = (a.min(b).min(c), a.max(b).max(c));
    let middle = (1.0 - least - greatest).max(least);
    let volume = below(least, middle, greatest, below_middle);
    if depth <= 0.5 { volume } else { 1.0 - volume }
}

/// Volume of the unit cube where `m1 x + m2 y + m3 z <= alpha`, for `m1 <= m2 <= m3` of sum 1 and `alpha <= 1/2`.
#[inline]
fn below(m1: f64, m2: f64, m3: f64, alpha: f64) -> f64 {
    let m12 = m1 + m2;
    if alpha < m1 {
        return alpha * alpha * alpha / (6.0 * m1 * m2 * m3);
    }
    if alpha < m2 {
        return alpha * (alpha - m1) / (2.0 * m2 * m3) + m1 * m1 / (6.0 * m2 * m3);
    }
    if alpha >= m12 && m12 <= m3 {
        return (alpha - 0.5 * m12) / m3;
    }
    let cube = |value: f64| value * value * value;
    let beyond = cube(alpha) - cube(alpha - m1) - cube(alpha - m2) - cube((alpha - m3).max(0.0));
    beyond / (6.0 * m1 * m2 * m3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points along each edge of the box that are counted.
    const COUNTED: i32 = 60;
    /// Of a count on 60^3 points: half of a layer, for a plane along a face.
    const OF_COUNT: f64 = 0.5 / 60.0 + 1e-9;

    #[test]
    fn the_share_is_that_of_points_counted() {
        let half = Vector3::new(0.5, 0.3, 0.8);
        for normal in [
            Vector3::x(),
            Vector3::new(0.0, 3.0, 4.0) / 5.0,
            Vector3::new(1e-9, 0.6, 0.8),
            Vector3::new(2.0, -3.0, 6.0) / 7.0,
            Vector3::new(-6.0, 2.0, 3.0) / 7.0,
        ] {
            for height in [-0.9, -0.5, -0.26, -0.1, 0.0, 0.02, 0.3, 0.7, 1.0] {
                let at = |k: i32, half: f64| {
                    half * (2.0 * (f64::from(k) + 0.5) / f64::from(COUNTED) - 1.0)
                };
                let mut inside = 0;
                for i in 0..COUNTED {
                    for j in 0..COUNTED {
                        for k in 0..COUNTED {
                            let point = Vector3::new(at(i, half.x), at(j, half.y), at(k, half.z));
                            inside += i32::from(normal.dot(&point) + height <= 0.0);
                        }
                    }
                }
                let counted = f64::from(inside) / f64::from(COUNTED).powi(3);
                let share = share_below(&normal, &half, height);
                assert!(
                    (share - counted).abs() <= OF_COUNT,
                    "{normal} {height}: {share} {counted}"
                );
            }
        }
    }
}
