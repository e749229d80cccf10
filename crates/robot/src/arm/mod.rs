//! Arms: what is known of one besides its URDF, and whose data a robot has.
//!
//! An arm is a folder with a URDF and an `arm.toml`. Nothing about a particular arm stands in code but
//! the name of the one that is taken where nobody names any (`DEFAULT_ARM`).

mod brakes;
mod check;
mod choice;
pub mod data;
mod scenario_keys;

use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use needlebench_kinematics::UrGeometry;

pub use choice::Recognition;
pub(crate) use choice::{choose_arm, note_on_no_arm};
pub use data::ArmData;
use needlebench_input::{Finding, Location, ModelSource, TomlText, nearest_name, source_of};

/// The arm of scenarios that name none.
pub const DEFAULT_ARM: &str = "ur3";

/// Name of the file with an arm's data.
const ARM_FILE: &str = "arm.toml";

/// An arm whose lengths are all within this of another's is the same type: factory calibrations move
/// them by up to 3 mm, while the two arms most like each other, UR3 and UR3e, differ by 19 mm.
pub const SAME_ARM_M: f64 = 5e-3;

/// What is known of an arm, and the file that says so.
#[derive(Debug, PartialEq)]
pub struct Arm {
    /// Name that it is called by: the folder's.
    pub key: String,
    /// The file's content.
    pub data: ArmData,
    /// The file.
    pub source: ModelSource,
    location: Location,
}

/// The arms that ship, by name.
static SHIPPED: LazyLock<Vec<Arc<Arm>>> = LazyLock::new(|| {
    Location::builtin_folders_with(ARM_FILE)
        .into_iter()
        .map(|folder| {
            let location = Location::Builtin(Path::new(&folder).join(ARM_FILE));
            Arc::new(Arm::read(&location).expect("the data of shipped arms are sound"))
        })
        .collect()
});

