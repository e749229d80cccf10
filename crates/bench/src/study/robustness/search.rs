//! The nearest place where something breaks, about a place where it holds.

use std::f64::consts::{PI, TAU};

/// How a break is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Search {
    /// Farthest distance.
    pub limit: f64,
    /// Distance of two places that are looked at along a direction.
    pub step: f64,
    /// Width within which a break is located.
    pub resolution: f64,
    /// Points of the ball within the nearest break that are looked at, over and over until none breaks.
    pub points: u32,
}

/// What is seen at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It holds.
    Holds,
    /// It breaks.
    Breaks,
    /// There is no such place: neither a break nor a sign that it holds.
    Impossible,
}

/// A break.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Break<const N: usize> {
    /// Its distance.
    pub radius: f64,
    /// Its direction.
    pub direction: [f64; N],
    /// Where it was seen to break: there, up to rounding.
    pub seen_at: [f64; N],
}

impl<const N: usize> Break<N> {
    /// Its place.
    pub fn offset(&self) -> [f64; N] {
        self.direction.map(|share| share * self.radius)
    }
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found<const N: usize> {
    /// The nearest break; none within the limit.
    pub nearest: Option<Break<N>>,
    /// Points of the last sweep of the ball within it, none of which breaks.
    pub points: u32,
    /// Those of them that are no places.
    pub impossible: u32,
    /// Whether the last sweep found nothing: otherwise the search was given up.
    pub settled: bool,
}

/// Halvings of the angle in which the pattern search turns the direction.
const REFINEMENTS: u32 = 8;

/// Directions whose breaks are the nearest, about each of which the pattern search starts.
const STARTS: usize = 4;

/// Sweeps after which the search is given up; each ends with a break that is nearer by a resolution, and
/// many of them by much more.
const MOST_SWEEPS: u32 = 64;

/// The nearest break that is found: along directions, about those with the nearest ones, and by even points
/// of the ball within.
pub(super) fn nearest_break<const N: usize>(
    search: &Search,
    directions: &[[f64; N]],
    mut look: impl FnMut(&[f64; N]) -> Verdict,
) -> Found<N> {
    let mut found = Found {
        nearest: None,
        points: 0,
        impossible: 0,
        settled: true,
    };
    if look(&[0.0; N]) == Verdict::Breaks {
        found.nearest = Some(Break {
            radius: 0.0,
            direction: [0.0; N],
            seen_at: [0.0; N],
        });
        return found;
    }
    if search.limit <= 0.0 {
        return found;
    }
    // By direction, the nearest first.
    let mut breaks: Vec<Break<N>> = Vec::new();
    for direction in directions {
        // Some farther ones are kept: another cone may begin behind the nearest break of the directions.
        let kept = breaks.get(STARTS - 1);
        let limit = kept.map_or(search.limit, |kept| kept.radius);
        if let Some(found) = first_break(search, direction, limit, &mut look) {
            let at = breaks.partition_point(|known| known.radius <= found.radius);
            breaks.insert(at, found);
            breaks.truncate(STARTS);
        }
    }
    // As wide as the directions are apart at first.
    let wide_rad = PI / libm::pow(directions.len() as f64, 1.0 / (N as f64 - 1.0));
    let mut best: Option<Break<N>> = None;
    for start in breaks {
        let refined = refine(search, start, wide_rad, &mut look);
        if best.is_none_or(|best| refined.radius < best.radius) {
            best = Some(refined);
        }
    }
    for sweep in 0..MOST_SWEEPS {
        let radius = best.map_or(search.limit, |best| best.radius);
        let inner = radius
            - if best.is_some() {
                search.resolution
            } else {
                0.0
            };
        (found.points, found.impossible, found.settled) = (0, 0, true);
        for point in 0..search.points {
            let offset = in_ball::<N>(sweep * search.points + point, inner);
            found.points += 1;
            match look(&offset) {
                Verdict::Holds => {}
                Verdict::Impossible => found.impossible += 1,
                Verdict::Breaks => {
                    let distance = dot(&offset, &offset).sqrt();
                    let direction = offset.map(|share| share / distance);
                    let here = Break {
                        radius: distance,
                        direction,
                        seen_at: offset,
                    };
                    // The first one on the way there, if there is another.
                    let start =
                        first_break(search, &direction, distance, &mut look).unwrap_or(here);
                    best = Some(refine(search, start, wide_rad, &mut look));
                    found.settled = false;
                    break;
                }
            }
        }
        if found.settled {
            break;
        }
    }
    found.nearest = best;
    found
}

/// Turns a direction with a break towards nearer ones.
fn refine<const N: usize>(
    search: &Search,
    mut best: Break<N>,
    wide_rad: f64,
    look: &mut impl FnMut(&[f64; N]) -> Verdict,
) -> Break<N> {
    let mut angle_rad = wide_rad;
    for _ in 0..REFINEMENTS {
        let mut found = true;
        while found {
            found = false;
            for turned in turned(&best.direction, angle_rad) {
                let limit = best.radius - search.resolution;
                if let Some(nearer) = first_break(search, &turned, limit, look) {
                    best = nearer;
                    found = true;
                    break;
                }
            }
        }
        angle_rad *= 0.5;
    }
    best
}

/// The first break along a direction, not beyond the limit. Where there is no place it is looked on behind
/// it.
fn first_break<const N: usize>(
    search: &Search,
    direction: &[f64; N],
    limit: f64,
    look: &mut impl FnMut(&[f64; N]) -> Verdict,
) -> Option<Break<N>> {
    let place = |radius: f64| direction.map(|share| share * radius);
    let mut before = 0.0;
    while before < limit {
        let mut bad = (before + search.step).min(limit);
        if look(&place(bad)) == Verdict::Breaks {
            while bad - before > search.resolution {
                let middle = f64::midpoint(before, bad);
                match look(&place(middle)) {
                    Verdict::Breaks => bad = middle,
                    Verdict::Holds | Verdict::Impossible => before = middle,
                }
            }
            return Some(Break {
                radius: bad,
                direction: *direction,
                seen_at: place(bad),
            });
        }
        before = bad;
    }
    None
}

/// A point of an evenly spread sequence in a ball: Roberts' additive recurrence on the positive root of
/// `x^(N+1) = x + 1` (2018), mapped so that equal volumes have equal numbers of points.
fn in_ball<const N: usize>(number: u32, radius: f64) -> [f64; N] {
    // The root, by iteration: each step halves the error and more.
    let root = (0..64).fold(2.0_f64, |x, _| libm::pow(1.0 + x, 1.0 / (N as f64 + 1.0)));
    let mut power = 1.0;
    let coordinates: [f64; N] = std::array::from_fn(|_| {
        power /= root;
        (0.5 + power * (f64::from(number) + 1.0)).fract()
    });
    let far = radius * libm::pow(coordinates[0], 1.0 / N as f64);
    let turn = TAU * coordinates[N - 1];
    let mut point = [0.0; N];
    let across = if N == 3 {
        let z = 2.0 * coordinates[1] - 1.0;
        point[2] = far * z;
        far * (1.0 - z * z).max(0.0).sqrt()
    } else {
        far
    };
    (point[0], point[1]) = (across * libm::cos(turn), across * libm::sin(turn));
    point
}

/// A direction turned by an angle both ways towards each direction of a basis across it.
fn turned<const N: usize>(direction: &[f64; N], angle_rad: f64) -> Vec<[f64; N]> {
    let (sine, cosine) = libm::sincos(angle_rad);
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
        let (sine, cosine) = libm::sincos(golden_rad * f64::from(k));
        [across * cosine, across * sine, z]
    }));
    directions
}

