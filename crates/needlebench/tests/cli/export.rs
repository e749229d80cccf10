//! `export`.

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use crate::support::{Bench, Json, SMALL, has_keys};

fn hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in Sha256::digest(bytes) {
        // Writing to a String cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

#[test]
fn each_format_is_written_where_results_go_and_says_what_it_is() {
    let bench = Bench::with_scenario(SMALL);
    for (format, file) in [
        ("mjcf", "small.xml"),
        ("urdf", "small.urdf"),
        ("gltf", "small.glb"),
    ] {
        let words = format!("export s.toml --as {format} --json");
        let answer = bench.run(&words).exits_with(0).json();
        has_keys(&answer, "schema_version scenario format files");
        assert_eq!(answer["format"], format);
        let files = answer["files"].list();
        assert_eq!(files[0]["name"], format!("out/small/{file}"));
        for each in files {
            let bytes = bench.read(each["name"].word());
            assert_eq!(each["bytes"], bytes.len());
            assert_eq!(each["sha256"], hex(&bytes));
        }
        assert_eq!(bench.run(&words).exits_with(0).json(), answer);
        let shown = bench.run(words.trim_end_matches(" --json"));
        let shown = shown.exits_with(0).stdout;
        assert!(shown.contains(&format!("out/small/{file}")), "{shown}");
    }
    let text = bench.text("out/small/small.srdf");
    assert!(text.contains("<group name=\"manipulator\">"));
}

#[test]
fn a_file_can_be_named_and_what_belongs_to_it_is_beside_it() {
    let bench = Bench::with_scenario(SMALL);
    let words = "export s.toml --as urdf --out a/b/robot.xacro";
    bench.run(words).exits_with(0);
    let tree = bench.tree("a/b");
    for name in ["robot.xacro", "robot.srdf", "robot_meshes/package.xml"] {
        assert!(tree.contains(&name.into()), "{tree:?}");
    }
    // Where its name is that of another file of the same export.
    let words = "export s.toml --as urdf --out c/robot.srdf";
    bench
        .run(words)
        .exits_with(2)
        .complains(["robot.srdf", "--out", "hint: "]);
    assert!(!bench.path("c/robot.srdf").exists());
}

#[test]
fn the_only_goal_need_not_be_named() {
    let bench = Bench::with_scenario(SMALL);
    let words = "export s.toml --as gltf --configuration Right-Up-Fold";
    bench.run(words).exits_with(0);
    let first = bench.read("out/small/small.glb");
    let named = format!("{words} --goal pose");
    bench.run(&named).exits_with(0);
    assert_eq!(bench.read("out/small/small.glb"), first);
}
