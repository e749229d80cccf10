//! A folder of results.

use std::io;
use std::path::{Path, PathBuf};

use needlebench_render::Image;
use needlebench_show::chart::Chart;
use serde::Serialize;

use super::atomic::{stream_atomically, write_atomically};
use super::error::FilesError;

/// Files of charts: pixels for viewers and documents, vectors for papers and pages.
const CHARTS: [&str; 2] = ["png", "svg"];

/// Files of recordings.
const RECORDINGS: [&str; 2] = ["csv", "mcap"];

/// A folder of results; names of files are relative to it.
#[derive(Debug, Clone, Copy)]
pub struct Folder<'a>(pub &'a Path);

impl Folder<'_> {
    /// Where a file is.
    pub fn path(self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Makes a folder in it.
    pub fn make(self, name: &str) -> Result<(), FilesError> {
        let path = self.path(name);
        std::fs::create_dir_all(&path).map_err(|source| FilesError::Write { path, source })
    }

    /// Writes a file.
    pub fn write(self, name: &str, bytes: impl AsRef<[u8]>) -> Result<(), FilesError> {
        let path = self.path(name);
        write_atomically(&path, bytes.as_ref()).map_err(|source| FilesError::Write { path, source })
    }

    /// Writes a file bit by bit.
    pub fn stream(
        self,
        name: &str,
        write: &mut dyn FnMut(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), FilesError> {
        let path = self.path(name);
        stream_atomically(&path, write).map_err(|source| FilesError::Write { path, source })
    }

    /// Writes a value as JSON for people and programs.
    pub fn write_json(self, name: &str, value: &impl Serialize) -> Result<(), FilesError> {
        let mut json = serde_json::to_vec_pretty(value)?;
        json.push(b'\n');
        self.write(name, json)
    }

    /// Writes a picture.
    pub fn write_image(self, name: &str, image: &Image) -> Result<(), FilesError> {
        self.write(name, image.to_png()?)
    }

    /// Writes a chart in pixels and in vectors; gives the names of both files.
    pub(crate) fn write_chart(self, stem: &str, chart: &Chart) -> Result<[String; 2], FilesError> {
        let [png, svg] = CHARTS.map(|extension| format!("{stem}.{extension}"));
        self.write_image(&png, &chart.to_image())?;
        self.write(&svg, chart.to_svg())?;
        Ok([png, svg])
    }

    /// Removes a file of an earlier run, if there is one, so that it is not taken for one of this run.
    pub fn remove(self, name: &str) -> Result<(), FilesError> {
        let path = self.path(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(FilesError::Remove {
                path,
                source: error,
            }),
            _ => Ok(()),
        }
    }

    /// Removes the files of a chart that an earlier run drew.
    pub(crate) fn remove_chart(self, stem: &str) -> Result<(), FilesError> {
        CHARTS
            .iter()
            .try_for_each(|extension| self.remove(&format!("{stem}.{extension}")))
    }

    /// Removes recordings and pictures that an earlier run left in a folder within this one; `written`
    /// are those of this run.
    pub(crate) fn remove_others(self, folder: &str, written: &[String]) -> Result<(), FilesError> {
        let path = self.path(folder);
        let entries = std::fs::read_dir(&path).and_then(Iterator::collect::<io::Result<Vec<_>>>);
        let entries = entries.map_err(|source| FilesError::Remove { path, source })?;
        for entry in entries {
            let name = entry.file_name().to_string_lossy().into_owned();
            let extension = Path::new(&name).extension().and_then(|text| text.to_str());
            let ours = extension.is_some_and(|extension| {
                RECORDINGS.contains(&extension) || CHARTS.contains(&extension)
            });
            let name = format!("{folder}/{name}");
            if ours && !written.contains(&name) {
                self.remove(&name)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_recordings_and_pictures_of_others_are_removed() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder(temporary.path());
        folder.make("pose").unwrap();
        let names = ["old.csv", "old.svg", "old.png", "new.svg", "notes.txt"];
        let names = names.map(|name| format!("pose/{name}"));
        for name in &names {
            folder.write(name, "").unwrap();
        }
        folder.remove_others("pose", &names[3..4]).unwrap();
        let left = names.map(|name| folder.path(&name).exists());
        assert_eq!(left, [false, false, false, true, true]);
        folder.remove_chart("pose/new").unwrap();
        folder.remove_chart("pose/new").unwrap();
        assert!(!folder.path("pose/new.svg").exists());
    }

    #[test]
    fn a_chart_is_two_files() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder(temporary.path());
        let chart = Chart::new([20.0, 10.0], "a < b");
        let names = folder.write_chart("chart", &chart).unwrap();
        assert_eq!(names, ["chart.png", "chart.svg"]);
        let svg = std::fs::read_to_string(folder.path("chart.svg")).unwrap();
        assert!(svg.contains("<title>a &lt; b</title>"));
        assert!(svg.starts_with("<svg xmlns") && svg.trim_end().ends_with("</svg>"));
        let png = std::fs::read(folder.path("chart.png")).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
        assert!(matches!(
            folder.write_chart("missing/chart", &chart),
            Err(FilesError::Write { .. })
        ));
    }
}
