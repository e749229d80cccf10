//! Study files: what they vary, and what is wrong with them.

use std::path::PathBuf;

use needlebench_input::Finding;
use needlebench_scenario::Overrides;
use needlebench_scenario::study::{FactorValues, ResolvedStudy, StudyMode, load_study};

fn load(lines: &str) -> Result<ResolvedStudy, Vec<Finding>> {
    load_with(lines, &Overrides::default())
}

/// Loads a study with these lines after its head; its folder is that of a copy of `supine_suite`.
fn load_with(lines: &str, overrides: &Overrides) -> Result<ResolvedStudy, Vec<Finding>> {
    let folder = tempfile::tempdir().unwrap();
    let scenarios = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    std::fs::copy(
        scenarios.join("supine_suite.toml"),
        folder.path().join("base.toml"),
    )
    .unwrap();
    let path = folder.path().join("study.toml");
    std::fs::write(
        &path,
        format!("name = \"s\"\nscenario = \"base.toml\"\n{lines}"),
    )
    .unwrap();
    load_study(&path, overrides)
}

fn finding(lines: &str) -> Finding {
    let mut findings = load(lines).expect_err("something is wrong");
    assert_eq!(findings.len(), 1, "{findings:?}");
    findings.remove(0)
}

const SHIFT: &str = "[[factors]]\nname = \"shift\"\nkey = \"phantom.position_mm[0]\"\n";

#[test]
fn former_names_are_read_as_the_present_ones() {
    let present = "[search]\nheld_out_layouts = 64\nfailure_penalty_mm = 7.5\n\
                   [[factors]]\nname = \"tool\"\nkey = \"tool.urdf\"\nrole = \"control\"\n\
                   values = [\"offset\", \"inline\"]\n\
                   [[factors]]\nname = \"s\"\nkey = \"seed\"\nrole = \"noise\"\nvalues = [1, 2]\n";
    let former = present
        .replace("held_out_layouts", "fresh")
        .replace("failure_penalty_mm", "failure_counts_mm")
        .replace("control", "choice")
        .replace("noise", "circumstance");
    let [present, former] = [present, &former].map(|lines| load(lines).unwrap());
    assert_eq!(present.file.search, former.file.search);
    assert_eq!(present.file.search.unwrap().held_out_layouts, 64);
    let roles = |factors: &[needlebench_scenario::study::StudyFactor]| {
        factors.iter().map(|each| each.role).collect::<Vec<_>>()
    };
    assert_eq!(roles(&present.factors), roles(&former.factors));
    assert_eq!(present.notes.len(), 0);
    assert_eq!(former.notes.len(), 4, "{:?}", former.notes);
}

#[test]
fn a_study_knows_its_factors() {
    let study = load(
        "mode = \"static\"\ngoals = [\"left_upper_anterior\"]\n[sampling]\nsamples = 8\n\
         [[factors]]\nname = \"x\"\nkey = \"phantom.position_mm[0]\"\nrange = [-30, 30]\nrelative = true\n\
         [[factors]]\nname = \"tool\"\nkey = \"tool.urdf\"\nrole = \"control\"\nvalues = [\"offset\", \"inline\"]\n\
         [[factors]]\nname = \"z\"\nkey = \"robot.base_position_mm[2]\"\ngrid = { from = 900, to = 1100, steps = 5 }\n\
         [[factors]]\nname = \"arm\"\n\
         [[factors.levels]]\nname = \"rigid\"\n\
         [[factors.levels]]\nname = \"soft\"\nmode = \"dynamic\"\n\
         set = { \"controller.stiffness_nm_rad\" = [500, 500, 500, 500, 500, 500], seed = 3 }\n",
    )
    .unwrap();
    assert_eq!(study.goals, ["left_upper_anterior"]);
    let names: Vec<&str> = study
        .factors
        .iter()
        .map(|factor| factor.name.as_str())
        .collect();
    assert_eq!(names, ["x", "tool", "z", "arm"]);
    assert!(study.factors[0].sampled && !study.factors[1].sampled);
    assert_eq!(study.factors[0].unit, "mm");
    let FactorValues::Levels(z) = &study.factors[2].values else {
        panic!("a grid has levels");
    };
    assert_eq!(
        z.iter()
            .map(|level| level.number.unwrap())
            .collect::<Vec<_>>(),
        [900.0, 950.0, 1000.0, 1050.0, 1100.0]
    );
    let FactorValues::Levels(arm) = &study.factors[3].values else {
        panic!("levels");
    };
    assert_eq!((arm[0].changes.len(), arm[1].changes.len()), (0, 2));
    assert_eq!(arm[1].mode, Some(StudyMode::Dynamic));
}

