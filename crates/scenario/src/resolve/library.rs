//! The models that scenarios name: read from files, built, and kept for the next scenario that names
//! the same.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector3;
use needlebench_cell::Tool;
use needlebench_input::{Finding, ModelSource, TomlText};
use needlebench_kinematics::{Dynamics, JOINT_COUNT, Joints, Pose};
use needlebench_robot::{LoadedRobot, MissingInertia, StatedShape, ToolOverrides};

use super::cache::Cache;
use super::fixtures::fixture_finding;
use super::imperfections::{AbsorbedSag, GearTwist, RealArms, RecordedBreath, resolve_calibration};
use super::obstacles::{UnplacedShape, unplaced_shape};
use super::overrides::Overrides;
use super::phantom::{UnplacedPhantom, scenario_phantom};
use super::robot::scenario_robot;
use super::tool::{UnmountedTool, scenario_tool, tool_overrides};
use crate::fixtures::{self, Fixture, FixtureError};
use crate::scenario::{
    CalibrationBlock, GantrySection, MountKind, MountSection, ObstacleSection, ObstacleShape,
    PartSection, PhantomSection, RobotSection, Scenario, TableSection, ToolSection,
};

/// What decides a phantom.
#[derive(Debug)]
struct PhantomKey {
    model: String,
    sizes_mm: [Option<f64>; 3],
    parts: Vec<PartSection>,
}

impl PhantomKey {
    fn is_of(&self, section: &PhantomSection) -> bool {
        self.model == section.model
            && self.sizes_mm == sizes_mm(section)
            && self.parts == section.parts
    }
}

fn sizes_mm(section: &PhantomSection) -> [Option<f64>; 3] {
    [section.breadth_mm, section.depth_mm, section.length_mm]
}

/// The models of scenarios that lie in one folder and are resolved with the same overrides.
#[derive(Debug, Default)]
pub(crate) struct ModelLibrary {
    robots: Cache<RobotKey, LoadedRobot>,
    tools: Cache<(String, ToolOverrides, BTreeMap<String, StatedShape>), UnmountedTool>,
    phantoms: Cache<PhantomKey, UnplacedPhantom>,
    tables: Cache<TableSection, Fixture>,
    gantries: Cache<GantrySection, Fixture>,
    mounts: Cache<(MountSection, Pose, Option<TableSection>), Fixture>,
    obstacles: Cache<ObstacleShape, UnplacedShape>,
    real_arms: Cache<(CalibrationBlock, Option<ModelSource>), RealArms>,
    absorbed: Cache<(Dynamics, GearTwist), AbsorbedSag>,
    recorded_breath: Cache<Vec<String>, RecordedBreath>,
}

/// What decides a robot but its place.
#[derive(Debug, Clone, PartialEq)]
struct RobotKey {
    urdf: Option<String>,
    arm: Option<String>,
    prefix: Option<String>,
    missing_inertia: MissingInertia,
    calibration: Option<String>,
    shape: BTreeMap<String, StatedShape>,
}

impl ModelLibrary {
    /// The scenario's robot, with its `base_link` at the world's origin.
    pub fn robot(
        &self,
        toml: &TomlText<'_>,
        section: &RobotSection,
        base: &Path,
        overrides: &Overrides,
    ) -> Result<Arc<LoadedRobot>, Finding> {
        let key = RobotKey {
            urdf: section.urdf.clone(),
            arm: section.arm.clone(),
            prefix: section.prefix.clone(),
            missing_inertia: section.missing_inertia.clone(),
            calibration: section.calibration.clone(),
            shape: section.shape.clone(),
        };
        self.robots.get(
            |known| *known == key,
            || {
                let robot = scenario_robot(toml, section, base, overrides)?;
                Ok((key.clone(), robot))
            },
        )
    }

    /// The scenario's tool.
    pub fn tool(
        &self,
        toml: &TomlText<'_>,
        scenario: &Scenario,
        base: &Path,
        overrides: &Overrides,
    ) -> Result<Arc<UnmountedTool>, Finding> {
        let wanted = tool_overrides(toml, scenario)?;
        let ToolSection { urdf, shape, .. } = &scenario.tool;
        self.tools.get(
            |(known, with, stated)| known == urdf && *with == wanted && stated == shape,
            || {
                let part = scenario_tool(toml, scenario, &wanted, base, overrides)?;
                Ok(((urdf.clone(), wanted, shape.clone()), part))
            },
        )
    }

