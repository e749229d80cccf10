//! From a scenario file to a resolved cell with goals.

mod arm_values;
mod assumed;
mod cache;
mod entry;
pub mod excitation;
mod expected;
mod fixtures;
mod goals;
mod gravity;
pub mod imperfections;
pub mod iso9283;
mod layout;
mod library;
mod mesh_file;
mod moved;
mod names;
mod needle_route;
mod obstacles;
mod overrides;
pub mod people;
mod phantom;
mod robot;
mod servo;
mod standing;
mod tool;
mod unit;
mod words;

use std::path::Path;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_cell::{BodyKind, Cell, CollisionBody, Frame, NeedleCorridor, placed};
use needlebench_input::{
    FileKind, Finding, ModelSource, TomlText, or_wrong_kind, read_text, source_of,
};
use needlebench_kinematics::trajectory::{MotionLimits, ProfileLimits};
use needlebench_kinematics::{JOINT_LABELS, Joints, Pose};
use needlebench_robot::{LoadedRobot, LoadedTool, RobotDescription};

use crate::engine_name::check_engine_names;
use crate::fixtures::Fixture;
use crate::scenario::{self, GoalSection, IN_IMPERFECTIONS, Scenario};
use arm_values::check_brakes;
use assumed::assume;
pub use assumed::name_from_file;
pub(crate) use entry::ChosenEntries;
use entry::PlannedSections;
pub use entry::{ChooseEntry, ChosenEntry, EntryChooser, GoalPlacer, NoEntry, OpenScenario};
use excitation::{ExcitationProtocol, check_sweeps, resolve_excitation};
pub use expected::Expected;
use expected::RealThings;
use goals::check_insertions;
pub use goals::{BevelFacing, Expectation, Goal, Roll, RunsAlong, bevel_clock, direction};
use goals::{BodyBoxes, InTissue, Surroundings, resolve_goal};
pub use gravity::GravitySettings;
use gravity::gravity_settings;
use imperfections::Imperfections;
pub use imperfections::NeedlePath;
use iso9283::{Iso9283Protocol, resolve_iso9283};
use layout::Layout;
pub(crate) use library::ModelLibrary;
pub(crate) use moved::StillLayout;
use needle_route::check_needle_route;
use obstacles::{check_obstacle_names, place_obstacles};
pub use overrides::Overrides;
use people::{People, Room, resolve_people};
pub use phantom::{ASSUMED_BODY, PlacedPhantom};
use phantom::{off_the_table, place_phantom};
pub use robot::load_robot;
pub use servo::ServoSettings;
use servo::{note_assumed_drives, servo_settings};
use standing::{
    BASE_KEY, KnownDepths, PLACE_HINT, Standing, check_distance, check_floor, check_start,
    note_crowds, note_idle_criteria,
};
pub use standing::{FOOT_M, RIGID_M};

/// A scenario with everything that it names read, checked and placed.
#[derive(Debug, Clone, PartialEq)]
pub struct ResolvedScenario {
    /// The file as it was read.
    pub scenario: Scenario,
    /// The file.
    pub source: ModelSource,
    /// Robot, tool and all that can be hit.
    pub cell: Cell,
    /// The files that the robot was made of, and what they say beside its geometry.
    pub robot_description: RobotDescription,
    /// The tool's URDF.
    pub tool_source: ModelSource,
    /// The phantom, if there is one.
    pub phantom: Option<PlacedPhantom>,
    /// Table, gantry, mount and obstacles, for pictures.
    pub fixtures: Vec<Fixture>,
    /// Where needles are to go.
    pub goals: Vec<Goal>,
    /// The test by ISO 9283, in place of goals.
    pub iso9283: Option<Iso9283Protocol>,
    /// The excitation run, in place of goals.
    pub excitation: Option<ExcitationProtocol>,
    /// Where every motion starts.
    pub start: Joints,
    /// The joint servo.
    pub servo: ServoSettings,
    /// Gravity, and what the controller takes it for.
    pub gravity: GravitySettings,
    /// Limits of the motion: the scenario's and the URDF's, whichever are lower.
    pub motion: MotionLimits,
    /// Parameter file of the phantom.
    pub phantom_source: Option<ModelSource>,
    /// Files of the parts that the user gave the phantom.
    pub phantom_parts: Vec<ModelSource>,
    /// Files of the obstacles' shapes.
    pub obstacle_files: Vec<ModelSource>,
    /// What was assumed or adjusted; belongs in every report.
    pub notes: Vec<String>,
    /// The people in the room, by goal.
    pub people: People,
    /// How the real arm and phantom that are simulated differ; none if they do not.
    pub imperfections: Option<Imperfections>,
    /// The arm and patient population of the RMS tip error; none where the arm's data do not suffice, or there are no
    /// goals.
    pub expected: Option<Expected>,
}

