//! Programs that are broken, endless or greedy: none of them crashes, all stay small, and the next good one runs.

#[path = "../urscript/test_arm.rs"]
#[expect(dead_code, reason = "shared with the other tests")]
mod test_arm;
#[path = "../urscript/test_host.rs"]
#[expect(dead_code, reason = "shared with the other tests")]
mod test_host;

use needlebench_urscript::{End, Program, Progress, Run};
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};

use crate::test_host::TestHost;

/// How many mangled programs are tried.
const PROGRAMS: u32 = 10_000;

/// Cycles of each, and of each hundredth.
const CYCLES: u32 = 3;
const MANY_CYCLES: u32 = 60;

/// Most memory of the process, kB.
const MOST_KB: u64 = 100_000;

/// Good programs, which are mangled.
const GOOD: [&str; 5] = [
    include_str!("../urscript/control.script"),
    "def fib(n):\n  if n < 2:\n    return n\n  end\n  return fib(n - 1) + fib(n - 2)\nend\ntextmsg(fib(12))\n",
    "s = struct(a = 1, b = [1, 2, 3], c = p[0.3, 0, 0.2, 0, 3, 0])\ns.b[1] = s.a + 4\n\
     while s.b[1] > 0:\n  s.b[1] = s.b[1] - 1\n  movej(get_inverse_kin(s.c), t = 0.004)\nend\n",
    "def p():\n  thread t(n):\n    while True:\n      x = [n, x_]\n      sleep(0.004)\n    end\n  end\n  x_ = \"a\"\n\
     i = 0\n  while i < 70:\n    h = run t(i)\n    i = i + 1\n  end\n  kill h\n  join h\nend\n",
    "m = [[1, 2], [3, 4]]\nm[1, 0] = m * transpose(m)\nx = str_cat(to_str(m), to_str(inv([[1, 2], [3, 4]])))\n\
     open = socket_open(\"127.0.0.1\", 50000, \"s\")\n\
     textmsg(socket_read_string(\"s\"))\nspeedj([0,0,0,0,0,1], 1, 0.1)\n",
];

/// What is put into them.
const WORDS: [&str; 40] = [
    "end",
    "def f(x):",
    "if",
    "else:",
    "while True:",
    "thread t():",
    "run",
    "kill",
    "join",
    "x",
    "x = x",
    "[x, x, x, x, x, x, x, x, x, x]",
    "-",
    "not",
    "(",
    ")",
    "[",
    "]",
    "1e308",
    "-1",
    "0",
    "4294967296",
    "0.5",
    "\"",
    "\"text\"",
    "p[",
    "p[0,0,0,0,0,0]",
    "enter_critical",
    "exit_critical",
    "sync()",
    "halt",
    "global",
    "local",
    "return",
    "break",
    "continue",
    "struct(x = x)",
    "f(f(x))",
    "\u{e4}",
    "sec s():",
];

/// One change of a text: where, what is done, and with which word.
type Change = (prop::sample::Index, u8, prop::sample::Index);

fn mangled(text: &str, changes: &[Change]) -> String {
    let mut words: Vec<&str> = text
        .split_inclusive([' ', '\n', '(', ')', ',', '[', ']', '='])
        .collect();
    for (place, what, with) in changes {
        let at = place.index(words.len().max(1)).min(words.len());
        let other = words
            .get(with.index(words.len().max(1)))
            .copied()
            .unwrap_or("x");
        match what % 6 {
            0 if at < words.len() => drop(words.remove(at)),
            1 => words.insert(at, WORDS[with.index(WORDS.len())]),
            2 => words.insert(at, other),
            3 if at < words.len() => words[at] = other,
            4 => {
                let end = (at + with.index(40)).min(words.len());
                words.drain(at..end);
            }
            _ => words.insert(at, " "),
        }
    }
    words.concat()
}

/// The program after a bad one.
fn run_good() {
    let mut host = TestHost::new();
    let end = host.run(GOOD[1], 20);
    assert_eq!(end, Some(End::Finished));
    assert!(host.trace[0].ends_with(": 144"), "{:?}", host.trace);
}

/// Runs what may be a program for some cycles.
fn try_program(text: &str, cycles: u32) -> Option<Progress> {
    let mut run = Run::new(Program::load(text).ok()?);
    let mut host = TestHost::new();
    let mut progress = Progress::Running;
    for _ in 0..cycles {
        progress = host.step(&mut run);
        if progress != Progress::Running {
            break;
        }
    }
    Some(progress)
}

/// Largest memory of this process so far, kB; where the system says it.
fn peak_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

