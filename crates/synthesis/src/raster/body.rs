//! A solid as the cells of a slice meet it: outside, inside, or cut, and by how much.

use std::ops::Range;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_geometry::{Shape, Solid, TriangleMesh, TriangleTree};
use needlebench_kinematics::Pose;

use super::plane_cut::{Plane, reach_m, share_below};

/// Faces count as one plane if normals and offsets differ by less: rounding of metres.
const SAME_PLANE: f64 = 1e-9;
/// Cosine of the angle between two faces above which the smaller share stands for what both leave: 30 degrees.
const SMOOTH_COSINE: f64 = 0.866;

/// Times the reach of a box: further from a surface there is no doubt about it, whatever rounding does.
const CLEARLY: f64 = 1.0 + 1e-6;

/// A solid in the frame of the slices.
#[derive(Debug)]
pub(crate) enum Body {
    /// Points within `radius_m` of a segment; a ball has no axis.
    Round {
        centre: Vector3<f64>,
        segment: Segment,
        radius_m: f64,
    },
    /// A cylinder with flat ends.
    Drum {
        centre: Vector3<f64>,
        axis: Vector3<f64>,
        radius_m: f64,
        half_length_m: f64,
    },
    /// A convex polyhedron.
    Faces(Vec<Plane>),
    /// What a closed surface encloses.
    Surface {
        tree: TriangleTree,
        centre: Vector3<f64>,
        shape_from_frame: UnitQuaternion<f64>,
    },
}

/// A segment about the origin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment {
    /// From its middle to its end.
    half_axis: Vector3<f64>,
    squared: f64,
    /// Unit vector along it.
    along: Vector3<f64>,
}

/// How a box lies to a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lies {
    Outside,
    Inside,
    /// It may be cut.
    Across,
}

/// How much of a box a body fills.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Filled {
    /// 0 to 1.
    pub share: f64,
    /// An edge or a thin part: smaller boxes would tell more.
    pub is_rough: bool,
    /// Outward unit normal of the plane that cuts the box, if one alone does.
    pub normal: Option<Vector3<f64>>,
}

impl Filled {
    fn by_one_plane(share: f64, normal: Vector3<f64>) -> Self {
        Self {
            share,
            is_rough: false,
            normal: Some(normal),
        }
    }
}

/// A box in the frame of the slices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    pub centre: Vector3<f64>,
    pub half: Vector3<f64>,
}

impl Body {
    /// Of a solid whose parent is the frame of the slices.
    pub fn new(solid: &Solid) -> Self {
        let frame_from_shape = solid.parent_from_shape;
        let centre = frame_from_shape.translation.vector;
        let axis = frame_from_shape.rotation * Vector3::z();
        match &solid.shape {
            Shape::Sphere { radius_m } => Self::Round {
                centre,
                segment: Segment::new(Vector3::zeros()),
                radius_m: *radius_m,
            },
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => Self::Round {
                centre,
                segment: Segment::new(axis * *half_length_m),
                radius_m: *radius_m,
            },
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => Self::Drum {
                centre,
                axis,
                radius_m: *radius_m,
                half_length_m: *half_length_m,
            },
            Shape::Cuboid { half_extents_m } => {
                Self::Faces(cuboid(&frame_from_shape, half_extents_m))
            }
            Shape::Convex(mesh) => Self::Faces(faces(&frame_from_shape, &mesh.0)),
            Shape::Mesh(mesh) => Self::Surface {
                tree: TriangleTree::new(mesh.surface()),
                centre,
                shape_from_frame: frame_from_shape.rotation.inverse(),
            },
        }
    }

    /// How a box lies to it. Of a polyhedron, `range` of `planes` are the faces that may cut the box; those of them that
    /// still may are appended.
    #[inline]
    pub fn lies(&self, cell: &Cell, planes: &mut Vec<Plane>, range: Range<u32>) -> Lies {
        match self {
            Self::Faces(_) => {
                let mut lies = Lies::Inside;
                for index in range {
                    let plane = planes[index as usize];
                    let height_m = plane.height_m(&cell.centre);
                    let reach_m = plane.reach_m(&cell.half);
                    if height_m >= reach_m {
                        return Lies::Outside;
                    }
                    if height_m > -reach_m {
                        lies = Lies::Across;
                        planes.push(plane);
                    }
                }
                lies
            }
            Self::Surface { .. } => {
                let (nearest, inside) = self.nearest_on_surface(&cell.centre);
                let radius_m = cell.half.norm();
                if (nearest - cell.centre).norm_squared() < radius_m * radius_m {
                    return Lies::Across;
                }
                if inside { Lies::Inside } else { Lies::Outside }
            }
            Self::Round { .. } | Self::Drum { .. } => {
                let height_m = self.height_m(&cell.centre);
                let radius_m = cell.half.norm();
                if height_m >= radius_m {
                    Lies::Outside
                } else if height_m < -radius_m {
                    Lies::Inside
                } else {
                    Lies::Across
                }
            }
        }
    }

