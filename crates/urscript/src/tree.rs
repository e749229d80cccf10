//! A program as a tree, with the place of everything.

use crate::place::Place;

/// A program's text, parsed.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// What stands at its first level.
    pub statements: Vec<Statement>,
}

/// What is done.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// Where it begins.
    pub place: Place,
    /// What it is.
    pub kind: StatementKind,
}

/// Kinds of statements.
#[derive(Debug, Clone, PartialEq)]
pub enum StatementKind {
    /// `def`, `sec` or `thread`.
    Function(Function),
    /// `if`, its `elif`s and its `else`.
    If {
        /// Conditions with what is done where they are the first that holds.
        branches: Vec<(Expression, Vec<Statement>)>,
        /// What is done otherwise.
        otherwise: Vec<Statement>,
    },
    /// `while`.
    While {
        /// As long as this holds.
        condition: Expression,
        /// This is done.
        body: Vec<Statement>,
    },
    /// `return`, with its value.
    Return(Option<Expression>),
    /// `break`.
    Break,
    /// `continue`.
    Continue,
    /// `pass`.
    Pass,
    /// `halt`.
    Halt,
    /// `global` or `local`.
    Declare {
        /// Where the name holds.
        scope: Scope,
        /// The name.
        name: String,
        /// Its value.
        value: Option<Expression>,
    },
    /// `name = value`, and the same for elements.
    Assign {
        /// What gets the value.
        target: Target,
        /// The value.
        value: Expression,
    },
    /// `kill`.
    Kill(Expression),
    /// `join`.
    Join(Expression),
    /// `enter_critical`.
    EnterCritical,
    /// `exit_critical`.
    ExitCritical,
    /// An expression by itself: a call.
    Expression(Expression),
}

/// Where a name holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// In the whole program.
    Global,
    /// In its function.
    Local,
}

/// What gets a value.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The variable.
    pub name: String,
    /// Its part.
    pub parts: Vec<Part>,
}

/// A part of a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// `[i]`, or `[i, j]` of a matrix.
    Element(Vec<Expression>),
    /// `.name` of a struct.
    Member(String),
}

/// A function of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct Function {
    /// What it is for.
    pub kind: FunctionKind,
    /// Its name.
    pub name: String,
    /// Its parameters, with what they are unless a call says otherwise.
    pub parameters: Vec<(String, Option<Expression>)>,
    /// What it does.
    pub body: Vec<Statement>,
}

/// Kinds of functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FunctionKind {
    /// `def`.
    Function,
    /// `sec`: a program that runs beside another and moves nothing.
    Secondary,
    /// `thread`.
    Thread,
}

/// What has a value.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    /// Where it stands: its operator, or its first word.
    pub place: Place,
    /// What it is.
    pub kind: ExpressionKind,
    /// Levels of expressions in it, itself included.
    pub(crate) levels: usize,
}

/// Kinds of expressions.
#[derive(Debug, Clone, PartialEq)]
pub enum ExpressionKind {
    /// A number.
    Number(f64),
    /// A string.
    Text(String),
    /// `True` or `False`.
    Truth(bool),
    /// A variable.
    Name(String),
    /// A function is called.
    Call {
        /// Its name.
        name: String,
        /// What it is given.
        arguments: Vec<Argument>,
    },
    /// A thread is started.
    Run {
        /// Its name.
        name: String,
        /// What it is given.
        arguments: Vec<Argument>,
    },
    /// A member of a struct, or a call of a remote one's.
    Member {
        /// Of what.
        of: Box<Expression>,
        /// The name.
        name: String,
        /// What it is called with, if it is called.
        arguments: Option<Vec<Argument>>,
    },
    /// An element of a list, a pose or a matrix.
    Element {
        /// Of what.
        of: Box<Expression>,
        /// Its index, or row and column.
        indices: Vec<Expression>,
    },
    /// `p[...]`.
    Pose(Vec<Expression>),
    /// `[...]`.
    List(Vec<Expression>),
    /// An operator before its operand.
    Unary {
        /// The operator.
        operator: Unary,
        /// The operand.
        operand: Box<Expression>,
    },
    /// An operator between its operands.
    Binary {
        /// The operator.
        operator: Binary,
        /// Before it.
        left: Box<Expression>,
        /// After it.
        right: Box<Expression>,
    },
}

/// What a function is given.
#[derive(Debug, Clone, PartialEq)]
pub struct Argument {
    /// The parameter, where it is named.
    pub name: Option<String>,
    /// The value.
    pub value: Expression,
}

/// Operators before an operand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unary {
    /// `-`
    Minus,
    /// `+`
    Plus,
    /// `not`
    Not,
}

/// Operators between two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Binary {
    /// `or`
    Or,
    /// `xor`
    Xor,
    /// `and`
    And,
    /// `==`
    Equal,
    /// `!=`
    Unequal,
    /// `<`
    Less,
    /// `>`
    Greater,
    /// `<=`
    AtMost,
    /// `>=`
    AtLeast,
    /// `+`
    Add,
    /// `-`
    Subtract,
    /// `*`
    Multiply,
    /// `/`
    Divide,
    /// `%`
    Remainder,
}

impl Binary {
    /// As it is written.
    pub fn sign(self) -> &'static str {
        match self {
            Self::Or => "or",
            Self::Xor => "xor",
            Self::And => "and",
            Self::Equal => "==",
            Self::Unequal => "!=",
            Self::Less => "<",
            Self::Greater => ">",
            Self::AtMost => "<=",
            Self::AtLeast => ">=",
            Self::Add => "+",
            Self::Subtract => "-",
            Self::Multiply => "*",
            Self::Divide => "/",
            Self::Remainder => "%",
        }
    }

    /// How tightly it binds.
    pub(crate) fn strength(self) -> u8 {
        match self {
            Self::Or | Self::Xor => 1,
            Self::And => 2,
            Self::Equal
            | Self::Unequal
            | Self::Less
            | Self::Greater
            | Self::AtMost
            | Self::AtLeast => 4,
            Self::Add | Self::Subtract => 5,
            Self::Multiply | Self::Divide | Self::Remainder => 6,
        }
    }
}
