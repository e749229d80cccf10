//! Pairs of colliders that are too far apart to touch yet.

use std::sync::atomic::{AtomicU64, Ordering};

use needlebench_kinematics::{Chain, JOINT_COUNT, Joints};
use rapier3d_f64::geometry::{ColliderHandle, ColliderSet};
use rapier3d_f64::parry::query;

use super::convert::UNITS_PER_M;

/// Pairs closer than this always go through collision detection, m.
///
/// Far above the prediction distance and above parry's errors, which are tens of micrometres.
const NEAR_M: f64 = 1e-3;

/// Remembers how far the links have to travel before a pair can touch.
///
/// A pair that was `d` apart cannot meet before its links have travelled `d` together, and a bound
/// on their travel costs nothing, while a distance costs about a microsecond. Results are the same
/// with and without.
pub(super) struct FarPairs {
    /// Bound on the way that any point of a link has gone since the reset, m.
    travel_m: [f64; JOINT_COUNT],
    /// Entry `[joint][link]`: greatest distance of the link's solids from the joint, m.
    reach_m: [[f64; JOINT_COUNT]; JOINT_COUNT],
    position: Joints,
    /// Number of colliders.
    count: usize,
    /// Per pair of colliders, the bits of the common travel below which they cannot touch.
    ///
    /// Atomic only because rapier asks hooks to be `Sync`.
    next_look_m: Vec<AtomicU64>,
}

impl FarPairs {
    /// Radii are those of each link's solids about the link's origin, m.
    pub(super) fn new(
        chain: &Chain,
        link_radii_m: &[f64; JOINT_COUNT],
        position: Joints,
        count: usize,
    ) -> Self {
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
        Self {
            travel_m: [0.0; JOINT_COUNT],
            reach_m,
            position,
            count,
            next_look_m: (0..count * count).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// Takes note of where the joints are now.
    pub(super) fn move_to(&mut self, position: Joints) {
        let moved = position - self.position;
        for link in 0..JOINT_COUNT {
            for joint in 0..=link {
                // An arc is longer than its chord.
                self.travel_m[link] += moved[joint].abs() * self.reach_m[joint][link];
            }
        }
        self.position = position;
    }

    /// Whether two colliders on the given links (`None` for the world) may touch.
    pub(super) fn may_touch(
        &self,
        handles: [ColliderHandle; 2],
        links: [Option<usize>; 2],
        colliders: &ColliderSet,
    ) -> bool {
        let index = handles.map(|handle| handle.into_raw_parts().0 as usize);
        let Some(next_look_m) = self.next_look_m.get(index[0] * self.count + index[1]) else {
            return true;
        };
        let travel_m: f64 = links
            .iter()
            .flatten()
            .map(|&link| self.travel_m[link])
            .sum();
        if travel_m < f64::from_bits(next_look_m.load(Ordering::Relaxed)) {
            return false;
        }
        let [a, b] = handles.map(|handle| &colliders[handle]);
        let found = query::distance(a.position(), a.shape(), b.position(), b.shape());
        // Unsupported shapes do not occur; if they did, rapier would see to them.
        let free_m = found.map_or(0.0, |found| found.distance / UNITS_PER_M - NEAR_M);
        if free_m > 0.0 {
            next_look_m.store((travel_m + free_m).to_bits(), Ordering::Relaxed);
        }
        free_m <= 0.0 || free_m.is_nan()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3};

    use super::*;
    use crate::test_cell::{Random, chain};

    #[test]
    fn no_point_of_a_link_goes_further_than_its_travel() {
        let chain = chain();
        let radii_m = [0.1, 0.3, 0.28, 0.08, 0.08, 0.2];
        let mut random = Random(5);
        let mut tightest: f64 = 0.0;
        for amplitude in [1e-4, 1e-2, 1.0] {
            for _ in 0..200 {
                let from = random.joints(3.0);
                let to = from + random.joints(amplitude);
                let mut pairs = FarPairs::new(&chain, &radii_m, from, 0);
                pairs.move_to(to);
                let (before, after) = (chain.link_poses(&from), chain.link_poses(&to));
                for link in 0..JOINT_COUNT {
                    let axis = random.joints(1.0).fixed_rows::<3>(0).into_owned();
                    let direction = UnitVector3::new_normalize(axis);
                    let point = Point3::from(direction.into_inner() * radii_m[link]);
                    let gone_m = (after[link] * point - before[link] * point).norm();
                    assert!(gone_m <= pairs.travel_m[link], "link {link}");
                    tightest = tightest.max(gone_m / pairs.travel_m[link]);
                }
            }
        }
        // The bound is a bound, not a way to look at every pair in every step.
        assert!(tightest > 0.7, "{tightest}");
    }
}
