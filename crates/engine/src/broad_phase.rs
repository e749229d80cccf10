//! Broad phase: which pairs of solids are near enough to touch in the next step.

use needlebench_cell::{Cell, Frame};
use needlebench_kinematics::{Chain, JOINT_COUNT, Joints, Pose};
use rapier3d_f64::geometry::SharedShape;
use rapier3d_f64::math::Vector;
use rapier3d_f64::parry::query;

use crate::EngineError;
use crate::contact_groups::{ContactBits, contact_bits};
use crate::convert::{UNITS_PER_M, collider_shapes, pose};

/// Pairs closer than this are near, m.
///
/// Far above the distance at which an engine begins to care, and above the errors of the distance
/// itself, which are tens of micrometres.
const NEAR_M: f64 = 1e-3;

/// A gap of bounding spheres that makes the distance of the solids themselves superfluous, m.
const SPHERES_SUFFICE_M: f64 = 0.03;

/// One convex shape of a cell that can touch something.
#[derive(Clone)]
pub(crate) struct Part {
    /// Index into `Cell::bodies`.
    pub body: usize,
    /// The moving link that carries it; none for the world.
    pub link: Option<usize>,
    /// The shape, in rapier's units.
    pub shape: SharedShape,
    /// Pose in the frame of the link or of the world, m.
    pub parent_from_shape: Pose,
    /// What it may touch.
    pub bits: ContactBits,
}

/// All convex shapes of a cell that can touch something.
pub(crate) fn parts(cell: &Cell) -> Result<Vec<Part>, EngineError> {
    let mut parts = Vec::new();
    for ((body, each), bits) in cell.bodies.iter().enumerate().zip(contact_bits(cell)?) {
        if bits == ContactBits::default() {
            continue;
        }
        let link = match each.frame {
            Frame::World => None,
            Frame::Link(i) => Some(i),
        };
        for solid in &each.solids {
            for (shape, parent_from_shape) in collider_shapes(solid)? {
                parts.push(Part {
                    body,
                    link,
                    shape,
                    parent_from_shape,
                    bits,
                });
            }
        }
    }
    Ok(parts)
}

/// Says which pairs of parts are near, without asking for most distances in most steps.
///
/// A pair that was `d` apart cannot meet before one part has travelled `d` relative to the other,
/// and a bound on that way costs nothing, while a distance costs about a microsecond.
#[derive(Clone)]
pub(crate) struct BroadPhase {
    chain: Chain,
    world_from_base_link: Pose,
    parts: Vec<Part>,
    spheres: Vec<Sphere>,
    /// Pairs, those with the same relative motion in a row.
    pairs: Vec<Pair>,
    groups: Vec<Group>,
    /// Entry `[joint][link]`: greatest distance of the link's parts from the joint, m.
    reach_m: [[f64; JOINT_COUNT]; JOINT_COUNT],
    /// Entry `[joint][link]`: bound on the way that any point of the link has gone since the
    /// reset, seen from the parent of the joint, m.
    travel_m: [[f64; JOINT_COUNT]; JOINT_COUNT],
    position: Joints,
    near: usize,
    /// A pair has become near in the last look.
    news: bool,
}

/// Bounding sphere of a part in its parent's frame.
#[derive(Debug, Clone, Copy)]
struct Sphere {
    center_m: nalgebra::Point3<f64>,
    radius_m: f64,
}

#[derive(Debug, Clone, Copy)]
struct Pair {
    parts: [usize; 2],
    near: bool,
    /// Travel up to which `near` holds, m.
    next_look_m: f64,
}

/// Pairs between two links, or between the world and a link.
#[derive(Debug, Clone)]
struct Group {
    /// First joint that moves the one against the other, and the link that it moves.
    motion: [usize; 2],
    pairs: std::ops::Range<usize>,
    /// Travel up to which nothing in the group changes, m.
    next_look_m: f64,
}

