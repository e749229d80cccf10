//! Round fields of view that do not hold all of the patient, nor what the patient lies on.

use needlebench_imaging::{Label, ReconstructOptions, Reconstruction};
use needlebench_volume::{LabelMap, Lying, Volume};

use super::beside::in_the_scanner;
use super::reconstruct::{MM, grid, label_at, options, render, run};

/// What scanners store where they saw nothing.
const PADDING_HU: i16 = -1024;

/// The scanner's picture within a circle, mm, with some noise.
fn seen_within([x, y]: [f64; 2], radius: f64) -> Volume {
    let mut volume = render(&in_the_scanner(), grid());
    let [nx, ny, nz] = volume.grid.size();
    for (k, j) in (0..nz).flat_map(|k| (0..ny).map(move |j| (k, j))) {
        for i in 0..nx {
            let offset = volume.grid.offset([i, j, k]);
            let place = volume
                .grid
                .ct_from_index(&[i as f64, j as f64, k as f64].into())
                / MM;
            volume.hu[offset] = if libm::hypot(place.x - x, place.y - y) > radius {
                PADDING_HU
            } else {
                let noise = i16::try_from((7 * i + 13 * j + 5 * k) % 11).unwrap();
                volume.hu[offset] + noise - 5
            };
        }
    }
    volume
}

fn lying(on: Lying) -> ReconstructOptions {
    ReconstructOptions {
        lying: Some(on),
        ..options()
    }
}

fn said(made: &Reconstruction, words: &str) -> bool {
    made.remarks.iter().any(|it| it.message.contains(words))
}

#[test]
fn a_circle_that_cuts_lungs_leaves_them_lungs() {
    // They reach to 124 mm on both sides.
    let made = run(&seen_within([0.0, 15.0], 112.0), &options()).unwrap();
    assert_eq!(made.segmentation.lungs.lungs.len(), 2);
    for side in [-1.0, 1.0] {
        let wanted = [Label::LungRight, Label::LungLeft][usize::from(side > 0.0)];
        assert_eq!(label_at(&made, [side * 105.0, 0.0, 0.0]), wanted as u16);
    }
    assert!(said(
        &made,
        "the field of view cuts the body on its left side"
    ));
}

#[test]
fn a_couch_goes_on_beyond_the_circle_as_it_is_seen() {
    let couch = Label::AssumedCouch as u16;
    let made = run(&seen_within([0.0, 15.0], 112.0), &options()).unwrap();
    assert_eq!(label_at(&made, [0.0, 109.5, 0.0]), Label::Couch as u16);
    for x in [-150.0, -90.0, 90.0, 150.0] {
        assert_eq!(label_at(&made, [x, 112.0, 10.0]), couch, "{x} mm");
        // It is flat, and not in the way above.
        assert_eq!(label_at(&made, [x, 102.0, 10.0]), 0, "{x} mm");
    }
    assert!(said(&made, "couch assumed beyond the field of view"));
    let surface = made.surfaces.iter().find(|it| it.name == "assumed_couch");
    assert!(surface.is_some());
    // All of it is seen in the image.
    let whole = run(&render(&in_the_scanner(), grid()), &options()).unwrap();
    assert!(!whole.labels.labels.contains(&couch));
}

#[test]
fn a_couch_that_the_circle_does_not_show_is_assumed_where_the_patient_lies() {
    let couch = Label::AssumedCouch as u16;
    let volume = seen_within([0.0, 0.0], 104.0);
    for (on, under) in [(Lying::Supine, 1.0), (Lying::Prone, -1.0)] {
        let made = run(&volume, &lying(on)).unwrap();
        for (x, y) in [(0.0, 108.0), (-120.0, 90.0), (120.0, 90.0)] {
            assert_eq!(label_at(&made, [x, under * y, 0.0]), couch, "{on:?} {x}");
            assert_eq!(label_at(&made, [x, -under * y, 0.0]), 0, "{on:?} {x}");
        }
    }
    // A field of view that goes on below the patient shows that there is none.
    let mut solids = in_the_scanner();
    solids.drain(..3);
    let alone = run(&render(&solids, grid()), &options()).unwrap();
    assert!(!alone.labels.labels.contains(&couch));
}

#[test]
fn what_a_label_map_has_beyond_the_circle_is_left_out() {
    let volume = seen_within([0.0, 15.0], 112.0);
    let (mut map, mut beyond) = (vec![0; volume.hu.len()], 0_usize);
    let [nx, ny, nz] = volume.grid.size();
    // A shoulder blade of 80 to 160 mm to the left, as of the whole patient.
    for (k, j) in (0..nz).flat_map(|k| (0..ny).map(move |j| (k, j))) {
        for i in 0..nx {
            let place = volume
                .grid
                .ct_from_index(&[i as f64, j as f64, k as f64].into())
                / MM;
            let there = (80.0..140.0).contains(&place.x) && (35.0..43.0).contains(&place.y);
            if there && place.z.abs() < 30.0 {
                let offset = volume.grid.offset([i, j, k]);
                map[offset] = 1;
                beyond += usize::from(volume.hu[offset] == PADDING_HU);
            }
        }
    }
    assert!(beyond > 0);
    let labels = LabelMap {
        grid: volume.grid.clone(),
        labels: map,
        names: vec![(1, "scapula_left".to_owned())],
    };
    let wanted = ReconstructOptions {
        labels: Some(labels),
        ..options()
    };
    let made = run(&volume, &wanted).unwrap();
    let ml = 1e6 * beyond as f64 * volume.grid.steps_m().determinant();
    let words = format!(
        "beyond the field of view, where the scan shows nothing, it is left out: `scapula_left` {ml:.1} ml"
    );
    assert!(said(&made, &words), "{:?}", made.remarks);
    assert_eq!(label_at(&made, [130.0, 39.0, 0.0]), 0);
    assert_eq!(label_at(&made, [90.0, 39.0, 0.0]), 1);
}
