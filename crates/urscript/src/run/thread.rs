//! A thread of a program that runs: its stack, and what it waits for.

use crate::call::Call;
use crate::code::{Code, NO_LOCAL, Target};
use crate::value::Value;

/// A function that is being done.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub routine: usize,
    /// The next instruction.
    pub next: usize,
    /// Its names begin here among the thread's.
    pub base: usize,
    /// Its value is used by the one that called it.
    pub is_used: bool,
}

/// What a thread waits for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Wait {
    /// Nothing: it can run.
    Ready,
    /// The end of this cycle.
    NextCycle,
    /// A cycle.
    Until(u64),
    /// The end of what it has begun.
    Motion,
    /// The end of a thread.
    Join(u32),
}

/// A call that is tried again.
#[derive(Debug)]
pub(super) struct Retry {
    pub builtin: u32,
    pub is_used: bool,
    pub call: Call,
    /// The cycle in which it was first tried.
    pub since: u64,
}

#[derive(Debug)]
pub(super) struct Thread {
    pub id: u32,
    /// The thread that started it.
    pub parent: u32,
    pub routine: usize,
    pub may_move: bool,
    pub wait: Wait,
    pub retry: Option<Box<Retry>>,
    pub frames: Vec<Frame>,
    pub stack: Vec<Value>,
    pub locals: Vec<Option<Value>>,
    /// Instructions of this cycle; what was too many counts in the next one.
    pub used: usize,
    /// Cycles without a break in which it used all of its share.
    pub busy_cycles: u32,
    /// Critical sections that it is in.
    pub critical: u32,
    pub has_ended: bool,
}

impl Thread {
    pub fn new(id: u32, parent: u32, routine: usize, may_move: bool) -> Self {
        Self {
            id,
            parent,
            routine,
            may_move,
            wait: Wait::NextCycle,
            retry: None,
            frames: Vec::new(),
            stack: Vec::new(),
            locals: Vec::new(),
            used: 0,
            busy_cycles: 0,
            critical: 0,
            has_ended: false,
        }
    }

    /// Begins a function with the values of its parameters.
    pub fn enter(
        &mut self,
        code: &Code,
        routine: usize,
        values: Vec<Option<Value>>,
        is_used: bool,
    ) {
        let base = self.locals.len();
        self.locals.extend(values);
        self.locals
            .resize(base + code.routines[routine].locals, None);
        self.frames.push(Frame {
            routine,
            next: 0,
            base,
            is_used,
        });
    }

    pub fn push(&mut self, value: Value) {
        self.stack.push(value);
    }

    pub fn pop(&mut self) -> Value {
        self.stack.pop().unwrap_or(Value::Nothing)
    }

    /// The last values of the stack.
    pub fn pop_all(&mut self, count: usize) -> Vec<Value> {
        let first = self.stack.len().saturating_sub(count);
        self.stack.split_off(first)
    }

    /// The last values of the stack, by the parameters that get them.
    pub fn arguments(&mut self, code: &Code, target: Target) -> Vec<Option<Value>> {
        let shape = &code.shapes[target.shape as usize];
        let first = self.stack.len().saturating_sub(shape.given);
        let values = shape.of.iter().map(|given| {
            let value = self.stack.get_mut(first + (*given)?)?;
            Some(std::mem::replace(value, Value::Nothing))
        });
        let values = values.collect();
        self.stack.truncate(first);
        values
    }

    pub fn jump(&mut self, to: u32) {
        if let Some(frame) = self.frames.last_mut() {
            frame.next = to as usize;
        }
    }

    /// The value of a name of the present function, where it has one.
    pub fn local(&self, local: u32) -> Option<&Value> {
        if local == NO_LOCAL {
            return None;
        }
        let base = self.frames.last()?.base;
        self.locals.get(base + local as usize)?.as_ref()
    }

    /// A name of the present function; none at the first level.
    pub fn local_mut(&mut self, local: u32) -> Option<&mut Option<Value>> {
        if local == NO_LOCAL {
            return None;
        }
        let base = self.frames.last()?.base;
        self.locals.get_mut(base + local as usize)
    }

    /// Bytes of its stack and names, without what they refer to.
    pub fn bytes(&self) -> usize {
        self.stack.capacity() * size_of::<Value>()
            + self.locals.capacity() * size_of::<Option<Value>>()
            + self.frames.capacity() * size_of::<Frame>()
    }

    /// All values that it has.
    pub fn values(&self) -> impl Iterator<Item = &Value> {
        let waiting = self.retry.iter().flat_map(|retry| &retry.call.values);
        let named = self.locals.iter().chain(waiting).flatten();
        self.stack.iter().chain(named)
    }
}
