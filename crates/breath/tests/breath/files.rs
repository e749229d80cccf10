//! Recordings in files.

use std::path::PathBuf;

use needlebench_breath::{LengthUnit, ReadOptions, Recording, read_recording, statistics};
use needlebench_input::Finding;
use needlebench_ros::message::Header;
use needlebench_ros::{McapWriter, Point, PointStamped, Stamp};
use tempfile::TempDir;

use crate::synthetic::{QUIET, along};

struct File {
    _folder: TempDir,
    path: PathBuf,
}

fn file(name: &str, bytes: &[u8]) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    File {
        _folder: folder,
        path,
    }
}

fn read(text: &str, options: &ReadOptions) -> Result<Recording, Vec<Finding>> {
    read_recording(&file("trace.csv", text.as_bytes()).path, options)
}

fn refused(text: &str) -> Finding {
    read(text, &ReadOptions::default()).unwrap_err().remove(0)
}

fn in_mm() -> ReadOptions {
    ReadOptions {
        unit: Some(LengthUnit::Millimetre),
        ..ReadOptions::default()
    }
}

/// A table of two minutes in mm: its header, with a line for each sample.
fn table(header: &str, line: impl Fn(f64, [f64; 3]) -> String) -> String {
    let samples = along(&QUIET.displacement_m(120.0, 5), 0.1);
    let mut text = header.to_owned();
    for (time_s, position) in samples.times_s.iter().zip(&samples.positions_m) {
        text += &line(*time_s, position.map(|each| 1e3 * each));
        text.push('\n');
    }
    text
}

#[test]
fn tables_are_read_whatever_parts_their_cells() {
    let whole = statistics(&QUIET.recording(120.0, 5)).unwrap();
    let comma = |value: f64| format!("{value:.4}").replace('.', ",");
    let all = [
        table("time_s,x_mm,y_mm,z_mm\n", |t, [x, y, z]| {
            format!("{t:.1},{x:.4},{y:.4},{z:.4}")
        }),
        // As trackers write it in countries with a decimal comma: milliseconds, frames, quotes.
        table(
            "\u{feff}\"Frame\";\"Timestamp\";\"x [mm]\";\"y [mm]\";\"z [mm]\"\r\n",
            |t, [x, y, z]| format!("6;{:.0};{};{};{}\r", 1e3 * t, comma(x), comma(y), comma(z)),
        ),
        table(
            "# a comment\nz (mm)\tt\tx (mm)\ty (mm)\n",
            |t, [x, y, z]| format!("{}\t{}\t{}\t{}", comma(z), comma(t), comma(x), comma(y)),
        ),
    ];
    for text in all {
        let found = statistics(&read(&text, &ReadOptions::default()).unwrap()).unwrap();
        assert_eq!(found.breaths, whole.breaths);
        assert!((found.amplitude_m.value - whole.amplitude_m.value).abs() < 1e-6);
    }
    let plain = table("", |t, [x, y, z]| format!("{t:.1} {x:.4} {y:.4} {z:.4}"));
    let found = statistics(&read(&plain, &in_mm()).unwrap()).unwrap();
    assert_eq!(found.breaths, whole.breaths);
    // A tenth of a millimetre in metres is a thousand times more.
    let metres = ReadOptions {
        unit: Some(LengthUnit::Metre),
        ..ReadOptions::default()
    };
    let finding = read(&plain, &metres).unwrap_err().remove(0);
    assert!(finding.message.contains("jumps by"), "{finding}");
}

#[test]
fn columns_are_chosen_by_name_or_number() {
    let whole = statistics(&QUIET.recording(120.0, 5)).unwrap();
    let text = table("seconds,count,a,b,c\n", |t, [x, y, z]| {
        format!("{t:.1},1,{x:.4},{y:.4},{z:.4}")
    });
    for columns in ["seconds,a,b,c", "1,3,4,5", "seconds,c", "1,5"] {
        let options = ReadOptions {
            columns: Some(columns.split(',').map(str::to_owned).collect()),
            ..in_mm()
        };
        let recording = read(&text, &options).unwrap();
        let found = statistics(&recording).unwrap();
        assert_eq!(found.breaths, whole.breaths, "{columns}");
        assert_eq!(
            recording.axis.is_none(),
            !columns.contains('a') && !columns.contains('3')
        );
    }
    for (columns, part) in [
        ("time,a,b", "names 3 columns"),
        ("seconds,d", "no column `d`"),
        ("1,9", "no column `9`"),
        ("1,a,a,b", "twice"),
    ] {
        let options = ReadOptions {
            columns: Some(columns.split(',').map(str::to_owned).collect()),
            ..in_mm()
        };
        let finding = read(&text, &options).unwrap_err().remove(0);
        assert!(finding.message.contains(part), "{finding}");
    }
    let finding = refused(&text);
    assert!(
        finding
            .message
            .contains("no column is a time: seconds, count, a, b, c"),
        "{finding}"
    );
}

