//! The layers of the workspace: who may depend on whom, and who owns which heavy dependency.

mod modules;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Every crate under `crates/`, the Python package, and the crates of the workspace that it may depend on.
///
/// Data flows one way: a new edge is a decision, and belongs here first.
const LAYERS: [(&str, &[&str]); 40] = [
    ("elementary", &[]),
    ("parallel", &[]),
    ("numerics", &[]),
    ("insertion", &["numerics"]),
    ("probability", &["numerics", "parallel"]),
    ("kinematics", &["numerics"]),
    ("geometry", &["kinematics"]),
    ("input", &[]),
    ("iso9283", &["input", "kinematics"]),
    ("ros", &[]),
    ("breath", &["ros", "input", "numerics"]),
    ("cell", &["geometry", "kinematics"]),
    ("robot", &["cell", "input", "geometry", "kinematics"]),
    ("phantom", &["insertion", "input", "geometry", "kinematics"]),
    (
        "scenario",
        &[
            "breath",
            "iso9283",
            "insertion",
            "phantom",
            "robot",
            "cell",
            "input",
            "geometry",
            "kinematics",
        ],
    ),
    ("clearance", &["cell", "geometry", "kinematics", "numerics"]),
    (
        "live",
        &["clearance", "scenario", "cell", "geometry", "kinematics"],
    ),
    (
        "planning",
        &[
            "clearance",
            "scenario",
            "phantom",
            "cell",
            "geometry",
            "kinematics",
            "numerics",
        ],
    ),
    ("engine", &["cell", "geometry", "kinematics", "numerics"]),
    ("render", &["geometry", "kinematics", "parallel"]),
    ("show", &["render", "input"]),
    (
        "uncertainty",
        &[
            "engine",
            "probability",
            "scenario",
            "cell",
            "insertion",
            "kinematics",
            "numerics",
        ],
    ),
    ("study", &["scenario", "input", "kinematics", "numerics"]),
    ("urscript", &["kinematics"]),
    ("controller", &["urscript", "kinematics"]),
    (
        "recorded",
        &["ros", "scenario", "cell", "input", "kinematics"],
    ),
    ("volume", &["parallel"]),
    (
        "imaging",
        &["volume", "geometry", "kinematics", "numerics", "parallel"],
    ),
    (
        "synthesis",
        &["volume", "geometry", "kinematics", "numerics"],
    ),
    (
        "routing",
        &[
            "imaging",
            "insertion",
            "volume",
            "scenario",
            "phantom",
            "cell",
            "geometry",
            "kinematics",
            "parallel",
        ],
    ),
    (
        "evaluation",
        &[
            "iso9283",
            "uncertainty",
            "engine",
            "clearance",
            "scenario",
            "robot",
            "cell",
            "input",
            "geometry",
            "kinematics",
        ],
    ),
    ("credibility", &["show", "evaluation", "engine", "input"]),
    (
        "patient",
        &[
            "synthesis",
            "evaluation",
            "routing",
            "imaging",
            "volume",
            "uncertainty",
            "engine",
            "planning",
            "clearance",
            "scenario",
            "phantom",
            "cell",
            "input",
            "geometry",
            "kinematics",
            "numerics",
            "parallel",
        ],
    ),
    (
        "bench",
        &[
            "insertion",
            "iso9283",
            "evaluation",
            "patient",
            "routing",
            "controller",
            "urscript",
            "recorded",
            "study",
            "probability",
            "uncertainty",
            "engine",
            "planning",
            "clearance",
            "scenario",
            "phantom",
            "robot",
            "cell",
            "input",
            "geometry",
            "kinematics",
            "numerics",
            "parallel",
            "elementary",
        ],
    ),
    (
        "export",
        &[
            "bench",
            "patient",
            "evaluation",
            "ros",
            "engine",
            "planning",
            "clearance",
            "scenario",
            "phantom",
            "cell",
            "geometry",
            "kinematics",
        ],
    ),
    (
        "report",
        &[
            "iso9283",
            "show",
            "export",
            "bench",
            "patient",
            "evaluation",
            "imaging",
            "volume",
            "recorded",
            "study",
            "uncertainty",
            "render",
            "engine",
            "planning",
            "live",
            "clearance",
            "scenario",
            "phantom",
            "robot",
            "cell",
            "input",
            "geometry",
            "kinematics",
            "numerics",
            "parallel",
        ],
    ),
    (
        "viewer",
        &[
            "report",
            "bench",
            "patient",
            "evaluation",
            "routing",
            "volume",
            "uncertainty",
            "planning",
            "scenario",
            "cell",
            "input",
            "kinematics",
            "parallel",
        ],
    ),
    (
        "paper",
        &[
            "show",
            "report",
            "bench",
            "evaluation",
            "render",
            "scenario",
            "cell",
            "input",
            "kinematics",
            "numerics",
            "parallel",
        ],
    ),
    (
        "needlebench",
        &[
            "breath",
            "insertion",
            "iso9283",
            "credibility",
            "synthesis",
            "show",
            "paper",
            "viewer",
            "report",
            "export",
            "bench",
            "patient",
            "evaluation",
            "imaging",
            "volume",
            "recorded",
            "study",
            "uncertainty",
            "engine",
            "planning",
            "clearance",
            "scenario",
            "phantom",
            "robot",
            "cell",
            "input",
            "kinematics",
            "parallel",
        ],
    ),
    (
        "python",
        &[
            "needlebench",
            "report",
            "bench",
            "patient",
            "evaluation",
            "engine",
            "planning",
            "recorded",
            "clearance",
            "scenario",
            "cell",
            "input",
            "kinematics",
            "parallel",
        ],
    ),
];

