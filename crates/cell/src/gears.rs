//! How strain-wave gears twist under torque.

use needlebench_kinematics::Joints;

/// Twist of each joint's gear under its torque: a line through three slopes, as manufacturers of strain-wave
/// gears give it.
///
/// ```text
/// twist = tau / K1                                 |tau| <= T1
///         T1 / K1 + (|tau| - T1) / K2              T1 < |tau| <= T2
///         T1 / K1 + (T2 - T1) / K2 + (|tau| - T2) / K3
/// ```
///
/// with the sign of the torque. The default is rigid.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GearTwist {
    /// `1 / K1`, `1 / K2`, `1 / K3`, rad/(N m).
    pub compliance_rad_per_nm: [Joints; 3],
    /// `T1`, `T2`, N m.
    pub corner_nm: [Joints; 2],
}

impl GearTwist {
    /// Gears of one stiffness, by their compliance, rad/(N m).
    pub fn linear(compliance_rad_per_nm: Joints) -> Self {
        Self {
            compliance_rad_per_nm: [compliance_rad_per_nm; 3],
            corner_nm: [Joints::zeros(); 2],
        }
    }

    /// The same with each joint's compliance times a factor.
    #[must_use]
    pub fn scaled(&self, factors: &Joints) -> Self {
        Self {
            compliance_rad_per_nm: self
                .compliance_rad_per_nm
                .map(|each| each.component_mul(factors)),
            corner_nm: self.corner_nm,
        }
    }

    /// Twist under the joints' torques, rad.
    pub fn twist_rad(&self, torque_nm: &Joints) -> Joints {
        Joints::from_fn(|i, _| {
            let torque = torque_nm[i];
            self.way(i, torque.abs()).copysign(torque)
        })
    }

    /// Torque that is left of `wanted_nm` where the twist takes `stiffness_nm_per_rad` times itself away:
    /// the solution of `tau + k twist(tau) = wanted`.
    pub fn in_series(&self, stiffness_nm_per_rad: &Joints, wanted_nm: &Joints) -> Joints {
        Joints::from_fn(|i, _| {
            let (k, wanted) = (stiffness_nm_per_rad[i], wanted_nm[i].abs());
            let slopes = self.compliance_rad_per_nm.map(|each| 1.0 + k * each[i]);
            let corners = self.corner_nm.map(|each| each[i]);
            // The torque at which each slope begins, and what is wanted there.
            let second = corners[0] * slopes[0];
            let third = second + (corners[1] - corners[0]) * slopes[1];
            let torque = if wanted <= second {
                wanted / slopes[0]
            } else if wanted <= third {
                corners[0] + (wanted - second) / slopes[1]
            } else {
                corners[1] + (wanted - third) / slopes[2]
            };
            torque.copysign(wanted_nm[i])
        })
    }

    /// How much the twist grows with the torque there, rad/(N m).
    pub fn slope_rad_per_nm(&self, torque_nm: &Joints) -> Joints {
        Joints::from_fn(|i, _| {
            let beyond = self
                .corner_nm
                .iter()
                .filter(|corner| torque_nm[i].abs() > corner[i]);
            self.compliance_rad_per_nm[beyond.count()][i]
        })
    }

    /// The least compliance of each gear, rad/(N m).
    pub fn stiffest_rad_per_nm(&self) -> Joints {
        let [first, second, third] = self.compliance_rad_per_nm;
        first.inf(&second).inf(&third)
    }

    fn way(&self, joint: usize, torque_nm: f64) -> f64 {
        let [first, second] = self.corner_nm.map(|each| each[joint]);
        let [a, b, c] = self.compliance_rad_per_nm.map(|each| each[joint]);
        let shares = [
            torque_nm.min(first),
            (torque_nm.min(second) - first).max(0.0),
            (torque_nm - second).max(0.0),
        ];
        a * shares[0] + b * shares[1] + c * shares[2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of sums of a few terms.
    const ROUNDING: f64 = 1e-15;

    /// Size 17 of a manufacturer's catalogue, ratio 50.
    fn size_17() -> GearTwist {
        GearTwist {
            compliance_rad_per_nm: [0.81e4, 1.1e4, 1.3e4].map(|k: f64| Joints::repeat(k.recip())),
            corner_nm: [3.9, 12.0].map(Joints::repeat),
        }
    }

    /// The catalogue's own angles at the corners: 4.9e-4 and 12e-4 rad to its two digits (Harmonic
    /// Drive, CSF and CSG, table 42).
    #[test]
    fn twist_at_the_corners_is_the_catalogue_s() {
        let twist = |torque: f64| size_17().twist_rad(&Joints::repeat(torque))[0];
        assert!((twist(3.9) - 4.9e-4).abs() < 0.1e-4);
        assert!((twist(12.0) - 12e-4).abs() < 0.5e-4, "{}", twist(12.0));
        assert!((twist(-12.0) + twist(12.0)).abs() < ROUNDING);
    }

    #[test]
    fn torque_in_series_balances_the_twist() {
        let gears = size_17();
        for stiffness in [0.0, 2000.0, 1e5] {
            for wanted in [-80.0, -13.0, -4.0, 0.0, 1.0, 5.0, 12.0, 13.0, 50.0] {
                let (k, wanted) = (Joints::repeat(stiffness), Joints::repeat(wanted));
                let torque = gears.in_series(&k, &wanted);
                let back = torque + k.component_mul(&gears.twist_rad(&torque));
                assert!((back - wanted).amax() < 1e-13, "{stiffness} {wanted}");
            }
        }
    }

    #[test]
    fn slope_is_the_derivative_of_the_twist() {
        let gears = size_17();
        for torque in [0.5, 3.0, 5.0, 11.0, 13.0, 40.0] {
            let at = |torque: f64| gears.twist_rad(&Joints::repeat(torque))[2];
            let difference = (at(torque + 1e-3) - at(torque - 1e-3)) / 2e-3;
            let slope = gears.slope_rad_per_nm(&Joints::repeat(torque))[2];
            assert!((difference / slope - 1.0).abs() < 1e-9, "{torque}");
        }
    }
}
