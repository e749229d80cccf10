//! Limits and desired values of clearances, class by class: the only place of all limits that postures and motions are
//! planned for.
//!
//! Four values of each class, never falling from one to the next:
//!
//! - the *floor* (`[planning]`): what is below it is rejected;
//! - the *required* clearance (`[criteria]`, else the floor): what is below it fails;
//! - the *desired* clearance: that with the reserve `clearance_reserve_mm`, by which a simulated motion may be off its
//!   plan;
//! - what is *ample*: beyond it nothing is gained, so that no motion is made longer for more.
//!
//! Of postures and motions that are not rejected those are preferred that fall short of the required clearances by
//! least, summed over the classes; of equal ones those that fall short of the desired clearances by least.

use needlebench_cell::ClearanceClass;
use needlebench_clearance::{ClassMinima, MotionCertificate};
use needlebench_scenario::scenario::Scenario;

/// Number of classes.
pub(crate) const CLASS_COUNT: usize = ClearanceClass::ALL.len();

/// Clearance from itself that is ample, as a share of the one at which the ranking's utility is full. It is inherent in
/// the arm, and no alternative path changes it.
const AMPLE_SELF_SHARE: f64 = 0.5;

/// Limits of one class, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassLimit {
    /// What is nearer is rejected.
    pub floor_m: f64,
    /// What is nearer fails.
    pub judged_m: f64,
    /// What is planned for where it can be had.
    pub wanted_m: f64,
    /// What is farther is no better.
    pub ample_m: f64,
}

/// Limits of all classes.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassLimits([ClassLimit; CLASS_COUNT]);

/// A clearance of each class, m; infinite where there is no pair of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ByClass([f64; CLASS_COUNT]);

/// How far clearances fall short, m, each a sum over the classes and not above 0. The order is that of preference:
/// first the required clearances, then the reserve.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Shortfall {
    /// Of the required clearances.
    pub judged_m: f64,
    /// Of the desired clearances.
    pub reserve_m: f64,
}

impl Shortfall {
    /// Nothing is missing.
    pub const NONE: Self = Self {
        judged_m: 0.0,
        reserve_m: 0.0,
    };

    /// At least as good as another, up to a difference that is none.
    pub fn reaches(&self, other: &Self, tolerance_m: f64) -> bool {
        self.judged_m >= other.judged_m - tolerance_m
            && self.reserve_m >= other.reserve_m - tolerance_m
    }
}

impl ClassLimits {
    /// The limits of a scenario.
    pub fn of(scenario: &Scenario) -> Self {
        const MM: f64 = 1e-3;
        let planning = &scenario.planning;
        let criteria = &scenario.criteria.min_clearance_mm;
        let reserve_m = planning.clearance_reserve_mm * MM;
        let best_m = |wanted: &str| {
            let aims = scenario.ranking.aims();
            let aim = aims.iter().find(|(key, _)| *key == wanted);
            aim.map_or(0.0, |(_, aim)| aim.best * MM)
        };
        let (best_clearance_m, best_self_m) = (best_m("clearance_mm"), best_m("self_clearance_mm"));
        Self(ClearanceClass::ALL.map(|class| {
            let floor_m = match class {
                // The guide tube is meant to stand near the skin: only touching counts.
                ClearanceClass::GuideStandoff => (planning.min_clearance_mm * MM).min(0.0),
                ClearanceClass::SelfCollision => planning.min_self_clearance_mm * MM,
                ClearanceClass::RobotPerson => {
                    planning
                        .min_person_clearance_mm
                        .max(planning.min_clearance_mm)
                        * MM
                }
                ClearanceClass::NeedleCorridor if planning.require_needle_corridor => 0.0,
                // Of the goal, whatever the posture.
                ClearanceClass::NeedleCorridor | ClearanceClass::NeedleRoute => f64::NEG_INFINITY,
                _ => planning.min_clearance_mm * MM,
            };
            let criterion_m = match class {
                ClearanceClass::NeedleRoute => None,
                _ => criteria.least_mm(class).map(|mm| mm * MM),
            };
            let judged_m = criterion_m.map_or(floor_m, |least_m| least_m.max(floor_m));
            let wanted_m = match class {
                // How far the tube stands off is the goal's, not the posture's, to choose.
                ClearanceClass::GuideStandoff => judged_m,
                _ => judged_m + reserve_m,
            };
            let ample_m = match class {
                ClearanceClass::SelfCollision => AMPLE_SELF_SHARE * best_self_m,
                _ if class.is_surroundings() => best_clearance_m,
                _ => wanted_m,
            };
            ClassLimit {
                floor_m,
                judged_m,
                wanted_m,
                ample_m: ample_m.max(wanted_m),
            }
        }))
    }

