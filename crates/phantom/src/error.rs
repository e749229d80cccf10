//! What can be wrong with phantom parameters.

use needlebench_input::schema::Misfit;

/// Why a phantom cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PhantomError {
    /// A parameter file is not TOML, has an unknown key or a value of the wrong type.
    #[error("phantom parameters: {message}")]
    Parse {
        /// The parser's message, with line and column.
        message: String,
    },
    /// No preset of that name.
    #[error("no phantom preset `{name}`; known: {}", known.join(", "))]
    UnknownPreset {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: Vec<&'static str>,
    },
    /// A value is outside the range of human anatomy (or of the phantom's construction), no number, or
    /// no usable name.
    #[error("phantom: {message}{}", hint.as_ref().map_or(String::new(), |hint| format!(" ({hint})")))]
    Value {
        /// Key, e.g. `breadth_mm` or `lesions[0].center_mm[1]`.
        key: String,
        /// What is wrong with its value.
        message: String,
        /// How to fix it.
        hint: Option<String>,
    },
    /// Two lesions or two markers share a name.
    #[error("phantom has two {kind}s named `{name}`")]
    DuplicateName {
        /// `lesion` or `marker`.
        kind: &'static str,
        /// The shared name.
        name: String,
    },
    /// The chest walls leave no space for the thoracic organs.
    #[error(
        "phantom chest walls leave {room_mm:.1} mm of {what}, {needed_mm:.1} mm required: \
         reduce the wall thicknesses or enlarge the chest"
    )]
    NoRoom {
        /// What is too small.
        what: &'static str,
        /// What the parameters leave, mm.
        room_mm: f64,
        /// What is needed, mm.
        needed_mm: f64,
    },
    /// An anatomical part would break through the skin.
    #[error("phantom part `{part}` extends {by_mm:.1} mm out of the skin: enlarge the chest walls")]
    PartOutsideSkin {
        /// Name of the part.
        part: String,
        /// By how much, mm.
        by_mm: f64,
    },
    /// A lesion is not wholly inside the skin.
    #[error(
        "lesion `{lesion}` at ({:.1}, {:.1}, {:.1}) mm in the phantom frame is not entirely inside \
         the skin: it extends out by {by_mm:.1} mm", center_mm[0], center_mm[1], center_mm[2]
    )]
    LesionOutsideSkin {
        /// Name of the lesion.
        lesion: String,
        /// Its centre, phantom frame, mm.
        center_mm: [f64; 3],
        /// By how much, mm.
        by_mm: f64,
    },
    /// A marker's height is above or below the skin.
    #[error(
        "marker `{marker}` at height {height_mm} mm is not on the side of the skin, which spans \
         +-{limit_mm:.1} mm for markers"
    )]
    MarkerOffSkin {
        /// Name of the marker.
        marker: String,
        /// Its height, phantom frame z, mm.
        height_mm: f64,
        /// Largest height, mm.
        limit_mm: f64,
    },
}

impl From<Misfit> for PhantomError {
    fn from(misfit: Misfit) -> Self {
        let Misfit {
            key, message, hint, ..
        } = misfit;
        Self::Value { key, message, hint }
    }
}
