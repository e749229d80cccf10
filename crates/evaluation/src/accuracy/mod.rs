//! The accuracy table that needle papers print: of the quantities that they share mean, standard deviation and
//! range, group by group.
//!
//! ND is the normal distance of a point from the needle's line, ED the Euclidean distance. What is measured is
//! where the needle would go through the guide as it stands, *before* it is inserted.

mod between;
mod spread;

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

pub use between::{LEAST_BLOCKS, Test, Tested};
pub(crate) use between::{friedman, kruskal_wallis};
pub use spread::Spread;

use crate::metric::{Metric, MetricKey, Unit};
use needlebench_scenario::study::StudyMode;

/// A column of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Its name in CSV, without the unit.
    pub key: &'static str,
    /// Heading for people, without the unit.
    pub heading: &'static str,
    /// Whether it is an error that groups are compared by.
    pub is_tested: bool,
    /// Metrics that it is read from: the first that was measured.
    metrics: &'static [&'static str],
}

const fn quantity(
    key: &'static str,
    heading: &'static str,
    metrics: &'static [&'static str],
) -> Quantity {
    Quantity {
        key,
        heading,
        is_tested: true,
        metrics,
    }
}

/// Place of the Euclidean distance at the target, by which hits are counted.
pub const TARGET_ED: usize = 4;

/// The columns, in their order.
pub const QUANTITIES: [Quantity; 10] = [
    Quantity {
        key: "entry_target_length",
        heading: "entry-target length",
        is_tested: false,
        metrics: &["entry_target_length"],
    },
    quantity(
        "entry_nd",
        "entry ND",
        &["entry_lateral_error", "entry_lateral_error_predicted"],
    ),
    quantity(
        "entry_ed",
        "entry ED",
        &["entry_error", "entry_error_predicted"],
    ),
    quantity(
        "target_nd",
        "target ND",
        &["lateral_error", "lateral_error_predicted"],
    ),
    quantity(
        "target_ed",
        "target ED",
        &["tip_error", "tip_error_predicted"],
    ),
    quantity(
        "angle",
        "angle",
        &["needle_angle_error", "needle_angle_error_predicted"],
    ),
    quantity(
        "angle_axial",
        "angle, axial",
        &["needle_angle_axial", "needle_angle_axial_predicted"],
    ),
    quantity(
        "angle_sagittal",
        "angle, sagittal",
        &["needle_angle_sagittal", "needle_angle_sagittal_predicted"],
    ),
    quantity(
        "depth_error",
        "depth error",
        &["depth_error", "depth_error_predicted"],
    ),
    quantity("duration", "duration", &["motion_time"]),
];

impl Quantity {
    fn metrics(self) -> impl Iterator<Item = &'static Metric> {
        self.metrics.iter().filter_map(|key| Metric::of_key(key))
    }

    /// Unit of its numbers.
    pub fn unit(self) -> Unit {
        self.metrics()
            .next()
            .expect("every quantity has a metric: a test makes sure")
            .unit
    }

    /// Names of what it is read from in runs, and in planned and simulated cases: the first that is there.
    pub fn keys(self) -> Vec<MetricKey> {
        self.metrics().map(MetricKey::of_run).collect()
    }

    /// The same with what static cases have in its place.
    pub fn keys_of_cases(self) -> Vec<MetricKey> {
        let of_static = self.metrics().filter_map(MetricKey::of_static_case);
        let mut keys = self.keys();
        keys.extend(of_static.filter(|key| !self.keys().contains(key)));
        debug_assert!(keys.iter().all(|key| {
            [StudyMode::Static, StudyMode::Planned, StudyMode::Dynamic]
                .iter()
                .any(|mode| key.is_measured_in(*mode))
        }));
        keys
    }
}

/// One needle.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Group that it belongs to.
    pub group: usize,
    /// What was drawn for it: samples of one block share the draw of arm, patient and place. None where
    /// nothing was drawn.
    pub block: Option<u64>,
    /// Values of [`QUANTITIES`], each in its unit; none where it was not measured.
    pub values: [Option<f64>; QUANTITIES.len()],
}

/// How many needles came within a radius of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Hits {
    /// Within it, or on it.
    pub within: u64,
    /// Of so many of which the distance is known.
    pub of: u64,
}

/// One row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracyRow {
    /// The group.
    pub label: String,
    /// Needles.
    pub n: u64,
    /// By [`QUANTITIES`].
    pub spreads: [Option<Spread>; QUANTITIES.len()],
    /// None without a radius, or where nothing was measured.
    pub hits: Option<Hits>,
}

