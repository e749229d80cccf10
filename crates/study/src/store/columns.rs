//! Rows of consecutive cases, column by column: what the journal and the tables hold.

use needlebench_kinematics::ik::Configuration;

use crate::{CaseResult, Factor, FactorKind, FactorValue, Outcome, Row};

/// Rows of a case.
pub(crate) const ROWS: usize = Configuration::ALL.len();

/// Values of a factor, one per case.
#[derive(Debug, Clone)]
pub(crate) enum FactorColumn {
    /// Indices of levels.
    Levels(Vec<u32>),
    /// Numbers of a continuum.
    Numbers(Vec<f64>),
}

impl FactorColumn {
    pub(crate) fn new(kind: &FactorKind) -> Self {
        match kind {
            FactorKind::Levels(_) => Self::Levels(Vec::new()),
            FactorKind::Continuous { .. } => Self::Numbers(Vec::new()),
        }
    }

    pub(crate) fn get(&self, index: usize) -> FactorValue {
        match self {
            Self::Levels(levels) => FactorValue::Level(levels[index] as usize),
            Self::Numbers(numbers) => FactorValue::Number(numbers[index]),
        }
    }

    fn same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Levels(a), Self::Levels(b)) => a == b,
            (Self::Numbers(a), Self::Numbers(b)) => {
                let bits = |number: &f64| number.to_bits();
                a.iter().map(bits).eq(b.iter().map(bits))
            }
            _ => false,
        }
    }

    fn push(&mut self, value: FactorValue) {
        match (self, value) {
            (Self::Levels(levels), FactorValue::Level(level)) => {
                levels.push(u32::try_from(level).expect("a factor has fewer than 2^32 levels"));
            }
            (Self::Numbers(numbers), FactorValue::Number(number)) => numbers.push(number),
            _ => panic!("a design gives the kind of value that its factor has"),
        }
    }

    fn extend(&mut self, other: &Self, range: std::ops::Range<usize>) {
        match (self, other) {
            (Self::Levels(to), Self::Levels(from)) => to.extend_from_slice(&from[range]),
            (Self::Numbers(to), Self::Numbers(from)) => to.extend_from_slice(&from[range]),
            _ => panic!("columns of one study have the same kinds"),
        }
    }
}

/// Some cases in the order of their numbers, [`ROWS`] rows each.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    /// Number of cases.
    pub(crate) cases: usize,
    /// In the order of the study's factors.
    pub(crate) factors: Vec<FactorColumn>,
    /// One per row, each an index into [`Outcome::ALL`].
    pub(crate) outcomes: Vec<u8>,
    /// One per row, each an index into `texts`.
    pub(crate) details: Vec<u32>,
    /// Texts, each once, in the order of their first row.
    pub(crate) texts: Vec<String>,
    /// One column per metric, one value per row; NaN where there is none.
    pub(crate) metrics: Vec<Vec<f32>>,
}

impl Columns {
    /// No cases of a study with so many metrics.
    pub(crate) fn new(factors: &[Factor], metrics: usize) -> Self {
        Self {
            cases: 0,
            factors: factors
                .iter()
                .map(|factor| FactorColumn::new(&factor.kind))
                .collect(),
            outcomes: Vec::new(),
            details: Vec::new(),
            texts: Vec::new(),
            metrics: vec![Vec::new(); metrics],
        }
    }

    /// Adds the next case.
    pub(crate) fn push(&mut self, values: &[FactorValue], result: &CaseResult) {
        assert_eq!(values.len(), self.factors.len(), "one value per factor");
        for (column, value) in self.factors.iter_mut().zip(values) {
            column.push(*value);
        }
        for (index, row) in result.rows.iter().enumerate() {
            let configuration = usize::from(row.configuration);
            assert_eq!(
                configuration, index,
                "rows are in the order of configurations"
            );
            self.outcomes.push(row.outcome as u8);
            let text = self.text(&row.detail);
            self.details.push(text);
            assert!(
                row.values.len() <= self.metrics.len(),
                "a row has no values beside the study's columns"
            );
            for (index, column) in self.metrics.iter_mut().enumerate() {
                column.push(row.values.get(index).copied().unwrap_or(f32::NAN));
            }
        }
        self.cases += 1;
    }

    /// Adds some cases of others of the same study.
    pub(crate) fn extend(&mut self, other: &Self, cases: std::ops::Range<usize>) {
        let rows = cases.start * ROWS..cases.end * ROWS;
        for (to, from) in self.factors.iter_mut().zip(&other.factors) {
            to.extend(from, cases.clone());
        }
        self.outcomes
            .extend_from_slice(&other.outcomes[rows.clone()]);
        // Texts are renumbered as they first appear, so that these columns are the same however
        // their cases were cut into blocks.
        let mut renumbered = vec![None; other.texts.len()];
        for text in &other.details[rows.clone()] {
            let text = *text as usize;
            let index = *renumbered[text].get_or_insert_with(|| self.text(&other.texts[text]));
            self.details.push(index);
        }
        for (to, from) in self.metrics.iter_mut().zip(&other.metrics) {
            to.extend_from_slice(&from[rows.clone()]);
        }
        self.cases += cases.len();
    }

    /// Index of a text.
    pub(crate) fn text(&mut self, text: &str) -> u32 {
        // A study has some dozen texts: rules and criteria.
        let index = self.texts.iter().position(|each| each == text);
        let index = index.unwrap_or_else(|| {
            self.texts.push(text.to_owned());
            self.texts.len() - 1
        });
        u32::try_from(index).expect("fewer texts than rows")
    }

    /// Whether both hold the same, to the last bit.
    pub(crate) fn same(&self, other: &Self) -> bool {
        let bits = |column: &Vec<f32>| {
            column
                .iter()
                .map(|value| value.to_bits())
                .collect::<Vec<_>>()
        };
        self.cases == other.cases
            && self
                .factors
                .iter()
                .zip(&other.factors)
                .all(|(a, b)| a.same(b))
            && self.outcomes == other.outcomes
            && self.texts == other.texts
            && self.details == other.details
            && self
                .metrics
                .iter()
                .map(bits)
                .eq(other.metrics.iter().map(bits))
    }

    /// A case of them, by its place, into what is used over and over.
    pub(crate) fn get(&self, place: usize, values: &mut Vec<FactorValue>, result: &mut CaseResult) {
        values.clear();
        values.extend(self.factors.iter().map(|column| column.get(place)));
        for (index, row) in result.rows.iter_mut().enumerate() {
            let at = place * ROWS + index;
            row.outcome = Outcome::ALL[usize::from(self.outcomes[at])];
            let detail = &self.texts[self.details[at] as usize];
            if row.detail != *detail {
                row.detail = detail.clone().into();
            }
            row.values.clear();
            row.values
                .extend(self.metrics.iter().map(|column| column[at]));
        }
    }
}

/// A case without content, for [`Columns::get`].
pub(crate) fn blank_case() -> CaseResult {
    CaseResult {
        case: 0,
        rows: std::array::from_fn(|index| {
            let configuration = u8::try_from(index).expect("eight configurations");
            Row::new(configuration, Outcome::Ok, "")
        }),
    }
}
