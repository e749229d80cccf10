//! What a scenario is made of: read from files, built, and kept for the next one that needs the same.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector3;
use needlebench_kinematics::Pose;

use crate::files::{Location, source_of};
use crate::fixtures::{
    self, Fixture, FixtureError, GantryParameters, MountParameters, TableParameters,
};
use crate::imperfections::{ArmPopulation, CalibrationBlock, resolve_calibration};
use crate::model::{ModelSource, Tool};
use crate::phantom::{Phantom, PhantomError, PhantomParameters};
use crate::resolve::{Overrides, calibrate};
use crate::robot::{MissingInertia, read_robot};
use crate::scenario::{PhantomSection, RobotSection, Scenario};
use crate::shelf::Shelf;
use crate::toml_text::TomlText;
use crate::tool::{ToolOverrides, read_tool};
use crate::user_parts::{PartSection, with_user_parts};
use crate::{Calibration, Finding, Robot, nearest_name};

/// Outer diameters of needles by gauge, mm: the nominal sizes of the needle gauge chart.
const NEEDLE_OUTER_DIAMETER_MM: [(u32, f64); 11] = [
    (14, 2.108),
    (15, 1.829),
    (16, 1.651),
    (17, 1.473),
    (18, 1.270),
    (19, 1.067),
    (20, 0.9081),
    (21, 0.8192),
    (22, 0.7176),
    (23, 0.6414),
    (25, 0.5144),
];

/// Value of `model` for a phantom of the user's parts alone.
const NO_MODEL: &str = "none";

/// A tool before it is mounted, and what was assumed.
#[derive(Debug)]
pub(crate) struct ToolPart {
    pub tool: Tool,
    pub notes: Vec<String>,
}

/// A phantom before it is placed, and the files that it is made of.
#[derive(Debug)]
pub(crate) struct PhantomPart {
    pub phantom: Arc<Phantom>,
    /// Vertices of the skin, phantom frame, m.
    pub skin_m: Vec<Vector3<f64>>,
    /// Parameter file, unless the phantom is of the user's parts alone.
    pub model: Option<ModelSource>,
    /// Files of the user's parts.
    pub parts: Vec<ModelSource>,
    pub notes: Vec<String>,
}

/// What decides a phantom.
#[derive(Debug)]
struct PhantomKey {
    model: String,
    sizes_mm: [Option<f64>; 3],
    parts: Vec<PartSection>,
}

impl PhantomKey {
    fn is_of(&self, section: &PhantomSection) -> bool {
        self.model == section.model
            && self.sizes_mm == sizes_mm(section)
            && self.parts == section.parts
    }
}

fn sizes_mm(section: &PhantomSection) -> [Option<f64>; 3] {
    [section.breadth_mm, section.depth_mm, section.length_mm]
}

/// The parts of scenarios that lie in one folder and are resolved with the same overrides.
#[derive(Debug, Default)]
pub(crate) struct Library {
    robots: Shelf<(String, MissingInertia, Option<String>), Robot>,
    tools: Shelf<(String, ToolOverrides), ToolPart>,
    phantoms: Shelf<PhantomKey, PhantomPart>,
    tables: Shelf<TableParameters, Fixture>,
    gantries: Shelf<GantryParameters, Fixture>,
    mounts: Shelf<(MountParameters, Pose), Fixture>,
    arms: Shelf<CalibrationBlock, (ArmPopulation, Vec<ModelSource>)>,
}

impl Library {
    /// The scenario's robot, with its `base_link` at the world's origin.
    pub fn robot(
        &self,
        toml: &TomlText<'_>,
        section: &RobotSection,
        base: &Path,
        overrides: &Overrides,
    ) -> Result<Arc<Robot>, Finding> {
        self.robots.get(
            |(urdf, missing, calibration)| {
                *urdf == section.urdf
                    && *missing == section.missing_inertia
                    && *calibration == section.calibration
            },
            || {
                let key = (
                    section.urdf.clone(),
                    section.missing_inertia,
                    section.calibration.clone(),
                );
                Ok((key, scenario_robot(toml, section, base, overrides)?))
            },
        )
    }