/// Directions spread evenly over the circle.
pub(super) fn on_circle(count: u32) -> Vec<[f64; 2]> {
    (0..count.max(1))
        .map(|k| {
            let (sine, cosine) = libm::sincos(TAU * f64::from(k) / f64::from(count.max(1)));
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
        points: 2048,
    };

    /// The last refinement turns by less than 0.3 degrees, and the distance grows by the angle squared.
    const TOLERANCE: f64 = 0.015;

    fn when(is_broken: bool) -> Verdict {
        if is_broken {
            Verdict::Breaks
        } else {
            Verdict::Holds
        }
    }

    #[test]
    fn the_distance_of_a_plane_is_found_whatever_its_direction() {
        for normal in on_sphere(25) {
            let found = nearest_break(&SEARCH, &on_sphere(32), |at| when(dot(at, &normal) > 17.3));
            let nearest = found.nearest.unwrap();
            let radius = nearest.radius;
            assert!((0.0..TOLERANCE).contains(&(radius - 17.3)), "{radius}");
            assert!(
                dot(&nearest.offset(), &normal) > 17.3,
                "the evidence is broken"
            );
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
        let radius = found.nearest.unwrap().radius;
        assert!((0.0..TOLERANCE).contains(&(radius - 15.0)), "{radius}");
    }

    #[test]
    fn a_turn_is_looked_for_in_both_angles() {
        let (sine, cosine) = libm::sincos(0.4_f64);
        let found = nearest_break(&SEARCH, &on_circle(16), |[yaw, roll]| {
            when(yaw * cosine + roll * sine < -6.25)
        });
        let radius = found.nearest.unwrap().radius;
        assert!((0.0..TOLERANCE).contains(&(radius - 6.25)), "{radius}");
    }

    #[test]
    fn nothing_breaks_beyond_the_limit_and_what_is_broken_has_no_radius() {
        let found = nearest_break(&SEARCH, &on_sphere(32), |at| when(at[0] > 51.0));
        assert_eq!(
            (found.nearest, found.points, found.settled),
            (None, 2048, true)
        );
        let found = nearest_break(&SEARCH, &on_sphere(32), |_| when(true));
        assert_eq!(found.nearest.unwrap().radius, 0.0);
    }

    #[test]
    fn a_gap_longer_than_the_step_is_not_jumped() {
        let found = nearest_break(&SEARCH, &on_sphere(32), |at| {
            when((11.0..13.5).contains(&at[2]) || at[2] > 30.0)
        });
        let radius = found.nearest.unwrap().radius;
        assert!((0.0..TOLERANCE).contains(&(radius - 11.0)), "{radius}");
    }

    #[test]
    fn a_narrow_cone_between_the_directions_is_found() {
        // A cone of 4 degrees about a direction of none of those, and a plane far behind it.
        let axis = [0.53, -0.41, 0.742_293_471_610_2];
        let found = nearest_break(&SEARCH, &on_sphere(32), |at| {
            let far = dot(at, at).sqrt();
            when(at[0] > 45.0 || far > 30.0 && dot(at, &axis) > 0.997_6 * far)
        });
        let radius = found.nearest.unwrap().radius;
        assert!((0.0..TOLERANCE).contains(&(radius - 30.0)), "{radius}");
    }

    #[test]
    fn a_place_that_does_not_exist_is_no_break_and_does_not_hold() {
        // A slab that does not exist hides the plane's nearest part; a half of the ball does not exist.
        let found = nearest_break(&SEARCH, &on_sphere(32), |at| {
            if (10.0..20.0).contains(&at[2]) || at[1] < 0.0 {
                Verdict::Impossible
            } else {
                when(at[2] > 15.0)
            }
        });
        let nearest = found.nearest.unwrap();
        let (radius, offset) = (nearest.radius, nearest.offset());
        assert!((0.0..TOLERANCE).contains(&(radius - 20.0)), "{radius}");
        assert!(offset[2] >= 20.0 && offset[1] >= 0.0);
        let share = f64::from(found.impossible) / f64::from(found.points);
        // Half of the ball, and of the other half the cap above 10 of 20: 5/32.
        assert!((share - (0.5 + 0.5 * 5.0 / 32.0)).abs() < 0.01, "{share}");
    }

    #[test]
    fn points_fill_the_ball_evenly() {
        let points: Vec<[f64; 3]> = (0..4000).map(|number| in_ball(number, 2.0)).collect();
        for axis in 0..3 {
            let count = |wanted: &dyn Fn(&[f64; 3]) -> bool| {
                points.iter().filter(|point| wanted(point)).count() as f64 / 4000.0
            };
            assert!((count(&|point| point[axis] > 0.0) - 0.5).abs() < 0.01);
            // A cap of half the radius is 5/32 of a ball.
            assert!((count(&|point| point[axis] > 1.0) - 5.0 / 32.0).abs() < 0.01);
        }
        assert!(points.iter().all(|point| dot(point, point) <= 4.0 + 1e-12));
    }
}
