//! A tree as byte code.

use std::collections::BTreeMap;

use crate::builtin::builtin;
use crate::call::arguments_of;
use crate::code::{Code, Constant, NO_LOCAL, Op, PathStep, Routine, Shape, Slot, Target};
use crate::lexer::shortened;
use crate::load::{Entry, Load, not_found};
use crate::parser::parse;
use crate::place::{Place, ScriptError};
use crate::tree::{
    Argument, Binary, Expression, ExpressionKind, Function, FunctionKind, Part, Program as Tree,
    Scope, Statement, StatementKind,
};

/// The name of a program that has none.
const UNNAMED: &str = "unnamed";

/// A program that was read and checked, and can run.
#[derive(Clone)]
pub struct Program {
    name: String,
    pub(crate) code: Code,
}

impl std::fmt::Debug for Program {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = formatter.debug_struct("Program");
        shown.field("name", &self.name).finish_non_exhaustive()
    }
}

impl Program {
    /// Reads and checks a program.
    ///
    /// A lone `def` is the program, and so is the one that a lone call after all functions names; where more stands at
    /// the first level, that is the program. Each `sec` of the first level runs beside it.
    ///
    /// # Errors
    /// The first thing that is no URScript; a name that nothing has, as `compile_error_name_not_found:NAME:`; a call
    /// with too many, too few or unknown arguments; with its place.
    pub fn load(text: &str) -> Result<Self, ScriptError> {
        let tree = parse(text)?;
        let load = Load::new(&tree)?;
        let mut compiler = Compiler::new(&load);
        let secondaries = secondaries(&tree);
        let has_main = tree.statements.iter().any(|statement| {
            !matches!(&statement.kind, StatementKind::Function(function)
                if function.kind != FunctionKind::Function)
        });
        let main = if has_main || secondaries.is_empty() {
            Some(load.find_entry(&tree)?)
        } else {
            None
        };
        for (index, loaded) in load.functions.iter().enumerate() {
            compiler.function(loaded.function, Some(index))?;
        }
        let mut name = UNNAMED.to_owned();
        for function in &secondaries {
            function.name.clone_into(&mut name);
            let index = load.function(None, &function.name);
            let first_level = compiler.first_level(Some(function), index, &function.body)?;
            compiler.code.secondaries.push(first_level);
        }
        match main {
            None => {}
            Some(Entry::Statements(statements)) => {
                UNNAMED.clone_into(&mut name);
                compiler.code.main = Some(compiler.first_level(None, None, statements)?);
            }
            Some(Entry::Function(index)) => {
                let function = load.functions[index].function;
                function.name.clone_into(&mut name);
                if function.kind != FunctionKind::Secondary {
                    let main = compiler.first_level(Some(function), Some(index), &function.body)?;
                    compiler.code.main = Some(main);
                }
            }
        }
        Ok(Self {
            name,
            code: compiler.code,
        })
    }

    /// Its name: that of its `def` or `sec`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// It runs beside another program, and may not move the arm.
    pub fn is_secondary(&self) -> bool {
        self.code.main.is_none()
    }
}

/// The `sec`s of the first level.
fn secondaries(tree: &Tree) -> Vec<&Function> {
    let functions = tree
        .statements
        .iter()
        .filter_map(|statement| match &statement.kind {
            StatementKind::Function(function) => Some(function),
            _ => None,
        });
    functions
        .filter(|function| function.kind == FunctionKind::Secondary)
        .collect()
}

/// Index of something among things that are few enough: a program has 2^20 bytes.
#[expect(clippy::cast_possible_truncation, reason = "a program has 2^20 bytes")]
fn index32(index: usize) -> u32 {
    index as u32
}

/// A loop around.
struct Loop {
    start: usize,
    /// Jumps to its end.
    breaks: Vec<usize>,
}

/// A function that is being compiled.
struct Draft<'a> {
    routine: Routine,
    /// The function by its index among those loaded; none at the first level.
    scope: Option<usize>,
    /// Names of its own; none at the first level, whose names are global.
    locals: Option<BTreeMap<&'a str, u32>>,
    loops: Vec<Loop>,
}