#[test]
fn a_grid_has_round_numbers_where_its_steps_are_round() {
    let study = load(&format!(
        "{SHIFT}grid = {{ from = -480, to = 0, steps = 7 }}\n"
    ))
    .unwrap();
    let FactorValues::Levels(levels) = &study.factors[0].values else {
        panic!("a grid has levels");
    };
    let labels: Vec<&str> = levels.iter().map(|level| level.label.as_str()).collect();
    assert_eq!(labels, ["-480", "-400", "-320", "-240", "-160", "-80", "0"]);
}

#[test]
fn empty_and_contradictory_factors_are_refused() {
    for (lines, key, word) in [
        (
            format!("{SHIFT}values = []\n"),
            "factors[0].values",
            "no values",
        ),
        (SHIFT.to_owned(), "factors[0].name", "no values"),
        (
            format!("{SHIFT}range = [30, -30]\n[sampling]\nsamples = 4\n"),
            "factors[0].range",
            "empty",
        ),
        (
            format!("{SHIFT}values = [1, 1.0]\n"),
            "factors[0].values[1]",
            "twice",
        ),
        (
            format!("{SHIFT}values = [1]\nrange = [0, 1]\n"),
            "factors[0].range",
            "contradicts",
        ),
        (
            format!("{SHIFT}grid = {{ from = 0, to = 1, steps = 1 }}\n"),
            "factors[0].grid.steps",
            "1 steps",
        ),
        (
            format!("{SHIFT}normal = {{ mean = 0, sd = 0 }}\n[sampling]\nsamples = 4\n"),
            "factors[0].normal.sd",
            "normal.sd` is 0, outside 0",
        ),
        (
            format!("{SHIFT}range = [0, 1]\n"),
            "factors[0].range",
            "number of samples",
        ),
        ("factors = []\n".to_owned(), "factors", "length 0"),
        (
            "goals = []\n".to_owned() + SHIFT + "values = [1]\n",
            "goals",
            "no goal",
        ),
        (
            "goals = [\"left_uper_anterior\"]\n".to_owned() + SHIFT + "values = [1]\n",
            "goals[0]",
            "no goal",
        ),
        (
            format!(
                "{SHIFT}values = [1]\n{}values = [2]\n",
                SHIFT.replace("\"shift\"", "\"other\"")
            ),
            "factors[1].name",
            "contradict",
        ),
        (
            format!("{SHIFT}values = [1]\n{SHIFT}values = [2]\n"),
            "factors[1].name",
            "both named",
        ),
        (
            format!("engines = [\"rapier\"]\n{SHIFT}values = [1]\n"),
            "engines",
            "dynamic",
        ),
        (
            SHIFT.replace("shift", "outcome") + "values = [1]\n",
            "factors[0].name",
            "column",
        ),
        (
            SHIFT.replace("\"shift\"", "\"a b\"") + "values = [1]\n",
            "factors[0].name",
            "not a usable name",
        ),
        (
            format!("[sampling]\nsamples = 0\n{SHIFT}values = [1]\n"),
            "sampling.samples",
            "0 samples",
        ),
    ] {
        let found = finding(&lines);
        assert_eq!(found.key.as_deref(), Some(key), "{found:?}");
        assert!(found.message.contains(word), "{found:?}");
        assert!(found.line.is_some(), "{found:?}");
    }
}

