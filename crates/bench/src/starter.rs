//! A first scenario: small, commented, and one that passes.
//!
//! The cell comes from a template and the arm's usual place in it; entry, and place where the usual one does not serve,
//! come from [`suggest`](crate::suggest). What does not pass what `check` asks is not given.

use std::path::Path;

use needlebench_cell::part_in_words;
use needlebench_input::Finding;
use needlebench_parallel::Control;
use needlebench_patient::SuggestError;
use needlebench_scenario::{
    Overrides, ResolvedScenario, ScenarioFamily, resolve_open_scenario, resolve_scenario,
};

use crate::Runnable;
use crate::preview::Preview;
use crate::suggest::{Entry, Place, suggest_entries, suggest_places};

/// What a first scenario begins from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Template {
    /// Beside the CT table, the patient on the back.
    Table,
    /// From the ceiling, the patient on the back.
    Hanging,
    /// Behind a patient on her left side.
    Lateral,
}

impl Template {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Table, Self::Hanging, Self::Lateral];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Hanging => "hanging",
            Self::Lateral => "lateral",
        }
    }

    /// What it is, for people.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Table => "robot on a column beside the CT table, patient supine",
            Self::Hanging => "robot mounted on the ceiling, patient supine",
            Self::Lateral => "robot on a column behind a patient in left lateral position",
        }
    }

    /// The default lesion: one that is feasible from this base placement.
    pub fn lesion(self) -> &'static str {
        match self {
            Self::Table | Self::Lateral => "pleural_based",
            Self::Hanging => "right_upper_lobe",
        }
    }

    fn posture(self) -> &'static str {
        match self {
            Self::Table | Self::Hanging => "supine",
            Self::Lateral => "left-lateral",
        }
    }

    /// Position and yaw of the base, mm and deg, as in shipped scenarios with a UR3.
    fn place(self) -> ([f64; 3], [f64; 3]) {
        match self {
            Self::Table => ([-280.0, 350.0, 1050.0], [0.0, 0.0, 270.0]),
            Self::Hanging => ([-60.0, 330.0, 1560.0], [180.0, 0.0, 90.0]),
            Self::Lateral => ([-200.0, 400.0, 1050.0], [0.0, 0.0, 270.0]),
        }
    }
}

/// The request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StarterOptions {
    /// Name of the scenario, and of its file without `.toml`.
    pub name: String,
    /// What it begins from.
    pub template: Template,
    /// Name of a shipped arm.
    pub arm: String,
    /// Name of a shipped phantom.
    pub phantom: String,
    /// Name of one of its lesions.
    pub lesion: String,
}

/// A first scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Starter {
    /// Its text.
    pub text: String,
    /// Its entry.
    pub entry: Entry,
    /// Its place, if the template's default is infeasible.
    pub place: Option<Place>,
}

/// Makes a first scenario. Its file is `file`, in messages.
///
/// # Errors
/// Why there is none with these options.
pub fn starter(
    file: &str,
    options: &StarterOptions,
    overrides: &Overrides,
    control: &Control<'_>,
) -> Result<Starter, SuggestError> {
    let usual = options.template.place();
    let draft = |(position, rpy): ([f64; 3], [f64; 3])| text(options, position, rpy, None);
    let mut at = usual;
    let mut place = None;
    let (mut resolved, mut entry) = entry_at(file, &draft(at), overrides, control)?;
    if entry.is_err() {
        let found = place_for(resolved, entry, overrides, control)?;
        at = (found.position_mm, found.rpy_deg);
        place = Some(found);
        (resolved, entry) = entry_at(file, &draft(at), overrides, control)?;
    }
    let mut entry = entry.map_err(|(why, _)| SuggestError::refused(why, OTHERS))?;
    let mut text = text(options, at.0, at.1, Some(&entry));
    // The final posture may be feasible where the start posture is not.
    if let Err(error) = passes(file, &text, overrides) {
        if place.is_some() {
            return Err(error);
        }
        let best = Some(entry.direction_deg);
        let found = place_for(resolved, Err((error.to_string(), best)), overrides, control)?;
        at = (found.position_mm, found.rpy_deg);
        place = Some(found);
        entry = entry_at(file, &draft(at), overrides, control)?
            .1
            .map_err(|(why, _)| SuggestError::refused(why, OTHERS))?;
        text = self::text(options, at.0, at.1, Some(&entry));
        passes(file, &text, overrides)?;
    }
    Ok(Starter { text, entry, place })
}

