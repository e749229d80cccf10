//! Model files: shipped inside the program, or on disk.

use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use include_dir::{Dir, include_dir};
use percent_encoding::percent_decode_str;
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::Finding;
use crate::read::read_data;

static BUILTIN: Dir<'static> = include_dir!("$OUT_DIR/models");

/// Prefix of shipped models in scenario files and reports.
const BUILTIN_PREFIX: &str = "builtin:";

/// Where a file is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// Path inside the shipped `models` folder.
    Builtin(PathBuf),
    /// Path on disk.
    Disk(PathBuf),
    /// What a program made of a file on disk.
    Expanded(Arc<Expanded>),
}

/// Text that a program made of a file on disk; files beside it are those beside that file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expanded {
    /// The file on disk.
    pub path: PathBuf,
    /// What the program made of it.
    pub text: Vec<u8>,
    /// Program, arguments and digest, for the notes of a report.
    pub note: String,
}

/// Search paths for `package://NAME/...`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PackagePaths(Vec<(String, PathBuf)>);

impl PackagePaths {
    /// Reads `NAME=DIR` arguments.
    ///
    /// # Errors
    /// A [`Finding`] for an argument without `=` or a folder that does not exist.
    pub fn from_arguments(arguments: &[String]) -> Result<Self, Finding> {
        let mut paths = Vec::new();
        for argument in arguments {
            let Some((name, folder)) = argument.split_once('=') else {
                return Err(Finding::new(
                    "--package-path",
                    format!("`{argument}` is not NAME=DIR"),
                )
                .hint("for example --package-path ur_description=/opt/ur_description"));
            };
            if !Path::new(folder).is_dir() {
                return Err(Finding::new(
                    "--package-path",
                    format!("the folder `{folder}` of package `{name}` does not exist"),
                )
                .hint("give the folder that package://NAME/ stands for"));
            }
            paths.push((name.to_owned(), PathBuf::from(folder)));
        }
        Ok(Self(paths))
    }

    /// The packages, with another one unless one of its name is there.
    #[must_use]
    pub fn or(mut self, name: String, folder: PathBuf) -> Self {
        if self.iter().all(|(known, _)| known != name) {
            self.0.push((name, folder));
        }
        self
    }

    /// Names and folders.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Path)> {
        let pairs = self.0.iter();
        pairs.map(|(name, folder)| (name.as_str(), folder.as_path()))
    }
}

impl Location {
    /// Reads a model reference of a scenario: the name of a shipped model, or a path relative to
    /// the scenario's folder. `folder` and `extension` say where shipped ones are.
    pub fn of_model(reference: &str, folder: &str, extension: &str, base: &Path) -> Self {
        let name = reference.strip_prefix(BUILTIN_PREFIX).unwrap_or(reference);
        let builtin = PathBuf::from(folder).join(format!("{name}.{extension}"));
        let is_name = !name.contains(['/', '\\']) && Path::new(name).extension().is_none();
        if is_name && (reference != name || BUILTIN.get_file(&builtin).is_some()) {
            return Self::Builtin(builtin);
        }
        Self::Disk(base.join(reference))
    }

    /// The shipped file that a name with `builtin:` says, if it does.
    pub fn builtin(name: &str) -> Option<Self> {
        let path = Path::new(name.strip_prefix(BUILTIN_PREFIX)?);
        Some(Self::Builtin(path.components().collect()))
    }

    /// Names of the shipped folders that hold a file of this name.
    pub fn builtin_folders_with(file: &str) -> Vec<String> {
        let mut names: Vec<String> = BUILTIN
            .dirs()
            .filter(|folder| BUILTIN.get_file(folder.path().join(file)).is_some())
            .filter_map(|folder| Some(folder.path().to_str()?.to_owned()))
            .collect();
        names.sort();
        names
    }

    /// Names of the shipped models in a folder.
    pub fn builtin_names(folder: &str, extension: &str) -> Vec<String> {
        let mut names: Vec<String> = BUILTIN
            .get_dir(folder)
            .into_iter()
            .flat_map(Dir::files)
            .filter(|file| {
                file.path()
                    .extension()
                    .is_some_and(|found| found == extension)
            })
            .filter_map(|file| Some(file.path().file_stem()?.to_str()?.to_owned()))
            .collect();
        names.sort();
        names
    }

    /// As users see it.
    pub fn display(&self) -> String {
        match self {
            Self::Builtin(path) => format!("{BUILTIN_PREFIX}{}", path.display()),
            Self::Disk(path) => path.display().to_string(),
            Self::Expanded(made) => format!("{} (expanded)", made.path.display()),
        }
    }

    /// How the text was made, where a program made it.
    pub fn note(&self) -> Option<&str> {
        match self {
            Self::Builtin(_) | Self::Disk(_) => None,
            Self::Expanded(made) => Some(&made.note),
        }
    }

