//! Messages of ROS 2 in MCAP files: written and read, without ROS.
//!
//! [`McapWriter`] makes a file of messages, [`messages`] reads one. The messages are those of ROS's own
//! packages ([`message`]), in the same fields and order; on the wire they are CDR. What they say
//! of a robot is the business of others.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod cdr;
mod container;
pub mod message;

pub use container::{Logged, McapWriter, ReadError, WriteError, is_mcap, messages};
pub use message::{JointState, Message, NotAMessage, Point, PointStamped, Stamp};
