//! The shipped table3 cell with imperfections.

#![allow(dead_code, reason = "every test file uses a part of it")]

use std::path::Path;

use needlebench_engine::{Servo, ServoGains};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

/// Every effect that has a block, with its defaults.
pub const ALL: &str = "
[imperfections.calibration]
class = \"nominal_kinematics\"
[imperfections.encoder]
zero_spread_deg = [0.01, 0.01, 0.01, 0.02, 0.02, 0.02]
[imperfections.elasticity]
[imperfections.payload]
mass_error_kg = 0.05
com_error_mm = [0, 5, 10]
[imperfections.friction]
[imperfections.control]
[imperfections.guide]
diametral_clearance_mm = 0.15
[imperfections.hand_eye]
[imperfections.registration]
[imperfections.skin_markers]
[imperfections.imaging]
[imperfections.needle]
model = \"cantilever\"
[imperfections.indentation]
[imperfections.breathing]
hold_failure = 0
";

/// Ends of motions: one with a bent wrist, one stretched out.
pub const POSTURES: [Joints; 2] = [
    Joints::new(0.3, -1.3, 1.5, -1.2, -1.4, 0.4),
    Joints::new(-0.6, -0.8, 0.5, -1.9, 1.2, 2.0),
];

/// table3 with these imperfections.
pub fn imperfect(blocks: &str) -> ResolvedScenario {
    resolved("scenarios/table3.toml", |text| format!("{text}\n{blocks}"))
}

/// A goal by entry and target, with these imperfections.
pub fn imperfect_in_tissue(blocks: &str) -> ResolvedScenario {
    resolved("guide/examples/tissue.toml", |text| {
        let (cell, _) = text
            .split_once("[expected.needle]")
            .expect("it has a needle");
        format!("{cell}\n{blocks}")
    })
}

fn resolved(file: &str, change: impl Fn(&str) -> String) -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(file);
    let text = std::fs::read_to_string(&path).expect("the shipped scenario is there");
    let folder = path.parent().expect("in a folder");
    let file = path.display().to_string();
    resolve_scenario(&file, &change(&text), folder, &Overrides::default())
        .expect("the blocks are sound")
}

pub fn servo(resolved: &ResolvedScenario) -> Servo {
    Servo {
        dynamics: resolved.cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: resolved.cell.robot.limits.efforts_nm(),
    }
}

/// A motion of every joint to a posture, held for `hold_s`.
pub fn motion_to(resolved: &ResolvedScenario, end: Joints, hold_s: f64) -> JointTrajectory {
    let start = end + Joints::new(0.5, 0.4, -0.5, 0.3, -0.4, 0.6);
    JointTrajectory::starting_at(start)
        .then_straight_to(Phase::Transfer, end, &resolved.motion)
        .then_hold(Phase::Hold, hold_s)
}
