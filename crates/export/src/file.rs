//! A file of an export.

/// A file to be written, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExportedFile {
    /// Its path beside the others of the same export, with `/` between folders. The first file of an
    /// export is the one that people open.
    pub name: String,
    /// What it holds.
    pub bytes: Vec<u8>,
}

impl ExportedFile {
    /// A file with a text.
    pub fn text(name: impl Into<String>, text: String) -> Self {
        Self {
            name: name.into(),
            bytes: text.into_bytes(),
        }
    }
}
