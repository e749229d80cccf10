//! What the rows of a case are worth.

use needlebench_study::search::CaseWorth;
use needlebench_study::{CaseResult, MetricColumn, Outcome};

use crate::study::MARGIN_COLUMN;

/// Column of the expected error of the tip, over all arms and patients. One draw's error is something else, and never
/// stands for it.
const TIP_ERROR: &str = "tip_rms_static";

/// What a case is worth with its best configuration: the most margin of any; the least expected error of the tip of those
/// that work.
pub fn worth_of(columns: &[MetricColumn], case: &CaseResult) -> CaseWorth {
    let place = |name: &str| columns.iter().position(|each| each.name == name);
    let margin = place(MARGIN_COLUMN);
    let keyed = |key: &str| columns.iter().position(|each| each.key == key);
    let tip = keyed(TIP_ERROR);
    let working = || case.rows.iter().filter(|row| row.outcome == Outcome::Ok);
    let margins = case.rows.iter().filter_map(|row| row.get(margin?));
    let tip_errors = working().filter_map(|row| row.get(tip?));
    CaseWorth {
        margin_mm: margins.map(f64::from).fold(f64::NEG_INFINITY, f64::max),
        works: working().next().is_some(),
        tip_error_mm: tip_errors.map(f64::from).reduce(f64::min),
    }
}
