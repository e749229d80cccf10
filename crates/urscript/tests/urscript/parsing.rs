//! What is a program, and where it is none.

use needlebench_urscript::tree::{
    Binary, Expression, ExpressionKind, FunctionKind, Part, Scope, Statement, StatementKind, Unary,
};
use needlebench_urscript::{MOST_BYTES, MOST_LEVELS, parse};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::test_arm::check_error;

fn statements(text: &str) -> Vec<Statement> {
    parse(text)
        .unwrap_or_else(|error| panic!("{error}\n{text}"))
        .statements
}

/// An expression with all brackets that its operators imply.
fn bracketed(expression: &Expression) -> String {
    let all = |parts: &[Expression]| parts.iter().map(bracketed).collect::<Vec<_>>().join(", ");
    match &expression.kind {
        ExpressionKind::Number(number) => number.to_string(),
        ExpressionKind::Text(text) => format!("{text:?}"),
        ExpressionKind::Truth(truth) => truth.to_string(),
        ExpressionKind::Name(name) => name.clone(),
        ExpressionKind::Call { name, arguments } => {
            let all: Vec<String> = arguments
                .iter()
                .map(|each| match &each.name {
                    Some(name) => format!("{name}={}", bracketed(&each.value)),
                    None => bracketed(&each.value),
                })
                .collect();
            format!("{name}({})", all.join(", "))
        }
        ExpressionKind::Run { name, .. } => format!("run {name}"),
        ExpressionKind::Member {
            of,
            name,
            arguments,
        } => {
            format!(
                "{}.{name}{}",
                bracketed(of),
                if arguments.is_some() { "()" } else { "" }
            )
        }
        ExpressionKind::Element { of, indices } => format!("{}[{}]", bracketed(of), all(indices)),
        ExpressionKind::Pose(parts) => format!("p[{}]", all(parts)),
        ExpressionKind::List(parts) => format!("[{}]", all(parts)),
        ExpressionKind::Unary { operator, operand } => {
            let sign = match operator {
                Unary::Minus => "-",
                Unary::Plus => "+",
                Unary::Not => "not ",
            };
            format!("({sign}{})", bracketed(operand))
        }
        ExpressionKind::Binary {
            operator,
            left,
            right,
        } => {
            format!(
                "({} {} {})",
                bracketed(left),
                operator.sign(),
                bracketed(right)
            )
        }
    }
}

fn value(text: &str) -> String {
    let mut all = statements(&format!("x = {text}"));
    assert_eq!(all.len(), 1, "{text}");
    match all.pop().unwrap().kind {
        StatementKind::Assign { value, .. } => bracketed(&value),
        other => panic!("{other:?}"),
    }
}

