//! A program that runs, cycle by cycle.

mod memory;
mod thread;

use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;

use crate::call::Call;
use crate::code::{Code, Constant, NO_LOCAL, Op, PathStep, Slot, Target};
use crate::compile::Program;
use crate::elements::{Step, element, index, member, replace, size};
use crate::host::Host;
use crate::lexer::shortened;
use crate::live::{Live, Reply};
use crate::operators::{binary, decided, unary};
use crate::place::{Place, ScriptError};
use crate::tree::FunctionKind;
use crate::value::{Value, list, structure};

use self::memory::{Memory, Sum, own_bytes};
use self::thread::{Retry, Thread, Wait};

/// Instructions of a thread in one cycle; it goes on in the next one then. Assumed: a controller counts time.
pub const MOST_INSTRUCTIONS: usize = 10_000;

/// A thread that uses all of its share for so long stops the program, s: assumed.
pub const LONGEST_BUSY_S: f64 = 1.0;

/// Most threads at a time: assumed.
pub const MOST_THREADS: usize = 64;

/// Most functions that wait for each other's return: assumed.
const MOST_CALLS: usize = 200;

/// Instructions that a call of a built-in function counts for.
const CALL_INSTRUCTIONS: usize = 20;

/// A sleep ends in the cycle that is as near to its end as this share of a cycle.
const SLEEP_ROUNDING: f64 = 1e-6;

/// Most lines that are named with what is not simulated.
const MOST_NOTES: usize = 1000;

/// How a program goes on.
#[derive(Debug, Clone, PartialEq)]
pub enum Progress {
    /// In the next cycle.
    Running,
    /// Not at all.
    Ended(End),
}

/// How a program ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// It came to its end.
    Finished,
    /// By `halt`.
    Halted,
    /// By a protective stop that it called for, or that a thread without a pause caused; with the reason.
    ProtectiveStop(String),
    /// By a runtime exception; the offset of its place is not known.
    Exception(ScriptError),
}

/// Why a thread does not go on now.
enum Pause {
    /// It waits, or its share of the cycle is used.
    Waits,
    /// It is over.
    ThreadEnded,
    /// The program is over.
    Ends(End),
}

/// A program that runs on a [`Host`].
///
/// Threads run one after the other in the order in which they were started, each until it waits or has used its share
/// of the cycle; a thread that is started runs from the next cycle on. The same program on a host that answers the
/// same does the same.
#[derive(Debug)]
pub struct Run {
    program: Arc<Program>,
    constants: Vec<Value>,
    globals: Vec<Option<Value>>,
    /// In the order in which they were started.
    threads: Vec<Thread>,
    /// The program ends with this thread.
    main: Option<u32>,
    last_handle: u32,
    /// The thread that has used its share within a critical section: nobody else runs before it has left that.
    locked_by: Option<u32>,
    /// Cycles so far.
    cycle: u64,
    memory: Memory,
    /// Lines of calls that are not simulated, each said once.
    said: BTreeSet<(usize, usize)>,
    end: Option<End>,
}

