//! Several arms in MuJoCo that are stepped together.

use needlebench_cell::Cell;
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointTrajectory;

use super::member::{Member, Model, unstable};
use super::process::GroupStep;
use super::{HarnessProcess, HarnessState, MujocoSettings};
use crate::{EngineError, EngineIdentity, Fleet, PlantState};

/// Arms of one cell that share a compiled model, each with a state of its own.
///
/// One message each way advances any of them by a step, so that the time that a message takes is
/// divided among them. What an arm does is the same, bit for bit, as if it were stepped alone.
pub struct MujocoFleet<'h> {
    harness: &'h mut HarnessProcess,
    model: Model,
    members: Vec<Member>,
    states: Vec<HarnessState>,
}

impl<'h> MujocoFleet<'h> {
    /// Compiles the cell's arm and everything that it may touch, and makes `count` of it.
    ///
    /// All of them have to be reset first. The harness keeps them for as long as it runs.
    pub fn new(
        harness: &'h mut HarnessProcess,
        cell: &Cell,
        timestep_s: f64,
        settings: &MujocoSettings,
        count: usize,
    ) -> Result<Self, EngineError> {
        let (model, first) = Model::load(harness, cell, timestep_s, settings)?;
        let mut members = vec![first];
        while members.len() < count {
            let copy = members[0].copy(harness)?;
            members.push(copy);
        }
        Ok(Self {
            harness,
            model,
            members,
            states: Vec::new(),
        })
    }

    /// Places one arm at rest at `position`, rad, and forgets everything that it did before.
    ///
    /// # Panics
    /// If there is no such arm.
    pub fn reset(&mut self, arm: usize, position: &Joints) -> Result<PlantState, EngineError> {
        self.members[arm].reset(self.harness, &self.model, position)
    }
}

