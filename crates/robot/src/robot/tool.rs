//! Needle guides, from URDF with the extension element `<needle_guide .../>`.

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_cell::{Needle, Tool, UnseenPart};
use needlebench_input::{Finding, Location, PackagePaths, source_of};
use needlebench_kinematics::{Body, Pose};

use super::parametric::GuidePlace;
use super::urdf::{JointKind, Urdf};
use super::{read_solids, read_urdf, read_visuals, rename_unique, visual_of};
use crate::LoadedTool;

/// Agreement that is asked of numbers which a tool's URDF states twice.
const STATED_TWICE_M: f64 = 1e-6;

/// Grey of surfaces without a colour.
const DEFAULT_COLOR: [f32; 4] = [0.6, 0.62, 0.66, 1.0];

/// Parameters of the needle guide that a scenario may override.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ToolOverrides {
    /// Angle about the flange axis at which the tool is bolted on.
    pub mount_rotation_rad: f64,
    /// Diameter of the bore, m.
    pub bore_m: Option<f64>,
    /// Gauge of the needle.
    pub needle_gauge: Option<u32>,
    /// Outer diameter of the needle, m.
    pub needle_outer_diameter_m: Option<f64>,
    /// Length of the needle from hub to tip, m.
    pub needle_length_m: Option<f64>,
    /// Of the tool `parametric`.
    pub guide: Option<GuidePlace>,
}

