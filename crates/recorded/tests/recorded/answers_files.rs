//! Answers of solvers of inverse kinematics, in every format that is read.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use needlebench_kinematics::Joints;
use needlebench_recorded::{AnswersFile, Asked, read_answers};
use parquet::basic::Compression;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use tempfile::TempDir;

fn joints(row: usize) -> Joints {
    Joints::from_fn(|joint, _| 0.1 * row as f64 - 0.2 * joint as f64 + 1.0 / 3.0)
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> AnswersFile {
        let path = self.write(name, bytes);
        read_answers(&path).unwrap_or_else(|wrong| panic!("{name}: {wrong:?}"))
    }

    /// What is wrong with a file: its line and all that is said.
    fn refused(&self, name: &str, bytes: impl AsRef<[u8]>) -> (Option<usize>, String) {
        let wrong = read_answers(&self.write(name, bytes)).unwrap_err();
        (wrong[0].line, wrong[0].to_string())
    }
}

/// Numbers that are read back bit for bit.
fn cells(row: usize, separator: &str) -> String {
    let cells: Vec<String> = joints(row).iter().map(|each| format!("{each:?}")).collect();
    cells.join(separator)
}

/// Answers to two goals, three to the first and one to the second, whatever the order of rows.
fn check_goals(file: &AnswersFile) {
    let found: Vec<(Asked, Vec<(usize, Joints)>)> = file
        .questions
        .iter()
        .map(|question| {
            let answers = question.answers.iter();
            let answers = answers.map(|answer| (answer.number, answer.joints));
            (question.asked.clone(), answers.collect())
        })
        .collect();
    let named = |name: &str| Asked::NamedGoal(name.to_owned());
    assert_eq!(
        found,
        [
            (
                named("a"),
                vec![(1, joints(0)), (3, joints(2)), (4, joints(3))]
            ),
            (named("b"), vec![(2, joints(1))]),
        ]
    );
    assert_eq!(file.source.answers, 4);
}

const GOALS: [&str; 4] = ["a", "b", "a", "a"];

#[test]
fn tables_json_and_parquet_say_the_same() {
    let folder = Folder::new();
    for (header, separator) in [
        ("goal,q1,q2,q3,q4,q5,q6", ","),
        ("goal;q_0;q_1;q_2;q_3;q_4;q_5", ";"),
        (
            "goal\tshoulder_pan_joint\tshoulder_lift_joint\telbow_joint\twrist_1_joint\twrist_2_joint\twrist_3_joint",
            "\t",
        ),
    ] {
        let mut text = format!("# of a solver\n{header}\n");
        for (row, goal) in GOALS.iter().enumerate() {
            writeln!(text, "{goal}{separator}{}", cells(row, separator)).unwrap();
        }
        let file = folder.read("answers.csv", &text);
        check_goals(&file);
        let lines = file.questions[0].answers.iter().map(|answer| answer.line);
        assert_eq!(lines.collect::<Vec<_>>(), [Some(3), Some(5), Some(6)]);
    }
    let rows: Vec<String> = GOALS
        .iter()
        .enumerate()
        .map(|(row, goal)| format!("{{\"goal\": \"{goal}\", \"q\": [{}]}}", cells(row, ", ")))
        .collect();
    check_goals(&folder.read("answers.json", format!("[\n{}\n]", rows.join(",\n"))));

    check_goals(&folder.read("answers.parquet", in_parquet()));
}

