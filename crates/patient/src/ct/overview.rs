//! What was found in a scan at a glance: how much of it, from what, how accurate, and what is not known.

use needlebench_cell::part_in_words;
use needlebench_imaging::{AssumedBody, Label, LabelFacts, Surface};
use needlebench_routing::Obstacle;
use needlebench_scenario::scenario::{NeedleRouteSection, RouteSection};
use needlebench_volume::{BesideKind, SurfaceTissue, structure_of};
use serde::{Deserialize, Serialize};

use super::{Registered, ScanBuild};

/// What is known of a structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverviewRow {
    /// Its name, as in surfaces and label maps.
    pub name: String,
    /// What it is of, in the words of `[[phantom.parts]]`; none of what is no structure.
    pub tissue: Option<SurfaceTissue>,
    /// The same for people.
    pub in_words: String,
    /// Its volume, m^3; none of what was not found.
    pub volume_m3: Option<f64>,
    /// Where it comes from.
    pub source: OverviewSource,
    /// How accurate it is; none if that is not evaluated.
    pub accuracy: Option<OverviewAccuracy>,
    /// What is not known of it.
    pub unknown: Option<String>,
}

/// Where something comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OverviewSource {
    /// Hounsfield units and shape of the volume.
    HuAndShape,
    /// A label map from elsewhere.
    LabelMap,
    /// A person's point in it, and the Hounsfield units around that.
    SeedAndHu,
    /// A model of where it usually is.
    Modelled,
    /// Where it must be, without its outline.
    Assumed,
    /// Nothing: it was not found.
    NotFound,
    /// Nothing: it was not looked for.
    NotSearched,
}

impl OverviewSource {
    /// For people.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::HuAndShape => "HU and shape",
            Self::LabelMap => "label map",
            Self::SeedAndHu => "seed and HU",
            Self::Modelled => "modelled",
            Self::Assumed => "assumed",
            Self::NotFound => "not found",
            Self::NotSearched => "not searched",
        }
    }
}

/// How accurate something is, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OverviewAccuracy {
    /// 99 % of the surface is no farther from that of the voxels.
    SurfaceP99M(f64),
    /// Half a voxel, along its longest edge: the outline runs between voxels.
    HalfVoxelM(f64),
    /// RMS error of the centroid.
    CentroidRmsM(f64),
    /// The largest RMS target registration error of the targets.
    TreRmsM(f64),
}

/// Something that a needle may meet.
struct Expected {
    name: &'static str,
    in_words: &'static str,
    /// Whether this is it.
    is_it: fn(&OverviewRow) -> bool,
    unknown: &'static str,
}

const fn expected(
    name: &'static str,
    in_words: &'static str,
    is_it: fn(&OverviewRow) -> bool,
    unknown: &'static str,
) -> Expected {
    Expected {
        name,
        in_words,
        is_it,
        unknown,
    }
}

const NOT_AVOIDED: &str = "not avoided";
const ABSENT_LUNG: &str = "what is in its place";

/// Said where nothing shows it.
const EXPECTED: [Expected; 6] = [
    expected(
        "lung_left",
        "left lung",
        |row| row.name == "lung_left",
        ABSENT_LUNG,
    ),
    expected(
        "lung_right",
        "right lung",
        |row| row.name == "lung_right",
        ABSENT_LUNG,
    ),
    expected(
        "trachea",
        "airways",
        |row| row.name == "trachea",
        NOT_AVOIDED,
    ),
    expected(
        "bone",
        "bone",
        |row| is_of(row, SurfaceTissue::Bone) && !is_cartilage(row),
        NOT_AVOIDED,
    ),
    expected("cartilage", "costal cartilage", is_cartilage, NOT_AVOIDED),
    expected(
        "vessels",
        "vessels outside lungs",
        |row| is_of(row, SurfaceTissue::Vessel) && row.name != LUNG_VESSELS && !is_mammary(row),
        NOT_AVOIDED,
    ),
];