impl ResolvedScenario {
    /// The needle, where it bends in tissue.
    pub(crate) fn needle_in_tissue(&self) -> Option<InTissue<'_>> {
        in_tissue(&self.scenario, self.expected.as_ref())
    }

    /// The same scenario with one of its goals alone.
    ///
    /// # Panics
    /// Without a goal of this index.
    #[must_use]
    pub fn with_goal_alone(&self, index: usize) -> Self {
        self.with_goals(&[index])
    }

    /// The scenario with some of its goals, in this order.
    #[must_use]
    pub fn with_goals(&self, indices: &[usize]) -> Self {
        fn chosen<T: Clone>(all: &[T], indices: &[usize]) -> Vec<T> {
            indices.iter().map(|index| all[*index].clone()).collect()
        }
        let mut some = self.clone();
        some.goals = chosen(&self.goals, indices);
        some.scenario.goals = chosen(&self.scenario.goals, indices);
        some.people.by_goal = chosen(&self.people.by_goal, indices);
        some
    }
}

/// Reads, resolves and validates a scenario file.
///
/// # Errors
/// Every [`Finding`] of the first stage that has any: text, values, models, goals.
pub fn load_scenario(path: &Path, overrides: &Overrides) -> Result<ResolvedScenario, Vec<Finding>> {
    let wrong_kind = |findings| or_wrong_kind(path, FileKind::Scenario, findings);
    let (file, text) = text_of(path).map_err(wrong_kind)?;
    resolve_scenario(&file, &text, folder_of(path), overrides).map_err(wrong_kind)
}

/// Reads a scenario file, and resolves and validates all of it but its goals.
///
/// # Errors
/// As [`load_scenario`].
pub fn load_open_scenario(
    path: &Path,
    overrides: &Overrides,
) -> Result<OpenScenario, Vec<Finding>> {
    let wrong_kind = |findings| or_wrong_kind(path, FileKind::Scenario, findings);
    let (file, text) = text_of(path).map_err(wrong_kind)?;
    resolve_open_scenario(&file, &text, folder_of(path), overrides).map_err(wrong_kind)
}

fn text_of(path: &Path) -> Result<(String, String), Vec<Finding>> {
    let file = path.display().to_string();
    match read_text(path) {
        Ok(text) => Ok((file, text)),
        Err(error) => {
            let hint = error.hint(
                "scenarios are TOML files, such as scenarios/table3.toml; `needlebench init` writes one",
            );
            let message = format!("cannot read the scenario: {error}");
            Err(vec![Finding::new(&file, message).hint(hint)])
        }
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// Resolves a scenario's text; `base` is the folder that its paths are relative to.
///
/// # Errors
/// As [`load_scenario`].
pub fn resolve_scenario(
    file: &str,
    text: &str,
    base: &Path,
    overrides: &Overrides,
) -> Result<ResolvedScenario, Vec<Finding>> {
    let _stage = tracing::info_span!("resolve", file).entered();
    let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
    let resolved = Draft::read(&toml, base, overrides)?.resolve()?;
    let (bodies, pairs) = (resolved.cell.bodies.len(), resolved.cell.pairs.len());
    tracing::info!(
        goals = resolved.goals.len(),
        bodies,
        pairs,
        "scenario resolved"
    );
    for note in &resolved.notes {
        tracing::debug!("{note}");
    }
    Ok(resolved)
}

/// Resolves a scenario's text but for its goals.
///
/// # Errors
/// As [`load_scenario`].
pub fn resolve_open_scenario(
    file: &str,
    text: &str,
    base: &Path,
    overrides: &Overrides,
) -> Result<OpenScenario, Vec<Finding>> {
    let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
    let draft = Draft::read(&toml, base, overrides)?;
    let goals = draft.scenario.goals.clone();
    let resolved = draft
        .without_goals(Extent::Open)
        .map_err(|found| draft.remarked(found))?;
    Ok(OpenScenario {
        resolved: draft.noted(resolved),
        goals,
    })
}

/// How much of a scenario is resolved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// All of it.
    Whole,
    /// All but its goals.
    WithoutGoals,
    /// All but its goals; a base placement that nobody gave is still to be chosen and may be any.
    Open,
}

/// A scenario as it was read, with what it leaves out assumed.
struct Draft<'a> {
    toml: &'a TomlText<'a>,
    scenario: Scenario,
    base: &'a Path,
    overrides: &'a Overrides,
    library: ModelLibrary,
    /// What was assumed, and what looks like a slip.
    remarks: Vec<String>,
}

