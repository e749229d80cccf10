//! What the best member of a family is best at.

use nalgebra::Point3;
use needlebench_cell::scenario::RollAim;
use needlebench_cell::{ClearanceClass, Goal};
use needlebench_clearance::Share;

use super::Member;
use crate::planner::{Candidate, Planner};

/// What a roll is chosen for.
pub type Aim = RollAim;

/// Length over which clearances count less and less for [`Aim::Clearance`], m.
const CLEARANCE_SCALE_M: f64 = 0.02;

/// How the clearance of a class counts in [`Planner::value`], which reads no more of it than the least of
/// each group (`a_sweep_sees_what_each_member_is_alone`).
pub(crate) fn share_in(aim: Aim, class: ClearanceClass) -> Option<Share> {
    let group = match aim {
        Aim::Clearance => match class {
            ClearanceClass::GuideStandoff | ClearanceClass::NeedleRoute => return None,
            _ => class as usize,
        },
        Aim::Balanced => match class {
            ClearanceClass::SelfCollision => 1,
            ClearanceClass::NeedleCorridor => 2,
            _ if class.is_surroundings() => 0,
            _ => return None,
        },
        Aim::JointMargin | Aim::Singularity | Aim::TipAccuracy => return None,
    };
    let offset_m = 0.0;
    Some(Share { group, offset_m })
}

impl Planner<'_> {
    /// How good a posture is at an aim; more is better. Of postures that work or do not work alike:
    /// it does not look at rules.
    pub fn value(&self, goal: &Goal, aim: Aim, candidate: &Candidate) -> f64 {
        let margins = &candidate.margins;
        match aim {
            Aim::Clearance => soft_least_m(candidate),
            Aim::JointMargin => margins.joint_limit,
            Aim::Singularity => singularity_margin(candidate),
            Aim::TipAccuracy => -self.tip_sensitivity(goal, candidate),
            Aim::Balanced => self.balanced(goal, candidate),
        }
    }

    /// Root of the sum of the squared speeds of the needle's tip under each joint alone, m/rad.
    ///
    /// With independent errors of standard deviation `s` in every joint the tip's root-mean-square
    /// displacement is `s` times this, to first order.
    pub fn tip_sensitivity(&self, goal: &Goal, candidate: &Candidate) -> f64 {
        let tool = &self.cell().tool;
        let tip_in_flange =
            tool.flange_from_guide_exit * Point3::new(0.0, 0.0, goal.insertion_length_m);
        self.kinematics()
            .chain
            .jacobian_at(&candidate.joints, &tip_in_flange.coords)
            .fixed_rows::<3>(0)
            .norm()
    }

    /// Weighted mean of the scenario's utilities of what a posture alone decides.
    fn balanced(&self, goal: &Goal, candidate: &Candidate) -> f64 {
        const MM: f64 = 1e3;
        let margins = &candidate.margins;
        let least = |wanted: fn(ClearanceClass) -> bool| {
            candidate
                .clearance
                .iter()
                .filter(|pair| wanted(pair.class))
                .map(|pair| pair.separation.distance_m)
                .fold(f64::INFINITY, f64::min)
        };
        let (mut sum, mut weights) = (0.0, 0.0);
        for (key, aim) in self.ranking_aims() {
            let value = match *key {
                "clearance_mm" => MM * least(ClearanceClass::is_surroundings),
                "self_clearance_mm" => MM * least(|class| class == ClearanceClass::SelfCollision),
                "needle_corridor_mm" => MM * least(|class| class == ClearanceClass::NeedleCorridor),
                // The same number in m/rad and in mm/mrad.
                "tip_sensitivity_mm_mrad" => self.tip_sensitivity(goal, candidate),
                "joint_margin" => margins.joint_limit,
                "singularity_margin" => margins.wrist_sine.min(margins.elbow_sine),
                "shoulder_margin_mm" => MM * margins.shoulder_m,
                _ => continue,
            };
            if value.is_finite() {
                sum += aim.weight * aim.utility(value);
                weights += aim.weight;
            }
        }
        if weights > 0.0 { sum / weights } else { 0.0 }
    }
}

/// Smallest of `|sin q5|`, `|sin q3|` and the distance from the shoulder's singularity over 0.1 m.
fn singularity_margin(candidate: &Candidate) -> f64 {
    const SHOULDER_SCALE_M: f64 = 0.1;
    let margins = &candidate.margins;
    margins
        .wrist_sine
        .min(margins.elbow_sine)
        .min(margins.shoulder_m / SHOULDER_SCALE_M)
}

/// Soft least clearance over the classes that a roll can change: `-s ln sum exp(-d / s)`.
///
/// The arm keeps about 10 mm from itself in most postures, by its build. A plain least would stop
/// there and leave the rest to chance; this one still grows with every other clearance.
fn soft_least_m(candidate: &Candidate) -> f64 {
    let terms: f64 = candidate
        .clearance
        .iter()
        .filter(|pair| {
            !matches!(
                pair.class,
                ClearanceClass::GuideStandoff | ClearanceClass::NeedleRoute
            )
        })
        .map(|pair| (-pair.separation.distance_m / CLEARANCE_SCALE_M).exp())
        .sum();
    if terms > 0.0 {
        -CLEARANCE_SCALE_M * terms.ln()
    } else {
        f64::INFINITY
    }
}

impl Member {
    /// Least clearance of the classes that a roll can change, m, and its class; `None` where there is
    /// no posture.
    pub fn least_clearance(&self) -> Option<&needlebench_clearance::PairClearance> {
        self.candidate
            .as_ref()?
            .clearance
            .iter()
            .filter(|pair| {
                !matches!(
                    pair.class,
                    ClearanceClass::GuideStandoff | ClearanceClass::NeedleRoute
                )
            })
            .min_by(|a, b| a.separation.distance_m.total_cmp(&b.separation.distance_m))
    }
}
