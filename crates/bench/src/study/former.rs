//! Results of studies of older versions, by today's names.

use needlebench_cell::study::StudyMode;
use needlebench_evaluation::metric::{FORMER_COLUMNS, FormerColumn, FormerRow, MetricKey};
use needlebench_study::{
    CaseResult, Factor, FactorValue, MetricColumn, ParquetResults, Results, ResultsError, Row,
};

use super::rows::metric_column;

/// Engines that had columns of their own.
const ENGINES: [&str; 2] = ["rapier", "mujoco"];

/// How rows were computed.
const KINDS: [FormerRow; 4] = [
    FormerRow::Static,
    FormerRow::Posture,
    FormerRow::Planned,
    FormerRow::Simulated,
];

/// A table of which nothing but the names of its columns is known, read as if today's program had
/// written it: each row by how it was computed.
pub struct FormerResults<'a> {
    results: &'a ParquetResults,
    mode: StudyMode,
    columns: Vec<MetricColumn>,
    /// For each kind of rows and each column the column of the table that holds it.
    places: [Vec<Option<usize>>; 4],
}

impl<'a> FormerResults<'a> {
    /// Of a table of an older version.
    pub fn new(results: &'a ParquetResults) -> Self {
        let mode = results.provenance()["mode"].as_str().unwrap_or_default();
        let modes = [StudyMode::Static, StudyMode::Planned, StudyMode::Dynamic];
        let mode = modes.into_iter().find(|known| known.name() == mode);
        let known: Vec<(usize, &FormerColumn)> = results
            .columns()
            .iter()
            .enumerate()
            .filter_map(|(index, column)| {
                let mut all = FORMER_COLUMNS.iter();
                Some((index, all.find(|former| former.name == column.name)?))
            })
            .collect();
        let held_by = |key: &str, kind: usize| {
            let mut known = known.iter();
            let found = known.find(|(_, former)| former.keys[kind] == Some(key));
            found.map(|(index, _)| *index)
        };
        let keys: Vec<MetricKey> = MetricKey::all(&ENGINES)
            .filter(|key| (0..KINDS.len()).any(|kind| held_by(&key.key(), kind).is_some()))
            .collect();
        Self {
            results,
            mode: mode.unwrap_or_default(),
            places: std::array::from_fn(|kind| {
                let keys = keys.iter();
                keys.map(|key| held_by(&key.key(), kind)).collect()
            }),
            columns: keys.iter().map(metric_column).collect(),
        }
    }

    /// What its columns are called today, where they have another name.
    pub fn note(&self, source: &str) -> String {
        let kind = match self.mode {
            StudyMode::Static => FormerRow::Static,
            StudyMode::Planned => FormerRow::Planned,
            StudyMode::Dynamic => FormerRow::Simulated,
        };
        let renamed: Vec<String> = self
            .columns
            .iter()
            .zip(&self.places[kind as usize])
            .filter(|(column, _)| column.spread)
            .filter_map(|(column, place)| {
                let before = &self.results.columns()[(*place)?].name;
                (*before != column.name).then(|| format!("`{before}` as `{}`", column.name))
            })
            .collect();
        format!(
            "{source} is of an older version: its {} cases are compared by what their numbers are called \
             today, {}",
            self.mode.name(),
            renamed.join(", ")
        )
    }

    fn row(&self, row: &Row) -> Row {
        let columns = self.results.columns();
        let kind = FormerRow::of(self.mode, |name| {
            let mut places = columns.iter();
            let place = places.position(|column| column.name == name);
            place.is_some_and(|place| row.get(place).is_some())
        });
        let places = self.places[kind as usize].iter();
        let mut made = Row::new(row.configuration, row.outcome, row.detail.clone());
        made.values = places
            .map(|place| place.and_then(|place| row.get(place)).unwrap_or(f32::NAN))
            .collect();
        made
    }
}

impl Results for FormerResults<'_> {
    fn factors(&self) -> &[Factor] {
        self.results.factors()
    }

    fn columns(&self) -> &[MetricColumn] {
        &self.columns
    }

    fn cases(&self) -> u64 {
        self.results.cases()
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(&[FactorValue], &CaseResult),
    ) -> Result<(), ResultsError> {
        self.results.visit(&mut |values, result| {
            let renamed = CaseResult {
                case: result.case,
                rows: result.rows.each_ref().map(|row| self.row(row)),
            };
            visit(values, &renamed);
        })
    }
}
