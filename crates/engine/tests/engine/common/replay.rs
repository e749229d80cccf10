//! An engine without physics: its arm is always where the motion wants it.
//!
//! All that a further engine has to be.

use needlebench_cell::{Cell, EngineSettings};
use needlebench_engine::{
    ArmSpec, Contact, Engine, EngineError, EngineIdentity, EngineSession, Plant, PlantState,
};
use needlebench_kinematics::trajectory::{JointState, JointTrajectory};
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};

/// The engine.
#[derive(Debug)]
pub struct Replay;

impl Engine for Replay {
    fn name(&self) -> &'static str {
        "replay"
    }

    fn title(&self) -> &'static str {
        "Replay"
    }

    fn start(
        &self,
        _settings: &EngineSettings,
        _tell: &mut dyn FnMut(&str),
    ) -> Result<Box<dyn EngineSession>, EngineError> {
        Ok(Box::new(Session))
    }
}

struct Session;

impl EngineSession for Session {
    fn make_plant<'s>(&'s mut self, arm: &ArmSpec<'_>) -> Result<Box<dyn Plant + 's>, EngineError> {
        Ok(Box::new(Puppet {
            cell: arm.cell.clone(),
            timestep_s: arm.timestep_s,
            motion: None,
            steps: 0,
        }))
    }
}

struct Puppet {
    cell: Cell,
    timestep_s: f64,
    motion: Option<JointTrajectory>,
    steps: u32,
}

impl Puppet {
    fn wanted(&self) -> JointState {
        let time_s = f64::from(self.steps) * self.timestep_s;
        let at_rest = JointState::at_rest(Joints::zeros());
        self.motion
            .as_ref()
            .map_or(at_rest, |motion| motion.sample(time_s))
    }

    fn state(&self) -> PlantState {
        let wanted = self.wanted();
        PlantState {
            position: wanted.position,
            velocity: wanted.velocity,
            world_from_flange: self.cell.robot.world_from_flange(&wanted.position),
            contact: Contact::default(),
        }
    }
}

impl Plant for Puppet {
    fn identity(&self) -> EngineIdentity {
        EngineIdentity {
            name: "replay",
            version: "1".to_owned(),
            settings: vec![("timestep_s".to_owned(), self.timestep_s.to_string())],
        }
    }

    fn reset(&mut self, position: &Joints) -> Result<PlantState, EngineError> {
        self.begin(&JointTrajectory::starting_at(*position))
    }

    fn begin(&mut self, motion: &JointTrajectory) -> Result<PlantState, EngineError> {
        (self.motion, self.steps) = (Some(motion.clone()), 0);
        Ok(self.state())
    }

    fn step(&mut self, _torque_nm: &Joints) -> Result<PlantState, EngineError> {
        self.steps += 1;
        Ok(self.state())
    }

    fn timestep_s(&self) -> f64 {
        self.timestep_s
    }

    fn velocity_age_s(&self) -> f64 {
        0.0
    }

    fn link_poses(&mut self) -> Result<[Pose; JOINT_COUNT], EngineError> {
        let links = self.cell.robot.chain.link_poses(&self.wanted().position);
        Ok(links.map(|link| self.cell.robot.world_from_base_link * link))
    }
}
