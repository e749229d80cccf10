//! A study without physics: as many digits and gaps as a real one, at once or as slow as one likes.

use std::time::Duration;

use needlebench_numerics::random::SplitMix64;
use needlebench_study::{
    CaseDesign, CaseError, CaseEvaluator, CaseResult, CaseWorker, Factor, FactorKind, FactorValue,
    Level, Manifest, MetricColumn, Outcome, Role, Row,
};

/// Two goals, three sizes, three tools, one angle that is drawn; cases run through them in turn.
pub struct SyntheticDesign {
    factors: Vec<Factor>,
    cases: u64,
}

impl SyntheticDesign {
    pub fn new(cases: u64) -> Self {
        let factor = |name: &str, unit: &str, role, kind| Factor {
            name: name.to_owned(),
            unit: unit.to_owned(),
            role,
            sampled: false,
            kind,
        };
        let labels = |labels: &[&str]| {
            let levels = labels.iter().map(|label| Level {
                label: (*label).to_owned(),
                number: None,
            });
            FactorKind::Levels(levels.collect())
        };
        let sizes = [0.9, 1.0, 1.1].map(|number: f64| Level {
            label: number.to_string(),
            number: Some(number),
        });
        Self {
            factors: vec![
                factor("goal", "", Role::Noise, labels(&["lung", "liver"])),
                factor(
                    "phantom_size",
                    "",
                    Role::Noise,
                    FactorKind::Levels(sizes.to_vec()),
                ),
                factor(
                    "tool",
                    "",
                    Role::Control,
                    labels(&["short", "long, \"thin\"", "bent"]),
                ),
                factor(
                    "tilt_deg",
                    "deg",
                    Role::Noise,
                    FactorKind::Continuous {
                        low: -5.0,
                        high: 5.0,
                    },
                ),
            ],
            cases,
        }
    }

    pub fn manifest(&self, block_cases: u32) -> Manifest {
        let provenance = serde_json::json!({
            "program": { "name": "needlebench", "version": "0.1.0" },
            "note": "drawn, not simulated: \u{3b1} = 0.1",
        });
        Manifest::new(
            "5eed",
            "synthetic",
            self,
            columns(),
            block_cases,
            provenance,
        )
    }
}

impl CaseDesign for SyntheticDesign {
    fn factors(&self) -> &[Factor] {
        &self.factors
    }

    fn cases(&self) -> u64 {
        self.cases
    }

    fn values(&self, case: u64) -> Vec<FactorValue> {
        let level = |count: u64, step: u64| {
            FactorValue::Level(usize::try_from(case / step % count).unwrap())
        };
        // The same tilts for all levels, as in a crossed design.
        let tilt = SplitMix64::new(case / 18).uniform(-5.0, 5.0);
        vec![
            level(2, 1),
            level(3, 2),
            level(3, 6),
            FactorValue::Number(tilt),
        ]
    }
}

/// Draws rows: a third rejected, of those half without any number, the rest with all that a static
/// case has, every one with a full mantissa.
pub struct SyntheticEvaluator {
    /// How long a case takes.
    pub delay: Duration,
    /// A case in which the environment fails.
    pub failing: Option<u64>,
}

impl SyntheticEvaluator {
    pub const FAST: Self = Self {
        delay: Duration::ZERO,
        failing: None,
    };
}

impl CaseEvaluator for SyntheticEvaluator {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        Box::new(SyntheticWorker(self))
    }
}

struct SyntheticWorker<'a>(&'a SyntheticEvaluator);

impl CaseWorker for SyntheticWorker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        if self.0.failing == Some(case) {
            return Err(CaseError {
                case,
                message: "the engine has left".to_owned(),
            });
        }
        std::thread::sleep(self.0.delay);
        let mut random = SplitMix64::new(case);
        let rows = std::array::from_fn(|configuration| row(configuration, &mut random));
        Ok(CaseResult { case, rows })
    }
}

fn row(configuration: usize, random: &mut SplitMix64) -> Row {
    let index = u8::try_from(configuration).unwrap();
    let (outcome, detail) = match random.uniform(0.0, 6.0) {
        ..1.0 => return Row::new(index, Outcome::Rejected, "unreachable"),
        ..2.0 => (Outcome::Rejected, "collision robot_phantom"),
        ..2.5 => (Outcome::Failed, "max_tip_position_error_mm"),
        _ => (Outcome::Ok, ""),
    };
    let values = (0..COLUMNS).map(|column| {
        let scale = 10.0 + 5.0 * f64::from(column) + configuration as f64;
        (column < FILLED).then(|| random.uniform(-0.3, 1.0) * scale)
    });
    Row::new(index, outcome, detail).with_values(values)
}

/// Columns of the table, and how many of them rows have: the rest is what only motions and engines
/// give.
const COLUMNS: u8 = 37;
const FILLED: u8 = 29;

/// Made-up columns, the first of which is the clearance.
pub fn columns() -> Vec<MetricColumn> {
    let name = |column: u8| match column {
        0 => "clearance_static_mm".to_owned(),
        _ => format!("metric_{column}"),
    };
    (0..COLUMNS)
        .map(|column| MetricColumn {
            name: name(column),
            key: name(column),
            words: format!("metric {column}"),
            description: format!("number {column} of those that are made up"),
            unit: "mm".to_owned(),
            more_is_better: None,
            spread: false,
            by_case: false,
            measure: None,
            criterion: None,
        })
        .collect()
}