struct Compiler<'a> {
    load: &'a Load<'a>,
    code: Code,
    globals: BTreeMap<&'a str, u32>,
    names: BTreeMap<&'a str, u32>,
    shapes: BTreeMap<Shape, u32>,
    builtins: BTreeMap<&'static str, u32>,
}

impl<'a> Compiler<'a> {
    fn new(load: &'a Load<'a>) -> Self {
        Self {
            load,
            code: Code {
                routines: Vec::new(),
                main: None,
                secondaries: Vec::new(),
                globals: Vec::new(),
                constants: Vec::new(),
                names: Vec::new(),
                paths: Vec::new(),
                structs: Vec::new(),
                shapes: Vec::new(),
                builtins: Vec::new(),
            },
            globals: BTreeMap::new(),
            names: BTreeMap::new(),
            shapes: BTreeMap::new(),
            builtins: BTreeMap::new(),
        }
    }

    /// A function as it is called or run.
    fn function(
        &mut self,
        function: &'a Function,
        scope: Option<usize>,
    ) -> Result<(), ScriptError> {
        let mut draft = Draft::new(Some(function), scope, Some(BTreeMap::new()));
        for (name, _) in &function.parameters {
            draft.local(name);
        }
        for (index, (_, otherwise)) in function.parameters.iter().enumerate() {
            let Some(otherwise) = otherwise else { continue };
            let local = index32(index);
            let given = draft.emit(otherwise.place, Op::JumpIfGiven { local, to: 0 });
            self.expression(&mut draft, otherwise)?;
            draft.emit(otherwise.place, Op::StoreLocal(local));
            draft.land(given);
        }
        self.finish(draft, &function.body)?;
        Ok(())
    }

    /// Statements of a first level, whose names are global.
    fn first_level(
        &mut self,
        function: Option<&'a Function>,
        scope: Option<usize>,
        body: &'a [Statement],
    ) -> Result<u32, ScriptError> {
        let mut draft = Draft::new(function, scope, None);
        for (name, otherwise) in function.map_or(&[][..], |function| &function.parameters) {
            let slot = self.slot(&mut draft, name);
            if let Some(otherwise) = otherwise {
                self.expression(&mut draft, otherwise)?;
                draft.emit(otherwise.place, Op::StoreGlobal(slot));
            }
        }
        self.finish(draft, body)
    }

    fn finish(&mut self, mut draft: Draft<'a>, body: &'a [Statement]) -> Result<u32, ScriptError> {
        self.statements(&mut draft, body)?;
        let end = body.last().map_or(Place::START, |last| last.place);
        draft.emit(end, Op::Nothing);
        draft.emit(end, Op::Return);
        let mut routine = draft.routine;
        routine.locals = draft.locals.map_or(0, |locals| locals.len());
        routine.code.shrink_to_fit();
        routine.places.shrink_to_fit();
        self.code.routines.push(routine);
        Ok(index32(self.code.routines.len() - 1))
    }

    fn slot(&mut self, draft: &mut Draft<'a>, name: &'a str) -> Slot {
        let next = index32(self.globals.len());
        let global = *self.globals.entry(name).or_insert(next);
        if global == next {
            self.code.globals.push(name.to_owned());
        }
        Slot {
            local: draft.local(name),
            global,
        }
    }

    fn name(&mut self, name: &'a str) -> u32 {
        let next = index32(self.names.len());
        let found = *self.names.entry(name).or_insert(next);
        if found == next {
            self.code.names.push(name.to_owned());
        }
        found
    }

    fn shape(&mut self, shape: Shape) -> u32 {
        let next = index32(self.shapes.len());
        if let Some(known) = self.shapes.get(&shape) {
            return *known;
        }
        self.code.shapes.push(shape.clone());
        self.shapes.insert(shape, next);
        next
    }

    fn statements(
        &mut self,
        draft: &mut Draft<'a>,
        statements: &'a [Statement],
    ) -> Result<(), ScriptError> {
        for statement in statements {
            self.statement(draft, statement)?;
        }
        Ok(())
    }

