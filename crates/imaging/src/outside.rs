//! The body where no scan shows it, as it is assumed to go on.

use std::collections::BTreeMap;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_geometry::mesh::simplified_hull;
use needlebench_geometry::{ConvexMesh, TriangleMesh};
use serde::Serialize;

use crate::field_of_view::{Cut, FieldOfView};

/// How a body is assumed to go on behind the cuts of its scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Outside {
    /// How far behind each cut, m.
    pub reach_m: f64,
    /// How much farther out on each side the body is behind the first and the last slice than near them, along x (left)
    /// and y (posterior) of `ct`, m.
    pub wider_m: [f64; 2],
}

impl Outside {
    /// Shoulders are farther out than the chest by half of what the bideltoid breadth is more than the chest's: 82 to
    /// 124 mm (ANSUR II, as in the shipped phantoms). Front and back are assumed.
    pub const USUAL_WIDER_M: [f64; 2] = [0.125, 0.05];
}

/// A body where no scan shows it.
#[derive(Debug, Clone)]
pub struct AssumedBody {
    /// By what it is assumed.
    pub outside: Outside,
    /// How many cuts it is behind.
    pub cuts: usize,
    /// Its pieces; neighbours overlap.
    pub pieces: Vec<AssumedPiece>,
}

/// A convex piece of the assumed body.
#[derive(Debug, Clone)]
pub struct AssumedPiece {
    /// Unique: `assumed_body_` and the side that it is on, with a number where a side has several.
    pub name: String,
    /// Its surface, `ct`, m.
    pub hull: ConvexMesh,
}

/// So far behind an end the body is as wide as it becomes, m (assumed: from the armpit to the shoulder).
const WIDENS_WITHIN_M: f64 = 0.1;

/// How much of a scan says what the body is like at its end, m.
const NEAR_END_M: f64 = 0.02;

/// Distance of cross-sections, m, at most.
const APART_M: f64 = 0.01;

/// Cross-sections keep so far from the ends, m: the surface is closed there.
const FROM_END_M: f64 = 1e-3;

/// Skin so near to a side says nothing of its direction, m and pixels: surfaces are rounded where they are cut.
const NEAR_SIDE_M: f64 = 5e-3;
const NEAR_SIDE_PIXELS: f64 = 3.0;

/// Tangents of a cross-section: what they enclose of a circle is 0.03 % farther out.
const TANGENTS: u32 = 128;

/// How far beyond what was seen of it a cross-section goes at most, as a share of what its tangents enclose: that of a
/// parabola. Any ellipse goes less far, along every direction.
const HALF_WAY: f64 = 0.5;

/// The body goes on so much beyond its reach, m: its end is behind the plane there.
const BEYOND_REACH_M: f64 = 1e-3;

/// Less than this beyond a side is not told from the surface of what was seen, m.
const THIN_M: f64 = 1e-3;

/// What a hull may leave out of its points, m.
const LEFT_OUT_M: f64 = 1e-4;

/// Farther than any body, m.
const FAR_M: f64 = 3.0;

/// A point of a cross-section, along two axes across the direction from slice to slice, m.
type Across = [f64; 2];

/// What is not beyond a line of a cross-section: a normal, and the most along it, m.
type HalfPlane = (Across, f64);

impl AssumedBody {
    /// What the names of its pieces begin with.
    pub const NAME: &str = "assumed_body";

