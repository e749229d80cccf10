//! The phantom as a scanner meets it: each part with its Hounsfield units, from the skin inwards.

use std::sync::Arc;

use nalgebra::Vector3;
use needlebench_geometry::{ConvexMesh, Shape, Solid, TriangleMesh};
use needlebench_phantom::{Phantom, PhantomPart, Tissue};
use needlebench_synthesis::Scene;
use serde::Serialize;

/// Hounsfield units of what a chest is made of. Textbook values, all of them assumed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Materials {
    /// Skin, and a phantom of which no more is known.
    pub skin: f64,
    /// Fat under the skin.
    pub fat: f64,
    /// Muscle and all else that has no part of its own.
    pub muscle: f64,
    /// Lung with its small vessels, at rest.
    pub lung: f64,
    /// The cleft between two lobes, of a part of a millimetre, on the drawn millimetre.
    pub fissure: f64,
    /// Air in windpipe and bronchi.
    pub air: f64,
    /// Walls of windpipe and bronchi.
    pub airway_wall: f64,
    /// Heart, and blood without contrast medium.
    pub blood: f64,
    /// Liver.
    pub liver: f64,
    /// Vessels; 150 to 300 with contrast medium.
    pub vessel: f64,
    /// The hard shell of bones.
    pub cortical: f64,
    /// What is in that shell.
    pub cancellous: f64,
    /// Cartilage of the ribs.
    pub cartilage: f64,
    /// Solid lesions.
    pub lesion: f64,
    /// Plastic of a marker's disc.
    pub marker_disc: f64,
    /// Foam that carries a marker's sphere, and its light disc.
    pub marker_carrier: f64,
    /// A marker's sphere: glass or ceramic.
    pub marker_sphere: f64,
}

impl Default for Materials {
    fn default() -> Self {
        Self {
            skin: 40.0,
            fat: -100.0,
            muscle: 50.0,
            lung: -850.0,
            fissure: -700.0,
            air: -1000.0,
            airway_wall: 40.0,
            blood: 45.0,
            liver: 60.0,
            vessel: 45.0,
            cortical: 900.0,
            cancellous: 200.0,
            cartilage: 100.0,
            lesion: 35.0,
            marker_disc: 100.0,
            marker_carrier: -950.0,
            marker_sphere: 1200.0,
        }
    }
}

/// Thickness of the skin, and of it with the fat under it, m (assumed).
const SKIN_M: f64 = 2e-3;
const SKIN_AND_FAT_M: f64 = 12e-3;
/// Thickness of the hard shell of bones, m (assumed).
const CORTICAL_M: f64 = 1e-3;
/// Thickness of an airway's wall, m: as the phantom's parts are drawn.
const AIRWAY_WALL_M: f64 = 1e-3;

/// The phantom and the patient's limbs, in the phantom's frame; labels are organs, or tissues where there is none.
///
/// Later parts lie over earlier ones: skin, fat, muscle, organs, vessels, airways, bones, lesions, markers. Whole bones come before
/// their insides, so that pieces of a rib that overlap have one shell.
pub(crate) fn phantom_scene(
    phantom: &Phantom,
    limbs: &[PhantomPart],
    materials: &Materials,
) -> Scene {
    let mut builder = Builder {
        scene: Scene::default(),
        materials,
    };
    let of =
        |wanted: fn(&PhantomPart) -> bool| phantom.parts.iter().filter(move |part| wanted(part));
    let spheres: Vec<&str> = phantom
        .markers
        .iter()
        .filter(|marker| marker.sphere.is_some())
        .map(|marker| marker.name.as_str())
        .collect();

    builder.outside(phantom.skin(), limbs);
    for part in of(|part| part.tissue == Tissue::Organ && !is_airway(part)) {
        builder.add(part, builder.organ_hu(part));
    }
    for part in of(|part| part.tissue == Tissue::Fissure) {
        builder.add(part, materials.fissure);
    }
    for part in of(|part| part.tissue == Tissue::Vessel) {
        builder.add(part, materials.vessel);
    }
    builder.with_inside(
        of(is_airway),
        materials.airway_wall,
        AIRWAY_WALL_M,
        materials.air,
    );
    for part in of(|part| part.tissue == Tissue::Bone && is_cartilage(part)) {
        builder.add(part, materials.cartilage);
    }
    builder.with_inside(
        of(|part| part.tissue == Tissue::Bone && !is_cartilage(part)),
        materials.cortical,
        CORTICAL_M,
        materials.cancellous,
    );
    for part in of(|part| part.tissue == Tissue::Lesion) {
        builder.add_as(part, &part.name, materials.lesion);
    }
    for part in of(|part| part.tissue == Tissue::Marker) {
        let marker = part.organ.as_deref().unwrap_or(&part.name);
        let hu = match () {
            () if part.name.ends_with(".sphere") => materials.marker_sphere,
            () if spheres.contains(&marker) => materials.marker_carrier,
            () => materials.marker_disc,
        };
        builder.add(part, hu);
    }
    builder.scene
}

