//! The answers of `ik` and `fk`, as JSON and as tables.

use std::collections::BTreeMap;

use needlebench_kinematics::ik::SolutionKind;
use needlebench_kinematics::{Joints, Pose, rotation_vector};
use serde::Serialize;

use super::arm::KinematicArm;

/// The arm and the calibration that an answer is for.
#[derive(Debug, Serialize)]
pub(super) struct ArmAnswer {
    arm: String,
    calibration: Option<CalibrationAnswer>,
}

#[derive(Debug, Serialize)]
struct CalibrationAnswer {
    file: String,
    sha256: String,
    hash: Option<String>,
}

impl ArmAnswer {
    pub(super) fn of(arm: &KinematicArm) -> Self {
        Self {
            arm: arm.name.clone(),
            calibration: arm
                .calibration
                .as_ref()
                .map(|calibration| CalibrationAnswer {
                    file: calibration.source.file.clone(),
                    sha256: calibration.source.sha256.clone(),
                    hash: calibration.hash.clone(),
                }),
        }
    }

    fn text(&self) -> String {
        match &self.calibration {
            None => self.arm.clone(),
            Some(CalibrationAnswer { file, hash, .. }) => {
                let hash = hash.as_deref().unwrap_or("no hash");
                format!("{}, calibrated by {file} ({hash})", self.arm)
            }
        }
    }
}

#[derive(Debug, Serialize)]
pub(super) struct IkAnswer {
    pub schema_version: u32,
    #[serde(flatten)]
    pub arm: ArmAnswer,
    pub method: &'static str,
    /// Pose tolerance for boundary solutions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance_rad: Option<f64>,
    /// Solutions.
    pub solutions: Vec<SolutionAnswer>,
    pub count: usize,
    /// Postures that do not reach the pose, nearest first.
    pub nearest: Vec<SolutionAnswer>,
    pub unreachable: Vec<UnreachableAnswer>,
    pub certificate: &'static str,
}

#[derive(Debug, Serialize)]
pub(super) struct SolutionAnswer {
    pub label: &'static str,
    pub joints_rad: [f64; 6],
    pub residual_m: f64,
    pub residual_rad: f64,
    pub within_limits: bool,
    pub free_joint: Option<&'static str>,
    pub kind: &'static str,
    pub merged: bool,
    /// A boundary solution: it misses the given pose by no more than the tolerance.
    pub touching: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<u32>,
}

#[derive(Debug, Serialize)]
pub(super) struct UnreachableAnswer {
    pub label: &'static str,
    pub missing_m: f64,
}

/// Name of a kind in answers.
pub(super) fn kind_name(kind: SolutionKind) -> &'static str {
    match kind {
        SolutionKind::Exact => "exact",
        SolutionKind::Touching => "touching",
        SolutionKind::Nearest => "nearest",
    }
}

impl SolutionAnswer {
    fn remarks(&self) -> String {
        let mut remarks = Vec::new();
        if self.kind == kind_name(SolutionKind::Nearest) {
            remarks.push("nearest posture, not a solution".to_owned());
        }
        if !self.within_limits {
            remarks.push("outside limits".to_owned());
        }
        if let Some(joint) = self.free_joint {
            remarks.push(format!("{joint} is free"));
        }
        if self.merged {
            remarks.push("coincident solutions".to_owned());
        }
        if self.touching {
            remarks.push("boundary solution".to_owned());
        }
        if let Some(iterations) = self.iterations {
            let plural = if iterations == 1 { "" } else { "s" };
            remarks.push(format!("{iterations} iteration{plural}"));
        }
        remarks.join(", ")
    }
}