impl<'a> Draft<'a> {
    fn read(
        toml: &'a TomlText<'a>,
        base: &'a Path,
        overrides: &'a Overrides,
    ) -> Result<Self, Vec<Finding>> {
        let mut scenario: Scenario = toml.read(&scenario::FILE)?;
        let library = ModelLibrary::default();
        let mut remarks = toml.former_names(&scenario::FILE);
        remarks.extend(toml.doubts());
        assume(toml, &mut scenario, base, overrides, &library, &mut remarks);
        Ok(Self {
            toml,
            scenario,
            base,
            overrides,
            library,
            remarks,
        })
    }

    fn resolve(mut self) -> Result<ResolvedScenario, Vec<Finding>> {
        let resolved = self.assume_entries().and_then(|planned| {
            let resolved = self.resolved(self.scenario.clone(), Extent::Whole)?;
            Ok(planned.put_back(resolved))
        });
        match resolved {
            Ok(resolved) => Ok(self.noted(resolved)),
            Err(found) => Err(self.remarked(found)),
        }
    }

    fn without_goals(&self, extent: Extent) -> Result<ResolvedScenario, Vec<Finding>> {
        let scenario = Scenario {
            goals: Vec::new(),
            ..self.scenario.clone()
        };
        self.resolved(scenario, extent)
    }

    fn resolved(
        &self,
        scenario: Scenario,
        extent: Extent,
    ) -> Result<ResolvedScenario, Vec<Finding>> {
        let source = source_of(self.toml.file.to_owned(), self.toml.text.as_bytes());
        let Self {
            toml,
            base,
            overrides,
            library,
            ..
        } = self;
        resolve(toml, scenario, source, base, overrides, library, extent)
            .map_err(|findings| self.of_assumed_place(findings))
    }

    /// What is wrong with a base placement that nobody gave, told as that of an assumed one.
    fn of_assumed_place(&self, mut findings: Vec<Finding>) -> Vec<Finding> {
        if self.toml.span_of(BASE_KEY).is_some() {
            return findings;
        }
        for finding in &mut findings {
            if finding.key.as_deref() == Some(BASE_KEY) {
                finding.message = format!(
                    "the robot's place is assumed, since [robot] gives none, and cannot be: {}",
                    finding.message
                );
                finding.hint = Some(PLACE_HINT.replace("FILE", self.toml.file));
            }
        }
        findings
    }

    /// Entries of goals that have a target and none, where somebody can choose them; the sections of those whose routes
    /// were planned, as they were.
    fn assume_entries(&mut self) -> Result<PlannedSections, Vec<Finding>> {
        let Some(chooser) = &self.overrides.choose_entry else {
            return Ok(PlannedSections::default());
        };
        if !self.scenario.goals.iter().any(GoalSection::is_open) {
            return Ok(PlannedSections::default());
        }
        let cell = self.without_goals(Extent::WithoutGoals)?;
        let mut chosen = chooser.choose(self.toml, &cell, &mut self.scenario.goals)?;
        self.remarks.append(&mut chosen.remarks);
        Ok(chosen.planned)
    }

    /// With the remarks before all other notes.
    fn noted(&self, mut resolved: ResolvedScenario) -> ResolvedScenario {
        resolved.notes.splice(0..0, self.remarks.iter().cloned());
        resolved
    }

    /// What is wrong may be so by what was assumed, or by a slip that it does not name.
    fn remarked(&self, mut findings: Vec<Finding>) -> Vec<Finding> {
        if let Some(first) = findings.first_mut()
            && !self.remarks.is_empty()
        {
            let remarks = self.remarks.join("\nnote: ");
            first.hint = Some(match &first.hint {
                Some(hint) => format!("{hint}\nnote: {remarks}"),
                None => format!("note: {remarks}"),
            });
        }
        findings
    }
}

