//! Evaluation of a straight needle path from the skin to a target, while its ends are dragged.
//!
//! Pure functions of a case and an [`Aim`]: [`route`] is answered at once from voxels and surfaces, [`reach`] by the
//! postures of all eight configurations. Lengths in m, angles in rad; places in `ct` (patient LPS).

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_bench::preview::GoalPreview;
use needlebench_cell::{part_in_words, reason_in_words};
use needlebench_input::Finding;
use needlebench_planning::{crossed_fissures, judged_tissues};
use needlebench_routing::body_normal;
use needlebench_scenario::imperfections::bends_along_m;
use needlebench_scenario::scenario::{GoalSection, Target};
use needlebench_scenario::{Goal, PlacedPhantom, ResolvedScenario};
use needlebench_volume::{SurfaceTissue, VoxelGrid, structure_of};
use serde::{Deserialize, Serialize};

use crate::around::Judged;
use crate::case::Case;

/// The target of the needle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TargetAim {
    /// The middle of a lesion of the scenario.
    Lesion(String),
    /// A place in `ct`, m.
    PlaceM([f64; 3]),
    /// An index, which may lie between voxels.
    Index([f64; 3]),
}

/// The entry of the needle: the point where the line from the target through here leaves the skin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum EntryAim {
    /// A place in `ct`, m.
    PlaceM([f64; 3]),
    /// An index, which may lie between voxels.
    Index([f64; 3]),
}

/// A needle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aim {
    /// The goal of the scenario that it is for: the guide's stand-off is that goal's.
    #[serde(default)]
    pub goal: Option<String>,
    /// Its target.
    pub target: TargetAim,
    /// Its entry.
    pub entry: EntryAim,
}

/// The target of a needle, whatever its entry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalAim {
    /// The goal of the scenario that it is for: the guide's stand-off is that goal's.
    #[serde(default)]
    pub goal: Option<String>,
    /// Its target.
    pub target: TargetAim,
}

/// Why there is no answer, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Refusal {
    /// What is wrong.
    pub message: String,
    /// How to fix it.
    pub hint: Option<String>,
}

impl Refusal {
    /// With what to do.
    pub fn new(message: impl Into<String>, hint: &str) -> Self {
        Self {
            message: message.into(),
            hint: Some(hint.to_owned()),
        }
    }
}

impl From<Finding> for Refusal {
    fn from(finding: Finding) -> Self {
        // File and key are those of a text that is not written yet.
        Self {
            message: finding.message,
            hint: finding.hint,
        }
    }
}

/// A needle in the cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Needle {
    /// The goal that it is, or why the robot's guide cannot be put there.
    pub goal: Result<Goal, Refusal>,
    /// The goal as a scenario has it.
    pub section: GoalSection,
    /// Entry on the skin, `ct`.
    pub entry_m: Point3<f64>,
    /// Target, `ct`.
    pub target_m: Point3<f64>,
    /// From the chosen point to the entry, along the needle.
    pub entry_moved_m: f64,
}

/// A stretch of the needle within one label.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Crossing {
    /// What it is called.
    pub name: String,
    /// Where it begins, from the entry.
    pub from_m: f64,
    /// Where it ends.
    pub to_m: f64,
}

/// Clearance of the needle from a tissue, and its margin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TissueAnswer {
    /// Bone, vessel or organ.
    pub tissue: String,
    /// The part.
    pub part: String,
    /// The part in words.
    pub words: String,
    /// Signed distance of the needle's surface.
    pub distance_m: f64,
    /// The required distance.
    pub margin_m: f64,
    /// Whether the margin is satisfied.
    pub kept: bool,
    /// Whether it is the median needle as tissue bends it that comes so near, and not the straight one.
    pub is_bent: bool,
    /// How far 99 % of the part's surface are from that of the voxels at most; none where it is unknown.
    pub surface_p99_m: Option<f64>,
}

/// How tissue bends the median needle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BendAnswer {
    /// Depths from the skin and how far the needle is off the straight line there, m; the last one is its tip's.
    pub path_m: Vec<[f64; 2]>,
    /// How far the tip is off the guide's axis, m.
    pub tip_m: f64,
    /// Whether that axis is aimed against the bend, and not at the target.
    pub is_aimed: bool,
    /// Towards where, a unit vector of `ct`; none where that is not known.
    pub towards: Option<[f64; 3]>,
    /// Whether the force behind it was measured, and not assumed.
    pub is_force_measured: bool,
}

