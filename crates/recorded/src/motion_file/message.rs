//! `trajectory_msgs/JointTrajectory`, alone or in MoveIt's messages, as JSON or YAML.

use needlebench_input::{Finding, YamlNode, YamlValue, parse_yaml_documents};
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES, Joints};

use super::Points;
use crate::joint_states::places;

const HINT: &str = "a motion has the keys of trajectory_msgs/JointTrajectory: joint_names and points with positions \
                    and time_from_start";

/// Reads the points of all trajectories of a file, in their order: of its documents, and of a list that MoveIt's
/// `DisplayTrajectory` has. Each further one begins at the end of the one before it.
pub(super) fn read(file: &str, text: &str) -> Result<Points, Vec<Finding>> {
    let documents = parse_yaml_documents(file, text).map_err(|finding| vec![finding.hint(HINT)])?;
    let reader = Reader { file, text };
    let mut messages = Vec::new();
    for document in &documents {
        reader.messages(document, &mut messages)?;
    }
    let mut whole: Option<Points> = None;
    for message in messages {
        let part = reader.points(message)?;
        whole = Some(match whole {
            None => part,
            Some(whole) => reader.joined(whole, part, message)?,
        });
    }
    whole.ok_or_else(|| vec![Finding::new(file, "the file is empty").hint(HINT)])
}

struct Reader<'a> {
    file: &'a str,
    text: &'a str,
}

/// Points that two trajectories share may differ by what is written of them, rad.
const SAME_POINT_RAD: f64 = 1e-6;

