//! A motion that is exported, and what every export says of it.

use needlebench_bench::motion::WorkingMotion;
use needlebench_bench::provenance::PROGRAM_VERSION;
use needlebench_bench::{EngineRun, RealArm, ScenarioRun};
use needlebench_cell::{ClearanceClass, pair_in_words};
use needlebench_clearance::MotionCertificate;
use needlebench_evaluation::judged::JudgedReport;
use needlebench_evaluation::report::Status;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use needlebench_planning::Rejection;
use needlebench_scenario::{Goal, ResolvedScenario};

/// A planned motion and, where an engine carried it out, its recording.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// The scenario.
    pub resolved: &'a ResolvedScenario,
    /// Where the needle is to go.
    pub goal: &'a Goal,
    /// In which configuration.
    pub configuration: Configuration,
    /// As planned.
    pub trajectory: &'a JointTrajectory,
    /// What the run says of it.
    pub status: Status,
    /// Rules that it violates, the first failing one first: what runs simulate of configurations that do not work.
    pub rejections: &'a [Rejection],
    /// Its certified clearances; none where there are none.
    pub certificate: Option<&'a MotionCertificate>,
    /// As an engine recorded it.
    pub recorded: &'a EngineRun,
    /// The arm that the engine had.
    pub real_arm: &'a RealArm,
    /// Where it comes from, if it is somebody else's.
    pub judged: Option<&'a JudgedReport>,
}

impl<'a> Motion<'a> {
    /// Of a feasible motion.
    pub fn of(working: &'a WorkingMotion) -> Self {
        Self {
            resolved: working.scenario(),
            goal: working.goal(),
            configuration: working.plan().configuration,
            trajectory: working.trajectory(),
            status: Status::Ok,
            rejections: &working.plan().rejections,
            certificate: working.plan().certificate.as_ref(),
            recorded: working.recorded(),
            real_arm: &working.run().real_arm,
            judged: None,
        }
    }

    /// Of a recording of a whole run; none where its configuration has no motion.
    pub fn in_run(
        resolved: &'a ResolvedScenario,
        finished: &'a ScenarioRun,
        [goal, configuration]: [usize; 2],
        recorded: &'a EngineRun,
    ) -> Option<Self> {
        let plan = &finished.plans[goal].configurations[configuration];
        Some(Self {
            resolved,
            goal: &resolved.goals[goal],
            configuration: plan.configuration,
            trajectory: plan.trajectory.as_ref()?,
            status: finished.report.goals[goal].configurations[configuration].status,
            rejections: &plan.rejections,
            certificate: plan.certificate.as_ref(),
            recorded,
            real_arm: &finished.real_arm,
            judged: finished.report.judged.as_ref(),
        })
    }

    /// What it is and where it comes from, by name.
    pub(crate) fn origin(&self) -> Vec<(&'static str, String)> {
        let robot = &self.resolved.robot_description;
        let mut origin = vec![
            ("program", format!("needlebench {PROGRAM_VERSION}")),
            ("scenario", self.resolved.scenario.name.clone()),
            ("scenario_sha256", self.resolved.source.sha256.clone()),
            ("seed", self.resolved.scenario.seed.to_string()),
            ("arm", robot.arm_name.clone()),
            ("robot_sha256", robot.source.sha256.clone()),
            ("tool", self.resolved.cell.tool.name.clone()),
            ("goal", self.goal.name.clone()),
            ("configuration", self.configuration.label().to_owned()),
            ("engine", self.recorded.engine.to_owned()),
            (
                "engine_version",
                self.recorded.recording.engine.version.clone(),
            ),
        ];
        if let Some(judged) = self.judged {
            origin.push(("motion", judged.file.clone()));
            origin.push(("motion_sha256", judged.sha256.clone()));
        }
        origin
    }

    /// Proven lower bounds of the planned motion's clearances by class, m, with the pair that comes nearest; classes
    /// that the cell has no part for, and those of the needle, are absent. None where nothing is certified.
    pub(crate) fn proven_m(&self) -> Option<Vec<Proven>> {
        let certificate = self.certificate?;
        let classes = ClearanceClass::ALL.into_iter();
        let proven = classes
            .filter(|class| class.is_physical())
            .filter_map(|class| {
                let found = certificate.get(class)?;
                let (a, b) = found.attained.solid_names(&self.resolved.cell);
                Some(Proven {
                    class,
                    lower_bound_m: found.lower_bound_m,
                    pair: [a.to_owned(), b.to_owned()],
                })
            });
        Some(proven.collect())
    }

    /// The same as a line of words for each class, less what an export strays from the planned path.
    pub(crate) fn proven_in_words(&self, stray_m: f64) -> Vec<String> {
        let Some(proven) = self.proven_m() else {
            return vec!["not certified: no certified clearances".to_owned()];
        };
        if proven.is_empty() {
            return vec!["no pairs".to_owned()];
        }
        let line = |each: &Proven| {
            // Down, so that what is said is proven.
            let proven_mm = ((each.lower_bound_m - stray_m) * 1e5).floor() / 1e2;
            let pair = pair_in_words(&each.pair);
            format!("{}: {proven_mm:.2} mm ({pair})", each.class.name())
        };
        proven.iter().map(line).collect()
    }

    /// Pose of the guide's exit in the controller's base frame, of the nominal arm.
    pub(crate) fn base_from_guide_exit(&self, q: &Joints) -> Pose {
        let robot = &self.resolved.cell.robot;
        let base_from_base_link = needlebench_cell::Robot::base_link_from_base().inverse();
        base_from_base_link
            * robot.chain.base_link_from_flange(q)
            * self.resolved.cell.tool.flange_from_guide_exit
    }

    /// For each joint the farthest that anything it moves is from its axis, m: no less in any posture.
    pub(crate) fn reach_m(&self) -> [f64; JOINT_COUNT] {
        let cell = &self.resolved.cell;
        // Of what each link carries, from the link's origin.
        let mut of_link = [0.0_f64; JOINT_COUNT];
        for body in &cell.bodies {
            let needlebench_cell::Frame::Link(link) = body.frame else {
                continue;
            };
            for solid in &body.solids {
                let at_m = solid.parent_from_shape.translation.vector.norm();
                of_link[link] = of_link[link].max(at_m + solid.shape.bounding_radius_m());
            }
        }
        let mut reach = [0.0_f64; JOINT_COUNT];
        for joint in (0..JOINT_COUNT).rev() {
            let next = cell.robot.chain.joints.get(joint + 1);
            let beyond = next.map_or(0.0, |next| {
                next.parent_from_joint.translation.vector.norm() + reach[joint + 1]
            });
            reach[joint] = of_link[joint].max(beyond);
        }
        reach
    }
}

/// A certified clearance.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Proven {
    pub class: ClearanceClass,
    pub lower_bound_m: f64,
    pub pair: [String; 2],
}
