//! From a table of any length to columns of bounded length.

use std::collections::BTreeMap;

use needlebench_evaluation::metric::{MetricKey, Precision};
use needlebench_numerics::random::SplitMix64;
use needlebench_study::{
    FactorKind, FactorValue, MetricColumn, Outcome, Results, ResultsError, Row,
};

/// Cases on a page.
pub(super) const MOST_CASES: u64 = 100_000;
/// Cases that are on the page because the statistics name them.
pub(super) const MOST_NOTED: usize = 2_000;
/// Cases on a page that have the postures of all rows.
const MOST_POSED: usize = 4_000;
/// Bytes that the columns of a page may take; base64 makes a third more of them, and scripts and
/// surfaces add less than a megabyte: together below 10 MB.
const MOST_BYTES: usize = 6_600_000;
/// Levels of a factor, and kinds of outcome, that fit in a byte.
pub(super) const LABELLED: usize = 255;
/// Steps that the range of a column is cut into: twelve bits and eight, some of them for what is
/// missing.
const FINE_STEPS: u16 = 4094;
const COARSE_STEPS: u16 = 254;
/// Configurations.
const ROWS: usize = 8;

/// What the page takes of a table's columns.
pub(super) struct Taken {
    /// Indices of the metrics of every row, with their steps.
    metrics: Vec<(usize, u16)>,
    /// Indices of the six joints, of each kind of cases that has them.
    joints: Vec<[usize; 6]>,
}

impl Taken {
    /// The metrics that the table of metrics has on the page.
    pub fn new(columns: &[MetricColumn]) -> Self {
        let keys = columns
            .iter()
            .map(|column| MetricKey::named(&column.key, &[]));
        let metrics = keys
            .enumerate()
            .filter_map(|(index, key)| {
                let steps = match key?.statistics().page? {
                    Precision::Fine => FINE_STEPS,
                    Precision::Coarse => COARSE_STEPS,
                };
                Some((index, steps))
            })
            .collect();
        let place = |key: &str| columns.iter().position(|column| column.key == key);
        let joints = ["_static", ""].into_iter().filter_map(|end| {
            let found: Vec<usize> = (1..=6)
                .filter_map(|joint| place(&format!("q{joint}{end}")))
                .collect();
            found.try_into().ok()
        });
        Self {
            metrics,
            joints: joints.collect(),
        }
    }

    /// Bytes of the metrics of a row.
    fn bytes_per_row(&self) -> usize {
        let fine = self.metrics.iter().filter(|(_, steps)| *steps > 255);
        let fine = fine.count();
        (3 * fine).div_ceil(2) + self.metrics.len() - fine
    }

    /// Positions of the joints, deg; NaN of a row without a posture.
    fn joints_deg(&self, row: &Row) -> [f32; 6] {
        let mut all = self.joints.iter();
        let found = all.find(|joints| row.get(joints[0]).is_some());
        found.map_or([f32::NAN; 6], |joints| {
            joints.map(|joint| row.get(joint).unwrap_or(f32::NAN))
        })
    }
}

/// Columns of the cases that are kept. Those of rows go configuration by configuration.
pub(super) struct Columns {
    /// Numbers of the cases.
    pub cases: Vec<u64>,
    /// By factor: index of a level, or the number.
    pub factors: Vec<Vec<f32>>,
    /// Indices into `outcome_names`.
    pub outcomes: Vec<u8>,
    /// `[outcome, detail]`.
    pub outcome_names: Vec<[String; 2]>,
    /// Those that any row has, by the index of their column, with their steps.
    pub metrics: Vec<(usize, u16, Vec<f32>)>,
    /// Indices of the cases that have postures.
    pub posed: Vec<u32>,
    /// Six joints of eight rows of each of those, deg.
    pub joints_deg: Vec<f32>,
}

/// Which cases are kept: one sampled from each block by a fixed rule, so that a cycle of the design is not
/// met always at the same place; and those that are noted.
struct Chosen {
    block: u64,
    cases: u64,
    noted: Vec<u64>,
}

impl Chosen {
    fn new(cases: u64, bytes_per_case: usize, noted: &[u64]) -> Self {
        let fits = (MOST_BYTES / bytes_per_case) as u64;
        let most = MOST_CASES.min(fits).max(1);
        let block = cases.div_ceil(most).max(1);
        Self {
            block,
            cases,
            noted: noted.to_vec(),
        }
    }

    fn has(&self, case: u64) -> bool {
        let start = case - case % self.block;
        let length = self.block.min(self.cases - start);
        // The seed is the block's number: the draw needs no memory.
        let drawn = SplitMix64::new(start / self.block).next_u64() % length;
        case - start == drawn || self.noted.binary_search(&case).is_ok()
    }
}

