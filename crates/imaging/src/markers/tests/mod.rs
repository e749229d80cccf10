//! Markers in scans that count points: found, how far off they are, and whether they know it.

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::type_complexity,
    reason = "small volumes, and shapes as they are written down"
)]
mod renderer;

use std::sync::atomic::AtomicBool;

use nalgebra::{Rotation3, Unit, Vector3};
use needlebench_numerics::random::NormalPairs;
use renderer::{Scanner, Scene, ball_on_skin};

use super::*;

const ABDOMEN_MM: f64 = 130.0;

/// What markers are off by.
#[derive(Debug, Default)]
struct Tally {
    trials: usize,
    missed: usize,
    squares: f64,
    /// Squares in units of the stated covariances, three for each.
    chi_squares: f64,
    fit_chi_squares: f64,
    longest_mm: f64,
    mean_normal: f64,
}

impl Tally {
    fn rms_mm(&self) -> f64 {
        (self.squares / (self.trials - self.missed).max(1) as f64).sqrt()
    }

    fn chi_square(&self) -> f64 {
        self.chi_squares / (3 * (self.trials - self.missed).max(1)) as f64
    }
}

fn find(volume: &Volume, model: &MarkerModel) -> Found {
    find_markers(
        volume,
        model,
        &Options::default(),
        1,
        &AtomicBool::new(false),
    )
    .unwrap()
}

/// Trials with scenes as `change` leaves them.
fn trials(
    count: u64,
    scanner: &Scanner,
    model: &MarkerModel,
    [diameter, hu]: [f64; 2],
    change: impl Fn(&mut Scene, &Vector3<f64>),
) -> Tally {
    let mut tally = Tally::default();
    for seed in 0..count {
        let mut random = NormalPairs::new(100 + seed);
        let mut trial = ball_on_skin(diameter, hu, ABDOMEN_MM, &mut random);
        change(&mut trial.scene, &trial.truth);
        let found = find(&scanner.scan(&trial.scene, &mut random), model);
        tally.trials += 1;
        let nearest = found.markers.iter().min_by(|a, b| {
            let off = |m: &DetectedMarker| (m.center_m.coords * 1e3 - trial.truth).norm();
            off(a).total_cmp(&off(b))
        });
        let Some(marker) = nearest else {
            println!("seed {seed}: none; {:?}", found.rejected);
            tally.missed += 1;
            continue;
        };
        let error_mm = marker.center_m.coords * 1e3 - trial.truth;
        let inverse = (marker.covariance_m2 * 1e6).try_inverse().unwrap();
        tally.squares += error_mm.norm_squared();
        tally.chi_squares += error_mm.dot(&(inverse * error_mm));
        tally.fit_chi_squares += marker.chi_square.unwrap_or(f64::NAN);
        tally.longest_mm = tally.longest_mm.max(error_mm.norm());
        tally.mean_normal += error_mm.dot(&trial.scene.skin_normal) / count as f64;
    }
    println!(
        "{diameter} mm, {hu} HU, {} mm every {} mm: rms {:.4} mm, longest {:.3}, outwards {:+.4}, chi-square {:.2}, fit {:.2}, missed {}",
        scanner.thickness,
        scanner.increment,
        tally.rms_mm(),
        tally.longest_mm,
        tally.mean_normal,
        tally.chi_square(),
        tally.fit_chi_squares / count as f64,
        tally.missed
    );
    tally
}

#[test]
fn a_ball_on_skin_is_found_and_localised() {
    for (thickness, increment, noise) in [(1.0, 1.0, 20.0), (2.5, 2.5, 15.0), (5.0, 2.5, 12.0)] {
        let model = MarkerModel::bare_sphere(5e-3);
        let scanner = Scanner::new(thickness, increment, noise);
        let tally = trials(4, &scanner, &model, [5.0, 1200.0], |_, _| ());
        assert_eq!(tally.missed, 0);
        assert!(tally.rms_mm() < 0.05, "{thickness}: {}", tally.rms_mm());
        assert!(tally.longest_mm < 0.1);
    }
}