/// As pandas writes it: compressed with snappy, columns that may lack values.
fn in_parquet() -> Vec<u8> {
    let columns: Vec<String> = (1..=6).map(|k| format!("optional double q{k};")).collect();
    let schema = format!(
        "message schema {{ optional byte_array goal (UTF8); {} }}",
        columns.join(" ")
    );
    let schema = Arc::new(parse_message_type(&schema).unwrap());
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .build();
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties)).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let defined = [1; GOALS.len()];
    let mut joint = 0;
    while let Some(mut column) = group.next_column().unwrap() {
        match column.untyped() {
            ColumnWriter::ByteArrayColumnWriter(writer) => {
                let names = GOALS.map(ByteArray::from);
                writer.write_batch(&names, Some(&defined), None).unwrap();
            }
            ColumnWriter::DoubleColumnWriter(writer) => {
                let values: Vec<f64> = (0..GOALS.len()).map(|row| joints(row)[joint]).collect();
                writer.write_batch(&values, Some(&defined), None).unwrap();
                joint += 1;
            }
            _ => unreachable!(),
        }
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
    bytes
}

/// NumPy's format, version 1, of NEP 1.
fn npy(kind: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values);
    bytes
}

#[test]
fn arrays_of_numpy_are_rows_of_one_goal() {
    let folder = Folder::new();
    let doubles: Vec<u8> = (0..3)
        .flat_map(|row| {
            joints(row)
                .iter()
                .flat_map(|each| each.to_le_bytes())
                .collect::<Vec<_>>()
        })
        .collect();
    let file = folder.read("a.npy", npy("<f8", "(3, 6)", &doubles));
    assert_eq!(file.questions.len(), 1);
    assert_eq!(file.questions[0].asked, Asked::Goal);
    let found: Vec<Joints> = file.questions[0]
        .answers
        .iter()
        .map(|each| each.joints)
        .collect();
    assert_eq!(found, [0, 1, 2].map(joints));
    for (bytes, said) in [
        (
            npy("<f8", "(3, 6)", &doubles[8..]),
            "136 bytes of values for 3 x 6",
        ),
        (
            npy("<f8", "(6, 3)", &doubles),
            "the array has the shape (6, 3)",
        ),
        (
            npy("<i8", "(3, 6)", &doubles),
            "the values are of the type `<i8`",
        ),
        (
            b"\x93NUMPY\x01\x00\xff\xff".to_vec(),
            "the array is cut off",
        ),
        (b"\x93NUMPY".to_vec(), "the array is cut off"),
        (
            npy("<f8", "(99999999999999999999, 6)", &doubles),
            "not n x 6",
        ),
        (
            npy("<f8", "(9999999999999999999, 6)", &doubles),
            "bytes of values",
        ),
    ] {
        let (_, text) = folder.refused("a.npy", bytes);
        assert!(text.contains(said), "{said}: {text}");
    }
}

#[test]
fn poses_are_questions_of_their_own() {
    let folder = Folder::new();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let table = format!(
        "x,y,z,qx,qy,qz,qw,q1,q2,q3,q4,q5,q6\n\
         0.1,0.2,0.3,0,0,{half:?},{half:?},{}\n\
         0.1,0.2,0.4,0,0,0,1,{}\n\
         0.1,0.2,0.3,0,0,{half:?},{half:?},{}\n",
        cells(0, ","),
        cells(1, ","),
        cells(2, ",")
    );
    let file = folder.read("poses.csv", table);
    let counts: Vec<usize> = file
        .questions
        .iter()
        .map(|each| each.answers.len())
        .collect();
    assert_eq!(counts, [2, 1]);
    let Asked::BaseFromFlange(pose) = &file.questions[0].asked else {
        panic!("{:?}", file.questions[0].asked);
    };
    let turned = pose.rotation * nalgebra::Vector3::x();
    assert!((turned - nalgebra::Vector3::y()).norm() < 1e-15, "{turned}");
    // The same pose by its rotation vector, without answers.
    let quarter = std::f64::consts::FRAC_PI_2;
    let text = format!("[{{\"pose\": [0.1, 0.2, 0.3, 0, 0, {quarter:?}], \"solutions\": []}}]");
    let asked = folder.read("poses.json", text).questions.remove(0);
    let Asked::BaseFromFlange(same) = asked.asked else {
        panic!("{:?}", asked.asked);
    };
    assert!(asked.answers.is_empty());
    assert!((pose.to_homogeneous() - same.to_homogeneous()).amax() < 1e-15);
}

