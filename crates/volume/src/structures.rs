//! What names of structures in label maps mean, and what surfaces are of.

use serde::{Deserialize, Serialize};

/// What a surface is of, in the words of `[[phantom.parts]]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SurfaceTissue {
    /// Outside of the body.
    Skin,
    /// Bone.
    Bone,
    /// Blood vessel.
    Vessel,
    /// Organ other than a lung.
    Organ,
    /// Lung.
    Lung,
    /// Lesion.
    Lesion,
    /// Beside the body: an arm, the couch, a cushion.
    Beside,
}

/// What something beside the body is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BesideKind {
    /// Arms that do not touch the trunk, or other limbs.
    Arms,
    /// What the patient lies on, through all slices.
    Couch,
    /// Anything else: cushions, rails, tubes, cables.
    Objects,
    /// Where the couch is taken to be beyond a field of view that does not show all of it.
    AssumedCouch,
}

impl BesideKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Arms, Self::Couch, Self::Objects, Self::AssumedCouch];

    /// Its name in label maps, and of its surface.
    pub fn name(self) -> &'static str {
        match self {
            Self::Arms => "arms",
            Self::Couch => "couch",
            Self::Objects => "objects",
            Self::AssumedCouch => "assumed_couch",
        }
    }
}

/// What a label stands for. Labels with the same name are one structure.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Structure {
    /// Its name here: `ribs`, `lung_left`.
    pub name: String,
    /// What it is.
    pub tissue: SurfaceTissue,
}

/// Words, all of which a name has that is none of what the table would take it for: muscles named after bones, parts of
/// the brain named like those of lung and heart, regions, and what is neither bone nor vessel.
const OTHER: &[&[&str]] = &[
    &["abdomen"],
    &["assist"],
    &["cartilage", "thyroid"],
    &["extremities", "pelvis"],
    &["fontanel"],
    &["frontal", "lobe"],
    &["hilum"],
    &["insular", "lobe"],
    &["ileocecal"],
    &["joint"],
    &["levator"],
    &["ligament"],
    &["limbic", "lobe"],
    &["lymph"],
    &["lymphatic"],
    &["muscle"],
    &["nerve"],
    &["occipital", "lobe"],
    &["parietal", "lobe"],
    &["pelvis", "renal"],
    &["sterno", "thyroid"],
    &["temporal", "lobe"],
];

