//! What a short scenario leaves out and cannot do without: assumed where there is a usual choice, and said.
//!
//! Nothing is assumed where a scenario without it has a meaning of its own: a robot without a patient stands
//! where its arm's data say, and without a table there is none.

use std::path::Path;

use super::library::ModelLibrary;
use super::overrides::Overrides;
use crate::scenario::{
    GoalSection, MountKind, MountSection, PhantomSection, Scenario, TableSection,
};
use needlebench_input::TomlText;
use needlebench_kinematics::{Chain, UrGeometry};

/// Middle of the table from mid-chest, along the patient, mm: head and legs lie on it, as in shipped scenarios.
const TABLE_FROM_CHEST_MM: f64 = -300.0;
/// Yaw of a base that looks at the patient from the right, deg.
const FACING_DEG: f64 = 270.0;
/// The guide that leaves the wrist beside the needle, and a needle for the deepest lesion of the largest chest.
const TOOL: (&str, f64) = ("perpendicular", 200.0);

/// Fills in names, patient, table, the robot's place, mount and tool, and says so in `notes`.
pub(super) fn assume(
    toml: &TomlText<'_>,
    scenario: &mut Scenario,
    base: &Path,
    overrides: &Overrides,
    library: &ModelLibrary,
    notes: &mut Vec<String>,
) {
    name_scenario(toml.file, scenario);
    name_goals(&mut scenario.goals);
    let is_by_points = |goal: &GoalSection| goal.flange_pose.is_none();
    let has_points = scenario.goals.iter().any(is_by_points);
    if scenario.phantom.is_none() && has_points {
        let section = PhantomSection::default();
        notes.push(format!(
            "assumed, since there is no [phantom]: `model = \"{}\"`, supine",
            section.model
        ));
        scenario.phantom = Some(section);
    }
    assume_table(scenario, notes);
    let all_by_points = scenario.goals.iter().all(is_by_points);
    if all_by_points && scenario.iso9283.is_none() && scenario.excitation.is_none() {
        let robot = library.robot(toml, &scenario.robot, base, overrides);
        let beside = robot.ok().and_then(|robot| {
            let arm = robot.description.arm.as_ref();
            let cell = arm.and_then(|used| used.arm.data.cell.as_ref());
            let of_arm = cell.and_then(|cell| cell.beside_patient_mm);
            of_arm.or_else(|| beside_by_reach_mm(&robot.robot.chain))
        });
        if let Some(beside_mm) = beside {
            assume_place(scenario, beside_mm, notes);
            assume_tool(toml, scenario, notes);
        }
    }
}

/// Where an arm without data of its own is put: along the patient, out from the table's edge, over its upper face, mm, in
/// whole centimetres. The straight line through the UR3's and the UR5e's `beside_patient_mm`, by what upper arm and
/// forearm reach together. None for a chain that is not a UR arm's.
fn beside_by_reach_mm(chain: &Chain) -> Option<[f64; 3]> {
    const UR3: (f64, [f64; 3]) = (456.9, [-280.0, 140.0, 270.0]);
    const UR5E: (f64, [f64; 3]) = (817.2, [-350.0, 390.0, 120.0]);
    let geometry = UrGeometry::of_chain(chain).ok()?;
    let reach_mm = 1e3 * (geometry.a2.abs() + geometry.a3.abs());
    // Longer arms stand farther out, but not lower or nearer to the feet.
    let share = ((reach_mm - UR3.0) / (UR5E.0 - UR3.0)).max(0.0);
    let along = |axis: usize, share: f64| {
        let mm = (UR5E.1[axis] - UR3.1[axis]).mul_add(share, UR3.1[axis]);
        (mm / 10.0).round() * 10.0
    };
    Some([
        along(0, share.min(1.0)),
        along(1, share),
        along(2, share.min(1.0)),
    ])
}

/// The file's name, if the scenario has none.
fn name_scenario(file: &str, scenario: &mut Scenario) {
    if scenario.name.is_empty() {
        scenario.name = name_from_file(Path::new(file));
    }
}

