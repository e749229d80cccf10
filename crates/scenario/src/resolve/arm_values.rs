//! What a scenario leaves to the arm, and the refusal where the arm does not say either.

use needlebench_cell::GearTwist;
use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::{JOINT_COUNT, Joints};
use needlebench_robot::LoadedRobot;
use needlebench_robot::arm::data::ArmData;

use crate::scenario::{ControlBlock, ElasticityBlock, FrictionBlock, Iso9283Section, Scenario};

/// One table of an arm's data.
struct Table<'a> {
    toml: &'a TomlText<'a>,
    robot: &'a LoadedRobot,
    name: &'static str,
}

impl<'a> Table<'a> {
    fn new(toml: &'a TomlText<'a>, robot: &'a LoadedRobot, name: &'static str) -> Self {
        Self { toml, robot, name }
    }

    fn data(&self) -> Option<&'a ArmData> {
        self.robot
            .description
            .arm
            .as_ref()
            .map(|used| &used.arm.data)
    }

    /// The scenario's value, else the arm's; `key` is the scenario's.
    fn pick<T>(&self, key: &str, given: Option<T>, known: Option<T>) -> Result<T, Finding> {
        given.or(known).ok_or_else(|| {
            let lack = match &self.robot.description.arm {
                Some(used) => used.arm.lack(self.name),
                None => format!("no arm data for {}", self.robot.description.arm_name),
            };
            let name = key.rsplit('.').next().unwrap_or(key);
            self.toml
                .finding(key, format!("`{name}` is required: {lack}"))
                .hint("give it here, or name an arm with such data: `[robot] arm`")
        })
    }
}

/// How the gears twist. A stiffness that the scenario gives holds for every torque.
pub(crate) fn gear_twist(
    toml: &TomlText<'_>,
    block: &ElasticityBlock,
    robot: &LoadedRobot,
) -> Result<GearTwist, Finding> {
    let table = Table::new(toml, robot, "gears");
    let known = table.data().and_then(|data| data.gears.as_ref());
    let stiffness_nm_rad = table.pick(
        "imperfections.elasticity.stiffness_nm_rad",
        block.stiffness_nm_rad,
        known.map(|gears| gears.stiffness_nm_rad),
    )?;
    let compliance = |stiffness: [f64; 6]| Joints::from(stiffness.map(f64::recip));
    let stiffening = known.and_then(|gears| gears.stiffening.as_ref());
    Ok(
        match stiffening.filter(|_| block.stiffness_nm_rad.is_none()) {
            None => GearTwist::linear(compliance(stiffness_nm_rad)),
            Some(more) => GearTwist {
                compliance_rad_per_nm: [stiffness_nm_rad, more.second_nm_rad, more.third_nm_rad]
                    .map(compliance),
                corner_nm: [more.first_corner_nm, more.second_corner_nm].map(Joints::from),
            },
        },
    )
}

/// Joint friction (LuGre model) as modelled in the controller.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFriction {
    /// Sliding friction per joint, N m.
    pub coulomb_nm: [f64; JOINT_COUNT],
    /// Break-away torque per joint, N m.
    pub stiction_nm: [f64; JOINT_COUNT],
    /// Speed at which the break-away torque has fallen off to 1/e, deg/s.
    pub stribeck_deg_s: [f64; JOINT_COUNT],
    /// Viscous friction per joint, N m s/rad.
    pub viscous_nms_rad: [f64; JOINT_COUNT],
    /// Stiffness of the contact before it slips per joint, N m/rad.
    pub bristle_stiffness_nm_rad: [f64; JOINT_COUNT],
    /// Damping of the contact before it slips per joint, N m s/rad.
    pub bristle_damping_nms_rad: [f64; JOINT_COUNT],
    /// Share of the modelled friction that the controller compensates while a joint moves.
    pub compensation: f64,
    /// Relative standard deviation of each joint's friction about the modelled value.
    pub spread: f64,
}

