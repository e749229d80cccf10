//! A needle in tissue: what it passes, and what is refused.

use std::path::Path;

use nalgebra::Vector3;
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
            "model = \"cantilever\"\nturn_at = \"best\"\n",
            "turn_at",
            "no meaning in model `cantilever`",
        ),
        (
            "turn_at = \"best\"\nturn_at_mm = 20\n",
            "turn_at",
            "contradicts `turn_at_mm`",
        ),
        (
            "tip = \"rolled\"\nturn_at = \"best\"\n",
            "turn_at",
            "needs a tip that bends to one side",
        ),
        ("aim = true\n", "aim", "is known to bend to one side"),
        (
            "aim = true\ntip = \"symmetric\"\n",
            "aim",
            "is known to bend to one side",
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

/// The tip of the needle that is bent by its mean comes to the target, along an axis through the same entry point.
#[test]
fn a_needle_is_aimed_against_its_mean_bend() {
    let block = "[expected.needle]\nbevel = \"posterior\"\nforces.wall_n = 0.3\n";
    let straight = resolve(GOAL, block).unwrap();
    let straight = &straight.goals[0];
    assert_eq!(straight.aim_m.norm(), 0.0);
    for turn in ["", "turn_at_mm = 60\n"] {
        let resolved = resolve(GOAL, &format!("{block}aim = true\n{turn}")).unwrap();
        let goal = &resolved.goals[0];
        let expected = resolved.expected.as_ref().unwrap();
        let needle = expected.imperfections.tissue().unwrap();
        let path = goal.needle_path.as_ref().unwrap();
        let [x, y] = needle.pushed_towards(path).unwrap();
        let towards = goal.world_from_guide_exit.rotation * Vector3::new(x, y, 0.0);
        assert!(towards.dot(&goal.axis).abs() < 1e-12);
        let entry = goal.entry_m.unwrap();
        assert!((entry - straight.entry_m.unwrap()).norm() < 1e-12);
        let exit = goal.world_from_guide_exit.translation.vector;
        let axis = goal.axis.into_inner();
        assert!((exit + axis * goal.standoff_m.unwrap() - entry.coords).norm() < 1e-12);
        let tip = exit + axis * goal.insertion_length_m;
        assert!((tip - goal.aimed_m().coords).norm() < 1e-12);
        let bend_m = -goal.aim_m.dot(&towards);
        assert!((tip + towards * bend_m - goal.target_m.coords).norm() < 1e-12);
        assert!((tip + towards * bend_m - straight.target_m.coords).norm() < 1e-12);
        // What it is aimed against is that of the way to the target, which is nearly that of the aimed way.
        let mean_m = needle.mean_bend_m(path, goal.standoff_m.unwrap()).unwrap();
        assert!(bend_m.abs() > 5e-4 && (bend_m / mean_m - 1.0).abs() < 0.02);
    }
    let too_deep = format!("{GOAL}\ninsertion_length_mm = 130");
    let finding = refused(
        &too_deep,
        "[expected.needle]\nbevel = \"3:00\"\naim = true\n",
    );
    assert!(
        finding.message.contains("does not end at its target"),
        "{finding:#?}"
    );
}

/// A route may enter the bone that its lesion lies in. No needle is inserted through it: the model has none for it.
#[test]
fn a_needle_that_ends_behind_the_bone_of_its_lesion_bends_as_in_air() {
    let any = resolve(GOAL, "").unwrap();
    let phantom = &any.phantom.as_ref().unwrap().phantom;
    let middle_mm = phantom.middle_of("sternum_body").unwrap().coords * 1e3;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("nodule.obj");
    let corners = "v 4 0 0\nv -4 0 0\nv 0 4 0\nv 0 -4 0\nv 0 0 4\nv 0 0 -4\n";
    let faces = "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";
    std::fs::write(&file, format!("{corners}{faces}")).unwrap();
    let part = format!(
        "[[phantom.parts]]\nname = \"nodule\"\ntissue = \"lesion\"\nfile = \"{}\"\n\
         position_mm = [{}, {}, {}]\n",
        file.display().to_string().replace('\\', "/"),
        middle_mm.x,
        middle_mm.y,
        middle_mm.z
    );
    let within = "lesion = \"nodule\"\nentry_direction_deg = [0, 0]";
    let resolved = resolve(within, &part).unwrap();
    let length_mm = resolved.goals[0].insertion_length_m * 1e3;
    let behind = format!("{within}\ninsertion_length_mm = {}", length_mm + 25.0);
    let resolved = resolve(&behind, &part).unwrap();
    assert_eq!(resolved.goals[0].needle_path, None);
    let expected = resolved.expected.as_ref().unwrap();
    assert!(expected.imperfections.tissue().is_none());
    let mut notes = resolved.notes.iter();
    assert!(
        notes.any(|note| note.contains("needles bend as in air")),
        "{:?}",
        resolved.notes
    );
    let block = format!("{part}[expected.needle]\nmodel = \"tissue\"\n");
    let finding = refused(&behind, &block);
    assert!(finding.message.contains("meets `"), "{finding:#?}");
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
