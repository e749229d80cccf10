//! `--robot FILE.xacro`: the program `xacro` on the PATH expands it. Stand-ins for it are scripts.

use std::fmt::Write as _;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use sha2::{Digest, Sha256};

use crate::support::{Answer, Bench, Json, SMALL, workspace};

const FK: &str = "fk --joints 0.3,-1.2,1.1,-0.4,0.9,0.2";

/// A bench whose PATH has a folder `bin` with a script of that name in front.
struct WithProgram {
    bench: Bench,
}

impl WithProgram {
    fn new(script: &str) -> Self {
        let bench = Bench::with_scenario(SMALL);
        fs::create_dir_all(bench.path("bin")).unwrap();
        bench.write("bin/xacro", script);
        let executable = fs::Permissions::from_mode(0o755);
        fs::set_permissions(bench.path("bin/xacro"), executable).unwrap();
        fs::copy(shipped("ur3"), bench.path("expanded.urdf")).unwrap();
        bench.write("arm.urdf.xacro", "<robot name=\"theirs\"/>");
        Self { bench }
    }

    fn run(&self, line: &str) -> Answer {
        let system = std::env::var_os("PATH").unwrap_or_default();
        let folders = std::iter::once(self.bench.path("bin")).chain(std::env::split_paths(&system));
        self.run_with(line, std::env::join_paths(folders).unwrap())
    }

    fn run_with(&self, line: &str, path: std::ffi::OsString) -> Answer {
        let mut command = self.bench.command(line);
        command.env("PATH", path).stdin(Stdio::null());
        Answer::of(command.output().unwrap())
    }
}

fn shipped(arm: &str) -> PathBuf {
    workspace().join(format!("models/{arm}/{arm}.urdf"))
}