#[test]
fn units_that_nobody_gives_and_angles_are_refused() {
    let finding = refused(&table("t,x,y,z\n", |t, [x, y, z]| {
        format!("{t:.1},{x:.4},{y:.4},{z:.4}")
    }));
    assert!(
        finding.message.contains("m or mm")
            && finding.hint.is_some_and(|hint| hint.contains("--unit mm"))
    );
    let finding = refused("time,roll_deg\n0,1\n0.1,2\n");
    assert!(finding.message.contains("no length"), "{finding}");
    assert_eq!(finding.key.as_deref(), Some("roll_deg"));
    let finding = refused("time_s,x_mm,y_mm,z_m\n0,1,1,1\n");
    assert!(
        finding.message.contains("not that of the others"),
        "{finding}"
    );
    let finding = refused("t_mm,position_mm\n0,1\n");
    assert!(finding.message.contains("not in s or ms"), "{finding}");
    let clock = table("t_s,x_mm,y_mm,z_mm\n", |t, [x, y, z]| {
        format!("{:.0},{x:.4},{y:.4},{z:.4}", 1e3 * t)
    });
    let finding = refused(&clock);
    assert!(
        finding
            .message
            .contains("is in s, and its median step is 100: ms by that"),
        "{finding}"
    );
}

#[test]
fn lines_that_are_wrong_are_named() {
    let finding = refused("t,position_mm\n0,1\n0.1,1;5\n0.2,2\n");
    assert_eq!(
        (finding.line, finding.key.as_deref()),
        (Some(3), Some("position_mm"))
    );
    let finding = refused("t,position_mm\n0,1\n0.1,1,5\n0.2,2\n");
    assert_eq!(finding.line, Some(3));
    assert!(finding.message.contains("3 values"), "{finding}");
    assert!(refused("").message.contains("empty"));
    let finding = refused("t,position_mm,patient\n0,1,A\n0.1,1,A\n0.2,1,B\n");
    assert_eq!(
        (finding.line, finding.key.as_deref()),
        (Some(4), Some("patient"))
    );
    assert!(finding.message.contains("`B` after `A`"), "{finding}");
    // The last line may be cut off.
    let whole = table("t_s,x_mm,y_mm,z_mm\n", |t, [x, y, z]| {
        format!("{t:.1},{x:.4},{y:.4},{z:.4}")
    });
    let recording = read(&whole[..whole.len() - 12], &ReadOptions::default()).unwrap();
    assert!(
        recording.findings[0].message.contains("3 values"),
        "{:?}",
        recording.findings
    );
}

fn log(topics: &[&str]) -> Vec<u8> {
    let samples = along(&QUIET.displacement_m(120.0, 5), 0.1);
    let mut writer = McapWriter::new("test").unwrap();
    for (count, position) in (0_u64..).zip(&samples.positions_m) {
        let time_ns = 1_700_000_000_000_000_000 + count * 100_000_000;
        for topic in topics {
            let [x, y, z] = *position;
            let message = PointStamped {
                header: Header {
                    stamp: Stamp::of_ns(time_ns),
                    frame_id: "tracker".to_owned(),
                },
                point: Point { x, y, z },
            };
            writer.write(topic, time_ns, &message).unwrap();
        }
    }
    writer.finish().unwrap()
}

#[test]
fn logs_of_ros_are_read_from_one_topic() {
    let whole = statistics(&QUIET.recording(120.0, 5)).unwrap();
    let recording = read_recording(
        &file("one.mcap", &log(&["/marker"])).path,
        &ReadOptions::default(),
    )
    .unwrap();
    assert_eq!((recording.format, recording.rows), ("mcap", 1201));
    let found = statistics(&recording).unwrap();
    assert!((found.amplitude_m.value - whole.amplitude_m.value).abs() < 1e-6);
    let two = file("two.mcap", &log(&["/a", "/b"]));
    let finding = read_recording(&two.path, &ReadOptions::default())
        .unwrap_err()
        .remove(0);
    assert!(
        finding
            .hint
            .is_some_and(|hint| hint.contains("--topic: /a, /b"))
    );
    let options = ReadOptions {
        topic: Some("/b".to_owned()),
        ..ReadOptions::default()
    };
    assert_eq!(read_recording(&two.path, &options).unwrap().rows, 1201);
    let cut = log(&["/marker"]);
    let cut = read_recording(
        &file("cut.mcap", &cut[..cut.len() / 2]).path,
        &ReadOptions::default(),
    );
    match cut {
        Ok(recording) => assert!(recording.findings[0].message.contains("cut off")),
        Err(findings) => assert!(findings[0].message.contains("no positions"), "{findings:?}"),
    }
}