impl Fleet for MujocoFleet<'_> {
    fn identity(&self) -> EngineIdentity {
        self.model.identity(self.harness.versions())
    }

    fn arms(&self) -> usize {
        self.members.len()
    }

    fn timestep_s(&self) -> f64 {
        self.model.timestep_s
    }

    fn begin(&mut self, arm: usize, motion: &JointTrajectory) -> Result<PlantState, EngineError> {
        self.reset(arm, &motion.sample(0.0).position)
    }

    fn step(
        &mut self,
        torques_nm: &[(usize, Joints)],
    ) -> Result<Vec<Result<PlantState, EngineError>>, EngineError> {
        let steps: Vec<GroupStep<'_>> = torques_nm
            .iter()
            .map(|(arm, torque_nm)| self.members[*arm].step(torque_nm))
            .collect();
        let failures = self.harness.step_group(&steps, &mut self.states)?;
        let mut failures = failures.into_iter().peekable();
        let mut observed = Vec::with_capacity(torques_nm.len());
        for (place, ((arm, _), state)) in torques_nm.iter().zip(&self.states).enumerate() {
            observed.push(match failures.next_if(|(failed, _)| *failed == place) {
                Some((_, reason)) => Err(unstable(reason)),
                None => self.members[*arm].observed(&self.model, state),
            });
        }
        Ok(observed)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use needlebench_cell::{BodyKind, CollisionBody, Frame};

    use super::super::mjcf::{FLANGE_SITE, mjcf};
    use super::*;
    use crate::mujoco::ensure;
    use crate::test_cell::{Random, cuboid, ur3};
    use crate::{MujocoPlant, Plant};

    const TIMESTEP_S: f64 = 1e-3;

    fn harness() -> HarnessProcess {
        let environment = ensure(&mut |stage| println!("{stage}")).unwrap();
        HarnessProcess::start(&environment, Duration::from_mins(1)).unwrap()
    }

    /// An arm above a table that it falls on.
    fn cell() -> Cell {
        let base = [0.3, -0.2, 0.5];
        let solid = cuboid("table", [base[0], base[1], 0.42], [1.5, 1.5, 0.1]);
        ur3(vec![CollisionBody {
            name: "table".into(),
            kind: BodyKind::Table,
            frame: Frame::World,
            solids: vec![solid],
        }])
    }

    const ARMS: usize = 3;
    const STEPS: usize = 900;

    fn start(arm: usize) -> Joints {
        [
            Joints::new(0.3, -0.6, 0.5, 0.4, -0.8, 0.2),
            Joints::new(-0.9, -0.2, 0.3, -0.4, 0.8, 0.2),
            Joints::new(1.2, -1.5, 1.3, 0.1, 0.8, -0.4),
        ][arm]
    }

    fn torque(random: &mut Random) -> Joints {
        random.joints(5.0)
    }

    /// Arms that leave the fleet early, fall, and touch.
    fn fleet_states(harness: &mut HarnessProcess) -> Vec<Vec<PlantState>> {
        let settings = MujocoSettings::default();
        let mut fleet = MujocoFleet::new(harness, &cell(), TIMESTEP_S, &settings, ARMS).unwrap();
        let mut randoms: Vec<Random> = (0..ARMS).map(|arm| Random(arm as u64)).collect();
        let mut states: Vec<Vec<PlantState>> = (0..ARMS)
            .map(|arm| vec![fleet.reset(arm, &start(arm)).unwrap()])
            .collect();
        for step in 0..STEPS {
            let torques: Vec<(usize, Joints)> = (0..ARMS)
                .filter(|arm| step < STEPS - 50 * arm)
                .map(|arm| (arm, torque(&mut randoms[arm])))
                .collect();
            let observed = fleet.step(&torques).unwrap();
            for ((arm, _), state) in torques.iter().zip(observed) {
                states[*arm].push(state.unwrap());
            }
        }
        states
    }

    #[test]
    fn arms_of_a_fleet_move_as_if_they_were_alone() {
        let mut harness = harness();
        let together = fleet_states(&mut harness);
        let touched = together.iter().flatten().filter(|s| s.contact.count > 0);
        let touched = touched.count();
        assert!(touched > 10, "touched in {touched} states");
        let settings = MujocoSettings::default();
        let mut plant = MujocoPlant::new(&mut harness, &cell(), TIMESTEP_S, &settings).unwrap();
        for (arm, together) in together.iter().enumerate() {
            let mut random = Random(arm as u64);
            let mut alone = vec![plant.reset(&start(arm)).unwrap()];
            while alone.len() < together.len() {
                alone.push(plant.step(&torque(&mut random)).unwrap());
            }
            assert_eq!(&alone, together, "arm {arm}");
        }
    }

    /// Leaving MuJoCo's collision detection out where nothing can touch changes no bit, and neither
    /// does cutting its steps between their halves.
    #[test]
    fn states_are_those_of_whole_steps_that_always_look_for_contacts() {
        let mut harness = harness();
        let together = fleet_states(&mut harness);
        let text = mjcf(&cell(), TIMESTEP_S, &MujocoSettings::default()).unwrap();
        let handle = harness.load(&text, FLANGE_SITE).unwrap();
        for (arm, together) in together.iter().enumerate() {
            let still = [0.0; needlebench_kinematics::JOINT_COUNT];
            let mut random = Random(arm as u64);
            harness
                .reset(&handle, start(arm).as_slice(), &still)
                .unwrap();
            let mut torques = Vec::new();
            for observed in &together[1..] {
                let torque = torque(&mut random);
                torques.extend(torque.iter().copied());
                let state = harness.step(&handle, torque.as_slice()).unwrap();
                assert_eq!(state.qpos, observed.position.as_slice(), "arm {arm}");
                assert_eq!(state.qvel, observed.velocity.as_slice());
                assert_eq!(state.contact.count, observed.contact.count);
                let force_n = observed.contact.normal_force_n;
                assert_eq!(state.contact.normal_force_n, force_n);
            }
            harness
                .reset(&handle, start(arm).as_slice(), &still)
                .unwrap();
            let whole = harness.replay(&handle, true, &torques).unwrap();
            let last = together.last().unwrap();
            assert_eq!(whole.qpos, last.position.as_slice());
            assert_eq!(whole.qvel, last.velocity.as_slice());
        }
    }

    #[test]
    fn cleared_process_serves_as_a_new_one() {
        let mut harness = harness();
        let fresh = fleet_states(&mut harness);
        let settings = MujocoSettings::default();
        let other = ur3(Vec::new());
        MujocoFleet::new(&mut harness, &other, TIMESTEP_S, &settings, 2).unwrap();
        harness.clear().unwrap();
        assert_eq!(fleet_states(&mut harness), fresh);
        // What was loaded before is gone: plants are counted from 0 again.
        harness.clear().unwrap();
        let fleet = MujocoFleet::new(&mut harness, &other, TIMESTEP_S, &settings, 1).unwrap();
        let handle = fleet.members[0].handle.clone();
        harness.clear().unwrap();
        let still = [0.0; needlebench_kinematics::JOINT_COUNT];
        let error = harness.step(&handle, &still).unwrap_err();
        assert!(error.to_string().contains("plant 0 of 0"), "{error}");
    }

    #[test]
    fn arm_that_becomes_unstable_does_not_concern_the_others() {
        let mut harness = harness();
        let settings = MujocoSettings::default();
        let mut fleet = MujocoFleet::new(&mut harness, &cell(), TIMESTEP_S, &settings, 3).unwrap();
        for arm in 0..3 {
            fleet.reset(arm, &start(0)).unwrap();
        }
        let still = Joints::zeros();
        let torques = [(2, still), (0, Joints::repeat(f64::NAN)), (1, still)];
        let states = fleet.step(&torques).unwrap();
        assert_eq!(states[0].as_ref().unwrap(), states[2].as_ref().unwrap());
        let error = states[1].as_ref().unwrap_err().to_string();
        assert!(error.contains("unstable"), "{error}");
        // A reset mends it.
        let before = fleet.reset(0, &start(0)).unwrap();
        let after = fleet.step(&[(0, still)]).unwrap().remove(0).unwrap();
        assert_eq!(states[0].as_ref().unwrap(), &after);
        assert_ne!(before, after);
    }
}
