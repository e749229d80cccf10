//! The build that a patient is of: files of another one are not taken for it.

use std::path::{Path, PathBuf};

use needlebench_input::{Finding, ModelSource, TomlText, read_text, sha256_hex};
use serde::Deserialize;

use crate::scenario::{BuildSection, PartSection};

/// The report of a build, as far as it is read.
#[derive(Deserialize)]
pub(super) struct Report {
    #[serde(skip)]
    path: PathBuf,
    surfaces: Vec<Surface>,
    /// None where nothing is assumed behind the cuts of the scan.
    assumed_body: Option<AssumedBody>,
}

#[derive(Deserialize)]
struct AssumedBody {
    surfaces: Vec<Surface>,
}

#[derive(Deserialize)]
struct Surface {
    /// Relative to the report.
    file: String,
    /// Of the file's bytes.
    sha256: String,
}

const REBUILD: &str =
    "`needlebench ct build` writes scenario and report together: build the folder again";

impl Report {
    /// Reads the report that a scenario in the folder `base` names; refuses that of another build.
    pub fn read(toml: &TomlText<'_>, section: &BuildSection, base: &Path) -> Result<Self, Finding> {
        let path = base.join(&section.report);
        let file = path.display();
        let text = read_text(&path).map_err(|error| {
            toml.finding("phantom.build.report", format!("{file}: {error}"))
                .hint(format!(
                    "{REBUILD}; a build that was interrupted has no report, and a plan that was moved aside is of a \
                     former build"
                ))
        })?;
        if sha256_hex(text.as_bytes()) != section.sha256 {
            return Err(toml
                .finding(
                    "phantom.build.sha256",
                    format!("this is of another build than {file}"),
                )
                .hint(
                    "the folder was built again since, or its report changed: plan again with `needlebench view` or \
                     `needlebench ct routes`, or build the folder again",
                ));
        }
        let report: Self = serde_json::from_str(&text).map_err(|error| {
            toml.finding(
                "phantom.build.report",
                format!("{file}: not written by `ct build`: {error}"),
            )
            .hint(REBUILD)
        })?;
        Ok(Self { path, ..report })
    }

    /// Refuses files of the report's surfaces that are not as they were written. `sources` are the files of `parts`,
    /// named as they were read from the folder `base`.
    pub fn check_parts(
        &self,
        toml: &TomlText<'_>,
        parts: &[PartSection],
        sources: &[ModelSource],
        base: &Path,
    ) -> Result<(), Finding> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let assumed = self.assumed_body.iter().flat_map(|body| &body.surfaces);
        for surface in self.surfaces.iter().chain(assumed) {
            // The same file may be named in several ways.
            let Ok(place) = folder.join(&surface.file).canonicalize() else {
                continue;
            };
            for (index, part) in parts.iter().enumerate() {
                let named = base.join(&part.file);
                let name = named.display().to_string();
                let is_other =
                    |source: &ModelSource| source.file == name && source.sha256 != surface.sha256;
                if named.canonicalize().is_ok_and(|named| named == place)
                    && sources.iter().any(is_other)
                {
                    return Err(toml
                        .finding(
                            &format!("phantom.parts[{index}].file"),
                            format!(
                                "{name} is not the surface that {} describes",
                                self.path.display()
                            ),
                        )
                        .hint(format!(
                            "{REBUILD}; for a surface of your own, give the file another name"
                        )));
                }
            }
        }
        Ok(())
    }
}
