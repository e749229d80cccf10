//! Calls of built-in functions with their values.

use crate::lexer::shortened;
use crate::place::{Place, ScriptError};
use crate::tree::Argument;
use crate::value::Value;

/// Of each parameter the argument that it gets, if any.
///
/// # Errors
/// An argument without a parameter, and two for one.
pub(crate) fn arguments_of(
    place: Place,
    function: &str,
    parameters: &[&str],
    arguments: &[Argument],
) -> Result<Vec<Option<usize>>, ScriptError> {
    let mut of: Vec<Option<usize>> = vec![None; parameters.len()];
    for (position, argument) in arguments.iter().enumerate() {
        let index = match &argument.name {
            None => (position < parameters.len()).then_some(position),
            Some(name) => parameters.iter().position(|each| each == name),
        };
        let Some(index) = index else {
            let message = match (&argument.name, parameters.len()) {
                (Some(name), _) => format!("{function} has no parameter `{}`", shortened(name)),
                (None, 1) => format!("{function} takes 1 argument at most"),
                (None, most) => format!("{function} takes {most} arguments at most"),
            };
            return Err(ScriptError::new(argument.value.place, message));
        };
        if of[index].replace(position).is_some() {
            let message = format!("{function}: `{}` is given twice", parameters[index]);
            return Err(ScriptError::new(place, message));
        }
    }
    Ok(of)
}

/// A call of a built-in function with its values.
#[derive(Debug, Clone)]
pub(crate) struct Call {
    pub place: Place,
    pub name: &'static str,
    /// By parameter; none where a call leaves it out.
    pub values: Vec<Option<Value>>,
    /// Names of the parameters.
    pub parameters: &'static [&'static str],
}

impl Call {
    /// An error at the call.
    pub fn error(&self, message: impl AsRef<str>) -> ScriptError {
        ScriptError::new(self.place, format!("{}: {}", self.name, message.as_ref()))
    }

    pub fn get(&self, index: usize) -> Option<&Value> {
        self.values.get(index).and_then(Option::as_ref)
    }

    fn wrong(&self, index: usize, wanted: &str) -> ScriptError {
        let parameter = self.parameters.get(index).copied().unwrap_or("argument");
        let found = self.get(index).map_or("missing", Value::kind);
        self.error(format!("{parameter} is {found}, where {wanted} is needed"))
    }

    pub fn value(&self, index: usize) -> Result<&Value, ScriptError> {
        self.get(index).ok_or_else(|| self.wrong(index, "a value"))
    }

    pub fn number(&self, index: usize) -> Result<f64, ScriptError> {
        match self.get(index) {
            Some(Value::Number(number)) => Ok(*number),
            _ => Err(self.wrong(index, "a number")),
        }
    }

    pub fn number_or(&self, index: usize, otherwise: f64) -> Result<f64, ScriptError> {
        match self.get(index) {
            None => Ok(otherwise),
            Some(_) => self.number(index),
        }
    }

    pub fn text(&self, index: usize) -> Result<&str, ScriptError> {
        match self.get(index) {
            Some(Value::Text(text)) => Ok(text),
            _ => Err(self.wrong(index, "a string")),
        }
    }

    pub fn numbers<const N: usize>(&self, index: usize) -> Result<[f64; N], ScriptError> {
        let numbers = self.get(index).and_then(Value::list_of_numbers);
        numbers
            .and_then(|numbers| <[f64; N]>::try_from(numbers).ok())
            .ok_or_else(|| self.wrong(index, &format!("a list of {N} numbers")))
    }

    pub fn joints(&self, index: usize) -> Result<needlebench_kinematics::Joints, ScriptError> {
        let joints = self.get(index).and_then(Value::joints);
        joints.ok_or_else(|| self.wrong(index, "a list of 6 joint positions"))
    }

    pub fn pose(&self, index: usize) -> Result<needlebench_kinematics::Pose, ScriptError> {
        let pose = self.get(index).and_then(Value::transform);
        pose.ok_or_else(|| self.wrong(index, "a pose"))
    }
}