/// Vessels that are seen in air, without contrast medium.
const LUNG_VESSELS: &str = "lung_vessels";

fn is_of(row: &OverviewRow, tissue: SurfaceTissue) -> bool {
    row.tissue == Some(tissue)
}

fn is_cartilage(row: &OverviewRow) -> bool {
    row.name.contains("cartilage")
}

fn is_mammary(row: &OverviewRow) -> bool {
    row.name.contains("mammary")
}

/// Organs below the diaphragm, which plain CT does not separate from what is around them.
const ABDOMINAL: [&str; 4] = ["liver", "spleen", "stomach", "bowel"];

/// What is modelled, and what is assumed: rows that needle paths may be told to leave out.
const INTERCOSTAL: &str = "intercostal_vessels";
const MAMMARY: &str = "mammary_vessels";
const MEDIASTINUM: &str = "mediastinum";

/// Rows that are no structures.
const MARKERS: &str = "markers";
const ENDS: &str = "field_of_view";
const BESIDE: &str = "beside";
const ASSUMED: &str = AssumedBody::NAME;

/// Contact of the skin with something else that is worth a word, m^2.
const CONTACT_M2: f64 = 1e-4;

impl ScanBuild {
    /// What was found, and what was not.
    pub fn overview(&self) -> Vec<OverviewRow> {
        let made = &self.seen.made;
        let of_surfaces = |wanted: &dyn Fn(SurfaceTissue) -> bool| {
            let surfaces = made.surfaces.iter();
            let surfaces = surfaces.filter(|surface| wanted(surface.tissue));
            surfaces.map(|it| self.of_surface(it)).collect::<Vec<_>>()
        };
        let is_within = |tissue| {
            !matches!(
                tissue,
                SurfaceTissue::Skin | SurfaceTissue::Beside | SurfaceTissue::Lesion
            )
        };
        let mut rows = of_surfaces(&|tissue| tissue == SurfaceTissue::Skin);
        rows.extend(of_surfaces(&is_within));
        let labels = made.facts.iter();
        rows.extend(labels.filter_map(|fact| self.of_label(fact)));
        let mut beside = of_surfaces(&|tissue| tissue == SurfaceTissue::Beside);
        let of_name = |name: &str| rows.iter().any(|row| row.name == name);
        let mut more: Vec<OverviewRow> = EXPECTED
            .iter()
            .filter(|it| !rows.iter().any(it.is_it))
            .map(|it| missing(it.name, it.in_words, it.unknown))
            .collect();
        more.extend(heart(&of_name));
        let abdominal = ABDOMINAL.into_iter().filter(|name| !of_name(name));
        let abdominal: Vec<&str> = abdominal.collect();
        if !abdominal.is_empty() {
            more.push(missing("abdominal", &abdominal.join(", "), NOT_AVOIDED));
        }
        more.push(modelled(
            INTERCOSTAL,
            "intercostal vessels",
            "below each bone",
        ));
        if !rows.iter().any(is_mammary) {
            more.push(modelled(MAMMARY, "mammary vessels", "beside the sternum"));
        }
        rows.extend(more);
        rows.extend(self.of_lesions());
        let not_grown = self.seen.made.not_grown.iter();
        rows.extend(not_grown.map(|each| OverviewRow {
            tissue: Some(SurfaceTissue::Lesion),
            ..missing(
                &each.name,
                &format!("lesion {}", each.name),
                "not segmented",
            )
        }));
        for row in &mut beside {
            if row.name == BesideKind::AssumedCouch.name() {
                row.source = OverviewSource::Assumed;
                row.accuracy = None;
                row.unknown = Some("beyond the field of view".to_owned());
            }
        }
        let absent = BesideKind::ALL.into_iter().map(BesideKind::name);
        let absent = absent.filter(|name| *name != BesideKind::AssumedCouch.name());
        let absent = absent.filter(|name| !beside.iter().any(|row| row.name == *name));
        let absent: Vec<&str> = absent.collect();
        rows.extend(beside);
        if !absent.is_empty() {
            let row = missing(BESIDE, &absent.join(", "), "");
            rows.push(OverviewRow {
                unknown: None,
                ..row
            });
        }
        rows.push(self.of_markers());
        rows.push(self.of_ends());
        rows.extend(self.assumed.as_ref().map(|assumed| OverviewRow {
            source: OverviewSource::Assumed,
            ..missing(
                ASSUMED,
                "body behind cuts",
                &format!("beyond {:.0} mm", 1e3 * assumed.outside.reach_m),
            )
        }));
        rows
    }