/// Words, all of which a name has; the structure that it is of; what that is. The first row that fits counts.
const TABLE: &[(&[&str], &str, SurfaceTissue)] = &[
    (&["nodule"], "", SurfaceTissue::Lesion),
    (&["tumor"], "", SurfaceTissue::Lesion),
    (&["tumour"], "", SurfaceTissue::Lesion),
    (&["lesion"], "", SurfaceTissue::Lesion),
    (&["cancer"], "", SurfaceTissue::Lesion),
    (&["mass"], "", SurfaceTissue::Lesion),
    (&["metastasis"], "", SurfaceTissue::Lesion),
    (&["neoplasm"], "", SurfaceTissue::Lesion),
    (&["lung", "vessel"], "lung_vessels", SurfaceTissue::Vessel),
    (&["lung", "trachea"], "trachea", SurfaceTissue::Organ),
    (&["lung", "left"], "lung_left", SurfaceTissue::Lung),
    (&["lung", "right"], "lung_right", SurfaceTissue::Lung),
    (&["lobe", "left"], "lung_left", SurfaceTissue::Lung),
    (&["lobe", "right"], "lung_right", SurfaceTissue::Lung),
    (&["spinal", "cord"], "spinal_cord", SurfaceTissue::Organ),
    (&["vertebral", "artery"], "arteries", SurfaceTissue::Vessel),
    (&["vertebra"], "vertebrae", SurfaceTissue::Bone),
    (&["vertebral"], "vertebrae", SurfaceTissue::Bone),
    (&["spine"], "vertebrae", SurfaceTissue::Bone),
    (&["sacrum"], "sacrum", SurfaceTissue::Bone),
    (&["rib"], "ribs", SurfaceTissue::Bone),
    (&["costal"], "costal_cartilages", SurfaceTissue::Bone),
    (&["sternum"], "sternum", SurfaceTissue::Bone),
    (&["scapula", "left"], "scapula_left", SurfaceTissue::Bone),
    (&["scapula", "right"], "scapula_right", SurfaceTissue::Bone),
    (&["clavicula", "left"], "clavicle_left", SurfaceTissue::Bone),
    (
        &["clavicula", "right"],
        "clavicle_right",
        SurfaceTissue::Bone,
    ),
    (&["clavicle", "left"], "clavicle_left", SurfaceTissue::Bone),
    (
        &["clavicle", "right"],
        "clavicle_right",
        SurfaceTissue::Bone,
    ),
    (&["humerus", "left"], "humerus_left", SurfaceTissue::Bone),
    (&["humerus", "right"], "humerus_right", SurfaceTissue::Bone),
    // Those of both sides in one.
    (&["scapula"], "scapulae", SurfaceTissue::Bone),
    (&["clavicula"], "clavicles", SurfaceTissue::Bone),
    (&["clavicle"], "clavicles", SurfaceTissue::Bone),
    (&["humerus"], "humeri", SurfaceTissue::Bone),
    (&["skeleton"], "bone", SurfaceTissue::Bone),
    (&["coccyx"], "sacrum", SurfaceTissue::Bone),
    (&["ilium"], "hips", SurfaceTissue::Bone),
    (&["femur"], "femurs", SurfaceTissue::Bone),
    (&["hip", "implant"], "implants", SurfaceTissue::Bone),
    (&["hip"], "hips", SurfaceTissue::Bone),
    (&["pelvis"], "hips", SurfaceTissue::Bone),
    (&["skull"], "skull", SurfaceTissue::Bone),
    (&["mandible"], "skull", SurfaceTissue::Bone),
    (&["maxilla"], "skull", SurfaceTissue::Bone),
    (&["jawbone"], "skull", SurfaceTissue::Bone),
    (&["zygoma"], "skull", SurfaceTissue::Bone),
    (&["zygomatic", "arch"], "skull", SurfaceTissue::Bone),
    (&["hyoid"], "hyoid", SurfaceTissue::Bone),
    (&["radius"], "forearms", SurfaceTissue::Bone),
    (&["ulna"], "forearms", SurfaceTissue::Bone),
    (&["carpal"], "hands", SurfaceTissue::Bone),
    (&["metacarpal"], "hands", SurfaceTissue::Bone),
    (&["phalanges", "hand"], "hands", SurfaceTissue::Bone),
    (&["patella"], "legs", SurfaceTissue::Bone),
    (&["tibia"], "legs", SurfaceTissue::Bone),
    (&["fibula"], "legs", SurfaceTissue::Bone),
    (&["calcaneus"], "feet", SurfaceTissue::Bone),
    (&["tarsal"], "feet", SurfaceTissue::Bone),
    (&["metatarsal"], "feet", SurfaceTissue::Bone),
    (&["phalanges", "feet"], "feet", SurfaceTissue::Bone),
    (&["bone"], "bone", SurfaceTissue::Bone),
    (&["valve"], "heart", SurfaceTissue::Organ),
    (&["aorta"], "aorta", SurfaceTissue::Vessel),
    (&["aortic"], "aorta", SurfaceTissue::Vessel),
    (&["ivc"], "inferior_vena_cava", SurfaceTissue::Vessel),
    (&["svc"], "superior_vena_cava", SurfaceTissue::Vessel),
    (&["celiac", "trunk"], "celiac_trunk", SurfaceTissue::Vessel),
    (&["truncus"], "arteries", SurfaceTissue::Vessel),
    (&["thyrocervical"], "arteries", SurfaceTissue::Vessel),
    (&["costocervical"], "arteries", SurfaceTissue::Vessel),
    (&["ductus", "arteriosus"], "arteries", SurfaceTissue::Vessel),
    (&["coronary", "sinus"], "veins", SurfaceTissue::Vessel),
    (
        &["pulmonary", "arterial"],
        "pulmonary_arteries",
        SurfaceTissue::Vessel,
    ),
    (&["arterial", "system"], "arteries", SurfaceTissue::Vessel),
    (
        &["pulmonary", "vein"],
        "pulmonary_veins",
        SurfaceTissue::Vessel,
    ),
    (
        &["pulmonary", "venous"],
        "pulmonary_veins",
        SurfaceTissue::Vessel,
    ),
    (
        &["pulmonary", "artery"],
        "pulmonary_arteries",
        SurfaceTissue::Vessel,
    ),
    (
        &["vena", "superior"],
        "superior_vena_cava",
        SurfaceTissue::Vessel,
    ),
    (
        &["vena", "inferior"],
        "inferior_vena_cava",
        SurfaceTissue::Vessel,
    ),
    (&["portal"], "portal_veins", SurfaceTissue::Vessel),
    (
        &["brachiocephalic"],
        "brachiocephalic_vessels",
        SurfaceTissue::Vessel,
    ),
    (
        &["subclavian"],
        "subclavian_arteries",
        SurfaceTissue::Vessel,
    ),
    (&["carotid"], "carotid_arteries", SurfaceTissue::Vessel),
    (
        &["iliac", "artery"],
        "iliac_arteries",
        SurfaceTissue::Vessel,
    ),
    (&["iliac", "vena"], "iliac_veins", SurfaceTissue::Vessel),
    (&["iliac", "vein"], "iliac_veins", SurfaceTissue::Vessel),
    (&["iliac", "crest"], "hips", SurfaceTissue::Bone),
    (&["iliac"], "iliac_vessels", SurfaceTissue::Vessel),
    (&["vena", "cava"], "venae_cavae", SurfaceTissue::Vessel),
    (&["artery"], "arteries", SurfaceTissue::Vessel),
    (&["vein"], "veins", SurfaceTissue::Vessel),
    (&["vessel"], "vessels", SurfaceTissue::Vessel),
    (&["venous", "system"], "veins", SurfaceTissue::Vessel),
    // Cavities of the brain have the name of those of the heart.
    (&["brain"], "brain", SurfaceTissue::Organ),
    (&["ventricle", "third"], "brain", SurfaceTissue::Organ),
    (&["ventricle", "fourth"], "brain", SurfaceTissue::Organ),
    (&["ventricle", "lateral"], "brain", SurfaceTissue::Organ),
    (&["ventricle", "horn"], "brain", SurfaceTissue::Organ),
    (&["ventricle", "trigone"], "brain", SurfaceTissue::Organ),
    (&["ventricle", "body"], "brain", SurfaceTissue::Organ),
    (&["heart"], "heart", SurfaceTissue::Organ),
    (&["auricular"], "heart", SurfaceTissue::Organ),
    (&["interatrial"], "heart", SurfaceTissue::Organ),
    (&["interventricular"], "heart", SurfaceTissue::Organ),
    (&["ventricular"], "heart", SurfaceTissue::Organ),
    (&["atrial"], "heart", SurfaceTissue::Organ),
    (&["atrium"], "heart", SurfaceTissue::Organ),
    (&["ventricle"], "heart", SurfaceTissue::Organ),
    (&["myocardium"], "heart", SurfaceTissue::Organ),
    (&["trachea"], "trachea", SurfaceTissue::Organ),
    (&["airway"], "trachea", SurfaceTissue::Organ),
    (&["bronchus"], "trachea", SurfaceTissue::Organ),
    (&["bronchi"], "trachea", SurfaceTissue::Organ),
    (&["bronchie"], "trachea", SurfaceTissue::Organ),
    (&["esophagus"], "esophagus", SurfaceTissue::Organ),
    (&["oesophagus"], "esophagus", SurfaceTissue::Organ),
    (&["thyroid"], "thyroid", SurfaceTissue::Organ),
    (&["liver"], "liver", SurfaceTissue::Organ),
    (&["spleen"], "spleen", SurfaceTissue::Organ),
    (&["stomach"], "stomach", SurfaceTissue::Organ),
    (&["gallbladder"], "gallbladder", SurfaceTissue::Organ),
    (&["pancreas"], "pancreas", SurfaceTissue::Organ),
    (&["kidney", "left"], "kidney_left", SurfaceTissue::Organ),
    (&["kidney", "right"], "kidney_right", SurfaceTissue::Organ),
    (&["kidney"], "kidneys", SurfaceTissue::Organ),
    (&["adrenal"], "adrenal_glands", SurfaceTissue::Organ),
    (&["colon"], "colon", SurfaceTissue::Organ),
    (&["duodenum"], "duodenum", SurfaceTissue::Organ),
    (&["rectum"], "colon", SurfaceTissue::Organ),
    (&["bowel"], "bowel", SurfaceTissue::Organ),
    (&["intestine"], "bowel", SurfaceTissue::Organ),
    (&["ileum"], "bowel", SurfaceTissue::Organ),
    (&["jejunum"], "bowel", SurfaceTissue::Organ),
    (&["thymus"], "thymus", SurfaceTissue::Organ),
    (&["larynx"], "larynx", SurfaceTissue::Organ),
    (&["prostate"], "prostate", SurfaceTissue::Organ),
    (&["uterus"], "uterus", SurfaceTissue::Organ),
    (&["bladder"], "bladder", SurfaceTissue::Organ),
    (&["diaphragm"], "diaphragm", SurfaceTissue::Organ),
    (&["pericardium"], "heart", SurfaceTissue::Organ),
];

