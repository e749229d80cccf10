//! Logs of ROS: positions of one topic of an MCAP file.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use needlebench_input::{Finding, read_data, sha256_hex};
use needlebench_ros::{NotAMessage, PointStamped, messages};

use crate::clock::TimeUnit;
use crate::options::ReadOptions;
use crate::samples::Samples;
use crate::source::Source;

const TOPIC_HINT: &str = "record geometry_msgs/PointStamped or PoseStamped messages of one marker";

/// Reads all positions of one topic, by their time stamps; where there is none, by the time of the log.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Source, Vec<Finding>> {
    let file = path.display().to_string();
    let refused = |message: String, hint: &str| vec![Finding::new(&file, message).hint(hint)];
    let bytes = read_data(path).map_err(|error| {
        let hint = error.hint("the path is relative to the working directory");
        refused(format!("cannot read the recording: {error}"), hint)
    })?;
    let mut topics: BTreeMap<String, (Samples, usize)> = BTreeMap::new();
    let mut notes = Vec::new();
    let read =
        messages(Cursor::new(&bytes)).map_err(|error| refused(error.to_string(), TOPIC_HINT))?;
    for message in read {
        let message = match message {
            Ok(message) => message,
            Err(error) => {
                let message = format!("the file is cut off ({error})");
                notes.push(Finding::new(&file, message).hint("what is before that is read"));
                break;
            }
        };
        let kind = message.message_type().unwrap_or_default();
        let is_position = PointStamped::READ_OF
            .iter()
            .any(|each| kind.ends_with(each));
        let is_wanted = options
            .topic
            .as_ref()
            .is_none_or(|wanted| wanted == message.topic());
        if !is_position || !is_wanted {
            continue;
        }
        let (samples, count) = topics.entry(message.topic().to_owned()).or_default();
        *count += 1;
        let stamped = PointStamped::decode(message.encoding(), message.data()).map_err(|error| {
            let message = format!("message {count} of {} is not a position: {error}", message.topic());
            let hint = match error {
                NotAMessage::Encoding(encoding) if encoding == "ros1" => {
                    "ROS 1 messages are not supported: convert the bag to ROS 2 with `rosbags-convert`"
                }
                _ => "supported encodings: CDR and JSON",
            };
            refused(message, hint)
        })?;
        let logged_s = message.log_time_ns() as f64 * 1e-9;
        let point = stamped.point;
        samples
            .times_s
            .push(stamped.header.stamp.seconds().unwrap_or(logged_s));
        samples.positions_m.push([point.x, point.y, point.z]);
        samples.places.push(*count);
    }
    let names: Vec<&str> = topics.keys().map(String::as_str).collect();
    let names = names.join(", ");
    let (mut samples, rows) = match (topics.len(), options.topic.as_deref()) {
        (0, Some(wanted)) => {
            return Err(refused(format!("no positions on `{wanted}`"), TOPIC_HINT));
        }
        (0, None) => return Err(refused("the file has no positions".to_owned(), TOPIC_HINT)),
        (1, _) => topics.into_values().next().unwrap_or_default(),
        (count, _) => {
            let hint = format!("choose one with --topic: {names}");
            return Err(refused(
                format!("the file has positions on {count} topics"),
                &hint,
            ));
        }
    };
    samples.is_log = true;
    // Stamps are times of the day: differences keep their digits.
    let first_s = samples.times_s.first().copied().unwrap_or(0.0);
    for time_s in &mut samples.times_s {
        *time_s -= first_s;
    }
    Ok(Source {
        file,
        sha256: sha256_hex(&bytes),
        format: "mcap",
        rows,
        time_unit: Some(TimeUnit::Second),
        samples,
        notes,
    })
}