#[test]
fn operators_bind_as_the_grammar_says() {
    for (text, expected) in [
        ("1 + 2 * 3 - 4 / 2 % 5", "((1 + (2 * 3)) - ((4 / 2) % 5))"),
        ("-a[0] * b", "((-a[0]) * b)"),
        ("- -1", "(-(-1))"),
        ("a or b and not c == d", "(a or (b and (not (c == d))))"),
        ("a xor b or c", "((a xor b) or c)"),
        ("not a and not not b", "((not a) and (not (not b)))"),
        ("1 < 2 == True", "((1 < 2) == true)"),
        ("a == not b", "(a == (not b))"),
        ("(1 + 2) * 3", "((1 + 2) * 3)"),
        ("m[1, 2][0]", "m[1, 2][0]"),
        (
            "f(1, q = [0, .5], r=p[0,0,0,0,0,1e-3])",
            "f(1, q=[0, 0.5], r=p[0, 0, 0, 0, 0, 0.001])",
        ),
        ("s.a.b(1)", "s.a.b()"),
        ("1. + .143 + 2E+3", "((1 + 0.143) + 2000)"),
        ("run f()", "run f"),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
}

#[test]
fn line_ends_are_white_space_and_statements_need_no_separator() {
    let all =
        statements("global a = # a comment\n0    global b = \r\n [1,\n 2] c = a d = 2 f()\rg()");
    assert_eq!(all.len(), 6);
    assert!(
        matches!(&all[1].kind, StatementKind::Declare { scope: Scope::Global, name, .. } if name == "b")
    );
    let lines: Vec<(usize, usize)> = all
        .iter()
        .map(|each| (each.place.line, each.place.column))
        .collect();
    assert_eq!(lines, [(1, 1), (2, 6), (4, 5), (4, 11), (4, 17), (5, 1)]);
}

#[test]
fn return_alone_looks_at_the_end_of_its_line() {
    let text = "def f():\n  return\n  x = 1\nend\ndef g():\n  return x\nend\n";
    let all = statements(text);
    let body = |index: usize| match &all[index].kind {
        StatementKind::Function(function) => &function.body,
        other => panic!("{other:?}"),
    };
    assert_eq!(body(0).len(), 2);
    assert_eq!(body(0)[0].kind, StatementKind::Return(None));
    assert_eq!(body(1).len(), 1);
    assert!(matches!(body(1)[0].kind, StatementKind::Return(Some(_))));
}

#[test]
fn nesting_decides_where_a_program_ends_and_not_indentation() {
    let text = "def outer(a, b = 2):\nif a == 1:\nwhile True:\nbreak\nend\nelif b < 0:\npass\nelse:\nhalt\nend\n\
                def inner():\nend\nend\nouter(1)";
    let all = statements(text);
    assert_eq!(all.len(), 2);
    let StatementKind::Function(outer) = &all[0].kind else {
        panic!("{all:?}");
    };
    assert_eq!(outer.kind, FunctionKind::Function);
    assert_eq!(outer.parameters.len(), 2);
    assert_eq!(outer.parameters[1].0, "b");
    assert!(outer.parameters[1].1.is_some());
    assert_eq!(outer.body.len(), 2);
    let StatementKind::If {
        branches,
        otherwise,
    } = &outer.body[0].kind
    else {
        panic!("{outer:?}");
    };
    assert_eq!((branches.len(), otherwise.len()), (2, 1));
}

/// As the graphical editor writes them: labels, a header, a counting thread, joints and poses of way points.
const AS_POLYSCOPE_WRITES: &str = r#" def Needle():
  set_gravity([0.0, 0.0, 9.82])
  set_tcp(p[0.0,0.0,0.2,0.0,0.0,0.0])
  step_count_1f = 0.0
  thread Step_Counter_Thread_1f():
    while (True):
      step_count_1f = step_count_1f + 1.0
      sync()
    end
  end
  run Step_Counter_Thread_1f()
  global Waypoint_1_p=p[.143, -.435, .20, -.001, 3.12, .04]
  global Waypoint_1_q=[-1.6007, -1.7271, -2.203, -.8080, 1.5951, -.0310]
  while (True):
    $ 1 "Robot Program"
    $ 2 "MoveJ"
    $ 3 "Waypoint_1" "breakAfter"
    movej(get_inverse_kin(Waypoint_1_p, qnear=Waypoint_1_q), a=1.3962634015954636, v=1.0471975511965976)
  end
end
"#;

#[test]
fn programs_of_the_graphical_editor_are_read() {
    let all = statements(AS_POLYSCOPE_WRITES);
    assert_eq!(all.len(), 1);
    assert_eq!((all[0].place.line, all[0].place.column), (1, 2));
    let StatementKind::Function(program) = &all[0].kind else {
        panic!("{all:?}");
    };
    assert_eq!(program.body.len(), 8);
    let StatementKind::While { body, .. } = &program.body[7].kind else {
        panic!("{program:?}");
    };
    assert_eq!(body.len(), 1);
    assert_eq!((body[0].place.line, body[0].place.column), (18, 5));
}

#[test]
fn parts_of_variables_and_scopes_are_assigned() {
    let all = statements(
        "q[0] = 1 m[1, 2].x = 2 local y kill h join run f() enter_critical exit_critical",
    );
    let StatementKind::Assign { target, .. } = &all[1].kind else {
        panic!("{all:?}");
    };
    assert_eq!(target.name, "m");
    assert!(matches!(&target.parts[0], Part::Element(indices) if indices.len() == 2));
    assert_eq!(target.parts[1], Part::Member("x".to_owned()));
    assert!(matches!(
        &all[2].kind,
        StatementKind::Declare {
            scope: Scope::Local,
            value: None,
            ..
        }
    ));
    assert_eq!(all.len(), 7);
}

#[test]
fn errors_have_line_and_column() {
    for (text, line, column, part) in [
        (
            "def f():\n  movej([0, 1\nend\n",
            3,
            1,
            "missing before `end`",
        ),
        (
            "def f():\n  x = 1\n",
            3,
            1,
            "`end` of `f` of line 1 is missing",
        ),
        ("x = 1\nend", 2, 1, "ends nothing"),
        (
            "if True:\n x = 1\n else:\n elif False:\n end",
            4,
            2,
            "without its `if`",
        ),
        ("x = p[1, 2]", 1, 5, "6 numbers, this one 2"),
        ("x = \"abc\ny = 1", 1, 5, "does not end on its line"),
        ("x = {{ value }}", 1, 5, "no meaning"),
        ("x = 'a'", 1, 5, "no meaning"),
        ("x = 2pi", 1, 6, "right after the number"),
        ("x = 1e999", 1, 5, "no finite number"),
        ("f() = 2", 1, 5, "gets no value"),
        ("pass = 3", 1, 6, "a statement is missing before `=`"),
        ("def end():\nend", 1, 5, "is a keyword"),
        ("f(a=1, 2)", 1, 8, "follows one with a name"),
        ("def f(a, a):\nend", 1, 10, "two parameters `a`"),
        ("x = 1;", 1, 6, "no meaning"),
        (
            "while True x = 1 end",
            1,
            12,
            "`:` after the condition is missing",
        ),
        ("x = a[]", 1, 6, "one index"),
        ("\u{e4} = 1", 1, 1, "no meaning"),
    ] {
        let error = parse(text).expect_err(text);
        check_error(&error, (line, column), part, text);
    }
}

#[test]
fn depth_and_length_are_limited() {
    let deep = |levels: usize| {
        [
            format!("x = {}1{}", "(".repeat(levels), ")".repeat(levels)),
            format!("x = {}1{}", "[".repeat(levels), "]".repeat(levels)),
            format!("x = {}1", "-".repeat(levels)),
            format!("x = 1{}", "+1".repeat(levels)),
            format!("x = a{}", "[0]".repeat(levels)),
            format!("x = {}1{}", "f(".repeat(levels), ")".repeat(levels)),
            format!("{}{}", "if True:\n".repeat(levels), "end\n".repeat(levels)),
            format!("{}{}", "def f():\n".repeat(levels), "end\n".repeat(levels)),
        ]
    };
    for text in deep(MOST_LEVELS - 2) {
        statements(&text);
    }
    for text in deep(MOST_LEVELS + 1).into_iter().chain(deep(40_000)) {
        let error = parse(&text).expect_err("too deep");
        assert!(error.message.contains("levels deep"), "{error}");
    }
    let many = "1 ".repeat(1 << 18);
    assert!(parse(&many).unwrap_err().message.contains("words"));
    let long = "x".repeat(MOST_BYTES + 1);
    assert!(parse(&long).unwrap_err().message.contains("at most"));
}

#[test]
fn every_operator_is_read_back_from_its_sign() {
    for operator in [
        Binary::Or,
        Binary::Xor,
        Binary::And,
        Binary::Equal,
        Binary::Unequal,
        Binary::Less,
        Binary::Greater,
        Binary::AtMost,
        Binary::AtLeast,
        Binary::Add,
        Binary::Subtract,
        Binary::Multiply,
        Binary::Divide,
        Binary::Remainder,
    ] {
        let sign = operator.sign();
        assert_eq!(value(&format!("a {sign} b")), format!("(a {sign} b)"));
    }
}

/// Words of programs in any order, which reach far into the parser.
fn salad() -> impl Strategy<Value = String> {
    let words = prop::sample::select(vec![
        "def", "f", "(", ")", ":", "end", "if", "elif", "else", "while", "return", "x", "=", "1",
        ".143", "p[", "[", "]", ",", "not", "and", "-", "+", "global", "local", "run", "thread",
        "\"s\"", "\n", "# c\n", "$ 1\n", "True", "halt", ".", "kill", "0", "==", "movej", "\u{e9}",
    ]);
    prop::collection::vec(words, 0..60).prop_map(|words| words.join(" "))
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 3000, failure_persistence: None, rng_seed: RngSeed::Fixed(3),
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_text_panics_and_errors_lie_within_it(text in prop_oneof![".{0,200}", salad()]) {
        if let Err(error) = parse(&text) {
            prop_assert!(error.place.offset <= text.len());
            let before = &text[..error.place.offset];
            let lines = before.replace("\r\n", "\n").replace('\r', "\n").matches('\n').count();
            prop_assert_eq!(error.place.line, lines + 1);
        }
    }

    #[test]
    fn a_program_cut_anywhere_is_no_panic(cut in 0..AS_POLYSCOPE_WRITES.len()) {
        let _ = parse(&AS_POLYSCOPE_WRITES[..cut]);
    }
}