impl Run {
    /// A program before its first cycle.
    pub fn new(program: impl Into<Arc<Program>>) -> Self {
        let program = program.into();
        let code = &program.code;
        let constants = code.constants.iter().map(|constant| match constant {
            Constant::Number(number) => Value::Number(*number),
            Constant::Text(text) => Value::Text(text.as_str().into()),
            Constant::Truth(truth) => Value::Truth(*truth),
        });
        // Handles of threads that the program starts count from 1: its own are at the other end.
        let own = code.main.map(|routine| (routine, true));
        let beside = code.secondaries.iter().map(|routine| (*routine, false));
        let threads = own.into_iter().chain(beside).zip((0..=u32::MAX).rev());
        let threads = threads.map(|((routine, may_move), id)| {
            let mut thread = Thread::new(id, id, routine as usize, may_move);
            thread.enter(code, routine as usize, Vec::new(), false);
            thread
        });
        let main = code.main.map(|_| u32::MAX);
        Self {
            constants: constants.collect(),
            globals: vec![None; code.globals.len()],
            threads: threads.collect(),
            main,
            last_handle: 0,
            locked_by: None,
            cycle: 0,
            memory: Memory::default(),
            said: BTreeSet::new(),
            end: None,
            program,
        }
    }

    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Does what the program does in one cycle of the controller.
    ///
    /// After the end it does nothing and says the same again. The caller ends a program by dropping it.
    pub fn step(&mut self, host: &mut dyn Host) -> Progress {
        if let Some(end) = &self.end {
            return Progress::Ended(end.clone());
        }
        self.cycle += 1;
        self.wake(host);
        if let Some(end) = self.run_threads(host) {
            if let End::ProtectiveStop(reason) = &end {
                host.protective_stop(reason);
            }
            self.threads.clear();
            self.end = Some(end.clone());
            return Progress::Ended(end);
        }
        Progress::Running
    }

    /// Threads whose waiting is over can run.
    fn wake(&mut self, host: &mut dyn Host) {
        let waits_for_motion = self
            .threads
            .iter()
            .any(|thread| thread.wait == Wait::Motion);
        let is_done = waits_for_motion && host.is_done();
        let alive: BTreeSet<u32> = self.threads.iter().map(|thread| thread.id).collect();
        for thread in &mut self.threads {
            let waits = match thread.wait {
                Wait::Ready | Wait::NextCycle => false,
                Wait::Until(cycle) => self.cycle < cycle,
                Wait::Motion => !is_done,
                Wait::Join(id) => alive.contains(&id),
            };
            if !waits {
                thread.wait = Wait::Ready;
            }
        }
    }

    /// Runs all threads that can; with the end of the program, if it comes.
    fn run_threads(&mut self, host: &mut dyn Host) -> Option<End> {
        // Those that are started in this cycle come in the next one.
        let mut order: Vec<usize> = (0..self.threads.len()).collect();
        let first = self.locked_by.take();
        order.sort_by_key(|index| Some(self.threads[*index].id) != first);
        for index in order {
            let thread = &mut self.threads[index];
            if self.locked_by.is_some() || thread.has_ended || thread.wait != Wait::Ready {
                continue;
            }
            thread.used = thread.used.saturating_sub(MOST_INSTRUCTIONS);
            if thread.used < MOST_INSTRUCTIONS {
                // The others are looked at from within.
                let parked = Thread::new(thread.id, thread.parent, thread.routine, false);
                let mut running = std::mem::replace(thread, parked);
                let pause = self.run_thread(&mut running, host);
                let was_killed = self.threads[index].has_ended;
                self.threads[index] = running;
                let thread = &mut self.threads[index];
                thread.has_ended |= was_killed;
                match pause {
                    Ok(Pause::Waits) => {}
                    Ok(Pause::ThreadEnded) => thread.has_ended = true,
                    Ok(Pause::Ends(end)) => return Some(end),
                    Err(error) => return Some(End::Exception(error)),
                }
            }
            let thread = &mut self.threads[index];
            if thread.has_ended {
                if self.main == Some(thread.id) {
                    return Some(End::Finished);
                }
                continue;
            }
            if thread.wait != Wait::Ready {
                thread.busy_cycles = 0;
                continue;
            }
            thread.busy_cycles += 1;
            // Nobody else runs before a critical section is left, unless it waits.
            self.locked_by = (thread.critical > 0).then_some(thread.id);
            if f64::from(thread.busy_cycles) * host.period_s() >= LONGEST_BUSY_S {
                return Some(End::ProtectiveStop(self.too_long(index)));
            }
        }
        self.threads.retain(|thread| !thread.has_ended);
        self.threads.is_empty().then_some(End::Finished)
    }

