//! What is not evaluated, and where.

use needlebench_urscript::{Installation, evaluate, parse};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::test_arm::{TestArm, check_error, done};

#[test]
fn what_depends_on_more_than_constants_is_refused_with_its_place() {
    for (text, line, column, part) in [
        (
            "movej([0,0,0,0,0,0])\nq = get_actual_joint_positions()",
            2,
            5,
            "measured state",
        ),
        ("x = get_tcp_force()", 1, 5, "measured state"),
        ("while not is_steady(): sync() end", 1, 11, "measured state"),
        ("if get_standard_digital_in(0): sleep(1) end", 1, 4, "input"),
        ("x = read_input_float_register(0)", 1, 5, "input"),
        ("socket_open(\"10.0.0.1\", 50001)", 1, 1, "another device"),
        ("s = rpc_factory(\"xmlrpc\", \"a\")", 1, 5, "another device"),
        (
            "thread t(): movej([0,0,0,0,0,0]) end\nrun t()",
            2,
            1,
            "starts a thread",
        ),
        (
            "x = 0\nthread t(): while True: x = x + 1 sync() end end\nrun t()\nsleep(x)",
            3,
            1,
            "starts a thread",
        ),
        (
            "force_mode(p[0,0,0,0,0,0], [1], [1], 2, [1])",
            1,
            1,
            "by forces",
        ),
        ("freedrive_mode()", 1, 1, "by forces"),
        (
            "speedl([0,0,0.1,0,0,0], 0.5)",
            1,
            1,
            "until something stops it",
        ),
        ("x = random()", 1, 5, "random"),
        ("servoc(p[0,0,0,0,0,0])", 1, 1, "only the controller knows"),
        (
            "x = request_boolean_from_primary_client(\"a\")",
            1,
            5,
            "person",
        ),
        ("protective_stop()", 1, 1, "safety"),
        ("x = struct(a = 1)", 1, 5, "not evaluated"),
        (
            "track_conveyor_linear(p[1,0,0,0,0,0], 500)",
            1,
            1,
            "conveyor",
        ),
        ("join 3", 1, 1, "waits for a thread"),
        (
            "set_tcp(p[0,0,0,0,0,0])\nmovec(p[0,0,0,0,0,0], p[0,0,1,0,0,0], mode = 1)",
            2,
            1,
            "in that mode",
        ),
    ] {
        let error = done(text).expect_err(text);
        check_error(&error, (line, column), part, text);
        assert!(
            error.message.ends_with("only fixed arguments are judged"),
            "{error}"
        );
        assert!(
            error
                .hint
                .as_deref()
                .is_some_and(|hint| hint.contains("RTDE log")),
            "{error:?}"
        );
    }
}

#[test]
fn mistakes_are_said_with_their_place() {
    for (text, line, column, part) in [
        (
            "movejj([0,0,0,0,0,0])",
            1,
            1,
            "nothing has the name `movejj`",
        ),
        (
            "if False:\n  x = undefined_name\nend",
            2,
            7,
            "nothing has the name `undefined_name`",
        ),
        ("x = true", 1, 5, "nothing has the name `true`"),
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
        (
            "set_tcp(p[0,0,0,0,0,0])\nmovej([0,-1,1,0,0,0], r = 0.1)\nq = get_target_joint_positions()",
            3,
            5,
            "blend",
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
        ("x = movej", 1, 5, "nothing has the name `movej`"),
        ("sleep(-1)", 1, 1, "at least 0"),
        ("x = p[1, 2, 3, 4, 5, True]", 1, 22, "in a pose"),
    ] {
        let error = done(text).expect_err(text);
        check_error(&error, (line, column), part, text);
    }
}

#[test]
fn programs_that_take_too_much_are_ended() {
    for (text, part) in [
        ("while True: x = 1 end", "steps"),
        ("def f(n): return f(n + 1) end x = f(0)", "levels deep"),
        (
            "s = \"aaaaaaaa\" while True: s = str_cat(s, s) end",
            "characters",
        ),
        ("a = [1] while True: a = [a] end", "levels deep"),
        (
            "a = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1] b = [a, a, a, a, a, a, a, a, a, a] \
             c = [b, b, b, b, b, b, b, b, b, b] d = [c, c, c, c, c, c, c, c, c, c]",
            "elements",
        ),
        (
            "a = [1, 1, 1, 1] while True: b = a b[0] = 2 a = b * 1 end",
            "steps",
        ),
    ] {
        let error = done(text).expect_err(text);
        assert!(error.message.contains(part), "{text}: {error}");
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
        assert!(done(&text).is_ok(), "{name}");
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
        if let Ok(program) = parse(&text) {
            let installation = Installation { flange_from_tcp: Some(needlebench_kinematics::Pose::identity()) };
            let _ = evaluate(&program, &mut TestArm::new(), &installation);
        }
    }
}
