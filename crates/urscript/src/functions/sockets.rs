//! Sockets: connections of a program, by name.
#![expect(
    clippy::unnecessary_wraps,
    reason = "built-in functions have one signature"
)]

use std::borrow::Cow;

use crate::call::Call;
use crate::live::{Live, Reply};
use crate::place::ScriptError;
use crate::value::{MOST_CHARACTERS, Value, integer, text, whole};

type Done = Result<Reply, ScriptError>;

/// The connection of calls that name none, and the time (s) that reading waits: those of UR's script manual.
const NAME: &str = "socket_0";
const WAIT_S: f64 = 2.0;

/// Most numbers of one reading: that of UR's script manual.
const MOST_NUMBERS: usize = 30;

fn truth(truth: bool) -> Done {
    Ok(Reply::Value(Value::Truth(truth)))
}

fn name(call: &Call, index: usize) -> Result<Cow<'static, str>, ScriptError> {
    match call.get(index) {
        None => Ok(Cow::Borrowed(NAME)),
        Some(_) => Ok(Cow::Owned(call.text(index)?.to_owned())),
    }
}

pub(crate) fn open(live: &mut Live<'_>, call: &Call) -> Done {
    let port = call.number(1)?;
    let fitting = whole(port).and_then(|port| u16::try_from(port).ok());
    let port = fitting.ok_or_else(|| call.error(format!("{port} is no port")))?;
    let name = name(call, 2)?;
    truth(live.host.open_socket(&name, call.text(0)?, port))
}

pub(crate) fn close(live: &mut Live<'_>, call: &Call) -> Done {
    live.host.close_socket(&name(call, 0)?);
    Ok(Reply::Value(Value::Nothing))
}

/// What is sent: a text, with or without a line end, a byte, or a whole number of 4 bytes.
pub(crate) fn send_line(live: &mut Live<'_>, call: &Call) -> Done {
    let line = format!("{}\n", call.value(0)?.text());
    truth(live.host.send(&name(call, 1)?, line.as_bytes()))
}

pub(crate) fn send_string(live: &mut Live<'_>, call: &Call) -> Done {
    let line = call.value(0)?.text();
    truth(live.host.send(&name(call, 1)?, line.as_bytes()))
}

pub(crate) fn send_byte(live: &mut Live<'_>, call: &Call) -> Done {
    let number = call.number(0)?;
    let byte = whole(number).and_then(|number| u8::try_from(number).ok());
    let byte = byte.ok_or_else(|| call.error(format!("{number} is no byte")))?;
    truth(live.host.send(&name(call, 1)?, &[byte]))
}

pub(crate) fn send_int(live: &mut Live<'_>, call: &Call) -> Done {
    let number = integer(call.number(0)?).map_err(|message| call.error(message))?;
    let bytes = number.to_be_bytes();
    truth(live.host.send(&name(call, 1)?, &bytes))
}

pub(crate) fn set_var(live: &mut Live<'_>, call: &Call) -> Done {
    let number = integer(call.number(1)?).map_err(|message| call.error(message))?;
    let line = format!("SET {} {number}\n", call.text(0)?);
    let sent = live.host.send(&name(call, 2)?, line.as_bytes());
    if sent {
        Ok(Reply::Value(Value::Nothing))
    } else {
        Err(call.error("the socket is not open"))
    }
}

/// How long a call waits, s; 0 is without end.
fn wait_s(call: &Call, index: usize) -> Result<f64, ScriptError> {
    let time_s = call.number_or(index, WAIT_S)?;
    Ok(if time_s > 0.0 { time_s } else { f64::INFINITY })
}

/// A reading that is complete, or that waits; without connection or in time it is what stands for none.
fn wait(
    live: &mut Live<'_>,
    (name, wait_s): (&str, f64),
    complete: Option<(usize, Value)>,
    none: Value,
) -> Done {
    if let Some((count, value)) = complete {
        live.host.take(name, count);
        return Ok(Reply::Value(value));
    }
    if live.host.received(name).is_some() && live.waited_s < wait_s {
        return Ok(Reply::Again);
    }
    Ok(Reply::Value(none))
}

/// The number of values, then the values; 0 and `none` where they did not come.
fn list_of(count: usize, values: &[f64], none: f64) -> Value {
    let mut all = vec![values.len() as f64];
    all.extend_from_slice(values);
    all.resize(count + 1, none);
    Value::numbers(&all)
}

fn count(call: &Call) -> Result<usize, ScriptError> {
    let number = call.number(0)?;
    match whole(number) {
        Some(count) if (1..=MOST_NUMBERS).contains(&count) => Ok(count),
        _ => Err(call.error(format!("{number} values: 1 to {MOST_NUMBERS} are read"))),
    }
}