/// What is known of a needle at once.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RouteAnswer {
    /// Entry on the skin.
    pub entry_m: [f64; 3],
    /// The same by index.
    pub entry_index: [f64; 3],
    /// Target.
    pub target_m: [f64; 3],
    /// The same by index.
    pub target_index: [f64; 3],
    /// From the chosen point to the entry, along the needle: positive outwards.
    pub entry_moved_m: f64,
    /// From entry to target.
    pub length_m: f64,
    /// How tissue bends it; none for a needle in air, or one whose way is not known.
    pub bend: Option<BendAnswer>,
    /// From the guide's exit to the needle's tip; none where the guide cannot be put there.
    pub insertion_m: Option<f64>,
    /// Why the guide cannot be placed there; distances from tissues are not evaluated then.
    pub not_placed: Option<Refusal>,
    /// How long the needle is.
    pub needle_m: f64,
    /// Between the needle and the skin's normal, [`body_normal`] of the entry.
    pub skin_angle_rad: f64,
    /// Between the needle and the axial plane; positive where it runs towards the head.
    pub axial_angle_rad: f64,
    /// What it passes, by the label map.
    pub crossings: Vec<Crossing>,
    /// Half a voxel along the needle: how far off the ends of crossings may be.
    pub crossing_within_m: f64,
    /// Within the lungs, with what they enclose; none where the label map knows no lung.
    pub in_lung_m: Option<f64>,
    /// How often it enters a lung.
    pub lung_entries: Option<usize>,
    /// Least distances to bone, vessels and organs with a margin.
    pub tissues: Vec<TissueAnswer>,
    /// Fissures that it crosses.
    pub fissures: Vec<String>,
    /// Result of the path rules; none until they were evaluated for its target.
    pub judged: Option<Judged>,
    /// Why a run rejects it, in words; none where no evaluated rule does.
    pub refusal: Option<String>,
}

/// Which configurations are feasible.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReachAnswer {
    /// Why the robot is not evaluated.
    pub unknown: Option<&'static str>,
    /// Of twelve roll angles only: a configuration that is feasible here is feasible, others may be.
    pub quick: bool,
    /// The configurations.
    pub preview: Option<GoalPreview>,
    /// Why each is infeasible, in words, in their order; empty where it is feasible.
    pub reasons: Vec<String>,
}

/// Rejects requests on a robot whose position is unknown.
///
/// # Errors
/// Why it is unknown.
pub(crate) fn registered(case: &Case) -> Result<(), Refusal> {
    match case.built().not_registered() {
        Some(unknown) => Err(Refusal::new(
            unknown,
            "planning on the slices is possible without it",
        )),
        None => Ok(()),
    }
}

/// Lays a needle into the cell.
///
/// # Errors
/// A target outside the patient; an entry from which no line runs to it.
pub fn needle(case: &Case, aim: &Aim) -> Result<Needle, Refusal> {
    let grid = case.grid();
    let mut section = aim.goal_aim().section(case)?;
    let placer = case.desk().placer();
    let target = placer.target(&section).map_err(outside)?;
    let towards = case.in_phantom(&match &aim.entry {
        EntryAim::PlaceM(place) => finite(place)?,
        EntryAim::Index(index) => grid.ct_from_index(&finite(index)?),
    });
    let outwards = UnitVector3::try_new(towards - target, 1e-3).ok_or_else(|| {
        Refusal::new(
            "entry and target are less than 1 mm apart",
            "click the entry on the skin",
        )
    })?;
    let placed = case.desk().scenario().phantom.as_ref();
    let placed =
        placed.ok_or_else(|| Refusal::new("there is no patient", "build the folder again"))?;
    let leaves = placed.phantom.skin_intersection(&target, &outwards);
    let Some((_, leaves_m)) = leaves else {
        return Err(Refusal::new(
            "the line from the target through the entry does not meet the skin",
            "the volume may end there: choose another direction",
        ));
    };
    let entry = target + outwards.into_inner() * leaves_m;
    section.entry_mm = Some((entry.coords * 1e3).into());
    let goal = placer.place(&section).map_err(Refusal::from);
    Ok(Needle {
        entry_m: case.in_ct(&entry),
        target_m: case.in_ct(&target),
        entry_moved_m: leaves_m - (towards - target).norm(),
        goal,
        section,
    })
}

