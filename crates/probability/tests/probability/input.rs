//! What cannot be a law, a case or a question is answered by an error that names it.

use nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use needlebench_probability::{Bend, BendDirection, Hold, Law, LawError};

use crate::common::{correlated, failing, part};

fn law_of(covariance_m2: &Matrix6<f64>) -> Result<Law, LawError> {
    Law::new(
        Vector6::zeros(),
        vec![part("arm", covariance_m2)],
        None,
        Vec::new(),
    )
}

#[test]
fn covariances_must_be_finite_symmetric_positive_and_not_all_zero() {
    let sound = correlated([1e-3; 3], [1e-3; 3], 0.5);
    assert!(law_of(&sound).is_ok());
    let with = |row: usize, column: usize, value: f64| {
        let mut other = sound;
        other[(row, column)] = value;
        law_of(&other)
    };
    assert!(
        matches!(with(2, 2, f64::NAN), Err(LawError::NotFinite { what }) if what == "covariance arm")
    );
    assert!(matches!(
        with(4, 1, 0.0),
        Err(LawError::NotSymmetric {
            row: 4,
            column: 1,
            ..
        })
    ));
    let negative = law_of(&correlated([1e-3; 3], [1e-3; 3], 1.2));
    assert!(
        matches!(negative, Err(LawError::NotPositive { variance_m2, .. }) if variance_m2 < 0.0)
    );
    // Rank 3: entry and tip move alike.
    assert!(law_of(&correlated([1e-3; 3], [1e-3; 3], 1.0)).is_ok());
    assert_eq!(law_of(&Matrix6::zeros()), Err(LawError::NoSpread));
    assert!(LawError::NoSpread.to_string().contains("0 or 1"));
    // One millimetre squared that was taken for a square metre.
    assert!(matches!(
        law_of(&Matrix6::identity()),
        Err(LawError::TooWide { .. })
    ));
    let mean = Law::new(
        Vector6::repeat(f64::INFINITY),
        vec![part("arm", &sound)],
        None,
        Vec::new(),
    );
    assert!(matches!(mean, Err(LawError::NotFinite { .. })));
}

#[test]
fn weights_of_the_breath_are_probabilities_that_sum_to_one() {
    let of = |holds: Vec<Hold>| {
        Law::new(
            Vector6::zeros(),
            vec![part("arm", &correlated([1e-3; 3], [1e-3; 3], 0.0))],
            None,
            holds,
        )
    };
    assert!(of(failing(Vector3::zeros(), Vector3::x())).is_ok());
    let percent = of(vec![Hold::still(-4.0), Hold::still(5.0)]);
    assert!(matches!(percent, Err(LawError::Weight { state: 0, .. })));
    assert!(
        matches!(of(vec![Hold::still(5.0)]), Err(LawError::Weight { weight, .. }) if weight == 5.0)
    );
    assert!(matches!(
        of(vec![Hold::still(f64::NAN)]),
        Err(LawError::Weight { .. })
    ));
    assert_eq!(
        of(vec![Hold::still(0.9)]),
        Err(LawError::Weights { sum: 0.9 })
    );
    let mut broken = Hold::still(1.0);
    broken.drift_m[1].y = f64::NAN;
    assert_eq!(of(vec![broken]), Err(LawError::Breath { state: 0 }));
}

#[test]
fn bends_have_a_value_at_every_fraction() {
    let curve = |count: usize| vec![Vector2::new(1e-3, 0.0); count];
    let of = |fractions: &[f64], curves, spread_rad| {
        Bend::new(
            fractions.to_vec(),
            curves,
            BendDirection::Known { spread_rad },
        )
    };
    assert!(of(&[0.0, 1.0], vec![curve(2)], 0.1).is_ok());
    for fractions in [
        &[0.0][..],
        &[],
        &[0.1, 1.0],
        &[0.0, 0.9],
        &[0.0, 0.5, 0.5, 1.0],
        &[0.0, f64::NAN],
    ] {
        let found = of(fractions, vec![curve(fractions.len())], 0.1);
        assert_eq!(found, Err(LawError::Fractions), "{fractions:?}");
    }
    assert_eq!(
        of(&[0.0, 1.0], vec![curve(2), curve(3)], 0.1),
        Err(LawError::Curve { curve: 1 })
    );
    assert_eq!(
        of(&[0.0, 1.0], Vec::new(), 0.1),
        Err(LawError::Curve { curve: 0 })
    );
    assert!(matches!(
        of(&[0.0, 1.0], vec![curve(2)], -0.1),
        Err(LawError::Turn { .. })
    ));
    // A single bend to one side is certain.
    let certain = of(&[0.0, 1.0], vec![curve(2)], 0.0).unwrap();
    let law = Law::new(Vector6::zeros(), Vec::new(), Some(certain), Vec::new());
    assert_eq!(law, Err(LawError::NoSpread));
}
