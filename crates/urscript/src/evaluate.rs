//! Programs whose course constants decide: what they do, one after the other.

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::builtin::{Does, builtin};
use crate::call::{Call, arguments_of};
use crate::elements::{Step, element, replace, size as elements};
use crate::lexer::shortened;
use crate::load::{Entry, Load};
use crate::machine::{Installation, Machine};
use crate::motion::{Arm, Belief};
use crate::place::{Place, ScriptError};
use crate::tree::{
    Argument, Expression, ExpressionKind, FunctionKind, Part, Program, Scope, Statement,
    StatementKind, Target,
};
use crate::value::{Value, list};

/// Most steps of a program: a loop that streams 100 000 joint positions takes fewer.
pub const MOST_STEPS: u64 = 5_000_000;

/// Most functions that wait for each other's return.
const MOST_CALLS: usize = 200;

/// Most blocks, expressions and calls within each other while a program runs.
const MOST_DEPTH: usize = 1000;

/// What a loop without end is told.
const NEVER_ENDS: &str = "does a loop never end, as with `Program Loops Forever` of PolyScope? save the program \
                          without it: only programs that end are judged";

/// Steps that a call of a built-in function counts for.
const CALL_STEPS: usize = 20;

/// What came of a program, besides its motions.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcome {
    /// What the controller believes at the end.
    pub belief: Belief,
    /// Motions that the arm was given.
    pub motions: usize,
    /// What was not simulated or is to be known, with the lines.
    pub notes: Vec<String>,
}

/// Does what a program does, and gives its motions to the arm.
///
/// # Errors
/// What is wrong in the program, what depends on more than constants, and what the arm refuses; with its place.
pub fn evaluate(
    program: &Program,
    arm: &mut dyn Arm,
    installation: &Installation,
) -> Result<Outcome, ScriptError> {
    let load = Load::new(program, |name| format!("nothing has the name `{name}`"))?;
    let (function, body) = match load.find_entry(program)? {
        Entry::Statements(statements) => (None, statements),
        Entry::Function(index) => {
            let function = load.functions[index].function;
            (Some(index), function.body.as_slice())
        }
    };
    let mut belief = Belief::default();
    let mut evaluator = Evaluator {
        load: &load,
        machine: Machine::new(arm, installation, &mut belief),
        globals: BTreeMap::new(),
        frames: vec![Frame {
            function,
            locals: None,
        }],
        steps: 0,
        depth: 0,
    };
    if let Some(index) = function {
        for (name, value) in &load.functions[index].function.parameters {
            if let Some(value) = value {
                let value = evaluator.expression(value)?;
                evaluator.globals.insert(name, value);
            }
        }
    }
    evaluator.statements(body)?;
    let machine = evaluator.machine;
    Ok(Outcome {
        belief: machine.belief.clone(),
        motions: machine.motions,
        notes: machine.into_notes(),
    })
}

/// A function that is being done.
struct Frame<'p> {
    function: Option<usize>,
    /// Names of its own; none at the program's first level, whose names are global.
    locals: Option<BTreeMap<&'p str, Value>>,
}

/// What follows a statement.
enum Flow {
    On,
    Break,
    Continue,
    Return(Value),
    Halt,
}

/// A program that is being done.
struct Evaluator<'p, 'a> {
    load: &'p Load<'p>,
    machine: Machine<'a>,
    globals: BTreeMap<&'p str, Value>,
    frames: Vec<Frame<'p>>,
    steps: u64,
    depth: usize,
}

