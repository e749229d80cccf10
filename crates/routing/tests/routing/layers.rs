//! What a needle passes, in voxels of slabs that are known, and in voxels of a phantom against its solids.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_phantom::{LayersError, Passed, PassedLayer, Phantom, Tissue};
use needlebench_routing::{Anatomy, Exit, Ray, SolidAnatomy, VoxelAnatomy, VoxelOptions, evenly};
use needlebench_scenario::scenario::NeedleRouteSection;
use needlebench_volume::{LabelMap, VoxelGrid};

use crate::voxels::usual;

/// A slab across x: its label with its name, Hounsfield units and thickness in mm.
type Slab = (u16, &'static str, i16, f64);

/// From the skin to a nodule: fat, muscle, an effusion, lung with a vessel and a bulla, and the nodule.
const CHEST: [Slab; 9] = [
    (0, "outside", -1000, 20.0),
    (1, "soft_tissue", -100, 8.0),
    (1, "soft_tissue", 50, 12.0),
    (4, "pleural_effusion", 5, 6.0),
    (2, "lung_left", -800, 10.0),
    (5, "lung_vessels", 40, 3.0),
    (2, "lung_left", -800, 7.0),
    (7, "bulla", -950, 5.0),
    (6, "nodule", 30, 15.0),
];

const ACROSS: usize = 60;
const VOXEL_M: f64 = 0.5e-3;
const IN_A_MM: f64 = 2.0;

struct Slabs {
    labels: LabelMap,
    hu: Vec<i16>,
}

impl Slabs {
    fn of(slabs: &[Slab]) -> Self {
        let mut columns: Vec<Slab> = Vec::new();
        for slab in slabs {
            let mut column = 0.0;
            while column < slab.3 * IN_A_MM {
                columns.push(*slab);
                column += 1.0;
            }
        }
        let size = [columns.len(), ACROSS, ACROSS];
        let grid = VoxelGrid::aligned(size, [VOXEL_M; 3], Point3::origin()).unwrap();
        let rows = (0..ACROSS * ACROSS).flat_map(|_| columns.iter());
        let mut names: Vec<(u16, String)> = Vec::new();
        for (label, name, ..) in slabs.iter().filter(|slab| slab.0 > 0) {
            if names.iter().all(|(known, _)| known != label) {
                names.push((*label, (*name).to_owned()));
            }
        }
        Self {
            hu: rows.clone().map(|slab| slab.2).collect(),
            labels: LabelMap {
                grid,
                labels: rows.map(|slab| slab.0).collect(),
                names,
            },
        }
    }

    /// Layers from the skin on towards the nodule's last column, lengths in mm; along x, and aside along y by so much.
    fn layers(&self, has_hu: bool, aside: f64) -> Result<Vec<(Passed, f64)>, LayersError> {
        let columns = self.labels.grid.size()[0] as f64;
        let target = Point3::new(columns - 1.0, 30.0, 30.0) * VOXEL_M;
        let options = VoxelOptions {
            lesions: &["nodule".to_owned()],
            off: &[NeedleRouteSection::MEDIASTINUM.to_owned()],
            hu: has_hu.then_some(&self.hu),
            ..usual()
        };
        let anatomy = VoxelAnatomy::new(&self.labels, Vector3::zeros(), target, &options).unwrap();
        let ray = Ray {
            target,
            outwards: UnitVector3::new_normalize(Vector3::new(-1.0, aside, 0.0)),
        };
        let Exit::Skin(depth_m) = anatomy.exit(&ray) else {
            panic!("no skin");
        };
        let layers = anatomy.layers(&ray, [0.0, depth_m])?;
        let slant = (1.0 + aside * aside).sqrt();
        let lengths = layers.iter();
        let lengths = lengths.map(|layer| (layer.tissue, layer.length_m * 1e3 / slant));
        Ok(lengths.collect())
    }
}

fn assert_same(found: &[(Passed, f64)], wanted: &[(Passed, f64)]) {
    let tissues = |all: &[(Passed, f64)]| all.iter().map(|each| each.0).collect::<Vec<_>>();
    assert_eq!(tissues(found), tissues(wanted), "{found:?}");
    for ((_, found), (_, wanted)) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
    }
}

#[test]
fn slabs_are_layers_of_their_thickness() {
    let slabs = Slabs::of(&CHEST);
    // The nodule ends at the centre of its last voxel.
    let wanted = [
        (Passed::Fat, 8.0),
        (Passed::Wall, 12.0),
        (Passed::Fluid, 6.0),
        (Passed::Lung, 20.0),
        (Passed::Gas, 5.0),
        (Passed::Lesion, 14.75),
    ];
    for aside in [0.0, 0.2] {
        assert_same(&slabs.layers(true, aside).unwrap(), &wanted);
    }
}

#[test]
fn without_hounsfield_units_names_tell_what_is_fat_or_some_is_assumed() {
    let mut named = CHEST;
    (named[1], named[2]) = (
        (8, "subcutaneous_fat", 50, 8.0),
        (9, "skeletal_muscle", -100, 12.0),
    );
    let wanted = [(Passed::Fat, 8.0), (Passed::Wall, 12.0)];
    for has_hu in [false, true] {
        let found = Slabs::of(&named).layers(has_hu, 0.0).unwrap();
        assert_same(&found[..2], &wanted);
    }
    // 20 mm of what is just soft: 10 of them are taken for fat.
    let found = Slabs::of(&CHEST).layers(false, 0.0).unwrap();
    assert_same(&found[..2], &[(Passed::Fat, 10.0), (Passed::Wall, 10.0)]);
}

