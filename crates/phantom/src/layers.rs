//! What a needle passes between skin and target.

use nalgebra::Point3;
pub use needlebench_insertion::Tissue as Passed;

use super::{Phantom, PhantomPart, Tissue};

/// Fat under the skin, m, where no part says what is fat (assumed), and the most of the wall that it takes.
const FAT_M: f64 = 10e-3;
const FAT_SHARE: f64 = 0.5;

/// Stretches shorter than this are those beside them, m.
const SHORTEST_M: f64 = 1e-3;

/// Farthest that curved surfaces are from their triangles where a middle is asked for, m.
const SURFACE_M: f64 = 1e-3;

/// A stretch of a needle in one tissue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassedLayer {
    /// Of what.
    pub tissue: Passed,
    /// Length along the needle, m.
    pub length_m: f64,
}

impl PassedLayer {
    /// Stretches on the way, the outermost first, as layers: those in one tissue are one, those below 1 mm are what is
    /// beside them. Where nobody knows what is fat, the wall begins with 10 mm of it (assumed), half of it at most.
    pub fn layers(stretches: impl IntoIterator<Item = Self>, is_fat_known: bool) -> Vec<Self> {
        let mut joined = Vec::new();
        for stretch in stretches {
            join(&mut joined, stretch);
        }
        let mut layers = without_short(&joined);
        let outermost = layers.first_mut().filter(|_| !is_fat_known);
        if let Some(first) = outermost.filter(|first| first.tissue == Passed::Wall) {
            let fat_m = FAT_M.min(FAT_SHARE * first.length_m);
            first.length_m -= fat_m;
            let fat = Self {
                tissue: Passed::Fat,
                length_m: fat_m,
            };
            layers.insert(0, fat);
        }
        layers
    }
}

/// Why it is not known what a needle passes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayersError {
    /// There is bone in the way.
    #[error("the needle meets `{0}`: nothing is known of a needle in bone")]
    Bone(String),
}

impl Phantom {
    /// The layers of a needle from where it enters the skin to where it ends (phantom frame), the outermost first.
    ///
    /// Lungs with what is in them, bullae (gas), effusions (fluid) and lesions are where their solids are; all else is wall,
    /// beginning with fat of an assumed thickness.
    ///
    /// # Errors
    /// [`LayersError::Bone`], unless it is bone that holds the end of the needle.
    pub fn layers(
        &self,
        entry: &Point3<f64>,
        tip: &Point3<f64>,
    ) -> Result<Vec<PassedLayer>, LayersError> {
        let length_m = (tip - entry).norm();
        if let Some(bone) = self.bones_met(entry, tip).next() {
            let name = bone.organ.as_ref().unwrap_or(&bone.name);
            return Err(LayersError::Bone(name.clone()));
        }
        // Later ones lie in earlier ones.
        let kinds = [Passed::Lung, Passed::Gas, Passed::Fluid, Passed::Lesion];
        let within = kinds.map(|kind| {
            let parts = self.parts.iter().filter(|part| passed(part) == Some(kind));
            let stretches = parts.flat_map(|part| part.solid.stretches(entry, tip));
            (kind, stretches.collect::<Vec<_>>())
        });
        let mut ends: Vec<f64> = within
            .iter()
            .flat_map(|(_, stretches)| stretches.iter().flatten().copied())
            .chain([0.0, 1.0])
            .collect();
        ends.sort_by(f64::total_cmp);
        let stretches = ends.windows(2).map(|pair| {
            let middle = 0.5 * (pair[0] + pair[1]);
            let is_in = |stretches: &[[f64; 2]]| {
                stretches
                    .iter()
                    .any(|[from, to]| (*from..=*to).contains(&middle))
            };
            let innermost = within.iter().rfind(|(_, stretches)| is_in(stretches));
            PassedLayer {
                tissue: innermost.map_or(Passed::Wall, |(kind, _)| *kind),
                length_m: (pair[1] - pair[0]) * length_m,
            }
        });
        Ok(PassedLayer::layers(stretches, false))
    }

    /// The bones that a needle passes, but for those that hold its end; phantom frame.
    pub fn bones_met(
        &self,
        entry: &Point3<f64>,
        tip: &Point3<f64>,
    ) -> impl Iterator<Item = &PhantomPart> {
        let bones = self.parts.iter().filter(|part| part.tissue == Tissue::Bone);
        bones.filter(|bone| {
            !bone.solid.stretches(entry, tip).is_empty() && !bone.solid.contains(tip)
        })
    }

    /// The middle of a structure, by the name of an organ or of a part: of the box around its surfaces, phantom frame.
    pub fn middle_of(&self, structure: &str) -> Option<Point3<f64>> {
        let is_of = |part: &&PhantomPart| {
            part.organ.as_deref() == Some(structure) || part.name == structure
        };
        let parts = self.parts.iter().filter(is_of);
        let corners = parts.flat_map(|part| {
            let surface = part.solid.shape.surface(SURFACE_M);
            let pose = part.solid.parent_from_shape;
            surface
                .vertices_m
                .into_iter()
                .map(move |at| (pose * at).coords)
        });
        let around = corners.map(|at| [at, at]);
        let [low, high] = around.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])])?;
        Some(Point3::from(0.5 * (low + high)))
    }
}

/// What a needle in a part of a phantom is in; none for what is no layer.
fn passed(part: &PhantomPart) -> Option<Passed> {
    let is_called = |word: &str| {
        part.name.contains(word)
            || part
                .organ
                .as_ref()
                .is_some_and(|organ| organ.contains(word))
    };
    match part.tissue {
        Tissue::Lesion => Some(Passed::Lesion),
        Tissue::Organ if is_called("bulla") || is_called("pneumothorax") => Some(Passed::Gas),
        Tissue::Organ if is_called("effusion") => Some(Passed::Fluid),
        Tissue::Organ if is_called("lung") => Some(Passed::Lung),
        _ => None,
    }
}

fn join(layers: &mut Vec<PassedLayer>, next: PassedLayer) {
    match layers.last_mut() {
        Some(last) if last.tissue == next.tissue => last.length_m += next.length_m,
        _ if next.length_m > 0.0 => layers.push(next),
        _ => {}
    }
}

/// The same without stretches that are too short to matter: each goes to the one before it, the first to the next.
fn without_short(all: &[PassedLayer]) -> Vec<PassedLayer> {
    let mut kept: Vec<PassedLayer> = Vec::new();
    let mut before_m = 0.0;
    for layer in all {
        let is_short = layer.length_m < SHORTEST_M && all.len() > 1;
        match kept.last_mut() {
            Some(last) if is_short => last.length_m += layer.length_m,
            None if is_short => before_m += layer.length_m,
            _ => join(
                &mut kept,
                PassedLayer {
                    length_m: layer.length_m + std::mem::take(&mut before_m),
                    ..*layer
                },
            ),
        }
    }
    if kept.is_empty() {
        // Short ones alone.
        let longest = all.iter().max_by(|a, b| a.length_m.total_cmp(&b.length_m));
        kept.extend(longest.map(|layer| PassedLayer {
            length_m: before_m,
            ..*layer
        }));
    }
    kept
}
