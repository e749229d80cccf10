//! The needles of a scenario in the coordinates of the scan that its patient was built from.

use std::path::Path;

use nalgebra::{Point3, Vector3};
use needlebench_input::Finding;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::Scenario;

use super::built_folder::{BUILD, check_patient, read_facts};
use crate::stop::Stop;

/// The needles of a scenario, in `ct`: the patient coordinates of its scan (LPS), wherever the patient lies, in the room
/// or by a registration.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanNeedles {
    /// SHA-256 of the `report.json` that the scenario's patient is of.
    pub report_sha256: String,
    /// Columns, rows, slices of the scan, along the patient's axes.
    pub size: [usize; 3],
    /// Distance of its voxels along x, y, z, m.
    pub spacing_m: [f64; 3],
    /// One for each goal, in their order.
    pub needles: Vec<ScanNeedle>,
}

/// A planned needle in `ct`, m.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanNeedle {
    /// Name of the goal.
    pub goal: String,
    /// Where it enters the skin.
    pub entry_m: Point3<f64>,
    /// The target.
    pub target_m: Point3<f64>,
    /// Where the tip ends: the target, unless `insertion_length_mm` says otherwise.
    pub tip_m: Point3<f64>,
}

impl ScanNeedles {
    /// Those of a scenario whose file is in `folder`.
    ///
    /// # Errors
    /// A patient that was not built from a scan, or is not where the build has it; a report that cannot be read; a goal
    /// that is not given by entry and target, whose place in the patient depends on where the patient lies.
    pub fn of(resolved: &ResolvedScenario, folder: &Path) -> Result<Self, Stop> {
        let (scenario, file) = (&resolved.scenario, &resolved.source.file);
        let build = scenario.phantom.as_ref().and_then(|it| it.build.as_ref());
        let (Some(build), Some(placed)) = (build, &resolved.phantom) else {
            return Err(no_scan(file, scenario).into());
        };
        let path = folder.join(&build.report);
        let facts = read_facts(&path).map_err(|error| Stop::of_scan(&path, error.hint(BUILD)))?;
        check_patient(&facts, file, scenario)?;
        let ct_from_phantom_m = Vector3::from(facts.phantom_origin_m);
        let phantom_from_world = placed.world_from_phantom.inverse();
        let in_ct = |world_m: Point3<f64>| phantom_from_world * world_m + ct_from_phantom_m;
        let sections = scenario.goals.iter();
        let needles = resolved.goals.iter().zip(sections).enumerate();
        let needles = needles.map(|(index, (goal, section))| {
            let by_points = section.flange_pose.is_none();
            let Some(entry_m) = goal.entry_m.filter(|_| by_points) else {
                return Err(of_flange(file, index, &goal.name));
            };
            let tip = Point3::new(0.0, 0.0, goal.insertion_length_m);
            Ok(ScanNeedle {
                goal: goal.name.clone(),
                entry_m: in_ct(entry_m),
                target_m: in_ct(goal.target_m),
                tip_m: in_ct(goal.world_from_guide_exit * tip),
            })
        });
        let needles: Vec<_> = needles.collect::<Result<_, Finding>>()?;
        if needles.is_empty() {
            let finding = Finding::new(file, "the scenario has no goal, so no needle");
            let finding = finding.key("goals");
            return Err(finding
                .hint("`needlebench ct routes` finds needle paths")
                .into());
        }
        Ok(Self {
            report_sha256: build.sha256.clone(),
            size: facts.size,
            spacing_m: facts.spacing_m,
            needles,
        })
    }
}

/// There are no coordinates of a scan.
fn no_scan(file: &str, scenario: &Scenario) -> Finding {
    let hint = if scenario.ct.is_some() {
        format!(
            "`needlebench run` scans the phantom: export out/{}/ct/scenario.toml, the patient that it builds",
            scenario.name
        )
    } else {
        "build the patient with `needlebench ct build SCAN --out DIR`, and export a scenario of that folder".to_owned()
    };
    let message = "the patient is not built from a scan, so there are no scan coordinates";
    Finding::new(file, message).key("phantom.build").hint(hint)
}

fn of_flange(file: &str, index: usize, goal: &str) -> Finding {
    let message = format!(
        "goal `{goal}` is a pose of the flange: where it is in the scan depends on where the patient lies"
    );
    Finding::new(file, message)
        .key(format!("goals[{index}].flange_pose"))
        .hint("give the needle in the patient: a target with `entry_mm` or `entry_direction_deg`")
}
