//! What the statistics need to know of a case.

use crate::column::Measures;
use crate::{CaseResult, FactorValue, MetricColumn, Outcome, Results, ResultsError, Row};

/// Number of configurations.
pub(crate) const CONFIGURATIONS: usize = 8;

/// The outcome of a layout, over its configurations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    /// Configurations that are ok, as bits.
    pub ok: u8,
    /// Configurations that were not evaluated, as bits.
    pub not_judged: u8,
    /// Whether the needle path has the required clearance from bone, vessels and organs, where required and known.
    pub keeps_away: Option<bool>,
    /// Configuration with the largest clearance of those that are ok; the first of equal ones.
    pub best: Option<usize>,
    /// Its clearance, mm.
    pub best_clearance: Option<f32>,
    /// Its tip error, mm.
    pub best_tip_error: Option<f32>,
    /// Least tip error of those that are ok, mm.
    pub least_tip_error: Option<f32>,
}

impl Layout {
    /// None of an invalid layout.
    pub(crate) fn of(result: &CaseResult, measures: &Measures) -> Option<Self> {
        let mut layout = Self {
            ok: 0,
            not_judged: 0,
            keeps_away: measures.keeps_away(&result.rows),
            best: None,
            best_clearance: None,
            best_tip_error: None,
            least_tip_error: None,
        };
        for (index, row) in result.rows.iter().enumerate() {
            match row.outcome {
                Outcome::Invalid => return None,
                Outcome::Ok => layout.ok |= 1 << index,
                Outcome::Failed | Outcome::Rejected => continue,
                Outcome::NotJudged => {
                    layout.not_judged |= 1 << index;
                    continue;
                }
            }
            let tip_error = measures.tip_error(row);
            if let Some(clearance) = measures.clearance(row)
                && layout.best_clearance.is_none_or(|best| clearance > best)
            {
                layout.best = Some(index);
                layout.best_clearance = Some(clearance);
                layout.best_tip_error = tip_error;
            }
            if let Some(error) = tip_error
                && layout.least_tip_error.is_none_or(|least| error < least)
            {
                layout.least_tip_error = Some(error);
            }
        }
        Some(layout)
    }

    /// Number of configurations that are ok.
    pub(crate) fn working(&self) -> usize {
        self.ok.count_ones() as usize
    }

    /// Number of configurations that are ok or were not evaluated.
    pub(crate) fn may_work(&self) -> usize {
        (self.ok | self.not_judged).count_ones() as usize
    }

    /// Whether a configuration is ok.
    pub(crate) fn works(&self, configuration: usize) -> bool {
        self.ok >> configuration & 1 == 1
    }
}

/// Which configuration of a layout is the best.
#[derive(Debug, Clone)]
pub struct BestConfiguration(Measures);

impl BestConfiguration {
    /// By the columns of a table.
    pub fn new(columns: &[MetricColumn]) -> Self {
        Self(Measures::new(columns))
    }

    /// Index of the configuration with the largest clearance of those that are ok, the first of equal
    /// ones; none where none is ok or the layout is invalid.
    pub fn of(&self, result: &CaseResult) -> Option<usize> {
        Layout::of(result, &self.0)?.best
    }
}

/// Whether a row's numbers are of a configuration that was not rejected.
pub(crate) fn has_numbers(row: &Row) -> bool {
    matches!(
        row.outcome,
        Outcome::Ok | Outcome::Failed | Outcome::NotJudged
    )
}

/// Visits all cases and rejects those that do not match the factors.
pub(crate) fn visit_checked(
    results: &dyn Results,
    mut visit: impl FnMut(&[FactorValue], &CaseResult),
) -> Result<(), ResultsError> {
    use crate::FactorKind;
    let factors = results.factors();
    let mut wrong: Option<String> = None;
    let mut seen = 0_u64;
    results.visit(&mut |values, result| {
        if wrong.is_some() {
            return;
        }
        let fits = values.len() == factors.len()
            && factors
                .iter()
                .zip(values)
                .all(|(factor, value)| match (&factor.kind, value) {
                    (FactorKind::Levels(levels), FactorValue::Level(level)) => {
                        *level < levels.len()
                    }
                    (FactorKind::Continuous { .. }, FactorValue::Number(number)) => {
                        number.is_finite()
                    }
                    _ => false,
                });
        if fits {
            seen += 1;
            visit(values, result);
        } else {
            wrong = Some(format!("case {} has invalid factor values", result.case));
        }
    })?;
    if wrong.is_none() && seen != results.cases() {
        wrong = Some(format!("{seen} cases instead of {}", results.cases()));
    }
    match wrong {
        None => Ok(()),
        Some(message) => Err(ResultsError {
            file: "results".to_owned(),
            message,
        }),
    }
}
