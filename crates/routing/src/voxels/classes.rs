//! What labels mean for a needle.

use needlebench_imaging::Label;
use needlebench_phantom::Passed;
use needlebench_volume::{LabelMap, SurfaceTissue, structure_of};

use super::blocks::BodySide;
use crate::Obstacle;

/// Words of fat in the names of labels, and of muscles.
const FAT: [&str; 2] = ["fat", "adipose"];
const MUSCLE: [&str; 4] = ["muscle", "autochthon", "iliopsoas", "gluteus"];

/// What a voxel is to a needle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Not of the body.
    Outside,
    /// Not of the body, and not air: arms, couch.
    Beside,
    /// What it may pass.
    Soft,
    /// Of a lung, by number.
    Lung(u8),
    /// In a lung without being air: small vessels, fissures.
    InLung,
    /// The lesion, or another.
    Lesion,
    Bone,
    Vessel,
    Organ,
}

/// A label, and what is known of it.
#[derive(Debug, Clone)]
pub(super) struct Class {
    pub name: String,
    pub kind: Kind,
    pub mark: Mark,
}

/// What makes a label more than its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mark {
    None,
    LungVessel,
    Bulla,
    Fissure,
    Gas,
}

impl Class {
    pub fn new(name: &str, kind: Kind) -> Self {
        Self {
            name: name.to_owned(),
            kind,
            mark: Mark::None,
        }
    }

    /// What a needle in it is in; none for bone, whose tissue nobody knows.
    pub fn passed(&self) -> Option<Passed> {
        let lower = self.name.to_lowercase();
        let is_called = |words: &[&str]| words.iter().any(|word| lower.contains(word));
        match self.kind {
            Kind::Bone => None,
            Kind::Lesion => Some(Passed::Lesion),
            Kind::InLung if self.mark == Mark::Bulla => Some(Passed::Gas),
            Kind::Lung(_) | Kind::InLung => Some(Passed::Lung),
            _ if self.mark == Mark::Gas || is_called(&["pneumothorax"]) => Some(Passed::Gas),
            _ if is_called(&["effusion", "fluid"]) => Some(Passed::Fluid),
            Kind::Soft if is_called(&FAT) => Some(Passed::Fat),
            // What may be passed by the scenario is bone all the same.
            Kind::Soft => (self.tissue() != Some(SurfaceTissue::Bone)).then_some(Passed::Wall),
            Kind::Organ if self.is_airway() => Some(Passed::Gas),
            _ => Some(Passed::Wall),
        }
    }

    /// Whether only Hounsfield units tell what of it is fat: its name says no more than that it is soft.
    pub fn may_be_fat(&self) -> bool {
        let lower = self.name.to_lowercase();
        let is_named = FAT.iter().chain(&MUSCLE).any(|word| lower.contains(word));
        let is_skin_or_unknown = matches!(self.tissue(), None | Some(SurfaceTissue::Skin));
        self.kind == Kind::Soft && !is_named && is_skin_or_unknown
    }

    fn tissue(&self) -> Option<SurfaceTissue> {
        structure_of(&self.name).map(|structure| structure.tissue)
    }

    fn is_airway(&self) -> bool {
        structure_of(&self.name).is_some_and(|structure| structure.name == "trachea")
    }

    /// Whether it counts as an obstacle for a target in a lung.
    pub fn is(&self, obstacle: Obstacle, target_lung: Option<u8>) -> bool {
        match self.kind {
            Kind::Bone => obstacle == Obstacle::Bone,
            Kind::Vessel => obstacle == Obstacle::Vessel,
            Kind::InLung => obstacle == Obstacle::Vessel && self.mark == Mark::LungVessel,
            Kind::Organ => obstacle == Obstacle::Organ,
            Kind::Lung(lung) => obstacle == Obstacle::Organ && target_lung != Some(lung),
            Kind::Outside | Kind::Beside | Kind::Soft | Kind::Lesion => false,
        }
    }
}

/// All labels as classes of one byte.
#[derive(Debug)]
pub(super) struct Classes {
    all: Vec<Class>,
    /// By label.
    of_label: Vec<u8>,
    lungs: Vec<String>,
}

