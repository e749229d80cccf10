//! Joint states of ROS in MCAP files.

use std::collections::BTreeMap;

use mcap::Writer;
use mcap::records::MessageHeader;
use needlebench_input::Finding;
use needlebench_kinematics::JOINT_NAMES;
use needlebench_recorded::{Effort, EffortMeaning, ReadOptions, RecordedRun, read_log};

/// Messages of a robot whose joints come in the order of the alphabet.
fn order() -> [usize; 6] {
    [2, 1, 0, 3, 4, 5]
}

fn cdr(time_s: f64, position: &[f64; 6], effort: &[f64; 6], prefix: &str) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    let body = |bytes: &mut Vec<u8>, alignment: usize| {
        while !(bytes.len() - 4).is_multiple_of(alignment) {
            bytes.push(0);
        }
    };
    let u32 = |bytes: &mut Vec<u8>, value: u32| {
        body(bytes, 4);
        bytes.extend(value.to_le_bytes());
    };
    let text = |bytes: &mut Vec<u8>, text: &str| {
        u32(bytes, u32::try_from(text.len()).unwrap() + 1);
        bytes.extend(text.as_bytes());
        bytes.push(0);
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a test's times"
    )]
    let (sec, nanosec) = (time_s as u32, ((time_s % 1.0) * 1e9).round() as u32);
    u32(&mut bytes, sec);
    u32(&mut bytes, nanosec);
    text(&mut bytes, "base_link");
    u32(&mut bytes, 6);
    for joint in order() {
        text(&mut bytes, &format!("{prefix}{}", JOINT_NAMES[joint]));
    }
    for values in [position, &[0.0; 6], effort] {
        u32(&mut bytes, 6);
        for joint in order() {
            body(&mut bytes, 8);
            bytes.extend(values[joint].to_le_bytes());
        }
    }
    bytes
}

fn positions(k: u32) -> [f64; 6] {
    std::array::from_fn(|joint| 0.1 * joint as f64 + 1e-4 * f64::from(k))
}

/// A file of 100 messages on each topic.
fn file(topics: &[&str], effort: f64, cut: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut writer = Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
    let schema = writer
        .add_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
        .unwrap();
    for topic in topics {
        let channel = writer
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
            .unwrap();
        for k in 0..100 {
            let header = header(channel, k);
            let time_s = 100.0 + 0.002 * f64::from(k);
            let data = cdr(time_s, &positions(k), &[effort; 6], "ur3e_");
            writer.write_to_known_channel(&header, &data).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    if cut > 0 {
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - cut]).unwrap();
    }
    folder
}

fn read(folder: &tempfile::TempDir, options: &ReadOptions) -> Result<RecordedRun, Vec<Finding>> {
    read_log(&folder.path().join("log.mcap"), options)
}

#[test]
fn joints_come_in_our_order_and_times_from_the_stamps() {
    let run = read(&file(&["/joint_states"], 0.0, 0), &ReadOptions::default()).unwrap();
    assert_eq!((run.len(), run.source.format), (100, "mcap"));
    assert_eq!(<[f64; 6]>::from(run.actual_q[7]), positions(7));
    assert!((run.time_s[7] - 100.014).abs() < 1e-9);
    assert!(run.effort_nm.is_none() && run.target.is_none());
}

#[test]
fn effort_has_to_be_given_its_meaning() {
    let folder = file(&["/joint_states"], 1.5, 0);
    let findings = read(&folder, &ReadOptions::default()).unwrap_err();
    let hint = findings[0].hint.as_deref().unwrap();
    assert!(
        hint.contains("--effort current") && hint.contains("compensated"),
        "{hint}"
    );
    let with = |effort| {
        let options = ReadOptions {
            effort: Some(effort),
            ..ReadOptions::default()
        };
        read(&folder, &options).unwrap()
    };
    assert_eq!(
        with(EffortMeaning::Current).actual_current_a.unwrap()[0][2],
        1.5
    );
    assert_eq!(
        with(EffortMeaning::Torque).effort_nm.unwrap().1,
        Effort::Torque
    );
    let compensated = with(EffortMeaning::Compensated).effort_nm.unwrap();
    assert_eq!(compensated.1, Effort::Compensated);
}

#[test]
fn of_several_topics_one_is_asked_for() {
    let folder = file(&["/a/joint_states", "/b/joint_states"], 0.0, 0);
    let findings = read(&folder, &ReadOptions::default()).unwrap_err();
    assert!(
        findings[0].hint.as_deref().unwrap().contains("--topic"),
        "{}",
        findings[0]
    );
    let options = ReadOptions {
        topic: Some("/b/joint_states".to_owned()),
        ..ReadOptions::default()
    };
    assert_eq!(read(&folder, &options).unwrap().len(), 100);
    // What the arm itself does is on ROS's own topic.
    let folder = file(&["/joint_states_planned", "/joint_states"], 0.0, 0);
    assert_eq!(read(&folder, &ReadOptions::default()).unwrap().len(), 100);
}

