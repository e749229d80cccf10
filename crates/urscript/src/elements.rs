//! Parts of values: elements of lists, poses and matrices, members of structs.

use std::rc::Rc;

use crate::value::{Value, checked_size, whole};

/// A step into a value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Step<'a> {
    Index(usize),
    Member(&'a str),
}

/// An index.
pub(crate) fn index(value: &Value) -> Result<usize, String> {
    let found = match value {
        Value::Number(number) => whole(*number),
        _ => None,
    };
    found.ok_or_else(|| {
        let text: String = value.text().chars().take(40).collect();
        format!("{text} is no index: they are whole numbers from 0")
    })
}

fn outside(index: usize, length: usize) -> String {
    format!("there is no element {index} of {length}: the first one is 0")
}

/// An element of a list or a pose.
pub(crate) fn element(of: &Value, index: usize) -> Result<Value, String> {
    let (found, length) = match of {
        Value::List(all) => (all.get(index).cloned(), all.len()),
        Value::Pose(all) => (all.get(index).copied().map(Value::Number), all.len()),
        other => return Err(format!("{} has no elements", other.kind())),
    };
    found.ok_or_else(|| outside(index, length))
}

/// A member of a struct.
pub(crate) fn member(of: &Value, name: &str) -> Result<Value, String> {
    let Value::Struct(all) = of else {
        return Err(format!("{} has no member `{name}`", of.kind()));
    };
    let found = all.iter().find(|(known, _)| **known == *name);
    found
        .map(|(_, value)| value.clone())
        .ok_or_else(|| format!("the struct has no member `{name}`"))
}

/// Puts a value in the place of a part; with the number of elements that were copied for it.
pub(crate) fn replace(of: &mut Value, steps: &[Step], value: Value) -> Result<usize, String> {
    let [first, rest @ ..] = steps else {
        *of = value;
        return Ok(0);
    };
    // What grew is looked at as a whole.
    let grows = matches!(value, Value::List(_) | Value::Struct(_));
    let copied = match (&mut *of, first) {
        (Value::List(all), Step::Index(index)) => {
            let length = all.len();
            let copied = if Rc::strong_count(all) > 1 { length } else { 0 };
            let all = Rc::make_mut(all);
            let found = all.get_mut(*index).ok_or_else(|| outside(*index, length))?;
            copied + replace(found, rest, value)?
        }
        (Value::Struct(all), Step::Member(name)) => {
            let copied = if Rc::strong_count(all) > 1 {
                all.len()
            } else {
                0
            };
            let all = Rc::make_mut(all);
            let found = all.iter_mut().find(|(known, _)| **known == **name);
            let (_, found) = found.ok_or_else(|| format!("the struct has no member `{name}`"))?;
            copied + replace(found, rest, value)?
        }
        (Value::Pose(all), Step::Index(index)) => {
            let Value::Number(number) = value else {
                return Err(format!(
                    "{} in a pose, where a number is needed",
                    value.kind()
                ));
            };
            if !rest.is_empty() {
                return Err("a number has no elements".to_owned());
            }
            let all = Rc::make_mut(all);
            let length = all.len();
            *all.get_mut(*index).ok_or_else(|| outside(*index, length))? = number;
            0
        }
        (other, Step::Member(name)) => {
            return Err(format!("{} has no member `{name}`", other.kind()));
        }
        (other, Step::Index(_)) => return Err(format!("{} has no elements", other.kind())),
    };
    let size = match of {
        Value::List(all) if grows => checked_size(all)?,
        Value::Struct(_) if grows => checked_size(std::slice::from_ref(of))?,
        _ => 0,
    };
    Ok(copied + size)
}

/// Elements of a list or a struct, those of lists in it included.
pub(crate) fn size(value: &Value) -> usize {
    match value {
        Value::List(_) | Value::Struct(_) => checked_size(std::slice::from_ref(value)).unwrap_or(0),
        _ => 0,
    }
}
