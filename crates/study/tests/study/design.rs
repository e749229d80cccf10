//! A design gives every case its values, from the number of the case alone.

use needlebench_scenario::study::{
    Distribution, FactorValues, Role, SamplingMethod, StudyFactor, StudyLevel,
};
use needlebench_scenario::{Change, KeyPath, Setting};
use needlebench_study::{Design, DesignError, Factor, FactorValue};

fn key() -> KeyPath {
    KeyPath::parse("phantom.position_mm[0]").unwrap()
}

fn levels(name: &str, count: usize, sampled: bool) -> StudyFactor {
    let level = |number: usize| StudyLevel {
        label: number.to_string(),
        number: Some(number as f64),
        changes: vec![(key(), Change::Set(Setting::from(number as f64)))],
        mode: None,
        engines: None,
    };
    StudyFactor {
        name: name.to_owned(),
        unit: String::new(),
        role: Role::Control,
        sampled,
        values: FactorValues::Levels((0..count).map(level).collect()),
    }
}

fn uniform(name: &str) -> StudyFactor {
    StudyFactor {
        name: name.to_owned(),
        unit: "mm".to_owned(),
        role: Role::Noise,
        sampled: true,
        values: FactorValues::Continuum {
            key: key(),
            relative: true,
            distribution: Distribution::Uniform {
                low: -30.0,
                high: 30.0,
            },
        },
    }
}

fn goals() -> Vec<String> {
    ["a", "b"].map(str::to_owned).into()
}

const METHODS: [SamplingMethod; 3] = [
    SamplingMethod::Sobol,
    SamplingMethod::LatinHypercube,
    SamplingMethod::Random,
];

#[test]
fn crossed_factors_meet_in_every_combination_with_the_same_samples() {
    for method in METHODS {
        let factors = [
            levels("x", 3, false),
            uniform("u"),
            levels("y", 2, false),
            levels("drawn", 4, true),
        ];
        let design = Design::of(&goals(), &factors, method, Some(16), 7).unwrap();
        assert_eq!(design.cases(), 2 * 3 * 2 * 16);
        let mut combinations = std::collections::BTreeMap::new();
        for case in 0..design.cases() {
            let values = design.values(case);
            let [
                FactorValue::Level(goal),
                FactorValue::Level(x),
                FactorValue::Number(u),
                FactorValue::Level(y),
                FactorValue::Level(drawn),
            ] = values[..]
            else {
                panic!("{values:?}");
            };
            assert!((-30.0..30.0).contains(&u) && drawn < 4);
            combinations
                .entry((goal, x, y))
                .or_insert_with(Vec::new)
                .push((u.to_bits(), drawn));
        }
        assert_eq!(combinations.len(), 12);
        let first = combinations.values().next().unwrap().clone();
        assert!(combinations.values().all(|samples| *samples == first));
        // Evenly drawn: four of each, by the strata of a Sobol sequence and a Latin hypercube.
        if method != SamplingMethod::Random {
            for level in 0..4 {
                assert_eq!(first.iter().filter(|(_, drawn)| *drawn == level).count(), 4);
            }
        }
    }
}

#[test]
fn the_goal_counts_slowest_and_the_samples_fastest() {
    let factors = [levels("x", 3, false), uniform("u")];
    let design = Design::of(&goals(), &factors, SamplingMethod::Sobol, Some(4), 0).unwrap();
    let level = |case, factor: usize| match design.values(case)[factor] {
        FactorValue::Level(level) => level,
        FactorValue::Number(_) => panic!("a level"),
    };
    assert_eq!(
        (0..24).map(|case| level(case, 0)).collect::<Vec<_>>(),
        [[0; 12], [1; 12]].concat()
    );
    assert_eq!(
        (0..12).map(|case| level(case, 1)).collect::<Vec<_>>(),
        [[0; 4], [1; 4], [2; 4]].concat()
    );
    assert_eq!(design.samples(), 4);
}

#[test]
fn a_design_without_sampled_factors_has_one_case_per_combination() {
    let design = Design::of(
        &goals(),
        &[levels("x", 5, false)],
        SamplingMethod::Sobol,
        Some(100),
        0,
    )
    .unwrap();
    assert_eq!(design.cases(), 10);
}

#[test]
fn values_depend_on_the_seed() {
    for method in METHODS {
        let [a, b] = [1, 2].map(|seed| {
            Design::of(&goals(), &[uniform("u")], method, Some(8), seed)
                .unwrap()
                .values(3)
        });
        assert_ne!(a, b);
    }
}

#[test]
fn more_cases_than_numbers_are_refused() {
    let factors: Vec<_> = (0..8)
        .map(|k| levels(&format!("f{k}"), 1000, false))
        .collect();
    let refused = Design::of(&goals(), &factors, SamplingMethod::Sobol, None, 0);
    assert_eq!(refused, Err(DesignError::TooMany));
    let factors: Vec<_> = (0..41).map(|k| uniform(&format!("f{k}"))).collect();
    let refused = Design::of(&goals(), &factors, SamplingMethod::Sobol, Some(8), 0);
    assert!(matches!(
        refused,
        Err(DesignError::TooManyDimensions {
            sampled: 41,
            most: 40,
            ..
        })
    ));
    assert!(
        Design::of(
            &goals(),
            &factors,
            SamplingMethod::LatinHypercube,
            Some(8),
            0
        )
        .is_ok()
    );
}

#[test]
fn what_is_drawn_is_known_as_sampled() {
    let seed = StudyFactor {
        values: FactorValues::Levels(vec![StudyLevel {
            label: "1".to_owned(),
            number: Some(1.0),
            changes: vec![(
                KeyPath::parse("seed").unwrap(),
                Change::Set(Setting::from(1.0)),
            )],
            mode: None,
            engines: None,
        }]),
        ..levels("draw", 1, false)
    };
    let of = |factors: &[StudyFactor]| -> Vec<bool> {
        let design = Design::of(&goals(), factors, SamplingMethod::Sobol, Some(4), 1).unwrap();
        design.factors().iter().map(Factor::is_sampled).collect()
    };
    let crossed = levels("tool", 3, false);
    let sampled = [levels("size", 3, true), uniform("along")];
    assert_eq!(of(&[crossed.clone(), seed.clone()]), [false, false, true]);
    // Crossed with sampled points, seeds are no further points.
    let all = [&[crossed, seed][..], &sampled].concat();
    assert_eq!(of(&all), [false, false, false, true, true]);
}
