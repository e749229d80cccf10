//! The phantom of a layout, moved: what [`resolve`](super::resolve) says of another place of it, without
//! resolving again what stays where it is.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Point3;
use needlebench_cell::{BodyKind, CollisionBody, Frame, placed};
use needlebench_input::TomlText;

use super::goals::{BodyBoxes, Goal, GoalInPhantom, Surroundings, goal_in_phantom, place_goal};
use super::library::ModelLibrary;
use super::obstacles::{PlacedObstacles, place_obstacles};
use super::people::{PatientSides, check_sides, have_room_by_boxes};
use super::phantom::{Corners, PlacedPhantom, UnplacedPhantom, place_phantom};
use super::standing::{KnownDepths, Standing, check_distance, patient_box};
use super::{Finding, ResolvedScenario};
use crate::scenario::PhantomSection;

/// All of a layout of one goal that stays where it is when its phantom is moved.
#[derive(Debug)]
pub(crate) struct StillLayout {
    resolved: ResolvedScenario,
    phantom: Arc<UnplacedPhantom>,
    obstacles: PlacedObstacles,
    /// Bodies that stand in the room, but for the robot's base and the phantom.
    fixtures: Vec<CollisionBody>,
    boxes: Vec<BodyBoxes>,
    /// The robot's base.
    base: CollisionBody,
    base_boxes: BodyBoxes,
    /// None for a goal that does not go with the phantom.
    goal: Option<GoalInPhantom>,
    depths: KnownDepths,
}

impl StillLayout {
    /// Of a layout that is resolved; none without a phantom and a goal. `library` and `folder` are those that
    /// it was resolved with.
    ///
    /// # Errors
    /// None that resolving has not had, unless files have changed since.
    pub fn new(
        resolved: ResolvedScenario,
        folder: &Path,
        library: &ModelLibrary,
    ) -> Result<Option<Self>, Vec<Finding>> {
        let one = |finding: Finding| vec![finding];
        let file = resolved.source.file.clone();
        let toml = TomlText::without_text(&file);
        let scenario = &resolved.scenario;
        let (Some(section), [goal_section]) = (&scenario.phantom, &scenario.goals[..]) else {
            return Ok(None);
        };
        // Of a resolved layout these are there already: notes have been taken.
        let mut notes = Vec::new();
        let phantom = library.phantom(&toml, section, folder)?;
        let obstacles = place_obstacles(
            &toml,
            scenario,
            &resolved.cell.robot.world_from_base_link,
            |index, section| library.obstacle(&toml, index, section, folder),
        )?;
        let cell = &resolved.cell;
        let base = CollisionBody {
            name: cell.robot.base.name.clone(),
            kind: BodyKind::Base,
            frame: Frame::World,
            solids: placed(&cell.robot.base.solids, &cell.robot.world_from_base_link),
        };
        let others: Vec<CollisionBody> = cell
            .bodies
            .iter()
            .filter(|body| body.frame == Frame::World)
            .filter(|body| {
                !matches!(
                    body.kind,
                    BodyKind::Base | BodyKind::Phantom | BodyKind::Person
                )
            })
            .cloned()
            .collect();
        let boxes: Vec<BodyBoxes> = others.iter().map(BodyBoxes::new).collect();
        let context = Surroundings {
            robot: &resolved.cell.robot,
            tool: &resolved.cell.tool,
            phantom: resolved.phantom.as_ref(),
            fixtures: &others,
            boxes: &boxes,
            needle: resolved.needle_in_tissue(),
        };
        let goal = goal_in_phantom(&toml, 0, goal_section, &context, &mut notes).map_err(one)?;
        Ok(Some(Self {
            base_boxes: BodyBoxes::new(&base),
            base,
            boxes,
            fixtures: others,
            phantom,
            obstacles,
            goal,
            depths: KnownDepths::default(),
            resolved,
        }))
    }

