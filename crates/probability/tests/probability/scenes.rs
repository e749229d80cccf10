//! Bounds and estimates in scenes that are sampled.

use nalgebra::{Point3, Vector6};
use needlebench_numerics::random::SplitMix64;
use needlebench_probability::{
    BendDirection, Draws, Event, HalfPlane, Law, Told, at_most, estimate,
};

use crate::common::{correlated, failing, part, quadratic};
use crate::shapes::{DEPTH_M, Shape, Shapes, case, structure};

/// Bends, failed holds, means, boundaries; balls and rods wherever they are.
#[test]
fn bounds_are_not_below_estimates_in_random_scenes() {
    const SCENES: u32 = 40;
    let mut random = SplitMix64::new(8);
    let mut compared = 0;
    for scene in 0..SCENES {
        let mut sds = || -> [f64; 3] { std::array::from_fn(|_| random.uniform(0.3e-3, 1.4e-3)) };
        let covariance = correlated(sds(), sds(), random.uniform(-0.3, 0.95));
        let direction = if scene % 2 == 0 {
            BendDirection::Unknown
        } else {
            BendDirection::Known {
                spread_rad: random.uniform(0.0, 0.5),
            }
        };
        let bend = (scene % 5 != 0).then(|| quadratic(random.uniform(0.2e-3, 2e-3), direction));
        let mut vector =
            |size_m: f64| nalgebra::Vector3::from_fn(|_, _| random.uniform(-size_m, size_m));
        let holds = if scene % 3 == 0 {
            Vec::new()
        } else {
            failing(vector(0.5e-3), vector(6e-3))
        };
        let mean = Vector6::from_fn(|_, _| random.uniform(-0.8e-3, 0.8e-3));
        let law = Law::new(mean, vec![part("arm", &covariance)], bend, holds).unwrap();
        let (sine, cosine) = libm::sincos(random.uniform(-3.0, 3.0));
        let radius_m = random.uniform(0.5e-3, 3e-3);
        let away_m = radius_m + random.uniform(3e-3, 8e-3);
        let centre_m = Point3::new(
            random.uniform(-0.005, DEPTH_M + 0.005),
            away_m * cosine,
            away_m * sine,
        );
        let (shape, covers) = if scene % 4 == 3 {
            let axis = nalgebra::Vector3::new(random.uniform(-0.5, 0.5), -sine, cosine).normalize();
            let shape = Shape::Rod {
                point_m: centre_m,
                axis,
                radius_m,
            };
            (shape, Vec::new())
        } else {
            let shape = Shape::Ball { centre_m, radius_m };
            (shape, HalfPlane::covers(&[centre_m], 1, radius_m))
        };
        let boundary_sd_m = random.uniform(0.0, 0.8e-3) * f64::from(scene % 2);
        let structures = [structure(boundary_sd_m, covers)];
        let shapes = Shapes(vec![shape]);
        let case = case(&law, &structures, &shapes);
        let event = Event::Closer {
            structure: 0,
            margin_m: 0.3e-3,
        };
        let bound = at_most(&case, &event).unwrap().unwrap();
        let draws = Draws {
            seed: u64::from(scene),
            most: 100_000,
            threads: 2,
            moves: true,
        };
        let found = estimate(&case, &[event], &draws).unwrap().remove(0);
        println!(
            "{scene}: {bound:?} {:?} {:?}",
            found.probability, found.method
        );
        if found.told == Told::Estimated {
            // Three standard errors, of which the interval has two on either side.
            let probability = found.probability.unwrap();
            let least = probability - 1.5 * (probability - found.interval.low);
            assert!(bound.probability >= least, "{scene}: {bound:?} {found:?}");
            compared += 1;
        }
    }
    assert!(compared > SCENES / 2, "{compared}");
}