    /// How much of a small box it fills.
    #[inline]
    pub fn fills(&self, cell: &Cell, planes: &[Plane]) -> Filled {
        match self {
            Self::Round {
                centre,
                segment,
                radius_m,
            } => {
                let (from_axis, along) = segment.to(&(cell.centre - centre));
                fills_round(cell, &from_axis, along, *radius_m)
            }
            Self::Drum {
                centre,
                axis,
                radius_m,
                half_length_m,
            } => {
                let from_centre = cell.centre - centre;
                let along_m = axis.dot(&from_centre);
                let from_axis = from_centre - axis * along_m;
                let side = fills_round(cell, &from_axis, Some(*axis), *radius_m);
                let end = share_below(axis, &cell.half, along_m.abs() - half_length_m);
                let share = side.share.min(end);
                let has_edge = side.share < 1.0 && end < 1.0;
                let is_thin = *half_length_m < cell.half.norm();
                Filled {
                    share,
                    is_rough: share > 0.0 && (side.is_rough || has_edge || is_thin),
                    normal: if end < 1.0 {
                        Some(if along_m < 0.0 { -axis } else { *axis })
                    } else {
                        side.normal
                    },
                }
            }
            Self::Faces(_) => {
                let mut filled = Filled {
                    share: 1.0,
                    is_rough: false,
                    normal: None,
                };
                let mut cutting: Option<Vector3<f64>> = None;
                for plane in planes {
                    let share =
                        share_below(&plane.normal, &cell.half, plane.height_m(&cell.centre));
                    if share >= 1.0 {
                        continue;
                    }
                    filled.share = filled.share.min(share);
                    match cutting {
                        None => {
                            cutting = Some(plane.normal);
                            filled.normal = cutting;
                        }
                        Some(normal) => {
                            filled.normal = None;
                            filled.is_rough |= normal.dot(&plane.normal) < SMOOTH_COSINE;
                        }
                    }
                }
                filled
            }
            Self::Surface { .. } => self.fills_surface(cell),
        }
    }

    /// How a small box lies to a round body where the distance of its centre alone tells: there [`Self::fills`] has
    /// a share of 0 or 1, and nothing is rough.
    #[inline]
    pub fn clearly_lies(&self, cell: &Cell) -> Lies {
        let reach_m = cell.half.norm();
        match self {
            Self::Round {
                centre,
                segment,
                radius_m,
            } => {
                let (from_axis, _) = segment.to(&(cell.centre - centre));
                clearly_within(from_axis.norm_squared(), *radius_m, reach_m)
            }
            Self::Drum {
                centre,
                axis,
                radius_m,
                half_length_m,
            } => {
                let from_centre = cell.centre - centre;
                let along_m = axis.dot(&from_centre);
                let from_axis = from_centre - axis * along_m;
                let over_end_m = along_m.abs() - half_length_m;
                if over_end_m > CLEARLY * reach_m {
                    return Lies::Outside;
                }
                match clearly_within(from_axis.norm_squared(), *radius_m, reach_m) {
                    Lies::Inside if over_end_m >= -CLEARLY * reach_m => Lies::Across,
                    side => side,
                }
            }
            Self::Faces(_) | Self::Surface { .. } => Lies::Across,
        }
    }

    /// How much of a small box is inside a surface, taken as the plane across the way to its nearest point; rough where the
    /// surface is not one there.
    fn fills_surface(&self, cell: &Cell) -> Filled {
        /// Share of the box's reach by which heights above a plane may be off.
        const PLANE: f64 = 0.02;
        let (nearest, inside) = self.nearest_on_surface(&cell.centre);
        let away = cell.centre - nearest;
        let outwards = if inside { -away } else { away };
        let Some(normal) = outwards.try_normalize(0.0) else {
            // The centre is on the surface.
            return Filled {
                share: 0.5,
                is_rough: true,
                normal: None,
            };
        };
        let height_m = normal.dot(&away);
        let reach_m = reach_m(&normal, &cell.half);
        let is_plane = [-reach_m, reach_m].iter().all(|step_m| {
            let point = cell.centre + normal * *step_m;
            let (nearest, inside) = self.nearest_on_surface(&point);
            let sign = if inside { -1.0 } else { 1.0 };
            let off_m = sign * (point - nearest).norm() - (height_m + step_m);
            off_m.abs() < PLANE * reach_m
        });
        Filled {
            share: share_below(&normal, &cell.half, height_m),
            is_rough: !is_plane,
            normal: Some(normal),
        }
    }

    /// Faces of a polyhedron; none of all others.
    pub fn planes(&self) -> &[Plane] {
        match self {
            Self::Faces(planes) => planes,
            _ => &[],
        }
    }