    fn too_long(&self, index: usize) -> String {
        let thread = &self.threads[index];
        let routine = &self.program.code.routines[thread.routine];
        let what = match routine.kind {
            FunctionKind::Thread => "thread",
            FunctionKind::Function | FunctionKind::Secondary => "program",
        };
        let line = thread.frames.last().map_or(1, |frame| {
            let routine = &self.program.code.routines[frame.routine];
            routine.place(frame.next).line
        });
        format!(
            "the {what} `{}` computed for {LONGEST_BUSY_S} s without a pause (line {line}): `sync()` is one",
            routine.name
        )
    }

    /// Adds the bytes of a new value, and looks at all values from time to time.
    fn account(&mut self, running: &Thread, bytes: usize) -> Result<(), String> {
        if !self.memory.add(bytes) {
            return Ok(());
        }
        let mut sum = Sum::default();
        for thread in self.threads.iter().chain([running]) {
            sum.bytes += thread.bytes();
            thread.values().for_each(|value| sum.add(value));
        }
        self.globals
            .iter()
            .flatten()
            .for_each(|value| sum.add(value));
        if sum.bytes > memory::MOST_BYTES {
            let most = memory::MOST_BYTES >> 20;
            return Err(format!("the program's values take more than {most} MB"));
        }
        Ok(())
    }

