//! How far and how crookedly the points of a solid move between two postures.

use nalgebra::Vector3;
use needlebench_geometry::Placement;
use needlebench_kinematics::{Chain, JOINT_COUNT, Joints};

use crate::body::{LinkPlacements, PlacedShape};

/// A posture of the motion.
#[derive(Debug, Clone)]
pub(super) struct Posture {
    pub time_s: f64,
    pub position: Joints,
    /// World poses of the moving links.
    pub links: LinkPlacements,
    /// Joint axes in the world, unit vectors.
    axes: [Vector3<f64>; JOINT_COUNT],
}

impl Posture {
    pub fn new(chain: &Chain, time_s: f64, position: Joints, links: &LinkPlacements) -> Self {
        let axes = std::array::from_fn(|k| links[k].rotation * chain.joints[k].axis.into_inner());
        Self {
            time_s,
            position,
            links: *links,
            axes,
        }
    }
}

/// Lengths and angles that the chain fixes.
#[derive(Debug, Clone)]
pub(super) struct ChainBounds {
    /// From the origin of joint `k - 1` to that of joint `k`, m.
    step_m: [f64; JOINT_COUNT],
    /// Largest `|z_j x z_k|` in any posture.
    sine: [[f64; JOINT_COUNT]; JOINT_COUNT],
}

impl ChainBounds {
    pub fn new(chain: &Chain) -> Self {
        let step_m = std::array::from_fn(|k| {
            let from_parent = &chain.joints[k].parent_from_joint;
            from_parent.translation.vector.norm()
        });
        // Between the lines of neighbouring axes, at most a right angle; the first has none.
        let turn_rad: [f64; JOINT_COUNT] = std::array::from_fn(|k| {
            if k == 0 {
                return 0.0;
            }
            let joint = &chain.joints[k];
            let axis = joint.parent_from_joint.rotation * joint.axis.into_inner();
            let before = chain.joints[k - 1].axis;
            libm::atan2(before.cross(&axis).norm(), before.dot(&axis).abs())
        });
        let sine = std::array::from_fn(|j| {
            std::array::from_fn(|k| {
                let between: f64 = turn_rad[j.min(k) + 1..=j.max(k)].iter().sum();
                libm::sin(between.min(std::f64::consts::FRAC_PI_2))
            })
        });
        Self { step_m, sine }
    }
}

/// A solid that joints move: what of its extent is the same in every posture.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingSolid {
    /// Link that carries it; also the last joint that moves it.
    link: usize,
    /// Largest distance of its points from the axis of that joint, m.
    own_radius_m: f64,
    /// Largest distance of its points from the origin of that joint, m.
    reach_m: f64,
}

impl MovingSolid {
    pub fn new(chain: &Chain, link: usize, solid: &PlacedShape) -> Self {
        let bound = &solid.bound;
        let axis = chain.joints[link].axis.into_inner();
        // A distance from a line or a point is convex: largest at an end of the capsule's segment.
        let largest = |measure: &dyn Fn(Vector3<f64>) -> f64| {
            measure(bound.centre + bound.half_axis).max(measure(bound.centre - bound.half_axis))
                + bound.radius_m
        };
        let reach_m = largest(&|point| point.norm()).min(bound.centre.norm() + bound.ball_radius_m);
        Self {
            link,
            own_radius_m: largest(&|point| axis.cross(&point).norm()).min(reach_m),
            reach_m,
        }
    }
}

/// What the joints do between two postures.
#[derive(Debug)]
pub(super) struct Sweep<'p> {
    left: &'p Posture,
    right: &'p Posture,
    /// `q_r - q_l`, rad.
    turn_rad: Joints,
    /// Distance from the chord, rad.
    deviation_rad: Joints,
    bounds: &'p ChainBounds,
    /// Scale of all lengths; 1 for a proof.
    length_scale: f64,
}

/// Bounds for the points of one solid relative to an inner body.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::struct_field_names, reason = "the unit belongs to the name")]
pub(super) struct PointBounds {
    /// Second derivative by the chord's fraction, m.
    pub curvature_m: f64,
    /// Way along the chord by the joints' radii, m.
    pub way_m: f64,
    /// Distance from the place on the chord, m.
    pub deviation_m: f64,
}