impl<'p> Evaluator<'p, '_> {
    fn step(&mut self, place: Place, steps: usize) -> Result<(), ScriptError> {
        self.steps += steps as u64;
        if self.steps <= MOST_STEPS {
            return Ok(());
        }
        let message = format!("the program takes more than {MOST_STEPS} steps");
        Err(ScriptError::new(place, message).hint(NEVER_ENDS))
    }

    fn deeper<T>(
        &mut self,
        place: Place,
        part: impl FnOnce(&mut Self) -> Result<T, ScriptError>,
    ) -> Result<T, ScriptError> {
        if self.depth >= MOST_DEPTH {
            let message =
                format!("calls, blocks and expressions are more than {MOST_DEPTH} levels deep");
            return Err(ScriptError::new(place, message));
        }
        self.depth += 1;
        let found = part(self);
        self.depth -= 1;
        found
    }

    fn statements(&mut self, statements: &'p [Statement]) -> Result<Flow, ScriptError> {
        for statement in statements {
            self.step(statement.place, 1)?;
            match self.deeper(statement.place, |inside| inside.statement(statement))? {
                Flow::On => {}
                other => return Ok(other),
            }
        }
        Ok(Flow::On)
    }

    fn statement(&mut self, statement: &'p Statement) -> Result<Flow, ScriptError> {
        match &statement.kind {
            StatementKind::Function(_)
            | StatementKind::Pass
            | StatementKind::EnterCritical
            | StatementKind::ExitCritical => {}
            StatementKind::If {
                branches,
                otherwise,
            } => {
                for (condition, body) in branches {
                    if self.truth(condition)? {
                        return self.statements(body);
                    }
                }
                return self.statements(otherwise);
            }
            StatementKind::While { condition, body } => {
                while self.truth(condition)? {
                    self.step(statement.place, 1)?;
                    match self.statements(body)? {
                        Flow::On | Flow::Continue => {}
                        Flow::Break => break,
                        other => return Ok(other),
                    }
                }
            }
            StatementKind::Return(value) => {
                let value = match value {
                    Some(value) => self.expression(value)?,
                    None => Value::Nothing,
                };
                return Ok(Flow::Return(value));
            }
            StatementKind::Break => return Ok(Flow::Break),
            StatementKind::Continue => return Ok(Flow::Continue),
            StatementKind::Halt => return Ok(Flow::Halt),
            StatementKind::Declare { scope, name, value } => {
                let value = match value {
                    Some(value) => self.something(value)?,
                    None => Value::Nothing,
                };
                let locals = self
                    .frames
                    .last_mut()
                    .and_then(|frame| frame.locals.as_mut());
                match (scope, locals) {
                    (Scope::Local, Some(locals)) => {
                        locals.insert(name, value);
                    }
                    (Scope::Global, Some(locals)) => {
                        locals.remove(name.as_str());
                        self.globals.insert(name, value);
                    }
                    (_, None) => {
                        self.globals.insert(name, value);
                    }
                }
            }
            StatementKind::Assign { target, value } => {
                let value = self.something(value)?;
                self.assign(statement.place, target, value)?;
            }
            StatementKind::Kill(handle) => {
                // No thread runs that could end.
                self.something(handle)?;
            }
            StatementKind::Join(_) => {
                return Err(self
                    .machine
                    .refused(statement.place, "join", "waits for a thread"));
            }
            StatementKind::Expression(expression) => {
                // What a call gives is dropped; a `halt` inside a function ends everything.
                if let ExpressionKind::Call { name, arguments } = &expression.kind {
                    return match self.call(expression.place, name, arguments)? {
                        Called::Value(_) => Ok(Flow::On),
                        Called::Halt => Ok(Flow::Halt),
                    };
                }
                self.expression(expression)?;
            }
        }
        Ok(Flow::On)
    }

    fn truth(&mut self, condition: &'p Expression) -> Result<bool, ScriptError> {
        match self.expression(condition)? {
            Value::Truth(truth) => Ok(truth),
            other => {
                let message = format!("the condition is {}, and no truth value", other.kind());
                Err(ScriptError::new(condition.place, message))
            }
        }
    }

    /// The variable of a name, where it is looked for from the present function.
    fn variable(&mut self, name: &str) -> Option<&mut Value> {
        let locals = self
            .frames
            .last_mut()
            .and_then(|frame| frame.locals.as_mut());
        if let Some(found) = locals.and_then(|locals| locals.get_mut(name)) {
            return Some(found);
        }
        self.globals.get_mut(name)
    }

    fn assign(
        &mut self,
        place: Place,
        target: &'p Target,
        value: Value,
    ) -> Result<(), ScriptError> {
        if target.parts.is_empty() {
            match self.variable(&target.name) {
                Some(known) => *known = value,
                None => match self
                    .frames
                    .last_mut()
                    .and_then(|frame| frame.locals.as_mut())
                {
                    Some(locals) => {
                        locals.insert(&target.name, value);
                    }
                    None => {
                        self.globals.insert(&target.name, value);
                    }
                },
            }
            return Ok(());
        }
        let mut steps: Vec<Step> = Vec::new();
        for part in &target.parts {
            let Part::Element(parts) = part else {
                return Err(self.machine.refused(place, "struct", "is not evaluated"));
            };
            for index in parts {
                steps.push(Step::Index(self.index(index)?));
            }
        }
        let wrong = |message: String| ScriptError::new(place, message);
        let Some(variable) = self.variable(&target.name) else {
            let message = format!("`{}` has no value yet", shortened(&target.name));
            return Err(wrong(message));
        };
        let copied = replace(variable, &steps, value).map_err(wrong)?;
        self.step(place, copied)
    }

    fn index(&mut self, index: &'p Expression) -> Result<usize, ScriptError> {
        let value = self.expression(index)?;
        crate::elements::index(&value).map_err(|message| ScriptError::new(index.place, message))
    }

    /// A value that is not nothing.
    fn something(&mut self, expression: &'p Expression) -> Result<Value, ScriptError> {
        match self.expression(expression)? {
            Value::Nothing => {
                let message = "the function gives nothing, where a value is needed";
                Err(ScriptError::new(expression.place, message))
            }
            value => Ok(value),
        }
    }

    fn expression(&mut self, expression: &'p Expression) -> Result<Value, ScriptError> {
        self.step(expression.place, 1)?;
        self.deeper(expression.place, |inside| inside.value_of(expression))
    }

    fn values(&mut self, all: &'p [Expression]) -> Result<Vec<Value>, ScriptError> {
        all.iter().map(|each| self.something(each)).collect()
    }

    fn value_of(&mut self, expression: &'p Expression) -> Result<Value, ScriptError> {
        let place = expression.place;
        match &expression.kind {
            ExpressionKind::Number(number) => Ok(Value::Number(*number)),
            ExpressionKind::Text(text) => {
                crate::value::text(text).map_err(|message| ScriptError::new(place, message))
            }
            ExpressionKind::Truth(truth) => Ok(Value::Truth(*truth)),
            ExpressionKind::Name(name) => match self.variable(name) {
                None | Some(Value::Nothing) => {
                    let message = format!("`{}` has no value here", shortened(name));
                    Err(ScriptError::new(place, message))
                }
                Some(value) => Ok(value.clone()),
            },
            ExpressionKind::Call { name, arguments } => match self.call(place, name, arguments)? {
                Called::Value(value) => Ok(value),
                Called::Halt => {
                    let message = "`halt` in a function whose value is needed";
                    Err(ScriptError::new(place, message))
                }
            },
            ExpressionKind::Run { name, .. } => {
                let from = self.frames.last().and_then(|frame| frame.function);
                let thread = self.load.function(from, name);
                if thread.is_some_and(|index| self.load.counting.contains(&index)) {
                    let text = "threads that only count are not run";
                    self.machine.note(place, text);
                    return Ok(Value::Number(0.0));
                }
                Err(self.machine.refused(place, "run", "starts a thread"))
            }
            ExpressionKind::Member { name, .. } => {
                let name = shortened(name);
                Err(self
                    .machine
                    .refused(place, &name, "belongs to a struct or a remote program"))
            }
            ExpressionKind::Element { of, indices } => {
                let of = self.something(of)?;
                let mut found = of;
                for index in indices {
                    let at = self.index(index)?;
                    found = element(&found, at)
                        .map_err(|message| ScriptError::new(index.place, message))?;
                }
                Ok(found)
            }
            ExpressionKind::Pose(parts) => {
                let values = self.values(parts)?;
                let mut numbers = [0.0; 6];
                for ((number, value), part) in numbers.iter_mut().zip(values).zip(parts) {
                    let Value::Number(found) = value else {
                        let message =
                            format!("{} in a pose, where a number is needed", value.kind());
                        return Err(ScriptError::new(part.place, message));
                    };
                    *number = found;
                }
                Ok(Value::Pose(Rc::new(numbers)))
            }
            ExpressionKind::List(parts) => {
                let values = self.values(parts)?;
                let (value, size) =
                    list(values).map_err(|message| ScriptError::new(place, message))?;
                self.step(place, size)?;
                Ok(value)
            }
            ExpressionKind::Unary { operator, operand } => {
                let operand = self.something(operand)?;
                self.step(place, elements(&operand))?;
                crate::operators::unary(*operator, operand)
                    .map_err(|message| ScriptError::new(place, message))
            }
            ExpressionKind::Binary {
                operator,
                left,
                right,
            } => {
                let left = self.something(left)?;
                if let Some(decided) = crate::operators::decided(*operator, &left) {
                    return Ok(decided);
                }
                let right = self.something(right)?;
                self.step(place, elements(&left) + elements(&right))?;
                crate::operators::binary(*operator, &left, &right)
                    .map_err(|message| ScriptError::new(place, message))
            }
        }
    }

    fn call(
        &mut self,
        place: Place,
        name: &str,
        arguments: &'p [Argument],
    ) -> Result<Called, ScriptError> {
        let from = self.frames.last().and_then(|frame| frame.function);
        if let Some(index) = self.load.function(from, name) {
            return self.call_own(place, index, arguments);
        }
        let Some(builtin) = builtin(name) else {
            let message = format!("`{}` is not known here", shortened(name));
            return Err(ScriptError::new(place, message));
        };
        match builtin.does {
            Does::Refused(reason) => {
                return Err(self.machine.refused(place, builtin.name, reason.in_words()));
            }
            Does::Nothing(note) => {
                for argument in arguments {
                    self.something(&argument.value)?;
                }
                self.machine.note(place, note);
                return Ok(Called::Value(Value::Nothing));
            }
            Does::Compute(_) | Does::Evaluate(_) => {}
        }
        let values = self.bind(place, builtin.name, builtin.parameters, arguments)?;
        if let Some(missing) = builtin.missing(|index| values[index].is_some()) {
            let message = format!("{}: `{missing}` is missing", builtin.name);
            return Err(ScriptError::new(place, message));
        }
        let lists = values.iter().flatten().map(elements);
        self.step(place, CALL_STEPS + lists.sum::<usize>())?;
        let call = Call {
            place,
            name: builtin.name,
            values,
            parameters: builtin.parameters,
        };
        self.deeper(place, |inside| builtin.evaluate(&mut inside.machine, &call))
            .map(Called::Value)
    }

    /// Values of a call by the parameters of what it calls.
    fn bind(
        &mut self,
        place: Place,
        function: &str,
        names: &[&str],
        arguments: &'p [Argument],
    ) -> Result<Vec<Option<Value>>, ScriptError> {
        let of = arguments_of(place, function, names, arguments)?;
        let mut given = Vec::with_capacity(arguments.len());
        for argument in arguments {
            given.push(Some(self.something(&argument.value)?));
        }
        let value = |index: Option<usize>| index.and_then(|index| given[index].take());
        Ok(of.into_iter().map(value).collect())
    }

    fn call_own(
        &mut self,
        place: Place,
        index: usize,
        arguments: &'p [Argument],
    ) -> Result<Called, ScriptError> {
        let function = self.load.functions[index].function;
        match function.kind {
            FunctionKind::Function => {}
            FunctionKind::Thread => return Err(self.machine.refused(place, "thread", "is called")),
            FunctionKind::Secondary => {
                return Err(self
                    .machine
                    .refused(place, "sec", "runs beside the program"));
            }
        }
        if self.frames.len() > MOST_CALLS {
            let message = format!("calls are more than {MOST_CALLS} levels deep");
            return Err(ScriptError::new(place, message));
        }
        let names: Vec<&str> = function
            .parameters
            .iter()
            .map(|each| each.0.as_str())
            .collect();
        let values = self.bind(place, &shortened(&function.name), &names, arguments)?;
        let mut locals: BTreeMap<&'p str, Value> = BTreeMap::new();
        for ((name, otherwise), value) in function.parameters.iter().zip(values) {
            let value = match (value, otherwise) {
                (Some(value), _) => value,
                (None, Some(otherwise)) => self.something(otherwise)?,
                (None, None) => {
                    let message = format!(
                        "{}: `{}` is missing",
                        shortened(&function.name),
                        shortened(name)
                    );
                    return Err(ScriptError::new(place, message));
                }
            };
            locals.insert(name, value);
        }
        self.frames.push(Frame {
            function: Some(index),
            locals: Some(locals),
        });
        let flow = self.statements(&function.body);
        self.frames.pop();
        Ok(match flow? {
            Flow::Return(value) => Called::Value(value),
            Flow::Halt => Called::Halt,
            Flow::On | Flow::Break | Flow::Continue => Called::Value(Value::Nothing),
        })
    }
}

/// What came of a call.
enum Called {
    Value(Value),
    /// The program ends.
    Halt,
}