    fn is_of_label_map(&self, structure: &str) -> bool {
        let mut given = self.seen.mapped.iter();
        given.any(|name| name == structure)
    }

    fn of_surface(&self, surface: &Surface) -> OverviewRow {
        let is_mapped = surface.level_hu.is_none() && self.is_of_label_map(&surface.name);
        let unknown = match surface.tissue {
            SurfaceTissue::Skin => self.contact(),
            SurfaceTissue::Lung => self.cut_lung(&surface.name),
            _ => None,
        };
        OverviewRow {
            name: surface.name.clone(),
            tissue: Some(surface.tissue),
            in_words: words(&surface.name),
            volume_m3: Some(surface.volume_m3),
            source: if is_mapped {
                OverviewSource::LabelMap
            } else {
                OverviewSource::HuAndShape
            },
            accuracy: Some(match surface.level_hu {
                Some(_) => OverviewAccuracy::SurfaceP99M(surface.error.p99_m),
                None => self.half_voxel(),
            }),
            unknown,
        }
    }

    fn half_voxel(&self) -> OverviewAccuracy {
        let [x, y, z] = self.seen.volume.grid.spacing_m();
        OverviewAccuracy::HalfVoxelM(0.5 * x.max(y).max(z))
    }

    fn contact(&self) -> Option<String> {
        let contact_m2 = self.seen.made.segmentation.body.contact_m2;
        (contact_m2 > CONTACT_M2).then(|| format!("skin on {:.0} cm2 of contact", 1e4 * contact_m2))
    }

    fn cut_lung(&self, name: &str) -> Option<String> {
        let mut lungs = self.seen.made.segmentation.lungs.lungs.iter();
        let is_cut = lungs.any(|lung| lung.cut && lung.side.structure() == name);
        is_cut.then(|| "beyond the scan".to_owned())
    }

    /// A label without a surface; none of soft tissue, of lesions, and of what has a surface.
    fn of_label(&self, fact: &LabelFacts) -> Option<OverviewRow> {
        let made = &self.seen.made;
        let structure = structure_of(&fact.name);
        let name = structure.as_ref().map_or(&fact.name, |it| &it.name).clone();
        let is_own = Label::ALL.iter().any(|label| label.name() == fact.name);
        let has_surface = made
            .surfaces
            .iter()
            .any(|surface| [&name, &fact.name].contains(&&surface.name));
        let is_lesion = made.lesions.iter().any(|it| it.lesion.name == fact.name);
        let is_soft = fact.name == Label::SoftTissue.name();
        let is_known = is_own || structure.is_some();
        if fact.voxels == 0 || has_surface || is_lesion || is_soft || !is_known {
            return None;
        }
        let tissue = structure.map(|it| it.tissue);
        // Bone that a label map with bones lacks has another name.
        let mut surfaces = made.surfaces.iter();
        let is_other_bone = fact.name == Label::Bone.name()
            && surfaces.any(|surface| surface.tissue == SurfaceTissue::Bone);
        if tissue == Some(SurfaceTissue::Skin) || is_other_bone {
            return None;
        }
        Some(OverviewRow {
            tissue,
            in_words: words(&name),
            volume_m3: Some(fact.volume_m3),
            source: if self.is_of_label_map(&name) {
                OverviewSource::LabelMap
            } else {
                OverviewSource::HuAndShape
            },
            accuracy: None,
            unknown: None,
            name,
        })
    }