/// The same for tests alone: what their inputs are made of.
const FOR_TESTS: [(&str, &[&str]); 10] = [
    ("geometry", &["numerics"]),
    ("scenario", &["numerics"]),
    ("clearance", &["input", "robot", "scenario"]),
    ("live", &["numerics"]),
    ("engine", &["input", "robot", "scenario"]),
    ("recorded", &["numerics"]),
    ("controller", &["numerics"]),
    ("routing", &["numerics"]),
    ("iso9283", &["numerics"]),
    ("viewer", &["imaging"]),
];

/// Dependencies that few crates have, hidden behind their own types.
const OWNERS: [(&str, &[&str]); 21] = [
    ("rayon", &["parallel"]),
    ("pyo3", &["python"]),
    ("numpy", &["python"]),
    ("rapier3d-f64", &["engine"]),
    ("parry3d-f64", &["geometry"]),
    ("toml", &["input", "phantom", "robot", "scenario"]),
    (
        "schemars",
        &[
            "cell",
            "credibility",
            "input",
            "needlebench",
            "phantom",
            "robot",
            "scenario",
        ],
    ),
    ("roxmltree", &["robot"]),
    ("granit-parser", &["input"]),
    ("stl_io", &["geometry"]),
    // Tables of studies, and of answers of other solvers.
    ("parquet", &["recorded", "study"]),
    ("zstd", &["study"]),
    ("crc32fast", &["study"]),
    ("mcap", &["ros"]),
    ("dicom-transfer-syntax-registry", &["volume"]),
    ("axum", &["viewer"]),
    ("png", &["render"]),
    ("quick-junit", &["report"]),
    ("comfy-table", &["show"]),
    ("indicatif", &["needlebench"]),
    ("clap", &["needlebench"]),
];

/// Where packages are that checks start: they may use everything, and nobody uses them.
const PROGRAMS: &str = "tests/programs";

/// What `cargo metadata` knows of a package of the workspace.
struct Package {
    manifest: PathBuf,
    dependencies: Vec<Dependency>,
}

struct Dependency {
    name: String,
    /// For tests only: builds nothing that others use.
    development: bool,
}