impl Reader<'_> {
    fn finding(&self, node: &YamlNode, message: impl Into<String>) -> Finding {
        Finding::new(self.file, message).at(self.text, node.span.clone())
    }

    /// The `JointTrajectory` messages in a document.
    fn messages<'n>(
        &self,
        node: &'n YamlNode,
        found: &mut Vec<&'n YamlNode>,
    ) -> Result<(), Vec<Finding>> {
        if node.get("points").is_some() {
            found.push(node);
            return Ok(());
        }
        // Ours and MoveIt's `RobotTrajectory`; goals of actions; `DisplayTrajectory`, and lists of any.
        for key in ["joint_trajectory", "trajectory", "robot_trajectory", "goal"] {
            if let Some(inner) = node.get(key) {
                return self.messages(inner, found);
            }
        }
        if let YamlValue::Sequence(items) = &node.value {
            for item in items {
                self.messages(item, found)?;
            }
            return Ok(());
        }
        Err(vec![self.finding(node, "no joint trajectory").hint(HINT)])
    }

    /// Puts a trajectory behind another one. Where it begins with the point at which that one ends, the point is
    /// passed once.
    fn joined(
        &self,
        mut whole: Points,
        mut part: Points,
        node: &YamlNode,
    ) -> Result<Points, Vec<Finding>> {
        let is_timed = |points: &Points| !points.times_s.is_empty();
        let has = |points: &Points| [1, 2].map(|kind| !points.values[kind].is_empty());
        if is_timed(&whole) != is_timed(&part) || has(&whole) != has(&part) {
            let message = "this trajectory does not have the same fields as those before it";
            let hint = "give all of them times, velocities and accelerations, or none";
            return Err(vec![self.finding(node, message).hint(hint)]);
        }
        let (last, first) = (whole.values[0].last(), part.values[0].first());
        let is_same = last
            .zip(first)
            .is_some_and(|(last, first)| (last - first).amax() <= SAME_POINT_RAD);
        if !is_same && is_timed(&whole) && part.times_s.first() == Some(&0.0) {
            let message = "this trajectory does not begin where the one before it ends";
            let hint = "trajectories of one file follow each other without a gap";
            return Err(vec![self.finding(node, message).hint(hint)]);
        }
        let skipped = usize::from(is_same);
        let begins_s = whole.times_s.last().copied().unwrap_or(0.0);
        let times_s = part.times_s.iter().skip(skipped);
        whole
            .times_s
            .extend(times_s.map(|time_s| begins_s + time_s));
        for (all, more) in whole.values.iter_mut().zip(&mut part.values) {
            all.extend(more.drain(..).skip(skipped));
        }
        whole.places.extend(part.places.drain(..).skip(skipped));
        whole.notes.extend(part.notes);
        whole.notes.dedup();
        Ok(whole)
    }

    fn points(&self, message: &YamlNode) -> Result<Points, Vec<Finding>> {
        let one = |finding: Finding| vec![finding];
        let Some(names) = message.get("joint_names") else {
            let message = self.finding(message, "the trajectory has no joint_names");
            return Err(one(message.key("joint_names").hint(HINT)));
        };
        let (order, notes) = self.order(names)?;
        let count = self.sequence(names, "joint_names")?.len();
        let mut points = Points {
            format: "joint trajectory",
            times_s: Vec::new(),
            values: [Vec::new(), Vec::new(), Vec::new()],
            places: Vec::new(),
            notes,
        };
        let nodes = message
            .get("points")
            .map(|all| self.sequence(all, "points"));
        for (index, node) in nodes.transpose()?.unwrap_or_default().iter().enumerate() {
            let keys = ["positions", "velocities", "accelerations"];
            for ((key, unit), values) in keys
                .iter()
                .zip(["rad", "rad/s", "rad/s^2"])
                .zip(&mut points.values)
            {
                let joints = match node.get(key) {
                    Some(values) => self.joints(values, key, unit, &order, count)?,
                    None => None,
                };
                let Some(joints) = joints else {
                    if *key == "positions" {
                        let message = format!("point {} has no positions", index + 1);
                        return Err(one(self.finding(node, message).key(*key).hint(HINT)));
                    }
                    if !values.is_empty() {
                        let message =
                            format!("point {} has no {key}, those before it do", index + 1);
                        let hint = "every point has them, or none";
                        return Err(one(self.finding(node, message).key(*key).hint(hint)));
                    }
                    continue;
                };
                if values.len() < index {
                    let message = format!("point {} has {key}, those before it do not", index + 1);
                    let hint = "every point has them, or none";
                    return Err(one(self.finding(node, message).key(*key).hint(hint)));
                }
                values.push(joints);
            }
            let time_s = node
                .get("time_from_start")
                .map(|time| self.time_s(time))
                .transpose()?;
            match time_s {
                Some(time_s) if points.times_s.len() == index => points.times_s.push(time_s),
                None if points.times_s.is_empty() => {}
                _ => {
                    let does = if time_s.is_some() {
                        "has a time"
                    } else {
                        "has no time"
                    };
                    let message = format!("point {} {does}, unlike those before it", index + 1);
                    let hint = "every point has time_from_start, or none";
                    let finding = self.finding(node, message).key("time_from_start");
                    return Err(one(finding.hint(hint)));
                }
            }
            points.places.push(node.span.start);
        }
        Ok(points)
    }

    /// Places of the arm's joints among the names.
    fn order(&self, node: &YamlNode) -> Result<([usize; JOINT_COUNT], Vec<String>), Vec<Finding>> {
        let names: Vec<String> = self
            .sequence(node, "joint_names")?
            .iter()
            .map(|name| match &name.value {
                YamlValue::Scalar(text) => Ok(text.clone()),
                _ => Err(vec![self.finding(name, "a joint's name is a word")]),
            })
            .collect::<Result<_, _>>()?;
        let refuse = |message: String| {
            let hint = format!("the arm has the joints {}", JOINT_NAMES.join(", "));
            Err(vec![
                self.finding(node, message).key("joint_names").hint(hint),
            ])
        };
        match places(&names) {
            Ok(Some((order, _))) => {
                let others = names.iter().enumerate();
                let others: Vec<&str> = others
                    .filter(|(at, _)| !order.contains(at))
                    .map(|(_, name)| name.as_str())
                    .collect();
                let mut notes = Vec::new();
                if !others.is_empty() {
                    notes.push(format!(
                        "joints that the arm does not have are left out: {}",
                        others.join(", ")
                    ));
                }
                Ok((order, notes))
            }
            Ok(None) => refuse(format!(
                "the motion is of another arm: its joints are {}",
                names.join(", ")
            )),
            Err(twice) => refuse(format!("two joints are `{twice}`")),
        }
    }

    fn sequence<'n>(&self, node: &'n YamlNode, key: &str) -> Result<&'n [YamlNode], Vec<Finding>> {
        match &node.value {
            YamlValue::Sequence(items) => Ok(items),
            _ => Err(vec![
                self.finding(node, format!("`{key}` has to be a list"))
                    .hint(HINT),
            ]),
        }
    }

    /// Values of the arm's joints; none of an empty list.
    fn joints(
        &self,
        node: &YamlNode,
        key: &str,
        unit: &str,
        order: &[usize; JOINT_COUNT],
        count: usize,
    ) -> Result<Option<Joints>, Vec<Finding>> {
        let items = self.sequence(node, key)?;
        if items.is_empty() {
            return Ok(None);
        }
        if items.len() != count {
            let message = format!("{} {key} for {count} joint names", items.len());
            return Err(vec![self.finding(node, message).key(key)]);
        }
        let mut joints = Joints::zeros();
        for (joint, at) in order.iter().enumerate() {
            joints[joint] = self.number(&items[*at], key, unit)?;
        }
        Ok(Some(joints))
    }

    fn number(&self, node: &YamlNode, key: &str, unit: &str) -> Result<f64, Vec<Finding>> {
        let text = match &node.value {
            YamlValue::Scalar(text) => text.trim(),
            _ => "",
        };
        let special = match text.to_ascii_lowercase().as_str() {
            ".nan" | "nan" | "null" => Some(f64::NAN),
            ".inf" | "inf" => Some(f64::INFINITY),
            "-.inf" | "-inf" => Some(f64::NEG_INFINITY),
            _ => None,
        };
        special.or_else(|| text.parse().ok()).ok_or_else(|| {
            let message = format!("`{text}` is no number");
            vec![
                self.finding(node, message)
                    .key(key)
                    .hint(format!("`{key}` are in {unit}")),
            ]
        })
    }

    /// A time of ROS 2 (`sec`, `nanosec`), of ROS 1 (`secs`, `nsecs`), or a number of seconds.
    fn time_s(&self, node: &YamlNode) -> Result<f64, Vec<Finding>> {
        const KEY: &str = "time_from_start";
        let part = |keys: [&str; 2]| -> Result<Option<f64>, Vec<Finding>> {
            let found = keys.into_iter().find_map(|key| node.get(key));
            found.map(|value| self.number(value, KEY, "s")).transpose()
        };
        match &node.value {
            YamlValue::Map(_) => match (part(["sec", "secs"])?, part(["nanosec", "nsecs"])?) {
                (None, None) => {
                    let message = "a time has `sec` and `nanosec`";
                    Err(vec![self.finding(node, message).key(KEY)])
                }
                // One rounding: whole nanoseconds are exact up to some months.
                (whole, part) => Ok((whole.unwrap_or(0.0) * 1e9 + part.unwrap_or(0.0)) / 1e9),
            },
            _ => self.number(node, KEY, "s"),
        }
    }
}