impl Arm {
    /// The arms that ship, by name.
    pub fn shipped() -> &'static [Arc<Self>] {
        &SHIPPED
    }

    /// Names of the arms that ship.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> + Clone {
        SHIPPED.iter().map(|arm| arm.key.as_str())
    }

    /// Every calibration in the data of a shipped arm, by its file's name; each name once.
    pub fn shipped_calibrations() -> Vec<(String, Location)> {
        let mut found = Vec::new();
        for arm in Self::shipped() {
            arm.add_calibrations(&mut found);
        }
        found.sort_by(|a, b| a.0.cmp(&b.0));
        found
    }

    /// Adds the calibrations of the data, by their files' names, to those that are known.
    pub fn add_calibrations(&self, known: &mut Vec<(String, Location)>) {
        let calibrations = self.data.population.iter().flat_map(|p| &p.calibrations);
        for entry in calibrations {
            let stem = Path::new(&entry.file).file_stem();
            let Some(name) = stem.and_then(|stem| stem.to_str()) else {
                continue;
            };
            if !known.iter().any(|(known, _)| known == name) {
                known.push((name.to_owned(), self.file(&entry.file)));
            }
        }
    }

    /// The arm that ships under a name.
    pub fn named(name: &str) -> Option<Arc<Self>> {
        SHIPPED.iter().find(|arm| arm.key == name).map(Arc::clone)
    }

    /// An arm by the name of a shipped one, in any case, or by the path of its `arm.toml` or of the
    /// folder that holds it, relative to `base`.
    ///
    /// # Errors
    /// A name or file that is not there, with what there is; what is wrong with the file.
    pub fn of_reference(reference: &str, base: &Path) -> Result<Arc<Self>, Finding> {
        let is_path = reference.contains(['/', '\\']) || Path::new(reference).extension().is_some();
        if !is_path && let Some(arm) = Self::named(&reference.to_lowercase()) {
            return Ok(arm);
        }
        let path = base.join(reference);
        let file = if path.is_dir() {
            path.join(ARM_FILE)
        } else {
            path
        };
        if file.is_file() {
            return Self::read(&Location::Disk(file)).map(Arc::new);
        }
        let finding = Finding::new(
            file.display().to_string(),
            format!("there is no arm `{reference}`"),
        );
        let near = nearest_name(reference, Self::shipped_names());
        Err(finding.hint(if let Some(near) = near.filter(|_| !is_path) {
            format!("did you mean `{near}`?")
        } else {
            let names: Vec<&str> = Self::shipped_names().collect();
            format!("the path of an {ARM_FILE}, or one of {}", names.join(", "))
        }))
    }

    fn read(location: &Location) -> Result<Self, Finding> {
        let file = location.display();
        let bytes = location
            .read()
            .map_err(|error| Finding::new(&file, format!("cannot read the arm's data: {error}")))?;
        let text = String::from_utf8(bytes)
            .map_err(|error| Finding::new(&file, format!("not UTF-8 text: {error}")))?;
        let toml = TomlText::parse(&file, &text)?;
        // One finding at a time, as of everything else that a robot is made of.
        let first = |findings: Vec<Finding>| findings.into_iter().next();
        let data: ArmData = match toml.read(&data::ARM_DATA) {
            Ok(data) => data,
            Err(findings) => return Err(first(findings).expect("an error says what is wrong")),
        };
        if let Some(finding) = first(check::check_arm(&toml, &data)) {
            return Err(finding);
        }
        Ok(Self {
            key: location
                .folder_name()
                .unwrap_or_else(|| data.name.to_lowercase()),
            data,
            source: source_of(file, text.as_bytes()),
            location: location.clone(),
        })
    }

    /// Where a file that the data name is.
    pub fn file(&self, name: &str) -> Location {
        Location::builtin(name).unwrap_or_else(|| self.location.beside(name))
    }

    /// A file that the data name, as data that stand elsewhere can name it: of a shipped arm with
    /// `builtin:`, else its path.
    pub fn file_from_elsewhere(&self, name: &str) -> String {
        self.file(name).display()
    }

    /// The arm's own URDF.
    pub fn urdf(&self) -> Location {
        self.file(&self.data.urdf)
    }

    /// The file in words: `models/ur3/arm.toml` for a shipped one.
    pub fn path(&self) -> String {
        match &self.location {
            Location::Builtin(path) => Path::new("models").join(path).display().to_string(),
            Location::Disk(_) | Location::Expanded(_) => self.location.display(),
        }
    }

    /// `the shipped UR3's`.
    pub(crate) fn possessive(&self) -> String {
        match self.location {
            Location::Builtin(_) => format!("the shipped {}'s", self.data.name),
            Location::Disk(_) | Location::Expanded(_) => format!("the {}'s", self.data.name),
        }
    }

    /// Largest difference of any length from these, m.
    pub fn deviation_m(&self, geometry: &UrGeometry) -> f64 {
        self.data.geometry.lengths().largest_difference_m(geometry)
    }

    /// What the data lack, in words: `the data of the UR5e (models/ur5e/arm.toml) have no [brakes]: ...`.
    pub fn lack(&self, table: &str) -> String {
        let why = self.data.lacks.get(table);
        let why = why.map_or(String::new(), |why| format!(": {why}"));
        format!(
            "the data of the {} ({}) have no [{table}]{why}",
            self.data.name,
            self.path()
        )
    }
}

/// Where a robot's URDF is: by the name of a shipped arm, or a path relative to `base`.
pub fn robot_location(reference: &str, base: &Path) -> Location {
    let name = reference.strip_prefix("builtin:").unwrap_or(reference);
    let is_name = !name.contains(['/', '\\']) && Path::new(name).extension().is_none();
    match Arm::named(name).filter(|_| is_name) {
        Some(arm) => arm.urdf(),
        None if is_name && reference != name => {
            Location::Builtin(PathBuf::from(name).join(format!("{name}.urdf")))
        }
        None => Location::Disk(base.join(reference)),
    }
}

/// An arm's data beside a URDF, if they say that they are of this URDF.
fn beside(urdf: &Location) -> Result<Option<Arc<Arm>>, Finding> {
    let location = urdf.beside(ARM_FILE);
    if let Location::Builtin(_) = location {
        let mut shipped = SHIPPED.iter();
        let found = shipped.find(|arm| arm.location == location && arm.urdf() == *urdf);
        return Ok(found.map(Arc::clone));
    }
    if !location.is_there() {
        return Ok(None);
    }
    let arm = Arm::read(&location)?;
    Ok(arm.urdf().is_same_file(urdf).then(|| Arc::new(arm)))
}

#[cfg(test)]
mod tests;
