//! Scenario files that are refused: each message names file, line, key and value, and hints.

use crate::support::{Bench, Finding, SMALL, with_edit};

/// The goal of `SMALL` by flange pose.
const FLANGE_POSE: &str = "\
insertion_length_mm = 86
approach_mm = 20
[goals.flange_pose]
position_mm = [194.2, -359.3, 170.1]
rotation_vector_rad = [-0.8567, 2.7197, -1.1407]
";

/// Straight down into the front of the chest: the skin is at -106.8 mm.
const ENTRY_AND_TARGET: &str = "\
entry_mm = [0, -106, 0]
target_mm = [0, -60, 0]
";

#[track_caller]
fn refused(text: &str) -> Finding {
    let bench = Bench::with_scenario(text);
    let answer = bench.run(&["check", "s.toml", "--json"]).exits_with(2);
    Finding::only(&answer, text).in_file("s.toml")
}

#[track_caller]
fn refused_with(from: &str, to: &str) -> Finding {
    refused(&with_edit(SMALL, from, to))
}

/// `SMALL` with another goal.
#[track_caller]
fn refused_goal(goal: &str) -> Finding {
    refused_with(FLANGE_POSE, goal)
}

#[track_caller]
fn refused_goal_with(from: &str, to: &str) -> Finding {
    refused_goal(&with_edit(ENTRY_AND_TARGET, from, to))
}

