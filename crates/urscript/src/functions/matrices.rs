//! Matrices: lists of rows of the same length.

use nalgebra::DMatrix;

use crate::call::Call;
use crate::place::ScriptError;
use crate::value::{Value, from_matrix, matrix};

type Done = Result<Value, ScriptError>;

fn value(call: &Call, matrix: &DMatrix<f64>) -> Done {
    if matrix.iter().any(|part| !part.is_finite()) {
        return Err(call.error("there is no finite matrix for these arguments"));
    }
    from_matrix(matrix).map_err(|message| call.error(message))
}

fn argument(call: &Call) -> Result<DMatrix<f64>, ScriptError> {
    let found = matrix(call.value(0)?);
    found.ok_or_else(|| call.error("a matrix is needed: a list of rows of the same length"))
}

/// Of a matrix, or of a pose.
pub(crate) fn inverse(call: &Call) -> Done {
    if let Value::Pose(_) = call.value(0)? {
        return super::poses::inverse(call);
    }
    let matrix = argument(call)?;
    if !matrix.is_square() {
        return Err(call.error("the matrix is not square"));
    }
    let inverse = matrix.try_inverse();
    value(
        call,
        &inverse.ok_or_else(|| call.error("the matrix is singular"))?,
    )
}

pub(crate) fn transpose(call: &Call) -> Done {
    value(call, &argument(call)?.transpose())
}

/// Rows and columns of a matrix, else the length.
pub(crate) fn size(call: &Call) -> Done {
    match matrix(call.value(0)?) {
        Some(matrix) => Ok(Value::numbers(&[
            matrix.nrows() as f64,
            matrix.ncols() as f64,
        ])),
        None => super::texts::length(call),
    }
}
