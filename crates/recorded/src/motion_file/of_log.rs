//! Motions from logs: the set-points, or on request what was measured.

use std::path::Path;

use needlebench_input::Finding;
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointState;

use super::{Known, MotionFile, MotionOptions, MotionSource};
use crate::joint_states::{is_mcap, joint_state_topics};
use crate::{ReadOptions, read_log};

/// Set-points in the MCAP files that needlebench writes.
const PLANNED_TOPIC: &str = "/joint_states_planned";

pub(super) fn read(
    path: &Path,
    file: &str,
    options: &MotionOptions,
) -> Result<MotionFile, Vec<Finding>> {
    let refuse = |message: String, key: &str, hint: String| {
        Err(vec![Finding::new(file, message).key(key).hint(hint)])
    };
    let is_mcap = is_mcap(path);
    if options.topic.is_some() && !is_mcap {
        let message = "--topic is about MCAP files, and this is a table".to_owned();
        return refuse(message, "--topic", "leave it out".to_owned());
    }
    let mut topic = options.topic.clone();
    if is_mcap && topic.is_none() && !options.of_actual {
        let topics = joint_state_topics(path, file)?;
        topic = topics.into_iter().find(|each| each == PLANNED_TOPIC);
    }
    // What a topic of joint states is, its name alone says.
    let is_planned = topic.as_deref() == Some(PLANNED_TOPIC);
    let log = read_log(
        path,
        &ReadOptions {
            topic,
            ..ReadOptions::default()
        },
    )?;
    let rows = match (log.stretches.as_slice(), options.stretch) {
        ([only], None | Some(1)) => only.clone(),
        (several, Some(number)) if (1..=several.len()).contains(&number) => {
            several[number - 1].clone()
        }
        (several, wanted) => {
            let all = several.iter().enumerate().map(|(index, rows)| {
                let [from_s, to_s] = [rows.start, rows.end - 1].map(|row| log.time_s[row]);
                format!("{} from {from_s:.3} s to {to_s:.3} s", index + 1)
            });
            let all: Vec<String> = all.collect();
            let message = match wanted {
                Some(number) => format!("the log has no stretch {number}"),
                None => format!(
                    "the log has gaps, and {} stretches between them",
                    several.len()
                ),
            };
            let hint = format!("choose one with --stretch: {}", all.join("; "));
            return refuse(message, "--stretch", hint);
        }
    };
    let measured = |known: Known| {
        let zero = Joints::zeros();
        let speeds = log
            .actual_qd
            .as_ref()
            .filter(|_| known == Known::Velocities);
        let states = rows.clone().map(|row| JointState {
            position: log.actual_q[row],
            velocity: speeds.map_or(zero, |speeds| speeds[row]),
            acceleration: zero,
        });
        (states.collect::<Vec<JointState>>(), known)
    };
    let ((states, known), format) = match &log.target {
        Some(target) if !options.of_actual => {
            let states = target[rows.clone()].to_vec();
            ((states, Known::Accelerations), "set-points of a log")
        }
        // A plan's speeds are those of its course; measured ones have noise of their own.
        _ if is_planned => {
            let known = if log.actual_qd.is_some() {
                Known::Velocities
            } else {
                Known::Positions
            };
            (measured(known), "planned joint states")
        }
        _ if options.of_actual => (measured(Known::Positions), "measured positions of a log"),
        _ => {
            let message = "the log has no set-points".to_owned();
            let hint = "judge what was measured with --of actual".to_owned();
            return refuse(message, "target_q", hint);
        }
    };
    Ok(MotionFile {
        source: MotionSource {
            file: file.to_owned(),
            sha256: log.source.sha256,
            format,
            points: states.len(),
        },
        times_s: Some(log.time_s[rows].to_vec()),
        states,
        known,
        lines: Vec::new(),
        notes: log.notes,
    })
}
