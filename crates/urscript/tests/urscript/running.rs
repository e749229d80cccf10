//! What programs do in time.

use needlebench_urscript::{
    Bank, End, LONGEST_BUSY_S, MOST_INSTRUCTIONS, MOST_THREADS, Program, Progress, Run, Signal,
};

use crate::test_host::TestHost;

/// Cycles in which every program of the tables ends.
const MOST_CYCLES: u32 = 200;

fn trace(text: &str) -> (Vec<String>, Option<End>) {
    let mut host = TestHost::new();
    let end = host.run(text, MOST_CYCLES);
    (host.trace, end)
}

/// What a program says, without the cycles.
fn said(text: &str) -> Vec<String> {
    let (trace, end) = trace(text);
    assert_eq!(end, Some(End::Finished), "{text}\n{trace:?}");
    let words = trace
        .iter()
        .map(|line| line.split_once(": ").unwrap().1.to_owned());
    words.collect()
}

/// Line, column and message of the exception that a program ends with.
fn exception(text: &str) -> (usize, usize, String) {
    match trace(text).1 {
        Some(End::Exception(error)) => (error.place.line, error.place.column, error.message),
        other => panic!("{other:?}\n{text}"),
    }
}

#[test]
fn calls_reach_the_host_in_the_cycles_that_the_language_says() {
    let q = "[0.5, -1.4, 1.1, -1.3, -1.4, 0.3]";
    for (text, expected) in [
        // A move takes as long as the host says; what follows runs in the cycle after.
        (format!("movej({q})\ntextmsg(\"there\")"), "0: movej [0.50] line 1|5: there"),
        (
            format!("movej({q}, t = 0.02)\nmovel({q})\ntextmsg(get_actual_joint_positions()[0])"),
            "0: movej [0.50] line 1|10: movel [0.50] line 2|15: 0.5",
        ),
        // `servoj` takes its time, a cycle if it says none.
        (
            format!("servoj({q}) servoj({q}, t = 0.008) servoj({q}) textmsg(1)"),
            "0: servoj [0.50] line 1|1: servoj [0.50] line 1|5: servoj [0.50] line 1|6: 1",
        ),
        (
            "speedj([0,0,0,0,0,0], 1, 0.006) stopj(2) textmsg(1)".to_owned(),
            "0: speedj [0.10] line 1|3: stop [0.10] line 1|5: 1",
        ),
        ("sync() sync() textmsg(1)".to_owned(), "2: 1"),
        ("sleep(0.006) textmsg(1) sleep(0.0061) textmsg(2)".to_owned(), "3: 1|7: 2"),
        ("sleep(0) textmsg(1) popup(\"a\") textmsg(2)".to_owned(), "0: 1|0: popup a|0: 2"),
        (
            "set_tcp(p[0,0,0.2,0,0,0]) textmsg(get_tcp_offset()) set_tcp(p[0,0,0.2,0,0,0])"
                .to_owned(),
            "0: belief|0: p[0, 0, 0.2, 0, 0, 0]",
        ),
        (
            "write_output_integer_register(3, 7) textmsg(read_output_integer_register(3) + 1)"
                .to_owned(),
            "0: OutputInteger[3] = Integer(7)|0: 8",
        ),
        (
            "set_digital_out(9, True) textmsg(get_configurable_digital_out(1))".to_owned(),
            "0: DigitalOutput[9] = Truth(true)|0: True",
        ),
        (
            "set_tool_digital_out(1, True) set_standard_analog_out(1, 0.5) set_flag(2, True)"
                .to_owned(),
            "0: DigitalOutput[17] = Truth(true)|0: AnalogOutput[1] = Number(0.5)|\
             0: Flag[2] = Truth(true)",
        ),
        (
            "zero_ftsensor() textmsg(force()) textmsg(is_steady())".to_owned(),
            "0: zero force|0: 5|0: True",
        ),
        (
            "i = 0 while i < 3: set_tool_voltage(0) i = i + 1 end".to_owned(),
            "0: not simulated: settings of the controller that are not simulated",
        ),
        (
            "rtde_set_watchdog(\"input_int_register_0\", 10, \"stop\")".to_owned(),
            "0: watchdog input_int_register_0 10 Hz stop",
        ),
        (
            "textmsg(socket_open(\"127.0.0.1\", 50000)) textmsg(socket_send_int(1))".to_owned(),
            "0: open socket_0 127.0.0.1:50000|0: False|0: False",
        ),
        (
            "textmsg(get_inverse_kin_has_solution(p[9, 9, 9, 0, 0, 0])) sync() textmsg(time().nanosec)"
                .to_owned(),
            "0: False|1: 2000000",
        ),
    ] {
        let (found, end) = trace(&text);
        assert_eq!(found.join("|"), expected, "{text}");
        assert_eq!(end, Some(End::Finished), "{text}");
    }
}