impl Classes {
    /// Of a label map whose lesions have these names.
    pub fn of(labels: &LabelMap, lesions: &[String], off: &[String]) -> Self {
        let mut made = Self {
            all: vec![
                Class::new("outside", Kind::Outside),
                Class::new("soft tissue", Kind::Soft),
            ],
            of_label: vec![1; 1 << 16],
            lungs: Vec::new(),
        };
        made.of_label[0] = 0;
        for (label, name) in &labels.names {
            if *label == 0 {
                continue;
            }
            let class = made.class(name, lesions, off);
            let number = made.add(class);
            made.of_label[usize::from(*label)] = number;
        }
        made
    }

    /// Adds a class: its number. More structures than a byte tells apart share the last number of their kind.
    pub fn add(&mut self, class: Class) -> u8 {
        match u8::try_from(self.all.len()) {
            Ok(number) => {
                self.all.push(class);
                number
            }
            Err(_) => self.like(class.kind),
        }
    }

    /// On which sides of the skin a class is. What is added later is found within the body.
    pub fn sides(&self, number: u8) -> u8 {
        match self.all.get(usize::from(number)) {
            Some(class) if class.kind == Kind::Outside => BodySide::Outside as u8,
            Some(class) if class.kind == Kind::Beside => {
                BodySide::Outside as u8 | BodySide::Beside as u8
            }
            _ => BodySide::Body as u8,
        }
    }

    fn like(&self, kind: Kind) -> u8 {
        let last = self.all.iter().rposition(|class| class.kind == kind);
        last.and_then(|index| u8::try_from(index).ok()).unwrap_or(1)
    }

    fn class(&mut self, name: &str, lesions: &[String], off: &[String]) -> Class {
        let lower = name.to_lowercase();
        if lesions.iter().any(|lesion| lesion == name) {
            return Class::new(name, Kind::Lesion);
        }
        let is_off = off.iter().any(|each| each == name);
        let structure = structure_of(name);
        let tissue = structure.as_ref().map(|structure| structure.tissue);
        if is_off && tissue == Some(SurfaceTissue::Beside) {
            return Class::new(name, Kind::Outside);
        }
        if is_off {
            return Class::new(name, Kind::Soft);
        }
        let is_bulla = ["bulla", "emphysema"]
            .iter()
            .any(|word| lower.contains(word))
            || name == Label::NoLung.name();
        let is_fissure = lower.contains("fissure");
        if is_bulla || is_fissure {
            return Class {
                mark: if is_bulla { Mark::Bulla } else { Mark::Fissure },
                ..Class::new(name, Kind::InLung)
            };
        }
        if name == Label::Gas.name() {
            return Class {
                mark: Mark::Gas,
                ..Class::new(name, Kind::Organ)
            };
        }
        let Some(structure) = structure else {
            return Class::new(name, Kind::Soft);
        };
        let kind = match structure.tissue {
            SurfaceTissue::Skin => Kind::Soft,
            SurfaceTissue::Bone => Kind::Bone,
            SurfaceTissue::Vessel if structure.name == "lung_vessels" => Kind::InLung,
            SurfaceTissue::Vessel => Kind::Vessel,
            SurfaceTissue::Organ => Kind::Organ,
            SurfaceTissue::Lesion => Kind::Lesion,
            SurfaceTissue::Beside => Kind::Beside,
            SurfaceTissue::Lung => Kind::Lung(self.lung(&structure.name)),
        };
        Class {
            mark: if kind == Kind::InLung {
                Mark::LungVessel
            } else {
                Mark::None
            },
            ..Class::new(name, kind)
        }
    }

    fn lung(&mut self, name: &str) -> u8 {
        let index = self.lungs.iter().position(|lung| lung == name);
        let index = index.unwrap_or_else(|| {
            self.lungs.push(name.to_owned());
            self.lungs.len() - 1
        });
        u8::try_from(index).unwrap_or(u8::MAX)
    }

    pub(crate) fn of_label(&self, label: u16) -> u8 {
        self.of_label[usize::from(label)]
    }

    pub fn get(&self, class: u8) -> &Class {
        &self.all[usize::from(class)]
    }

    pub fn all(&self) -> impl Iterator<Item = &Class> {
        self.all.iter()
    }

    /// Number of a lung.
    pub(crate) fn lung_called(&self, name: &str) -> Option<u8> {
        let index = self.lungs.iter().position(|lung| lung == name)?;
        u8::try_from(index).ok()
    }

    pub(crate) fn lung_name(&self, lung: u8) -> &str {
        &self.lungs[usize::from(lung)]
    }
}
