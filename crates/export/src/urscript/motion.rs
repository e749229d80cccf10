//! A planned motion as a URScript program.

use std::fmt::Write;

use needlebench_kinematics::trajectory::{Phase, Piece, PieceCourse};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints, rotation_vector};

use super::{AT_START_RAD, joints, plain, set_payload, write_check_start, write_head};
use crate::error::ExportError;
use crate::file::ExportedFile;
use crate::motion::Motion;
use crate::trajectory::NEVER_RUN;

/// Decimals of joint positions: half a nanoradian is less than anything here.
const DECIMALS: usize = 9;

/// Half of the last decimal in all joints, and rounding, at the reach of any arm, m.
const ROUNDING_M: f64 = 1e-8;

/// How far `servoj` looks ahead, s, and how stiffly it follows: the manufacturer's defaults.
const LOOKAHEAD_S: f64 = 0.1;
const GAIN: u32 = 300;

/// How long the last set-point of a stream is held, s: a filter of second order with that look-ahead and gain is then
/// within 25 nm of it, and without it 0.2 mm behind.
const SETTLE_S: f64 = 0.5;

/// Deceleration that ends a stream of set-points, at which the arm stands anyway, rad/s^2.
const STOP_RAD_S2: f64 = 2.0;

/// Places of the path that a program states for each of its moves, ends included.
const PLACES: u32 = 41;

/// A move of the program.
struct Move {
    piece: Piece,
    end: Joints,
    kind: Kind,
    /// How far anything of the arm strays from the planned path at most, m.
    stray_m: f64,
}

enum Kind {
    /// `movej` without blending: the same straight joint path, under the controller's own profile.
    Straight {
        way_rad: f64,
        leading: usize,
        speed_rad_s: f64,
        acceleration_rad_s2: f64,
    },
    /// `servoj` at the controller's period.
    Stream { set_points: Vec<Joints> },
}

impl Kind {
    /// How long it takes by the controller's documentation: for `movej` a trapezoid of the leading joint, s.
    fn duration_s(&self, period_s: f64) -> f64 {
        match self {
            Self::Straight {
                way_rad,
                speed_rad_s,
                acceleration_rad_s2,
                ..
            } => {
                let ramp_s = speed_rad_s / acceleration_rad_s2;
                if way_rad >= &(speed_rad_s * ramp_s) {
                    way_rad / speed_rad_s + ramp_s
                } else {
                    2.0 * (way_rad / acceleration_rad_s2).sqrt()
                }
            }
            Self::Stream { set_points } => set_points.len() as f64 * period_s,
        }
    }

    /// How long it is held at its end, s.
    fn settle_s(&self) -> f64 {
        match self {
            Self::Straight { .. } => 0.0,
            Self::Stream { .. } => SETTLE_S,
        }
    }
}

/// The planned motion as a program: joint-space lines as `movej` without blending, other motions as `servoj` at the
/// controller's period. It states the path of the guide's exit and what is proven of its clearance.
///
/// # Errors
/// [`ExportError::NoPeriod`] for an arm whose data do not say how often its controller takes set-points.
pub fn motion_script(motion: &Motion<'_>, name: &str) -> Result<ExportedFile, ExportError> {
    let robot = &motion.resolved.robot_description;
    let control = robot
        .arm
        .as_ref()
        .and_then(|used| used.arm.data.control.as_ref());
    let period_s = match control {
        Some(control) => control.period_ms * 1e-3,
        None => {
            return Err(ExportError::NoPeriod {
                arm: robot.arm_name.clone(),
            });
        }
    };
    let moves = moves(motion, period_s);
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_script(&mut out, motion, &moves, period_s);
    Ok(ExportedFile::text(name, out))
}

fn moves(motion: &Motion<'_>, period_s: f64) -> Vec<Move> {
    let reach = Joints::from(motion.reach_m());
    let trajectory = motion.trajectory;
    let at = |time_s: f64| trajectory.sample(time_s).position;
    let mut all = Vec::new();
    for piece in trajectory.pieces() {
        let duration_s = piece.end_s - piece.start_s;
        let end = at(piece.end_s);
        let (kind, stray_m) = match piece.course {
            PieceCourse::Hold => continue,
            PieceCourse::Straight {
                leading,
                speed_rad_s,
                acceleration_rad_s2,
            } => {
                let way_rad = (end - at(piece.start_s))[leading].abs();
                let kind = Kind::Straight {
                    way_rad,
                    leading,
                    speed_rad_s,
                    acceleration_rad_s2,
                };
                (kind, ROUNDING_M)
            }
            PieceCourse::Curved => {
                let time_at = |k: u32| (f64::from(k) * period_s).min(duration_s);
                let mut count = 1;
                while time_at(count) < duration_s {
                    count += 1;
                }
                let set_points = (1..=count).map(|k| at(piece.start_s + time_at(k)));
                let stray_m = (1..=count)
                    .map(|k| {
                        let [from, to] = [k - 1, k].map(|k| piece.start_s + time_at(k));
                        trajectory.chord_deviation(from, to).dot(&reach)
                    })
                    .fold(0.0, f64::max);
                let kind = Kind::Stream {
                    set_points: set_points.collect(),
                };
                (kind, stray_m + ROUNDING_M)
            }
        };
        all.push(Move {
            piece,
            end,
            kind,
            stray_m,
        });
    }
    all
}