    /// Instructions of a thread until it waits or has used its share.
    fn run_thread(
        &mut self,
        thread: &mut Thread,
        host: &mut dyn Host,
    ) -> Result<Pause, ScriptError> {
        let program = Arc::clone(&self.program);
        let code = &program.code;
        if let Some(retry) = thread.retry.take()
            && let Some(pause) = self.retry(code, thread, retry, host)?
        {
            return Ok(pause);
        }
        while thread.used < MOST_INSTRUCTIONS {
            let Some(frame) = thread.frames.last_mut() else {
                return Ok(Pause::ThreadEnded);
            };
            let routine = &code.routines[frame.routine];
            let at = frame.next;
            let Some(op) = routine.code.get(at) else {
                return Ok(Pause::ThreadEnded);
            };
            frame.next += 1;
            thread.used += 1;
            let place = || routine.place(at);
            let wrong = |message: String| ScriptError::new(place(), message);
            match *op {
                Op::Constant(index) => thread.push(self.constants[index as usize].clone()),
                Op::Nothing => thread.push(Value::Nothing),
                Op::Load(slot) => {
                    let value = match thread.local(slot.local) {
                        Some(value) => Some(value),
                        None => self.globals[slot.global as usize].as_ref(),
                    };
                    match value {
                        None | Some(Value::Nothing) => {
                            let name = shortened(&code.globals[slot.global as usize]);
                            return Err(wrong(format!("`{name}` has no value here")));
                        }
                        Some(value) => {
                            let value = value.clone();
                            thread.push(value);
                        }
                    }
                }
                Op::Store(slot) => {
                    let value = thread.pop();
                    *self.variable(thread, slot) = Some(value);
                }
                Op::StoreLocal(local) => {
                    let value = thread.pop();
                    if let Some(variable) = thread.local_mut(local) {
                        *variable = Some(value);
                    }
                }
                Op::StoreGlobal(slot) => {
                    let value = thread.pop();
                    if let Some(variable) = thread.local_mut(slot.local) {
                        *variable = None;
                    }
                    self.globals[slot.global as usize] = Some(value);
                }
                Op::StorePart { slot, path } => {
                    let bytes = self.store_part(code, thread, slot, path).map_err(wrong)?;
                    self.account(thread, bytes).map_err(wrong)?;
                }
                Op::Element => {
                    let at = index(&thread.pop()).map_err(wrong)?;
                    let value = element(&thread.pop(), at).map_err(wrong)?;
                    thread.push(value);
                }
                Op::Member(name) => {
                    let name = &code.names[name as usize];
                    let value = member(&thread.pop(), name).map_err(wrong)?;
                    thread.push(value);
                }
                Op::Pose => {
                    let mut numbers = [0.0; 6];
                    for number in numbers.iter_mut().rev() {
                        let value = thread.pop();
                        let Value::Number(found) = value else {
                            let kind = value.kind();
                            let message = format!("{kind} in a pose, where a number is needed");
                            return Err(wrong(message));
                        };
                        *number = found;
                    }
                    self.push_new(thread, Value::Pose(Rc::new(numbers)))
                        .map_err(wrong)?;
                }
                Op::List(count) => {
                    let values = thread.pop_all(count as usize);
                    let (value, size) = list(values).map_err(wrong)?;
                    thread.used += size;
                    self.push_new(thread, value).map_err(wrong)?;
                }
                Op::Struct(of) => {
                    let names = &code.structs[of as usize];
                    let values = thread.pop_all(names.len());
                    let names = names
                        .iter()
                        .map(|name| code.names[*name as usize].as_str().into());
                    let (value, size) = structure(names.zip(values).collect()).map_err(wrong)?;
                    thread.used += size;
                    self.push_new(thread, value).map_err(wrong)?;
                }
                Op::Unary(operator) => {
                    let operand = thread.pop();
                    thread.used += size(&operand);
                    let value = unary(operator, operand).map_err(wrong)?;
                    self.push_new(thread, value).map_err(wrong)?;
                }
                Op::Binary(operator) => {
                    let right = thread.pop();
                    let left = thread.pop();
                    thread.used += size(&left) + size(&right);
                    let value = binary(operator, &left, &right).map_err(wrong)?;
                    self.push_new(thread, value).map_err(wrong)?;
                }
                Op::Decided { operator, to } => {
                    let left = thread.stack.last().unwrap_or(&Value::Nothing);
                    if decided(operator, left).is_some() {
                        thread.jump(to);
                    }
                }
                Op::Jump(to) => thread.jump(to),
                Op::JumpUnless(to) => match thread.pop() {
                    Value::Truth(true) => {}
                    Value::Truth(false) => thread.jump(to),
                    other => {
                        let kind = other.kind();
                        let message = format!("the condition is {kind}, and no truth value");
                        return Err(wrong(message));
                    }
                },
                Op::JumpIfGiven { local, to } => {
                    if thread.local(local).is_some() {
                        thread.jump(to);
                    }
                }
                Op::Call(target) => {
                    if thread.frames.len() > MOST_CALLS {
                        let message = format!("calls are more than {MOST_CALLS} levels deep");
                        return Err(wrong(message));
                    }
                    let values = thread.arguments(code, target);
                    let locals = code.routines[target.function as usize].locals;
                    thread.used += locals / 8;
                    let kept = thread.stack.len() + locals;
                    thread.enter(code, target.function as usize, values, target.is_used);
                    self.account(thread, kept * size_of::<Value>())
                        .map_err(wrong)?;
                }
                Op::Builtin(target) => {
                    let builtin = &code.builtins[target.function as usize];
                    let call = Call {
                        place: place(),
                        name: builtin.name,
                        values: thread.arguments(code, target),
                        parameters: builtin.parameters,
                    };
                    let retry = Box::new(Retry {
                        builtin: target.function,
                        is_used: target.is_used,
                        call,
                        since: self.cycle,
                    });
                    if let Some(pause) = self.retry(code, thread, retry, host)? {
                        return Ok(pause);
                    }
                }
                Op::Run(target) => {
                    let values = thread.arguments(code, target);
                    let handle = self.start(code, thread, target, values).map_err(wrong)?;
                    thread.push(Value::Number(f64::from(handle)));
                }
                Op::Kill => {
                    if let Some(id) = self.handle(&thread.pop()).map_err(wrong)? {
                        self.kill(id);
                        let own = self.threads.iter().find(|each| each.id == thread.id);
                        if own.is_some_and(|own| own.has_ended) {
                            return Ok(Pause::ThreadEnded);
                        }
                    }
                }
                Op::Join => {
                    let handle = self.handle(&thread.pop()).map_err(wrong)?;
                    if handle == Some(thread.id) {
                        return Err(wrong("a thread joins itself".to_owned()));
                    }
                    let mut others = self.threads.iter().filter(|each| !each.has_ended);
                    if let Some(id) = handle
                        && others.any(|each| each.id == id)
                    {
                        thread.wait = Wait::Join(id);
                        return Ok(Pause::Waits);
                    }
                }
                Op::EnterCritical => thread.critical = thread.critical.saturating_add(1),
                Op::ExitCritical => thread.critical = thread.critical.saturating_sub(1),
                Op::Pop => drop(thread.pop()),
                Op::Return => {
                    let value = thread.pop();
                    let Some(frame) = thread.frames.pop() else {
                        return Ok(Pause::ThreadEnded);
                    };
                    thread.locals.truncate(frame.base);
                    let Some(caller) = thread.frames.last() else {
                        return Ok(Pause::ThreadEnded);
                    };
                    if frame.is_used {
                        let place = code.routines[caller.routine].place(caller.next - 1);
                        thread.push(something(value, place)?);
                    }
                }
                Op::Halt => return Ok(Pause::Ends(End::Halted)),
                Op::Remote(name) => {
                    let name = shortened(&code.names[name as usize]);
                    return Err(wrong(format!(
                        "`{name}` belongs to a remote program, which is not simulated"
                    )));
                }
            }
        }
        let bytes = thread.stack.len() * size_of::<Value>();
        let at = thread.frames.last().map_or(Place::START, |frame| {
            code.routines[frame.routine].place(frame.next)
        });
        self.account(thread, bytes)
            .map_err(|message| ScriptError::new(at, message))?;
        Ok(Pause::Waits)
    }

