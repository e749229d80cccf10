//! Label maps of what was found.

use needlebench_volume::{BesideKind, LabelMap, Volume};
use serde::Serialize;

use crate::mask::{IndexBox, Mask};

use super::{Lesion, Segmentation, Side};

/// Numbers of the label maps that this crate makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u16)]
pub enum Label {
    /// Within the skin and nothing else.
    SoftTissue = 1,
    /// Left lung with what it encloses and has no label of its own.
    LungLeft = 2,
    /// Right lung.
    LungRight = 3,
    /// Inside of trachea and bronchi.
    Airways = 4,
    /// Soft tissue in the lungs.
    LungVessels = 5,
    /// Bone with its marrow.
    Bone = 6,
    /// Blood with contrast medium.
    ContrastVessels = 7,
    /// Enclosed air that is neither lung nor airway.
    Gas = 8,
    /// Arms beside the body, with their bones.
    Arms = 9,
    /// What the patient lies on.
    Couch = 10,
    /// Anything else beside the body.
    Objects = 11,
    /// Costal cartilage.
    Cartilage = 12,
    /// Air in the place of the lungs that has no lung around it: bullae, emphysema, a pneumothorax.
    NoLung = 13,
    /// The couch beyond the field of view, assumed.
    AssumedCouch = 14,
}

/// Label of the first lesion; the others follow in their order.
pub const FIRST_LESION: u16 = 100;

impl Label {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::SoftTissue,
        Self::LungLeft,
        Self::LungRight,
        Self::Airways,
        Self::LungVessels,
        Self::Bone,
        Self::ContrastVessels,
        Self::Gas,
        Self::Arms,
        Self::Couch,
        Self::Objects,
        Self::Cartilage,
        Self::NoLung,
        Self::AssumedCouch,
    ];

    /// Its name in label maps and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::SoftTissue => "soft_tissue",
            Self::LungLeft => "lung_left",
            Self::LungRight => "lung_right",
            Self::Airways => "airways",
            Self::LungVessels => "lung_vessels",
            Self::Bone => "bone",
            Self::ContrastVessels => "contrast_vessels",
            Self::Gas => "gas",
            Self::Arms => BesideKind::Arms.name(),
            Self::Couch => BesideKind::Couch.name(),
            Self::Objects => BesideKind::Objects.name(),
            Self::Cartilage => "costal_cartilages",
            Self::NoLung => "air_without_lung",
            Self::AssumedCouch => BesideKind::AssumedCouch.name(),
        }
    }
}

/// What is known of a label.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LabelFacts {
    /// Its number.
    pub label: u16,
    /// Its name.
    pub name: String,
    /// Number of its voxels.
    pub voxels: usize,
    /// Their volume, m^3. Half a voxel of the surface is uncertain either way.
    pub volume_m3: f64,
}

/// Every voxel's label; where structures overlap, the later one of [`Label`] has it, and lesions have it before all.
pub fn label_map(
    volume: &Volume,
    found: &Segmentation,
    lesions: &[Lesion],
) -> (LabelMap, Vec<LabelFacts>) {
    let mut map = LabelMap {
        grid: volume.grid.clone(),
        labels: vec![0; volume.grid.len()],
        names: Label::ALL
            .iter()
            .map(|&label| (label as u16, label.name().to_owned()))
            .collect(),
    };
    let whole = IndexBox::whole(volume.grid.size());
    for each in &found.beside {
        let label = match each.kind {
            BesideKind::Arms => Label::Arms,
            BesideKind::Couch => Label::Couch,
            BesideKind::Objects => Label::Objects,
            BesideKind::AssumedCouch => Label::AssumedCouch,
        };
        paint(&mut map, &each.bounds, &each.mask, label as u16);
    }
    paint(&mut map, &whole, &found.body.mask, Label::SoftTissue as u16);
    for lung in &found.lungs.lungs {
        let label = match lung.side {
            Side::Left => Label::LungLeft,
            Side::Right => Label::LungRight,
        };
        paint(&mut map, &found.lungs.bounds, &lung.mask, label as u16);
    }
    for (bounds, mask, label) in [
        (&found.lungs.bounds, &found.lungs.no_lung, Label::NoLung),
        (&found.lungs.bounds, &found.lungs.gas, Label::Gas),
        (&found.lungs.bounds, &found.lungs.airways, Label::Airways),
        (
            &found.lungs.bounds,
            &found.lungs.vessels,
            Label::LungVessels,
        ),
        (&found.bone.bounds, &found.bone.cartilage, Label::Cartilage),
        (&found.bone.bounds, &found.bone.bone, Label::Bone),
        (
            &found.bone.bounds,
            &found.bone.contrast,
            Label::ContrastVessels,
        ),
    ] {
        paint(&mut map, bounds, mask, label as u16);
    }
    for (number, lesion) in (FIRST_LESION..).zip(lesions) {
        paint(&mut map, &lesion.bounds, &lesion.mask, number);
        map.names.push((number, lesion.name.clone()));
    }
    let facts = label_facts(&map);
    (map, facts)
}

/// Gives the voxels of a mask of a box a label.
pub fn paint(map: &mut LabelMap, within: &IndexBox, mask: &Mask, label: u16) {
    let [_, ny, nz] = mask.size();
    for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
        let row = map
            .grid
            .offset([within.first[0], j + within.first[1], k + within.first[2]]);
        for [from, to] in mask.runs(j, k) {
            map.labels[row + from..row + to].fill(label);
        }
    }
}

/// Voxels and volume of every label that a map names.
pub(crate) fn label_facts(map: &LabelMap) -> Vec<LabelFacts> {
    let mut counts = vec![0_usize; 1 << 16];
    // Neighbours mostly have the same label: these are counted at once.
    for some in map.labels.chunks(64) {
        let first = some[0];
        let differ = some
            .iter()
            .fold(0, |differ, &label| differ | (label ^ first));
        if differ == 0 {
            counts[usize::from(first)] += some.len();
        } else {
            for &label in some {
                counts[usize::from(label)] += 1;
            }
        }
    }
    let voxel_m3 = map.grid.steps_m().determinant().abs();
    map.names
        .iter()
        .map(|(label, name)| {
            let voxels = counts[usize::from(*label)];
            LabelFacts {
                label: *label,
                name: name.clone(),
                voxels,
                volume_m3: voxels as f64 * voxel_m3,
            }
        })
        .collect()
}
