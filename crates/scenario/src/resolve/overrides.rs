//! What the command line may replace in a scenario.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::entry::EntryChooser;
use needlebench_input::{Expanded, Finding, Location, PackagePaths};
use needlebench_robot::MissingInertia;
use needlebench_robot::arm::{Arm, DEFAULT_ARM, robot_location};

/// What the command line may replace in a scenario.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overrides {
    /// URDF of another robot, relative to the working directory, or the name of a shipped arm.
    pub robot_urdf: Option<PathBuf>,
    /// What a program made of the file `robot_urdf`, which it replaces.
    pub expanded: Option<Arc<Expanded>>,
    /// The arm whose data the robot has: the name of a shipped one, or the path of an `arm.toml`
    /// relative to the working directory. Without a URDF it is the robot too.
    pub arm: Option<String>,
    /// What stands before the names of the arm's links and joints in its URDF.
    pub prefix: Option<String>,
    /// Search paths for `package://`.
    pub packages: PackagePaths,
    /// Factory calibration whose joint origins replace the URDF's, relative to the working
    /// directory.
    pub calibration: Option<PathBuf>,
    /// What to do when a moving link has no mass.
    pub missing_inertia: Option<MissingInertia>,
    /// Names of the engines that there are: a file that names another one is refused. Without any
    /// names none is.
    pub engines: Vec<&'static str>,
    /// Chooses the entry of a goal that has only a target; without it such a goal is rejected.
    pub choose_entry: Option<EntryChooser>,
}

impl Overrides {
    /// Whether the scenario's robot is not used.
    pub(crate) fn replace_robot(&self) -> bool {
        self.robot_urdf.is_some() || self.expanded.is_some() || self.arm.is_some()
    }

    /// The named arm, and where the URDF is: that arm's own or the default one's if none
    /// is given.
    pub(crate) fn arm_and_urdf(&self) -> Result<(Option<Arc<Arm>>, Location), Finding> {
        let here = Path::new("");
        let arm = self
            .arm
            .as_ref()
            .map(|name| Arm::of_reference(name, here).map_err(|finding| finding.key("--arm")))
            .transpose()?;
        if let Some(expanded) = &self.expanded {
            return Ok((arm, Location::Expanded(Arc::clone(expanded))));
        }
        let location = match (&self.robot_urdf, &arm) {
            (Some(path), _) => match path.to_str() {
                Some(reference) => robot_location(reference, here),
                None => Location::Disk(path.clone()),
            },
            (None, Some(arm)) => arm.urdf(),
            (None, None) => robot_location(DEFAULT_ARM, here),
        };
        Ok((arm, location))
    }
}
