//! The protocol of ISO 9283:1998, *Manipulating industrial robots - Performance criteria and
//! related test methods*, as a section of a scenario.
//!
//! The standard's test cube has its edges along the axes of the robot's base frame. Five poses lie
//! on the space diagonals of one of its four test planes: P1 in the middle, P2 to P5 a tenth of
//! the diagonal's length from its ends.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::{Body, Pose, UrGeometry, UrModel};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::SAME_ARM_M;
use crate::scenario::Scenario;
use crate::toml_text::TomlText;
use crate::{Finding, Robot, Tool, nearest_name};

/// Number of poses of the protocol.
pub const POSE_COUNT: usize = 5;

/// Poses at which the variation over approach directions is measured, from 0: P1, P2 and P4.
pub const DIRECTIONAL_POSES: [usize; 3] = [0, 1, 3];

/// Cycles that the standard asks for.
pub const STANDARD_CYCLES: u32 = 30;

/// Edge lengths of the standard's cube, mm.
pub const STANDARD_EDGES_MM: [f64; 4] = [250.0, 400.0, 630.0, 1000.0];

/// A tenth of the diagonal from its ends is this share of the corner's distance from the middle.
const CORNER_SHARE: f64 = 0.8;

/// Density of the test load: steel, kg/m^3.
const LOAD_DENSITY_KG_M3: f64 = 7850.0;

/// Speed of the tool on straight lines at a speed share of 1, m/s: the typical tool speed of the
/// UR3's data sheet.
const TOOL_SPEED_M_S: f64 = 1.0;

/// The test of a robot's accuracy and repeatability by ISO 9283, instead of goals: five poses in a
/// cube, visited again and again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Iso9283Section {
    /// Configuration of the arm at every pose, in the words of reports: `Right-Up-Fold`.
    pub configuration: String,
    /// Middle of the test cube in the controller's `base` frame, mm. The default lies between the
    /// robot and the chest of the shipped scenarios. Assumed.
    pub cube_centre_mm: [f64; 3],
    /// Edge of the test cube, mm. The standard has 250, 400, 630 and 1000 and asks for the largest
    /// that the workspace holds: 250 for a UR3.
    pub cube_edge_mm: f64,
    /// Horizontal direction in which the test plane rises: `+x`, `-x`, `+y` or `-y` of `base`. These
    /// are the standard's planes C1-C2-C7-C8, C2-C3-C8-C5, C3-C4-C5-C6 and C4-C1-C6-C7.
    pub plane_rises_towards: Horizontal,
    /// Direction in which the guide points at every pose, `base` frame; any length.
    pub guide_axis: [f64; 3],
    /// Angle of the guide about that direction, deg; at 0 its x axis is as near to the `base`
    /// frame's x as it gets.
    pub roll_deg: f64,
    /// Distance of the measured point from the guide's exit along the needle, mm.
    pub beyond_guide_mm: f64,
    /// Cycles, and visits of each pose from each direction. Default: the standard's 30.
    pub cycles: u32,
    /// Share of the robot's rated joint speeds, and of the data sheet's typical tool speed of 1 m/s
    /// on straight approaches. The standard tests 1, 0.5 and 0.1. Accelerations are those of
    /// `[motion]`.
    pub speed_share: f64,
    /// Mass at the flange, tool included, kg. Left out: the rated load of a UR3 or UR3e, 3 kg, which
    /// is 100 % of the rated load as the standard has it.
    pub load_kg: Option<f64>,
    /// Centre of what is added to the tool to reach that mass, a cube of steel, in the flange frame,
    /// mm. Assumed.
    pub load_centre_mm: [f64; 3],
    /// Time for which the robot stands at each pose, s. Assumed.
    pub dwell_s: f64,
    /// Time at the end of the stand over which a measurement is averaged, s. Assumed: a laser
    /// tracker's usual window.
    pub measuring_s: f64,
    /// Length of the straight approach from each of three directions for the multi-directional
    /// accuracy, mm; 0 leaves that test out. Assumed.
    pub approach_mm: f64,
    /// Half-width of the band of the stabilisation time, mm. Default: the repeatability that the
    /// UR3's data sheet states.
    pub limit_band_mm: f64,
    /// Standard deviation of the tracker's noise on each axis, um: it is in every repeatability that
    /// is measured on a real robot. Default: a perfect tracker.
    pub tracker_noise_um: f64,
    /// What the robot has to reach.
    pub criteria: Iso9283Criteria,
}

