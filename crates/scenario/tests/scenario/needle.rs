//! A needle in tissue: what it passes, and what is refused.

use std::path::Path;

use needlebench_input::Finding;
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

const GOAL: &str = "lesion = \"right_lower_lobe\"\nentry_direction_deg = [-75, 3]";

fn resolve(goal: &str, more: &str) -> Result<ResolvedScenario, Vec<Finding>> {
    let text = format!(
        "name = \"x\"\n[robot]\nbase_position_mm = [-900, 0, 800]\n[tool]\nneedle_length_mm = 400\n\
         [phantom]\nmodel = \"male-p50-supine\"\nrest_on_table = false\nposition_mm = [0, 0, 1000]\n\
         [[goals]]\nname = \"g\"\n{goal}\n{more}\n"
    );
    resolve_scenario("x.toml", &text, Path::new(""), &Overrides::default())
}

fn refused(goal: &str, more: &str) -> Finding {
    let mut findings = resolve(goal, more).expect_err("it is to be refused");
    assert_eq!(findings.len(), 1, "{findings:#?}");
    let finding = findings.remove(0);
    assert!(
        finding.line.is_some() && finding.hint.is_some(),
        "{finding:#?}"
    );
    finding
}

#[test]
fn a_needle_in_tissue_passes_what_is_between_skin_and_tip() {
    for place in ["expected", "imperfections"] {
        let block = format!("[{place}.needle]\nmodel = \"tissue\"\nbevel = \"liver\"\n");
        let resolved = resolve(GOAL, &block).unwrap();
        let goal = &resolved.goals[0];
        let path = goal.needle_path.as_ref().unwrap();
        let names: Vec<&str> = path
            .layers
            .iter()
            .map(|layer| layer.tissue.name())
            .collect();
        assert_eq!(names[..2], ["fat", "wall"], "{names:?}");
        assert_eq!(names.last(), Some(&"lesion"), "{names:?}");
        let length_m: f64 = path.layers.iter().map(|layer| layer.length_m).sum();
        assert!((length_m - goal.entry_to_target_m().unwrap()).abs() < 1e-9);
        let [x, y] = path.pushed_towards.unwrap();
        assert!((x * x + y * y - 1.0).abs() < 1e-9);
        let needle = resolved.expected.unwrap().imperfections;
        assert!(needle.tissue().is_some());
    }
    for usual in ["", "[expected.needle]\n", "[imperfections.needle]\n"] {
        let resolved = resolve(GOAL, usual).unwrap();
        assert!(resolved.goals[0].needle_path.is_some(), "{usual}");
        assert!(
            resolved.expected.unwrap().imperfections.tissue().is_some(),
            "{usual}"
        );
    }
    for air in ["model = \"cantilever\"\n", "side_force_n = 0.1\n"] {
        let resolved = resolve(GOAL, &format!("[expected.needle]\n{air}")).unwrap();
        assert_eq!(resolved.goals[0].needle_path, None);
        assert!(
            resolved.expected.unwrap().imperfections.tissue().is_none(),
            "{air}"
        );
    }
}

/// A scenario that says nothing of its needle runs whatever is in the needle's way: it bends as in air where nothing else is
/// known, and says so.
#[test]
fn a_needle_that_nobody_described_bends_as_in_air_where_tissue_is_not_known() {
    // From the back through the spine or a rib: refused for that, so that no bend is missed.
    let through = "lesion = \"pleural_based\"\nentry_direction_deg = [100, 0]";
    let refused = resolve(through, "").unwrap();
    assert_eq!(refused.goals[0].needle_path, None);
    let is_in_tissue = |resolved: &ResolvedScenario| {
        let expected = resolved.expected.as_ref().unwrap();
        expected.imperfections.tissue().is_some()
    };
    let says = |resolved: &ResolvedScenario| {
        let mut notes = resolved.notes.iter();
        notes.any(|note| note.contains("needles bend as in air"))
    };
    assert!(!says(&refused));
    let allowed = resolve(through, "[planning.needle_route]\noff = [\"bone\"]\n").unwrap();
    assert!(!is_in_tissue(&allowed) && says(&allowed));
    // A play of 3 mm is none that the model has.
    let loose = "[imperfections.needle]\n[imperfections.guide]\ndiametral_clearance_mm = 3\n";
    let loose = resolve(GOAL, loose).unwrap();
    assert!(!is_in_tissue(&loose) && says(&loose));
    assert_eq!(loose.goals[0].needle_path, None);
    let text = "name = \"x\"\n[robot]\n[[goals]]\nname = \"g\"\nflange_pose = { position_mm = [-300, -100, 300], \
                rotation_vector_rad = [0, 3, 0] }\ninsertion_length_mm = 100\n";
    let free =
        resolve_scenario("x.toml", text, Path::new(""), &Overrides::default()).expect("no patient");
    assert!(!is_in_tissue(&free) && !says(&free));
}