impl Columns {
    /// Reads the whole table once; memory does not grow with it.
    pub fn read(results: &dyn Results, noted: &[u64]) -> Result<Self, ResultsError> {
        let factors = results.factors();
        let factor_bytes: usize = factors
            .iter()
            .map(|factor| match &factor.kind {
                FactorKind::Levels(levels) if levels.len() <= LABELLED => 1,
                _ => 2,
            })
            .sum();
        let taken = Taken::new(results.columns());
        // Outcome and metrics in each row; the number of the case.
        let bytes_per_case = factor_bytes + ROWS * (1 + taken.bytes_per_row()) + 4;
        let chosen = Chosen::new(results.cases(), bytes_per_case, noted);
        let blocks = results.cases().div_ceil(chosen.block);
        let kept = usize::try_from(blocks).expect("100 000 at most") + noted.len();
        // Noted cases have postures in any case.
        let pose_every = kept.div_ceil(MOST_POSED - MOST_NOTED).max(1);
        let mut reader = Reader {
            cases: Vec::new(),
            factors: vec![Vec::new(); factors.len()],
            outcomes: Default::default(),
            names: BTreeMap::new(),
            metrics: vec![Default::default(); taken.metrics.len()],
            taken,
            posed: Vec::new(),
            joints_deg: Vec::new(),
        };
        results.visit(&mut |values, result| {
            if chosen.has(result.case) {
                let is_noted = chosen.noted.binary_search(&result.case).is_ok();
                let posed = is_noted || reader.cases.len().is_multiple_of(pose_every);
                reader.push(values, result.case, &result.rows, posed);
            }
        })?;
        Ok(reader.finish())
    }
}

struct Reader {
    taken: Taken,
    cases: Vec<u64>,
    factors: Vec<Vec<f32>>,
    outcomes: [Vec<u8>; ROWS],
    names: BTreeMap<(Outcome, String), u8>,
    metrics: Vec<[Vec<f32>; ROWS]>,
    posed: Vec<u32>,
    joints_deg: Vec<f32>,
}

impl Reader {
    #[expect(clippy::cast_possible_truncation, reason = "for plots")]
    fn push(&mut self, values: &[FactorValue], case: u64, rows: &[Row; ROWS], posed: bool) {
        if posed {
            let index = u32::try_from(self.cases.len()).expect("100 000 cases at most");
            self.posed.push(index);
            for row in rows {
                self.joints_deg.extend(self.taken.joints_deg(row));
            }
        }
        self.cases.push(case);
        for (column, value) in self.factors.iter_mut().zip(values) {
            column.push(match value {
                FactorValue::Level(level) => *level as f32,
                FactorValue::Number(number) => *number as f32,
            });
        }
        for (index, row) in rows.iter().enumerate() {
            let code = self.code(row);
            self.outcomes[index].push(code);
            for ((metric, _), columns) in self.taken.metrics.iter().zip(&mut self.metrics) {
                columns[index].push(row.get(*metric).unwrap_or(f32::NAN));
            }
        }
    }

    /// Code of what became of a row; the 250th kind of an outcome and all further ones are one.
    fn code(&mut self, row: &Row) -> u8 {
        const MOST_KINDS: usize = LABELLED - Outcome::ALL.len();
        let key = (row.outcome, row.detail.to_string());
        if let Some(&code) = self.names.get(&key) {
            return code;
        }
        let key = if self.names.len() < MOST_KINDS {
            key
        } else {
            (row.outcome, "other".to_owned())
        };
        let next = u8::try_from(self.names.len()).expect("at most 255 kinds");
        *self.names.entry(key).or_insert(next)
    }

    fn finish(self) -> Columns {
        let mut outcome_names = vec![[String::new(), String::new()]; self.names.len()];
        for ((outcome, detail), code) in self.names {
            outcome_names[usize::from(code)] = [outcome.name().to_owned(), detail];
        }
        let metrics = self
            .taken
            .metrics
            .into_iter()
            .zip(self.metrics)
            .map(|((metric, steps), columns)| (metric, steps, columns.concat()))
            .filter(|(_, _, values)| values.iter().any(|value| !value.is_nan()))
            .collect();
        Columns {
            cases: self.cases,
            factors: self.factors,
            outcomes: self.outcomes.concat(),
            outcome_names,
            metrics,
            posed: self.posed,
            joints_deg: self.joints_deg,
        }
    }
}

/// Indices of levels in a byte each.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "indices of at most 255 levels"
)]
pub(super) fn narrow(values: &[f32]) -> Vec<u8> {
    values.iter().map(|value| *value as u8).collect()
}

/// Indices of levels; the 65536th level and all further ones are one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates"
)]
pub(super) fn codes(values: &[f32]) -> Vec<u16> {
    values.iter().map(|value| *value as u16).collect()
}