    fn statement(
        &mut self,
        draft: &mut Draft<'a>,
        statement: &'a Statement,
    ) -> Result<(), ScriptError> {
        let place = statement.place;
        match &statement.kind {
            StatementKind::Function(_) | StatementKind::Pass => {}
            StatementKind::If {
                branches,
                otherwise,
            } => {
                let mut ends = Vec::with_capacity(branches.len());
                for (condition, body) in branches {
                    self.expression(draft, condition)?;
                    let next = draft.emit(condition.place, Op::JumpUnless(0));
                    self.statements(draft, body)?;
                    ends.push(draft.emit(place, Op::Jump(0)));
                    draft.land(next);
                }
                self.statements(draft, otherwise)?;
                for end in ends {
                    draft.land(end);
                }
            }
            StatementKind::While { condition, body } => {
                let start = draft.routine.code.len();
                self.expression(draft, condition)?;
                let end = draft.emit(condition.place, Op::JumpUnless(0));
                draft.loops.push(Loop {
                    start,
                    breaks: vec![end],
                });
                self.statements(draft, body)?;
                draft.emit(place, Op::Jump(index32(start)));
                for each in draft
                    .loops
                    .pop()
                    .map(|inner| inner.breaks)
                    .unwrap_or_default()
                {
                    draft.land(each);
                }
            }
            StatementKind::Break => {
                let jump = draft.emit(place, Op::Jump(0));
                let Some(inner) = draft.loops.last_mut() else {
                    return Err(ScriptError::new(place, "`break` outside a loop"));
                };
                inner.breaks.push(jump);
            }
            StatementKind::Continue => {
                let Some(inner) = draft.loops.last() else {
                    return Err(ScriptError::new(place, "`continue` outside a loop"));
                };
                let start = index32(inner.start);
                draft.emit(place, Op::Jump(start));
            }
            StatementKind::Return(value) => {
                match value {
                    Some(value) => self.expression(draft, value)?,
                    None => {
                        draft.emit(place, Op::Nothing);
                    }
                }
                draft.emit(place, Op::Return);
            }
            StatementKind::Halt => {
                draft.emit(place, Op::Halt);
            }
            StatementKind::Declare { scope, name, value } => {
                match value {
                    Some(value) => self.expression(draft, value)?,
                    None => {
                        draft.emit(place, Op::Nothing);
                    }
                }
                let slot = self.slot(draft, name);
                draft.emit(
                    place,
                    match scope {
                        Scope::Local if slot.local != NO_LOCAL => Op::StoreLocal(slot.local),
                        _ => Op::StoreGlobal(slot),
                    },
                );
            }
            StatementKind::Assign { target, value } => {
                self.expression(draft, value)?;
                let mut path = Vec::new();
                for part in &target.parts {
                    match part {
                        Part::Element(indices) => {
                            for index in indices {
                                self.expression(draft, index)?;
                                path.push(PathStep::Index);
                            }
                        }
                        Part::Member(name) => path.push(PathStep::Member(self.name(name))),
                    }
                }
                let slot = self.slot(draft, &target.name);
                if path.is_empty() {
                    draft.emit(place, Op::Store(slot));
                } else {
                    self.code.paths.push(path);
                    let path = index32(self.code.paths.len() - 1);
                    draft.emit(place, Op::StorePart { slot, path });
                }
            }
            StatementKind::Kill(handle) => {
                self.expression(draft, handle)?;
                draft.emit(place, Op::Kill);
            }
            StatementKind::Join(handle) => {
                self.expression(draft, handle)?;
                draft.emit(place, Op::Join);
            }
            StatementKind::EnterCritical => {
                draft.emit(place, Op::EnterCritical);
            }
            StatementKind::ExitCritical => {
                draft.emit(place, Op::ExitCritical);
            }
            StatementKind::Expression(expression) => {
                if let ExpressionKind::Call { name, arguments } = &expression.kind
                    && name != "struct"
                {
                    return self.call(draft, expression.place, name, (arguments, false));
                }
                self.expression(draft, expression)?;
                draft.emit(expression.place, Op::Pop);
            }
        }
        Ok(())
    }