    pub fn resolved(&self) -> &ResolvedScenario {
        &self.resolved
    }

    /// The phantom and the goal where `section` lays them; none where it takes more to say whether there is
    /// such a layout. All that it names but the place is that of the layout.
    ///
    /// # Errors
    /// As [`resolve`](super::resolve) has them.
    pub(crate) fn with_phantom_at(
        &self,
        section: &PhantomSection,
    ) -> Result<Option<(PlacedPhantom, Goal)>, Vec<Finding>> {
        if self.people_are_bodies() {
            return Ok(None);
        }
        let one = |finding: Finding| vec![finding];
        let (scenario, cell) = (&self.resolved.scenario, &self.resolved.cell);
        let toml = TomlText::without_text(&self.resolved.source.file);
        let mut notes = Vec::new();
        let placed =
            place_phantom(&toml, section, scenario.table.as_ref(), &self.phantom).map_err(one)?;
        let standing = Standing {
            toml: &toml,
            scenario,
            robot: &cell.robot,
            fixtures: &self.resolved.fixtures,
            phantom: Some((&placed, &self.phantom)),
            obstacles: &self.obstacles.placed,
            base: &self.base.solids,
            known: &self.depths,
        };
        standing.check_lying(&mut notes).map_err(one)?;
        let context = Surroundings {
            robot: &cell.robot,
            tool: &cell.tool,
            phantom: Some(&placed),
            fixtures: &self.fixtures,
            boxes: &self.boxes,
            needle: self.resolved.needle_in_tissue(),
        };
        let goal =
            place_goal(&toml, 0, &scenario.goals[0], self.goal.as_ref(), &context).map_err(one)?;
        let goals = std::slice::from_ref(&goal);
        check_distance(&toml, scenario, &cell.robot, &cell.tool, goals).map_err(one)?;
        let sides = PatientSides::new(&placed.world_from_phantom.rotation);
        check_sides(&toml, &scenario.people, sides.as_ref()).map_err(one)?;
        let patient = widened(&patient_box(&self.phantom, &placed));
        let bodies = self.boxes.iter().chain([&self.base_boxes]);
        let boxes: Vec<&Corners> = bodies.map(|body| &body.whole).chain([&patient]).collect();
        let have_room = have_room_by_boxes(
            &scenario.people,
            &goal,
            sides.as_ref(),
            &Point3::from(cell.robot.world_from_base_link.translation.vector),
            &boxes,
        );
        Ok(have_room.then_some((placed, goal)))
    }
}

impl StillLayout {
    /// Whether there are people to keep away from: they stand and face where the goal is, which moves with the phantom.
    fn people_are_bodies(&self) -> bool {
        !self.resolved.scenario.people.persons.is_empty()
    }

    /// Whether nothing but the patient is elsewhere, and the patient's limbs lie beside the chest as in the layout: they
    /// may not where the chest is turned on what it rests on.
    pub(crate) fn lies_alike(&self, placed: &PlacedPhantom) -> bool {
        /// More than the rounding of a place, m and rad.
        const SAME: f64 = 1e-9;
        let known = self.resolved.phantom.as_ref();
        let stand_still = !self.people_are_bodies();
        known.is_some_and(|known| {
            stand_still
                && known.limbs.len() == placed.limbs.len()
                && known.limbs.iter().zip(&placed.limbs).all(|(known, here)| {
                    let [known, here] = [known, here].map(|limb| limb.solid.parent_from_shape);
                    let between = known.inverse() * here;
                    between.translation.vector.norm() < SAME && between.rotation.angle() < SAME
                })
        })
    }
}

/// A box that holds what rounding may put outside of one.
fn widened((low, high): &Corners) -> Corners {
    /// More than the rounding of some metres, m.
    const ROUNDING_M: f64 = 1e-9;
    let by = nalgebra::Vector3::repeat(ROUNDING_M);
    (low - by, high + by)
}