#[test]
fn bare_numbers_are_joints_in_their_order() {
    let folder = Folder::new();
    let file = folder.read(
        "bare.txt",
        format!("{}\n{}\n", cells(0, " "), cells(1, " ")),
    );
    let found: Vec<Joints> = file.questions[0]
        .answers
        .iter()
        .map(|each| each.joints)
        .collect();
    assert_eq!(found, [0, 1].map(joints));
    assert!(
        file.notes[0].contains("no names of columns"),
        "{:?}",
        file.notes
    );
    let file = folder.read(
        "bare.json",
        format!("[[{}], [{}]]", cells(0, ","), cells(1, ",")),
    );
    assert_eq!(file.questions[0].answers.len(), 2);
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let folder = Folder::new();
    let header = "goal,q1,q2,q3,q4,q5,q6";
    let row = format!("a,{}", cells(0, ","));
    for (name, text, line, said) in [
        ("a.csv", String::new(), None, "the file is empty"),
        (
            "a.csv",
            format!("{header}\n"),
            None,
            "the file has no answers",
        ),
        (
            "a.csv",
            "q1,q2,q3,q4,q5\n".to_owned(),
            Some(1),
            "no column for wrist_3_joint",
        ),
        (
            "a.csv",
            format!("{header}\n{row}\na,1,2\n"),
            Some(3),
            "3 values for 7 columns",
        ),
        (
            "a.csv",
            format!("{header}\n{row}\na,1,2,x,4,5,6\n"),
            Some(3),
            "`x` is no number",
        ),
        (
            "a.csv",
            format!("{header}\na,90,2,3,4,5,6\n"),
            Some(2),
            "more than two revolutions",
        ),
        (
            "a.csv",
            format!("{header}\na,nan,2,3,4,5,6\n"),
            Some(2),
            "shoulder_pan_joint is NaN rad",
        ),
        (
            "a.csv",
            format!("{header},q1\n"),
            Some(1),
            "a second column of what `q1` is",
        ),
        (
            "a.csv",
            "shoulder_pan_deg,q2\n".to_owned(),
            Some(1),
            "is in degrees",
        ),
        (
            "a.csv",
            format!("x,y,{header}\n"),
            Some(1),
            "the columns of the pose are not complete",
        ),
        (
            "a.csv",
            format!("x,y,z,rx,ry,rz,{header}\n"),
            Some(1),
            "both a column `goal` and columns of a pose",
        ),
        (
            "a.json",
            "[[1,2,3]]".to_owned(),
            Some(1),
            "3 joint positions, not 6",
        ),
        (
            "a.json",
            "{\"goal\": \"a\", \"solutions\": 3}".to_owned(),
            Some(1),
            "`solutions` has to be a list",
        ),
        (
            "a.json",
            "[{\"pose\": [1,2], \"solutions\": []}]".to_owned(),
            Some(1),
            "x, y, z, rx, ry, rz",
        ),
        (
            "a.json",
            "[\n{\"pose\": [0,0,0,0,0,0,2], \"solutions\": []}]".to_owned(),
            Some(2),
            "the quaternion has the length 2",
        ),
        (
            "a.json",
            "[{\"goal\": \"a\"}]".to_owned(),
            Some(1),
            "neither joint positions nor solutions",
        ),
    ] {
        let (found, text) = folder.refused(name, text);
        assert!(text.contains(said), "{said}: {text}");
        assert_eq!(found, line, "{text}");
    }
    let (_, text) = folder.refused("a.bin", b"\xff\xfe\x00");
    assert!(text.contains("neither text"), "{text}");
    let (_, text) = folder.refused("a.parquet", b"PAR1nothing of the kind");
    assert!(text.contains("not a Parquet file"), "{text}");
}