/// Radius within which a needle counts as a hit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HitRadius {
    /// The radius, mm.
    pub radius_mm: f64,
    /// Who says so.
    pub source: String,
}

/// The table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracyTable {
    /// Run or study.
    pub name: String,
    /// What groups are of: names of factors, `configuration`.
    pub by: Vec<String>,
    /// Groups in their order.
    pub groups: Vec<AccuracyRow>,
    /// All of them.
    pub all: AccuracyRow,
    /// Comparison of the groups, by [`QUANTITIES`]; the reason where there is none.
    pub tests: [Result<Tested, String>; QUANTITIES.len()],
    /// Radius of a hit.
    pub hit_radius: Option<HitRadius>,
    /// Columns of results that the numbers are from, by [`QUANTITIES`].
    pub columns: [BTreeSet<String>; QUANTITIES.len()],
    /// Whether something that acts on the needle only while it is inserted is in the numbers, and what.
    pub insertion_effects: Vec<String>,
    /// What else to keep in mind.
    pub notes: Vec<String>,
}

/// How samples of different groups belong together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Drawn {
    /// By [`Sample::block`].
    Blocks,
    /// Nothing was drawn: differences of groups are no matter of chance.
    Nothing(String),
}

/// Sums up samples. `labels` are those of the groups.
pub fn summarise(
    labels: &[String],
    samples: &[Sample],
    radius_mm: Option<f64>,
    drawn: &Drawn,
) -> (
    Vec<AccuracyRow>,
    AccuracyRow,
    [Result<Tested, String>; QUANTITIES.len()],
) {
    let row = |label: &str, is_in: &dyn Fn(&Sample) -> bool| {
        let members: Vec<&Sample> = samples.iter().filter(|each| is_in(each)).collect();
        let of = |quantity: usize| members.iter().filter_map(move |each| each.values[quantity]);
        let measured = of(TARGET_ED).count() as u64;
        AccuracyRow {
            label: label.to_owned(),
            n: members.len() as u64,
            spreads: std::array::from_fn(|quantity| Spread::of(of(quantity))),
            hits: radius_mm.filter(|_| measured > 0).map(|radius| Hits {
                within: of(TARGET_ED).filter(|error| *error <= radius).count() as u64,
                of: measured,
            }),
        }
    };
    let groups = labels.iter().enumerate();
    let groups: Vec<AccuracyRow> = groups
        .map(|(group, label)| row(label, &|each| each.group == group))
        .collect();
    let all = row("all", &|_| true);
    let tests = std::array::from_fn(|index| {
        if !QUANTITIES[index].is_tested {
            return Err("planned, not measured".to_owned());
        }
        match drawn {
            Drawn::Nothing(why) => Err(why.clone()),
            Drawn::Blocks => compare(labels.len(), samples, index).map_err(str::to_owned),
        }
    });
    (groups, all, tests)
}