    fn of_lesions(&self) -> impl Iterator<Item = OverviewRow> + '_ {
        self.seen.made.lesions.iter().map(|measured| {
            let lesion = &measured.lesion;
            let size = measured.size.as_ref();
            let mut unknown = Vec::new();
            if lesion.leaked {
                unknown.push("its size");
            }
            if lesion.cut_at_wall {
                unknown.push("edge at the wall");
            }
            if size.is_none() {
                unknown.push("its surface");
            }
            OverviewRow {
                name: lesion.name.clone(),
                tissue: Some(SurfaceTissue::Lesion),
                in_words: format!("lesion {}", lesion.name),
                volume_m3: size.map(|size| size.volume_m3),
                source: if lesion.level_hu.is_some() {
                    OverviewSource::SeedAndHu
                } else {
                    OverviewSource::LabelMap
                },
                accuracy: size.map(|size| {
                    let rms_m = size.centroid_covariance_m2.trace().max(0.0).sqrt();
                    OverviewAccuracy::CentroidRmsM(rms_m)
                }),
                unknown: (!unknown.is_empty()).then(|| unknown.join(", ")),
            }
        })
    }

    fn of_markers(&self) -> OverviewRow {
        let Some(found) = &self.seen.markers else {
            return OverviewRow {
                source: OverviewSource::NotSearched,
                ..missing(MARKERS, "markers", "base placement")
            };
        };
        let used = |it: &Registered| it.registration.markers.len();
        let used = self.registered.as_ref().map_or(0, used);
        let errors = self.targets.iter().filter_map(|it| it.registration);
        OverviewRow {
            name: MARKERS.to_owned(),
            tissue: None,
            in_words: format!("{} markers, {used} used", found.markers.len()),
            volume_m3: None,
            source: OverviewSource::HuAndShape,
            accuracy: errors
                .map(|error| error.rms_m)
                .reduce(f64::max)
                .map(OverviewAccuracy::TreRmsM),
            unknown: None,
        }
    }

    /// Where the scan ends: beyond it nothing is known.
    fn of_ends(&self) -> OverviewRow {
        let sides = &self.seen.made.segmentation.body.cut_sides;
        let unknown = if sides.is_empty() {
            "skin at both ends".to_owned()
        } else {
            format!("skin at both ends, {}", sides.join(", "))
        };
        OverviewRow {
            source: OverviewSource::HuAndShape,
            ..missing(ENDS, "field of view", &unknown)
        }
    }
}

/// What a needle may meet that no label map shows, as needle paths take it by the rules of all `routes`, without the
/// structures that are `off`.
pub fn unlabelled(
    overview: &[OverviewRow],
    routes: &[RouteSection],
    off: &[String],
) -> Vec<OverviewRow> {
    let is_off = |name: &str| off.iter().any(|each| each == name);
    let vessels = is_off(Obstacle::Vessel.name());
    let is_left_out = |name: &str| match name {
        INTERCOSTAL => vessels || routes.iter().any(|route| route.below_rib_mm <= 0.0),
        MAMMARY => vessels || routes.iter().any(|route| route.beside_sternum_mm <= 0.0),
        MEDIASTINUM => is_off(Obstacle::Organ.name()) || is_off(NeedleRouteSection::MEDIASTINUM),
        _ => false,
    };
    let is_in_the_way = |row: &&OverviewRow| {
        let is_within = !matches!(
            row.tissue,
            Some(SurfaceTissue::Skin | SurfaceTissue::Lesion | SurfaceTissue::Beside)
        );
        let is_structure = ![MARKERS, ENDS, BESIDE, ASSUMED].contains(&row.name.as_str());
        is_within && is_structure && row.source != OverviewSource::LabelMap
    };
    let rows = overview.iter().filter(is_in_the_way);
    rows.map(|row| {
        let is_taken = matches!(
            row.source,
            OverviewSource::Modelled | OverviewSource::Assumed
        );
        if is_taken && is_left_out(&row.name) {
            missing(&row.name, &row.in_words, NOT_AVOIDED)
        } else {
            row.clone()
        }
    })
    .collect()
}

