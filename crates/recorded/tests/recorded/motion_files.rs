//! Motions of other planners, written in every format that is read.

use std::fmt::Write as _;
use std::path::PathBuf;

use needlebench_kinematics::JOINT_NAMES;
use needlebench_kinematics::trajectory::Between;
use needlebench_recorded::{Known, MotionFile, MotionOptions, read_motion};
use tempfile::TempDir;

/// Joints as ROS sorts them.
const ORDER: [usize; 6] = [2, 1, 0, 3, 4, 5];

fn at(point: usize) -> [f64; 6] {
    std::array::from_fn(|joint| 0.1 * point as f64 - 0.2 * joint as f64 + 1.0 / 3.0)
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    fn read(&self, name: &str, text: &str) -> MotionFile {
        let path = self.write(name, text);
        read_motion(&path, &MotionOptions::default()).unwrap_or_else(|wrong| panic!("{wrong:?}"))
    }

    /// What is wrong with a file: its line and all that is said.
    fn refused(&self, name: &str, text: &str) -> (Option<usize>, String) {
        let path = self.write(name, text);
        let wrong = read_motion(&path, &MotionOptions::default()).unwrap_err();
        (wrong[0].line, wrong[0].to_string())
    }
}

/// Numbers as JSON and YAML have them.
fn list(values: impl IntoIterator<Item = f64>) -> String {
    let all: Vec<String> = values
        .into_iter()
        .map(|value| format!("{value:?}"))
        .collect();
    format!("[{}]", all.join(", "))
}

fn message(points: usize, extra: impl Fn(usize) -> String) -> String {
    let names: Vec<String> = ORDER
        .iter()
        .map(|joint| format!("\"{}\"", JOINT_NAMES[*joint]))
        .collect();
    let mut all = Vec::new();
    for point in 0..points {
        let positions = list(ORDER.map(|joint| at(point)[joint]));
        all.push(format!("{{\"positions\": {positions}{}}}", extra(point)));
    }
    format!(
        "{{\"joint_names\": [{}], \"points\": [\n{}\n]}}",
        names.join(", "),
        all.join(",\n")
    )
}

fn timed(point: usize) -> String {
    format!(", \"time_from_start\": {{\"sec\": {point}, \"nanosec\": 500000000}}")
}

fn has_points(motion: &MotionFile, points: usize) {
    assert_eq!(motion.states.len(), points);
    for (point, state) in motion.states.iter().enumerate() {
        assert_eq!(<[f64; 6]>::from(state.position), at(point));
    }
}

#[test]
fn the_same_motion_is_read_from_json_yaml_and_tables() {
    let folder = Folder::new();
    let json = message(3, timed);
    let mut yaml = "# ros2 topic echo\njoint_names:\n".to_owned();
    for joint in ORDER {
        let _ = writeln!(yaml, "- {}", JOINT_NAMES[joint]);
    }
    yaml.push_str("points:\n");
    let mut table = "time_s;".to_owned();
    let names: Vec<&str> = ORDER.iter().map(|joint| JOINT_NAMES[*joint]).collect();
    table.push_str(&names.join(";"));
    for point in 0..3 {
        let _ = writeln!(yaml, "- positions:");
        for joint in ORDER {
            let _ = writeln!(yaml, "  - {:?}", at(point)[joint]);
        }
        let _ = writeln!(
            yaml,
            "  time_from_start: {{sec: {point}, nanosec: 500000000}}"
        );
        let values = ORDER.map(|joint| format!("{:?}", at(point)[joint]));
        let _ = write!(table, "\n{point}.5;{}", values.join(";"));
    }
    let moveit = format!("{{\"joint_trajectory\": {json}, \"multi_dof_joint_trajectory\": {{}}}}");
    let shown = format!("{{\"model_id\": \"ur3\", \"trajectory\": [{moveit}]}}");
    for (name, text) in [
        ("a.json", &json),
        ("b.yaml", &format!("{yaml}---\n")),
        ("c.csv", &table),
        ("d.json", &moveit),
        ("e.yaml", &shown),
        ("f", &table),
    ] {
        let motion = folder.read(name, text);
        has_points(&motion, 3);
        assert_eq!(
            motion.times_s.as_deref(),
            Some(&[0.5, 1.5, 2.5][..]),
            "{name}"
        );
        assert_eq!(motion.known, Known::Positions);
        assert_eq!(motion.known.between(), Between::Lines);
    }
}

#[test]
fn velocities_and_accelerations_decide_what_joins_the_points() {
    let folder = Folder::new();
    let with = |accelerations: bool| {
        message(2, |point| {
            let mut text = timed(point);
            let _ = write!(text, ", \"velocities\": {}", list([0.5; 6]));
            if accelerations {
                let _ = write!(text, ", \"accelerations\": {}", list([0.25; 6]));
            }
            text
        })
    };
    let cubic = folder.read("a.json", &with(false));
    assert_eq!(cubic.known.between(), Between::Cubics);
    let quintic = folder.read("b.json", &with(true));
    assert_eq!(quintic.known.between(), Between::Quintics);
    assert_eq!(quintic.states[1].acceleration[5], 0.25);
    assert_eq!(quintic.states[1].velocity[0], 0.5);
}

