//! What operators make of values.

use nalgebra::DMatrix;

use crate::tree::{Binary, Unary};
use crate::value::{Value, from_matrix, list, matrix};

/// The value of an operator before its operand.
pub(crate) fn unary(operator: Unary, operand: Value) -> Result<Value, String> {
    match (operator, operand) {
        (Unary::Not, Value::Truth(truth)) => Ok(Value::Truth(!truth)),
        (Unary::Minus, Value::Number(number)) => Ok(Value::Number(-number)),
        (Unary::Plus, Value::Number(number)) => Ok(Value::Number(number)),
        (Unary::Minus, value) if value.list_of_numbers().is_some() => {
            let numbers = value.list_of_numbers().unwrap_or_default();
            let negated: Vec<f64> = numbers.iter().map(|number| -number).collect();
            Ok(Value::numbers(&negated))
        }
        (operator, operand) => {
            let sign = match operator {
                Unary::Minus => "-",
                Unary::Plus => "+",
                Unary::Not => "not",
            };
            Err(format!("`{sign}` of {}", operand.kind()))
        }
    }
}

/// The value of an operator that its first operand decides alone: the second one is not looked at then.
pub(crate) fn decided(operator: Binary, left: &Value) -> Option<Value> {
    match (operator, left) {
        (Binary::And, Value::Truth(false)) => Some(Value::Truth(false)),
        (Binary::Or, Value::Truth(true)) => Some(Value::Truth(true)),
        _ => None,
    }
}

/// The value of an operator between two operands.
pub(crate) fn binary(operator: Binary, left: &Value, right: &Value) -> Result<Value, String> {
    let wrong = || {
        let (left, right) = (left.kind(), right.kind());
        format!("`{}` between {left} and {right}", operator.sign())
    };
    match (operator, left, right) {
        (Binary::Equal | Binary::Unequal, _, _) => {
            if std::mem::discriminant(left) != std::mem::discriminant(right) {
                return Err(wrong());
            }
            let is_equal = left == right;
            Ok(Value::Truth(is_equal == (operator == Binary::Equal)))
        }
        (Binary::And, Value::Truth(left), Value::Truth(right)) => Ok(Value::Truth(*left && *right)),
        (Binary::Or, Value::Truth(left), Value::Truth(right)) => Ok(Value::Truth(*left || *right)),
        (Binary::Xor, Value::Truth(left), Value::Truth(right)) => Ok(Value::Truth(left != right)),
        (_, Value::Number(left), Value::Number(right)) => match compared(operator, *left, *right) {
            Some(truth) => Ok(Value::Truth(truth)),
            None => Ok(Value::Number(
                calculated(operator, *left, *right)?.ok_or_else(wrong)?,
            )),
        },
        (Binary::Multiply, Value::Number(factor), all)
        | (Binary::Multiply, all, Value::Number(factor)) => {
            each(&all.list_of_numbers().ok_or_else(wrong)?, |number| {
                calculated(Binary::Multiply, number, *factor)
            })
        }
        (Binary::Multiply, Value::List(_), Value::List(_)) => {
            matrix_product(left, right)?.ok_or_else(wrong)
        }
        (Binary::Divide, all, Value::Number(divisor)) => {
            each(&all.list_of_numbers().ok_or_else(wrong)?, |number| {
                calculated(Binary::Divide, number, *divisor)
            })
        }
        (Binary::Add | Binary::Subtract, Value::List(_), Value::List(_)) => {
            let (left, right) = (left.list_of_numbers(), right.list_of_numbers());
            let (left, right) = left.zip(right).ok_or_else(wrong)?;
            if left.len() != right.len() {
                return Err(format!(
                    "`{}` between lists of {} and {} numbers",
                    operator.sign(),
                    left.len(),
                    right.len()
                ));
            }
            let mut right = right.into_iter();
            each(&left, |number| {
                calculated(operator, number, right.next().unwrap_or(0.0))
            })
        }
        _ => Err(wrong()),
    }
}

/// A matrix times a matrix, or times a list.
fn matrix_product(left: &Value, right: &Value) -> Result<Option<Value>, String> {
    let Some(left) = matrix(left) else {
        return Ok(None);
    };
    let column = right.list_of_numbers();
    let right = match &column {
        Some(numbers) => DMatrix::from_column_slice(numbers.len(), 1, numbers),
        None => match matrix(right) {
            Some(right) => right,
            None => return Ok(None),
        },
    };
    if left.ncols() != right.nrows() {
        let (columns, rows) = (left.ncols(), right.nrows());
        return Err(format!("`*` between {columns} columns and {rows} rows"));
    }
    let product = left * right;
    if product.iter().any(|part| !part.is_finite()) {
        return Err("the product is no finite matrix".to_owned());
    }
    if column.is_some() {
        return Ok(Some(Value::numbers(product.as_slice())));
    }
    from_matrix(&product).map(Some)
}

fn each(
    numbers: &[f64],
    mut of: impl FnMut(f64) -> Result<Option<f64>, String>,
) -> Result<Value, String> {
    let mut made = Vec::with_capacity(numbers.len());
    for number in numbers {
        made.push(Value::Number(of(*number)?.unwrap_or(f64::NAN)));
    }
    list(made).map(|(value, _)| value)
}

fn compared(operator: Binary, left: f64, right: f64) -> Option<bool> {
    Some(match operator {
        Binary::Less => left < right,
        Binary::Greater => left > right,
        Binary::AtMost => left <= right,
        Binary::AtLeast => left >= right,
        _ => return None,
    })
}

/// A finite number; none where the operator makes none of numbers.
///
/// Numbers are doubles throughout. What the controller makes of the remainder of negative or broken numbers is not
/// known, and not guessed.
fn calculated(operator: Binary, left: f64, right: f64) -> Result<Option<f64>, String> {
    let found = match operator {
        Binary::Add => left + right,
        Binary::Subtract => left - right,
        Binary::Multiply => left * right,
        Binary::Divide | Binary::Remainder if right == 0.0 => {
            return Err(format!("{left} is divided by 0"));
        }
        Binary::Divide => left / right,
        Binary::Remainder => {
            let are_whole = [left, right]
                .iter()
                .all(|number| *number >= 0.0 && number.fract() == 0.0);
            if !are_whole {
                return Err(format!(
                    "{left} % {right}: the remainder is evaluated of whole numbers that are not negative"
                ));
            }
            left % right
        }
        _ => return Ok(None),
    };
    if !found.is_finite() {
        return Err(format!(
            "{left} {} {right} is no finite number",
            operator.sign()
        ));
    }
    Ok(Some(found))
}
