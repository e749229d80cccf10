//! What the best member of a family is best at.

use nalgebra::Point3;
use needlebench_cell::ClearanceClass;
use needlebench_clearance::AIMS;
use needlebench_kinematics::Joints;
use needlebench_scenario::Goal;
use needlebench_scenario::scenario::RollAim;

use super::Member;
use crate::limits::ByClass;
use crate::planner::{Candidate, Planner, PostureMargins};

/// What a roll is chosen for.
pub type Aim = RollAim;

/// Length over which clearances count less and less for [`Aim::Clearance`], m.
const CLEARANCE_SCALE_M: f64 = 0.02;

/// Group of classes of which the least clearance counts for [`Aim::Balanced`], with its key in `[ranking]`.
pub(super) const BALANCED: [&str; AIMS] =
    ["clearance_mm", "self_clearance_mm", "needle_corridor_mm"];

/// Index in [`BALANCED`] of the group of a class.
pub(super) fn balanced_group(class: ClearanceClass) -> Option<usize> {
    match class {
        ClearanceClass::SelfCollision => Some(1),
        ClearanceClass::NeedleCorridor => Some(2),
        _ if class.is_surroundings() => Some(0),
        _ => None,
    }
}

/// Whether a roll can change the clearance of a class.
fn changes_with_roll(class: ClearanceClass) -> bool {
    !matches!(
        class,
        ClearanceClass::GuideStandoff | ClearanceClass::NeedleRoute
    )
}

/// What a posture's value depends on.
pub(super) struct Valued<'v> {
    pub joints: &'v Joints,
    pub margins: &'v PostureMargins,
    pub clearance: &'v ByClass,
}

impl Planner<'_> {
    /// How good a posture is at an aim; more is better. It does not evaluate rules, so it applies to feasible and
    /// infeasible postures alike.
    pub fn value(&self, goal: &Goal, aim: Aim, candidate: &Candidate) -> f64 {
        self.value_of(
            goal,
            aim,
            &Valued {
                joints: &candidate.joints,
                margins: &candidate.margins,
                clearance: &ByClass::of_posture(&candidate.clearance),
            },
        )
    }

    pub(super) fn value_of(&self, goal: &Goal, aim: Aim, posture: &Valued<'_>) -> f64 {
        match aim {
            Aim::Clearance => soft_least_m(posture.clearance),
            Aim::JointMargin => posture.margins.joint_limit,
            Aim::Singularity => singularity_margin(posture.margins),
            Aim::TipAccuracy => -self.tip_sensitivity_at(goal, posture.joints),
            Aim::Balanced => self.balanced(goal, posture),
        }
    }

    /// Root of the sum of the squared speeds of the needle's tip under each joint alone, m/rad.
    ///
    /// With independent errors of standard deviation `s` in every joint the tip's root-mean-square
    /// displacement is `s` times this, to first order.
    pub fn tip_sensitivity(&self, goal: &Goal, candidate: &Candidate) -> f64 {
        self.tip_sensitivity_at(goal, &candidate.joints)
    }

    fn tip_sensitivity_at(&self, goal: &Goal, q: &Joints) -> f64 {
        let tool = &self.cell().tool;
        let tip_in_flange =
            tool.flange_from_guide_exit * Point3::new(0.0, 0.0, goal.insertion_length_m);
        self.kinematics()
            .chain
            .jacobian_at(q, &tip_in_flange.coords)
            .fixed_rows::<3>(0)
            .norm()
    }

    /// Weighted mean of the scenario's utilities of what a posture alone decides.
    fn balanced(&self, goal: &Goal, posture: &Valued<'_>) -> f64 {
        const MM: f64 = 1e3;
        let margins = posture.margins;
        let least = |group: usize| {
            let classes = ClearanceClass::ALL.into_iter();
            classes
                .filter(|class| balanced_group(*class) == Some(group))
                .map(|class| posture.clearance.get(class))
                .fold(f64::INFINITY, f64::min)
        };
        let (mut sum, mut weights) = (0.0, 0.0);
        for (key, aim) in self.ranking_aims() {
            let value = match *key {
                _ if BALANCED.contains(key) => {
                    let group = BALANCED.iter().position(|known| known == key);
                    group.map_or(f64::INFINITY, |group| MM * least(group))
                }
                // The same number in m/rad and in mm/mrad.
                "tip_sensitivity_mm_mrad" => self.tip_sensitivity_at(goal, posture.joints),
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
fn singularity_margin(margins: &PostureMargins) -> f64 {
    const SHOULDER_SCALE_M: f64 = 0.1;
    margins
        .wrist_sine
        .min(margins.elbow_sine)
        .min(margins.shoulder_m / SHOULDER_SCALE_M)
}

/// Soft least clearance over the classes that a roll can change: `-s ln sum exp(-d / s)`.
///
/// The arm keeps about 10 mm from itself in most postures, by its build. A plain least would stop
/// there and leave the rest to chance; this one still grows with every other clearance.
fn soft_least_m(clearance: &ByClass) -> f64 {
    let terms: f64 = ClearanceClass::ALL
        .into_iter()
        .filter(|class| changes_with_roll(*class))
        .map(|class| libm::exp(-clearance.get(class) / CLEARANCE_SCALE_M))
        .sum();
    if terms > 0.0 {
        -CLEARANCE_SCALE_M * libm::log(terms)
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
            .filter(|pair| changes_with_roll(pair.class))
            .min_by(|a, b| a.separation.distance_m.total_cmp(&b.separation.distance_m))
    }
}
