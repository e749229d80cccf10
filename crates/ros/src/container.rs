//! MCAP files.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use mcap::io::MessageReader;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};

use crate::message::Message;

/// First bytes of an MCAP file.
const MAGIC: &[u8] = &[0x89, b'M', b'C', b'A', b'P'];

/// Whether bytes begin as an MCAP file does.
pub fn is_mcap(mut input: impl Read) -> bool {
    let mut first = [0; MAGIC.len()];
    input.read_exact(&mut first).is_ok() && first == MAGIC
}

/// A message as it stands in a file.
#[derive(Debug, Clone)]
pub struct Logged(mcap::Message<'static>);

impl Logged {
    /// Topic, e.g. `/joint_states`.
    pub fn topic(&self) -> &str {
        &self.0.channel.topic
    }

    /// Type, e.g. `sensor_msgs/msg/JointState`; none where the file does not say.
    pub fn message_type(&self) -> Option<&str> {
        self.0
            .channel
            .schema
            .as_ref()
            .map(|each| each.name.as_str())
    }

    /// `cdr`, `json` or another one.
    pub fn encoding(&self) -> &str {
        &self.0.channel.message_encoding
    }

    /// When it was logged, ns.
    pub fn log_time_ns(&self) -> u64 {
        self.0.log_time
    }

    /// Its bytes.
    pub fn data(&self) -> &[u8] {
        &self.0.data
    }
}

/// Why a file cannot be read on.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct ReadError(#[from] mcap::McapError);

/// Messages of a file in its order, until it breaks off.
pub fn messages(input: impl Read) -> impl Iterator<Item = Result<Logged, ReadError>> {
    MessageReader::new(input).map(|each| Ok(Logged(each?)))
}

/// Why a file cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("the MCAP file cannot be made: {0}")]
pub struct WriteError(#[from] mcap::McapError);

/// Quality of service of topics whose last message is for whoever comes later, as `rosbag2` keeps it with a channel:
/// reliable, transient local, one message. `RViz` asks for it.
const LATCHED: &str = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  avoid_ros_namespace_conventions: false\n";

/// Makes an MCAP file of ROS 2 messages (profile `ros2`): the same bytes of the same messages.
pub struct McapWriter {
    writer: Writer<Cursor<Vec<u8>>>,
    /// Channels and how many messages each has, by topic.
    channels: BTreeMap<String, (u16, u32)>,
}

impl std::fmt::Debug for McapWriter {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let topics = self.channels.keys();
        out.debug_list().entries(topics).finish()
    }
}

impl McapWriter {
    /// An empty file; `library` names the program that makes it.
    ///
    /// # Errors
    /// [`WriteError`]: memory has none.
    pub fn new(library: &str) -> Result<Self, WriteError> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(library)
            // At a fixed level in this thread, so that bytes depend on no machine.
            .compression(Some(Compression::Zstd))
            .compression_level(3)
            .compression_threads(0);
        Ok(Self {
            writer: options.create(Cursor::new(Vec::new()))?,
            channels: BTreeMap::new(),
        })
    }

    /// Adds a record of names and values.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn metadata(
        &mut self,
        name: &str,
        values: BTreeMap<String, String>,
    ) -> Result<(), WriteError> {
        let record = Metadata {
            name: name.to_owned(),
            metadata: values,
        };
        Ok(self.writer.write_metadata(&record)?)
    }

    /// Adds a message; logged and published at the same time. All of a topic are of one type.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write<M: Message>(
        &mut self,
        topic: &str,
        time_ns: u64,
        message: &M,
    ) -> Result<(), WriteError> {
        self.put(topic, time_ns, message, false)
    }

    /// Adds a message that whoever subscribes later is given too: what is fixed.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write_latched<M: Message>(
        &mut self,
        topic: &str,
        time_ns: u64,
        message: &M,
    ) -> Result<(), WriteError> {
        self.put(topic, time_ns, message, true)
    }

    fn put<M: Message>(
        &mut self,
        topic: &str,
        time_ns: u64,
        message: &M,
        latched: bool,
    ) -> Result<(), WriteError> {
        let (channel_id, sequence) = if let Some((id, count)) = self.channels.get_mut(topic) {
            *count += 1;
            (*id, *count)
        } else {
            let definition = M::definition();
            let schema = self
                .writer
                .add_schema(M::TYPE, "ros2msg", definition.as_bytes())?;
            let mut metadata = BTreeMap::new();
            if latched {
                metadata.insert("offered_qos_profiles".to_owned(), LATCHED.to_owned());
            }
            let id = self.writer.add_channel(schema, topic, "cdr", &metadata)?;
            self.channels.insert(topic.to_owned(), (id, 0));
            (id, 0)
        };
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        Ok(self
            .writer
            .write_to_known_channel(&header, &message.to_cdr())?)
    }

    /// The file.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn finish(mut self) -> Result<Vec<u8>, WriteError> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner())
    }
}