/// Resolves a scenario whose values are in their ranges; `toml` says where they stand, and `library`
/// keeps what is read. One that needs goals is refused as a whole if it has none.
pub(crate) fn resolve(
    toml: &TomlText<'_>,
    scenario: Scenario,
    source: ModelSource,
    base: &Path,
    overrides: &Overrides,
    library: &ModelLibrary,
    extent: Extent,
) -> Result<ResolvedScenario, Vec<Finding>> {
    let one = |finding: Finding| vec![finding];
    let with_goals = extent == Extent::Whole;
    let mut findings = scenario::check_together(toml, &scenario, with_goals);
    let engines = scenario.engines.run.as_deref();
    findings.extend(check_engine_names(
        toml,
        "engines.run",
        engines,
        &overrides.engines,
    ));
    if !findings.is_empty() {
        return Err(findings);
    }
    let mut notes = Vec::new();
    if scenario.ct.is_some() {
        notes.push(
            "this is the phantom itself: `run` and `study` begin with its scan ([ct]) and use the scan alone"
                .to_owned(),
        );
    }
    let robot = library
        .robot(toml, &scenario.robot, base, overrides)
        .map_err(one)?;
    notes.extend(robot.description.notes.iter().cloned());
    let Layout {
        world_from_base_link,
        start,
    } = Layout::of(&scenario, &robot, &mut notes);
    let mut robot = LoadedRobot::clone(&robot);
    robot.world_from_base_link = world_from_base_link;
    let tool = library
        .tool(toml, &scenario, base, overrides)
        .map_err(one)?;
    notes.extend(tool.notes.iter().cloned());
    let LoadedTool {
        mut tool,
        source: tool_source,
    } = tool.tool.clone();
    let iso9283 = scenario
        .iso9283
        .as_ref()
        .map(|section| resolve_iso9283(toml, section, &robot, &mut tool, &mut notes))
        .transpose()
        .map_err(one)?;
    let excitation = scenario
        .excitation
        .as_ref()
        .map(|section| resolve_excitation(toml, &scenario, section, &robot, &mut tool, &mut notes))
        .transpose()
        .map_err(one)?;
    check_floor(toml, &robot).map_err(one)?;
    let [table, gantry, mount] = library
        .fixtures(toml, &scenario, &world_from_base_link)
        .map_err(one)?;
    let obstacles = place_obstacles(toml, &scenario, &world_from_base_link, |index, section| {
        library.obstacle(toml, index, section, base)
    })?;
    let (mut phantom, mut phantom_source, mut phantom_parts) = (None, None, Vec::new());
    let mut lying = None;
    if let Some(section) = &scenario.phantom {
        let unplaced = library.phantom(toml, section, base)?;
        notes.extend(unplaced.notes.iter().cloned());
        let placed = place_phantom(toml, section, scenario.table.as_ref(), &unplaced);
        let placed = placed.map_err(one)?;
        notes.extend(off_the_table(
            section,
            scenario.table.as_ref(),
            &unplaced,
            &placed,
        ));
        phantom = Some(placed);
        phantom_source.clone_from(&unplaced.model);
        phantom_parts.clone_from(&unplaced.parts);
        lying = Some(unplaced);
    }

    let route = &scenario.planning.needle_route;
    check_needle_route(toml, route, phantom.as_ref(), &mut notes).map_err(one)?;

    let mut fixtures = Vec::new();
    let mut surroundings = Vec::new();
    if let Some(placed) = &phantom {
        let outside = placed.outside().collect();
        surroundings.push(static_body("phantom", BodyKind::Phantom, outside));
    }
    for (name, kind, fixture) in [
        ("table", BodyKind::Table, table),
        ("gantry", BodyKind::Gantry, gantry),
        ("mount", BodyKind::Mount, mount),
    ] {
        if let Some(fixture) = fixture {
            surroundings.push(static_body(name, kind, fixture.solids.clone()));
            fixtures.push(Fixture::clone(&fixture));
        }
    }

    let arm = robot.links.iter().chain([&robot.base]);
    let arm = arm.flat_map(|link| {
        let solids = link.solids.iter().chain(&tool.solids);
        let solids = solids.chain(&tool.guide_solids);
        solids.map(|solid| &*solid.name).chain([&*link.name])
    });
    let parts = phantom.iter();
    let parts = parts.flat_map(|placed| placed.phantom.parts.iter().chain(&placed.limbs));
    let taken = arm.chain(parts.map(|part| &*part.name));
    check_obstacle_names(toml, &scenario.obstacles, taken).map_err(one)?;
    let base_solids = placed(&robot.base.solids, &world_from_base_link);
    let standing = Standing {
        toml,
        obstacles: &obstacles.placed,
        scenario: &scenario,
        robot: &robot,
        fixtures: &fixtures,
        phantom: phantom.as_ref().zip(lying.as_deref()),
        base: &base_solids,
        known: &KnownDepths::default(),
    };
    if extent == Extent::Open && toml.span_of(BASE_KEY).is_none() {
        standing.check_before_placing(&mut notes).map_err(one)?;
    } else {
        standing.check(&mut notes).map_err(one)?;
    }
    surroundings.extend(obstacles.bodies(&scenario.obstacles));
    fixtures.extend(obstacles.fixtures());
    note_idle_criteria(&scenario, &mut notes);
    let real = RealThings {
        toml,
        library,
        robot: &robot,
        tool: &tool,
        base,
        timestep_ms: scenario.engines.timestep_ms,
        gravity_m_s2: scenario.engines.gravity_m_s2,
        has_no_goals: with_goals && scenario.goals.is_empty(),
    };
    let mut real_notes = Vec::new();
    let imperfections = scenario.imperfections.as_ref();
    let imperfections =
        imperfections.map(|section| real.resolve(section, IN_IMPERFECTIONS, &mut real_notes));
    let mut imperfections = imperfections.transpose().map_err(one)?;
    let mut expected = real
        .expected(&scenario, imperfections.as_ref(), &mut real_notes)
        .map_err(one)?;
    let mut goals = {
        let fixtures: Vec<CollisionBody> = surroundings
            .iter()
            .filter(|body| body.kind != BodyKind::Phantom)
            .cloned()
            .collect();
        let context = Surroundings {
            robot: &robot,
            tool: &tool,
            phantom: phantom.as_ref(),
            fixtures: &fixtures,
            boxes: &fixtures.iter().map(BodyBoxes::new).collect::<Vec<_>>(),
            needle: in_tissue(&scenario, expected.as_ref()),
        };
        let (mut goals, mut findings) = (Vec::new(), Vec::new());
        for (index, section) in scenario.goals.iter().enumerate() {
            match resolve_goal(toml, index, section, &context, &mut notes) {
                Ok(goal) => goals.push(goal),
                Err(finding) => findings.push(finding),
            }
        }
        if !findings.is_empty() {
            return Err(findings);
        }
        check_distance(toml, &scenario, &robot, &tool, &goals).map_err(one)?;
        goals
    };

    let people = {
        let standing = surroundings
            .iter()
            .flat_map(|body| body.solids.iter().map(|solid| (body.name.as_str(), solid)));
        let solids: Vec<_> = standing
            .chain(base_solids.iter().map(|solid| ("robot's base", solid)))
            .collect();
        let room = Room {
            phantom: phantom.as_ref(),
            solids: &solids,
            robot_base_m: Point3::from(world_from_base_link.translation.vector),
            needle_m: tool.needle.length_m,
        };
        resolve_people(toml, &scenario.people, &goals, &room).map_err(one)?
    };
    note_crowds(&people, &goals, &mut notes);
    if !scenario.people.persons.is_empty() {
        for (name, solids) in people.bodies(&goals) {
            fixtures.push(people::drawn(solids.clone()));
            surroundings.push(static_body(&name, BodyKind::Person, solids));
        }
    }
    if let Some(joint) = robot.limits.first_violation(&start) {
        let limit = robot.limits.0[joint];
        return Err(one(toml.finding(
            &format!("start.joints_deg[{joint}]"),
            format!(
                "{} starts at {:.1} deg, outside {:.1} to {:.1} deg",
                JOINT_LABELS[joint],
                start[joint].to_degrees(),
                limit.lower_rad.to_degrees(),
                limit.upper_rad.to_degrees()
            ),
        )));
    }
    check_start(toml, &robot, &start).map_err(one)?;
    if let Some(protocol) = &excitation {
        check_sweeps(toml, protocol, &robot, &start).map_err(one)?;
    }
    let motion = motion_limits(&scenario, &robot.limits.velocities_rad_s());
    let corridor = NeedleCorridor {
        radius_m: scenario.tool.corridor_radius_mm * 1e-3,
        length_m: scenario
            .tool
            .corridor_length_mm
            .map_or(tool.needle.length_m, |mm| mm * 1e-3),
        hand_cone_half_angle_rad: scenario.tool.hand_cone_half_angle_deg.to_radians(),
    };
    notes.extend(real_notes);
    {
        let predicted = expected.as_mut().map(|each| &mut each.imperfections);
        let mut found: Vec<_> = imperfections
            .as_mut()
            .into_iter()
            .chain(predicted)
            .collect();
        check_insertions(
            toml,
            &scenario,
            phantom.as_ref(),
            &mut goals,
            &mut found,
            &mut notes,
        )
        .map_err(one)?;
    }
    check_brakes(toml, &scenario, &robot, &mut notes).map_err(one)?;
    let file = &source.file;
    let servo = servo_settings(file, &scenario.controller, &robot, &tool, &mut notes);
    let with_friction = |each: &Imperfections| each.friction.is_some();
    let has_friction = imperfections.as_ref().is_some_and(with_friction)
        || expected
            .as_ref()
            .is_some_and(|expected| with_friction(&expected.imperfections));
    note_assumed_drives(&scenario, &robot, has_friction, &mut notes);
    let gravity = gravity_settings(file, &scenario, &robot, &mut notes);
    if gravity.is_believed_wrongly() {
        // An arm that is not what its controller believes.
        imperfections.get_or_insert_with(Imperfections::none);
    }
    let LoadedRobot { robot, description } = robot;
    let cell = Cell::assemble(
        robot,
        tool,
        corridor,
        surroundings,
        Joints::from_column_slice(&servo.armature_kgm2),
        gravity.world(),
    );
    let behind_cuts = phantom.as_ref().zip(lying.as_deref());
    let behind_cuts = behind_cuts.map(|(placed, lying)| lying.behind_cuts(placed));
    let cell = cell.with_behind_cuts(behind_cuts.unwrap_or_default());
    Ok(ResolvedScenario {
        scenario,
        source,
        cell,
        robot_description: description,
        tool_source,
        phantom,
        fixtures,
        goals,
        iso9283,
        excitation,
        start,
        servo,
        gravity,
        motion,
        phantom_source,
        phantom_parts,
        obstacle_files: obstacles.sources,
        notes,
        people,
        imperfections,
        expected,
    })
}