fn mangled_programs_do_no_harm() {
    let changes = prop::collection::vec(any::<Change>(), 1..8);
    let strategy = (0..GOOD.len(), changes);
    let mut runner = TestRunner::new(ProptestConfig {
        cases: PROGRAMS,
        failure_persistence: None,
        max_shrink_iters: 200,
        rng_seed: RngSeed::Fixed(11),
        ..ProptestConfig::default()
    });
    let tried = std::cell::Cell::new(0_u32);
    let loaded = std::cell::Cell::new(0_u32);
    let found = runner.run(&strategy, |(good, changes)| {
        tried.set(tried.get() + 1);
        let is_long = tried.get().is_multiple_of(100);
        let text = mangled(GOOD[good], &changes);
        let cycles = if is_long { MANY_CYCLES } else { CYCLES };
        loaded.set(loaded.get() + u32::from(try_program(&text, cycles).is_some()));
        if is_long {
            run_good();
        }
        Ok(())
    });
    found.unwrap();
    // Enough of them are programs still, and enough are none.
    assert!(
        (PROGRAMS / 10..PROGRAMS * 9 / 10).contains(&loaded.get()),
        "{loaded:?}"
    );
}

/// Many variables with a value.
fn names(count: usize, value: &str) -> String {
    let each: Vec<String> = (0..count)
        .map(|index| format!("v{index} = {value}\n"))
        .collect();
    each.concat()
}

fn greedy_programs_stay_small() {
    let many = |count: usize, part: &str| part.repeat(count);
    let l = "l = [1,1,1,1,1,1,1,1,1,1] * 1 m = [l,l,l,l,l,l,l,l,l,l]";
    let locals = names(5000, "1");
    let bad = [
        many(1 << 16, "a() "),
        many(1 << 19, " #"),
        many(1 << 18, "1 "),
    ];
    let greedy = [
        // Many lists under many names; each of its own.
        format!("l = [{}1]\n{}", many(9000, "1,"), names(10_000, "l * 1")),
        format!("{l} k = m a = [] while True: a = [a, k] k = k * 2 sync() end"),
        // Long strings in long lists.
        format!(
            "s = \"{}\" n = 0 l = [{}0] \
             while True: l[n] = str_cat(s, n) n = (n + 1) % 9000 sync() end",
            many(1000, "a"),
            many(9000, "0,")
        ),
        format!(
            "s = \"{}\" l = [{}0] m = struct(a = l, b = s) \
             while True: x = to_str([l, l]) y = to_str(m) end",
            many(500, "\u{e4}"),
            many(4000, "s,")
        ),
        format!(
            "thread t(): local l = [{}0] n = 0 \
             while True: l[n] = str_cat(s, n) n = (n + 1) % 9000 end end \
             s = \"{}\" i = 0 while i < 60: run t() i = i + 1 end sleep(9)",
            many(9000, "0,"),
            many(1000, "a")
        ),
        // Deep calls with many names, in many threads.
        format!("def f(n): {locals} sync() return 1 + f(n + 1) end x = f(0)"),
        format!(
            "thread t(): def f(n): {locals} sync() return 1 + f(n + 1) end x = f(0) end \
             i = 0 while i < 60: run t() i = i + 1 end while True: sync() end"
        ),
        // Calls in the middle of long lists.
        format!(
            "def f(n): sync() return [{}f(n + 1)] end x = f(0)",
            many(50_000, "1,")
        ),
        // Threads that start threads.
        "thread t(): run t() run t() sync() end run t() while True: sync() end".to_owned(),
        "thread t(): while True: x = [1, 2, 3] end end i = 0 \
         while i < 5: run t() i = i + 1 end sleep(9)"
            .to_owned(),
        // As long as a program may be.
        many((1 << 18) - 2, "1 "),
        format!(
            "{}l = [{}1]\n{}",
            many(200_000, "1 "),
            many(4000, "1,"),
            names(2000, "l * 1")
        ),
        format!("x = [{}1]", many(1 << 16, "1,")),
        format!("beep({}1)", many(1 << 16, "1,")),
        names(50_000, "1"),
        "if True: ".repeat(190) + &many(1000, "x = 1 ") + &"end ".repeat(190),
        "while True: textmsg(1) popup(\"a\") end".to_owned(),
        "while True: x = inv([[1,2,3],[4,5,6],[7,8,10]]) * [1,2,3] end".to_owned(),
    ];
    for text in greedy.iter().chain(&bad) {
        let start: String = text.chars().take(60).collect();
        let is_loaded = try_program(text, 700).is_some();
        assert_eq!(is_loaded, !bad.contains(text), "{start}");
        run_good();
        if let Some(kb) = peak_kb() {
            assert!(kb < MOST_KB, "{kb} kB: {start}");
        }
    }
}

/// One test, so that nothing else is in the memory that is measured.
#[test]
fn hostile_programs_are_harmless() {
    greedy_programs_stay_small();
    mangled_programs_do_no_harm();
    if let Some(kb) = peak_kb() {
        assert!(kb < MOST_KB, "{kb} kB");
    }
}
