//! The arms that Universal Robots sells, as data.

use std::fmt;
use std::str::FromStr;

use crate::UrGeometry;

/// A UR arm whose nominal lengths are known.
///
/// Lengths: Universal Robots, *DH parameters for calculations of kinematics and dynamics*; the same
/// as the origins in `default_kinematics.yaml` of ROS's `ur_description`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum UrModel {
    /// UR3, CB series.
    Ur3,
    /// UR3e.
    Ur3e,
    /// UR5, CB series (third version of the arm).
    Ur5,
    /// UR5e.
    Ur5e,
    /// UR10, CB series.
    Ur10,
    /// UR10e.
    Ur10e,
    /// UR16e.
    Ur16e,
    /// UR20.
    Ur20,
    /// UR30.
    Ur30,
}

impl UrModel {
    /// All of them, small arms first.
    pub const ALL: [Self; 9] = [
        Self::Ur3,
        Self::Ur3e,
        Self::Ur5,
        Self::Ur5e,
        Self::Ur10,
        Self::Ur10e,
        Self::Ur16e,
        Self::Ur20,
        Self::Ur30,
    ];

    /// The manufacturer's name of the model: `UR3e`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ur3 => "UR3",
            Self::Ur3e => "UR3e",
            Self::Ur5 => "UR5",
            Self::Ur5e => "UR5e",
            Self::Ur10 => "UR10",
            Self::Ur10e => "UR10e",
            Self::Ur16e => "UR16e",
            Self::Ur20 => "UR20",
            Self::Ur30 => "UR30",
        }
    }

    /// Nominal lengths.
    pub const fn geometry(self) -> UrGeometry {
        let [d1, a2, a3, d4, d5, d6] = match self {
            Self::Ur3 => return UrGeometry::UR3,
            Self::Ur3e => [0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921],
            Self::Ur5 => [0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823],
            Self::Ur5e => [0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996],
            Self::Ur10 => [0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922],
            Self::Ur10e => [0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655],
            Self::Ur16e => [0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655],
            Self::Ur20 => [0.2363, -0.862, -0.7287, 0.201, 0.1593, 0.1543],
            Self::Ur30 => [0.2363, -0.637, -0.5037, 0.201, 0.1593, 0.1543],
        };
        UrGeometry {
            d1,
            a2,
            a3,
            d4,
            d5,
            d6,
        }
    }

    /// The arm whose lengths are most like these, and the largest difference of any length, m.
    ///
    /// A factory calibration moves a length by up to about 1 mm; the two arms most like each other,
    /// UR3 and UR3e, are 18.7 mm apart. A difference between says that it is none of these arms.
    pub fn nearest(geometry: &UrGeometry) -> (Self, f64) {
        let deviation_m = |model: Self| geometry.largest_difference_m(&model.geometry());
        Self::ALL
            .map(|model| (model, deviation_m(model)))
            .into_iter()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("there are nine")
    }
}

impl UrGeometry {
    /// Largest difference of any length, m; NaN if one is.
    pub fn largest_difference_m(&self, other: &Self) -> f64 {
        [
            self.d1 - other.d1,
            self.a2 - other.a2,
            self.a3 - other.a3,
            self.d4 - other.d4,
            self.d5 - other.d5,
            self.d6 - other.d6,
        ]
        .map(f64::abs)
        .into_iter()
        // Its order puts NaN last, where `f64::max` would drop it.
        .max_by(f64::total_cmp)
        .expect("there are six")
    }
}

impl fmt::Display for UrModel {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name())
    }
}

/// A name that is none of [`UrModel::ALL`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown arm `{name}`; known: {}", UrModel::ALL.map(UrModel::name).join(", "))]
pub struct UnknownUrModel {
    /// The name as given.
    pub name: String,
}

impl FromStr for UrModel {
    type Err = UnknownUrModel;

    /// Reads `UR3e` in any case, with or without a space, hyphen or underscore.
    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let plain: String = name
            .chars()
            .filter(|each| !matches!(each, ' ' | '-' | '_'))
            .collect();
        Self::ALL
            .into_iter()
            .find(|model| model.name().eq_ignore_ascii_case(&plain))
            .ok_or_else(|| UnknownUrModel {
                name: name.to_owned(),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Joints;

    /// Rounding of sums of lengths below 2 m.
    const LENGTH_M: f64 = 1e-15;

    #[test]
    fn every_arm_is_its_own_nearest_and_no_other_is_within_18_mm() {
        for model in UrModel::ALL {
            assert_eq!(UrModel::nearest(&model.geometry()), (model, 0.0));
            for other in UrModel::ALL {
                let apart_m = model.geometry().largest_difference_m(&other.geometry());
                assert!(model == other || apart_m > 0.018, "{model} {other}");
            }
        }
    }

    #[test]
    fn a_slightly_different_arm_is_still_the_same_model_and_says_by_how_much() {
        let mut geometry = UrModel::Ur5e.geometry();
        geometry.a3 += 7e-4;
        geometry.d6 -= 3e-4;
        let (model, deviation_m) = UrModel::nearest(&geometry);
        assert_eq!(model, UrModel::Ur5e);
        assert!((deviation_m - 7e-4).abs() < LENGTH_M);
    }

    #[test]
    fn lengths_that_are_no_numbers_are_near_to_nothing() {
        let mut geometry = UrModel::Ur3.geometry();
        geometry.a2 = f64::NAN;
        assert!(UrModel::nearest(&geometry).1.is_nan());
    }

    #[test]
    fn names_are_read_in_any_case_and_spelling() {
        for model in UrModel::ALL {
            assert_eq!(model.name().parse(), Ok(model));
            assert_eq!(model.name().to_lowercase().parse(), Ok(model));
        }
        assert_eq!("ur-16 E".parse(), Ok(UrModel::Ur16e));
        let error = "UR4".parse::<UrModel>().unwrap_err();
        assert!(error.to_string().contains("`UR4`"));
        assert!(error.to_string().contains("UR3, UR3e, UR5"));
    }

    #[test]
    fn stretched_arms_reach_what_the_maker_says() {
        // Origins of `ur_description`: forearm and wrist 1 along -x, wrists 1 and 3 along -y.
        for (model, reach_m, aside_m) in [
            (UrModel::Ur3, 0.4569, 0.19425),
            (UrModel::Ur5, 0.81725, 0.19145),
            (UrModel::Ur5e, 0.8172, 0.2329),
            (UrModel::Ur10, 1.1843, 0.256141),
            (UrModel::Ur16e, 0.8384, 0.2907),
            (UrModel::Ur20, 1.5907, 0.3553),
            (UrModel::Ur30, 1.1407, 0.3553),
        ] {
            let flange = model
                .geometry()
                .chain()
                .base_link_from_flange(&Joints::zeros());
            assert!(
                (flange.translation.vector.x - reach_m).abs() < LENGTH_M,
                "{model}"
            );
            assert!(
                (flange.translation.vector.y - aside_m).abs() < LENGTH_M,
                "{model}"
            );
        }
    }
}
