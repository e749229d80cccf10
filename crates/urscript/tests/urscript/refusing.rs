//! What is an error, and where.

use needlebench_kinematics::Pose;
use needlebench_urscript::Program;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::test_arm::check_error;
use crate::test_host::{TestHost, done};

#[test]
fn what_is_known_and_not_simulated_is_an_exception_with_its_place() {
    for (text, line, column, part) in [
        (
            "x = 1\ns = rpc_factory(\"xmlrpc\", \"a\")",
            2,
            5,
            "another device",
        ),
        (
            "force_mode(p[0,0,0,0,0,0], [1], [1], 2, [1])",
            1,
            1,
            "by forces",
        ),
        ("freedrive_mode()", 1, 1, "by forces"),
        ("x = random()", 1, 5, "random"),
        (
            "x = request_boolean_from_primary_client(\"a\")",
            1,
            5,
            "person",
        ),
        ("x = get_jacobian()", 1, 5, "it is not simulated"),
        (
            "track_conveyor_linear(p[1,0,0,0,0,0], 500)",
            1,
            1,
            "conveyor",
        ),
        (
            "set_tcp(p[0,0,0,0,0,0])\nmovec(p[0,0,0,0,0,0], p[0,0,1,0,0,0], mode = 1)",
            2,
            1,
            "in that mode",
        ),
    ] {
        let Err(error) = done(text, None) else {
            panic!("{text}");
        };
        check_error(&error, (line, column), part, text);
        assert!(error.message.ends_with("not simulated"), "{error}");
    }
}

#[test]
fn mistakes_are_said_with_their_place() {
    for (text, line, column, part) in [
        (
            "movejj([0,0,0,0,0,0])",
            1,
            1,
            "compile_error_name_not_found:movejj:",
        ),
        (
            "if False:\n  x = undefined_name\nend",
            2,
            7,
            "compile_error_name_not_found:undefined_name:",
        ),
        ("x = true", 1, 5, "compile_error_name_not_found:true:"),
        ("x = y\ny = 2", 1, 5, "`y` has no value here"),
        ("movej([0,0,0,0,0])", 1, 1, "list of 6 joint positions"),
        ("movej([0,0,0,0,0,0], v = 0)", 1, 1, "v is 0"),
        ("movej([0,0,0,0,0,0], q = 2)", 1, 1, "given twice"),
        ("movej([0,0,0,0,0,0], b = 2)", 1, 26, "no parameter `b`"),
        ("movej()", 1, 1, "`q` is missing"),
        ("sleep(1, 2)", 1, 10, "takes 1 argument at most"),
        ("movel(p[0.3, 0, 0.3, 0, 0, 0])", 1, 1, "sets no TCP"),
        ("movej([0,0,0,0,0,0], r = 0.01)", 1, 1, "sets no TCP"),
        (
            "set_tcp(p[0,0,0,0,0,0])\nmovej(p[9, 9, 9, 0, 0, 0])",
            2,
            1,
            "no joint positions",
        ),
        ("x = 1 / 0", 1, 7, "divided by 0"),
        ("x = -1 % 2", 1, 8, "remainder"),
        ("x = sqrt(-1)", 1, 5, "no finite number"),
        ("x = pow(10, 400)", 1, 5, "no finite number"),
        ("x = [1, 2][2]", 1, 12, "no element 2 of 2"),
        ("x = [1, 2][0.5]", 1, 12, "no index"),
        ("x = 1 + \"a\"", 1, 7, "between a number and a string"),
        ("x = [1] + [1, 2]", 1, 9, "lists of 1 and 2"),
        ("x = 1 == True", 1, 7, "between a number and a truth value"),
        ("if 1: sleep(1) end", 1, 4, "no truth value"),
        ("x = sleep(1)", 1, 5, "gives nothing"),
        ("def f(a): end f()", 1, 15, "`a` is missing"),
        ("def f(): end def g(): end", 1, 14, "second function"),
        (
            "def f(): sleep(1) end sleep(2)",
            1,
            1,
            "none of them calls it",
        ),
        ("def f(): end def f(): end f()", 1, 14, "defined twice"),
        ("", 1, 1, "does nothing"),
        ("thread t(): end", 1, 1, "does nothing"),
        ("x = movej", 1, 5, "compile_error_name_not_found:movej:"),
        ("sleep(-1)", 1, 1, "at least 0"),
        ("x = p[1, 2, 3, 4, 5, True]", 1, 5, "in a pose"),
    ] {
        let Err(error) = done(text, None) else {
            panic!("{text}");
        };
        check_error(&error, (line, column), part, text);
    }
}

#[test]
fn every_built_in_of_the_manual_is_known() {
    // None of these is `nothing has the name`: programs are checked as a whole before anything is done.
    for name in [
        "get_freedrive_status",
        "get_target_waypoint",
        "servoc",
        "movec",
        "optimovej",
        "direct_torque",
        "modbus_add_signal",
        "set_tool_communication",
        "screw_driving",
        "path_offset_set",
        "interpreter_mode",
        "inv",
        "transpose",
        "size",
        "integer_to_binary_list",
        "get_actual_joint_positions_history",
        "zero_ftsensor",
        "tool_contact",
        "write_output_integer_register",
        "read_output_boolean_register",
        "set_analog_out",
        "get_configurable_digital_out",
    ] {
        let text = format!("if False: {name}() end sleep(1)");
        let error = Program::load(&text).err().map(|error| error.message);
        let is_unknown = error.is_some_and(|message| message.contains("not_found"));
        assert!(!is_unknown, "{name}");
    }
}

/// Words of programs that run far.
fn salad() -> impl Strategy<Value = String> {
    let words = prop::sample::select(vec![
        "x = 1",
        "y = x",
        "x = [1, 2, 3, 4, 5, 6]",
        "x[0] = y",
        "movej(x)",
        "movel(x)",
        "y = p[0.3, 0, 0.2, 0, 3, 0]",
        "set_tcp(y)",
        "sleep(x)",
        "if x == y:",
        "while x < 3:",
        "end",
        "else:",
        "x = x + 1",
        "y = pose_trans(y, y)",
        "y = get_inverse_kin(y)",
        "def f(x):",
        "return x",
        "f(y)",
        "x = f(x)",
        "halt",
        "break",
        "x = x * x",
        "servoj(x)",
        "x = to_str(x)",
        "y = length(x)",
        "x = [x, y]",
        "textmsg(x)",
        "x = -x",
        "stopj(1)",
        "y = x[y]",
        "movej(y, r = 0.1)",
    ]);
    prop::collection::vec(words, 0..30).prop_map(|words| words.join("\n"))
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000, failure_persistence: None, rng_seed: RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_program_panics(text in salad()) {
        let text = format!("x = 2 y = 3\n{text}");
        if Program::load(&text).is_ok() {
            let mut host = TestHost::new();
            host.belief.flange_from_tcp = Some(Pose::identity());
            host.run(&text, 300);
        }
    }
}
