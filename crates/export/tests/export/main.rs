//! Exports, from outside the crate. Other tools open them in `tests/validation/export`.

mod gltf;
mod mjcf;
mod urdf;

use std::path::Path;

use needlebench_export::{ExportError, ExportedFile, Packing, Shown};
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};

/// A cell with obstacles of meshes, people and a gantry, hanging.
fn hanging() -> ResolvedScenario {
    shipped("hanging")
}

fn shipped(name: &str) -> ResolvedScenario {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let path = folder.join(format!("{name}.toml"));
    load_scenario(&path, &Overrides::default()).unwrap()
}

fn text(file: &ExportedFile) -> &str {
    std::str::from_utf8(&file.bytes).unwrap()
}

/// Text between two others, for all places where the first stands.
fn all_between<'t>(text: &'t str, before: &str, after: &str) -> Vec<&'t str> {
    text.split(before)
        .skip(1)
        .map(|rest| rest.split_once(after).unwrap().0)
        .collect()
}

#[test]
fn the_same_scenario_gives_the_same_files() {
    type Export = fn(&ResolvedScenario) -> Result<Vec<ExportedFile>, ExportError>;
    let formats: [(Export, &str); 3] = [
        (
            |resolved| needlebench_export::mjcf(resolved, "cell"),
            "cell.xml",
        ),
        (
            |resolved| needlebench_export::urdf(resolved, "cell"),
            "cell.urdf",
        ),
        (
            |resolved| needlebench_export::gltf(resolved, "cell", &Shown::Start, Packing::Binary),
            "cell.glb",
        ),
    ];
    for (export, first) in formats {
        let files = export(&hanging()).unwrap();
        assert_eq!(files[0].name, first);
        assert_eq!(files, export(&hanging()).unwrap());
        let mut names: Vec<&str> = files.iter().map(|file| &*file.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), files.len());
    }
}

#[test]
fn heads_name_scenario_hash_program_and_what_was_assumed() {
    let resolved = hanging();
    assert!(!resolved.notes.is_empty());
    for file in [
        &needlebench_export::mjcf(&resolved, "cell").unwrap()[0],
        &needlebench_export::urdf(&resolved, "cell").unwrap()[0],
        &needlebench_export::urdf(&resolved, "cell").unwrap()[1],
    ] {
        let [comment] = all_between(text(file), "<!--", "-->")[..] else {
            panic!("{} has not one comment", file.name);
        };
        assert!(comment.contains("of the scenario hanging"));
        assert!(comment.contains(&resolved.source.sha256));
        assert!(comment.contains("made by needlebench"));
        assert!(comment.contains("units: m, kg, s, rad"));
        // What XML forbids in a comment.
        assert!(!comment.contains("--"));
        for note in &resolved.notes {
            let beginning = note.split("--").next().unwrap();
            assert!(comment.contains(beginning), "{note}");
        }
    }
}

#[test]
fn what_the_nominal_cell_leaves_out_is_said() {
    let head = |name| {
        let files = needlebench_export::mjcf(&shipped(name), "cell").unwrap();
        text(&files[0]).split_once("-->").unwrap().0.to_owned()
    };
    assert!(head("imperfect").contains("imperfections"));
    assert!(!head("table3").contains("imperfections"));
}
