//! Parts of the phantom from the user's mesh files, such as a segmented CT.

mod overlap;
mod read;

use std::path::Path;

use needlebench_geometry::mesh::{SurfaceIndex, centroid_m, check_thickness, volume_m3};
use needlebench_geometry::{Shape, Solid, TriangleMesh};
use needlebench_input::{Finding, ModelSource, TomlText, nearest_name};
use needlebench_kinematics::Pose;
use needlebench_phantom::{
    HalfSpaces, LESION_RGBA, Lesion, Phantom, PhantomPart, SKIN_RGBA, SkinSurface, Tissue,
};

use crate::scenario::{PartSection, PartTissue};
use overlap::{check_inside_skin, note_overlaps};
use read::{PartMesh, read_part};

fn tissue_of(tissue: PartTissue) -> Tissue {
    match tissue {
        PartTissue::Skin => Tissue::Skin,
        PartTissue::Beside => Tissue::Beside,
        PartTissue::Assumed => Tissue::Assumed,
        PartTissue::Bone => Tissue::Bone,
        PartTissue::Vessel => Tissue::Vessel,
        PartTissue::Organ | PartTissue::Lung => Tissue::Organ,
        PartTissue::Lesion => Tissue::Lesion,
    }
}

fn color_rgba(tissue: PartTissue) -> [f32; 4] {
    match tissue {
        PartTissue::Skin => SKIN_RGBA,
        PartTissue::Bone => [0.93, 0.90, 0.80, 1.0],
        PartTissue::Vessel => [0.75, 0.12, 0.15, 1.0],
        PartTissue::Organ => [0.60, 0.28, 0.24, 0.8],
        PartTissue::Lung => [0.86, 0.60, 0.62, 0.55],
        PartTissue::Lesion => LESION_RGBA,
        PartTissue::Beside => [0.62, 0.64, 0.68, 1.0],
        PartTissue::Assumed => [0.72, 0.42, 0.82, 1.0],
    }
}

/// The shipped phantom with parts of the user, or these alone.
pub(crate) fn with_mesh_parts(
    toml: &TomlText<'_>,
    sections: &[PartSection],
    shipped: Option<Phantom>,
    base: &Path,
    notes: &mut Vec<String>,
) -> Result<(Phantom, Vec<ModelSource>), Finding> {
    let (parameters, mut parts, mut lesions, mut markers) = match shipped {
        None => (None, Vec::new(), Vec::new(), Vec::new()),
        Some(phantom) => (
            phantom.parameters,
            phantom.parts,
            phantom.lesions,
            phantom.markers,
        ),
    };
    let had_skin = !parts.is_empty();
    remove_replaced(toml, sections, &mut parts)?;
    let kept_skin = parts
        .first()
        .is_some_and(|part| part.tissue == Tissue::Skin);
    if had_skin && !kept_skin {
        let before = parts.len();
        parts.retain(|part| part.tissue != Tissue::Marker);
        if parts.len() < before {
            notes.push("the markers of the model's skin were removed with it".to_owned());
        }
    }
    for side in ["left", "right"] {
        // Fissures go with the lung that they are in.
        let lung = format!("lung_{side}");
        if parts.iter().all(|part| part.name != lung) {
            parts.retain(|part| part.tissue != Tissue::Fissure || !part.name.ends_with(side));
        }
    }
    lesions.retain(|lesion| {
        let name = format!("lesion_{}", lesion.name);
        parts.iter().any(|part| part.name == name)
    });
    markers.retain(|marker| parts.iter().any(|part| part.name == marker.name));
    check_names(toml, sections, &parts)?;
    check_one_skin(toml, sections, kept_skin)?;

    let mut meshes = Vec::with_capacity(sections.len());
    let mut sources = Vec::with_capacity(sections.len());
    for (index, section) in sections.iter().enumerate() {
        let (mesh, source) = read_part(toml, index, section, base, notes)?;
        meshes.push(mesh);
        if !sources.contains(&source) {
            sources.push(source);
        }
    }

    let (mut skin_surface, mut beside) = (None, Vec::new());
    for (index, (section, mesh)) in sections.iter().zip(&meshes).enumerate() {
        let part = part_of(toml, index, section, mesh, notes)?;
        if matches!(section.tissue, PartTissue::Beside | PartTissue::Assumed) {
            beside.push(part);
        } else if part.tissue == Tissue::Skin {
            skin_surface = Some(match HalfSpaces::of(&part.solid) {
                Some(faces) => SkinSurface::Convex(faces),
                None => SkinSurface::Mesh(Box::new(SurfaceIndex::new(mesh.surface.clone()))),
            });
            parts.insert(0, part);
        } else {
            parts.push(part);
        }
    }
    let skin_surface = match skin_surface {
        Some(surface) => surface,
        None => SkinSurface::Convex(
            HalfSpaces::of(&parts[0].solid).expect("the shipped skins are convex"),
        ),
    };
    check_inside_skin(toml, sections, &meshes, &parts, &skin_surface)?;
    note_overlaps(sections, &meshes, notes);
    for (section, mesh) in sections.iter().zip(&meshes) {
        if section.tissue == PartTissue::Lesion {
            let lesion = lesion_of(section, mesh, &parts, notes);
            for part in &mut parts {
                if part.name == section.name {
                    part.organ.clone_from(&lesion.organ);
                }
            }
            lesions.push(lesion);
        }
    }
    let phantom = Phantom::of_parts(parameters, parts, lesions, markers, skin_surface);
    Ok((phantom.with_beside(beside), sources))
}

