//! Tokens as a tree.

use crate::lexer::{Kind, Token, shortened, tokens};
use crate::place::{Place, ScriptError};
use crate::tree::{
    Argument, Binary, Expression, ExpressionKind, Function, FunctionKind, Part, Program, Scope,
    Statement, StatementKind, Target, Unary,
};

/// Longest program, bytes.
pub const MOST_BYTES: usize = 1 << 20;

/// Most levels of blocks and of expressions within each other.
pub const MOST_LEVELS: usize = 200;

/// Words that are no names.
const KEYWORDS: [&str; 26] = [
    "def",
    "sec",
    "thread",
    "end",
    "if",
    "elif",
    "else",
    "while",
    "return",
    "break",
    "continue",
    "pass",
    "halt",
    "global",
    "local",
    "kill",
    "join",
    "run",
    "enter_critical",
    "exit_critical",
    "and",
    "or",
    "xor",
    "not",
    "True",
    "False",
];

/// How tightly `not` binds: less than comparisons, more than `and`.
const NOT_STRENGTH: u8 = 3;

/// Parses a program.
///
/// White space separates words and nothing else: a statement ends where the next begins, a block at its `end`, and
/// only `return` cares for the line's end. The last `end` of a text may be without its line end.
///
/// # Errors
/// The first thing that is no URScript, with its place.
pub fn parse(text: &str) -> Result<Program, ScriptError> {
    if text.len() > MOST_BYTES {
        let message = format!("the program has {} bytes, {MOST_BYTES} at most", text.len());
        return Err(ScriptError::new(Place::START, message));
    }
    let tokens = tokens(text)?;
    let mut parser = Parser {
        tokens: &tokens,
        next: 0,
        levels: 0,
    };
    let mut statements = Vec::new();
    loop {
        match parser.kind() {
            Kind::End => return Ok(Program { statements }),
            Kind::Word("end") => {
                let message = "this `end` ends nothing";
                return Err(ScriptError::new(parser.place(), message));
            }
            _ => statements.push(parser.statement()?),
        }
    }
}

struct Parser<'a, 'text> {
    /// The last one is the end, and stays.
    tokens: &'a [Token<'text>],
    next: usize,
    /// Blocks and brackets around.
    levels: usize,
}