    /// Limits of a class.
    pub fn get(&self, class: ClearanceClass) -> &ClassLimit {
        &self.0[class as usize]
    }

    /// Below what postures and motions are rejected.
    pub(crate) fn floors(&self) -> ByClass {
        ByClass(self.0.map(|limit| limit.floor_m))
    }

    /// What is planned for.
    pub(crate) fn wanted(&self) -> ByClass {
        ByClass(self.0.map(|limit| limit.wanted_m))
    }

    /// What is no better farther.
    pub(crate) fn ample(&self) -> ByClass {
        ByClass(self.0.map(|limit| limit.ample_m))
    }

    /// How far clearances fall short of the limits.
    pub fn shortfall(&self, clearance: &ByClass) -> Shortfall {
        let sum = |limit_m: fn(&ClassLimit) -> f64| -> f64 {
            let classes = clearance.0.iter().zip(&self.0);
            classes
                .map(|(clearance_m, limit)| (clearance_m - limit_m(limit)).min(0.0))
                .sum()
        };
        Shortfall {
            judged_m: sum(|limit| limit.judged_m),
            reserve_m: sum(|limit| limit.wanted_m),
        }
    }
}

impl ByClass {
    /// The least clearances of a posture.
    pub fn of_posture(minima: &ClassMinima) -> Self {
        let mut all = [f64::INFINITY; CLASS_COUNT];
        for pair in minima.iter() {
            all[pair.class as usize] = pair.separation.distance_m;
        }
        Self(all)
    }

    /// Clearances by class, m.
    pub(crate) fn of(clearance_m: impl Fn(ClearanceClass) -> f64) -> Self {
        Self(ClearanceClass::ALL.map(clearance_m))
    }

    /// The certified lower bounds of a motion.
    pub fn proven(certificate: &MotionCertificate) -> Self {
        let mut all = [f64::INFINITY; CLASS_COUNT];
        for (class, found) in certificate.iter() {
            all[class as usize] = found.lower_bound_m;
        }
        Self(all)
    }

    /// What is attained along a motion, at least the certified bounds.
    pub(crate) fn attained(certificate: &MotionCertificate) -> Self {
        let mut all = [f64::INFINITY; CLASS_COUNT];
        for (class, found) in certificate.iter() {
            all[class as usize] = found.attained.separation.distance_m;
        }
        Self(all)
    }

    /// That of a class.
    pub fn get(&self, class: ClearanceClass) -> f64 {
        self.0[class as usize]
    }

    /// The lesser of each class.
    #[must_use]
    pub fn least(&self, other: &Self) -> Self {
        self.with(other, f64::min)
    }

    pub(crate) fn with(&self, other: &Self, both: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|class| {
            both(self.0[class], other.0[class])
        }))
    }

    /// Least of the surroundings, m.
    pub(crate) fn of_surroundings_m(&self) -> f64 {
        let classes = ClearanceClass::ALL.into_iter();
        classes
            .filter(|class| class.is_surroundings())
            .map(|class| self.get(class))
            .fold(f64::INFINITY, f64::min)
    }

    /// Without the classes that a motion does not decide: the corridor counts while the arm holds.
    pub(crate) fn of_bodies(mut self) -> Self {
        for class in ClearanceClass::ALL {
            if !class.is_physical() {
                self.0[class as usize] = f64::INFINITY;
            }
        }
        self
    }

    /// By how much any class of physical bodies is below another's at most, m; negative where all are above.
    pub(crate) fn most_below(&self, other: &Self) -> f64 {
        let physical = ClearanceClass::ALL
            .into_iter()
            .filter(|class| class.is_physical());
        physical
            .map(|class| other.get(class) - self.get(class))
            .filter(|lack_m| !lack_m.is_nan())
            .fold(f64::NEG_INFINITY, f64::max)
    }
}
