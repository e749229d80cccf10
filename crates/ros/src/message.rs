//! Messages of ROS 2: `std_msgs`, `geometry_msgs`, `sensor_msgs`, `tf2_msgs`, `visualization_msgs`.
//!
//! Fields, their order and constants are those of ROS 2's interface definitions since Humble.

mod marker;

pub use marker::{Colour, Marker, MarkerArray, MarkerShape};

use serde::{Deserialize, Serialize};

use crate::cdr;

/// A type of message that can be written: its fields are those of its definition, in order.
pub trait Message: Serialize + Sized {
    /// Name with package, e.g. `std_msgs/msg/String`.
    const TYPE: &'static str;

    /// Its definition and those of all types in it, as MCAP's `ros2msg` has them.
    fn definition() -> String;

    /// Its bytes.
    fn to_cdr(&self) -> Vec<u8> {
        cdr::encode(self)
    }
}

/// Definition of a message followed by those of the types in it.
fn with_types(own: &str, types: &[(&str, &str)]) -> String {
    let line = "=".repeat(80);
    types.iter().fold(own.to_owned(), |text, (name, fields)| {
        text + &line + "\nMSG: " + name + "\n" + fields
    })
}

const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const HEADER: (&str, &str) = (
    "std_msgs/Header",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
);
const VECTOR3: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) = (
    "geometry_msgs/Quaternion",
    "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
);

/// `builtin_interfaces/msg/Time`.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Stamp {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds besides.
    #[serde(alias = "nsec")]
    pub nanosec: u32,
}

/// Nanoseconds of a second.
const NS: u64 = 1_000_000_000;

impl Stamp {
    /// Of a time in nanoseconds.
    pub fn of_ns(time_ns: u64) -> Self {
        Self {
            sec: i32::try_from(time_ns / NS).unwrap_or(i32::MAX),
            nanosec: u32::try_from(time_ns % NS).unwrap_or_default(),
        }
    }

    /// Seconds; none where it is not set.
    pub fn seconds(self) -> Option<f64> {
        (self != Self::default()).then(|| f64::from(self.sec) + f64::from(self.nanosec) * 1e-9)
    }
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Default, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Header {
    /// When.
    pub stamp: Stamp,
    /// Frame of what follows; empty if it has none.
    pub frame_id: String,
}

/// `sensor_msgs/msg/JointState`.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JointState {
    /// When; its frame is empty.
    pub header: Header,
    /// Names of joints.
    pub name: Vec<String>,
    /// Positions, rad.
    pub position: Vec<f64>,
    /// Velocities, rad/s.
    pub velocity: Vec<f64>,
    /// Efforts, N m; empty where there are none.
    pub effort: Vec<f64>,
}

/// Why bytes are not a message of the expected type.
#[derive(Debug, thiserror::Error)]
pub enum NotAMessage {
    /// CDR that ends too early.
    #[error("it is cut off")]
    CutOff,
    /// Invalid JSON, or JSON of something else.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// Bytes of another kind: `ros1`, `protobuf`.
    #[error("it is encoded as `{0}`")]
    Encoding(String),
}

impl JointState {
    /// Of the bytes of a message in an encoding: `json` or `cdr`.
    ///
    /// # Errors
    /// [`NotAMessage`].
    pub fn decode(encoding: &str, data: &[u8]) -> Result<Self, NotAMessage> {
        match encoding {
            "json" => Ok(serde_json::from_slice(data)?),
            "cdr" => cdr::decode(data).ok_or(NotAMessage::CutOff),
            other => Err(NotAMessage::Encoding(other.to_owned())),
        }
    }
}

impl Message for JointState {
    const TYPE: &'static str = "sensor_msgs/msg/JointState";

    fn definition() -> String {
        with_types(
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
            &[HEADER, TIME],
        )
    }
}

/// Three coordinates, m.
#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// `geometry_msgs/msg/PointStamped`: where a point is.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointStamped {
    /// When, and the frame of the coordinates.
    #[serde(default)]
    pub header: Header,
    /// The coordinates.
    pub point: Point,
}

/// `geometry_msgs/msg/PoseStamped` as JSON, without what follows the position.
#[derive(Deserialize)]
struct PoseStamped {
    #[serde(default)]
    header: Header,
    pose: Position,
}

#[derive(Deserialize)]
struct Position {
    position: Point,
}

impl PointStamped {
    /// Types of messages that [`PointStamped::decode`] reads, without their package.
    pub const READ_OF: [&str; 2] = ["PointStamped", "PoseStamped"];

