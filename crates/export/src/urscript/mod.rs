//! Programs in URScript, the language of the controllers of UR arms.
//!
//! What all programs have in common stands here: how numbers are written, what a person reads first, and that nothing
//! moves before the arm is found at its start posture.

mod excitation;
mod motion;

pub use excitation::excitation_script;
pub use motion::motion_script;

use std::fmt::Write;

use needlebench_kinematics::{Body, Joints};

/// How far a joint may be from the start posture for the program to begin, rad: 1 deg, which moves no part of the arm by
/// more than about the clearance that the start posture has. It goes slowly to the start posture first.
const AT_START_RAD: f64 = 0.017;

/// Comments at the top of a program.
fn write_head(out: &mut String, head: &str) -> std::fmt::Result {
    for line in head.lines() {
        writeln!(out, "{}", format!("  # {line}").trim_end())?;
    }
    Ok(())
}

/// The function `nb_check_start`, which ends the program unless the arm is at its start posture.
fn write_check_start(out: &mut String, start: &str) -> std::fmt::Result {
    writeln!(out, "\n  global nb_start = {start}")?;
    write!(
        out,
        "\n  def nb_check_start():\n    \
             local q = get_actual_joint_positions()\n    \
             local i = 0\n    \
             while i < 6:\n      \
               if norm(q[i] - nb_start[i]) > {AT_START_RAD}:\n        \
                 popup(\"Move the arm to the start posture that stands in the program, turns of the wrist \
         included, and start again.\", title=\"Not at the start posture\", error=True, blocking=True)\n        \
                 halt\n      \
               end\n      \
               i = i + 1\n    \
             end\n    \
             # Slowly to the very start posture.\n    \
             movej(nb_start, a=0.5, v=0.1)\n  \
           end\n"
    )
}

/// What the flange carries.
fn set_payload(body: &Body) -> String {
    format!(
        "set_payload({:.4}, [{:.5}, {:.5}, {:.5}])",
        body.mass_kg, body.com_m.x, body.com_m.y, body.com_m.z
    )
}

/// Joint positions, rad.
fn joints(q: &Joints, decimals: usize) -> String {
    let texts: Vec<String> = q.iter().map(|rad| format!("{rad:.decimals$}")).collect();
    format!("[{}]", texts.join(", "))
}

/// A text of users as comments and strings of a program can hold it: a line of ASCII without quotes.
fn plain(text: &str) -> String {
    let keep = |letter: char| (' '..='~').contains(&letter) && !"\"\\".contains(letter);
    text.chars()
        .map(|letter| if keep(letter) { letter } else { '_' })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_users_end_no_comment_and_no_string() {
        assert_eq!(plain("a\"b\\c\nd\u{e9}"), "a_b_c_d_");
    }
}
