//! Made-up probabilities.

use needlebench_evaluation::probability::{
    EventProbability, LesionProbability, ProbabilityReport, StructureProbability,
};

pub fn event(
    probability: Option<f64>,
    interval_95: [f64; 2],
    at_most: Option<f64>,
) -> EventProbability {
    EventProbability {
        probability,
        interval_95,
        at_most,
        of_1000: "so many".to_owned(),
        assumed_larger: None,
        at_most_of_1000: at_most.map(|_| "at most so many".to_owned()),
        mostly: None,
        draws: 10_000,
    }
}

/// Of a lesion and the vessel that is near; bones and organs are far.
pub fn probability_report(lesion: EventProbability, vessel: EventProbability) -> ProbabilityReport {
    ProbabilityReport {
        in_lesion: Some(LesionProbability {
            lesion: "a".to_owned(),
            diameter_m: 0.01,
            boundary_sd_m: 0.0,
            event: lesion,
        }),
        within_2_mm: event(Some(0.5), [0.4, 0.6], None),
        structures: vec![StructureProbability {
            structure: "vessel".to_owned(),
            tissue: "vessel".to_owned(),
            distance_m: 0.004,
            boundary_sd_m: 0.0,
            moves_with: "wall",
            event: vessel,
        }],
        any: None,
        margin_m: 1e-3,
        others: 3,
        others_at_most: 1e-9,
        assumed: Vec::new(),
    }
}