impl Aim {
    /// What it is for.
    pub(crate) fn goal_aim(&self) -> GoalAim {
        GoalAim {
            goal: self.goal.clone(),
            target: self.target.clone(),
        }
    }
}

impl GoalAim {
    /// The goal, with its target and without an entry.
    ///
    /// # Errors
    /// A target that is no place.
    pub(crate) fn section(&self, case: &Case) -> Result<GoalSection, Refusal> {
        let target = match &self.target {
            TargetAim::Lesion(name) => Target::Lesion(name.clone()),
            TargetAim::PlaceM(place) => Target::Point(phantom_mm(case, &finite(place)?)),
            TargetAim::Index(index) => {
                let place = case.grid().ct_from_index(&finite(index)?);
                Target::Point(phantom_mm(case, &place))
            }
        };
        let mut section = GoalSection::at(target);
        let named = self.goal.as_ref();
        let own = named.and_then(|name| case.goals().iter().find(|goal| goal.name == *name));
        if let Some(own) = own.or(case.goals().first()) {
            section.name.clone_from(&own.name);
            if own.flange_pose.is_none() {
                section.standoff_mm = own.standoff_mm;
                section.approach_mm = own.approach_mm;
                section.roll_deg = own.roll_deg;
            }
        }
        Ok(section)
    }
}

fn phantom_mm(case: &Case, ct_m: &Point3<f64>) -> [f64; 3] {
    (case.in_phantom(ct_m).coords * 1e3).into()
}

fn finite(numbers: &[f64; 3]) -> Result<Point3<f64>, Refusal> {
    /// Beyond what any volume has, m or voxels.
    const FAR: f64 = 1e5;
    if numbers.iter().all(|number| number.abs() < FAR) {
        Ok(Point3::from(*numbers))
    } else {
        Err(Refusal {
            message: "a position requires three finite numbers".to_owned(),
            hint: None,
        })
    }
}

/// A target that is not in the patient, in words of the page.
fn outside(finding: Finding) -> Refusal {
    Refusal {
        message: finding.message,
        hint: Some("choose a lesion, or click a target inside the body".to_owned()),
    }
}

/// What is known of a needle at once.
///
/// # Errors
/// As [`needle`].
pub fn route(case: &Case, aim: &Aim) -> Result<RouteAnswer, Refusal> {
    let needle = needle(case, aim)?;
    let resolved = case.desk().scenario();
    let grid = case.grid();
    let placed = resolved.phantom.as_ref().expect("a needle has a patient");
    let inwards = UnitVector3::new_normalize(needle.target_m - needle.entry_m);
    let length_m = (needle.target_m - needle.entry_m).norm();
    let crossings = crossings(case, &needle.entry_m, &needle.target_m);
    let knows_lungs = case.labels().names.iter().any(|(_, name)| is_lung(name));
    let in_lung: Vec<bool> = crossings
        .iter()
        .map(|each| belongs_to_lung(case, &each.name))
        .collect();
    let lung_m = crossings
        .iter()
        .zip(&in_lung)
        .filter(|(_, lung)| **lung)
        .map(|(each, _)| each.to_m - each.from_m)
        .sum();
    let entries = (0..in_lung.len())
        .filter(|&at| in_lung[at] && (at == 0 || !in_lung[at - 1]))
        .count();
    let goal = needle.goal.as_ref().ok();
    let judged = goal.map(|goal| judged_tissues(resolved, placed, goal));
    let tissues: Vec<TissueAnswer> = judged
        .into_iter()
        .flatten()
        .map(|judged| {
            let part = judged.nearest.part;
            TissueAnswer {
                tissue: part.tissue.to_string(),
                part: part.name.clone(),
                words: part_in_words(&part.name).into_owned(),
                distance_m: judged.distance_m,
                margin_m: judged.margin_m,
                kept: judged.is_kept(),
                is_bent: judged.nearest.is_bent,
                surface_p99_m: surface_p99_m(case, &part.name),
            }
        })
        .collect();
    let by_rules = case.last_target().judged(
        &needle.section.name,
        &case.in_phantom(&needle.target_m),
        &-inwards,
    );
    Ok(RouteAnswer {
        refusal: refusal(&tissues, by_rules.as_ref()),
        entry_m: needle.entry_m.coords.into(),
        entry_index: grid.index_from_ct(&needle.entry_m).coords.into(),
        target_m: needle.target_m.coords.into(),
        target_index: grid.index_from_ct(&needle.target_m).coords.into(),
        entry_moved_m: needle.entry_moved_m,
        length_m,
        bend: goal.and_then(|goal| bend(resolved, placed, goal)),
        insertion_m: goal.map(|goal| goal.insertion_length_m),
        not_placed: needle.goal.as_ref().err().cloned(),
        needle_m: resolved.cell.tool.needle.length_m,
        skin_angle_rad: body_normal(case.labels(), &needle.entry_m).angle(&-inwards.into_inner()),
        axial_angle_rad: libm::atan2(inwards.z, libm::hypot(inwards.x, inwards.y)),
        crossing_within_m: half_voxel_m(grid, &inwards),
        crossings,
        in_lung_m: knows_lungs.then_some(lung_m),
        lung_entries: knows_lungs.then_some(entries),
        tissues,
        fissures: goal
            .map(|goal| crossed_fissures(resolved, goal))
            .unwrap_or_default(),
        judged: by_rules,
    })
}