#[test]
fn goal_by_entry_and_target_is_sound_before_it_is_spoilt() {
    let bench = Bench::with_scenario(&with_edit(SMALL, FLANGE_POSE, ENTRY_AND_TARGET));
    let answer = bench.run(&["check", "s.toml", "--json"]).exits_with(2);
    // All that is wrong with it is where it aims from there: it can be read, and a run rejects it.
    let answer = answer.json();
    let messages: Vec<&str> = answer["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|each| each["message"].as_str().unwrap())
        .collect();
    assert!(
        messages[0].contains("out of reach")
            && messages[1].contains("deep through body of the sternum"),
        "{messages:?}"
    );
    assert_eq!(messages.len(), 2, "{messages:?}");
    let run = ["run", "s.toml", "--engine", "rapier"];
    bench.run(&run).exits_with(1);
}

#[test]
fn unknown_key_is_refused_with_the_one_that_was_meant() {
    refused_with("hold_s = 0.1", "hold_ss = 0.1")
        .at("hold_ss")
        .key("motion.hold_ss")
        .says("unknown key `hold_ss`")
        .hints("did you mean `hold_s`?");
}

#[test]
fn unknown_section_is_refused_with_the_one_that_was_meant() {
    refused_with("[motion]", "[motoin]")
        .at("[motoin]")
        .key("motoin")
        .hints("did you mean `motion`?");
}

#[test]
fn key_in_another_unit_is_refused_with_the_right_unit() {
    refused_with("approach_mm = 20", "standoff_m = 0.01")
        .at("standoff_m ")
        .key("goals[0].standoff_m")
        .says("unknown key `standoff_m`")
        .hints("did you mean `standoff_mm`? The key says the unit");
}

#[test]
fn text_where_a_number_belongs_is_refused_with_the_unit() {
    refused_with("approach_mm = 20", "approach_mm = \"20 mm\"")
        .at("approach_mm")
        .key("goals[0].approach_mm")
        .says("\"20 mm\"")
        .says("expected a number")
        .hints("give a plain number, in millimetres");
}

#[test]
fn vector_of_the_wrong_length_is_refused() {
    refused_with("[194.2, -359.3, 170.1]", "[194.2, -359.3]")
        .at("position_mm = [194.2")
        .key("goals[0].flange_pose.position_mm")
        .says("length 2")
        .says("[194.2, -359.3]");
}

#[test]
fn missing_key_is_named_with_its_table() {
    refused_with("position_mm = [194.2, -359.3, 170.1]\n", "")
        .at("[goals.flange_pose]")
        .key("goals[0].flange_pose.position_mm")
        .says("the key `position_mm` is missing");
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    for (number, shown) in [("nan", "nan"), ("-inf", "-inf"), ("1e400", "1e400")] {
        refused_with("hold_s = 0.1", &format!("hold_s = {number}"))
            .at("hold_s")
            .key("motion.hold_s")
            .says(shown)
            .says("not a finite number")
            .hints("finite");
    }
    refused_with("center_mm = [300, -598]", "center_mm = [300, inf]")
        .at("center_mm")
        .key("table.center_mm[1]")
        .says("inf");
}

#[test]
fn value_outside_its_range_is_refused_with_range_and_unit() {
    refused_with("hold_s = 0.1", "hold_s = 900")
        .at("hold_s")
        .key("motion.hold_s")
        .says("900 s, outside 0.1 to 60")
        .hints("in s");
    refused_with("top_height_mm = 763.5", "length_mm = 2.0")
        .key("table.length_mm")
        .at("length_mm = 2.0")
        .says("`table.length_mm` is 2 mm, outside 300 to 5000")
        .hints("millimetres");
    refused_with("[phantom]", "[phantom]\nbreadth_mm = 0.3")
        .key("phantom.breadth_mm")
        .at("breadth_mm")
        .says("`phantom.breadth_mm` is 0.3 mm, outside 150 to 600")
        .hints("millimetres");
    refused_with("[recording]", "[engines]\nfriction = -1\n[recording]")
        .at("friction")
        .key("engines.friction")
        .says("is -1, outside 0 to 10")
        .hints("without a unit");
}

#[test]
fn file_that_is_not_toml_is_refused_at_its_line() {
    refused_with("hold_s = 0.1", "hold_s = ").at("hold_s");
    refused_with("hold_s = 0.1", "hold_s = 0.1\nhold_s = 0.2").says("duplicate key `hold_s`");
}

#[test]
fn target_outside_the_phantom_is_refused_with_its_distance() {
    refused_goal_with("[0, -60, 0]", "[0, -200, 0]")
        .at("target_mm")
        .key("goals[0].target_mm")
        .says("93.0 mm outside the phantom")
        .hints("phantom frame");
}

#[test]
fn entry_off_the_skin_is_refused_with_the_point_on_it() {
    refused_goal_with("[0, -106, 0]", "[0, -220, 0]")
        .at("entry_mm")
        .key("goals[0].entry_mm")
        .says("113.2 mm before the skin")
        .hints("meets the skin at [0.0, -106.8, 0.0]");
}

#[test]
fn entry_equal_to_target_is_refused() {
    refused_goal_with("[0, -60, 0]", "[0, -106, 0]")
        .at("entry_mm")
        .key("goals[0].entry_mm")
        .says("same point")
        .hints("from entry to target");
}

#[test]
fn goal_inside_the_table_is_refused() {
    // Without `rest_on_table` the phantom may be pushed into the table by mistake.
    let sunk = with_edit(
        SMALL,
        "position_mm = [155.0, -609.5, 0]",
        "position_mm = [155.0, -609.5, 660]\nrest_on_table = false",
    );
    let text = with_edit(&sunk, FLANGE_POSE, ENTRY_AND_TARGET);
    refused(&text)
        .at("position_mm")
        .key("phantom.position_mm")
        .says("deep in the table")
        .hints("rest_on_table");
    // The same by flange pose, where the target is where the needle ends.
    let start = SMALL.find("[phantom]").unwrap();
    let end = SMALL.find("[table]").unwrap();
    let without_phantom = SMALL.replace(&SMALL[start..end], "");
    let text = with_edit(
        &without_phantom,
        "top_height_mm = 763.5",
        "top_height_mm = 920",
    );
    refused(&text)
        .at("[goals.flange_pose]")
        .key("goals[0].flange_pose")
        .says("the target lies inside the table");
}

#[test]
fn flange_pose_that_points_past_the_phantom_is_refused() {
    // The paper's pose in metres.
    refused_with("[194.2, -359.3, 170.1]", "[0.1942, -0.3593, 0.1701]")
        .at("[goals.flange_pose]")
        .key("goals[0].flange_pose")
        .says("misses the phantom");
}

#[test]
fn goal_that_contradicts_itself_is_refused() {
    refused_goal("entry_mm = [0, -106, 0]\n")
        .at("[[goals]]")
        .key("goals[0].target_mm")
        .says("neither `target_mm` nor `lesion`");
    refused_goal_with(
        "[0, -60, 0]\n",
        "[0, -60, 0]\nlesion = \"left_perihilar\"\n",
    )
    .at("lesion")
    .key("goals[0].lesion")
    .says("contradicts `target_mm`");
    refused_with("approach_mm = 20", "entry_mm = [0, -106, 0]")
        .at("entry_mm")
        .key("goals[0].entry_mm")
        .says("contradicts `flange_pose`");
}

#[test]
fn unknown_lesion_is_refused_with_the_one_that_was_meant() {
    refused_goal("entry_mm = [0, -106, 0]\nlesion = \"left_perihilum\"\n")
        .at("lesion")
        .key("goals[0].lesion")
        .says("no lesion `left_perihilum`")
        .hints("did you mean `left_perihilar`?");
}

#[test]
fn two_goals_of_one_name_are_refused() {
    let another = format!("[[goals]]\nname = \"pose\"\n{FLANGE_POSE}[motion]");
    refused_with("[motion]", &another)
        .key("goals[1].name")
        .says("two goals are named `pose`")
        .hints("each its own name");
}

#[test]
fn scenario_without_goals_is_refused() {
    let goal = format!("[[goals]]\nname = \"pose\"\n{FLANGE_POSE}");
    refused_with(&goal, "")
        .key("goals")
        .says("the key `goals` is missing");
    let text = with_edit(SMALL, &goal, "");
    refused(&with_edit(
        &text,
        "name = \"small\"",
        "name = \"small\"\ngoals = []",
    ))
    .at("goals")
    .key("goals")
    .says("no goal")
    .hints("[[goals]]");
}

#[test]
fn name_that_is_no_file_name_is_refused() {
    refused_with("name = \"small\"", "name = \"../small\"")
        .at("name")
        .key("name")
        .says("`../small`")
        .hints("letters, digits");
}

#[test]
fn needle_that_is_too_short_is_refused_with_both_lengths() {
    let short = "mount_rotation_deg = 90\nneedle_length_mm = 100";
    refused_with("mount_rotation_deg = 90", short)
        .at("insertion_length_mm")
        .key("goals[0].insertion_length_mm")
        .says("100.0 mm long, but guide and insertion need 136.0 mm")
        .hints("needle_length_mm");
}

#[test]
fn needle_that_does_not_pass_the_bore_is_refused_at_the_given_value() {
    refused_with("mount_rotation_deg = 90", "bore_mm = 1.0")
        .at("bore_mm")
        .key("tool.bore_mm")
        .says("1.270 mm does not pass a bore of 1.000 mm");
    refused_with("mount_rotation_deg = 90", "needle_gauge = 14")
        .at("needle_gauge")
        .key("tool.needle_gauge")
        .says("2.108 mm does not pass");
    refused_with("mount_rotation_deg = 90", "needle_gauge = 24")
        .at("needle_gauge")
        .says("24 gauge")
        .hints("14 to 23");
}

#[test]
fn unknown_tool_is_refused_with_the_shipped_ones() {
    refused_with("[tool]", "[tool]\nurdf = \"ofset\"")
        .at("urdf")
        .key("tool.urdf")
        .says("ofset")
        .hints("did you mean `offset`? Shipped: inline, offset, perpendicular");
}

#[test]
fn unknown_robot_is_refused_with_the_shipped_ones() {
    refused_with("[robot]", "[robot]\nurdf = \"ur3-e\"")
        .at("urdf")
        .key("robot.urdf")
        .says("ur3-e")
        .hints("did you mean `ur3e`? Shipped: ur3, ur3e, ur5e");
}

#[test]
fn unknown_phantom_is_refused_with_the_shipped_ones() {
    refused_with("[phantom]", "[phantom]\nmodel = \"male-p51\"")
        .at("model")
        .key("phantom.model")
        .says("male-p51")
        .hints("did you mean `male-p5");
    refused_with("[phantom]", "[phantom]\nmodel = \"x\"")
        .hints("female-p5, female-p5-supine, female-p50, female-p50-supine, female-p95,")
        .hints("male-p50-supine, male-p95, male-p95-supine");
}

#[test]
fn unknown_posture_is_refused_with_the_one_that_was_meant() {
    refused_with("[phantom]", "[phantom]\nposture = \"suppine\"")
        .at("posture")
        .key("phantom.posture")
        .says("`suppine`")
        .hints("did you mean `supine`?");
}

#[test]
fn unknown_engine_is_refused_with_the_known_ones() {
    refused_with("[recording]", "[engines]\nrun = [\"bullet\"]\n[recording]")
        .at("run")
        .key("engines.run[0]")
        .says("`bullet`")
        .hints("one of rapier, mujoco");
    refused_with("[recording]", "[engines]\nrun = [\"mujco\"]\n[recording]")
        .hints("did you mean `mujoco`?");
    refused_with("[recording]", "[engines]\nrun = []\n[recording]")
        .key("engines.run")
        .hints("rapier");
}

#[test]
fn unknown_configuration_or_outcome_is_refused() {
    let expected = |line: &str| format!("[goals.expected]\n{line}\n[motion]");
    refused_with("[motion]", &expected("Right-Down-Fild = \"ok\""))
        .at("Right-Down-Fild")
        .key("goals[0].expected.Right-Down-Fild")
        .says("`Right-Down-Fild`")
        .hints("did you mean `Right-Down-Fold`?");
    refused_with("[motion]", &expected("every = \"colision\""))
        .at("every")
        .key("goals[0].expected.every")
        .says("`colision` is not a value that `goals[0].expected.every` can have")
        .hints("collision");
}

#[test]
fn start_outside_the_joint_limits_is_refused() {
    refused_with(
        "[motion]",
        "[start]\njoints_deg = [0, -90, 400, 0, 0, 0]\n[motion]",
    )
    .at("joints_deg")
    .key("start.joints_deg[2]")
    .says("elbow starts at 400.0 deg, outside -180.0 to 180.0 deg");
}

#[test]
fn file_that_cannot_be_read_is_refused_by_name() {
    let bench = Bench::new();
    let answer = bench.run(&["check", "none.toml"]).exits_with(2);
    answer.complains(["cannot read the scenario", "none.toml", "hint: "]);
    // A folder cannot be read, whoever asks.
    let answer = bench.run(&["run", "."]).exits_with(2);
    answer.complains(["this is a folder, not a scenario", "hint: "]);
}

#[test]
fn file_that_is_not_utf_8_is_refused_by_name() {
    let bench = Bench::new();
    bench.write("latin.toml", b"name = \"sm\xe4ll\"\n");
    let answer = bench.run(&["check", "latin.toml"]).exits_with(2);
    answer.complains(["UTF-8", "latin.toml", "hint: save the file as UTF-8 text"]);
}