impl Default for Iso9283Section {
    fn default() -> Self {
        Self {
            configuration: "Right-Up-Fold".to_owned(),
            cube_centre_mm: [0.0, -300.0, 150.0],
            cube_edge_mm: STANDARD_EDGES_MM[0],
            plane_rises_towards: Horizontal::PlusY,
            guide_axis: [0.0, 0.0, -1.0],
            roll_deg: 0.0,
            beyond_guide_mm: 0.0,
            cycles: STANDARD_CYCLES,
            speed_share: 1.0,
            load_kg: None,
            load_centre_mm: [0.0, 0.0, 50.0],
            dwell_s: 0.5,
            measuring_s: 0.1,
            approach_mm: 50.0,
            limit_band_mm: 0.1,
            tracker_noise_um: 0.0,
            criteria: Iso9283Criteria::default(),
        }
    }
}

/// Limits of the standard's figures, at every pose and in each engine; one that is left out is not
/// judged.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Iso9283Criteria {
    /// Largest pose accuracy AP, mm.
    pub max_accuracy_mm: Option<f64>,
    /// Largest pose repeatability RP, mm.
    pub max_repeatability_mm: Option<f64>,
    /// Largest multi-directional variation vAP, mm.
    pub max_directional_variation_mm: Option<f64>,
    /// Largest stabilisation time, s.
    pub max_stabilisation_time_s: Option<f64>,
    /// Largest overshoot, mm.
    pub max_overshoot_mm: Option<f64>,
}

/// A horizontal direction of the `base` frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Horizontal {
    /// Along x.
    #[serde(rename = "+x")]
    PlusX,
    /// Against x.
    #[serde(rename = "-x")]
    MinusX,
    /// Along y.
    #[serde(rename = "+y")]
    PlusY,
    /// Against y.
    #[serde(rename = "-y")]
    MinusY,
}

impl Horizontal {
    fn vector(self) -> Vector3<f64> {
        match self {
            Self::PlusX => Vector3::x(),
            Self::MinusX => -Vector3::x(),
            Self::PlusY => Vector3::y(),
            Self::MinusY => -Vector3::y(),
        }
    }
}

/// The protocol in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Iso9283Protocol {
    /// Configuration of the arm at every pose.
    pub configuration: Configuration,
    /// Commanded poses P1 to P5 of the measured point in the controller's base frame; z along the
    /// insertion.
    pub base_from_point: [Pose; POSE_COUNT],
    /// Middle of the test cube in the controller's base frame.
    pub cube_centre_m: Point3<f64>,
    /// The measured point, in the frame of the flange.
    pub flange_from_point: Pose,
    /// Cycles.
    pub cycles: u32,
    /// Share of the rated joint speeds.
    pub speed_share: f64,
    /// Speed of the tool on straight approaches, m/s.
    pub line_velocity_m_s: f64,
    /// Mass at the flange, tool included, kg.
    pub load_kg: f64,
    /// Stand at each pose, s.
    pub dwell_s: f64,
    /// Averaging window at the end of the stand, s.
    pub measuring_s: f64,
    /// Length of the approach from each direction, m; 0 if that test is left out.
    pub approach_m: f64,
    /// Half-width of the band of the stabilisation time, m.
    pub limit_band_m: f64,
    /// Standard deviation of the tracker's noise on each axis, m.
    pub tracker_noise_m: f64,
}

