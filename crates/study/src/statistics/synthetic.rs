//! Results with known true values.

use crate::{
    CaseResult, Factor, FactorKind, FactorValue, Level, Measure, MetricColumn, Outcome, Results,
    ResultsError, Role, Row,
};

type Case = dyn Fn(u64) -> (Vec<FactorValue>, [Row; 8]) + Send + Sync;

/// The columns of [`ok`]: clearance, tip error, and one that no row has.
pub(crate) fn columns() -> [MetricColumn; 3] {
    let column = |key: &str, words: &str, more_is_better, measure, criterion: &str| MetricColumn {
        name: format!("{key}_mm"),
        key: key.to_owned(),
        words: words.to_owned(),
        description: format!("{words}, mm"),
        unit: "mm".to_owned(),
        more_is_better: Some(more_is_better),
        spread: true,
        by_case: true,
        measure,
        criterion: Some(criterion.to_owned()),
    };
    let (clearance, error) = (Some(Measure::Clearance), Some(Measure::TipError));
    [
        column(
            "clearance",
            "clearance",
            true,
            clearance,
            "min_clearance_mm",
        ),
        column("tip_error", "tip error", false, error, "max_tip_error_mm"),
        column("tip_rms", "rms tip error", false, None, "max_tip_rms_mm"),
    ]
}

/// Results that are made when they are read.
pub(crate) struct Synthetic {
    pub columns: Vec<MetricColumn>,
    pub factors: Vec<Factor>,
    pub cases: u64,
    pub case: Box<Case>,
}

impl Results for Synthetic {
    fn factors(&self) -> &[Factor] {
        &self.factors
    }

    fn columns(&self) -> &[MetricColumn] {
        &self.columns
    }

    fn cases(&self) -> u64 {
        self.cases
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(&[FactorValue], &CaseResult),
    ) -> Result<(), ResultsError> {
        for case in 0..self.cases {
            let (values, rows) = (self.case)(case);
            visit(&values, &CaseResult { case, rows });
        }
        Ok(())
    }
}

pub(crate) fn levels(name: &str, role: Role, labels: &[&str]) -> Factor {
    let level = |label: &&str| Level {
        label: (*label).to_owned(),
        number: label.parse().ok(),
    };
    Factor {
        name: name.to_owned(),
        unit: String::new(),
        role,
        sampled: false,
        kind: FactorKind::Levels(labels.iter().map(level).collect()),
    }
}

pub(crate) fn goal() -> Factor {
    levels("goal", Role::Noise, &["lesion"])
}

pub(crate) fn continuous(name: &str, role: Role, low: f64, high: f64) -> Factor {
    Factor {
        name: name.to_owned(),
        unit: "mm".to_owned(),
        role,
        sampled: false,
        kind: FactorKind::Continuous { low, high },
    }
}

/// Eight rejected rows.
pub(crate) fn rejected() -> [Row; 8] {
    std::array::from_fn(|index| {
        let index = u8::try_from(index).unwrap();
        Row::new(index, Outcome::Rejected, "unreachable")
    })
}

/// A row that is ok.
pub(crate) fn ok(index: u8, clearance_mm: f64, tip_error_mm: f64) -> Row {
    Row::new(index, Outcome::Ok, "")
        .with_values([Some(clearance_mm), Some(tip_error_mm)].into_iter())
}

/// A number in (0, 1) that depends on a seed, a case and a column alone.
pub(crate) fn uniform(seed: u64, case: u64, column: u64) -> f64 {
    use needlebench_numerics::random::SplitMix64;
    let mut random = SplitMix64::new(seed ^ case.wrapping_mul(0x9e37_79b9) ^ column << 48);
    random.next_u64();
    random.uniform(0.0, 1.0)
}
