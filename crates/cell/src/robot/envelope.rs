//! What stands for links whose shapes in a URDF are missing or too small: what is known of the arm, or nothing.

use std::collections::{BTreeMap, BTreeSet};

use needlebench_geometry::mesh::{area_m2, points_on};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::enclosure::{CHORD_ERROR_M, signed_distance_m, surface_in_parent};
use super::rename_unique;
use crate::model::UnseenPart;
use crate::{Finding, Robot, nearest_name};

/// Samples on the known envelope of a link, about.
const SAMPLES: f64 = 600.0;

/// How far the known envelope reaches beyond a link's own shapes on average, at most, m: the shipped ones are 0.7 to
/// 4.5 mm outside the makers' surfaces (`models/*/README.md`, step 6).
const MEAN_BEYOND_M: f64 = 0.008;

/// The same where it reaches farthest, m: 26 mm, where the sphere of the UR5e's elbow lies inside it.
const WORST_BEYOND_M: f64 = 0.04;

/// What a scenario says of a link's collision shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StatedShape {
    /// It needs none: nothing is to be said of its clearance.
    None,
    /// The URDF's, whatever is known of the arm.
    Given,
}

impl Robot {
    /// Gives links that have no collision shape, or shapes that do not fill what is known of the arm, the enclosing
    /// primitives of the arm's own URDF, and says so. What is left without a shape is in [`Robot::unseen`], unless
    /// `stated` says that it has none.
    ///
    /// To be called before a calibration moves the links' frames.
    pub(crate) fn complete_shapes(
        &mut self,
        stated: &BTreeMap<String, StatedShape>,
    ) -> Result<(), Finding> {
        self.check_names(stated)?;
        let labels: Vec<String> = self.all_links().map(|link| link.name.clone()).collect();
        let stated_of = |owner: usize, robot: &Self| {
            let members = robot.members.iter().filter(|each| each.owner == owner);
            let mut names = members.map(|each| each.name.as_str());
            let by_link = names.find_map(|name| stated.get(name).copied());
            stated.get(&labels[owner]).copied().or(by_link)
        };
        let known = self.known_envelopes();
        for (owner, envelope) in known.into_iter().enumerate() {
            if stated_of(owner, self).is_some() {
                continue;
            }
            let whose = self.arm.as_ref().map_or("", |used| &used.arm.data.name);
            let label = &labels[owner];
            let link = match owner.checked_sub(1) {
                None => &mut self.base,
                Some(moving) => &mut self.links[moving],
            };
            let why = if link.solids.is_empty() {
                "has no collision geometry".to_owned()
            } else {
                let (mean_m, worst_m) = beyond_m(&envelope, &link.solids);
                if mean_m <= MEAN_BEYOND_M && worst_m <= WORST_BEYOND_M {
                    continue;
                }
                format!(
                    "has collision shapes that leave out up to {:.0} mm of it",
                    worst_m * 1e3
                )
            };
            link.solids.extend(envelope);
            rename_unique(&mut link.solids, label);
            let told =
                format!("{label} {why}: the primitives that enclose a {whose}'s stand for it");
            self.notes
                .retain(|note| !note.starts_with(&format!("{label} has no collision")));
            self.notes.push(told);
        }
        let mut unseen = Vec::new();
        for (owner, label) in labels.iter().enumerate() {
            let is_bare = self
                .all_links()
                .nth(owner)
                .is_some_and(|link| link.solids.is_empty());
            if is_bare && stated_of(owner, self).is_none() {
                unseen.push(UnseenPart {
                    name: label.clone(),
                    owner: Some(owner),
                });
            }
        }
        // What is bolted to a link and drawn, and is no link of an arm itself.
        let bare: BTreeSet<usize> = unseen.iter().filter_map(|each| each.owner).collect();
        for member in &self.members {
            let is_bare = member.is_drawn && !member.has_geometry && !member.is_links_own;
            if is_bare && !bare.contains(&member.owner) && !stated.contains_key(&member.name) {
                unseen.push(UnseenPart {
                    name: member.name.clone(),
                    owner: Some(member.owner),
                });
            }
        }
        let without = stated
            .iter()
            .filter(|(_, shape)| **shape == StatedShape::None);
        let without: Vec<&str> = without.map(|(name, _)| name.as_str()).collect();
        if !without.is_empty() {
            self.notes.push(format!(
                "{}{}",
                crate::model::WITHOUT_SHAPE,
                without.join(", ")
            ));
        }
        self.unseen = unseen;
        Ok(())
    }

