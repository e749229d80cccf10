//! The set-points of a log through the engines, piece by piece: a run of any length needs the memory of
//! what is compared.

use std::ops::Range;

use needlebench_cell::EngineSettings;
use needlebench_engine::{
    Engine, EngineError, EngineIdentity, EnginePool, Hooks, Keep, Motion, MotionJob,
    MotionSettings, run_motions,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{Between, JointTrajectory, Phase};
use needlebench_parallel::Control;
use needlebench_recorded::RecordedRun;

use super::arm::ReplayedArm;
use super::compare::Course;

/// Longest piece, s.
const LONGEST_S: f64 = 20.0;

/// A piece that starts in motion starts at rest in the engines: for this time, in s, the servo catches up and nothing
/// is compared. The servo's natural frequency is 6 Hz or more, its damping ratio 0.6 or nearly so.
const CATCHING_UP_S: f64 = 0.5;

/// Pieces whose trajectories are there at a time.
const AT_A_TIME: usize = 16;

/// Rows that are simulated, and those of them that are compared.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Piece {
    rows: Range<usize>,
    from: usize,
    load: usize,
}

/// Why an engine does not follow a log.
#[derive(Debug, thiserror::Error)]
pub(super) enum CourseError {
    /// It ended, or could not begin.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// It could not simulate a piece.
    #[error("from {from_s:.2} s of the log: {source}")]
    Piece {
        /// Where the piece begins, s after the first row.
        from_s: f64,
        /// What it reports.
        source: EngineError,
    },
    /// No two rows follow each other.
    #[error("the log has no two consecutive rows without a gap")]
    NoPiece,
}

/// What an engine does at every row of the log.
pub(super) fn course(
    run: &RecordedRun,
    arm: &ReplayedArm,
    engines: &EngineSettings,
    pool: &EnginePool,
    engine: &'static dyn Engine,
    control: &Control<'_>,
) -> Result<(EngineIdentity, Course), CourseError> {
    let target = run
        .target
        .as_ref()
        .expect("only a log with set-points is replayed");
    let pieces = pieces(run);
    control.progress.expect(pieces.len() as u64);
    let mut course = Course::none(run.len());
    let mut identity = None;
    let mut failed: Option<(usize, EngineError)> = None;
    for batch in pieces.chunks(AT_A_TIME) {
        let trajectories: Vec<JointTrajectory> = batch
            .iter()
            .map(|piece| {
                let times_s = &run.time_s[piece.rows.clone()];
                let states = &target[piece.rows.clone()];
                JointTrajectory::sampled(Phase::Replay, Between::Quintics, times_s, states)
                    .expect("rows of a stretch increase in time and are finite")
            })
            .collect();
        let times_s: Vec<Vec<f64>> = batch
            .iter()
            .map(|piece| {
                let start_s = run.time_s[piece.rows.start];
                (piece.from..piece.rows.end)
                    .map(|row| run.time_s[row] - start_s)
                    .collect()
            })
            .collect();
        let jobs: Vec<MotionJob<'_>> = batch
            .iter()
            .zip(trajectories.iter().zip(&times_s))
            .map(|(piece, (trajectory, times_s))| MotionJob {
                cell: &arm.cells[piece.load],
                friction: None,
                motion: Motion {
                    servo: &arm.servos[piece.load],
                    actuation: &arm.actuation,
                    trajectory,
                    braking: None,
                    keep: Keep::Near(times_s),
                },
            })
            .collect();
        let hooks = Hooks {
            cancel: Some(control.cancel),
            progress: None,
        };
        let settings = MotionSettings::new(engines);
        let mut ended =
            |index: usize, result: Result<needlebench_engine::Recording, EngineError>| {
                control.progress.step();
                let piece = &batch[index];
                match result {
                    Ok(recording) => take(run, piece, &times_s[index], &recording, &mut course),
                    Err(error) if failed.is_none() => failed = Some((piece.rows.start, error)),
                    Err(_) => {}
                }
            };
        let done = run_motions(pool, engine, &jobs, settings, hooks, &mut ended);
        identity = identity.or(done.identity);
        if let Some(error) = done.error {
            return Err(error.into());
        }
    }
    match (failed, identity) {
        (Some((row, source)), _) => Err(CourseError::Piece {
            from_s: run.time_s[row] - run.time_s[0],
            source,
        }),
        (None, Some(identity)) => Ok((identity, course)),
        (None, None) => Err(CourseError::NoPiece),
    }
}

/// Takes what is compared out of a recording: the state nearest to each row's time.
fn take(
    run: &RecordedRun,
    piece: &Piece,
    times_s: &[f64],
    recording: &needlebench_engine::Recording,
    course: &mut Course,
) {
    let mut kept = 0;
    for (row, time_s) in (piece.from..piece.rows.end).zip(times_s) {
        while kept + 1 < recording.time_s.len()
            && (recording.time_s[kept + 1] - time_s).abs()
                <= (recording.time_s[kept] - time_s).abs()
        {
            kept += 1;
        }
        let Some(state) = recording.state.get(kept) else {
            continue;
        };
        course.error[row] = state.position - recording.reference[kept].position;
        let torques = recording
            .torque_nm
            .get(kept)
            .zip(recording.drive_nm.get(kept));
        if let Some((link_nm, motor_nm)) = torques {
            course.link_nm[row] = *link_nm;
            course.motor_nm[row] = *motor_nm;
        }
    }
    debug_assert!(piece.rows.end <= run.len());
}

/// Pieces of the stretches, cut where set-points stand where they do, and where the load changes.
fn pieces(run: &RecordedRun) -> Vec<Piece> {
    let target = run
        .target
        .as_ref()
        .expect("only a log with set-points is replayed");
    let stands = |row: usize| target[row].velocity == Joints::zeros();
    let mut pieces = Vec::new();
    for stretch in split_by_load(run) {
        let mut from = stretch.start;
        while from + 1 < stretch.end {
            let until_s = run.time_s[from] + LONGEST_S;
            let mut end = from + run.time_s[from..stretch.end].partition_point(|t| *t <= until_s);
            if end < stretch.end {
                // The last stand in the second half of the piece, if there is one.
                let half = from + (end - from) / 2;
                if let Some(stand) = (half..end).rev().find(|row| stands(*row)) {
                    end = stand + 1;
                }
            }
            let end = end.max(from + 2).min(stretch.end);
            let start = if stands(from) || from == stretch.start {
                from
            } else {
                let start_s = run.time_s[from] - CATCHING_UP_S;
                let earlier = run.time_s[stretch.start..from].partition_point(|t| *t < start_s);
                stretch.start + earlier
            };
            let compared = if stands(start) {
                from
            } else {
                let ready_s = run.time_s[start] + CATCHING_UP_S;
                from.max(start + run.time_s[start..end].partition_point(|t| *t < ready_s))
            };
            pieces.push(Piece {
                rows: start..end,
                from: compared.min(end),
                load: run.load_at(from).unwrap_or(0),
            });
            from = if end == stretch.end { end } else { end - 1 };
        }
    }
    pieces
}

/// Stretches, cut where the load changes.
fn split_by_load(run: &RecordedRun) -> Vec<Range<usize>> {
    let mut parts = Vec::new();
    for stretch in &run.stretches {
        let mut from = stretch.start;
        for (row, _) in &run.loads {
            if *row > from && *row < stretch.end {
                parts.push(from..*row);
                from = *row;
            }
        }
        parts.push(from..stretch.end);
    }
    parts
}