/// A stand at a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Which pose, from 0.
    pub pose: usize,
    /// Axis of the base frame along which it was approached: 0 to 2 for x to z. None for the
    /// plain sequence of poses.
    pub axis: Option<usize>,
    /// When the motion to it starts, s.
    pub departure_s: f64,
    /// When the planned motion ends, s.
    pub arrival_s: f64,
    /// When the robot leaves, s.
    pub end_s: f64,
}

/// Values of the section outside their sensible ranges, and what contradicts it.
pub(crate) fn check_iso9283(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    let Some(section) = &scenario.iso9283 else {
        return Vec::new();
    };
    let mut findings = Vec::new();
    let [x, y, z] = section.cube_centre_mm;
    let [lx, ly, lz] = section.load_centre_mm;
    let criteria = &section.criteria;
    let optional = |value: Option<f64>| value.unwrap_or(1.0);
    for (key, value, least, most, unit) in [
        ("cube_centre_mm[0]", x, -5000.0, 5000.0, "mm"),
        ("cube_centre_mm[1]", y, -5000.0, 5000.0, "mm"),
        ("cube_centre_mm[2]", z, -5000.0, 5000.0, "mm"),
        ("cube_edge_mm", section.cube_edge_mm, 10.0, 2000.0, "mm"),
        ("roll_deg", section.roll_deg, -360.0, 360.0, "deg"),
        ("beyond_guide_mm", section.beyond_guide_mm, 0.0, 500.0, "mm"),
        ("speed_share", section.speed_share, 0.01, 1.0, ""),
        ("load_kg", optional(section.load_kg), 0.0, 50.0, "kg"),
        ("load_centre_mm[0]", lx, -500.0, 500.0, "mm"),
        ("load_centre_mm[1]", ly, -500.0, 500.0, "mm"),
        ("load_centre_mm[2]", lz, -500.0, 500.0, "mm"),
        ("dwell_s", section.dwell_s, 0.05, 60.0, "s"),
        (
            "measuring_s",
            section.measuring_s,
            0.0,
            section.dwell_s,
            "s",
        ),
        ("approach_mm", section.approach_mm, 0.0, 500.0, "mm"),
        ("limit_band_mm", section.limit_band_mm, 1e-6, 100.0, "mm"),
        ("tracker_noise_um", section.tracker_noise_um, 0.0, 1e4, "um"),
        (
            "criteria.max_accuracy_mm",
            optional(criteria.max_accuracy_mm),
            0.0,
            1000.0,
            "mm",
        ),
        (
            "criteria.max_repeatability_mm",
            optional(criteria.max_repeatability_mm),
            0.0,
            1000.0,
            "mm",
        ),
        (
            "criteria.max_directional_variation_mm",
            optional(criteria.max_directional_variation_mm),
            0.0,
            1000.0,
            "mm",
        ),
        (
            "criteria.max_stabilisation_time_s",
            optional(criteria.max_stabilisation_time_s),
            0.0,
            60.0,
            "s",
        ),
        (
            "criteria.max_overshoot_mm",
            optional(criteria.max_overshoot_mm),
            0.0,
            1000.0,
            "mm",
        ),
    ] {
        if !(least..=most).contains(&value) {
            let key = format!("iso9283.{key}");
            let finding = toml.finding(
                &key,
                format!("`{key}` is {value} {unit}, outside {least} to {most}"),
            );
            findings.push(if unit.is_empty() {
                finding.hint("it is a plain number, without a unit")
            } else {
                finding.hint(format!("the value is in {unit}"))
            });
        }
    }
    if !(2..=1000).contains(&section.cycles) {
        findings.push(
            toml.finding(
                "iso9283.cycles",
                format!("`iso9283.cycles` is {}, outside 2 to 1000", section.cycles),
            )
            .hint("the standard asks for 30; a spread needs at least 2"),
        );
    }
    if Configuration::from_label(&section.configuration).is_none() {
        let names = Configuration::ALL.map(Configuration::label);
        findings.push(
            toml.finding(
                "iso9283.configuration",
                format!("there is no configuration `{}`", section.configuration),
            )
            .hint(match nearest_name(&section.configuration, names) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("one of {}", names.join(", ")),
            }),
        );
    }
    if Vector3::from(section.guide_axis).norm() < 1e-6 {
        findings.push(
            toml.finding("iso9283.guide_axis", "the direction has no length")
                .hint("such as [0, 0, -1] for downwards"),
        );
    }
    if !scenario.goals.is_empty() {
        findings.push(
            toml.finding("iso9283", "a scenario has either goals or [iso9283]")
                .hint("put the protocol into a scenario of its own"),
        );
    }
    findings
}