    fn expressions(
        &mut self,
        draft: &mut Draft<'a>,
        all: impl IntoIterator<Item = &'a Expression>,
    ) -> Result<(), ScriptError> {
        for each in all {
            self.expression(draft, each)?;
        }
        Ok(())
    }

    fn constant(&mut self, constant: Constant) -> Op {
        self.code.constants.push(constant);
        Op::Constant(index32(self.code.constants.len() - 1))
    }

    /// Instructions that leave an expression's value on the stack.
    fn expression(
        &mut self,
        draft: &mut Draft<'a>,
        expression: &'a Expression,
    ) -> Result<(), ScriptError> {
        let place = expression.place;
        let op = match &expression.kind {
            ExpressionKind::Number(number) => self.constant(Constant::Number(*number)),
            ExpressionKind::Text(text) => {
                crate::value::text(text).map_err(|message| ScriptError::new(place, message))?;
                self.constant(Constant::Text(text.clone()))
            }
            ExpressionKind::Truth(truth) => self.constant(Constant::Truth(*truth)),
            ExpressionKind::Name(name) => Op::Load(self.slot(draft, name)),
            ExpressionKind::Call { name, arguments }
                if name == "struct" && self.load.function(draft.scope, name).is_none() =>
            {
                let mut members = Vec::with_capacity(arguments.len());
                for argument in arguments {
                    let Some(name) = &argument.name else {
                        let message = "members of a struct have names: struct(a = 1)";
                        return Err(ScriptError::new(argument.value.place, message));
                    };
                    self.expression(draft, &argument.value)?;
                    members.push(self.name(name));
                }
                self.code.structs.push(members);
                Op::Struct(index32(self.code.structs.len() - 1))
            }
            ExpressionKind::Call { name, arguments } => {
                return self.call(draft, place, name, (arguments, true));
            }
            ExpressionKind::Run { name, arguments } => {
                let function = self.own(draft, place, name)?;
                if self.load.functions[function].function.kind != FunctionKind::Thread {
                    let message = format!("`{}` is no thread", shortened(name));
                    return Err(ScriptError::new(place, message));
                }
                let shape = self.own_shape(place, function, arguments)?;
                self.expressions(draft, arguments.iter().map(|each| &each.value))?;
                Op::Run(Target {
                    function: index32(function),
                    shape,
                    is_used: true,
                })
            }
            ExpressionKind::Member {
                of,
                name,
                arguments,
            } => {
                self.expression(draft, of)?;
                let index = self.name(name);
                match arguments {
                    None => Op::Member(index),
                    Some(arguments) => {
                        self.expressions(draft, arguments.iter().map(|each| &each.value))?;
                        Op::Remote(index)
                    }
                }
            }
            ExpressionKind::Element { of, indices } => {
                self.expression(draft, of)?;
                for index in indices {
                    self.expression(draft, index)?;
                    draft.emit(index.place, Op::Element);
                }
                return Ok(());
            }
            ExpressionKind::Pose(parts) => {
                self.expressions(draft, parts)?;
                Op::Pose
            }
            ExpressionKind::List(parts) => {
                self.expressions(draft, parts)?;
                Op::List(index32(parts.len()))
            }
            ExpressionKind::Unary { operator, operand } => {
                self.expression(draft, operand)?;
                Op::Unary(*operator)
            }
            ExpressionKind::Binary {
                operator,
                left,
                right,
            } => {
                self.expression(draft, left)?;
                let decided = matches!(operator, Binary::And | Binary::Or).then(|| {
                    let operator = *operator;
                    draft.emit(place, Op::Decided { operator, to: 0 })
                });
                self.expression(draft, right)?;
                draft.emit(place, Op::Binary(*operator));
                if let Some(decided) = decided {
                    draft.land(decided);
                }
                return Ok(());
            }
        };
        draft.emit(place, op);
        Ok(())
    }

    /// The function of the program that a name means.
    fn own(&self, draft: &Draft<'a>, place: Place, name: &str) -> Result<usize, ScriptError> {
        let found = self.load.function(draft.scope, name);
        found.ok_or_else(|| ScriptError::new(place, not_found(name)))
    }