/// Heart and great vessels if nothing shows them: between the lungs, or anywhere in the half of the chest without one.
fn heart(is_shown: &dyn Fn(&str) -> bool) -> Option<OverviewRow> {
    if is_shown("heart") && is_shown("aorta") {
        return None;
    }
    let row = |unknown| missing(MEDIASTINUM, "heart, great vessels", unknown);
    let place = match [is_shown("lung_left"), is_shown("lung_right")] {
        [true, true] => "all between lungs",
        [false, false] => return Some(row(NOT_AVOIDED)),
        _ => "all beside the lung",
    };
    Some(OverviewRow {
        source: OverviewSource::Assumed,
        ..row(place)
    })
}

fn modelled(name: &str, in_words: &str, place: &str) -> OverviewRow {
    OverviewRow {
        source: OverviewSource::Modelled,
        ..missing(name, in_words, place)
    }
}

fn missing(name: &str, in_words: &str, unknown: &str) -> OverviewRow {
    OverviewRow {
        name: name.to_owned(),
        tissue: None,
        in_words: in_words.to_owned(),
        volume_m3: None,
        source: OverviewSource::NotFound,
        accuracy: None,
        unknown: Some(unknown.to_owned()),
    }
}

fn words(name: &str) -> String {
    match name {
        "skin" => "body within skin".to_owned(),
        _ if name == Label::Gas.name() => "gas outside lungs".to_owned(),
        _ => part_in_words(name).replace('_', " "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_label_map_shows_is_taken_as_the_rules_take_it() {
        use OverviewSource::{Assumed, HuAndShape, Modelled, NotFound};
        let row = |name: &str, source| OverviewRow {
            source,
            ..missing(name, name, "somewhere")
        };
        let overview = [
            row("skin", OverviewSource::HuAndShape),
            row("bone", OverviewSource::HuAndShape),
            row("liver", OverviewSource::LabelMap),
            row(MEDIASTINUM, OverviewSource::Assumed),
            row(INTERCOSTAL, OverviewSource::Modelled),
            row(MARKERS, OverviewSource::NotSearched),
        ];
        let mut overview = overview;
        overview[0].tissue = Some(SurfaceTissue::Skin);
        let sources = |rib_zone_mm: f64, off: &[&str]| {
            let route = RouteSection {
                below_rib_mm: rib_zone_mm,
                ..RouteSection::default()
            };
            let off: Vec<String> = off.iter().map(|&name| name.to_owned()).collect();
            let rows = unlabelled(&overview, &[route], &off);
            let rows = rows.into_iter().map(|row| (row.name, row.source));
            rows.collect::<Vec<_>>()
        };
        let named = |sources: [OverviewSource; 3]| {
            let names = ["bone", MEDIASTINUM, INTERCOSTAL].map(str::to_owned);
            names.into_iter().zip(sources).collect::<Vec<_>>()
        };
        assert_eq!(sources(3.0, &[]), named([HuAndShape, Assumed, Modelled]));
        assert_eq!(sources(0.0, &[]), named([HuAndShape, Assumed, NotFound]));
        assert_eq!(
            sources(3.0, &[MEDIASTINUM]),
            named([HuAndShape, NotFound, Modelled])
        );
    }

    #[test]
    fn heart_is_assumed_beside_the_lungs() {
        let with = |names: &[&str]| {
            let row = heart(&|name| names.contains(&name));
            row.map(|row| row.source)
        };
        let both = ["lung_left", "lung_right"];
        assert_eq!(with(&both), Some(OverviewSource::Assumed));
        assert_eq!(with(&both[..1]), Some(OverviewSource::Assumed));
        assert_eq!(with(&["heart", "lung_left"]), Some(OverviewSource::Assumed));
        assert_eq!(with(&["heart"]), Some(OverviewSource::NotFound));
        assert_eq!(with(&["heart", "aorta"]), None);
    }
}
