//! The outcome of the rows of a case.

use needlebench_study::search::CaseWorth;
use needlebench_study::{CaseResult, MetricColumn, Outcome};

use crate::study::MARGIN_COLUMN;

/// Column of the RMS tip error over the arm and patient population. The error of one draw is never used in its place.
const TIP_ERROR: &str = "tip_rms_static";

/// Column of the probability that the tip is in the lesion.
const LESION: &str = "lesion_probability_static";

/// The outcome of a case with its best configuration: the largest margin of any; the least RMS tip error and the largest
/// probability of the lesion of the feasible ones.
pub fn worth_of(columns: &[MetricColumn], case: &CaseResult) -> CaseWorth {
    let place = |name: &str| columns.iter().position(|each| each.name == name);
    let margin = place(MARGIN_COLUMN);
    let keyed = |key: &str| columns.iter().position(|each| each.key == key);
    let tip = keyed(TIP_ERROR);
    let working = || case.rows.iter().filter(|row| row.outcome == Outcome::Ok);
    let margins = case.rows.iter().filter_map(|row| row.get(margin?));
    let lesion = keyed(LESION);
    let in_lesion = working().filter_map(|row| row.get(lesion?));
    let tip_errors = working().filter_map(|row| row.get(tip?));
    CaseWorth {
        margin_mm: margins.map(f64::from).fold(f64::NEG_INFINITY, f64::max),
        works: working().next().is_some(),
        tip_error_mm: tip_errors.map(f64::from).reduce(f64::min),
        lesion_probability: in_lesion.map(f64::from).reduce(f64::max),
    }
}