    fn variable<'t>(&'t mut self, thread: &'t mut Thread, slot: Slot) -> &'t mut Option<Value> {
        let global = &mut self.globals[slot.global as usize];
        let is_local = match thread.local(slot.local) {
            Some(_) => true,
            None => slot.local != NO_LOCAL && global.is_none(),
        };
        match thread.local_mut(slot.local) {
            Some(local) if is_local => local,
            _ => global,
        }
    }

    /// A value that was made.
    fn push_new(&mut self, thread: &mut Thread, value: Value) -> Result<(), String> {
        let bytes = own_bytes(&value);
        thread.push(value);
        if bytes == 0 {
            return Ok(());
        }
        self.account(thread, bytes)
    }

    /// Puts a value in the place of a part; with the bytes that were copied for it.
    fn store_part(
        &mut self,
        code: &Code,
        thread: &mut Thread,
        slot: Slot,
        path: u32,
    ) -> Result<usize, String> {
        let path = &code.paths[path as usize];
        let mut steps = Vec::with_capacity(path.len());
        for step in path.iter().rev() {
            steps.push(match step {
                PathStep::Index => Step::Index(index(&thread.pop())?),
                PathStep::Member(name) => Step::Member(&code.names[*name as usize]),
            });
        }
        steps.reverse();
        let value = thread.pop();
        let variable = self.variable(thread, slot);
        let Some(variable) = variable else {
            let name = shortened(&code.globals[slot.global as usize]);
            return Err(format!("`{name}` has no value yet"));
        };
        let copied = replace(variable, &steps, value)?;
        thread.used += copied;
        Ok(copied * size_of::<Value>())
    }