/// A scenario's name from that of its file, as far as it can be one.
pub fn name_from_file(file: &Path) -> String {
    let stem = file.file_stem().and_then(|stem| stem.to_str());
    let is_of_names = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let name = stem.unwrap_or_default().chars();
    let name: String = name
        .map(|c| if is_of_names(c) { c } else { '_' })
        .take(needlebench_input::schema::LONGEST_NAME)
        .collect();
    if name.is_empty() {
        "scenario".to_owned()
    } else {
        name
    }
}

/// Their lesions' names, or their numbers.
fn name_goals(goals: &mut [GoalSection]) {
    for index in 0..goals.len() {
        if !goals[index].name.is_empty() {
            continue;
        }
        let numbered = format!("goal_{}", index + 1);
        let lesion = goals[index].lesion.clone().unwrap_or_default();
        let is_free =
            |name: &String| !name.is_empty() && goals.iter().all(|goal| goal.name != *name);
        goals[index].name = Some(lesion).filter(is_free).unwrap_or(numbered);
    }
}

/// A table under a patient who is to rest on one.
fn assume_table(scenario: &mut Scenario, notes: &mut Vec<String>) {
    let Some(phantom) = &scenario.phantom else {
        return;
    };
    if !phantom.rest_on_table || scenario.table.is_some() {
        return;
    }
    let (sine, cosine) = libm::sincos(phantom.head_yaw_deg.to_radians());
    let [x, y, _] = phantom.position_mm;
    let along_mm = TABLE_FROM_CHEST_MM;
    let table = TableSection {
        center_mm: [along_mm.mul_add(cosine, x), along_mm.mul_add(sine, y)],
        yaw_deg: phantom.head_yaw_deg,
        ..TableSection::default()
    };
    notes.push(format!(
        "assumed, since the patient rests on a table and there is no [table]: {:.0} mm wide, upper face \
         {:.0} mm above the floor",
        table.width_mm, table.top_height_mm
    ));
    scenario.table = Some(table);
}

/// A robot at the patient's right, where the scenario says nothing of its place. In the middle of the room, its
/// general place, it would stand in the patient.
fn assume_place(
    scenario: &mut Scenario,
    [along_mm, beside_mm, over_mm]: [f64; 3],
    notes: &mut Vec<String>,
) {
    let (Some(phantom), Some(table)) = (&scenario.phantom, &scenario.table) else {
        return;
    };
    let robot = &mut scenario.robot;
    let is_said = robot.base_position_mm.is_some() || robot.base_rpy_deg.is_some();
    let mount = scenario.mount.as_ref();
    let is_carried_otherwise = mount.is_some_and(|mount| mount.kind != MountKind::Column);
    let lies_in_the_middle = phantom.position_mm[..2] == [0.0; 2]
        && phantom.head_yaw_deg == 0.0
        && phantom.rest_on_table
        && table.yaw_deg == 0.0
        && table.center_mm[1] == 0.0;
    if is_said || is_carried_otherwise || !lies_in_the_middle {
        return;
    }
    let place_mm = [
        along_mm,
        0.5 * table.width_mm + beside_mm,
        table.top_height_mm + over_mm,
    ];
    robot.base_position_mm = Some(place_mm);
    robot.base_rpy_deg = Some([0.0, 0.0, FACING_DEG]);
    // In all digits: what is copied from the screen is the same place.
    let [x, y, z] = place_mm;
    let mut what = format!(
        "on the patient's right, `base_position_mm = [{x}, {y}, {z}]` and `base_rpy_deg = \
         [0, 0, {FACING_DEG}]`"
    );
    if scenario.mount.is_none() {
        scenario.mount = Some(MountSection::default());
        what += ", on a column (`[mount]`)";
    }
    notes.push(format!(
        "assumed, since [robot] gives no base placement: {what}"
    ));
}

/// The tool, where the scenario says nothing of it: the same whether the robot's place is assumed or written down.
fn assume_tool(toml: &TomlText<'_>, scenario: &mut Scenario, notes: &mut Vec<String>) {
    if toml.span_of("tool").is_none() {
        let (urdf, length_mm) = TOOL;
        urdf.clone_into(&mut scenario.tool.urdf);
        scenario.tool.needle_length_mm = Some(length_mm);
        notes.push(format!(
            "assumed, since there is no [tool]: the guide `urdf = \"{urdf}\"` with `needle_length_mm = {length_mm}`"
        ));
    }
}
