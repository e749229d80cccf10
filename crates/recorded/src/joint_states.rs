//! Logs of ROS: `sensor_msgs/JointState` in an MCAP file, as CDR or JSON.

use std::collections::BTreeMap;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use needlebench_input::{Finding, open_input};
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES};
use needlebench_ros::{JointState, NotAMessage, messages};
use sha2::{Digest, Sha256};

use crate::raw::RawLog;
use crate::{EffortMeaning, Quantity, ReadOptions};

const STILL_THERE: &str = "does the file still exist?";

const CUT_OFF: &str = "the file may be cut off; try to repair it with `mcap recover`";

/// Whether a file is one of MCAP, by its first bytes.
pub(crate) fn is_mcap(path: &Path) -> bool {
    open_input(path).is_ok_and(needlebench_ros::is_mcap)
}

/// Reads all joint states of one topic; with them the SHA-256 of the file.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<(RawLog, String), Vec<Finding>> {
    let file = path.display().to_string();
    let refuse = |message: String, hint: &str| vec![Finding::new(&file, message).hint(hint)];
    let open = || {
        open_input(path).map_err(|error| {
            let hint = error.hint("the path is relative to the working directory");
            refuse(format!("cannot read the log: {error}"), hint)
        })
    };
    let hash = hash_of(open()?).map_err(|error| refuse(error.to_string(), STILL_THERE))?;
    let (topic, others) = choose_topic(&file, BufReader::new(open()?), options.topic.as_deref())?;
    let mut raw = RawLog::default();
    raw.notes.extend(others);
    let quantities = [
        Quantity::Time,
        Quantity::ActualQ,
        Quantity::ActualQd,
        Quantity::ActualTorque,
    ];
    raw.expect(quantities, 0);
    let (mut broken, mut without_stamp, mut others) = (None, 0, 0);
    let mut prefix: Option<String> = None;
    let whole = messages(BufReader::with_capacity(1 << 20, open()?));
    for message in whole.map_err(|error| refuse(error.to_string(), STILL_THERE))? {
        let message = match message {
            Ok(message) => message,
            Err(error) => {
                broken = Some(error.to_string());
                break;
            }
        };
        if message.topic() != topic {
            continue;
        }
        raw.rows_in_file += 1;
        let number = raw.rows_in_file;
        let parsed = JointState::decode(message.encoding(), message.data());
        let state = parsed.map_err(|error| {
            let message = format!("message {number} of {topic} is not a joint state: {error}");
            let hint = match error {
                NotAMessage::Encoding(encoding) if encoding == "ros1" => {
                    "ROS 1 messages are not supported: convert the bag to ROS 2 with `rosbags-convert`"
                }
                _ => "supported encodings: CDR and JSON",
            };
            refuse(message, hint)
        })?;
        let Some((places, of)) = places(&state.name).map_err(|name| {
            let message = format!("message {number} of {topic} has two joints `{name}`");
            refuse(
                message,
                "record one arm per topic, or choose another topic: --topic NAME",
            )
        })?
        else {
            others += 1;
            continue;
        };
        let first = prefix.get_or_insert_with(|| of.to_owned());
        if first != of {
            return Err(two_arms(&file, &topic, first, of));
        }
        let stamp_s = state.header.stamp.seconds();
        let logged_s = message.log_time_ns() as f64 * 1e-9;
        let time_s = stamp_s.unwrap_or(logged_s);
        // A clock that starts at zero was zero once.
        without_stamp += usize::from(stamp_s.is_none() && logged_s > 0.0);
        let of = |values: &[f64]| places.map(|at| values.get(at).copied().unwrap_or(f64::NAN));
        let mut cut = None;
        raw.add(Quantity::Time, &[time_s], &mut cut);
        raw.add(Quantity::ActualQ, &of(&state.position), &mut cut);
        raw.add(Quantity::ActualQd, &of(&state.velocity), &mut cut);
        raw.add(Quantity::ActualTorque, &of(&state.effort), &mut cut);
        raw.end_row(number, cut);
    }
    if let Some(error) = broken {
        if raw.rows() == 0 {
            return Err(refuse(format!("cannot read the log: {error}"), CUT_OFF));
        }
        raw.notes.push(format!(
            "the file is cut off after {} messages of {topic} ({error})",
            raw.rows_in_file
        ));
    }
    if raw.rows() == 0 {
        let message = format!("no message of {topic} has the six joints of a UR arm");
        let hint = format!("names end in {}", JOINT_NAMES.join(", "));
        return Err(refuse(message, &hint));
    }
    if others > 0 {
        raw.notes.push(format!(
            "{others} of {} messages of {topic} left out: other joints",
            raw.rows_in_file
        ));
    }
    if without_stamp > 0 {
        raw.notes.push(format!(
            "{without_stamp} messages have no time stamp: log times are used"
        ));
    }
    name_effort(&file, &mut raw, options.effort)?;
    Ok((raw, hash))
}