/// Name of the function of a phase.
fn function(phase: Phase) -> String {
    format!("nb_{}", phase.name().replace('-', "_"))
}

fn write_script(
    out: &mut String,
    motion: &Motion<'_>,
    moves: &[Move],
    period_s: f64,
) -> std::fmt::Result {
    let resolved = motion.resolved;
    let tool = &resolved.cell.tool;
    let tcp = &tool.flange_from_guide_exit;
    writeln!(out, "def needlebench_motion():")?;
    write_head(out, &head(motion, moves, period_s))?;
    write_check_start(out, &joints(&resolved.start, DECIMALS))?;
    let mut phases: Vec<Phase> = Vec::new();
    for (index, each) in moves.iter().enumerate() {
        if phases.last() != Some(&each.piece.phase) {
            if !phases.is_empty() {
                writeln!(out, "  end")?;
            }
            phases.push(each.piece.phase);
            writeln!(out, "\n  def {}():", function(each.piece.phase))?;
        }
        write_move(out, index + 1, each, period_s)?;
    }
    if !phases.is_empty() {
        writeln!(out, "  end")?;
    }
    let (place, turn) = (tcp.translation.vector, rotation_vector(&tcp.rotation));
    writeln!(
        out,
        "\n  # The exit of the guide, z along the insertion.\n  set_tcp(p[{:.9}, {:.9}, {:.9}, {:.9}, {:.9}, {:.9}])",
        place.x, place.y, place.z, turn.x, turn.y, turn.z
    )?;
    writeln!(out, "  {}", set_payload(&tool.body))?;
    writeln!(
        out,
        "  popup(\"This program was never run on a robot. Compare the scenario with the real room; everybody out of \
         reach, hand at the emergency stop. Continue starts the motion.\", title=\"{}\", warning=True, blocking=True)",
        // What the user named may hold anything.
        plain(&motion.goal.name)
    )?;
    writeln!(out, "  nb_check_start()")?;
    for phase in &phases {
        writeln!(out, "  {}()", function(*phase))?;
    }
    writeln!(
        out,
        "  popup(\"The guide is at the planned insertion pose. The retreat is not included in this \
         program.\", title=\"At the needle\", blocking=True)\n  halt"
    )?;
    write_path(out, motion, moves, period_s)?;
    writeln!(out, "end")
}

fn write_move(out: &mut String, number: usize, each: &Move, period_s: f64) -> std::fmt::Result {
    let phase = each.piece.phase.name();
    let duration_s = each.kind.duration_s(period_s);
    match &each.kind {
        Kind::Straight {
            leading,
            speed_rad_s,
            acceleration_rad_s2,
            ..
        } => {
            let leads = JOINT_LABELS[*leading];
            writeln!(
                out,
                "    # Move {number}, {phase}: a straight joint path, {leads} leads; about {duration_s:.3} s."
            )?;
            writeln!(
                out,
                "    movej({}, a={acceleration_rad_s2:.6}, v={speed_rad_s:.6})",
                joints(&each.end, DECIMALS)
            )
        }
        Kind::Stream { set_points } => {
            writeln!(
                out,
                "    # Move {number}, {phase}: {} set-points, one every {:.0} ms; {duration_s:.3} s.",
                set_points.len(),
                period_s * 1e3
            )?;
            // The arm catches up with the last one.
            let held = set_points.last().map(|last| (last, SETTLE_S));
            for (q, time_s) in set_points.iter().map(|q| (q, period_s)).chain(held) {
                writeln!(
                    out,
                    "    servoj({}, 0, 0, {time_s}, {LOOKAHEAD_S}, {GAIN})",
                    joints(q, DECIMALS)
                )?;
            }
            writeln!(out, "    stopj({STOP_RAD_S2:.1})")
        }
    }
}