    /// Does a call of a built-in function, for the first time or again; with what the thread waits for, if it does.
    fn retry(
        &mut self,
        code: &Code,
        thread: &mut Thread,
        retry: Box<Retry>,
        host: &mut dyn Host,
    ) -> Result<Option<Pause>, ScriptError> {
        let builtin = &code.builtins[retry.builtin as usize];
        let place = retry.call.place;
        let sizes = retry.call.values.iter().flatten().map(size);
        thread.used += CALL_INSTRUCTIONS + sizes.sum::<usize>();
        let is_moving = self
            .threads
            .iter()
            .any(|each| each.wait == Wait::Motion && !each.has_ended);
        let standing = if !thread.may_move {
            Some("a program beside another may not move the arm")
        } else if is_moving {
            Some("another thread moves the arm already")
        } else {
            None
        };
        let period_s = host.period_s();
        let cycles = u32::try_from(self.cycle - retry.since).unwrap_or(u32::MAX);
        let line = (retry.builtin as usize, place.line);
        let is_said =
            builtin.only_notes() && (self.said.contains(&line) || self.said.len() >= MOST_NOTES);
        let reply = if is_said {
            Reply::Value(Value::Nothing)
        } else {
            let mut live = Live {
                host,
                standing,
                waited_s: f64::from(cycles) * period_s,
            };
            builtin.run(&mut live, &retry.call)?
        };
        if builtin.only_notes() && !is_said {
            self.said.insert(line);
        }
        let (wait, value) = match reply {
            Reply::Value(value) => (Wait::Ready, value),
            Reply::NextCycle => (Wait::NextCycle, Value::Nothing),
            Reply::Sleep(time_s) => {
                let cycles = (time_s / period_s - SLEEP_ROUNDING).ceil().max(0.0);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "whole and not negative; what is too long is as long as can be"
                )]
                let cycles = cycles as u64;
                let until = self.cycle.saturating_add(cycles);
                let wait = if cycles > 0 {
                    Wait::Until(until)
                } else {
                    Wait::Ready
                };
                (wait, Value::Nothing)
            }
            Reply::Moving => (Wait::Motion, Value::Nothing),
            Reply::Again => {
                thread.retry = Some(retry);
                thread.wait = Wait::NextCycle;
                return Ok(Some(Pause::Waits));
            }
            Reply::ProtectiveStop => {
                let reason = format!("the program called for it ({place})");
                return Ok(Some(Pause::Ends(End::ProtectiveStop(reason))));
            }
        };
        if retry.is_used {
            let wrong = |message| ScriptError::new(place, message);
            self.push_new(thread, something(value, place)?)
                .map_err(wrong)?;
        }
        thread.wait = wait;
        Ok((thread.wait != Wait::Ready).then_some(Pause::Waits))
    }

    fn start(
        &mut self,
        code: &Code,
        thread: &Thread,
        target: Target,
        values: Vec<Option<Value>>,
    ) -> Result<u32, String> {
        let alive = self.threads.iter().filter(|each| !each.has_ended).count();
        if alive >= MOST_THREADS {
            return Err(format!("there are {MOST_THREADS} threads already"));
        }
        self.last_handle += 1;
        let (routine, id) = (target.function as usize, self.last_handle);
        let mut new = Thread::new(id, thread.id, routine, thread.may_move);
        new.enter(code, routine, values, false);
        self.threads.push(new);
        Ok(id)
    }

    /// The thread that a value is the handle of; none for 0.
    fn handle(&self, value: &Value) -> Result<Option<u32>, String> {
        let Value::Number(number) = value else {
            return Err(format!("{} is no handle of a thread", value.kind()));
        };
        let handle = crate::value::whole(*number).and_then(|handle| u32::try_from(handle).ok());
        match handle {
            Some(0) => Ok(None),
            Some(handle) if handle <= self.last_handle => Ok(Some(handle)),
            _ => Err(format!("{number} is no handle of a thread")),
        }
    }

    /// Ends a thread with those that it started.
    fn kill(&mut self, id: u32) {
        // Those that a thread started come after it.
        let mut killed = BTreeSet::from([id]);
        for thread in &mut self.threads {
            if killed.contains(&thread.id) || killed.contains(&thread.parent) {
                killed.insert(thread.id);
                thread.has_ended = true;
            }
        }
    }
}

/// A value that is not nothing.
fn something(value: Value, place: Place) -> Result<Value, ScriptError> {
    if matches!(value, Value::Nothing) {
        let message = "the function gives nothing, where a value is needed";
        return Err(ScriptError::new(place, message));
    }
    Ok(value)
}
