//! What the programs of checks of scans share.

use needlebench_imaging::ImagingError;
use serde_json::{Value, json};

/// The answer about what is not read.
pub fn refused(error: ImagingError) -> Value {
    match error {
        ImagingError::Interrupted => json!({"refused": "interrupted"}),
        ImagingError::Refused {
            place,
            message,
            hint,
        } => json!({"refused": message, "place": place, "hint": hint}),
    }
}
