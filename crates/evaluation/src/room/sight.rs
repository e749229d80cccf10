//! Lines of sight from people's eyes to the entry point and to the needle behind the guide.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use super::hand_cone::frame_about;
use super::obstacles::PlacedObstacles;

/// Segments per person and stature to the skin about the entry point, and as many to the needle.
pub const SIGHT_SEGMENTS: u32 = 512;
/// Radius of the piece of skin about the entry point that is looked at, m.
pub const ENTRY_DISC_RADIUS_M: f64 = 0.03;
/// Height of that piece over the skin, m: a line to the skin itself would graze it.
pub const ENTRY_DISC_HEIGHT_M: f64 = 2e-3;

/// What is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SightTargets {
    /// Entry point.
    pub entry_m: Point3<f64>,
    /// Outer normal of the skin there, a unit vector.
    pub outwards: Vector3<f64>,
    /// Ends of the needle behind the guide: near the guide's entry, and the hub.
    pub needle_m: [Point3<f64>; 2],
}

/// Which part of the sight is free.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    /// Share of free segments to the skin about the entry point.
    pub entry_fraction: f64,
    /// Share of free segments to the needle behind the guide.
    pub needle_fraction: f64,
    /// The solid that is first in the way of most of the blocked ones.
    pub blocker: Option<String>,
}

/// Point `index` of a sequence that fills the unit cube of five dimensions evenly: multiples of
/// powers of the inverse of the positive root of `x^6 = x + 1` (Roberts, 2018), from the middle.
fn even_point(index: u32) -> [f64; 5] {
    const ROOT: f64 = 1.134_724_138_401_519;
    let mut step = 1.0;
    std::array::from_fn(|_| {
        step /= ROOT;
        (0.5 + f64::from(index + 1) * step).fract()
    })
}

/// Segments from eyes in a ball to the targets, in the order of the sequence: even ones to the
/// skin, odd ones to the needle.
pub fn sight_segments(
    eyes_m: &Point3<f64>,
    head_movement_m: f64,
    targets: &SightTargets,
    count: u32,
) -> impl Iterator<Item = [Point3<f64>; 2]> {
    let [across, beside] = frame_about(&targets.outwards);
    let targets = *targets;
    let eyes_m = *eyes_m;
    (0..2 * count).map(move |index| {
        let [far, height, turn, out, about] = even_point(index / 2);
        // Even in the ball: the cube root spreads the radius, the height is even by Archimedes.
        let radius_m = head_movement_m * far.cbrt();
        let up = 2.0 * height - 1.0;
        let level = (1.0 - up * up).max(0.0).sqrt();
        let (sine, cosine) = (TAU * turn).sin_cos();
        let eye = eyes_m + Vector3::new(level * cosine, level * sine, up) * radius_m;
        let target = if index % 2 == 0 {
            let (sine, cosine) = (TAU * about).sin_cos();
            targets.entry_m
                + targets.outwards * ENTRY_DISC_HEIGHT_M
                + (across * cosine + beside * sine) * (ENTRY_DISC_RADIUS_M * out.sqrt())
        } else {
            targets.needle_m[0] + (targets.needle_m[1] - targets.needle_m[0]) * out
        };
        [eye, target]
    })
}

/// Measures the sight of one person of one stature.
///
/// [`SIGHT_SEGMENTS`] segments each to skin and needle, the same for every configuration, so that
/// differences come from the arm alone. Against half planes the shares are within 0.01 of the true
/// ones (`tests/room.rs`).
pub fn measure_sight(
    obstacles: &PlacedObstacles<'_>,
    eyes_m: &Point3<f64>,
    head_movement_m: f64,
    targets: &SightTargets,
) -> Sight {
    let mut free = [0_u32; 2];
    let mut blocked: Vec<(usize, u32)> = Vec::new();
    let segments = sight_segments(eyes_m, head_movement_m, targets, SIGHT_SEGMENTS);
    for (index, [eye, target]) in segments.enumerate() {
        match obstacles.first_on_the_way(&eye, &target) {
            None => free[index % 2] += 1,
            Some((_, solid)) => match blocked.iter_mut().find(|(known, _)| *known == solid) {
                Some((_, count)) => *count += 1,
                None => blocked.push((solid, 1)),
            },
        }
    }
    let worst = blocked
        .iter()
        .max_by_key(|(solid, count)| (*count, std::cmp::Reverse(*solid)));
    let share = |count: u32| f64::from(count) / f64::from(SIGHT_SEGMENTS);
    Sight {
        entry_fraction: share(free[0]),
        needle_fraction: share(free[1]),
        blocker: worst.map(|(solid, _)| obstacles.name(*solid).to_owned()),
    }
}
