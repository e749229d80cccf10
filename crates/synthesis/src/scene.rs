//! What is scanned: solids with their Hounsfield units.

use needlebench_geometry::Solid;
use needlebench_kinematics::Pose;

/// A solid of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenePart {
    /// The exact solid, in `ct`.
    pub solid: Solid,
    /// Hounsfield units before the scanner clips them: steel is far above 3071.
    pub hu: f64,
    /// What the label map has where this part is on top; 0 is nothing.
    pub label: u16,
}

/// Solids in a room of air. Where parts overlap, the later one is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// In their order: later ones override earlier ones.
    pub parts: Vec<ScenePart>,
    /// Labels and what they are called, in the order of the labels.
    pub names: Vec<(u16, String)>,
    /// Hounsfield units of what is around them.
    pub around_hu: f64,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            parts: Vec::new(),
            names: Vec::new(),
            around_hu: f64::from(needlebench_volume::AIR_HU),
        }
    }
}

impl Scene {
    /// A part on top of all so far.
    pub fn push(&mut self, solid: Solid, hu: f64, label: u16) {
        self.parts.push(ScenePart { solid, hu, label });
    }

    /// The label of this name: the one that it has, or the next one.
    pub fn label(&mut self, name: &str) -> u16 {
        if let Some((label, _)) = self.names.iter().find(|(_, known)| known == name) {
            return *label;
        }
        let label = self
            .names
            .last()
            .map_or(1, |(last, _)| last.saturating_add(1));
        self.names.push((label, name.to_owned()));
        label
    }

    /// With every solid moved: a patient who lies otherwise, or elsewhere.
    #[must_use]
    pub fn moved(mut self, after_from_before: &Pose) -> Self {
        for part in &mut self.parts {
            part.solid.parent_from_shape = after_from_before * part.solid.parent_from_shape;
        }
        self
    }
}