#[test]
fn kinematics_of_the_host_are_those_of_the_program() {
    let text = "q = get_actual_joint_positions() x = get_forward_kin(q) y = get_actual_tcp_pose() \
                textmsg(point_dist(x, y) < 1e-12) r = get_inverse_kin(x) textmsg(norm(r - q) < 1e-9)";
    assert_eq!(said(text), ["True", "True"]);
}

#[test]
fn names_and_values_are_those_of_the_language() {
    for (text, expected) in [
        // Line ends are white space: constants filled in with a line end each.
        (
            "global a = # of the line\n0    global b = # another\n 24\ntextmsg(a + b)",
            "24",
        ),
        // Indentation means nothing: the program ends where its nesting does.
        (
            "def p():\nif True:\ntextmsg(1)\nend\ntextmsg(2)\nend",
            "1|2",
        ),
        ("def p():\n  textmsg(1)\nend\np()", "1"),
        // At the first level of a program all names are global, `local` or not.
        (
            "def p():\n local a = 1\n def f(): return a end\n textmsg(f())\nend",
            "1",
        ),
        // A free name is the global one if there is any, else local, again in each nested function.
        (
            "def p(): def f(): x = 5 def g(): x = 7 return x end return g() * 100 + x end \
             textmsg(f()) end",
            "705",
        ),
        ("def p(): x = 1 def f(): x = 2 end f() textmsg(x) end", "2"),
        (
            "def p(): x = 1 def f(): local x = 2 return x end textmsg(f() * 10 + x) end",
            "21",
        ),
        ("def p(): def f(): global y = 3 end f() textmsg(y) end", "3"),
        // `p[` begins a pose, or an element of a variable of that name.
        (
            "def f(p): p[0] = p[0] * 2 return p end textmsg(f(p[1, 0, 0, 0, 0, 0]))",
            "p[2, 0, 0, 0, 0, 0]",
        ),
        // Lists, structs and poses are values.
        ("a = [1, 2] b = a b[0] = 7 textmsg(a[0], b[0])", "17"),
        (
            "def f(l): l[0] = 9 return l end a = [1, 2] b = f(a) textmsg(a[0], b[0])",
            "19",
        ),
        (
            "s = struct(x = 1, y = [1, 2]) t = s t.y[1] = 5 textmsg(s.y[1], t.y[1]) textmsg(t)",
            "25|struct(x=1, y=[1, 5])",
        ),
        (
            "m = [[1, 2], [3, 4]] m[1, 0] = 8 textmsg(m)",
            "[[1, 2], [8, 4]]",
        ),
        // Named and default arguments.
        (
            "def f(a, b = 10, c = a + b): return [a, b, c] end textmsg(f(1)) textmsg(f(1, c = 0)) \
             textmsg(f(c = 3, a = 2, b = 1))",
            "[1, 10, 11]|[1, 10, 0]|[2, 1, 3]",
        ),
        (
            "textmsg(.5 + 1, \" \") textmsg([1, 2] * 2 + [1, 1] / 2)",
            "1.5 |[2.5, 4.5]",
        ),
        (
            "textmsg(False and 1 / 0 == 1) textmsg(True or 1 / 0 == 1)",
            "False|True",
        ),
        (
            "i = 0 while True: i = i + 1 if i == 2: continue elif i == 4: break end textmsg(i) end",
            "1|3",
        ),
        (
            "def f(): return\n 1 end def g(): end f() g() textmsg(1)",
            "1",
        ),
        (
            "def fib(n): if n < 2: return n end return fib(n - 1) + fib(n - 2) end textmsg(fib(10))",
            "55",
        ),
        (
            "textmsg(transpose([[1, 2, 3]])) textmsg(inv([[2, 1], [0, 4]])[0]) textmsg(size([[1, 2, 3]]))",
            "[[1], [2], [3]]|[0.5, -0.125]|[1, 3]",
        ),
        (
            "textmsg([[1, 2], [3, 4]] * [[0, 1], [1, 0]]) textmsg([[1, 2], [3, 4]] * [1, 1])",
            "[[2, 1], [4, 3]]|[3, 7]",
        ),
        (
            "l = integer_to_binary_list(5) textmsg(l[0], l[1]) textmsg(binary_list_to_integer(l))",
            "TrueFalse|5",
        ),
        (
            "textmsg(binary_list_to_integer(integer_to_binary_list(-2)))",
            "-2",
        ),
        (
            "textmsg(str_sub(\"needle\", 1, 3), str_at(\"abc\", 2)) textmsg(str_find(\"abcb\", \"b\", 2))",
            "eedc|3",
        ),
        (
            "x = 3 if x > 2 and not x == 4: textmsg(\"a\") else: textmsg(\"b\") end $ 3 \"label\"\n",
            "a",
        ),
        ("textmsg(1)\nhalt_ = 2 textmsg(halt_)", "1|2"),
    ] {
        assert_eq!(said(text).join("|"), expected, "{text}");
    }
}

