//! Bounds against exact probabilities.

use needlebench_numerics::random::SplitMix64;
use needlebench_probability::{BoundKind, Structure, at_most};

use crate::cells::{NEEDED_M, all, closer, rigid};
use crate::quadrature::in_disc;
use crate::shapes::{Shape, Shapes, case, structure};

/// Of the quadrature, relative.
const ROUNDING: f64 = 1e-9;

#[test]
fn bounds_are_never_below_the_quadrature() {
    /// Of bounds over probabilities where there are half-planes.
    const MEDIAN: f64 = 5.0;
    let mut ratios = Vec::new();
    for (number, cell) in all().iter().enumerate() {
        let with_planes = at_most(
            &case(&cell.law, &cell.structures, &cell.shapes),
            &cell.event,
        )
        .unwrap();
        let Some(with_planes) = with_planes else {
            assert!(cell.event.is_wanted());
            continue;
        };
        let without: Vec<Structure> = cell
            .structures
            .iter()
            .map(|each| structure(each.boundary_sd_m, Vec::new()))
            .collect();
        let stations = at_most(&case(&cell.law, &without, &cell.shapes), &cell.event)
            .unwrap()
            .unwrap();
        assert_eq!(stations.kind, BoundKind::Stations);
        assert_eq!(with_planes.kind, BoundKind::HalfPlanes);
        for bound in [with_planes, stations] {
            let ratio = bound.probability / cell.exact;
            assert!(
                ratio >= 1.0 - ROUNDING,
                "{number}: {bound:?} {:e}",
                cell.exact
            );
        }
        ratios.push(with_planes.probability / cell.exact);
    }
    let [median, largest] = median_and_largest(ratios);
    println!("half-planes: median {median:.2}, largest {largest:.2}");
    assert!(median < MEDIAN, "{median}");
}

fn median_and_largest(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[values.len() - 1]]
}

/// A pipe about the needle has no half-plane.
#[test]
fn bounds_of_what_surrounds_the_needle_are_never_below_the_quadrature() {
    /// Of bounds over probabilities where there are none.
    const MEDIAN: f64 = 30.0;
    let mut random = SplitMix64::new(4);
    let ratios = (0..40).map(|number| {
        let (law, mean_m, sd_m) = rigid(&mut random);
        let widest_m = sd_m[1].max(sd_m[2]);
        let spare_m = random.uniform(1.0, 4.5) * widest_m + 0.3e-3;
        let shapes = Shapes(vec![Shape::Around {
            radius_m: NEEDED_M + spare_m,
        }]);
        let structures = [structure(0.0, Vec::new())];
        let bound = at_most(&case(&law, &structures, &shapes), &closer())
            .unwrap()
            .unwrap();
        let exact = 1.0 - in_disc([mean_m[1], mean_m[2]], [sd_m[1], sd_m[2]], spare_m);
        println!("{number}: {exact:.2e} {:.2e}", bound.probability);
        assert_eq!(bound.kind, BoundKind::Stations);
        assert!(
            bound.probability >= exact * (1.0 - ROUNDING) - 1e-14,
            "{number}: {exact:e} {bound:?}"
        );
        bound.probability / exact
    });
    let [median, largest] = median_and_largest(ratios.collect());
    println!("stations: median {median:.2}, largest {largest:.2}");
    assert!(median < MEDIAN, "{median}");
}