/// Whether a scenario's text passes all that `check` asks.
fn passes(file: &str, text: &str, overrides: &Overrides) -> Result<(), SuggestError> {
    let one = |findings: Vec<Finding>| {
        let first = findings.into_iter().next();
        first.map_or(SuggestError::Interrupted, SuggestError::from)
    };
    let resolved = resolve_scenario(file, text, Path::new(""), overrides).map_err(one)?;
    let runnable = Runnable::checked(resolved).map_err(|finding| one(vec![finding]))?;
    let (_, findings) = Preview::of(runnable.scenario())
        .map_err(|error| SuggestError::refused(error.to_string(), OTHERS))?;
    if findings.is_empty() {
        Ok(())
    } else {
        Err(one(findings))
    }
}

/// What to do where no configuration is feasible.
const OTHERS: &str =
    "choose another --lesion, --from or --arm; `needlebench init --list` shows what there is";

/// The first entry in a draft's cell, or why there is none and the direction with the best route.
type FoundEntry = Result<Entry, (String, Option<[f64; 2]>)>;

fn entry_at(
    file: &str,
    draft: &str,
    overrides: &Overrides,
    control: &Control<'_>,
) -> Result<(ResolvedScenario, FoundEntry), SuggestError> {
    let open =
        resolve_open_scenario(file, draft, Path::new(""), overrides).map_err(|findings| {
            let first = findings.into_iter().next();
            first.map_or(SuggestError::Interrupted, SuggestError::from)
        })?;
    let found = suggest_entries(&open.resolved, &open.goals[0], 1, control)?;
    let why = found.why_none();
    let best = found.best_route_deg;
    let mut resolved = open.resolved;
    resolved.scenario.goals = open.goals;
    let entry = found.entries.into_iter().next();
    Ok((resolved, entry.ok_or((why, best))))
}

/// A placement from which the goal's best path is feasible.
fn place_for(
    mut resolved: ResolvedScenario,
    entry: FoundEntry,
    overrides: &Overrides,
    control: &Control<'_>,
) -> Result<Place, SuggestError> {
    let Err((why, best)) = entry else {
        unreachable!("asked only where there is no entry");
    };
    let Some(direction_deg) = best else {
        return Err(SuggestError::refused(why, OTHERS));
    };
    let goal = &mut resolved.scenario.goals[0];
    goal.entry_direction_deg = Some(direction_deg);
    let goals = vec![goal.name.clone()];
    let family = ScenarioFamily::of(resolved, Path::new(""), overrides);
    let family = family.map_err(|findings| {
        let first = findings.into_iter().next();
        first.map_or(SuggestError::Interrupted, SuggestError::from)
    })?;
    let found = suggest_places(&family, &goals, 1, control)?;
    let why = found.why_none();
    let first = found.places.into_iter().next();
    first.ok_or_else(|| SuggestError::refused(why, OTHERS))
}

