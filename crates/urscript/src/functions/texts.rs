//! Strings and lengths.

use std::rc::Rc;

use crate::call::Call;
use crate::place::ScriptError;
use crate::value::{Value, integer, text, whole};

type Done = Result<Value, ScriptError>;

fn made(call: &Call, new: &str) -> Done {
    text(new).map_err(|message| call.error(message))
}

pub(crate) fn length(call: &Call) -> Done {
    let count = match call.value(0)? {
        Value::Text(text) => text.chars().count(),
        Value::List(all) => all.len(),
        Value::Struct(all) => all.len(),
        other => return Err(call.error(format!("{} has no length", other.kind()))),
    };
    Ok(Value::Number(count as f64))
}

pub(crate) fn concatenate(call: &Call) -> Done {
    let joined = format!("{}{}", call.value(0)?.text(), call.value(1)?.text());
    made(call, &joined)
}

pub(crate) fn is_empty(call: &Call) -> Done {
    Ok(Value::Truth(call.text(0)?.is_empty()))
}

pub(crate) fn to_text(call: &Call) -> Done {
    made(call, &call.value(0)?.text())
}

pub(crate) fn number(call: &Call) -> Done {
    match call.text(0)?.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(Value::Number(number)),
        _ => Err(call.error("the string is no number")),
    }
}

/// A position in a string, from 0.
fn position(call: &Call, index: usize) -> Result<usize, ScriptError> {
    let number = call.number(index)?;
    whole(number).ok_or_else(|| call.error(format!("{number} is no position in a string")))
}

pub(crate) fn at(call: &Call) -> Done {
    let (text, at) = (call.text(0)?, position(call, 1)?);
    let letter = text.chars().nth(at);
    let letter = letter.ok_or_else(|| call.error(format!("the string has no character {at}")))?;
    made(call, &letter.to_string())
}

/// From a position on, all or a number of characters.
pub(crate) fn part(call: &Call) -> Done {
    let (text, from) = (call.text(0)?, position(call, 1)?);
    let count = match call.get(2) {
        None => usize::MAX,
        Some(Value::Number(number)) if *number < 0.0 => usize::MAX,
        Some(_) => position(call, 2)?,
    };
    let part: String = text.chars().skip(from).take(count).collect();
    made(call, &part)
}

/// Where a string first stands in another one, -1 where it does not.
pub(crate) fn find(call: &Call) -> Done {
    let (text, part) = (call.text(0)?, call.text(1)?);
    let from = match call.get(2) {
        None => 0,
        Some(_) => position(call, 2)?,
    };
    let start = text
        .char_indices()
        .nth(from)
        .map_or(text.len(), |(at, _)| at);
    let found = text[start..].find(part);
    Ok(Value::Number(match found {
        Some(at) => (from + text[start..start + at].chars().count()) as f64,
        None => -1.0,
    }))
}

/// The 32 bits of a whole number, the lowest first.
pub(crate) fn bits(call: &Call) -> Done {
    let number = integer(call.number(0)?).map_err(|message| call.error(message))?;
    let bits = (0..32).map(|bit| Value::Truth(number >> bit & 1 == 1));
    Ok(Value::List(Rc::new(bits.collect())))
}

/// The whole number of up to 32 bits, the lowest first.
pub(crate) fn of_bits(call: &Call) -> Done {
    let Value::List(all) = call.value(0)? else {
        return Err(call.error("a list of truth values is needed"));
    };
    let mut number = 0_u32;
    for (bit, value) in all.iter().enumerate() {
        match value {
            Value::Truth(truth) if bit < 32 => number |= u32::from(*truth) << bit,
            _ => return Err(call.error("a list of up to 32 truth values is needed")),
        }
    }
    Ok(Value::Number(f64::from(number.cast_signed())))
}