/// The needle of a scenario, where it bends in tissue.
fn in_tissue<'a>(scenario: &'a Scenario, expected: Option<&'a Expected>) -> Option<InTissue<'a>> {
    let needle = expected?.imperfections.tissue()?;
    let (place, block) = scenario.needle_in_tissue()?;
    Some(InTissue {
        place,
        block,
        needle,
    })
}

fn static_body(
    name: &str,
    kind: BodyKind,
    solids: Vec<needlebench_geometry::Solid>,
) -> CollisionBody {
    CollisionBody {
        name: name.to_owned(),
        kind,
        frame: Frame::World,
        solids,
    }
}

/// The pose that a scenario gives as a position in millimetres and roll, pitch and yaw in degrees.
pub fn pose_of(position_mm: [f64; 3], rpy_deg: [f64; 3]) -> Pose {
    let [roll, pitch, yaw] = rpy_deg.map(f64::to_radians);
    Pose::from_parts(
        Translation3::from(Vector3::from(position_mm) * 1e-3),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

fn motion_limits(scenario: &Scenario, urdf_velocity: &Joints) -> MotionLimits {
    let motion = &scenario.motion;
    let wanted = Joints::repeat(motion.joint_velocity_deg_s.to_radians());
    MotionLimits {
        velocity: wanted.zip_map(urdf_velocity, f64::min),
        acceleration: Joints::repeat(motion.joint_acceleration_deg_s2.to_radians()),
        jerk: Joints::repeat(motion.joint_jerk_deg_s3.to_radians()),
        line: ProfileLimits {
            velocity: motion.line_velocity_mm_s * 1e-3,
            acceleration: motion.line_acceleration_mm_s2 * 1e-3,
            jerk: motion.line_jerk_mm_s3 * 1e-3,
        },
    }
}