/// Takes away what the user's parts stand for.
fn remove_replaced(
    toml: &TomlText<'_>,
    sections: &[PartSection],
    parts: &mut Vec<PhantomPart>,
) -> Result<(), Finding> {
    let is = |part: &PhantomPart, word: &str| {
        part.name == word
            || part.organ.as_deref() == Some(word) && part.tissue != Tissue::Lesion
            || part.tissue.to_string() == word
    };
    for (index, section) in sections.iter().enumerate() {
        for (at, word) in section.replaces.iter().enumerate() {
            if parts.iter().any(|part| is(part, word)) {
                continue;
            }
            let earlier = sections[..index]
                .iter()
                .any(|each| each.replaces.contains(word));
            if earlier {
                continue;
            }
            let mut known: Vec<String> = parts
                .iter()
                .flat_map(|part| {
                    part.organ
                        .clone()
                        .into_iter()
                        .chain([part.tissue.to_string()])
                })
                .collect();
            known.sort();
            known.dedup();
            let finding = toml.finding(
                &format!("phantom.parts[{index}].replaces[{at}]"),
                format!("the model has no part `{word}`"),
            );
            let names = known.iter().map(String::as_str);
            return Err(finding.hint(if known.is_empty() {
                "there is nothing to replace: omit `replaces`".to_owned()
            } else if let Some(near) = nearest_name(word, names) {
                format!("did you mean `{near}`?")
            } else {
                format!("it has {}", known.join(", "))
            }));
        }
    }
    parts.retain(|part| {
        let mut words = sections.iter().flat_map(|section| &section.replaces);
        !words.any(|word| is(part, word))
    });
    Ok(())
}

fn check_names(
    toml: &TomlText<'_>,
    sections: &[PartSection],
    parts: &[PhantomPart],
) -> Result<(), Finding> {
    for (index, section) in sections.iter().enumerate() {
        let name = &section.name;
        let key = format!("phantom.parts[{index}].name");
        let taken = sections[..index].iter().any(|each| each.name == *name)
            || parts
                .iter()
                .any(|part| part.name == *name || part.name.strip_prefix("lesion_") == Some(name));
        if taken {
            return Err(toml
                .finding(&key, format!("the phantom has another part `{name}`"))
                .hint("give each part its own name, or state what it `replaces`"));
        }
    }
    Ok(())
}