/// The scenario's text; without an entry it is a draft.
fn text(
    options: &StarterOptions,
    position_mm: [f64; 3],
    rpy_deg: [f64; 3],
    entry: Option<&Entry>,
) -> String {
    let StarterOptions {
        name,
        template,
        arm,
        phantom,
        lesion,
    } = options;
    let listed = |numbers: [f64; 3]| {
        let [x, y, z] = numbers;
        format!("[{x}, {y}, {z}]")
    };
    let mount = match template {
        Template::Table | Template::Lateral => {
            "[mount]\nkind = \"column\" # on the floor, under the base; or wedge, table_rail, wall, ceiling\n"
        }
        Template::Hanging => {
            "[mount]\nkind = \"ceiling\" # or column, wedge, table_rail, wall\nceiling_height_mm = 2700 # over the floor\n\n\
             # Start posture of every motion: folded under the base. Shoulder pan to wrist 3.\n[start]\njoints_deg = [0, -20, \
             -140, -20, 90, 0]\n"
        }
    };
    let looks = match template {
        Template::Table => "270: the robot faces the patient from the right",
        Template::Hanging => "180 first: mounted upside down",
        Template::Lateral => "270: the robot faces the patient's back",
    };
    let right = match template {
        Template::Table | Template::Hanging => "y towards the patient's right",
        Template::Lateral => "y towards the patient's back",
    };
    let (top_mm, cushion) = match template {
        Template::Table | Template::Hanging => (780, ""),
        Template::Lateral => (
            750,
            "position_mm = [0, 0, 20] # mid-chest in the world; the third: a cushion on the table\n",
        ),
    };
    let goal = entry.map_or(String::new(), |entry| {
        let margins = entry.margins.iter();
        let margins = margins.map(|each| {
            let (distance_mm, part) = (each.distance_m * 1e3, part_in_words(&each.part));
            format!("\n# {distance_mm:.1} mm to {part} ({})", each.tissue)
        });
        let margins = margins.collect::<Vec<_>>().concat();
        let [azimuth, elevation] = entry.direction_deg;
        format!(
            "# Where the needle enters, as seen from the target: azimuth (0 front, 90 patient's left, -90 right) and\n\
             # elevation (90 towards the head), deg. Here the needle path is {:.0} mm deep and has clearances of{margins}\n\
             # `needlebench suggest {name}.toml` proposes others; a point is `entry_mm = [left, posterior, superior]`.\n\
             entry_direction_deg = [{azimuth}, {elevation}]\n",
            entry.depth_m * 1e3
        )
    });
    format!(
        r#"#:schema ./scenario.schema.json
# {about}. `needlebench run {name}.toml` reports the feasible arm
# configurations, the tip error and all clearances.
#
# Change first: the patient and the lesion ([phantom], [[goals]]), then the base placement ([robot]); after each change
# `needlebench check {name}.toml` lists the feasible configurations within seconds. Omitted keys have defaults;
# scenario.schema.json describes all keys, and editors that support the line at the top show them.
#
# Lengths are in mm, angles in deg, as the keys state. World frame: x towards the patient's head,
# {right}, z up from the floor. Points of the patient: from mid-chest, x to the patient's
# left, y to the back, z to the head.
name = "{name}"
description = "A first scenario: {about_small}."
seed = 1 # seed of all random numbers: the same seed gives the same results

[robot]
urdf = "{arm}" # a UR arm, `needlebench init --list` lists all; or the path of a URDF
base_position_mm = {position} # of its base_link in the world
base_rpy_deg = {rpy} # roll, pitch, yaw; {looks}

{mount}
[tool]
urdf = "perpendicular" # guide axis perpendicular to the wrist; or offset, inline, or the path of a URDF
needle_length_mm = 200 # hub to tip: guide (50), stand-off and depth must fit

[phantom]
model = "{phantom}" # size of the patient: `needlebench init --list` lists all
posture = "{posture}" # or supine, prone, left-lateral, right-lateral
{cushion}arms = "overhead" # or beside, none
head = true # include the head as an obstacle

[table]
center_mm = [-300, 0] # centre of its upper face, which supports legs and head
top_height_mm = {top_mm} # of the upper face over the floor

# One [[goals]] for each needle.
[[goals]]
name = "{lesion}"
lesion = "{lesion}" # its centre is the target; a point is `target_mm = [left, posterior, superior]`
{goal}standoff_mm = 15 # from the guide's exit to the skin

# Postures and motions with a smaller clearance or self-clearance are rejected.
[planning]
min_clearance_mm = 5
min_self_clearance_mm = 5

# Limits for every feasible configuration.
[criteria]
max_tip_position_error_mm = 0.1 # simulated, of the nominal arm
max_peak_torque_ratio = 1.0 # relative to the joints' limits
min_working_configurations = 1 # feasible, of eight
"#,
        about = capitalised(template.in_words()),
        about_small = template.in_words(),
        position = listed(position_mm),
        rpy = listed(rpy_deg),
        posture = template.posture(),
    )
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// A small study of a scenario with goals: how much the patient's place may be off.
pub fn starter_study(scenario: &str) -> String {
    format!(
        r#"#:schema ./study.schema.json
# How much may the patient be displaced? `needlebench study {scenario}_study.toml` evaluates {scenario}.toml with the
# patient moved and rotated, and reports in how many of these layouts each configuration is feasible.
name = "{scenario}_study"
scenario = "{scenario}.toml"
seed = 1
mode = "static" # final postures; planned: motions too; dynamic: in the engines
replanned_cases = 8 # layouts that are also planned, to measure how much postures alone overestimate

[sampling]
method = "sobol"
samples = 32 # layouts of each goal

[[factors]]
name = "along"
key = "phantom.position_mm[0]" # any key of the scenario
range = [-30, 30]
relative = true # added to the scenario's value

[[factors]]
name = "across"
key = "phantom.position_mm[1]"
range = [-20, 20]
relative = true

[[factors]]
name = "yaw"
key = "phantom.head_yaw_deg"
range = [-5, 5]
relative = true
"#
    )
}