/// What people do without a fit: mean place of the voxels around, mm, each with a weight by its HU.
fn centroid(
    volume: &Volume,
    around_mm: &Vector3<f64>,
    weight: impl Fn(f64) -> f64,
) -> Vector3<f64> {
    let [nx, ny, nz] = volume.grid.size();
    let (mut sum, mut moment) = (0.0, Vector3::zeros());
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let index = Point3::new(i as f64, j as f64, k as f64);
                let at_mm = volume.grid.ct_from_index(&index).coords * 1e3;
                if (at_mm - around_mm).norm() < 8.0 {
                    let hu = f64::from(volume.hu[volume.grid.offset([i, j, k])]);
                    sum += weight(hu);
                    moment += at_mm * weight(hu);
                }
            }
        }
    }
    moment / f64::max(sum, 1e-9)
}

/// Rms errors, mm, of centroids: binary over a third of the ball, weighted over air, weighted over skin.
fn centroids(count: u64, scanner: &Scanner, [diameter, hu]: [f64; 2]) -> [f64; 3] {
    let mut squares = [0.0; 3];
    for seed in 0..count {
        let mut random = NormalPairs::new(100 + seed);
        let trial = ball_on_skin(diameter, hu, ABDOMEN_MM, &mut random);
        let volume = scanner.scan(&trial.scene, &mut random);
        let shown = hu.min(3071.0);
        let weights: [&dyn Fn(f64) -> f64; 3] = [
            &|seen| f64::from(u8::from(seen > shown / 3.0)),
            &|seen| (seen + 500.0).max(0.0),
            &|seen| (seen - 140.0).max(0.0),
        ];
        for (square, weight) in squares.iter_mut().zip(weights) {
            let error = centroid(&volume, &trial.truth, weight) - trial.truth;
            *square += error.norm_squared() / count as f64;
        }
    }
    squares.map(f64::sqrt)
}

#[test]
#[ignore = "prints the table of methods: a minute in release"]
fn table() {
    let bare = |diameter: f64| MarkerModel::bare_sphere(diameter * 1e-3);
    for (diameter, hu, thickness, increment, noise) in [
        (5.0, 1200.0, 1.0, 1.0, 20.0),
        (5.0, 1200.0, 1.0, 1.0, 50.0),
        (5.0, 1200.0, 2.5, 2.5, 15.0),
        (5.0, 1200.0, 5.0, 5.0, 12.0),
        (5.0, 1200.0, 5.0, 2.5, 12.0),
        (5.0, 8000.0, 1.0, 1.0, 20.0),
        (10.0, 1200.0, 1.0, 1.0, 20.0),
        (10.0, 1200.0, 5.0, 5.0, 12.0),
        (8.0, 1200.0, 5.0, 5.0, 12.0),
    ] {
        const TRIALS: u64 = 48;
        let scanner = Scanner::new(thickness, increment, noise);
        let [binary, air, skin] = centroids(TRIALS, &scanner, [diameter, hu]);
        println!(
            "centroids: binary {binary:.3}, weighted over air {air:.3}, over skin {skin:.3} mm"
        );
        trials(TRIALS, &scanner, &bare(diameter), [diameter, hu], |_, _| ());
        let softer = Scanner {
            blur: 0.55 * 1.25,
            ..scanner
        };
        print!("  blur +25 %, radius +0.05: ");
        trials(
            TRIALS,
            &softer,
            &bare(diameter),
            [diameter + 0.1, hu],
            |_, _| (),
        );
    }
}

#[test]
#[ignore = "several hundred scans: two minutes"]
fn covariances_are_those_of_the_errors() {
    for (thickness, increment, noise) in [(1.0, 1.0, 50.0), (2.5, 2.5, 40.0)] {
        let scanner = Scanner::new(thickness, increment, noise);
        let tally = trials(
            300,
            &scanner,
            &MarkerModel::bare_sphere(6e-3),
            [6.0, 1200.0],
            |_, _| (),
        );
        // Of so many chi-squares with three degrees of freedom the mean is known to 4.7 %.
        assert!(
            (tally.chi_square() - 1.0).abs() < 0.1 + 0.047,
            "{}",
            tally.chi_square()
        );
    }
}

