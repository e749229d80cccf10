//! The protocol of ISO 9283:1998, *Manipulating industrial robots - Performance criteria and
//! related test methods*, in SI units.
//!
//! The standard's test cube has its edges along the axes of the robot's base frame. Five poses lie
//! on the space diagonals of one of its four test planes: P1 in the middle, P2 to P5 a tenth of
//! the diagonal's length from its ends.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_cell::Tool;
use needlebench_input::{Finding, TomlText};
use needlebench_iso9283::STANDARD_CYCLES;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::{Body, Pose};
use needlebench_robot::LoadedRobot;

use super::arm_values::test_cube;
pub(crate) use crate::scenario::STANDARD_EDGES_MM;
pub use crate::scenario::{Horizontal, Iso9283Criteria, Iso9283Section};

/// Number of poses of the protocol.
pub const POSE_COUNT: usize = 5;

/// Poses at which the variation over approach directions is measured, from 0: P1, P2 and P4.
pub const DIRECTIONAL_POSES: [usize; 3] = [0, 1, 3];

/// A tenth of the diagonal from its ends is this share of the corner's distance from the middle.
const CORNER_SHARE: f64 = 0.8;

/// Density of the test load: steel, kg/m^3.
const LOAD_DENSITY_KG_M3: f64 = 7850.0;

fn vector(direction: Horizontal) -> Vector3<f64> {
    match direction {
        Horizontal::PlusX => Vector3::x(),
        Horizontal::MinusX => -Vector3::x(),
        Horizontal::PlusY => Vector3::y(),
        Horizontal::MinusY => -Vector3::y(),
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

/// The protocol of a checked section; gives the tool its test load.
pub(crate) fn resolve_iso9283(
    toml: &TomlText<'_>,
    section: &Iso9283Section,
    robot: &LoadedRobot,
    tool: &mut Tool,
    notes: &mut Vec<String>,
) -> Result<Iso9283Protocol, Finding> {
    let configuration =
        Configuration::from_label(&section.configuration).expect("the section was checked before");
    let cube = test_cube(toml, section, robot)?;
    let load_kg = cube.load_kg;
    let added_kg = load_kg - tool.body.mass_kg;
    if added_kg < 0.0 {
        let tool_kg = tool.body.mass_kg;
        return Err(toml
            .finding(
                "iso9283.load_kg",
                format!("the load is {load_kg} kg, less than the tool's {tool_kg:.3} kg"),
            )
            .hint("the load is the total mass at the flange, tool included"));
    }
    if added_kg > 0.0 {
        let centre_m = Vector3::from(section.load_centre_mm) * 1e-3;
        tool.body = tool.body.combined_with(&steel_cube(added_kg, centre_m));
        notes.push(format!(
            "test load: {added_kg:.3} kg of steel at {:?} mm in the flange frame, {load_kg} kg with the \
             tool; known to the controller",
            section.load_centre_mm
        ));
    }
    if section.cycles != STANDARD_CYCLES {
        notes.push(format!(
            "{} cycles instead of the standard's {STANDARD_CYCLES}",
            section.cycles
        ));
    }
    if !STANDARD_EDGES_MM.contains(&cube.edge_mm) {
        notes.push(format!(
            "the test cube's edge of {} mm is not one of the standard's {STANDARD_EDGES_MM:?}",
            cube.edge_mm
        ));
    }
    let beyond_exit = Pose::translation(0.0, 0.0, section.beyond_guide_mm * 1e-3);
    let cube_centre_m = Point3::from(Vector3::from(cube.centre_mm) * 1e-3);
    let orientation = guide_orientation(section);
    let base_from_point = corners(section, cube.edge_mm)
        .map(|offset_m| Pose::from_parts((cube_centre_m.coords + offset_m).into(), orientation));
    Ok(Iso9283Protocol {
        configuration,
        base_from_point,
        cube_centre_m,
        flange_from_point: tool.flange_from_guide_exit * beyond_exit,
        cycles: section.cycles,
        speed_share: section.speed_share,
        line_velocity_m_s: section.speed_share * (cube.tool_speed_mm_s * 1e-3),
        load_kg,
        dwell_s: section.dwell_s,
        measuring_s: section.measuring_s,
        approach_m: section.approach_mm * 1e-3,
        limit_band_m: cube.limit_band_mm * 1e-3,
        tracker_noise_m: section.tracker_noise_um * 1e-6,
    })
}

/// Offsets of P1 to P5 from the cube's middle, m.
///
/// P2 and P4 are the ends of one diagonal, P3 and P5 those of the other; P2 and P3 are on the low
/// side.
fn corners(section: &Iso9283Section, edge_mm: f64) -> [Vector3<f64>; POSE_COUNT] {
    let half_m = 0.5 * edge_mm * 1e-3 * CORNER_SHARE;
    let rise = vector(section.plane_rises_towards);
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

fn steel_cube(mass_kg: f64, centre_m: Vector3<f64>) -> Body {
    let edge_m = libm::cbrt(mass_kg / LOAD_DENSITY_KG_M3);
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
            let corners = corners(&section, STANDARD_EDGES_MM[0]);
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
            assert!(corners[3].dot(&vector(rise)) > 0.0 && corners[3].z > 0.0);
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
