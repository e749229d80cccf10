//! Which tests of the program hold what against a closed form or against another program.

use serde::Serialize;

/// A test and what it shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct VerifyingTest {
    /// What is computed.
    pub quantity: &'static str,
    /// What it is compared with.
    pub against: &'static str,
    /// File of the test, from the top of the source tree.
    pub file: &'static str,
    /// Its name.
    pub test: &'static str,
}

const fn test(
    quantity: &'static str,
    against: &'static str,
    file: &'static str,
    test: &'static str,
) -> VerifyingTest {
    VerifyingTest {
        quantity,
        against,
        file,
        test,
    }
}

/// The tests, by what they are of. They are run before every change of the program, and not by a run.
pub(crate) const VERIFYING_TESTS: [VerifyingTest; 16] = [
    test(
        "free motion in both engines and the reference integrator",
        "the pendulum in elliptic functions",
        "tests/benchmarks/free_motion.rs",
        "a_pendulum_swings_as_the_elliptic_functions_say",
    ),
    test(
        "gravity in both engines and the reference integrator",
        "free fall",
        "tests/benchmarks/free_motion.rs",
        "a_ball_on_a_long_lever_falls_freely",
    ),
    test(
        "servo in both engines and the reference integrator",
        "the closed form of the sampled loop",
        "tests/benchmarks/servo_step.rs",
        "a_servo_step_is_the_closed_form_of_its_sampling",
    ),
    test(
        "force of a resting contact",
        "equilibrium of weight and load",
        "tests/benchmarks/contact.rs",
        "a_resting_ball_is_borne_by_its_weight_and_what_presses_it",
    ),
    test(
        "sliding contact",
        "motion without friction",
        "tests/benchmarks/contact.rs",
        "a_ball_slides_over_a_smooth_table_as_through_nothing",
    ),
    test(
        "loader, forward kinematics, mass matrix, gravity, inverse dynamics",
        "Pinocchio",
        "tests/validation/dynamics/mod.rs",
        "loader_and_dynamics_agree_with_pinocchio",
    ),
    test(
        "poses of the engines' bodies",
        "forward kinematics",
        "tests/validation/engines/mod.rs",
        "engine_bodies_are_where_forward_kinematics_puts_them",
    ),
    test(
        "holding torque in the engines",
        "analytic inverse dynamics",
        "tests/validation/engines/mod.rs",
        "gravity_torque_holds_arm_and_tool_still",
    ),
    test(
        "motions of the bundled scenarios",
        "each other (rapier and MuJoCo)",
        "tests/validation/engines/mod.rs",
        "engines_agree_along_every_planned_motion",
    ),
    test(
        "inverse kinematics",
        "the postures that generated the poses, at twice the precision",
        "tests/validation/inverse/mod.rs",
        "every_posture_of_a_fresh_pose_has_a_row_and_every_row_is_right",
    ),
    test(
        "registration",
        "Kabsch's solution by singular values",
        "crates/kinematics/src/registration_tests.rs",
        "registration_equals_kabsch_by_singular_values",
    ),
    test(
        "registration error",
        "Fitzpatrick and West's closed form",
        "crates/kinematics/src/registration_tests.rs",
        "simulated_error_is_that_of_the_closed_form",
    ),
    test(
        "bounds on pairs that cannot collide",
        "random postures",
        "crates/clearance/tests/clearance/pairs.rs",
        "random_postures_do_not_refute_what_is_proven",
    ),
    test(
        "errors of the needle tip and axis",
        "closed forms of a shifted and a tilted guide",
        "crates/evaluation/tests/evaluation/measurements.rs",
        "a_tilt_about_the_exit_grows_with_the_insertion",
    ),
    test(
        "needle angles in two planes",
        "rotations about the planes' normals",
        "crates/evaluation/tests/evaluation/measurements.rs",
        "a_turn_about_the_normal_of_a_plane_shows_in_that_plane_as_it_is",
    ),
    test(
        "known deviations of the engines",
        "the law of each",
        "tests/benchmarks/deviations.rs",
        "every_known_deviation_has_its_test",
    ),
];

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn every_test_that_is_named_exists() {
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        for each in VERIFYING_TESTS {
            let text = std::fs::read_to_string(top.join(each.file));
            let text = text.unwrap_or_else(|error| panic!("{}: {error}", each.file));
            let lines: Vec<&str> = text.lines().map(str::trim).collect();
            let at = lines
                .iter()
                .position(|line| *line == format!("fn {}() {{", each.test));
            let at = at.unwrap_or_else(|| panic!("{} has no {}", each.file, each.test));
            let before = &lines[at.saturating_sub(4)..at];
            assert!(before.contains(&"#[test]"), "{} is no test", each.test);
            let is_left_out = before.iter().any(|line| line.starts_with("#[ignore"));
            assert!(!is_left_out, "{} is not run", each.test);
        }
    }
}
