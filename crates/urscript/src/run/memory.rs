//! How much memory a program's values take.

use std::collections::HashSet;
use std::rc::Rc;

use crate::value::Value;

/// Most bytes of all values of a program: assumed. With its text, tree and code a program stays below 100 MB.
pub(super) const MOST_BYTES: usize = 40 << 20;

/// After so many new bytes it is looked what is still there.
const BETWEEN: usize = 8 << 20;

/// Bytes of what a value refers to by itself.
pub(super) fn own_bytes(value: &Value) -> usize {
    const COUNTS: usize = 40;
    match value {
        Value::Nothing | Value::Truth(_) | Value::Number(_) => 0,
        Value::Text(text) => COUNTS + text.len(),
        Value::List(all) => COUNTS + all.capacity() * size_of::<Value>(),
        Value::Pose(_) => COUNTS + size_of::<[f64; 6]>(),
        Value::Struct(all) => COUNTS + all.capacity() * size_of::<(Rc<str>, Value)>(),
    }
}

/// New bytes since the last look.
#[derive(Debug, Default)]
pub(super) struct Memory {
    new: usize,
}

impl Memory {
    /// Adds new bytes; true when it is time to look at all values.
    pub fn add(&mut self, bytes: usize) -> bool {
        self.new += bytes;
        if self.new < BETWEEN {
            return false;
        }
        self.new = 0;
        true
    }
}

/// What is found when all values are looked at: what several refer to counts once.
#[derive(Debug, Default)]
pub(super) struct Sum {
    pub bytes: usize,
    seen: HashSet<*const ()>,
}

impl Sum {
    pub fn add(&mut self, value: &Value) {
        let (address, is_shared): (*const (), bool) = match value {
            Value::Nothing | Value::Truth(_) | Value::Number(_) => return,
            Value::Text(text) => (Rc::as_ptr(text).cast(), Rc::strong_count(text) > 1),
            Value::List(all) => (Rc::as_ptr(all).cast(), Rc::strong_count(all) > 1),
            Value::Pose(all) => (Rc::as_ptr(all).cast(), Rc::strong_count(all) > 1),
            Value::Struct(all) => (Rc::as_ptr(all).cast(), Rc::strong_count(all) > 1),
        };
        if is_shared && !self.seen.insert(address) {
            return;
        }
        self.bytes += own_bytes(value);
        match value {
            Value::List(all) => all.iter().for_each(|each| self.add(each)),
            Value::Struct(all) => all.iter().for_each(|(_, each)| self.add(each)),
            _ => {}
        }
    }
}