fn is_airway(part: &PhantomPart) -> bool {
    let organ = part.organ.as_deref().unwrap_or("");
    organ.starts_with("trachea") || organ.starts_with("main_bronchus")
}

fn is_cartilage(part: &PhantomPart) -> bool {
    part.name.starts_with("cartilage")
}

struct Builder<'m> {
    scene: Scene,
    materials: &'m Materials,
}

impl Builder<'_> {
    fn add(&mut self, part: &PhantomPart, hu: f64) {
        let name = part.organ.as_deref().unwrap_or(&part.name);
        self.add_as(part, name, hu);
    }

    fn add_as(&mut self, part: &PhantomPart, name: &str, hu: f64) {
        let label = self.scene.label(name);
        self.scene.push(part.solid.clone(), hu, label);
    }

    /// Skin, fat and muscle, of a skin that can be shrunk; else one tissue within.
    fn outside(&mut self, skin: &Solid, limbs: &[PhantomPart]) {
        let layers = [
            (0.0, "skin", self.materials.skin),
            (SKIN_M, "fat", self.materials.fat),
            (SKIN_AND_FAT_M, "muscle", self.materials.muscle),
        ];
        let solids: Vec<&Solid> = std::iter::once(skin)
            .chain(limbs.iter().map(|part| &part.solid))
            .collect();
        // A surface that need not be convex cannot be shrunk by scaling it.
        let is_layered = solids
            .iter()
            .all(|solid| !matches!(solid.shape, Shape::Mesh(_)));
        if !is_layered {
            let label = self.scene.label("muscle");
            for solid in solids {
                self.scene.push(solid.clone(), self.materials.muscle, label);
            }
            return;
        }
        for (under_m, name, hu) in layers {
            let label = self.scene.label(name);
            for solid in solids.iter().filter_map(|solid| shrunk(solid, under_m)) {
                self.scene.push(solid, hu, label);
            }
        }
    }

    fn organ_hu(&self, part: &PhantomPart) -> f64 {
        let organ = part.organ.as_deref().unwrap_or(&part.name);
        match organ {
            _ if organ.contains("lung") => self.materials.lung,
            "heart" => self.materials.blood,
            "liver" => self.materials.liver,
            _ => self.materials.muscle,
        }
    }

    /// All of some parts, and then what is inside them.
    fn with_inside<'p>(
        &mut self,
        parts: impl Iterator<Item = &'p PhantomPart> + Clone,
        shell_hu: f64,
        shell_m: f64,
        inside_hu: f64,
    ) {
        for part in parts.clone() {
            self.add(part, shell_hu);
        }
        for part in parts {
            if let Some(solid) = shrunk(&part.solid, shell_m) {
                let label = self
                    .scene
                    .label(part.organ.as_deref().unwrap_or(&part.name));
                self.scene.push(solid, inside_hu, label);
            }
        }
    }
}