/// Compares groups in one quantity. Of each draw a group has one value, the mean of its samples of that draw:
/// they are not independent. Where draws stand in several groups, groups are compared draw by draw.
fn compare(groups: usize, samples: &[Sample], quantity: usize) -> Result<Tested, &'static str> {
    let mut blocks: BTreeMap<u64, Vec<(f64, u32)>> = BTreeMap::new();
    for sample in samples {
        if let (Some(block), Some(value)) = (sample.block, sample.values[quantity]) {
            let sums = blocks
                .entry(block)
                .or_insert_with(|| vec![(0.0, 0); groups]);
            sums[sample.group].0 += value;
            sums[sample.group].1 += 1;
        }
    }
    let seen: BTreeSet<usize> = samples
        .iter()
        .filter(|each| each.values[quantity].is_some())
        .map(|each| each.group)
        .collect();
    let present: Vec<usize> = seen.into_iter().collect();
    if present.is_empty() {
        return Err("not measured");
    }
    let mean = |sums: &[(f64, u32)], group: usize| {
        let (sum, count) = sums[group];
        (count > 0).then(|| sum / f64::from(count))
    };
    let shared = blocks.values().any(|sums| {
        let in_groups = present.iter().filter(|group| sums[**group].1 > 0).count();
        in_groups > 1
    });
    if shared {
        let complete: Vec<Vec<f64>> = blocks
            .values()
            .filter_map(|sums| present.iter().map(|group| mean(sums, *group)).collect())
            .collect();
        return friedman(&complete);
    }
    let by_group: Vec<Vec<f64>> = present
        .iter()
        .map(|group| {
            blocks
                .values()
                .filter_map(|sums| mean(sums, *group))
                .collect()
        })
        .collect();
    kruskal_wallis(&by_group)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_has_metrics_that_agree_on_their_unit() {
        for quantity in QUANTITIES {
            for key in quantity.metrics {
                let metric = Metric::of_key(key).expect(key);
                assert_eq!(metric.unit, quantity.unit(), "{key}");
            }
            assert!(!quantity.keys().is_empty());
        }
        assert_eq!(QUANTITIES[TARGET_ED].key, "target_ed");
        let keys = QUANTITIES[TARGET_ED].keys_of_cases();
        let names: Vec<String> = keys.iter().map(MetricKey::column).collect();
        assert_eq!(
            names,
            [
                "tip_error_mm",
                "tip_error_predicted_mm",
                "tip_error_static_mm"
            ]
        );
    }

    fn sample(group: usize, block: u64, error: f64) -> Sample {
        let mut values = [None; QUANTITIES.len()];
        values[TARGET_ED] = Some(error);
        Sample {
            group,
            block: Some(block),
            values,
        }
    }

    fn names(count: usize) -> Vec<String> {
        (0..count).map(|index| format!("group {index}")).collect()
    }

    #[test]
    fn rows_count_what_they_have_and_hits_include_the_radius() {
        let mut samples = vec![sample(0, 0, 1.0), sample(0, 1, 2.0), sample(1, 2, 3.0)];
        samples.push(Sample {
            group: 1,
            block: None,
            values: [None; QUANTITIES.len()],
        });
        let (groups, all, tests) = summarise(&names(2), &samples, Some(2.0), &Drawn::Blocks);
        assert_eq!([groups[0].n, groups[1].n, all.n], [2, 2, 4]);
        assert_eq!(groups[0].hits, Some(Hits { within: 2, of: 2 }));
        assert_eq!(groups[1].hits, Some(Hits { within: 0, of: 1 }));
        assert_eq!(all.hits, Some(Hits { within: 2, of: 3 }));
        let spread = all.spreads[TARGET_ED].unwrap();
        assert_eq!((spread.mean, spread.sd), (2.0, Some(1.0)));
        assert_eq!(all.spreads[0], None);
        assert!(tests.iter().all(Result::is_err), "{tests:?}");
        let (_, all, _) = summarise(&names(2), &samples, None, &Drawn::Blocks);
        assert_eq!(all.hits, None);
    }

    #[test]
    fn groups_that_share_draws_are_compared_draw_by_draw() {
        // The same arm in both groups, worse in the second by little beside the spread of arms.
        let samples: Vec<Sample> = (0..20_u32)
            .flat_map(|arm| {
                let error = f64::from(arm);
                [0, 1].map(|group| sample(group, u64::from(arm), error + 0.1 * group as f64))
            })
            .collect();
        let (_, _, tests) = summarise(&names(2), &samples, None, &Drawn::Blocks);
        let found = tests[TARGET_ED].clone().unwrap();
        assert_eq!((found.test, found.members), (Test::Friedman, 20));
        // All twenty agree: 12/(20*2*3)*(20^2 + 40^2) - 180 = 20.
        assert!(found.p < 1e-5);
        // Of other arms in each group nothing is shown.
        let apart: Vec<Sample> = samples
            .iter()
            .map(|each| Sample {
                block: each.block.map(|block| block + 100 * each.group as u64),
                ..each.clone()
            })
            .collect();
        let (_, _, tests) = summarise(&names(2), &apart, None, &Drawn::Blocks);
        let found = tests[TARGET_ED].clone().unwrap();
        assert_eq!((found.test, found.members), (Test::KruskalWallis, 20));
        assert!(found.p > 0.5);
    }

    #[test]
    fn several_samples_of_one_draw_are_one_value() {
        // Four arms are no more for being measured in eight configurations each.
        let samples: Vec<Sample> = (0..64_u32)
            .map(|index| sample((index % 2) as usize, u64::from(index % 8), f64::from(index)))
            .collect();
        let (_, _, tests) = summarise(&names(2), &samples, None, &Drawn::Blocks);
        assert!(tests[TARGET_ED].is_err(), "{:?}", tests[TARGET_ED]);
    }

    #[test]
    fn where_nothing_is_drawn_nothing_is_tested() {
        let samples: Vec<Sample> = (0..40_u32)
            .map(|index| sample((index % 2) as usize, u64::from(index), f64::from(index)))
            .collect();
        let drawn = Drawn::Nothing("nothing is drawn".to_owned());
        let (_, _, tests) = summarise(&names(2), &samples, None, &drawn);
        assert_eq!(tests[TARGET_ED], Err("nothing is drawn".to_owned()));
    }
}