impl BroadPhase {
    /// Watches all pairs of the cell that may touch; call [`Self::reset`] before anything else.
    pub(crate) fn new(cell: &Cell) -> Result<Self, EngineError> {
        let chain = cell.dynamics().chain;
        let parts = parts(cell)?;
        let spheres: Vec<Sphere> = parts.iter().map(bounding_sphere).collect();
        let mut link_radii_m = [0.0_f64; JOINT_COUNT];
        for (part, sphere) in parts.iter().zip(&spheres) {
            if let Some(link) = part.link {
                let radius_m = sphere.center_m.coords.norm() + sphere.radius_m;
                link_radii_m[link] = link_radii_m[link].max(radius_m);
            }
        }
        let mut of_motion: Vec<Vec<Pair>> = vec![Vec::new(); JOINT_COUNT * JOINT_COUNT];
        for (b, second) in parts.iter().enumerate() {
            for (a, first) in parts.iter().enumerate().take(b) {
                let touch = first.bits.member & second.bits.mask != 0;
                let (lower, upper) = (first.link.min(second.link), first.link.max(second.link));
                let (true, Some(upper)) = (touch && lower != upper, upper) else {
                    continue;
                };
                let joint = lower.map_or(0, |link| link + 1);
                of_motion[joint * JOINT_COUNT + upper].push(Pair {
                    parts: [a, b],
                    near: false,
                    next_look_m: 0.0,
                });
            }
        }
        let mut pairs = Vec::new();
        let mut groups = Vec::new();
        for (motion, of_motion) in of_motion.into_iter().enumerate() {
            if !of_motion.is_empty() {
                let start = pairs.len();
                pairs.extend(of_motion);
                groups.push(Group {
                    motion: [motion / JOINT_COUNT, motion % JOINT_COUNT],
                    pairs: start..pairs.len(),
                    next_look_m: 0.0,
                });
            }
        }
        Ok(Self {
            chain,
            world_from_base_link: cell.robot.world_from_base_link,
            reach_m: reaches_m(&chain, &link_radii_m),
            parts,
            spheres,
            pairs,
            groups,
            travel_m: [[0.0; JOINT_COUNT]; JOINT_COUNT],
            position: Joints::zeros(),
            near: 0,
            news: false,
        })
    }

    /// The parts, by whose indices pairs are named.
    pub(crate) fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Begins anew at a posture; returns whether any pair is near.
    pub(crate) fn reset(&mut self, position: &Joints) -> bool {
        self.travel_m = [[0.0; JOINT_COUNT]; JOINT_COUNT];
        self.position = *position;
        for pair in &mut self.pairs {
            pair.next_look_m = 0.0;
            pair.near = false;
        }
        for group in &mut self.groups {
            group.next_look_m = 0.0;
        }
        self.near = 0;
        self.look();
        self.near > 0
    }

    /// Takes note of where the joints are now; returns whether any pair is near.
    pub(crate) fn move_to(&mut self, position: &Joints) -> bool {
        let moved = position - self.position;
        for link in 0..JOINT_COUNT {
            let mut way_m = 0.0;
            for joint in (0..=link).rev() {
                // An arc is longer than its chord.
                way_m += moved[joint].abs() * self.reach_m[joint][link];
                self.travel_m[joint][link] += way_m;
            }
        }
        self.position = *position;
        self.look();
        self.near > 0
    }

    /// Indices of the parts of all near pairs.
    pub(crate) fn near_pairs(&self) -> impl Iterator<Item = [usize; 2]> {
        self.pairs
            .iter()
            .filter(|pair| pair.near)
            .map(|pair| pair.parts)
    }

    /// Whether a pair has become near in the last move or reset.
    pub(crate) fn has_news(&self) -> bool {
        self.news
    }

    /// Looks at every pair that may have changed.
    fn look(&mut self) {
        self.news = false;
        let mut poses: Option<[Pose; JOINT_COUNT]> = None;
        for group in &mut self.groups {
            let [joint, link] = group.motion;
            let travel_m = self.travel_m[joint][link];
            // Written so that NaN looks.
            if travel_m < group.next_look_m {
                continue;
            }
            let poses = poses.get_or_insert_with(|| {
                let links = self.chain.link_poses(&self.position);
                links.map(|pose| self.world_from_base_link * pose)
            });
            group.next_look_m = f64::INFINITY;
            for pair in &mut self.pairs[group.pairs.clone()] {
                if travel_m >= pair.next_look_m || travel_m.is_nan() {
                    let free_m = gap_m(&self.parts, &self.spheres, pair.parts, poses) - NEAR_M;
                    let near = free_m <= 0.0 || free_m.is_nan();
                    self.near = self.near + usize::from(near) - usize::from(pair.near);
                    self.news |= near && !pair.near;
                    pair.near = near;
                    // A pair that was called near too long is only looked at in vain.
                    pair.next_look_m = travel_m + if near { 0.5 * NEAR_M } else { free_m };
                }
                group.next_look_m = group.next_look_m.min(pair.next_look_m);
            }
        }
    }
}

/// Lower bound of a pair's distance, m.
fn gap_m(parts: &[Part], spheres: &[Sphere], pair: [usize; 2], poses: &[Pose; JOINT_COUNT]) -> f64 {
    let parents = pair.map(|part| {
        parts[part]
            .link
            .map_or_else(Pose::identity, |link| poses[link])
    });
    let [a, b] = [0, 1].map(|k| {
        (
            parents[k] * spheres[pair[k]].center_m,
            spheres[pair[k]].radius_m,
        )
    });
    let spheres_m = (a.0 - b.0).norm() - a.1 - b.1;
    if spheres_m > SPHERES_SUFFICE_M {
        return spheres_m;
    }
    let [a, b] = [0, 1].map(|k| {
        let part = &parts[pair[k]];
        (pose(&(parents[k] * part.parent_from_shape)), &part.shape)
    });
    // Unsupported shapes do not occur; if they did, the engine would see to them.
    query::distance(&a.0, a.1.as_ref(), &b.0, b.1.as_ref())
        .map_or(0.0, |found| found.distance / UNITS_PER_M)
}

