//! A study's table that is made as it is read, for tests of its page and for the page that a browser opens.

use std::borrow::Cow;

use needlebench_bench::study::StudyColumns;
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::study::StudyMode;
use needlebench_study::{
    CaseResult, Factor, FactorKind, FactorValue, Level, MetricColumn, Outcome, Results,
    ResultsError, Role, Row,
};

/// A table that is made as it is read: two goals, a tool, a level of calibration and six numbers.
pub struct Synthetic {
    pub columns: Vec<MetricColumn>,
    pub factors: Vec<Factor>,
    pub cases: u64,
}

impl Synthetic {
    pub fn new(cases: u64) -> Self {
        let levels = |name: &str, labels: &[&str], role| Factor {
            name: name.to_owned(),
            unit: String::new(),
            role,
            sampled: false,
            kind: FactorKind::Levels(
                labels
                    .iter()
                    .map(|label| Level {
                        label: (*label).to_owned(),
                        number: None,
                    })
                    .collect(),
            ),
        };
        let number = |name: &str, unit: &str, low, high| Factor {
            name: name.to_owned(),
            unit: unit.to_owned(),
            role: Role::Noise,
            sampled: false,
            kind: FactorKind::Continuous { low, high },
        };
        let factors = vec![
            levels(
                "goal",
                &["left_upper_anterior", "right_pleural_lateral"],
                Role::Noise,
            ),
            levels(
                "tool",
                &["perpendicular", "inline", "offset </script>"],
                Role::Control,
            ),
            number("phantom_x", "mm", -60.0, 60.0),
            number("phantom_y", "mm", -60.0, 60.0),
            number("phantom_yaw", "deg", -15.0, 15.0),
            number("chest_depth", "mm", 190.0, 280.0),
            number("base_x", "mm", -100.0, 100.0),
            number("base_y", "mm", -100.0, 100.0),
        ];
        let columns = StudyColumns::new(&[StudyMode::Static], &[]).described();
        Self {
            columns,
            factors,
            cases,
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "columns of single precision"
    )]
    pub fn case(&self, case: u64) -> (Vec<FactorValue>, CaseResult) {
        let mut random = SplitMix64::new(case / 6);
        let mut values = vec![
            FactorValue::Level((case % 2) as usize),
            FactorValue::Level((case / 2 % 3) as usize),
        ];
        let mut numbers = Vec::new();
        for factor in &self.factors[2..] {
            let FactorKind::Continuous { low, high } = factor.kind else {
                continue;
            };
            let number = random.uniform(low, high);
            numbers.push((number - low) / (high - low) - 0.5);
            values.push(FactorValue::Number(number));
        }
        let tool = (case / 2 % 3) as f64;
        let mut noise = SplitMix64::new(case);
        let rows = std::array::from_fn(|index| {
            let side = if index % 2 == 0 { 1.0 } else { -1.0 };
            let reach = numbers[0] * side + 0.5 * numbers[1] - 0.3 * numbers[2] * numbers[5];
            let clearance_mm =
                25.0 + 60.0 * reach - 8.0 * tool - 4.0 * index as f64 + noise.uniform(-4.0, 4.0);
            let outcome = if numbers[3] > 0.49 {
                Outcome::Invalid
            } else if clearance_mm < 0.0 {
                Outcome::Rejected
            } else if clearance_mm < 6.0 {
                Outcome::Failed
            } else {
                Outcome::Ok
            };
            let detail = match outcome {
                Outcome::Ok => "",
                Outcome::Failed | Outcome::NotJudged => "min_clearance_mm.robot_phantom",
                Outcome::Rejected => "collision robot_phantom",
                Outcome::Invalid => "phantom.position_mm",
            };
            let index = u8::try_from(index).unwrap();
            let mut row = Row::new(index, outcome, Cow::Borrowed(detail));
            if outcome != Outcome::Invalid {
                row.values = vec![f32::NAN; self.columns.len()];
                let mut set = |key: &str, value: f64| {
                    let mut columns = self.columns.iter();
                    let place = columns.position(|column| column.key == key).unwrap();
                    row.values[place] = value as f32;
                };
                set("clearance_static", clearance_mm);
                set(
                    "tip_error_static",
                    1.2 + numbers[4].abs() + noise.uniform(0.0, 0.8),
                );
                set("surplus_static", clearance_mm - 5.0);
                set("self_clearance_static", 9.0 + noise.uniform(0.0, 20.0));
                for (joint, start) in [-85.0, -105.0, 30.0, 40.0, 100.0, 10.0]
                    .into_iter()
                    .enumerate()
                {
                    set(
                        &format!("q{}_static", joint + 1),
                        start + 30.0 * numbers[joint] + 4.0 * f64::from(index),
                    );
                }
            }
            row
        });
        (values, CaseResult { case, rows })
    }
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
            let (values, result) = self.case(case);
            visit(&values, &result);
        }
        Ok(())
    }
}
