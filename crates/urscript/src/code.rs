//! A program as byte code: what [`Run`](crate::Run) does one instruction after the other.

use crate::builtin::Builtin;
use crate::place::Place;
use crate::tree::{Binary, FunctionKind, Unary};

/// The first level of a program has no names of its own.
pub(crate) const NO_LOCAL: u32 = u32::MAX;

/// A name: that of the function, where it has a value, else the global one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Slot {
    pub local: u32,
    pub global: u32,
}

/// Arguments of a call by parameter: see [`Shape`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Target {
    /// Index of the function or of the built-in one.
    pub function: u32,
    pub shape: u32,
    /// The value is used: there has to be one.
    pub is_used: bool,
}

/// An instruction. Jumps go to instructions of the same function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Op {
    /// Puts a constant on the stack.
    Constant(u32),
    /// Puts nothing on the stack, for a declaration without a value.
    Nothing,
    Load(Slot),
    Store(Slot),
    StoreLocal(u32),
    /// Stores globally; the function's own name has no value from there on.
    StoreGlobal(Slot),
    /// Stores into a part: the value lies below the indices of the path.
    StorePart {
        slot: Slot,
        path: u32,
    },
    Element,
    Member(u32),
    Pose,
    List(u32),
    Struct(u32),
    Unary(Unary),
    Binary(Binary),
    /// Jumps where the operand on the stack decides alone.
    Decided {
        operator: Binary,
        to: u32,
    },
    Jump(u32),
    JumpUnless(u32),
    /// Jumps where a parameter was given.
    JumpIfGiven {
        local: u32,
        to: u32,
    },
    Call(Target),
    Builtin(Target),
    Run(Target),
    Kill,
    Join,
    EnterCritical,
    ExitCritical,
    Pop,
    Return,
    Halt,
    /// A method of a remote program is called.
    Remote(u32),
}

/// A constant.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Constant {
    Number(f64),
    Text(String),
    Truth(bool),
}

/// How many arguments a call has, and which of them each parameter gets.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Shape {
    pub given: usize,
    pub of: Vec<Option<usize>>,
}

/// A step of the path to a part; indices are on the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PathStep {
    Index,
    /// Index of the name.
    Member(u32),
}

/// A function as instructions.
#[derive(Debug, Clone)]
pub(crate) struct Routine {
    pub name: String,
    pub kind: FunctionKind,
    /// Names of its own, parameters first.
    pub locals: usize,
    pub code: Vec<Op>,
    /// Line and column of each instruction.
    pub places: Vec<[u32; 2]>,
}

impl Routine {
    /// Where an instruction stands in the text; its offset is not kept.
    pub fn place(&self, instruction: usize) -> Place {
        let [line, column] = self.places.get(instruction).copied().unwrap_or([1, 1]);
        Place {
            offset: 0,
            line: line as usize,
            column: column as usize,
        }
    }
}

/// All that a program consists of.
#[derive(Clone)]
pub(crate) struct Code {
    pub routines: Vec<Routine>,
    /// The routine that is the program.
    pub main: Option<u32>,
    /// Routines that run beside it and may not move.
    pub secondaries: Vec<u32>,
    /// Names of global variables.
    pub globals: Vec<String>,
    pub constants: Vec<Constant>,
    /// Names of members.
    pub names: Vec<String>,
    pub paths: Vec<Vec<PathStep>>,
    pub structs: Vec<Vec<u32>>,
    pub shapes: Vec<Shape>,
    pub builtins: Vec<Builtin>,
}