fn read_binary(live: &mut Live<'_>, call: &Call, size: usize) -> Done {
    let count = count(call)?;
    let name = name(call, 1)?;
    let bytes = live.host.received(&name).unwrap_or_default();
    let complete = bytes.get(..count * size).map(|bytes| {
        let numbers: Vec<f64> = bytes
            .chunks_exact(size)
            .map(|chunk| match <[u8; 4]>::try_from(chunk) {
                Ok(four) => f64::from(i32::from_be_bytes(four)),
                Err(_) => f64::from(chunk[0]),
            })
            .collect();
        (count * size, list_of(count, &numbers, -1.0))
    });
    let none = list_of(count, &[], -1.0);
    wait(live, (&name, wait_s(call, 2)?), complete, none)
}

pub(crate) fn read_integers(live: &mut Live<'_>, call: &Call) -> Done {
    read_binary(live, call, 4)
}

pub(crate) fn read_bytes(live: &mut Live<'_>, call: &Call) -> Done {
    read_binary(live, call, 1)
}

/// A line of numbers in brackets: `(1.5, 2)`.
pub(crate) fn read_floats(live: &mut Live<'_>, call: &Call) -> Done {
    let count = count(call)?;
    let name = name(call, 1)?;
    let bytes = live.host.received(&name).unwrap_or_default();
    let end = bytes.iter().position(|byte| *byte == b')');
    let none = list_of(count, &[], f64::NAN);
    let complete = end.map(|end| {
        let text = String::from_utf8_lossy(&bytes[..end]);
        let inside = text.rsplit('(').next().unwrap_or_default();
        let numbers: Option<Vec<f64>> = inside
            .split(',')
            .map(|part| part.trim().parse::<f64>().ok())
            .collect();
        let numbers = numbers.filter(|numbers| numbers.len() == count);
        let value = match numbers {
            Some(numbers) => list_of(count, &numbers, f64::NAN),
            None => none.clone(),
        };
        (end + 1, value)
    });
    wait(live, (&name, wait_s(call, 2)?), complete, none)
}

fn string(call: &Call, bytes: &[u8]) -> Result<Value, ScriptError> {
    text(&String::from_utf8_lossy(bytes)).map_err(|message| call.error(message))
}

pub(crate) fn read_line(live: &mut Live<'_>, call: &Call) -> Done {
    let name = name(call, 0)?;
    let bytes = live.host.received(&name).unwrap_or_default();
    let complete = match bytes.iter().position(|byte| *byte == b'\n') {
        Some(end) => {
            let line = bytes[..end].strip_suffix(b"\r").unwrap_or(&bytes[..end]);
            Some((end + 1, string(call, line)?))
        }
        None => None,
    };
    let none = string(call, b"")?;
    wait(live, (&name, wait_s(call, 1)?), complete, none)
}

fn find(bytes: &[u8], part: &[u8]) -> Option<usize> {
    bytes.windows(part.len()).position(|window| window == part)
}

/// All that came; with a prefix or a suffix what lies behind the one and before the other.
pub(crate) fn read_string(live: &mut Live<'_>, call: &Call) -> Done {
    let name = name(call, 0)?;
    let [prefix, suffix] = [1, 2].map(|index| call.get(index).map(Value::text).unwrap_or_default());
    let bytes = live.host.received(&name).unwrap_or_default();
    let start = if prefix.is_empty() {
        Some(0)
    } else {
        find(bytes, prefix.as_bytes()).map(|at| at + prefix.len())
    };
    let end = start.and_then(|start| {
        if suffix.is_empty() {
            let end = bytes.len().min(start + MOST_CHARACTERS);
            return (end > start).then_some((start, end, end));
        }
        let at = start + find(&bytes[start..], suffix.as_bytes())?;
        Some((start, at, at + suffix.len()))
    });
    let complete = match end {
        Some((start, end, taken)) => Some((taken, string(call, &bytes[start..end])?)),
        None => None,
    };
    let none = string(call, b"")?;
    wait(live, (&name, wait_s(call, 4)?), complete, none)
}

/// Asks for a number by its name: `GET name`, answered by `name number`.
pub(crate) fn get_var(live: &mut Live<'_>, call: &Call) -> Done {
    let wanted = call.text(0)?;
    let name = name(call, 1)?;
    if live.waited_s <= 0.0 && !live.host.send(&name, format!("GET {wanted}\n").as_bytes()) {
        return Err(call.error("the socket is not open"));
    }
    let bytes = live.host.received(&name).unwrap_or_default();
    let complete = bytes.iter().position(|byte| *byte == b'\n').map(|end| {
        let line = String::from_utf8_lossy(&bytes[..end]);
        let number = line.trim().strip_prefix(wanted).unwrap_or_default();
        let number = number.trim().parse::<i32>().unwrap_or(0);
        (end + 1, Value::Number(f64::from(number)))
    });
    wait(live, (&name, WAIT_S), complete, Value::Number(0.0))
}