    /// The scenario's phantom.
    pub fn phantom(
        &self,
        toml: &TomlText<'_>,
        section: &PhantomSection,
        base: &Path,
    ) -> Result<Arc<UnplacedPhantom>, Vec<Finding>> {
        self.phantoms.get(
            |key| key.is_of(section),
            || {
                let key = PhantomKey {
                    model: section.model.clone(),
                    sizes_mm: sizes_mm(section),
                    parts: section.parts.clone(),
                };
                Ok((key, scenario_phantom(toml, section, base)?))
            },
        )
    }

    /// The scenario's table, gantry and mount, as far as it has them.
    pub fn fixtures(
        &self,
        toml: &TomlText<'_>,
        scenario: &Scenario,
        world_from_base_link: &Pose,
    ) -> Result<[Option<Arc<Fixture>>; 3], Finding> {
        fn made<K>(
            cache: &Cache<K, Fixture>,
            key: Option<K>,
            make: impl Fn(&K) -> Result<Fixture, FixtureError>,
            finding: impl Fn(&FixtureError) -> Finding,
        ) -> Result<Option<Arc<Fixture>>, Finding>
        where
            K: Clone + PartialEq,
        {
            key.map(|key| {
                cache.get(
                    |known| *known == key,
                    || make(&key).map(|made| (key.clone(), made)),
                )
            })
            .transpose()
            .map_err(|error| finding(&error))
        }
        let finding = |section| move |error: &FixtureError| fixture_finding(toml, section, error);
        // Only one on the table's rail goes where the table goes.
        let table_of = |mount: &MountSection| {
            let on_rail = mount.kind == MountKind::TableRail;
            scenario.table.clone().filter(|_| on_rail)
        };
        let mount = scenario.mount.clone();
        Ok([
            made(
                &self.tables,
                scenario.table.clone(),
                |table| Ok(fixtures::table(table)),
                finding("table"),
            )?,
            made(
                &self.gantries,
                scenario.gantry.clone(),
                fixtures::gantry,
                finding("gantry"),
            )?,
            made(
                &self.mounts,
                mount.map(|mount| {
                    let table = table_of(&mount);
                    (mount, *world_from_base_link, table)
                }),
                |(mount, base, table)| fixtures::mount(mount, base, table.as_ref()),
                finding("mount"),
            )?,
        ])
    }

    /// The shape of an obstacle, not placed. `index` is its section's, for findings.
    pub fn obstacle(
        &self,
        toml: &TomlText<'_>,
        index: usize,
        section: &ObstacleSection,
        base: &Path,
    ) -> Result<Arc<UnplacedShape>, Finding> {
        self.obstacles.get(
            |known| *known == section.shape,
            || {
                let shape = unplaced_shape(toml, index, section, base)?;
                Ok((section.shape.clone(), shape))
            },
        )
    }

    /// The real arms of a calibration block, for a robot.
    pub(crate) fn real_arms(
        &self,
        toml: &TomlText<'_>,
        block: &CalibrationBlock,
        robot: &LoadedRobot,
        base: &Path,
    ) -> Result<Arc<RealArms>, Finding> {
        let arm = robot
            .description
            .arm
            .as_ref()
            .map(|used| used.arm.source.clone());
        let key = (block.clone(), arm);
        self.real_arms.get(
            |known| *known == key,
            || {
                let arms = resolve_calibration(toml, block, robot, base)?;
                Ok((key.clone(), arms))
            },
        )
    }

    /// What recordings of breath say.
    pub(crate) fn recorded_breath(
        &self,
        toml: &TomlText<'_>,
        files: &[String],
        base: &Path,
    ) -> Result<Arc<RecordedBreath>, Finding> {
        self.recorded_breath.get(
            |known| known == files,
            || Ok((files.to_vec(), RecordedBreath::read(toml, files, base)?)),
        )
    }

    /// What a calibration that was measured on the sagging arm takes of its sag; with the tool on, or
    /// without, and with gravity in the frame of `base_link` as it was then.
    pub(crate) fn absorbed_sag(
        &self,
        robot: &LoadedRobot,
        tool: Option<&Tool>,
        gears: &GearTwist,
        gravity_m_s2: Vector3<f64>,
    ) -> Arc<AbsorbedSag> {
        let mut bodies = robot.bodies;
        if let Some(tool) = tool {
            let carried = tool.body.transformed(&robot.chain.wrist_3_from_flange);
            bodies[JOINT_COUNT - 1] = bodies[JOINT_COUNT - 1].combined_with(&carried);
        }
        let measured = Dynamics {
            chain: robot.chain,
            bodies,
            armature_kgm2: Joints::zeros(),
            gravity_m_s2,
        };
        let key = (measured, *gears);
        let made = self.absorbed.get(
            |known| *known == key,
            || Ok::<_, std::convert::Infallible>((key, AbsorbedSag::new(&key.0, *gears))),
        );
        made.unwrap_or_else(|never| match never {})
    }
}
