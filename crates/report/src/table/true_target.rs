//! Distance of the needle from the true lesion position, in a sentence.

use needlebench_evaluation::metric::Metric;
use needlebench_evaluation::report::{ConfigurationReport, GoalReport};

use super::budget::mm;

/// Distances of a configuration's needle from the true target, of the tip and lateral: simulated,
/// or predicted where no engine ran.
fn distances_m(configuration: &ConfigurationReport) -> Option<[f64; 2]> {
    let read = |keys: [&str; 2]| {
        let mut known = keys.into_iter().filter_map(Metric::of_key);
        known.find_map(|metric| metric.read(configuration))
    };
    Some([
        read(["true_target_error", "true_target_error_predicted"])?,
        read(["true_target_lateral", "true_target_lateral_predicted"])?,
    ])
}

/// Of the recommended configuration, or from the least to the most of those that were measured; none where the true
/// lesion position is unknown.
pub(crate) fn true_target_in_words(goal: &GoalReport) -> Option<String> {
    let chosen = goal.recommended.as_ref().map(|found| found.label.as_str());
    let measured = goal.configurations.iter().filter(|each| {
        each.rejections.is_empty() && chosen.is_none_or(|label| each.label == label)
    });
    let distances: Vec<[f64; 2]> = measured.filter_map(distances_m).collect();
    let range = |at: usize| {
        let all = || distances.iter().map(|both| both[at]);
        let [least, most] = [all().reduce(f64::min)?, all().reduce(f64::max)?].map(mm);
        Some(if least == most {
            format!("{least} mm")
        } else {
            format!("{least} to {most} mm")
        })
    };
    let (tip, across) = (range(0)?, range(1)?);
    Some(format!("true lesion: tip error {tip}, lateral {across}"))
}