/// Words of which the name of the body's outside consists: `body_trunc`, `External`. One with another word is
/// something in the body, such as the body of a vertebra or an external artery.
const OUTSIDE: &[&str] = &[
    "body",
    "contour",
    "external",
    "extremities",
    "outer",
    "outline",
    "patient",
    "skin",
    "surface",
    "trunc",
    "trunk",
    "whole",
];
/// Those that make a name one of the outside.
const IS_OUTSIDE: &[&str] = &["body", "external", "skin"];

/// Plurals, and the words of the table.
const PLURALS: &[(&str, &str)] = &[
    ("airways", "airway"),
    ("arteries", "artery"),
    ("bones", "bone"),
    ("carpals", "carpal"),
    ("clavicles", "clavicle"),
    ("femora", "femur"),
    ("femurs", "femur"),
    ("hips", "hip"),
    ("humeri", "humerus"),
    ("kidneys", "kidney"),
    ("lesions", "lesion"),
    ("lobes", "lobe"),
    ("lungs", "lung"),
    ("masses", "mass"),
    ("metacarpals", "metacarpal"),
    ("metastases", "metastasis"),
    ("nodules", "nodule"),
    ("ribs", "rib"),
    ("scapulae", "scapula"),
    ("scapulas", "scapula"),
    ("tumors", "tumor"),
    ("tumours", "tumour"),
    ("veins", "vein"),
    ("ventricles", "ventricle"),
    ("vertebrae", "vertebra"),
    ("vertebras", "vertebra"),
    ("vessels", "vessel"),
];