    /// The position in the bytes of a `PointStamped` or `PoseStamped`, in an encoding: `json` or `cdr`.
    ///
    /// # Errors
    /// [`NotAMessage`].
    pub fn decode(encoding: &str, data: &[u8]) -> Result<Self, NotAMessage> {
        match encoding {
            "json" => serde_json::from_slice(data).or_else(|error| {
                let Ok(PoseStamped { header, pose }) = serde_json::from_slice(data) else {
                    return Err(error.into());
                };
                let point = pose.position;
                Ok(Self { header, point })
            }),
            // The orientation of a pose comes after its position.
            "cdr" => cdr::decode(data).ok_or(NotAMessage::CutOff),
            other => Err(NotAMessage::Encoding(other.to_owned())),
        }
    }
}

impl Message for PointStamped {
    const TYPE: &'static str = "geometry_msgs/msg/PointStamped";

    fn definition() -> String {
        with_types(
            "std_msgs/Header header\ngeometry_msgs/Point point\n",
            &[
                HEADER,
                TIME,
                ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
            ],
        )
    }
}

/// `std_msgs/msg/String`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Text(pub String);

impl Message for Text {
    const TYPE: &'static str = "std_msgs/msg/String";

    fn definition() -> String {
        "string data\n".to_owned()
    }
}

/// `std_msgs/msg/Float64`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Number(pub f64);

impl Message for Number {
    const TYPE: &'static str = "std_msgs/msg/Float64";

    fn definition() -> String {
        "float64 data\n".to_owned()
    }
}

/// A place and a direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pose {
    /// x, y, z, m.
    pub position: [f64; 3],
    /// Unit quaternion, x, y, z, w.
    pub quat_xyzw: [f64; 4],
}

/// `geometry_msgs/msg/TransformStamped`: the place of a child frame in its parent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransformStamped {
    /// When, and the parent.
    pub header: Header,
    /// The child.
    pub child_frame_id: String,
    /// Coordinates in the child to coordinates in the parent.
    pub parent_from_child: Pose,
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TfMessage(pub Vec<TransformStamped>);

impl Message for TfMessage {
    const TYPE: &'static str = "tf2_msgs/msg/TFMessage";

    fn definition() -> String {
        with_types(
            "geometry_msgs/TransformStamped[] transforms\n",
            &[
                (
                    "geometry_msgs/TransformStamped",
                    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
                ),
                HEADER,
                TIME,
                (
                    "geometry_msgs/Transform",
                    "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
                ),
                VECTOR3,
                QUATERNION,
            ],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joint_states_come_back_as_they_were_written() {
        let state = JointState {
            header: Header {
                stamp: Stamp::of_ns(12_000_000_345),
                frame_id: String::new(),
            },
            name: vec!["shoulder_pan_joint".to_owned(), "elbow_joint".to_owned()],
            position: vec![0.1, -2.5e-300],
            velocity: vec![f64::MIN_POSITIVE, 4.0],
            effort: Vec::new(),
        };
        let back = JointState::decode("cdr", &state.to_cdr()).unwrap();
        assert_eq!(back, state);
        assert_eq!(
            (back.header.stamp.sec, back.header.stamp.nanosec),
            (12, 345)
        );
        assert!(JointState::decode("cdr", &state.to_cdr()[..70]).is_err());
    }
    #[test]
    fn positions_are_read_from_points_and_from_poses() {
        let header = Header {
            stamp: Stamp::of_ns(1_500_000_000),
            frame_id: "tracker".to_owned(),
        };
        let point = Point {
            x: 0.1,
            y: -2.0,
            z: 3.5,
        };
        let stamped = PointStamped { header, point };
        let bytes = stamped.to_cdr();
        assert_eq!(PointStamped::decode("cdr", &bytes).unwrap(), stamped);
        assert!(PointStamped::decode("cdr", &bytes[..bytes.len() - 1]).is_err());
        // A pose goes on with its orientation.
        let pose = (&stamped, [0.0, 0.0, 0.0, 1.0]);
        let pose = PointStamped::decode("cdr", &cdr::encode(&pose)).unwrap();
        assert_eq!(pose, stamped);
        let place = r#"{"x": 0.1, "y": -2, "z": 3.5}"#;
        for message in [
            format!(r#"{{"point": {place}}}"#),
            format!(r#"{{"pose": {{"position": {place}, "orientation": {{}}}}}}"#),
        ] {
            let read = PointStamped::decode("json", message.as_bytes()).unwrap();
            assert_eq!(read.point, point);
        }
        assert!(PointStamped::decode("json", b"{}").is_err());
        assert!(PointStamped::decode("ros1", &[]).is_err());
    }
}
