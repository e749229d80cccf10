//! Strings, lengths and messages.

use crate::call::Call;
use crate::machine::Machine;
use crate::place::ScriptError;
use crate::value::{Value, text};

type Done = Result<Value, ScriptError>;

/// Characters of a message that a note repeats.
const MOST_OF_A_MESSAGE: usize = 80;

fn made(call: &Call, new: &str) -> Done {
    text(new).map_err(|message| call.error(message))
}

pub(crate) fn length(_: &mut Machine<'_>, call: &Call) -> Done {
    let count = match call.value(0)? {
        Value::Text(text) => text.chars().count(),
        Value::List(all) => all.len(),
        other => return Err(call.error(format!("{} has no length", other.kind()))),
    };
    Ok(Value::Number(count as f64))
}

pub(crate) fn concatenate(_: &mut Machine<'_>, call: &Call) -> Done {
    let joined = format!("{}{}", call.value(0)?.text(), call.value(1)?.text());
    made(call, &joined)
}

pub(crate) fn is_empty(_: &mut Machine<'_>, call: &Call) -> Done {
    Ok(Value::Truth(call.text(0)?.is_empty()))
}

pub(crate) fn to_text(_: &mut Machine<'_>, call: &Call) -> Done {
    made(call, &call.value(0)?.text())
}

pub(crate) fn number(_: &mut Machine<'_>, call: &Call) -> Done {
    match call.text(0)?.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(Value::Number(number)),
        _ => Err(call.error("the string is no number")),
    }
}

fn said(call: &Call) -> String {
    let all: Vec<String> = call
        .values
        .iter()
        .flatten()
        .take(2)
        .map(Value::text)
        .collect();
    let all = all.concat();
    let printable = all
        .chars()
        .map(|letter| if letter.is_control() { ' ' } else { letter });
    printable.take(MOST_OF_A_MESSAGE).collect()
}

pub(crate) fn message(machine: &mut Machine<'_>, call: &Call) -> Done {
    call.value(0)?;
    machine.note(call.place, &format!("textmsg: {}", said(call)));
    Ok(Value::Nothing)
}

pub(crate) fn popup(machine: &mut Machine<'_>, call: &Call) -> Done {
    call.value(0)?;
    machine.note(call.place, "popup answered at once");
    Ok(Value::Nothing)
}
