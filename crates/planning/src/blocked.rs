//! Why a motion is rejected, in words: the decisive reason, with its deepest value and what would free it.

use needlebench_clearance::{ClassCertificate, MotionCertificate, Nearby};
use needlebench_kinematics::trajectory::LineError;

use crate::motion_plan::{Required, SearchEffort, Way};
use crate::planner::Planner;
use crate::rejection::of_distance;
use crate::{Rejection, Rule};

impl Planner<'_> {
    /// Why a motion is rejected: first what every motion to this posture does, then what the transfer
    /// does, each at its deepest.
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
                    "{a} {does} {b} in the start posture: every motion begins there; another start would \
                     free it"
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
                    "{a} {does} {b} in the {} at {:.2} s, at their nearest: the way along the needle, which no \
                     transfer changes; another roll, a shorter `approach_mm` or another base may free it",
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
            "{a} {does} {b} in the {} at {:.2} s, at their nearest",
            found.phase.name(),
            found.time_s
        );
        let kept_mm = required.attainable().get(class) * 1e3;
        let (rule, detail) = match search {
            Some(effort) => (
                Rule::NoMotion,
                format!(
                    "no way around was found among {} random postures ({} looked at), and on the straight \
                     one {place}; start and approach keep {kept_mm:.1} mm there: more \
                     `motion_checks`, another start or another base may free it",
                    effort.samples, effort.checks
                ),
            ),
            None => (
                close,
                format!(
                    "{place}; start and approach keep {kept_mm:.1} mm: a way around (`motion_checks`) may \
                     free it"
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

    /// Which rule a class breaks, what its two bodies do, in words, and the distance by which they do, m: the proven bound,
    /// of bodies that were not seen to touch 0 at least.
    fn broken(found: &ClassCertificate) -> (Rule, &'static str, f64) {
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
    fn deepest<'c>(&self, certificate: &'c MotionCertificate) -> Option<&'c ClassCertificate> {
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
