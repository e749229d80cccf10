//! The results as one document: `paper.json`.

use needlebench_evaluation::report::{Provenance, Verdict as Outcome};
use serde::Serialize;

use super::accuracy::AccuracyRow;
use super::convergence::ConvergenceReport;
use super::equations::differential::TurnReport;
use super::equations::{EquationReport, Verdict};
use super::free_space::FreeSpaceReport;
use super::solver::{CountReport, VariantReport};
use super::table_3::Table3Report;
use super::timing::Timings;
use needlebench_report::number::percent;

/// Version of the keys.
const SCHEMA_VERSION: u32 = 1;

/// One thing that has to be so.
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

/// Everything that was reproduced. SI units; shares are 0 to 1; a figure that is no number is null.
#[derive(Debug, Clone, Serialize)]
pub struct PaperReport {
    /// Version of this layout.
    pub schema_version: u32,
    /// The paper.
    pub paper: Citation,
    /// Whether all checks are met.
    pub verdict: Outcome,
    /// What is checked.
    pub checks: Vec<Check>,
    /// Table 3 beside its recomputation.
    pub table_3: Table3Report,
    /// Each equation as printed and as corrected.
    pub equations: Vec<EquationReport>,
    /// Equation 45 as printed, by angle.
    pub equation_45: Vec<TurnReport>,
    /// The closed form with some equations as printed.
    pub solver_variants: Vec<VariantReport>,
    /// How many solutions poses have.
    pub solution_counts: CountReport,
    /// Errors of both methods.
    pub accuracy: Vec<AccuracyRow>,
    /// Convergence of the numerical method.
    pub convergence: ConvergenceReport,
    /// Figure 6 in numbers.
    pub free_space: FreeSpaceReport,
    /// Files written beside this one.
    pub files: Vec<String>,
    /// Where the numbers come from.
    pub provenance: Provenance,
    /// Times; the only part that differs between two runs.
    pub timings: Timings,
}

/// What the stages of a run have found.
pub(super) struct Findings {
    pub table_3: Table3Report,
    pub equations: Vec<EquationReport>,
    pub equation_45: Vec<TurnReport>,
    pub solver_variants: Vec<VariantReport>,
    pub solution_counts: CountReport,
    pub accuracy: Vec<AccuracyRow>,
    pub convergence: ConvergenceReport,
    pub free_space: FreeSpaceReport,
    pub provenance: Provenance,
    pub timings: Timings,
}

impl PaperReport {
    pub(super) fn new(findings: Findings) -> Self {
        let checks = checks(&findings);
        let verdict = if checks.iter().all(|check| check.pass) {
            Outcome::Pass
        } else {
            Outcome::Fail
        };
        Self {
            schema_version: SCHEMA_VERSION,
            paper: Citation {
                authors: "O. Abdelaziz, M. Luo, G. Jiang and S. Chen",
                title: "Multiple configurations for puncturing robot positioning",
            },
            verdict,
            checks,
            table_3: findings.table_3,
            equations: findings.equations,
            equation_45: findings.equation_45,
            solver_variants: findings.solver_variants,
            solution_counts: findings.solution_counts,
            accuracy: findings.accuracy,
            convergence: findings.convergence,
            free_space: findings.free_space,
            files: Vec::new(),
            provenance: findings.provenance,
            timings: findings.timings,
        }
    }

    /// Whether everything is as it has to be.
    pub fn passes(&self) -> bool {
        self.verdict == Outcome::Pass
    }
}

/// Sampling error of a share over some ten thousand correlated answers.
const SHARE: f64 = 0.015;

fn checks(findings: &Findings) -> Vec<Check> {
    let table = &findings.table_3;
    let broken = |keeps: fn(&EquationReport) -> bool| {
        let numbers: Vec<&str> = findings
            .equations
            .iter()
            .filter(|equation| !keeps(equation))
            .map(|equation| equation.number)
            .collect();
        numbers.join(", ")
    };
    let not_holding = broken(|equation| equation.holds);
    let not_confirmed = broken(|equation| {
        (equation.verdict == Verdict::Right) == (equation.printed.failing == 0.0)
    });
    let off: Vec<&str> = findings
        .solver_variants
        .iter()
        .filter(|variant| (variant.right - variant.expected).abs() > SHARE)
        .map(|variant| variant.name)
        .collect();
    let complete = findings
        .solver_variants
        .last()
        .is_some_and(|mended| mended.right == 1.0 && mended.finds_the_joints == 1.0);
    let or_none = |text: String| {
        if text.is_empty() {
            "none".to_owned()
        } else {
            text
        }
    };
    vec![
        Check {
            name: "Table 3 is reproduced",
            pass: table.matches,
            detail: format!(
                "largest difference {:.1e} rad of {:.0e} rad allowed",
                table.largest_difference_rad, table.tolerance_rad
            ),
        },
        Check {
            name: "labels of rows 3 to 6 are swapped, those of the others right",
            pass: table.swapped_rows == [3, 4, 5, 6],
            detail: format!("swapped: {:?}", table.swapped_rows),
        },
        Check {
            name: "every corrected equation holds within its tolerance",
            pass: not_holding.is_empty(),
            detail: format!("broken: {}", or_none(not_holding)),
        },
        Check {
            name: "an equation called right never fails as printed, another does",
            pass: not_confirmed.is_empty(),
            detail: format!("not confirmed: {}", or_none(not_confirmed)),
        },
        Check {
            name: "solver variants are right as often as the errata say",
            pass: off.is_empty(),
            detail: format!("off by more than {SHARE}: {}", or_none(off.join(", "))),
        },
        Check {
            name: "the corrected solver is always right and finds the joints that made the pose",
            pass: complete,
            detail: findings
                .solver_variants
                .last()
                .map_or_else(String::new, |mended| {
                    format!(
                        "right {}, found for {} of poses",
                        percent(mended.right),
                        percent(mended.finds_the_joints)
                    )
                }),
        },
    ]
}
