//! Matches and registers the cases that `check.py` sends on standard input; answers as JSON.

use nalgebra::{Matrix3, Point3};
use needlebench_imaging::registration::{
    MatchOptions, ReferenceFrame, ReferenceMarker, match_markers, register_weighted,
};
use needlebench_kinematics::registration::Localised;
use serde::Deserialize;
use serde_json::{Value, json};

#[derive(Deserialize)]
struct Place {
    at_m: [f64; 3],
    covariance_m2: [[f64; 3]; 3],
}

#[derive(Deserialize)]
struct Case {
    detected: Vec<Place>,
    known: Vec<Place>,
    target_m: [f64; 3],
}

fn answer(case: &Case) -> Result<Value, needlebench_volume::VolumeError> {
    let matrix = |place: &Place| Matrix3::from(place.covariance_m2);
    let detected: Vec<_> = case
        .detected
        .iter()
        .map(|place| Localised {
            at_m: Point3::from(place.at_m),
            covariance_m2: matrix(place),
        })
        .collect();
    let known: Vec<_> = case
        .known
        .iter()
        .enumerate()
        .map(|(k, place)| {
            ReferenceMarker::touched(format!("{k}"), Point3::from(place.at_m), matrix(place))
        })
        .collect();
    let matched = match_markers(&detected, &known, &MatchOptions::default())?;
    let registration = register_weighted(&matched, &detected, &known, ReferenceFrame::Robot)?;
    let tre = registration.tre(&Point3::from(case.target_m));
    Ok(json!({ "match": matched, "registration": registration, "tre": tre }))
}

fn main() {
    let cases: Vec<Case> = serde_json::from_reader(std::io::stdin()).expect("a list of cases");
    let answers: Vec<Value> = cases
        .iter()
        .map(|case| answer(case).unwrap_or_else(|error| json!({ "error": error.to_string() })))
        .collect();
    println!("{}", Value::from(answers));
}
