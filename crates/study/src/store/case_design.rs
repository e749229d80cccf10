//! What a study's files need to know of its design.

use crate::{Design, Factor, FactorValue};

/// What the runner needs of a design.
pub trait CaseDesign: Sync {
    /// The factors, in the order of their columns.
    fn factors(&self) -> &[Factor];

    /// Number of cases.
    fn cases(&self) -> u64;

    /// Values of all factors in a case.
    fn values(&self, case: u64) -> Vec<FactorValue>;
}

impl CaseDesign for Design {
    fn factors(&self) -> &[Factor] {
        self.factors()
    }

    fn cases(&self) -> u64 {
        self.cases()
    }

    fn values(&self, case: u64) -> Vec<FactorValue> {
        self.values(case)
    }
}