fn check_one_skin(
    toml: &TomlText<'_>,
    sections: &[PartSection],
    kept_skin: bool,
) -> Result<(), Finding> {
    let mut skins = (0..sections.len()).filter(|&i| sections[i].tissue == PartTissue::Skin);
    let (first, second) = (skins.next(), skins.next());
    match (kept_skin, first, second) {
        (true, Some(index), _) => Err(toml
            .finding(
                &format!("phantom.parts[{index}].tissue"),
                "the model has a skin already",
            )
            .hint("add `replaces = [\"skin\"]`, or set `model = \"none\"` under [phantom]")),
        (_, _, Some(index)) => Err(toml
            .finding(
                &format!("phantom.parts[{index}].tissue"),
                "two parts are the skin",
            )
            .hint("the skin is one closed surface: join the files")),
        (false, None, _) => Err(toml
            .finding("phantom.parts", "the phantom has no skin")
            .hint("add a part with `tissue = \"skin\"`: entries and clearances refer to it")),
        _ => Ok(()),
    }
}

/// A part with its shape about the middle of its box, which keeps bounding balls small.
fn part_of(
    toml: &TomlText<'_>,
    index: usize,
    section: &PartSection,
    mesh: &PartMesh,
    notes: &mut Vec<String>,
) -> Result<PhantomPart, Finding> {
    let [low, high] = needlebench_geometry::mesh::extent_m(&mesh.surface);
    let middle = nalgebra::center(&low, &high);
    let about_middle = TriangleMesh {
        vertices_m: mesh
            .surface
            .vertices_m
            .iter()
            .map(|v| v - middle.coords)
            .collect(),
        triangles: mesh.surface.triangles.clone(),
    };
    let is_skin = section.tissue == PartTissue::Skin;
    if is_skin || matches!(section.tissue, PartTissue::Beside | PartTissue::Assumed) {
        // What engines collide with.
        check_thickness(&about_middle.vertices_m).map_err(|why| {
            toml.finding(
                &format!("phantom.parts[{index}].file"),
                format!("{}: {why}", mesh.file),
            )
        })?;
    }
    let shape = Shape::of_surface(about_middle);
    if is_skin && matches!(shape, Shape::Convex(_)) {
        notes.push(format!("part `{}` is convex", section.name));
    }
    Ok(PhantomPart {
        name: section.name.clone(),
        tissue: tissue_of(section.tissue),
        organ: match section.tissue {
            PartTissue::Skin | PartTissue::Lesion => None,
            _ => Some(section.name.clone()),
        },
        solid: Solid {
            name: section.name.clone(),
            shape,
            parent_from_shape: Pose::translation(middle.x, middle.y, middle.z),
        },
        color_rgba: color_rgba(section.tissue),
    })
}

/// A lesion with the centre and the volume of its file; the organ or bone around its centre.
fn lesion_of(
    section: &PartSection,
    mesh: &PartMesh,
    parts: &[PhantomPart],
    notes: &mut Vec<String>,
) -> Lesion {
    let center_m = centroid_m(&mesh.surface);
    if mesh.surface.winding_number(&center_m) == 0 {
        notes.push(format!(
            "the centre of lesion `{}` is outside it: a goal that names it misses the lesion",
            section.name
        ));
    }
    let organ = parts
        .iter()
        .filter(|part| matches!(part.tissue, Tissue::Organ | Tissue::Bone))
        .find(|part| part.solid.contains(&center_m))
        .and_then(|part| part.organ.clone());
    Lesion {
        name: section.name.clone(),
        center_m,
        // Of the ball with the same volume.
        diameter_m: libm::cbrt(6.0 * volume_m3(&mesh.surface) / std::f64::consts::PI),
        organ,
    }
}
