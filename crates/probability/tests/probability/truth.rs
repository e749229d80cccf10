//! Estimates against exact probabilities.

use nalgebra::Vector3;
use needlebench_probability::{BendDirection, Draws, Estimate, Told, at_most, estimate};

use crate::cells::{Cell, all};
use crate::shapes::{Shape, case};

fn estimated(cell: &Cell, seed: u64, most: u64) -> Estimate {
    let case = case(&cell.law, &cell.structures, &cell.shapes);
    let draws = Draws {
        seed,
        most,
        threads: 2,
        moves: true,
    };
    estimate(&case, std::slice::from_ref(&cell.event), &draws)
        .unwrap()
        .remove(0)
}

/// Standard errors that an estimate is off by; a whole interval is 2 x 1.96 of them, in the logarithm.
fn errors(estimate: &Estimate, exact: f64) -> f64 {
    let probability = estimate.probability.unwrap();
    let width = libm::log(estimate.interval.high / estimate.interval.low);
    libm::log(probability / exact) / (width / (2.0 * 1.96))
}

#[test]
fn estimates_are_those_of_the_quadrature() {
    /// Of 90 cells one is beyond 4 standard errors in 200 runs.
    const MOST_ERRORS: f64 = 4.0;
    /// Of 90 intervals of 95 % more than 11 do not cover in 1 % of all runs.
    const MOST_OUTSIDE: usize = 11;
    let cells = all();
    let mut outside = 0;
    for (number, cell) in cells.iter().enumerate() {
        let found = estimated(cell, 7, 1_000_000);
        assert_eq!(
            found.told,
            Told::Estimated,
            "{number}: {found:?}, {:e}",
            cell.exact
        );
        let off = errors(&found, cell.exact);
        println!(
            "{number}: {:.3e} {:.3e} {off:.2} {:?} {} {:.0}",
            cell.exact,
            found.probability.unwrap(),
            found.method,
            found.draws,
            found.effective_size
        );
        assert!(
            off.abs() < MOST_ERRORS,
            "{number}: {off}, {found:?}, {:e}",
            cell.exact
        );
        outside += usize::from(!found.interval.contains(cell.exact));
    }
    println!("{outside} of {} outside", cells.len());
    assert!(outside <= MOST_OUTSIDE, "{outside}");
}

/// How often of 200 runs the interval holds the exact value.
fn covered(cell: &Cell, most: u64) -> u32 {
    (0..200)
        .map(|seed| {
            u32::from(
                estimated(cell, 1000 + seed, most)
                    .interval
                    .contains(cell.exact),
            )
        })
        .sum()
}

/// Of 200 intervals of 95 % fewer than 183 hold the value in 1 % of all runs.
const FEWEST: u32 = 183;

#[test]
fn intervals_of_plain_draws_cover() {
    let cells = all();
    let likely = cells.iter().find(|cell| cell.exact > 0.01).unwrap();
    let covered = covered(likely, 10_000);
    println!("{covered} of 200 at {:.2e}", likely.exact);
    assert!(covered >= FEWEST, "{covered}");
}

#[test]
fn intervals_of_importance_sampling_cover() {
    let cells = all();
    let rare = cells
        .iter()
        .find(|cell| (1e-6..1e-4).contains(&cell.exact))
        .unwrap();
    let covered = covered(rare, 10_000);
    println!("{covered} of 200 at {:.2e}", rare.exact);
    assert!(covered >= FEWEST, "{covered}");
}

/// A minute; `cargo test -p needlebench-probability -- --ignored --nocapture` prints it.
#[test]
#[ignore = "a minute: prints the coverage of all cells"]
fn intervals_of_all_cells_cover() {
    let mut worst = 200;
    for (number, cell) in all().iter().enumerate() {
        let covered = covered(cell, 1_000_000);
        println!("{number}: {:.2e} {covered}", cell.exact);
        worst = worst.min(covered);
    }
    println!("worst {worst} of 200");
}

/// A line of JSON for each cell, for `tests/validation/probability/compare.py`.
#[test]
#[ignore = "prints all cells for a check in SciPy"]
fn cells_are_printed() {
    println!();
    for cell in all() {
        let case = case(&cell.law, &cell.structures, &cell.shapes);
        let found = estimated(cell, 7, 1_000_000);
        let bound = at_most(&case, &cell.event)
            .unwrap()
            .map_or(1.0, |bound| bound.probability);
        let law = &cell.law;
        let failing = law.holds().last().filter(|hold| hold.failed_m.is_some());
        let vector = |vector: Vector3<f64>| [vector.x, vector.y, vector.z];
        let breath = failing.map_or([[0.0; 3]; 2], |hold| {
            [hold.level_sd_m[1], hold.failed_m.unwrap()[1]].map(vector)
        });
        let bend = law.bend().map_or("none", |bend| match bend.direction() {
            BendDirection::Known { .. } => "known",
            BendDirection::Unknown => "unknown",
        });
        let shape = match cell.shapes.0[0] {
            Shape::HalfSpace { normal, offset_m } => ("half-space", vector(normal), offset_m),
            Shape::Ball { centre_m, radius_m } => ("ball", vector(centre_m.coords), radius_m),
            Shape::Around { .. } | Shape::Rod { .. } => unreachable!("no such cells"),
        };
        println!(
            "{{\"mean_m\": {:?}, \"covariance_m2\": {:?}, \"breath_m\": {breath:?}, \"bend\": \"{bend}\", \
             \"shape\": \"{}\", \"at_m\": {:?}, \"size_m\": {:?}, \"boundary_sd_m\": {:?}, \"wanted\": {}, \
             \"probability\": {:?}, \"low\": {:?}, \"high\": {:?}, \"at_most\": {bound:?}, \"exact\": {:?}}}",
            law.mean_m().as_slice(),
            law.covariance_m2().as_slice(),
            shape.0,
            shape.1,
            shape.2,
            cell.structures[0].boundary_sd_m,
            cell.event.is_wanted(),
            found.probability.unwrap(),
            found.interval.low,
            found.interval.high,
            cell.exact,
        );
    }
}
