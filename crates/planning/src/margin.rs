//! Margins of a motion, of those that its configuration allows.
//!
//! Some postures a configuration must take, whatever way leads there: the start, the approach and the place where it
//! holds. Their clearances bound what any motion can keep, class by class: what is *attainable*. The transit in between
//! is free, so it ought never to come nearer to anything than those postures do. Beyond what is ample
//! (`ClassLimit::ample_m`) more is not looked for.

use needlebench_cell::ClearanceClass;
use needlebench_clearance::{
    CertificateOptions, Motion, MotionCertificate, Span, certify, certify_enough,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};

use crate::limits::{ByClass, ClassLimits};
use crate::motion::MotionChecker;

/// Difference of clearances that is none to a search, m: a fifth of what is printed of them, and more than
/// twice the width of a certificate as it is by default.
pub(crate) const SAME_M: f64 = 2.5e-4;

/// What part of a motion comes nearest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LimitedBy {
    /// The start posture.
    Start,
    /// The approach, or the posture in which it ends.
    Approach,
    /// The way in between.
    Transfer,
}

impl LimitedBy {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Approach => "approach",
            Self::Transfer => "transfer",
        }
    }
}

/// How the search for a transit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchEnd {
    /// The transit keeps what the other postures do, or what is ample: none keeps more that counts.
    Bound,
    /// A posture that every motion must take is nearer than allowed: no transit helps.
    Proof,
    /// What may be looked at was used up: there may be a better transfer.
    Budget,
}

impl SearchEnd {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bound => "bound",
            Self::Proof => "proof",
            Self::Budget => "budget",
        }
    }
}

/// Margins of a motion in one class. All are certified lower bounds, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassMargin {
    /// The class.
    pub class: ClearanceClass,
    /// The required clearance.
    pub limit_m: f64,
    /// Clearance of the postures that the motion must take.
    pub attainable_m: f64,
    /// Clearance of the whole motion.
    pub achieved_m: f64,
    /// What comes nearest.
    pub limited_by: LimitedBy,
}

impl ClassMargin {
    /// Its clearance in excess of the required one, m.
    pub fn margin_m(&self) -> f64 {
        self.achieved_m - self.limit_m
    }
}

/// Margins of a motion, of those that its configuration allows.
#[derive(Debug, Clone, PartialEq)]
pub struct Margin {
    /// Class by class, of those that the cell has pairs of and a motion decides.
    pub classes: Vec<ClassMargin>,
    /// How the search ended.
    pub end: SearchEnd,
    /// What the straight transit would have kept; none where the transit is straight.
    pub straight: Option<Straight>,
}

/// The straight transit that an alternative path, or other 2π equivalents, replace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Straight {
    /// Certified minimum clearance of the motion from the surroundings, m; negative where it is blocked.
    pub clearance_m: f64,
    /// The same of the motion that replaces it, m.
    pub instead_m: f64,
    /// How long it would take, s.
    pub duration_s: f64,
}

impl Margin {
    /// The class of surroundings with the least margin: what the motion as a whole is limited by.
    pub fn least(&self) -> Option<&ClassMargin> {
        self.surroundings()
            .min_by(|a, b| a.margin_m().total_cmp(&b.margin_m()))
    }

    /// Least margin beyond the required clearance that any motion to this posture could keep from its surroundings, m.
    pub fn attainable_m(&self) -> Option<f64> {
        let all = self.surroundings();
        all.map(|each| each.attainable_m - each.limit_m)
            .min_by(f64::total_cmp)
    }

    /// The one that this motion keeps, m.
    pub fn achieved_m(&self) -> Option<f64> {
        self.least().map(ClassMargin::margin_m)
    }

    fn surroundings(&self) -> impl Iterator<Item = &ClassMargin> {
        let all = self.classes.iter();
        all.filter(|each| each.class.is_surroundings())
    }
}

/// Clearances of the parts of a motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Parts {
    pub start: ByClass,
    pub approach: ByClass,
    pub transfer: ByClass,
}

impl Parts {
    /// What any motion can keep.
    pub fn attainable(&self) -> ByClass {
        self.start.least(&self.approach)
    }

    /// What this one keeps.
    pub fn achieved(&self) -> ByClass {
        self.attainable().least(&self.transfer)
    }

    pub fn margin(
        &self,
        limits: &ClassLimits,
        end: SearchEnd,
        straight: Option<Straight>,
    ) -> Margin {
        let (attainable, achieved) = (self.attainable(), self.achieved());
        let classes = ClearanceClass::ALL.into_iter().filter_map(|class| {
            let attainable_m = attainable.get(class);
            if !class.is_physical() || attainable_m == f64::INFINITY {
                return None;
            }
            // The start is part of the transfer: only what is nearer by more than the width of a
            // certificate is the transfer's own.
            let limited_by = if self.transfer.get(class) < attainable_m - SAME_M {
                LimitedBy::Transfer
            } else if self.start.get(class) < self.approach.get(class) {
                LimitedBy::Start
            } else {
                LimitedBy::Approach
            };
            Some(ClassMargin {
                class,
                limit_m: limits.get(class).judged_m,
                attainable_m,
                achieved_m: achieved.get(class),
                limited_by,
            })
        });
        Margin {
            classes: classes.collect(),
            end,
            straight,
        }
    }
}

/// The parts of a motion that are of some phases.
struct Only<'t> {
    trajectory: &'t JointTrajectory,
    spans: Vec<Span>,
}

impl Motion for Only<'_> {
    fn position(&self, time_s: f64) -> Joints {
        self.trajectory.sample(time_s).position
    }

    fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints {
        self.trajectory.chord_deviation(from_s, to_s)
    }

    fn spans(&self) -> Vec<Span> {
        self.spans.clone()
    }
}

impl MotionChecker<'_> {
    fn options(&self) -> CertificateOptions {
        CertificateOptions {
            tolerance_m: self.tolerance_m,
            ..CertificateOptions::default()
        }
    }

    /// Certificate of a whole motion.
    pub(crate) fn certificate(&self, trajectory: &JointTrajectory) -> MotionCertificate {
        certify(self.model, trajectory, &self.options())
    }

    /// Certificate of the transit of a motion, as far as it is nearer than what is enough.
    pub(crate) fn of_transfer(
        &self,
        trajectory: &JointTrajectory,
        enough: &ByClass,
    ) -> MotionCertificate {
        let spans = Motion::spans(trajectory).into_iter();
        let part = Only {
            trajectory,
            spans: spans.filter(|span| span.phase == Phase::Transfer).collect(),
        };
        certify_enough(self.model, &part, &self.options(), |class| {
            enough.get(class)
        })
    }
}