/// The protocol of a checked section; gives the tool its test load.
pub(crate) fn resolve_iso9283(
    toml: &TomlText<'_>,
    section: &Iso9283Section,
    robot: &Robot,
    tool: &mut Tool,
    notes: &mut Vec<String>,
) -> Result<Iso9283Protocol, Finding> {
    let configuration =
        Configuration::from_label(&section.configuration).expect("the section was checked before");
    let load_kg = match section.load_kg {
        Some(load_kg) => load_kg,
        None => rated_load_kg(robot).ok_or_else(|| {
            toml.finding(
                "iso9283.load_kg",
                format!("the rated load of {} is not known", robot.arm_name()),
            )
            .hint("give the mass at the flange, tool included, in kg")
        })?,
    };
    let added_kg = load_kg - tool.body.mass_kg;
    if added_kg < 0.0 {
        let tool_kg = tool.body.mass_kg;
        return Err(toml
            .finding(
                "iso9283.load_kg",
                format!("the load is {load_kg} kg, but the tool alone has {tool_kg:.3} kg"),
            )
            .hint("the load is the whole mass at the flange, tool included"));
    }
    if added_kg > 0.0 {
        let centre_m = Vector3::from(section.load_centre_mm) * 1e-3;
        tool.body = tool.body.combined_with(&steel_cube(added_kg, centre_m));
        notes.push(format!(
            "test load: {added_kg:.3} kg of steel at {:?} mm from the flange make {load_kg} kg with \
             the tool; the controller knows it",
            section.load_centre_mm
        ));
    }
    if section.cycles != STANDARD_CYCLES {
        notes.push(format!(
            "{} cycles instead of the standard's {STANDARD_CYCLES}",
            section.cycles
        ));
    }
    if !STANDARD_EDGES_MM.contains(&section.cube_edge_mm) {
        notes.push(format!(
            "the test cube's edge of {} mm is none of the standard's {STANDARD_EDGES_MM:?}",
            section.cube_edge_mm
        ));
    }
    let beyond_exit = Pose::translation(0.0, 0.0, section.beyond_guide_mm * 1e-3);
    let cube_centre_m = Point3::from(Vector3::from(section.cube_centre_mm) * 1e-3);
    let orientation = guide_orientation(section);
    let base_from_point = corners(section)
        .map(|offset_m| Pose::from_parts((cube_centre_m.coords + offset_m).into(), orientation));
    Ok(Iso9283Protocol {
        configuration,
        base_from_point,
        cube_centre_m,
        flange_from_point: tool.flange_from_guide_exit * beyond_exit,
        cycles: section.cycles,
        speed_share: section.speed_share,
        line_velocity_m_s: section.speed_share * TOOL_SPEED_M_S,
        load_kg,
        dwell_s: section.dwell_s,
        measuring_s: section.measuring_s,
        approach_m: section.approach_mm * 1e-3,
        limit_band_m: section.limit_band_mm * 1e-3,
        tracker_noise_m: section.tracker_noise_um * 1e-6,
    })
}

