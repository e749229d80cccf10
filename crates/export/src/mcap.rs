//! A recorded motion as messages of ROS 2 in an MCAP file.

mod frames;
mod markers;

use std::collections::BTreeMap;

use needlebench_bench::provenance::PROGRAM_VERSION;
use needlebench_cell::rule_in_words;
use needlebench_evaluation::sample_indices;
use needlebench_kinematics::trajectory::Phase;
use needlebench_kinematics::{JOINT_NAMES, Joints};
use needlebench_ros::message::{Header, Number, Text};
use needlebench_ros::{JointState, McapWriter, Stamp, WriteError};

use crate::error::ExportError;
use crate::file::ExportedFile;
use crate::motion::Motion;

/// The recording of a motion as an MCAP file of ROS 2 messages, one row every `period_s` as in the CSV recording.
///
/// | Topic | What |
/// |---|---|
/// | `/joint_states` | `sensor_msgs/JointState`: positions, velocities and the torque of the step that ended then (N m, with gravity's share; at the start that of the first step) as the engine has them |
/// | `/joint_states_planned` | the same of the plan, without efforts |
/// | `/tf`, `/tf_static` | `tf2_msgs/TFMessage`: the frames of the arm that was simulated, by its kinematics at those positions |
/// | `/cell` | `visualization_msgs/MarkerArray`: arm, tool, patient, table, gantry, mount, obstacles, the planned needle |
/// | `/clearance/CLASS` | `std_msgs/Float64`: signed distance, m |
/// | `/contact/normal_force` | `std_msgs/Float64`: sum of the normal forces of rigid contacts over the step that ended then, N |
/// | `/phase` | `std_msgs/String`, when it begins |
///
/// Log times and stamps are simulated time from 0. No forces of contacts have a direction in a recording, so there is no
/// wrench. The same bytes for the same recording.
///
/// # Errors
/// [`ExportError::Mcap`]: memory has no errors of writing.
pub fn mcap(motion: &Motion<'_>, name: &str) -> Result<ExportedFile, ExportError> {
    let bytes = bytes(motion).map_err(|error| ExportError::Mcap(error.to_string()))?;
    Ok(ExportedFile {
        name: name.to_owned(),
        bytes,
    })
}

fn bytes(motion: &Motion<'_>) -> Result<Vec<u8>, WriteError> {
    let recording = &motion.recorded.recording;
    let clearance = &motion.recorded.clearance;
    let mut file = McapWriter::new(&format!("needlebench {PROGRAM_VERSION}"))?;
    file.metadata("needlebench", metadata(motion))?;
    file.write_latched("/tf_static", 0, &frames::fixed(motion))?;
    file.write_latched("/cell", 0, &markers::cell(motion))?;
    let period_s = motion.resolved.scenario.recording.period_ms * 1e-3;
    let mut phase: Option<Phase> = None;
    for (row, index) in sample_indices(recording, period_s).into_iter().enumerate() {
        let time_ns = nanoseconds(recording.time_s[index]);
        let (state, reference) = (&recording.state[index], &recording.reference[index]);
        let now = motion.trajectory.phase_at(recording.time_s[index]);
        if phase.replace(now) != Some(now) {
            file.write("/phase", time_ns, &Text(now.name().to_owned()))?;
        }
        let torque = recording.torque_nm.get(index.saturating_sub(1));
        let actual = joint_state(time_ns, &state.position, &state.velocity, torque);
        file.write("/joint_states", time_ns, &actual)?;
        let planned = joint_state(time_ns, &reference.position, &reference.velocity, None);
        file.write("/joint_states_planned", time_ns, &planned)?;
        file.write(
            "/tf",
            time_ns,
            &frames::moving(motion, &state.position, time_ns),
        )?;
        file.write(
            "/contact/normal_force",
            time_ns,
            &Number(state.contact.normal_force_n),
        )?;
        for (class, series) in &clearance.distance_m {
            let topic = format!("/clearance/{}", class.name());
            file.write(&topic, time_ns, &Number(series[row]))?;
        }
    }
    file.finish()
}

fn metadata(motion: &Motion<'_>) -> BTreeMap<String, String> {
    let origin = motion.origin().into_iter();
    let mut all: BTreeMap<String, String> = origin
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
    all.insert(
        "truth".to_owned(),
        "simulated, not recorded on a real robot".to_owned(),
    );
    let rules = motion.rejections.first().map_or_else(
        || "all satisfied".to_owned(),
        |first| {
            let rule = rule_in_words(first.rule.name());
            format!("infeasible: {rule}: {}", first.detail)
        },
    );
    all.insert("planning_rules".to_owned(), rules);
    // `failed` where it keeps the rules but misses a criterion.
    all.insert("status".to_owned(), motion.status.name().to_owned());
    all.insert(
        "effort".to_owned(),
        "joint torque in N m, gravity included".to_owned(),
    );
    all.insert(
        "proven_clearance".to_owned(),
        motion.proven_in_words(0.0).join("; "),
    );
    all
}

/// A time from the start of a motion in whole nanoseconds.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "from 0 to some minutes"
)]
fn nanoseconds(time_s: f64) -> u64 {
    (time_s * 1e9).round() as u64
}

fn joint_state(
    time_ns: u64,
    position: &Joints,
    velocity: &Joints,
    effort: Option<&Joints>,
) -> JointState {
    let values = |joints: &Joints| joints.iter().copied().collect();
    JointState {
        header: Header {
            stamp: Stamp::of_ns(time_ns),
            frame_id: String::new(),
        },
        name: JOINT_NAMES.map(str::to_owned).to_vec(),
        position: values(position),
        velocity: values(velocity),
        effort: effort.map(values).unwrap_or_default(),
    }
}
