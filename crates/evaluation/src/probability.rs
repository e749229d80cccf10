//! How likely the needle of a configuration meets what, and reaches the lesion: of the error model, never of a patient.

use needlebench_scenario::scenario::CriteriaSection;
use serde::Serialize;

/// Probabilities of one needle over the arm and patient population.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProbabilityReport {
    /// The tip is in the lesion; none for a goal that is no lesion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_lesion: Option<LesionProbability>,
    /// The tip is within 2 mm of the target.
    pub within_2_mm: EventProbability,
    /// The needle's surface comes closer to a structure than `margin_m`: those of which that is at least 1e-6 likely by the
    /// upper bound, the likeliest first,
    /// then those that no draw hits by their bounds.
    pub structures: Vec<StructureProbability>,
    /// It comes closer to any of these structures.
    pub any: Option<EventProbability>,
    /// How close is too close: from the needle's surface to the structure's.
    pub margin_m: f64,
    /// How many other structures there are.
    pub others: usize,
    /// Upper bound of the probability that it comes closer to any of those.
    pub others_at_most: f64,
    /// Sources of the model that are assumed, and not measured.
    pub assumed: Vec<String>,
}

/// Of the lesion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LesionProbability {
    /// Its name.
    pub lesion: String,
    /// Its diameter.
    pub diameter_m: f64,
    /// Standard deviation of where its boundary is.
    pub boundary_sd_m: f64,
    /// How likely.
    #[serde(flatten)]
    pub event: EventProbability,
}

/// Of one structure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StructureProbability {
    /// Its name.
    pub structure: String,
    /// Bone, vessel or organ.
    pub tissue: String,
    /// Distance of its surface from that of the planned straight needle, negative inside.
    pub distance_m: f64,
    /// Standard deviation of where its boundary is.
    pub boundary_sd_m: f64,
    /// What it moves with while the patient breathes: `wall` or `lung`.
    pub moves_with: &'static str,
    /// How likely.
    #[serde(flatten)]
    pub event: EventProbability,
}

/// How likely an event is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventProbability {
    /// The estimate; none where it is told by its bound alone.
    pub probability: Option<f64>,
    /// Its 95 % interval.
    pub interval_95: [f64; 2],
    /// Upper bound without sampling, given the model; none for what is wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// Needles of 1000, in words: `2.1 (1.4 to 3.0)`.
    pub of_1000: String,
    /// The bound, in words: `at most 14`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most_of_1000: Option<String>,
    /// The same with the deviations of what is assumed [`ASSUMED_LARGER`] times as large; none where nothing is drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assumed_larger: Option<LargerProbability>,
    /// The source whose halved variance changes the estimate most; none without an estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mostly: Option<String>,
    /// Draws of the estimate.
    pub draws: u64,
}

/// How many times as large the deviations of what is assumed are in the second column.
pub const ASSUMED_LARGER: f64 = 1.5;

/// How likely an event is under larger deviations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LargerProbability {
    /// The estimate; none where no draw has it.
    pub probability: Option<f64>,
    /// Its 95 % interval.
    pub interval_95: [f64; 2],
    /// Needles of 1000, in words.
    pub of_1000: String,
}

impl ProbabilityReport {
    /// The structures of a tissue, the likeliest first.
    fn of_tissue(&self, tissue: &str) -> impl Iterator<Item = &StructureProbability> {
        let structures = self.structures.iter();
        structures.filter(move |each| each.tissue == tissue)
    }

    /// How likely the needle comes close to the structure of a tissue that it most likely does: the estimate, or the most that
    /// it can be where there is none; none where the planned path does already.
    pub(crate) fn value_of(&self, tissue: &str) -> Option<f64> {
        match self.of_tissue(tissue).next() {
            Some(first) => {
                let event = &first.event;
                let known = event.probability.unwrap_or_else(|| event.largest());
                (event.draws > 0).then_some(known)
            }
            None => Some(self.others_at_most),
        }
    }

    /// The same in words.
    pub(crate) fn words_of(&self, tissue: &str) -> String {
        match self.of_tissue(tissue).next() {
            Some(first) => format!("{}: {}", first.structure, first.event.in_words()),
            None => "by its bound alone".to_owned(),
        }
    }

    /// Criteria on probabilities that cannot be told from their limits, each with why.
    pub(crate) fn undecided(&self, criteria: &CriteriaSection) -> Vec<(&'static str, String)> {
        let structures = &criteria.max_structure_probability;
        let of = |tissue: &str| self.of_tissue(tissue).next().map(|each| &each.event);
        let lesion = self.in_lesion.as_ref().map(|lesion| &lesion.event);
        let all = [
            (
                "min_lesion_probability",
                criteria.min_lesion_probability,
                lesion,
            ),
            (
                "max_structure_probability.bone",
                structures.bone,
                of("bone"),
            ),
            (
                "max_structure_probability.vessel",
                structures.vessel,
                of("vessel"),
            ),
            (
                "max_structure_probability.organ",
                structures.organ,
                of("organ"),
            ),
        ];
        let open = all.into_iter().filter_map(|(key, limit, event)| {
            let (limit, event) = (limit?, event?);
            let [low, _] = event.interval_95;
            let is_open = low <= limit && limit < event.largest();
            is_open.then(|| {
                let words = event.in_words();
                (
                    key,
                    format!("the interval holds the limit {limit}: {words}"),
                )
            })
        });
        open.collect()
    }
}

impl EventProbability {
    /// The largest that the model allows: the upper end of the interval, or the bound where that is less.
    pub fn largest(&self) -> f64 {
        let [_, high] = self.interval_95;
        self.at_most.map_or(high, |at_most| at_most.min(high))
    }

    /// Of 1000 needles.
    pub fn in_words(&self) -> String {
        let bound = self.at_most_of_1000.as_ref();
        let bound = bound.map_or_else(String::new, |bound| format!(", {bound}"));
        format!("{}{bound} of 1000 needles by this model", self.of_1000)
    }
}
