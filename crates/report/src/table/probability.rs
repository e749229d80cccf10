//! How likely the needle meets what, and reaches the lesion: counts of 1000 needles by the error model.

use needlebench_cell::part_in_words;
use needlebench_evaluation::probability::{ASSUMED_LARGER, EventProbability, ProbabilityReport};
use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_show::Block;

/// The answer for the recommended configuration, in a sentence; none without one.
pub(crate) fn probability_in_words(goal: &GoalReport) -> Option<String> {
    let (configuration, all) = chosen(goal)?;
    let mut parts = Vec::new();
    match &all.in_lesion {
        Some(lesion) => parts.push(format!(
            "{} end in the lesion ({:.0} mm)",
            lesion.event.of_1000,
            lesion.diameter_m * 1e3
        )),
        None => parts.push(format!(
            "{} end within 2 mm of the target",
            all.within_2_mm.of_1000
        )),
    }
    if let (Some(any), Some(first)) = (&all.any, all.structures.first()) {
        let bound = any.at_most_of_1000.as_ref();
        let bound = bound.map_or_else(String::new, |bound| format!(" ({bound})"));
        let most_often = any.probability.map_or_else(String::new, |_| {
            format!(", most often to {}", part_in_words(&first.structure))
        });
        parts.push(format!(
            "{} come closer than {:.0} mm to a structure{most_often}{bound}",
            any.of_1000,
            all.margin_m * 1e3
        ));
    }
    let wanted = match &all.in_lesion {
        Some(lesion) => &lesion.event,
        None => &all.within_2_mm,
    };
    let larger = [Some(wanted), all.any.as_ref()].into_iter().flatten();
    let larger: Vec<&str> = larger
        .filter_map(|event| Some(event.assumed_larger.as_ref()?.of_1000.as_str()))
        .collect();
    if !larger.is_empty() {
        parts.push(format!(
            "assumed errors x {ASSUMED_LARGER}: {}",
            larger.join(" and ")
        ));
    }
    Some(format!(
        "of 1000 needles by this model ({}, assumed: {}): {}",
        configuration.label,
        all.assumed.join(", "),
        parts.join("; ")
    ))
}

/// The configuration that is told of: the recommended one, else the first that has any.
fn chosen(goal: &GoalReport) -> Option<(&ConfigurationReport, &ProbabilityReport)> {
    let known = || {
        let configurations = goal.configurations.iter();
        configurations.filter_map(|each| Some((each, each.probability.as_ref()?)))
    };
    let recommended = goal.recommended.as_ref();
    let recommended =
        recommended.and_then(|found| known().find(|(each, _)| each.label == found.label));
    recommended.or_else(|| known().next())
}

/// The same with the assumed errors larger.
fn with_larger(event: &EventProbability) -> String {
    let larger = event.assumed_larger.as_ref();
    larger.map_or_else(|| "-".to_owned(), |larger| larger.of_1000.clone())
}

/// All configurations, and the structures of the one that is recommended.
pub(crate) fn probability_blocks(goal: &GoalReport) -> Vec<Block> {
    let Some((configuration, all)) = chosen(goal) else {
        return Vec::new();
    };
    let rows = goal.configurations.iter().filter_map(|each| {
        let all = each.probability.as_ref()?;
        let dash = || "-".to_owned();
        let lesion = all.in_lesion.as_ref();
        let any = all.any.as_ref();
        let first = all.structures.first();
        Some(vec![
            each.label.to_owned(),
            lesion.map_or_else(dash, |lesion| lesion.event.of_1000.clone()),
            lesion.map_or_else(dash, |lesion| with_larger(&lesion.event)),
            all.within_2_mm.of_1000.clone(),
            any.map_or_else(dash, |any| any.of_1000.clone()),
            any.and_then(|any| any.at_most_of_1000.clone())
                .unwrap_or_else(dash),
            first
                .filter(|first| first.event.probability.is_some())
                .map_or_else(dash, |first| part_in_words(&first.structure).into_owned()),
        ])
    });
    let own = |what: String, event: &EventProbability, distance_m: Option<f64>| {
        let dash = || "-".to_owned();
        vec![
            what,
            distance_m.map_or_else(dash, |distance_m| format!("{:.1}", distance_m * 1e3)),
            event.of_1000.clone(),
            with_larger(event),
            event.at_most_of_1000.clone().unwrap_or_else(dash),
            event.mostly.clone().unwrap_or_else(dash),
        ]
    };
    let lesion = all.in_lesion.iter();
    let lesion = lesion.map(|lesion| {
        let what = format!("tip in the lesion ({:.0} mm)", lesion.diameter_m * 1e3);
        own(what, &lesion.event, None)
    });
    let point = own(
        "tip within 2 mm of the target".to_owned(),
        &all.within_2_mm,
        None,
    );
    let close = all.structures.iter().map(|each| {
        let what = format!("close to {}", part_in_words(&each.structure));
        own(what, &each.event, Some(each.distance_m))
    });
    let any = all.any.iter();
    let any = any.map(|any| own("close to any of them".to_owned(), any, None));
    let others = format!(
        "close: needle surface nearer than {:.0} mm; {} other structures together: at most {:.1e} of 1000; mostly: source whose \
         variance, halved, changes the count most, bend not considered; assumed: {}",
        all.margin_m * 1e3,
        all.others,
        all.others_at_most * 1e3,
        all.assumed.join(", ")
    );
    vec![
        Block::Lines(vec![
            "of 1000 needles by this model, estimates with 95 % intervals".to_owned(),
        ]),
        Block::table(
            [
                "configuration",
                "tip in the lesion",
                "assumed errors x 1.5",
                "within 2 mm",
                "close to a structure",
                "bound",
                "most often",
            ],
            rows.collect(),
        ),
        Block::table(
            [
                configuration.label,
                "distance (mm)",
                "of 1000 needles",
                "assumed errors x 1.5",
                "bound",
                "mostly",
            ],
            lesion.chain([point]).chain(close).chain(any).collect(),
        ),
        Block::Lines(vec![others]),
    ]
}