    /// The body of this skin behind the cuts of its scan.
    ///
    /// Behind the sides, each cross-section is assumed to be within its tangents where skin was seen, as a convex one
    /// is, no farther beyond what was seen than half of what they enclose, as an ellipse is, and no farther out than
    /// the reach. Behind the first and the last slice, the hull of the cross-sections near
    /// the end goes on, that of the `others` (arms) included, and becomes wider. No piece is where the scan saw
    /// anything.
    pub fn of(
        skin: &TriangleMesh,
        others: &[&TriangleMesh],
        seen: &FieldOfView,
        outside: Outside,
    ) -> Self {
        let sections = Sections::of(skin, seen, &outside);
        let mut made = sections.behind_sides();
        for end in &seen.ends {
            let outline = sections.near_end(end, others);
            let hull = sections.behind_end(end, &outline);
            made.extend(hull.map(|hull| (side_of(&end.normal), hull)));
        }
        let mut counts: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
        for (side, _) in &made {
            counts.entry(*side).or_default()[1] += 1;
        }
        let pieces = made.into_iter().map(|(side, hull)| {
            let [number, count] = counts.entry(side).or_default();
            *number += 1;
            let name = if *count > 1 {
                format!("{}_{side}_{number}", Self::NAME)
            } else {
                format!("{}_{side}", Self::NAME)
            };
            AssumedPiece { name, hull }
        });
        Self {
            outside,
            cuts: seen.cuts(skin).len(),
            pieces: pieces.collect(),
        }
    }
}

/// Side of the patient that a direction in `ct` points to.
fn side_of(normal: &UnitVector3<f64>) -> &'static str {
    const SIDES: [[&str; 2]; 3] = [
        ["right", "left"],
        ["anterior", "posterior"],
        ["inferior", "superior"],
    ];
    let axis = normal.iamax();
    SIDES[axis][usize::from(normal[axis] > 0.0)]
}

/// A cross-section.
struct Section {
    /// Along the normal of slices, m.
    at_m: f64,
    /// Corners of what the body is assumed to be within.
    outline: Vec<Across>,
    /// Whether a side cuts it.
    is_cut: bool,
}

/// Cross-sections of a scan.
struct Sections<'s> {
    seen: &'s FieldOfView,
    outside: &'s Outside,
    across: [Vector3<f64>; 2],
    /// From slice to slice, of length 1.
    along: Vector3<f64>,
    all: Vec<Section>,
}

impl<'s> Sections<'s> {
    fn of(skin: &TriangleMesh, seen: &'s FieldOfView, outside: &'s Outside) -> Self {
        let [low, high] = &seen.ends;
        // Sides are parallel to the direction from slice to slice, and a quarter of them on are not parallel.
        let first = seen.sides[0].normal.into_inner();
        let other = seen.sides[seen.sides.len() / 4 + usize::from(seen.sides.len() == 4)];
        let along = first.cross(&other.normal).normalize();
        let along = along * along.dot(&high.normal).signum();
        let mut made = Self {
            seen,
            outside,
            across: [first, along.cross(&first)],
            along,
            all: Vec::new(),
        };
        let from_m = FROM_END_M - low.offset_m;
        let length_m = high.offset_m - FROM_END_M - from_m;
        let mut share = 0.0;
        while share <= 1.0 && length_m > 0.0 {
            let section = made.section(skin, from_m + share * length_m);
            made.all.extend(section);
            let step = (APART_M / length_m).min(1.0);
            // The last one is at the end.
            share = if share < 1.0 {
                (share + step).min(1.0)
            } else {
                f64::INFINITY
            };
        }
        made
    }

    fn across(&self, point: &Point3<f64>) -> Across {
        self.across.map(|axis| axis.dot(&point.coords))
    }

    /// The point of a plane across the slices that has these coordinates.
    fn on(&self, [a, b]: Across, normal: &Vector3<f64>, offset_m: f64) -> Point3<f64> {
        let [x, y] = self.across;
        let flat = x * a + y * b;
        let along_m = (offset_m - normal.dot(&flat)) / normal.dot(&self.along);
        Point3::from(flat + self.along * along_m)
    }

    /// Directions of tangents, and the same in `ct`.
    fn directions(&self) -> impl Iterator<Item = (Across, Vector3<f64>)> {
        let [x, y] = self.across;
        (0..TANGENTS).map(move |at| {
            let angle = std::f64::consts::TAU * f64::from(at) / f64::from(TANGENTS);
            let [a, b] = [libm::cos(angle), libm::sin(angle)];
            ([a, b], x * a + y * b)
        })
    }

