//! A plane edge as a scanner shows it.

use needlebench_numerics::normal;

/// Least standard deviation of an edge, mm: no slice's profile is sharper.
const SHARPEST_MM: f64 = 0.1;

/// Standard deviations beyond which an edge is over.
const OVER: f64 = 6.0;

/// Share of what lies behind an edge, and its derivatives, per mm.
#[derive(Debug, Clone, Copy, Default)]
pub struct EdgeShare {
    /// 1 deep behind it, 0 before it.
    pub value: f64,
    /// By the depth.
    pub depth: f64,
    /// By the blur's standard deviation across the slice.
    pub blur: f64,
}

/// An edge with one normal under one blur: a Gaussian across the slice, a box along its normal.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    sigma_mm: f64,
    half_mm: f64,
    /// Of the edge's standard deviation by that across the slice.
    sigma_by_blur: f64,
}

impl Edge {
    /// `along` is the cosine between the edge's normal and the slice's.
    pub fn new(along: f64, blur_mm: f64, thickness_mm: f64) -> Self {
        let across = (1.0 - along * along).max(0.0).sqrt();
        let sigma_mm = libm::hypot(blur_mm * across, SHARPEST_MM);
        Self {
            sigma_mm,
            half_mm: 0.5 * thickness_mm * along.abs(),
            sigma_by_blur: blur_mm * across * across / sigma_mm,
        }
    }

    /// At a place so deep behind it.
    pub fn share(&self, depth_mm: f64) -> EdgeShare {
        let reach = OVER * self.sigma_mm + self.half_mm;
        if depth_mm.abs() >= reach {
            return EdgeShare {
                value: f64::from(u8::from(depth_mm > 0.0)),
                ..EdgeShare::default()
            };
        }
        let t = depth_mm / self.sigma_mm;
        let a = self.half_mm / self.sigma_mm;
        if a < 1e-3 {
            let density = density(t) / self.sigma_mm;
            return EdgeShare {
                value: normal::probability_below(t),
                depth: density,
                blur: -t * density * self.sigma_by_blur,
            };
        }
        // The integral of the normal distribution is x P(x) + p(x).
        let (high, low) = (t + a, t - a);
        let (p_high, p_low) = (
            normal::probability_below(high),
            normal::probability_below(low),
        );
        let (d_high, d_low) = (density(high), density(low));
        let scale = 0.5 / a;
        EdgeShare {
            value: scale * (high * p_high + d_high - low * p_low - d_low),
            depth: scale * (p_high - p_low) / self.sigma_mm,
            blur: scale * (d_high - d_low) / self.sigma_mm * self.sigma_by_blur,
        }
    }
}

fn density(t: f64) -> f64 {
    libm::exp(-0.5 * t * t) / std::f64::consts::TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_differences_and_the_middle_is_a_half() {
        for along in [0.0, 0.3, -0.8, 1.0] {
            let edge = Edge::new(along, 0.55, 2.5);
            assert!((edge.share(0.0).value - 0.5).abs() < 1e-12);
            for depth in [-1.1, -0.2, 0.4] {
                let h = 1e-4;
                let at = edge.share(depth);
                let slope = (edge.share(depth + h).value - edge.share(depth - h).value) / (2.0 * h);
                assert!((at.depth - slope).abs() < 1e-6, "{along} {depth}");
                let softer = Edge::new(along, 0.55 + h, 2.5).share(depth).value;
                assert!(((softer - at.value) / h - at.blur).abs() < 1e-3);
            }
        }
    }
}