#[test]
fn what_is_thinner_than_a_millimetre_is_what_lies_beside_it_and_bone_is_no_layer() {
    let mut thin = CHEST;
    thin[3].3 = 0.5;
    let found = Slabs::of(&thin).layers(true, 0.0).unwrap();
    let wanted = [
        (Passed::Fat, 8.0),
        (Passed::Wall, 12.5),
        (Passed::Lung, 20.0),
    ];
    assert_same(&found[..3], &wanted);
    let mut bony = CHEST;
    bony[3] = (3, "rib_left_5", 400, 6.0);
    assert_eq!(
        Slabs::of(&bony).layers(true, 0.0),
        Err(LayersError::Bone("rib_left_5".to_owned()))
    );
}

#[test]
fn voxels_of_a_phantom_have_its_layers() {
    const SPACING_M: f64 = 2e-3;
    let phantom = Phantom::build(&Phantom::size_preset("male-p50-supine").unwrap()).unwrap();
    // The one that is nearest to the skin, and about it as far as a needle reaches.
    let least_m = |target: Point3<f64>| {
        let depths_m = evenly(200).filter_map(|outwards| {
            let (_, depth_m) = phantom.skin_intersection(&target, &outwards)?;
            Some(depth_m)
        });
        depths_m.fold(f64::INFINITY, f64::min)
    };
    let targets = phantom.lesions.iter().map(|lesion| lesion.center_m);
    let target = targets
        .min_by(|a, b| least_m(*a).total_cmp(&least_m(*b)))
        .unwrap();
    let size = [90, 90, 40];
    let half = Vector3::new(90.0, 90.0, 40.0) * 0.5 * SPACING_M;
    let grid = VoxelGrid::aligned(size, [SPACING_M; 3], target - half).unwrap();
    let of_tissue = |wanted: Tissue, word: &'static str| {
        let parts = phantom.parts.iter();
        let parts = parts.filter(move |part| part.tissue == wanted && part.name.contains(word));
        parts.collect::<Vec<_>>()
    };
    let kinds = [
        (3_u16, of_tissue(Tissue::Lesion, "")),
        (2, of_tissue(Tissue::Organ, "lung")),
        (6, of_tissue(Tissue::Bone, "")),
    ];
    let mut labels = vec![0_u16; grid.len()];
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let at = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                if phantom.skin_signed_depth(&at) <= 0.0 {
                    continue;
                }
                let mut kinds = kinds.iter();
                let inside =
                    kinds.find(|(_, parts)| parts.iter().any(|part| part.solid.contains(&at)));
                labels[grid.offset([i, j, k])] = inside.map_or(1, |(label, _)| *label);
            }
        }
    }
    let names = [
        (1, "soft_tissue"),
        (2, "lung_right"),
        (3, "nodule"),
        (6, "bone"),
    ];
    let labels = LabelMap {
        grid,
        labels,
        names: names.map(|(label, name)| (label, name.to_owned())).into(),
    };
    let options = VoxelOptions {
        lesions: &["nodule".to_owned()],
        off: &[NeedleRouteSection::MEDIASTINUM.to_owned()],
        needle_m: 0.08,
        outside_m: 0.0,
        ..usual()
    };
    let voxels = VoxelAnatomy::new(&labels, Vector3::zeros(), target, &options).unwrap();
    let solids = SolidAnatomy::new(&phantom, target, true, &NeedleRouteSection::default());
    let mut compared = 0;
    for outwards in evenly(1000) {
        let ray = Ray { target, outwards };
        let Exit::Skin(depth_m) = solids.exit(&ray) else {
            continue;
        };
        // Not where the voxels end it, and not along a surface, where a voxel is far on the way.
        let is_within = ((ray.at(depth_m + 5e-3) - target).abs() - half).max() < 0.0;
        let is_steep = outwards.dot(&solids.skin_normal(&ray, depth_m)) > 0.8;
        if !is_within || !is_steep {
            continue;
        }
        let layers =
            [&solids as &dyn Anatomy, &voxels].map(|each| each.layers(&ray, [0.0, depth_m]));
        let [Ok(of_solids), Ok(of_voxels)] = layers else {
            continue;
        };
        compared += 1;
        for tissue in [Passed::Fat, Passed::Wall, Passed::Lung, Passed::Lesion] {
            let sum_m = |layers: &[PassedLayer]| -> f64 {
                let of_it = layers.iter().filter(|layer| layer.tissue == tissue);
                of_it.map(|layer| layer.length_m).sum()
            };
            let off_m = (sum_m(&of_solids) - sum_m(&of_voxels)).abs();
            assert!(
                off_m < 3_f64.sqrt() * SPACING_M,
                "{tissue:?} {off_m}: {of_solids:?} {of_voxels:?}"
            );
        }
    }
    assert!(compared > 20, "{compared}");
}