    /// The cross-section at a place along the normal of slices; none where there is no skin.
    fn section(&self, skin: &TriangleMesh, at_m: f64) -> Option<Section> {
        let normal = self.seen.ends[1].normal;
        let height_m = |point: &Point3<f64>| normal.dot(&point.coords) - at_m;
        let mut points = Vec::new();
        for triangle in &skin.triangles {
            let corners = triangle.map(|corner| skin.vertices_m[corner as usize]);
            for at in 0..3 {
                let [from, to] = [corners[at], corners[(at + 1) % 3]];
                let [below_m, above_m] = [height_m(&from), height_m(&to)];
                // Of the two triangles of an edge, one runs up along it.
                if below_m < 0.0 && above_m >= 0.0 {
                    points.push(from + (to - from) * (below_m / (below_m - above_m)));
                }
            }
        }
        let pixel_m = self.seen.pixel_m;
        let near_m = NEAR_SIDE_M.max(NEAR_SIDE_PIXELS * pixel_m);
        let depth_m = |point: &Point3<f64>| self.seen.nearest_side(point).map_or(FAR_M, |it| it.0);
        let depths_m: Vec<f64> = points.iter().map(depth_m).collect();
        let is_cut = depths_m.iter().any(|&depth_m| depth_m < self.seen.rim_m());
        let mut tangents = Vec::new();
        let mut open = Vec::new();
        for (direction, in_ct) in self.directions() {
            let most = points.iter().zip(&depths_m);
            let most = most.map(|(point, depth_m)| (in_ct.dot(&point.coords), *depth_m));
            let (most_m, depth_m) = most.max_by(|a, b| a.0.total_cmp(&b.0))?;
            if !is_cut || depth_m >= near_m {
                tangents.push((direction, most_m));
            } else {
                open.push((direction, most_m));
            }
        }
        if is_cut {
            let reach_m = self.outside.reach_m + BEYOND_REACH_M;
            let enclosed = within(&tangents);
            for (direction, seen_m) in open {
                let farthest = enclosed.iter().map(|&corner| dot(direction, corner));
                let beyond_m = HALF_WAY * (farthest.fold(f64::NEG_INFINITY, f64::max) - seen_m);
                if beyond_m < self.outside.reach_m {
                    tangents.push((direction, seen_m + beyond_m));
                }
            }
            tangents.extend(self.seen.sides.iter().map(|side| {
                let (normal, offset_m) = self.side(side);
                (normal, offset_m + reach_m)
            }));
        }
        Some(Section {
            at_m,
            outline: within(&tangents),
            is_cut,
        })
    }

    /// A side as it is across.
    fn side(&self, side: &Cut) -> HalfPlane {
        (
            self.across.map(|axis| axis.dot(&side.normal)),
            side.offset_m,
        )
    }

    /// What of the cross-sections is beyond each side.
    fn behind_sides(&self) -> Vec<(&'static str, ConvexMesh)> {
        let [low, high] = &self.seen.ends;
        let cut: Vec<&Section> = self.all.iter().filter(|each| each.is_cut).collect();
        let mut made = Vec::new();
        for side in &self.seen.sides {
            let (normal, offset_m) = self.side(side);
            let mut points = Vec::new();
            let mut deepest_m: f64 = 0.0;
            for section in &cut {
                let beyond = clipped(&section.outline, ([-normal[0], -normal[1]], -offset_m));
                for corner in beyond {
                    deepest_m = deepest_m.max(dot(normal, corner) - offset_m);
                    let mut at_ends = [low, high].into_iter().filter(|end| {
                        let end_m = end.normal.dot(&high.normal) * end.offset_m;
                        (section.at_m - end_m).abs() <= APART_M
                    });
                    points.push(self.on(corner, &high.normal, section.at_m));
                    points.extend(
                        at_ends
                            .by_ref()
                            .map(|end| self.on(corner, &end.normal, end.offset_m)),
                    );
                }
            }
            if deepest_m > THIN_M
                && let Ok(hull) = simplified_hull(&points, LEFT_OUT_M)
            {
                made.push((side_of(&side.normal), hull));
            }
        }
        made.sort_by_key(|(side, _)| *side);
        made
    }

