//! Files of a reproduction.

use needlebench_render::tile;
use needlebench_report::files::{FilesError, Folder};

use super::Reproduction;
use super::html::page;

/// Columns of the sheet with all configurations.
const SHEET_COLUMNS: usize = 4;

/// Writes pictures, page and report, and the names of the files into the report.
///
/// # Errors
/// What cannot be written.
pub fn write_paper(found: &mut Reproduction, folder: Folder<'_>) -> Result<(), FilesError> {
    let mut pictures = Vec::new();
    for (name, image) in &found.pictures {
        let png = image.to_png()?;
        folder.write(name, &png)?;
        found.report.files.push(name.clone());
        pictures.push((name.clone(), png));
    }
    if !found.pictures.is_empty() {
        let captioned: Vec<_> = found
            .pictures
            .iter()
            .map(|(name, image)| (image.clone(), name.trim_end_matches(".png").to_owned()))
            .collect();
        let name = "figure_6.png";
        folder.write_image(name, &tile(&captioned, SHEET_COLUMNS))?;
        found.report.files.push(name.to_owned());
    }
    found.report.files.push("paper.html".to_owned());
    folder.write("paper.html", page(&found.report, &pictures))?;
    folder.write_json("paper.json", &found.report)
}