/// Offsets of P1 to P5 from the cube's middle, m.
///
/// P2 and P4 are the ends of one diagonal, P3 and P5 those of the other; P2 and P3 are on the low
/// side.
fn corners(section: &Iso9283Section) -> [Vector3<f64>; POSE_COUNT] {
    let half_m = 0.5 * section.cube_edge_mm * 1e-3 * CORNER_SHARE;
    let rise = section.plane_rises_towards.vector();
    let across = Vector3::z().cross(&rise);
    let up = rise + Vector3::z();
    [
        Vector3::zeros(),
        (-up - across) * half_m,
        (-up + across) * half_m,
        (up + across) * half_m,
        (up - across) * half_m,
    ]
}

/// Orientation of the guide in the base frame.
fn guide_orientation(section: &Iso9283Section) -> UnitQuaternion<f64> {
    let z = UnitVector3::new_normalize(Vector3::from(section.guide_axis));
    let across = |axis: Vector3<f64>| axis - z.into_inner() * z.dot(&axis);
    // A guide along x has no nearest x axis.
    let x = if across(Vector3::x()).norm() > 1e-3 {
        across(Vector3::x())
    } else {
        across(Vector3::y())
    };
    let x = UnitVector3::new_normalize(x).into_inner();
    let axes = Matrix3::from_columns(&[x, z.cross(&x), z.into_inner()]);
    let unrolled = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    unrolled * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), section.roll_deg.to_radians())
}

/// Rated load of the two arms of the UR3's size, kg: Universal Robots' data sheets.
fn rated_load_kg(robot: &Robot) -> Option<f64> {
    let geometry = UrGeometry::of_chain(&robot.chain).ok()?;
    let (model, deviation_m) = UrModel::nearest(&geometry);
    let known = matches!(model, UrModel::Ur3 | UrModel::Ur3e) && deviation_m <= SAME_ARM_M;
    known.then_some(3.0)
}

fn steel_cube(mass_kg: f64, centre_m: Vector3<f64>) -> Body {
    let edge_m = (mass_kg / LOAD_DENSITY_KG_M3).cbrt();
    Body {
        mass_kg,
        com_m: centre_m,
        inertia_kgm2: Matrix3::identity() * (mass_kg * edge_m * edge_m / 6.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_a_tenth_of_the_diagonal_from_its_ends() {
        for rise in [
            Horizontal::PlusX,
            Horizontal::MinusX,
            Horizontal::PlusY,
            Horizontal::MinusY,
        ] {
            let section = Iso9283Section {
                plane_rises_towards: rise,
                ..Iso9283Section::default()
            };
            let corners = corners(&section);
            let diagonal_m = 0.25 * 3.0_f64.sqrt();
            for (a, b) in [(1, 3), (2, 4)] {
                // Eight tenths are left between the two, and P1 is in the middle of them.
                let between_m = (corners[a] - corners[b]).norm();
                assert!((between_m - 0.8 * diagonal_m).abs() < 1e-15);
                assert!((corners[a] + corners[b]).norm() < 1e-15);
            }
            // One plane, that rises in the direction named.
            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            assert!(
                corners
                    .iter()
                    .all(|corner| corner.dot(&normal).abs() < 1e-15)
            );
            assert!(corners[3].dot(&rise.vector()) > 0.0 && corners[3].z > 0.0);
        }
    }

    #[test]
    fn the_guide_points_along_its_axis() {
        for guide_axis in [[0.0, 0.0, -1.0], [0.3, -0.4, -2.0], [-5.0, 0.0, 0.0]] {
            let section = Iso9283Section {
                guide_axis,
                roll_deg: 30.0,
                ..Iso9283Section::default()
            };
            let z = guide_orientation(&section) * Vector3::z();
            assert!((z - Vector3::from(guide_axis).normalize()).norm() < 1e-15);
        }
    }
}