fn hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in Sha256::digest(bytes) {
        // Writing to a String cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// Writes down what it was called with, and answers with a URDF.
const CAT: &str = "#!/bin/sh\nprintf '%s\\n' \"$@\" > called\ncat expanded.urdf\n";

#[test]
fn a_xacro_file_is_expanded_and_the_report_says_by_what() {
    let with = WithProgram::new(CAT);
    let options = "--robot arm.urdf.xacro --xacro ur_type:=ur10e --xacro 'name:=a b'";
    let here = with
        .run(&format!("{FK} {options} --json"))
        .exits_with(0)
        .json();
    let called = with.bench.text("called");
    assert_eq!(called, "arm.urdf.xacro\nur_type:=ur10e\nname:=a b\n");
    let there = with.run(&format!("{FK} --robot expanded.urdf --json"));
    let there = there.exits_with(0).json();
    assert_eq!(here["flange_in_base"], there["flange_in_base"]);
    assert_eq!(here["flange_in_base"]["position_m"].list().len(), 3);

    let checked = with.run(&format!("check s.toml {options}")).exits_with(0);
    let digest = hex(&with.bench.read("expanded.urdf"));
    let text = checked
        .stdout
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    for part in [
        "bin/xacro made of arm.urdf.xacro with ur_type:=ur10e name:=a b",
        digest.as_str(),
    ] {
        assert!(text.contains(part), "{text}");
    }
    let answer = with.run(&format!(
        "run s.toml {options} --engine rapier --no-pictures --no-page --quiet"
    ));
    assert!(answer.status.is_some_and(|status| status < 2), "{answer:?}");
    let report: serde_json::Value =
        serde_json::from_slice(&with.bench.read("out/small/report.json")).unwrap();
    let notes = report["notes"].list();
    assert!(
        notes.iter().any(|note| note.word().contains(&digest)),
        "{notes:?}"
    );
    let inputs = report["provenance"]["inputs"].list();
    let robot = inputs
        .iter()
        .find(|input| input["role"] == "robot")
        .unwrap();
    assert_eq!(robot["file"], "arm.urdf.xacro (expanded)");
    assert_eq!(robot["sha256"], digest);
}

#[test]
fn what_is_wrong_in_an_expansion_is_said_of_it() {
    let with = WithProgram::new(CAT);
    with.bench.write(
        "expanded.urdf",
        "<robot name=\"x\"><link name=\"base_link\"/></robot>",
    );
    let line = format!("{FK} --robot arm.urdf.xacro");
    with.run(&line)
        .exits_with(2)
        .complains(["not a UR arm", "arm.urdf.xacro (expanded)"]);
    // What was not expanded after all.
    let xacro =
        "<robot name=\"x\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:arm/></robot>";
    with.bench.write("expanded.urdf", xacro);
    with.run(&line)
        .exits_with(2)
        .complains(["this is a xacro file"]);
}

#[test]
fn a_program_that_fails_is_quoted() {
    let script = "#!/bin/sh\necho 'Undefined substitution argument ur_type' >&2\necho \"when processing file: $1\" >&2\nexit 2\n";
    let with = WithProgram::new(script);
    let line = format!("{FK} --robot arm.urdf.xacro --xacro name:=ur");
    with.run(&line).exits_with(2).complains([
        "xacro made no URDF of it: exit status: 2",
        "Undefined substitution argument ur_type",
        "when processing file: arm.urdf.xacro",
        "hint: the line that was run: xacro arm.urdf.xacro name:=ur",
    ]);
    let silent = WithProgram::new("#!/bin/sh\nexit 0\n");
    silent
        .run(&line)
        .exits_with(2)
        .complains(["it wrote nothing"]);
    let broken = WithProgram::new("#!/none/there\n");
    broken
        .run(&line)
        .exits_with(2)
        .complains(["it cannot be started"]);
}

#[test]
fn without_the_program_the_line_to_type_is_said() {
    let with = WithProgram::new(CAT);
    // A folder without anything that can be run.
    fs::create_dir_all(with.bench.path("empty/xacro")).unwrap();
    let path = with.bench.path("empty").into_os_string();
    let line = format!("{FK} --robot arm.urdf.xacro --xacro ur_type:=ur5");
    with.run_with(&line, path).exits_with(2).complains([
        "no program `xacro` is on the PATH",
        "xacro arm.urdf.xacro ur_type:=ur5 > robot.urdf, then --robot robot.urdf",
    ]);
}

#[test]
fn arguments_of_xacro_need_a_file_for_it_and_a_name() {
    let with = WithProgram::new(CAT);
    let line = format!("{FK} --robot expanded.urdf --xacro ur_type:=ur5");
    with.run(&line)
        .exits_with(2)
        .complains(["--xacro", "omit it", "expanded.urdf"]);
    let line = format!("{FK} --robot arm.urdf.xacro --xacro=-o:=other.urdf");
    with.run(&line)
        .exits_with(2)
        .complains(["`-o:=other.urdf` is not NAME:=VALUE"]);
    let line = format!("{FK} --xacro ur_type:=ur5");
    with.run(&line).exits_with(2).complains(["--robot"]);
    let line = format!("{FK} --robot none.xacro --xacro ur_type:=ur5");
    with.run(&line)
        .exits_with(2)
        .complains(["cannot read the URDF", "none.xacro"]);
}

/// A scenario is the same on every machine: it names a URDF.
#[test]
fn a_scenario_names_no_xacro_file() {
    let with = WithProgram::new(CAT);
    let xacro =
        "<robot name=\"x\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:arm/></robot>";
    with.bench.write("arm.urdf.xacro", xacro);
    let text = SMALL.replacen("[robot]", "[robot]\nurdf = \"arm.urdf.xacro\"", 1);
    assert_ne!(text, SMALL);
    with.bench.write("s.toml", text);
    with.run("check s.toml")
        .exits_with(2)
        .complains(["this is a xacro file", "expand it first"]);
    assert!(!Path::new(&with.bench.path("called")).exists());
    let line = "plan-excitation --robot arm.urdf.xacro --out excitation.toml";
    with.bench.write("arm.urdf.xacro", "<robot/>");
    with.run(line)
        .exits_with(2)
        .complains(["names its robot's URDF", "expand it first"]);
}

/// ROS's program asks Python's `ament_index_python` for packages, which is not installed here.
const FIND: &str = "#!/usr/bin/env python3
from ament_index_python.packages import get_package_share_directory as find

declaration, rest = open(find('their_arm') + '/urdf/arm.urdf').read().split('?>', 1)
print(declaration + '?>' + open(find('other') + '/head').read() + rest)
try:
    find('nobody')
except LookupError as error:
    open('refused', 'w').write(str(error))
";

#[test]
fn packages_are_found_though_no_ros_is_installed() {
    let with = WithProgram::new(FIND);
    let bench = &with.bench;
    for folder in ["their arm/urdf/inc", "elsewhere"] {
        fs::create_dir_all(bench.path(folder)).unwrap();
    }
    bench.write(
        "their arm/package.xml",
        "<package><name>their_arm</name></package>",
    );
    bench.write("their arm/urdf/inc/arm.xacro", "<robot/>");
    fs::copy(shipped("ur10e"), bench.path("their arm/urdf/arm.urdf")).unwrap();
    bench.write("elsewhere/head", "<!-- from elsewhere -->");
    let before = bench.tree(".");
    let line = format!(
        "{FK} --robot 'their arm/urdf/inc/arm.xacro' --package-path other=elsewhere --json"
    );
    let found = with.run(&line).exits_with(0).json();
    let line = format!("{FK} --robot 'their arm/urdf/arm.urdf' --json");
    let known = with.run(&line).exits_with(0).json();
    assert_eq!(found["flange_in_base"], known["flange_in_base"]);
    assert!(bench.text("refused").contains("'nobody'"));
    // Nothing else is written anywhere beside the file.
    let mut after = bench.tree(".");
    after.retain(|name| !name.ends_with("refused"));
    assert_eq!(before, after);
}
