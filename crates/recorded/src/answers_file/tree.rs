//! Answers as JSON or YAML.

use nalgebra::{Quaternion, Vector3};
use needlebench_input::{Finding, YamlNode, YamlValue, parse_yaml};
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};

use super::cells::{of_quaternion, of_vector};
use super::{Asked, Made};

const HINT: &str = "answers are a list of six joint positions each, or of questions such as {\"goal\": \"lesion\", \
                    \"solutions\": [[q1, ..., q6], ...]}, with \"pose\": [x, y, z, rx, ry, rz] in place of the goal";

/// Keys of a list of questions, of one question's answers, and of one answer.
const LISTS: [&str; 3] = ["questions", "answers", "poses"];
const SOLUTIONS: [&str; 2] = ["solutions", "answers"];
const JOINTS: [&str; 4] = ["joints_rad", "joints", "q", "positions"];

/// Reads a list of answers or of questions.
pub(super) fn read(file: &str, text: &str) -> Result<Made, Finding> {
    let root = parse_yaml(file, text).map_err(|finding| finding.hint(HINT))?;
    let reader = Reader { file, text };
    let mut made = Made::default();
    if is_question(&root) {
        reader.question(&root, &mut made)?;
        return Ok(made);
    }
    let list = LISTS.iter().find_map(|key| root.get(key)).unwrap_or(&root);
    for item in reader.list(list, "answers")? {
        if is_question(item) {
            reader.question(item, &mut made)?;
            continue;
        }
        let asked = reader.asked(item)?;
        let joints = match &item.value {
            YamlValue::Map(_) => JOINTS.iter().find_map(|key| item.get(key)),
            _ => Some(item),
        };
        let Some(joints) = joints else {
            return Err(reader.finding(item, "neither joint positions nor solutions"));
        };
        reader.answer(asked, joints, &mut made)?;
    }
    Ok(made)
}

/// Whether a value has a list of solutions.
fn is_question(node: &YamlNode) -> bool {
    let is_asked = node.get("goal").is_some() || node.get("pose").is_some();
    node.get(SOLUTIONS[0]).is_some() || is_asked && node.get(SOLUTIONS[1]).is_some()
}

struct Reader<'a> {
    file: &'a str,
    text: &'a str,
}

impl Reader<'_> {
    fn finding(&self, node: &YamlNode, message: impl Into<String>) -> Finding {
        Finding::new(self.file, message)
            .at(self.text, node.span.clone())
            .hint(HINT)
    }

    fn line(&self, node: &YamlNode) -> usize {
        1 + self.text[..node.span.start].matches('\n').count()
    }

    fn list<'n>(&self, node: &'n YamlNode, key: &str) -> Result<&'n [YamlNode], Finding> {
        match &node.value {
            YamlValue::Sequence(items) => Ok(items),
            _ => Err(self.finding(node, format!("`{key}` has to be a list"))),
        }
    }

    fn numbers(&self, node: &YamlNode, key: &str) -> Result<Vec<f64>, Finding> {
        let items = self.list(node, key)?.iter();
        items.map(|item| self.number(item, key)).collect()
    }

    fn number(&self, node: &YamlNode, key: &str) -> Result<f64, Finding> {
        let text = match &node.value {
            YamlValue::Scalar(text) => text.trim(),
            _ => "a list",
        };
        text.parse().map_err(|_| {
            let message = format!("`{text}` is no number");
            self.finding(node, message).key(key)
        })
    }

    fn question(&self, node: &YamlNode, made: &mut Made) -> Result<(), Finding> {
        let asked = self.asked(node)?;
        made.question(asked.clone(), Some(self.line(node)));
        let found = SOLUTIONS.iter().find_map(|key| Some((key, node.get(key)?)));
        let (key, solutions) = found.expect("a question has solutions");
        for solution in self.list(solutions, key)? {
            let joints = JOINTS.iter().find_map(|key| solution.get(key));
            self.answer(asked.clone(), joints.unwrap_or(solution), made)?;
        }
        Ok(())
    }

    fn asked(&self, node: &YamlNode) -> Result<Asked, Finding> {
        match (node.get("goal"), node.get("pose")) {
            (Some(goal), Some(_)) => {
                Err(self.finding(goal, "both `goal` and `pose`: an answer is to one of them"))
            }
            (Some(goal), None) => match &goal.value {
                YamlValue::Scalar(name) => Ok(Asked::NamedGoal(name.clone())),
                _ => Err(self.finding(goal, "`goal` is the name of a goal")),
            },
            (None, Some(pose)) => Ok(Asked::BaseFromFlange(self.pose(pose)?)),
            (None, None) => Ok(Asked::Goal),
        }
    }

    fn pose(&self, node: &YamlNode) -> Result<Pose, Finding> {
        let pose = match self.numbers(node, "pose")?[..] {
            [x, y, z, a, b, c] => {
                of_vector(self.file, Vector3::new(x, y, z), Vector3::new(a, b, c))
            }
            [x, y, z, a, b, c, d] => of_quaternion(
                self.file,
                Vector3::new(x, y, z),
                Quaternion::new(d, a, b, c),
            ),
            _ => {
                let message =
                    "`pose` has the numbers x, y, z, rx, ry, rz, or x, y, z, qx, qy, qz, qw";
                return Err(self.finding(node, message).key("pose"));
            }
        };
        pose.map_err(|finding| finding.at(self.text, node.span.clone()))
    }

    fn answer(&self, asked: Asked, node: &YamlNode, made: &mut Made) -> Result<(), Finding> {
        let numbers = self.numbers(node, "joints")?;
        if numbers.len() != JOINT_COUNT {
            let message = format!("{} joint positions, not {JOINT_COUNT}", numbers.len());
            return Err(self.finding(node, message));
        }
        let line = Some(self.line(node));
        made.answer(asked, line, Joints::from_column_slice(&numbers));
        Ok(())
    }
}