/// Packages of the workspace by the name of their folder.
fn packages() -> BTreeMap<String, Package> {
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--no-deps",
            "--offline",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    metadata["packages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|package| {
            let manifest = PathBuf::from(text(&package["manifest_path"]));
            let folder = manifest.parent().unwrap().file_name().unwrap();
            let dependencies = package["dependencies"]
                .as_array()
                .unwrap()
                .iter()
                .map(|dependency| Dependency {
                    name: short(&text(&dependency["name"])),
                    development: dependency["kind"] == "dev",
                })
                .collect();
            let folder = folder.to_str().unwrap();
            // Programs that checks start, for which the crates below them are named.
            let is_program = manifest
                .parent()
                .unwrap()
                .parent()
                .unwrap()
                .ends_with(PROGRAMS);
            let name = if is_program {
                format!("{PROGRAMS}/{folder}")
            } else {
                folder.to_owned()
            };
            let package = Package {
                manifest,
                dependencies,
            };
            (name, package)
        })
        .collect()
}

/// `cell` for `needlebench-cell`: a package is named after its folder.
fn short(name: &str) -> String {
    name.strip_prefix("needlebench-").unwrap_or(name).to_owned()
}

#[test]
fn every_crate_of_the_workspace_has_its_layer() {
    let mut found: BTreeSet<String> = packages().into_keys().collect();
    found.retain(|name| !name.starts_with(PROGRAMS));
    let mut expected: BTreeSet<String> = LAYERS.map(|(name, _)| name.to_owned()).into();
    // This package, which may use everything and which nobody uses.
    expected.insert("tests".to_owned());
    assert_eq!(found, expected);
}

#[test]
fn crates_depend_on_lower_layers_only() {
    let packages = packages();
    let for_tests: BTreeMap<&str, &[&str]> = FOR_TESTS.into();
    for (place, (name, allowed)) in LAYERS.into_iter().enumerate() {
        for other in allowed {
            let is_above = LAYERS[..place].iter().any(|(above, _)| above == other);
            assert!(is_above, "{name} stands above {other}, which it uses");
        }
        let in_tests = for_tests.get(name).copied().unwrap_or_default();
        for dependency in &packages[name].dependencies {
            let used = dependency.name.as_str();
            let is_allowed =
                allowed.contains(&used) || dependency.development && in_tests.contains(&used);
            assert!(
                is_allowed || !packages.contains_key(used),
                "{name} depends on {used}, but may depend on {allowed:?} only"
            );
        }
    }
}

#[test]
fn every_allowed_edge_is_used() {
    // An edge that nobody needs is a door left open.
    let packages = packages();
    for (name, allowed) in LAYERS {
        for dependency in allowed {
            let used = packages[name]
                .dependencies
                .iter()
                .any(|each| each.name == *dependency && !each.development);
            assert!(used, "{name} does not use {dependency}");
        }
    }
    for (name, allowed) in FOR_TESTS {
        for dependency in allowed {
            let mut all = packages[name].dependencies.iter();
            assert!(
                all.any(|each| each.name == *dependency),
                "{name}'s tests do not use {dependency}"
            );
        }
    }
}

#[test]
fn heavy_dependencies_have_few_owners() {
    let packages = packages();
    for (dependency, owners) in OWNERS {
        let users: Vec<&str> = packages
            .iter()
            // The cross-crate tests compare with whatever they need.
            .filter(|(name, _)| !name.starts_with("tests"))
            .filter(|(_, package)| {
                let mut names = package.dependencies.iter();
                // Tests compare with whatever they need.
                names.any(|each| each.name == dependency && !each.development)
            })
            .map(|(name, _)| name.as_str())
            .collect();
        assert_eq!(users, owners, "users of {dependency}");
    }
}

#[test]
fn every_crate_takes_the_lints_of_the_workspace_which_forbid_unsafe_code() {
    /// Their functions are exported by an attribute that counts as unsafe code.
    const EXPORTING: [&str; 2] = ["elementary", "live"];
    let root = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml"));
    assert!(root.unwrap().contains("unsafe_code = \"forbid\""));
    for (name, package) in packages() {
        let text = std::fs::read_to_string(package.manifest).unwrap();
        if EXPORTING.contains(&name.as_str()) {
            assert!(text.contains("\nunsafe_code = \"deny\"\n"));
            continue;
        }
        assert!(
            text.contains("\n[lints]\nworkspace = true\n"),
            "{name} has no `[lints] workspace = true`"
        );
    }
}