fn bounding_sphere(part: &Part) -> Sphere {
    let sphere = part
        .shape
        .compute_bounding_sphere(&pose(&part.parent_from_shape));
    let Vector { x, y, z } = sphere.center;
    Sphere {
        center_m: nalgebra::Point3::new(x, y, z) / UNITS_PER_M,
        radius_m: sphere.radius / UNITS_PER_M,
    }
}

/// Radii are those of each link's parts about the link's origin, m.
fn reaches_m(
    chain: &Chain,
    link_radii_m: &[f64; JOINT_COUNT],
) -> [[f64; JOINT_COUNT]; JOINT_COUNT] {
    let mut reach_m = [[0.0; JOINT_COUNT]; JOINT_COUNT];
    for (joint, reach) in reach_m.iter_mut().enumerate() {
        let mut origin_m = 0.0;
        for link in joint..JOINT_COUNT {
            if link > joint {
                let offset = &chain.joints[link].parent_from_joint.translation;
                origin_m += offset.vector.norm();
            }
            reach[link] = origin_m + link_radii_m[link];
        }
    }
    reach_m
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3};

    use super::*;
    use crate::test_cell::{Random, cuboid, ur3};

    fn cell() -> Cell {
        let table = cuboid("table", [0.6, 0.1, 0.55], [0.4, 0.6, 0.1]);
        ur3(vec![needlebench_cell::CollisionBody {
            name: "table".into(),
            kind: needlebench_cell::BodyKind::Table,
            frame: Frame::World,
            solids: vec![table],
        }])
    }

    #[test]
    fn no_point_of_a_link_goes_further_than_its_travel() {
        let mut near = BroadPhase::new(&cell()).unwrap();
        let radii_m = [0.1, 0.3, 0.28, 0.08, 0.08, 0.2];
        near.reach_m = reaches_m(&near.chain, &radii_m);
        let chain = near.chain;
        let mut random = Random(5);
        let mut tightest: f64 = 0.0;
        for amplitude in [1e-4, 1e-2, 1.0] {
            for _ in 0..100 {
                let from = random.joints(3.0);
                let to = from + random.joints(amplitude);
                near.reset(&from);
                near.move_to(&to);
                let (before, after) = (chain.link_poses(&from), chain.link_poses(&to));
                for link in 0..JOINT_COUNT {
                    let axis = random.joints(1.0).fixed_rows::<3>(0).into_owned();
                    let direction = UnitVector3::new_normalize(axis);
                    let point = Point3::from(direction.into_inner() * radii_m[link]);
                    // Seen from the world, and from each link before it.
                    for joint in 0..=link {
                        let seen = |poses: &[Pose; JOINT_COUNT]| {
                            let in_base = poses[link] * point;
                            if joint == 0 {
                                in_base
                            } else {
                                poses[joint - 1].inverse_transform_point(&in_base)
                            }
                        };
                        let gone_m = (seen(&after) - seen(&before)).norm();
                        let travel_m = near.travel_m[joint][link];
                        assert!(gone_m <= travel_m * (1.0 + 1e-12), "{joint} {link}");
                        tightest = tightest.max(gone_m / travel_m);
                    }
                }
            }
        }
        // The bound is a bound, not a way to look at every pair in every step.
        assert!(tightest > 0.7, "{tightest}");
    }

    /// What is not called near is at least this far apart: the limit less the errors of parry.
    const APART_M: f64 = 0.9 * NEAR_M;

    #[test]
    fn what_is_not_called_near_is_apart() {
        let mut near = BroadPhase::new(&cell()).unwrap();
        let mut random = Random(6);
        let mut seen = [0, 0];
        for _ in 0..20 {
            let (from, to) = (random.joints(2.0), random.joints(2.0));
            near.reset(&from);
            for k in 1..=100 {
                near.move_to(&from.lerp(&to, f64::from(k) / 100.0));
                let links = near.chain.link_poses(&near.position);
                let poses = links.map(|pose| near.world_from_base_link * pose);
                for pair in &near.pairs {
                    let gap_m = gap_m(&near.parts, &near.spheres, pair.parts, &poses);
                    seen[usize::from(pair.near)] += 1;
                    assert!(pair.near || gap_m > APART_M, "{pair:?}: {gap_m}");
                }
            }
        }
        assert!(seen.iter().all(|&count| count > 100), "{seen:?}");
    }
}
