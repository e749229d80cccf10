//! A judged motion that leads to no goal: a case for each criterion.

use needlebench_bench::judge::free::FreeReport;
use quick_junit::{Report, SerializeError, TestSuite};

use super::replay::add_criteria;

/// The motion as a JUnit document.
///
/// # Errors
/// The document cannot be written.
pub fn free_junit(report: &FreeReport) -> Result<String, SerializeError> {
    let mut document = Report::new("needlebench");
    let name = format!("{}.motion.{}", report.scenario, report.source.file);
    let mut suite = TestSuite::new(name);
    add_criteria(&mut suite, &report.criteria, &report.not_judged);
    document.add_test_suite(suite);
    document.to_string()
}