/// Gives `effort` its meaning, if the log has any.
fn name_effort(
    file: &str,
    raw: &mut RawLog,
    meaning: Option<EffortMeaning>,
) -> Result<(), Vec<Finding>> {
    let effort = &raw.values[&Quantity::ActualTorque];
    if effort
        .iter()
        .all(|value| !value.is_finite() || *value == 0.0)
    {
        raw.values.remove(&Quantity::ActualTorque);
        return Ok(());
    }
    match meaning {
        None => Err(vec![
            Finding::new(
                file,
                "`effort` in joint states of UR arms has three possible meanings; the log does not \
                 specify which",
            )
            .hint(
                "--effort current (A: drivers for PolyScope before 5.23, and later ones by option), \
                 --effort torque (N m, gravity included) or --effort compensated (N m without \
                 gravity: newer drivers)",
            ),
        ]),
        Some(EffortMeaning::Current) => {
            let current = raw.values.remove(&Quantity::ActualTorque);
            raw.values.extend(current.map(|values| (Quantity::ActualCurrent, values)));
            Ok(())
        }
        Some(EffortMeaning::Torque | EffortMeaning::Compensated) => Ok(()),
    }
}

fn hash_of(file: std::fs::File) -> std::io::Result<String> {
    let mut digest = Sha256::new();
    let mut reader = BufReader::with_capacity(1 << 20, file);
    let mut buffer = vec![0; 1 << 16];
    loop {
        let count = reader.read(&mut buffer)?;
        if count == 0 {
            let hash = digest.finalize();
            return Ok(hash
                .iter()
                .fold(String::new(), |text, byte| text + &format!("{byte:02x}")));
        }
        digest.update(&buffer[..count]);
    }
}

/// Topic on which ROS has the states of an arm's joints.
const ROS_TOPIC: &str = "/joint_states";

/// Topics with joint states.
pub(crate) fn joint_state_topics(path: &Path, file: &str) -> Result<Vec<String>, Vec<Finding>> {
    let refuse = |message: String| vec![Finding::new(file, message).hint(STILL_THERE)];
    let input = open_input(path).map_err(|error| refuse(error.to_string()))?;
    let (topics, _) = topics(BufReader::new(input)).map_err(refuse)?;
    Ok(topics.into_keys().collect())
}

/// Messages with joint states by topic, and what broke the file off.
fn topics(input: impl Read + Seek) -> Result<(BTreeMap<String, usize>, Option<String>), String> {
    let mut topics: BTreeMap<String, usize> = BTreeMap::new();
    for message in messages(input).map_err(|error| error.to_string())? {
        let message = match message {
            Ok(message) => message,
            Err(error) => return Ok((topics, Some(error.to_string()))),
        };
        let kind = message.message_type();
        if kind.is_some_and(|kind| kind.ends_with("JointState")) {
            *topics.entry(message.topic().to_owned()).or_default() += 1;
        }
    }
    Ok((topics, None))
}

/// The topic of joint states: the only one, the one that is named, or that of ROS; with what else there is, where nobody
/// chose.
fn choose_topic(
    file: &str,
    input: impl Read + Seek,
    wanted: Option<&str>,
) -> Result<(String, Option<String>), Vec<Finding>> {
    let refuse = |message: String, hint: String| Err(vec![Finding::new(file, message).hint(hint)]);
    let (topics, broken) = match topics(input) {
        Ok(found) => found,
        Err(error) => return refuse(error, STILL_THERE.to_owned()),
    };
    let names: Vec<&str> = topics.keys().map(String::as_str).collect();
    match (wanted, names.as_slice()) {
        (_, []) if broken.is_some() => {
            let error = broken.unwrap_or_default();
            refuse(format!("cannot read the log: {error}"), CUT_OFF.to_owned())
        }
        (_, []) => refuse(
            "the log has no joint states".to_owned(),
            "record sensor_msgs/JointState messages, such as /joint_states".to_owned(),
        ),
        (Some(wanted), names) if !names.contains(&wanted) => refuse(
            format!("the log has no joint states on `{wanted}`"),
            format!("available: {}", names.join(", ")),
        ),
        (Some(wanted), _) => Ok((wanted.to_owned(), None)),
        (None, [only]) => Ok(((*only).to_owned(), None)),
        (None, several) if several.contains(&ROS_TOPIC) => {
            let note = format!(
                "joint states are read from {ROS_TOPIC}; choose another topic with --topic: {}",
                several.join(", ")
            );
            Ok((ROS_TOPIC.to_owned(), Some(note)))
        }
        (None, several) => refuse(
            format!("the log has joint states on {} topics", several.len()),
            format!("choose one with --topic: {}", several.join(", ")),
        ),
    }
}

/// Several arms on one topic: their states would be taken for one that jumps.
fn two_arms(file: &str, topic: &str, first: &str, other: &str) -> Vec<Finding> {
    let joint = JOINT_NAMES[0];
    let message = format!(
        "joint states of two arms are on {topic}: of `{first}{joint}` and of `{other}{joint}`"
    );
    vec![Finding::new(file, message).hint("record one arm per topic")]
}

/// Places of the six joints among names, and the prefix that they have in common; none if one is missing.
///
/// # Errors
/// A joint that is there twice.
pub(crate) fn places(
    names: &[String],
) -> Result<Option<([usize; JOINT_COUNT], &str)>, &'static str> {
    let mut found = [None; JOINT_COUNT];
    for (at, name) in names.iter().enumerate() {
        let joint = JOINT_NAMES.iter().position(|joint| name.ends_with(joint));
        if let Some(joint) = joint
            && found[joint].replace(at).is_some()
        {
            return Err(JOINT_NAMES[joint]);
        }
    }
    let mut whole = [0; JOINT_COUNT];
    for (place, found) in whole.iter_mut().zip(found) {
        let Some(found) = found else {
            return Ok(None);
        };
        *place = found;
    }
    let first = &names[whole[0]];
    let prefix = first.strip_suffix(JOINT_NAMES[0]).unwrap_or_default();
    Ok(Some((whole, prefix)))
}
