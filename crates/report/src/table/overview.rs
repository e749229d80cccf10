//! What was found in a scan, as a table.

use needlebench_patient::ct::{OverviewAccuracy, OverviewRow, OverviewSource};
use needlebench_show::{CellAlignment, plain_table};

/// Structures of one tissue of a label map that have a row each; more share one.
const ROWS_OF_TISSUE: usize = 3;

/// What stands where there is nothing to say.
const NONE: &str = "-";

/// Rows that stand for these on a screen: many structures of one tissue of a label map as one.
pub fn overview_rows(overview: &[OverviewRow]) -> Vec<OverviewRow> {
    let is_mapped = |row: &OverviewRow| row.source == OverviewSource::LabelMap;
    let is_alike = |a: &OverviewRow, b: &OverviewRow| is_mapped(b) && a.tissue == b.tissue;
    let mut rows: Vec<OverviewRow> = Vec::new();
    for row in overview {
        let alike: Vec<&OverviewRow> = overview.iter().filter(|it| is_alike(row, it)).collect();
        let Some(tissue) = row.tissue.filter(|_| is_mapped(row)) else {
            rows.push(row.clone());
            continue;
        };
        if alike.len() <= ROWS_OF_TISSUE {
            rows.push(row.clone());
        } else if alike[0] == row {
            rows.push(OverviewRow {
                in_words: format!("{} {}s", alike.len(), format!("{tissue:?}").to_lowercase()),
                volume_m3: Some(alike.iter().filter_map(|it| it.volume_m3).sum()),
                ..row.clone()
            });
        }
    }
    rows
}

/// The table.
pub fn overview_text(overview: &[OverviewRow]) -> String {
    let mut table = plain_table(&["structure", "ml", "from", "accuracy (mm)", "not known"]);
    for row in overview_rows(overview) {
        table.add_row([
            row.in_words.clone(),
            volume_ml(&row).unwrap_or_else(|| NONE.to_owned()),
            row.source.in_words().to_owned(),
            row.accuracy.map_or_else(|| NONE.to_owned(), accuracy_mm),
            row.unknown.unwrap_or_default(),
        ]);
    }
    if let Some(column) = table.column_mut(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    format!(
        "{table}\nml: within the surface, or of the voxels of what has none; on coarse voxels they differ, and notes have \
         the voxels'\naccuracy: P99 distance of the surface from the voxels, RMS error of a lesion's centroid, TRE of \
         markers; whether a structure is what it is taken for is not evaluated"
    )
}

/// What no label map showed, by what stands for it; empty if there is nothing.
pub fn unlabelled_text(unlabelled: &[OverviewRow]) -> String {
    let mut text = String::new();
    for (sources, words) in [
        (
            &[OverviewSource::HuAndShape, OverviewSource::SeedAndHu][..],
            "from HU and shape alone",
        ),
        (&[OverviewSource::Assumed], "assumed"),
        (&[OverviewSource::Modelled], "modelled"),
        (
            &[OverviewSource::NotFound, OverviewSource::NotSearched],
            "not found and not avoided",
        ),
    ] {
        let rows = unlabelled
            .iter()
            .filter(|row| sources.contains(&row.source));
        let with_place = |row: &OverviewRow| match (&row.unknown, row.source) {
            (Some(place), OverviewSource::Assumed | OverviewSource::Modelled) => {
                format!("{} ({place})", row.in_words)
            }
            _ => row.in_words.clone(),
        };
        let names: Vec<String> = rows.map(with_place).collect();
        if !names.is_empty() {
            text += "\n  ";
            text += words;
            text += ": ";
            text += &names.join(", ");
        }
    }
    if text.is_empty() {
        return text;
    }
    format!("no label map shows:{text}")
}

/// Its volume in ml.
pub(crate) fn volume_ml(row: &OverviewRow) -> Option<String> {
    let volume_m3 = row.volume_m3?;
    let digits = usize::from(volume_m3 < 1e-4);
    Some(format!("{:.digits$}", volume_m3 * 1e6))
}

/// With its unit's digits.
pub(crate) fn accuracy_mm(accuracy: OverviewAccuracy) -> String {
    match accuracy {
        OverviewAccuracy::SurfaceP99M(m) => format!("P99 {:.2}", m * 1e3),
        OverviewAccuracy::HalfVoxelM(m) => format!("voxel/2 {:.2}", m * 1e3),
        OverviewAccuracy::CentroidRmsM(m) => format!("RMS {:.2}", m * 1e3),
        OverviewAccuracy::TreRmsM(m) => format!("TRE {:.2}", m * 1e3),
    }
}

#[cfg(test)]
mod tests {
    use needlebench_volume::SurfaceTissue;

    use super::*;

    fn row(name: &str, tissue: SurfaceTissue, source: OverviewSource) -> OverviewRow {
        OverviewRow {
            name: name.to_owned(),
            tissue: Some(tissue),
            in_words: name.replace('_', " "),
            volume_m3: Some(2e-4),
            source,
            accuracy: Some(OverviewAccuracy::HalfVoxelM(5e-4)),
            unknown: None,
        }
    }

    #[test]
    fn many_structures_of_a_label_map_share_a_row() {
        let mut overview = vec![row("skin", SurfaceTissue::Skin, OverviewSource::HuAndShape)];
        for bone in ["ribs", "sternum", "vertebrae", "hips"] {
            overview.push(row(bone, SurfaceTissue::Bone, OverviewSource::LabelMap));
        }
        overview.push(row("liver", SurfaceTissue::Organ, OverviewSource::LabelMap));
        let rows = overview_rows(&overview);
        let names: Vec<&str> = rows.iter().map(|row| row.in_words.as_str()).collect();
        assert_eq!(names, ["skin", "4 bones", "liver"]);
        assert_eq!(volume_ml(&rows[1]).unwrap(), "800");
        // Three have rows of their own.
        assert_eq!(overview_rows(&overview[..4]).len(), 4);
        let text = overview_text(&overview);
        assert!(text.contains("voxel/2 0.50"), "{text}");
    }

    #[test]
    fn what_no_label_map_shows_is_said_by_what_stands_for_it() {
        let mut heart = row("heart", SurfaceTissue::Organ, OverviewSource::Assumed);
        heart.unknown = Some("all between lungs".to_owned());
        let overview = [
            row("bone", SurfaceTissue::Bone, OverviewSource::HuAndShape),
            heart,
            row("liver", SurfaceTissue::Organ, OverviewSource::NotFound),
        ];
        assert_eq!(
            unlabelled_text(&overview),
            "no label map shows:\n  from HU and shape alone: bone\n  assumed: heart (all between lungs)\n  \
             not found and not avoided: liver"
        );
        assert_eq!(unlabelled_text(&[]), "");
    }
}