#[test]
fn the_phantoms_marker_under_its_disc_is_localised() {
    let scanner = Scanner::new(2.5, 2.5, 15.0);
    let tally = trials(
        3,
        &scanner,
        &MarkerModel::phantom_sphere(8e-3),
        [8.0, 1200.0],
        |scene, truth| {
            let normal = scene.skin_normal;
            scene
                .cylinders
                .push((truth + normal * 4.5, normal, [9.0, 0.5], 100.0));
            scene.cylinders.push((*truth, normal, [9.0, 4.0], -950.0));
            // The carrier ends at the skin that it stands on.
            scene.spheres.rotate_left(0);
        },
    );
    assert_eq!(tally.missed, 0);
    assert!(tally.rms_mm() < 0.05, "{}", tally.rms_mm());
}

#[test]
fn ribs_wrong_blur_and_wrong_radius_do_little() {
    let scanner = Scanner {
        blur: 0.55 * 1.25,
        ..Scanner::new(1.0, 1.0, 20.0)
    };
    let tally = trials(
        3,
        &scanner,
        &MarkerModel::bare_sphere(5e-3),
        [5.1, 1200.0],
        |scene, _| {
            let along = scene.skin_axis.cross(&scene.skin_normal).normalize();
            let rib = scene.skin_point - scene.skin_normal * 10.0;
            scene.cylinders.push((rib, along, [5.0, 60.0], 500.0));
        },
    );
    assert_eq!(tally.missed, 0);
    assert!(tally.rms_mm() < 0.06, "{}", tally.rms_mm());
}

#[test]
fn clipped_metal_is_localised_and_said_to_be_clipped() {
    let mut random = NormalPairs::new(7);
    let trial = ball_on_skin(5.0, 8000.0, ABDOMEN_MM, &mut random);
    let found = find(
        &Scanner::new(1.0, 1.0, 20.0).scan(&trial.scene, &mut random),
        &MarkerModel {
            hu: 6000.0,
            ..MarkerModel::bare_sphere(5e-3)
        },
    );
    assert_eq!(found.markers.len(), 1, "{found:?}");
    let off = (found.markers[0].center_m.coords * 1e3 - trial.truth).norm();
    assert!(off < 0.05, "{off}");
    assert!(
        found.markers[0]
            .remarks
            .iter()
            .any(|r| r.message.contains("clipped"))
    );
}

#[test]
fn a_ball_within_one_slice_has_no_place_across_it() {
    let model = MarkerModel::bare_sphere(5e-3);
    let scanner = Scanner::new(5.0, 5.0, 12.0);
    let tally = trials(4, &scanner, &model, [5.0, 1200.0], |_, _| ());
    assert_eq!(tally.missed, 0);
    // The truth lies within what is said: a mean of 4 chi-squares with three degrees of freedom is below 3 times that.
    assert!(tally.chi_square() < 3.0, "{}", tally.chi_square());
    let mut random = NormalPairs::new(3);
    let mut trial = ball_on_skin(5.0, 1200.0, ABDOMEN_MM, &mut random);
    let shift = Vector3::new(0.0, 0.0, -trial.truth.z);
    trial.scene.spheres[0].0 += shift;
    trial.scene.skin_point += shift;
    let found = find(&scanner.scan(&trial.scene, &mut random), &model);
    let marker = &found.markers[0];
    assert!(
        marker.covariance_m2[(2, 2)].sqrt() > 0.25e-3,
        "{}",
        marker.covariance_m2[(2, 2)].sqrt()
    );
    assert!(
        marker
            .remarks
            .iter()
            .any(|r| r.message.contains("too uncertain"))
    );
}

#[test]
fn turned_and_tilted_slices_are_no_other() {
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(0.2, 0.3, 0.9)), 0.7);
    let turned = Scanner {
        axes: *turn.matrix(),
        ..Scanner::new(2.5, 2.5, 15.0)
    };
    let model = MarkerModel::bare_sphere(6e-3);
    assert!(trials(2, &turned, &model, [6.0, 1200.0], |_, _| ()).rms_mm() < 0.06);
    // A gantry's tilt: slices move along z, their planes lean.
    let mut tilted = Scanner::new(2.5, 2.5, 15.0);
    let lean = 0.35_f64;
    tilted
        .axes
        .set_column(1, &Vector3::new(0.0, libm::cos(lean), -libm::sin(lean)));
    assert!(trials(2, &tilted, &model, [6.0, 1200.0], |_, _| ()).rms_mm() < 0.06);
}

