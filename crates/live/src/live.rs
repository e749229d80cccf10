//! A scene with a movable base.

use needlebench_cell::{BodyKind, BodyPair, ClearanceClass, CollisionBody, Frame};
use needlebench_clearance::{ClearanceModel, ClearanceParts, PairClearance};
use needlebench_geometry::{Solid, TriangleMesh};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use needlebench_scenario::fixtures::{FixtureError, mount};
use needlebench_scenario::{FOOT_M, RIGID_M};

use crate::scene::{Scene, Tie};

/// Fineness of a mount's curved surfaces, which it has none of, m.
const CHORD_ERROR_M: f64 = 1e-3;

/// A scene whose base can be moved.
#[derive(Debug)]
pub struct Live {
    pub(crate) scene: Scene,
    /// Where the base is now, with all that goes along.
    pub(crate) world_from_base_link: Pose,
    bodies: Vec<CollisionBody>,
    /// Pairs of the scene.
    pub(crate) model: ClearanceModel,
    /// Base and mount against the fixed bodies of the room.
    standing: ClearanceModel,
    standing_pairs: Vec<BodyPair>,
    /// None for an arm that is not of UR's build.
    pub(crate) kinematics: Option<Kinematics>,
}

/// Overlap of base or mount with a fixed body of the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Body of the base, or what goes along with it.
    pub body: usize,
    /// The body that it overlaps.
    pub other: usize,
    /// Depth, m.
    pub depth_m: f64,
}

impl Live {
    /// Prepares a scene.
    pub fn new(scene: Scene) -> Self {
        let bodies: Vec<CollisionBody> = scene.bodies.iter().map(|it| it.body.clone()).collect();
        let standing_pairs = standing_pairs(&scene);
        let parts = |pairs| ClearanceParts {
            chain: &scene.chain,
            world_from_base_link: &scene.world_from_base_link,
            bodies: &bodies,
            pairs,
            behind_cuts: &[],
        };
        let model = ClearanceModel::of_parts(&parts(&scene.pairs));
        let standing = model.for_parts(&parts(&standing_pairs));
        let kinematics = Kinematics::new(scene.chain).ok();
        Self {
            world_from_base_link: scene.world_from_base_link,
            kinematics: kinematics.map(|it| it.within(scene.joint_limits)),
            scene,
            bodies,
            model,
            standing,
            standing_pairs,
        }
    }

    /// Moves the base, and what is attached to it, to another placement.
    ///
    /// # Errors
    /// A placement at which its mount cannot carry it; all stays as it was.
    pub fn place_base(&mut self, world_from_base_link: &Pose) -> Result<(), FixtureError> {
        let carried = match &self.scene.mount {
            Some(section) => {
                mount(section, world_from_base_link, self.scene.table.as_ref())?.solids
            }
            None => Vec::new(),
        };
        let new_from_old = world_from_base_link * self.scene.world_from_base_link.inverse();
        for (body, of_scene) in self.bodies.iter_mut().zip(&self.scene.bodies) {
            body.solids = match of_scene.tie {
                Tie::None => continue,
                Tie::Mount => carried.clone(),
                Tie::Base => of_scene
                    .body
                    .solids
                    .iter()
                    .map(|solid| Solid {
                        parent_from_shape: new_from_old * solid.parent_from_shape,
                        ..solid.clone()
                    })
                    .collect(),
            };
        }
        self.world_from_base_link = *world_from_base_link;
        let parts = |pairs| ClearanceParts {
            chain: &self.scene.chain,
            world_from_base_link,
            bodies: &self.bodies,
            pairs,
            behind_cuts: &[],
        };
        let model = self.model.for_parts(&parts(&self.scene.pairs));
        self.standing = model.for_parts(&parts(&self.standing_pairs));
        self.model = model;
        Ok(())
    }

    /// Moves the base back to its placement in the scene.
    pub fn reset_base(&mut self) {
        *self = Self::new(self.scene.clone());
    }

    /// Clearance of every pair of the scene, in its order.
    pub fn pairs(&self, q: &Joints) -> Vec<PairClearance> {
        self.model.all_pairs(q)
    }

    /// Overlaps of base and mount, deeper than a foot or rounding is.
    pub fn overlaps(&self) -> Vec<Overlap> {
        let found = self.standing.all_pairs(&self.scene.start).into_iter();
        let overlaps = found.map(|it| Overlap {
            body: self.standing_pairs[it.pair].a,
            other: self.standing_pairs[it.pair].b,
            depth_m: -it.separation.distance_m,
        });
        let allowed_m = |body: usize| match self.bodies[body].kind {
            BodyKind::Base => FOOT_M,
            _ => RIGID_M,
        };
        overlaps
            .filter(|it| it.depth_m > allowed_m(it.body))
            .collect()
    }

    /// Lowest point of boxes around the moving bodies, over the floor, m.
    pub fn lowest_m(&self, q: &Joints) -> f64 {
        let links: [Pose; JOINT_COUNT] = self
            .scene
            .chain
            .link_poses(q)
            .map(|pose| self.world_from_base_link * pose);
        let of_bodies = self.bodies.iter().filter_map(|body| match body.frame {
            Frame::Link(link) if body.kind != BodyKind::NeedleCorridor => Some((body, links[link])),
            _ => None,
        });
        let low_m = of_bodies.flat_map(|(body, pose)| {
            body.solids.iter().map(move |solid| {
                let placed = Solid {
                    parent_from_shape: pose * solid.parent_from_shape,
                    ..solid.clone()
                };
                placed.bounding_box().0.z
            })
        });
        low_m.fold(f64::INFINITY, f64::min)
    }

    /// The mount where it is now, for pictures.
    pub fn mount_surfaces(&self) -> Vec<TriangleMesh> {
        let bodies = self.bodies.iter().zip(&self.scene.bodies);
        let solids = bodies
            .filter(|(_, of_scene)| of_scene.tie == Tie::Mount)
            .flat_map(|(body, _)| &body.solids);
        solids
            .map(|solid| {
                let mut surface = solid.shape.surface(CHORD_ERROR_M);
                for vertex in &mut surface.vertices_m {
                    *vertex = solid.parent_from_shape * *vertex;
                }
                surface
            })
            .collect()
    }
}

/// Base and mount against all bodies of the room that do not move with them.
fn standing_pairs(scene: &Scene) -> Vec<BodyPair> {
    let places = 0..scene.bodies.len();
    let stands = |at: usize| scene.bodies[at].body.frame == Frame::World;
    let goes_along = |at: usize| stands(at) && scene.bodies[at].tie != Tie::None;
    let stays = |at: usize| stands(at) && scene.bodies[at].tie == Tie::None;
    let of_body = |a: usize| {
        let others = (0..scene.bodies.len()).filter(|at| stays(*at));
        others.map(move |b| BodyPair {
            a,
            b,
            // Any: these are not used by class.
            class: ClearanceClass::RobotObstacle,
        })
    };
    places
        .filter(|at| goes_along(*at))
        .flat_map(of_body)
        .collect()
}