impl IkAnswer {
    pub(super) fn text(&self) -> String {
        let mut table = needlebench_show::plain_table(&[
            "configuration",
            "q1\n(rad)",
            "q2\n(rad)",
            "q3\n(rad)",
            "q4\n(rad)",
            "q5\n(rad)",
            "q6\n(rad)",
            "residual\n(m)",
            "residual\n(rad)",
            "remarks",
        ]);
        for row in self.solutions.iter().chain(&self.nearest) {
            let mut cells = vec![row.label.to_owned()];
            cells.extend(row.joints_rad.iter().map(|q| format!("{q:.5}")));
            cells.push(format!("{:.1e}", row.residual_m));
            cells.push(format!("{:.1e}", row.residual_rad));
            cells.push(row.remarks());
            table.add_row(cells);
        }
        for unreachable in &self.unreachable {
            let mut cells = vec![unreachable.label.to_owned()];
            cells.extend((0..8).map(|_| "-".to_owned()));
            cells.push(format!("out of reach by {}", length(unreachable.missing_m)));
            table.add_row(cells);
        }
        let (arm, count, certificate) = (self.arm.text(), self.count, self.certificate);
        let touching = match (self.tolerance_m, self.tolerance_rad) {
            (Some(m), Some(rad)) if self.solutions.iter().any(|row| row.touching) => {
                let m = length(m);
                format!("\nboundary solution: reaches the pose to within {m} and {rad:.1e} rad")
            }
            _ => String::new(),
        };
        format!("{table}\narm: {arm}\n{count}: {certificate}{touching}")
    }
}

/// A length in the unit that shows its digits.
fn length(m: f64) -> String {
    if m >= 1e-4 {
        format!("{:.1} mm", m * 1e3)
    } else if m >= 1e-7 {
        format!("{:.1} um", m * 1e6)
    } else if m >= 1e-10 {
        format!("{:.1} nm", m * 1e9)
    } else {
        format!("{m:.1e} m")
    }
}

#[derive(Debug, Serialize)]
pub(super) struct FkAnswer {
    schema_version: u32,
    #[serde(flatten)]
    arm: ArmAnswer,
    flange_in_base: PoseAnswer,
    flange_in_base_link: PoseAnswer,
    links: BTreeMap<String, PoseAnswer>,
    /// Names of the links from base to flange, as tables print them.
    #[serde(skip)]
    order: Vec<String>,
}

#[derive(Debug, Serialize)]
struct PoseAnswer {
    position_m: [f64; 3],
    rotvec_rad: [f64; 3],
    quat_wxyz: [f64; 4],
}

impl PoseAnswer {
    fn new(pose: &Pose) -> Self {
        let q = pose.rotation;
        Self {
            position_m: pose.translation.vector.into(),
            rotvec_rad: rotation_vector(&q).into(),
            quat_wxyz: [q.w, q.i, q.j, q.k],
        }
    }
}

impl FkAnswer {
    pub(super) fn new(arm: &KinematicArm, q: &Joints) -> Self {
        let in_base_link = arm.chain.base_link_from_flange(q);
        let in_base = needlebench_cell::Robot::base_link_from_base().inverse() * in_base_link;
        let poses = arm.chain.link_poses(q);
        let order: Vec<String> = arm
            .links
            .iter()
            .map(|link| format!("{link}_link"))
            .collect();
        Self {
            schema_version: 1,
            arm: ArmAnswer::of(arm),
            flange_in_base: PoseAnswer::new(&in_base),
            flange_in_base_link: PoseAnswer::new(&in_base_link),
            links: order
                .iter()
                .cloned()
                .zip(poses.iter().map(PoseAnswer::new))
                .collect(),
            order,
        }
    }

    pub(super) fn text(&self) -> String {
        let mut table = needlebench_show::plain_table(&[
            "frame",
            "position\nx (m)",
            "\ny (m)",
            "\nz (m)",
            "rotation vector\nx (rad)",
            "\ny (rad)",
            "\nz (rad)",
        ]);
        let mut row = |name: String, pose: &PoseAnswer| {
            let mut cells = vec![name];
            let numbers = pose.position_m.iter().chain(&pose.rotvec_rad);
            cells.extend(numbers.map(|value| format!("{value:.6}")));
            table.add_row(cells);
        };
        row("flange in base".to_owned(), &self.flange_in_base);
        row("flange in base_link".to_owned(), &self.flange_in_base_link);
        for link in &self.order {
            row(format!("{link} in base_link"), &self.links[link]);
        }
        format!("{table}\narm: {}", self.arm.text())
    }
}