    /// Base and moving links.
    fn all_links(&self) -> impl Iterator<Item = &crate::Link> {
        std::iter::once(&self.base).chain(&self.links)
    }

    fn check_names(&self, stated: &BTreeMap<String, StatedShape>) -> Result<(), Finding> {
        let labels = self.all_links().map(|link| link.name.as_str());
        let members = self.members.iter().map(|each| each.name.as_str());
        let names: Vec<&str> = labels.chain(members).collect();
        let Some(unknown) = stated.keys().find(|name| !names.contains(&name.as_str())) else {
            return Ok(());
        };
        let message = format!("the robot has no link `{unknown}`");
        let finding = Finding::new(&self.source.file, message).key("robot.shape");
        Err(match nearest_name(unknown, names.iter().copied()) {
            Some(near) => finding.hint(format!("did you mean `{near}`?")),
            None => finding.hint(format!("there are {}", names.join(", "))),
        })
    }

    /// The enclosing primitives of base and moving links in this robot's link frames, by the arm's own URDF; empty
    /// where nothing is known of it, and of the arm's own URDF itself.
    fn known_envelopes(&self) -> Vec<Vec<Solid>> {
        let used = self.arm.as_ref();
        let used = used.filter(|used| used.has_its_lengths() && used.arm.data.enclosure.is_some());
        let Some(nominal) = used.and_then(|used| used.nominal.as_ref()) else {
            return Vec::new();
        };
        // Two descriptions of one arm may turn their link frames differently; at zero angles the links are in the
        // same place.
        let zero = Joints::zeros();
        let (theirs, ours) = (
            self.chain.link_poses(&zero),
            nominal.chain.link_poses(&zero),
        );
        let mut all = vec![nominal.base.solids.clone()];
        all.extend((0..JOINT_COUNT).map(|index| {
            let theirs_from_ours: Pose = theirs[index].inverse() * ours[index];
            crate::model::placed(&nominal.links[index].solids, &theirs_from_ours)
        }));
        all
    }
}

/// How far the outer surface of a link's envelope is outside its shapes, on average and at most, m.
fn beyond_m(envelope: &[Solid], solids: &[Solid]) -> (f64, f64) {
    let surfaces: Vec<_> = envelope.iter().map(surface_in_parent).collect();
    let area: f64 = surfaces.iter().map(|each| area_m2(each.mesh())).sum();
    let spacing_m = (area / SAMPLES).sqrt();
    let own: Vec<_> = solids
        .iter()
        .map(|solid| (solid, surface_in_parent(solid)))
        .collect();
    let (mut sum_m, mut count, mut worst_m) = (0.0, 0_u32, 0.0_f64);
    for (index, surface) in surfaces.iter().enumerate() {
        for point in points_on(surface.mesh(), spacing_m) {
            let hidden = envelope.iter().enumerate().any(|(other, solid)| {
                other != index && signed_distance_m(solid, &point) < -CHORD_ERROR_M
            });
            if hidden {
                continue;
            }
            let over_m = own
                .iter()
                .map(|(solid, surface)| match solid.shape {
                    Shape::Convex(_) | Shape::Mesh(_) => surface.signed_distance_m(&point),
                    _ => signed_distance_m(solid, &point),
                })
                .fold(f64::INFINITY, f64::min)
                .max(0.0);
            worst_m = worst_m.max(over_m);
            sum_m += over_m;
            count += 1;
        }
    }
    (sum_m / f64::from(count.max(1)), worst_m)
}
