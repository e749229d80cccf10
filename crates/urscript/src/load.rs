//! A program before it runs: its functions by where they are known, and names that nothing has.

use std::collections::{BTreeMap, BTreeSet};

use crate::builtin::builtin;
use crate::lexer::shortened;
use crate::place::{Place, ScriptError};
use crate::tree::{
    Expression, ExpressionKind, Function, FunctionKind, Program, Statement, StatementKind,
};
use crate::walk::{Node, walk};

/// A function with those that are defined in it.
pub(crate) struct Loaded<'a> {
    pub function: &'a Function,
    /// The function that it is defined in.
    parent: Option<usize>,
}

/// Where a program begins.
pub(crate) enum Entry<'a> {
    /// Statements at the first level.
    Statements(&'a [Statement]),
    /// The function that is the program.
    Function(usize),
}

/// A program that can run.
pub(crate) struct Load<'a> {
    pub functions: Vec<Loaded<'a>>,
    /// Functions by the one they are defined in and their name.
    by_name: BTreeMap<(Option<usize>, &'a str), usize>,
}

impl<'a> Load<'a> {
    /// Prepares a program.
    ///
    /// # Errors
    /// A name that nothing has.
    pub fn new(program: &'a Program) -> Result<Self, ScriptError> {
        let mut load = Self {
            functions: Vec::new(),
            by_name: BTreeMap::new(),
        };
        load.add(&program.statements, None)?;
        load.check_names(program)?;
        Ok(load)
    }

    /// The function that a name means in a function.
    pub fn function(&self, from: Option<usize>, name: &str) -> Option<usize> {
        let mut level = from;
        loop {
            if let Some(found) = self.by_name.get(&(level, name)) {
                return Some(*found);
            }
            level = self.functions[level?].parent;
        }
    }