#[test]
fn way_points_without_times_are_taken_for_what_they_are() {
    let folder = Folder::new();
    let zero = |_: usize| ", \"time_from_start\": {\"sec\": 0, \"nanosec\": 0}".to_owned();
    for text in [message(3, |_| String::new()), message(3, zero)] {
        let motion = folder.read("a.json", &text);
        assert_eq!(motion.times_s, None);
    }
}

#[test]
fn trajectories_that_follow_each_other_are_one_motion() {
    let folder = Folder::new();
    let first = message(3, |point| {
        format!(", \"time_from_start\": {{\"sec\": {point}}}")
    });
    // The second begins where the first ends.
    let second = first.replace(&list(ORDER.map(|joint| at(0)[joint])), "FIRST");
    let second = second.replace(
        &list(ORDER.map(|joint| at(2)[joint])),
        &list(ORDER.map(|joint| at(0)[joint])),
    );
    let second = second.replace("FIRST", &list(ORDER.map(|joint| at(2)[joint])));
    let motion = folder.read("a.yaml", &format!("{first}\n---\n{second}\n"));
    assert_eq!(
        motion.times_s.as_deref(),
        Some(&[0.0, 1.0, 2.0, 3.0, 4.0][..])
    );
    assert_eq!(motion.states[4].position, motion.states[0].position);
    let (_, gap) = folder.refused("b.yaml", &format!("{first}\n---\n{first}\n"));
    assert!(
        gap.contains("does not begin where the one before it ends"),
        "{gap}"
    );
}

#[test]
fn every_mistake_is_refused_with_its_line() {
    let folder = Folder::new();
    let good = message(3, timed);
    let second = list(ORDER.map(|joint| at(1)[joint]));
    let with = |old: &str, new: &str| {
        assert!(good.contains(old), "{old}");
        good.replace(old, new)
    };
    let degrees = list(ORDER.map(|joint| at(1)[joint].to_degrees() + 60.0));
    for (text, line, said) in [
        (with(&second, &degrees), Some(3), "are these degrees?"),
        (
            with(&second, &second.replacen('[', "[.nan, ", 1)),
            Some(3),
            "7 positions for 6 joint names",
        ),
        (
            with(&second, "[0, 0, 0, 0, 0, .nan]"),
            Some(3),
            "wrist_3_joint is NaN rad",
        ),
        (
            with(&second, "[0, 0, 0, 0, 0, x]"),
            Some(3),
            "`x` is no number",
        ),
        (
            with("\"sec\": 1", "\"sec\": 0"),
            Some(3),
            "the same as that of the point before it",
        ),
        (with("\"sec\": 2", "\"sec\": 1"), Some(4), "the same as"),
        (
            with("elbow_joint", "panda_joint3"),
            Some(1),
            "the motion is of another arm",
        ),
        (
            with("\"points\"", "\"way_points\""),
            Some(1),
            "no joint trajectory",
        ),
        (
            with("\"joint_names\"", "\"names\""),
            Some(1),
            "the trajectory has no joint_names",
        ),
        (
            message(1, timed),
            None,
            "1 point: a motion has at least two",
        ),
        (String::new(), None, "the file is empty"),
    ] {
        let (at, message) = folder.refused("a.json", &text);
        assert!(message.contains(said), "{message}");
        assert_eq!(at, line, "{message}");
    }
    let header = format!("t,{}\n", JOINT_NAMES.join(","));
    for (text, line, said) in [
        (
            header.replace("elbow_joint", "elbow_deg"),
            Some(1),
            "is in degrees",
        ),
        (header.replace("elbow_joint", "elbow"), None, "0 points"),
        (
            header.replace("elbow_joint", "x"),
            Some(1),
            "no position of elbow_joint",
        ),
        (
            "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n".to_owned(),
            Some(1),
            "no column names a joint",
        ),
        (
            format!("{header}0,0,0,0,0,0,0\n1,0,0,0,0,0\n"),
            Some(3),
            "6 values for 7 columns",
        ),
        (
            format!("{header}0,0,0,0,0,0,0\n1,0,0,0,0,0,x\n"),
            Some(3),
            "`x` is no number",
        ),
        (
            format!("{header}1,0,0,0,0,0,0\n0,0,0,0,0,0,0\n"),
            Some(3),
            "not after",
        ),
    ] {
        let (at, message) = folder.refused("a.csv", &text);
        assert!(message.contains(said), "{message}");
        assert_eq!(at, line, "{message}");
    }
}
