//! Arguments shared by several commands.

mod engine;
mod pictures;
mod running;
mod table;

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use nalgebra::Matrix3x4;
use needlebench_kinematics::UrModel;
use needlebench_robot::MissingInertia;

use crate::output::complain;

pub(crate) use engine::{EngineArgument, EngineParser};
pub(crate) use pictures::PicturesArguments;
pub(crate) use running::{Record, RunningArguments};
pub(crate) use table::{TableArguments, leave};

/// A robot in place of the scenario's, and its arm data.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct RobotArguments {
    /// Arm data: a bundled arm (e.g. ur5e) or the path of an arm.toml; also selects the robot unless --robot
    /// is given.
    #[arg(long, value_name = "ARM")]
    pub arm: Option<String>,
    #[command(flatten)]
    pub urdf: UrdfArguments,
}

/// A robot in place of the scenario's.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct UrdfArguments {
    /// URDF of another UR arm, a file.xacro that the program xacro on the PATH expands, or a bundled arm's name
    /// [default: the scenario's robot, or a UR3].
    #[arg(long, value_name = "URDF")]
    pub robot: Option<PathBuf>,
    /// Argument of xacro, such as ur_type:=ur10e, for a robot's file.xacro; repeatable.
    #[arg(long, value_name = "NAME:=VALUE", requires = "robot")]
    pub xacro: Vec<String>,
    /// Prefix of the arm's link and joint names, e.g. left_ in a URDF with two arms; joints of the other arms are fixed
    /// at 0.
    #[arg(long, value_name = "PREFIX")]
    pub prefix: Option<String>,
    /// Folder of a ROS package that the URDF's meshes refer to; repeatable.
    #[arg(long, value_name = "NAME=DIR")]
    pub package_path: Vec<String>,
    /// Factory calibration of the arm, as written by ROS's `ur_calibration`; its joint origins replace
    /// the URDF's.
    #[arg(long, value_name = "YAML")]
    pub calibration: Option<PathBuf>,
    /// Policy for moving links without mass.
    #[arg(long, value_name = "POLICY", value_parser = missing_inertia())]
    pub missing_inertia: Option<MissingInertia>,
}

/// A robot in place of the default one, for commands that need its kinematics only.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct ArmArguments {
    /// A UR arm by name, with its nominal lengths: UR3, UR3e, UR5, UR5e, UR10, UR10e, UR16e, UR20
    /// or UR30.
    #[arg(
        long,
        value_name = "MODEL",
        conflicts_with_all = ["robot", "xacro", "prefix", "package_path", "missing_inertia"]
    )]
    pub arm: Option<UrModel>,
    #[command(flatten)]
    pub robot: UrdfArguments,
}

/// Parser of the policies: reject the robot, or use the mass properties of the arm that it is.
fn missing_inertia() -> impl TypedValueParser<Value = MissingInertia> {
    PossibleValuesParser::new(MissingInertia::texts()).map(|text| {
        text.parse()
            .expect("it is one of the texts that are possible")
    })
}

/// Six comma-separated finite numbers, and half a unit in the last place that each was written to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Six(pub [f64; 6], pub [f64; 6]);

impl std::str::FromStr for Six {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Vec<(f64, f64)> = text
            .split(',')
            .map(|word| Ok((finite(word.trim())?, half_unit(word.trim()))))
            .collect::<Result<_, String>>()?;
        let count = numbers.len();
        let numbers: [(f64, f64); 6] = numbers
            .try_into()
            .map_err(|_| format!("expected six comma-separated numbers, got {count}"))?;
        Ok(Self(
            numbers.map(|(value, _)| value),
            numbers.map(|(_, half_unit)| half_unit),
        ))
    }
}

impl Six {
    /// Warns of joint positions of more than two turns, which no arm has: they are likely degrees.
    pub(crate) fn doubt_degrees(&self) {
        if let Some(most) = self.0.iter().find(|q| q.abs() > 2.0 * TAU) {
            complain(&format!(
                "note: joint positions are in rad, and {most} rad are {:.1} turns; {most} deg would be {:.4} rad",
                most / TAU,
                most.to_radians()
            ));
        }
    }
}

/// The upper three rows `[R | p]` of a pose's matrix, as they were given, and half a unit in the last
/// place that each number was written to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseMatrix(pub Matrix3x4<f64>, pub Matrix3x4<f64>);

impl std::str::FromStr for PoseMatrix {
    type Err = String;

    /// Reads what programs print: numbers between commas, semicolons, brackets and white space.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let words = || {
            text.split(|each: char| each.is_whitespace() || ",;[]()".contains(each))
                .filter(|word| !word.is_empty())
        };
        let numbers: Vec<f64> = words().map(finite).collect::<Result<_, _>>()?;
        let half_units: Vec<f64> = words().map(half_unit).collect();
        let count = numbers.len();
        let rows = match count {
            12 => &numbers[..],
            16 => {
                let (rows, last) = numbers.split_at(12);
                if last != [0.0, 0.0, 0.0, 1.0] {
                    let columns = [3, 7, 11].iter().all(|&at| rows[at] == 0.0) && last[3] == 1.0;
                    return Err(if columns {
                        "the numbers are in column-major order; give them row by row".to_owned()
                    } else {
                        format!("the last row is {last:?}, required are 0, 0, 0, 1")
                    });
                }
                rows
            }
            _ => {
                return Err(format!(
                    "expected 12 numbers (three rows of rotation and position) or 16, got {count}"
                ));
            }
        };
        Ok(Self(
            Matrix3x4::from_row_slice(rows),
            Matrix3x4::from_row_slice(&half_units[..12]),
        ))
    }
}

/// Half a unit in the last place that a number was written to: 5e-4 for `0.120` and `12.0e-2`, 0.5 for
/// `3`.
fn half_unit(word: &str) -> f64 {
    let (mantissa, exponent) = word.split_once(['e', 'E']).unwrap_or((word, "0"));
    let decimals = mantissa
        .split_once('.')
        .map_or(0, |(_, decimals)| decimals.len());
    let decimals = i32::try_from(decimals).unwrap_or(i32::MAX);
    let exponent: i32 = exponent.parse().unwrap_or(0);
    0.5 * 10.0_f64.powi(exponent.saturating_sub(decimals))
}

fn finite(word: &str) -> Result<f64, String> {
    let number: f64 = word
        .parse()
        .map_err(|_| format!("`{word}` is not a number"))?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(format!("`{word}` is not finite"))
    }
}
