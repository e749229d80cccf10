//! Finds the phantom's markers in a scan of `needlebench ct synth`, registers them, and answers as JSON.
//!
//! `scan_markers FOLDER`: reads `ct.nii.gz` and `truth.json`; the truth is used for the spheres' size and, as what a list
//! of known places would say, for their places in the phantom.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use nalgebra::{Matrix4, Point3};
use needlebench_imaging::markers::{DetectedMarker, MarkerModel, Options, find_markers};
use needlebench_imaging::registration::{
    MatchOptions, ReferenceFrame, ReferenceMarker, match_markers, register_weighted,
};
use needlebench_volume::read::{ReadOptions, read_volume};
use needlebench_volume::resample;
use serde::Deserialize;
use serde_json::{Value, json};

type Failure = Box<dyn std::error::Error>;

#[derive(Deserialize)]
struct Truth {
    ct_from_phantom: [[f64; 4]; 4],
    markers: Vec<Marker>,
    lesions: Vec<Lesion>,
}

#[derive(Deserialize)]
struct Marker {
    name: String,
    sphere_center_m: [f64; 3],
    sphere_diameter_m: f64,
}

#[derive(Deserialize)]
struct Lesion {
    center_m: [f64; 3],
}

/// Of places that a list knows from a drawing.
const DRAWING_SIGMA_M: f64 = 1e-5;

fn main() -> Result<(), Failure> {
    let folder = std::env::args().nth(1).ok_or("scan_markers FOLDER")?;
    let folder = Path::new(&folder);
    let truth: Truth = serde_json::from_slice(&std::fs::read(folder.join("truth.json"))?)?;
    let cancel = AtomicBool::new(false);
    let options = ReadOptions::default();
    let read = read_volume(&folder.join("ct.nii.gz"), &options, 1, &cancel)?;
    let resampled = resample(read.volume, options.max_bytes, 1, &cancel)?;
    let volume = resampled.volume;
    let diameter_m = truth.markers.first().ok_or("no markers")?.sphere_diameter_m;
    let model = MarkerModel::phantom_sphere(diameter_m);
    let start = Instant::now();
    let mut found = find_markers(&volume, &model, &Options::default(), 1, &cancel)?;
    if resampled.remark.is_some() {
        found = found.of_interpolated(&volume);
    }
    let phantom_from_ct = Matrix4::from_fn(|row, column| truth.ct_from_phantom[row][column])
        .try_inverse()
        .ok_or("ct_from_phantom")?;
    let known: Vec<_> = truth
        .markers
        .iter()
        .map(|marker| {
            let at_m = phantom_from_ct.transform_point(&Point3::from(marker.sphere_center_m));
            ReferenceMarker::from_cad(&marker.name, at_m, DRAWING_SIGMA_M)
        })
        .collect();
    let detected: Vec<_> = found
        .markers
        .iter()
        .map(DetectedMarker::localised)
        .collect();
    let registered =
        match_markers(&detected, &known, &MatchOptions::default()).and_then(|matched| {
            register_weighted(&matched, &detected, &known, ReferenceFrame::Phantom)
        });
    let seconds = start.elapsed().as_secs_f64();
    let registration: Value = match &registered {
        Ok(registration) => {
            let targets = truth.lesions.iter().map(|lesion| {
                let wanted = phantom_from_ct.transform_point(&Point3::from(lesion.center_m));
                let told = registration.tre(&Point3::from(lesion.center_m));
                json!({
                    "error_m": (told.at_m - wanted).as_slice(),
                    "covariance_m2": <[[f64; 3]; 3]>::from(told.covariance_m2),
                })
            });
            json!({ "targets": targets.collect::<Vec<_>>(), "chi_square": registration.chi_square })
        }
        Err(error) => json!({ "error": error.to_string() }),
    };
    println!(
        "{}",
        json!({ "markers": found.markers, "rejected": found.rejected.len(), "registration": registration, "seconds": seconds })
    );
    Ok(())
}