    /// The scenario's tool.
    pub fn tool(
        &self,
        toml: &TomlText<'_>,
        scenario: &Scenario,
        base: &Path,
        overrides: &Overrides,
    ) -> Result<Arc<ToolPart>, Finding> {
        let wanted = tool_overrides(toml, scenario)?;
        let urdf = &scenario.tool.urdf;
        self.tools.get(
            |(known, with)| known == urdf && *with == wanted,
            || {
                let part = scenario_tool(toml, scenario, &wanted, base, overrides)?;
                Ok(((urdf.clone(), wanted), part))
            },
        )
    }

    /// The scenario's phantom.
    pub fn phantom(
        &self,
        toml: &TomlText<'_>,
        section: &PhantomSection,
        base: &Path,
    ) -> Result<Arc<PhantomPart>, Finding> {
        self.phantoms.get(
            |key| key.is_of(section),
            || {
                let key = PhantomKey {
                    model: section.model.clone(),
                    sizes_mm: sizes_mm(section),
                    parts: section.parts.clone(),
                };
                Ok((key, scenario_phantom(toml, section, base)?))
            },
        )
    }

    /// The scenario's table, gantry and mount, as far as it has them.
    pub fn fixtures(
        &self,
        toml: &TomlText<'_>,
        scenario: &Scenario,
        world_from_base_link: &Pose,
    ) -> Result<[Option<Arc<Fixture>>; 3], Finding> {
        fn made<K>(
            shelf: &Shelf<K, Fixture>,
            key: Option<K>,
            make: impl Fn(&K) -> Result<Fixture, FixtureError>,
            finding: impl Fn(&FixtureError) -> Finding,
        ) -> Result<Option<Arc<Fixture>>, Finding>
        where
            K: Clone + PartialEq,
        {
            key.map(|key| {
                shelf.get(
                    |known| *known == key,
                    || make(&key).map(|made| (key.clone(), made)),
                )
            })
            .transpose()
            .map_err(|error| finding(&error))
        }
        let finding = |section| move |error: &FixtureError| fixture_finding(toml, section, error);
        let mount = scenario.mount.clone();
        Ok([
            made(
                &self.tables,
                scenario.table.clone(),
                fixtures::table,
                finding("table"),
            )?,
            made(
                &self.gantries,
                scenario.gantry.clone(),
                fixtures::gantry,
                finding("gantry"),
            )?,
            made(
                &self.mounts,
                mount.map(|mount| (mount, *world_from_base_link)),
                |(mount, base)| fixtures::mount(mount, base),
                finding("mount"),
            )?,
        ])
    }

    /// The real arms of a calibration block, and the files that they are from.
    pub fn arms(
        &self,
        toml: &TomlText<'_>,
        block: &CalibrationBlock,
        base: &Path,
    ) -> Result<Arc<(ArmPopulation, Vec<ModelSource>)>, Finding> {
        self.arms.get(
            |known| known == block,
            || {
                let mut sources = Vec::new();
                let arms = resolve_calibration(toml, block, base, &mut sources)?;
                Ok((block.clone(), (arms, sources)))
            },
        )
    }
}