#[test]
fn a_file_that_breaks_off_is_refused_or_read_as_far_as_it_goes() {
    for cut in [200, 2000] {
        match read(&file(&["/joint_states"], 0.0, cut), &ReadOptions::default()) {
            Ok(run) => assert!(run.len() <= 100),
            Err(findings) => assert!(findings[0].hint.is_some(), "{}", findings[0]),
        }
    }
}

/// Head of the message `k` of a channel, 2 ms after the one before.
fn header(channel_id: u16, k: u32) -> MessageHeader {
    MessageHeader {
        channel_id,
        sequence: k,
        log_time: u64::from(k) * 2_000_000 + 7,
        publish_time: 0,
    }
}

/// Messages of two arms by turns on one topic, in records of the file or in chunks.
fn messages(encoding: &str, prefixes: [&str; 2], options: mcap::WriteOptions) -> Vec<u8> {
    let mut writer = options.create(std::io::Cursor::new(Vec::new())).unwrap();
    let schema = writer
        .add_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
        .unwrap();
    let channel = writer
        .add_channel(schema, "/joint_states", encoding, &BTreeMap::new())
        .unwrap();
    for k in 0..100 {
        let header = header(channel, k);
        let prefix = prefixes[k as usize % 2];
        let data = cdr(
            100.0 + 0.002 * f64::from(k),
            &positions(k),
            &[0.0; 6],
            prefix,
        );
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn read_bytes(bytes: &[u8]) -> Result<RecordedRun, Vec<Finding>> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("log.mcap"), bytes).unwrap();
    read(&folder, &ReadOptions::default())
}

fn uncompressed() -> mcap::WriteOptions {
    mcap::WriteOptions::new().compression(None)
}

#[test]
fn two_arms_on_one_topic_are_no_arm_that_jumps() {
    let both = messages("cdr", ["left_", "right_"], uncompressed());
    let findings = read_bytes(&both).unwrap_err();
    let text = &findings[0].message;
    assert!(
        text.contains("`left_shoulder_pan_joint`") && text.contains("`right_shoulder_pan_joint`"),
        "{text}"
    );
}

#[test]
fn messages_of_ros_1_are_named() {
    let findings = read_bytes(&messages("ros1", [""; 2], uncompressed())).unwrap_err();
    assert!(
        findings[0].message.contains("encoded as `ros1`"),
        "{findings:?}"
    );
    assert!(findings[0].hint.as_deref().unwrap().contains("ROS 1"));
}

/// Where records of a kind begin, of the file and not of its chunks.
fn records(bytes: &[u8], kind: u8) -> Vec<usize> {
    let (mut at, mut found) = (8, Vec::new());
    while at + 9 < bytes.len() {
        if bytes[at] == kind {
            found.push(at);
        }
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        at += 9 + usize::try_from(length).unwrap();
    }
    found
}

#[test]
fn lengths_that_lie_are_refused_before_there_is_room_for_them() {
    let plain = messages("cdr", [""; 2], uncompressed());
    let packed = messages("cdr", [""; 2], mcap::WriteOptions::new());
    let loose = messages("cdr", [""; 2], mcap::WriteOptions::new().use_chunks(false));
    for good in [&plain, &packed, &loose] {
        assert_eq!(read_bytes(good).unwrap().len(), 100);
    }
    let with = |bytes: &[u8], at: usize, length: u64| {
        let mut bytes = bytes.to_vec();
        bytes[at..at + 8].copy_from_slice(&length.to_le_bytes());
        bytes
    };
    let chunk = records(&plain, 6)[0];
    let first_inside = chunk + 9 + 40;
    for length in [1 << 20, 3 << 30, 1 << 62, u64::MAX] {
        let schema = records(&loose, 3)[0];
        let packed_chunk = records(&packed, 6)[0];
        let liars = [
            // A record of the file; one within a chunk; a chunk's unpacked and packed sizes.
            with(&loose, schema + 1, length),
            with(&plain, first_inside + 1, length),
            with(&plain, chunk + 9 + 16, length),
            with(&plain, chunk + 9 + 32, length),
            with(&packed, packed_chunk + 9 + 36, length),
        ];
        for (index, bytes) in liars.iter().enumerate() {
            let findings = read_bytes(bytes).unwrap_err();
            let text = &findings[0].message;
            assert!(
                text.contains("states a length of"),
                "{index}, {length}: {text}"
            );
        }
        // What stands before is read, and said to be all.
        let message = records(&loose, 5)[80];
        let run = read_bytes(&with(&loose, message + 1, length)).unwrap();
        assert_eq!(run.len(), 80);
    }
}