#[test]
fn keys_that_the_scenario_cannot_have_are_refused_with_what_it_can() {
    for (lines, words) in [
        (
            "key = \"phantom.positon_mm[0]\"\nvalues = [1]\n",
            ["positon_mm", "position_mm"],
        ),
        (
            "key = \"phantom.position_mm[3]\"\nvalues = [1]\n",
            ["[3]", "3 numbers"],
        ),
        (
            "key = \"phantom..x\"\nvalues = [1]\n",
            ["phantom..x", "path of a key"],
        ),
        (
            "key = \"goals[0].roll_deg\"\nvalues = [1]\n",
            ["goals[0]", "goal."],
        ),
        (
            "key = \"tool.urdf\"\nvalues = [3]\n",
            ["tool.urdf", "string"],
        ),
        (
            "key = \"tool.urdf\"\nvalues = [\"offset\"]\nrelative = true\n",
            ["offset", "added"],
        ),
        (
            "key = \"phantom.posture\"\nvalues = [\"supin\"]\n",
            ["supin", "supine"],
        ),
    ] {
        let found = finding(&format!("[[factors]]\nname = \"f\"\n{lines}"));
        let text = format!(
            "{} {}",
            found.message,
            found.hint.clone().unwrap_or_default()
        );
        for word in words {
            assert!(text.contains(word), "{text}");
        }
        assert!(found.line.is_some());
    }
}

#[test]
fn engines_are_those_that_there_are() {
    let overrides = Overrides {
        engines: vec!["rapier", "mujoco"],
        ..Overrides::default()
    };
    let head =
        format!("mode = \"dynamic\"\nengines = [\"rapier\", \"mujco\"]\n{SHIFT}values = [1]\n");
    let level = "mode = \"dynamic\"\n[[factors]]\nname = \"arm\"\n\
                 [[factors.levels]]\nname = \"other\"\nengines = [\"bullet\"]\n";
    for (lines, key, hint) in [
        (head.as_str(), "engines[1]", "did you mean `mujoco`?"),
        (
            level,
            "factors[0].levels[0].engines[0]",
            "one of rapier, mujoco",
        ),
    ] {
        let findings = load_with(lines, &overrides).expect_err("there is no such engine");
        let [found] = &findings[..] else {
            panic!("{findings:?}");
        };
        assert_eq!(found.key.as_deref(), Some(key), "{found:?}");
        assert_eq!(found.hint.as_deref(), Some(hint), "{found:?}");
        assert!(found.line.is_some(), "{found:?}");
        // Who does not know the engines cannot tell.
        load(lines).unwrap();
    }
}

#[test]
fn motions_are_planned_by_default_as_far_as_that_is_affordable() {
    let mode = |lines: &str| load(lines).unwrap().mode;
    let grid = |steps: u32| format!("{SHIFT}grid = {{ from = -30, to = 30, steps = {steps} }}\n");
    let one = "goals = [\"left_upper_anterior\"]\n";
    assert_eq!(mode(&format!("{one}{}", grid(512))), StudyMode::Planned);
    assert_eq!(mode(&format!("{one}{}", grid(513))), StudyMode::Static);
    // Samples multiply, and goals.
    let sampled =
        |samples: u32| format!("[sampling]\nsamples = {samples}\n{SHIFT}range = [-30, 30]\n");
    assert_eq!(mode(&format!("{one}{}", sampled(512))), StudyMode::Planned);
    assert_eq!(mode(&sampled(512)), StudyMode::Static);
    // What is said counts.
    let said = format!("mode = \"static\"\n{one}{}", grid(2));
    assert_eq!(mode(&said), StudyMode::Static);
    let study = load(&said).unwrap();
    assert_eq!(study.file.replanned_cases, 32);
}