fn scenario_robot(
    toml: &TomlText<'_>,
    section: &RobotSection,
    base: &Path,
    overrides: &Overrides,
) -> Result<Robot, Finding> {
    let location = match &overrides.robot_urdf {
        Some(path) => Location::Disk(path.clone()),
        None => Location::of_model(&section.urdf, "ur3", "urdf", base),
    };
    let mut robot = read_robot(
        &location,
        &overrides.packages,
        overrides.missing_inertia.unwrap_or(section.missing_inertia),
        Pose::identity(),
    )
    .map_err(|finding| {
        // The command line's robot is not the one that the scenario names.
        if overrides.robot_urdf.is_some() {
            finding
        } else {
            with_model_names(toml, finding, &location, "robot.urdf", "ur3")
        }
    })?;
    calibrate(&mut robot, overrides)?;
    // The scenario's calibration is that of the scenario's robot.
    if let (Some(reference), None, None) = (
        &section.calibration,
        &overrides.calibration,
        &overrides.robot_urdf,
    ) {
        let path = base.join(reference);
        if !path.is_file() {
            return Err(toml
                .finding(
                    "robot.calibration",
                    format!("there is no file {}", path.display()),
                )
                .hint("the path is relative to the scenario's folder"));
        }
        Calibration::load(&path).and_then(|calibration| calibration.apply_to(&mut robot))?;
    }
    Ok(robot)
}

fn scenario_tool(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    wanted: &ToolOverrides,
    base: &Path,
    overrides: &Overrides,
) -> Result<ToolPart, Finding> {
    let location = Location::of_model(&scenario.tool.urdf, "needle_guide", "urdf", base);
    let mut notes = Vec::new();
    let tool =
        read_tool(&location, &overrides.packages, wanted, &mut notes).map_err(|finding| {
            // A bore or a gauge of the scenario may not fit the tool's other half.
            let given = [
                ("tool.bore_mm", scenario.tool.bore_mm.is_some()),
                ("tool.needle_gauge", scenario.tool.needle_gauge.is_some()),
            ]
            .into_iter()
            .find(|(_, is_given)| *is_given);
            match given {
                Some((key, _)) if finding.key.as_deref() == Some("bore_mm") => Finding {
                    hint: finding.hint,
                    ..toml.finding(key, finding.message)
                },
                _ => with_model_names(toml, finding, &location, "tool.urdf", "needle_guide"),
            }
        })?;
    Ok(ToolPart { tool, notes })
}

fn scenario_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    base: &Path,
) -> Result<PhantomPart, Finding> {
    let mut notes = Vec::new();
    let (shipped, model) = if section.model == NO_MODEL {
        check_no_model(toml, section)?;
        (None, None)
    } else {
        let (phantom, source) = shipped_phantom(toml, section, base)?;
        (Some(phantom), Some(source))
    };
    let (phantom, parts) = match shipped {
        Some(phantom) if section.parts.is_empty() => (phantom, Vec::new()),
        shipped => with_user_parts(toml, &section.parts, shipped, base, &mut notes)?,
    };
    let skin = phantom.skin();
    // A polyhedron is its own surface, whatever the fineness.
    let surface = skin.shape.surface(0.0);
    let skin_m = surface.vertices_m.iter();
    let skin_m = skin_m.map(|vertex| (skin.parent_from_shape * vertex).coords);
    Ok(PhantomPart {
        skin_m: skin_m.collect(),
        phantom: Arc::new(phantom),
        model,
        parts,
        notes,
    })
}

/// A phantom without a model is what its parts are.
fn check_no_model(toml: &TomlText<'_>, section: &PhantomSection) -> Result<(), Finding> {
    for (name, given) in [
        ("breadth_mm", section.breadth_mm),
        ("depth_mm", section.depth_mm),
        ("length_mm", section.length_mm),
    ] {
        if given.is_some() {
            return Err(toml
                .finding(
                    &format!("phantom.{name}"),
                    format!("`{name}` contradicts `model = \"{NO_MODEL}\"`"),
                )
                .hint("the parts have the size of their files"));
        }
    }
    Ok(())
}