    fn own_shape(
        &mut self,
        place: Place,
        function: usize,
        arguments: &[Argument],
    ) -> Result<u32, ScriptError> {
        let function = self.load.functions[function].function;
        let name = shortened(&function.name);
        let parameters = function.parameters.iter();
        let names: Vec<&str> = parameters.map(|each| each.0.as_str()).collect();
        let of = arguments_of(place, &name, &names, arguments)?;
        let mut parameters = function.parameters.iter().zip(&of);
        if let Some(((missing, _), _)) =
            parameters.find(|((_, otherwise), given)| otherwise.is_none() && given.is_none())
        {
            let message = format!("{name}: `{}` is missing", shortened(missing));
            return Err(ScriptError::new(place, message));
        }
        let given = arguments.len();
        Ok(self.shape(Shape { given, of }))
    }

    fn call(
        &mut self,
        draft: &mut Draft<'a>,
        place: Place,
        name: &'a str,
        (arguments, is_used): (&'a [Argument], bool),
    ) -> Result<(), ScriptError> {
        let op = if let Some(function) = self.load.function(draft.scope, name) {
            match self.load.functions[function].function.kind {
                FunctionKind::Function => {}
                FunctionKind::Thread => {
                    let name = shortened(name);
                    let message = format!("`{name}` is a thread, and no function");
                    let hint = format!("`run {name}()` starts it");
                    return Err(ScriptError::new(place, message).hint(hint));
                }
                FunctionKind::Secondary => {
                    let message = format!("`{}` runs beside the program", shortened(name));
                    return Err(ScriptError::new(place, message).hint("it is no function"));
                }
            }
            let shape = self.own_shape(place, function, arguments)?;
            Op::Call(Target {
                function: index32(function),
                shape,
                is_used,
            })
        } else {
            let found = builtin(name);
            let found = found.ok_or_else(|| ScriptError::new(place, not_found(name)))?;
            let of = if found.has_parameters() {
                arguments_of(place, found.name, found.parameters, arguments)?
            } else {
                (0..arguments.len()).map(Some).collect()
            };
            if let Some(missing) = found.missing(|index| of[index].is_some()) {
                let message = format!("{}: `{missing}` is missing", found.name);
                return Err(ScriptError::new(place, message));
            }
            let next = index32(self.builtins.len());
            let function = *self.builtins.entry(found.name).or_insert(next);
            if function == next {
                self.code.builtins.push(found);
            }
            let given = arguments.len();
            Op::Builtin(Target {
                function,
                shape: self.shape(Shape { given, of }),
                is_used,
            })
        };
        self.expressions(draft, arguments.iter().map(|each| &each.value))?;
        draft.emit(place, op);
        Ok(())
    }
}

impl<'a> Draft<'a> {
    fn new(
        function: Option<&Function>,
        scope: Option<usize>,
        locals: Option<BTreeMap<&'a str, u32>>,
    ) -> Self {
        Self {
            routine: Routine {
                name: function.map_or(UNNAMED.to_owned(), |function| shortened(&function.name)),
                kind: function.map_or(FunctionKind::Function, |function| function.kind),
                locals: 0,
                code: Vec::new(),
                places: Vec::new(),
            },
            scope,
            locals,
            loops: Vec::new(),
        }
    }

    fn local(&mut self, name: &'a str) -> u32 {
        let Some(locals) = &mut self.locals else {
            return NO_LOCAL;
        };
        let next = index32(locals.len());
        *locals.entry(name).or_insert(next)
    }

    /// Adds an instruction, with its index.
    fn emit(&mut self, place: Place, op: Op) -> usize {
        self.routine.code.push(op);
        self.routine
            .places
            .push([index32(place.line), index32(place.column)]);
        self.routine.code.len() - 1
    }

    /// A jump goes to the instruction that comes next.
    fn land(&mut self, jump: usize) {
        let next = index32(self.routine.code.len());
        match &mut self.routine.code[jump] {
            Op::Jump(to)
            | Op::JumpUnless(to)
            | Op::JumpIfGiven { to, .. }
            | Op::Decided { to, .. } => *to = next,
            _ => {}
        }
    }
}