impl<'text> Parser<'_, 'text> {
    fn kind(&self) -> &Kind<'text> {
        &self.tokens[self.next].kind
    }

    fn kind_after(&self) -> &Kind<'text> {
        let last = self.tokens.len() - 1;
        &self.tokens[(self.next + 1).min(last)].kind
    }

    fn place(&self) -> Place {
        self.tokens[self.next].place
    }

    fn advance(&mut self) {
        self.next = (self.next + 1).min(self.tokens.len() - 1);
    }

    fn is_word(&self, word: &str) -> bool {
        matches!(self.kind(), Kind::Word(found) if *found == word)
    }

    fn is_sign(&self, sign: &str) -> bool {
        matches!(self.kind(), Kind::Sign(found) if *found == sign)
    }

    fn accept(&mut self, sign: &str) -> bool {
        let is_there = self.is_sign(sign);
        if is_there {
            self.advance();
        }
        is_there
    }

    fn wrong(&self, wanted: &str) -> ScriptError {
        let message = format!("{wanted} is missing before {}", self.kind().in_words());
        ScriptError::new(self.place(), message)
    }

    fn expect(&mut self, sign: &str, after: &str) -> Result<(), ScriptError> {
        if self.accept(sign) {
            return Ok(());
        }
        Err(self.wrong(&format!("`{sign}` {after}")))
    }

    fn name(&mut self, of: &str) -> Result<String, ScriptError> {
        match self.kind() {
            Kind::Word(word) if !KEYWORDS.contains(word) => {
                let name = (*word).to_owned();
                self.advance();
                Ok(name)
            }
            Kind::Word(word) => {
                let message = format!("`{word}` is a keyword, and no name of {of}");
                Err(ScriptError::new(self.place(), message))
            }
            _ => Err(self.wrong(&format!("the name of {of}"))),
        }
    }

    /// One level further in, and out again.
    fn within<T>(
        &mut self,
        part: impl FnOnce(&mut Self) -> Result<T, ScriptError>,
    ) -> Result<T, ScriptError> {
        if self.levels >= MOST_LEVELS {
            return Err(too_deep(self.place()));
        }
        self.levels += 1;
        let found = part(self);
        self.levels -= 1;
        found
    }

    /// Statements up to one of the words, which stays.
    fn body(
        &mut self,
        begins: Place,
        what: &str,
        ends: &[&str],
    ) -> Result<Vec<Statement>, ScriptError> {
        self.within(|parser| {
            let mut statements = Vec::new();
            loop {
                match parser.kind() {
                    Kind::Word(word) if ends.contains(word) => return Ok(statements),
                    Kind::End => {
                        let message = format!("`end` of {what} of line {} is missing", begins.line);
                        return Err(ScriptError::new(parser.place(), message));
                    }
                    Kind::Word(word @ ("elif" | "else")) => {
                        let message = format!("`{word}` without its `if`");
                        return Err(ScriptError::new(parser.place(), message));
                    }
                    _ => statements.push(parser.statement()?),
                }
            }
        })
    }

    fn statement(&mut self) -> Result<Statement, ScriptError> {
        let place = self.place();
        let word = match self.kind() {
            Kind::Word(word) => *word,
            _ => "",
        };
        let simple = |parser: &mut Self, kind| {
            parser.advance();
            Ok(kind)
        };
        let kind = match word {
            "def" => self.function(FunctionKind::Function),
            "sec" => self.function(FunctionKind::Secondary),
            "thread" => self.function(FunctionKind::Thread),
            "if" => self.branches(),
            "while" => self.repetition(),
            "return" => {
                self.advance();
                // Only what stands on the line is returned.
                let ends = self.place().line > place.line || !self.begins_expression();
                let value = if ends { None } else { Some(self.expression()?) };
                Ok(StatementKind::Return(value))
            }
            "break" => simple(self, StatementKind::Break),
            "continue" => simple(self, StatementKind::Continue),
            "pass" => simple(self, StatementKind::Pass),
            "halt" => simple(self, StatementKind::Halt),
            "enter_critical" => simple(self, StatementKind::EnterCritical),
            "exit_critical" => simple(self, StatementKind::ExitCritical),
            "global" => self.declaration(Scope::Global),
            "local" => self.declaration(Scope::Local),
            "kill" => {
                self.advance();
                Ok(StatementKind::Kill(self.expression()?))
            }
            "join" => {
                self.advance();
                Ok(StatementKind::Join(self.expression()?))
            }
            _ => self.assignment_or_call(),
        }?;
        Ok(Statement { place, kind })
    }

    fn function(&mut self, kind: FunctionKind) -> Result<StatementKind, ScriptError> {
        let begins = self.place();
        self.advance();
        let name = self.name("a function")?;
        self.expect("(", "after the function's name")?;
        let mut parameters: Vec<(String, Option<Expression>)> = Vec::new();
        while !self.accept(")") {
            if !parameters.is_empty() {
                self.expect(",", "between parameters")?;
            }
            let place = self.place();
            let parameter = self.name("a parameter")?;
            if parameters.iter().any(|(known, _)| *known == parameter) {
                let message = format!("there are two parameters `{}`", shortened(&parameter));
                return Err(ScriptError::new(place, message));
            }
            let value = if self.accept("=") {
                Some(self.expression()?)
            } else {
                None
            };
            parameters.push((parameter, value));
        }
        self.expect(":", "after the parameters")?;
        let what = format!("`{}`", shortened(&name));
        let body = self.body(begins, &what, &["end"])?;
        self.advance();
        Ok(StatementKind::Function(Function {
            kind,
            name,
            parameters,
            body,
        }))
    }

    fn branches(&mut self) -> Result<StatementKind, ScriptError> {
        let begins = self.place();
        let mut branches = Vec::new();
        let mut otherwise = Vec::new();
        while self.is_word("if") && branches.is_empty() || self.is_word("elif") {
            self.advance();
            let condition = self.expression()?;
            self.expect(":", "after the condition")?;
            let body = self.body(begins, "the `if`", &["elif", "else", "end"])?;
            branches.push((condition, body));
        }
        if self.is_word("else") {
            self.advance();
            self.expect(":", "after `else`")?;
            otherwise = self.body(begins, "the `if`", &["end"])?;
        }
        self.advance();
        Ok(StatementKind::If {
            branches,
            otherwise,
        })
    }

    fn repetition(&mut self) -> Result<StatementKind, ScriptError> {
        let begins = self.place();
        self.advance();
        let condition = self.expression()?;
        self.expect(":", "after the condition")?;
        let body = self.body(begins, "the `while`", &["end"])?;
        self.advance();
        Ok(StatementKind::While { condition, body })
    }

    fn declaration(&mut self, scope: Scope) -> Result<StatementKind, ScriptError> {
        self.advance();
        let name = self.name("a variable")?;
        let value = if self.accept("=") {
            Some(self.expression()?)
        } else {
            None
        };
        Ok(StatementKind::Declare { scope, name, value })
    }

    fn assignment_or_call(&mut self) -> Result<StatementKind, ScriptError> {
        if !self.begins_expression() {
            return Err(self.wrong("a statement"));
        }
        let expression = self.expression()?;
        if !self.is_sign("=") {
            return Ok(StatementKind::Expression(expression));
        }
        let place = self.place();
        let target = target(expression).map_err(|name| {
            let error = ScriptError::new(
                place,
                "this gets no value: only variables and their parts do",
            );
            match name {
                Some(name) => error.hint(format!("`{}(...)` is a call", shortened(&name))),
                None => error,
            }
        })?;
        self.advance();
        let value = self.expression()?;
        Ok(StatementKind::Assign { target, value })
    }

    fn begins_expression(&self) -> bool {
        match self.kind() {
            Kind::Word(word) => {
                matches!(*word, "True" | "False" | "not" | "run") || !KEYWORDS.contains(word)
            }
            Kind::Number(_) | Kind::Text(_) | Kind::Pose => true,
            Kind::Sign(sign) => matches!(*sign, "(" | "[" | "-" | "+"),
            Kind::End => false,
        }
    }

    fn expression(&mut self) -> Result<Expression, ScriptError> {
        self.within(|parser| parser.operators(0))
    }

    /// Operands and the operators between them that bind at least so tightly.
    fn operators(&mut self, least: u8) -> Result<Expression, ScriptError> {
        let mut left = self.operand(least)?;
        while let Some(operator) = self.binary() {
            if operator.strength() < least {
                break;
            }
            let place = self.place();
            self.advance();
            let right = self.operators(operator.strength() + 1)?;
            let levels = 1 + left.levels.max(right.levels);
            let kind = ExpressionKind::Binary {
                operator,
                left: Box::new(left),
                right: Box::new(right),
            };
            left = checked(place, kind, levels)?;
        }
        Ok(left)
    }

    fn binary(&self) -> Option<Binary> {
        Some(match self.kind() {
            Kind::Word("or") => Binary::Or,
            Kind::Word("xor") => Binary::Xor,
            Kind::Word("and") => Binary::And,
            Kind::Sign(sign) => match *sign {
                "==" => Binary::Equal,
                "!=" => Binary::Unequal,
                "<" => Binary::Less,
                ">" => Binary::Greater,
                "<=" => Binary::AtMost,
                ">=" => Binary::AtLeast,
                "+" => Binary::Add,
                "-" => Binary::Subtract,
                "*" => Binary::Multiply,
                "/" => Binary::Divide,
                "%" => Binary::Remainder,
                _ => return None,
            },
            _ => return None,
        })
    }

    fn operand(&mut self, least: u8) -> Result<Expression, ScriptError> {
        let place = self.place();
        let operator = match self.kind() {
            Kind::Word("not") => Unary::Not,
            Kind::Sign("-") => Unary::Minus,
            Kind::Sign("+") => Unary::Plus,
            _ => return self.postfix(),
        };
        self.advance();
        let operand = self.within(|parser| {
            if operator == Unary::Not && least <= NOT_STRENGTH {
                parser.operators(NOT_STRENGTH + 1)
            } else {
                parser.operand(u8::MAX)
            }
        })?;
        let levels = 1 + operand.levels;
        let operand = Box::new(operand);
        checked(place, ExpressionKind::Unary { operator, operand }, levels)
    }

    fn postfix(&mut self) -> Result<Expression, ScriptError> {
        let mut found = self.primary()?;
        loop {
            let place = self.place();
            if self.accept("[") {
                let indices = self.expressions("]")?;
                if indices.is_empty() || indices.len() > 2 {
                    let message = "an element has one index, or row and column";
                    return Err(ScriptError::new(place, message));
                }
                let levels = 1 + found.levels.max(deepest(&indices));
                let of = Box::new(found);
                found = checked(place, ExpressionKind::Element { of, indices }, levels)?;
            } else if self.is_sign(".") {
                self.advance();
                let name = self.name("a member")?;
                let arguments = if self.accept("(") {
                    Some(self.arguments()?)
                } else {
                    None
                };
                let inside = arguments.iter().flatten().map(|each| each.value.levels);
                let levels = 1 + found.levels.max(inside.max().unwrap_or(0));
                let of = Box::new(found);
                let kind = ExpressionKind::Member {
                    of,
                    name,
                    arguments,
                };
                found = checked(place, kind, levels)?;
            } else {
                return Ok(found);
            }
        }
    }

    fn primary(&mut self) -> Result<Expression, ScriptError> {
        let place = self.place();
        let leaf = |parser: &mut Self, kind| {
            parser.advance();
            checked(place, kind, 1)
        };
        match self.kind() {
            Kind::Number(number) => {
                let number = *number;
                leaf(self, ExpressionKind::Number(number))
            }
            Kind::Text(text) => {
                let text = (*text).to_owned();
                leaf(self, ExpressionKind::Text(text))
            }
            Kind::Word("True") => leaf(self, ExpressionKind::Truth(true)),
            Kind::Word("False") => leaf(self, ExpressionKind::Truth(false)),
            Kind::Word("run") => {
                self.advance();
                let name = self.name("a thread")?;
                self.expect("(", "after the thread's name")?;
                let arguments = self.arguments()?;
                let levels = 1 + deepest_argument(&arguments);
                checked(place, ExpressionKind::Run { name, arguments }, levels)
            }
            Kind::Word(word) if !KEYWORDS.contains(word) => {
                let name = (*word).to_owned();
                self.advance();
                if !self.accept("(") {
                    return checked(place, ExpressionKind::Name(name), 1);
                }
                let arguments = self.arguments()?;
                let levels = 1 + deepest_argument(&arguments);
                checked(place, ExpressionKind::Call { name, arguments }, levels)
            }
            Kind::Pose => {
                self.advance();
                let parts = self.expressions("]")?;
                if parts.len() == 1 {
                    // An element of a variable that is called `p`.
                    let levels = 2.max(1 + deepest(&parts));
                    let of = Box::new(checked(place, ExpressionKind::Name("p".to_owned()), 1)?);
                    let indices = parts;
                    return checked(place, ExpressionKind::Element { of, indices }, levels);
                }
                if parts.len() != 6 {
                    let message = format!("a pose has 6 numbers, this one {}", parts.len());
                    let error = ScriptError::new(place, message);
                    return Err(error.hint("`p[` begins a pose; `p` is no name of a list"));
                }
                let levels = 1 + deepest(&parts);
                checked(place, ExpressionKind::Pose(parts), levels)
            }
            Kind::Sign("[") => {
                self.advance();
                let parts = self.expressions("]")?;
                let levels = 1 + deepest(&parts);
                checked(place, ExpressionKind::List(parts), levels)
            }
            Kind::Sign("(") => {
                self.advance();
                let inside = self.expression()?;
                self.expect(")", "after the expression")?;
                Ok(inside)
            }
            _ => Err(self.wrong("a value")),
        }
    }

    /// Expressions up to a closing bracket, the opening one passed.
    fn expressions(&mut self, close: &str) -> Result<Vec<Expression>, ScriptError> {
        let mut found = Vec::new();
        while !self.accept(close) {
            if !found.is_empty() {
                self.expect(",", "between elements")?;
            }
            found.push(self.expression()?);
        }
        Ok(found)
    }

    fn arguments(&mut self) -> Result<Vec<Argument>, ScriptError> {
        let mut found: Vec<Argument> = Vec::new();
        while !self.accept(")") {
            if !found.is_empty() {
                self.expect(",", "between arguments")?;
            }
            let is_named = matches!(self.kind(), Kind::Word(word) if !KEYWORDS.contains(word))
                && *self.kind_after() == Kind::Sign("=");
            let name = if is_named {
                let name = self.name("a parameter")?;
                self.advance();
                Some(name)
            } else {
                None
            };
            if name.is_none() && found.last().is_some_and(|last| last.name.is_some()) {
                let message = "an argument without a name follows one with a name";
                return Err(ScriptError::new(self.place(), message));
            }
            found.push(Argument {
                name,
                value: self.expression()?,
            });
        }
        Ok(found)
    }
}

