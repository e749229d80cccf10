//! Least clearances by class, as values of the report.

use std::collections::BTreeMap;

use needlebench_cell::ClearanceClass;
use needlebench_clearance::is_known;
use serde::Serialize;

/// Least clearance of a class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassClearance {
    /// Signed distance: positive apart, negative the penetration depth.
    pub minimum_m: f64,
    /// Proven lower bound over the whole motion; none where there is no motion. With a breath that is held at another
    /// phase than was planned for, it holds in every phase.
    pub certified_lower_bound_m: Option<f64>,
    /// What is taken off the bound of the motion as it was, since the skin may come nearer in another phase of the breath;
    /// none without breath. Only the rest of the distance between bound and minimum is what the proof could not close.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub breath_allowance_m: Option<f64>,
    /// Lower bound of the distance from where the patient's body may go on behind the cuts of its scan, not resolved
    /// beyond what matters; none where nothing is cut, or for a class that is not from the patient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub behind_cuts_m: Option<f64>,
    /// The two solids.
    pub pair: [String; 2],
    /// Nearest (or deepest) points of the two, in the world.
    pub witness_points_m: [[f64; 3]; 2],
    /// Phase of the motion; `final_posture` without one, `insertion` for the needle path.
    pub phase: &'static str,
    /// Time in the motion.
    pub time_s: Option<f64>,
    /// Engine whose motion it is.
    pub engine: Option<String>,
}

/// Clearances by class; a class that the cell has no part for is absent.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct ClearanceReport {
    /// By class name.
    #[serde(flatten)]
    pub classes: BTreeMap<&'static str, ClassClearance>,
    /// Least over the classes of physical bodies, the guide's intended stand-off left out.
    pub minimum_m: Option<f64>,
    /// Least certified lower bound over the same classes; none unless all of them have one.
    pub minimum_certified_m: Option<f64>,
}

impl ClearanceReport {
    /// The least clearances of a motion.
    pub fn of(minima: &BTreeMap<ClearanceClass, ClassClearance>) -> Self {
        let named = minima
            .iter()
            .map(|(class, found)| (class.name(), found.clone()));
        Self::new(named.collect())
    }

    /// Clearances by class with the least of those that count.
    pub fn new(classes: BTreeMap<&'static str, ClassClearance>) -> Self {
        let mut made = Self {
            classes,
            minimum_m: None,
            minimum_certified_m: None,
        };
        made.minimum_m = made.least().map(|found| found.minimum_m);
        made.minimum_certified_m = made
            .physical()
            .map(|found| found.certified_lower_bound_m)
            .reduce(|least, next| Some(least?.min(next?)))
            .flatten();
        made
    }

    /// The least clearance of physical bodies from each other, the guide's intended stand-off left
    /// out.
    fn least(&self) -> Option<&ClassClearance> {
        self.physical()
            .min_by(|a, b| a.minimum_m.total_cmp(&b.minimum_m))
    }

    /// The least clearance of arm and tool from what stands around them, the arm's own left out.
    pub fn least_from_surroundings(&self) -> Option<&ClassClearance> {
        let classes = self.classes.iter();
        classes
            .filter(|(class, _)| {
                ClearanceClass::named(class).is_some_and(ClearanceClass::is_surroundings)
            })
            .map(|(_, found)| found)
            .min_by(|a, b| a.minimum_m.total_cmp(&b.minimum_m))
    }

    /// Names of the classes of which the clearance is not known: the patient may be nearer behind the cuts of its scan.
    pub fn unknown(&self) -> impl Iterator<Item = &'static str> {
        let classes = self.classes.iter();
        let unknown = classes.filter(|(_, found)| !is_known(found.minimum_m, found.behind_cuts_m));
        unknown.map(|(class, _)| *class)
    }

    fn physical(&self) -> impl Iterator<Item = &ClassClearance> {
        self.classes
            .iter()
            .filter(|(class, _)| {
                ClearanceClass::named(class).is_some_and(ClearanceClass::is_unwanted)
            })
            .map(|(_, found)| found)
    }
}