/// The friction of a block, with what it leaves to the arm.
pub(crate) fn joint_friction(
    toml: &TomlText<'_>,
    block: &FrictionBlock,
    robot: &LoadedRobot,
) -> Result<JointFriction, Finding> {
    let table = Table::new(toml, robot, "friction");
    let known = table.data().and_then(|data| data.friction.as_ref());
    let pick =
        |name: &str, given: Option<[f64; JOINT_COUNT]>, known: Option<[f64; JOINT_COUNT]>| {
            table.pick(&format!("imperfections.friction.{name}"), given, known)
        };
    let friction = JointFriction {
        coulomb_nm: pick("coulomb_nm", block.coulomb_nm, known.map(|f| f.coulomb_nm))?,
        stiction_nm: pick(
            "stiction_nm",
            block.stiction_nm,
            known.map(|f| f.stiction_nm),
        )?,
        stribeck_deg_s: pick(
            "stribeck_deg_s",
            block.stribeck_deg_s,
            known.map(|f| f.stribeck_deg_s),
        )?,
        viscous_nms_rad: pick(
            "viscous_nms_rad",
            block.viscous_nms_rad,
            known.map(|f| f.viscous_nms_rad),
        )?,
        bristle_stiffness_nm_rad: pick(
            "bristle_stiffness_nm_rad",
            block.bristle_stiffness_nm_rad,
            known.map(|f| f.bristle_stiffness_nm_rad),
        )?,
        bristle_damping_nms_rad: pick(
            "bristle_damping_nms_rad",
            block.bristle_damping_nms_rad,
            known.map(|f| f.bristle_damping_nms_rad),
        )?,
        compensation: block.compensation,
        spread: block.spread,
    };
    let pairs = friction.stiction_nm.iter().zip(&friction.coulomb_nm);
    for (i, (stiction, coulomb)) in pairs.enumerate() {
        if stiction < coulomb {
            return Err(toml
                .finding(
                    &format!("imperfections.friction.stiction_nm[{i}]"),
                    format!(
                        "the break-away torque of {stiction} N m is below the sliding friction of \
                         {coulomb} N m"
                    ),
                )
                .hint("the break-away torque must be at least the sliding friction"));
        }
    }
    Ok(friction)
}

/// Time between two set-points, ms.
pub(crate) fn set_point_period_ms(
    toml: &TomlText<'_>,
    block: &ControlBlock,
    robot: &LoadedRobot,
    timestep_ms: f64,
) -> Result<f64, Finding> {
    const KEY: &str = "imperfections.control.period_ms";
    let table = Table::new(toml, robot, "control");
    let known = table.data().and_then(|data| data.control.as_ref());
    let period_ms = table.pick(KEY, block.period_ms, known.map(|control| control.period_ms))?;
    if period_ms < timestep_ms {
        return Err(toml
            .finding(
                KEY,
                format!(
                    "the set-point period of {period_ms} ms is below the time step of {timestep_ms} ms"
                ),
            )
            .hint("omit the block for a servo that receives the trajectory in every step"));
    }
    Ok(period_ms)
}

/// What ISO 9283's protocol needs of the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TestCube {
    pub centre_mm: [f64; 3],
    pub edge_mm: f64,
    pub load_kg: f64,
    pub tool_speed_mm_s: f64,
    pub limit_band_mm: f64,
}

/// The protocol's cube, load and speed, with what a section leaves to the arm.
pub(crate) fn test_cube(
    toml: &TomlText<'_>,
    section: &Iso9283Section,
    robot: &LoadedRobot,
) -> Result<TestCube, Finding> {
    let table = |name| Table::new(toml, robot, name);
    let data = table("iso9283").data();
    let cube = data.and_then(|data| data.iso9283.as_ref());
    let load = data.and_then(|data| data.payload.as_ref());
    let speed = data.and_then(|data| data.tool_speed.as_ref());
    let repeatability = data.and_then(|data| data.repeatability.as_ref());
    Ok(TestCube {
        centre_mm: table("iso9283").pick(
            "iso9283.cube_centre_mm",
            section.cube_centre_mm,
            cube.map(|cube| cube.cube_centre_mm),
        )?,
        edge_mm: table("iso9283").pick(
            "iso9283.cube_edge_mm",
            section.cube_edge_mm,
            cube.map(|cube| cube.cube_edge_mm),
        )?,
        load_kg: table("payload").pick(
            "iso9283.load_kg",
            section.load_kg,
            load.map(|load| load.kg),
        )?,
        tool_speed_mm_s: table("tool_speed").pick(
            "iso9283.tool_speed_mm_s",
            section.tool_speed_mm_s,
            speed.map(|speed| speed.mm_s),
        )?,
        limit_band_mm: table("repeatability").pick(
            "iso9283.limit_band_mm",
            section.limit_band_mm,
            repeatability.map(|each| each.mm),
        )?,
    })
}

/// Refuses a stop that needs brakes of which nothing is known, and says what they are derived from.
pub(crate) fn check_brakes(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    robot: &LoadedRobot,
    notes: &mut Vec<String>,
) -> Result<(), Finding> {
    let stop = scenario.events.as_ref().and_then(|each| each.stop.as_ref());
    let Some(stop) = stop.filter(|stop| stop.category < 2) else {
        return Ok(());
    };
    let lack = match &robot.description.arm {
        Some(used) => match used.brakes() {
            Some(figures) => {
                notes.push(figures.note());
                return Ok(());
            }
            None => used.arm.lack("brakes"),
        },
        None => format!("no arm data for {}", robot.description.arm_name),
    };
    let category = stop.category;
    Err(toml
        .finding(
            "events.stop.category",
            format!("a stop of category {category} requires brake data, but {lack}"),
        )
        .hint(
            "`category = 2` needs no brakes; or give the arm's stopping times: `[robot] arm = \
             \"my_arm.toml\"` with a [brakes] table, see models/README.md",
        ))
}
