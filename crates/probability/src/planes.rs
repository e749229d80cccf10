//! Half-planes along the needle that a structure lies beyond.

use nalgebra::{Point3, Vector2};

/// A half-space along the planned needle, over a stretch of it: what lies in it has `normal . (y, z) >= offset_m` and x
/// within the stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfPlane {
    /// Unit vector in y and z, from the needle towards the structure.
    pub normal: Vector2<f64>,
    /// Distance of its boundary from the planned axis, m.
    pub offset_m: f64,
    /// Least and largest x of what lies in it, m; may be infinite.
    pub stretch_m: [f64; 2],
}

/// Normals that are tried.
const DIRECTIONS: usize = 96;

/// Pieces of the same sector about the needle have the same plane.
const SECTORS: usize = 192;

/// Planes of one structure: more are no better than stations.
pub(crate) const MOST_PLANES: usize = 4;

/// Bisections of the distance that all planes have at least.
const BISECTIONS: usize = 24;

impl HalfPlane {
    /// Half-planes that hold all of a structure, in several ways, of which a bound takes the best for its law: every
    /// single one of 96 directions that does, and up to four together that are as far from the needle as a search
    /// finds. None where there are none, as about a structure that surrounds the needle.
    ///
    /// A piece is `per_piece` points in turn, in the frame of the needle: 3 of a triangle, 1 of a voxel's centre; it
    /// lies within `beyond_m` of their hull (half a voxel's diagonal), m.
    pub fn covers(points_m: &[Point3<f64>], per_piece: usize, beyond_m: f64) -> Vec<Vec<Self>> {
        let sectors = Sector::of_pieces(points_m, per_piece.max(1), beyond_m);
        if sectors.is_empty() {
            return Vec::new();
        }
        let all: Vec<usize> = (0..sectors.len()).collect();
        let is_beyond = |direction: &usize| {
            let mut offsets_m = sectors.iter().map(|sector| sector.least_m[*direction]);
            offsets_m.all(|offset_m| offset_m > 0.0)
        };
        let single = (0..DIRECTIONS).filter(is_beyond);
        let mut covers: Vec<Vec<Self>> = single
            .map(|direction| vec![Self::over(direction, &all, &sectors, beyond_m)])
            .collect();
        if let Some(several) = farthest(&sectors).filter(|found| found.len() > 1) {
            let planes = several.iter();
            covers.push(
                planes
                    .map(|(direction, covered)| Self::over(*direction, covered, &sectors, beyond_m))
                    .collect(),
            );
        }
        covers
    }

    fn over(direction: usize, covered: &[usize], sectors: &[Sector], beyond_m: f64) -> Self {
        let of = |value: fn(&Sector) -> f64, pick: fn(f64, f64) -> f64, start: f64| {
            let values = covered.iter().map(|sector| value(&sectors[*sector]));
            values.fold(start, pick)
        };
        let offsets_m = covered
            .iter()
            .map(|sector| sectors[*sector].least_m[direction]);
        Self {
            normal: normal(direction),
            offset_m: offsets_m.fold(f64::INFINITY, f64::min),
            stretch_m: [
                of(|sector| sector.stretch_m[0], f64::min, f64::INFINITY) - beyond_m,
                of(|sector| sector.stretch_m[1], f64::max, f64::NEG_INFINITY) + beyond_m,
            ],
        }
    }
}

/// Directions that cover all sectors, as far from the needle as possible.
fn farthest(sectors: &[Sector]) -> Option<Vec<(usize, Vec<usize>)>> {
    let most_m = |sector: &Sector| sector.least_m.iter().copied().fold(f64::MIN, f64::max);
    let mut high_m = sectors.iter().map(most_m).fold(f64::MAX, f64::min);
    let mut low_m = 0.0;
    let mut best = cover(sectors, low_m)?;
    for _ in 0..BISECTIONS {
        let middle_m = f64::midpoint(low_m, high_m);
        if let Some(found) = cover(sectors, middle_m) {
            best = found;
            low_m = middle_m;
        } else {
            high_m = middle_m;
        }
    }
    Some(best)
}

fn normal(direction: usize) -> Vector2<f64> {
    let (sine, cosine) = libm::sincos(std::f64::consts::TAU * direction as f64 / DIRECTIONS as f64);
    Vector2::new(cosine, sine)
}

/// Pieces that lie in about the same direction.
struct Sector {
    /// Along each normal, how far all of them are beyond the axis at least, m.
    least_m: Vec<f64>,
    stretch_m: [f64; 2],
}

impl Sector {
    fn of_pieces(points_m: &[Point3<f64>], per_piece: usize, beyond_m: f64) -> Vec<Self> {
        let normals: Vec<Vector2<f64>> = (0..DIRECTIONS).map(normal).collect();
        let mut sectors: Vec<Option<Self>> = (0..SECTORS).map(|_| None).collect();
        for piece in points_m.chunks(per_piece) {
            let middle = piece
                .iter()
                .fold(Vector2::zeros(), |sum, point| sum + point.coords.yz());
            let angle = libm::atan2(middle.y, middle.x) / std::f64::consts::TAU + 0.5;
            let sector = sectors[crate::draw::nth(SECTORS, angle)].get_or_insert_with(|| Self {
                least_m: vec![f64::INFINITY; DIRECTIONS],
                stretch_m: [f64::INFINITY, f64::NEG_INFINITY],
            });
            for point in piece {
                let [low, high] = &mut sector.stretch_m;
                (*low, *high) = (low.min(point.x), high.max(point.x));
                let across = point.coords.yz();
                for (least, normal) in sector.least_m.iter_mut().zip(&normals) {
                    *least = least.min(normal.dot(&across) - beyond_m);
                }
            }
        }
        sectors.into_iter().flatten().collect()
    }
}

/// Directions whose planes at this distance have all sectors beyond them, the one that has most first, with their
/// sectors.
fn cover(sectors: &[Sector], distance_m: f64) -> Option<Vec<(usize, Vec<usize>)>> {
    let mut open: Vec<usize> = (0..sectors.len()).collect();
    let mut found = Vec::new();
    while !open.is_empty() {
        if found.len() == MOST_PLANES {
            return None;
        }
        let is_beyond =
            |sector: &usize, direction: usize| sectors[*sector].least_m[direction] >= distance_m;
        let count = |direction: usize| {
            open.iter()
                .filter(|each| is_beyond(each, direction))
                .count()
        };
        // The first of those that have most, and of these the one farthest away.
        let margin_m = |direction: usize| {
            let beyond = open.iter().filter(|each| is_beyond(each, direction));
            let offsets_m = beyond.map(|each| sectors[*each].least_m[direction]);
            offsets_m.fold(f64::INFINITY, f64::min)
        };
        let best = (0..DIRECTIONS).max_by(|a, b| {
            let by_count = count(*a).cmp(&count(*b));
            by_count.then_with(|| margin_m(*a).total_cmp(&margin_m(*b)))
        })?;
        let (beyond, rest): (Vec<usize>, Vec<usize>) =
            open.iter().partition(|each| is_beyond(each, best));
        if beyond.is_empty() {
            return None;
        }
        found.push((best, beyond));
        open = rest;
    }
    Some(found)
}