/// The phantom that a parameter file describes.
fn shipped_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    base: &Path,
) -> Result<(Phantom, ModelSource), Finding> {
    let location = Location::of_model(&section.model, "chest_phantom", "toml", base);
    let bytes = location.read().map_err(|error| {
        let names = Location::builtin_names("chest_phantom", "toml");
        toml.finding("phantom.model", format!("{}: {error}", location.display()))
            .hint(
                match nearest_name(&section.model, names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!(
                        "a path, `{NO_MODEL}` for [[phantom.parts]] alone, or one of {}",
                        names.join(", ")
                    ),
                },
            )
    })?;
    let file = location.display();
    let text = String::from_utf8(bytes)
        .map_err(|error| Finding::new(&file, format!("not UTF-8 text: {error}")))?;
    let parameter_text = TomlText::parse(&file, &text)?;
    let mut parameters: PhantomParameters = parameter_text.deserialize()?;
    let sizes = [
        (&mut parameters.breadth_mm, section.breadth_mm),
        (&mut parameters.depth_mm, section.depth_mm),
        (&mut parameters.length_mm, section.length_mm),
    ];
    let mut resized = false;
    for (size, wanted) in sizes {
        if let Some(wanted) = wanted {
            *size = wanted;
            resized = true;
        }
    }
    let phantom = Phantom::build(&parameters).map_err(|error| {
        if resized {
            let key = match &error {
                PhantomError::OutOfRange { key, .. } => format!("phantom.{key}"),
                _ => "phantom".to_owned(),
            };
            toml.finding(&key, error.to_string())
                .hint("lengths are in millimetres; leave a size out to take the model's own")
        } else {
            Finding::new(&file, error.to_string())
        }
    })?;
    Ok((phantom, source_of(file, text.as_bytes())))
}

/// A model that a scenario names but that does not exist: points at the key and lists what does.
fn with_model_names(
    toml: &TomlText<'_>,
    finding: Finding,
    location: &Location,
    key: &str,
    folder: &str,
) -> Finding {
    if location.read().is_ok() || finding.file != location.display() {
        return finding;
    }
    let names = Location::builtin_names(folder, "urdf");
    let given = location.display();
    let stem = Path::new(&given)
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or("");
    let hint = match nearest_name(stem, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`? Shipped: {}", names.join(", ")),
        None => format!(
            "a path relative to the scenario, or a shipped model: {}",
            names.join(", ")
        ),
    };
    let mut finding = finding.hint(hint);
    if toml.span_of(key).is_some() {
        let placed = toml.finding(key, format!("{}: {}", location.display(), finding.message));
        finding = Finding {
            hint: finding.hint,
            ..placed
        };
    }
    finding
}

/// What is wrong with a fixture, at the key of its section.
fn fixture_finding(toml: &TomlText<'_>, section: &str, error: &FixtureError) -> Finding {
    let Some(name) = error.key() else {
        return toml
            .finding(section, error.to_string())
            .hint("see `base_position_mm` and `base_rpy_deg` under [robot]");
    };
    toml.finding(&format!("{section}.{name}"), error.to_string())
        .hint(if name.ends_with("_mm") {
            "lengths are in millimetres"
        } else {
            "angles are in degrees"
        })
}

fn tool_overrides(toml: &TomlText<'_>, scenario: &Scenario) -> Result<ToolOverrides, Finding> {
    let tool = &scenario.tool;
    let needle_outer_diameter_m = match tool.needle_gauge {
        None => None,
        Some(gauge) => {
            let known = NEEDLE_OUTER_DIAMETER_MM
                .iter()
                .find(|(each, _)| *each == gauge);
            let Some((_, diameter_mm)) = known else {
                return Err(toml
                    .finding(
                        "tool.needle_gauge",
                        format!("there is no {gauge} gauge needle here"),
                    )
                    .hint("14 to 23, and 25"));
            };
            Some(diameter_mm * 1e-3)
        }
    };
    Ok(ToolOverrides {
        mount_rotation_rad: tool.mount_rotation_deg.to_radians(),
        bore_m: tool.bore_mm.map(|mm| mm * 1e-3),
        needle_gauge: tool.needle_gauge,
        needle_outer_diameter_m,
        needle_length_m: tool.needle_length_mm.map(|mm| mm * 1e-3),
    })
}