/// What a name of 3D Slicer, TotalSegmentator or this program stands for; none if it is not known.
///
/// Names are taken apart into words of letters; `l` and `r` stand for left and right. A lesion keeps its name.
pub fn structure_of(name: &str) -> Option<Structure> {
    let lower = name.to_lowercase();
    let written: Vec<&str> = lower
        .split(|c: char| !c.is_alphabetic())
        .filter(|word| !word.is_empty())
        .collect();
    let mut words: Vec<&str> = written
        .iter()
        .map(|&word| match word {
            "l" => "left",
            "r" => "right",
            _ => PLURALS
                .iter()
                .find(|(plural, _)| *plural == word)
                .map_or(word, |(_, one)| one),
        })
        .collect();
    // Both sides in one are neither.
    let sides = ["left", "right"];
    if sides.iter().all(|side| words.contains(side)) {
        words.retain(|word| !sides.contains(word));
    }
    if words.iter().any(|word| IS_OUTSIDE.contains(word))
        && words.iter().all(|word| OUTSIDE.contains(word))
    {
        return Some(Structure {
            name: "skin".to_owned(),
            tissue: SurfaceTissue::Skin,
        });
    }
    // Of this program; no name of others means just that.
    if BesideKind::ALL.iter().any(|kind| kind.name() == lower) {
        return Some(Structure {
            name: lower,
            tissue: SurfaceTissue::Beside,
        });
    }
    let has = |wanted: &[&str]| wanted.iter().all(|word| words.contains(word));
    let (_, structure, tissue) = TABLE.iter().find(|(wanted, _, _)| has(wanted))?;
    // A lesion may be called after any place.
    if *tissue != SurfaceTissue::Lesion && OTHER.iter().any(|wanted| has(wanted)) {
        return None;
    }
    let name = match *tissue {
        SurfaceTissue::Lesion => written
            .iter()
            .copied()
            .chain(digits(&lower))
            .collect::<Vec<_>>()
            .join("_"),
        _ => (*structure).to_owned(),
    };
    Some(Structure {
        name,
        tissue: *tissue,
    })
}

