//! A label map that was read.

use crate::{LabelMap, Remark, VolumeError};

/// A label map on the CT's grid, and what is odd about it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadLabels {
    /// Labels of the CT's voxels, with the names of those that have any.
    pub labels: LabelMap,
    /// What is odd.
    pub remarks: Vec<Remark>,
    /// Whether labels are numbers given while reading, of structures that the source names and does not number.
    pub is_numbered_here: bool,
}

impl ReadLabels {
    /// Gives labels the names that a list from elsewhere has for them.
    ///
    /// # Errors
    /// A list for labels that are numbered here: its numbers are of something else.
    pub fn rename(&mut self, given: &[(u16, String)]) -> Result<(), VolumeError> {
        if self.is_numbered_here && !given.is_empty() {
            return Err(VolumeError::refused(
                "names are given by number, but structures of a folder of masks or of an RT structure set have names \
                 and no numbers",
            )
            .hint("omit --label-names; rename the files of the masks, or the structures, instead"));
        }
        for (label, name) in &mut self.labels.names {
            if let Some((_, given)) = given.iter().find(|(known, _)| known == label) {
                name.clone_from(given);
            }
        }
        Ok(())
    }
}
