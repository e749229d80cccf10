//! A run that excites every joint as a URScript program.

use std::fmt::Write;

use needlebench_bench::record_plan::PlanReport;
use needlebench_cell::ResolvedScenario;
use needlebench_cell::excitation::ExcitationProtocol;
use needlebench_evaluation::excitation::proven_m;
use needlebench_planning::excitation::{Aim, ExcitationPlan};

use super::{AT_START_RAD, joints, set_payload, write_check_start, write_head};

/// Decimals of joint positions.
const DECIMALS: usize = 6;

/// The program. Motions are `movej` without blending along the same straight joint paths, with the same speeds and
/// accelerations of the leading joint.
pub fn excitation_script(
    resolved: &ResolvedScenario,
    protocol: &ExcitationProtocol,
    plan: &ExcitationPlan,
    report: &PlanReport,
) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_script(&mut out, resolved, protocol, plan, report);
    out
}

fn write_script(
    out: &mut String,
    resolved: &ResolvedScenario,
    protocol: &ExcitationProtocol,
    plan: &ExcitationPlan,
    report: &PlanReport,
) -> std::fmt::Result {
    let start_deg: Vec<String> = resolved
        .start
        .iter()
        .map(|rad| format!("{:.2}", rad.to_degrees()))
        .collect();
    let [surroundings, itself] = proven_m(&report.planned);
    let proven = |value: Option<f64>| {
        value.map_or("nothing to come near to".to_owned(), |metres| {
            format!("{:.1} mm", metres * 1e3)
        })
    };
    let head = format!(
        "Excitation run for a {arm}: {postures} postures, sweeps of single joints, {loads} payloads.\n\
         Made by needlebench from {name}, seed {seed}. About {minutes:.1} min with each payload.\n\
         \n\
         READ THIS BEFORE YOU RUN IT\n\
         - It moves every joint far. It knows the cell of the scenario and nothing else: compare the\n\
         \x20 scenario with the real room, cables, hoses, people and the floor first.\n\
         - Proven least clearance of arm, tool and payload: {surroundings} from what the scenario has,\n\
         \x20 {itself} from the arm itself. It holds for the nominal arm, for a start posture that is\n\
         \x20 met to {at_start_deg:.0} deg, and for no tool or payload but those of the scenario.\n\
         - First run: speed slider at 10 %, nobody within reach, a hand at the emergency stop.\n\
         - Then at 100 %: what is logged with the slider lower is not what was planned.\n\
         - Payload and TCP are set by this program. Afterwards load your installation again.\n\
         - The path of movej without blending is the straight joint path that was certified; its profile\n\
         \x20 is the controller's own, with the speeds and accelerations that are given here.\n\
         \n\
         Start posture (deg): {start}\n\
         Record meanwhile with UR's RTDE recorder, at 125 Hz or more: timestamp, target_q, target_qd,\n\
         target_qdd, target_current, target_moment, actual_q, actual_qd, actual_current,\n\
         actual_TCP_pose, target_TCP_pose, joint_temperatures, robot_mode, joint_mode, safety_mode,\n\
         speed_scaling, payload, payload_cog.",
        arm = report.arm,
        postures = report.postures,
        loads = report.payloads_kg.len(),
        name = report.scenario,
        seed = report.seed,
        minutes = report.duration_s / 60.0,
        surroundings = proven(surroundings),
        itself = proven(itself),
        at_start_deg = AT_START_RAD.to_degrees(),
        start = start_deg.join(", "),
    );
    writeln!(out, "def needlebench_excitation():")?;
    write_head(out, &head)?;
    write_check_start(out, &joints(&resolved.start, DECIMALS))?;
    writeln!(out, "\n  def nb_run():")?;
    let acceleration = resolved.motion.acceleration.min();
    for leg in &plan.legs {
        if let Aim::Posture(_) | Aim::Start | Aim::Turn { .. } = leg.aim {
            writeln!(out, "    # {}", leg.aim.in_words())?;
        }
        writeln!(
            out,
            "    movej({}, a={acceleration:.4}, v={:.4})",
            joints(&leg.to, DECIMALS),
            leg.speed_rad_s
        )?;
        writeln!(out, "    sleep({:?})", leg.stand_s)?;
    }
    writeln!(out, "  end\n")?;
    writeln!(out, "  # The log is of the flange.")?;
    writeln!(out, "  set_tcp(p[0, 0, 0, 0, 0, 0])")?;
    for (index, load) in protocol.loads.iter().enumerate() {
        let number = index + 1;
        let whole = load.with_tool(&resolved.cell.tool);
        let mounted = if load.body.mass_kg > 0.0 {
            let [x, y, z]: [f64; 3] = (load.body.com_m * 1e3).into();
            format!(
                "Mount {} kg besides the tool, centre at ({x:.0}, {y:.0}, {z:.0}) mm from the flange.",
                load.body.mass_kg
            )
        } else {
            "Mount the tool alone.".to_owned()
        };
        writeln!(out, "\n  # Payload {number}.")?;
        writeln!(
            out,
            "  popup(\"{mounted} Everybody out of reach, hand at the emergency stop. Continue starts the \
             run.\", title=\"Payload {number} of {}\", warning=True, blocking=True)",
            protocol.loads.len()
        )?;
        writeln!(out, "  {}", set_payload(&whole))?;
        writeln!(out, "  nb_check_start()")?;
        writeln!(out, "  nb_run()")?;
    }
    writeln!(out, "\n  halt")?;
    writeln!(out, "end")
}