    /// Points of the cross-sections near an end, and of what else is there.
    fn near_end(&self, end: &Cut, others: &[&TriangleMesh]) -> Vec<Across> {
        let end_m = end.normal.dot(&self.seen.ends[1].normal) * end.offset_m;
        let near = self.all.iter();
        let near = near.filter(|section| (section.at_m - end_m).abs() <= NEAR_END_M);
        let others = others.iter().flat_map(|mesh| &mesh.vertices_m);
        let others = others.filter(|at| end.offset_m - end.normal.dot(&at.coords) <= NEAR_END_M);
        let outlines = near.flat_map(|section| section.outline.iter().copied());
        outlines.chain(others.map(|at| self.across(at))).collect()
    }

    /// The body behind an end; none where nothing is there.
    fn behind_end(&self, end: &Cut, points: &[Across]) -> Option<ConvexMesh> {
        if points.is_empty() {
            return None;
        }
        let [x_m, y_m] = self.outside.wider_m;
        let reach_m = self.outside.reach_m;
        let outline = |share: f64| {
            let planes = self.directions().map(|(direction, in_ct)| {
                let most = points.iter().map(|&point| dot(direction, point));
                let most_m = most.fold(f64::NEG_INFINITY, f64::max);
                let [x, y] = [x_m * in_ct.x, y_m * in_ct.y];
                (direction, most_m + share * (x * x + y * y).sqrt())
            });
            within(&planes.collect::<Vec<_>>())
        };
        let widest = outline((reach_m / WIDENS_WITHIN_M).min(1.0));
        let levels = [
            (outline(0.0), 0.0),
            (widest.clone(), reach_m.min(WIDENS_WITHIN_M)),
            (widest, reach_m + BEYOND_REACH_M),
        ];
        let all = levels.iter().flat_map(|(outline, behind_m)| {
            let corners = outline.iter();
            corners.map(move |&corner| self.on(corner, &end.normal, end.offset_m + behind_m))
        });
        simplified_hull(&all.collect::<Vec<_>>(), LEFT_OUT_M).ok()
    }
}

fn dot(a: Across, b: Across) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Corners of what is within all half-planes and not farther than any body.
fn within(planes: &[HalfPlane]) -> Vec<Across> {
    let far = vec![
        [-FAR_M, -FAR_M],
        [FAR_M, -FAR_M],
        [FAR_M, FAR_M],
        [-FAR_M, FAR_M],
    ];
    let mut outline = planes
        .iter()
        .fold(far, |outline, plane| clipped(&outline, *plane));
    // Of corners at one place a file would have triangles without area.
    let is_same = |a: Across, b: Across| libm::hypot(a[0] - b[0], a[1] - b[1]) < LEFT_OUT_M;
    outline.dedup_by(|a, b| is_same(*a, *b));
    if outline.len() > 1 && is_same(outline[0], outline[outline.len() - 1]) {
        outline.pop();
    }
    outline
}

/// What of a convex outline is within a half-plane.
fn clipped(outline: &[Across], (normal, most_m): HalfPlane) -> Vec<Across> {
    let mut left = Vec::with_capacity(outline.len() + 1);
    for (at, &corner) in outline.iter().enumerate() {
        let next = outline[(at + 1) % outline.len()];
        let [here_m, there_m] = [corner, next].map(|point| most_m - dot(normal, point));
        if here_m >= 0.0 {
            left.push(corner);
        }
        if (here_m < 0.0) != (there_m < 0.0) {
            let share = here_m / (here_m - there_m);
            left.push([0, 1].map(|axis| corner[axis] + share * (next[axis] - corner[axis])));
        }
    }
    left
}
