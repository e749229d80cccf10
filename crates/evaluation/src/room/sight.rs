//! Lines of sight from people's eyes to the entry point and to the needle behind the guide.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use super::hand_cone::frame_about;
use super::obstacles::{Ball, PlacedObstacles, SightLines};

/// Segments of one series, to the skin about the entry point and as many to the needle.
pub(crate) const SIGHT_SEGMENTS: u32 = 512;
/// Series of segments per person and stature, each evenly spread and shifted at random against the
/// others: what they differ by says how far their mean may be off.
pub(crate) const SIGHT_SERIES: u32 = 8;
/// Quantile of Student's t distribution for 95 % and seven degrees of freedom.
const STUDENT_95: f64 = 2.365;
/// Radius of the piece of skin about the entry point that is looked at, m.
pub(crate) const ENTRY_DISC_RADIUS_M: f64 = 0.03;
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

impl SightTargets {
    /// Whether no point of the needle is farther from that of other targets at the same entry.
    pub(super) fn is_within(&self, other: &Self, distance_m: f64) -> bool {
        let mut ends = self.needle_m.iter().zip(&other.needle_m);
        ends.all(|(a, b)| (a - b).norm() <= distance_m)
    }

    /// Middle of the piece of skin that is looked at.
    fn skin_m(&self) -> Point3<f64> {
        self.entry_m + self.outwards * ENTRY_DISC_HEIGHT_M
    }

    /// Lines from eyes in a ball past solids: to the skin, and to the needle.
    fn lines<'p>(
        &self,
        solids: &'p PlacedObstacles<'_>,
        eyes_m: &Point3<f64>,
        head_movement_m: f64,
    ) -> [SightLines<'p>; 2] {
        let [near, hub] = &self.needle_m;
        let eyes = Ball {
            center_m: *eyes_m,
            radius_m: head_movement_m,
        };
        let skin = Ball {
            center_m: self.skin_m(),
            radius_m: ENTRY_DISC_RADIUS_M,
        };
        let needle = Ball {
            center_m: nalgebra::center(near, hub),
            radius_m: 0.5 * (near - hub).norm(),
        };
        [skin, needle].map(|target| solids.lines_between(&eyes, &target))
    }
}

/// Which part of the sight the robot leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    /// Of the segments to the skin about the entry point that phantom, table, gantry, mount and obstacles leave
    /// free, the share that arm and tool leave free too; 0 where nothing is to be seen at all.
    pub entry_fraction: f64,
    /// The same of the segments to the needle behind the guide.
    pub needle_fraction: f64,
    /// Mean of the two shares of all segments that are free without the robot.
    pub without_robot_fraction: f64,
    /// 95 of 100 such means of the two fractions lie within this of the true one: estimated from how
    /// much the series differ. At least the share of one segment.
    pub accuracy: f64,
    /// The solid of the robot that is in the way of most of the segments.
    pub blocker: Option<String>,
}

/// Point `index` of a sequence that fills the unit cube of five dimensions evenly: multiples of
/// powers of the inverse of the positive root of `x^6 = x + 1` (Roberts, 2018), from `start`.
fn even_point(index: u32, start: &[f64; 5]) -> [f64; 5] {
    const ROOT: f64 = 1.134_724_138_401_519;
    let mut step = 1.0;
    start.map(|start| {
        step /= ROOT;
        (start + f64::from(index + 1) * step).fract()
    })
}