impl<'p> Sweep<'p> {
    pub fn new(
        [left, right]: [&'p Posture; 2],
        deviation_rad: Joints,
        bounds: &'p ChainBounds,
        length_scale: f64,
    ) -> Self {
        Self {
            left,
            right,
            turn_rad: right.position - left.position,
            deviation_rad,
            bounds,
            length_scale,
        }
    }

    /// Bounds for the points of `moving`, seen from the body that joint `first` moves on.
    ///
    /// All zero if no joint lies between the two.
    pub fn point_bounds(
        &self,
        moving: &MovingSolid,
        solid: &PlacedShape,
        first: usize,
    ) -> PointBounds {
        let radii_m = self.radii_m(moving, solid, first);
        let mut bounds = PointBounds {
            curvature_m: 0.0,
            way_m: 0.0,
            deviation_m: 0.0,
        };
        let mut turned_rad = 0.0;
        for k in first..=moving.link {
            let turn_rad = self.turn_rad[k].abs();
            let way_m = radii_m[k] * turn_rad;
            bounds.way_m += way_m;
            bounds.deviation_m += radii_m[k] * self.deviation_rad[k];
            bounds.curvature_m += way_m * (turn_rad + 2.0 * turned_rad);
            turned_rad += turn_rad;
        }
        bounds.curvature_m = bounds
            .curvature_m
            .min(self.curvature_by_links_m(moving, first));
        bounds
    }

    /// Largest distance of the solid's points from each axis, from `first` on, m.
    fn radii_m(&self, moving: &MovingSolid, solid: &PlacedShape, first: usize) -> Joints {
        let mut radii_m = Joints::zeros();
        let mut stretched_m = moving.reach_m;
        let mut way_m = 0.0;
        let ends = [self.left, self.right]
            .map(|posture| (posture, solid.bound.placed(&posture.links[moving.link])));
        for j in (first..=moving.link).rev() {
            let radius_m = if j == moving.link {
                moving.own_radius_m
            } else {
                stretched_m += self.bounds.step_m[j + 1];
                let at_ends: f64 = ends
                    .iter()
                    .map(|(posture, bound)| {
                        let (axis, origin) = (&posture.axes[j], posture.links[j].translation);
                        let centre = bound.centre - origin;
                        let across = |point: Vector3<f64>| axis.cross(&point).norm();
                        across(centre + bound.half_axis).max(across(centre - bound.half_axis))
                            + bound.radius_m
                    })
                    .sum();
                (0.5 * (at_ends + way_m)).min(stretched_m)
            };
            radii_m[j] = radius_m * self.length_scale;
            way_m += radii_m[j] * (self.turn_rad[j].abs() + 2.0 * self.deviation_rad[j]);
        }
        radii_m
    }

    /// Bound of the second derivative by the angular velocities of the links.
    fn curvature_by_links_m(&self, moving: &MovingSolid, first: usize) -> f64 {
        let mut curvature_m = 0.0;
        let mut angular = [Vector3::zeros(); 2];
        let mut angular_change = 0.0;
        for i in first..=moving.link {
            for (sum, posture) in angular.iter_mut().zip([self.left, self.right]) {
                *sum += posture.axes[i] * self.turn_rad[i];
            }
            for j in first..i {
                angular_change +=
                    (self.turn_rad[j] * self.turn_rad[i]).abs() * self.bounds.sine[j][i];
            }
            let angular_speed = 0.5 * (angular[0].norm() + angular[1].norm() + angular_change);
            let length_m = if i == moving.link {
                moving.reach_m
            } else {
                self.bounds.step_m[i + 1]
            };
            curvature_m += length_m * (angular_speed * angular_speed + angular_change);
        }
        curvature_m * self.length_scale
    }

    /// Bound of the way of any point of the solid along the chord, m; never more than
    /// [`PointBounds::way_m`].
    pub fn way_m(
        &self,
        moving: &MovingSolid,
        solid: &PlacedShape,
        first: usize,
        bounds: &PointBounds,
    ) -> f64 {
        let speeds_m = [self.left, self.right].map(|posture| {
            let centre = posture.links[moving.link].point(&solid.bound.centre);
            let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
            for k in first..=moving.link {
                let turn = posture.axes[k] * self.turn_rad[k];
                linear += turn.cross(&(centre - posture.links[k].translation));
                angular += turn;
            }
            linear.norm() + angular.norm() * solid.bound.ball_radius_m
        });
        let by_ends_m = 0.5 * (speeds_m[0] + speeds_m[1]) + 0.25 * bounds.curvature_m;
        by_ends_m.min(bounds.way_m)
    }
}

/// Pose of a body in the frame of another one; `None` is the world.
pub(super) fn inner_from_outer(
    links: &LinkPlacements,
    inner: Option<usize>,
    outer: usize,
) -> Placement {
    match inner {
        None => links[outer],
        Some(inner) => links[inner].inverse_after(&links[outer]),
    }
}