/// The last number in a name.
fn digits(name: &str) -> Option<&str> {
    name.split(|c: char| !c.is_ascii_digit())
        .rfind(|part| !part.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_programs_are_known() {
        for (name, wanted, tissue) in [
            ("lung_upper_lobe_left", "lung_left", SurfaceTissue::Lung),
            ("lung_middle_lobe_right", "lung_right", SurfaceTissue::Lung),
            ("Right Lung", "lung_right", SurfaceTissue::Lung),
            ("Lung_L", "lung_left", SurfaceTissue::Lung),
            ("left lower lobe", "lung_left", SurfaceTissue::Lung),
            ("rib_left_7", "ribs", SurfaceTissue::Bone),
            ("vertebrae_T5", "vertebrae", SurfaceTissue::Bone),
            ("scapula_right", "scapula_right", SurfaceTissue::Bone),
            ("heart_atrium_left", "heart", SurfaceTissue::Organ),
            ("heart", "heart", SurfaceTissue::Organ),
            ("pulmonary_vein", "pulmonary_veins", SurfaceTissue::Vessel),
            ("iliac_vena_left", "iliac_veins", SurfaceTissue::Vessel),
            ("lung_vessels", "lung_vessels", SurfaceTissue::Vessel),
            ("lung_trachea_bronchia", "trachea", SurfaceTissue::Organ),
            ("body", "skin", SurfaceTissue::Skin),
            ("body_trunc", "skin", SurfaceTissue::Skin),
            ("Liver", "liver", SurfaceTissue::Organ),
            ("lung_nodules", "lung_nodules", SurfaceTissue::Lesion),
            ("lesion 2", "lesion_2", SurfaceTissue::Lesion),
            ("vertebrae_body", "vertebrae", SurfaceTissue::Bone),
            ("Vertebral body L1", "vertebrae", SurfaceTissue::Bone),
            ("body_extremities", "skin", SurfaceTissue::Skin),
            ("External", "skin", SurfaceTissue::Skin),
            ("external iliac", "iliac_vessels", SurfaceTissue::Vessel),
            (
                "external carotid artery",
                "carotid_arteries",
                SurfaceTissue::Vessel,
            ),
            ("Lungs_R", "lung_right", SurfaceTissue::Lung),
            ("Kidneys left", "kidney_left", SurfaceTissue::Organ),
            (
                "portal_vein_and_splenic_vein",
                "portal_veins",
                SurfaceTissue::Vessel,
            ),
            ("coronary_arteries", "arteries", SurfaceTissue::Vessel),
            ("lung vessels", "lung_vessels", SurfaceTissue::Vessel),
            ("urinary_bladder", "bladder", SurfaceTissue::Organ),
            ("femur_left", "femurs", SurfaceTissue::Bone),
            ("Kidney Right and left", "kidneys", SurfaceTissue::Organ),
            ("Scapula Right and left", "scapulae", SurfaceTissue::Bone),
            (
                "nodule left hilum",
                "nodule_left_hilum",
                SurfaceTissue::Lesion,
            ),
        ] {
            let structure = structure_of(name);
            let found = structure.map(|found| (found.name, found.tissue));
            assert_eq!(found, Some((wanted.to_owned(), tissue)), "{name}");
        }
        for name in [
            "",
            "autochthon_left",
            "air",
            "face",
            "external oblique",
            "Lung Right and left",
            "para-aortic lymph nodes",
            "ileocecal valve",
            "lung",
        ] {
            assert_eq!(structure_of(name), None, "{name}");
        }
    }
}