/// Where the series start: the first in the middle of the cube, the others at random, always the same.
fn starts() -> impl Iterator<Item = [f64; 5]> {
    // Steele, Lea and Flood, Fast splittable pseudorandom number generators (2014).
    let mut state = 0x0005_1947_u64;
    let mut uniform = move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = state;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..SIGHT_SERIES).map(move |series| match series {
        0 => [0.5; 5],
        _ => std::array::from_fn(|_| uniform()),
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
    series(eyes_m, head_movement_m, targets, count, [0.5; 5])
}

fn series(
    eyes_m: &Point3<f64>,
    head_movement_m: f64,
    targets: &SightTargets,
    count: u32,
    start: [f64; 5],
) -> impl Iterator<Item = [Point3<f64>; 2]> + use<> {
    let [across, beside] = frame_about(&targets.outwards);
    let targets = *targets;
    let eyes_m = *eyes_m;
    (0..2 * count).map(move |index| {
        let [far, height, turn, out, about] = even_point(index / 2, &start);
        // Even in the ball: the cube root spreads the radius, the height is even by Archimedes.
        let radius_m = head_movement_m * libm::cbrt(far);
        let up = 2.0 * height - 1.0;
        let level = (1.0 - up * up).max(0.0).sqrt();
        let (sine, cosine) = libm::sincos(TAU * turn);
        let eye = eyes_m + Vector3::new(level * cosine, level * sine, up) * radius_m;
        let target = if index % 2 == 0 {
            let (sine, cosine) = libm::sincos(TAU * about);
            targets.skin_m()
                + (across * cosine + beside * sine) * (ENTRY_DISC_RADIUS_M * out.sqrt())
        } else {
            targets.needle_m[0] + (targets.needle_m[1] - targets.needle_m[0]) * out
        };
        [eye, target]
    })
}

/// Lines of sight of one person of one stature, and which of them phantom, table, gantry, mount and obstacles leave
/// free: the same for every configuration, so it is found once.
///
/// `SIGHT_SERIES` times `SIGHT_SEGMENTS` segments each to skin and needle.
#[derive(Debug, Clone)]
pub struct OpenLines {
    eyes_m: Point3<f64>,
    head_movement_m: f64,
    targets: SightTargets,
    /// By segment, the series one after the other.
    is_open: Vec<bool>,
}

impl OpenLines {
    /// Past the surroundings.
    pub fn new(
        surroundings: &PlacedObstacles<'_>,
        eyes_m: &Point3<f64>,
        head_movement_m: f64,
        targets: &SightTargets,
    ) -> Self {
        let mut past = targets.lines(surroundings, eyes_m, head_movement_m);
        let is_open = starts()
            .flat_map(|start| series(eyes_m, head_movement_m, targets, SIGHT_SEGMENTS, start))
            .enumerate()
            .map(|(index, [eye, target])| !past[index % 2].is_in_the_way(&eye, &target))
            .collect();
        Self {
            eyes_m: *eyes_m,
            head_movement_m,
            targets: *targets,
            is_open,
        }
    }

    /// What a robot leaves of them.
    ///
    /// [`Sight::accuracy`] says how far the shares may be from the true ones.
    pub fn past(&self, robot: &PlacedObstacles<'_>) -> Sight {
        /// Segments that the surroundings leave, and those of them that the robot leaves; to skin and needle.
        type Counts = [[u32; 2]; 2];
        let share = |of: f64, all: f64| if all > 0.0 { of / all } else { 0.0 };
        let fractions =
            |counts: &Counts| counts.map(|[open, free]| share(f64::from(free), f64::from(open)));
        let mut blocked: Vec<(usize, u32)> = Vec::new();
        let mut all: Counts = [[0; 2]; 2];
        let mut means = Vec::new();
        let mut past_robot = self
            .targets
            .lines(robot, &self.eyes_m, self.head_movement_m);
        let of_series = self.is_open.chunks(2 * SIGHT_SEGMENTS as usize);
        for (start, is_open) in starts().zip(of_series) {
            let mut counts: Counts = [[0; 2]; 2];
            let segments = series(
                &self.eyes_m,
                self.head_movement_m,
                &self.targets,
                SIGHT_SEGMENTS,
                start,
            );
            for (index, ([eye, target], is_open)) in segments.zip(is_open).enumerate() {
                if !is_open {
                    continue;
                }
                let [open, free] = &mut counts[index % 2];
                *open += 1;
                match past_robot[index % 2].first_on_the_way(&eye, &target) {
                    None => *free += 1,
                    Some((_, solid)) => {
                        match blocked.iter_mut().find(|(known, _)| *known == solid) {
                            Some((_, count)) => *count += 1,
                            None => blocked.push((solid, 1)),
                        }
                    }
                }
            }
            let [entry, needle] = fractions(&counts);
            means.push(0.5 * (entry + needle));
            for (sum, of_series) in all.iter_mut().flatten().zip(counts.iter().flatten()) {
                *sum += of_series;
            }
        }
        let worst = blocked
            .iter()
            .max_by_key(|(solid, count)| (*count, std::cmp::Reverse(*solid)));
        let series = f64::from(SIGHT_SERIES);
        let mean = means.iter().sum::<f64>() / series;
        let squares: f64 = means.iter().map(|each| (each - mean) * (each - mean)).sum();
        let standard_error = (squares / (series - 1.0) / series).sqrt();
        let [entry_fraction, needle_fraction] = fractions(&all);
        let segments = series * f64::from(SIGHT_SEGMENTS);
        let open: f64 = all.iter().map(|[open, _]| f64::from(*open)).sum();
        Sight {
            entry_fraction,
            needle_fraction,
            without_robot_fraction: 0.5 * open / segments,
            accuracy: (STUDENT_95 * standard_error).max(1.0 / segments),
            blocker: worst.map(|(solid, _)| robot.name(*solid).to_owned()),
        }
    }
}