fn too_deep(place: Place) -> ScriptError {
    let message = format!("nested more than {MOST_LEVELS} levels deep");
    ScriptError::new(place, message)
}

fn checked(place: Place, kind: ExpressionKind, levels: usize) -> Result<Expression, ScriptError> {
    if levels > MOST_LEVELS {
        return Err(too_deep(place));
    }
    Ok(Expression {
        place,
        kind,
        levels,
    })
}

fn deepest(all: &[Expression]) -> usize {
    all.iter().map(|each| each.levels).max().unwrap_or(0)
}

fn deepest_argument(all: &[Argument]) -> usize {
    all.iter().map(|each| each.value.levels).max().unwrap_or(0)
}

/// An expression that stands left of `=`; else the function that it calls, if it does.
fn target(expression: Expression) -> Result<Target, Option<String>> {
    match expression.kind {
        ExpressionKind::Name(name) => Ok(Target {
            name,
            parts: Vec::new(),
        }),
        ExpressionKind::Element { of, indices } => {
            let mut found = target(*of)?;
            found.parts.push(Part::Element(indices));
            Ok(found)
        }
        ExpressionKind::Member {
            of,
            name,
            arguments: None,
        } => {
            let mut found = target(*of)?;
            found.parts.push(Part::Member(name));
            Ok(found)
        }
        ExpressionKind::Call { name, .. } => Err(Some(name)),
        _ => Err(None),
    }
}
