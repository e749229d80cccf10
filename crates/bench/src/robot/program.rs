//! Files with programs, what their controller is, and what it is made to believe.

use std::path::Path;

use needlebench_input::{Finding, read_data_text};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Pose, rotation_angle_between};
use needlebench_scenario::ResolvedScenario;
use needlebench_urscript::{Belief, ScriptError};

use crate::judge::set_point_period_s;

/// The tool's point of a controller's installation, which a program does not say.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum InstalledTcp {
    /// Not known: a program that needs one before it sets one is refused.
    #[default]
    Unknown,
    /// The flange's centre.
    Flange,
    /// The exit of the scenario's guide.
    GuideExit,
}

/// Differences of what a controller believes that are said, m, rad, kg.
const DIFFERS_M: f64 = 1e-4;
const DIFFERS_RAD: f64 = 2e-3;
const DIFFERS_KG: f64 = 1e-3;
/// The same of the centre of the payload and of gravity, which nobody sets so exactly.
const CENTRE_DIFFERS_M: f64 = 1e-3;
const GRAVITY_DIFFERS_RAD: f64 = 0.017;

/// Whether a file is a program by its name.
pub fn is_program(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| {
        ["script", "urscript"].contains(&extension.to_ascii_lowercase().as_str())
    })
}

/// Text of a program.
///
/// # Errors
/// That the file cannot be read.
pub(super) fn program_text(path: &Path) -> Result<String, Finding> {
    read_data_text(path).map_err(|error| {
        let hint = error
            .hint("the path is relative to the working directory")
            .to_owned();
        let message = format!("cannot read the program: {error}");
        Finding::new(path.display().to_string(), message).hint(hint)
    })
}

/// Time between two set-points of the controller of a scenario's arm, s, and the arm's kinematics.
///
/// # Errors
/// An arm without that time in its data, or that is no UR arm.
pub(super) fn controller_of(resolved: &ResolvedScenario) -> Result<(f64, Kinematics), Finding> {
    let Some(period_s) = set_point_period_s(resolved) else {
        let message = format!(
            "the data of {} do not say how often its controller takes set-points, which a program needs",
            resolved.robot_description.arm_name
        );
        let finding = Finding::new(&resolved.source.file, message).key("control.period_ms");
        return Err(finding.hint("choose an arm with [control] in its arm.toml"));
    };
    let kinematics = Kinematics::new(resolved.cell.robot.chain).map_err(|error| {
        let message = format!("programs are evaluated for UR arms alone: {error}");
        Finding::new(&resolved.source.file, message)
    })?;
    Ok((period_s, kinematics.within(resolved.cell.robot.limits)))
}

impl InstalledTcp {
    /// The tool's point in the flange's frame, if it is known.
    pub(super) fn flange_from_tcp(self, resolved: &ResolvedScenario) -> Option<Pose> {
        match self {
            Self::Unknown => None,
            Self::Flange => Some(Pose::identity()),
            Self::GuideExit => Some(resolved.cell.tool.flange_from_guide_exit),
        }
    }
}

/// An error of a program as one of its file.
pub(super) fn wrong_program(file: &str, text: &str, error: ScriptError) -> Finding {
    let ScriptError {
        place,
        message,
        hint,
    } = error;
    let finding = Finding::new(file, format!("column {}: {message}", place.column));
    let finding = Finding {
        hint,
        ..finding.at(text, place.offset..place.offset)
    };
    // Lines may end in a carriage return alone.
    Finding {
        line: Some(place.line),
        ..finding
    }
}

/// What the program makes its controller believe, where that is not what the scenario has.
pub(super) fn differences(
    resolved: &ResolvedScenario,
    belief: &Belief,
    installed: Option<Pose>,
) -> Vec<String> {
    let tool = &resolved.cell.tool;
    let Belief {
        flange_from_tcp,
        payload_kg,
        centre_m,
        gravity_m_s2,
    } = belief;
    let mut notes = Vec::new();
    let carried = tool.body.mass_kg;
    match payload_kg {
        None => notes.push(format!(
            "the program sets no payload; {carried:.3} kg carried"
        )),
        Some(set) if (set - carried).abs() > DIFFERS_KG => {
            notes.push(format!("payload {set:.3} kg set, {carried:.3} kg carried"));
        }
        Some(_) => {}
    }
    if let Some(centre_m) = centre_m {
        let off_m = (nalgebra::Vector3::from(*centre_m) - tool.body.com_m).norm();
        if off_m > CENTRE_DIFFERS_M {
            notes.push(format!(
                "centre of the payload set {:.1} mm off that of the tool",
                off_m * 1e3
            ));
        }
    }
    if let Some(tcp) = flange_from_tcp.or(installed) {
        let exit = &tool.flange_from_guide_exit;
        let off_m = (tcp.translation.vector - exit.translation.vector).norm();
        let off_rad = rotation_angle_between(&tcp.rotation, &exit.rotation);
        if off_m > DIFFERS_M || off_rad > DIFFERS_RAD {
            notes.push(format!(
                "TCP {:.1} mm and {:.1} deg off the guide's exit",
                off_m * 1e3,
                off_rad.to_degrees()
            ));
        }
    }
    if let Some(gravity) = gravity_m_s2 {
        // A program says what accelerates the arm when it stands: up.
        let set = nalgebra::Vector3::from(*gravity);
        let up = -(resolved.cell.robot.world_from_base().rotation.inverse()
            * resolved.cell.gravity_m_s2);
        let off_rad = libm::atan2(set.cross(&up).norm(), set.dot(&up));
        if off_rad > GRAVITY_DIFFERS_RAD {
            notes.push(format!(
                "direction of gravity set {:.1} deg off that of the scenario",
                off_rad.to_degrees()
            ));
        }
    }
    notes
}