    /// Of a round body: its distance from a point outside, less inside; it changes no faster than the point moves.
    fn height_m(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Round {
                centre,
                segment,
                radius_m,
            } => segment.to(&(point - centre)).0.norm() - radius_m,
            Self::Drum {
                centre,
                axis,
                radius_m,
                half_length_m,
            } => {
                let from_centre = point - centre;
                let along_m = axis.dot(&from_centre);
                let from_axis_m = (from_centre - axis * along_m).norm();
                (from_axis_m - radius_m).max(along_m.abs() - half_length_m)
            }
            Self::Faces(_) | Self::Surface { .. } => f64::INFINITY,
        }
    }

    /// The nearest point of a surface, and whether the point is inside.
    fn nearest_on_surface(&self, point: &Vector3<f64>) -> (Vector3<f64>, bool) {
        let Self::Surface {
            tree,
            centre,
            shape_from_frame,
        } = self
        else {
            return (*point, false);
        };
        let in_shape = Point3::from(shape_from_frame * (point - centre));
        let nearest = tree.nearest(&in_shape);
        let in_frame = shape_from_frame.inverse_transform_vector(&nearest.coords) + centre;
        (in_frame, tree.contains(&in_shape))
    }
}

impl Segment {
    fn new(half_axis: Vector3<f64>) -> Self {
        let squared = half_axis.norm_squared();
        Self {
            half_axis,
            squared,
            along: half_axis / squared.sqrt(),
        }
    }

    /// From its nearest point to a point; and its direction, where that is not an end.
    #[inline]
    fn to(&self, point: &Vector3<f64>) -> (Vector3<f64>, Option<Vector3<f64>>) {
        if self.squared == 0.0 {
            return (*point, None);
        }
        let at = point.dot(&self.half_axis) / self.squared;
        let on_axis = self.half_axis * at.clamp(-1.0, 1.0);
        (point - on_axis, (at.abs() < 1.0).then_some(self.along))
    }
}

/// How a small box lies to what is within a distance of an axis, by the square of its centre's distance.
#[inline]
fn clearly_within(squared_m2: f64, radius_m: f64, reach_m: f64) -> Lies {
    /// The mean height of the round surface over the box is above the centre's by a sixth of the reach at most.
    const CURVED: f64 = 7.0 / 6.0;
    let outside_m = radius_m + CLEARLY * reach_m;
    if squared_m2 > outside_m * outside_m {
        return Lies::Outside;
    }
    let inside_m = radius_m - CLEARLY * CURVED * reach_m;
    if radius_m > 2.0 * reach_m && squared_m2 < inside_m * inside_m {
        return Lies::Inside;
    }
    Lies::Across
}

/// How much of a small box is within a distance of an axis, or of a point where there is no axis.
///
/// The surface is taken as the plane that has, over the box, the mean height of the round one: second order in
/// box over radius is kept.
#[inline]
fn fills_round(
    cell: &Cell,
    from_axis: &Vector3<f64>,
    axis: Option<Vector3<f64>>,
    radius_m: f64,
) -> Filled {
    let distance_m = from_axis.norm();
    let reach_m = cell.half.norm();
    if distance_m <= reach_m {
        // About the axis: of a body that is larger than the box, or of a thin one.
        return Filled {
            share: f64::from(u8::from(distance_m < radius_m)),
            is_rough: radius_m < 2.0 * reach_m,
            normal: None,
        };
    }
    let normal = from_axis / distance_m;
    let variance = |direction: &Vector3<f64>| {
        let reach = direction.component_mul(&cell.half);
        reach.norm_squared() / 3.0
    };
    let across =
        reach_m * reach_m / 3.0 - variance(&normal) - axis.map_or(0.0, |axis| variance(&axis));
    let height_m = distance_m + 0.5 * across / distance_m - radius_m;
    Filled::by_one_plane(share_below(&normal, &cell.half, height_m), normal)
}

fn cuboid(frame_from_shape: &Pose, half_extents_m: &Vector3<f64>) -> Vec<Plane> {
    let centre = frame_from_shape.translation.vector;
    let face = |axis: usize, sign: f64| {
        let mut normal = Vector3::zeros();
        normal[axis] = sign;
        let normal = frame_from_shape.rotation * normal;
        Plane {
            normal,
            offset_m: normal.dot(&centre) + half_extents_m[axis],
        }
    };
    (0..3)
        .flat_map(|axis| [face(axis, 1.0), face(axis, -1.0)])
        .collect()
}

/// The planes of a convex mesh, each once.
fn faces(frame_from_shape: &Pose, mesh: &TriangleMesh) -> Vec<Plane> {
    let at = |index: u32| (frame_from_shape * mesh.vertices_m[index as usize]).coords;
    let mut planes: Vec<Plane> = Vec::with_capacity(mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        let Some(normal) = (at(b) - at(a)).cross(&(at(c) - at(a))).try_normalize(0.0) else {
            continue;
        };
        let offset_m = normal.dot(&at(a));
        let is_known = planes.iter().any(|plane| {
            (plane.normal - normal).norm() < SAME_PLANE
                && (plane.offset_m - offset_m).abs() < SAME_PLANE
        });
        if !is_known {
            planes.push(Plane { normal, offset_m });
        }
    }
    planes
}
