//! The nearest place where something breaks, about a place where it holds.

use std::f64::consts::{PI, TAU};

/// How a break is looked for along a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Search {
    /// Farthest distance.
    pub limit: f64,
    /// Distance of two places that are looked at.
    pub step: f64,
    /// Width within which a break is located.
    pub resolution: f64,
}

/// Halvings of the angle in which the pattern search turns the direction.
const REFINEMENTS: u32 = 8;

/// The nearest break: its distance, its place, and what breaks; `None` within the limit.
///
/// `breaks` says what breaks at an offset, if anything does.
pub(super) fn nearest_break<const N: usize>(
    search: &Search,
    directions: &[[f64; N]],
    mut breaks: impl FnMut(&[f64; N]) -> Option<String>,
) -> Option<(f64, [f64; N], String)> {
    if let Some(detail) = breaks(&[0.0; N]) {
        return Some((0.0, [0.0; N], detail));
    }
    let mut best: Option<(f64, [f64; N], String)> = None;
    for direction in directions {
        let limit = best.as_ref().map_or(search.limit, |(radius, ..)| *radius);
        if let Some((radius, detail)) = first_break(search, direction, limit, &mut breaks) {
            best = Some((radius, *direction, detail));
        }
    }
    let (mut radius, mut direction, mut detail) = best?;
    // As wide as the directions are apart at first.
    let mut angle_rad = PI / (directions.len() as f64).powf(1.0 / (N as f64 - 1.0));
    for _ in 0..REFINEMENTS {
        let mut found = true;
        while found {
            found = false;
            for turned in turned(&direction, angle_rad) {
                let limit = radius - search.resolution;
                if let Some((nearer, what)) = first_break(search, &turned, limit, &mut breaks) {
                    (radius, direction, detail) = (nearer, turned, what);
                    found = true;
                    break;
                }
            }
        }
        angle_rad *= 0.5;
    }
    Some((radius, direction.map(|share| share * radius), detail))
}

/// Distance of the first break along a direction, not beyond the limit.
fn first_break<const N: usize>(
    search: &Search,
    direction: &[f64; N],
    limit: f64,
    breaks: &mut impl FnMut(&[f64; N]) -> Option<String>,
) -> Option<(f64, String)> {
    let mut at = |radius: f64| breaks(&direction.map(|share| share * radius));
    let mut good = 0.0;
    while good < limit {
        let mut bad = (good + search.step).min(limit);
        if let Some(mut detail) = at(bad) {
            while bad - good > search.resolution {
                let middle = f64::midpoint(good, bad);
                match at(middle) {
                    Some(here) => (bad, detail) = (middle, here),
                    None => good = middle,
                }
            }
            return Some((bad, detail));
        }
        good = bad;
    }
    None
}

/// A direction turned by an angle both ways towards each direction of a basis across it.
fn turned<const N: usize>(direction: &[f64; N], angle_rad: f64) -> Vec<[f64; N]> {
    let (sine, cosine) = angle_rad.sin_cos();
    let mut basis: Vec<[f64; N]> = vec![*direction];
    for axis in 0..N {
        let mut across = [0.0; N];
        across[axis] = 1.0;
        for known in &basis {
            let along = dot(&across, known);
            across = std::array::from_fn(|i| across[i] - along * known[i]);
        }
        let length = dot(&across, &across).sqrt();
        // The axis that lies nearest to what is there already is left out.
        if length > 1.0 / (2.0 * N as f64) && basis.len() < N {
            basis.push(across.map(|share| share / length));
        }
    }
    let across = basis.into_iter().skip(1);
    across
        .flat_map(|across| {
            [sine, -sine]
                .map(|sine| std::array::from_fn(|i| direction[i] * cosine + across[i] * sine))
        })
        .collect()
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The six axes and directions spread evenly over the sphere: a Fibonacci lattice.
pub(super) fn on_sphere(count: u32) -> Vec<[f64; 3]> {
    let golden_rad = PI * (3.0 - 5.0_f64.sqrt());
    let mut directions = Vec::new();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut direction = [0.0; 3];
            direction[axis] = sign;
            directions.push(direction);
        }
    }
    directions.extend((0..count).map(|k| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
        let across = (1.0 - z * z).sqrt();
        let (sine, cosine) = (golden_rad * f64::from(k)).sin_cos();
        [across * cosine, across * sine, z]
    }));
    directions
}

/// Directions spread evenly over the circle.
pub(super) fn on_circle(count: u32) -> Vec<[f64; 2]> {
    (0..count.max(1))
        .map(|k| {
            let (sine, cosine) = (TAU * f64::from(k) / f64::from(count.max(1))).sin_cos();
            [cosine, sine]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCH: Search = Search {
        limit: 50.0,
        step: 2.0,
        resolution: 0.01,
    };

    /// The last refinement turns by less than 0.3 degrees, and the distance grows by the angle squared.
    const TOLERANCE: f64 = 0.015;

    fn when(is_broken: bool) -> Option<String> {
        is_broken.then(|| "broken".to_owned())
    }

    #[test]
    fn the_distance_of_a_plane_is_found_whatever_its_direction() {
        for normal in on_sphere(25) {
            let found = nearest_break(&SEARCH, &on_sphere(32), |at| when(dot(at, &normal) > 17.3));
            let (radius, offset, _) = found.unwrap();
            assert!((0.0..TOLERANCE).contains(&(radius - 17.3)), "{radius}");
            assert!(dot(&offset, &normal) > 17.3, "the evidence is broken");
        }
    }

    #[test]
    fn the_reach_of_an_arm_is_the_distance_to_its_sphere() {
        // Within 600 of a point that lies 585 away: 15 outwards, by no other way less.
        let towards = [2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0];
        let found = nearest_break(&SEARCH, &on_sphere(32), |at| {
            let wrist: [f64; 3] = std::array::from_fn(|i| 585.0 * towards[i] + at[i]);
            when(dot(&wrist, &wrist).sqrt() > 600.0)
        });
        let (radius, ..) = found.unwrap();
        assert!((0.0..TOLERANCE).contains(&(radius - 15.0)), "{radius}");
    }

    #[test]
    fn a_turn_is_looked_for_in_both_angles() {
        let (sine, cosine) = 0.4_f64.sin_cos();
        let found = nearest_break(&SEARCH, &on_circle(16), |[yaw, roll]| {
            when(yaw * cosine + roll * sine < -6.25)
        });
        let (radius, ..) = found.unwrap();
        assert!((0.0..TOLERANCE).contains(&(radius - 6.25)), "{radius}");
    }

    #[test]
    fn nothing_breaks_beyond_the_limit_and_what_is_broken_has_no_radius() {
        assert_eq!(
            nearest_break(&SEARCH, &on_sphere(32), |at| when(at[0] > 51.0)),
            None
        );
        let found = nearest_break(&SEARCH, &on_sphere(32), |_| when(true));
        assert_eq!(found.unwrap().0, 0.0);
    }

    #[test]
    fn a_gap_longer_than_the_step_is_not_jumped() {
        let found = nearest_break(&SEARCH, &on_sphere(32), |at| {
            when((11.0..13.5).contains(&at[2]) || at[2] > 30.0)
        });
        let (radius, ..) = found.unwrap();
        assert!((0.0..TOLERANCE).contains(&(radius - 11.0)), "{radius}");
    }
}