/// What is left of a solid under a layer of this thickness; `None` if nothing is, or for a surface that need not be convex.
///
/// Exact for round solids and boxes; of a polyhedron each axis is scaled about the middle of its extent, which takes off the
/// thickness at its ends and less on slopes.
fn shrunk(solid: &Solid, by_m: f64) -> Option<Solid> {
    if by_m == 0.0 {
        return Some(solid.clone());
    }
    let left = |length_m: f64| Some(length_m - by_m).filter(|left_m| *left_m > 0.0);
    let shape = match &solid.shape {
        Shape::Sphere { radius_m } => Shape::Sphere {
            radius_m: left(*radius_m)?,
        },
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => Shape::Cylinder {
            radius_m: left(*radius_m)?,
            half_length_m: left(*half_length_m)?,
        },
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => Shape::Capsule {
            radius_m: left(*radius_m)?,
            half_length_m: *half_length_m,
        },
        Shape::Cuboid { half_extents_m } => Shape::Cuboid {
            half_extents_m: Vector3::new(
                left(half_extents_m.x)?,
                left(half_extents_m.y)?,
                left(half_extents_m.z)?,
            ),
        },
        Shape::Convex(mesh) => Shape::Convex(Arc::new(ConvexMesh(scaled(&mesh.0, by_m)?))),
        Shape::Mesh(_) => return None,
    };
    Some(Solid {
        shape,
        ..solid.clone()
    })
}

fn scaled(mesh: &TriangleMesh, by_m: f64) -> Option<TriangleMesh> {
    let start = (
        Vector3::repeat(f64::INFINITY),
        Vector3::repeat(f64::NEG_INFINITY),
    );
    let (low, high) = mesh.vertices_m.iter().fold(start, |(low, high), vertex| {
        (low.inf(&vertex.coords), high.sup(&vertex.coords))
    });
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    if half.min() <= by_m {
        return None;
    }
    let factor = half.map(|half_m| 1.0 - by_m / half_m);
    let vertices_m = mesh.vertices_m.iter();
    let vertices_m =
        vertices_m.map(|vertex| (middle + (vertex.coords - middle).component_mul(&factor)).into());
    Some(TriangleMesh {
        vertices_m: vertices_m.collect(),
        triangles: mesh.triangles.clone(),
    })
}

#[cfg(test)]
mod tests {
    use needlebench_phantom::PhantomParameters;
    use needlebench_scenario::scenario::MarkerKind;

    use super::*;

    #[test]
    fn what_is_on_top_in_the_middle_of_each_part_is_that_part() {
        let parameters = PhantomParameters {
            marker_kind: MarkerKind::CtSphere,
            ..Phantom::size_preset("male-p50-supine").unwrap()
        };
        let phantom = Phantom::build(&parameters).unwrap();
        let scene = phantom_scene(&phantom, &[], &Materials::default());
        let named = |name: &str| {
            let known = scene.names.iter().find(|(_, known)| known == name);
            known.unwrap_or_else(|| panic!("no {name}")).0
        };
        for lesion in &phantom.lesions {
            let label = named(&format!("lesion_{}", lesion.name));
            let part = scene.parts.iter().find(|part| part.label == label).unwrap();
            assert_eq!(part.hu, 35.0);
            assert_eq!(
                part.solid.parent_from_shape.translation.vector,
                lesion.center_m.coords
            );
        }
        let hu_of = |name: &str| {
            let parts = scene.parts.iter().filter(|part| part.solid.name == name);
            parts.map(|part| part.hu).collect::<Vec<_>>()
        };
        assert_eq!(hu_of("skin"), [40.0, -100.0, 50.0]);
        assert_eq!(hu_of("rib_left_4.3"), [900.0, 200.0]);
        assert_eq!(hu_of("cartilage_left_4.1"), [100.0]);
        assert_eq!(hu_of("trachea.1"), [40.0, -1000.0]);
        assert_eq!(hu_of("lung_left"), [-850.0]);
        assert_eq!(hu_of("marker_1"), [-950.0]);
        assert_eq!(hu_of("marker_1.sphere"), [1200.0]);
        let first_inside = scene
            .parts
            .iter()
            .position(|part| part.hu == 200.0)
            .unwrap();
        let last_shell = scene
            .parts
            .iter()
            .rposition(|part| part.hu == 900.0)
            .unwrap();
        assert!(
            last_shell < first_inside,
            "shells of overlapping pieces do not cut their insides"
        );
    }
}
