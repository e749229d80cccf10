//! Answers of solvers of inverse kinematics: joint positions, each for a goal of a scenario or a pose.

mod cells;
mod columnar;
mod tree;

use std::collections::BTreeMap;
use std::path::Path;

use needlebench_input::{Finding, read_data, sha256_hex};
use needlebench_kinematics::{JOINT_NAMES, Joints, Pose};
use serde::Serialize;

/// Answers that a solver gave, by what it was asked.
#[derive(Debug, Clone, PartialEq)]
pub struct AnswersFile {
    /// Where they are from.
    pub source: AnswersSource,
    /// What was asked, in the order of the file.
    pub questions: Vec<Question>,
    /// Notes from reading; belong in every report.
    pub notes: Vec<String>,
}

/// The file of answers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AnswersSource {
    /// File as the user named it.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// What it is, for people.
    pub format: &'static str,
    /// Number of answers.
    pub answers: usize,
}

/// What a solver was asked, and what it answered.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// What was asked.
    pub asked: Asked,
    /// Line where it stands first, from 1; none in files without lines.
    pub line: Option<usize>,
    /// The answers, in the order of the file.
    pub answers: Vec<Answer>,
}

/// What a solver was asked for.
#[derive(Debug, Clone, PartialEq)]
pub enum Asked {
    /// The scenario's goal; the file does not say which.
    Goal,
    /// The goal of this name.
    NamedGoal(String),
    /// A pose of the flange in the controller's base frame.
    BaseFromFlange(Pose),
}

/// One posture that a solver gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// Which one of the file, from 1.
    pub number: usize,
    /// Line, from 1; none in files without lines.
    pub line: Option<usize>,
    /// Joint positions, rad.
    pub joints: Joints,
}

/// No joint of an answer turns farther, rad: what is larger is in degrees. (A joint turns by two revolutions at most, but
/// for a wrist 3 without limits.)
const MOST_RAD: f64 = 2.0 * std::f64::consts::TAU;

const HINT: &str = "a row has the six joint positions in radians, in columns q1 to q6 or named after the joints; and where \
                    there are several goals a column `goal`, or the pose of the flange as x, y, z, rx, ry, rz";

/// Reads answers: a table (CSV, TSV), JSON or YAML, Parquet, or NumPy's `.npy`.
///
/// # Errors
/// What is wrong with the file, and a hint.
pub fn read_answers(path: &Path) -> Result<AnswersFile, Vec<Finding>> {
    let file = path.display().to_string();
    let one = |finding: Finding| vec![finding];
    let bytes = read_data(path).map_err(|error| {
        let hint = error
            .hint("the path is relative to the working directory")
            .to_owned();
        let message = format!("cannot read the answers: {error}");
        one(Finding::new(&file, message).hint(hint))
    })?;
    let sha256 = sha256_hex(&bytes);
    let (format, made) = if bytes.starts_with(columnar::NPY_MAGIC) {
        ("NumPy array", columnar::npy(&file, &bytes).map_err(one)?)
    } else if bytes.starts_with(columnar::PARQUET_MAGIC) {
        ("Parquet", columnar::parquet(&file, bytes).map_err(one)?)
    } else {
        let text = String::from_utf8(bytes).map_err(|_| {
            let message = "neither text, nor Parquet, nor an array of NumPy";
            one(Finding::new(&file, message).hint(HINT))
        })?;
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("json") => ("JSON", tree::read(&file, &text).map_err(one)?),
            Some("yaml" | "yml") => ("YAML", tree::read(&file, &text).map_err(one)?),
            _ if text.trim_start().starts_with(['{', '[']) => {
                ("JSON", tree::read(&file, &text).map_err(one)?)
            }
            _ => ("table", cells::table(&file, &text).map_err(one)?),
        }
    };
    for answer in made.questions.iter().flat_map(|each| &each.answers) {
        check(&file, answer).map_err(one)?;
    }
    if made.questions.is_empty() {
        return Err(one(
            Finding::new(&file, "the file has no answers").hint(HINT)
        ));
    }
    Ok(AnswersFile {
        source: AnswersSource {
            file,
            sha256,
            format,
            answers: made.answers,
        },
        questions: made.questions,
        notes: made.notes,
    })
}

/// Answers in memory, to the scenario's goal. `name` stands for the file.
///
/// # Errors
/// A value that is no joint position.
pub fn answers_of(name: &str, joints: &[Joints]) -> Result<AnswersFile, Finding> {
    let numbers = joints.iter().flat_map(|each| each.iter());
    let bytes: Vec<u8> = numbers.flat_map(|number| number.to_le_bytes()).collect();
    let mut made = Made::default();
    made.question(Asked::Goal, None);
    for joints in joints {
        made.answer(Asked::Goal, None, *joints);
    }
    for answer in made.questions.iter().flat_map(|each| &each.answers) {
        check(name, answer)?;
    }
    Ok(AnswersFile {
        source: AnswersSource {
            file: name.to_owned(),
            sha256: sha256_hex(&bytes),
            format: "array",
            answers: made.answers,
        },
        questions: made.questions,
        notes: made.notes,
    })
}

/// What a reader makes of a file.
#[derive(Debug, Default)]
struct Made {
    questions: Vec<Question>,
    /// Questions by their poses, bit for bit.
    by_pose: BTreeMap<[u64; 7], usize>,
    /// Number of answers.
    answers: usize,
    notes: Vec<String>,
}

impl Made {
    /// The question that was asked, made if this is the first time.
    fn question(&mut self, asked: Asked, line: Option<usize>) -> &mut Question {
        let next = self.questions.len();
        let index = if let Asked::BaseFromFlange(pose) = &asked {
            let [x, y, z] = pose.translation.vector.into();
            let [i, j, k, w] = pose.rotation.coords.into();
            let bits = [x, y, z, i, j, k, w].map(f64::to_bits);
            *self.by_pose.entry(bits).or_insert(next)
        } else {
            let known = self.questions.iter().position(|each| each.asked == asked);
            known.unwrap_or(next)
        };
        if index == next {
            self.questions.push(Question {
                asked,
                line,
                answers: Vec::new(),
            });
        }
        &mut self.questions[index]
    }

    fn answer(&mut self, asked: Asked, line: Option<usize>, joints: Joints) {
        self.answers += 1;
        let number = self.answers;
        self.question(asked, line).answers.push(Answer {
            number,
            line,
            joints,
        });
    }
}

fn check(file: &str, answer: &Answer) -> Result<(), Finding> {
    for (joint, value) in answer.joints.iter().enumerate() {
        let name = JOINT_NAMES[joint];
        let found = |message: String| Finding {
            line: answer.line,
            ..Finding::new(file, format!("answer {}: {message}", answer.number)).key(name)
        };
        if !value.is_finite() {
            let hint =
                "every value has to be a finite number; leave out what the solver does not answer";
            return Err(found(format!("{name} is {value} rad")).hint(hint));
        }
        if value.abs() > MOST_RAD {
            let message = format!("{name} is {value} rad, more than two revolutions");
            return Err(found(message).hint("joint positions are in radians; are these degrees?"));
        }
    }
    Ok(())
}