#[test]
fn threads_run_one_after_the_other_in_the_order_of_their_start() {
    let text = "def p():
  thread a():
    while True:
      textmsg(\"a\")
      sync()
    end
  end
  thread b():
    textmsg(\"b\")
  end
  h = run a()
  i = run b()
  textmsg(\"main \", h + i)
  join i
  textmsg(\"joined\")
  sync()
  kill h
  kill 0
  join 0
  join h
  sync()
  textmsg(\"end\")
end";
    let (found, end) = trace(text);
    let expected = "0: main 3|1: a|1: b|2: joined|2: a|4: end";
    // The main thread comes first: it ends `a` in cycle 3 before that runs.
    assert_eq!(found.join("|"), expected);
    assert_eq!(end, Some(End::Finished));
}

#[test]
fn a_thread_that_is_killed_takes_those_that_it_started_with_it() {
    let text = "thread outer(): thread inner(): while True: textmsg(\"in\") sync() end end \
                run inner() while True: sync() end end \
                h = run outer() sleep(0.008) kill h sleep(0.01) textmsg(\"end\")";
    assert_eq!(trace(text).0.join("|"), "2: in|3: in|9: end");
}

#[test]
fn threads_end_with_the_program() {
    let text = "thread t(): while True: textmsg(\"t\") sync() end end run t() sync() sync()";
    assert_eq!(trace(text).0.join("|"), "1: t");
}

#[test]
fn nobody_else_runs_in_a_critical_section_that_computes() {
    // Each pass takes more than a share of a cycle.
    let body = |lock: &str, unlock: &str| {
        format!(
            "n = 0 x = 0 thread t(): while True: x = x + 1 sync() end end run t() sync() sync() \
             {lock} before = x while n < 5000: n = n + 1 end seen = x - before {unlock} textmsg(seen)"
        )
    };
    let free: f64 = said(&body("", ""))[0].parse().unwrap();
    assert!(free > 2.0, "{free}");
    assert_eq!(said(&body("enter_critical", "exit_critical")), ["0"]);
    // One that waits lets the others run.
    let text = "x = 0 thread t(): while True: x = x + 1 sync() end end run t() sync() \
                enter_critical before = x sleep(0.01) seen = x - before exit_critical textmsg(seen)";
    assert_eq!(said(text), ["5"]);
}

#[test]
fn one_thread_at_a_time_moves_the_arm() {
    let q = "[0.5, -1.4, 1.1, -1.3, -1.4, 0.3]";
    let text = format!("thread t(): movej({q}) end run t() sync() sync() movej({q})");
    assert!(exception(&text).2.contains("another thread moves the arm"));
    // What it has begun goes on after its thread is killed, until something else is begun.
    let text = format!("thread t(): movej({q}) end h = run t() sync() sync() kill h stopj(2)");
    assert_eq!(
        trace(&text).0.join("|"),
        "1: movej [0.50] line 1|2: stop [0.10] line 1"
    );
}

#[test]
fn a_secondary_program_runs_beside_and_may_not_move() {
    let program =
        Program::load("sec s():\n set_digital_out(1, True)\n sync()\n textmsg(1)\nend").unwrap();
    assert!(program.is_secondary());
    assert_eq!(program.name(), "s");
    let main = Program::load("def main():\n while True:\n sync()\n end\nend").unwrap();
    assert!(!main.is_secondary());
    let (mut main, mut beside) = (Run::new(main), Run::new(program));
    let mut host = TestHost::new();
    assert_eq!(host.step(&mut main), Progress::Running);
    assert_eq!(host.step(&mut beside), Progress::Running);
    assert_eq!(host.step(&mut beside), Progress::Ended(End::Finished));
    assert_eq!(host.step(&mut main), Progress::Running);
    for text in [
        "sec s():\n movej([0, -1, 1, 0, 0, 0])\nend",
        "sec s():\n movej([0, -1, 1, 0, 0, 0])\nend\ns()",
        "sec s():\n thread t(): movej([0, -1, 1, 0, 0, 0]) end\n h = run t()\n join h\nend",
        "def p(): sleep(1) end\nsec s():\n movej([0, -1, 1, 0, 0, 0])\nend",
    ] {
        let (line, _, message) = exception(text);
        assert!(message.contains("may not move") && line > 1, "{message}");
    }
}

#[test]
fn mistakes_are_found_at_load_with_their_place() {
    for (text, line, column, part) in [
        (
            "def p():\n  foo()\nend",
            2,
            3,
            "compile_error_name_not_found:foo:",
        ),
        (
            "x = 1\ny = x + zz",
            2,
            9,
            "compile_error_name_not_found:zz:",
        ),
        (
            "if False:\n  movejj([0])\nend",
            2,
            3,
            "compile_error_name_not_found:movejj:",
        ),
        // Of a function that is known elsewhere.
        (
            "def f(): def g(): end end def p(): g() end p()",
            1,
            36,
            "compile_error_name_not_found:g:",
        ),
        ("run f()", 1, 1, "compile_error_name_not_found:f:"),
        ("movej()", 1, 1, "`q` is missing"),
        (
            "movej([0], 1, 2, 3, 4, 5)",
            1,
            24,
            "takes 5 arguments at most",
        ),
        ("movej([0], b = 2)", 1, 16, "no parameter `b`"),
        ("sleep(1, t = 2)", 1, 1, "given twice"),
        ("def f(a): end f()", 1, 15, "`a` is missing"),
        ("def f(a): end f(1, 2)", 1, 20, "takes 1 argument at most"),
        ("thread t(): end t()", 1, 17, "is a thread"),
        ("def f(): end f() run f()", 1, 18, "is no thread"),
        ("sec s(): end def p(): s() end", 1, 23, "beside the program"),
        ("break", 1, 1, "outside a loop"),
        (
            "while True: def f(): continue end end",
            1,
            22,
            "outside a loop",
        ),
        ("x = struct(1)", 1, 12, "members of a struct have names"),
        ("", 1, 1, "does nothing"),
        ("def p():\n x = (1\nend", 3, 1, "missing before `end`"),
    ] {
        let error = Program::load(text).expect_err(text);
        assert_eq!(
            (error.place.line, error.place.column),
            (line, column),
            "{text}: {error}"
        );
        assert!(error.message.contains(part), "{text}: {error}");
    }
}

#[test]
fn exceptions_have_line_and_column() {
    for (text, line, column, part) in [
        (
            "x = 1\nif x == 1:\n  y = [1, 2][x + 1]\nend",
            3,
            16,
            "no element 2 of 2",
        ),
        ("sync()\nx = 1 / 0", 2, 7, "divided by 0"),
        ("x = y\ny = 2", 1, 5, "`y` has no value here"),
        ("global x\ny = x", 2, 5, "`x` has no value here"),
        ("if 1: sync() end", 1, 4, "no truth value"),
        ("x = sync()", 1, 5, "gives nothing"),
        ("def f(): end x = f()", 1, 18, "gives nothing"),
        (
            "x = force_mode(p[0,0,0,0,0,0], [1], [1], 2, [1])",
            1,
            5,
            "not simulated",
        ),
        ("s = rpc_factory(\"xmlrpc\", \"a\")", 1, 5, "not simulated"),
        ("s = struct(a = 1)\ns.read()", 2, 2, "remote program"),
        ("s = struct(a = 1) x = s.b", 1, 24, "no member `b`"),
        ("x = 1 x.a = 2", 1, 7, "a number has no member `a`"),
        ("x[0] = 2", 1, 1, "`x` has no value yet"),
        ("kill 7", 1, 1, "no handle"),
        ("join True", 1, 1, "no handle"),
        ("movej([9, 0, 0, 0, 0, 0])", 1, 1, "out of their limits"),
        ("movej(p[9, 9, 9, 0, 0, 0])", 1, 1, "no joint positions"),
        ("movej([0, 0])", 1, 1, "6 joint positions"),
        ("read_input_integer_register(48)", 1, 1, "they are 0 to 47"),
        (
            "write_output_integer_register(0, 1.5)",
            1,
            1,
            "no whole number of 32 bits",
        ),
        (
            "write_output_boolean_register(0, 1)",
            1,
            1,
            "a truth value is needed",
        ),
        ("x = random()", 1, 5, "not simulated"),
        ("x = get_freedrive_status()", 1, 5, "not simulated"),
        (
            "thread t():\n  x = 1 / 0\nend\nrun t()\nsleep(1)",
            2,
            9,
            "divided by 0",
        ),
        ("inv([[1, 2], [2, 4]])", 1, 1, "singular"),
    ] {
        let (found_line, found_column, message) = exception(text);
        assert_eq!(
            (found_line, found_column),
            (line, column),
            "{text}: {message}"
        );
        assert!(message.contains(part), "{text}: {message}");
    }
}

#[test]
fn what_is_over_stays_over() {
    let mut host = TestHost::new();
    let mut run = Run::new(Program::load("textmsg(1) halt textmsg(2)").unwrap());
    for _ in 0..3 {
        assert_eq!(host.step(&mut run), Progress::Ended(End::Halted));
    }
    assert_eq!(host.trace, ["0: 1"]);
    let (found, end) = trace("sync()\nprotective_stop()\ntextmsg(1)");
    assert_eq!(
        end,
        Some(End::ProtectiveStop(
            "the program called for it (line 2, column 1)".to_owned()
        ))
    );
    assert_eq!(
        found,
        ["1: protective stop: the program called for it (line 2, column 1)"]
    );
}

#[test]
fn sockets_are_read_as_the_bytes_come() {
    let text = "open = socket_open(\"127.0.0.1\", 30000, \"s\")
textmsg(open)
textmsg(socket_read_binary_integer(2, \"s\", 0))
textmsg(socket_read_ascii_float(2, \"s\"))
textmsg(socket_read_line(\"s\"))
textmsg(socket_read_string(\"s\", \"<\", \">\"))
textmsg(socket_read_byte_list(2, \"s\", 0.004))
textmsg(socket_get_var(\"n\", \"s\"))
socket_send_int(258, \"s\")
socket_close(\"s\")
textmsg(socket_read_line(\"s\"))";
    let mut host = TestHost::new();
    host.socket = Some(Vec::new());
    let mut run = Run::new(Program::load(text).unwrap());
    let later: [(u32, &[u8]); 5] = [
        (2, &[0, 0, 1, 0, 255, 255]),
        (4, &[255, 254]),
        (6, b"(1.5, -2)need"),
        (8, b"le\n..<a"),
        (10, b"b>\x07"),
    ];
    loop {
        for (_, bytes) in later.iter().filter(|(cycle, _)| *cycle == host.cycle) {
            host.socket.as_mut().unwrap().extend_from_slice(bytes);
        }
        if host.cycle == 14 {
            host.socket = Some(b"n 42\n".to_vec());
        }
        if host.step(&mut run) != Progress::Running {
            break;
        }
        assert!(host.cycle < 50, "{:?}", host.trace);
    }
    let expected = "0: open s 127.0.0.1:30000|0: True|4: [2, 256, -2]|6: [2, 1.5, -2]|8: needle|10: ab|\
                    12: [0, -1, -1]|14: 42|14: ";
    assert_eq!(host.trace.join("|"), expected);
    assert_eq!(host.sent, b"GET n\n\x00\x00\x01\x02");
}

#[test]
fn a_thread_that_computes_goes_on_in_the_next_cycle() {
    // Five instructions a pass, at least.
    let passes = MOST_INSTRUCTIONS;
    let text = format!("i = 0 while i < {passes}: i = i + 1 end textmsg(i)");
    let (found, _) = trace(&text);
    let cycle: usize = found[0].split(':').next().unwrap().parse().unwrap();
    assert!((5..=12).contains(&cycle), "{found:?}");
    // Others run meanwhile.
    let text = "thread t(): while True: i = 1 end end run t() sleep(0.02) textmsg(1)";
    assert_eq!(trace(text).0, ["10: 1"]);
}

#[test]
fn a_thread_that_computes_for_a_second_stops_the_program() {
    for (text, what, cycles) in [
        (
            "def busy():\n  while True: x = 1 end\nend",
            "the program `busy`",
            500,
        ),
        // It begins in the second cycle.
        (
            "thread spins():\n  while True: end\nend\nrun spins()\nsleep(9)",
            "the thread `spins`",
            501,
        ),
    ] {
        let mut host = TestHost::new();
        let expected = format!("{what} computed for {LONGEST_BUSY_S} s without a pause (line 2)");
        match host.run(text, cycles) {
            Some(End::ProtectiveStop(reason)) => assert!(reason.starts_with(&expected), "{reason}"),
            other => panic!("{other:?}"),
        }
        assert_eq!(host.cycle, cycles);
        assert!(
            host.trace[0].contains("protective stop"),
            "{:?}",
            host.trace
        );
    }
}

#[test]
fn sizes_and_depths_are_limited() {
    let calls = |depth: usize| {
        format!("def f(n): if n == 0: return 0 end return 1 + f(n - 1) end textmsg(f({depth}))")
    };
    assert_eq!(said(&calls(199)), ["199"]);
    for (text, part) in [
        (calls(200), "200 levels deep"),
        (
            "def f(): return f() end x = f()".to_owned(),
            "200 levels deep",
        ),
        (
            format!(
                "thread t(): sleep(9) end i = 0 while i < {MOST_THREADS}: run t() i = i + 1 end"
            ),
            "64 threads",
        ),
        (
            "s = \"aaaaaaaa\" while True: s = str_cat(s, s) sync() end".to_owned(),
            "1023 at most",
        ),
        (
            "a = [1] while True: a = [a] sync() end".to_owned(),
            "levels deep",
        ),
        (
            "a = [1,1,1,1,1,1,1,1,1,1] while True: a = [a, a, a, a, a, a, a, a, a, a] sync() end"
                .to_owned(),
            "10000 at most",
        ),
        (
            "a = struct(b = 1) while True: a = struct(b = a) sync() end".to_owned(),
            "levels deep",
        ),
    ] {
        let (_, _, message) = exception(&text);
        assert!(message.contains(part), "{text}: {message}");
    }
    // As many threads as there may be at a time, again and again.
    let text = format!(
        "thread t(): x = 1 end i = 0 while i < {}: h = run t() join h i = i + 1 end textmsg(i)",
        MOST_THREADS + 10
    );
    assert_eq!(said(&text), ["74"]);
}

#[test]
fn programs_go_to_other_threads_of_the_computer() {
    fn moves<T: Send + Sync>() {}
    moves::<Program>();
}

/// A control program of the shape that client libraries send: a loop that reads a command register, answers by output
/// registers, streams set-points from a thread, moves from another one, and looks after its client.
const CONTROL: &str = include_str!("control.script");

/// A client that gives a command, waits for the answer 2, takes it back and waits for 1; `servoj` each time anew.
/// Without a beat it does nothing at all.
fn drive(cycles: u32, with_beat: bool) -> (TestHost, Progress) {
    let mut host = TestHost::new();
    let mut run = Run::new(Program::load(CONTROL).unwrap());
    let mut commands = Vec::from([1, 4, 2, 2, 2, 2, 2, 3, 4, 9]);
    commands.reverse();
    let mut progress = Progress::Running;
    let mut sent = 0.0;
    for cycle in 0..cycles {
        let answer = host.signals.get(&(Bank::OutputInteger, 0)).copied();
        let command = host.signals.get(&(Bank::InputInteger, 0)).copied();
        let has_command = command.is_some_and(|signal| signal != Signal::Integer(0));
        if with_beat {
            let beat = Signal::Integer(i32::try_from(cycle).unwrap());
            host.signals.insert((Bank::InputInteger, 2), beat);
        }
        let moved = host.signals.get(&(Bank::OutputInteger, 1)) != Some(&Signal::Integer(0));
        if answer == Some(Signal::Integer(2)) && has_command {
            host.signals
                .insert((Bank::InputInteger, 0), Signal::Integer(0));
        } else if answer == Some(Signal::Integer(1))
            && with_beat
            && !has_command
            && cycle % 10 == 0
            && moved
        {
            let Some(next) = commands.pop() else { continue };
            sent += 0.01;
            for joint in 0..6 {
                let at = host.state.target_joints[joint];
                let number = if joint == 0 { 0.1 + sent } else { at };
                host.signals
                    .insert((Bank::InputFloat, joint), Signal::Number(number));
            }
            host.signals
                .insert((Bank::InputInteger, 0), Signal::Integer(next));
        }
        progress = host.step(&mut run);
        if progress != Progress::Running {
            break;
        }
    }
    (host, progress)
}

#[test]
fn a_control_program_serves_its_client() {
    let (host, progress) = drive(500, true);
    assert_eq!(progress, Progress::Ended(End::Finished));
    let joined = host.trace.join("\n");
    let count = |part: &str| host.trace.iter().filter(|line| line.contains(part)).count();
    assert_eq!(count("movej [0.11]"), 1, "{joined}");
    // A set-point in each cycle from the first target to the stop, each target until the next one.
    let servo: Vec<(u32, String)> = host
        .trace
        .iter()
        .filter_map(|line| {
            let (cycle, what) = line.split_once(": servoj ")?;
            Some((cycle.parse().ok()?, what.split(' ').next()?.to_owned()))
        })
        .collect();
    assert!(
        servo.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1),
        "{joined}"
    );
    let mut targets: Vec<&String> = servo.iter().map(|each| &each.1).collect();
    targets.dedup();
    assert_eq!(targets, ["[0.13]", "[0.14]", "[0.15]", "[0.16]", "[0.17]"]);
    assert_eq!(count(": stop ["), 1, "{joined}");
    assert_eq!(count("OutputFloat[0]"), 2, "{joined}");
    assert_eq!(count("OutputInteger[0] = Integer(2)"), 10, "{joined}");
    assert!(joined.ends_with("control ended"), "{joined}");
}

#[test]
fn a_control_program_notices_that_its_client_is_gone() {
    let (host, progress) = drive(500, false);
    assert_eq!(progress, Progress::Ended(End::Halted));
    assert!(host.trace.last().unwrap().ends_with("client lost"));
    assert!((100..110).contains(&host.cycle), "{}", host.cycle);
}

#[test]
fn the_same_host_makes_the_same_run() {
    let (first, _) = drive(500, true);
    let (second, _) = drive(500, true);
    assert_eq!(first.trace, second.trace);
    assert_eq!(first.state, second.state);
}
