//! Collision bits that let exactly the cell's physical pairs touch, the same in both engines.

use std::collections::{BTreeMap, BTreeSet};

use needlebench_cell::Cell;

use crate::EngineError;

/// Distinct bits: MuJoCo keeps `contype` and `conaffinity` in signed 32-bit integers.
const GROUP_LIMIT: usize = 31;

/// Collision bits of one body: two bodies touch if each one's `mask` has the other's `member`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct ContactBits {
    /// The group that the body belongs to; 0 for a body that touches nothing.
    pub member: u32,
    /// The groups that it touches.
    pub mask: u32,
}

/// Bits per [`Cell::bodies`] entry.
///
/// Bodies with the same partners share a group. Because the relation is symmetric and no body is its
/// own partner, the groups reproduce it exactly.
pub(crate) fn contact_bits(cell: &Cell) -> Result<Vec<ContactBits>, EngineError> {
    let mut partners = vec![BTreeSet::new(); cell.bodies.len()];
    for pair in cell.pairs.iter().filter(|pair| pair.class.is_physical()) {
        partners[pair.a].insert(pair.b);
        partners[pair.b].insert(pair.a);
    }
    let mut group_of = BTreeMap::new();
    for set in partners.iter().filter(|set| !set.is_empty()) {
        let next = group_of.len();
        group_of.entry(set.clone()).or_insert(next);
    }
    if group_of.len() > GROUP_LIMIT {
        return Err(EngineError::TooManyContactGroups {
            groups: group_of.len(),
            limit: GROUP_LIMIT,
        });
    }
    let member = |body: usize| {
        group_of
            .get(&partners[body])
            .map_or(0, |&group| 1_u32 << group)
    };
    Ok((0..cell.bodies.len())
        .map(|body| ContactBits {
            member: member(body),
            mask: partners[body]
                .iter()
                .fold(0, |mask, &other| mask | member(other)),
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use needlebench_cell::{BodyKind, BodyPair, ClearanceClass, CollisionBody, Frame};

    use super::*;

    #[test]
    fn bits_let_exactly_the_physical_pairs_touch() {
        let cell = crate::test_cell::ur3(Vec::new());
        let bits = contact_bits(&cell).unwrap();
        for a in 0..cell.bodies.len() {
            for b in 0..cell.bodies.len() {
                let wanted = cell.pairs.iter().any(|pair| {
                    pair.class.is_physical() && [(a, b), (b, a)].contains(&(pair.a, pair.b))
                });
                let first = bits[a].member & bits[b].mask != 0;
                let second = bits[b].member & bits[a].mask != 0;
                assert_eq!((first, second), (wanted, wanted), "bodies {a} and {b}");
            }
        }
    }

    #[test]
    fn too_many_groups_are_an_error() {
        let mut cell = crate::test_cell::ur3(Vec::new());
        let solids = cell.bodies[1].solids.clone();
        // A path of 40 bodies: no two have the same partners.
        cell.bodies = (0..40)
            .map(|i| CollisionBody {
                name: i.to_string(),
                kind: BodyKind::Table,
                frame: Frame::World,
                solids: solids.clone(),
            })
            .collect();
        cell.pairs = (1..40)
            .map(|b| BodyPair {
                a: b - 1,
                b,
                class: ClearanceClass::RobotTable,
            })
            .collect();
        assert!(matches!(
            contact_bits(&cell),
            Err(EngineError::TooManyContactGroups {
                groups: 40,
                limit: 31
            })
        ));
    }
}