    /// Adds the functions that are defined among statements, at any depth of blocks.
    fn add(
        &mut self,
        statements: &'a [Statement],
        parent: Option<usize>,
    ) -> Result<(), ScriptError> {
        for statement in statements {
            match &statement.kind {
                StatementKind::Function(function) => {
                    let index = self.functions.len();
                    self.functions.push(Loaded { function, parent });
                    let key = (parent, function.name.as_str());
                    if self.by_name.insert(key, index).is_some() {
                        let name = shortened(&function.name);
                        let message = format!("`{name}` is defined twice");
                        return Err(ScriptError::new(statement.place, message));
                    }
                    self.add(&function.body, Some(index))?;
                }
                StatementKind::If {
                    branches,
                    otherwise,
                } => {
                    for (_, body) in branches {
                        self.add(body, parent)?;
                    }
                    self.add(otherwise, parent)?;
                }
                StatementKind::While { body, .. } => self.add(body, parent)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// The first name that nothing in the program has.
    fn check_names(&self, program: &'a Program) -> Result<(), ScriptError> {
        let names = names(program);
        let own: BTreeSet<&str> = self.by_name.keys().map(|(_, name)| *name).collect();
        let mut wrong: Option<ScriptError> = None;
        walk(&program.statements, &mut |node| {
            let Node::Expression(expression) = node else {
                return;
            };
            let (what, name, is_known) = match &expression.kind {
                ExpressionKind::Name(name) => ("variable", name, names.contains(name.as_str())),
                ExpressionKind::Call { name, .. } | ExpressionKind::Run { name, .. } => {
                    ("function", name, own.contains(name.as_str()))
                }
                _ => return,
            };
            if is_known || wrong.is_some() || builtin(name).is_some() && what == "function" {
                return;
            }
            let error = ScriptError::new(expression.place, not_found(name));
            wrong = Some(match name.as_str() {
                "true" | "false" => error.hint("truth values are True and False"),
                _ if own.contains(name.as_str()) || builtin(name).is_some() => {
                    error.hint("it is a function: a call has brackets")
                }
                _ => error.hint(format!(
                    "it is no {what} of this program and no built-in one"
                )),
            });
        });
        wrong.map_or(Ok(()), Err)
    }

    /// A lone function is the program, and so is the one that a lone call after all functions names; where more stands
    /// at the first level, that is the program.
    ///
    /// # Errors
    /// What does not say where the program begins.
    pub fn find_entry(&self, program: &'a Program) -> Result<Entry<'a>, ScriptError> {
        let mut functions: Vec<(Place, &Function)> = Vec::new();
        let mut others: Vec<&Statement> = Vec::new();
        for statement in &program.statements {
            match &statement.kind {
                StatementKind::Function(function) if function.kind == FunctionKind::Function => {
                    functions.push((statement.place, function));
                }
                StatementKind::Function(_) => {}
                _ => others.push(statement),
            }
        }
        let index = |name: &str| self.by_name.get(&(None, name)).copied();
        match (functions.as_slice(), others.as_slice()) {
            ([], []) => {
                let message = "the program does nothing: there is no `def`, and nothing beside one";
                Err(ScriptError::new(Place::START, message))
            }
            ([(_, lone)], []) => {
                let found = index(&lone.name).expect("all functions are known by name");
                if let Some((name, _)) = lone.parameters.iter().find(|each| each.1.is_none()) {
                    let (program, name) = (shortened(&lone.name), shortened(name));
                    let message = format!("the program `{program}` is given no `{name}`");
                    return Err(ScriptError::new(Place::START, message));
                }
                Ok(Entry::Function(found))
            }
            ([_, (place, second), ..], []) => {
                let message = format!(
                    "`{}` is a second function, and nothing says which one is the program",
                    shortened(&second.name)
                );
                let hint =
                    "call the program's function after the last `end`, or define the others in it";
                Err(ScriptError::new(*place, message).hint(hint))
            }
            (_, [lone]) => {
                if let StatementKind::Expression(Expression {
                    kind: ExpressionKind::Call { name, arguments },
                    ..
                }) = &lone.kind
                    && arguments.is_empty()
                    && let Some(found) = index(name)
                    && self.functions[found].function.parameters.is_empty()
                    && self.functions[found].function.kind != FunctionKind::Thread
                {
                    return Ok(Entry::Function(found));
                }
                self.statements(program, &functions)
            }
            _ => self.statements(program, &functions),
        }
    }

    fn statements(
        &self,
        program: &'a Program,
        functions: &[(Place, &Function)],
    ) -> Result<Entry<'a>, ScriptError> {
        let mut calls_own = functions.is_empty();
        for statement in &program.statements {
            if matches!(statement.kind, StatementKind::Function(_)) {
                continue;
            }
            walk(std::slice::from_ref(statement), &mut |node| {
                if let Node::Expression(Expression {
                    kind: ExpressionKind::Call { name, .. },
                    ..
                }) = node
                {
                    calls_own |= self.function(None, name).is_some();
                }
            });
        }
        if calls_own {
            return Ok(Entry::Statements(&program.statements));
        }
        let (place, function) = functions[0];
        let message = format!(
            "statements stand beside `{}`, and none of them calls it",
            shortened(&function.name)
        );
        let hint = "call it, or move the statements into it";
        Err(ScriptError::new(place, message).hint(hint))
    }
}

/// A name that nothing has, in the words of a UR controller.
pub(crate) fn not_found(name: &str) -> String {
    format!("compile_error_name_not_found:{}:", shortened(name))
}

/// All names that anything in a program gets a value by.
fn names(program: &Program) -> BTreeSet<&str> {
    let mut names = BTreeSet::new();
    walk(&program.statements, &mut |node| {
        let Node::Statement(statement) = node else {
            return;
        };
        match &statement.kind {
            StatementKind::Function(function) => {
                names.extend(function.parameters.iter().map(|(name, _)| name.as_str()));
            }
            StatementKind::Declare { name, .. } => {
                names.insert(name.as_str());
            }
            StatementKind::Assign { target, .. } => {
                names.insert(target.name.as_str());
            }
            _ => {}
        }
    });
    names
}