#[test]
fn what_no_needle_does_is_refused_with_its_key() {
    for (more, key, says) in [
        (
            "model = \"cantilever\"\nbevel = \"3:00\"\n",
            "bevel",
            "no meaning in model `cantilever`",
        ),
        (
            "model = \"cantilever\"\nturn_at_mm = 20\n",
            "turn_at_mm",
            "no meaning in model `cantilever`",
        ),
        (
            "model = \"cantilever\"\nforces.living = 0.5\n",
            "forces",
            "no meaning in model `cantilever`",
        ),
        (
            "side_force_n = 0.1\nbevel = \"3:00\"\n",
            "bevel",
            "no meaning in model `cantilever`",
        ),
        (
            "model = \"tissue\"\nside_force_n = 0.1\n",
            "side_force_n",
            "no meaning in model `tissue`",
        ),
        (
            "model = \"tissue\"\ntip = \"symmetric\"\nbevel = \"left\"\n",
            "bevel",
            "needs a tip that bends to one side",
        ),
        (
            "model = \"tissue\"\nturn_at_mm = 400\n",
            "turn_at_mm",
            "is turned at 400 mm, but ends",
        ),
        (
            "model = \"tissue\"\nbevel = \"spin\"\n",
            "bevel",
            "neither a direction nor a structure",
        ),
        (
            "model = \"tissue\"\nbevel = \"13:00\"\n",
            "bevel",
            "neither a direction nor a structure",
        ),
        (
            "model = \"tissue\"\nbevel = \"left\"\n",
            "bevel",
            "runs along `left`",
        ),
        (
            "model = \"tissue\"\nbore_mm = 2\n",
            "bore_mm",
            "not smaller than the needle",
        ),
        (
            "model = \"tissue\"\nmeasured.file = \"nowhere.toml\"\n",
            "measured.file",
            "cannot read",
        ),
        (
            "model = \"tissue\"\nforces.wall_n = 0.1\nmeasured.file = \"nowhere.toml\"\n",
            "forces.wall_n",
            "contradicts `measured`",
        ),
    ] {
        for place in ["expected.needle", "imperfections.needle"] {
            let finding = refused(GOAL, &format!("[{place}]\n{more}"));
            assert_eq!(finding.key, Some(format!("{place}.{key}")), "{finding:#?}");
            assert!(finding.message.contains(says), "{finding:#?}");
        }
    }
    let spine = refused(
        GOAL,
        "[imperfections.needle]\nmodel = \"tissue\"\nbevel = \"spin\"\n",
    );
    assert!(spine.hint.unwrap().contains("`spine`"));
    let both = "[expected.needle]\nmodel = \"tissue\"\n[imperfections.needle]\n";
    assert_eq!(refused(GOAL, both).key.as_deref(), Some("expected.needle"));
}

#[test]
fn a_needle_through_bone_or_without_a_patient_is_refused() {
    let block = "[expected.needle]\nmodel = \"tissue\"\n";
    // From the back through the spine or a rib.
    let through = "lesion = \"pleural_based\"\nentry_direction_deg = [100, 0]";
    let finding = refused(through, block);
    assert!(finding.message.contains("meets `"), "{finding:#?}");
    let text = format!(
        "name = \"x\"\n[robot]\n[[goals]]\nname = \"g\"\nflange_pose = {{ position_mm = [-300, -100, 300], \
         rotation_vector_rad = [0, 3, 0] }}\ninsertion_length_mm = 100\n{block}"
    );
    let findings = resolve_scenario("x.toml", &text, Path::new(""), &Overrides::default());
    let findings = findings.expect_err("no patient");
    assert!(
        findings
            .iter()
            .any(|each| each.message.contains("no patient whose tissue")),
        "{findings:#?}"
    );
}

#[test]
fn a_measured_force_is_read_with_its_interval() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("force.toml");
    let write = |text: &str| std::fs::write(&file, text).unwrap();
    let block = format!(
        "[expected.needle]\nmodel = \"tissue\"\nmeasured.file = \"{}\"\n",
        file.display().to_string().replace('\\', "/")
    );
    write("tip_force_n = 0.06\ninterval_95_n = [0.05, 0.072]\nbends = 8\nheld = \"hub\"\n");
    let resolved = resolve(GOAL, &block).unwrap();
    let expected = resolved.expected.unwrap().imperfections;
    let needle = expected.tissue().unwrap();
    assert!(needle.is_force_measured && needle.wall_force_n.median == 0.06);
    // Ends of a lognormal's interval: 1.96 standard deviations to either side.
    let spread = libm::pow(0.072 / 0.05, 1.0 / (2.0 * 1.959_963_984_540_054));
    assert!((needle.wall_force_n.spread / spread - 1.0).abs() < 1e-12);
    let name = file.display().to_string();
    assert!(expected.sources.iter().any(|source| source.file == name));
    write("tip_force_n = 0.06\ninterval_95_n = [-0.01, 0.12]\n");
    let findings = resolve(GOAL, &block).expect_err("it reaches 0");
    assert_eq!(
        findings[0].key.as_deref(),
        Some("interval_95_n"),
        "{findings:#?}"
    );
}
