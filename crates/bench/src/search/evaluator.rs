//! The rows of a generation's cases.

use needlebench_patient::ct::{LastScan, scanned};
use needlebench_scenario::study::StudyMode;
use needlebench_scenario::study::search::ObjectiveName;
use needlebench_study::search::GenerationDesign;
use needlebench_study::{CaseDesign as _, CaseError, CaseEvaluator, CaseResult, CaseWorker};

use super::PreparedSearch;
use crate::study::{StaticWorker, StudyCase, counted_classes, rows_without_scenario};

/// Computes the cases of a generation: final postures.
pub struct GenerationEvaluator<'a> {
    /// The search.
    pub search: &'a PreparedSearch,
    /// The generation.
    pub design: GenerationDesign<'a>,
}

impl CaseEvaluator for GenerationEvaluator<'_> {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        Box::new(Worker {
            of: self,
            postures: StaticWorker::counting(counted_classes(&self.search.study))
                .expecting_tip(self.search.expects(ObjectiveName::TipError))
                .asking(self.search.likely()),
            scan: LastScan::default(),
        })
    }
}

struct Worker<'a> {
    of: &'a GenerationEvaluator<'a>,
    postures: StaticWorker,
    scan: LastScan,
}

impl CaseWorker for Worker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        let study = &self.of.search.study;
        let layout = StudyCase::of_values(study, case, self.of.design.values(case));
        let rows = match layout
            .scenario(study)
            .and_then(|resolved| scanned(resolved, study.family.overrides(), &mut self.scan))
        {
            Err(findings) => rows_without_scenario(&findings, StudyMode::Static),
            Ok(resolved) => self.postures.rows(&resolved),
        };
        Ok(CaseResult {
            case,
            rows: self.of.search.columns.rows(&rows),
        })
    }
}
