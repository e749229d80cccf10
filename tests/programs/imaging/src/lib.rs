//! What the programs of checks of scans share.

use needlebench_volume::VolumeError;
use serde_json::{Value, json};

/// The answer about what is not read.
pub fn refused(error: VolumeError) -> Value {
    match error {
        VolumeError::Interrupted => json!({"refused": "interrupted"}),
        VolumeError::Refused {
            place,
            message,
            hint,
        } => json!({"refused": message, "place": place, "hint": hint}),
    }
}