#[test]
fn a_ring_in_a_flat_disc_is_found_by_its_density() {
    let mut random = NormalPairs::new(21);
    let mut trial = ball_on_skin(2.0, 2500.0, ABDOMEN_MM, &mut random);
    trial.scene.spheres.clear();
    let normal = trial.scene.skin_normal;
    trial
        .scene
        .rings
        .push((trial.truth, normal, [7.0, 1.0], 2500.0));
    trial
        .scene
        .cylinders
        .push((trial.truth, normal, [9.0, 1.0], 100.0));
    let found = find(
        &Scanner::new(1.0, 1.0, 20.0).scan(&trial.scene, &mut random),
        &MarkerModel::ring_disc(14e-3, 2e-3, 2e-3),
    );
    assert_eq!(found.markers.len(), 1, "{found:?}");
    let off = (found.markers[0].center_m.coords * 1e3 - trial.truth).norm();
    assert!(off < 0.1, "{off}");
}

#[test]
fn streaks_and_a_neighbour_that_touches_are_told_by_the_residuals() {
    // With tissue around that has no streaks.
    let wide = || Scanner {
        size: [90, 90, 21],
        ..Scanner::new(1.0, 1.0, 20.0)
    };
    let mut random = NormalPairs::new(31);
    let trial = ball_on_skin(5.0, 1200.0, ABDOMEN_MM, &mut random);
    let streaked = Scanner {
        streaks: 200.0,
        ..wide()
    };
    let model = MarkerModel::bare_sphere(5e-3);
    let clean = find(&wide().scan(&trial.scene, &mut random), &model);
    let odd = |found: &Found| {
        found.markers.iter().all(|m| {
            m.remarks
                .iter()
                .any(|r| r.message.contains("times the noise"))
        })
    };
    assert_eq!(clean.markers.len(), 1);
    assert!(!odd(&clean), "{clean:?}");
    assert!(odd(&find(
        &streaked.scan(&trial.scene, &mut random),
        &model
    )));
    let mut touched = trial.scene.clone();
    let beside = trial.scene.skin_axis * 5.2;
    touched.spheres.push((trial.truth + beside, 2.5, 1200.0));
    assert!(odd(&find(&wide().scan(&touched, &mut random), &model)));
}

#[test]
fn skin_without_a_marker_has_none_and_bad_models_are_refused() {
    let mut random = NormalPairs::new(41);
    let mut trial = ball_on_skin(5.0, 1200.0, ABDOMEN_MM, &mut random);
    trial.scene.spheres.clear();
    let volume = Scanner::new(2.5, 2.5, 30.0).scan(&trial.scene, &mut random);
    assert!(
        find(&volume, &MarkerModel::bare_sphere(5e-3))
            .markers
            .is_empty()
    );
    let go = AtomicBool::new(false);
    let options = Options::default();
    assert!(find_markers(&volume, &MarkerModel::bare_sphere(0.0), &options, 1, &go).is_err());
    assert!(
        find_markers(
            &volume,
            &MarkerModel::bare_sphere(f64::NAN),
            &options,
            1,
            &go
        )
        .is_err()
    );
    let stopped = find_markers(
        &volume,
        &MarkerModel::bare_sphere(5e-3),
        &options,
        1,
        &AtomicBool::new(true),
    );
    assert_eq!(stopped.unwrap_err(), VolumeError::Interrupted);
}

#[test]
fn threads_change_nothing_and_what_is_written_is_read_again() {
    let mut random = NormalPairs::new(51);
    let trial = ball_on_skin(6.0, 1200.0, ABDOMEN_MM, &mut random);
    let volume = Scanner::new(2.5, 2.5, 15.0).scan(&trial.scene, &mut random);
    let model = MarkerModel::bare_sphere(6e-3);
    let one = find(&volume, &model);
    let many = find_markers(
        &volume,
        &model,
        &Options::default(),
        3,
        &AtomicBool::new(false),
    )
    .unwrap();
    assert_eq!(one, many);
    let text = serde_json::to_string(&one).unwrap();
    assert!(text.contains("center_m") && text.contains("covariance_m2"));
    let again: Found = serde_json::from_str(&text).unwrap();
    assert_eq!(again.markers.len(), one.markers.len());
}
