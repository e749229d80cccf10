//! Half-planes that hold a structure.

use nalgebra::Point3;
use needlebench_numerics::random::SplitMix64;
use needlebench_probability::HalfPlane;

/// Whether a point lies in one of some half-planes, to rounding.
fn holds(cover: &[HalfPlane], point: &Point3<f64>) -> bool {
    cover.iter().any(|plane| {
        let [from_m, to_m] = plane.stretch_m;
        plane.normal.dot(&point.coords.yz()) >= plane.offset_m - 1e-12
            && (from_m - 1e-12..=to_m + 1e-12).contains(&point.x)
    })
}

#[test]
fn every_cover_holds_every_piece() {
    let mut random = SplitMix64::new(6);
    for case in 0..40 {
        // Triangles on an arc about the needle, wider from case to case.
        let width = 0.15 * f64::from(case);
        let points: Vec<Point3<f64>> = (0..60)
            .flat_map(|_| {
                let angle = 1.0 + random.uniform(-0.5, 0.5) * width;
                let away_m = random.uniform(4e-3, 8e-3);
                let x_m = random.uniform(0.02, 0.06);
                let (sine, cosine) = libm::sincos(angle);
                let corner = Point3::new(x_m, away_m * cosine, away_m * sine);
                let mut beside = || random.uniform(-0.5e-3, 0.5e-3);
                [0; 3].map(|_| corner + nalgebra::Vector3::new(beside(), beside(), beside()))
            })
            .collect();
        let beyond_m = 0.2e-3;
        let covers = HalfPlane::covers(&points, 3, beyond_m);
        // Well below half a turn there is a single plane.
        let is_single = covers.iter().any(|cover| cover.len() == 1);
        assert!(is_single || width > 2.4, "{width}");
        assert!(!covers.is_empty() || width > 4.0, "{width}");
        for cover in &covers {
            assert!(cover.len() <= 4);
            for triangle in points.chunks(3) {
                let one_holds_all = cover.iter().any(|plane| {
                    triangle
                        .iter()
                        .all(|point| holds(std::slice::from_ref(plane), point))
                });
                assert!(one_holds_all);
                // What is around a corner too.
                let side = triangle[0] + nalgebra::Vector3::new(-beyond_m, 0.0, 0.0);
                assert!(holds(cover, &side));
            }
        }
    }
}

#[test]
fn what_surrounds_the_needle_has_no_cover() {
    let ring: Vec<Point3<f64>> = (0..360)
        .map(|degree| {
            let (sine, cosine) = libm::sincos(f64::from(degree).to_radians());
            Point3::new(0.04, 5e-3 * cosine, 5e-3 * sine)
        })
        .collect();
    // Four planes about a whole ring come within cos 45 of its radius.
    let covers = HalfPlane::covers(&ring, 1, 0.0);
    assert!(covers.iter().all(|cover| cover.len() == 4));
    let nearest = covers
        .iter()
        .flatten()
        .map(|plane| plane.offset_m)
        .fold(f64::INFINITY, f64::min);
    assert!(
        nearest <= 5e-3 * libm::cos(std::f64::consts::FRAC_PI_4) + 1e-9,
        "{nearest}"
    );
    assert!(HalfPlane::covers(&ring, 1, 5e-3).is_empty());
    assert!(HalfPlane::covers(&[], 1, 0.0).is_empty());
}

#[test]
fn planes_are_as_far_as_the_structure() {
    let point = Point3::new(0.03, 3e-3, 4e-3);
    let covers = HalfPlane::covers(&[point], 1, 1e-3);
    let farthest = covers
        .iter()
        .flatten()
        .map(|plane| plane.offset_m)
        .fold(0.0, f64::max);
    // 96 directions: half a step off.
    let least = 5e-3 * libm::cos(std::f64::consts::PI / 96.0) - 1e-3;
    assert!(farthest <= 4e-3 + 1e-12 && farthest >= least, "{farthest}");
    let [from_m, to_m] = covers[0][0].stretch_m;
    assert!((from_m - 0.029).abs() < 1e-15 && (to_m - 0.031).abs() < 1e-15);
}