fn bend(resolved: &ResolvedScenario, placed: &PlacedPhantom, goal: &Goal) -> Option<BendAnswer> {
    let needle = resolved.expected.as_ref()?.imperfections.tissue()?;
    let path = goal.needle_path.as_ref()?;
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    let inserted = needle.insert_median(path, stand_off_m).ok()?;
    let (tip_m, along_axis_m) = (inserted.tip_m()[0], bends_along_m(&inserted));
    let Some(towards) = needle.pushed_towards(path) else {
        return Some(BendAnswer {
            path_m: along_axis_m,
            tip_m,
            is_aimed: false,
            towards: None,
            is_force_measured: needle.is_force_measured,
        });
    };
    // Off the line from entry to target, which the axis of an aimed needle leaves at the skin.
    let entry = goal.entry_m?;
    let line = UnitVector3::new_normalize(goal.target_m - entry);
    let across = goal.world_from_guide_exit.rotation * Vector3::new(towards[0], towards[1], 0.0);
    let across = UnitVector3::new_normalize(across - line.into_inner() * line.dot(&across));
    let points = goal.bent_line(&along_axis_m, towards).into_iter();
    let path_m = points.map(|point| {
        let from_entry = point - entry;
        [from_entry.dot(&line), from_entry.dot(&across)]
    });
    // `ct` has the axes of the phantom.
    let to_ct = placed.world_from_phantom.rotation.inverse();
    Some(BendAnswer {
        path_m: path_m.collect(),
        tip_m,
        is_aimed: needle.is_aimed,
        towards: Some((to_ct * across.into_inner()).into()),
        is_force_measured: needle.is_force_measured,
    })
}

/// The tissue whose margin is violated most, or else the path rule that is violated.
fn refusal(tissues: &[TissueAnswer], judged: Option<&Judged>) -> Option<String> {
    let missed_m = |each: &TissueAnswer| each.distance_m - each.margin_m;
    let refused = tissues.iter().filter(|each| !each.kept);
    if let Some(TissueAnswer {
        tissue,
        words,
        distance_m,
        margin_m,
        ..
    }) = refused.min_by(|a, b| missed_m(a).total_cmp(&missed_m(b)))
    {
        let [mm, required_mm] = [distance_m, margin_m].map(|metres| 1e3 * metres);
        return Some(if mm < 0.0 {
            format!("penetration {:.1} mm into {words} ({tissue})", -mm)
        } else {
            format!("clearance {mm:.1} mm to {words} ({tissue}), {required_mm:.1} mm required")
        });
    }
    let judged = judged?;
    let broken = judged.broken?;
    let bent = judged.bent.iter().map(|bent| format!(", {bent}"));
    Some(format!("path rule: {broken}{}", bent.collect::<String>()))
}

