//! Elementary functions.

use crate::call::Call;
use crate::place::ScriptError;
use crate::value::Value;

type Done = Result<Value, ScriptError>;

/// A result, if there is one.
fn finite(call: &Call, number: f64) -> Done {
    if number.is_finite() {
        return Ok(Value::Number(number));
    }
    Err(call.error("there is no finite number for these arguments"))
}

fn of_one(call: &Call, function: fn(f64) -> f64) -> Done {
    let number = call.number(0)?;
    finite(call, function(number))
}

pub(crate) fn acos(call: &Call) -> Done {
    of_one(call, libm::acos)
}

pub(crate) fn asin(call: &Call) -> Done {
    of_one(call, libm::asin)
}

pub(crate) fn atan(call: &Call) -> Done {
    of_one(call, libm::atan)
}

/// The manual's `atan2(x, y)` is the angle of x over y.
pub(crate) fn atan2(call: &Call) -> Done {
    finite(call, libm::atan2(call.number(0)?, call.number(1)?))
}

pub(crate) fn ceil(call: &Call) -> Done {
    of_one(call, f64::ceil)
}

pub(crate) fn cos(call: &Call) -> Done {
    of_one(call, libm::cos)
}

pub(crate) fn d2r(call: &Call) -> Done {
    of_one(call, f64::to_radians)
}

pub(crate) fn floor(call: &Call) -> Done {
    of_one(call, f64::floor)
}

/// `log(b, f)`: of f to the base b.
pub(crate) fn log(call: &Call) -> Done {
    finite(
        call,
        libm::log(call.number(1)?) / libm::log(call.number(0)?),
    )
}

pub(crate) fn norm(call: &Call) -> Done {
    match call.value(0)? {
        Value::Number(number) => Ok(Value::Number(number.abs())),
        other => match other.list_of_numbers() {
            Some(all) => finite(call, length(&all)),
            None => Err(call.error(format!("of {} there is none", other.kind()))),
        },
    }
}

pub(crate) fn normalize(call: &Call) -> Done {
    let Some(all) = call.value(0)?.list_of_numbers() else {
        return Err(call.error("a list of numbers is needed"));
    };
    let length = length(&all);
    if length <= 0.0 || !length.is_finite() {
        return Err(call.error("the list has no direction"));
    }
    let scaled: Vec<f64> = all.iter().map(|each| each / length).collect();
    Ok(Value::numbers(&scaled))
}

fn length(all: &[f64]) -> f64 {
    all.iter().map(|each| each * each).sum::<f64>().sqrt()
}

pub(crate) fn pow(call: &Call) -> Done {
    finite(call, libm::pow(call.number(0)?, call.number(1)?))
}

pub(crate) fn r2d(call: &Call) -> Done {
    of_one(call, f64::to_degrees)
}

pub(crate) fn sin(call: &Call) -> Done {
    of_one(call, libm::sin)
}

pub(crate) fn sqrt(call: &Call) -> Done {
    of_one(call, f64::sqrt)
}

pub(crate) fn tan(call: &Call) -> Done {
    of_one(call, libm::tan)
}
