//! Judged answers of somebody's inverse kinematics.

use needlebench_bench::judge::answers::{
    AnswerReport, AnswersReport, Defect, PostureReport, QuestionReport, SolutionReport,
};
use needlebench_cell::ClearanceClass;
use needlebench_show::{Block, blocks_text};

use super::verdict::capitals;

/// Answers of a question that a screen has room for.
const MOST_ROWS: usize = 16;

/// The answers as text: a line with the verdict, and of each question its solutions and answers; all of them if it is
/// `whole`, else what a screen has room for.
pub fn answers_text(report: &AnswersReport, whole: bool) -> String {
    let mut blocks = vec![Block::Lines(vec![summary(report), source(report)])];
    for question in &report.questions {
        blocks.push(Block::Lines(vec![String::new(), heading(question)]));
        blocks.push(solutions(question));
        blocks.extend(answers(question, whole));
    }
    if !report.notes.is_empty() {
        let notes = report.notes.iter().map(|note| format!("note: {note}"));
        blocks.push(Block::Lines(notes.collect()));
    }
    blocks_text(&blocks)
}

/// The verdict in a line.
pub(crate) fn summary(report: &AnswersReport) -> String {
    let word = capitals(report.verdict);
    let all = report.source.answers;
    let answers = report.questions.iter().flat_map(|each| &each.answers);
    let wrong = answers.clone().filter(|each| !each.defects.is_empty());
    let (judged, wrong) = (answers.count(), wrong.count());
    let missing: usize = report
        .questions
        .iter()
        .map(|each| each.missing().count())
        .sum();
    let there: usize = report
        .questions
        .iter()
        .map(|each| each.solutions.len())
        .sum();
    let left_out = if judged < all {
        format!(" ({} left out)", all - judged)
    } else {
        String::new()
    };
    format!(
        "{word} {}: {} of {judged} answers right{left_out}, {} of {there} solutions answered",
        report.scenario,
        judged - wrong,
        there - missing
    )
}

fn source(report: &AnswersReport) -> String {
    let partial = if report.is_partial {
        "; one right answer is enough"
    } else {
        ""
    };
    format!(
        "answers {}: {}; right within {} mm and {:.4} deg{partial}",
        report.source.file,
        report.source.format,
        report.tolerance_m * 1e3,
        report.tolerance_rad.to_degrees()
    )
}

fn heading(question: &QuestionReport) -> String {
    let set = match (question.roll_is_free, question.certificate) {
        (true, _) => "roll free: configurations that reach it at any roll".to_owned(),
        (false, Some(certificate)) => {
            format!("set of solutions: {}", certificate.replace('_', " "))
        }
        (false, None) => "set of solutions".to_owned(),
    };
    format!(
        "{}: {} answers; {} solutions ({set})",
        question.name,
        question.answers.len(),
        question.solutions.len()
    )
}

fn solutions(question: &QuestionReport) -> Block {
    let rows = question.solutions.iter().map(|solution| {
        let SolutionReport {
            label,
            roll_rad,
            answered_by,
            posture,
            ..
        } = solution;
        let by = match answered_by[..] {
            [] => "MISSING".to_owned(),
            [first] => format!("answer {first}"),
            [first, ..] => format!("answer {first} and {} more", answered_by.len() - 1),
        };
        vec![
            (*label).to_owned(),
            by,
            roll(*roll_rad),
            clearance(posture),
            feasible(posture),
        ]
    });
    Block::table(
        [
            "solution",
            "<answered by",
            "roll\n(deg)",
            "clearance\n(mm)",
            "<posture",
        ],
        rows.collect(),
    )
}

/// All answers if there is room, else those with defects.
fn answers(question: &QuestionReport, whole: bool) -> Vec<Block> {
    let all = &question.answers;
    if all.is_empty() {
        return Vec::new();
    }
    let has_room = whole || all.len() <= MOST_ROWS;
    let shown: Vec<&AnswerReport> = if has_room {
        all.iter().collect()
    } else {
        let wrong = all.iter().filter(|each| !each.defects.is_empty());
        wrong.take(MOST_ROWS).collect()
    };
    let rows: Vec<Vec<String>> = shown.iter().map(|each| row(each)).collect();
    let left = all.len() - rows.len();
    let mut blocks = Vec::new();
    if !rows.is_empty() {
        let header = [
            "answer",
            "<nearest solution",
            "roll\n(deg)",
            "off\n(mm)",
            "off\n(deg)",
            "<finding",
        ];
        blocks.push(Block::table(header, rows));
    }
    if left > 0 {
        let line = format!("{left} answers are not listed: --wide and --json have all");
        blocks.push(Block::Lines(vec![line]));
    }
    blocks
}

fn row(answer: &AnswerReport) -> Vec<String> {
    let findings: Vec<String> = answer.defects.iter().map(defect).collect();
    let finding = match (findings.is_empty(), answer.equivalent_to) {
        (false, _) => findings.join("; "),
        (true, Some(number)) => format!("right, 2π equivalent of answer {number}"),
        (true, None) => "right".to_owned(),
    };
    let number = match answer.line {
        Some(line) => format!("{} (line {line})", answer.number),
        None => answer.number.to_string(),
    };
    vec![
        number,
        answer.label.unwrap_or("-").to_owned(),
        roll(answer.roll_rad),
        small(answer.off_m * 1e3),
        small(answer.off_rad.to_degrees()),
        finding,
    ]
}

/// What is wrong with an answer, in words.
pub(crate) fn defect(defect: &Defect) -> String {
    match defect {
        Defect::Off => "OFF".to_owned(),
        Defect::JointRange {
            joint,
            value_rad,
            limit_rad,
        } => format!(
            "OUTSIDE: {joint} at {:.2} deg, limit {:.2}",
            value_rad.to_degrees(),
            limit_rad.to_degrees()
        ),
        Defect::Double { of } => format!("DOUBLE of answer {of}"),
    }
}

/// Four decimals, or the power of ten of what rounding leaves.
fn small(value: f64) -> String {
    if value >= 1e-4 {
        format!("{value:.4}")
    } else {
        "< 0.0001".to_owned()
    }
}

fn roll(roll_rad: Option<f64>) -> String {
    roll_rad.map_or("-".to_owned(), |roll_rad| {
        format!("{:.1}", roll_rad.to_degrees())
    })
}

/// What is called the clearance everywhere: of arm and tool from what stands around them.
fn clearance(posture: &PostureReport) -> String {
    let classes = posture.clearance_m.iter();
    let around = classes.filter(|(class, _)| {
        ClearanceClass::named(class).is_some_and(ClearanceClass::is_surroundings)
    });
    let least_m = around.map(|(_, least_m)| *least_m).reduce(f64::min);
    least_m.map_or("-".to_owned(), |least_m| format!("{:.1}", least_m * 1e3))
}

fn feasible(posture: &PostureReport) -> String {
    posture
        .fault
        .clone()
        .unwrap_or_else(|| "feasible".to_owned())
}
