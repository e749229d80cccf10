//! Why a motion is rejected, in words: the decisive reason, with its worst value and a hint.

use needlebench_cell::Rule;
use needlebench_clearance::{ClassCertificate, MotionCertificate, Nearby};
use needlebench_kinematics::trajectory::LineError;

use crate::Rejection;
use crate::motion_plan::{Required, SearchEffort, Way};
use crate::planner::Planner;
use crate::rejection::of_distance;

impl Planner<'_> {
    /// Why a motion is rejected: first the violations common to all motions to this posture, then those of the
    /// transit, each at its worst.
    pub(crate) fn too_near(
        &self,
        required: &Required,
        way: &Way,
        approach: &MotionCertificate,
        search: Option<&SearchEffort>,
    ) -> Option<Rejection> {
        if let Some(pair) = self.checker.posture(self.start(), &mut Nearby::default()).1 {
            let [a, b] = pair.in_words(self.cell());
            let (rule, does) = of_distance(pair.separation.distance_m);
            return Some(Rejection {
                rule,
                value: pair.separation.distance_m,
                limit: self.limits().get(pair.class).floor_m,
                unit: "m",
                detail: format!(
                    "{a} {does} {b} in the start posture, common to all motions; try another start \
                     posture"
                ),
                class: Some(pair.class),
            });
        }
        if let Some(found) = self.deepest(approach) {
            let [a, b] = found.attained.in_words(self.cell());
            let class = found.attained.class;
            let (rule, does, value) = Self::broken(found);
            return Some(Rejection {
                rule,
                value,
                limit: self.limits().get(class).floor_m,
                unit: "m",
                detail: format!(
                    "{a} {does} {b} in the {} (t = {:.2} s), common to all transit paths; try \
                     another roll, a shorter `approach_mm` or another base placement",
                    found.phase.name(),
                    found.time_s
                ),
                class: Some(class),
            });
        }
        let found = self.deepest(&way.certificate)?;
        let [a, b] = found.attained.in_words(self.cell());
        let class = found.attained.class;
        let (close, does, value) = Self::broken(found);
        let place = format!(
            "{a} {does} {b} in the {} (t = {:.2} s)",
            found.phase.name(),
            found.time_s
        );
        let kept_mm = required.attainable().get(class) * 1e3;
        let (rule, detail) = match search {
            Some(effort) => (
                Rule::NoMotion,
                format!(
                    "no alternative path found among {} random postures ({} checked), and on the \
                     joint-space line {place}; start and approach allow {kept_mm:.1} mm there; try \
                     more `motion_checks`, another start posture or another base placement",
                    effort.samples, effort.checks
                ),
            ),
            None => (
                close,
                format!(
                    "{place}; start and approach allow {kept_mm:.1} mm; an alternative path \
                     (`motion_checks`) may be feasible"
                ),
            ),
        };
        Some(Rejection {
            rule,
            value,
            limit: self.limits().get(class).floor_m,
            unit: "m",
            detail,
            class: Some(class),
        })
    }

    /// Which rule a class violates, what its two bodies do, in words, and their distance, m: the certified bound,
    /// of bodies that were not seen to touch 0 at least.
    pub(crate) fn broken(found: &ClassCertificate) -> (Rule, &'static str, f64) {
        let attained_m = found.attained.separation.distance_m;
        let (rule, does) = of_distance(attained_m);
        let bound_m = found.lower_bound_m.min(attained_m);
        let value_m = if attained_m < 0.0 {
            bound_m
        } else {
            bound_m.max(0.0)
        };
        (rule, does, value_m)
    }

    /// The class that is farthest below its floor along a motion, if any is.
    pub(crate) fn deepest<'c>(
        &self,
        certificate: &'c MotionCertificate,
    ) -> Option<&'c ClassCertificate> {
        certificate
            .iter()
            .filter(|(class, _)| class.is_physical())
            .map(|(class, found)| {
                (
                    found,
                    found.lower_bound_m - self.limits().get(class).floor_m,
                )
            })
            .filter(|(_, excess_m)| *excess_m < 0.0)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(found, _)| found)
    }

    /// A needle's line that the arm cannot follow to its beginning.
    pub(crate) fn blocked_approach(error: &LineError, approach_m: f64) -> Rejection {
        let free_m = match error {
            LineError::Singular { travelled_m, .. } | LineError::OutOfReach { travelled_m } => {
                *travelled_m
            }
        };
        Rejection {
            rule: Rule::Approach,
            value: free_m,
            limit: approach_m,
            unit: "m",
            detail: error.to_string(),
            class: None,
        }
    }
}