fn surface_p99_m(case: &Case, part: &str) -> Option<f64> {
    // Solids of one surface are numbered: `bone.3`.
    let name = part.split_once('.').map_or(part, |(name, _)| name);
    let surfaces = &case.built().facts().surfaces;
    let surface = surfaces.iter().find(|surface| surface.name == name)?;
    Some(surface.distance_from_voxels.p99_m)
}

fn is_lung(name: &str) -> bool {
    structure_of(name).is_some_and(|structure| structure.tissue == SurfaceTissue::Lung)
}

/// The lung itself, and what is labelled within it: its vessels, airways and lesions.
fn belongs_to_lung(case: &Case, name: &str) -> bool {
    let is_lesion = case
        .built()
        .facts()
        .lesions
        .iter()
        .any(|lesion| lesion.name == name && lesion.in_lung);
    is_lung(name) || is_lesion || matches!(name, "lung_vessels" | "airways")
}

/// Half of what a voxel spans along a direction.
fn half_voxel_m(grid: &VoxelGrid, along: &UnitVector3<f64>) -> f64 {
    let spacing_m = grid.spacing_m();
    let reach = (0..3).map(|axis| spacing_m[axis] / along[axis].abs().max(1e-12));
    0.5 * reach.fold(f64::INFINITY, f64::min)
}

/// Stretches of a line by label, voxel by voxel, from its start; what is outside of everything counts as none.
fn crossings(case: &Case, from_m: &Point3<f64>, to_m: &Point3<f64>) -> Vec<Crossing> {
    let grid = case.grid();
    let [from, to] = [from_m, to_m].map(|place| grid.index_from_ct(place));
    let along = to - from;
    let length_m = (to_m - from_m).norm();
    let mut stops = vec![0.0, 1.0];
    for axis in 0..3 {
        let [low, high] = [from[axis].min(to[axis]), from[axis].max(to[axis])];
        let mut wall = (low - 0.5).ceil() + 0.5;
        while wall < high {
            stops.push((wall - from[axis]) / along[axis]);
            wall += 1.0;
        }
    }
    stops.retain(|stop| (0.0..=1.0).contains(stop));
    stops.sort_by(f64::total_cmp);
    let mut found: Vec<(u16, Crossing)> = Vec::new();
    for pair in stops.windows(2) {
        let middle = from + along * (0.5 * (pair[0] + pair[1]));
        let label = case
            .nearest_voxel(&middle)
            .map_or(0, |offset| case.labels().labels[offset]);
        match found.last_mut() {
            Some((last, crossing)) if *last == label => crossing.to_m = pair[1] * length_m,
            _ => found.push((
                label,
                Crossing {
                    name: case.label_name(label).unwrap_or_default(),
                    from_m: pair[0] * length_m,
                    to_m: pair[1] * length_m,
                },
            )),
        }
    }
    let named = found.into_iter().filter(|(label, _)| *label != 0);
    named.map(|(_, crossing)| crossing).collect()
}

/// Which of the eight configurations are feasible for a needle, by their postures; `quick` checks few roll angles.
/// The same on any number of threads.
///
/// # Errors
/// As [`needle`].
pub fn reach(case: &Case, aim: &Aim, quick: bool, threads: usize) -> Result<ReachAnswer, Refusal> {
    if let Some(unknown) = case.built().not_registered() {
        return Ok(ReachAnswer {
            unknown: Some(unknown),
            quick,
            preview: None,
            reasons: Vec::new(),
        });
    }
    let goal = needle(case, aim)?.goal?;
    let preview = if quick {
        case.desk().quick_preview(&goal, threads)
    } else {
        case.desk().preview(&goal, threads)
    };
    let preview = preview.map_err(|error| Refusal {
        message: error.to_string(),
        hint: None,
    })?;
    let reasons = preview.configurations.iter();
    let reasons = reasons.map(|each| match each.reason() {
        "" => String::new(),
        reason => reason_in_words(reason),
    });
    Ok(ReachAnswer {
        unknown: None,
        quick,
        reasons: reasons.collect(),
        preview: Some(preview),
    })
}
