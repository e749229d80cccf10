//! What cannot be a law, a case or a question is answered by an error that names it.

use nalgebra::{Matrix6, Point3, Vector2, Vector3, Vector6};
use needlebench_probability::{
    Anatomy, Bend, BendDirection, Body, Case, CaseError, Draws, EstimateError, Event, EventError,
    HalfPlane, Hold, Law, LawError, Needle, at_most, estimate,
};

use crate::common::{correlated, failing, linear, part};
use crate::shapes::{DEPTH_M, NEEDLE, Shape, Shapes, case, structure};

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

/// Distances that are none.
struct Broken(fn(&Point3<f64>) -> f64);

impl Anatomy for Broken {
    fn distance_m(&self, _: usize, point_m: &Point3<f64>) -> f64 {
        (self.0)(point_m)
    }
}

fn broken(of: fn(&Point3<f64>) -> f64) -> Result<(), CaseError> {
    let law = linear(Vector6::zeros(), &correlated([1e-3; 3], [1e-3; 3], 0.0));
    Case::new(&law, NEEDLE, &[structure(0.0, Vec::new())], &Broken(of)).map(|_| ())
}

#[test]
fn distances_must_be_numbers_in_metres_of_something() {
    assert!(matches!(
        broken(|_| f64::NAN),
        Err(CaseError::Distance { .. })
    ));
    assert!(matches!(
        broken(|_| f64::INFINITY),
        Err(CaseError::Empty { .. })
    ));
    // Millimetres.
    let steep = broken(|point| 1e3 * (0.2 - point.x));
    assert!(matches!(&steep, Err(CaseError::Steep { structure, .. }) if structure == "vessel"));
    assert!(steep.unwrap_err().to_string().contains("in m, not mm"));
    // Beyond the path, where only draws ask.
    let law = linear(Vector6::zeros(), &correlated([1e-3; 3], [1e-3; 3], 0.0));
    let structures = [structure(0.0, Vec::new())];
    let anatomy = Broken(|point| {
        if point.y > 1e-3 {
            f64::NAN
        } else {
            3e-3 - point.y
        }
    });
    let case = Case::new(&law, NEEDLE, &structures, &anatomy).unwrap();
    let draws = Draws {
        seed: 1,
        most: 1000,
        threads: 1,
        moves: true,
    };
    let closer = Event::Closer {
        structure: 0,
        margin_m: 0.0,
    };
    let found = estimate(&case, &[closer], &draws);
    assert!(
        matches!(found, Err(EstimateError::Distance { .. })),
        "{found:?}"
    );
}

#[test]
fn needles_structures_and_questions_have_sound_lengths() {
    let law = linear(Vector6::zeros(), &correlated([1e-3; 3], [1e-3; 3], 0.0));
    let shapes = Shapes(vec![Shape::Around { radius_m: 0.01 }]);
    let short = Needle {
        depth_m: 0.0,
        ..NEEDLE
    };
    let structures = [structure(0.0, Vec::new())];
    assert!(matches!(
        Case::new(&law, short, &structures, &shapes),
        Err(CaseError::Needle { .. })
    ));
    let negative = [structure(-1e-3, Vec::new())];
    assert!(matches!(
        Case::new(&law, NEEDLE, &negative, &shapes),
        Err(CaseError::Boundary { .. })
    ));
    let plane = HalfPlane {
        normal: Vector2::new(2.0, 0.0),
        offset_m: 0.01,
        stretch_m: [0.0, DEPTH_M],
    };
    let planes = [structure(0.0, vec![vec![plane]])];
    assert!(matches!(
        Case::new(&law, NEEDLE, &planes, &shapes),
        Err(CaseError::Plane { .. })
    ));
    let case = case(&law, &structures, &shapes);
    let ask = |event: Event, most: u64| {
        let draws = Draws {
            seed: 1,
            most,
            threads: 1,
            moves: true,
        };
        estimate(&case, &[event], &draws).unwrap_err()
    };
    let within = Event::TipWithin {
        radius_m: 2e-3,
        body: Body::Lung,
    };
    assert_eq!(ask(within, 10), EstimateError::Draws { draws: 10 });
    let rejected = |event: Event| {
        // Bounds reject what estimates do.
        let EstimateError::Event(found) = ask(event.clone(), 1000) else {
            panic!("another error");
        };
        assert_eq!(at_most(&case, &event), Err(found.clone()));
        found
    };
    let missing = Event::TipInside { structure: 3 };
    assert_eq!(
        rejected(missing),
        EventError::Structure {
            structure: 3,
            count: 1
        }
    );
    let margin = Event::Closer {
        structure: 0,
        margin_m: -1e-3,
    };
    assert!(matches!(
        rejected(margin),
        EventError::Length { what: "margin", .. }
    ));
    let notch = Event::NotchInside {
        structure: 0,
        notch_m: [-0.01, 0.01],
        least_m: 0.005,
    };
    assert!(matches!(rejected(notch), EventError::Notch { .. }));
}