fn head(motion: &Motion<'_>, moves: &[Move], period_s: f64) -> String {
    let resolved = motion.resolved;
    let tool = &resolved.cell.tool;
    let degrees = |q: &Joints| {
        let all: Vec<String> = q
            .iter()
            .map(|rad| format!("{:.2}", rad.to_degrees()))
            .collect();
        all.join(", ")
    };
    let at_start_deg = AT_START_RAD.to_degrees();
    let origin = motion.origin().into_iter();
    let origin: Vec<String> = origin
        .map(|(name, value)| format!("  {name}: {}", plain(&value)))
        .collect();
    let origin = origin.join("\n");
    let stray_m = moves.iter().map(|each| each.stray_m).fold(0.0, f64::max);
    let proven = motion.proven_in_words(stray_m);
    let proven: Vec<String> = proven
        .iter()
        .map(|line| format!("  {}", plain(line)))
        .collect();
    let proven = proven.join("\n");
    let total_s: f64 = moves
        .iter()
        .map(|each| each.kind.duration_s(period_s) + each.kind.settle_s())
        .sum();
    // Not "-0".
    let in_mm = |of: nalgebra::Vector3<f64>| of.map(|metres| (metres * 1e6).round() / 1e3 + 0.0);
    let [x, y, z]: [f64; 3] = in_mm(tool.body.com_m).into();
    let exit_mm = in_mm(tool.flange_from_guide_exit.translation.vector);
    let (mut speed, mut acceleration) = ([0.0_f64; JOINT_COUNT], [0.0_f64; JOINT_COUNT]);
    for joint in 0..JOINT_COUNT {
        speed[joint] = resolved.motion.velocity[joint];
        acceleration[joint] = resolved.motion.acceleration[joint];
    }
    format!(
        "Motion of a {arm} that brings a needle guide to the insertion pose.\n\
         NEVER RUN ON A ROBOT: {NEVER_RUN}.\n\
         {origin}\n\
         \n\
         READ THIS BEFORE YOU RUN IT\n\
         - It accounts for the scenario's cell only: compare the scenario with the real room, the\n\
         \x20 patient, cables, hoses, people and the floor first. Never use it with a patient: not a medical device.\n\
         - First run: speed slider at 10 %, all people out of reach, a hand at the emergency stop.\n\
         - It starts at the start posture, met to {at_start_deg:.0} deg, and goes slowly to it first.\n\
         - Payload and TCP are set by this program. Afterwards reload your installation.\n\
         - movej without blending follows the straight joint path that was planned, under the controller's own\n\
         \x20 profile. servoj is given the planned joint positions; the arm lags behind them and smooths them: how\n\
         \x20 far it strays from the path by that is not known here. Each stream holds its last set-point for\n\
         \x20 {SETTLE_S} s, for the arm to catch up.\n\
         - It ends at the insertion pose. The retreat is not included.\n\
         \n\
         Payload: {mass:.4} kg, centre at ({x:.2}, {y:.2}, {z:.2}) mm from the flange.\n\
         TCP: exit of the guide, ({tx:.3}, {ty:.3}, {tz:.3}) mm from the flange.\n\
         Start posture (deg): {start}\n\
         Limits of joint speed (deg/s): {speed}\n\
         Limits of joint acceleration (deg/s^2): {acceleration}\n\
         Takes about {total_s:.2} s at 100 %.\n\
         Certified minimum clearance of the nominal arm and tool along the path, at any speed, minus the\n\
         {stray_um:.2} um that the program strays from the planned path at most:\n\
         {proven}\n\
         The expected path of the guide exit is at the end of the program.",
        arm = motion.resolved.robot_description.arm_name,
        mass = tool.body.mass_kg,
        tx = exit_mm.x,
        ty = exit_mm.y,
        tz = exit_mm.z,
        start = degrees(&resolved.start),
        speed = degrees(&Joints::from(speed)),
        acceleration = degrees(&Joints::from(acceleration)),
        stray_um = stray_m * 1e6,
    )
}

/// The path of the guide's exit as comments.
fn write_path(
    out: &mut String,
    motion: &Motion<'_>,
    moves: &[Move],
    period_s: f64,
) -> std::fmt::Result {
    writeln!(
        out,
        "\n  # Expected path of the guide's exit in the controller's base frame (m), of the nominal arm. Of a movej by the\n  \
         # share of its way that is done, of a servoj by the number of its set-points that are reached."
    )?;
    let trajectory = motion.trajectory;
    for (number, each) in (1..).zip(moves) {
        let Piece { start_s, end_s, .. } = each.piece;
        let from = trajectory.sample(start_s).position;
        let mut place = |at: f64, q: &Joints| {
            let exit = motion.base_from_guide_exit(q).translation.vector;
            writeln!(
                out,
                "  # path {number} {at} {:.9} {:.9} {:.9}",
                exit.x, exit.y, exit.z
            )
        };
        let last = PLACES - 1;
        match &each.kind {
            Kind::Straight { .. } => {
                for k in 0..PLACES {
                    let share = f64::from(k) / f64::from(last);
                    place(share, &(from + (each.end - from) * share))?;
                }
            }
            Kind::Stream { set_points } => {
                let count = set_points.len();
                let mut done: Vec<usize> = (0..PLACES as usize)
                    .map(|k| k * count / last as usize)
                    .collect();
                done.dedup();
                for reached in done {
                    // From the plan, not from what is written.
                    let time_s = (start_s + reached as f64 * period_s).min(end_s);
                    place(reached as f64, &trajectory.sample(time_s).position)?;
                }
            }
        }
    }
    Ok(())
}