    /// All bytes of the file.
    ///
    /// # Errors
    /// Why it cannot be read, in words.
    pub fn read(&self) -> Result<Vec<u8>, String> {
        match self {
            Self::Builtin(path) => {
                let file = BUILTIN.get_file(path);
                let bytes = file.map(|file| file.contents().to_vec());
                tracing::trace!(file = %self.display(), found = bytes.is_some(), "read what ships");
                bytes.ok_or_else(|| "no such shipped model".to_owned())
            }
            Self::Disk(path) => read_data(path).map_err(|error| error.to_string()),
            Self::Expanded(made) => Ok(made.text.clone()),
        }
    }

    /// Whether there is such a file.
    pub fn is_there(&self) -> bool {
        match self {
            Self::Builtin(path) => BUILTIN.get_file(path).is_some(),
            Self::Disk(path) => path.is_file(),
            Self::Expanded(made) => made.path.is_file(),
        }
    }

    /// Whether both are the same file, by whatever path.
    pub fn is_same_file(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Disk(a), Self::Disk(b)) => {
                a == b
                    || matches!(
                        (a.canonicalize(), b.canonicalize()),
                        (Ok(a), Ok(b)) if a == b
                    )
            }
            _ => self == other,
        }
    }

    /// Name of the folder that the file is in; none in the working directory.
    pub fn folder_name(&self) -> Option<String> {
        let path = match self {
            Self::Builtin(path) | Self::Disk(path) => path,
            Self::Expanded(made) => &made.path,
        };
        Some(path.parent()?.file_name()?.to_str()?.to_owned())
    }

    /// A file by its path relative to this one's folder.
    pub fn beside(&self, name: &str) -> Self {
        let sibling = |path: &Path| path.parent().unwrap_or(Path::new("")).join(name);
        match self {
            Self::Builtin(path) => Self::Builtin(normalized(&sibling(path))),
            Self::Disk(path) => Self::Disk(sibling(path)),
            Self::Expanded(made) => Self::Disk(sibling(&made.path)),
        }
    }

    /// A mesh file that a URDF at `self` names: a path, `file://`, `package://NAME/...` or Gazebo's `model://NAME/...`.
    ///
    /// Names are URIs where a file of that very name is not there: `%20` is a blank then.
    pub fn mesh(&self, name: &str, packages: &PackagePaths) -> Result<Self, String> {
        let found = self.mesh_as_named(name, packages)?;
        if !name.contains('%') || found.is_there() {
            return Ok(found);
        }
        let decoded = percent_decode_str(name).decode_utf8();
        let decoded = decoded.map_err(|_| "its `%` escapes are not UTF-8 text".to_owned())?;
        let other = self.mesh_as_named(&decoded, packages)?;
        Ok(if other.is_there() { other } else { found })
    }

    fn mesh_as_named(&self, name: &str, packages: &PackagePaths) -> Result<Self, String> {
        let in_package = ["package://", "model://"]
            .iter()
            .find_map(|scheme| name.strip_prefix(scheme));
        if let Some(rest) = in_package {
            let (package, inside) = rest.split_once('/').unwrap_or((rest, ""));
            return packages
                .0
                .iter()
                .find(|(known, _)| known == package)
                .map(|(_, folder)| Self::Disk(folder.join(inside)))
                .ok_or_else(|| {
                    format!("package `{package}` is not known: give --package-path {package}=DIR")
                });
        }
        if let Some((scheme, _)) = name
            .split_once("://")
            .filter(|(scheme, _)| *scheme != "file")
        {
            return Err(format!(
                "`{scheme}://` is not supported: use a path, file://, package:// or model://"
            ));
        }
        let path = name
            .strip_prefix("file://localhost")
            .or(name.strip_prefix("file://"));
        Ok(self.beside(path.unwrap_or(name)))
    }
}

/// Removes `.` and `..`, which the shipped folder does not resolve.
fn normalized(path: &Path) -> PathBuf {
    let mut parts = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => {
                parts.pop();
            }
            Component::CurDir => {}
            other => parts.push(other),
        }
    }
    parts
}

/// Where a model came from, for the provenance of a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ModelSource {
    /// File as the scenario names it, or `builtin:` and the model's name.
    pub file: String,
    /// SHA-256 of the file's bytes, lower-case hex.
    pub sha256: String,
}

/// Name and SHA-256 of a file.
pub fn source_of(file: String, bytes: &[u8]) -> ModelSource {
    ModelSource {
        file,
        sha256: sha256_hex(bytes),
    }
}

/// SHA-256 of bytes, as lower-case hex.
pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .fold(String::new(), |mut text, byte| {
            // Writing to a String cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        })
}
