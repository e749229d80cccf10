//! What stands for links whose shapes in a URDF are missing or too small: what is known of the arm, or nothing.

use std::collections::{BTreeMap, BTreeSet};

use needlebench_cell::UnseenPart;
use needlebench_geometry::{Shape, Solid};
use needlebench_input::{Finding, nearest_name};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::enclosure::{
    Overhang, known_envelopes, nearest_m, overhang, signed_distance_m, surface_in_parent,
};
use super::rename_unique;
use crate::LoadedRobot;
use crate::{ASSUMED_SHAPES, Recognition, STANDS_FOR_IT, WITHOUT_SHAPE};

/// Samples on the known envelope of a link, about.
const SAMPLES: f64 = 600.0;

/// How far the known envelope reaches beyond a link's own shapes on average, at most, m: the shipped ones are 0.7 to
/// 4.5 mm outside the manufacturers' surfaces (`models/*/README.md`, step 6).
const MEAN_BEYOND_M: f64 = 0.008;

/// The same where it reaches farthest, m: 26 mm, where the sphere of the UR5e's elbow lies inside it.
const WORST_BEYOND_M: f64 = 0.04;

/// A scenario's setting for the collision shape of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StatedShape {
    /// No shape needed; its clearance is not evaluated.
    None,
    /// The URDF's shape as it is, without completion from the arm's data.
    Given,
}

impl LoadedRobot {
    /// Gives links that have no collision shape, or shapes that do not fill what is known of the arm, the enclosing
    /// primitives of the arm's own URDF, and says so. What is left without a shape is in `unseen` of the robot, unless
    /// `stated` says that it has none.
    ///
    /// To be called before a calibration moves the links' frames.
    pub fn complete_shapes(
        &mut self,
        stated: &BTreeMap<String, StatedShape>,
    ) -> Result<(), Finding> {
        self.check_names(stated)?;
        let labels: Vec<String> = self.all_links().map(|link| link.name.clone()).collect();
        let stated_of = |owner: usize, robot: &Self| {
            let members = robot
                .description
                .members
                .iter()
                .filter(|each| each.owner == owner);
            let mut names = members.map(|each| each.name.as_str());
            let by_link = names.find_map(|name| stated.get(name).copied());
            stated.get(&labels[owner]).copied().or(by_link)
        };
        let known = known_envelopes(&self.robot, &self.description);
        for (owner, envelope) in known.into_iter().enumerate() {
            if stated_of(owner, self).is_some() {
                continue;
            }
            let whose = self
                .description
                .arm
                .as_ref()
                .map_or("", |used| &used.arm.data.name);
            let label = &labels[owner];
            let link = match owner.checked_sub(1) {
                None => &mut self.robot.base,
                Some(moving) => &mut self.robot.links[moving],
            };
            let why = if link.solids.is_empty() {
                "has no collision geometry".to_owned()
            } else {
                let Overhang {
                    mean_m, worst_m, ..
                } = beyond(&envelope, &link.solids);
                if mean_m <= MEAN_BEYOND_M && worst_m <= WORST_BEYOND_M {
                    continue;
                }
                format!(
                    "has collision shapes that miss up to {:.0} mm of it",
                    worst_m * 1e3
                )
            };
            link.solids.extend(envelope);
            rename_unique(&mut link.solids, label);
            let told =
                format!("{label} {why}: the primitives of a {whose}'s {label}{STANDS_FOR_IT}");
            self.description
                .notes
                .retain(|note| !note.starts_with(&format!("{label} has no collision")));
            self.description.notes.push(told);
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
        for member in &self.description.members {
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
            self.description
                .notes
                .push(format!("{WITHOUT_SHAPE}{}", without.join(", ")));
        }
        self.robot.unseen = unseen;
        self.note_assumed_enclosure();
        Ok(())
    }

    /// Says that shapes of the arm's own URDF are assumed, where the robot has any of them.
    fn note_assumed_enclosure(&mut self) {
        let Some(used) = &self.description.arm else {
            return;
        };
        let notes = &mut self.description.notes;
        let has_some = used.recognition == Recognition::Own
            || notes.iter().any(|note| note.ends_with(STANDS_FOR_IT));
        let data = &used.arm.data;
        let source = data.enclosure.as_ref().map(|traced| &traced.source);
        let reason = source.and_then(|source| source.strip_prefix("assumed:"));
        if let Some(reason) = reason.filter(|_| has_some) {
            notes.push(format!(
                "{ASSUMED_SHAPES}{}, and so are clearances of the arm: {}",
                data.name,
                reason.trim()
            ));
        }
    }

    fn check_names(&self, stated: &BTreeMap<String, StatedShape>) -> Result<(), Finding> {
        let labels = self.all_links().map(|link| link.name.as_str());
        let members = self
            .description
            .members
            .iter()
            .map(|each| each.name.as_str());
        let names: Vec<&str> = labels.chain(members).collect();
        let Some(unknown) = stated.keys().find(|name| !names.contains(&name.as_str())) else {
            return Ok(());
        };
        let message = format!("the robot has no link `{unknown}`");
        let finding = Finding::new(&self.description.source.file, message).key("robot.shape");
        Err(match nearest_name(unknown, names.iter().copied()) {
            Some(near) => finding.hint(format!("did you mean `{near}`?")),
            None => finding.hint(format!("links: {}", names.join(", "))),
        })
    }
}

/// How far the outer surface of a link's envelope is outside its shapes. Exact for primitives.
fn beyond(envelope: &[Solid], solids: &[Solid]) -> Overhang {
    let own: Vec<_> = solids
        .iter()
        .map(|solid| (solid, surface_in_parent(solid)))
        .collect();
    overhang(envelope, SAMPLES, |point| {
        nearest_m(own.iter().map(|(solid, surface)| match solid.shape {
            Shape::Convex(_) | Shape::Mesh(_) => surface.signed_distance_m(point),
            _ => signed_distance_m(solid, point),
        }))
    })
}
