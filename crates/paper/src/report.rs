//! The results as one document: `paper.json`.

use needlebench_evaluation::report::{Provenance, Verdict as Outcome};
use needlebench_show::number::percent;
use serde::Serialize;

use super::accuracy::AccuracyRow;
use super::convergence::ConvergenceReport;
use super::equations::{EquationReport, TurnReport};
use super::free_space::FreeSpaceReport;
use super::solver::{CountReport, VariantReport};
use super::table_3::Table3Report;
use super::timing::Timings;

/// A requirement and its result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    pub name: &'static str,
    pub pass: bool,
    pub detail: String,
}

/// The paper, as a citation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Citation {
    pub authors: &'static str,
    pub title: &'static str,
}

/// All results. SI units; shares are 0 to 1; values that are not numbers are null.
#[derive(Debug, Clone, Serialize)]
pub struct PaperReport {
    /// Version of this layout.
    pub schema_version: u32,
    /// The paper.
    pub paper: Citation,
    /// Whether all checks are met.
    pub verdict: Outcome,
    /// The checks.
    pub checks: Vec<Check>,
    /// Table 3, with its recomputation.
    pub table_3: Table3Report,
    /// Each equation as printed and as corrected.
    pub equations: Vec<EquationReport>,
    /// Equation 45 as printed, by angle.
    pub equation_45: [TurnReport; 3],
    /// The closed form with some equations as printed.
    pub solver_variants: Vec<VariantReport>,
    /// Numbers of solutions of poses.
    pub solution_counts: CountReport,
    /// Errors of both methods.
    pub accuracy: Vec<AccuracyRow>,
    /// Convergence of the numerical method.
    pub convergence: ConvergenceReport,
    /// Figure 6 in numbers.
    pub free_space: FreeSpaceReport,
    /// Other written files.
    pub files: Vec<String>,
    /// Provenance of the results.
    pub provenance: Provenance,
    /// Times; the only part that differs between two runs.
    pub timings: Timings,
}

/// Sampling error of a share over some ten thousand correlated answers.
const SHARE: f64 = 0.015;

impl PaperReport {
    /// Whether all requirements are met.
    pub fn passes(&self) -> bool {
        self.verdict == Outcome::Pass
    }

    /// The requirements.
    pub(super) fn checks(&self) -> Vec<Check> {
        let table = &self.table_3;
        let broken = |keeps: fn(&EquationReport) -> bool| {
            let broken = self.equations.iter().filter(|equation| !keeps(equation));
            broken.map(|equation| &*equation.number).collect::<Vec<_>>()
        };
        let not_holding = broken(|equation| equation.holds);
        let not_confirmed =
            broken(|equation| (equation.verdict == "right") == (equation.printed.failing == 0.0));
        let variants = self.solver_variants.iter();
        let off = variants.filter(|variant| (variant.right - variant.expected).abs() > SHARE);
        let off: Vec<&str> = off.map(|variant| variant.name).collect();
        let mended = self
            .solver_variants
            .last()
            .expect("variants end with the mended one");
        let list = |names: &[&str]| {
            if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            }
        };
        let check = |name, pass, detail| Check { name, pass, detail };
        vec![
            check(
                "Table 3 is reproduced",
                table.matches,
                format!(
                    "largest difference {:.1e} rad, limit {:.0e} rad",
                    table.largest_difference_rad, table.tolerance_rad
                ),
            ),
            check(
                "labels of rows 3 to 6 are swapped, those of the others correct",
                table.swapped_rows == [3, 4, 5, 6],
                format!("swapped: {:?}", table.swapped_rows),
            ),
            check(
                "every corrected equation is within its tolerance",
                not_holding.is_empty(),
                format!("violated: {}", list(&not_holding)),
            ),
            check(
                "printed equations fail if and only if they are not marked right",
                not_confirmed.is_empty(),
                format!("not confirmed: {}", list(&not_confirmed)),
            ),
            check(
                "solver variants have the success rates of the errata",
                off.is_empty(),
                format!("difference above {SHARE}: {}", list(&off)),
            ),
            check(
                "the corrected solver is always correct and finds the joints of the pose",
                mended.right == 1.0 && mended.finds_the_joints == 1.0,
                format!(
                    "correct {}, found for {} of poses",
                    percent(mended.right),
                    percent(mended.finds_the_joints)
                ),
            ),
        ]
    }
}