/// Reads a tool; its root link is put on the flange.
pub fn read_tool(
    location: &Location,
    packages: &PackagePaths,
    overrides: &ToolOverrides,
    notes: &mut Vec<String>,
) -> Result<LoadedTool, Finding> {
    let urdf = match overrides.guide {
        Some(guide) => Urdf::parse(&location.display(), guide.urdf().as_bytes())?,
        None => read_urdf(location)?,
    };
    notes.extend(urdf.notes.iter().cloned());
    let guide = urdf.needle_guide.ok_or_else(|| {
        Finding::new(&urdf.file, "it has no <needle_guide> element").hint(
            "add <needle_guide bore_mm=\"1.40\" guide_length_mm=\"50\" needle_gauge=\"18\" \
             needle_od_mm=\"1.270\" needle_length_mm=\"150\"/> below <robot>",
        )
    })?;
    if let Some(joint) = urdf
        .joints
        .iter()
        .find(|joint| joint.kind != JointKind::Fixed)
    {
        return Err(urdf.finding(
            &joint.span,
            format!(
                "joint '{}' moves; a needle guide has fixed joints only",
                joint.name
            ),
        ));
    }
    let root = urdf
        .links
        .iter()
        .find(|link| urdf.joint_above(&link.name).is_none())
        .expect("a parsed URDF has one root");
    let flange_from_root = Pose::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), overrides.mount_rotation_rad),
    );
    let flange_from = |link: &str| -> Pose {
        urdf.joints_between(&root.name, link)
            .into_iter()
            .flatten()
            .fold(flange_from_root, |pose, joint| {
                pose * joint.parent_from_joint
            })
    };
    let frame = |link: &str| {
        urdf.link(link).map(|_| flange_from(link)).ok_or_else(|| {
            Finding::new(&urdf.file, format!("it has no link '{link}'"))
                .key(format!("link '{link}'"))
                .hint("a needle guide needs the frames guide_entry, guide_exit and needle_tip, z in the insertion direction")
        })
    };
    let entry = frame("guide_entry")?;
    let exit = frame("guide_exit")?;
    let tip = frame("needle_tip")?;
    check_axis(
        &urdf,
        &entry,
        &exit,
        "guide_exit",
        guide.guide_length_mm * 1e-3,
    )?;
    check_axis(
        &urdf,
        &entry,
        &tip,
        "needle_tip",
        guide.needle_length_mm * 1e-3,
    )?;

    let mut body = Body::massless();
    let (mut solids, mut guide_solids, mut visuals) = (Vec::new(), Vec::new(), Vec::new());
    let mut unseen = Vec::new();
    for link in &urdf.links {
        let pose = flange_from(&link.name);
        body = body.combined_with(&link.inertial.unwrap_or(Body::massless()).transformed(&pose));
        let read = read_solids(&urdf, location, packages, link, &pose, notes)?;
        let is_there = !link.visuals.is_empty() || link.inertial.is_some();
        if is_there && read.is_empty() && link.name != "guide_tube" {
            unseen.push(UnseenPart {
                name: link.name.clone(),
                owner: None,
            });
        }
        if link.name == "guide_tube" {
            &mut guide_solids
        } else {
            &mut solids
        }
        .extend(read);
        visuals.extend(read_visuals(&urdf, location, packages, link, &pose, notes));
    }
    if body.mass_kg <= 0.0 {
        return Err(Finding::new(&urdf.file, "the tool has no mass")
            .hint("give one of its links an <inertial>"));
    }
    if guide_solids.is_empty() {
        return Err(Finding::new(
            &urdf.file,
            "it has no link 'guide_tube' with collision geometry",
        )
        .key("link 'guide_tube'")
        .hint("the guide tube's stand-off from the skin is reported separately"));
    }
    rename_unique(&mut solids, "tool");
    rename_unique(&mut guide_solids, "guide_tube");
    if visuals.is_empty() {
        visuals = solids
            .iter()
            .chain(&guide_solids)
            .map(|solid| visual_of(solid, DEFAULT_COLOR))
            .collect();
    }
    let needle = Needle {
        gauge: overrides.needle_gauge.unwrap_or(guide.needle_gauge),
        outer_diameter_m: overrides
            .needle_outer_diameter_m
            .unwrap_or(guide.needle_od_mm * 1e-3),
        length_m: overrides
            .needle_length_m
            .unwrap_or(guide.needle_length_mm * 1e-3),
    };
    let bore_m = overrides.bore_m.unwrap_or(guide.bore_mm * 1e-3);
    if bore_m <= needle.outer_diameter_m {
        return Err(Finding::new(
            &urdf.file,
            format!(
                "a needle of {:.3} mm does not fit a bore of {:.3} mm",
                needle.outer_diameter_m * 1e3,
                bore_m * 1e3
            ),
        )
        .key("bore_mm")
        .hint("use a wider bore or a thinner needle (a larger gauge)"));
    }
    let tool = Tool {
        name: urdf
            .name
            .strip_prefix("needle_guide_")
            .unwrap_or(&urdf.name)
            .to_owned(),
        solids,
        guide_solids,
        unseen,
        visuals,
        body,
        flange_from_guide_entry: entry,
        flange_from_guide_exit: exit,
        bore_m,
        needle,
    };
    let source = source_of(location.display(), urdf.text.as_bytes());
    Ok(LoadedTool { tool, source })
}

/// `frame` has to lie `length_m` ahead of `entry` on its z axis, and point the same way.
fn check_axis(
    urdf: &Urdf,
    entry: &Pose,
    frame: &Pose,
    name: &str,
    length_m: f64,
) -> Result<(), Finding> {
    let in_entry = entry.inverse() * frame;
    let miss = (in_entry.translation.vector - Vector3::z() * length_m).norm();
    let axis = (in_entry.rotation * Vector3::z() - Vector3::z()).norm();
    if miss <= STATED_TWICE_M && axis <= STATED_TWICE_M {
        return Ok(());
    }
    Err(Finding::new(
        &urdf.file,
        format!(
            "'{name}' is {:.3} mm from the point {:.1} mm ahead of 'guide_entry' on its z axis, \
             and its z axis is off by {axis:.1e}",
            miss * 1e3,
            length_m * 1e3
        ),
    )
    .key(format!("link '{name}'"))
    .hint("<needle_guide> and the frames must state the same lengths"))
}
